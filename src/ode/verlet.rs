//! Velocity Verlet with a fixed step, for comparison with other DEM codes.
//!
//! L. Verlet, Phys. Rev. 159 (1967) 98; W. C. Swope et al., J. Chem. Phys. 76 (1982) 637.
//!
//! As in LAMMPS and LIGGGHTS, forces are evaluated once a step, at the new positions and the velocities of
//! the half step. The order is 2 where forces depend on positions alone, and 1 where they depend on
//! velocities.

use super::{Ivp, Linear, Method, Norm, StepStart, TrialOutcome, TrialStep, add_dissipation};
use crate::math::larger;

/// The method. It carries nothing over from step to step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Verlet;

impl<P: Ivp> Method<P> for Verlet {
    fn name(&self) -> &'static str {
        "velocity-verlet"
    }

    fn error_order(&self) -> f64 {
        2.0
    }

    fn attempt(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        h: f64,
        _norm: &Norm,
        trial: &mut TrialStep<P::State>,
    ) -> TrialOutcome {
        trial.reset(step_start.y.len(), 0);
        ivp.begin();
        trial.evaluations = step_start.find_slope(ivp);
        let (y, first) = (&step_start.y, &step_start.slope);
        // The stage has the new positions and the velocities of the half step.
        let make = |_: usize,
                    start: usize,
                    [next]: [&mut [P::State]; 1],
                    stages: &mut [P::State],
                    _: &mut [P::State]| {
            for (k, half) in stages.iter_mut().enumerate() {
                *half = y[start + k];
                half.kick(0.5 * h, &first[start + k]);
                half.drift(h);
            }
            next.copy_from_slice(stages);
        };
        ivp.rhs_of(step_start.t + h, y, [0, 1], [&mut trial.next], &mut trial.slope, &make);
        trial.evaluations += 1;
        (trial.slope_known, trial.dissipation) = (true, ivp.dissipation());
        add_dissipation(&mut trial.dissipated, 0.5 * h, &step_start.dissipation);
        add_dissipation(&mut trial.dissipated, 0.5 * h, &trial.dissipation);
        let TrialStep { next, slope, .. } = trial;
        let finish = |start: usize, chunk: &mut [P::State]| {
            let mut largest = 0.0;
            for (next, slope) in chunk.iter_mut().zip(&slope[start..]) {
                next.kick(0.5 * h, slope);
                largest = larger(largest, next.max_abs());
            }
            // There is no error estimate: a step is accepted if it is finite.
            if largest < f64::INFINITY { 0.0 } else { f64::INFINITY }
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
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
        i: usize,
    ) -> Option<P::State> {
        let mut state = step_start.y[i];
        state.kick(0.5 * share * h, &step_start.slope[i]);
        state.drift(share * h);
        let mut mean = P::State::zero();
        mean.add_scaled(1.0 - share, &step_start.slope[i]);
        mean.add_scaled(share, &trial.slope[i]);
        state.kick(0.5 * share * h, &mean);
        Some(state)
    }

    fn error_of(
        &self,
        i: usize,
        _h: f64,
        _norm: &Norm,
        _anchor: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
    ) -> f64 {
        trial.next[i].max_abs()
    }

    fn stages(&self) -> usize {
        0
    }
}
