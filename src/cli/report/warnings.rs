//! Warnings for the user: of doubtful scenes before a run, and of doubtful results after it.

use super::monitor::Monitor;
use crate::domain::Comm;
use crate::engine::simulation::{FrameSummary, Outcome, friction_tolerance, tightening};
use crate::math::digits::short;
use crate::math::vector::Vec3;
use crate::model::effects::{Effects, FrictionLaw, Variant};
use crate::ode::{Limit, NormName};
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::stop::Rest;
use crate::scene::walls::described_walls;

/// Warnings about a scene and its particles that can be given before a run.
pub fn forewarnings(scene: &Scene, start: &InitialCondition) -> Vec<String> {
    let mut warnings = double_wall_warnings(scene);
    warnings.extend(unused_key_warnings(scene));
    warnings.extend(cut_force_warning(scene));
    warnings.extend(wall_barrier_warning(scene, start));
    warnings.extend(pair_barrier_warning(scene, start));
    warnings.extend(loose_tolerance_warning(scene, start).or_else(|| shivering_warning(scene, start)));
    warnings.extend(long_window_warning(scene, start));
    warnings
}

/// Tells which keys of [friction] the law of friction does not use.
fn unused_key_warnings(scene: &Scene) -> Vec<String> {
    let Some(friction) = &scene.friction else { return Vec::new() };
    let given = |unused: &[(&str, Option<f64>)], law: &str| {
        let given = unused.iter().filter_map(|&(key, value)| Some((key, value?)));
        let warning = |(key, value)| {
            format!("warning: friction.{key} = {value} is not used by friction.law = \"{law}\": leave it out")
        };
        given.map(warning).collect()
    };
    match friction.law {
        FrictionLaw::History => {
            given(&[("regularization_velocity", friction.regularization_velocity)], "history")
        }
        FrictionLaw::Regularized => {
            let unused = [("stiffness_ratio", friction.stiffness_ratio), ("damping", friction.damping)];
            given(&unused, "regularized")
        }
    }
}

/// Warns if `l_max` cuts off a force that is not small, and names an `l_max` that is large enough.
fn cut_force_warning(scene: &Scene) -> Option<String> {
    let contact = &scene.contact;
    let g = scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let weight = scene.particles.mass * g;
    let (scale, name) = if weight > 0.0 {
        (weight, "the weight of a particle")
    } else {
        (contact.repulsion_at_contact, "F_0")
    };
    let cut =
        contact.repulsion_at_contact * (-contact.stiffness_exponent * contact.interaction_distance).exp();
    let enough = (contact.repulsion_at_contact / (1e-3 * scale)).ln() / contact.stiffness_exponent;
    (cut > 1e-3 * scale).then(|| {
        format!(
            "warning: contact.interaction_distance = {} m cuts off a force of {cut:.3e} N, which is {:.1e} \
             of {name}: step control and energy will suffer; {:.4} m or more would do",
            contact.interaction_distance,
            cut / scale,
            // Rounded up, so that the number printed is enough.
            (enough * 1e4).ceil() / 1e4
        )
    })
}

/// Warns of every two walls in the same plane: each of them pushes and rubs.
fn double_wall_warnings(scene: &Scene) -> Vec<String> {
    let walls = described_walls(&scene.container);
    let mut warnings = Vec::new();
    for (k, (b, second)) in walls.iter().enumerate() {
        // Equal except for rounding. The limit is far below any length that matters.
        let same = walls[..k].iter().find(|(a, _)| (a.normal - b.normal).norm() < 1e-12 && a.coincides(b));
        warnings.extend(same.map(|(_, first)| {
            format!("warning: {second} is the same plane as {first}: its force counts twice")
        }));
    }
    warnings
}

/// Warns if spheres overlap deeply before anything has moved; `overlap` is the largest overlap, m.
pub fn overlap_warning(scene: &Scene, overlap: f64) -> Option<String> {
    let share = overlap / scene.particles.radius;
    (share > 0.3).then(|| {
        format!(
            "warning: at the start spheres overlap each other or a wall by up to {overlap:.3e} m, {share:.2} \
             of the radius: they will fly apart"
        )
    })
}

/// Energy (J) that it takes to push two bodies `depth` (m) closer together than touching.
///
/// With `depth` = r the centre of a sphere is in the plane of a wall. With `depth` = 2 r the centres of a
/// pair coincide. The cut at l_max is neglected.
fn barrier(scene: &Scene, kappa: f64, depth: f64) -> f64 {
    scene.contact.repulsion_at_contact / kappa * (kappa * depth).exp()
}

