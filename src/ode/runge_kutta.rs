//! Trial steps of any explicit Runge-Kutta method, given as a table.

use super::{
    Dissipation, Errors, Ivp, Layout, Method, MethodName, Norm, Part, Stage, StepStart, Tableau, Term,
    TrialOutcome, TrialStep, add_dissipation, sums,
};

/// Largest number of stages of a table.
const MOST: usize = 7;

/// The slopes of all stages, that of stage 0 first.
///
/// A slope that is no longer needed may have been overwritten by the slope of a later stage, which is then
/// found in both entries. All later weights of the overwritten slope are 0.
type Slopes<'a> = [&'a [f64]; MOST];

/// The Runge-Kutta method of one table.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{DORMAND_PRINCE, MERSON, Method, RungeKutta};
///
/// let method = RungeKutta::new(&DORMAND_PRINCE);
/// assert_eq!(method.name().to_string(), "dormand-prince");
/// assert!(method.has_inside()); // frames within a step cost nothing
/// assert!(!RungeKutta::new(&MERSON).has_inside());
/// ```
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
    fn slopes<'a>(&self, first: &'a [f64], slope: &'a [f64], stages: &'a [Vec<f64>]) -> Slopes<'a> {
        let mut slopes: Slopes<'a> = [&[]; MOST];
        slopes[0] = first;
        for (slope_at, &slot) in slopes[1..].iter_mut().zip(&self.slots) {
            *slope_at = if slot == 0 { slope } else { &stages[slot - 1] };
        }
        slopes
    }

    /// Errors of the rows `part`, in the given norm. The slopes are those of all rows.
    fn errors(&self, part: Part, h: f64, norm: &Norm, slopes: &Slopes) -> Errors {
        let weights = Weights::new(self.tableau.error, if norm.rate { 1.0 } else { h / 3.0 });
        norm.errors(part, weights.terms(&slopes.map(|slope| rows_of(slope, part))).all())
    }
}

/// The weights of a sum of slopes that are not 0, each times the step.
struct Weights {
    /// Index of the slope, and its weight.
    terms: [(usize, f64); MOST],
    count: usize,
}

impl Weights {
    fn new(weights: &[f64], h: f64) -> Self {
        let (mut terms, mut count) = ([(0, 0.0); MOST], 0);
        for (s, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            terms[count] = (s, h * weight);
            count += 1;
        }
        Weights { terms, count }
    }

    /// The terms of the weighted sum of the slopes.
    fn terms<'a>(&self, slopes: &Slopes<'a>) -> Terms<'a> {
        let mut terms: [Term; MOST] = [(&[], 0.0); MOST];
        for (term, &(s, weight)) in terms.iter_mut().zip(&self.terms[..self.count]) {
            *term = (slopes[s], weight);
        }
        Terms { terms, count: self.count }
    }
}

/// The terms of a weighted sum.
struct Terms<'a> {
    terms: [Term<'a>; MOST],
    count: usize,
}

impl<'a> Terms<'a> {
    fn all(&self) -> &[Term<'a>] {
        &self.terms[..self.count]
    }
}

/// The rows `part` of a slope; of a slope that is empty, nothing.
fn rows_of(slope: &[f64], part: Part) -> &[f64] {
    if slope.is_empty() { slope } else { &slope[part.range()] }
}

/// The vector in a slot that `slots` assigned.
fn vector_at<'a>(slot: usize, slope: &'a mut Vec<f64>, stages: &'a mut [Vec<f64>]) -> &'a mut Vec<f64> {
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

impl Method for RungeKutta {
    fn name(&self) -> MethodName {
        self.tableau.name
    }

    fn error_order(&self) -> f64 {
        self.tableau.error_order
    }

    fn attempt(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep,
    ) -> TrialOutcome {
        let n = step_start.y.len();
        trial.reset(n, self.stages());
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
            let weights = Weights::new(table.a[s], h);
            let make = |stage: Stage| {
                let Stage { part, vectors: [next, ..], state, slope: old } = stage;
                let slopes = slopes.map(|slope| if slope.is_empty() { &*old } else { &slope[part.range()] });
                sums::add_to(&y[part.range()], weights.terms(&slopes).all(), state);
                if is_result {
                    next.copy_from_slice(state);
                }
            };
            let vectors = [&mut next[..], &mut [], &mut []];
            ivp.rhs_of(step_start.t + table.c[s] * h, y, vectors, &mut new, &make);
            *vector_at(slot, slope, stages) = new;
            self.dissipation[s - 1] = ivp.dissipation();
        }
        let slopes = self.slopes(first, slope, stages);
        let weights = Weights::new(table.b, h);
        let finish = |part: Part, rows: &mut [f64]| {
            // Where the last stage is the result, `next` holds it already.
            if !table.first_same_as_last {
                let slopes = slopes.map(|slope| rows_of(slope, part));
                sums::add_to(&y[part.range()], weights.terms(&slopes).all(), rows);
            }
            self.errors(part, h, norm, &slopes)
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
        step_start: &StepStart,
        trial: &TrialStep,
        _layout: &Layout,
    ) -> Option<Vec<f64>> {
        let weights = Weights::new(&(self.tableau.dense?)(share), h);
        let slopes = self.slopes(&step_start.slope, &trial.slope, &trial.stages);
        let mut state = step_start.y.clone();
        sums::add_to(&step_start.y, weights.terms(&slopes).all(), &mut state);
        Some(state)
    }

    fn error_of(&self, part: Part, h: f64, norm: &Norm, step_start: &StepStart, trial: &TrialStep) -> f64 {
        self.errors(part, h, norm, &self.slopes(&step_start.slope, &trial.slope, &trial.stages)).largest
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
