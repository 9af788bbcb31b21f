//! Materials: every contact has the coefficients of its two bodies, on walls and between spheres.

use crate::common::{Case, Run, assert_near};
use demhybrid::domain::Solo;
use demhybrid::engine::kernel::kernel;
use demhybrid::engine::simulation::Simulation;
use demhybrid::math::instructions::InstructionSet;
use demhybrid::math::vector::Vec3;
use demhybrid::model::columns::{spin, velocity};
use demhybrid::model::contact::LawParameters;
use demhybrid::model::effects::Effects;
use demhybrid::ode::Ivp;
use demhybrid::scene::initial_condition::{InitialCondition, column};
use demhybrid::scene::{Scene, effects};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const G: f64 = 9.81;

/// The case with these materials for its spheres: numbers in the scene.
fn built(case: &Case, materials: &[usize]) -> (Scene, InitialCondition) {
    let (scene, mut start) = case.build();
    if !materials.is_empty() {
        let numbers = materials.iter().map(|&number| number as f64).collect();
        start.columns.push((column("material", "1"), numbers));
    }
    (scene, start)
}

fn run(case: &Case, materials: &[usize]) -> Run {
    let (scene, start) = built(case, materials);
    crate::common::run(&scene, &start).unwrap()
}

/// Gap at which a contact with the restitution `e` carries `weight` (N) at rest, m.
fn gap_under(weight: f64, e: f64) -> f64 {
    -(weight / (0.5 * (1.0 + e * e) * F_0)).ln() / KAPPA
}

/// By slope and by sphere: acceleration down the slope (m/s^2), and speed at the end (m/s).
type Slid = [[[f64; 2]; 2]; 2];

/// Two slopes with the tangent `slope` that face each other, the left one of "ice" and the right one of
/// "felt". A sphere of each material stands on each slope and cannot turn. `pair` is what holds between ice
/// and felt, in place of the mixing rule.
fn on_two_slopes(slope: f64, pair: &str) -> Slid {
    let cos = 1.0 / (1.0 + slope * slope).sqrt();
    let sin = slope * cos;
    let felt = format!("{{ name = 'felt', friction = 0.6, restitution = 0.5{pair} }}");
    let walls = format!(
        "[{{ normal = [{}, 0, {}], material = 'ice' }}, {{ normal = [{sin}, 0, {}], material = 'felt' }}]",
        -sin, -cos, -cos
    );
    let mut case = Case::defaults()
        .heavy()
        .set("t_end", 1.6)
        .set("output.interval", 0.2)
        .set("friction.law", "history")
        .set("friction.coefficient", 0.3)
        .set("friction.rotation", false)
        .set("solver.tolerance", 1e-4)
        .raw(&format!("material=[{{ name = 'ice', friction = 0.2, restitution = 0.9 }}, {felt}]"))
        .raw(&format!("container.wall={walls}"));
    let e = [[0.9, f64::sqrt(0.45)], [f64::sqrt(0.45), 0.5]];
    let mut materials = Vec::new();
    for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
        for (material, e) in e[side].into_iter().enumerate() {
            let (up, inward) = (Vec3::new(sign * cos, 0.0, sin), Vec3::new(-sign * sin, 0.0, cos));
            let lift = R + gap_under(G * cos, e);
            case = case.sphere(8.0 * up + lift * inward + Vec3::y() * material as f64, Vec3::zeros());
            materials.push(material);
        }
    }
    let found = run(&case, &materials);
    let speed = |k: usize, i: usize| found.frames[k].v[i].norm();
    [[0, 1], [2, 3]].map(|pair| pair.map(|i| [(speed(8, i) - speed(4, i)) / 0.8, speed(8, i)]))
}

