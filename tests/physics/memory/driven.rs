//! One contact whose motion is prescribed, against closed forms.
//!
//! Along one line, at rest but for slow shear x, and with q = |p|/s, the law reads x_m dq/dx = 1 - g where
//! the shear grows, and 1 where it shrinks; g = max(0, 2 q - 1)^2. From q = 1/2 up 1 - g = 4 q (1 - q), so
//! that the shear is x_m (1/2 + ln(q/(1 - q))/4) there.

use super::{F_0, KAPPA, MU, R, RHO_0};
use crate::common::assert_near;
use demhybrid::math::elementary::Separate;
use demhybrid::math::vector::Vec3;
use demhybrid::model::contact::{Dissipative, LawParameters};
use demhybrid::model::history::{History, MemoryParameters, Partner, Response, Touch};
use demhybrid::model::size::Partners;

const MEMORY: MemoryParameters =
    MemoryParameters { stiffness_ratio: 0.5, damping: 1.0, mass: 1.0, resistance: [None; 2] };
const LAW: LawParameters = LawParameters {
    r: R,
    f_0: F_0,
    kappa: KAPPA,
    l_max: 0.1,
    e: 0.4,
    psi: 10.0,
    phi: MU,
    v_min: 0.01,
    memory: Some(MEMORY),
};
/// Shear at full friction, m.
pub const X_M: f64 = MU * RHO_0 / (0.5 * KAPPA);

/// A block on a floor that opens at the rate `opening` (m/s) and is sheared along x at the rate `slip` (m/s).
fn respond(gap: f64, opening: f64, slip: f64, p: f64) -> Response {
    let (n, v_rel) = (Vec3::z(), Vec3::new(slip, 0.0, opening));
    let (spins, memory, size) = (&Vec3::zeros(), &(p * Vec3::x()), Partners::alike(LAW.r, true));
    let touch = Touch { gap, n: &n, v_rel: &v_rel, spins, spin_n: 0.0, size, memory };
    let friction = History::new(&LAW, MEMORY, false);
    friction.action::<Separate, _>(&LAW, &Dissipative::new(LAW.e, LAW.psi), Partner::Wall, touch)
}

/// Integrates y' = f(t, y) from `t` (s) by `steps` steps of h (s) with the classical method of order 4.
fn march<const N: usize>(
    mut y: [f64; N],
    t: f64,
    h: f64,
    steps: u32,
    f: impl Fn(f64, &[f64; N]) -> [f64; N],
) -> [f64; N] {
    let moved = |y: &[f64; N], h: f64, slope: &[f64; N]| std::array::from_fn(|k| y[k] + h * slope[k]);
    for step in 0..steps {
        let t = t + h * f64::from(step);
        let k1 = f(t, &y);
        let k2 = f(t + 0.5 * h, &moved(&y, 0.5 * h, &k1));
        let k3 = f(t + 0.5 * h, &moved(&y, 0.5 * h, &k2));
        let k4 = f(t + h, &moved(&y, h, &k3));
        y = std::array::from_fn(|k| y[k] + h / 6.0 * (k1[k] + 2.0 * (k2[k] + k3[k]) + k4[k]));
    }
    y
}

/// Shear over x_m at which a fresh contact has the share q of its limit.
pub fn shear(q: f64) -> f64 {
    if q <= 0.5 { q } else { 0.5 + 0.25 * (q / (1.0 - q)).ln() }
}

/// The share of its limit that a fresh contact has after a shear of x x_m.
fn share(x: f64) -> f64 {
    if x <= 0.5 { x } else { 1.0 / (1.0 + (-4.0 * (x - 0.5)).exp()) }
}

