//! What the program owes its user on top of the equations: effects that are off change nothing, output
//! changes nothing, nothing flies through anything, directions are alike, and what cannot be computed is an
//! error.

use crate::common::{Case, Run, Snapshot, run, run_law, run_unturnable};
use demhybrid::error::Error;
use demhybrid::math::vector::Vec3;
use demhybrid::model::contact::{Coulomb, Dissipative, Elastic, Frictionless, Turning};
use demhybrid::scene::Scene;
use demhybrid::scene::effects::law;
use nalgebra::Rotation3;

const R: f64 = 0.1;

/// 27 spheres fall into a small box until most touch.
fn many() -> Case {
    Case::config("quick.toml").set("t_end", 0.4)
}

/// The rebound function of the scene, also where nothing is lost.
fn dissipative(scene: &Scene) -> Dissipative {
    let law = law(scene);
    Dissipative::new(law.e, law.psi)
}

/// The friction of the scene, also where its coefficient is 0.
fn coulomb(scene: &Scene) -> Coulomb {
    let law = law(scene);
    Coulomb::new(law.phi, law.v_min)
}

/// Same states, to the bit, in all frames, and same work.
fn assert_same(a: &Run, b: &Run) {
    assert!(a.end().largest_overlap > 0.0, "nothing touches");
    assert_eq!(a.outcome.counts, b.outcome.counts);
    assert_eq!(a.bits(), b.bits());
}

#[test]
fn friction_with_a_zero_coefficient_is_no_friction() {
    let (scene, start) = many().set("friction.coefficient", 0.0).build();
    let (rebound, friction) = (dissipative(&scene), coulomb(&scene));
    let run = run_law(&scene, &start, rebound, Frictionless).unwrap();
    assert_same(&run, &run_law(&scene, &start, rebound, friction).unwrap());
    // With rotation on, too: without friction there is no torque.
    assert_same(&run, &run_law(&scene, &start, rebound, Turning(friction)).unwrap());
}

#[test]
fn spheres_that_no_torque_can_turn_are_locked() {
    let (scene, start) = many().build();
    let (rebound, friction) = (dissipative(&scene), coulomb(&scene));
    let locked = run_law(&scene, &start, rebound, friction).unwrap();
    assert_same(&locked, &run_unturnable(&scene, &start, rebound, Turning(friction)).unwrap());
    // With their own inertia they do turn.
    let turning = run_law(&scene, &start, rebound, Turning(friction)).unwrap();
    assert!(turning.end().omega.iter().any(|omega| omega.norm() > 1.0));
}

#[test]
fn the_stabilised_method_leaves_out_weak_contacts_and_the_others_nothing() {
    // Two spheres at rest with a gap of 0.08 m, where the repulsion is 6e-5 N.
    let pair = |method: &str| {
        Case::tight()
            .rough(true)
            .set("t_end", 0.1)
            .set("contact.interaction_distance", 0.1)
            .set("solver.method", method)
            .set("solver.norm", "scaled")
            .set("solver.velocity_scale", 1.0)
            .set("solver.tolerance", 0.1)
            .set("solver.max_step", 1e-3)
            .sphere(Vec3::zeros(), Vec3::zeros())
            .sphere(Vec3::new(0.28, 0.0, 0.0), Vec3::zeros())
    };
    let left_out = pair("chebyshev").run();
    // The start, and its stiffness in a dozen right-hand sides, are evaluated before a method is at work: its
    // slope must not get into the steps.
    let counts = left_out.outcome.counts;
    assert!(counts.pairs <= 13 && counts.rhs > 200, "{counts:?}");
    assert_eq!(left_out.end().v, [Vec3::zeros(); 2]);
    for all in [pair("chebyshev").set("solver.neglected_force", 0.0), pair("merson"), pair("auto")] {
        let run = all.run();
        assert_eq!(run.outcome.counts.pairs, run.outcome.counts.rhs);
        // Both accelerate by nearly F/m for 0.1 s.
        let expected = 10.0 * (-12.0f64).exp() * 0.1 * 0.58;
        assert!((run.end().v[1].x - expected).abs() < 1e-2 * expected, "{}", run.end().v[1].x);
    }
}

