//! The stabilised method: Runge-Kutta-Chebyshev of order 2 with as many stages as the stiffness asks for.
//!
//! J. G. Verwer, B. P. Sommeijer, Computing 52 (1994); B. P. Sommeijer, L. F. Shampine, J. G. Verwer, RKC: an explicit
//! solver for parabolic PDEs, J. Comput. Appl. Math. 88 (1998) 315-326. Chebyshev polynomials that are damped a little
//! stay bounded along the negative real axis up to 0.65 s^2, so that s right-hand sides cover a stiffness that s^2/5
//! steps of a classical method would need.

use super::{
    Anchor, Ivp, Linear, Losses, Method, Norm, SpectralRadius, Trial, Verdict, add_losses, hermite, larger,
};
use crate::parallel::{self, GRAIN};

/// Damping epsilon: the polynomials stay below 1 - epsilon/3 in magnitude, and the stable region is a strip instead of
/// beads on the axis.
pub const DAMPING: f64 = 2.0 / 13.0;

/// Stages of one step at most: beyond, round-off grows as their square.
pub const MOST_STAGES: usize = 1000;

/// Coefficients of one stage, in terms of the change D since the start of the step:
/// D_j = mu D_{j-1} + nu D_{j-2} + h (mu~ F_{j-1} + gamma~ F_0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// Weight of the stage before.
    pub mu: f64,
    /// Weight of the one before that.
    pub nu: f64,
    /// Weight of the slope at the stage before, in steps.
    pub mu_slope: f64,
    /// Weight of the slope at the start, in steps.
    pub gamma: f64,
    /// Time of the stage as a share of the step.
    pub c: f64,
}

/// Length of the stable interval of `s` stages on the negative real axis.
pub fn real_stability(s: usize) -> f64 {
    2.0 / 3.0 * ((s * s) as f64 - 1.0) * (1.0 - 2.0 / 15.0 * DAMPING)
}

/// Stages that make a step with |h lambda| = `z` stable; at least 2.
pub fn stages_for(z: f64) -> usize {
    let s = (1.0 + z / (2.0 / 3.0 * (1.0 - 2.0 / 15.0 * DAMPING))).sqrt().ceil();
    // A cast saturates, also from NaN and infinity.
    (s as usize).clamp(2, MOST_STAGES + 1)
}

/// The coefficients of stages 1..=s.
pub fn stages(s: usize) -> Vec<Stage> {
    let w0 = 1.0 + DAMPING / (s * s) as f64;
    // T_j(w0) and its first two derivatives.
    let mut t = vec![[1.0, 0.0, 0.0], [w0, 1.0, 0.0]];
    for j in 2..=s {
        let (a, b): ([f64; 3], [f64; 3]) = (t[j - 1], t[j - 2]);
        t.push([
            2.0 * w0 * a[0] - b[0],
            2.0 * a[0] + 2.0 * w0 * a[1] - b[1],
            4.0 * a[1] + 2.0 * w0 * a[2] - b[2],
        ]);
    }
    let w1 = t[s][1] / t[s][2];
    let b = |j: usize| {
        let j = j.max(2);
        t[j][2] / (t[j][1] * t[j][1])
    };
    let a = |j: usize| 1.0 - b(j) * t[j][0];
    let c = |j: usize| if j == 1 { w1 * t[2][2] / t[2][1] / (4.0 * w0) } else { w1 * t[j][2] / t[j][1] };
    let mut stages = vec![Stage { mu: 0.0, nu: 0.0, mu_slope: b(1) * w1, gamma: 0.0, c: c(1) }];
    for j in 2..=s {
        let mu_slope = 2.0 * b(j) * w1 / b(j - 1);
        stages.push(Stage {
            mu: 2.0 * b(j) * w0 / b(j - 1),
            nu: -b(j) / b(j - 2),
            mu_slope,
            gamma: -a(j - 1) * mu_slope,
            c: c(j),
        });
    }
    stages
}

/// The method and its scratch.
pub struct Chebyshev<S> {
    /// Estimate of the spectral radius.
    pub radius: SpectralRadius<S>,
    table: Vec<Stage>,
    /// Changes since the start of the step at the last two stages.
    change: Vec<S>,
    before: Vec<S>,
    stage: Vec<S>,
    slope: Vec<S>,
}

impl<S: Linear> Chebyshev<S> {
    /// Estimate of the local error of particle `i`: 4/5 (y_n - y_{n+1}) + 2/5 h (F_n + F_{n+1}).
    #[inline(always)]
    fn error(i: usize, h: f64, norm: &Norm, anchor: &Anchor<S>, trial: (&[S], &[S])) -> f64 {
        let mut error = S::zero();
        error.add_scaled(0.8, &anchor.y[i]);
        error.add_scaled(-0.8, &trial.0[i]);
        error.add_scaled(0.4 * h, &anchor.slope[i]);
        error.add_scaled(0.4 * h, &trial.1[i]);
        let scale = if norm.rate { 3.0 / h } else { 1.0 };
        scale * error.magnitude(&norm.weights)
    }
}

