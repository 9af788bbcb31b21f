//! Many starts of one scene, and scenes side by side: `demhybrid ensemble` runs them or gathers runs that are there, and
//! shows how far the beds agree.

mod cases;
mod figures;
mod files;
mod gather;
pub mod measures;
mod summary;
#[cfg(test)]
mod testing;

use crate::accuracy::command::prepare;
use crate::agreement::share;
use crate::cli::EnsembleArgs;
use crate::domain::Comm;
use crate::error::Error;
use crate::farm::{Farm, Sample};
use crate::launch;
use measures::{Followed, MEASURES, Plan};
use std::path::{Path, PathBuf};

/// One run of a case, done or left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its seed.
    pub seed: u64,
    /// What it gave, or why it gave nothing.
    pub outcome: Result<Followed, String>,
}

/// All runs of one scene, by ascending seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// What tells it from the others, in a few words.
    pub name: String,
    /// Its scene as resolved, in TOML, whose seed means nothing.
    pub scene: String,
    /// Its runs.
    pub runs: Vec<Run>,
}

/// Runs or gathers what the command line asks for, writes the folder and prints a table. Collective.
pub fn run(args: &EnsembleArgs, comm: &dyn Comm) -> Result<(), Error> {
    let farm = Farm::start(comm, args.threads, args.quiet)?;
    let plan = Plan { times: args.times, region: args.region.clone() };
    let cases = match args.gather.first() {
        None => {
            let cases = cases::load(args, comm)?;
            share(comm, || prepare(&folder(args), args.force).map(|()| String::new()))?;
            cases::run(&farm, &cases, &args.seeds.0, &plan)
        }
        Some(_) => {
            let found = gather::find(&args.gather, comm)?;
            share(comm, || prepare(&folder(args), args.force).map(|()| String::new()))?;
            gather::measure(&farm, &found, &plan)
        }
    };
    warn(&cases, comm);
    let mut written = Ok(());
    let outcome = share(comm, || {
        written = write(args, &cases);
        Ok(if written.is_err() { "failed".to_owned() } else { String::new() })
    })?;
    match (outcome.is_empty(), written) {
        (true, _) => sound(&cases),
        (false, Err(why)) => Err(why),
        // Rank 0 says why.
        (false, Ok(())) => Err(Error::Elsewhere { code: 4 }),
    }
}

/// The folder of the files.
fn folder(args: &EnsembleArgs) -> PathBuf {
    let first = args.gather.first().map(|run| gather::family(run));
    let name = || first.or_else(|| args.scenes.first().map(|scene| stem(scene))).unwrap_or_default();
    args.output.clone().unwrap_or_else(|| format!("{}-ensemble", name()).into())
}

/// Name of a file without folder and extension.
fn stem(file: &Path) -> String {
    file.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned())
}

/// The runs of a case out of their samples.
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

/// Tells about runs without a result. Rank 0 only speaks.
fn warn(cases: &[Case], comm: &dyn Comm) {
    if comm.rank() > 0 {
        return;
    }
    for case in cases {
        for run in &case.runs {
            if let Err(why) = &run.outcome {
                launch::say(&format!(
                    "demhybrid: warning: {}, seed {}, is left out: {why}",
                    case.name, run.seed
                ));
            }
        }
    }
}

/// Whether every case has a run that counts.
fn sound(cases: &[Case]) -> Result<(), Error> {
    for case in cases {
        if let (true, Some(Run { seed, outcome: Err(why) })) =
            (case.runs.iter().all(|run| run.outcome.is_err()), case.runs.first())
        {
            return Err(Error::NoRun { case: case.name.clone(), seed: *seed, why: why.clone() });
        }
    }
    Ok(())
}

/// Writes all files and prints the table. On rank 0.
fn write(args: &EnsembleArgs, cases: &[Case]) -> Result<(), Error> {
    let folder = folder(args);
    let chosen: Vec<usize> = (0..MEASURES.len())
        .filter(|&k| match args.measures.is_empty() {
            true => MEASURES[k].usual,
            false => args.measures.iter().any(|name| *name == MEASURES[k].name),
        })
        .collect();
    let summary = summary::Summary::of(cases);
    let mut written = files::write(&folder, cases, &summary)?;
    written.extend(figures::draw(&folder, &folder_title(&folder), cases, &summary, &chosen)?);
    launch::print(&files::table(cases, &summary, &chosen));
    launch::print(&format!("\nfiles in {}: {}\n", folder.display(), written.join(", ")));
    Ok(())
}

/// The heading of the figures.
fn folder_title(folder: &Path) -> String {
    folder.file_name().map_or("ensemble".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{CommandLine, Work};
    use clap::Parser;

    fn args(line: &str) -> EnsembleArgs {
        match CommandLine::try_parse_from(line.split_whitespace()).unwrap().work() {
            Work::Ensemble(args) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_folder_is_named_after_the_first_scene_or_the_family_of_runs() {
        let named = |line: &str| folder(&args(line)).display().to_string();
        assert_eq!(named("demhybrid ensemble a/bed.toml b.toml"), "bed-ensemble");
        assert_eq!(named("demhybrid ensemble --gather x/bed-1.vtkhdf x/bed-2.vtkhdf"), "bed-ensemble");
        assert_eq!(named("demhybrid ensemble bed.toml --out there"), "there");
    }

    #[test]
    fn a_case_without_any_sound_run_is_a_failure() {
        let failed = Run { seed: 4, outcome: Err("nan".to_owned()) };
        let sound_run = Run { seed: 5, outcome: Ok(Followed::default()) };
        let case = |runs: Vec<Run>| Case { name: "a".into(), scene: String::new(), runs };
        assert_eq!(sound(&[case(vec![failed.clone(), sound_run])]), Ok(()));
        let why = sound(&[case(vec![failed])]).unwrap_err();
        assert_eq!(why.exit_code(), 3);
        assert!(why.to_string().contains("no run of a") && why.to_string().contains("seed 4: nan"), "{why}");
    }
}