#[test]
fn full_restitution_is_no_loss() {
    let (scene, start) = many().set("contact.restitution", 1.0).build();
    let friction = Turning(coulomb(&scene));
    let run = run_law(&scene, &start, dissipative(&scene), friction).unwrap();
    assert_same(&run, &run_law(&scene, &start, Elastic, friction).unwrap());
}

#[test]
fn a_scene_runs_with_the_kernel_of_its_effects() {
    // Against the kernel written out by hand, for a variant each.
    let (scene, start) = many().build();
    let (rebound, friction) = (dissipative(&scene), coulomb(&scene));
    assert_same(&many().run(), &run_law(&scene, &start, rebound, Turning(friction)).unwrap());
    let locked = many().set("friction.rotation", false);
    assert_same(&locked.run(), &run_law(&scene, &start, rebound, friction).unwrap());
    let basic = many().set("friction.coefficient", 0.0).set("contact.restitution", 1.0);
    assert_same(&basic.run(), &run_law(&scene, &start, Elastic, Frictionless).unwrap());
}

#[test]
fn the_result_does_not_depend_on_the_output_interval() {
    let with = |interval: f64| many().set("output.interval", interval).run();
    let rare = with(0.5);
    assert_eq!(rare.frames.len(), 2);
    for interval in [0.013, 1e-3] {
        let often = with(interval);
        assert_eq!(often.frames.len(), (0.4 / interval).ceil() as usize + 1);
        assert_eq!(rare.end().bits(), often.end().bits(), "interval {interval} s");
        let steps = |run: &Run| (run.outcome.counts.accepted, run.outcome.counts.rejected);
        assert_eq!(steps(&rare), steps(&often), "interval {interval} s");
    }
}

/// A sphere thrown with `v` (m/s) at the floor, with the step control as good as off.
fn thrown(tolerance: f64, v: f64) -> Case {
    Case::tight()
        .set("contact.interaction_distance", 0.1)
        .set("solver.tolerance", tolerance)
        .set("solver.initial_step", 1.0)
        .set("t_end", 3.0 / v)
        .set("output.interval", 0.01 / v)
        .floor()
        .sphere(Vec3::new(0.2, 0.1, 1.0), Vec3::new(0.1 * v, 0.0, -v))
}

/// Energy (J) that brings two surfaces `depth` (m) into each other: (F_0/kappa) e^{kappa depth}.
fn barrier(kappa: f64, depth: f64) -> f64 {
    10.0 / kappa * (kappa * depth).exp()
}

#[test]
fn no_sphere_passes_a_wall_at_any_tolerance() {
    for (kappa, l_max) in [(150.0, 0.1), (500.0, 0.02)] {
        for v in [20.0, 100.0] {
            assert!(barrier(kappa, R) > 0.5 * v * v, "the wall is too weak to hold the sphere");
            for tolerance in [0.1, 1e6, 1e12, 1e300] {
                let case = thrown(tolerance, v)
                    .set("contact.stiffness_exponent", kappa)
                    .set("contact.interaction_distance", l_max);
                let run = case.run();
                let name = format!("kappa = {kappa}, v = {v}, tolerance = {tolerance}");
                let lowest = run.frames.iter().map(|frame| frame.x[0].z).fold(f64::INFINITY, f64::min);
                assert!(lowest > 0.0, "{name}: centre at {lowest} m");
                let end = run.end();
                assert!(end.x[0].z > 0.0 && end.v[0].z > 0.0, "{name}: {} {}", end.x[0], end.v[0]);
            }
        }
    }
}

