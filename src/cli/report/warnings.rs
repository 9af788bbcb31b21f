//! Warnings of doubtful results after a run.

use super::forewarnings::loose_tolerance_warning;
use super::monitor::Monitor;
use crate::domain::Comm;
use crate::engine::simulation::{FrameSummary, Outcome};
use crate::math::digits::{rough, short};
use crate::model::effects::{Effects, Variant};
use crate::ode::Limit;
use crate::scene::Scene;
use crate::scene::initial_condition::overlaps::DEEP;
use crate::scene::initial_condition::{self, InitialCondition};

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
            "warning: energy at the end and dissipated energy are {} J more than there was at the start, {} \
             of the largest kinetic energy: no contact creates energy, so the steps are too coarse for the \
             motion, or for the integral of what it dissipates; a smaller {smaller} would help",
            rough(created),
            rough(created / largest)
        ));
    }
    // A bed at rest has almost no kinetic energy. One particle at the velocity scale is the least scale.
    let least = scene.particles.mass * initial_condition::velocity_scale(scene, start).powi(2);
    let (created, scale) = (course.largest_rise, largest.max(least));
    (created > RISEN_SHARE * scale && created > rounding).then(|| {
        format!(
            "warning: energy was created: at a frame it was {} J more than at one before, {} of the largest \
             kinetic energy; no contact creates energy, so the steps are too coarse for the motion; a \
             smaller {smaller} would help",
            rough(created),
            rough(created / scale)
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
            "warning: energy was lost: at a frame it was {} J less than at one before, {} of the largest \
             kinetic energy; with contact.restitution = 1 and without friction nothing dissipates energy, so \
             the steps are too coarse for the motion; a smaller {smaller} would help",
            rough(lost),
            rough(lost / scale)
        )
    })
}

/// Warns if spheres overlapped deeply at a frame, by `share` of a radius at most.
fn deep_overlap_warning(scene: &Scene, share: f64) -> Option<String> {
    let key = match scene.scales {
        Some(_) => "a smaller contact.overlap",
        None => "a larger contact.stiffness_exponent",
    };
    (share > DEEP).then(|| {
        format!(
            "warning: the largest overlap is {} of the radius: the contacts are soft for this load; {key} makes \
             them harder",
            rough(share)
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
            "warning: {} steps were accepted at solver.min_step = {} s with an error above solver.tolerance: \
             a smaller solver.min_step or a larger solver.tolerance would help",
            counts.forced,
            short(scene.solver.min_step)
        ));
    }
    doubts.extend(deep_overlap_warning(scene, outcome.largest_overlap.share));
    if loose_tolerance_warning(scene, start).is_some() {
        let by_error = Limit::ALL.iter().zip(counts.limits).find(|(limit, _)| **limit == Limit::Error);
        doubts.push(format!(
            "warning: solver.tolerance decided the size of {} of {} steps",
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
    use super::super::testing::scene;
    use super::*;
    use crate::model::size::Size;
    use crate::scene::contact_scales::ContactScales;

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
        assert!(warning.contains("0.006 J") && warning.contains("0.0012 of the largest"), "{warning}");
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
    fn a_deep_overlap_is_told_with_the_key_that_makes_contacts_harder() {
        let mut scene = scene(&[]);
        let warning = deep_overlap_warning(&scene, 0.4).unwrap();
        assert!(warning.contains("is 0.4 of the radius: "), "{warning}");
        assert!(warning.contains("a larger contact.stiffness_exponent"), "{warning}");
        assert_eq!(deep_overlap_warning(&scene, 0.2), None);
        scene.scales = Some(ContactScales::new(0.2, 0.4, 9.81, [0.0; 2], &[Size::new(0.1, 1.0)]));
        let warning = deep_overlap_warning(&scene, 0.4).unwrap();
        assert!(warning.contains("a smaller contact.overlap"), "{warning}");
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
        assert!(warning.contains("energy was created") && warning.contains("0.06 J"), "{warning}");
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
        assert!(warning.contains("energy was lost") && warning.contains("0.06 J"), "{warning}");
        assert_eq!(of(&elastic, 4e-2), None);
        assert_eq!(of(&scene(&["contact.restitution=1"]), 6e-2), None, "friction dissipates");
        assert_eq!(of(&Scene { friction: None, ..scene(&[]) }, 6e-2), None, "rebound dissipates");
    }
}
