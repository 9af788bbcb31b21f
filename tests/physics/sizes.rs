//! Spheres of unequal sizes: against another program, what they must keep, and that nothing depends on how
//! they are numbered.

use crate::common::{Case, Run, assert_near, root};
use demhybrid::domain::Solo;
use demhybrid::engine::simulation::Simulation;
use demhybrid::files::load::load;
use demhybrid::math::vector::Vec3;
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::{InitialCondition, column, read_csv};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Largest deviation of the end state of a case of tests/data/reference (m, m/s, rad/s) from DOP853 of SciPy
/// (tests/data/reference/unequal.py), which knows neither spins s = r w nor the memory p.
fn deviation(name: &str) -> f64 {
    let folder = root().join("tests/data/reference");
    let (mut scene, start) = load(&folder.join(format!("{name}.toml")), &[], &Solo).unwrap();
    let end = crate::common::run(&scene, &start).unwrap();
    scene.particles.file = Some(format!("{name}.end.csv").into());
    let exact = read_csv(&scene, &folder).unwrap();
    let end = end.end();
    let pairs = [(&end.x, &exact.x), (&end.v, &exact.v), (&end.omega, &exact.omega)];
    let off = pairs.iter().flat_map(|(found, exact)| {
        assert_eq!(found.len(), exact.len());
        found.iter().zip(*exact).map(|(found, exact)| (found - Vec3::from(*exact)).amax())
    });
    off.fold(0.0, f64::max)
}

#[test]
fn unequal_pairs_and_six_sizes_in_a_box_end_where_another_program_does() {
    for name in ["unequal_pair_paper", "unequal_pair_memory", "unequal_six_paper", "unequal_six_memory"] {
        let off = deviation(name);
        println!("{name}: {off:.1e}");
        assert!(off < 1e-8, "{name}: {off:e}");
    }
}

/// Radii (m) and masses (kg) for the particles of a case.
fn with_sizes(case: &Case, radii: &[f64], masses: &[f64]) -> (Scene, InitialCondition) {
    let (mut scene, mut start) = case.build();
    start.columns.push((column("radius", "m"), radii.to_vec()));
    start.columns.push((column("mass", "kg"), masses.to_vec()));
    start.settle_sizes(&mut scene, None);
    (scene, start)
}

fn run(case: &Case, radii: &[f64], masses: &[f64]) -> Run {
    let (scene, start) = with_sizes(case, radii, masses);
    crate::common::run(&scene, &start).unwrap()
}

#[test]
fn sizes_that_are_all_the_same_are_no_sizes() {
    let case = Case::config("bed.toml").set("t_end", 0.4);
    let (scene, start) = case.build();
    let count = start.x.len();
    let (r, m) = (scene.particles.radius, scene.particles.mass);
    let (alike, same) = with_sizes(&case, &vec![r; count], &vec![m; count]);
    assert_eq!(alike, scene);
    assert_eq!(same, start);
}

#[test]
fn elastic_spheres_of_unequal_masses_exchange_their_momenta() {
    // e = 1, head-on: v_i' = ((m_i - m_j) v_i + 2 m_j v_j)/(m_i + m_j), whatever the radii are.
    let case = Case::tight()
        .set("contact.restitution", 1.0)
        .set("contact.stiffness_exponent", 1500.0)
        .set("contact.interaction_distance", 0.02)
        .sphere(Vec3::zeros(), Vec3::x())
        .sphere(Vec3::x() * 0.5, Vec3::x() * -0.5);
    let (masses, v) = ([1.0, 5.0], [1.0, -0.5]);
    let end = run(&case, &[0.1, 0.3], &masses);
    let total = masses[0] + masses[1];
    for (i, j) in [(0, 1), (1, 0)] {
        let after = ((masses[i] - masses[j]) * v[i] + 2.0 * masses[j] * v[j]) / total;
        assert_near("speed after the collision, m/s", end.end().v[i].x, after, 1e-6);
    }
}

#[test]
fn a_small_sphere_rests_on_a_large_one_as_deep_as_its_own_weight_presses_it() {
    // One stands above the other on a floor, without friction.
    let case = Case::defaults().heavy().floor().set("t_end", 8.0);
    let (radii, masses) = ([0.2, 0.05], [8.0, 0.125]);
    let case = case.sphere(Vec3::z() * 0.2, Vec3::zeros()).sphere(Vec3::z() * 0.45, Vec3::zeros());
    let end = run(&case, &radii, &masses);
    // rho(0) F_0 exp(-kappa l) = weight above.
    let gap = |weight: f64| -(weight / (0.58 * 10.0)).ln() / 150.0;
    let large = radii[0] + gap(9.81 * (masses[0] + masses[1]));
    let small = large + radii[0] + radii[1] + gap(9.81 * masses[1]);
    assert_near("height of the large sphere, m", end.end().x[0].z, large, 1e-4);
    assert_near("height of the small sphere, m", end.end().x[1].z, small, 1e-4);
}

