//! Ensembles: one scene from many initial conditions, or several scenes side by side.
//!
//! `demhybrid ensemble` runs them, or gathers runs that are finished, and reports how far the beds agree.

mod cases;
mod figures;
mod files;
pub mod gather;
pub mod measures;
mod request;
mod summary;
#[cfg(test)]
mod testing;

use crate::error::Error;
use crate::studies::job_pool::Sample;
pub use cases::{load, run};
use measures::Followed;
pub use measures::{MEASURES, MeasureId, Plan};
pub use request::{Request, Seeds, Vary};
use std::path::Path;

/// One run of a case. It may have failed.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its seed.
    pub seed: u64,
    /// Its measures, or why there are none.
    pub outcome: Result<Followed, String>,
}

/// All runs of one scene, by ascending seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Short name that tells it from the other cases.
    pub name: String,
    /// Its resolved scene in TOML. The seed in it has no meaning.
    pub scene: String,
    /// Its runs.
    pub runs: Vec<Run>,
}

/// Pairs each seed of a case with its sample.
fn runs(seeds: impl IntoIterator<Item = u64>, samples: impl IntoIterator<Item = Sample>) -> Vec<Run> {
    let run = |(seed, sample): (u64, Sample)| Run {
        seed,
        outcome: match sample.failure {
            Some(why) => Err(why),
            None => Ok(Followed::of(&sample)),
        },
    };
    seeds.into_iter().zip(samples).map(run).collect()
}

/// Checks that every case has at least one run that did not fail.
pub fn check_cases(cases: &[Case]) -> Result<(), Error> {
    for case in cases {
        if let (true, Some(Run { seed, outcome: Err(why) })) =
            (case.runs.iter().all(|run| run.outcome.is_err()), case.runs.first())
        {
            return Err(Error::NoRun { case: case.name.clone(), seed: *seed, why: why.clone() });
        }
    }
    Ok(())
}

/// Writes all files into `folder` and returns the table for the terminal. Rank 0 only.
///
/// The figures and the table show the measures `wanted`, or the usual ones if it is empty.
pub fn write(folder: &Path, cases: &[Case], wanted: &[MeasureId]) -> Result<String, Error> {
    let chosen: Vec<usize> = (0..MEASURES.len())
        .filter(|&k| match wanted.is_empty() {
            true => MEASURES[k].usual,
            false => wanted.contains(&MeasureId(k)),
        })
        .collect();
    let summary = summary::Summary::of(cases);
    let mut written = files::write(folder, cases, &summary)?;
    written.extend(figures::draw(folder, &folder_title(folder), cases, &summary, &chosen)?);
    let table = files::table(cases, &summary, &chosen);
    Ok(format!("{table}\nfiles in {}: {}\n", folder.display(), written.join(", ")))
}

/// The heading of the figures.
fn folder_title(folder: &Path) -> String {
    folder.file_name().map_or("ensemble".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_without_any_sound_run_is_a_failure() {
        let failed = Run { seed: 4, outcome: Err("nan".to_owned()) };
        let sound_run = Run { seed: 5, outcome: Ok(Followed::default()) };
        let case = |runs: Vec<Run>| Case { name: "a".into(), scene: String::new(), runs };
        assert_eq!(check_cases(&[case(vec![failed.clone(), sound_run])]), Ok(()));
        let why = check_cases(&[case(vec![failed])]).unwrap_err();
        assert_eq!(why.exit_code(), 3);
        assert!(why.to_string().contains("no run of a") && why.to_string().contains("seed 4: nan"), "{why}");
    }
}