#[test]
fn no_sphere_passes_another_at_any_tolerance() {
    for (kappa, l_max) in [(150.0, 0.1), (500.0, 0.02)] {
        for v in [20.0, 100.0] {
            assert!(barrier(kappa, 2.0 * R) > 0.25 * v * v, "the spheres are too weak");
            for tolerance in [0.1, 1e6, 1e12, 1e300] {
                let run = Case::tight()
                    .set("contact.stiffness_exponent", kappa)
                    .set("contact.interaction_distance", l_max)
                    .set("solver.tolerance", tolerance)
                    .set("solver.initial_step", 1.0)
                    .set("t_end", 3.0 / v)
                    .set("output.interval", 0.01 / v)
                    .sphere(Vec3::new(-0.5, 0.0, 0.0), Vec3::x() * v)
                    .sphere(Vec3::new(0.5, 0.0, 0.0), Vec3::zeros())
                    .run();
                let name = format!("kappa = {kappa}, v = {v}, tolerance = {tolerance}");
                for frame in &run.frames {
                    assert!(frame.x[1].x > frame.x[0].x, "{name}: passed by t = {}", frame.time);
                }
                let end = run.end();
                assert!(end.v[1].x > end.v[0].x, "{name}: they do not part");
                assert!(end.v[1].x > 0.4 * v, "{name}: the second was not hit");
            }
        }
    }
}

#[test]
fn coincident_centres_are_an_error_that_names_them() {
    let case = Case::tight()
        .sphere(Vec3::x(), Vec3::zeros())
        .sphere(Vec3::y(), Vec3::zeros())
        .sphere(Vec3::z(), Vec3::zeros())
        .sphere(Vec3::y() * 2.0, Vec3::z());
    // A program that makes its own particles need not check them first.
    let (scene, mut start) = case.build();
    start.x[3] = start.x[1];
    let error = run(&scene, &start).unwrap_err();
    assert_eq!(error, Error::Coincident { i: 1, j: 3, t: 0.0 });
    assert_eq!(error.exit_code(), 3);
}

#[test]
fn a_force_between_spheres_beyond_a_double_is_an_error_that_names_them() {
    // 5000/m times an overlap of 0.15 m is 750: exp overflows beyond 709.
    let case = Case::tight()
        .set("contact.stiffness_exponent", 5000.0)
        .sphere(Vec3::y(), Vec3::zeros())
        .sphere(Vec3::x() * 0.05, Vec3::zeros())
        .sphere(Vec3::zeros(), Vec3::zeros());
    let error = case.try_run().unwrap_err();
    let Error::PairForce { i: 1, j: 2, overlap, t: 0.0 } = error else { panic!("{error:?}") };
    // Two roundings of lengths below 0.2 m.
    assert!((overlap - 0.15).abs() < 1e-15, "{overlap}");
    assert_eq!(error.exit_code(), 3);
}

#[test]
fn a_force_by_a_wall_beyond_a_double_is_an_error_that_names_it() {
    let case = Case::tight()
        .set("contact.stiffness_exponent", 10000.0)
        .wall(Vec3::z() * 9.0, Vec3::z())
        .floor()
        .sphere(Vec3::new(0.0, 1.0, 5.0), Vec3::zeros())
        .sphere(Vec3::z() * 0.02, Vec3::zeros());
    let error = case.try_run().unwrap_err();
    let Error::WallForce { i: 1, ref wall, overlap, t: 0.0 } = error else { panic!("{error:?}") };
    assert!(wall.starts_with("container.wall[1] (point (0, 0, 0) m"), "{wall}");
    // Two roundings of lengths below 0.1 m.
    assert!((overlap - 0.08).abs() < 1e-16, "{overlap}");
    assert_eq!(error.exit_code(), 3);
}

#[test]
fn a_tolerance_below_round_off_ends_the_run_with_an_error() {
    let case = Case::config("quick.toml").set("solver.tolerance", 1e-30);
    let error = case.try_run().unwrap_err();
    let Error::BelowRoundOff { tolerance, forced, accepted, t, min_step, i, .. } = error else {
        panic!("{error:?}")
    };
    assert_eq!((tolerance, min_step), (1e-30, 1e-9));
    assert!(forced >= 1000 && accepted >= forced && t > 0.0 && i < 27, "{error:?}");
    assert_eq!(error.exit_code(), 3);
}

