//! Blocks and spheres on slopes and on the floor, against the mechanics of rigid bodies with Coulomb's law.
//!
//! Friction acts with the lever a = r + l. So a rolling sphere has v = a w, its inertia adds 0.4 (r/a)^2 of
//! its mass, and it slips where that takes more than mu m g cos: above tan = mu (1 + 2.5 (a/r)^2).

use super::driven::{X_M, shear};
use super::{G, MU, R, gap_under, on_slope, remembering};
use crate::common::{Case, Run, Snapshot, assert_near};
use demhybrid::math::vector::Vec3;

/// One method of each family, at a tolerance that leaves four digits.
const METHODS: [&str; 2] = ["chebyshev", "dormand-prince"];

fn accurate(method: &str) -> Case {
    Case::defaults().set("solver.method", method).set("solver.tolerance", 1e-4)
}

/// Mean acceleration along the slope between two frames, m/s^2.
fn acceleration(run: &Run, from: usize) -> f64 {
    let [early, late] = [&run.frames[from], run.end()];
    (late.v[0].x - early.v[0].x) / (late.time - early.time)
}

/// The lever over the radius at rest on the slope.
fn lever(slope: f64) -> f64 {
    1.0 + gap_under(G / (1.0 + slope * slope).sqrt()) / R
}

#[test]
fn a_block_stands_below_its_angle_with_either_family_of_methods() {
    // At its default tolerance Dormand-Prince shakes a block that much that it creeps 1e-4 m at 0.98.
    for (method, tolerance) in [("auto", 0.1), ("chebyshev", 0.1), ("merson", 0.1), ("dormand-prince", 1e-3)]
    {
        let shares: &[f64] = match method {
            "auto" | "chebyshev" => &[0.1, 0.3, 0.6, 0.75, 0.84, 0.9, 0.95, 0.98],
            _ => &[0.3, 0.9, 0.98],
        };
        for &share in shares {
            let case = Case::defaults().set("solver.method", method).set("solver.tolerance", tolerance);
            let run =
                on_slope(share * MU, false, case).set("t_end", 100.0).set("output.interval", 10.0).run();
            let (early, late) = (&run.frames[1], run.end());
            let drift = (late.x[0] - early.x[0]).norm();
            let what = format!("{method}: drift at {share} of the limit from 10 s to 100 s, m");
            assert_near(&what, drift, 0.0, 1e-6);
            // At first it shears, by more than one that is pulled slowly: it comes with some speed.
            let moved = late.x[0].x / X_M;
            println!("{method}: moved {moved} x_m");
            assert!(
                moved > 0.999 * shear(share) && moved < 1.0 / (1.0 - share),
                "{method}: moved {moved} x_m"
            );
        }
    }
}

#[test]
fn a_block_slides_above_its_angle_as_coulomb_says() {
    for method in METHODS {
        for share in [1.02, 1.2, 2.0] {
            let slope = share * MU;
            let run = on_slope(slope, false, accurate(method)).set("t_end", 3.0).run();
            let exact = G * (slope - MU) / (1.0 + slope * slope).sqrt();
            let what = format!("{method}: acceleration at {share} of the limit, m/s^2");
            // From the middle on: by then the memory has reached its limit within exp(-4 x/x_m).
            assert_near(&what, acceleration(&run, run.frames.len() / 2), exact, 1e-4 * exact);
        }
    }
}

