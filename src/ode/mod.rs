//! Explicit methods for y' = f(t, y) with adaptive steps. Knows neither particles nor ranks: the problem evaluates f,
//! measures errors and agrees on the outcome of a trial step.

pub mod chebyshev;
pub mod controller;
pub mod integrator;
pub mod method_switch;
mod names;
pub mod runge_kutta;
pub mod spectral;
pub mod tableau;
#[cfg(test)]
mod tests;
pub mod verlet;

pub use chebyshev::Chebyshev;
pub use controller::{Decision, Limit, StepControl, StepRule};
pub use names::{MethodName, NormName};
pub use runge_kutta::RungeKutta;
pub use spectral::SpectralRadius;
pub use tableau::{DORMAND_PRINCE, MERSON, Tableau};
pub use verlet::Verlet;

/// What the parts of a state are divided by before they are compared with a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// For positions, 1/m.
    pub x: f64,
    /// For velocities, s/m.
    pub v: f64,
    /// For angular velocities, s.
    pub omega: f64,
}

impl Weights {
    /// Metres, metres a second and radians a second count alike.
    pub const MIXED: Weights = Weights { x: 1.0, v: 1.0, omega: 1.0 };
}

/// A vector space element: the state of one particle.
pub trait Linear: Copy + Send + Sync {
    /// The neutral element.
    fn zero() -> Self;
    /// Adds `s * other`.
    fn add_scaled(&mut self, s: f64, other: &Self);
    /// Largest weighted component by magnitude; NaN becomes +infinity.
    fn magnitude(&self, weights: &Weights) -> f64;
    /// Adds `h * slope` to the velocities alone.
    fn kick(&mut self, h: f64, slope: &Self);
    /// Adds `h` times the own velocity to the position.
    fn drift(&mut self, h: f64);

    /// Largest component by magnitude, whatever its unit; NaN becomes +infinity.
    fn max_abs(&self) -> f64 {
        self.magnitude(&Weights::MIXED)
    }
}

/// What all ranks know after a trial step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialOutcome {
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
    /// A trial step starts. Until the next one `rhs_of` has the same `y`.
    fn begin(&mut self);
    /// dy/dt at time `t` (s) and state `y`; both slices hold the owned particles. Collective.
    fn rhs(&mut self, t: f64, y: &[Self::State], dydt: &mut [Self::State]);
    /// `rhs` at a stage of a step from `y` that is made on the way: `make(k, first, vectors, stage, dydt)` puts stage k of the
    /// particles from `first` on into `stage`, from parts of the vectors and from what `dydt` still holds if need be. It is
    /// called once for every particle, in parts of any size and order, before anything of that particle changes. This is
    /// stage k of `turn` = [k, stages], which are evaluated one after the other with the same arguments but for the time: once
    /// the slope of a particle has been found, the next of them may be made of it at once, and then `dydt` holds what that leaves
    /// there. [0, 1] is a stage that stands alone. Collective.
    fn rhs_of<const K: usize>(
        &mut self,
        t: f64,
        y: &[Self::State],
        turn: [usize; 2],
        vectors: [&mut [Self::State]; K],
        dydt: &mut [Self::State],
        make: &(impl Fn(usize, usize, [&mut [Self::State]; K], &mut [Self::State], &mut [Self::State]) + Sync),
    ) {
        let mut stage = vec![Self::State::zero(); y.len()];
        make(turn[0], 0, vectors, &mut stage, dydt);
        self.rhs(t, &stage, dydt);
    }
    /// Power lost in the last right-hand side by rebound and by friction, W; zero where nobody asked for it.
    fn dissipation(&self) -> Dissipation {
        [0.0; 2]
    }
    /// Ends the trial from `y` that `begin` started with the result `next`. `finish(first, part)` is called once for every
    /// particle, in parts of any size and order: it gives the particles from `first` on their last touch and returns their
    /// largest error, of which the largest becomes everybody's. Collective.
    fn agree(
        &mut self,
        y: &[Self::State],
        next: &mut [Self::State],
        finish: &(impl Fn(usize, &mut [Self::State]) -> f64 + Sync),
    ) -> TrialOutcome;
    /// Length of a vector of the state space over all ranks, in a norm in which the stiff part of f is close to
    /// symmetric; velocities dominate it. Collective.
    fn length(&mut self, v: &[Self::State]) -> f64;
    /// Adds `share` times a vector of about length 1 with a bit of every direction to `v`: it is a function of the particles'
    /// ids and of `round` alone.
    fn add_direction(&mut self, round: u64, share: f64, v: &mut [Self::State]);
    /// A length (in the norm of `length`) over which f is close to linear, and yet well above round-off.
    fn small_length(&self) -> f64;
}

