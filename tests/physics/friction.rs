//! Friction and spin: oblique impacts, sliding, rolling, creeping, and the balance of angular momentum.

use crate::common::{Case, Run, assert_near};
use demhybrid::math::vector::Vec3;
use std::f64::consts::PI;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const G: f64 = 9.81;
const PHI: f64 = 0.2;
const V_MIN: f64 = 0.01;
/// Share of the repulsion between surfaces at rest, (1 + e^2)/2.
const RHO_0: f64 = 0.58;
/// Friction is phi F and the load rho F: the effective coefficient of a contact at rest is phi/rho_0, not
/// phi.
const PHI_STATIC: f64 = PHI / RHO_0;

/// A sphere that does not spin hits the floor with `v_n` and slides over it with `v_t` (m/s): state after it.
fn oblique_impact(v_n: f64, v_t: f64) -> (Vec3, Vec3) {
    let gap = 0.21;
    // Time to come, to turn round and, at e_eff >= 0.4, to go.
    let case = Case::tight().floor().rough(true).set("t_end", 5.0 * gap / v_n);
    let end = case.sphere(Vec3::z() * (R + gap), Vec3::new(0.6 * v_t, 0.8 * v_t, -v_n)).run().end().clone();
    assert!(end.x[0].z > R + 0.2, "still in contact");
    (end.v[0], end.omega[0])
}

#[test]
fn a_sliding_impact_passes_on_friction_of_the_unreduced_repulsion() {
    // v_n, J = int F dt/m and its last digit, impact friction coefficient phi J/J_n. With rho F in place of F
    // the coefficient would be 0.2 throughout.
    let table = [
        [0.2, f64::NAN, f64::NAN, 0.3592],
        [1.0, 3.125692, 6e-7, 0.4412],
        [2.0, 6.573189, 6e-7, 0.4681],
        [8.0, 27.532577, 6e-7, 0.4916],
    ];
    for [v_n, impulse, digit, coefficient] in table {
        let v_t = 30.0;
        let (v, omega) = oblique_impact(v_n, v_t);
        let along = Vec3::new(0.6, 0.8, 0.0);
        let lost = v_t - v.dot(&along);
        assert_near(&format!("impact friction at {v_n} m/s"), lost / (v_n + v.z), coefficient, 5e-5);
        if impulse.is_finite() {
            assert_near(&format!("J at {v_n} m/s"), lost / PHI, impulse, digit);
        }
        // omega' = (5/2) phi J/r about the axis that rolls along the slip.
        let turn = Vec3::z().cross(&along) * (2.5 * lost / R);
        assert_near("omega' against (5/2) phi J/r", (omega - turn).norm(), 0.0, 1e-8 * turn.norm());
        assert_near("speed across the slip", v.dot(&Vec3::new(-0.8, 0.6, 0.0)), 0.0, 1e-12);
    }
}

#[test]
fn an_oblique_impact_ends_rolling_or_sliding_as_its_slip_lasts() {
    // v_t, v_t' and omega' at v_n = 2 m/s: below v_t = 3.5 phi J = 4.601 m/s the sphere leaves rolling.
    for (v_t, v_after, spin) in [(2.0, 1.42858, 14.286), (6.0, 4.68536, 32.866)] {
        let (v, omega) = oblique_impact(2.0, v_t);
        assert_near(&format!("v_t' after {v_t} m/s"), v.xy().norm(), v_after, 6e-6);
        assert_near(&format!("omega' after {v_t} m/s"), omega.norm(), spin, 6e-4);
        // What the centre loses the spin gains, to rounding: every stage gives both the same friction.
        assert_near("v_t' + (2/5) r omega'", v.xy().norm() + 0.4 * R * omega.norm(), v_t, 1e-12);
    }
    let threshold = 3.5 * PHI * 6.573189;
    assert_near("threshold, m/s", threshold, 4.601, 5e-4);
    let slip = |v_t: f64| {
        let (v, omega) = oblique_impact(2.0, v_t);
        v.xy().norm() - R * omega.norm()
    };
    // Sliding to the end leaves what is above the threshold; rolling leaves the tail of the regularisation.
    assert_near("slip left at threshold + 0.1, m/s", slip(threshold + 0.1), 0.1, 1e-6);
    assert!(slip(threshold - 0.1) < V_MIN);
}

