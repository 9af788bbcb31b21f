//! Resistance to rolling and twisting: what rolls stops after the way that the law gives, what stands stays.

use crate::common::{Case, Run, assert_near};
use demhybrid::math::vector::Vec3;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const G: f64 = 9.81;
const RHO_0: f64 = 0.58;
const ROLLING: f64 = 0.05;
const TWISTING: f64 = 0.02;

fn resisting(case: Case) -> Case {
    case.set("friction.law", "history")
        .set("friction.coefficient", 0.345)
        .set("friction.rolling.coefficient", ROLLING)
        .set("friction.twisting.coefficient", TWISTING)
        .set("particles.mass", 1.0)
}

/// Gap at which the floor carries `weight` (N), m.
fn gap_under(weight: f64) -> f64 {
    -(weight / (RHO_0 * F_0)).ln() / KAPPA
}

/// A tight tolerance for contacts with memory.
fn tight() -> Case {
    Case::tight()
        .set("solver.norm", "scaled")
        .set("solver.method", "dormand-prince")
        .set("solver.tolerance", 1e-8)
        .set("contact.interaction_distance", 0.1)
}

/// Way at full resistance, m.
fn full(coefficient: f64) -> f64 {
    coefficient * RHO_0 / (0.5 * KAPPA)
}

#[test]
fn a_sphere_that_rolls_stops_after_the_way_that_the_law_gives() {
    // It rolls with the lever a = r + l. The moment mu_r r m g takes its energy m v^2/2 (1 + 0.4 (r/a)^2) over
    // the angle x/a. Where r = a, this is x = 0.7 v^2/(mu_r g).
    let gap = gap_under(G);
    let lever = R + gap;
    let speed = 0.5;
    let case = resisting(tight()).heavy().floor().set("t_end", 3.0).set("output.interval", 0.02);
    let omega = Vec3::y() * (speed / lever);
    let run = case.spinning_sphere(Vec3::z() * lever, Vec3::x() * speed, omega).run();
    let furthest = run.frames.iter().map(|frame| frame.x[0].x).fold(0.0, f64::max);
    let way = lever / R * speed * speed * (1.0 + 0.4 * (R / lever).powi(2)) / (2.0 * ROLLING * G);
    // The resistance builds up over the way y_m, and gives back what it stores.
    assert_near("way until it stops, m", furthest, way, full(ROLLING));
    assert!((way - 0.7 * speed * speed / (ROLLING * G)).abs() < 0.02 * way);
    let end = run.end();
    assert!(end.v[0].norm() < 1e-4 && (furthest - end.x[0].x) < 3.0 * full(ROLLING), "{:?}", end.v[0]);
}

/// A sphere at rest on a slope with the tangent `slope`, seen from it.
fn on_slope(slope: f64, case: Case) -> Run {
    let cos = 1.0 / (1.0 + slope * slope).sqrt();
    let case = resisting(case).floor().set("gravity", [G * slope * cos, 0.0, -G * cos]);
    case.sphere(Vec3::z() * (R + gap_under(G * cos)), Vec3::zeros()).run()
}

#[test]
fn a_sphere_stands_below_its_angle_and_rolls_above() {
    // The weight turns it about the contact with the lever a, the resistance with r: tan = mu_r r/a.
    let ratio = 1.0 + gap_under(G) / R;
    for share in [0.3, 0.9, 0.98] {
        let run = on_slope(share * ROLLING / ratio, Case::defaults().set("t_end", 40.0));
        let (early, late) = (run.frames.iter().find(|frame| frame.time >= 10.0).unwrap(), run.end());
        let drift = (late.x[0] - early.x[0]).norm();
        assert_near(&format!("drift at {share} of its angle from 10 s to 40 s, m"), drift, 0.0, 1e-6);
        // It gives way by y_m/(1 - share) or so until it stands.
        assert!(late.x[0].x < 3.0 * full(ROLLING) / (1.0 - share), "{share}: {:e}", late.x[0].x);
    }
    for share in [1.1, 2.0] {
        let slope = share * ROLLING / ratio;
        let run = on_slope(slope, tight());
        let [early, late] = [&run.frames[50], run.end()];
        let found = (late.v[0].x - early.v[0].x) / (late.time - early.time);
        let cos = 1.0 / (1.0 + slope * slope).sqrt();
        let exact = G * cos * (slope - ROLLING / ratio) / (1.0 + 0.4 / ratio.powi(2));
        assert_near(&format!("acceleration at {share} of its angle, m/s^2"), found, exact, 2e-4 * G);
    }
}

#[test]
fn a_sphere_that_spins_about_its_normal_is_stopped_by_twisting_resistance() {
    // The moment mu_t r m g brakes the inertia 0.4 m r^2.
    let omega = 5.0;
    let case = resisting(tight()).heavy().floor().set("t_end", 3.0).set("output.interval", 0.05);
    let run = case.spinning_sphere(Vec3::z() * (R + gap_under(G)), Vec3::zeros(), Vec3::z() * omega).run();
    let rate = TWISTING * G / (0.4 * R);
    for frame in run.frames.iter().filter(|frame| frame.time > 0.2 && frame.time < 0.9) {
        // The memory fills over z_m = r theta: meanwhile the moment is below its limit.
        let late = full(TWISTING) / (R * omega);
        let expected = omega - rate * frame.time;
        assert_near("spin, rad/s", frame.omega[0].z, expected, 2.0 * rate * late);
    }
    let stopped = run.frames.iter().find(|frame| frame.time > omega / rate + 0.5).unwrap();
    assert!(stopped.omega[0].norm() < 1e-3, "{:?}", stopped.omega[0]);
    assert!(run.end().omega[0].norm() < 1e-6, "{:?}", run.end().omega[0]);
}

#[test]
fn a_free_pair_keeps_its_angular_momentum_and_gains_no_energy() {
    let case = resisting(tight()).set("solver.tolerance", 1e-10).set("t_end", 0.35);
    let case = case
        .spinning_sphere(Vec3::zeros(), Vec3::new(0.8, 0.1, 0.0), Vec3::new(3.0, -2.0, 5.0))
        .spinning_sphere(Vec3::new(0.27, 0.11, 0.05), Vec3::new(-1.1, 0.0, 0.2), Vec3::new(0.0, 4.0, -1.0));
    let run = case.run();
    let angular = |k: usize| {
        let frame = &run.frames[k];
        let orbital: Vec3 = frame.x.iter().zip(&frame.v).map(|(x, v)| x.cross(v)).sum();
        orbital + frame.omega.iter().sum::<Vec3>() * (0.4 * R * R)
    };
    let drift = (angular(run.frames.len() - 1) - angular(0)).norm();
    assert_near("angular momentum of a free pair", drift, 0.0, 1e-9);
    let rises = run.frames.windows(2).map(|pair| pair[1].energy() - pair[0].energy()).fold(0.0, f64::max);
    assert!(rises < 1e-9, "{rises:e}");
}

#[test]
fn what_resists_nothing_changes_nothing() {
    let end = |case: Case| {
        let case = case.set("friction.law", "history").set("friction.coefficient", 0.345).set("t_end", 1.0);
        let run = case.run();
        (run.end().bits(), run.end().counts.rhs)
    };
    let bed = || Case::config("bed.toml");
    let none = bed().set("friction.rolling.coefficient", 0.0).set("friction.twisting.coefficient", 0.0);
    assert_eq!(end(bed()), end(none));
    assert_ne!(end(bed()), end(bed().set("friction.twisting.coefficient", 0.01)));
}
