//! The tolerance of a step: what the scene says, or else what its friction needs.

use crate::model::effects::FrictionLaw;
use crate::ode::NormName;
use crate::scene::{DEFAULT_TOLERANCE, Scene};

/// Error of velocity of a sphere that is alone, over v_min, in a step at the tolerance.
const ALONE: f64 = 0.4;
/// The tolerance in a crowd is this times (v_min/scale)^(3/2): 0.1 at a hundredth of the scale.
const CROWD: f64 = 100.0;
/// No smaller tolerance is taken: rounding must stay far below it.
const LEAST: f64 = 1e-9;

/// Largest tolerance at which spheres creep as the brake of eq. (2.8) says; infinite where nothing creeps.
///
/// A step at the tolerance may be wrong by `tolerance * scale` in velocity, with the velocity `scale` in m/s.
/// Where that is much more than v_min, a long step throws a slip across the brake and the next one throws it
/// back. Errors stay within the tolerance, but the surfaces shiver at many times v_min and slide. Gravity
/// makes them slide, so without it nothing is asked.
///
/// `count` is the number of spheres. A step is judged by the largest error of all, and a typical
/// sphere of many errs far less than the worst.
pub fn friction_tolerance(scene: &Scene, scale: f64, count: u64) -> f64 {
    let heavy = scene.gravity != [0.0; 3];
    let braked = scene.friction.as_ref().filter(|f| f.law == FrictionLaw::Regularized && scene.rubs());
    match braked.and_then(|friction| friction.regularization_velocity) {
        Some(v_min) if heavy && count > 0 && scene.solver.norm != NormName::Paper => {
            let share = v_min / scale;
            (ALONE * count as f64 * share).min(CROWD * share * share.sqrt()).max(LEAST)
        }
        _ => f64::INFINITY,
    }
}

/// The tolerance of a run of `count` spheres: the scene's, or else 0.1 or what its friction needs, whichever
/// is smaller. `scale` is the velocity scale, m/s.
///
/// # Examples
///
/// ```rust
/// use demhybrid::engine::simulation::tolerance;
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/settle.toml")?;
/// let scene = |set: &str| Scene::parse("settle.toml", &text, &[set.to_owned()]);
/// let scale = (9.81f64 * 0.1).sqrt();
/// assert_eq!(tolerance(&scene("t_end=1")?, scale, 200), 0.1);
/// assert!(tolerance(&scene("friction.regularization_velocity=1e-4")?, scale, 200) < 2e-4);
/// assert_eq!(tolerance(&scene("solver.tolerance=0.05")?, scale, 1), 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn tolerance(scene: &Scene, scale: f64, count: u64) -> f64 {
    let needed = || DEFAULT_TOLERANCE.min(friction_tolerance(scene, scale, count));
    scene.solver.tolerance.unwrap_or_else(needed)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLE: &str = include_str!("../../../configs/settle.toml");
    const BED: &str = include_str!("../../../configs/bed.toml");

    fn of(text: &str, sets: &[&str], count: u64) -> f64 {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        tolerance(&Scene::parse("a.toml", text, &sets).unwrap(), 1.0, count)
    }

    fn at(v_min: f64, count: u64) -> f64 {
        of(SETTLE, &[&format!("friction.regularization_velocity={v_min:e}")], count)
    }

    #[test]
    fn a_slower_brake_has_a_tighter_tolerance_and_a_usual_bed_the_usual_one() {
        assert_eq!([25, 200, 1_000_000].map(|count| at(0.01, count)), [0.1; 3]);
        let near = |found: f64, exact: f64| assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
        // A sphere that is alone errs by 0.4 v_min, four of them by 1.6 v_min.
        for v_min in [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5] {
            near(at(v_min, 1), 0.4 * v_min);
            near(at(v_min, 200), 100.0 * v_min.powf(1.5));
        }
        near(at(1e-3, 4), 1.6e-3);
        // At 1e-4 m/s the crowd's 100 v_min^(3/2) is v_min.
        near(at(1e-4, 4), 1e-4);
        assert_eq!(at(1e-300, 1), LEAST);
    }

    #[test]
    fn what_the_scene_says_is_obeyed_and_what_does_not_creep_asks_nothing() {
        let slow = "friction.regularization_velocity=1e-4";
        assert_eq!(of(SETTLE, &[slow, "solver.tolerance=0.2"], 1), 0.2);
        for sets in [&["gravity=[0,0,0]"][..], &["friction.coefficient=0"], &["solver.norm=paper"]] {
            assert_eq!(of(SETTLE, &[&[slow][..], sets].concat(), 1), DEFAULT_TOLERANCE, "{sets:?}");
        }
        assert_eq!(of(BED, &[slow], 1), DEFAULT_TOLERANCE);
    }
}
