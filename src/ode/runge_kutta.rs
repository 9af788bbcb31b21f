//! Trial steps of any explicit Runge-Kutta method, given as a table.

use super::{
    Dissipation, Ivp, Linear, Method, Norm, StepStart, Tableau, TrialOutcome, TrialStep, add_dissipation,
};
use crate::math::larger;

/// Largest number of stages of a table.
const MOST: usize = 7;

/// The slopes of all stages, that of stage 0 first.
///
/// A slope that is no longer needed may have been overwritten by the slope of a later stage, which is then
/// found in both entries. All later weights of the overwritten slope are 0.
type Slopes<'a, S> = [&'a [S]; MOST];

/// The Runge-Kutta method of one table.
pub struct RungeKutta {
    tableau: &'static Tableau,
    /// Slots that keep the slopes of stages 1, 2, ..., as `slots` assigns them.
    slots: Vec<usize>,
    dissipation: Vec<Dissipation>,
}

impl RungeKutta {
    /// The method of `tableau`.
    pub fn new(tableau: &'static Tableau) -> Self {
        RungeKutta { tableau, slots: slots(tableau), dissipation: vec![[0.0; 2]; tableau.stages() - 1] }
    }

    /// The slopes of a trial whose vectors are `slope` and `stages`; `first` is the slope of stage 0.
    #[inline(always)]
    fn slopes<'a, S>(&self, first: &'a [S], slope: &'a [S], stages: &'a [Vec<S>]) -> Slopes<'a, S> {
        let mut slopes: Slopes<'a, S> = [&[]; MOST];
        slopes[0] = first;
        for (slope_at, &slot) in slopes[1..].iter_mut().zip(&self.slots) {
            *slope_at = if slot == 0 { slope } else { &stages[slot - 1] };
        }
        slopes
    }

    /// Error of row `i` in the given norm.
    #[inline(always)]
    fn error<S: Linear>(&self, i: usize, h: f64, norm: &Norm, slopes: &Slopes<S>) -> f64 {
        let scale = if norm.rate { 1.0 } else { h / 3.0 };
        combine(self.tableau.error, scale, slopes, i).magnitude(&norm.weights)
    }
}

/// The weighted sum of the slopes of row `i`, times `h`.
#[inline(always)]
fn combine<S: Linear>(weights: &[f64], h: f64, slopes: &Slopes<S>, i: usize) -> S {
    let mut sum = S::zero();
    for (weight, slope) in weights.iter().zip(slopes) {
        if *weight != 0.0 {
            sum.add_scaled(h * weight, &slope[i]);
        }
    }
    sum
}

/// The vector in a slot that `slots` assigned.
fn vector_at<'a, S>(slot: usize, slope: &'a mut Vec<S>, stages: &'a mut [Vec<S>]) -> &'a mut Vec<S> {
    if slot == 0 { slope } else { &mut stages[slot - 1] }
}

/// Assigns slots to the slopes of stages 1, 2, ... of `tableau`: 0 is the slope of the trial, k is its
/// `stages[k - 1]`.
///
/// A slot is used again once no later stage needs its slope, and neither do the result, the error and the
/// dense output.
fn slots(tableau: &Tableau) -> Vec<usize> {
    let end = tableau.stages();
    // A weight of the dense output that is 0 at this point is 0 everywhere in the step.
    let inside = tableau.dense.map(|weights| weights(0.3));
    let is_kept = |s: usize| {
        tableau.b[s] != 0.0 || tableau.error[s] != 0.0 || inside.is_some_and(|weights| weights[s] != 0.0)
    };
    let last_use = |s: usize| {
        if is_kept(s) { end } else { (s + 1..end).rev().find(|&t| tableau.a[t][s] != 0.0).unwrap_or(s) }
    };
    // The last stage that needs the slope in each slot. Slot 0 is kept free for the slope at the end of the
    // step, if the method evaluates it.
    let mut taken = vec![if tableau.first_same_as_last { end } else { 0 }];
    let mut slots = Vec::new();
    for s in 1..end {
        // Stage s itself may still need the old slope: the stage is computed before its slope is stored.
        let slot = if tableau.first_same_as_last && s + 1 == end {
            0
        } else {
            taken.iter().position(|&last| last <= s).unwrap_or(taken.len())
        };
        if slot == taken.len() {
            taken.push(end);
        }
        taken[slot] = last_use(s);
        slots.push(slot);
    }
    slots
}

