//! The stabilised method: Runge-Kutta-Chebyshev of order 2, with as many stages as the stiffness requires.
//!
//! J. G. Verwer, B. P. Sommeijer, Computing 52 (1994); B. P. Sommeijer, L. F. Shampine, J. G. Verwer, RKC: an
//! explicit solver for parabolic PDEs, J. Comput. Appl. Math. 88 (1998) 315-326.
//!
//! Slightly damped Chebyshev polynomials stay bounded along the negative real axis up to 0.65 s^2. So s
//! right-hand sides cover a stiffness for which a classical method would need s^2/5 steps.

use super::{
    Dissipation, Errors, Ivp, Layout, Method, MethodName, Norm, Part, SpectralRadius, Stage, StepStart,
    TrialOutcome, TrialStep, add_dissipation, hermite, sums,
};

/// Damping epsilon: the polynomials stay below 1 - epsilon/3 in magnitude.
///
/// Without damping the stable region is pinched to single points of the axis. With it the region is a strip.
pub const DAMPING: f64 = 2.0 / 13.0;

/// Damping of long steps of problems that oscillate. The region is wider, so that it holds oscillations up to
/// |h lambda| = 4.9 at 60 degrees from the negative axis and 3.2 at 75, in place of 3.2 and 2.4. Its length
/// is about half.
pub const STRONG_DAMPING: f64 = 10.0;

/// The stable interval with `STRONG_DAMPING` is at least this times s^2 - 1.
pub const STRONG_INTERVAL: f64 = 0.347;

/// Largest |h lambda| of a step of two stages, for problems that oscillate. Up to there it holds oscillations
/// at 75 degrees from the negative axis, as steps of more stages do.
const MOST_OF_TWO: f64 = 1.5;

/// Steps of fewer stages are never damped strongly: nothing in them is stiff.
const FEW: usize = 9;

/// Largest number of stages of a step. Round-off grows with its square.
pub const MOST_STAGES: usize = 1000;

/// State vectors in use besides the state and the slope at both ends of a step: the changes of the state
/// since the start of the step, at the last two stages.
const CHANGES: usize = 2;

/// Coefficients of one stage, for the change D of the state since the start of the step.
///
/// D_j = mu D_{j-1} + nu D_{j-2} + h (mu~ F_{j-1} + gamma~ F_0)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// mu: weight of the change at the stage before.
    pub mu: f64,
    /// nu: weight of the change two stages before.
    pub nu: f64,
    /// mu~: weight of the slope at the stage before.
    pub mu_slope: f64,
    /// gamma~: weight of the slope at the start of the step.
    pub gamma: f64,
    /// Time of the stage as a share of the step.
    pub c: f64,
}

/// Length of the stable interval of `s` stages on the negative real axis.
pub fn real_stability(s: usize) -> f64 {
    2.0 / 3.0 * ((s * s) as f64 - 1.0) * (1.0 - 2.0 / 15.0 * DAMPING)
}

/// Number of stages that makes a step with |h lambda| = `z` stable; at least 2.
///
/// It exceeds [`MOST_STAGES`] by one where that many are not enough.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::chebyshev::{real_stability, stages_for};
///
/// let stages = stages_for(1000.0);
/// assert!(real_stability(stages) >= 1000.0 && real_stability(stages - 1) < 1000.0);
/// assert!(stages < 42); // far fewer right-hand sides than 1000/3.5 steps of an explicit method take
/// ```
pub fn stages_for(z: f64) -> usize {
    let s = (1.0 + z / (2.0 / 3.0 * (1.0 - 2.0 / 15.0 * DAMPING))).sqrt().ceil();
    // The cast saturates; NaN becomes 0.
    (s as usize).clamp(2, MOST_STAGES + 1)
}

