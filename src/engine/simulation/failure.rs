//! Decides whether a run can go on after a failed trial, and why not.

use super::Simulation;
use crate::engine::dynamics::{Fault, TRAVEL};
use crate::error::Error;
use crate::model::columns::velocity;
use crate::model::contact::LawParameters;
use crate::ode::{Ivp, TrialOutcome, largest_magnitude};

/// Contacts that open within this many of the smallest steps are pressed: no step resolves them.
const PRESSED: f64 = 1000.0;

/// The error of spheres of `mass` (kg) that are pressed together by `overlap` (m) at the time `t` (s), so
/// that steps of `min_step` (s) are too long for what they do; `None` if steps can follow.
pub fn pressed(law: LawParameters, mass: f64, overlap: f64, min_step: f64, t: f64) -> Option<Error> {
    let LawParameters { r, f_0, kappa, .. } = law;
    let force = f_0 * (kappa * overlap).exp();
    // A sphere that is pushed with F moves by 1/kappa within sqrt(2 m/(kappa F)).
    let time = (2.0 * mass / (kappa * force)).sqrt();
    let shortest = PRESSED * min_step;
    // The overlap for which that time is the shortest that steps can follow.
    let enough = (2.0 * mass / (kappa * f_0 * shortest * shortest)).ln() / kappa;
    let min_step_enough = time / PRESSED;
    let is_pressed = overlap > 0.0 && overlap > enough;
    let enough = enough.max(0.0);
    is_pressed.then(|| Error::Pressed {
        overlap,
        share: overlap / r,
        force,
        time,
        min_step,
        enough,
        min_step_enough,
        t,
    })
}

impl Simulation<'_> {
    /// Returns an error if no smaller step can succeed after a failed trial with step `h` (s). Collective.
    ///
    /// That is so if the right-hand side at the last accepted state is not finite, or if the step is the
    /// smallest.
    pub(super) fn fail_if_impossible(&mut self, h: f64, outcome: TrialOutcome) -> Result<(), Error> {
        if self.start_is_broken() {
            return Err(self.broken_start());
        }
        if h > self.control.min_step {
            return Ok(());
        }
        // Repeat the trial to find where it breaks.
        self.dynamics.search_fault();
        self.integrator.attempt(&mut self.dynamics, &mut self.step_start, h, &self.norm, &mut self.trial);
        if let Some(fault) = self.dynamics.fault() {
            return Err(self.not_finite(&fault));
        }
        if outcome.within_travel {
            return Err(self.no_step(h));
        }
        let y = &self.step_start.y;
        let layout = self.dynamics.layout();
        let speed = |i: usize| velocity(&y[layout.row(0, i).range()]).norm();
        let i = self.dynamics.worst(|i| speed(i) * self.dynamics.size(i).per_r);
        let own = self.dynamics.ids().iter().position(|&id| id == i);
        let mut travel = [own.map_or(0.0, |i| TRAVEL * self.dynamics.size(i).r)];
        self.comm.max(&mut travel);
        Err(Error::TooFast { t: self.step_start.t, h, i, travel: travel[0] })
    }

    /// Returns an error if contacts are pressed so hard that the smallest step is too long for them.
    /// Collective.
    pub(super) fn fail_if_pressed(&mut self) -> Result<(), Error> {
        let (t, min_step) = (self.step_start.t, self.control.min_step);
        let (_, overlap) = self.dynamics.potential_energy(&self.step_start.y[..]);
        let overlap = overlap.length;
        let masses = (0..self.dynamics.ids().len()).map(|i| self.dynamics.size(i).mass);
        let mut least = [-masses.fold(f64::INFINITY, f64::min)];
        self.comm.max(&mut least);
        pressed(self.dynamics.law(), -least[0], overlap, min_step, t).map_or(Ok(()), Err)
    }

    /// Whether the right-hand side at the last accepted state is not finite. Collective.
    pub(super) fn start_is_broken(&self) -> bool {
        let mut steepest = [largest_magnitude(&self.step_start.slope)];
        self.comm.max(&mut steepest);
        steepest[0] == f64::INFINITY
    }

    /// Why the right-hand side at the last accepted state is not finite. Collective.
    pub(super) fn broken_start(&mut self) -> Error {
        let (state, slope) = (self.step_start.y.clone(), self.step_start.slope.clone());
        self.not_finite(&Fault { t: self.step_start.t, state, slope })
    }

    /// Why a right-hand side is not finite. Collective.
    fn not_finite(&mut self, fault: &Fault) -> Error {
        self.dynamics.explain(&fault.state, fault.t, &self.wall_names).unwrap_or_else(|| {
            let layout = self.dynamics.layout();
            let slope = |i: usize| largest_magnitude(&fault.slope[layout.row(0, i).range()]);
            Error::Acceleration { i: self.dynamics.worst(slope), t: fault.t }
        })
    }

    pub(super) fn no_step(&self, h: f64) -> Error {
        let i = self.limiting_particle(h);
        Error::NoStep { t: self.step_start.t, h, min_step: self.control.min_step, i }
    }

    /// The particle with the largest error in the last trial, of step `h` (s). Collective.
    pub(super) fn limiting_particle(&self, h: f64) -> u64 {
        let layout = self.dynamics.layout();
        let error = |i: usize| {
            let part = layout.row(0, i);
            self.integrator.error_of(part, h, &self.norm, &self.step_start, &self.trial)
        };
        self.dynamics.worst(error)
    }
}
