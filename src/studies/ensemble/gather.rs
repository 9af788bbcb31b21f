//! Gathers finished runs, such as those of a job array, into cases. Runs with the same scene form one case.

use super::cases::name;
use super::measures::{Plan, recorded};
use super::{Case, runs};
use crate::beds::folder::stem;
use crate::domain::Comm;
use crate::domain::agreement::share;
use crate::error::Error;
use crate::files::names::Series;
use crate::files::run_file::RunFile;
use crate::math::digits::short;
use crate::studies::job_pool::{JobPool, Sample};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A run file that was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    file: PathBuf,
    seed: u64,
    /// Its scene in TOML, without everything that may differ between the runs of a case.
    scene: String,
    /// Why the run cannot be used, or `None` if it can.
    incomplete: Option<String>,
}

/// The runs of one case, by ascending seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Family {
    name: String,
    runs: Vec<Found>,
}

/// Name of the case that a run file belongs to: `bed` for `bed-7.vtkhdf`.
pub fn family(file: &Path) -> String {
    let stem = stem(file);
    match stem.rsplit_once('-') {
        Some((name, number)) if !name.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) => {
            name.to_owned()
        }
        _ => stem,
    }
}

/// Rank 0 reads the scenes of all `files` and groups them; all ranks get the result. Collective.
pub fn find(files: &[PathBuf], comm: &dyn Comm) -> Result<Vec<Family>, Error> {
    // Initialise HDF5 here, on the main thread: it may call MPI when it starts.
    let _ = hdf5::library_version();
    let text = share(comm, || {
        let found = files.iter().map(|file| look(file)).collect::<Result<Vec<Found>, Error>>()?;
        let families = families(found)?;
        serde_json::to_string(&families).map_err(|why| Error::Input(format!("--gather: {why}")))
    })?;
    serde_json::from_str(&text).map_err(|why| Error::Input(format!("--gather: {why}")))
}

fn look(file: &Path) -> Result<Found, Error> {
    let run_file = RunFile::open(file)?;
    let mut scene = run_file.scene.clone();
    let Some(seed) = scene.particles.seed_mut().and_then(|seed| seed.replace(0)) else {
        return Err(run_file.unreadable("its particles came from a file; an ensemble needs runs with a seed"));
    };
    (scene.output.file, scene.output.energy) = (Some("run.vtkhdf".into()), false);
    (scene.checkpoint, scene.limits) = (None, None);
    let incomplete = match run_file.completed {
        true => None,
        false => Some(format!(
            "{} is not complete: it ends at t = {} s of {} s; demhybrid --resume goes on with it",
            file.display(),
            short(run_file.series(Series::Time)?.last().copied().unwrap_or(0.0)),
            short(scene.t_end)
        )),
    };
    Ok(Found { file: file.to_path_buf(), seed, scene: scene.resolved(), incomplete })
}

/// Groups the runs by scene. Groups come in the order of their first files.
fn families(found: Vec<Found>) -> Result<Vec<Family>, Error> {
    let mut groups: Vec<Vec<Found>> = Vec::new();
    for run in found {
        match groups.iter_mut().find(|group| group[0].scene == run.scene) {
            None => groups.push(vec![run]),
            Some(group) => {
                if let Some(other) = group.iter().find(|other| other.seed == run.seed) {
                    return Err(Error::Input(format!(
                        "{}: it has the scene and the seed {} of {}; each run must be given once",
                        run.file.display(),
                        run.seed,
                        other.file.display()
                    )));
                }
                group.push(run);
            }
        }
    }
    let names = names(&groups);
    let family = |(name, mut runs): (String, Vec<Found>)| {
        runs.sort_by_key(|run| run.seed);
        Family { name, runs }
    };
    Ok(names.into_iter().zip(groups).map(family).collect())
}

