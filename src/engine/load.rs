//! Loading of a scene and its particles, and an estimate of the memory that they need.
//!
//! Rank 0 reads the files. All ranks get the same scene and the same particles.

use super::simulation::state_vectors;
use crate::domain::agreement::{agree, share};
use crate::domain::{Comm, launch};
use crate::error::Error;
use crate::math::digits;
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use std::path::Path;

/// Reads the scene file `path` and its particles on rank 0, and checks both on every rank. Collective.
///
/// `sets` are the `--set` options; they apply on every rank.
pub fn load(path: &Path, sets: &[String], comm: &dyn Comm) -> Result<(Scene, InitialCondition), Error> {
    let text = share(comm, || {
        let unreadable = |why| Error::Input(format!("{}: the scene cannot be read: {why}", path.display()));
        initial_condition::read_bytes(path)
            .map_err(|why| unreadable(why.to_string()))
            .and_then(|bytes| String::from_utf8(bytes).map_err(|_| unreadable("it is not UTF-8 text".into())))
    })?;
    let name = path.to_string_lossy();
    let mut scene = Scene::parse(&name, &text, sets)?;
    // A TOML integer holds 63 bits. With a longer seed the scene in the run file could not be read again.
    let seed = share(comm, || Ok((rand::random::<u64>() >> 1).to_string()))?;
    scene.set_seed_if_missing(seed.parse().expect("it was printed as a number"));
    let start = match &scene.particles.grid {
        Some(grid) => {
            agree(comm, check_memory(comm, &scene, grid.count))?;
            initial_condition::grid(&scene, grid)
        }
        None => {
            let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
            let mut read = Ok(InitialCondition::default());
            share(comm, || {
                read = initial_condition::read_csv(&scene, &folder);
                read.as_ref().map(|_| String::new()).map_err(Clone::clone)
            })?;
            let start = share_start(comm, read?);
            agree(comm, check_memory(comm, &scene, start.x.len() as u64))?;
            start
        }
    };
    initial_condition::check(&scene, &start)?;
    Ok((scene, start))
}

/// Copies the particles that rank 0 has in `own` to every rank. Collective.
pub fn share_start(comm: &dyn Comm, own: InitialCondition) -> InitialCondition {
    let both = |list: Vec<[f64; 3]>| {
        let mut bytes: Vec<u8> = list.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        comm.broadcast(&mut bytes);
        let number = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("chunks have eight bytes"));
        bytes
            .chunks_exact(24)
            .map(|row| [number(&row[..8]), number(&row[8..16]), number(&row[16..])])
            .collect()
    };
    InitialCondition { x: both(own.x), v: both(own.v), omega: both(own.omega), ..InitialCondition::default() }
}

/// Listed pairs per particle in a packed bed, approximately.
const LISTED_PAIRS: f64 = 13.0;
/// Near pairs per particle in a packed bed, approximately: the listed pairs that are evaluated.
const NEAR_PAIRS: f64 = 8.5;

/// Memory of the initial condition of one particle, bytes. Every rank holds that of all particles.
pub const START_BYTES: u64 = 72;

/// Approximate memory of the solver for one particle in a packed bed, bytes: states, slopes and lists.
pub fn bytes_per_particle(scene: &Scene) -> u64 {
    let components = if scene.rotates() { 9.0 } else { 6.0 };
    // The state vectors of the method, and the bodies at which forces are evaluated; then three earlier
    // positions (24 bytes each) and an id.
    let states = (state_vectors(scene) + 1) as f64 * 8.0 * components + 3.0 * 24.0 + 8.0;
    (states + 8.0 * (LISTED_PAIRS + NEAR_PAIRS)) as u64
}

/// Refuses a scene of `count` particles that does not fit into the memory of this machine. Collective.
///
/// Accepts any scene if the size of the memory is unknown.
pub fn check_memory(comm: &dyn Comm, scene: &Scene, count: u64) -> Result<(), Error> {
    // Every rank holds the initial condition of all particles, and solver memory only for its own.
    let here = comm.ranks_on_node() as u64;
    let own = count.div_ceil(comm.size() as u64).saturating_mul(bytes_per_particle(scene));
    let needed = count.saturating_mul(START_BYTES).saturating_add(own).saturating_mul(here);
    let there = launch::physical_memory();
    if there > 0 && needed > there {
        return Err(Error::Input(format!(
            "{count} particles need about {} on each machine, and this one has {}: fewer particles or more \
             machines would do",
            digits::bytes(needed),
            digits::bytes(there)
        )));
    }
    Ok(())
}