/// Fills `table` with the coefficients of the stages 1..=s; s must be 2 or more.
///
/// Returns the error constant C: a step of size h errs by C h^3 y''' to leading order.
pub fn tabulate(s: usize, damping: f64, table: &mut Vec<Coefficients>) -> f64 {
    let w0 = 1.0 + damping / (s * s) as f64;
    // Maps T_{j-2} and T_{j-1} at w0, each with its first three derivatives, to T_{j-1} and T_j.
    let next = |[b, a]: [[f64; 4]; 2]| {
        let t = [
            2.0 * w0 * a[0] - b[0],
            2.0 * a[0] + 2.0 * w0 * a[1] - b[1],
            4.0 * a[1] + 2.0 * w0 * a[2] - b[2],
            6.0 * a[2] + 2.0 * w0 * a[3] - b[3],
        ];
        [a, t]
    };
    let first = [[1.0, 0.0, 0.0, 0.0], [w0, 1.0, 0.0, 0.0]];
    let [_, second] = next(first);
    let [_, last] = (2..=s).fold(first, |pair, _| next(pair));
    let w1 = last[1] / last[2];
    let weight = |t: &[f64; 4]| t[2] / (t[1] * t[1]);
    // b_{j-2} and b_{j-1}, where b_0 = b_1 = b_2.
    let mut b = [weight(&second); 2];
    table.clear();
    table.push(Coefficients {
        mu: 0.0,
        nu: 0.0,
        mu_slope: b[1] * w1,
        gamma: 0.0,
        c: w1 * second[2] / second[1] / (4.0 * w0),
    });
    let mut pair = first;
    for _ in 2..=s {
        let a = 1.0 - b[1] * pair[1][0];
        pair = next(pair);
        let t = &pair[1];
        let own = weight(t);
        let mu_slope = 2.0 * own * w1 / b[1];
        table.push(Coefficients {
            mu: 2.0 * own * w0 / b[1],
            nu: -own / b[0],
            mu_slope,
            gamma: -a * mu_slope,
            c: w1 * t[2] / t[1],
        });
        b = [b[1], own];
    }
    1.0 / 6.0 - weight(&last) * w1.powi(3) * last[3] / 6.0
}

/// Local error over its published estimate, to leading order, for the error constant C of a method.
///
/// The estimate is h^3 y'''/15 for the exact y_{n+1}, and 4/5 of the error of y_{n+1} come on top. So the
/// error is C/(1/15 + 4/5 C) of it: 0.83 for two stages, 0.69 for three, and 0.55 for many.
fn share_of_estimate(constant: f64) -> f64 {
    constant / (1.0 / 15.0 + 0.8 * constant)
}

/// The stabilised method.
pub struct Chebyshev {
    /// Estimate of the spectral radius.
    pub radius: SpectralRadius,
    /// Steps longer than this do not follow the oscillations of the problem, s; infinite if there are none.
    long: f64,
    /// Damping of the last step.
    damping: f64,
    /// Share of the estimated errors of the last step that counts.
    share: f64,
    /// Coefficients of the stages of the last step. Has capacity for the largest number of stages.
    table: Vec<Coefficients>,
}

impl Chebyshev {
    /// The method for a problem whose oscillations steps longer than `long` (s) do not follow. It is infinite
    /// for a problem that does not oscillate.
    pub fn new(long: f64) -> Self {
        let table = Vec::with_capacity(MOST_STAGES);
        Chebyshev { radius: SpectralRadius::default(), long, damping: DAMPING, share: 1.0, table }
    }

    /// Whether the problem oscillates.
    fn oscillates(&self) -> bool {
        self.long < f64::INFINITY
    }

    /// Stages and damping of a step `h` (s).
    fn plan(&self, h: f64) -> (usize, f64) {
        let z = h * self.radius.bound();
        let least = if self.oscillates() && z > MOST_OF_TWO { 3 } else { 2 };
        let s = stages_for(z).max(least);
        if h <= self.long || s < FEW {
            return (s.min(MOST_STAGES), DAMPING);
        }
        let s = (1.0 + z / STRONG_INTERVAL).sqrt().ceil() as usize;
        (s.clamp(FEW, MOST_STAGES), STRONG_DAMPING)
    }

