//! Friction with memory: what stands stays, what slides obeys Coulomb, and nothing creates energy.

mod column;
mod driven;
mod energy;
mod slopes;

use crate::common::{Case, Run, assert_near};
use demhybrid::math::vector::Vec3;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const G: f64 = 9.81;
const RHO_0: f64 = 0.58;
const MU: f64 = 0.345;

/// Friction with memory in a case.
fn remembering(case: Case, rotation: bool) -> Case {
    case.set("friction.law", "history").set("friction.coefficient", MU).set("friction.rotation", rotation)
}

/// Gap at which the floor carries `weight` (N), m.
fn gap_under(weight: f64) -> f64 {
    -(weight / (RHO_0 * F_0)).ln() / KAPPA
}

/// One sphere of 1 kg on a slope with the tangent `slope`, seen from it: the floor is z = 0, gravity leans.
fn on_slope(slope: f64, rotation: bool, case: Case) -> Case {
    let cos = 1.0 / (1.0 + slope * slope).sqrt();
    let case = remembering(case, rotation).floor().set("gravity", [G * slope * cos, 0.0, -G * cos]);
    case.set("particles.mass", 1.0).sphere(Vec3::z() * (R + gap_under(G * cos)), Vec3::zeros())
}

#[test]
fn an_oblique_pair_and_a_sliding_sphere_agree_with_another_program() {
    // The reference solves the same equations for the shear x_m p/s, by DOP853 of scipy with rtol 1e-10.
    let case = remembering(Case::tight(), true)
        .set("solver.norm", "scaled")
        .set("solver.method", "dormand-prince")
        .set("solver.tolerance", 1e-10)
        .set("contact.interaction_distance", 0.1)
        .set("particles.mass", 1.0);
    let pair = case
        .clone()
        .set("t_end", 0.35)
        .spinning_sphere(Vec3::zeros(), Vec3::new(0.8, 0.1, 0.0), Vec3::new(3.0, -2.0, 5.0))
        .spinning_sphere(Vec3::new(0.27, 0.11, 0.05), Vec3::new(-1.1, 0.0, 0.2), Vec3::new(0.0, 4.0, -1.0))
        .run();
    let exact = [
        [0.053902602, -0.094553724, -0.069645721],
        [-0.008631315, -0.370242279, -0.256869007],
        [3.40407923, -4.179157476, 7.46649978],
    ];
    let end = pair.end();
    for (found, exact) in [end.x[0], end.v[0], end.omega[0]].iter().zip(exact) {
        assert_near("vector of the first sphere", (found - Vec3::from(exact)).norm(), 0.0, 3e-9);
    }
    let angular = |k: usize| {
        let frame = &pair.frames[k];
        let orbital: Vec3 = frame.x.iter().zip(&frame.v).map(|(x, v)| x.cross(v)).sum();
        orbital + frame.omega.iter().sum::<Vec3>() * (0.4 * R * R)
    };
    let drift = (angular(pair.frames.len() - 1) - angular(0)).norm();
    assert_near("angular momentum of a free pair", drift, 0.0, 1e-9);
    let sliding = case.heavy().floor().set("t_end", 0.8);
    let end = sliding.sphere(Vec3::z() * 0.10012, Vec3::x() * 1.5).run().end().clone();
    assert_near("x of the sphere, m", end.x[0].x, 0.8777384307, 1e-9);
    assert_near("its speed, m/s", end.v[0].x, 1.051836421, 1e-9);
    assert_near("its spin, rad/s", end.omega[0].y, 10.90026921, 1e-8);
}

/// Largest rise of the energy between frames over its range.
fn rise(run: &Run) -> f64 {
    let energies: Vec<f64> = run.frames.iter().map(|frame| frame.energy()).collect();
    let span = energies[0] - energies.iter().copied().fold(f64::INFINITY, f64::min);
    let rises = energies.windows(2).map(|pair| pair[1] - pair[0]);
    rises.fold(0.0, f64::max) / span
}

#[test]
fn a_bed_comes_to_rest_and_its_energy_never_rises() {
    let run = remembering(Case::config("bed.toml"), true).set("t_end", 6.0).set("output.interval", 0.1).run();
    let end = run.end();
    println!("{} right-hand sides, kinetic energy {:e} J", end.counts.rhs, end.kinetic_energy);
    assert!(end.kinetic_energy < 1e-10, "{:e} J", end.kinetic_energy);
    assert!(rise(&run) < 1e-6, "{:e}", rise(&run));
    assert!(end.counts.rhs < 20_000);
    // What rests does not move: the last two seconds, while the slowest modes still fade.
    let before = &run.frames[run.frames.len() - 21];
    let moved = end.x.iter().zip(&before.x).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(moved < 1e-4, "{moved:e} m");
}

#[test]
fn every_method_rests() {
    // Three spheres on a floor, and one on top of them, for a hundred seconds.
    let corner = |k: f64| Vec3::new((2.1 * k).cos(), (2.1 * k).sin(), 0.0) * 0.117 + Vec3::z() * 0.0965;
    let walls = |case: Case| {
        // Walls keep the three from rolling away; they would, without resistance against it.
        let side = |k: f64| Vec3::new((2.1 * k).cos(), (2.1 * k).sin(), 0.0);
        (0..3).fold(case, |case, k| case.wall(side(f64::from(k)) * 0.215, side(f64::from(k))))
    };
    for (method, t_end) in [("auto", 100.0), ("chebyshev", 100.0), ("merson", 10.0), ("dormand-prince", 10.0)]
    {
        let case = walls(remembering(Case::defaults(), true).heavy().floor()).set("particles.mass", 1.0);
        let case = case.set("solver.method", method).set("t_end", t_end);
        let case = (0..3).fold(case, |case, k| case.sphere(corner(f64::from(k)), Vec3::zeros()));
        let run = case.sphere(Vec3::z() * 0.255, Vec3::zeros()).run();
        let (middle, end) = (&run.frames[run.frames.len() / 2], run.end());
        let moved = end.x.iter().zip(&middle.x).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        println!("{method}: {} right-hand sides, moved {moved:e} m", end.counts.rhs);
        assert!(moved < 1e-5, "{method}: {moved:e} m");
        assert!(end.x[3].z > 0.2, "{method}: the pile stands");
    }
}

#[test]
fn frames_do_not_touch_steps() {
    let end = |interval: f64| {
        let case =
            remembering(Case::config("bed.toml"), true).set("t_end", 0.6).set("solver.method", "merson");
        case.set("output.interval", interval).run().end().bits()
    };
    assert_eq!(end(0.6), end(0.0013));
}
