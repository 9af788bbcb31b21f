//! The integrator: takes steps with the method that the scene names, or with the one that `auto` chooses.

use crate::ode::method_switch::{MethodSwitch, Tally};
use crate::ode::{
    Chebyshev, DORMAND_PRINCE, Ivp, Layout, Limit, MERSON, Method, MethodName, Norm, Part, RungeKutta,
    SpectralRadius, StepStart, Tableau, TrialOutcome, TrialStep, Verlet,
};
use serde::{Deserialize, Serialize};

/// How `auto` starts.
#[derive(Debug, Clone, Copy)]
pub struct AutoPlan {
    /// The explicit method that takes the first steps.
    pub explicit: &'static Tableau,
    /// Why it starts with that method, in words that follow "because".
    pub reason: &'static str,
    /// Whether the problem is damped. If not, the stabilised method is never used.
    pub is_damped: bool,
    /// Steps of the explicit method before the other one is asked.
    pub patience: u64,
    /// Steps longer than this do not follow oscillations, which the stabilised method then damps, s; infinite
    /// if there are none.
    pub long: f64,
}

/// Takes steps with one active method at a time.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::integrator::{AutoPlan, Integrator};
/// use demhybrid::ode::method_switch::PATIENCE;
/// use demhybrid::ode::{MERSON, MethodName};
///
/// let (reason, long) = ("the motion is rough", f64::INFINITY);
/// let plan = AutoPlan { explicit: &MERSON, reason, is_damped: true, patience: PATIENCE, long };
/// let auto = Integrator::new(MethodName::Auto, plan);
/// assert!(!auto.is_stabilised()); // not before the stiffness is known
/// assert!(auto.report().contains("merson"));
/// assert!(Integrator::new(MethodName::Chebyshev, plan).is_stabilised());
/// ```
pub struct Integrator {
    active: Box<dyn Method>,
    /// For `auto`: the inactive method, and the method switch.
    resting: Option<(Box<dyn Method>, MethodSwitch)>,
    /// Largest stable step from the start of the step, s; none until it has been asked for.
    stable: Option<f64>,
    /// Right-hand sides evaluated since the last accepted step.
    spent: u64,
}

/// What the integrator carries over from one trial to the next. Another integrator that restores it continues
/// in the same way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    stable: Option<f64>,
    spent: u64,
    radius: Option<SpectralRadius>,
    tally: Option<Tally>,
}

impl Integrator {
    /// An integrator with the method `name`. `auto` says how the method of that name starts.
    pub fn new(name: MethodName, auto: AutoPlan) -> Self {
        let table = |table| Box::new(RungeKutta::new(table)) as Box<dyn Method>;
        let stabilised = || Box::new(Chebyshev::new(auto.long)) as Box<dyn Method>;
        let fixed = |active| Integrator { active, resting: None, stable: None, spent: 0 };
        match name {
            MethodName::Merson => fixed(table(&MERSON)),
            MethodName::DormandPrince => fixed(table(&DORMAND_PRINCE)),
            MethodName::VelocityVerlet => fixed(Box::new(Verlet)),
            MethodName::Chebyshev => fixed(stabilised()),
            MethodName::Auto => {
                let switch = MethodSwitch::new(auto.explicit, auto.reason, auto.patience);
                let switch = if auto.is_damped { switch } else { switch.forever() };
                let resting = Some((stabilised(), switch));
                Integrator { active: table(auto.explicit), resting, stable: None, spent: 0 }
            }
        }
    }

    /// Prepares a trial: finds the largest stable step and switches the method where that saves work. Call it
    /// before every trial. Collective.
    ///
    /// Returns the number of right-hand sides evaluated. `trial` is used as work space: its result is lost.
    pub fn prepare(&mut self, ivp: &mut dyn Ivp, step_start: &mut StepStart, trial: &mut TrialStep) -> u64 {
        if self.stable.is_some() {
            return 0;
        }
        let mut evaluations = 0;
        let mut cap = f64::INFINITY;
        if let Some((resting, switch)) = &mut self.resting {
            if switch.wants_stiffness() {
                let bound;
                (bound, evaluations) = resting.spectral_bound(ivp, step_start, trial);
                switch.learn(bound);
            }
            if let Some(limit) = switch.change() {
                std::mem::swap(&mut self.active, resting);
                cap = limit;
            }
        }
        let (stable, more) = self.active.stable_step(ivp, step_start, trial);
        self.stable = Some(stable.min(cap));
        evaluations += more;
        self.spent += evaluations;
        evaluations
    }

