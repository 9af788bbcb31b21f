//! The output file of an earlier process: reads what it holds, and prepares it for more frames.
//!
//! One rank does this with the serial driver: the parallel one cannot shorten arrays (decision 032).

use std::os::unix::fs::FileExt;
use std::path::Path;
use std::str::FromStr;

use hdf5::types::VarLenUnicode;
use hdf5::{Attribute, Dataset, File, Group};

use super::RunInfo;
use super::collective::{Transfer, begin_behind_the_end};
use super::frames::{largest_growth, options};
use super::run_group::put_scene;
use crate::domain::Solo;
use crate::model::columns::{Changes, Column, MASS, MATERIAL, RADIUS, SPECIES};
use crate::model::size::Size;
use crate::scene::initial_condition::InitialCondition;

/// What an output file says about the run that wrote it.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The scene with every default filled in, TOML.
    pub scene: String,
    /// Whether the run is complete.
    pub completed: bool,
    /// Number of complete frames.
    pub frames: u64,
    /// Times of the complete frames, s.
    pub times: Vec<f64>,
    /// Number of particles.
    pub count: u64,
}

/// Reads what the output file `path` holds. An error says why the file cannot be such a file.
pub fn inspect(path: &Path) -> Result<Found, String> {
    let file = open(path)?;
    let foreign = |_| {
        "it is not an output file of demhybrid: it has no /run with a scene and no /VTKHDF/Steps".to_owned()
    };
    let run = file.group("run").map_err(foreign)?;
    let scene = match run.attr("scene") {
        Ok(attribute) => text(&attribute)?,
        Err(_) => {
            let all = run.dataset("scene_text").map_err(foreign)?;
            long_text(path, &all)?
        }
    };
    let completed: i64 = run.attr("completed").and_then(|found| found.read_scalar()).map_err(foreign)?;
    let steps = file.group("VTKHDF/Steps").map_err(foreign)?;
    let frames: i64 = steps.attr("NSteps").and_then(|found| found.read_scalar()).map_err(foreign)?;
    let ids = file.dataset("VTKHDF/PointData/id").map_err(foreign)?;
    let frames = u64::try_from(frames).map_err(|_| format!("it claims {frames} frames"))?;
    // A kill in the first flush may leave times that cannot be read.
    let read = || steps.dataset("Values").and_then(|times| times.read_raw());
    let times: Vec<f64> = if frames == 0 { Vec::new() } else { read().map_err(foreign)? };
    // A kill between the writes of `NSteps` and of the times leaves frames without times.
    let times = times[..times.len().min(frames as usize)].to_vec();
    if !times.iter().all(|time| time.is_finite()) {
        return Err("a frame of it has no finite time".into());
    }
    Ok(Found {
        scene,
        completed: completed == 1,
        frames: times.len() as u64,
        times,
        count: ids.shape().first().copied().unwrap_or(0) as u64,
    })
}

/// The state of all `count` particles in the first frame.
pub fn first_frame(path: &Path, count: u64) -> Result<InitialCondition, String> {
    whole_frame(path, 0, count)
}

/// The state of all `count` particles in frame `k`, which must be complete, and their columns.
pub fn whole_frame(path: &Path, k: u64, count: u64) -> Result<InitialCondition, String> {
    let file = open(path)?;
    Ok(InitialCondition { columns: constants(&file, count).map_err(say)?, ..frame(&file, k, count)? })
}