#[test]
fn a_start_that_presses_spheres_together_is_the_cause_that_is_told() {
    // Cells of 0.05 m: spheres overlap by up to 1.5 of their radius.
    let case =
        Case::config("settle.toml").set("particles.grid.spacing", 0.05).set("particles.grid.jitter", 0.004);
    let error = case.set("t_end", 0.01).try_run().unwrap_err();
    let Error::Pressed { overlap, share, force, min_step, enough, .. } = error else { panic!("{error:?}") };
    assert!((overlap / 0.1 - share).abs() < 1e-12 && share > 1.4 && min_step == 1e-9, "{error:?}");
    assert!((force / (10.0 * (150.0 * overlap).exp()) - 1.0).abs() < 1e-12, "{error:?}");
    assert_eq!(error.exit_code(), 3);
    assert!(error.to_string().contains("of the radius), which pushes them apart with"), "{error}");
    // kappa F_0 exp(kappa l) (1e-6 s)^2 = 2 m: l = ln(2e12/1500)/150 = 0.14 m.
    assert!((enough - (2e12f64 / 1500.0).ln() / 150.0).abs() < 1e-12, "{enough}");
    assert!(error.to_string().contains("overlaps of 0.14 m or less, or solver.min_step = "), "{error}");
}

#[test]
fn a_state_beyond_arithmetic_is_told_with_its_particle_and_its_size() {
    let spinning = Case::defaults().rough(true).floor().set("solver.method", "velocity-verlet");
    let spinning = spinning.set("solver.step", 1e-4).sphere(Vec3::z() * 0.2, Vec3::zeros());
    let (scene, mut start) = spinning.sphere(Vec3::z() * 0.099, Vec3::zeros()).build();
    start.omega[1] = [1e308, 0.0, 0.0];
    let error = run(&scene, &start).unwrap_err();
    let Error::OutOfRange { i: 1, spin, t: 0.0, .. } = error else { panic!("{error:?}") };
    assert!((spin / 1e308 - 1.0).abs() < 1e-12, "{spin}");
    assert_eq!(error.exit_code(), 3);
    // A speed that no step can follow takes it through the floor.
    let thrown = Case::defaults().floor().set("solver.method", "velocity-verlet").set("solver.step", 1e-3);
    let error = thrown.sphere(Vec3::z() * 0.2, Vec3::z() * -1e6).try_run().unwrap_err();
    let Error::BeyondWall { i: 0, ref wall, beyond, .. } = error else { panic!("{error:?}") };
    assert!(beyond > 900.0 && wall.starts_with("container.wall[0]"), "{beyond} {wall}");
    assert_eq!(error.exit_code(), 3);
}

#[test]
fn steps_that_only_the_minimum_lets_pass_are_counted() {
    // Beyond l_max = 0.1 m with kappa = 30 the force jumps by 0.5 N, which no step resolves to 1e-6 m/s^2:
    // one step passes unresolved on the way in, and one on the way out.
    let run = Case::config("bounce.toml").set("contact.stiffness_exponent", 30.0).set("t_end", 2.5).run();
    let forced = run.outcome.counts.forced;
    assert!((1..=2).contains(&forced), "{forced} forced");
    // Where the jump, 1e-12 N, is below the tolerance, no step is forced.
    let smooth = Case::tight().floor().heavy().sphere(Vec3::z(), Vec3::zeros()).set("t_end", 0.8).run();
    assert!(smooth.end().v[0].z > 0.0);
    assert_eq!(smooth.outcome.counts.forced, 0);
}

