//! The driver of a run: takes steps to the end of the scene, and makes frames on the way.

use crate::domain::Comm;
use crate::domain::rows::{self, ById};
use crate::engine::dynamics::{Clocks, Dynamics, Particles};
use crate::engine::forces::BodyParameters;
use crate::engine::kernel::{Kernel, kernel};
use crate::error::{Error, StopRequest};
use crate::math::instructions::InstructionSet;
use crate::model::columns::{Changes, Column, Columns, SPIN};
use crate::model::effects::{Effects, Variant};
use crate::ode::integrator::{AutoPlan, Integrator};
use crate::ode::{
    DORMAND_PRINCE, Dissipation, Ivp, Limit, MERSON, MethodName, Norm, NormName, StepControl, StepRule,
    StepStart, TrialOutcome, TrialStep,
};
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::{Scene, Stop, effects};
pub use cutoff::{cutoff, neglected_force};
pub use frame_summary::FrameSummary;
pub use memory::{Memory, Remembered, Snapshot};
use serde::{Deserialize, Serialize};
use std::time::Instant;

mod cutoff;
mod failure;
mod frame_summary;
mod memory;
mod observer;
mod rest_detector;
mod rounding;

/// Number of consecutive forced steps that ends a run.
const FORCED_IN_A_ROW: u64 = 1000;
/// Number of accepted steps after which at most one in a hundred may be forced.
const FORCED_GRACE: u64 = 100_000;

/// Work done so far, the same on every rank and for any number of ranks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Accepted steps.
    pub accepted: u64,
    /// Rejected steps: their error was too large.
    pub rejected: u64,
    /// Trials in which a particle left the range of the neighbour lists or moved too far.
    pub outrun: u64,
    /// Steps accepted at the smallest size although their error was too large.
    pub forced: u64,
    /// Right-hand sides, each counted once over all ranks, including those of rejected trials and of frames.
    pub rhs: u64,
    /// Pairs within l_max whose force was evaluated.
    pub pairs: u64,
    /// Number of times that the neighbour lists were built.
    pub rebuilds: u64,
    /// Accepted steps by what decided their size, in the order of `Limit::ALL`.
    pub limits: [u64; Limit::ALL.len()],
}

/// The state of the system at one time, for the output and the progress line.
pub struct Frame<'a> {
    /// Time, s.
    pub time: f64,
    /// Size of the last accepted step, s.
    pub step: f64,
    /// Work done so far.
    pub counts: Counts,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Potential energy of contacts and of gravity, J.
    pub potential_energy: f64,
    /// Largest overlap, m.
    pub largest_overlap: f64,
    /// Highest point of any sphere, m.
    pub bed_height: f64,
    /// Energy dissipated so far by rebound and by friction, J; zero unless `output.energy` is on.
    pub dissipated: Dissipation,
    /// Time spent so far in the parts of the work on this rank.
    pub clocks: Clocks,
    /// Wall time spent on earlier frames and on checkpoints on this rank, s.
    pub output_seconds: f64,
    /// First id of `rows`.
    pub first: u64,
    /// The particles of this rank's block of ids, by id, as rows of the state.
    pub rows: &'a ById<'a>,
    /// Columns that change only when lists are built, of the same particles.
    pub constants: &'a ById<'a>,
    /// The columns of the particles.
    pub columns: &'a Columns,
}

impl Frame<'_> {
    /// The numbers of a column of the particles in `rows`, row after row.
    ///
    /// # Panics
    ///
    /// Panics if the particles have no such column.
    pub fn numbers(&self, column: &Column) -> Vec<f64> {
        let (changes, range) = self.columns.find(&column.name).expect("particles have this column");
        match changes {
            Changes::EveryStage => self.rows.columns(range),
            Changes::WithLists => self.constants.columns(range),
        }
    }
}

/// Receives the frames and checkpoints of a run.
pub trait Observer {
    /// Receives a frame. Collective.
    fn frame(&mut self, frame: &Frame) -> Result<(), Error>;
    /// Receives a checkpoint, from which the run can be resumed. Collective.
    fn checkpoint(&mut self, _snapshot: &Snapshot) -> Result<(), Error> {
        Ok(())
    }
}

