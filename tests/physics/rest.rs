//! Spheres at rest, alone and in columns, and small oscillations about it.

use crate::common::{Case, assert_near};
use demhybrid::math::vector::Vec3;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const PSI: f64 = 10.0;
const G: f64 = 9.81;

/// Share of the repulsion between surfaces at rest: (1 + e^2)/2.
fn rho_0(e: f64) -> f64 {
    0.5 * (1.0 + e * e)
}

/// Gap (m) under which a contact bears `load` (N) at rest.
fn bearing_gap(e: f64, load: f64) -> f64 {
    -(load / (rho_0(e) * F_0)).ln() / KAPPA
}

#[test]
fn a_dropped_sphere_comes_to_rest_where_the_reduced_repulsion_bears_it() {
    let case = Case::tight().floor().heavy().set("t_end", 4.0);
    let end = case.sphere(Vec3::new(0.3, -0.2, 0.15), Vec3::zeros()).run().end().clone();
    let gap = end.x[0].z - R;
    // Published digits; what moves after 4 s has decayed by e^{-0.9 * 38 * 3} since the last bounce.
    assert_near("l_eq, m", gap, -3.50363e-3, 5e-9);
    assert_near("l_eq by formula, m", gap, bearing_gap(0.4, G), 1e-11);
    assert_near("F, N", F_0 * (-KAPPA * gap).exp(), 16.9138, 5e-5);
    assert!(end.v[0].norm() < 1e-9, "{}", end.v[0]);
}

#[test]
fn a_heavy_sphere_rests_deeper() {
    let case = Case::tight().floor().heavy().set("particles.mass", 4.0).set("t_end", 4.0);
    let end = case.sphere(Vec3::z() * 0.11, Vec3::zeros()).run().end().clone();
    assert_near("l_eq of 4 kg, m", end.x[0].z - R, bearing_gap(0.4, 4.0 * G), 1e-11);
}

/// Frames of a sphere released at rest at `shift` (m) from its equilibrium: time (s) and height above it (m).
fn released(e: f64, shift: f64) -> Vec<[f64; 2]> {
    let rest = R + bearing_gap(e, G);
    let run = Case::tight()
        .floor()
        .heavy()
        // Accelerations are about omega_0^2 * 1e-5 m = 1e-2 m/s^2: seven digits of them.
        .set("solver.tolerance", 1e-11)
        .set("contact.restitution", e)
        .set("t_end", 0.3)
        .set("output.interval", 0.002)
        .sphere(Vec3::z() * (rest + shift), Vec3::zeros())
        .run();
    run.frames.iter().map(|frame| [frame.time, frame.x[0].z - rest]).collect()
}

#[test]
fn a_sphere_at_rest_oscillates_with_the_predicted_frequency_and_damping() {
    let omega_0 = (KAPPA * G).sqrt();
    assert_near("omega_0, rad/s", omega_0, 38.3601, 5e-5);
    for (e, published) in [(0.4, 0.92593), (0.7, 0.43767), (0.95, 0.06553)] {
        let zeta = 0.5 * (1.0 - e * e) * PSI * G / (2.0 * rho_0(e) * omega_0);
        assert_near("zeta", zeta, published, 5e-6);
        // Half the difference of two opposite shifts: what is quadratic in the shift drops out, and the cubic
        // rest is (kappa shift)^2 = 2e-6 of the shift.
        let shift = 1e-5;
        let (up, down) = (released(e, shift), released(e, -shift));
        let omega_d = omega_0 * (1.0 - zeta * zeta).sqrt();
        let mut worst = 0.0f64;
        for (up, down) in up.iter().zip(&down) {
            let phase = omega_d * up[0];
            let exact =
                (-zeta * omega_0 * up[0]).exp() * (phase.cos() + zeta * omega_0 / omega_d * phase.sin());
            worst = worst.max((0.5 * (up[1] - down[1]) / shift - exact).abs());
        }
        // Over 11 radians this settles omega_0 to 1e-6 and zeta to 1e-5.
        assert_near(&format!("oscillation at e = {e}, largest deviation"), worst, 0.0, 1e-5);
    }
}

/// A column of `n` spheres that starts with the gaps (m) given from the floor up.
fn column(n: usize, gap: impl Fn(usize) -> f64) -> Case {
    let mut case = Case::tight().floor().heavy();
    let mut z = -R;
    for k in 0..n {
        z += 2.0 * R + gap(k);
        case = case.sphere(Vec3::new(0.5, 0.5, z), Vec3::zeros());
    }
    case
}

