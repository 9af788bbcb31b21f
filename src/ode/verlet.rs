//! Velocity Verlet with a fixed step, for comparison with other DEM codes.
//!
//! L. Verlet, Phys. Rev. 159 (1967) 98; W. C. Swope et al., J. Chem. Phys. 76 (1982) 637.
//!
//! As in LAMMPS and LIGGGHTS, forces are evaluated once a step, at the new positions and the velocities of
//! the half step. The order is 2 where forces depend on positions alone, and 1 where they depend on
//! velocities.

use super::{
    Errors, Ivp, Layout, Method, MethodName, Norm, Part, Stage, StepStart, TrialOutcome, TrialStep,
    add_dissipation, largest_magnitude,
};

/// The method. It carries nothing over from step to step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Verlet;

impl Method for Verlet {
    fn name(&self) -> MethodName {
        MethodName::VelocityVerlet
    }

    fn error_order(&self) -> f64 {
        2.0
    }

    fn attempt(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        h: f64,
        _norm: &Norm,
        trial: &mut TrialStep,
    ) -> TrialOutcome {
        trial.reset(step_start.y.len(), 0);
        ivp.begin();
        trial.evaluations = step_start.find_slope(ivp);
        let (y, first) = (&step_start.y, &step_start.slope);
        // The stage has the new positions and the velocities of the half step.
        let make = |stage: Stage| {
            let Stage { part, vectors: [next, ..], state, .. } = stage;
            state.copy_from_slice(&y[part.range()]);
            part.kick(0.5 * h, &first[part.range()], state);
            part.drift(h, state);
            next.copy_from_slice(state);
        };
        let vectors = [&mut trial.next[..], &mut [], &mut []];
        ivp.rhs_of(step_start.t + h, y, vectors, &mut trial.slope, &make);
        trial.evaluations += 1;
        (trial.slope_known, trial.dissipation) = (true, ivp.dissipation());
        add_dissipation(&mut trial.dissipated, 0.5 * h, &step_start.dissipation);
        add_dissipation(&mut trial.dissipated, 0.5 * h, &trial.dissipation);
        let TrialStep { next, slope, .. } = trial;
        let finish = |part: Part, rows: &mut [f64]| {
            part.kick(0.5 * h, &slope[part.range()], rows);
            // There is no error estimate: a step is accepted if it is finite.
            Errors::largest(if largest_magnitude(rows) < f64::INFINITY { 0.0 } else { f64::INFINITY })
        };
        ivp.agree(y, next, &finish)
    }

    fn has_inside(&self) -> bool {
        true
    }

    /// The parabola of the scheme itself: the acceleration is constant up to the half step.
    fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart,
        trial: &TrialStep,
        layout: &Layout,
    ) -> Option<Vec<f64>> {
        let (first, last) = (&step_start.slope, &trial.slope);
        let mean: Vec<f64> =
            first.iter().zip(last).map(|(a, b)| 0.0 + a * (1.0 - share) + b * share).collect();
        let mut state = step_start.y.clone();
        for part in layout.parts() {
            let rows = &mut state[part.range()];
            part.kick(0.5 * share * h, &first[part.range()], rows);
            part.drift(share * h, rows);
            part.kick(0.5 * share * h, &mean[part.range()], rows);
        }
        Some(state)
    }

    fn error_of(&self, part: Part, _h: f64, _norm: &Norm, _step_start: &StepStart, trial: &TrialStep) -> f64 {
        largest_magnitude(&trial.next[part.range()])
    }

    fn stages(&self) -> usize {
        0
    }
}