impl<F: FnMut(&Frame) -> Result<(), Error>> Observer for F {
    fn frame(&mut self, frame: &Frame) -> Result<(), Error> {
        self(frame)
    }
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Time reached, s.
    pub time: f64,
    /// The stop request that ended the run early, if any.
    pub stopped: Option<StopRequest>,
    /// The key of `[stop]` whose criterion ended the run because the particles are at rest, if any.
    pub at_rest_by: Option<&'static str>,
    /// Work done.
    pub counts: Counts,
    /// Pairs evaluated by this rank, whose earlier particle it owns.
    pub own_pairs: u64,
    /// Time spent in the parts of the work on this rank.
    pub clocks: Clocks,
    /// Wall time spent on frames and checkpoints on this rank, measures included, s.
    pub output_seconds: f64,
    /// Wall time of the run, s.
    pub seconds: f64,
    /// Largest overlap of any frame, m.
    pub largest_overlap: f64,
    /// The method that took the steps and, for `auto`, why.
    pub choice: String,
    /// Largest gap at which the stabilised method evaluates contacts, m.
    pub cutoff: f64,
    /// Memory of the solver on this rank, bytes.
    pub bytes: usize,
    /// Number of ghosts of this rank at the end.
    pub ghosts: usize,
}

/// What a run has done so far: the same on every rank, and saved as it is in checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Number of the next frame: frames before it are complete.
    pub frame: u64,
    /// Work done. Of pairs, while the run goes on, those of this rank.
    pub counts: Counts,
    /// Proposed size of the next step, s, and what decided it.
    pub(super) h: f64,
    pub(super) limit: Limit,
    /// Size of the last accepted step, s.
    pub(super) last: f64,
    /// Energy dissipated up to the last accepted state, J.
    pub(super) dissipated: Dissipation,
    /// Consecutive steps that were forced.
    pub(super) forced_in_a_row: u64,
    /// State of the rest detector.
    pub(super) rest: rest_detector::Watched,
    /// Largest overlap of any frame, m.
    pub(super) largest_overlap: f64,
}

impl Progress {
    /// Of a run that has done nothing; `h` (s) is its first step.
    fn new(h: f64) -> Self {
        Progress {
            frame: 0,
            counts: Counts::default(),
            h,
            limit: Limit::First,
            last: 0.0,
            dissipated: [0.0; 2],
            forced_in_a_row: 0,
            rest: rest_detector::Watched::default(),
            largest_overlap: 0.0,
        }
    }
}

/// When frames and checkpoints are due.
#[derive(Debug, Clone, Copy)]
struct Schedule {
    t_end: f64,
    /// Time between frames, s.
    interval: f64,
    /// Simulated time between checkpoints, s; infinite if checkpoints are only written on request.
    checkpoint_interval: f64,
    /// Whether a checkpoint is written at the end too.
    checkpoint_at_end: bool,
    /// Time of the last checkpoint, or of the start, s.
    saved: f64,
}

impl Schedule {
    fn new(scene: &Scene) -> Self {
        let checkpoint = scene.checkpoint.as_ref();
        Schedule {
            t_end: scene.t_end,
            interval: scene.output.interval.unwrap_or(scene.t_end / 100.0),
            checkpoint_interval: checkpoint.and_then(|keys| keys.interval).unwrap_or(f64::INFINITY),
            checkpoint_at_end: checkpoint.is_some(),
            saved: 0.0,
        }
    }

    /// Time of frame `k`: k times the interval, or the end of the scene, s.
    fn frame_time(&self, k: u64) -> f64 {
        let t = k as f64 * self.interval;
        if t < self.t_end - 1e-9 * self.interval { t } else { self.t_end }
    }

    /// Whether a checkpoint is due at time `t` (s).
    fn checkpoint_is_due(&self, t: f64) -> bool {
        let passed = |t: f64| (t / self.checkpoint_interval).floor();
        passed(t) > passed(self.saved)
    }
}

/// Wall times of this process.
#[derive(Debug, Clone, Copy)]
struct WallClock {
    started: Instant,
    /// Time spent on frames and checkpoints, s.
    output_seconds: f64,
}