/// A name for each group: the name of its files. If several groups share that name, the values that differ
/// between their scenes follow.
fn names(groups: &[Vec<Found>]) -> Vec<String> {
    let stems: Vec<String> = groups.iter().map(|group| family(&group[0].file)).collect();
    let keys: Vec<BTreeMap<String, String>> = groups.iter().map(|group| values(&group[0].scene)).collect();
    let name_of = |k: usize| {
        let alike: Vec<usize> = (0..groups.len()).filter(|&other| stems[other] == stems[k]).collect();
        let mut differing: Vec<&String> = alike
            .iter()
            .flat_map(|&other| keys[other].keys())
            .filter(|key| alike.iter().any(|&other| keys[other].get(*key) != keys[k].get(*key)))
            .collect();
        differing.sort_unstable();
        differing.dedup();
        let value = |key: &String| keys[k].get(key).map_or("none".to_owned(), Clone::clone);
        name(&stems[k], differing.into_iter().map(|key| (key.as_str(), value(key))))
    };
    (0..groups.len()).map(name_of).collect()
}

/// The values of a scene, by the dotted paths of their keys.
fn values(scene: &str) -> BTreeMap<String, String> {
    fn walk(path: &str, value: &toml::Value, found: &mut BTreeMap<String, String>) {
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                    walk(&path, value, found);
                }
            }
            other => {
                found.insert(path.to_owned(), other.to_string());
            }
        }
    }
    let mut found = BTreeMap::new();
    if let Ok(table) = scene.parse::<toml::Table>() {
        walk("", &toml::Value::Table(table), &mut found);
    }
    found
}

/// Measures all runs that are complete. Collective.
pub fn measure(pool: &JobPool, families: &[Family], plan: &Plan) -> Vec<Case> {
    let jobs: Vec<&Found> = families.iter().flat_map(|family| &family.runs).collect();
    let mut samples = pool.run("gathering", &jobs, |found| measured(found, plan)).into_iter();
    let mut case = |family: &Family| Case {
        name: family.name.clone(),
        scene: family.runs[0].scene.clone(),
        runs: runs(family.runs.iter().map(|run| run.seed), samples.by_ref().take(family.runs.len())),
    };
    families.iter().map(&mut case).collect()
}

fn measured(found: &Found, plan: &Plan) -> Sample {
    let failed = |why: String| Sample { failure: Some(why), ..Sample::default() };
    if let Some(why) = &found.incomplete {
        return failed(why.clone());
    }
    let sample = RunFile::open(&found.file).and_then(|run_file| recorded(&run_file, plan));
    sample.unwrap_or_else(|why| failed(why.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::ensemble::testing::scene;

    fn found(file: &str, seed: u64, sets: &[&str]) -> Found {
        Found { file: file.into(), seed, scene: scene(sets).0.resolved(), incomplete: None }
    }

    #[test]
    fn the_seed_at_the_end_of_a_name_is_no_part_of_the_family() {
        let named = |file: &str| family(Path::new(file));
        assert_eq!(named("a/bed-12.vtkhdf"), "bed");
        assert_eq!(named("bed-a-3.vtkhdf"), "bed-a");
        assert_eq!(named("bed-soft.vtkhdf"), "bed-soft");
        assert_eq!(named("-3.vtkhdf"), "-3");
    }

    #[test]
    fn files_of_one_scene_are_a_case_named_by_what_differs() {
        let soft = ["contact.restitution=0.2"];
        let list = vec![
            found("bed-2.vtkhdf", 2, &[]),
            found("bed-1.vtkhdf", 1, &[]),
            found("bed-3.vtkhdf", 1, &soft),
            found("long-1.vtkhdf", 1, &["t_end=2"]),
        ];
        let families = families(list).unwrap();
        let names: Vec<&str> = families.iter().map(|family| family.name.as_str()).collect();
        assert_eq!(names, ["bed restitution=0.4", "bed restitution=0.2", "long"]);
        assert_eq!(families[0].runs.iter().map(|run| run.seed).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn a_run_given_twice_is_refused_with_both_files() {
        let twice = vec![found("a.vtkhdf", 7, &[]), found("b.vtkhdf", 7, &[])];
        let why = families(twice).unwrap_err().to_string();
        assert!(why.contains("a.vtkhdf") && why.contains("b.vtkhdf") && why.contains("seed 7"), "{why}");
    }
}