/// A plane through a point off the origin, steep by `degrees`, facing some way that no axis points.
struct Slope {
    point: Vec3,
    up: Vec3,
    down_hill: Vec3,
    /// rad
    angle: f64,
}

impl Slope {
    fn new(degrees: f64) -> Self {
        let angle = degrees * PI / 180.0;
        let ahead = Vec3::new(0.7f64.cos(), 0.7f64.sin(), 0.0);
        Slope {
            point: Vec3::new(0.4, -0.3, 0.8),
            up: ahead * angle.sin() + Vec3::z() * angle.cos(),
            down_hill: ahead * angle.cos() - Vec3::z() * angle.sin(),
            angle,
        }
    }

    /// A sphere of `mass` (kg) set on the slope with velocity `v` (m/s) down it, where it neither sinks nor
    /// rises.
    fn sphere(&self, rotation: bool, mass: f64, v: f64) -> Case {
        let gap = -(mass * G * self.angle.cos() / (RHO_0 * F_0)).ln() / KAPPA;
        // The normal's length does not matter.
        let case = Case::tight().heavy().rough(rotation).wall(self.point, self.up * -3.0);
        case.set("particles.mass", mass).sphere(self.point + self.up * (R + gap), self.down_hill * v)
    }

    /// Speed down the slope, and slip, in frame `k` (m/s).
    fn speed_and_slip(&self, run: &Run, k: usize) -> [f64; 2] {
        let frame = &run.frames[k];
        let v = frame.v[0].dot(&self.down_hill);
        let axis = self.up.cross(&self.down_hill);
        // Nothing moves sideways or off the plane; 1e-8: the tolerance over the time of the run.
        assert!((frame.v[0] - self.down_hill * v).norm() < 1e-8, "{}", frame.v[0]);
        [v, v - R * frame.omega[0].dot(&axis)]
    }

    /// Acceleration (m/s^2) in the second half of `run`, with `run.frames` two equal spans long, and the last
    /// slip.
    fn acceleration_and_slip(&self, run: &Run) -> [f64; 2] {
        let last = run.frames.len() - 1;
        let [[early, _], [late, slip]] = [last / 2, last].map(|k| self.speed_and_slip(run, k));
        [(late - early) / (run.frames[last].time - run.frames[last / 2].time), slip]
    }
}

#[test]
fn a_sliding_sphere_starts_to_roll_when_the_effective_coefficient_says() {
    for mass in [1.0, 2.5] {
        let level = Slope::new(0.0);
        let t_roll = 2.0 / (7.0 * PHI_STATIC * G);
        // The nominal phi = 0.2 would give 0.1456 s.
        assert_near("t_roll by formula, s", t_roll, 0.084462, 5e-7);
        let run = level
            .sphere(true, mass, 1.0)
            .set("t_end", 3.0 * t_roll)
            .set("output.interval", 0.1 * t_roll)
            .run();
        let [v, _] = level.speed_and_slip(&run, 9);
        let braking = (1.0 - v) / run.frames[9].time;
        assert_near("effective static coefficient", braking / G, 0.344828, 5e-7);
        assert_near("t_roll, s", 2.0 / (7.0 * braking), 0.084462, 5e-7);
        let way = (run.frames[10].x[0] - run.frames[0].x[0]).dot(&level.down_hill);
        // The limiter weakens friction over the last 1 % of the slip: some 1e-3 s at some 1e-3 m/s.
        assert_near("way until rolling, m", way, 0.072396, 1.5e-6);
        let [v, slip] = level.speed_and_slip(&run, 30);
        assert_near("slip at 3 t_roll, m/s", slip, 1.669e-5, 5e-9);
        // v - (2/7) slip is 5/7 v_0 at any time: what the centre loses the spin gains.
        assert_near("speed of rolling, m/s", v - 2.0 / 7.0 * slip, 5.0 / 7.0, 1e-8);
    }
}

