//! `demhybrid accuracy SCENE`: compares what accuracy costs with different solvers, and recommends one.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser};

use super::numbers::positive;
use crate::beds::folder::{prepare_together, stem};
use crate::domain::agreement::write_on_rank_0;
use crate::domain::{Comm, stdout};
use crate::error::Error;
use crate::ode::MethodName;
use crate::studies::accuracy::{Comparison, METHODS, Request, Study, Sweep};
use crate::studies::job_pool::JobPool;

/// Find out how accurately a scene is computed, and what more accuracy would cost
///
/// Runs the scene with several methods and tolerances. Compares these runs with exact answers and with a far
/// more accurate run of its own.
///
/// Writes tables (runs.csv, accuracy.json) and figures (SVG) to a folder. The table, remarks on it and a
/// recommendation go to stdout.
///
/// Study "impact": one sphere hits a floor. Errors of the time to the next highest point and of the
/// restitution, against their exact values.
///
/// Study "state": all spheres at one time, against the reference. After some time trajectories part for ever,
/// whatever the solver. That time is found and printed, and states are compared before it.
///
/// Study "energy": drift of the energy if nothing dissipates it, else energy that is not accounted for.
///
/// Study "ensemble": volume fraction, bed height, coordination number and largest overlap over several
/// initial states, with 95 % intervals.
///
/// Every run takes one core. Runs are shared out over ranks (mpirun) and threads. Only the core seconds
/// depend on their numbers.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(after_help = AFTER_HELP)]
pub struct AccuracyArgs {
    /// Scene file, TOML in SI units
    pub scene: PathBuf,

    /// Folder for tables and figures [default: NAME-accuracy for NAME.toml, in the working folder]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Methods to compare [default: all; in ensembles auto and chebyshev]
    #[arg(long, value_name = "METHODS", value_delimiter = ',', value_parser = method_parser())]
    pub methods: Vec<MethodName>,

    /// Tolerances of the methods with error control [default: 1e-1 to 1e-8, of chebyshev to 1e-6, in
    /// ensembles to 1e-4]
    #[arg(
        long,
        value_name = "NUMBERS",
        value_delimiter = ',',
        value_parser = positive,
        allow_negative_numbers = true
    )]
    pub tolerances: Vec<f64>,

    /// Steps of velocity-verlet in s [default: 1e-2, 3e-3, 1e-3, 3e-4 and 1e-4 of T]
    ///
    /// T = 1/sqrt(kappa g) is the time in which a sphere at rest on a floor swings by one radian. Here kappa
    /// is the stiffness exponent and g the gravity. Without gravity T = 1/(kappa V), the time of an impact at
    /// the scene's velocity scale V.
    #[arg(
        long,
        value_name = "NUMBERS",
        value_delimiter = ',',
        value_parser = positive,
        allow_negative_numbers = true
    )]
    pub steps: Vec<f64>,

    /// Initial states of a scene with a seed, such as particles.grid.seed: seeds 1 to N
    #[arg(
        long,
        value_name = "N",
        default_value = "5",
        allow_negative_numbers = true,
        value_parser = RangedU64ValueParser::<u64>::new().range(1..=1000)
    )]
    pub seeds: u64,

    /// Time at which states are compared, s [default: the last one before trajectories part]
    #[arg(long, value_name = "T", value_parser = positive, allow_negative_numbers = true)]
    pub time: Option<f64>,

    /// End of the runs of the ensemble, s [default: t_end of the scene]
    #[arg(long, value_name = "T", value_parser = positive, allow_negative_numbers = true)]
    pub until: Option<f64>,

    /// Error of the model: repeat impact and ensemble for these values of a scene key
    ///
    /// For example --sweep contact.stiffness_exponent=30,150,500. One accurate solver computes all values, so
    /// that differences come from the model alone. They have a figure and a table of their own.
    #[arg(long, value_name = "KEY=V1,V2,..")]
    pub sweep: Option<Sweep>,

    /// Compare with the published solver too: merson, norm = "paper", tolerance 0.1
    #[arg(long)]
    pub paper: bool,

    /// Studies to make [default: all that the scene allows]
    #[arg(long, value_name = "STUDIES", value_delimiter = ',', value_parser = study_parser())]
    pub studies: Vec<Study>,

    /// Threads of each MPI rank, each with a run of its own [default: as many as the rank's cores allow]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,

    /// Set a key of the scene, e.g. --set contact.restitution=1; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Write into a folder that is not empty
    #[arg(long)]
    pub force: bool,

    /// Show no progress, only errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl AccuracyArgs {
    fn request(&self) -> Request {
        Request {
            scene: self.scene.clone(),
            set: self.set.clone(),
            methods: self.methods.clone(),
            tolerances: self.tolerances.clone(),
            steps: self.steps.clone(),
            seeds: self.seeds,
            time: self.time,
            until: self.until,
            sweep: self.sweep.clone(),
            paper: self.paper,
            studies: self.studies.clone(),
        }
    }

    /// Folder for the tables and figures.
    fn folder(&self) -> PathBuf {
        self.output.clone().unwrap_or_else(|| format!("{}-accuracy", stem(&self.scene)).into())
    }
}

/// Runs the comparison that the command line asks for. Collective.
pub fn run(args: &AccuracyArgs, comm: &dyn Comm) -> Result<(), Error> {
    let pool = JobPool::start(comm, args.threads, args.quiet)?;
    let request = args.request();
    let comparison = Comparison::load(&request, &pool)?;
    let folder = args.folder();
    let _lock = prepare_together(comm, &folder, args.force)?;
    comparison.announce();
    let found = comparison.found();
    write_on_rank_0(comm, || {
        let kept = format!("; the files in {} are complete", folder.display());
        stdout::print(&comparison.write(&folder, &found)?, &kept)
    })
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid accuracy configs/quick.toml
  demhybrid accuracy configs/bounce.toml --studies impact --sweep contact.stiffness_exponent=30,150,500
  mpirun -n 4 demhybrid accuracy configs/settle.toml --threads 1 --studies ensemble --seeds 10 --until 2 --paper

A run that fails, or takes more right-hand sides than a run may, is shown as failed; it ends nothing.";

fn study_parser() -> impl clap::builder::TypedValueParser<Value = Study> {
    let find = |name: String| Study::ALL.into_iter().find(|study| study.name() == name);
    PossibleValuesParser::new(Study::ALL.map(Study::name))
        .try_map(move |name| find(name).ok_or("it must be the name of a study"))
}

fn method_parser() -> impl TypedValueParser<Value = MethodName> {
    PossibleValuesParser::new(METHODS.map(MethodName::name)).try_map(|name| name.parse::<MethodName>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{CommandLine, Work};
    use clap::Parser;

    #[test]
    fn the_folder_is_named_after_the_scene() {
        let folder = |more: &str| {
            let line = format!("demhybrid accuracy a/eight.toml {more}");
            match CommandLine::try_parse_from(line.split_whitespace()).unwrap().work() {
                Work::Accuracy(args) => args.folder(),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(folder(""), PathBuf::from("eight-accuracy"));
        assert_eq!(folder("-o other"), PathBuf::from("other"));
    }
}