/// The least kappa (1/m) above the scene's for which the barrier is `energy` (J); three digits, rounded up.
fn kappa_that_would_do(scene: &Scene, depth: f64, energy: f64) -> f64 {
    // From kappa = 1/depth on, the barrier grows with kappa.
    let mut low = scene.contact.stiffness_exponent.max(1.0 / depth);
    let mut high = low;
    while barrier(scene, high, depth) < energy {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if barrier(scene, middle, depth) < energy { low = middle } else { high = middle }
    }
    let unit = 10f64.powf(high.log10().floor() - 2.0);
    (high / unit).ceil() * unit
}

/// Squared speed (m^2/s^2) with which a body arrives at a plane under gravity alone; none if it never does.
///
/// `v` is the velocity of the body (m/s), `n` the normal of the plane, away from the body. `depth` is the
/// distance of the body from the plane (m).
fn arrival(scene: &Scene, v: &[f64; 3], n: &[f64; 3], depth: f64) -> Option<f64> {
    let along = |a: &[f64; 3]| a.iter().zip(n).map(|(a, n)| a * n).sum::<f64>();
    let (v_n, g_n) = (along(v), along(&scene.gravity));
    let squared = v_n * v_n + 2.0 * g_n * depth;
    ((v_n > 0.0 || g_n > 0.0) && squared > 0.0).then_some(squared)
}

/// Warns if a single sphere can arrive at a wall with more energy than the barrier of the wall.
///
/// Its centre then goes beyond the plane. The force keeps growing there, so that the sphere comes back.
fn wall_barrier_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let r = scene.particles.radius;
    let walls = described_walls(&scene.container);
    let mut worst = (0.0, 0, "");
    for (i, (x, v)) in start.x.iter().zip(&start.v).enumerate() {
        for (wall, name) in &walls {
            let depth = wall.depth(&Vec3::from(*x));
            if let Some(squared) = arrival(scene, v, &wall.normal.into(), depth)
                && squared > worst.0
            {
                worst = (squared, i, name);
            }
        }
    }
    let (squared, i, name) = worst;
    let energy = 0.5 * scene.particles.mass * squared;
    let barrier = barrier(scene, scene.contact.stiffness_exponent, r);
    (barrier < energy).then(|| {
        format!(
            "warning: particle {i} can meet {name} with {energy:.3e} J, and the barrier (F_0/kappa) \
             e^(kappa r) of a wall is {barrier:.3e} J: centres will go beyond it and come back; \
             contact.stiffness_exponent = {} 1/m or more would do",
            short(kappa_that_would_do(scene, r, energy))
        )
    })
}

/// Warns if two spheres can meet with more energy than their barrier. They then pass through each other.
///
/// The closing speed is the largest difference between velocities at the start, or the largest speed of a
/// fall onto a sphere at rest, whichever is larger.
fn pair_barrier_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    if start.x.len() < 2 {
        return None;
    }
    let walls = described_walls(&scene.container);
    let square = |v: &[f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
    let falls = start.x.iter().zip(&start.v).map(|(x, v)| {
        let gains = walls.iter().map(|(wall, _)| {
            let g_n = wall.normal.dot(&Vec3::from(scene.gravity));
            2.0 * g_n * wall.depth(&Vec3::from(*x))
        });
        square(v) + gains.fold(0.0, f64::max)
    });
    let range = |axis: usize| {
        let (low, high) = start
            .v
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v[axis]), high.max(v[axis])));
        high - low
    };
    let squared = falls.fold(square(&[range(0), range(1), range(2)]), f64::max);
    // The reduced mass is half the mass of a sphere.
    let energy = 0.25 * scene.particles.mass * squared;
    let depth = 2.0 * scene.particles.radius;
    let barrier = barrier(scene, scene.contact.stiffness_exponent, depth);
    (barrier < energy).then(|| {
        format!(
            "warning: two particles can meet at {} m/s, with {energy:.3e} J, and the barrier (F_0/kappa) \
             e^(2 kappa r) of a pair is {barrier:.3e} J: they will pass through each other; \
             contact.stiffness_exponent = {} 1/m or more would do",
            short(squared.sqrt()),
            short(kappa_that_would_do(scene, depth, energy))
        )
    })
}

