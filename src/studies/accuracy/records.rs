//! The records of runs: their solvers, their work and their results.

use crate::files::names::named;
use crate::math::interval::Interval;
use crate::ode::MethodName;
pub use crate::studies::job_pool::Work;
use serde::Serialize;
use std::collections::BTreeMap;

named! {
    /// The question that a run belongs to.
    Study {
        /// One impact, compared with its exact solution.
        Impact = "impact",
        /// All particles at one time, compared with a far more accurate run.
        State = "state",
        /// How far the energy deviates from what forces and dissipation allow.
        Energy = "energy",
        /// Statistics over many initial states.
        Ensemble = "ensemble",
    }
}

named! {
    /// A result of a run. The name includes the unit.
    Measure {
        /// Time to the next highest point of an impact, s.
        ReboundTime = "rebound time (s)",
        /// Relative error of that time.
        ReboundError = "error of rebound time",
        /// Delay of that time compared with a hard floor, s.
        LaterThanHard = "later than hard (s)",
        /// Speed of separation divided by speed of approach.
        Restitution = "restitution",
        /// Relative error of the restitution.
        RestitutionError = "error of restitution",
        /// Restitution minus the coefficient e.
        RestitutionBeyondE = "restitution beyond e",
        /// Relative error of the time within the interaction distance of the floor.
        ContactError = "error of contact time",
        /// Largest error of a position, m.
        PositionError = "position error (m)",
        /// Largest error of a velocity, m/s.
        VelocityError = "velocity error (m/s)",
        /// Largest error of an angular velocity, rad/s.
        SpinError = "spin error (rad/s)",
        /// Largest change of the energy over the largest kinetic energy, in scenes without dissipation.
        EnergyDrift = "energy drift",
        /// Largest energy not accounted for over the largest kinetic energy, in all other scenes.
        EnergyBalance = "energy balance",
        /// Share of the volume of the bed that spheres fill.
        VolumeFraction = "volume fraction",
        /// Highest point of any sphere, m.
        BedHeight = "bed height (m)",
        /// Mean number of spheres that a sphere is in contact with.
        Coordination = "coordination number",
        /// Largest overlap in any frame, m.
        LargestOverlap = "largest overlap (m)",
    }
}

impl Measure {
    /// Whether it is an error, of which the order of magnitude matters. Of the others all digits do.
    pub fn is_error(self) -> bool {
        use Measure::*;
        match self {
            ReboundError | RestitutionError | ContactError | PositionError | VelocityError | SpinError
            | EnergyDrift | EnergyBalance => true,
            ReboundTime | LaterThanHard | Restitution | RestitutionBeyondE | VolumeFraction | BedHeight
            | Coordination | LargestOverlap => false,
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
    /// Its results, in the order of their names.
    pub measures: BTreeMap<Measure, f64>,
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
    /// The measure.
    pub measure: Measure,
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
    fn results_are_written_under_their_names_in_the_order_of_the_names() {
        let all: BTreeMap<Measure, f64> = Measure::ALL.iter().map(|&measure| (measure, 1.0)).collect();
        let names: Vec<&str> = all.keys().map(|measure| measure.name()).collect();
        assert!(names.is_sorted() && names.len() == Measure::ALL.len(), "{names:?}");
        let json: serde_json::Value = serde_json::to_value(&all).unwrap();
        assert!(names.iter().all(|name| json[name] == 1.0), "{json}");
    }
}