    /// Length of the stable interval of the longest step.
    fn longest(&self) -> f64 {
        if !self.oscillates() {
            return real_stability(MOST_STAGES);
        }
        STRONG_INTERVAL * ((MOST_STAGES * MOST_STAGES) as f64 - 1.0)
    }

    /// Estimates of the local error of the rows `part`: 4/5 (y_n - y_{n+1}) + 2/5 h (F_n + F_{n+1}), times
    /// the `share` of it that counts.
    ///
    /// `next` and `slope` hold these rows only.
    fn errors(
        share: f64,
        part: Part,
        h: f64,
        norm: &Norm,
        step_start: &StepStart,
        (next, slope): (&[f64], &[f64]),
    ) -> Errors {
        let (y, first) = (&step_start.y[part.range()], &step_start.slope[part.range()]);
        let [own, weight] = [share * 0.8, share * (0.4 * h)];
        let errors = norm.errors(part, &[(y, own), (next, -own), (first, weight), (slope, weight)]);
        let scale = if norm.rate { 3.0 / h } else { 1.0 };
        Errors { largest: scale * errors.largest, ..errors }
    }
}

impl Method for Chebyshev {
    fn name(&self) -> MethodName {
        MethodName::Chebyshev
    }

    fn error_order(&self) -> f64 {
        3.0
    }

    fn stable_step(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        trial: &mut TrialStep,
    ) -> (f64, u64) {
        let (bound, evaluations) = self.spectral_bound(ivp, step_start, trial);
        (self.longest() / bound, evaluations)
    }

    fn spectral_bound(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        trial: &mut TrialStep,
    ) -> (f64, u64) {
        ivp.begin();
        let evaluations =
            step_start.find_slope(ivp) + self.radius.update(ivp, step_start, trial, self.oscillates());
        (self.radius.bound(), evaluations)
    }

    fn known_bound(&self) -> Option<f64> {
        Some(self.radius.bound())
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
        trial.reset(n, CHANGES);
        ivp.begin();
        trial.evaluations = step_start.find_slope(ivp);
        let (s, damping) = self.plan(h);
        if s != self.table.len() || damping != self.damping {
            let constant = tabulate(s, damping, &mut self.table);
            self.damping = damping;
            self.share = if self.oscillates() { share_of_estimate(constant) } else { 1.0 };
        }
        let (y, first, table) = (&step_start.y[..], &step_start.slope[..], &self.table[..]);
        // The new change overwrites the change of two stages before, and the new slope that of the stage
        // before. This is safe because a row of a stage depends only on the same row of these vectors.
        let make_stage = |j: usize, row: &Coefficients, stage: Stage| {
            let Stage { part, vectors: [next, even, odd], state, slope } = stage;
            let (changes, older) = if j.is_multiple_of(2) { (even, odd) } else { (odd, even) };
            let (y, first) = (&y[part.range()], &first[part.range()]);
            let [gamma, mu_slope] = [h * row.gamma, h * row.mu_slope];
            if j == 0 {
                sums::advance(y, (changes, None), &[(first, mu_slope)], state);
            } else {
                let own = if j == 1 { None } else { Some(row.nu) };
                let terms = [(&*older, row.mu), (first, gamma), (&*slope, mu_slope)];
                sums::advance(y, (changes, own), &terms, state);
            }
            if j + 1 == s {
                next.copy_from_slice(state);
            }
        };
        let mut dissipated: [Dissipation; 2] = [[0.0; 2]; 2];
        let mut dissipation = step_start.dissipation;
        let TrialStep { next, slope, stages, .. } = &mut *trial;
        let [even, odd, ..] = &mut stages[..] else { unreachable!("there is room for two") };
        for (j, row) in table.iter().enumerate() {
            let mut sum = [0.0; 2];
            if j > 0 {
                add_dissipation(&mut sum, row.mu, &dissipated[0]);
                add_dissipation(&mut sum, row.nu, &dissipated[1]);
                add_dissipation(&mut sum, h * row.gamma, &step_start.dissipation);
            }
            add_dissipation(&mut sum, h * row.mu_slope, &dissipation);
            dissipated = [sum, dissipated[0]];
            ivp.rhs_of(step_start.t + row.c * h, y, [next, even, odd], slope, &|stage: Stage| {
                make_stage(j, row, stage)
            });
            dissipation = ivp.dissipation();
        }
        trial.evaluations += s as u64;
        (trial.slope_known, trial.dissipation, trial.dissipated) = (true, dissipation, dissipated[0]);
        let TrialStep { next, slope, .. } = trial;
        let share = self.share;
        let error = |part: Part, rows: &mut [f64]| {
            Self::errors(share, part, h, norm, step_start, (rows, &slope[part.range()]))
        };
        ivp.agree(&step_start.y, next, &error)
    }

