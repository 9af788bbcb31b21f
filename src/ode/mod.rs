//! Explicit methods for y' = f(t, y) with adaptive steps. Knows neither particles nor ranks: the problem evaluates f
//! and agrees on the outcome of a trial step.

pub mod controller;
pub mod step;
pub mod tableau;

pub use controller::{Decision, StepRule};
pub use step::Stepper;
pub use tableau::{MERSON, Tableau};

/// A vector space element: the state of one particle.
pub trait Linear: Copy + Send + Sync {
    /// The neutral element.
    fn zero() -> Self;
    /// Adds `s * other`.
    fn add_scaled(&mut self, s: f64, other: &Self);
    /// Largest component by magnitude; NaN becomes +infinity.
    fn max_abs(&self) -> f64;
}

/// What all ranks know after a trial step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Largest error over all components of all particles; +infinity when anything is not finite.
    pub error: f64,
    /// The neighbour lists covered every stage and the result: if not, the trial says nothing.
    pub covered: bool,
    /// Neither a stage nor the result moved a particle further from the start of the step than a step may.
    pub within_travel: bool,
}

/// An initial value problem whose state is spread over ranks: every rank holds a slice of it.
pub trait Ivp {
    /// State of one particle.
    type State: Linear;
    /// A trial step starts at `y`.
    fn begin(&mut self, y: &[Self::State]);
    /// dy/dt at time `t` (s) and state `y`; both slices hold the owned particles. Collective.
    fn rhs(&mut self, t: f64, y: &[Self::State], dydt: &mut [Self::State]);
    /// Ends the trial that `begin` started with the result `next`: the local `error` becomes everybody's. Collective.
    fn agree(&mut self, error: f64, next: &[Self::State]) -> Verdict;
}

/// The larger of two magnitudes where NaN counts as +infinity (`f64::max` would drop it).
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if b <= a {
        a
    } else if b.is_nan() {
        f64::INFINITY
    } else {
        // a < b, or a is NaN, which no caller passes: magnitudes are folded from 0.
        b
    }
}
