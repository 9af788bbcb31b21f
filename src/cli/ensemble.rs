//! The command line of `demhybrid ensemble`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, RangedU64ValueParser};

use super::RegionArgs;
use crate::accuracy::sweep::split;
use crate::ensemble::measures::MEASURES;

/// Most seeds of an ensemble.
const MOST_SEEDS: usize = 100_000;

/// Run scenes from many starts, and show means, ranges and 95 % intervals of the beds
///
/// Every scene, with every value of the varied keys, is a case; every case runs once for every seed of
/// particles.grid.seed. Measures are those of analyze, at the end of the runs and over time. The folder gets runs.csv (every
/// run), summary.csv and summary.json (means, ranges, standard deviations, 95 % intervals of the means by Student's t, and
/// differences to the first case on the same seeds), evolution.csv, ranges.svg and evolution.svg. The table goes to stdout.
///
/// Every run takes one core. Runs are shared out over ranks (mpirun) and threads; no number depends on either.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct EnsembleArgs {
    /// Scene files, TOML in SI units; several are cases side by side
    #[arg(required_unless_present = "gather", value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,

    /// Seeds: N for 1 to N, a range such as 11-20, or a list such as 3,5,7-9
    #[arg(long, default_value = "10", value_name = "N|LIST")]
    pub seeds: Seeds,

    /// Values of a scene key, each a case; may be repeated for all combinations
    ///
    /// For example --vary friction.coefficient=0.1,0.2. Where there are several scenes, the name of one and a colon before
    /// the key let that scene alone vary: --vary settle:friction.coefficient=0.1,0.2.
    #[arg(long, value_name = "[SCENE:]KEY=V1,V2,..")]
    pub vary: Vec<Vary>,

    /// Set a key of all scenes, e.g. --set t_end=4; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Take runs that are there already, the output files of a job array for example, in place of running scenes
    ///
    /// Files whose scenes differ in nothing but seed, output.file, checkpoint and limits are one case. Runs that are not
    /// complete are named and left out.
    #[arg(long, value_name = "RUN", num_args = 1.., conflicts_with_all = ["scenes", "seeds", "vary", "set"])]
    pub gather: Vec<PathBuf>,

    /// Measures in the table and the figures [default: volume_fraction,paper_count_in_unit_cube,bed_height,
    /// mean_coordination,rattlers,largest_overlap_of_run]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', hide_possible_values = true)]
    #[arg(value_parser = PossibleValuesParser::new(MEASURES.iter().map(|measure| measure.name)))]
    pub measures: Vec<String>,

    /// Measure over time at this many times, about; 0: at the end only
    ///
    /// All particles at these times are held in memory until the run ends.
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub times: u64,

    #[command(flatten)]
    #[allow(missing_docs, reason = "its doc would take the place of the help of the command")]
    pub region: RegionArgs,

    /// Folder for tables and figures [default: name of the first scene, -ensemble, in the working folder]
    #[arg(short, long, alias = "out", value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Threads of each MPI rank, each with a run of its own [default: what the rank's cores allow]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,

    /// Write into a folder that is not empty
    #[arg(long)]
    pub force: bool,

    /// No progress, only warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Seeds in ascending order, none twice; at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds(pub Vec<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "it must be a number of seeds such as 10 (seeds 1 to 10), a range such as 11-20, or a list such as 3,5,7";
        let number = |word: &str| word.trim().parse::<u64>().map_err(|_| form.to_owned());
        let mut seeds = Vec::new();
        let parts: Vec<&str> = text.split(',').collect();
        for part in &parts {
            let (from, to) = match part.split_once('-') {
                Some((from, to)) => (number(from)?, number(to)?),
                None if parts.len() == 1 => (1, number(part)?),
                None => (number(part)?, number(part)?),
            };
            if from > to {
                return Err(match parts.len() {
                    1 if to == 0 => "there must be at least one seed".to_owned(),
                    _ => format!("the range {part} is empty: its first number must not be above its last"),
                });
            }
            // The scene is TOML, whose integers have 63 bits.
            if i64::try_from(to).is_err() {
                return Err(format!("{to} is too large: seeds go up to {}", i64::MAX));
            }
            if to - from >= MOST_SEEDS as u64 || seeds.len() >= MOST_SEEDS {
                return Err(format!("more than {MOST_SEEDS} seeds"));
            }
            seeds.extend(from..=to);
        }
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        match seeds.len() == count {
            true => Ok(Seeds(seeds)),
            false => Err("a seed is named twice".to_owned()),
        }
    }
}