/// A run of a scene.
pub struct Simulation<'c> {
    comm: &'c dyn Comm,
    dynamics: Dynamics<'c>,
    integrator: Integrator,
    control: StepControl,
    /// The tolerance of the scene, before `auto` tightens it.
    tolerance: f64,
    /// Largest gap at which the stabilised method evaluates contacts, m.
    cutoff: f64,
    norm: Norm,
    /// The last accepted state of the owned particles, and what is known there.
    step_start: StepStart,
    trial: TrialStep,
    progress: Progress,
    schedule: Schedule,
    /// When the run ends because the particles are at rest.
    stop: Option<Stop>,
    /// Whether a step has been accepted in this process.
    moved_on: bool,
    /// The memory of the run before the last trial.
    memory: Option<Memory>,
    clock: WallClock,
}

/// A contact law of one's own and other body parameters than those of the scene.
pub struct Physics<'a> {
    /// Makes the kernel for an instruction set.
    pub kernel: &'a dyn Fn(InstructionSet) -> Box<dyn Kernel>,
    /// Mass, inertia, gravity and walls.
    pub parameters: BodyParameters,
}

/// An accepted trial step.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Size, s.
    h: f64,
    /// Whether it was accepted only because steps cannot be smaller.
    forced: bool,
    /// What decided its size.
    limit: Limit,
}

impl<'c> Simulation<'c> {
    /// A run from the initial condition `start`, which holds all particles, on every rank. Collective.
    pub fn new(scene: &Scene, start: &InitialCondition, comm: &'c dyn Comm) -> Result<Self, Error> {
        let physics = Physics { kernel: &|set| scene_kernel(scene, set), parameters: parameters(scene) };
        Self::with_physics(scene, start, physics, comm)
    }

    /// `new` with other physics than the scene's. The kernel decides whether spheres rotate.
    pub fn with_physics(
        scene: &Scene,
        start: &InitialCondition,
        physics: Physics,
        comm: &'c dyn Comm,
    ) -> Result<Self, Error> {
        let ids = rows::block(start.x.len() as u64, comm.rank(), comm.size());
        let Physics { kernel, parameters } = physics;
        let rotation = kernel(InstructionSet::Baseline).width() == SPIN.end;
        let (columns, mut y, constants) = start.rows(ids.clone(), rotation);
        let scale = initial_condition::velocity_scale(scene, start);
        let particles = Particles { ids: ids.collect(), columns, constants, y: &mut y };
        let mut dynamics = Dynamics::new(comm, kernel, parameters, scale, particles, &mut [])?;
        if scene.output.energy {
            dynamics.audit();
        }
        let mut step_start = StepStart::new(0.0, y);
        dynamics.begin();
        let rhs = step_start.find_slope(&mut dynamics);
        let mut simulation = Simulation::at_rest(scene, comm, dynamics, scale);
        (simulation.step_start, simulation.progress.counts.rhs) = (step_start, rhs);
        // An initial condition that cannot be continued is reported before any output is created.
        if simulation.start_is_broken() {
            return Err(simulation.broken_start());
        }
        if simulation.control.rule == StepRule::ProportionalIntegral {
            simulation.check_rounding(tightening(scene))?;
            simulation.find_first_step();
        }
        Ok(simulation)
    }

    /// A run without particles, before its first step.
    fn at_rest(scene: &Scene, comm: &'c dyn Comm, dynamics: Dynamics<'c>, scale: f64) -> Self {
        let (norm, control) = error_control(scene, scale, dynamics.columns());
        let h = control.clamp(scene.solver.step.unwrap_or(scene.solver.initial_step));
        Simulation {
            comm,
            dynamics,
            integrator: Integrator::new(scene.solver.method, auto_plan(scene)),
            tolerance: control.tolerance / tightening(scene),
            cutoff: cutoff(scene, scale),
            norm,
            control,
            step_start: StepStart::new(0.0, Vec::new()),
            trial: TrialStep::default(),
            progress: Progress::new(h),
            schedule: Schedule::new(scene),
            stop: scene.stop.clone(),
            moved_on: false,
            memory: None,
            clock: WallClock { started: Instant::now(), output_seconds: 0.0 },
        }
    }

    /// What each particle carries.
    pub fn columns(&self) -> &Columns {
        self.dynamics.columns()
    }

