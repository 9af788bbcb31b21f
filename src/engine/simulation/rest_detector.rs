//! The rest detector: decides whether a bed has come to rest, as `[stop]` of the scene defines it.
//!
//! It checks accepted states only, about ten times per `stop.window` of simulated time, so that it changes no
//! bit of the motion. A criterion is met when it has held in every check during a whole window. None holds
//! while a particle is faster than `stop.speed`: forces of a heap balance long before its last spheres stop.

use super::Simulation;
use crate::ode::Ivp;
use crate::scene::stop::Rest;
use serde::{Deserialize, Serialize};

/// Number of checks per window.
const LOOKS: f64 = 10.0;
/// The criteria, named by their keys.
const CRITERIA: [&str; 4] =
    ["stop.kinetic_energy", "stop.unbalanced_force", "stop.height_change", "stop.speed"];

/// State of the rest detector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RestState {
    /// Time of the next check, s.
    next: f64,
    /// Time since which each criterion has held, s.
    since: [Option<f64>; 4],
    /// Smallest and largest height since the third criterion has held, m.
    heights: [f64; 2],
}

impl Default for RestState {
    fn default() -> Self {
        RestState { next: 0.0, since: [None; 4], heights: [f64::INFINITY, f64::NEG_INFINITY] }
    }
}

/// What the detector measures in one check.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Look {
    /// Mean kinetic energy of a particle, J.
    kinetic_energy: f64,
    /// Sum of the net forces on particles over the sum of the contact forces and weights.
    unbalanced_force: f64,
    /// Height of the bed, m.
    height: f64,
    /// Largest speed of a centre, m/s.
    speed: f64,
}

impl RestState {
    /// Takes the measures `look` at time `t` (s) into account. Returns the first criterion that is met.
    fn see(&mut self, rest: &Rest, t: f64, look: &Look) -> Option<&'static str> {
        self.next = t + rest.window / LOOKS;
        let [low, high] = [self.heights[0].min(look.height), self.heights[1].max(look.height)];
        let slow = look.speed <= rest.speed;
        let steady = slow && rest.height_change.is_some_and(|most| high - low <= most);
        self.heights = if steady { [low, high] } else { [look.height; 2] };
        let below = |most: Option<f64>, found: f64| slow && most.is_some_and(|most| found <= most);
        let holds = [
            below(rest.kinetic_energy, look.kinetic_energy),
            below(rest.unbalanced_force, look.unbalanced_force),
            steady,
            slow && rest.is_speed_alone(),
        ];
        for (since, holds) in self.since.iter_mut().zip(holds) {
            *since = if holds { since.or(Some(t)) } else { None };
        }
        // The range of heights starts again with the height that broke it.
        if slow && rest.height_change.is_some() && self.since[2].is_none() {
            self.since[2] = Some(t);
        }
        // A window that is short by a rounding error counts as complete.
        let met = |since: &Option<f64>| since.is_some_and(|since| t - since >= rest.window * (1.0 - 1e-9));
        self.since.iter().position(met).map(|k| CRITERIA[k])
    }
}

