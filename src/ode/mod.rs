//! Explicit methods for y' = f(t, y) with adaptive steps.
//!
//! The methods see vectors of numbers only. The problem ([`Ivp`]) evaluates f, measures errors and brings all
//! processes to the same decision on a trial step.

pub mod chebyshev;
pub mod controller;
mod errors;
pub mod integrator;
pub mod method_switch;
mod names;
pub mod rows;
pub mod runge_kutta;
pub mod spectral;
pub mod sums;
pub mod tableau;
#[cfg(test)]
mod tests;
pub mod verlet;

pub use chebyshev::Chebyshev;
pub use controller::{Decision, Limit, Seen, StepControl, StepRule};
pub use errors::Errors;
pub use names::{MethodName, NormName};
pub use rows::{Layout, Norm, Part, Rows, Segment, largest_magnitude};
pub use runge_kutta::RungeKutta;
pub use spectral::SpectralRadius;
pub use sums::Term;
pub use tableau::{DORMAND_PRINCE, MERSON, Tableau};
pub use verlet::Verlet;

/// Outcome of a trial step, the same on all processes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialOutcome {
    /// Error of the step, of all rows; +infinity where anything is not finite.
    pub error: f64,
    /// What the problem has prepared near the start of the step was valid at every stage and at the result.
    /// If not, the trial says nothing about the step.
    pub covered: bool,
    /// No stage moved a row further from the start of the step than one step may, and neither did the result.
    pub within_travel: bool,
}

/// Vectors that a method may pass to `make`, at most.
pub const VECTORS: usize = 3;

/// Some rows of a stage that is being made.
pub struct Stage<'a> {
    /// Which rows these are.
    pub part: Part,
    /// Vectors of the method at these rows; empty where a vector is not used.
    pub vectors: [&'a mut [f64]; VECTORS],
    /// The state of the stage, to be written.
    pub state: &'a mut [f64],
    /// What the slope held before; see [`Ivp::rhs_of`].
    pub slope: &'a mut [f64],
}

/// Makes the stage of some rows; see [`Ivp::rhs_of`].
pub type MakeStage<'f> = dyn Fn(Stage) + Sync + 'f;

/// Completes some rows of a result and returns their errors; see [`Ivp::agree`].
pub type FinishRows<'f> = dyn Fn(Part, &mut [f64]) -> Errors + Sync + 'f;

/// No vectors for `make`.
pub(crate) fn no_vectors<'a>() -> [&'a mut [f64]; VECTORS] {
    [&mut [], &mut [], &mut []]
}