/// Gaps (m) of a column, from the floor up.
fn column_gaps(x: &[Vec3]) -> Vec<f64> {
    let below = std::iter::once(-R).chain(x.iter().map(|x| x.z));
    x.iter().zip(below).map(|(x, below)| x.z - below - 2.0 * R).collect()
}

#[test]
fn two_stacked_spheres_settle_to_their_two_gaps() {
    let run = column(2, |_| 0.01).set("t_end", 4.0).run();
    let gaps = column_gaps(&run.end().x);
    assert_near("l_floor, m", gaps[0], -8.12461e-3, 5e-9);
    assert_near("l_12, m", gaps[1], -3.50363e-3, 5e-9);
}

#[test]
fn each_contact_of_a_column_bears_what_stands_above_it() {
    let run = column(10, |_| 0.0).set("t_end", 6.0).run();
    for (k, gap) in column_gaps(&run.end().x).iter().rev().enumerate() {
        let exact = bearing_gap(0.4, (k + 1) as f64 * G);
        // The slowest of ten modes has decayed to this.
        assert_near(&format!("l_{}, m", k + 1), *gap, exact, 1e-9);
    }
    assert_near("l_10, m", column_gaps(&run.end().x)[0], -18.85e-3, 5e-6);
}

#[test]
fn a_column_of_a_hundred_spheres_stays_in_its_equilibrium() {
    let gap = |k: usize| bearing_gap(0.4, (100 - k) as f64 * G);
    // Published to 0.01 mm.
    assert_near("l_100, m", gap(0), -34.21e-3, 1e-5);
    let case = column(100, gap).set("t_end", 0.5);
    let (before, after) = (case.build().1.x, case.run().end().x.clone());
    for (before, after) in before.iter().zip(&after) {
        // A wrong load anywhere would start an acceleration of a part of g. 1e-10 m: heights near 20 m have
        // rounding errors of 4e-15 m, which the stiffest contact turns into 2.5e5 * 4e-15 = 1e-9 m/s^2.
        assert!((Vec3::from(*before) - after).norm() < 1e-10, "{before:?} moved to {after}");
    }
}

/// Forty spheres at rest on an open floor, and one that rolls away from them at 0.5 m/s.
fn spheres_and_one_that_rolls(law: &str) -> Case {
    let height = R + bearing_gap(0.4, G);
    let case = Case::defaults().rough(true).floor().heavy().set("friction.law", law).set("t_end", 3.0);
    let case = (0..40).fold(case, |case, k| {
        let place = Vec3::new(f64::from(k % 8), f64::from(k / 8), 0.0);
        case.sphere(place + Vec3::z() * height, Vec3::zeros())
    });
    let speed = 0.5;
    case.spinning_sphere(Vec3::new(8.0, 2.0, height), speed * Vec3::x(), speed / height * Vec3::y())
}

#[test]
fn nothing_is_at_rest_while_one_sphere_rolls_away() {
    // Each criterion holds from the start, because forces balance and the mean of 41 energies is small.
    for criterion in ["unbalanced_force", "kinetic_energy", "height_change", "speed"] {
        let most = if criterion == "speed" { 0.05 } else { 0.1 };
        let rolling = spheres_and_one_that_rolls("regularized").set(&format!("stop.{criterion}"), most);
        assert_eq!(rolling.run().outcome.at_rest_by, None, "{criterion}");
        let at_any_speed = if criterion == "speed" { 1.0 } else { most };
        let at_any_speed = rolling.set(&format!("stop.{criterion}"), at_any_speed).set("stop.speed", 1.0);
        let outcome = at_any_speed.run().outcome;
        assert_eq!(outcome.at_rest_by, Some(format!("stop.{criterion}").as_str()));
        // The window of r/sqrt(g r) = 0.101 s, and two checks.
        assert!((0.1..0.13).contains(&outcome.time), "{criterion}: {} s", outcome.time);
    }
}

#[test]
fn a_bed_is_at_rest_when_its_last_sphere_has_rolled_out() {
    let rolling = spheres_and_one_that_rolls("history").set("friction.rolling.coefficient", 0.05);
    let run = rolling.set("stop.unbalanced_force", 1e-3).set("stop.units", "scene").run();
    // The moment 0.05 r m g brakes it by (5/7) 0.05 g = 0.350 m/s^2, so it stops after 1.43 s.
    let stops = 0.5 / (5.0 / 7.0 * 0.05 * G);
    assert_eq!(run.outcome.at_rest_by, Some("stop.unbalanced_force"));
    assert!((stops..stops + 0.3).contains(&run.outcome.time), "{} s", run.outcome.time);
}
