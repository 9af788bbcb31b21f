//! Decides whether a run can go on after a failed trial, and why not.

use super::Simulation;
use crate::error::Error;
use crate::math::larger;
use crate::model::contact::{Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::ode::{Linear, TrialOutcome};

impl<R: Rebound, T: Tangential, W: Spin> Simulation<'_, R, T, W> {
    /// Returns an error if no smaller step can succeed after a failed trial with step `h` (s). Collective.
    ///
    /// That is so if the right-hand side at the last accepted state is not finite, or if the step is the
    /// smallest.
    pub(super) fn fail_if_impossible(&mut self, h: f64, outcome: TrialOutcome) -> Result<(), Error> {
        if self.start_is_broken() {
            return Err(self.unbearable_start());
        }
        if h > self.control.min_step {
            return Ok(());
        }
        // Repeat the trial to find where it breaks.
        self.dynamics.watch();
        self.integrator.attempt(&mut self.dynamics, &mut self.step_start, h, &self.norm, &mut self.trial);
        if let Some((t, state, slope)) = self.dynamics.broken() {
            return Err(self.unbearable(t, &state, &slope));
        }
        if outcome.within_travel {
            return Err(self.no_step(h));
        }
        let y = &self.step_start.y;
        let i = self.dynamics.worst(|i| y[i].v.norm());
        Err(Error::TooFast { t: self.step_start.t, h, i, travel: self.dynamics.travel() })
    }

    /// Whether the right-hand side at the last accepted state is not finite. Collective.
    pub(super) fn start_is_broken(&self) -> bool {
        let mut steepest = [self.step_start.slope.iter().map(Linear::max_abs).fold(0.0, larger)];
        self.comm.max(&mut steepest);
        steepest[0] == f64::INFINITY
    }

    pub(super) fn unbearable_start(&mut self) -> Error {
        let (y, slope) = (self.step_start.y.clone(), self.step_start.slope.clone());
        self.unbearable(self.step_start.t, &y, &slope)
    }

    /// Why the right-hand side `slope` at `state` and time `t` (s) is not finite. Collective.
    pub(super) fn unbearable(&mut self, t: f64, state: &[Motion<W>], slope: &[Motion<W>]) -> Error {
        self.dynamics.explain(state, t).unwrap_or_else(|| {
            let i = self.dynamics.worst(|i| slope[i].max_abs());
            Error::Acceleration { i, t }
        })
    }

    pub(super) fn no_step(&self, h: f64) -> Error {
        let i = self.limiting_particle(h);
        Error::NoStep { t: self.step_start.t, h, min_step: self.control.min_step, i }
    }

    /// The particle with the largest error in the last trial, of step `h` (s). Collective.
    pub(super) fn limiting_particle(&self, h: f64) -> u64 {
        let error = |i: usize| self.integrator.error_of(i, h, &self.norm, &self.step_start, &self.trial);
        self.dynamics.worst(error)
    }
}
