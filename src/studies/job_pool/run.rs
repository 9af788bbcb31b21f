//! Runs a scene on one thread. The caller gets each frame as plain vectors.
//!
//! A limit ends runs that take too much work.

use std::sync::Arc;

use super::{Sample, Work};
use crate::domain::Solo;
use crate::engine::simulation::{Counts, Frame, Simulation};
use crate::error::Error;
use crate::files::run_file::State;
use crate::math::vector::Vec3;
use crate::model::columns::{position, spin, velocity};
use crate::model::size::Size;
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;

/// All particles at one time, in the order of their ids.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameData {
    /// Time, s.
    pub time: f64,
    /// Centres, m.
    pub x: Vec<Vec3>,
    /// Velocities, m/s.
    pub v: Vec<Vec3>,
    /// Angular velocities, rad/s; zero without rotation.
    pub omega: Vec<Vec3>,
    /// The size of each particle; none where all have that of the scene.
    pub sizes: Arc<[Size]>,
    /// Numbers of the materials of the particles in the scene; none where nobody has one.
    pub materials: Arc<[u32]>,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Potential energy of contacts and height, J.
    pub potential_energy: f64,
    /// Energy dissipated so far by rebound and by friction, J; zero unless the scene asks for dissipation.
    pub dissipated: [f64; 2],
    /// Largest overlap, m.
    pub largest_overlap: f64,
    /// Highest point of any sphere, m.
    pub bed_height: f64,
}

impl FrameData {
    /// The state as frame `number` of an output file would hold it, without spins.
    pub fn state(&self, number: u64) -> State {
        let list = |vectors: &[Vec3]| vectors.iter().map(|&vector| vector.into()).collect();
        State {
            frame: number,
            time: self.time,
            x: list(&self.x),
            v: list(&self.v),
            omega: None,
            sizes: self.sizes.clone(),
            materials: self.materials.clone(),
        }
    }
}

/// Limit on the right-hand sides of a run of `particles` particles: 3 million, and fewer for many particles,
/// because each one then costs more.
pub fn work_limit(particles: usize) -> u64 {
    (1_000_000_000 / particles.max(1) as u64).clamp(20_000, 3_000_000)
}

/// Runs `scene` from `start` and calls `look` with every frame.
///
/// The run ends at the first frame with more than `limit` right-hand sides.
///
/// The sample has the work and, if the run failed, the reason. The work of a failed run is counted up to its
/// last frame. The caller fills in the numbers.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::{Scene, initial_condition};
/// use demhybrid::studies::job_pool::run::{run, work_limit};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &["t_end=0.1".to_owned()])?;
/// let grid = scene.particles.grid.as_ref().ok_or("there is no grid")?;
/// let start = initial_condition::grid(&scene, grid);
/// let mut frames = 0;
/// let sample = run(&scene, &start, work_limit(start.x.len()), |_| frames += 1);
/// assert_eq!((frames, sample.failure), (6, None)); // one in 0.02 s, and that at the start
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run(scene: &Scene, start: &InitialCondition, limit: u64, mut look: impl FnMut(&FrameData)) -> Sample {
    // The number of fixed steps is known in advance, so check it before the run.
    let steps = scene.solver.step.map_or(0.0, |step| scene.t_end / step);
    if steps > limit as f64 {
        let why = Error::WorkLimit { t: 0.0, done: 0, limit };
        return Sample {
            failure: Some(format!("{why}, and there would be {steps:.0} steps")),
            ..Sample::default()
        };
    }
    let mut counts = Counts::default();
    let outcome = follow(scene, start, limit, &mut counts, &mut look);
    let work = Work {
        rhs_evaluations: counts.rhs,
        pair_evaluations: counts.pairs,
        steps_accepted: counts.accepted,
        steps_rejected: counts.rejected,
        core_seconds: 0.0,
    };
    Sample { work, failure: outcome.err().map(|why| why.to_string()), numbers: Vec::new() }
}

/// Runs the scene and keeps `counts` up to date, also where the run fails.
fn follow(
    scene: &Scene,
    start: &InitialCondition,
    limit: u64,
    counts: &mut Counts,
    look: &mut dyn FnMut(&FrameData),
) -> Result<(), Error> {
    let outcome = Simulation::new(scene, start, &Solo)?.run(&mut |frame: &Frame| {
        *counts = frame.counts;
        look(&frame.into());
        if frame.counts.rhs > limit && frame.time < scene.t_end {
            return Err(Error::WorkLimit { t: frame.time, done: frame.counts.rhs, limit });
        }
        Ok(())
    })?;
    *counts = outcome.counts;
    Ok(())
}

impl From<&Frame<'_>> for FrameData {
    fn from(frame: &Frame) -> Self {
        FrameData {
            time: frame.time,
            x: frame.rows.map(position),
            v: frame.rows.map(velocity),
            omega: frame.rows.map(spin),
            sizes: frame.sizes().into(),
            materials: frame.materials().into(),
            kinetic_energy: frame.kinetic_energy,
            potential_energy: frame.potential_energy,
            dissipated: frame.dissipated,
            largest_overlap: frame.largest_overlap,
            bed_height: frame.bed_height,
        }
    }
}