/// A sphere slides with g (sin - mu cos), or stands.
fn assert_slid(found: Slid, slope: f64, mu: [[f64; 2]; 2]) {
    let cos = 1.0 / (1.0 + slope * slope).sqrt();
    for (side, (found, mu)) in found.iter().zip(mu).enumerate() {
        for (material, (&[acceleration, speed], mu)) in found.iter().zip(mu).enumerate() {
            let exact = G * (slope * cos - mu * cos);
            let what = format!("of material {material} on slope {side}, tan = {slope}");
            // What stands has swung in its elastic shear, and fades.
            match exact > 0.0 {
                true => assert_near(&format!("acceleration {what}, m/s^2"), acceleration, exact, 1e-3),
                false => assert_near(&format!("speed {what}, m/s"), speed, 0.0, 3e-3),
            }
        }
    }
}

#[test]
fn a_sphere_stands_below_the_angle_of_its_pair_with_the_wall_and_slides_above() {
    let mixed = f64::sqrt(0.2 * 0.6);
    let mu = [[0.2, mixed], [mixed, 0.6]];
    for slope in [0.18, 0.3, 0.45, 0.7] {
        assert_slid(on_two_slopes(slope, ""), slope, mu);
    }
}

#[test]
fn what_is_given_for_a_pair_holds_in_place_of_the_mean_on_either_side() {
    let mu = [[0.2, 0.5], [0.5, 0.6]];
    assert_slid(on_two_slopes(0.45, ", pair = [{ with = 'ice', friction = 0.5 }]"), 0.45, mu);
    let mu = [[0.2, 0.0], [0.0, 0.6]];
    assert_slid(on_two_slopes(0.1, ", pair = [{ with = 'ice', friction = 0 }]"), 0.1, mu);
}

/// Fixed steps: what one sphere does leaves the steps of others as they are.
fn fixed() -> Case {
    Case::defaults()
        .heavy()
        .set("solver.method", "velocity-verlet")
        .set("solver.step", 1e-4)
        .set("t_end", 1.5)
        .set("contact.stiffness_exponent", 600.0)
        .set("contact.interaction_distance", 0.05)
}

/// Bits of the centres, velocities and spins of sphere `i` in all frames, without its place on the floor.
fn bits(run: &Run, i: usize) -> Vec<u64> {
    let of = |frame: &crate::common::Snapshot| {
        let (x, v, w) = (frame.x[i], frame.v[i], frame.omega[i]);
        [x.z, v.x, v.y, v.z, w.x, w.y, w.z].map(f64::to_bits)
    };
    run.frames.iter().flat_map(of).collect()
}

#[test]
fn spheres_bounce_with_the_restitution_of_their_pair_to_the_last_bit() {
    let above = |x: f64| Vec3::new(x, 0.0, 0.6);
    let materials = "material=[{ name = 'a', restitution = 1 }, { name = 'b', restitution = 0.5 }]";
    let wall = |material: &str| format!("container.wall=[{{ material = '{material}' }}]");
    // Two spheres on one floor, and one sphere on each of two floors.
    for (floor, of_floor) in [("a", 1.0), ("b", 0.5)] {
        let both = fixed().raw(materials).raw(&wall(floor));
        let both = both.sphere(above(0.0), Vec3::x()).sphere(above(7.0), Vec3::x());
        let both = run(&both, &[0, 1]);
        for (i, own) in [1.0, 0.5].into_iter().enumerate() {
            let e = if own == of_floor { own } else { f64::sqrt(own) * f64::sqrt(of_floor) };
            let alone = fixed().set("contact.restitution", e).floor().sphere(above(0.0), Vec3::x());
            assert_eq!(bits(&both, i), bits(&run(&alone, &[]), 0), "{floor} {i}");
        }
        // They are not the same: the one with more restitution is higher at some time.
        let apart = both.frames.iter().map(|frame| (frame.x[0].z - frame.x[1].z).abs());
        assert!(apart.fold(0.0, f64::max) > 0.05);
    }
}