impl Simulation<'_> {
    /// The criterion by which the bed is at rest at the end of the trial, at time `t` (s), if any.
    /// Collective.
    ///
    /// The memory for a checkpoint was stored before this check, so a resumed run repeats the check.
    pub(super) fn at_rest_by(&mut self, t: f64) -> Option<&'static str> {
        if t < self.progress.rest.next {
            return None;
        }
        let rest = self.rest?;
        let state = std::mem::take(&mut self.trial.next);
        let look = self.look(&rest, t, &state);
        self.trial.next = state;
        self.progress.rest.see(&rest, t, &look)
    }

    /// Measures the particles; leaves out what no criterion needs. Collective.
    fn look(&mut self, rest: &Rest, t: f64, state: &[f64]) -> Look {
        let count = self.dynamics.count() as f64;
        let kinetic_energy = rest.kinetic_energy.map(|_| self.dynamics.kinetic_energy(state) / count);
        let unbalanced_force = rest.unbalanced_force.map(|_| {
            // The slope needs a vector of its own. That of the trial, where it is known, may come from older
            // lists, and the next step needs it unchanged.
            let mut slope = vec![0.0; state.len()];
            self.dynamics.rhs(t, state, &mut slope);
            self.progress.counts.rhs += 1;
            self.dynamics.unbalanced_force(state, &slope)
        });
        Look {
            kinetic_energy: kinetic_energy.unwrap_or(f64::INFINITY),
            unbalanced_force: unbalanced_force.unwrap_or(f64::INFINITY),
            height: self.dynamics.bed_height(state),
            speed: self.dynamics.largest_speed(state),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rest by the mean kinetic energy, the unbalanced force and the change of height, at any speed.
    fn rest(kinetic_energy: Option<f64>, unbalanced_force: Option<f64>, height_change: Option<f64>) -> Rest {
        Rest { kinetic_energy, unbalanced_force, height_change, speed: f64::INFINITY, window: 1.0 }
    }

    /// Time at which `rest` ends a run with the measures `of(t)`, and the criterion. The last measure is the
    /// largest speed.
    fn ends(rest: &Rest, of: impl Fn(f64) -> [f64; 4]) -> Option<(f64, &'static str)> {
        let mut state = RestState::default();
        (0..1000).map(|k| 0.01 * f64::from(k)).find_map(|t| {
            if t < state.next {
                return None;
            }
            let [kinetic_energy, unbalanced_force, height, speed] = of(t);
            let by = state.see(rest, t, &Look { kinetic_energy, unbalanced_force, height, speed });
            by.map(|by| (t, by))
        })
    }

    #[test]
    fn a_criterion_must_hold_for_a_whole_window() {
        let slow = rest(Some(1e-3), None, None);
        assert_eq!(ends(&slow, |_| [1e-2, 0.0, 0.0, 0.0]), None);
        let (t, by) = ends(&slow, |t| [if t < 2.0 { 1.0 } else { 1e-4 }, 0.0, 0.0, 0.0]).unwrap();
        assert!((3.0..3.2).contains(&t) && by == "stop.kinetic_energy", "{t} {by}");
        // A bump in between restarts the window.
        let bumpy = |t| if t < 2.0 || (2.5..2.65).contains(&t) { 1.0 } else { 0.0 };
        let (t, _) = ends(&slow, |t| [bumpy(t), 0.0, 0.0, 0.0]).unwrap();
        assert!((3.6..3.9).contains(&t), "{t}");
    }

    #[test]
    fn any_criterion_ends_the_run_and_is_named() {
        let any = rest(Some(1e-9), Some(1e-3), Some(1e-9));
        assert_eq!(ends(&any, |t| [1.0, 1e-4, t, 0.0]).unwrap().1, "stop.unbalanced_force");
        assert_eq!(ends(&any, |_| [1.0, 1.0, 3.0, 0.0]).unwrap().1, "stop.height_change");
    }

    #[test]
    fn a_height_that_creeps_is_a_change() {
        let still = rest(None, None, Some(0.01));
        assert_eq!(ends(&still, |t| [0.0, 0.0, 0.1 * t, 0.0]), None);
        // The height rises by 0.005 m per window.
        assert!(ends(&still, |t| [0.0, 0.0, 0.005 * t, 0.0]).unwrap().0 < 1.2);
        // The height swings by more, and then rests.
        let (t, _) = ends(&still, |t| [0.0, 0.0, if t < 4.0 { (7.0 * t).sin() } else { 0.5 }, 0.0]).unwrap();
        assert!((5.0..5.3).contains(&t), "{t}");
    }

    #[test]
    fn nothing_is_at_rest_while_one_particle_moves() {
        // One particle stops at 4 s.
        let rolling = |t: f64| [0.0, 0.0, 0.5, if t < 4.0 { 0.2 } else { 0.01 }];
        for all in [rest(Some(1.0), None, None), rest(None, Some(1.0), None), rest(None, None, Some(1.0))] {
            let (t, _) = ends(&Rest { speed: 0.1, ..all }, rolling).unwrap();
            assert!((5.0..5.2).contains(&t), "{t}");
            assert_eq!(ends(&Rest { speed: 0.005, ..all }, rolling), None);
        }
    }

    #[test]
    fn a_speed_alone_is_a_criterion_and_beside_others_only_a_condition() {
        let slow = Rest { speed: 0.1, ..rest(None, None, None) };
        assert_eq!(ends(&slow, |_| [1.0, 1.0, 1.0, 0.05]).unwrap().1, "stop.speed");
        let both = Rest { speed: 0.1, ..rest(Some(1e-9), None, None) };
        assert_eq!(ends(&both, |_| [1.0, 1.0, 1.0, 0.05]), None);
    }
}