#[test]
fn a_contact_sheared_to_and_fro_follows_its_loop_and_loses_what_is_in_it() {
    // So slow that damping adds 1e-8 of the limit.
    let speed = 1e-9;
    let parts = 8;
    for (most, gap) in [(0.3, 0.0), (0.5, -0.01), (0.7, 0.0), (0.7, -0.02), (0.95, 0.01), (0.999, -0.01)] {
        let s = (-0.5 * KAPPA * gap).exp();
        let limit = MU * RHO_0 * F_0 * s * s;
        let rate = |slip: f64| {
            move |_: f64, y: &[f64; 3]| {
                let found = respond(gap, 0.0, slip, y[0]);
                [found.rate.x, found.dissipation[1], -found.force.x * slip]
            }
        };
        // Time to shear a share of x_m.
        let time = |x: f64| x * X_M / speed;
        // Up to q = 1/2 and from there on: the slope bends there, and no step goes across.
        let mut y = march([0.0; 3], 0.0, time(0.5f64.min(most)) / 100.0, 100, rate(speed));
        y = march(y, 0.0, time(shear(most) - 0.5f64.min(most)) / 4000.0, 4000, rate(speed));
        assert_near(&format!("first loading to {most} at a gap of {gap} m"), y[0] / s, most, 1e-10);
        // Unloading is elastic and ends at q = 0, where loading begins on the other side.
        let stroke = most + shear(most);
        (y[1], y[2]) = (0.0, 0.0);
        let mut worst = 0.0f64;
        for side in [-1.0, 1.0] {
            let part = stroke / f64::from(parts);
            for k in 1..=parts {
                y = march(y, 0.0, time(part) / 2000.0, 2000, rate(side * speed));
                let since = part * f64::from(k) - most;
                let exact = side * if since < 0.0 { since } else { share(since) };
                let force = -respond(gap, 0.0, side * speed, y[0]).force.x / limit;
                worst = worst.max((y[0] / s - exact).abs()).max((force - exact).abs());
            }
        }
        // A kink inside a step of stroke/16000.
        assert_near(&format!("loop of {most} at a gap of {gap} m, largest deviation"), worst, 0.0, 1e-7);
        // What wear takes: twice the integral of q g/(1 - g) from 1/2 up.
        let lost = if most > 0.5 { -0.5 * (2.0 - 2.0 * most).ln() - most * most + 0.25 } else { 0.0 };
        assert_near("energy lost in the loop over limit x_m", y[1] / (limit * X_M), lost, 1e-6);
        assert_near("work done in the loop over limit x_m", y[2] / (limit * X_M), lost, 1e-6);
    }
}

/// How far (x_m) a block creeps in a cycle: it is pulled with a share `pull` of its limit, while the load
/// that presses it swings by the share `swing`.
fn creep(pull: f64, swing: f64) -> f64 {
    let (period, steps) = (8.0, 4000);
    let omega = std::f64::consts::TAU / period;
    let force = pull * MU * RHO_0 * F_0;
    // Position, velocity, memory of 1 kg; the gap at which the load is F_0 (1 + swing sin(omega t)).
    let rate = |t: f64, y: &[f64; 3]| {
        let load = 1.0 + swing * (omega * t).sin();
        let opening = -swing * omega * (omega * t).cos() / (KAPPA * load);
        let found = respond(-load.ln() / KAPPA, opening, y[1], y[2]);
        [y[1], force + found.force.x, found.rate.x]
    };
    let h = period / f64::from(steps);
    let (settled, cycles) = (5, 5);
    let before = march([0.0, 0.0, pull], 0.0, h, settled * steps, rate);
    let after = march(before, f64::from(settled) * period, h, cycles * steps, rate);
    (after[0] - before[0]) / (f64::from(cycles) * X_M)
}

#[test]
fn a_block_does_not_creep_under_a_load_that_swings_below_half_of_its_limit() {
    for pull in [0.1, 0.3, 0.45] {
        for swing in [0.006, 0.01] {
            // What is left comes of damping, and grows as swing^2 over the period.
            assert_near(
                &format!("creep at {pull} of the limit, +-{swing}, x_m"),
                creep(pull, swing),
                0.0,
                4e-6,
            );
        }
    }
}

#[test]
fn a_block_creeps_under_a_load_that_swings_near_its_limit_as_the_wear_says() {
    // While the load falls, q grows from pull/(1 + swing) to pull/(1 - swing). That takes the integral of
    // g/(1 - g) more shear than the way back gives, in x_m.
    let extra = |q: f64| 0.25 * (q / (1.0 - q)).ln() - q;
    for (pull, swing) in [(0.6, 0.006), (0.8, 0.0015), (0.8, 0.006), (0.8, 0.01), (0.9, 0.01)] {
        let exact = extra(pull / (1.0 - swing)) - extra(pull / (1.0 + swing));
        let found = creep(pull, swing);
        // Damping makes the block lag behind its load.
        assert_near(&format!("creep at {pull} of the limit, +-{swing}, x_m"), found, exact, 0.01 * exact);
    }
}