#[test]
fn a_turned_scene_gives_the_turned_result() {
    // Two rubbing spheres fall into a corner of three planes and hit each other there.
    let end = |turn: Rotation3<f64>| {
        let mut case = Case::tight().rough(true).set("t_end", 0.5);
        let gravity: [f64; 3] = (turn * Vec3::new(0.0, 0.0, -9.81)).into();
        case = case.set("gravity", gravity);
        for normal in [-Vec3::x(), -Vec3::y(), -Vec3::z()] {
            case = case.wall(Vec3::zeros(), turn * normal);
        }
        let first = turn * Vec3::new(0.15, 0.2, 0.3);
        let second = turn * Vec3::new(0.3, 0.17, 0.55);
        let run = case
            .spinning_sphere(first, turn * Vec3::new(-1.0, -0.5, 0.0), turn * Vec3::new(5.0, 1.0, 0.0))
            .sphere(second, turn * Vec3::new(-0.5, 0.2, -2.0))
            .run();
        let back = turn.inverse();
        let end = run.end().clone();
        end.x.iter().chain(&end.v).chain(&end.omega).map(|vector| back * vector).collect::<Vec<Vec3>>()
    };
    let plain = end(Rotation3::identity());
    assert!(plain[4].norm() > 0.1 && plain[5].norm() > 0.1, "they do not spin: {plain:?}");
    let turned = end(Rotation3::from_euler_angles(0.4, -1.1, 2.3));
    for (plain, turned) in plain.iter().zip(&turned) {
        // Steps differ, because the error is measured along the axes: 1e-9 of error rate, amplified by
        // collisions, in rad/s tenfold more than in m/s.
        assert!((plain - turned).norm() < 2e-7, "{plain} became {turned}");
    }
}

#[test]
fn a_sphere_that_leaves_through_an_open_side_flies_on() {
    let (x, v) = (Vec3::new(0.3, 0.5, 0.6), Vec3::new(-40.0, 0.0, 30.0));
    let run = Case::tight()
        .rough(true)
        .heavy()
        .set("container.box.min", [f64::NEG_INFINITY, 0.0, 0.0])
        .set("t_end", 3.0)
        .set("output.interval", 0.1)
        .sphere(Vec3::new(0.5, 0.2, 0.15), Vec3::zeros())
        .sphere(x, v)
        .run();
    for frame in &run.frames {
        let t = frame.time;
        assert_eq!(frame.x.len(), 2);
        let parabola = x + v * t + Vec3::new(0.0, 0.0, -9.81) * (0.5 * t * t);
        // Merson is exact on a parabola; some 10 000 steps each round 100 m: 1e-10 m.
        assert!((frame.x[1] - parabola).norm() < 1e-9, "{} at t = {t}, not {parabola}", frame.x[1]);
        assert!((frame.x[0] - Vec3::new(0.5, 0.2, 0.1)).norm() < 0.06, "the other one left: {}", frame.x[0]);
    }
    assert!(run.end().x[1].x < -100.0);
}

#[test]
fn a_frame_at_the_moment_when_centres_pass_through_each_other_does_not_end_the_run() {
    // Forces too weak to matter: two spheres 0.5 m apart that close at 8 m/s share one centre at 1/16 s,
    // where the steps of 1/256 s, limited by travel, have no stage but the frame has one.
    let run = |interval: f64| {
        let step = 1.0 / 256.0;
        Case::tight()
            .sphere(Vec3::z() * 0.75, Vec3::z() * 4.0)
            .sphere(Vec3::z() * 1.25, Vec3::z() * -4.0)
            .set("contact.repulsion_at_contact", 1e-300)
            .set("solver.max_step", step)
            .set("solver.initial_step", step)
            .set("output.interval", interval)
            .set("t_end", 0.1)
            .run()
    };
    let (at_the_moment, beside) = (run(0.0625), run(0.01));
    assert_eq!(at_the_moment.frames[1].time, 0.0625);
    assert!((at_the_moment.frames[1].x[0].z - 1.0).abs() < 1e-12);
    assert_eq!(at_the_moment.end().x, beside.end().x);
}