impl<S: Linear> Default for Chebyshev<S> {
    fn default() -> Self {
        Chebyshev {
            radius: SpectralRadius::default(),
            table: Vec::new(),
            change: Vec::new(),
            before: Vec::new(),
            stage: Vec::new(),
            slope: Vec::new(),
        }
    }
}

impl<P: Ivp> Method<P> for Chebyshev<P::State> {
    fn name(&self) -> &'static str {
        "chebyshev"
    }

    fn error_order(&self) -> f64 {
        3.0
    }

    fn stable_step(&mut self, ivp: &mut P, anchor: &mut Anchor<P::State>) -> (f64, u64) {
        let (bound, evaluations) = self.spectral_bound(ivp, anchor);
        (real_stability(MOST_STAGES) / bound, evaluations)
    }

    fn spectral_bound(&mut self, ivp: &mut P, anchor: &mut Anchor<P::State>) -> (f64, u64) {
        ivp.begin(&anchor.y);
        let evaluations = anchor.find_slope(ivp) + self.radius.update(ivp, anchor);
        (self.radius.bound(), evaluations)
    }

    fn known_bound(&self) -> Option<f64> {
        Some(self.radius.bound())
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
        for buffer in [&mut self.change, &mut self.before, &mut self.stage, &mut self.slope] {
            buffer.resize(n, P::State::zero());
        }
        ivp.begin(&anchor.y);
        trial.evaluations = anchor.find_slope(ivp);
        let s = stages_for(h * self.radius.bound()).min(MOST_STAGES);
        if s != self.table.len() {
            self.table = stages(s);
        }
        let (y, first) = (&anchor.y, &anchor.slope);
        let mut lost: [Losses; 2] = [[0.0; 2]; 2];
        let mut losses = anchor.losses;
        for (j, row) in self.table.iter().enumerate() {
            // The oldest change gives its place to the new one.
            std::mem::swap(&mut self.change, &mut self.before);
            let (older, slope) = (&self.before, if j == 0 { first } else { &self.slope });
            let advance = |start: usize, changes: &mut [P::State], stages: &mut [P::State]| {
                for (k, (change, stage)) in changes.iter_mut().zip(stages).enumerate() {
                    let i = start + k;
                    let mut sum = P::State::zero();
                    if j > 0 {
                        sum.add_scaled(row.mu, &older[i]);
                        if j > 1 {
                            sum.add_scaled(row.nu, change);
                        }
                        sum.add_scaled(h * row.gamma, &first[i]);
                    }
                    sum.add_scaled(h * row.mu_slope, &slope[i]);
                    *change = sum;
                    *stage = y[i];
                    stage.add_scaled(1.0, &sum);
                }
            };
            let mut stage = std::mem::take(&mut self.stage);
            parallel::for_chunk_pairs(&mut self.change, &mut stage, GRAIN, advance);
            let mut sum = [0.0; 2];
            if j > 0 {
                add_losses(&mut sum, row.mu, &lost[0]);
                add_losses(&mut sum, row.nu, &lost[1]);
                add_losses(&mut sum, h * row.gamma, &anchor.losses);
            }
            add_losses(&mut sum, h * row.mu_slope, &losses);
            lost = [sum, lost[0]];
            let slope = if j + 1 == s { &mut trial.slope } else { &mut self.slope };
            ivp.rhs(anchor.t + row.c * h, &stage, slope);
            losses = ivp.losses();
            trial.evaluations += 1;
            self.stage = stage;
        }
        trial.next.copy_from_slice(&self.stage);
        (trial.slope_known, trial.losses, trial.lost) = (true, losses, lost[0]);
        let result = (&trial.next[..], &trial.slope[..]);
        let error = parallel::fold(n, GRAIN, |i| Self::error(i, h, norm, anchor, result), 0.0, larger);
        ivp.agree(error, &trial.next)
    }

    fn has_inside(&self) -> bool {
        true
    }

    fn inside(
        &self,
        share: f64,
        h: f64,
        anchor: &Anchor<P::State>,
        trial: &Trial<P::State>,
        i: usize,
    ) -> Option<P::State> {
        let ends = [[&anchor.y[i], &anchor.slope[i]], [&trial.next[i], &trial.slope[i]]];
        Some(hermite(share, h, ends[0], ends[1]))
    }

    fn rejected(&mut self) {
        self.radius.doubt();
    }

    fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        anchor: &Anchor<P::State>,
        trial: &Trial<P::State>,
    ) -> f64 {
        Self::error(i, h, norm, anchor, (&trial.next, &trial.slope))
    }

    fn vectors(&self) -> usize {
        4 + self.radius.vectors()
    }
}
