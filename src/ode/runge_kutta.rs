//! One trial step of any explicit Runge-Kutta table.

use super::{Anchor, Ivp, Linear, Losses, Method, Norm, Tableau, Trial, Verdict, add_losses, larger};
use crate::parallel::{self, GRAIN};

/// Slopes and stage of the owned particles for one table.
pub struct RungeKutta<S> {
    tableau: &'static Tableau,
    /// Slopes of stages 1, 2, ...; that of stage 0 is the anchor's.
    slopes: Vec<Vec<S>>,
    losses: Vec<Losses>,
    stage: Vec<S>,
}

impl<S: Linear> RungeKutta<S> {
    /// For `tableau`; buffers follow the number of owned particles.
    pub fn new(tableau: &'static Tableau) -> Self {
        let rest = tableau.stages() - 1;
        RungeKutta {
            tableau,
            slopes: vec![Vec::new(); rest],
            losses: vec![[0.0; 2]; rest],
            stage: Vec::new(),
        }
    }

    /// The weighted sum of the slopes of particle `i`, times `h`.
    #[inline(always)]
    fn combine(&self, weights: &[f64], h: f64, first: &[S], i: usize) -> S {
        let mut sum = S::zero();
        if weights[0] != 0.0 {
            sum.add_scaled(h * weights[0], &first[i]);
        }
        for (weight, slope) in weights[1..].iter().zip(&self.slopes) {
            if *weight != 0.0 {
                sum.add_scaled(h * weight, &slope[i]);
            }
        }
        sum
    }

    /// Error of particle `i` in the given norm.
    #[inline(always)]
    fn error(&self, i: usize, h: f64, norm: &Norm, first: &[S]) -> f64 {
        let scale = if norm.rate { 1.0 } else { h / 3.0 };
        self.combine(self.tableau.error, scale, first, i).magnitude(&norm.weights)
    }
}

impl<P: Ivp> Method<P> for RungeKutta<P::State> {
    fn name(&self) -> &'static str {
        self.tableau.name
    }

    fn error_order(&self) -> f64 {
        self.tableau.error_order
    }

    fn attempt(
        &mut self,
        ivp: &mut P,
        anchor: &mut Anchor<P::State>,
        h: f64,
        norm: &Norm,
        trial: &mut Trial<P::State>,
    ) -> Verdict {
        let n = anchor.y.len();
        trial.reset(n);
        self.stage.resize(n, P::State::zero());
        self.slopes.iter_mut().for_each(|slope| slope.resize(n, P::State::zero()));
        let table = self.tableau;
        ivp.begin(&anchor.y);
        trial.evaluations = anchor.find_slope(ivp);
        let (y, first) = (&anchor.y, &anchor.slope);
        for s in 1..table.stages() {
            let mut stage = std::mem::take(&mut self.stage);
            parallel::for_chunks(&mut stage, GRAIN, |start, chunk| {
                for (k, stage) in chunk.iter_mut().enumerate() {
                    let i = start + k;
                    *stage = y[i];
                    stage.add_scaled(1.0, &self.combine(table.a[s], h, first, i));
                }
            });
            ivp.rhs(anchor.t + table.c[s] * h, &stage, &mut self.slopes[s - 1]);
            self.losses[s - 1] = ivp.losses();
            trial.evaluations += 1;
            self.stage = stage;
        }
        let finish = |start: usize, chunk: &mut [P::State]| {
            let mut worst = 0.0;
            for (k, next) in chunk.iter_mut().enumerate() {
                let i = start + k;
                *next = y[i];
                next.add_scaled(1.0, &self.combine(table.b, h, first, i));
                worst = larger(worst, self.error(i, h, norm, first));
            }
            worst
        };
        let error = parallel::chunks(&mut trial.next, GRAIN, finish, 0.0, larger);
        add_losses(&mut trial.lost, h * table.b[0], &anchor.losses);
        for (b, losses) in table.b[1..].iter().zip(&self.losses) {
            add_losses(&mut trial.lost, h * b, losses);
        }
        if table.first_same_as_last {
            let last = self.slopes.last_mut().expect("a table has two stages at least");
            trial.slope.copy_from_slice(last);
            trial.losses = *self.losses.last().expect("a table has two stages at least");
            trial.slope_known = true;
        }
        ivp.agree(error, &trial.next)
    }

    fn has_inside(&self) -> bool {
        self.tableau.dense.is_some()
    }

    fn inside(
        &self,
        share: f64,
        h: f64,
        anchor: &Anchor<P::State>,
        _trial: &Trial<P::State>,
        i: usize,
    ) -> Option<P::State> {
        let weights = (self.tableau.dense?)(share);
        let mut state = anchor.y[i];
        state.add_scaled(1.0, &self.combine(&weights, h, &anchor.slope, i));
        Some(state)
    }

    fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        anchor: &Anchor<P::State>,
        _trial: &Trial<P::State>,
    ) -> f64 {
        self.error(i, h, norm, &anchor.slope)
    }

    fn vectors(&self) -> usize {
        self.tableau.stages()
    }
}