    /// The equations of motion.
    pub fn dynamics(&self) -> &Dynamics<'c> {
        &self.dynamics
    }

    /// The equations of motion, for evaluations outside of the run.
    pub fn dynamics_mut(&mut self) -> &mut Dynamics<'c> {
        &mut self.dynamics
    }

    /// From now on calls `interrupts` once a trial step, on every rank, for stop requests.
    pub fn listen_to(&mut self, interrupts: &'c dyn Fn() -> StopRequest) {
        self.dynamics.listen_to(interrupts);
    }

    /// Last accepted state of the owned particles, in the order of the ids of `dynamics`.
    pub fn state(&self) -> &[f64] {
        &self.step_start.y
    }

    /// Runs to the end of the scene, or until a stop request, and passes every frame to `observer`.
    /// Collective.
    pub fn run(mut self, observer: &mut dyn Observer) -> Result<Outcome, Error> {
        if self.progress.frame == 0 {
            let first = std::mem::take(&mut self.step_start.y);
            self.show(0.0, &first, [0.0; 2], observer)?;
            self.step_start.y = first;
            self.progress.frame = 1;
        }
        'steps: loop {
            let step = self.find_step()?;
            if self.save_if_asked(observer)? {
                return Ok(self.outcome());
            }
            let reached = self.step_start.t + step.h;
            let extremes = self.dynamics.candidate();
            while self.schedule.frame_time(self.progress.frame) < reached {
                let due = self.schedule.frame_time(self.progress.frame);
                let share = (due - self.step_start.t) / step.h;
                let Some((state, dissipated)) = self.frame_inside(share, step.h) else {
                    // Rare: repeat the step with new lists.
                    self.dynamics.rebuild(&mut self.step_start)?;
                    (self.progress.h, self.progress.limit) = (step.h, step.limit);
                    continue 'steps;
                };
                let dissipated = [0, 1].map(|k| self.progress.dissipated[k] + dissipated[k]);
                if due >= self.schedule.t_end {
                    self.count(Step { h: share * step.h, limit: Limit::End, ..step })?;
                }
                self.show(due, &state, dissipated, observer)?;
                if due >= self.schedule.t_end {
                    return self.end(observer);
                }
                self.progress.frame += 1;
            }
            self.count(step)?;
            let shown = self.schedule.frame_time(self.progress.frame) <= reached;
            if shown {
                self.show_result(reached, observer)?;
                if reached >= self.schedule.t_end {
                    return self.end(observer);
                }
                self.progress.frame += 1;
            }
            if let Some(by) = self.at_rest_by(reached) {
                if !shown {
                    self.show_result(reached, observer)?;
                }
                let outcome = self.end(observer)?;
                return Ok(Outcome { time: reached, at_rest_by: Some(by), ..outcome });
            }
            self.accept(reached, step.limit);
            self.dynamics.commit(extremes);
        }
    }

    /// Ends the run at the end of the scene. Collective.
    fn end(mut self, observer: &mut dyn Observer) -> Result<Outcome, Error> {
        if self.schedule.checkpoint_at_end {
            self.save(observer)?;
        }
        Ok(Outcome { time: self.schedule.t_end, stopped: None, ..self.outcome() })
    }

    /// Chooses the size of the first step, at most the `initial_step` of the scene. Collective.
    ///
    /// An Euler step of that size would change the slope by about as much as the state (E. Hairer, S. P.
    /// Norsett, G. Wanner, Solving ODEs I, II.4).
    fn find_first_step(&mut self) {
        let (whole, slopes) = (self.dynamics.layout().whole(0), &self.step_start.slope);
        let mut slope = [self.norm.largest(whole, |k| slopes[k])];
        self.comm.max(&mut slope);
        let guess = 0.01 / slope[0];
        if guess < self.progress.h {
            self.progress.h = self.control.clamp(guess);
        }
    }

    /// Tries steps from the last accepted state until one is accepted. Its result is in `trial`. Collective.
    fn find_step(&mut self) -> Result<Step, Error> {
        loop {
            self.progress.counts.rhs +=
                self.integrator.prepare(&mut self.dynamics, &mut self.step_start, &mut self.trial);
            if self.choose_cutoff() {
                self.step_start.slope_known = false;
            }
            let (mut h, mut limit) = (self.progress.h, self.progress.limit);
            let stable = self.integrator.stable_step();
            let mut cut = |most: f64, by: Limit| {
                if most < h {
                    (h, limit) = (most, by);
                }
            };
            cut(stable, Limit::Stability);
            cut(self.dynamics.step_limit(), Limit::Travel);
            let h = self.control.clamp(h);
            if self.dynamics.will_outrun(h) {
                self.dynamics.rebuild(&mut self.step_start)?;
            }
            self.remember();
            let outcome = self.attempt(h);
            if !outcome.covered && !self.dynamics.lists_are_fresh() {
                // Lists that do not cover the step say nothing about it: repeat it with new lists.
                self.progress.counts.outrun += 1;
                self.dynamics.rebuild(&mut self.step_start)?;
                (self.progress.h, self.progress.limit) = (h, limit);
                continue;
            }
            if !outcome.within_travel || !outcome.covered {
                self.progress.counts.outrun += 1;
                self.fail_if_impossible(h, outcome)?;
                (self.progress.h, self.progress.limit) = (self.control.clamp(0.5 * h), Limit::Travel);
                continue;
            }
            let decision = self.control.judge(h, outcome.error, self.integrator.error_order());
            (self.progress.h, self.progress.limit) = (decision.next, decision.limit);
            if decision.accept {
                if self.step_start.t + h == self.step_start.t {
                    return Err(self.no_step(h));
                }
                return Ok(Step { h, forced: decision.forced, limit });
            }
            self.progress.counts.rejected += 1;
            self.integrator.rejected();
            if outcome.error == f64::INFINITY {
                self.fail_if_impossible(h, outcome)?;
            }
        }
    }

    /// Sets the gap up to which contacts are evaluated, for the active method. Returns whether that changes
    /// the slopes.
    fn choose_cutoff(&mut self) -> bool {
        let stabilised = self.integrator.is_stabilised();
        self.dynamics.evaluate_within(if stabilised { self.cutoff } else { f64::INFINITY })
    }

    /// One trial step from the last accepted state. Collective.
    fn attempt(&mut self, h: f64) -> TrialOutcome {
        let outcome =
            self.integrator.attempt(&mut self.dynamics, &mut self.step_start, h, &self.norm, &mut self.trial);
        self.progress.counts.rhs += self.trial.evaluations;
        outcome
    }

    /// The state at a `share` of the accepted step `h` (s), and the energy lost up to there, J. Collective.
    ///
    /// It comes from the dense output if the method has one. If not, a step of its own leads there from the
    /// last accepted state. None if the lists are too old for that step.
    fn frame_inside(&mut self, share: f64, h: f64) -> Option<(Vec<f64>, Dissipation)> {
        if self.integrator.has_inside() {
            let layout = self.dynamics.layout();
            let state = self.integrator.inside(share, h, &self.step_start, &self.trial, layout)?;
            let (start, end) = (self.step_start.dissipation, self.trial.dissipation);
            let dissipated = [0, 1].map(|k| {
                let rest = 1.0 - share;
                share * share * (1.0 + 2.0 * rest) * self.trial.dissipated[k]
                    + h * share * rest * (rest * start[k] - share * end[k])
            });
            return Some((state, dissipated));
        }
        let step = (std::mem::take(&mut self.trial.next), self.trial.dissipated);
        let outcome = self.attempt(share * h);
        let (state, dissipated) = (std::mem::replace(&mut self.trial.next, step.0), self.trial.dissipated);
        // The trial of the frame has overwritten the slope at the end of the step.
        (self.trial.dissipated, self.trial.slope_known) = (step.1, false);
        if !outcome.covered && !self.dynamics.lists_are_fresh() {
            return None;
        }
        if outcome.covered && outcome.error < f64::INFINITY {
            return Some((state, dissipated));
        }
        // The stages of this frame meet something that the stages of the step did not meet, such as two
        // centres that pass through each other at this moment. Take the parabola through the start, its slope
        // and the result: it is finite.
        let ends = self.step_start.y.iter().zip(&self.step_start.slope).zip(&self.trial.next);
        let state = ends.map(|((y, slope), result)| {
            let bend = result - y + slope * -h;
            y + slope * (share * h) + bend * (share * share)
        });
        Some((state.collect(), self.trial.dissipated.map(|dissipated| share * dissipated)))
    }

    /// Accepts the trial, which ends at time `t` (s). `limit` decided its size.
    fn accept(&mut self, t: f64, limit: Limit) {
        let (step_start, trial) = (&mut self.step_start, &mut self.trial);
        std::mem::swap(&mut step_start.y, &mut trial.next);
        std::mem::swap(&mut step_start.slope, &mut trial.slope);
        (step_start.t, step_start.slope_known, step_start.dissipation) =
            (t, trial.slope_known, trial.dissipation);
        self.moved_on = true;
        crate::ode::add_dissipation(&mut self.progress.dissipated, 1.0, &trial.dissipated);
        self.integrator.accepted(self.progress.last, limit);
    }

    /// Counts an accepted step. Ends the run if too many steps are accepted only because steps cannot be
    /// smaller. Collective.
    fn count(&mut self, Step { h, forced, limit }: Step) -> Result<(), Error> {
        self.progress.last = h;
        self.progress.counts.accepted += 1;
        self.progress.counts.forced += u64::from(forced);
        let index = Limit::ALL.iter().position(|&other| other == limit);
        self.progress.counts.limits[index.expect("all limits are listed")] += 1;
        self.progress.forced_in_a_row = if forced { self.progress.forced_in_a_row + 1 } else { 0 };
        let accepted = self.progress.counts.accepted;
        let prevail = accepted > FORCED_GRACE && self.progress.counts.forced * 100 > accepted;
        if forced && (self.progress.forced_in_a_row >= FORCED_IN_A_ROW || prevail) {
            return Err(Error::BelowRoundOff {
                tolerance: self.tolerance,
                forced: self.progress.counts.forced,
                accepted,
                t: self.step_start.t,
                h,
                min_step: self.control.min_step,
                i: self.limiting_particle(h),
            });
        }
        Ok(())
    }
}

