//! Loading of a scene and its particles, and an estimate of the memory that they need.
//!
//! Rank 0 reads the files. All ranks get the same scene and the same particles.

use super::simulation::state_vectors;
use crate::domain::agreement::{agree, share};
use crate::domain::{Comm, launch};
use crate::error::Error;
use crate::math::digits;
use crate::model::columns::Column;
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::{LeftOut, Particles, Scene, effects, shown, species};
use std::iter;
use std::path::Path;

/// Reads the last frame of the run in a file: all particles, with columns of their radii and masses.
///
/// Rank 0 alone calls it. Files of runs are above this folder, so the caller brings it.
pub type ReadRun<'a> = &'a dyn Fn(&Path) -> Result<InitialCondition, Error>;

/// Reads the scene file `path` and its particles on rank 0, and checks both on every rank. Collective.
///
/// `sets` are the `--set` options; they apply on every rank. [`crate::files::load::load`] brings `read_run`.
pub fn load(
    path: &Path,
    sets: &[String],
    comm: &dyn Comm,
    read_run: ReadRun,
) -> Result<(Scene, InitialCondition), Error> {
    let text = share(comm, || {
        let unreadable = |why| Error::Input(format!("{}: the scene cannot be read: {why}", path.display()));
        initial_condition::read_bytes(path).map_err(|why| unreadable(why.to_string())).and_then(|bytes| {
            initial_condition::text_of(bytes)
                .map_err(|(line, why)| unreadable(format!("line {line} is {why}")))
        })
    })?;
    let name = path.to_string_lossy();
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let LeftOut { file, run, radius, mass, density } = LeftOut::of(&name, &text, sets)?;
    let mut sets = sets.to_vec();
    // The file is read once: it may be a pipe.
    let mut early = None;
    let says_all = radius.is_some() && mass;
    // Of two sources none is read: the scene is refused.
    let run = run.filter(|_| file.is_none());
    let file = file.filter(|_| radius.is_none_or(|r| r > 0.0) && !says_all);
    let mut typical = [None; 2];
    if file.is_some() || run.is_some() {
        let means = share(comm, || {
            let table = match (&run, file) {
                (None, Some(file)) => initial_condition::read_table(&file, &folder, true)?,
                (run, _) => read_run(&folder.join(run.as_deref().unwrap_or(Path::new(""))))?,
            };
            let means = serde_json::to_string(&table.means(radius)).expect("these are numbers");
            early = Some(table);
            Ok(means)
        })?;
        typical = serde_json::from_str(&means).unwrap_or_default();
        let [own_radius, own_mass]: [Option<f64>; 2] = typical;
        let set = |key: &str, number: f64| format!("particles.{key}={number:?}");
        sets.extend(own_radius.filter(|_| radius.is_none()).map(|r| set("radius", r)));
        sets.extend(own_mass.filter(|_| !mass).map(|mass| set("mass", mass)));
    }
    let tables = |table: &Path| share(comm, || species::read(table, &folder));
    let mut scene = Scene::parse_with(&folder, &name, &text, &sets, &tables)?;
    fits_the_run(&scene, typical)?;
    // A TOML integer holds 63 bits. With a longer seed the scene in the run file could not be read again.
    let seed = share(comm, || Ok((rand::random::<u64>() >> 1).to_string()))?;
    scene.set_seed_if_missing(seed.parse().expect("it was printed as a number"));
    let mut start = match scene.particles.count() {
        Some(count) => {
            agree(comm, check_memory(comm, &scene, count))?;
            let start = initial_condition::made(&scene)?;
            start.settle_drawn(&mut scene, radius.is_none(), !mass || density.is_some());
            start
        }
        None => {
            let mut read = Ok(InitialCondition::default());
            share(comm, || {
                read = match early.take() {
                    None => initial_condition::read_csv(&scene, &folder),
                    Some(mut early) => early.settle_materials(&scene).map(|()| early),
                };
                read.as_ref().map(|_| String::new()).map_err(Clone::clone)
            })?;
            let mut start = share_start(comm, read?);
            start.settle_sizes(&mut scene, density);
            agree(comm, check_memory(comm, &scene, start.x.len() as u64))?;
            start
        }
    };
    // A particle file has them already.
    start.settle_materials(&scene)?;
    let start = initial_condition::ready(&scene, start)?;
    scene.settle_contacts(&start)?;
    Ok((scene, start))
}