/// Power (W) or energy (J) lost by rebound and by friction.
pub type Dissipation = [f64; 2];

/// Adds `s * other`.
pub(crate) fn add_dissipation(sum: &mut Dissipation, s: f64, other: &Dissipation) {
    sum[0] += s * other[0];
    sum[1] += s * other[1];
}

/// Where a step starts, and all that belongs to it: what moves along when particles change their places in memory.
#[derive(Debug, Clone)]
pub struct StepStart<S> {
    /// Time, s.
    pub t: f64,
    /// Last accepted state of the owned particles.
    pub y: Vec<S>,
    /// f there (of velocity Verlet: at the last half step); of no use unless `slope_known`.
    pub slope: Vec<S>,
    /// Whether `slope` is f.
    pub slope_known: bool,
    /// Dissipation in `slope`, W.
    pub dissipation: Dissipation,
    /// The stiffest direction, as far as it is known; of no use unless `direction_known`.
    pub direction: Vec<S>,
    /// Whether `direction` is one: the same on every rank, also where there are no particles.
    pub direction_known: bool,
}

impl<S: Linear> StepStart<S> {
    /// At `y` at time `t` (s).
    pub fn new(t: f64, y: Vec<S>) -> Self {
        StepStart {
            t,
            y,
            slope: Vec::new(),
            slope_known: false,
            dissipation: [0.0; 2],
            direction: Vec::new(),
            direction_known: false,
        }
    }

    /// Evaluates f unless it is known; returns the number of right-hand sides that took. Collective.
    pub fn find_slope<P: Ivp<State = S>>(&mut self, ivp: &mut P) -> u64 {
        if self.slope_known {
            return 0;
        }
        fit(&mut self.slope, self.y.len());
        ivp.rhs(self.t, &self.y, &mut self.slope);
        self.dissipation = ivp.dissipation();
        self.slope_known = true;
        1
    }

    /// Memory held for states, bytes.
    pub fn bytes(&self) -> usize {
        [&self.y, &self.slope, &self.direction].map(Vec::capacity).iter().sum::<usize>() * size_of::<S>()
    }
}

/// The result of a trial step, and the room in which it is worked out. Between two trials that room serves whatever asks
/// for right-hand sides: there is one for all methods, of which one is at work at a time.
#[derive(Debug, Clone)]
pub struct TrialStep<S> {
    /// State at its end.
    pub next: Vec<S>,
    /// f at its end, if the method knows it; else a slope inside of the step.
    pub slope: Vec<S>,
    /// What else the method keeps of the inside of the step: slopes or changes.
    pub stages: Vec<Vec<S>>,
    /// Whether `slope` is f.
    pub slope_known: bool,
    /// Dissipation in `slope`, W.
    pub dissipation: Dissipation,
    /// Energy lost in the step by rebound and by friction, J.
    pub dissipated: Dissipation,
    /// Right-hand sides that the trial took.
    pub evaluations: u64,
}

impl<S> Default for TrialStep<S> {
    fn default() -> Self {
        TrialStep {
            next: Vec::new(),
            slope: Vec::new(),
            stages: Vec::new(),
            slope_known: false,
            dissipation: [0.0; 2],
            dissipated: [0.0; 2],
            evaluations: 0,
        }
    }
}

impl<S: Linear> TrialStep<S> {
    /// Room for `n` particles, in `stages` vectors beside the result and its slope.
    fn reset(&mut self, n: usize, stages: usize) {
        if self.stages.len() < stages {
            self.stages.resize_with(stages, Vec::new);
        }
        self.stages[..stages].iter_mut().for_each(|stage| fit(stage, n));
        fit(&mut self.next, n);
        fit(&mut self.slope, n);
        self.slope_known = false;
        self.dissipated = [0.0; 2];
        self.evaluations = 0;
    }

