//! Loading of a scene and its particles, also of those in the file of another run.

use crate::domain::Comm;
use crate::engine::load;
use crate::error::Error;
use crate::files::output::whole_frame;
use crate::files::run_file::RunFile;
use crate::model::columns::{MASS, RADIUS};
use crate::scene::Scene;
use crate::scene::initial_condition::{InitialCondition, column};
use std::path::Path;

/// Reads the scene file `path` and its particles on rank 0, and checks both on every rank. Collective.
///
/// `sets` are the `--set` options; they apply on every rank.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::files::load::load;
///
/// let set = ["t_end=0.5".to_owned()];
/// let (scene, start) = load("configs/quick.toml".as_ref(), &set, &Solo)?;
/// assert_eq!((scene.t_end, start.x.len()), (0.5, 27));
/// # Ok::<(), demhybrid::error::Error>(())
/// ```
pub fn load(path: &Path, sets: &[String], comm: &dyn Comm) -> Result<(Scene, InitialCondition), Error> {
    // Initialise HDF5 here, on all ranks and the main thread: it may call MPI when it starts.
    let _ = hdf5::library_version();
    load::load(path, sets, comm, &last_frame)
}

/// The particles in the last frame of the run in the file `path`, all with radius and mass.
fn last_frame(path: &Path) -> Result<InitialCondition, Error> {
    let run = RunFile::open(path).map_err(|why| {
        Error::Input(format!(
            "particles.run: {why}; it must be the output file of another run, and a relative path starts at \
             the folder of the scene"
        ))
    })?;
    let mut start = whole_frame(path, run.frames - 1, run.count).map_err(|why| run.unreadable(&why))?;
    let typical = &run.scene.particles;
    for (name, unit, number) in [(RADIUS, "m", typical.radius), (MASS, "kg", typical.mass)] {
        if !start.columns.iter().any(|(column, _)| column.name == name) {
            start.columns.push((column(name, unit), vec![number; start.x.len()]));
        }
    }
    Ok(start)
}