/// Checks that radius and mass of a scene that starts from a run are those of its spheres, if it has both.
/// `typical` is the mean radius (m) and mass (kg) of the run.
fn fits_the_run(scene: &Scene, typical: [Option<f64>; 2]) -> Result<(), Error> {
    let Particles { run: Some(run), radius, mass, .. } = &scene.particles else { return Ok(()) };
    for (key, own, of_run, unit) in [("radius", radius, typical[0], "m"), ("mass", mass, typical[1], "kg")] {
        // Means are rounded.
        if of_run.is_some_and(|of_run| (own - of_run).abs() > 1e-9 * of_run) {
            return Err(Error::Input(format!(
                "particles.{key} = {} {unit} contradicts particles.run = \"{}\", whose spheres have {} \
                 {unit}: it must be left out",
                digits::short(*own),
                shown(run),
                digits::short(of_run.unwrap_or_default())
            )));
        }
    }
    Ok(())
}

/// Copies the particles that rank 0 has in `own` to every rank. Collective.
pub fn share_start(comm: &dyn Comm, own: InitialCondition) -> InitialCondition {
    let numbers = |own: &[f64]| -> Vec<f64> {
        let mut bytes: Vec<u8> = own.iter().flat_map(|x| x.to_le_bytes()).collect();
        comm.broadcast(&mut bytes);
        bytes.as_chunks().0.iter().map(|&number| f64::from_le_bytes(number)).collect()
    };
    let vectors = |own: &[[f64; 3]]| numbers(own.as_flattened()).as_chunks().0.to_vec();
    let (x, v, omega) = (vectors(&own.x), vectors(&own.v), vectors(&own.omega));
    let unread = own.unread;
    let (columns, own): (Vec<Column>, Vec<Vec<f64>>) = own.columns.into_iter().unzip();
    let mut described = serde_json::to_vec(&(columns, unread)).expect("columns are text and numbers");
    comm.broadcast(&mut described);
    let (columns, unread): (Vec<Column>, _) = serde_json::from_slice(&described).expect("rank 0 wrote them");
    let own = own.iter().map(Vec::as_slice).chain(iter::repeat(&[][..]));
    let columns = columns.into_iter().zip(own).map(|(column, own)| (column, numbers(own))).collect();
    InitialCondition { x, v, omega, columns, unread, pushed: None }
}

/// Listed pairs per particle in a packed bed, approximately.
const LISTED_PAIRS: f64 = 13.0;
/// Near pairs per particle in a packed bed, approximately: the listed pairs that are evaluated.
const NEAR_PAIRS: f64 = 8.5;

/// Contacts within reach per particle in a packed bed, approximately.
const CONTACTS: f64 = 5.5;

/// Memory of the initial condition of one particle, bytes. Every rank holds that of all particles.
pub const START_BYTES: u64 = 72;

/// Approximate memory of the solver for one particle in a packed bed, bytes: states, slopes and lists.
pub fn bytes_per_particle(scene: &Scene) -> u64 {
    let components = if scene.rotates() { 9.0 } else { 6.0 };
    // The state vectors of the method, and the bodies at which forces are evaluated; then three earlier
    // positions (24 bytes each) and an id.
    let states = (state_vectors(scene) + 1) as f64 * 8.0 * components + 3.0 * 24.0 + 8.0;
    let lists = 8.0 * (LISTED_PAIRS + NEAR_PAIRS);
    let Some(memory) = effects::law(scene).memory else { return (states + lists) as u64 };
    // The rows of contacts in all vectors and at the stage, two ids and whether they count; the number of the
    // row of every listed and every near pair.
    let rows = CONTACTS * ((state_vectors(scene) + 1) as f64 * 8.0 * memory.numbers() as f64 + 17.0);
    (states + lists + rows + 0.5 * lists) as u64
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
            "{count} particles need about {} on each machine, and this one has {}: {} or more machines would \
             do",
            digits::bytes(needed),
            digits::bytes(there),
            match scene.particles.source() {
                "particles.file" => "fewer rows of particles.file".to_owned(),
                "particles.run" => "a particles.run with fewer particles".to_owned(),
                made => format!("a smaller {made}.count"),
            }
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;
    use crate::model::columns::Changes;

    #[test]
    fn every_rank_gets_all_that_rank_0_has() {
        let column = |name: &str, width| {
            let (name, unit, changes) = (name.to_owned(), "1".to_owned(), Changes::WithLists);
            Column { name, width, unit, changes, in_file: true, names: Vec::new() }
        };
        let start = InitialCondition {
            x: vec![[0.0, 0.1, 0.2], [1.0, 1.1, 1.2]],
            v: vec![[2.0, 2.1, 2.2], [3.0, 3.1, 3.2]],
            omega: vec![[4.0, 4.1, 4.2], [5.0, 5.1, 5.2]],
            columns: vec![(column("tag", 1), vec![6.0, 7.0]), (column("way", 2), vec![8.0, 8.5, 9.0, 9.5])],
            unread: vec!["mass".to_owned()],
            pushed: None,
        };
        team(3, |comm| {
            let own = if comm.rank() == 0 { start.clone() } else { InitialCondition::default() };
            assert_eq!(share_start(comm, own), start);
        });
    }
}
