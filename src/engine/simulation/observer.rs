//! What a run gives to its observer, frames and checkpoints, and how it ended.

use super::{Counts, Simulation, Snapshot};
use crate::domain::rows::{self, ById};
use crate::engine::dynamics::{Clocks, Overlap};
use crate::error::{Error, StopRequest};
use crate::model::columns::{Changes, Column, Columns, MASS, MATERIAL, RADIUS, put_angular_velocities};
use crate::model::size::Size;
use crate::ode::Dissipation;
use crate::scene::stop::Rest;
use std::borrow::Cow;
use std::ops::Range;
use std::time::Instant;

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
    /// The particles of this rank's block of ids, by id: position, velocity and, with rotation, angular
    /// velocity.
    pub rows: &'a ById<'a>,
    /// Columns that change only when lists are built, of the same particles.
    pub constants: &'a ById<'a>,
    /// The columns of the particles.
    pub columns: &'a Columns,
}

impl Frame<'_> {
    /// The sizes of the particles in `rows`; empty where all have that of the scene.
    pub fn sizes(&self) -> Vec<Size> {
        if !self.columns.sized() {
            return Vec::new();
        }
        let [radii, masses] = [RADIUS, MASS].map(|name| self.constants.columns(self.range(name)));
        radii.into_iter().zip(masses).map(|(r, mass)| Size::new(r, mass)).collect()
    }

    /// The numbers of the materials of the particles in `rows`; empty where nobody has one.
    pub fn materials(&self) -> Vec<u32> {
        match self.columns.find(MATERIAL) {
            None => Vec::new(),
            Some((_, range)) => {
                self.constants.columns(range).into_iter().map(|number| number as u32).collect()
            }
        }
    }

    fn range(&self, name: &str) -> Range<usize> {
        self.columns.find(name).expect("particles have this column").1
    }

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
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::engine::simulation::{Frame, Observer, Simulation};
/// use demhybrid::error::Error;
/// use demhybrid::scene::{Scene, initial_condition};
///
/// /// Ends the run where the bed is higher than this, m.
/// struct LowerThan(f64);
///
/// impl Observer for LowerThan {
///     fn frame(&mut self, frame: &Frame) -> Result<(), Error> {
///         if frame.bed_height < self.0 { Ok(()) } else { Err(Error::Input("too high".to_owned())) }
///     }
/// }
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &["t_end=0.1".to_owned()])?;
/// let grid = scene.particles.grid.as_ref().ok_or("there is no grid")?;
/// let start = initial_condition::grid(&scene, grid);
///
/// let run = |most| Simulation::new(&scene, &start, &Solo)?.run(&mut LowerThan(most));
/// assert!(run(2.0).is_ok());
/// assert_eq!(run(0.5).unwrap_err().to_string(), "too high");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// What the scene asks of particles at rest, if it does.
    pub rest: Option<Rest>,
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
    /// Largest overlap of any frame.
    pub largest_overlap: Overlap,
    /// The method that took the steps and, for `auto`, why.
    pub choice: String,
    /// The tolerance of the steps; meaningless where they are fixed.
    pub tolerance: f64,
    /// Largest gap at which the stabilised method evaluates contacts, m.
    pub cutoff: f64,
    /// Memory of the solver on this rank, bytes.
    pub bytes: usize,
    /// Number of ghosts of this rank at the end.
    pub ghosts: usize,
}

