//! Stiffness at a state: the spectral radius of df/dy, by a power iteration that evaluates f only.

use super::{Ivp, Stage, StepStart, TrialStep, fit, no_vectors};
use crate::math::larger;
use crate::threads::{self, GRAIN};
use serde::{Deserialize, Serialize};

/// Safety factor on the estimate, because a power iteration approaches the radius from below.
///
/// A small factor is enough: damping leaves a margin, and a step that is unstable all the same is rejected
/// for its error.
const SAFETY: f64 = 1.05;
/// Number of states that share one estimate: stiffness changes little from one step to the next.
const SHARED: u32 = 2;
/// The same where stiffness is steady.
const SHARED_IF_STEADY: u32 = 4;
/// Where stiffness is steady, an estimate is at least this share of the one before. The images of an
/// oscillation stay short for half a turn, which may be several estimates.
const LEFT: f64 = 0.95;
/// The iteration ends when it changes the estimate by less than this share.
const SETTLED: f64 = 0.1;
/// Largest number of iterations at one state, with and without a good direction to start from.
const MOST: [u32; 2] = [3, 12];
/// Share of every other direction that is added before an iteration. It lets the iteration find stiffness
/// that arises elsewhere.
const MIXED_IN: f64 = 0.02;

/// Estimate of the spectral radius, updated along a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpectralRadius {
    estimate: f64,
    /// Factor by which the last iteration stretched its vector, 1/s.
    stretch: f64,
    doubted: bool,
    /// Number of states that have used the last estimate.
    served: u32,
    round: u64,
}

impl Default for SpectralRadius {
    fn default() -> Self {
        SpectralRadius { estimate: 0.0, stretch: 0.0, doubted: true, served: 0, round: 0 }
    }
}

impl SpectralRadius {
    /// Upper bound of the spectral radius as last estimated, 1/s.
    pub fn bound(&self) -> f64 {
        SAFETY * self.estimate
    }

    /// Call this after a failed step: the next estimate then takes more iterations.
    pub fn doubt(&mut self) {
        self.doubted = true;
    }

    /// Improves the stiffest direction at `step_start`, whose slope must be known, and the estimate.
    /// Collective.
    ///
    /// Returns the number of right-hand sides evaluated. `trial` is used as work space: its result is lost.
    ///
    /// `steady` says that stiffness never jumps, as it does where the paper's friction stops a contact. Then
    /// an estimate serves longer and falls slowly, and a failed step is a reason for a new estimate, but not
    /// for doubts about the direction.
    pub fn update(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        trial: &mut TrialStep,
        steady: bool,
    ) -> u64 {
        let (shared, left) = if steady { (SHARED_IF_STEADY, LEFT) } else { (SHARED, 0.0) };
        if !self.doubted && self.served < shared {
            self.served += 1;
            return 0;
        }
        self.served = 1;
        fit(&mut trial.slope, step_start.y.len());
        // If nothing was stiff before, there is no direction to start from.
        let careful = self.doubted && !steady || self.stretch == 0.0;
        let least = left * self.estimate;
        self.mix(ivp, &mut step_start.direction, step_start.y.len());
        step_start.direction_known = true;
        let mut evaluations = 0;
        for k in 0..MOST[usize::from(careful)] {
            let length = ivp.length(&step_start.direction);
            if length == 0.0 || !length.is_finite() {
                (self.stretch, self.estimate) = (0.0, 0.0);
                break;
            }
            let found = Self::apply(ivp, step_start, trial, length);
            evaluations += 1;
            let ratio = found / self.stretch;
            // For an oscillation, long and short images alternate: take the geometric mean of two.
            let steady = (0.5..=2.0).contains(&ratio);
            self.estimate = if steady || k == 0 { found } else { (found * self.stretch).sqrt() };
            self.stretch = found;
            if (ratio - 1.0).abs() <= SETTLED && (k > 0 || !careful) {
                break;
            }
        }
        if self.stretch > 0.0 {
            self.estimate = larger(self.estimate, least);
        }
        self.doubted = false;
        evaluations
    }

    /// Replaces the direction, divided by its `length`, by its image: the derivative of f along it.
    /// Collective.
    ///
    /// Returns the length of the image.
    fn apply(ivp: &mut dyn Ivp, step_start: &mut StepStart, trial: &mut TrialStep, length: f64) -> f64 {
        let (small, direction, y) = (ivp.small_length(), &mut step_start.direction, &step_start.y);
        let along = &*direction;
        let scale = small / length;
        let make = |stage: Stage| {
            let range = stage.part.range();
            for ((number, y), along) in stage.state.iter_mut().zip(&y[range.clone()]).zip(&along[range]) {
                *number = y + along * scale;
            }
        };
        ivp.rhs_of(step_start.t, y, no_vectors(), &mut trial.slope, &make);
        let (slope, first) = (&trial.slope, &step_start.slope);
        let scale = 1.0 / small;
        threads::for_chunks(direction, 8 * GRAIN, |start, chunk| {
            for (k, direction) in (start..).zip(chunk) {
                *direction = 0.0 + slope[k] * scale + first[k] * -scale;
            }
        });
        ivp.length(direction)
    }

    /// Adds a small part of every direction to `direction`, of `n` numbers. If there is no direction yet,
    /// creates one.
    fn mix(&mut self, ivp: &mut dyn Ivp, direction: &mut Vec<f64>, n: usize) {
        self.round += 1;
        let mut share = MIXED_IN * self.stretch;
        if self.stretch == 0.0 {
            direction.clear();
            share = 1.0;
        }
        debug_assert!(direction.is_empty() || direction.len() == n, "a direction moves with its rows");
        fit(direction, n);
        ivp.add_direction(self.round, share, direction);
    }
}