    /// What another integrator needs to continue in the same way.
    pub fn memory(&self) -> Memory {
        let resting = || self.resting.as_ref().and_then(|(method, _)| method.memory());
        Memory {
            stable: self.stable,
            spent: self.spent,
            // At most one of the two methods estimates the spectral radius.
            radius: self.active.memory().or_else(resting),
            tally: self.resting.as_ref().map(|(_, switch)| switch.tally()),
        }
    }

    /// Restores the memory of an integrator of the same scene, from this process or another. This integrator
    /// must be new.
    pub fn recall(&mut self, memory: &Memory) {
        (self.stable, self.spent) = (memory.stable, memory.spent);
        if let (Some((resting, switch)), Some(tally)) = (&mut self.resting, memory.tally)
            && switch.recall(tally)
        {
            std::mem::swap(&mut self.active, resting);
        }
        let Some(radius) = memory.radius else { return };
        for method in
            std::iter::once(&mut self.active).chain(self.resting.iter_mut().map(|(method, _)| method))
        {
            // Methods that do not estimate the radius ignore it.
            method.recall(radius);
        }
    }

    /// Whether the stabilised method is active.
    pub fn is_stabilised(&self) -> bool {
        self.active.known_bound().is_some()
    }

    /// Largest stable step from the start of the step, s; infinite if it is not known.
    pub fn stable_step(&self) -> f64 {
        self.stable.unwrap_or(f64::INFINITY)
    }

    /// The power of h with which the error of a step shrinks.
    pub fn error_order(&self) -> f64 {
        self.active.error_order()
    }

    /// Takes a trial step of size `h` (s) from `step_start`. Collective.
    pub fn attempt(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep,
    ) -> TrialOutcome {
        let outcome = self.active.attempt(ivp, step_start, h, norm, trial);
        self.spent += trial.evaluations;
        outcome
    }

    /// Dense output: the state at a `share` of the last trial, an accepted step of size `h` (s). None if the
    /// method has no dense output.
    pub fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart,
        trial: &TrialStep,
        layout: &Layout,
    ) -> Option<Vec<f64>> {
        self.active.inside(share, h, step_start, trial, layout)
    }

    /// Whether the active method has a dense output.
    pub fn has_inside(&self) -> bool {
        self.active.has_inside()
    }

    /// Tells the integrator that the last trial was rejected for its error.
    pub fn rejected(&mut self) {
        self.active.rejected();
        self.stable = None;
    }

    /// Tells the integrator that the last trial, of step size `h` (s) decided by `limit`, is accepted.
    pub fn accepted(&mut self, h: f64, limit: Limit) {
        if let Some((_, switch)) = &mut self.resting {
            switch.step(h, limit, self.spent, self.active.known_bound());
        }
        (self.stable, self.spent) = (None, 0);
    }

    /// Largest error of the rows `part` in the last trial, of step size `h` (s).
    pub fn error_of(
        &self,
        part: Part,
        h: f64,
        norm: &Norm,
        step_start: &StepStart,
        trial: &TrialStep,
    ) -> f64 {
        self.active.error_of(part, h, norm, step_start, trial)
    }

    /// Largest number of state vectors that the start of the step and the trial may hold together.
    ///
    /// These are state and slope at both ends of a step, the vectors that the active method uses within it,
    /// and the stiffest direction where a method estimates it.
    pub fn vectors(&self) -> usize {
        let resting = self.resting.as_ref().filter(|(_, switch)| !switch.is_final());
        let methods = || std::iter::once(&self.active).chain(resting.map(|(method, _)| method));
        let stages = methods().map(|method| method.stages()).max().unwrap_or(0);
        4 + stages + usize::from(methods().any(|method| method.known_bound().is_some()))
    }

    /// Name of the method and, for `auto`, which one was chosen and why.
    pub fn report(&self) -> String {
        let name = self.active.name();
        self.resting
            .as_ref()
            .map_or_else(|| name.to_string(), |(resting, switch)| switch.report(name, resting.name()))
    }
}