#[test]
fn what_has_no_friction_is_not_rubbed_at_all_where_others_are() {
    // Beside a sphere that is rubbed one of a material without friction slides and spins on.
    for law in ["history", "regularized"] {
        for resists in [false, true] {
            let rolling = if law == "history" && resists { ", rolling = 0.1, twisting = 0.1" } else { "" };
            let materials = format!(
                "material=[{{ name = 'a', friction = 0 }}, {{ name = 'b', friction = 0.5{rolling} }}]"
            );
            let case = fixed()
                .set("friction.law", law)
                .set("friction.coefficient", 0.3)
                .set("friction.regularization_velocity", 0.01)
                .raw(&materials)
                .raw("container.wall=[{ material = 'b' }]");
            let (v, omega) = (Vec3::new(0.3, 0.1, 0.0), Vec3::new(1.0, -3.0, 2.0));
            let x = |k: f64| Vec3::new(7.0 * k, 0.0, 0.11);
            let case = case.spinning_sphere(x(0.0), v, omega).spinning_sphere(x(1.0), v, omega);
            let found = run(&case, &[0, 1]);
            let (free, rubbed) = (found.end(), found.end());
            assert_eq!([free.v[0].x, free.v[0].y], [0.3, 0.1], "{law}");
            // The spin is that of the start but for the factor r and back.
            assert!((free.omega[0] - omega).norm() < 1e-14, "{law}: {:?}", free.omega[0]);
            assert!((rubbed.omega[1] - omega).norm() > 0.5, "{law}: {:?}", rubbed.omega[1]);
            let bare = fixed().floor().sphere(x(0.0), v);
            let bare = run(&bare, &[]);
            // The law that remembers computes the repulsion from its root: its last digits are others.
            let apart = found.frames.iter().zip(&bare.frames).map(|(a, b)| (a.x[0].z - b.x[0].z).abs());
            let apart = apart.fold(0.0, f64::max);
            assert!(apart <= if law == "history" { 1e-10 } else { 0.0 }, "{law}: {apart:e}");
        }
    }
}

#[test]
fn a_contact_that_remembers_begins_by_the_law_of_its_own_materials() {
    // Two spheres that meet obliquely and a floor that both strike at a slant, all of the second material.
    // The stabilised method takes the first rates of memories from where contacts are found.
    let case = |friction: f64| {
        Case::defaults()
            .heavy()
            .set("t_end", 0.5)
            .set("output.interval", 0.01)
            .set("solver.method", "chebyshev")
            .set("friction.law", "history")
            .set("friction.coefficient", friction)
            .set("friction.rotation", true)
            .spinning_sphere(Vec3::new(0.0, 0.0, 0.3), Vec3::new(1.0, 0.1, -1.0), Vec3::new(1.0, 2.0, 3.0))
            .spinning_sphere(Vec3::new(0.4, 0.05, 0.3), Vec3::new(-1.0, 0.2, -0.8), Vec3::new(0.0, -5.0, 1.0))
    };
    let alone = run(&case(0.5).floor(), &[]);
    // The spheres have met, and rub on the floor.
    assert!(alone.end().omega.iter().all(|omega| (omega - Vec3::new(1.0, 2.0, 3.0)).norm() > 1.0));
    let materials = "material=[{ name = 'a', friction = 0.1 }, { name = 'b', friction = 0.5 }]";
    let both = run(&case(0.1).raw(materials).raw("container.wall=[{ material = 'b' }]"), &[1, 1]);
    assert_eq!(both.bits(), alone.bits());
    let other = run(&case(0.1).raw(materials).raw("container.wall=[{ material = 'a' }]"), &[1, 1]);
    assert_ne!(other.bits(), alone.bits());
}

#[test]
fn materials_with_the_values_of_the_scene_and_one_material_for_all_change_no_bit() {
    let case = Case::config("bed.toml").set("t_end", 1.0).set("output.interval", 0.1);
    let plain = run(&case, &[]);
    let count = plain.frames[0].x.len();
    let (scene, _) = case.build();
    let own = scene.plain_coefficients();
    let (e, mu) = (own.restitution, own.friction);
    // Two materials that say nothing new, one of them for the walls.
    let same = format!("material=[{{ name = 'a' }}, {{ name = 'b', restitution = {e}, friction = {mu} }}]");
    let two = case.clone().raw(&same).raw("container.box.material='b'");
    let materials: Vec<usize> = (0..count).map(|i| i % 3).collect();
    assert_eq!(run(&two, &materials).bits(), plain.bits());
    // One material, whatever [contact] and [friction] say.
    let one = format!("material=[{{ name = 'a', restitution = {e}, friction = {mu} }}]");
    let one = case.raw(&one).raw("container.box.material='a'");
    let one = one.set("contact.restitution", 0.95).set("friction.coefficient", 0.05);
    assert_eq!(run(&one, &vec![0; count]).bits(), plain.bits());
}

