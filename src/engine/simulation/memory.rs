//! What the next step depends on, apart from the scene. With it a run continues in another process, on any
//! number of ranks, to the same bits as if it had never stopped.
//!
//! A checkpoint holds the run as it was before the last accepted trial step. It is written while the start of
//! that step is still unchanged.
//!
//! A resumed run repeats that step. So it also repeats the frames within it, wherever the run was stopped.

use super::{Counts, Simulation, error_control, rest_detector};
use crate::domain::{Comm, rows};
use crate::engine::dynamics::{Dynamics, Extremes};
use crate::error::Error;
use crate::math::vector::Vec3;
use crate::model::contact::{Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::ode::{Dissipation, Limit, StepStart, integrator};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// What the next step depends on, apart from the scene and the particles. The same on every rank, except for
/// the pairs in `counts`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// Time of the last accepted state, s.
    pub t: f64,
    /// Number of the next frame: all earlier ones are complete.
    pub frame: u64,
    /// Work up to this state. `pairs` are those of this rank while the run goes on, and those of all ranks in
    /// a checkpoint.
    pub counts: Counts,
    /// Whether the slope at the accepted state is known. It then belongs to the particles' data.
    pub slope_known: bool,
    /// Whether the stiffest direction is known. It then belongs to the particles' data.
    pub direction_known: bool,
    pub(super) h: f64,
    pub(super) limit: Limit,
    pub(super) last: f64,
    pub(super) dissipation: Dissipation,
    pub(super) dissipated: Dissipation,
    pub(super) forced_in_a_row: u64,
    pub(super) error_before: Option<f64>,
    pub(super) rejected: bool,
    pub(super) integrator: integrator::Memory,
    pub(super) extremes: Extremes,
    pub(super) watched: rest_detector::Watched,
    pub(super) largest_overlap: f64,
}

/// A run to save: its memory and the particles of this rank. The order of the particles does not matter.
#[derive(Debug)]
pub struct Snapshot<'a, W> {
    /// Everything but the particles.
    pub memory: Memory,
    /// Number of particles on all ranks.
    pub count: u64,
    /// Ids of the owned particles.
    pub ids: &'a [u64],
    /// Last accepted state.
    pub state: &'a [Motion<W>],
    /// Positions at which the neighbour lists were built, m. Lists built there again have the same summation
    /// order.
    pub origin: &'a [Vec3],
    /// Slope at that state; empty if it is not known.
    pub slope: &'a [Motion<W>],
    /// The stiffest direction; empty if it is not known.
    pub direction: &'a [Motion<W>],
}

/// A run to resume: its memory, and the particles of a block of ids, by id.
#[derive(Debug, Clone, PartialEq)]
pub struct Remembered<W> {
    /// Everything but the particles.
    pub memory: Memory,
    /// Last accepted state.
    pub state: Vec<Motion<W>>,
    /// Positions at which the neighbour lists were built, m.
    pub origin: Vec<Vec3>,
    /// Slope at that state; empty if it is not known.
    pub slope: Vec<Motion<W>>,
    /// The stiffest direction; empty if it is not known.
    pub direction: Vec<Motion<W>>,
}

impl<'c, R: Rebound, T: Tangential, W: Spin> Simulation<'c, R, T, W> {
    /// Resumes a run of `count` particles of the scene under `law`. Collective.
    ///
    /// `remembered` holds the particles of this rank's block of ids. Velocities are compared with `scale`
    /// (m/s).
    pub fn resume(
        scene: &Scene,
        law: Law<R, T>,
        comm: &'c dyn Comm,
        count: u64,
        scale: f64,
        remembered: Remembered<W>,
    ) -> Result<Self, Error> {
        let Remembered { memory, mut state, origin, mut slope, mut direction } = remembered;
        let at = |x: &Vec3| Motion { x: *x, v: Vec3::zeros(), omega: W::zero() };
        let mut places: Vec<Motion<W>> = origin.iter().map(at).collect();
        let known = [true, memory.slope_known, memory.direction_known];
        let lists = [&mut state, &mut slope, &mut direction].into_iter().zip(known);
        let mut companions: Vec<_> = lists.filter_map(|(list, known)| known.then_some(list)).collect();
        let ids = rows::block(count, comm.rank(), comm.size()).collect();
        let parameters = super::parameters(scene);
        let mut dynamics = Dynamics::new(comm, law, parameters, scale, ids, &mut places, &mut companions)?;
        dynamics.go_on_from(memory.counts.rebuilds, memory.counts.pairs);
        dynamics.commit(memory.extremes);
        if scene.output.energy {
            dynamics.audit();
        }
        let (norm, mut control) = error_control(scene, scale);
        (control.before, control.rejected) = (memory.error_before, memory.rejected);
        let mut simulation = Simulation {
            h: memory.h,
            limit: memory.limit,
            last: memory.last,
            counts: memory.counts,
            dissipated: memory.dissipated,
            forced_in_a_row: memory.forced_in_a_row,
            largest_overlap: memory.largest_overlap,
            frame: memory.frame,
            watched: memory.watched,
            saved: memory.t,
            memory: None,
            ..Simulation::at_rest(scene, comm, dynamics, norm, control, scale)
        };
        simulation.integrator.recall(&memory.integrator);
        simulation.choose_cutoff();
        simulation.step_start = StepStart {
            t: memory.t,
            y: state,
            slope,
            slope_known: memory.slope_known,
            dissipation: memory.dissipation,
            direction,
            direction_known: memory.direction_known,
        };
        Ok(simulation)
    }

    /// Stores what the next trial depends on, before that trial is made.
    pub(super) fn remember(&mut self) {
        let (step_start, control, dynamics) = (&self.step_start, &self.control, &self.dynamics);
        self.memory = Some(Memory {
            t: step_start.t,
            frame: self.frame,
            counts: Counts { pairs: dynamics.own_pairs(), rebuilds: dynamics.rebuilds(), ..self.counts },
            slope_known: step_start.slope_known,
            direction_known: step_start.direction_known,
            h: self.h,
            limit: self.limit,
            last: self.last,
            dissipation: step_start.dissipation,
            dissipated: self.dissipated,
            forced_in_a_row: self.forced_in_a_row,
            error_before: control.before,
            rejected: control.rejected,
            integrator: self.integrator.memory(),
            extremes: dynamics.extremes(),
            watched: self.watched,
            largest_overlap: self.largest_overlap,
        });
    }
}
