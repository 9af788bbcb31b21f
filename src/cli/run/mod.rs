//! `demhybrid SCENE` and `demhybrid --resume FILE`: reads and checks the scene, runs it, and reports.

use crate::cli::report;
use crate::domain::Comm;
use crate::domain::agreement::{agree, share, write_on_rank_0};
use crate::domain::launch::{self, Threads};
use crate::domain::stdout;
use crate::engine::dynamics::common_instructions;
use crate::error::Error;
use crate::files::load::load;
use crate::files::output::{Claim, Output};
use crate::math::instructions::InstructionSet;
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::threads;
use clap::builder::RangedU64ValueParser;
use execute::{Beginning, Execution};
use std::path::{Path, PathBuf};
use std::time::Instant;

mod execute;
mod interrupts;
mod resume;

/// A run of a scene.
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
pub struct Args {
    /// Scene file, TOML in SI units
    #[arg(required_unless_present = "resume")]
    pub scene: Option<PathBuf>,

    /// Go on with the run that wrote FILE, from its last checkpoint, on any number of ranks and threads
    ///
    /// Scene and particles come from FILE and from FILE.ckpt-a and FILE.ckpt-b beside it. With --set, t_end
    /// may be larger, and checkpoint.* and limits.* may change.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "output", "dry_run", "force"])]
    pub resume: Option<PathBuf>,

    /// Output file, instead of output.file of the scene
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// Threads of each MPI rank [default: as many as the rank's cores and RAYON_NUM_THREADS allow]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub threads: Option<usize>,

    /// Set a key of the scene, e.g. --set solver.tolerance=1e-3; may be repeated
    ///
    /// VALUE is TOML; text that is not TOML is taken as a string. Missing tables are created.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Check the scene, print what would run, and exit
    #[arg(long)]
    pub dry_run: bool,

    /// Replace an existing output file, unless another run is writing it
    #[arg(long)]
    pub force: bool,

    /// Show no progress, only warnings and errors
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,

    /// Show more about the progress of the run
    #[arg(short, long)]
    pub verbose: bool,
}

/// Does the run that the command line `args` asks for, on all ranks of `comm`. Collective.
pub fn run(args: &Args, comm: &dyn Comm) -> Result<(), Error> {
    let started = Instant::now();
    launch::check_launcher(comm.size())?;
    let Threads { count: threads, have_cores, warning } =
        agree(comm, launch::start_threads(comm, args.threads))?;
    let set = agree(comm, InstructionSet::chosen().map_err(Error::Input))?;
    let [set, widest] = common_instructions(comm, set);
    let mixed = launch::mixed_machines_warning(set, widest);
    let ground = Ground { args, comm, threads, set, started };
    let tell = |warnings: &[String]| {
        if comm.rank() == 0 {
            warning.iter().chain(&mixed).chain(warnings).for_each(|warning| launch::say(warning));
        }
    };
    let run = || match (&args.scene, &args.resume) {
        (Some(scene), _) => begin(&ground, scene, &tell),
        (None, Some(file)) => {
            tell(&[]);
            resume::run(&ground, file)
        }
        // Not reached: the command line demands one of the two.
        (None, None) => Err(Error::Input("a scene, or --resume FILE, is missing".into())),
    };
    if have_cores { threads::with_spinning_threads(run) } else { run() }
}

/// What a new run and a resumed run have in common.
struct Ground<'a> {
    args: &'a Args,
    comm: &'a dyn Comm,
    threads: usize,
    set: InstructionSet,
    started: Instant,
}

/// Runs the scene `path`, or prints its plan if this is a dry run; `tell` prints warnings. Collective.
fn begin(ground: &Ground, path: &Path, tell: &dyn Fn(&[String])) -> Result<(), Error> {
    let Ground { args, comm, threads, .. } = *ground;
    let (scene, start) = load_for_output(args, path, comm)?;
    let file = scene.output.file.clone().unwrap_or_default();
    share(comm, || spare_the_input(path, &scene, &file))?;
    let count = start.x.len() as u64;
    let room = report::output_bytes(&scene, count).saturating_add(report::checkpoint_bytes(&scene, count));
    let warnings = || if comm.rank() == 0 { report::forewarnings(&scene, &start) } else { Vec::new() };
    if args.dry_run {
        let target = Output::check_path(comm, &file, args.force, room);
        tell(&warnings());
        let output = match &target {
            Ok(_) => file.display().to_string(),
            Err(why) => format!("would be refused: {why}"),
        };
        let plan = report::plan(comm, path, &scene, &start, threads, &output);
        return write_on_rank_0(comm, || stdout::print(&plan, ""));
    }
    let claim = Claim::stake(comm, &file, args.force, room);
    tell(&warnings());
    let claim = &claim?;
    let beginning = Beginning::Start;
    Execution { ground, name: path, file: &file, claim, scene: &scene, start: &start, beginning }.run()
}

/// Reads the scene `path` and its particles, and puts in the output file of the command line. Collective.
fn load_for_output(args: &Args, path: &Path, comm: &dyn Comm) -> Result<(Scene, InitialCondition), Error> {
    let (mut scene, start) = load(path, &args.set, comm)?;
    if let Some(file) = &args.output {
        if file.to_str().is_none() {
            return Err(Error::Input(format!("--output {}: the name is not UTF-8 text", file.display())));
        }
        scene.output.file = Some(file.clone());
    }
    Ok((scene, start))
}

/// Refuses an output file that would overwrite the scene, its particles or a sieve curve.
fn spare_the_input(path: &Path, scene: &Scene, output: &Path) -> Result<String, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let particles = scene.particles.read_from().map(|file| folder.join(file));
    let same =
        |input: &Path| matches!((input.canonicalize(), output.canonicalize()), (Ok(a), Ok(b)) if a == b);
    let tables = scene.species.iter().filter_map(|species| Some(folder.join(species.table()?)));
    let inputs = [(Some(path.to_path_buf()), "the scene"), (particles, scene.particles.source())].into_iter();
    for (input, what) in inputs.chain(tables.map(|table| (Some(table), "the sieve curve of a species"))) {
        if input.is_some_and(|input| same(&input)) {
            let file = output.display();
            return Err(Error::Input(format!(
                "output.file = \"{file}\" is {what} itself; choose another name"
            )));
        }
    }
    Ok(String::new())
}