/// 15 drops or head-on pairs at contacts of this hardness, with the default solver.
///
/// Returns the largest rise of energy from one frame to a later one, over the largest kinetic energy.
fn largest_rise(hardness: f64, restitution: f64, pair: bool) -> f64 {
    let kappa = hardness / R;
    let rise = |drop: u32| {
        let height = 0.05 + 0.95 * f64::from(drop) / 14.0;
        let case = Case::defaults()
            .set("t_end", 1.5)
            .set("output.interval", 0.01)
            .set("contact.stiffness_exponent", kappa)
            .set("contact.restitution", restitution)
            .set("contact.interaction_distance", 20.0 / kappa);
        let case = if pair {
            let speed = (2.0 * 9.81 * height).sqrt();
            let coming = Vec3::new(0.0, 0.0, 2.0 * R + height);
            case.sphere(Vec3::zeros(), Vec3::zeros()).sphere(coming, -speed * Vec3::z())
        } else {
            case.heavy().floor().sphere(Vec3::new(0.0, 0.0, R + height), Vec3::zeros())
        };
        rise_of(&case.run().frames)
    };
    (0..15).map(rise).fold(0.0, f64::max)
}

/// The largest rise of energy from one frame to a later one, over the largest kinetic energy.
fn rise_of(frames: &[Snapshot]) -> f64 {
    let most = frames.iter().map(|frame| frame.kinetic_energy).fold(0.0, f64::max);
    let rises = frames.iter().scan(f64::INFINITY, |least, frame| {
        *least = least.min(frame.energy());
        Some(frame.energy() - *least)
    });
    rises.fold(0.0, f64::max) / most
}

#[test]
fn an_impact_is_never_within_one_step_however_hard_the_contact() {
    for hardness in [150.0, 500.0, 1_000.0, 3_000.0, 1e4, 1e5] {
        for restitution in [0.4, 1.0] {
            for pair in [false, true] {
                let rise = largest_rise(hardness, restitution, pair);
                println!("kappa r = {hardness}, e = {restitution}, pair {pair}: {rise:.1e}");
                assert!(rise < 0.01, "kappa r = {hardness}, e = {restitution}, pair {pair}: {rise}");
            }
        }
    }
}

#[test]
fn a_sphere_that_rests_on_a_hard_floor_is_not_thrown() {
    // At rest, contacts of e = 0 ring, and steps are at the edge of stability. Where 1/kappa is 1e-5 r, an
    // error that is small beside the radius is a contact with 1e6 times the force.
    for drop in 0..15 {
        let height = 0.05 * 20f64.powf(f64::from(2 * drop + 1) / 29.0);
        let case = Case::defaults()
            .set("t_end", 1.5)
            .set("output.interval", 0.015)
            .set("contact.stiffness_exponent", 1e5 / R)
            .set("contact.restitution", 0.0)
            .set("contact.interaction_distance", 30.0 * R / 1e5)
            .rough(true)
            .heavy()
            .floor()
            .sphere(Vec3::new(0.0, 0.0, R + height), 0.3 * Vec3::x());
        let rise = rise_of(&case.run().frames);
        println!("drop {drop}: {rise:.1e}");
        assert!(rise < 1e-4, "drop {drop}: {rise}");
    }
}

#[test]
fn an_elastic_pair_that_rubs_with_memory_gains_nothing() {
    // The step into this impact leaves the memory at twice its limit.
    for run in 0..10 {
        let height = 0.05 * 20f64.powf(f64::from(run) / 9.0);
        let speed = (2.0 * 9.81 * height).sqrt();
        let case = Case::defaults()
            .set("t_end", 1.0)
            .set("output.interval", 0.01)
            .set("contact.stiffness_exponent", 150.0 / R)
            .set("contact.restitution", 1.0)
            .set("contact.interaction_distance", 0.02)
            .set("friction.law", "history")
            .set("friction.coefficient", 0.345)
            .spinning_sphere(Vec3::zeros(), 0.5 * speed * Vec3::x(), Vec3::new(3.0, 1.0, -2.0))
            .spinning_sphere(
                Vec3::new(0.2 + 0.3 * speed, 0.09, 0.05),
                -0.5 * speed * Vec3::x(),
                Vec3::new(0.0, 5.0, 2.0),
            );
        let rise = rise_of(&case.run().frames);
        println!("pair {run}: {rise:.1e}");
        assert!(rise < 1e-3, "pair {run}: {rise}");
    }
}
