//! The driver of a run: takes steps to the end of the scene, and makes frames on the way.

use crate::domain::{Comm, rows};
use crate::engine::dynamics::{Dynamics, Particles};
use crate::engine::forces::BodyParameters;
use crate::engine::kernel::MakeLaws;
use crate::error::{Error, StopRequest};
use crate::math::instructions::InstructionSet;
use crate::model::columns::{Changes, Columns, SPIN, put_spins};
use crate::ode::integrator::Integrator;
use crate::ode::{Ivp, Limit, Norm, StepControl, StepRule, StepStart, TrialStep};
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::stop::Rest;
use crate::scene::walls::described_walls;
pub use cutoff::{cutoff, neglected_force};
pub use failure::pressed;
pub use frame_summary::FrameSummary;
pub use memory::{Memory, Remembered, Snapshot};
pub use observer::{Frame, Observer, Outcome};
pub use physics::{Physics, parameters, state_vectors, tightening};
use physics::{auto_plan, error_control, long_step, own_weights, scene_laws};
pub use progress::{Counts, Progress};
use progress::{Schedule, WallClock};
use std::time::Instant;
pub use tolerance::{friction_tolerance, tolerance};
use trial::Step;

mod cutoff;
mod failure;
mod frame_summary;
mod memory;
mod observer;
mod physics;
mod progress;
mod rest_detector;
mod rounding;
mod tolerance;
mod trial;

/// A run of a scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::engine::simulation::{Frame, Simulation};
/// use demhybrid::scene::{Scene, initial_condition};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &["t_end=0.1".to_owned()])?;
/// let grid = scene.particles.grid.as_ref().ok_or("there is no grid")?;
/// let start = initial_condition::grid(&scene, grid);
///
/// let mut times = Vec::new();
/// let outcome = Simulation::new(&scene, &start, &Solo)?.run(&mut |frame: &Frame| {
///     times.push(frame.time);
///     Ok(())
/// })?;
/// assert_eq!((outcome.time, outcome.stopped), (0.1, None));
/// assert_eq!((times.len(), times[0], times[5]), (6, 0.0, 0.1)); // a frame each 0.02 s
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// Names of the walls for messages, in order.
    wall_names: Vec<String>,
    /// The last accepted state of the owned particles, and what is known there.
    step_start: StepStart,
    trial: TrialStep,
    progress: Progress,
    schedule: Schedule,
    /// When the run ends because the particles are at rest.
    rest: Option<Rest>,
    /// Whether a step has been accepted in this process.
    moved_on: bool,
    /// The memory of the run before the last trial.
    memory: Option<Memory>,
    clock: WallClock,
}

impl<'c> Simulation<'c> {
    /// A run from the initial condition `start`, which holds all particles, on every rank. Collective.
    pub fn new(scene: &Scene, start: &InitialCondition, comm: &'c dyn Comm) -> Result<Self, Error> {
        Self::begin(scene, start, (&|set| scene_laws(scene, set), parameters(scene)), comm)
    }

    /// `new` with other physics than the scene's. The kernel decides whether spheres rotate.
    ///
    /// All methods evaluate all contacts, unless the scene has `solver.neglected_force`.
    pub fn with_physics(
        scene: &Scene,
        start: &InitialCondition,
        physics: Physics,
        comm: &'c dyn Comm,
    ) -> Result<Self, Error> {
        let Physics { kernel, parameters } = physics;
        let simulation = Self::begin(scene, start, (&|set| kernel(set).into(), parameters), comm)?;
        Ok(simulation.without_default_cutoff(scene))
    }

    /// What the scene's own law neglects says nothing of another law.
    fn without_default_cutoff(mut self, scene: &Scene) -> Self {
        if scene.solver.neglected_force.is_none() {
            self.cutoff = f64::INFINITY;
        }
        self
    }

    fn begin(
        scene: &Scene,
        start: &InitialCondition,
        (laws, parameters): (&MakeLaws, BodyParameters),
        comm: &'c dyn Comm,
    ) -> Result<Self, Error> {
        let ids = rows::block(start.x.len() as u64, comm.rank(), comm.size());
        start.check_columns()?;
        start.check_sizes(scene)?;
        start.check_materials(scene)?;
        let rotation = laws(InstructionSet::Baseline).first().width() == SPIN.end;
        let (columns, mut y, constants) = start.rows(ids.clone(), rotation);
        let (sizes, r) = (columns.sizes(&constants), scene.particles.radius);
        put_spins(&mut y, columns.width(Changes::EveryStage), |i| sizes.get(i).map_or(r, |size| size.r));
        let scale = initial_condition::velocity_scale(scene, start);
        let particles = Particles { ids: ids.collect(), columns, constants, y: &mut y };
        let mut dynamics = Dynamics::new(comm, laws, parameters, scale, particles, &mut [])?;
        if scene.output.energy {
            dynamics.audit();
        }
        dynamics.remember_within(cutoff(scene, scale * dynamics.lightest()));
        dynamics.start_contacts(&mut y);
        let mut step_start = StepStart::new(0.0, y);
        dynamics.begin();
        let rhs = step_start.find_slope(&mut dynamics);
        let mut simulation = Simulation::empty(scene, comm, dynamics, scale, start.x.len() as u64);
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
    fn empty(scene: &Scene, comm: &'c dyn Comm, dynamics: Dynamics<'c>, scale: f64, count: u64) -> Self {
        let (norm, control) = error_control(scene, (scale, count), dynamics.columns());
        let h = control.clamp(scene.solver.step.unwrap_or(scene.solver.initial_step));
        let lightest = dynamics.lightest();
        let mut norm = Norm { rows: own_weights(&dynamics, &norm), ..norm };
        if !norm.rate {
            // The memories of the weakest contacts: their limit goes with the root of m/r.
            norm.weights.iter_mut().skip(1).flatten().for_each(|weight| *weight /= lightest);
        }
        let cutoff = cutoff(scene, scale * lightest);
        let plan = auto_plan(scene, &dynamics.materials(scene.material.len()), long_step(scene, scale));
        Simulation {
            comm,
            dynamics,
            integrator: Integrator::new(scene.solver.method, plan),
            tolerance: control.tolerance / tightening(scene),
            cutoff,
            norm,
            wall_names: described_walls(&scene.container).into_iter().map(|(_, name)| name).collect(),
            control,
            step_start: StepStart::new(0.0, Vec::new()),
            trial: TrialStep::default(),
            progress: Progress::new(h),
            schedule: Schedule::new(scene),
            rest: Rest::of(scene, scale),
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

    /// Last accepted state of the owned particles, with spins, in the order of the ids of `dynamics`.
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
                    self.rebuild()?;
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
            self.dynamics.follow_contacts(&mut self.step_start);
        }
    }

    /// Ends the run at the end of the scene. Collective.
    fn end(mut self, observer: &mut dyn Observer) -> Result<Outcome, Error> {
        if self.schedule.checkpoint_at_end {
            self.save(observer)?;
        }
        Ok(Outcome { time: self.schedule.t_end, stopped: None, ..self.outcome() })
    }
}