/// The state of all `count` particles in frame `k`, which must be complete.
///
/// Angular velocities are 0 if the file has none.
pub fn frame(file: &File, k: u64, count: u64) -> Result<InitialCondition, String> {
    let (first, end) = ((k * count) as usize, ((k + 1) * count) as usize);
    let rows = |name: &str| -> Result<Vec<[f64; 3]>, String> {
        let all = file.dataset(name).and_then(|rows| rows.read_slice_2d::<f64, _>((first..end, ..)));
        Ok(all.map_err(say)?.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
    };
    let spins = "VTKHDF/PointData/angular_velocity";
    let (x, v) = (rows("VTKHDF/Points")?, rows("VTKHDF/PointData/velocity")?);
    let omega = if file.link_exists(spins) { rows(spins)? } else { vec![[0.0; 3]; x.len()] };
    Ok(InitialCondition { x, v, omega, ..InitialCondition::default() })
}

/// What the file holds once about all particles.
pub struct Bodies {
    /// The size of each; none where all are alike.
    pub sizes: Vec<Size>,
    /// Their species, if they have any.
    pub species: Option<Species>,
    /// The number of the material of each in the scene; none where nobody has a material.
    pub materials: Vec<u32>,
}

/// What the file holds about its `count` particles: sizes, species and materials.
pub fn bodies(file: &File, count: u64) -> Result<Bodies, String> {
    let columns = constants(file, count).map_err(say)?;
    let find = |name: &str| columns.iter().find(|(column, _)| column.name == name);
    let species = find(SPECIES).map(|(column, numbers)| Species {
        names: column.names.clone(),
        of: numbers.iter().map(|&number| number as u32).collect(),
    });
    let sizes = match (find(RADIUS), find(MASS)) {
        (Some((_, r)), Some((_, mass))) => r.iter().zip(mass).map(|(&r, &mass)| Size::new(r, mass)).collect(),
        _ => Vec::new(),
    };
    let materials = find(MATERIAL).map(|(_, numbers)| numbers.iter().map(|&number| number as u32).collect());
    Ok(Bodies { sizes, species, materials: materials.unwrap_or_default() })
}

/// The species of the particles of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Species {
    /// Their names.
    pub names: Vec<String>,
    /// For each particle the index of its name.
    pub of: Vec<u32>,
}

/// The columns of `count` particles that the file holds once, for all frames; without ids, and without radii
/// where all are the same.
///
/// A column has a unit. Arrays without one are not ours.
fn constants(file: &File, count: u64) -> hdf5::Result<Vec<(Column, Vec<f64>)>> {
    let point_data = file.group("VTKHDF/PointData")?;
    let of_frames = ["velocity", "angular_velocity", "id"];
    let names = point_data.member_names()?.into_iter().filter(|name| !of_frames.contains(&&name[..]));
    let mut columns = Vec::new();
    for name in names {
        let array = point_data.dataset(&name)?;
        let Ok(unit) = array.attr("unit").and_then(|unit| unit.read_scalar::<VarLenUnicode>()) else {
            continue;
        };
        if array.shape().first() == Some(&(count as usize)) {
            let (unit, width) = (unit.to_string(), array.shape().get(1).copied().unwrap_or(1));
            let names = array.attr("names").and_then(|names| names.read_scalar::<VarLenUnicode>());
            let names = names.map_or_else(|_| Vec::new(), |names| names.lines().map(str::to_owned).collect());
            let column = Column { name, width, unit, changes: Changes::WithLists, in_file: true, names };
            columns.push((column, array.read_raw()?));
        }
    }
    Ok(columns)
}

