//! Trial steps: their size, their outcome, and frames inside of them.

use super::Simulation;
use super::physics::own_weights;
use crate::error::Error;
use crate::ode::controller::{GROWTH, SAFETY, SAFETY_OF_MEANS};
use crate::ode::{Dissipation, Ivp, Limit, TrialOutcome};

/// Number of consecutive forced steps that ends a run.
const FORCED_IN_A_ROW: u64 = 1000;
/// Number of accepted steps after which at most one in a hundred may be forced.
const FORCED_GRACE: u64 = 100_000;

/// An accepted trial step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    /// Size, s.
    pub(super) h: f64,
    /// Whether it was accepted only because steps cannot be smaller.
    pub(super) forced: bool,
    /// What decided its size.
    pub(super) limit: Limit,
}

impl Simulation<'_> {
    /// Chooses the size of the first step, at most the `initial_step` of the scene. Collective.
    ///
    /// An Euler step of that size would change the slope by about as much as the state (E. Hairer, S. P.
    /// Norsett, G. Wanner, Solving ODEs I, II.4).
    pub(super) fn find_first_step(&mut self) {
        let (whole, slopes) = (self.dynamics.layout().whole(0), &self.step_start.slope);
        let mut slope = [self.norm.largest(whole, &slopes[whole.range()])];
        self.comm.max(&mut slope);
        let guess = 0.01 / slope[0];
        if guess < self.progress.h {
            self.progress.h = self.control.clamp(guess);
        }
    }

    /// Tries steps from the last accepted state until one is accepted. Its result is in `trial`. Collective.
    pub(super) fn find_step(&mut self) -> Result<Step, Error> {
        loop {
            self.progress.counts.rhs +=
                self.integrator.prepare(&mut self.dynamics, &mut self.step_start, &mut self.trial);
            if self.choose_cutoff() {
                self.step_start.slope_known = false;
            }
            let (mut h, mut limit) = self.next_trial();
            if self.dynamics.will_outrun(h) {
                self.rebuild()?;
                // New lists may have new impacts.
                (h, limit) = self.next_trial();
            }
            self.remember();
            let outcome = self.attempt(h);
            if !outcome.covered && !self.dynamics.lists_are_fresh() {
                // Lists that do not cover the step say nothing about it: repeat it with new lists.
                self.progress.counts.outrun += 1;
                self.rebuild()?;
                (self.progress.h, self.progress.limit) = (h, limit);
                continue;
            }
            if !outcome.within_travel || !outcome.covered {
                self.progress.counts.outrun += 1;
                self.fail_if_impossible(h, outcome)?;
                (self.progress.h, self.progress.limit) = (self.control.clamp(0.5 * h), Limit::Travel);
                continue;
            }
            // At rest only the error of an explicit method tells how far it is from stable: there it must
            // stay well below the tolerance.
            let comes_close = self.norm.mean.is_some() && self.integrator.is_stabilised();
            self.control.safety = if comes_close { SAFETY_OF_MEANS } else { SAFETY };
            let decision = self.control.judge(h, outcome.error, self.integrator.error_order());
            (self.progress.h, self.progress.limit) = (decision.next, decision.limit);
            if decision.accept {
                if self.step_start.t + h == self.step_start.t {
                    return Err(self.no_step(h));
                }
                return Ok(Step { h, forced: decision.forced, limit });
            }
            self.progress.counts.rejected += 1;
            self.integrator.rejected();
            if outcome.error == f64::INFINITY {
                self.fail_if_impossible(h, outcome)?;
            }
        }
    }

    /// Builds new lists at the last accepted state. Collective.
    pub(super) fn rebuild(&mut self) -> Result<(), Error> {
        self.dynamics.rebuild(&mut self.step_start)?;
        self.norm.rows = own_weights(&self.dynamics, &self.norm);
        Ok(())
    }

    /// Size of the next trial step (s), and what decided it.
    fn next_trial(&self) -> (f64, Limit) {
        let proposed = (self.progress.h, self.progress.limit);
        let limits = [
            (self.integrator.stable_step(), Limit::Stability),
            (self.dynamics.travel_limit(), Limit::Travel),
            (self.dynamics.contact_limit(), Limit::Contact),
        ];
        let (h, limit) = limits.into_iter().fold(proposed, |a, b| if b.0 < a.0 { b } else { a });
        (self.control.clamp(h), limit)
    }

    /// Sets the gap up to which contacts are evaluated, for the active method. Returns whether that changes
    /// the slopes.
    pub(super) fn choose_cutoff(&mut self) -> bool {
        let stabilised = self.integrator.is_stabilised();
        self.dynamics.evaluate_within(if stabilised { self.cutoff } else { f64::INFINITY })
    }

    /// One trial step from the last accepted state. Collective.
    fn attempt(&mut self, h: f64) -> TrialOutcome {
        self.dynamics.set_largest_next(GROWTH * h);
        let outcome =
            self.integrator.attempt(&mut self.dynamics, &mut self.step_start, h, &self.norm, &mut self.trial);
        self.progress.counts.rhs += self.trial.evaluations;
        outcome
    }

    /// The state at a `share` of the accepted step `h` (s), and the energy lost up to there, J. Collective.
    ///
    /// It comes from the dense output if the method has one. If not, a step of its own leads there from the
    /// last accepted state. None if the lists are too old for that step.
    pub(super) fn frame_inside(&mut self, share: f64, h: f64) -> Option<(Vec<f64>, Dissipation)> {
        if self.integrator.has_inside() {
            let layout = self.dynamics.layout();
            let state = self.integrator.inside(share, h, &self.step_start, &self.trial, layout)?;
            let (start, end) = (self.step_start.dissipation, self.trial.dissipation);
            let dissipated = [0, 1].map(|k| {
                let rest = 1.0 - share;
                share * share * (1.0 + 2.0 * rest) * self.trial.dissipated[k]
                    + h * share * rest * (rest * start[k] - share * end[k])
            });
            return Some((state, dissipated));
        }
        let step = (std::mem::take(&mut self.trial.next), self.trial.dissipated);
        self.dynamics.set_of_frame(true);
        let outcome = self.attempt(share * h);
        self.dynamics.set_of_frame(false);
        let (state, dissipated) = (std::mem::replace(&mut self.trial.next, step.0), self.trial.dissipated);
        // The trial of the frame has overwritten the slope at the end of the step.
        (self.trial.dissipated, self.trial.slope_known) = (step.1, false);
        if !outcome.covered && !self.dynamics.lists_are_fresh() {
            return None;
        }
        if outcome.covered && outcome.error < f64::INFINITY {
            return Some((state, dissipated));
        }
        // The stages of this frame meet something that the stages of the step did not meet, such as two
        // centres that pass through each other at this moment. Take the parabola through the start, its slope
        // and the result: it is finite.
        let ends = self.step_start.y.iter().zip(&self.step_start.slope).zip(&self.trial.next);
        let state = ends.map(|((y, slope), result)| {
            let bend = result - y + slope * -h;
            y + slope * (share * h) + bend * (share * share)
        });
        Some((state.collect(), self.trial.dissipated.map(|dissipated| share * dissipated)))
    }

    /// Accepts the trial, which ends at time `t` (s). `limit` decided its size.
    pub(super) fn accept(&mut self, t: f64, limit: Limit) {
        let (step_start, trial) = (&mut self.step_start, &mut self.trial);
        std::mem::swap(&mut step_start.y, &mut trial.next);
        std::mem::swap(&mut step_start.slope, &mut trial.slope);
        (step_start.t, step_start.slope_known, step_start.dissipation) =
            (t, trial.slope_known, trial.dissipation);
        self.moved_on = true;
        crate::ode::add_dissipation(&mut self.progress.dissipated, 1.0, &trial.dissipated);
        self.integrator.accepted(self.progress.last, limit);
    }

    /// Counts an accepted step. Ends the run if too many steps are accepted only because steps cannot be
    /// smaller. Collective.
    pub(super) fn count(&mut self, Step { h, forced, limit }: Step) -> Result<(), Error> {
        self.progress.last = h;
        self.progress.counts.accepted += 1;
        self.progress.counts.forced += u64::from(forced);
        let index = Limit::ALL.iter().position(|&other| other == limit);
        self.progress.counts.limits[index.expect("all limits are listed")] += 1;
        self.progress.forced_in_a_row = if forced { self.progress.forced_in_a_row + 1 } else { 0 };
        let accepted = self.progress.counts.accepted;
        let prevail = accepted > FORCED_GRACE && self.progress.counts.forced * 100 > accepted;
        if forced && (self.progress.forced_in_a_row >= FORCED_IN_A_ROW || prevail) {
            self.fail_if_pressed()?;
            return Err(Error::BelowRoundOff {
                tolerance: self.tolerance,
                forced: self.progress.counts.forced,
                accepted,
                t: self.step_start.t,
                h,
                min_step: self.control.min_step,
                i: self.limiting_particle(h),
            });
        }
        Ok(())
    }
}