impl Simulation<'_> {
    /// Writes a checkpoint if one is due or requested. Returns whether the run must stop there. Collective.
    pub(super) fn save_if_asked(&mut self, observer: &mut dyn Observer) -> Result<bool, Error> {
        let request = match self.dynamics.request() {
            // Every process takes at least one step. If not, a run in several parts might never finish.
            StopRequest::WallLimit | StopRequest::StopFile if !self.moved_on => StopRequest::Nothing,
            request => request,
        };
        if request != StopRequest::Nothing || self.schedule.checkpoint_is_due(self.step_start.t) {
            self.save(observer)?;
        }
        Ok(request.stops())
    }

    /// Passes a checkpoint to `observer`: the run as it was before the last trial. Collective.
    pub(super) fn save(&mut self, observer: &mut dyn Observer) -> Result<(), Error> {
        let Some(mut memory) = self.memory else { return Ok(()) };
        let clock = Instant::now();
        let (step_start, dynamics) = (&self.step_start, &self.dynamics);
        let pairs = &mut memory.progress.counts.pairs;
        *pairs = dynamics.total_pairs(*pairs);
        let slope = if memory.slope_known { &step_start.slope[..] } else { &[] };
        let direction = if memory.direction_known { &step_start.direction[..] } else { &[] };
        let vectors = [&step_start.y[..], slope, direction];
        let known: Vec<&[f64]> = vectors.into_iter().filter(|vector| !vector.is_empty()).collect();
        let (contact_slots, contacts) = dynamics.contact_table(&known);
        let particles = dynamics.particle_numbers();
        let [state, slope, direction] = vectors.map(|vector| &vector[..particles.min(vector.len())]);
        observer.checkpoint(&Snapshot {
            memory,
            contact_slots: contact_slots.map(|number| number as u64),
            contacts: &contacts,
            count: dynamics.count(),
            ids: dynamics.ids(),
            columns: dynamics.columns(),
            constants: dynamics.constants(),
            state,
            origin: dynamics.origin(),
            slope,
            direction,
        })?;
        self.schedule.saved = step_start.t;
        self.clock.output_seconds += clock.elapsed().as_secs_f64();
        Ok(())
    }

    /// Passes the result of the trial, at time `t` (s), to the observer as a frame. Collective.
    pub(super) fn show_result(&mut self, t: f64, observer: &mut dyn Observer) -> Result<(), Error> {
        let state = std::mem::take(&mut self.trial.next);
        let dissipated = [0, 1].map(|k| self.progress.dissipated[k] + self.trial.dissipated[k]);
        self.show(t, &state, dissipated, observer)?;
        self.trial.next = state;
        Ok(())
    }

    /// Passes the state at time `t` (s) to the observer as a frame. Collective.
    pub(super) fn show(
        &mut self,
        t: f64,
        state: &[f64],
        dissipated: Dissipation,
        observer: &mut dyn Observer,
    ) -> Result<(), Error> {
        let clock = Instant::now();
        let dynamics = &mut self.dynamics;
        self.progress.counts.pairs = dynamics.pair_evaluations();
        self.progress.counts.rebuilds = dynamics.rebuilds();
        let (potential_energy, largest_overlap) = dynamics.potential_energy(state);
        let potential_energy = potential_energy + dynamics.remembered_energy(state);
        let (count, ids, columns) = (dynamics.count(), dynamics.ids(), dynamics.columns());
        let width = columns.width(Changes::EveryStage);
        let mut shown = Cow::Borrowed(&state[..dynamics.ids().len() * width]);
        if columns.rotation() {
            put_angular_velocities(shown.to_mut(), width, |i| dynamics.size(i).r);
        }
        let rows = ById::new(self.comm, count, ids, &shown, width);
        let constant = columns.width(Changes::WithLists);
        // Without such columns there is nothing to collect.
        let constants = match constant {
            0 => ById::none(),
            width => ById::new(self.comm, count, ids, dynamics.constants(), width),
        };
        let seen = observer.frame(&Frame {
            time: t,
            step: self.progress.last,
            counts: self.progress.counts,
            kinetic_energy: dynamics.kinetic_energy(state),
            potential_energy,
            largest_overlap: largest_overlap.length,
            bed_height: dynamics.bed_height(state),
            dissipated,
            clocks: dynamics.clocks,
            output_seconds: self.clock.output_seconds,
            first: rows::block(dynamics.count(), self.comm.rank(), self.comm.size()).start,
            rows: &rows,
            constants: &constants,
            columns,
        });
        if matches!(seen, Err(Error::Replaced { .. })) {
            self.save(observer)?;
        }
        seen?;
        self.progress.largest_overlap = self.progress.largest_overlap.max(largest_overlap);
        self.clock.output_seconds += clock.elapsed().as_secs_f64();
        Ok(())
    }

    pub(super) fn outcome(&self) -> Outcome {
        let request = self.dynamics.request();
        Outcome {
            tolerance: self.tolerance,
            time: self.step_start.t,
            stopped: request.stops().then_some(request),
            rest: self.rest,
            at_rest_by: None,
            counts: Counts {
                pairs: self.dynamics.pair_evaluations(),
                rebuilds: self.dynamics.rebuilds(),
                ..self.progress.counts
            },
            own_pairs: self.dynamics.own_pairs(),
            clocks: self.dynamics.clocks,
            output_seconds: self.clock.output_seconds,
            seconds: self.clock.started.elapsed().as_secs_f64(),
            largest_overlap: self.progress.largest_overlap,
            choice: self.integrator.report(),
            cutoff: self.cutoff,
            bytes: self.dynamics.bytes() + self.step_start.bytes() + self.trial.bytes(),
            ghosts: self.dynamics.ghosts(),
        }
    }
}