/// Cuts the file to its first `frames` frames, so that the run which `info` describes can go on in it.
///
/// The run then counts as not completed.
pub fn prepare(path: &Path, frames: u64, info: &RunInfo) -> Result<(), String> {
    let prepared = || -> hdf5::Result<()> {
        let file = options(&Solo)?.open_rw(path)?;
        let root = file.group("VTKHDF")?;
        let steps = root.group("Steps")?;
        let run = file.group("run")?;
        if run.attr("stopped_by").is_err() && run.attr("completed")?.read_scalar::<i64>()? == 0 {
            // The run was killed, perhaps during a flush. Its last frame may then have chunks beyond the end
            // of the file that the superblock states, and new data would overwrite them.
            let count = root.dataset("PointData/id")?.size() as u64;
            begin_behind_the_end(&file, largest_growth(count))?;
            let there = steps.attr("NSteps")?.read_scalar::<i64>()?;
            cut_to_chunks(&root, there.max(0) as u64, count)?;
        }
        // There must never be more times than `NSteps` says, or VTK's reader crashes.
        shorten(&steps, &["Values"], frames)?;
        steps.attr("NSteps")?.write_scalar(&(frames as i64))?;
        shorten(&root, &["NumberOfPoints"], frames)?;
        let series = run.group("series")?;
        let names = series.member_names()?;
        shorten(&series, &names.iter().map(String::as_str).collect::<Vec<_>>(), frames)?;
        run.attr("completed")?.write_scalar(&0_i64)?;
        run.attr("ranks")?.write_scalar(&(info.ranks as i64))?;
        run.attr("threads")?.write_scalar(&(info.threads as i64))?;
        for name in ["choice", "stopped_by"] {
            if run.attr(name).is_ok() {
                run.delete_attr(name)?;
            }
        }
        replace_text(&run, "instruction_set", &info.instruction_set)?;
        if run.attr("scene").is_ok() {
            run.delete_attr("scene")?;
        } else {
            run.unlink("scene_text")?;
        }
        put_scene(&run, &Transfer::new(None)?, &info.scene, true)?;
        file.close()
    };
    prepared().map_err(say)
}

fn open(path: &Path) -> Result<File, String> {
    File::open(path).map_err(|why| format!("it cannot be opened as an HDF5 file: {}", say(why)))
}

/// The message of HDF5 on one line.
#[allow(clippy::needless_pass_by_value)] // for `map_err`
fn say(why: hdf5::Error) -> String {
    why.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn text(attribute: &Attribute) -> Result<String, String> {
    attribute.read_scalar::<VarLenUnicode>().map(|text| text.to_string()).map_err(say)
}

/// Reads a text that is a dataset. Its bytes are contiguous in the file, and are read from there.
///
/// The crate `hdf5` cannot read a text whose length is known only at run time.
fn long_text(path: &Path, text: &Dataset) -> Result<String, String> {
    let bytes = text.dtype().map_err(say)?.size();
    let offset = text.offset().ok_or("its scene is not where it should be")?;
    let mut all = vec![0; bytes.min(LONGEST_TEXT)];
    let read = std::fs::File::open(path).and_then(|file| file.read_exact_at(&mut all, offset));
    read.map_err(|why| why.to_string())?;
    String::from_utf8(all).map_err(|_| "its scene is not UTF-8 text".into())
}

/// Longest scene that is read, bytes.
const LONGEST_TEXT: usize = 64 << 20;

fn shorten(group: &Group, names: &[&str], rows: u64) -> hdf5::Result<()> {
    for name in names {
        let array = group.dataset(name)?;
        let mut shape = array.shape();
        if shape[0] as u64 > rows {
            shape[0] = rows as usize;
            array.resize(shape)?;
        }
    }
    Ok(())
}

/// Cuts the growing arrays in `group` to the chunks of the `frames` complete frames of `count` particles.
///
/// After a kill an array may already be longer than the tree of its chunks knows. A chunk that is missing
/// there is made only when the array grows.
fn cut_to_chunks(group: &Group, frames: u64, count: u64) -> hdf5::Result<()> {
    for array in group.datasets()? {
        let (name, mut shape) = (array.name(), array.shape());
        let of_particles = name == "/VTKHDF/Points" || name.starts_with("/VTKHDF/PointData/");
        let rows = if of_particles { frames * count } else { frames } as usize;
        if let Some(chunk) = array.chunk()
            && shape[0] > rows.next_multiple_of(chunk[0])
        {
            shape[0] = rows.next_multiple_of(chunk[0]);
            array.resize(shape)?;
        }
    }
    group.groups()?.iter().try_for_each(|group| cut_to_chunks(group, frames, count))
}

fn replace_text(group: &Group, name: &str, text: &str) -> hdf5::Result<()> {
    let value = VarLenUnicode::from_str(text).map_err(|why| format!("attribute {name}: {why}"))?;
    group.attr(name)?.write_scalar(&value)
}