/// Warns if the tolerance allows a single step to be entirely wrong.
///
/// In the scaled norm this is an error of a radius or of the velocity scale v. In the paper's norm it is
/// kappa v^2, the acceleration of a contact at that speed.
fn loose_tolerance_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let tolerance = scene.solver.tolerance.filter(|_| scene.solver.step.is_none())?;
    let v = initial_condition::velocity_scale(scene, start);
    let (most, wrong) = if scene.solver.norm == NormName::Paper {
        let most = scene.contact.stiffness_exponent * v * v;
        (most, format!("{} m/s^2, the acceleration of a contact", short(most)))
    } else {
        (1.0, "a whole radius".to_owned())
    };
    (tolerance * tightening(scene) >= most).then(|| {
        format!(
            "warning: solver.tolerance = {} does not control the step: it accepts steps that are wrong by \
             {wrong}; only how far a particle may move in a step does, and contacts may create energy; the \
             default is 0.1",
            short(tolerance)
        )
    })
}

/// Warns if the run is over before particles can have been at rest for long enough.
fn long_window_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let window = Rest::of(scene, initial_condition::velocity_scale(scene, start))?.window;
    (window >= scene.t_end).then(|| {
        format!(
            "warning: [stop] cannot end the run: its window of {} s (stop.window) is not shorter than t_end = \
             {} s",
            short(window),
            short(scene.t_end)
        )
    })
}

/// Warns if the tolerance of the scene is too loose for the brake of its friction.
fn shivering_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let tolerance = scene.solver.tolerance.filter(|_| scene.solver.step.is_none())?;
    let v_min = scene.friction.as_ref()?.regularization_velocity?;
    let scale = initial_condition::velocity_scale(scene, start);
    let enough = friction_tolerance(scene, scale, start.x.len() as u64);
    // Three digits, rounded down, so that the printed number is small enough.
    let unit = 10f64.powf(enough.log10().floor() - 2.0);
    (tolerance > enough).then(|| {
        format!(
            "warning: solver.tolerance = {} allows errors of {:.3e} m/s a step, {:.3e} times \
             friction.regularization_velocity: what should creep may shiver, and slide or sink many times \
             too fast; {} or less would do, or leave it out",
            short(tolerance),
            tolerance * scale,
            tolerance * scale / v_min,
            short((enough / unit).floor() * unit)
        )
    })
}

/// Share of the largest kinetic energy that the energy balance may gain without a warning.
const CREATED_SHARE: f64 = 1e-3;
/// The same share for a rise between frames: the default tolerance may cause it with one bouncing sphere.
const RISEN_SHARE: f64 = 1e-2;
/// The same share for a fall between frames, where no effect dissipates energy.
const LOST_SHARE: f64 = 1e-2;
/// Share of the energies in a balance that rounding may explain.
const ENERGY_ROUNDING: f64 = 1e-12;

/// Warns if the run has more energy than it can have, at the end or at a frame.
fn created_energy_warning(scene: &Scene, start: &InitialCondition, course: &FrameSummary) -> Option<String> {
    let largest = course.largest_kinetic_energy;
    let [rebound, friction] = course.dissipated;
    let rounding = ENERGY_ROUNDING * (course.start_energy.abs() + rebound + friction);
    let smaller = if scene.solver.step.is_some() { "solver.step" } else { "solver.tolerance" };
    let created = course.residual();
    if scene.output.energy && created > CREATED_SHARE * largest && created > rounding {
        return Some(format!(
            "warning: energy at the end and dissipated energy are {created:.3e} J more than there was at the \
             start, {:.1e} of the largest kinetic energy: no contact creates energy, so the steps are too \
             coarse for the motion, or for the integral of what it dissipates; a smaller {smaller} would \
             help",
            created / largest
        ));
    }
    // A bed at rest has almost no kinetic energy. One particle at the velocity scale is the least scale.
    let least = scene.particles.mass * initial_condition::velocity_scale(scene, start).powi(2);
    let (created, scale) = (course.largest_rise, largest.max(least));
    (created > RISEN_SHARE * scale && created > rounding).then(|| {
        format!(
            "warning: energy was created: at a frame it was {created:.3e} J more than at one before, {:.1e} \
             of the largest kinetic energy; no contact creates energy, so the steps are too coarse for the \
             motion; a smaller {smaller} would help",
            created / scale
        )
    })
}