    fn has_inside(&self) -> bool {
        true
    }

    fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart,
        trial: &TrialStep,
        _layout: &Layout,
    ) -> Option<Vec<f64>> {
        let (start, end) = ([&step_start.y[..], &step_start.slope], [&trial.next[..], &trial.slope]);
        Some(hermite(share, h, start, end))
    }

    fn rejected(&mut self) {
        self.radius.doubt();
    }

    fn error_of(&self, part: Part, h: f64, norm: &Norm, step_start: &StepStart, trial: &TrialStep) -> f64 {
        let ends = (&trial.next[part.range()], &trial.slope[part.range()]);
        Self::errors(self.share, part, h, norm, step_start, ends).largest
    }

    fn stages(&self) -> usize {
        CHANGES
    }

    fn memory(&self) -> Option<SpectralRadius> {
        Some(self.radius)
    }

    fn recall(&mut self, memory: SpectralRadius) {
        self.radius = memory;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::{FinishRows, Segment};

    /// A row of two numbers that decay with these rates, 1/s.
    struct Decays {
        rates: [f64; 2],
        layout: Layout,
    }

    impl Ivp for Decays {
        fn layout(&self) -> &Layout {
            &self.layout
        }
        fn begin(&mut self) {}
        fn rhs(&mut self, _t: f64, y: &[f64], dydt: &mut [f64]) {
            dydt.copy_from_slice(&[-self.rates[0] * y[0], -self.rates[1] * y[1]]);
        }
        fn agree(&mut self, _y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
            TrialOutcome {
                error: finish(self.layout.whole(0), next).error(),
                covered: true,
                within_travel: true,
            }
        }
        fn length(&mut self, v: &[f64]) -> f64 {
            v[0].hypot(v[1])
        }
        fn add_direction(&mut self, _round: u64, share: f64, v: &mut [f64]) {
            v.iter_mut().for_each(|number| *number += share);
        }
        fn small_length(&self) -> f64 {
            1.5e-8
        }
    }

    #[test]
    fn where_the_motion_oscillates_the_estimate_is_the_error() {
        // The second number is 0. Its rate only asks for more stages.
        for (rate, least, most) in [(1.0, 2, 2), (400.0, 3, 3), (1e4, 10, 20), (1e6, 100, 200)] {
            let layout = Layout(vec![Segment { rows: 1, width: 2, positions: 0 }]);
            let (h, mut ivp) = (0.01, Decays { rates: [1.0, rate], layout });
            let mut estimate_per_error = |long: f64| {
                let norm = Norm { weights: vec![vec![1.0; 2]], rate: false, mean: None, rows: Vec::new() };
                let (mut method, mut trial) = (Chebyshev::new(long), TrialStep::default());
                let mut step_start = StepStart::new(0.0, vec![1.0, 0.0]);
                method.stable_step(&mut ivp, &mut step_start, &mut trial);
                let estimate = method.attempt(&mut ivp, &mut step_start, h, &norm, &mut trial).error;
                assert!((least..=most).contains(&trial.evaluations), "{}", trial.evaluations);
                estimate / (trial.next[0] - (-h).exp()).abs()
            };
            let [published, counted] = [f64::INFINITY, 1.0].map(&mut estimate_per_error);
            assert!((counted - 1.0).abs() < 0.02, "{rate} 1/s: {counted}");
            assert!((1.19..1.85).contains(&published), "{rate} 1/s: {published}");
        }
    }
}