/// The slip s at which Sigma(s) is `share`, m/s, by bisection of eq. (2.8).
fn slip_of(share: f64) -> f64 {
    let (mut low, mut high) = (0.0, V_MIN);
    for _ in 0..60 {
        let s = 0.5 * (low + high);
        if 3.0 * (s / V_MIN).powi(2) - 2.0 * (s / V_MIN).powi(3) < share { low = s } else { high = s }
    }
    low
}

#[test]
fn a_sphere_rolls_down_a_gentle_slope_with_a_steady_slip() {
    for (degrees, acceleration, slip) in [(10.0, f64::NAN, 2.40865e-3), (20.0, 2.396584, 3.643919e-3)] {
        let slope = Slope::new(degrees);
        let run = slope.sphere(true, 1.0, 0.0).set("t_end", 0.6).set("output.interval", 0.3).run();
        let [found, found_slip] = slope.acceleration_and_slip(&run);
        let exact = 5.0 / 7.0 * G * slope.angle.sin();
        assert_near(&format!("a at {degrees} degrees, m/s^2"), found, exact, 1e-7);
        if acceleration.is_finite() {
            assert_near(&format!("a at {degrees} degrees as published"), found, acceleration, 5e-7);
        }
        // Sigma(s) = 2 tan(th)/(7 phi_static).
        let steady = slip_of(2.0 * slope.angle.tan() / (7.0 * PHI_STATIC));
        assert_near(&format!("slip at {degrees} degrees, m/s"), found_slip, steady, 1e-8);
        assert_near(&format!("slip at {degrees} degrees as published"), found_slip, slip, 6e-9);
    }
}

#[test]
fn a_sphere_slides_down_a_slope_steeper_than_fifty_degrees() {
    let slope = Slope::new(55.0);
    let run = slope.sphere(true, 1.0, 0.0).set("t_end", 0.6).set("output.interval", 0.3).run();
    assert_near("a at 55 degrees, m/s^2", slope.acceleration_and_slip(&run)[0], 6.095611, 6e-7);
    let critical = (3.5 * PHI_STATIC).atan() * 180.0 / PI;
    assert_near("critical angle, degrees", critical, 50.356, 5e-4);
    let slip = |degrees: f64| {
        let slope = Slope::new(degrees);
        let run = slope.sphere(true, 1.0, 0.0).set("t_end", 2.0).set("output.interval", 1.0).run();
        slope.acceleration_and_slip(&run)[1]
    };
    // Below: the steady slip, less than v_min. Above: slip grows with g (sin - 3.5 phi_static cos) t, 0.1
    // degrees being 0.027 m/s^2.
    let steady = slip_of(2.0 * ((critical - 0.1) * PI / 180.0).tan() / (7.0 * PHI_STATIC));
    assert_near("slip 0.1 degrees below, m/s", slip(critical - 0.1), steady, 1e-6);
    assert!(slip(critical + 0.1) > 4.0 * V_MIN, "{}", slip(critical + 0.1));
}

#[test]
fn a_block_creeps_below_the_critical_angle_and_slides_above() {
    assert_near("critical angle, degrees", PHI_STATIC.atan() * 180.0 / PI, 19.0256, 5e-5);
    // Sigma(v) = tan(th)/phi_static. The nominal phi would let it slide from 11.31 degrees.
    for (degrees, creep, digit) in [(10.0, 5.075661e-3, 1e-9), (19.0, 9.778516e-3, 1e-9)] {
        let slope = Slope::new(degrees);
        let run = slope.sphere(false, 1.0, 0.0).set("t_end", 1.0).set("output.interval", 0.5).run();
        let [acceleration, speed] = slope.acceleration_and_slip(&run);
        assert_near(&format!("creep at {degrees} degrees, m/s"), speed, creep, digit);
        assert_near(&format!("creep at {degrees} degrees is steady, m/s^2"), acceleration, 0.0, 1e-8);
    }
    let slope = Slope::new(25.0);
    let run = slope.sphere(false, 1.0, 0.0).set("t_end", 0.6).set("output.interval", 0.3).run();
    assert_near("a at 25 degrees, m/s^2", slope.acceleration_and_slip(&run)[0], 1.080065, 6e-7);
}