/// Warns if energy is gone that no effect of the scene dissipates.
fn lost_energy_warning(scene: &Scene, start: &InitialCondition, course: &FrameSummary) -> Option<String> {
    let effects = Effects::of(scene);
    if effects.dissipative || effects.variant != Variant::Basic {
        return None;
    }
    let least = scene.particles.mass * initial_condition::velocity_scale(scene, start).powi(2);
    let (lost, scale) = (course.largest_fall, course.largest_kinetic_energy.max(least));
    let rounding = ENERGY_ROUNDING * course.start_energy.abs();
    let smaller = if scene.solver.step.is_some() { "solver.step" } else { "solver.tolerance" };
    (lost > LOST_SHARE * scale && lost > rounding).then(|| {
        format!(
            "warning: energy was lost: at a frame it was {lost:.3e} J less than at one before, {:.1e} of the \
             largest kinetic energy; with contact.restitution = 1 and without friction nothing dissipates \
             energy, so the steps are too coarse for the motion; a smaller {smaller} would help",
            lost / scale
        )
    })
}

/// Warnings of doubtful results after a run. Collective; the same on every rank.
pub fn doubts(
    comm: &dyn Comm,
    scene: &Scene,
    start: &InitialCondition,
    outcome: &Outcome,
    course: &FrameSummary,
    monitor: &Monitor,
) -> Vec<String> {
    let mut doubts = Vec::new();
    let counts = &outcome.counts;
    if counts.forced > 0 {
        doubts.push(format!(
            "warning: {} steps were accepted at solver.min_step = {:e} s with an error above \
             solver.tolerance",
            counts.forced, scene.solver.min_step
        ));
    }
    let share = outcome.largest_overlap / scene.particles.radius;
    if share > 0.3 {
        doubts.push(format!(
            "warning: the largest overlap is {share:.2} of the radius: the contacts are soft for this load; \
             a larger contact.stiffness_exponent makes them harder"
        ));
    }
    if loose_tolerance_warning(scene, start).is_some() {
        let by_error = Limit::ALL.iter().zip(counts.limits).find(|(limit, _)| **limit == Limit::Error);
        doubts.push(format!(
            "warning: the tolerance decided the size of {} of {} steps",
            by_error.map_or(0, |(_, steps)| steps),
            counts.accepted
        ));
    }
    doubts.extend(created_energy_warning(scene, start, course));
    doubts.extend(lost_energy_warning(scene, start, course));
    doubts.extend(monitor.warnings(comm));
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(extra: &[&str]) -> Scene {
        let text = include_str!("../../../configs/paper/settle.toml");
        let sets: Vec<String> = extra.iter().map(ToString::to_string).collect();
        Scene::parse("settle.toml", text, &sets).unwrap()
    }

    /// Particles at the given centres with the given velocities.
    fn bodies(list: &[[[f64; 3]; 2]]) -> InitialCondition {
        InitialCondition {
            x: list.iter().map(|&[x, _]| x).collect(),
            v: list.iter().map(|&[_, v]| v).collect(),
            omega: vec![[0.0; 3]; list.len()],
            ..InitialCondition::default()
        }
    }

    #[test]
    fn the_paper_cuts_off_nothing_that_matters() {
        assert_eq!(cut_force_warning(&scene(&[])), None);
        assert_eq!(cut_force_warning(&scene(&["gravity=[0,0,0]"])), None);
    }

    #[test]
    fn a_cut_force_is_warned_of_with_the_distance_that_would_do() {
        let warning = cut_force_warning(&scene(&["contact.stiffness_exponent=30"])).unwrap();
        // 10 exp(-30 l) = 9.81e-3 at l = 0.230897 m.
        assert!(
            warning.contains("contact.interaction_distance = 0.1 m") && warning.contains("0.2309 m"),
            "{warning}"
        );
        let enough = scene(&["contact.stiffness_exponent=30", "contact.interaction_distance=0.2309"]);
        assert_eq!(cut_force_warning(&enough), None);
        let weightless = scene(&["contact.stiffness_exponent=30", "gravity=[0,0,0]"]);
        // exp(-30 l) = 1e-3 at l = 0.23026 m.
        assert!(cut_force_warning(&weightless).unwrap().contains("0.2303 m"));
    }

    #[test]
    fn walls_given_twice_are_warned_of() {
        assert!(double_wall_warnings(&scene(&[])).is_empty());
        let floor = "container.wall=[{ point = [5, 5, 0], normal = [0, 0, -2] }, { normal = [0, 0, 1] }]";
        let warnings = double_wall_warnings(&scene(&[floor]));
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains("container.wall[0]") && warnings[0].contains("z = 0 m"), "{warnings:?}");
    }

    #[test]
    fn deep_overlaps_at_the_start_are_warned_of() {
        assert_eq!(overlap_warning(&scene(&[]), 0.029), None);
        assert!(overlap_warning(&scene(&[]), 0.17).unwrap().contains("1.70 of the radius"));
    }

    fn course(residual: f64) -> FrameSummary {
        FrameSummary {
            count: 1,
            kinetic_energy: 1.0,
            potential_energy: 2.0 + residual,
            dissipated: [3.0, 4.0],
            start_energy: 10.0,
            largest_kinetic_energy: 5.0,
            ..FrameSummary::default()
        }
    }

    #[test]
    fn created_energy_is_warned_of_where_the_balance_is_kept_and_lost_energy_is_not() {
        let kept = scene(&["output.energy=true"]);
        // 1e-3 of 5 J.
        let warning = created_energy_warning(&kept, &InitialCondition::default(), &course(6e-3)).unwrap();
        assert!(warning.contains("6.000e-3 J") && warning.contains("1.2e-3 of the largest"), "{warning}");
        assert!(warning.contains("a smaller solver.tolerance"), "{warning}");
        for residual in [4e-3, 0.0, -6.0] {
            assert_eq!(
                created_energy_warning(&kept, &InitialCondition::default(), &course(residual)),
                None,
                "{residual} J"
            );
        }
        assert_eq!(created_energy_warning(&scene(&[]), &InitialCondition::default(), &course(6.0)), None);
    }

    #[test]
    fn rounding_in_a_bed_at_rest_is_not_created_energy() {
        let kept = scene(&["output.energy=true"]);
        let still = FrameSummary { largest_kinetic_energy: 1e-20, ..course(1e-14) };
        assert!(still.residual() > 0.0);
        assert_eq!(created_energy_warning(&kept, &InitialCondition::default(), &still), None);
    }

    #[test]
    fn energy_that_rises_between_frames_is_warned_of_without_the_balance() {
        let risen = |rise| FrameSummary { largest_rise: rise, ..course(0.0) };
        let warning =
            created_energy_warning(&scene(&[]), &InitialCondition::default(), &risen(6e-2)).unwrap();
        assert!(warning.contains("energy was created") && warning.contains("6.000e-2 J"), "{warning}");
        assert_eq!(created_energy_warning(&scene(&[]), &InitialCondition::default(), &risen(4e-2)), None);
        let verlet =
            Scene { solver: crate::scene::Solver { step: Some(1e-3), ..scene(&[]).solver }, ..scene(&[]) };
        let warning = created_energy_warning(&verlet, &InitialCondition::default(), &risen(6e-2)).unwrap();
        assert!(warning.contains("a smaller solver.step"), "{warning}");
    }

    #[test]
    fn energy_that_is_lost_is_warned_of_where_no_effect_dissipates_it() {
        let elastic = scene(&["contact.restitution=1"]);
        let elastic = Scene { friction: None, ..elastic };
        let lost = |fall| FrameSummary { largest_fall: fall, ..course(0.0) };
        let of = |scene: &Scene, fall| lost_energy_warning(scene, &InitialCondition::default(), &lost(fall));
        // 1e-2 of 5 J.
        let warning = of(&elastic, 6e-2).unwrap();
        assert!(warning.contains("energy was lost") && warning.contains("6.000e-2 J"), "{warning}");
        assert_eq!(of(&elastic, 4e-2), None);
        assert_eq!(of(&scene(&["contact.restitution=1"]), 6e-2), None, "friction dissipates");
        assert_eq!(of(&Scene { friction: None, ..scene(&[]) }, 6e-2), None, "rebound dissipates");
    }

    #[test]
    fn a_wall_that_cannot_hold_a_fall_is_warned_of_with_the_kappa_that_would_do() {
        // r = 0.1 m, kappa = 30: e^3/3 = 6.695 J; a fall over 1 m brings 9.81 J.
        let soft = scene(&["contact.stiffness_exponent=30"]);
        let fall = |height| bodies(&[[[0.5, 0.5, height], [0.0; 3]]]);
        let warning = wall_barrier_warning(&soft, &fall(1.0)).unwrap();
        assert!(warning.contains("particle 0 can meet the side z = 0 m"), "{warning}");
        assert!(warning.contains("9.810e0 J") && warning.contains("6.695e0 J"), "{warning}");
        assert_eq!(wall_barrier_warning(&soft, &fall(0.68)), None);
        // 10/kappa e^(kappa/10) = 9.81 J at kappa = 35.8: three digits, rounded up.
        let kappa: f64 = warning
            .split("stiffness_exponent = ")
            .nth(1)
            .unwrap()
            .split(' ')
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let enough = scene(&[&format!("contact.stiffness_exponent={kappa:?}")]);
        assert_eq!(wall_barrier_warning(&enough, &fall(1.0)), None);
        let less = scene(&[&format!("contact.stiffness_exponent={:?}", 0.99 * kappa)]);
        assert!(wall_barrier_warning(&less, &fall(1.0)).is_some());
        assert_eq!(wall_barrier_warning(&scene(&[]), &fall(100.0)), None);
    }

    #[test]
    fn a_sphere_that_leaves_a_wall_meets_it_only_if_gravity_brings_it_back() {
        let soft = |gravity: &str| scene(&["contact.stiffness_exponent=30", gravity]);
        let up = bodies(&[[[0.5, 0.5, 0.2], [0.0, 0.0, 4.0]]]);
        assert!(wall_barrier_warning(&soft("gravity=[0,0,-9.81]"), &up).is_some());
        assert_eq!(wall_barrier_warning(&soft("gravity=[0,0,0]"), &up), None);
    }

    #[test]
    fn spheres_that_can_pass_through_each_other_are_warned_of() {
        // e^6/3 = 134.5 J; two that close at v = 40 m/s have 400 J, at 20 m/s 100 J.
        let soft = scene(&["contact.stiffness_exponent=30", "gravity=[0,0,0]"]);
        let pair = |v| bodies(&[[[0.2, 0.5, 0.5], [v, 0.0, 0.0]], [[0.8, 0.5, 0.5], [-v, 0.0, 0.0]]]);
        let warning = pair_barrier_warning(&soft, &pair(20.0)).unwrap();
        assert!(warning.contains("at 40 m/s, with 4.000e2 J") && warning.contains("1.345e2 J"), "{warning}");
        assert_eq!(pair_barrier_warning(&soft, &pair(10.0)), None);
        assert_eq!(pair_barrier_warning(&soft, &bodies(&[[[0.5; 3], [100.0, 0.0, 0.0]]])), None);
    }

    #[test]
    fn a_tolerance_that_allows_everything_is_warned_of_in_either_norm() {
        let start = InitialCondition::default();
        let loose = |sets: &[&str]| loose_tolerance_warning(&scene(sets), &start);
        assert_eq!(loose(&[]), None);
        // kappa v^2 = 150 g r = 147 m/s^2.
        assert_eq!(loose(&["solver.tolerance=100"]), None);
        assert!(loose(&["solver.tolerance=150"]).unwrap().contains("does not control the step"));
        assert_eq!(loose(&["solver.norm=scaled", "solver.tolerance=0.9"]), None);
        assert!(
            loose(&["solver.norm=scaled", "solver.tolerance=1e6"]).unwrap().contains("= 1000000 does not")
        );
    }

    #[test]
    fn a_tolerance_too_loose_for_the_brake_is_warned_of_with_one_that_would_do() {
        let start = bodies(&[[[0.5, 0.5, 0.1], [0.0; 3]]]);
        let warning = |sets: &[&str]| {
            let scaled =
                [&["solver.norm=scaled", "friction.regularization_velocity=1e-4"][..], sets].concat();
            shivering_warning(&scene(&scaled), &start)
        };
        // 0.4 * 1e-4/sqrt(9.81 * 0.1) = 4.0385e-5.
        let told = warning(&["solver.tolerance=0.1"]).unwrap();
        assert!(told.contains("= 0.1 allows errors of 9.905e-2 m/s a step, 9.905e2 times"), "{told}");
        assert!(told.contains("4.03e-5 or less would do"), "{told}");
        assert_eq!(warning(&["solver.tolerance=4.03e-5"]), None);
        assert!(warning(&["solver.tolerance=4.04e-5"]).is_some());
        for sets in [&["solver.norm=paper"][..], &["gravity=[0,0,0]"], &["friction.law=history"]] {
            assert_eq!(warning(&[sets, &["solver.tolerance=0.1"]].concat()), None, "{sets:?}");
        }
        // The usual bed at the usual tolerance.
        let many = bodies(&[[[0.5, 0.5, 0.1], [0.0; 3]]; 200]);
        assert_eq!(shivering_warning(&scene(&["solver.norm=scaled"]), &many), None);
    }
}