/// Three materials with friction of either kind.
const THREE: &str = "[{ name = 'a', restitution = 0.9, friction = 0.1, rolling = 0, twisting = 0.05 },
    { name = 'b', restitution = 0.3, friction = 0.6, rolling = 0.1, pair = [{ with = 'a', friction = 0.9 }] },
    { name = 'c', restitution = 1, friction = 0, rolling = 0.05, pair = [{ with = 'b', twisting = 0.2 }] }]";

fn three(memory: bool) -> String {
    // The paper's friction has no resistance to rolling.
    let plain = ["rolling = 0.05, ", "rolling = 0.1, ", ", rolling = 0, twisting = 0.05", "twisting = 0.2"];
    let replaced = ["", "", "", "friction = 0.2"];
    let text = plain.iter().zip(replaced).fold(THREE.to_owned(), |text, (from, to)| match memory {
        true => text,
        false => text.replace(from, to),
    });
    format!("material={}", text.replace('\n', " "))
}

/// Spheres that meet in free space, of three materials.
fn cluster(bodies: &[([f64; 3], [f64; 3], [f64; 3])], memory: bool) -> Case {
    let case = Case::tight().set("contact.interaction_distance", 0.3).set("t_end", 0.15);
    let case = case.set("solver.method", "dormand-prince").set("solver.norm", "scaled");
    let case = case.set("solver.tolerance", 1e-9).set("output.interval", 0.01).set("output.energy", true);
    let case = if memory {
        case.set("friction.law", "history").set("friction.coefficient", 0.3)
    } else {
        case.rough(true)
    };
    let case = case.raw(&three(memory));
    bodies.iter().fold(case, |case, (x, v, w)| case.spinning_sphere((*x).into(), (*v).into(), (*w).into()))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 8,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn momentum_stays_energy_is_balanced_and_never_rises_and_numbers_do_not_matter(
        speeds in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 10),
        materials in proptest::collection::vec(0..4usize, 5),
        memory in any::<bool>(),
    ) {
        let corners =
            [[0.0; 3], [1.0, 0.0, 0.0], [-0.6, 0.8, 0.0], [0.0, -0.6, 0.8], [0.0, 0.0, -1.0]];
        let bodies: Vec<_> = (0..5)
            .map(|k| {
                let v = std::array::from_fn(|c| 0.5 * speeds[k][c] - 1.5 * corners[k][c]);
                (corners[k].map(|x| 0.22 * x), v, speeds[5 + k].map(|w| 5.0 * w))
            })
            .collect();
        let found = run(&cluster(&bodies, memory), &materials);
        let momenta = |k: usize| {
            let frame = &found.frames[k];
            let angular = |i: usize| frame.x[i].cross(&frame.v[i]) + frame.omega[i] * (0.4 * R * R);
            (frame.v.iter().sum::<Vec3>(), (0..5).map(angular).sum::<Vec3>())
        };
        let (start, last) = (momenta(0), momenta(found.frames.len() - 1));
        prop_assert!((start.0 - last.0).norm() < 1e-11, "{:e}", (start.0 - last.0).norm());
        // The paper's law has levers r while centres are further apart than 2 r.
        if memory {
            prop_assert!((start.1 - last.1).norm() < 1e-7, "{:e}", (start.1 - last.1).norm());
        }
        let energies: Vec<f64> = found.frames.iter().map(|frame| frame.energy()).collect();
        let rise = energies.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        prop_assert!(rise < 1e-7 * energies[0], "{rise:e} of {:e}", energies[0]);
        // What is lost is what contacts dissipate.
        for frame in &found.frames {
            let sum = frame.energy() + frame.dissipated[0] + frame.dissipated[1];
            prop_assert!((sum / energies[0] - 1.0).abs() < 2e-6, "{:e}", sum / energies[0] - 1.0);
        }
        // The same spheres, numbered otherwise.
        let order = [2, 0, 4, 3, 1];
        let renumbered = order.map(|k| bodies[k]);
        let other = run(&cluster(&renumbered, memory), &order.map(|k| materials[k]));
        for (k, &i) in order.iter().enumerate() {
            prop_assert!((other.end().x[k] - found.end().x[i]).norm() < 1e-7);
        }
    }

    #[test]
    fn every_contact_has_the_law_of_its_two_materials(
        places in proptest::collection::vec(proptest::array::uniform3(0.0..0.5f64), 12),
        speeds in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 24),
        materials in proptest::collection::vec(0..4usize, 12),
    ) {
        // Numbers of a, b, c and of what has none, by hand.
        let own = [[0.9, 0.1], [0.3, 0.6], [1.0, 0.0], [0.4, 0.2]];
        let between = |a: usize, b: usize| {
            let mean = [0, 1].map(|k| f64::sqrt(own[a][k] * own[b][k]));
            match [a.min(b), a.max(b)] {
                [0, 1] => [mean[0], 0.9],
                [1, 2] => [mean[0], 0.2],
                _ => mean,
            }
        };
        let wall = "container.wall=[{ material = 'c' }, { normal = [-1, 0, 0] }]";
        let mut case = Case::tight().rough(true).raw(&three(false)).raw(wall);
        for (k, x) in places.iter().enumerate() {
            let x = Vec3::from(*x) + Vec3::repeat(0.05);
            case = case.spinning_sphere(x, speeds[k].into(), Vec3::from(speeds[12 + k]) * 10.0);
        }
        let (scene, start) = built(&case, &materials);
        let mut simulation = Simulation::new(&scene, &start, &Solo).unwrap();
        let y = simulation.state().to_vec();
        let (ids, mut slope) = (simulation.dynamics().ids().to_vec(), y.clone());
        simulation.dynamics_mut().rhs(0.0, &y, &mut slope);
        let law = |a: usize, b: usize| {
            let [e, phi] = between(a, b);
            let law = LawParameters { e, phi, ..effects::law(&scene) };
            kernel(Effects::of(&scene), law, InstructionSet::Baseline)
        };
        let (x, v) = (|i: usize| Vec3::from(start.x[i]), |i: usize| Vec3::from(start.v[i]));
        let s = |i: usize| Vec3::from(start.omega[i]) * R;
        for (id, row) in ids.into_iter().zip(slope.chunks_exact(9)) {
            let i = id as usize;
            let (mut force, mut turning, mut scale) = (Vec3::zeros(), Vec3::zeros(), 0.0);
            for j in (0..12).filter(|&j| j != i) {
                let apart = x(i) - x(j);
                let gap = apart.norm() - 2.0 * R;
                if gap <= 0.2 {
                    let kernel = law(materials[i], materials[j]);
                    let n = apart.normalize();
                    let found = kernel.action(gap, &n, &(v(i) - v(j)), &(s(i) + s(j)));
                    force += found.force;
                    turning += found.turning;
                    scale += found.force.norm();
                }
            }
            for (material, inward, depth) in [(2, Vec3::z(), x(i).z), (3, Vec3::x(), x(i).x)] {
                if depth - R <= 0.2 {
                    let found = law(materials[i], material).action(depth - R, &inward, &v(i), &s(i));
                    force += found.force;
                    turning += found.turning;
                    scale += found.force.norm();
                }
            }
            // The mass is 1 kg, and r^2/I is 5/2 over it. Vector instructions have other last digits.
            let off = (velocity(row) - force).norm();
            prop_assert!(off <= 1e-11 * scale, "{off:e}");
            prop_assert!((spin(row) - 2.5 * turning).norm() <= 1e-11 * scale);
        }
    }
}