/// Friction on the first of two spheres, eqs. (2.1), (2.6)-(2.8), as printed; with the gap (m) and the
/// normal.
fn pair_friction(x: &[Vec3], v: &[Vec3], omega: &[Vec3]) -> (Vec3, f64, Vec3) {
    let apart = x[0] - x[1];
    let d = apart.norm();
    let rate = apart.dot(&(v[0] - v[1])) / d;
    let slip = (v[0] - v[1]) - apart * (rate / d) - (omega[0] + omega[1]).cross(&apart) * (R / d);
    let s = slip.norm();
    let sigma = if s < V_MIN { 3.0 * (s / V_MIN).powi(2) - 2.0 * (s / V_MIN).powi(3) } else { 1.0 };
    let force = F_0 * (-KAPPA * (d - 2.0 * R)).exp();
    (slip * (-PHI * force * sigma / s), d - 2.0 * R, apart / d)
}

#[test]
fn angular_momentum_changes_by_the_friction_couple_across_the_gap() {
    // Where slip turns round it crosses v_min in 1e-4 s: frames must resolve that.
    let interval = 5e-6;
    let run = Case::tight()
        .rough(true)
        .set("t_end", 0.35)
        .set("output.interval", interval)
        .spinning_sphere(Vec3::zeros(), Vec3::new(0.8, 0.1, 0.0), Vec3::new(3.0, -2.0, 5.0))
        .spinning_sphere(Vec3::new(0.27, 0.11, 0.05), Vec3::new(-1.1, 0.0, 0.2), Vec3::new(0.0, 4.0, -1.0))
        .run();
    let momentum = |k: usize| -> Vec3 {
        let frame = &run.frames[k];
        (0..2).map(|i| frame.x[i].cross(&frame.v[i]) + frame.omega[i] * (0.4 * R * R)).sum()
    };
    // The levers are r, the centres 2r + l apart: dL/dt = l n x F_fr.
    let couple = |k: usize| {
        let frame = &run.frames[k];
        let (friction, gap, n) = pair_friction(&frame.x, &frame.v, &frame.omega);
        n.cross(&friction) * gap
    };
    let (mut worst, mut size, mut total) = (0.0f64, 0.0f64, Vec3::zeros());
    for k in (0..run.frames.len() - 2).step_by(2) {
        // Simpson's rule on two intervals.
        total += (couple(k) + couple(k + 1) * 4.0 + couple(k + 2)) * (interval / 3.0);
        let change = momentum(k + 2) - momentum(0);
        worst = worst.max((change - total).norm());
        size = size.max(change.norm());
    }
    // What Simpson's rule leaves over; the change itself is 1e5 times as large.
    assert!(size > 1e-3, "{size}");
    assert_near("L(t) - L(0) - int l n x F_fr dt, kg m^2/s", worst, 0.0, 1e-8);
}

#[test]
fn an_oblique_pair_gains_angular_momentum_with_the_papers_friction_and_none_with_memory() {
    let gain = |law: &str| {
        let pair = Case::tight().rough(true).set("friction.law", law).set("t_end", 0.6);
        let pair = pair.sphere(Vec3::zeros(), Vec3::new(2.0, 0.0, 0.0));
        let run = pair.sphere(Vec3::new(0.5, 0.15, 0.0), Vec3::new(-2.0, 0.0, 0.0)).run();
        let end = run.end();
        let momentum: Vec3 = (0..2).map(|i| end.x[i].cross(&end.v[i]) + end.omega[i] * (0.4 * R * R)).sum();
        momentum.norm() / 0.3 - 1.0
    };
    assert_near("gain with the paper's friction", gain("regularized"), 0.0263, 1e-4);
    assert_near("gain with friction that remembers", gain("history"), 0.0, 1e-9);
}
