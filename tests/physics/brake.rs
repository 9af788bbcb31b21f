//! Creep with the default solver: a slip within the brake of eq. (2.8) is steady and right at any v_min.

use crate::common::{Case, Run};
use demhybrid::math::vector::Vec3;

const R: f64 = 0.1;
const G: f64 = 9.81;
/// Effective coefficient of a contact at rest, phi/rho_0.
const PHI_STATIC: f64 = 0.2 / 0.58;
const V_MINS: [f64; 6] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5];

/// The slip over v_min at which Sigma is `share`, by bisection of eq. (2.8).
fn slip_of(share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let s: f64 = 0.5 * (low + high);
        if 3.0 * s.powi(2) - 2.0 * s.powi(3) < share { low = s } else { high = s }
    }
    low
}

/// A sphere on a floor under gravity that leans by `degrees`, with the default solver.
fn sphere(degrees: f64, rotation: bool, v_min: f64) -> Case {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let gap = -(G * cos / (0.58 * 10.0)).ln() / 150.0;
    let case = Case::defaults().set("gravity", [G * sin, 0.0, -G * cos]).rough(rotation);
    case.set("friction.regularization_velocity", v_min).floor().sphere(Vec3::z() * (R + gap), Vec3::zeros())
}

/// Mean and largest slip of `run` in its second half, over v_min.
fn slip(run: &Run, v_min: f64) -> [f64; 2] {
    let half = &run.frames[run.frames.len() / 2..];
    let slips: Vec<f64> = half.iter().map(|frame| (frame.v[0].x - R * frame.omega[0].y) / v_min).collect();
    let largest = slips.iter().fold(0.0f64, |most, slip| most.max(slip.abs()));
    [slips.iter().sum::<f64>() / slips.len() as f64, largest]
}

#[test]
fn slopes_creep_and_roll_as_the_brake_says_at_any_v_min() {
    for v_min in V_MINS {
        for (degrees, rotation) in
            [(2.0, false), (10.0, false), (18.0, false), (2.0, true), (10.0, true), (30.0, true)]
        {
            let run = sphere(degrees, rotation, v_min).set("t_end", 2.0).set("output.interval", 0.01).run();
            let tangent = f64::tan(degrees.to_radians());
            let exact = slip_of(if rotation { 2.0 / 7.0 * tangent } else { tangent } / PHI_STATIC);
            let [mean, largest] = slip(&run, v_min);
            let rhs = run.end().counts.rhs;
            println!(
                "{v_min:.0e} m/s, {degrees} degrees, rotation {rotation}: slip {:.4} of the exact one, \
                 {:.4} at most, {rhs} right-hand sides",
                mean / exact,
                largest / exact
            );
            // A step errs by 0.4 v_min at the tolerance, and comes to rest at a tenth of it.
            assert!((mean - exact).abs() < 0.01, "{mean} is not {exact} v_min");
            assert!(largest < exact + 0.04, "shivers: {largest} in place of {exact} v_min");
        }
    }
}

/// What the top of a pile of four sinks by from 1 s to `until` (s), and the right-hand sides.
fn sink_of_the_pile(v_min: f64, until: f64) -> [f64; 2] {
    let (a, h) = (0.2 / 3.0f64.sqrt(), R + 0.163_299_316_185_545_2);
    let base = [90.0f64, 210.0, 330.0].map(|angle| {
        let (sin, cos) = angle.to_radians().sin_cos();
        Vec3::new(a * cos, a * sin, R)
    });
    let case = Case::defaults()
        .heavy()
        .rough(true)
        .floor()
        .set("contact.stiffness_exponent", 1500.0)
        .set("contact.interaction_distance", 0.01)
        .set("friction.coefficient", 0.4)
        .set("friction.regularization_velocity", v_min)
        .set("t_end", until)
        .set("output.interval", 0.5);
    let run =
        base.into_iter().chain([Vec3::z() * h]).fold(case, |case, x| case.sphere(x, Vec3::zeros())).run();
    [run.frames[2].x[3].z - run.end().x[3].z, run.end().counts.rhs as f64]
}

#[test]
fn a_pile_of_four_sinks_in_proportion_to_v_min() {
    // From 1 s to 20 s. Merson's method at a tolerance of 1e-5 down to 3e-4 m/s. Below it the default method
    // with errors of velocity of 0.03 v_min a step.
    let table = [
        (1e-2, 8.130e-2),
        (3e-3, 1.50648e-2),
        (1e-3, 4.4884e-3),
        (3e-4, 1.31374e-3),
        (1e-4, 4.4669e-4),
        (3e-5, 1.3781e-4),
    ];
    for (v_min, converged) in table {
        let [sink, rhs] = sink_of_the_pile(v_min, 20.0);
        println!("{v_min:.0e} m/s: sinks by {sink:.6e} m, converged {converged:e} m, {rhs} right-hand sides");
        assert!((sink / converged - 1.0).abs() < 2e-3, "{sink} m in place of {converged} m");
    }
    // At a tolerance of 0.1 it takes 128 468, and the pile sinks 4.5 times as far.
    assert!(sink_of_the_pile(3e-4, 20.0)[1] < 80_000.0);
}