#[test]
fn the_largest_share_that_is_pressed_in_is_that_of_the_sphere_which_it_is_in() {
    // One above the other: the floor and the upper sphere press the lower one in.
    let share = |radii: [f64; 2], masses: [f64; 2]| {
        let [low, high] = [radii[0], 2.0 * radii[0] + radii[1]].map(|z| Vec3::z() * z);
        let case = Case::defaults().heavy().floor().set("t_end", 0.5);
        let overlap = run(&case.sphere(low, Vec3::zeros()).sphere(high, Vec3::zeros()), &radii, &masses);
        overlap.outcome.largest_overlap
    };
    let crushed = share([0.05, 0.2], [0.125, 8.0]);
    assert!(crushed.length > 0.017, "{crushed:?}"); // ln(m g/(rho(0) F_0))/kappa at rest, m
    assert_near("share of the small sphere", crushed.share, crushed.length / 0.05, 1e-12);
    // The same weight presses the large one in by as much, which is less of it.
    let borne = share([0.2, 0.05], [8.0, 0.125]);
    assert_near("share of the large sphere", borne.share, borne.length / 0.2, 1e-12);
}

/// A cluster of spheres that meet in free space, with friction of either kind.
fn cluster(bodies: &[([f64; 3], [f64; 3], [f64; 3])], memory: bool) -> Case {
    let case = Case::tight().set("contact.interaction_distance", 0.3).set("t_end", 0.15);
    let case = case.set("solver.method", "dormand-prince").set("solver.norm", "scaled");
    let case = case.set("solver.tolerance", 1e-9).set("output.interval", 0.01);
    let case = if memory {
        case.set("friction.law", "history")
            .set("friction.coefficient", 0.3)
            .set("friction.rolling.coefficient", 0.05)
            .set("friction.twisting.coefficient", 0.05)
    } else {
        case.rough(true)
    };
    bodies.iter().fold(case, |case, (x, v, w)| case.spinning_sphere((*x).into(), (*v).into(), (*w).into()))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 12,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn momentum_stays_energy_never_rises_and_numbers_do_not_matter(
        logs in proptest::collection::vec(-1.0..1.0f64, 4),
        densities in proptest::collection::vec(0.5..2.0f64, 4),
        speeds in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 8),
        memory in any::<bool>(),
    ) {
        // Radii from 0.04 to 0.22 m, centres at the corners of a tetrahedron where all nearly touch the
        // first.
        let radii: Vec<f64> = logs.iter().map(|log| 0.094 * f64::exp(0.85 * log)).collect();
        let masses: Vec<f64> = radii.iter().zip(&densities).map(|(r, d)| 1000.0 * d * r.powi(3)).collect();
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [-0.6, 0.8, 0.0], [0.0, -0.6, 0.8]];
        let bodies: Vec<_> = (0..4)
            .map(|k| {
                let way = if k == 0 { 0.0 } else { radii[0] + radii[k] + 0.02 };
                let v = std::array::from_fn(|c| 0.5 * speeds[k][c] - 1.5 * corners[k][c]);
                (corners[k].map(|x| way * x), v, speeds[4 + k].map(|w| 5.0 * w))
            })
            .collect();
        let found = run(&cluster(&bodies, memory), &radii, &masses);
        let momenta = |k: usize| {
            let frame = &found.frames[k];
            let linear = |i: usize| frame.v[i] * masses[i];
            let spin = |i: usize| frame.omega[i] * (0.4 * masses[i] * radii[i] * radii[i]);
            let angular = |i: usize| frame.x[i].cross(&linear(i)) + spin(i);
            ((0..4).map(linear).sum::<Vec3>(), (0..4).map(angular).sum::<Vec3>())
        };
        let (start, last) = (momenta(0), momenta(found.frames.len() - 1));
        let scale = masses.iter().sum::<f64>();
        prop_assert!((start.0 - last.0).norm() < 1e-12 * scale, "{}", (start.0 - last.0).norm() / scale);
        // The paper's law has levers r while centres are further apart than 2 r.
        if memory {
            prop_assert!((start.1 - last.1).norm() < 1e-8 * scale, "{}", (start.1 - last.1).norm() / scale);
        }
        let energies: Vec<f64> = found.frames.iter().map(|frame| frame.energy()).collect();
        let rise = energies.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        prop_assert!(rise < 1e-7 * energies[0], "{rise:e} of {:e}", energies[0]);
        // The same spheres, numbered otherwise.
        let order = [2, 0, 3, 1];
        let pick = |numbers: &[f64]| order.map(|k| numbers[k]);
        let renumbered = order.map(|k| bodies[k]);
        let other = run(&cluster(&renumbered, memory), &pick(&radii), &pick(&masses));
        for (k, &i) in order.iter().enumerate() {
            prop_assert!((other.end().x[k] - found.end().x[i]).norm() < 1e-7);
        }
    }
}

#[test]
fn a_start_that_is_impossible_is_refused_with_the_particle_and_the_column() {
    let (mut scene, start) = Case::config("quick.toml").build();
    let count = start.x.len();
    let refusal = |columns: Vec<(&str, Vec<f64>)>, scene: &mut Scene| {
        let columns = columns.into_iter().map(|(name, numbers)| (column(name, "m"), numbers)).collect();
        let start = InitialCondition { columns, ..start.clone() };
        Simulation::new(scene, &start, &Solo).err().map(|why| why.to_string()).unwrap_or_default()
    };
    let only = refusal(vec![("radius", vec![0.1; count])], &mut scene);
    assert!(only.contains("columns of radii and of masses go together"), "{only}");
    let mut radii = vec![0.1; count];
    radii[3] = 0.0;
    let none = refusal(vec![("radius", radii.clone()), ("mass", vec![1.0; count])], &mut scene);
    assert!(none.contains("particle 3 has the radius 0"), "{none}");
    radii[3] = 1e4;
    let wide = refusal(vec![("radius", radii), ("mass", vec![1.0; count])], &mut scene);
    assert!(wide.contains("radii reach from 0.1 m to 10000 m"), "{wide}");
}
