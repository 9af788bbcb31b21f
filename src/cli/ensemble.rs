//! `demhybrid ensemble`: runs scenes from many initial states, or gathers finished runs, and compares them.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser};

use super::RegionArgs;
use crate::beds::folder::{prepare_together, stem};
use crate::domain::agreement::write_on_rank_0;
use crate::domain::{Comm, launch, stdout};
use crate::error::Error;
use crate::studies::ensemble::{self, Case, MEASURES, MeasureId, Plan, Request, Seeds, Vary, gather};
use crate::studies::job_pool::JobPool;

/// Run scenes from many initial states, and show means, ranges and 95 % intervals of the beds
///
/// A case is a scene with one value of every varied key. Every case runs once for every seed of its start,
/// such as particles.grid.seed. The measures are those of analyze, at the end of the runs and over time.
///
/// The folder gets runs.csv (every run), summary.csv and summary.json, evolution.csv, ranges.svg and
/// evolution.svg. The table goes to stdout.
///
/// The summary has means, ranges, standard deviations, 95 % intervals of the means by Student's t, and
/// differences to the first case on the same seeds.
///
/// Every run takes one core. Runs are shared out over ranks (mpirun) and threads, which change no number.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct EnsembleArgs {
    /// Scene files, TOML in SI units; several scenes are compared as cases
    #[arg(required_unless_present = "gather", value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,

    /// Seeds: N for 1 to N, a range such as 11-20, or a list such as 3,5,7-9
    #[arg(long, default_value = "10", value_name = "N|LIST")]
    pub seeds: Seeds,

    /// Values of a scene key, each a case; may be repeated for all combinations
    ///
    /// For example --vary friction.coefficient=0.1,0.2. If there are several scenes, the name of one of them
    /// and a colon before the key vary that scene alone: --vary settle:friction.coefficient=0.1,0.2.
    #[arg(long, value_name = "[SCENE:]KEY=V1,V2,..")]
    pub vary: Vec<Vary>,

    /// Set a key of all scenes, e.g. --set t_end=4; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Read finished runs instead of running scenes, for example the output files of a job array
    ///
    /// Files are one case if their scenes differ only in seed, output.file, checkpoint and limits. Runs that
    /// are not complete are named and left out.
    #[arg(long, value_name = "RUN", num_args = 1.., conflicts_with_all = ["scenes", "seeds", "vary", "set"])]
    pub gather: Vec<PathBuf>,

    /// Measures in the table and the figures [default: volume_fraction,paper_count_in_unit_cube,bed_height,
    /// mean_coordination,rattlers,largest_overlap_of_run]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', hide_possible_values = true)]
    #[arg(value_parser = measure_parser())]
    pub measures: Vec<MeasureId>,

    /// Measure at about this many times during a run; 0: at the end only
    ///
    /// All particles at these times are held in memory until the run ends.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub times: u64,

    #[command(flatten)]
    #[allow(missing_docs, reason = "its doc would take the place of the help of the command")]
    pub region: RegionArgs,

    /// Folder for tables and figures [default: NAME-ensemble for the first scene, in the working folder]
    #[arg(short, long, alias = "out", value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Threads of each MPI rank, each with a run of its own [default: as many as the rank's cores allow]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,

    /// Write into a folder that is not empty
    #[arg(long)]
    pub force: bool,

    /// Show no progress, only warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

fn measure_parser() -> impl TypedValueParser<Value = MeasureId> {
    PossibleValuesParser::new(MEASURES.iter().map(|measure| measure.name))
        .map(|name| MeasureId::of_name(&name).expect("no other name passes"))
}

impl EnsembleArgs {
    fn request(&self) -> Request {
        Request {
            scenes: self.scenes.clone(),
            seeds: self.seeds.clone(),
            vary: self.vary.clone(),
            set: self.set.clone(),
        }
    }

    /// Folder for the tables and figures.
    fn folder(&self) -> PathBuf {
        let first = self.gather.first().map(|run| gather::family(run));
        let name = || first.or_else(|| self.scenes.first().map(|scene| stem(scene))).unwrap_or_default();
        self.output.clone().unwrap_or_else(|| format!("{}-ensemble", name()).into())
    }
}

/// Runs or gathers what the command line asks for, writes the folder and prints a table. Collective.
pub fn run(args: &EnsembleArgs, comm: &dyn Comm) -> Result<(), Error> {
    let pool = JobPool::start(comm, args.threads, args.quiet)?;
    let plan = Plan { times: args.times, region: args.region.region() };
    let folder = args.folder();
    let make_folder = || prepare_together(comm, &folder, args.force);
    let _lock;
    let cases = match args.gather.first() {
        None => {
            let cases = ensemble::load(&args.request(), comm)?;
            _lock = make_folder()?;
            ensemble::run(&pool, &cases, &args.seeds.0, &plan)
        }
        Some(_) => {
            let found = gather::find(&args.gather, comm)?;
            _lock = make_folder()?;
            gather::measure(&pool, &found, &plan)
        }
    };
    warn(&cases, comm);
    write_on_rank_0(comm, || {
        let kept = format!("; the files in {} are complete", folder.display());
        stdout::print(&ensemble::write(&folder, &cases, &args.measures)?, &kept)
    })?;
    ensemble::check_cases(&cases)
}

/// Warns of every run without a result. Rank 0 alone prints.
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

const AFTER_HELP: &str = "\
Examples:
  demhybrid ensemble configs/bed.toml --seeds 10
  demhybrid ensemble configs/bed.toml --seeds 10 --vary friction.coefficient=0.1,0.2,0.345 \
    --vary contact.restitution=0.4,0.8
  mpirun -n 4 demhybrid ensemble configs/bed.toml --seeds 11-50 --threads 1
  demhybrid ensemble --gather bed-*.vtkhdf

Figure 4.3 of the paper, three variants of the model side by side, one of them with two coefficients:
  demhybrid ensemble configs/paper/*.toml --vary settle:friction.coefficient=0.1,0.2 \\
      --measures paper_count_in_unit_cube -o fig-4-3

Measures: volume_fraction, porosity, overlap_fraction (of the region, see --box), paper_count_in_unit_cube,
volume_fraction_in_unit_cube, mean_coordination, mean_coordination_without_rattlers, rattlers, contacts, \
wall_contacts,
mean_force, largest_force, contact_threshold, overlap_coordination, overlaps, wall_overlaps, mean_overlap,
largest_overlap, bed_height, kinetic_energy, potential_energy (at the end), \
largest_overlap_of_run, end_time, steps_accepted, steps_rejected, rhs_evaluations, pair_evaluations.

Nothing is written of a single run: [checkpoint] and [limits] of a scene mean nothing here. \
Runs too large for one core
belong into a job array, and its files to --gather.

A run that fails is reported and left out of the means; the command fails, with code 3, \
only if all runs of a case do.";

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
        let named = |line: &str| args(line).folder().display().to_string();
        assert_eq!(named("demhybrid ensemble a/bed.toml b.toml"), "bed-ensemble");
        assert_eq!(named("demhybrid ensemble --gather x/bed-1.vtkhdf x/bed-2.vtkhdf"), "bed-ensemble");
        assert_eq!(named("demhybrid ensemble bed.toml --out there"), "there");
    }
}