/// An initial value problem. Its state is a sequence of rows, spread over processes.
///
/// Every process owns some of the rows. Vectors hold the owned rows, in the same order throughout
/// a step.
///
/// A step consists of a call of `begin`, any number of evaluations by `rhs` and `rhs_of`, and a call of
/// `agree`. `agree` may be left out where no result is wanted, for example when a spectral radius is
/// estimated.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{
///     FinishRows, Ivp, Layout, MERSON, Method, Norm, RungeKutta, Segment, StepStart, TrialOutcome,
///     TrialStep,
/// };
///
/// /// y' = -y
/// struct Decay {
///     layout: Layout,
/// }
///
/// impl Ivp for Decay {
///     fn layout(&self) -> &Layout {
///         &self.layout
///     }
///     fn begin(&mut self) {}
///     fn rhs(&mut self, _t: f64, y: &[f64], dydt: &mut [f64]) {
///         dydt[0] = -y[0];
///     }
///     fn agree(&mut self, _y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
///         let error = finish(self.layout.whole(0), next).error();
///         TrialOutcome { error, covered: true, within_travel: true }
///     }
///     fn length(&mut self, v: &[f64]) -> f64 {
///         v[0].abs()
///     }
///     fn add_direction(&mut self, _round: u64, share: f64, v: &mut [f64]) {
///         v[0] += share;
///     }
///     fn small_length(&self) -> f64 {
///         1e-8
///     }
/// }
///
/// let mut decay = Decay { layout: Layout(vec![Segment { rows: 1, width: 1, positions: 0 }]) };
/// let norm = Norm { weights: vec![vec![1.0]], rate: false, mean: None, rows: Vec::new() };
/// let (mut start, mut trial) = (StepStart::new(0.0, vec![1.0]), TrialStep::default());
/// let outcome = RungeKutta::new(&MERSON).attempt(&mut decay, &mut start, 0.1, &norm, &mut trial);
/// assert!((trial.next[0] - (-0.1f64).exp()).abs() < 1e-7);
/// assert!(outcome.error < 1e-7);
/// assert_eq!(trial.evaluations, 5);
/// ```
pub trait Ivp {
    /// The segments of a vector on this process. They change only between steps.
    fn layout(&self) -> &Layout;
    /// Starts a step from a state `y`, which `rhs_of` and `agree` receive.
    ///
    /// The caller guarantees:
    ///
    /// - Up to the next `begin`, every `rhs_of` and `agree` receives the same `y`, with the same contents.
    ///   The problem may therefore keep what it has measured at `y` from one stage to the next.
    /// - After an `rhs` at a state other than `y`, `begin` is called before the next `rhs_of`.
    ///
    /// The problem guarantees:
    ///
    /// - The `covered` and `within_travel` of the next `agree` account for every evaluation since this call.
    fn begin(&mut self);
    /// Puts dy/dt at time `t` (s) and state `y` into `dydt`. Collective.
    ///
    /// `y` may be any state. Both slices hold the owned rows. What `dydt` holds before does not matter.
    fn rhs(&mut self, t: f64, y: &[f64], dydt: &mut [f64]);
    /// Puts dy/dt at time `t` (s) and at one stage of a step from `y` into `dydt`. Collective.
    ///
    /// The stage is not passed: `make` computes it during the evaluation, some rows at a time. A problem can
    /// then compute the stage and evaluate f there in one pass over memory.
    ///
    /// `make(stage)` computes the consecutive rows `stage.part` of the stage and writes them to
    /// `stage.state`. All slices of [`Stage`] have the length of this part. Of `vectors`, those that the
    /// method does not use are empty.
    ///
    /// The problem guarantees:
    ///
    /// - `make` is called exactly once for every row. The parts may have any size and come in any order, and
    ///   several threads may call `make` at once.
    /// - When `make` receives a row, its slope still holds what the caller passed. `state` may hold anything.
    ///
    /// The caller guarantees:
    ///
    /// - `y` is the state for which `begin` was called, and all slices have its length.
    /// - `make` writes every row of `state`. It may also change the rows of `vectors` and `slope` that it
    ///   receives. What it computes depends on these rows and on data that do not change meanwhile.
    fn rhs_of(
        &mut self,
        t: f64,
        y: &[f64],
        vectors: [&mut [f64]; VECTORS],
        dydt: &mut [f64],
        make: &MakeStage,
    ) {
        let mut state = vec![0.0; y.len()];
        let mut vectors = vectors;
        for part in self.layout().clone().parts() {
            // A vector that is not used is empty.
            let of_part = vectors.each_mut().map(|vector| {
                let range = if vector.is_empty() { 0..0 } else { part.range() };
                &mut vector[range]
            });
            let (state, slope) = (&mut state[part.range()], &mut dydt[part.range()]);
            make(Stage { part, vectors: of_part, state, slope });
        }
        self.rhs(t, &state, dydt);
    }
    /// Power lost in the last right-hand side, W; zero unless the problem has been told to compute it.
    fn dissipation(&self) -> Dissipation {
        [0.0; 2]
    }
    /// Ends the step that `begin` started from `y`. Its result is `next`. Collective.
    ///
    /// `finish(part, rows)` completes the consecutive rows `part` of `next`, which it receives as `rows`. It
    /// returns the errors of these rows.
    ///
    /// - `finish` is called exactly once for every row. The parts may have any size and come in any order,
    ///   and several threads may call it at once.
    /// - All processes receive the same outcome, with the error of all rows together.
    fn agree(&mut self, y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome;
    /// Length of the vector `v` of the state space, over all processes. Collective.
    ///
    /// The norm is one in which the stiff part of f is close to symmetric. Velocities dominate it.
    fn length(&mut self, v: &[f64]) -> f64;
    /// Adds `share` times a vector of length about 1 (in the norm of `length`) to `v`.
    ///
    /// This vector has a part in every direction. It depends only on `round` and on the identities of the
    /// rows, not on which process owns them.
    fn add_direction(&mut self, round: u64, share: f64, v: &mut [f64]);
    /// A length (in the norm of `length`) over which f is close to linear, but which is well above round-off.
    fn small_length(&self) -> f64;
}

/// Power (W) or energy (J) that is lost, in two parts that the problem defines.
pub type Dissipation = [f64; 2];

/// Adds `s * other`.
pub(crate) fn add_dissipation(sum: &mut Dissipation, s: f64, other: &Dissipation) {
    sum[0] += s * other[0];
    sum[1] += s * other[1];
}

/// The start of a step: the last accepted state and what is known there.
///
/// All its vectors move along when rows change their owner or their index.
#[derive(Debug, Clone)]
pub struct StepStart {
    /// Time, s.
    pub t: f64,
    /// Last accepted state of the owned rows.
    pub y: Vec<f64>,
    /// f at that state (for velocity Verlet: at the last half step); meaningless unless `slope_known`.
    pub slope: Vec<f64>,
    /// Whether `slope` is f.
    pub slope_known: bool,
    /// Dissipation in `slope`, W.
    pub dissipation: Dissipation,
    /// The stiffest direction found so far; meaningless unless `direction_known`.
    pub direction: Vec<f64>,
    /// Whether `direction` is known: the same on every process, also where one owns no rows.
    pub direction_known: bool,
}

impl StepStart {
    /// A start at state `y` and time `t` (s), of which nothing else is known.
    pub fn new(t: f64, y: Vec<f64>) -> Self {
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

    /// Evaluates f unless it is known. Returns the number of right-hand sides evaluated. Collective.
    pub fn find_slope(&mut self, ivp: &mut dyn Ivp) -> u64 {
        if self.slope_known {
            return 0;
        }
        fit(&mut self.slope, self.y.len());
        ivp.rhs(self.t, &self.y, &mut self.slope);
        self.dissipation = ivp.dissipation();
        self.slope_known = true;
        1
    }

    /// Memory held by the state vectors, bytes.
    pub fn bytes(&self) -> usize {
        [&self.y, &self.slope, &self.direction].map(Vec::capacity).iter().sum::<usize>() * size_of::<f64>()
    }
}

/// A trial step: its result, and the work space of the method.
///
/// One trial step serves all methods, since only one method is active at a time. Between two trials, other
/// code that evaluates right-hand sides uses it as work space too.
#[derive(Debug, Clone)]
pub struct TrialStep {
    /// State at the end of the step.
    pub next: Vec<f64>,
    /// f at the end of the step, if the method evaluates it there; otherwise a slope within the step.
    pub slope: Vec<f64>,
    /// Further work space of the method: slopes, or changes of the state, within the step.
    pub stages: Vec<Vec<f64>>,
    /// Whether `slope` is f at the end of the step.
    pub slope_known: bool,
    /// Dissipation in `slope`, W.
    pub dissipation: Dissipation,
    /// Energy lost during the step, J.
    pub dissipated: Dissipation,
    /// Right-hand sides that the trial evaluated.
    pub evaluations: u64,
}

impl Default for TrialStep {
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

impl TrialStep {
    /// Makes room for `n` rows in the result, in its slope and in `stages` further vectors.
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