#[test]
fn a_sphere_rolls_below_its_threshold_and_slips_above() {
    // The threshold depends on the lever, and that on the slope.
    let threshold = |slope: f64| MU * (1.0 + 2.5 * lever(slope).powi(2));
    let threshold = (0..20).fold(3.5 * MU, |slope, _| threshold(slope));
    for method in METHODS {
        for share in [0.5, 0.98, 1.02, 1.2] {
            let slope = share * threshold;
            let (cos, lever) = (1.0 / (1.0 + slope * slope).sqrt(), lever(slope));
            let run = on_slope(slope, true, accurate(method)).set("t_end", 8.0).run();
            let exact = if share < 1.0 {
                G * slope * cos / (1.0 + 0.4 / (lever * lever))
            } else {
                G * (slope - MU) * cos
            };
            let what = format!("{method}: acceleration at {share} of the threshold, m/s^2");
            assert_near(&what, acceleration(&run, run.frames.len() / 2), exact, 1e-4 * exact);
            // Where it slips, the slip grows from then on at a constant rate.
            let slip = |frame: &Snapshot| frame.v[0].x - R * lever * frame.omega[0].y;
            let [early, late] = [&run.frames[run.frames.len() / 2], run.end()].map(slip);
            let exact = (G * cos * (slope - MU * (1.0 + 2.5 * lever * lever)) * 4.0).max(0.0);
            let what = format!("{method}: slip gained in 4 s at {share} of the threshold, m/s");
            assert_near(&what, late - early, exact, 1e-8 + 1e-4 * exact);
            assert!(share > 1.0 || late.abs() < 1e-8, "{method}: {late} m/s at {share} of the threshold");
        }
    }
}

#[test]
fn a_sphere_set_down_without_spin_rolls_when_friction_has_stopped_its_slip() {
    let lever = lever(0.0);
    // Slip falls at mu g (1 + 2.5 (a/r)^2): without the lever's correction 3.5 mu g.
    let braking = MU * G * (1.0 + 2.5 * lever * lever);
    for (v_0, damping) in [(1.0, 1.0), (4.0, 1.0), (4.0, 0.0)] {
        let t_roll = v_0 / braking;
        let interval = t_roll / 200.0;
        let case = remembering(Case::defaults(), true)
            .set("friction.damping", damping)
            .set("particles.mass", 1.0)
            .set("solver.method", "dormand-prince")
            .set("solver.tolerance", 1e-9)
            .set("output.interval", interval)
            .set("t_end", t_roll + 0.5);
        let height = Vec3::z() * (R + gap_under(G));
        let run = case.heavy().floor().sphere(height, Vec3::x() * v_0).run();
        let slip = |k: usize| run.frames[k].v[0].x - R * lever * run.frames[k].omega[0].y;
        let k = (0..run.frames.len()).find(|&k| slip(k) < 0.0).expect("it rolls");
        // Linear between frames: friction is constant up to there.
        let rolls = run.frames[k - 1].time + interval * slip(k - 1) / (slip(k - 1) - slip(k - 2)).abs();
        // Friction grows over a slip of some x_m: the integral of (1 - q)/(1 - g) over q is 3/8 + ln(2)/4.
        // Damping theta = tau |t|/s adds to it from the start: what lacks is 1 + theta smaller.
        let theta = damping * 2.0 * (2.0 / 7.0 * MU * G / X_M).sqrt() * v_0 / (MU * G);
        let late = (0.375 + 0.25 * 2f64.ln()) / (1.0 + theta) * X_M / v_0;
        let what = format!("rolls from {v_0} m/s, damping {damping}, after, s");
        // Slip falls by braking x_m/v_0 while friction grows.
        assert_near(&what, rolls, t_roll + late, late * (0.01 + 3.0 * braking * X_M / (v_0 * v_0)));
        // No torque about the line of contact, at any time: so v is known where the slip is 0.
        let kept = |frame: &Snapshot| frame.v[0].x + 0.4 * R / lever * frame.omega[0].y;
        let off = run.frames.iter().map(|frame| (kept(frame) - v_0).abs()).fold(0.0, f64::max);
        assert_near("angular momentum over that of the start", off / v_0, 0.0, 1e-9);
        if damping > 0.0 {
            let exact = v_0 / (1.0 + 0.4 / (lever * lever));
            assert_near("speed of rolling, m/s", run.end().v[0].x, exact, 1e-6 * exact);
        }
    }
}