impl<P: Ivp> Method<P> for RungeKutta {
    fn name(&self) -> &'static str {
        self.tableau.name
    }

    fn error_order(&self) -> f64 {
        self.tableau.error_order
    }

    fn attempt(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep<P::State>,
    ) -> TrialOutcome {
        let n = step_start.y.len();
        trial.reset(n, Method::<P>::stages(self));
        let table = self.tableau;
        ivp.begin();
        trial.evaluations = step_start.find_slope(ivp);
        let (y, first) = (&step_start.y, &step_start.slope);
        let TrialStep { next, slope, stages, .. } = &mut *trial;
        for s in 1..table.stages() {
            // The new slope overwrites an old one that this stage may still need. `make` finds the old one in
            // `dydt`.
            let slot = self.slots[s - 1];
            let mut new = std::mem::take(vector_at(slot, slope, stages));
            let slopes = self.slopes(first, slope, stages);
            let is_result = table.first_same_as_last && s + 1 == table.stages();
            let make = |_: usize,
                        start: usize,
                        [next]: [&mut [P::State]; 1],
                        stages: &mut [P::State],
                        old: &mut [P::State]| {
                let slopes = slopes.map(|slope| if slope.is_empty() { &*old } else { &slope[start..] });
                for (k, stage) in stages.iter_mut().enumerate() {
                    *stage = y[start + k];
                    stage.add_scaled(1.0, &combine(table.a[s], h, &slopes, k));
                }
                if is_result {
                    next.copy_from_slice(stages);
                }
            };
            ivp.rhs_of(step_start.t + table.c[s] * h, y, [0, 1], [next], &mut new, &make);
            *vector_at(slot, slope, stages) = new;
            self.dissipation[s - 1] = ivp.dissipation();
        }
        let slopes = self.slopes(first, slope, stages);
        let finish = |start: usize, part: &mut [P::State]| {
            let mut worst = 0.0;
            for (i, next) in (start..).zip(part) {
                // If the last stage is the result, `next` already holds it.
                if !table.first_same_as_last {
                    *next = y[i];
                    next.add_scaled(1.0, &combine(table.b, h, &slopes, i));
                }
                worst = larger(worst, self.error(i, h, norm, &slopes));
            }
            worst
        };
        let outcome = ivp.agree(y, next, &finish);
        trial.evaluations += table.stages() as u64 - 1;
        add_dissipation(&mut trial.dissipated, h * table.b[0], &step_start.dissipation);
        for (b, dissipation) in table.b[1..].iter().zip(&self.dissipation) {
            add_dissipation(&mut trial.dissipated, h * b, dissipation);
        }
        if table.first_same_as_last {
            trial.dissipation = *self.dissipation.last().expect("a table has two stages at least");
            trial.slope_known = true;
        }
        outcome
    }

    fn has_inside(&self) -> bool {
        self.tableau.dense.is_some()
    }

    fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
        i: usize,
    ) -> Option<P::State> {
        let weights = (self.tableau.dense?)(share);
        let mut state = step_start.y[i];
        let slopes = self.slopes(&step_start.slope, &trial.slope, &trial.stages);
        state.add_scaled(1.0, &combine(&weights, h, &slopes, i));
        Some(state)
    }

    fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
    ) -> f64 {
        self.error(i, h, norm, &self.slopes(&step_start.slope, &trial.slope, &trial.stages))
    }

    fn stages(&self) -> usize {
        self.slots.iter().copied().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::{DORMAND_PRINCE, MERSON};

    #[test]
    fn slopes_share_places_where_none_is_needed_any_more() {
        // Merson needs the slope of stage 1 for stage 2 only; Dormand-Prince needs it for stages 2 to 5.
        assert_eq!(slots(&MERSON), [0, 0, 1, 2]);
        assert_eq!(slots(&DORMAND_PRINCE), [1, 2, 3, 4, 1, 0]);
    }
}
