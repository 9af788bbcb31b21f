//! One trial step of any explicit Runge-Kutta table.

use super::{Ivp, Linear, Tableau, Verdict, larger};
use crate::parallel::{self, GRAIN};

/// Slopes and stage of the owned particles for one method.
pub struct Stepper<S> {
    tableau: &'static Tableau,
    slopes: Vec<Vec<S>>,
    stage: Vec<S>,
    /// `slopes[0]` is f at the current state: a repeated trial from there need not evaluate it again.
    first_slope_known: bool,
}

impl<S: Linear> Stepper<S> {
    /// A stepper for `tableau`; buffers follow the number of owned particles.
    pub fn new(tableau: &'static Tableau) -> Self {
        Stepper {
            tableau,
            slopes: vec![Vec::new(); tableau.stages()],
            stage: Vec::new(),
            first_slope_known: false,
        }
    }

    /// The method.
    pub fn tableau(&self) -> &'static Tableau {
        self.tableau
    }

    /// Evaluates f at the state `y` from which the first step will start, at time `t` (s). Collective.
    pub fn start<P: Ivp<State = S>>(&mut self, ivp: &mut P, t: f64, y: &[S]) {
        ivp.begin(y);
        self.resize(y.len());
        ivp.rhs(t, y, &mut self.slopes[0]);
        self.first_slope_known = true;
    }

    fn resize(&mut self, n: usize) {
        self.stage.resize(n, S::zero());
        for slope in &mut self.slopes {
            slope.resize(n, S::zero());
        }
    }

    /// To be called when the state has changed or its particles have moved in memory.
    pub fn forget(&mut self) {
        self.first_slope_known = false;
    }

    /// Right-hand sides that the next attempt takes.
    pub fn cost(&self) -> u64 {
        self.tableau.stages() as u64 - u64::from(self.first_slope_known)
    }

    /// f in stage `s` of the last attempt; length of the owned particles.
    pub fn slope(&self, s: usize) -> &[S] {
        &self.slopes[s]
    }

    /// The state in stage `s` of the last attempt, a step `h` (s) from `y`.
    pub fn stage(&self, s: usize, h: f64, y: &[S]) -> Vec<S> {
        (0..y.len()).map(|i| self.stage_of(s, h, y, i)).collect()
    }

    /// Error rate of particle `i` in the last attempt.
    pub fn error_of(&self, i: usize) -> f64 {
        self.combine(self.tableau.error, 1.0, i).max_abs()
    }

    /// Takes a trial step `h` (s) from `y` at time `t` (s) and leaves the result in `next`. Collective.
    pub fn attempt<P: Ivp<State = S>>(
        &mut self,
        ivp: &mut P,
        t: f64,
        h: f64,
        y: &[S],
        next: &mut Vec<S>,
    ) -> Verdict {
        self.resize(y.len());
        next.resize(y.len(), S::zero());
        let table = self.tableau;
        ivp.begin(y);
        if !self.first_slope_known {
            ivp.rhs(t, y, &mut self.slopes[0]);
            self.first_slope_known = true;
        }
        for s in 1..table.stages() {
            let mut stage = std::mem::take(&mut self.stage);
            parallel::for_chunks(&mut stage, GRAIN, |first, chunk| {
                for (k, stage) in chunk.iter_mut().enumerate() {
                    *stage = self.stage_of(s, h, y, first + k);
                }
            });
            ivp.rhs(t + table.c[s] * h, &stage, &mut self.slopes[s]);
            self.stage = stage;
        }
        let finish = |first: usize, chunk: &mut [S]| {
            let mut worst = 0.0;
            for (k, next) in chunk.iter_mut().enumerate() {
                let i = first + k;
                *next = y[i];
                next.add_scaled(1.0, &self.combine(table.b, h, i));
                worst = larger(worst, self.error_of(i));
            }
            worst
        };
        let error = parallel::chunks(next, GRAIN, finish, 0.0, larger);
        ivp.agree(error, next)
    }

    #[inline(always)]
    fn stage_of(&self, s: usize, h: f64, y: &[S], i: usize) -> S {
        let mut stage = y[i];
        stage.add_scaled(1.0, &self.combine(self.tableau.a[s], h, i));
        stage
    }

    /// h times the weighted sum of the slopes of particle `i`.
    #[inline(always)]
    fn combine(&self, weights: &[f64], h: f64, i: usize) -> S {
        let mut sum = S::zero();
        for (weight, slope) in weights.iter().zip(&self.slopes) {
            if *weight != 0.0 {
                sum.add_scaled(h * weight, &slope[i]);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MERSON;

    impl Linear for f64 {
        fn zero() -> Self {
            0.0
        }
        fn add_scaled(&mut self, s: f64, other: &Self) {
            *self += s * other;
        }
        fn max_abs(&self) -> f64 {
            larger(0.0, self.abs())
        }
    }

    /// y' = y cos t, y = exp(sin t).
    #[derive(Default)]
    struct Growth {
        evaluations: u64,
    }

    impl Ivp for Growth {
        type State = f64;
        fn begin(&mut self, _y: &[f64]) {}
        fn rhs(&mut self, t: f64, y: &[f64], dydt: &mut [f64]) {
            self.evaluations += 1;
            dydt[0] = y[0] * t.cos();
        }
        fn agree(&mut self, error: f64, _next: &[f64]) -> Verdict {
            Verdict { error, covered: true, within_travel: true }
        }
    }

    fn integrate(steps: u32) -> (f64, u64) {
        let (mut ivp, mut stepper) = (Growth::default(), Stepper::new(&MERSON));
        let (mut y, mut next, h) = (vec![1.0], Vec::new(), 2.0 / f64::from(steps));
        for k in 0..steps {
            stepper.attempt(&mut ivp, f64::from(k) * h, h, &y, &mut next);
            std::mem::swap(&mut y, &mut next);
            stepper.forget();
        }
        ((y[0] - 2f64.sin().exp()).abs(), ivp.evaluations)
    }

    #[test]
    fn halving_the_step_divides_the_error_by_sixteen() {
        let (coarse, fine) = (integrate(40).0, integrate(80).0);
        let order = (coarse / fine).log2();
        assert!((order - 4.0).abs() < 0.1, "order {order}");
    }

    #[test]
    fn a_repeated_trial_saves_its_first_slope() {
        let mut ivp = Growth::default();
        let mut stepper = Stepper::new(&MERSON);
        let mut next = Vec::new();
        assert_eq!(stepper.cost(), 5);
        stepper.attempt(&mut ivp, 0.0, 0.1, &[1.0], &mut next);
        let once = next[0];
        assert_eq!(stepper.cost(), 4);
        stepper.attempt(&mut ivp, 0.0, 0.2, &[1.0], &mut next);
        stepper.attempt(&mut ivp, 0.0, 0.1, &[1.0], &mut next);
        assert_eq!(ivp.evaluations, 13);
        assert_eq!(next[0], once);
    }

    #[test]
    fn merson_estimates_a_third_of_the_step_times_its_rate() {
        // For y' = y the local error of the fourth-order solution is about h^5/720 and the estimate h/3 rate is
        // of the same order: Merson's estimate is exact for linear problems with constant coefficients.
        struct Exponential;
        impl Ivp for Exponential {
            type State = f64;
            fn begin(&mut self, _y: &[f64]) {}
            fn rhs(&mut self, _t: f64, y: &[f64], dydt: &mut [f64]) {
                dydt[0] = y[0];
            }
            fn agree(&mut self, error: f64, _next: &[f64]) -> Verdict {
                Verdict { error, covered: true, within_travel: true }
            }
        }
        let h = 0.01;
        let mut next = Vec::new();
        let verdict = Stepper::new(&MERSON).attempt(&mut Exponential, 0.0, h, &[1.0], &mut next);
        let estimate = h / 3.0 * verdict.error;
        let fifth = h.powi(5);
        assert!((estimate / fifth * 720.0 - 1.0).abs() < 0.05, "{}", estimate / fifth * 720.0);
    }
}
