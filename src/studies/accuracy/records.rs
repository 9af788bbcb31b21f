//! What a run gave and what it cost.

use crate::math::interval::Interval;
use crate::ode::MethodName;
pub use crate::studies::job_pool::Work;
use serde::Serialize;
use std::collections::BTreeMap;

/// The question that a run helps to answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Study {
    /// One impact: how far the rebound is from a far more accurate one.
    Impact,
    /// All particles at a fixed time: how far they are from a far more accurate run.
    State,
    /// How far the energy is from what forces and losses allow.
    Energy,
    /// Statistics over many initial states.
    Ensemble,
}

impl Study {
    /// All of them.
    pub const ALL: [Study; 4] = [Study::Impact, Study::State, Study::Energy, Study::Ensemble];

    /// The word for it in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Study::Impact => "impact",
            Study::State => "state",
            Study::Energy => "energy",
            Study::Ensemble => "ensemble",
        }
    }
}

/// What steps in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
pub enum Stepper {
    /// A method, in the scaled norm.
    Method(MethodName),
    /// The published solver: Merson's method, in the paper's norm.
    Published,
}

impl Stepper {
    /// The word for it in tables and files: the name of the method, or `paper`.
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

/// A time-stepping method and what sets its accuracy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Solver {
    /// What steps.
    pub method: Stepper,
    /// `solver.tolerance`; none for a method with a fixed step.
    pub tolerance: Option<f64>,
    /// Fixed step, s; none for a method that chooses its own.
    pub step: Option<f64>,
}

impl Solver {
    /// Method and accuracy in a few words: `chebyshev 1e-3`, `velocity-verlet 1e-5 s`.
    pub fn label(&self) -> String {
        let tolerance = self.tolerance.map(|tolerance| format!(" {tolerance:e}"));
        let step = self.step.map(|step| format!(" {step:e} s"));
        format!("{}{}{}", self.method.name(), tolerance.unwrap_or_default(), step.unwrap_or_default())
    }
}

/// One run: what was asked, what it cost, what came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Record {
    /// The question it belongs to.
    pub study: Study,
    /// Value of a swept scene key, such as `contact.stiffness_exponent=30`.
    pub variation: Option<String>,
    /// How time was stepped.
    pub solver: Solver,
    /// Seed of the initial state, where the study has several.
    pub seed: Option<u64>,
    /// What it cost; for a failed run, up to the failure.
    pub work: Work,
    /// Results by name, the unit within the name.
    pub measures: BTreeMap<String, f64>,
    /// Why the run ended early, if it did.
    pub failure: Option<String>,
}

/// A measure of one solver over many initial states.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// Value of a swept scene key, such as `contact.stiffness_exponent=30`.
    pub variation: Option<String>,
    /// How time was stepped.
    pub solver: Solver,
    /// Name of the measure, the unit within the name.
    pub measure: String,
    /// Its mean over the seeds.
    pub interval: Interval,
    /// Mean of the differences to the most accurate solver on the same seeds.
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