/// The kernel with the effects of the scene.
fn scene_kernel(scene: &Scene, set: InstructionSet) -> Box<dyn Kernel> {
    kernel(Effects::of(scene), effects::law(scene), set)
}

/// What acts on the particles besides their contacts.
pub fn parameters(scene: &Scene) -> BodyParameters {
    let r = scene.particles.radius;
    BodyParameters {
        mass: scene.particles.mass,
        inverse_inertia: 1.0 / (0.4 * scene.particles.mass * r * r),
        gravity: scene.gravity.into(),
        walls: crate::scene::walls::walls(&scene.container),
    }
}

/// How errors are measured and step sizes chosen. Velocities are compared with `scale` (m/s).
fn error_control(scene: &Scene, scale: f64, columns: &Columns) -> (Norm, StepControl) {
    let (solver, r) = (&scene.solver, scene.particles.radius);
    let paper = solver.norm == NormName::Paper;
    // Positions over the radius, velocities over the scale, and spins as the velocities of surfaces.
    let [x, v, omega] = if paper { [1.0; 3] } else { [1.0 / r, 1.0 / scale, r / scale] };
    let weights = [x, x, x, v, v, v, omega, omega, omega];
    let norm = Norm { weights: vec![weights[..columns.width(Changes::EveryStage)].to_vec()], rate: paper };
    let control = match solver.step {
        Some(step) => StepControl::new(StepRule::Fixed, 1.0, step, step),
        None => {
            let rule = if paper { StepRule::Published } else { StepRule::ProportionalIntegral };
            let tolerance = solver.tolerance.unwrap_or(crate::scene::DEFAULT_TOLERANCE) * tightening(scene);
            StepControl::new(rule, tolerance, solver.min_step, solver.max_step)
        }
    };
    (norm, control)
}

