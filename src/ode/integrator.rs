//! The method that takes the steps: the one that the scene names, or the one that `auto` finds best.

use crate::ode::method_switch::{MethodSwitch, Tally};
use crate::ode::{
    Chebyshev, DORMAND_PRINCE, Ivp, Limit, MERSON, Method, MethodName, Norm, RungeKutta, SpectralRadius,
    StepStart, Tableau, TrialOutcome, TrialStep, Verlet,
};
use serde::{Deserialize, Serialize};

/// How `auto` begins.
#[derive(Debug, Clone, Copy)]
pub struct AutoPlan {
    /// The explicit method that takes the first steps.
    pub explicit: &'static Tableau,
    /// Why that one, in words that follow "because".
    pub reason: &'static str,
    /// Whether anything is damped: if not, the stabilised method has no place.
    pub is_damped: bool,
}

/// Takes steps with one method at a time.
pub struct Integrator<'c, P: Ivp> {
    active: Box<dyn Method<P> + 'c>,
    /// Of `auto`: the method that rests, and how to choose.
    resting: Option<(Box<dyn Method<P> + 'c>, MethodSwitch)>,
    /// Largest stable step from the anchor, s; none before it has been asked for.
    stable: Option<f64>,
    /// Right-hand sides since the last accepted step.
    spent: u64,
}

/// What the integrator remembers from one trial to the next: with it, another one goes on in the same way.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    stable: Option<f64>,
    spent: u64,
    radius: Option<SpectralRadius>,
    tally: Option<Tally>,
}

impl<'c, P: Ivp + 'c> Integrator<'c, P> {
    /// The method `name`; `auto` says how that one begins.
    pub fn new(name: MethodName, auto: AutoPlan) -> Self {
        let table = |table| Box::new(RungeKutta::new(table)) as Box<dyn Method<P> + 'c>;
        let fixed = |active| Integrator { active, resting: None, stable: None, spent: 0 };
        match name {
            MethodName::Merson => fixed(table(&MERSON)),
            MethodName::DormandPrince => fixed(table(&DORMAND_PRINCE)),
            MethodName::VelocityVerlet => fixed(Box::new(Verlet)),
            MethodName::Chebyshev => fixed(Box::<Chebyshev>::default()),
            MethodName::Auto => {
                let switch = MethodSwitch::new(auto.explicit, auto.reason);
                let switch = if auto.is_damped { switch } else { switch.forever() };
                let resting = Some((Box::<Chebyshev>::default() as Box<dyn Method<P> + 'c>, switch));
                Integrator { active: table(auto.explicit), resting, stable: None, spent: 0 }
            }
        }
    }

    /// To be called before a trial: finds out what is stable from `anchor`, and changes the method where that pays. Returns
    /// the right-hand sides that took. `trial` lends its room and loses its result. Collective.
    pub fn prepare(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        trial: &mut TrialStep<P::State>,
    ) -> u64 {
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

    /// What it remembers.
    pub fn memory(&self) -> Memory {
        let resting = || self.resting.as_ref().and_then(|(method, _)| method.memory());
        Memory {
            stable: self.stable,
            spent: self.spent,
            // One of two methods at most estimates the radius.
            radius: self.active.memory().or_else(resting),
            tally: self.resting.as_ref().map(|(_, switch)| switch.tally()),
        }
    }

    /// Takes up what another one of the same scene, in this process or another, remembered. This one must be new.
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
            // The others have nothing to remember.
            method.recall(radius);
        }
    }

    /// Whether the stabilised method is at work.
    pub fn is_stabilised(&self) -> bool {
        self.active.known_bound().is_some()
    }

    /// Largest stable step from the anchor, s, as far as it is known.
    pub fn stable_step(&self) -> f64 {
        self.stable.unwrap_or(f64::INFINITY)
    }

    /// The error of a step shrinks as h to this power.
    pub fn error_order(&self) -> f64 {
        self.active.error_order()
    }

    /// Takes a trial step `h` (s) from `anchor`. Collective.
    pub fn attempt(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep<P::State>,
    ) -> TrialOutcome {
        let outcome = self.active.attempt(ivp, step_start, h, norm, trial);
        self.spent += trial.evaluations;
        outcome
    }

    /// The state at a `share` of the last trial, a step `h` (s) that stands, if the method has a dense output.
    pub fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
    ) -> Option<Vec<P::State>> {
        (0..step_start.y.len()).map(|i| self.active.inside(share, h, step_start, trial, i)).collect()
    }

    /// Whether `inside` gives states.
    pub fn has_inside(&self) -> bool {
        self.active.has_inside()
    }

    /// The last trial was rejected for its error.
    pub fn rejected(&mut self) {
        self.active.rejected();
        self.stable = None;
    }

    /// The last trial, a step `h` (s) whose size was decided by `limit`, stands.
    pub fn accepted(&mut self, h: f64, limit: Limit) {
        if let Some((_, switch)) = &mut self.resting {
            switch.step(h, limit, self.spent, self.active.known_bound());
        }
        (self.stable, self.spent) = (None, 0);
    }

    /// Error of owned particle `i` in the last trial, of step `h` (s).
    pub fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
    ) -> f64 {
        self.active.error_of(i, h, norm, step_start, trial)
    }

    /// State vectors that anchor and trial may come to hold: state and slope at both ends of a step, what the methods keep
    /// of its inside, of which one is at work at a time, and the stiffest direction where a method asks for it.
    pub fn vectors(&self) -> usize {
        let resting = self.resting.as_ref().filter(|(_, switch)| !switch.is_final());
        let methods = || std::iter::once(&self.active).chain(resting.map(|(method, _)| method));
        let stages = methods().map(|method| method.stages()).max().unwrap_or(0);
        4 + stages + usize::from(methods().any(|method| method.known_bound().is_some()))
    }

    /// The method, and of `auto` what it picked and why.
    pub fn report(&self) -> String {
        let name = self.active.name();
        self.resting
            .as_ref()
            .map_or_else(|| name.to_owned(), |(resting, switch)| switch.report(name, resting.name()))
    }
}
