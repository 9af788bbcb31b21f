//! The cutoff: the largest gap at which the stabilised method evaluates contacts.
//!
//! It is `contact.interaction_distance`, or less: the gap at which the force of a contact is too weak to
//! matter at the tolerance. The stabilised method works where spheres are in touch and steps are short.
//!
//! The other methods evaluate all contacts. They are used in flight and in the first contacts. There weak
//! forces act for a long time, and the weak force ahead of a contact makes the steps shorter in time.

use super::tightening;
use crate::model::effects::{Effects, Variant};
use crate::ode::{MethodName, NormName};
use crate::scene::{DEFAULT_TOLERANCE, Scene};

/// Limit for contacts that are left out: their acceleration over the tolerance is less than this, in units of
/// the squared velocity scale over the radius.
///
/// At the default tolerance this is a four-thousandth of the weight of a sphere. Positions in a bed are then
/// as accurate as with all contacts, within the spread over initial conditions (docs/decisions/012).
const UNSEEN: f64 = 2.5e-3;

/// The force of a contact that is left out is always less than this share of F_0.
const MOST: f64 = 1e-3;

/// The stabilised method leaves out contacts with a repulsion F below this, N; 0 where that method is never
/// used.
///
/// It is `solver.neglected_force`, if given. If not, it is what does not matter at the tolerance, for
/// velocities compared with `scale` (m/s) in the scaled norm, and 0 in the paper's norm.
pub fn neglected_force(scene: &Scene, scale: f64) -> f64 {
    let solver = &scene.solver;
    let stabilised = match solver.method {
        MethodName::Chebyshev => true,
        MethodName::Auto => {
            let effects = Effects::of(scene);
            // Without dissipation `auto` never switches to the stabilised method.
            effects.dissipative || effects.variant != Variant::Basic
        }
        _ => false,
    };
    if !stabilised {
        return 0.0;
    }
    let unseen = || {
        if solver.norm == NormName::Paper {
            return 0.0;
        }
        let tolerance = solver.tolerance.unwrap_or(DEFAULT_TOLERANCE) * tightening(scene);
        let force = UNSEEN * tolerance * scene.particles.mass * scale * scale / scene.particles.radius;
        force.min(MOST * scene.contact.repulsion_at_contact)
    };
    solver.neglected_force.unwrap_or_else(unseen)
}

/// Largest gap at which the stabilised method evaluates contacts, m; `scale` as for [`neglected_force`].
pub fn cutoff(scene: &Scene, scale: f64) -> f64 {
    let contact = &scene.contact;
    // If no force is neglected, the logarithm is infinite.
    let gap =
        (contact.repulsion_at_contact / neglected_force(scene, scale)).ln() / contact.stiffness_exponent;
    gap.min(contact.interaction_distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(sets: &[&str]) -> Scene {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Scene::parse("bed.toml", include_str!("../../../configs/bed.toml"), &sets).unwrap()
    }

    #[test]
    fn a_tighter_tolerance_sees_weaker_forces() {
        let scale = (9.81f64 * 0.1).sqrt();
        let bed = scene(&[]);
        assert!((neglected_force(&bed, scale) - 2.4525e-3).abs() < 1e-16);
        assert!((cutoff(&bed, scale) - (10.0f64 / 2.4525e-3).ln() / 150.0).abs() < 1e-15);
        let tight = scene(&["solver.tolerance=1e-3"]);
        assert!((neglected_force(&tight, scale) - 2.4525e-5).abs() < 1e-18);
        // If the force at the interaction distance matters, that distance is the cutoff.
        assert_eq!(cutoff(&scene(&["solver.tolerance=1e-6"]), scale), 0.1);
        // At any tolerance, contacts begin long before the surfaces touch.
        assert_eq!(neglected_force(&scene(&["solver.tolerance=1e3"]), scale), 10.0 * MOST);
    }

    #[test]
    fn what_the_stabilised_method_does_not_take_leaves_nothing_out() {
        for sets in [
            &["solver.norm=\"paper\""][..],
            &["solver.method=\"merson\""],
            &["solver.method=\"dormand-prince\"", "solver.neglected_force=1"],
            &["solver.method=\"velocity-verlet\"", "solver.step=1e-5"],
            &["contact.restitution=1", "friction.coefficient=0"],
            &["solver.neglected_force=0"],
        ] {
            assert_eq!(neglected_force(&scene(sets), 1.0), 0.0);
            assert_eq!(cutoff(&scene(sets), 1.0), 0.1);
        }
    }

    #[test]
    fn a_force_of_the_scene_decides() {
        let own = scene(&["solver.neglected_force=0.5"]);
        assert_eq!(neglected_force(&own, 1.0), 0.5);
        assert!((cutoff(&own, 1.0) - 20.0f64.ln() / 150.0).abs() < 1e-15);
    }
}