/// A scene key and the values it takes, in all scenes or in one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vary {
    /// The scene that varies, by path or name; none: all.
    pub scene: Option<String>,
    /// Dotted path of the key.
    pub key: String,
    /// Values in TOML; at least one.
    pub values: Vec<String>,
}

impl FromStr for Vary {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "it must be KEY=V1,V2,.. such as friction.coefficient=0.1,0.2, or SCENE:KEY=V1,V2,..";
        let (head, list) = text.split_once('=').ok_or(form)?;
        let (scene, key) = match head.rsplit_once(':') {
            Some((scene, key)) => (Some(scene.trim().to_owned()), key),
            None => (None, head),
        };
        let (key, values) = (key.trim().to_owned(), split(list));
        if key.is_empty() || values.iter().any(String::is_empty) || scene.as_deref() == Some("") {
            return Err(form.into());
        }
        if key == "particles.grid.seed" {
            return Err("particles.grid.seed is what --seeds is for".into());
        }
        if key == "output" || key.starts_with("output.") {
            return Err(format!("{key} is no part of the model: the files of an ensemble go to --output"));
        }
        Ok(Vary { scene, key, values })
    }
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid ensemble configs/bed.toml --seeds 10
  demhybrid ensemble configs/bed.toml --seeds 10 --vary friction.coefficient=0.05,0.1,0.2 --vary contact.restitution=0.4,0.8
  mpirun -n 4 demhybrid ensemble configs/bed.toml --seeds 11-50 --threads 1
  demhybrid ensemble --gather bed-*.vtkhdf

Figure 4.3 of the paper, three variants of the model side by side, one of them with two coefficients:
  demhybrid ensemble configs/settle-basic.toml configs/settle-friction.toml configs/settle.toml \\
      --vary settle:friction.coefficient=0.1,0.2 --measures paper_count_in_unit_cube -o fig-4-3

Measures: volume_fraction, porosity, overlap_fraction (of the region, see --box), paper_count_in_unit_cube,
volume_fraction_in_unit_cube, mean_coordination, mean_coordination_without_rattlers, rattlers, contacts, wall_contacts,
mean_overlap, largest_overlap, mean_force, largest_force, bed_height, kinetic_energy, potential_energy (at the end),
largest_overlap_of_run, end_time, steps_accepted, steps_rejected, rhs_evaluations, pair_evaluations.

Nothing is written of a single run: [checkpoint] and [limits] of a scene mean nothing here. Runs too large for one core
belong into a job array, and its files to --gather.

A run that fails is reported and left out of the means; the command fails, with code 3, only if all runs of a case do.";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_seeds_counts_from_one_and_lists_are_taken_as_they_are() {
        let seeds = |text: &str| text.parse::<Seeds>().map(|seeds| seeds.0);
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("7-7"), Ok(vec![7]));
        assert_eq!(seeds("3, 5,0"), Ok(vec![0, 3, 5]));
        assert_eq!(seeds("9,11-13"), Ok(vec![9, 11, 12, 13]));
        for (text, part) in [
            ("", "must be a number"),
            ("0", "at least one"),
            ("x", "must be a number"),
            ("5-3", "empty"),
            ("1,2,2", "twice"),
            ("1,2,,3", "must be a number"),
            ("-3", "must be a number"),
            ("99999999", "more than"),
            ("18446744073709551615-18446744073709551615", "too large"),
        ] {
            let why = seeds(text).unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }

    #[test]
    fn a_key_varies_in_all_scenes_or_in_one() {
        let vary: Vary = "friction.coefficient=0.1, 0.2".parse().unwrap();
        assert_eq!((vary.scene, vary.key.as_str()), (None, "friction.coefficient"));
        assert_eq!(vary.values, ["0.1", "0.2"]);
        let vary: Vary = "settle:gravity=[0,0,-1],[0,0,-2]".parse().unwrap();
        assert_eq!((vary.scene.as_deref(), vary.values.len()), (Some("settle"), 2));
        for (text, part) in [
            ("contact", "KEY=V1"),
            ("=1", "KEY=V1"),
            (":contact.restitution=1", "KEY=V1"),
            ("contact.restitution=1,,2", "KEY=V1"),
            ("particles.grid.seed=1,2", "--seeds"),
            ("output.file=a,b", "--output"),
        ] {
            let why = text.parse::<Vary>().unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }
}