    /// Memory held by the state vectors, bytes.
    pub fn bytes(&self) -> usize {
        let stages: usize = self.stages.iter().map(Vec::capacity).sum();
        (self.next.capacity() + self.slope.capacity() + stages) * size_of::<f64>()
    }
}

/// Gives `vector` the length `n`. Its contents are unspecified afterwards.
///
/// It grows by a sixteenth more than it needs. `Vec::resize` would double the memory of a vector that grows
/// by a few rows at a time.
fn fit(vector: &mut Vec<f64>, n: usize) {
    if n > vector.capacity() {
        // The old contents are not needed: free them before allocating again.
        *vector = Vec::new();
        vector.reserve_exact(n + n / 16);
    }
    vector.resize(n, 0.0);
}

/// A method that takes one step.
pub trait Method {
    /// Name in the scene file.
    fn name(&self) -> MethodName;
    /// The power of h with which the error of a step shrinks.
    fn error_order(&self) -> f64;
    /// Takes a trial step of size `h` (s) from `step_start` and leaves the result in `trial`. Collective.
    fn attempt(
        &mut self,
        ivp: &mut dyn Ivp,
        step_start: &mut StepStart,
        h: f64,
        norm: &Norm,
        trial: &mut TrialStep,
    ) -> TrialOutcome;
    /// The largest stable step (s) from `step_start`, and the number of right-hand sides evaluated to find
    /// it. Collective.
    ///
    /// The step is infinite where the method has no estimate: its error then limits the step. `trial` is used
    /// as work space: its result is lost.
    fn stable_step(
        &mut self,
        _ivp: &mut dyn Ivp,
        _step_start: &mut StepStart,
        _trial: &mut TrialStep,
    ) -> (f64, u64) {
        (f64::INFINITY, 0)
    }
    /// Upper bound of the spectral radius at the start of the step (1/s), and the number of right-hand sides
    /// evaluated to find it. Collective.
    ///
    /// The bound is infinite if the method has no estimate. `trial` is used as work space: its result is
    /// lost.
    fn spectral_bound(
        &mut self,
        _ivp: &mut dyn Ivp,
        _step_start: &mut StepStart,
        _trial: &mut TrialStep,
    ) -> (f64, u64) {
        (f64::INFINITY, 0)
    }
    /// The last bound found, 1/s, if the method estimates the spectral radius.
    fn known_bound(&self) -> Option<f64> {
        None
    }
    /// Whether the method has a dense output: states within a step.
    fn has_inside(&self) -> bool;
    /// Tells the method that the last trial was rejected for its error.
    fn rejected(&mut self) {}
    /// Dense output: the state within the last trial, an accepted step of size `h` (s).
    ///
    /// `share` is the share of the step, 0 to 1. None if the method has no dense output.
    fn inside(
        &self,
        share: f64,
        h: f64,
        step_start: &StepStart,
        trial: &TrialStep,
        layout: &Layout,
    ) -> Option<Vec<f64>>;
    /// Largest error of the rows `part` in the last trial, of step size `h` (s).
    fn error_of(&self, part: Part, h: f64, norm: &Norm, step_start: &StepStart, trial: &TrialStep) -> f64;
    /// Number of vectors in [`TrialStep::stages`] that the method uses.
    fn stages(&self) -> usize;
    /// What the method carries over from one step to the next, if anything.
    fn memory(&self) -> Option<SpectralRadius> {
        None
    }
    /// Restores what `memory` returned, in this process or another.
    fn recall(&mut self, _memory: SpectralRadius) {}
}

/// The cubic through the states and slopes at both ends of a step `h` (s), evaluated at a `share` of the
/// step. `start` and `end` are the state and the slope at each end.
pub(crate) fn hermite(share: f64, h: f64, start: [&[f64]; 2], end: [&[f64]; 2]) -> Vec<f64> {
    let rest = 1.0 - share;
    let [y0, y1] = [rest * rest * (1.0 + 2.0 * share), share * share * (1.0 + 2.0 * rest)];
    let [f0, f1] = [h * share * rest * rest, -h * share * share * rest];
    let number = |k: usize| 0.0 + start[0][k] * y0 + end[0][k] * y1 + start[1][k] * f0 + end[1][k] * f1;
    (0..start[0].len()).map(number).collect()
}
