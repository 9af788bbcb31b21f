//! The records of runs: their solvers, their work and their results.

use crate::math::interval::Interval;
use crate::ode::MethodName;
pub use crate::studies::job_pool::Work;
use serde::Serialize;
use std::collections::BTreeMap;

/// The question that a run belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Study {
    /// One impact, compared with its exact solution.
    Impact,
    /// All particles at one time, compared with a far more accurate run.
    State,
    /// How far the energy deviates from what forces and dissipation allow.
    Energy,
    /// Statistics over many initial states.
    Ensemble,
}

impl Study {
    /// All studies.
    pub const ALL: [Study; 4] = [Study::Impact, Study::State, Study::Energy, Study::Ensemble];

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Study::Impact => "impact",
            Study::State => "state",
            Study::Energy => "energy",
            Study::Ensemble => "ensemble",
        }
    }
}

/// What advances the time: a method with the norm of its error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
pub enum Stepper {
    /// A method, in the scaled norm.
    Method(MethodName),
    /// The published solver: Merson's method, in the paper's norm.
    Published,
}

impl Stepper {
    /// Name in tables and files: the name of the method, or `paper`.
    pub fn name(self) -> &'static str {
        match self {
            Stepper::Method(method) => method.name(),
            Stepper::Published => "paper",
        }
    }
}

impl std::fmt::Display for Stepper {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.pad(self.name())
    }
}

impl From<Stepper> for &'static str {
    fn from(stepper: Stepper) -> Self {
        stepper.name()
    }
}

/// A time-stepping method, with the number that determines its accuracy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Solver {
    /// The method.
    pub method: Stepper,
    /// `solver.tolerance`; `None` for a method with a fixed step.
    pub tolerance: Option<f64>,
    /// Fixed step, s; `None` for a method that chooses its own.
    pub step: Option<f64>,
}

impl Solver {
    /// Method and accuracy: `chebyshev 1e-3`, `velocity-verlet 1e-5 s`.
    pub fn label(&self) -> String {
        let tolerance = self.tolerance.map(|tolerance| format!(" {tolerance:e}"));
        let step = self.step.map(|step| format!(" {step:e} s"));
        format!("{}{}{}", self.method.name(), tolerance.unwrap_or_default(), step.unwrap_or_default())
    }
}

/// One run: its parameters, its work and its results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Record {
    /// The study it belongs to.
    pub study: Study,
    /// Value of a swept scene key, such as `contact.stiffness_exponent=30`.
    pub variation: Option<String>,
    /// The solver.
    pub solver: Solver,
    /// Seed of the initial state, if the study has several.
    pub seed: Option<u64>,
    /// Its work; for a failed run, the work up to the failure.
    pub work: Work,
    /// Results by name. The name includes the unit.
    pub measures: BTreeMap<String, f64>,
    /// Why the run ended early, or `None`.
    pub failure: Option<String>,
}

/// A measure of one solver over many initial states.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// Value of a swept scene key, such as `contact.stiffness_exponent=30`.
    pub variation: Option<String>,
    /// The solver.
    pub solver: Solver,
    /// Name of the measure, with the unit.
    pub measure: String,
    /// Mean over the seeds.
    pub interval: Interval,
    /// Mean difference to the most accurate solver, for equal seeds.
    pub paired: Option<Interval>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solver(method: MethodName, tolerance: Option<f64>, step: Option<f64>) -> Solver {
        Solver { method: Stepper::Method(method), tolerance, step }
    }

    #[test]
    fn a_label_names_the_method_and_what_sets_its_accuracy() {
        assert_eq!(solver(MethodName::Chebyshev, Some(1e-3), None).label(), "chebyshev 1e-3");
        assert_eq!(solver(MethodName::VelocityVerlet, None, Some(1e-5)).label(), "velocity-verlet 1e-5 s");
        assert_eq!(solver(MethodName::Auto, None, None).label(), "auto");
    }

    #[test]
    fn a_study_is_serialised_as_its_name() {
        for study in Study::ALL {
            let json = serde_json::to_value(study).unwrap();
            assert_eq!(json, study.name());
        }
    }
}
