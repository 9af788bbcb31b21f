//! How stiff the problem is at a state: the spectral radius of df/dy by a power iteration that needs f alone.

use super::{Ivp, Linear, StepStart, TrialStep, fit};
use crate::threads::{self, GRAIN};
use serde::{Deserialize, Serialize};

/// The estimate is multiplied by this: a power iteration approaches from below. Damping allows for more, and a step that
/// was unstable all the same is rejected for its error. (Tried: 1.0 to 1.5, with the same share of rejected steps.)
const SAFETY: f64 = 1.05;
/// States that share an estimate: stiffness changes little from a step to the next.
const SHARED: u32 = 2;
/// An iteration that changes the estimate by less than this share is the last one.
const SETTLED: f64 = 0.1;
/// Iterations at one state at most, with and without a good direction to start from.
const MOST: [u32; 2] = [3, 12];
/// Share of every other direction that is mixed in, so that stiffness that comes up elsewhere is found.
const MIXED_IN: f64 = 0.02;

/// Estimate of the spectral radius along a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpectralRadius {
    estimate: f64,
    /// Length of the image of a vector of length 1 in the last iteration, 1/s.
    stretch: f64,
    doubted: bool,
    /// States that the last estimate served.
    served: u32,
    round: u64,
}

impl Default for SpectralRadius {
    fn default() -> Self {
        SpectralRadius { estimate: 0.0, stretch: 0.0, doubted: true, served: 0, round: 0 }
    }
}

impl SpectralRadius {
    /// Upper bound of the spectral radius, as far as it is known, 1/s.
    pub fn bound(&self) -> f64 {
        SAFETY * self.estimate
    }

    /// A step has failed: the next estimate takes more care.
    pub fn doubt(&mut self) {
        self.doubted = true;
    }

    /// Estimates at `anchor`, whose slope must be known, from the direction found so far, and improves that direction.
    /// Returns the number of right-hand sides. Collective. `trial` lends its room and loses its result.
    pub fn update<P: Ivp>(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        trial: &mut TrialStep<P::State>,
    ) -> u64 {
        if !self.doubted && self.served < SHARED {
            self.served += 1;
            return 0;
        }
        self.served = 1;
        fit(&mut trial.slope, step_start.y.len());
        // Without stiffness before, as in free flight, there is no direction to go on with.
        let careful = self.doubted || self.stretch == 0.0;
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
            // Of an oscillation every other image is short: the mean of two tells.
            let steady = (0.5..=2.0).contains(&ratio);
            self.estimate = if steady || k == 0 { found } else { (found * self.stretch).sqrt() };
            self.stretch = found;
            if (ratio - 1.0).abs() <= SETTLED && (k > 0 || !careful) {
                break;
            }
        }
        self.doubted = false;
        evaluations
    }

    /// Puts the image of the direction, divided by its `length`, in its place: the derivative of f along it.
    /// Returns the length of the image. Collective.
    fn apply<P: Ivp>(
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        trial: &mut TrialStep<P::State>,
        length: f64,
    ) -> f64 {
        let (small, direction, y) = (ivp.small_length(), &mut step_start.direction, &step_start.y);
        let along = &*direction;
        let make = |_: usize,
                    start: usize,
                    []: [&mut [P::State]; 0],
                    stages: &mut [P::State],
                    _: &mut [P::State]| {
            for (k, stage) in stages.iter_mut().enumerate() {
                *stage = y[start + k];
                stage.add_scaled(small / length, &along[start + k]);
            }
        };
        ivp.rhs_of(step_start.t, y, [0, 1], [], &mut trial.slope, &make);
        let (slope, first) = (&trial.slope, &step_start.slope);
        threads::for_chunks(direction, GRAIN, |start, chunk| {
            for (k, direction) in chunk.iter_mut().enumerate() {
                let mut image = P::State::zero();
                image.add_scaled(1.0 / small, &slope[start + k]);
                image.add_scaled(-1.0 / small, &first[start + k]);
                *direction = image;
            }
        });
        ivp.length(direction)
    }

    /// Adds a little of every direction to `direction`, of `n` particles; all of it where there is none yet.
    fn mix<P: Ivp>(&mut self, ivp: &mut P, direction: &mut Vec<P::State>, n: usize) {
        self.round += 1;
        let mut share = MIXED_IN * self.stretch;
        if self.stretch == 0.0 {
            direction.clear();
            share = 1.0;
        }
        debug_assert!(
            direction.is_empty() || direction.len() == n,
            "a direction migrates with its particles"
        );
        fit(direction, n);
        ivp.add_direction(self.round, share, direction);
    }
}