    /// Memory held for states, bytes.
    pub fn bytes(&self) -> usize {
        let stages: usize = self.stages.iter().map(Vec::capacity).sum();
        (self.next.capacity() + self.slope.capacity() + stages) * size_of::<S>()
    }
}

/// Makes `vector` of length `n`, whatever it holds. Particles that arrive one by one must not double its memory, as
/// `Vec::resize` would: where it grows it takes a sixteenth more than it needs.
fn fit<S: Linear>(vector: &mut Vec<S>, n: usize) {
    if n > vector.capacity() {
        // What it held is of no use: let go of it before there is a second one.
        *vector = Vec::new();
        vector.reserve_exact(n + n / 16);
    }
    vector.resize(n, S::zero());
}

/// How the error of a step is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Norm {
    /// Scales of the state.
    pub weights: Weights,
    /// The paper's: 3/h times the local error, which is the published rate of Merson's method; otherwise the local
    /// error itself.
    pub rate: bool,
}

/// A method that takes one step.
pub trait Method<P: Ivp> {
    /// Name in the scene file.
    fn name(&self) -> &'static str;
    /// The error of a step shrinks as h to this power.
    fn error_order(&self) -> f64;
    /// Takes a trial step `h` (s) from `anchor` and leaves the result in `trial`. Collective.
    fn attempt(
        &mut self,
        ivp: &mut P,
        step_start: &mut StepStart<P::State>,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep<P::State>,
    ) -> TrialOutcome;
    /// The largest step (s) that is stable from `anchor`, as far as the method knows; infinite if its error tells.
    /// May evaluate right-hand sides, whose number it returns. Collective.
    /// `trial` lends its room and loses its result.
    fn stable_step(
        &mut self,
        _ivp: &mut P,
        _anchor: &mut StepStart<P::State>,
        _trial: &mut TrialStep<P::State>,
    ) -> (f64, u64) {
        (f64::INFINITY, 0)
    }
    /// Upper bound of the spectral radius at `anchor`, 1/s, and the right-hand sides that took; infinite if the method has
    /// no estimate. Collective. `trial` lends its room and loses its result.
    fn spectral_bound(
        &mut self,
        _ivp: &mut P,
        _anchor: &mut StepStart<P::State>,
        _trial: &mut TrialStep<P::State>,
    ) -> (f64, u64) {
        (f64::INFINITY, 0)
    }
    /// The last bound found, 1/s, if the method has an estimate.
    fn known_bound(&self) -> Option<f64> {
        None
    }
    /// Whether the method has a dense output.
    fn has_inside(&self) -> bool;
    /// The last trial was rejected for its error.
    fn rejected(&mut self) {}
    /// The state of owned particle `i` at a `share` of the last trial, a step `h` (s) that stands, if the method has a
    /// dense output.
    fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
        i: usize,
    ) -> Option<P::State>;
    /// Error of owned particle `i` in the last trial, of step `h` (s).
    fn error_of(
        &self,
        i: usize,
        h: f64,
        norm: &Norm,
        step_start: &StepStart<P::State>,
        trial: &TrialStep<P::State>,
    ) -> f64;
    /// State vectors in [`TrialStep::stages`] that the method uses.
    fn stages(&self) -> usize;
    /// What the method remembers from one step to the next, if anything.
    fn memory(&self) -> Option<SpectralRadius> {
        None
    }
    /// Takes up what `memory` gave, in this process or another.
    fn recall(&mut self, _memory: SpectralRadius) {}
}

/// The cubic through the states and slopes at both ends of a step `h` (s), at a `share` of it.
pub(crate) fn hermite<S: Linear>(share: f64, h: f64, [y0, f0]: [&S; 2], [y1, f1]: [&S; 2]) -> S {
    let rest = 1.0 - share;
    let mut state = S::zero();
    state.add_scaled(rest * rest * (1.0 + 2.0 * share), y0);
    state.add_scaled(share * share * (1.0 + 2.0 * rest), y1);
    state.add_scaled(h * share * rest * rest, f0);
    state.add_scaled(-h * share * share * rest, f1);
    state
}