/// Largest number of state vectors that the methods of the scene use.
pub fn state_vectors(scene: &Scene) -> usize {
    Integrator::new(scene.solver.method, auto_plan(scene)).vectors()
}

/// How `auto` starts. It switches to the stabilised method where that needs less work.
///
/// With friction the motion is stiff and not very smooth. Merson's method is accurate wherever it is stable,
/// and takes the first impacts, whose errors grow most.
///
/// Without friction the motion is smooth and mostly not stiff: there the method of Dormand and Prince is
/// cheaper.
fn auto_plan(scene: &Scene) -> AutoPlan {
    let Effects { variant, dissipative } = Effects::of(scene);
    if variant == Variant::Basic {
        let reason = "without friction the motion is smooth";
        AutoPlan { explicit: &DORMAND_PRINCE, reason, is_damped: dissipative }
    } else {
        AutoPlan { explicit: &MERSON, reason: "friction is not very smooth", is_damped: true }
    }
}

/// Factor by which `auto` tightens the tolerance where the motion is smooth.
///
/// There two more digits cost about twice the work, and without damping errors grow.
pub fn tightening(scene: &Scene) -> f64 {
    let smooth = Effects::of(scene).variant == Variant::Basic;
    if smooth && scene.solver.method == MethodName::Auto { 0.01 } else { 1.0 }
}
