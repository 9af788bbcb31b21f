//! What the next step depends on, apart from the scene. With it a run continues in another process, on any
//! number of ranks, to the same bits as if it had never stopped.
//!
//! A checkpoint holds the run as it was before the last accepted trial step. It is written while the start of
//! that step is still unchanged.
//!
//! A resumed run repeats that step. So it also repeats the frames within it, wherever the run was stopped.

use super::physics::scene_laws;
use super::{Physics, Progress, Simulation, cutoff, parameters};
use crate::domain::{Comm, rows};
use crate::engine::dynamics::{ContactRecords, Dynamics, Extremes, Particles};
use crate::engine::forces::BodyParameters;
use crate::engine::kernel::MakeLaws;
use crate::error::Error;
use crate::math::vector::Vec3;
use crate::model::columns::Columns;
use crate::ode::{Dissipation, Seen, StepStart, integrator};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// What the next step depends on besides the particles; the same on every rank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// Time of the last accepted state, s.
    pub t: f64,
    /// What the run has done up to there.
    pub progress: Progress,
    /// Whether the slope at the accepted state is known, and belongs to the particles.
    pub slope_known: bool,
    /// Whether the stiffest direction is known, and belongs to the particles.
    pub direction_known: bool,
    /// Dissipation in the slope, W.
    dissipation: Dissipation,
    /// Memory of the step control: the last error, whether the last trial was rejected, and what long steps
    /// have seen.
    control: (Option<f64>, bool, Option<Seen>),
    integrator: integrator::Memory,
    extremes: Extremes,
}

/// A checkpoint: the memory of the run, and the particles of this rank in any order.
#[derive(Debug)]
pub struct Snapshot<'a> {
    /// All but the particles.
    pub memory: Memory,
    /// Number of particles on all ranks.
    pub count: u64,
    /// Ids of the owned particles.
    pub ids: &'a [u64],
    /// Their columns.
    pub columns: &'a Columns,
    /// Columns that change only when lists are built.
    pub constants: &'a [f64],
    /// Last accepted state.
    pub state: &'a [f64],
    /// Positions when the neighbour lists were built, m. Lists that are built there again have the same
    /// summation order.
    pub origin: &'a [Vec3],
    /// Slope at that state; empty unless known.
    pub slope: &'a [f64],
    /// The stiffest direction; empty unless known.
    pub direction: &'a [f64],
    /// Contacts for which a row of `contacts` has room, and the numbers in the memory of each; 0 without
    /// friction that remembers.
    pub contact_slots: [u64; 2],
    /// Memories of the contacts of the owned particles; see [`ContactRecords`].
    pub contacts: &'a [f64],
}

/// A run to be resumed: its memory, and the particles of this rank's block of ids, by id.
#[derive(Debug, Clone, PartialEq)]
pub struct Remembered {
    /// All but the particles.
    pub memory: Memory,
    /// Columns that change only when lists are built.
    pub constants: Vec<f64>,
    /// Last accepted state.
    pub state: Vec<f64>,
    /// Positions when the neighbour lists were built, m: three numbers for each particle.
    pub origin: Vec<f64>,
    /// Slope at that state; empty unless known.
    pub slope: Vec<f64>,
    /// The stiffest direction; empty unless known.
    pub direction: Vec<f64>,
    /// Contacts for which a row of `contacts` has room, and the numbers in the memory of each; 0 without
    /// friction that remembers.
    pub contact_slots: [u64; 2],
    /// Memories of the contacts of these particles; see [`ContactRecords`].
    pub contacts: Vec<f64>,
}

impl<'c> Simulation<'c> {
    /// Resumes a run of `count` particles of the scene with the given `columns`. Velocities are compared with
    /// `scale` (m/s). Collective.
    pub fn resume(
        scene: &Scene,
        comm: &'c dyn Comm,
        particles: (u64, Columns),
        scale: f64,
        remembered: Remembered,
    ) -> Result<Self, Error> {
        let physics: (&MakeLaws, _) = (&|set| scene_laws(scene, set), parameters(scene));
        Self::go_on(scene, physics, comm, particles, scale, remembered)
    }

    /// `resume` for a run that began with [`Simulation::with_physics`]: a checkpoint does not hold the law.
    pub fn resume_with_physics(
        scene: &Scene,
        physics: Physics,
        comm: &'c dyn Comm,
        particles: (u64, Columns),
        scale: f64,
        remembered: Remembered,
    ) -> Result<Self, Error> {
        let Physics { kernel, parameters } = physics;
        let physics: (&MakeLaws, _) = (&|set| kernel(set).into(), parameters);
        let mut simulation = Self::go_on(scene, physics, comm, particles, scale, remembered)?;
        simulation = simulation.without_default_cutoff(scene);
        simulation.choose_cutoff();
        Ok(simulation)
    }

    fn go_on(
        scene: &Scene,
        (laws, parameters): (&MakeLaws, BodyParameters),
        comm: &'c dyn Comm,
        (count, columns): (u64, Columns),
        scale: f64,
        remembered: Remembered,
    ) -> Result<Self, Error> {
        let Remembered { memory, constants, mut state, origin, mut slope, mut direction, .. } = remembered;
        let ids = rows::block(count, comm.rank(), comm.size());
        // Particles at rest where they were when the lists were built.
        let width = state.len() / (ids.end - ids.start).max(1) as usize;
        let mut at_origin = vec![0.0; state.len()];
        for (row, x) in at_origin.chunks_exact_mut(width.max(1)).zip(origin.chunks_exact(3)) {
            row[..3].copy_from_slice(x);
        }
        let known = [true, memory.slope_known, memory.direction_known];
        let lists = [&mut state, &mut slope, &mut direction].into_iter().zip(known);
        let mut companions: Vec<_> = lists.filter_map(|(list, known)| known.then_some(list)).collect();
        let particles = Particles { ids: ids.clone().collect(), columns, constants, y: &mut at_origin };
        let mut dynamics = Dynamics::new(comm, laws, parameters, scale, particles, &mut companions)?;
        dynamics.remember_within(cutoff(scene, scale * dynamics.lightest()));
        let [slots, numbers] = remembered.contact_slots.map(|number| number as usize);
        let (first, vectors) = (ids.start, companions.len());
        let records = ContactRecords::from_table(first, &remembered.contacts, slots, [vectors, numbers]);
        dynamics.restore_contacts(records, &mut companions);
        let Progress { counts, .. } = memory.progress;
        dynamics.go_on_from(counts.rebuilds, counts.pairs);
        dynamics.commit(memory.extremes);
        if scene.output.energy {
            dynamics.audit();
        }
        let mut simulation = Simulation::empty(scene, comm, dynamics, scale, count);
        let control = &mut simulation.control;
        (control.before, control.rejected, control.seen) = memory.control;
        (simulation.progress, simulation.schedule.saved) = (memory.progress, memory.t);
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

    /// Stores what the next trial depends on.
    pub(super) fn remember(&mut self) {
        let (step_start, control, dynamics) = (&self.step_start, &self.control, &self.dynamics);
        let mut progress = self.progress;
        (progress.counts.pairs, progress.counts.rebuilds) = (dynamics.own_pairs(), dynamics.rebuilds());
        self.memory = Some(Memory {
            t: step_start.t,
            progress,
            slope_known: step_start.slope_known,
            direction_known: step_start.direction_known,
            dissipation: step_start.dissipation,
            control: (control.before, control.rejected, control.seen),
            integrator: self.integrator.memory(),
            extremes: dynamics.extremes(),
        });
    }
}
