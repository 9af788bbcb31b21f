//! From the command line to the exit code: reads and checks the scene, runs it, tells about it.

use crate::agreement::{agree, share};
use crate::cli::Args;
use crate::domain::Comm;
use crate::dynamics::common_instructions;
use crate::error::Error;
use crate::instructions::InstructionSet;
use crate::launch::{self, Threads};
use crate::output::{self, Output};
use crate::parallel;
use crate::report;
use crate::scene::Scene;
use crate::simulation;
use crate::start::{self, Start};
use execute::{Beginning, Execution};
use std::path::Path;
use std::time::Instant;

mod execute;
mod resume;

/// Runs the command line `args` on all ranks of `comm` and returns when it is done. Collective.
pub fn run(args: &Args, comm: &dyn Comm) -> Result<(), Error> {
    let started = Instant::now();
    launch::check_launcher(comm.size())?;
    let Threads { count: threads, have_cores, warning } =
        agree(comm, launch::start_threads(comm, args.threads))?;
    let set = agree(comm, InstructionSet::chosen())?;
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
        // The command line has been read: one of the two is there.
        (None, None) => Err(Error::Input("a scene, or --resume FILE, is missing".into())),
    };
    if have_cores { parallel::attended(run) } else { run() }
}

/// What every run stands on.
struct Ground<'a> {
    args: &'a Args,
    comm: &'a dyn Comm,
    threads: usize,
    set: InstructionSet,
    started: Instant,
}

/// Runs the scene `path`, or tells what it would do; `tell` brings warnings to the user. Collective.
fn begin(ground: &Ground, path: &Path, tell: &dyn Fn(&[String])) -> Result<(), Error> {
    let Ground { args, comm, threads, .. } = *ground;
    let (scene, start) = load_for_output(args, path, comm)?;
    let file = scene.output.file.clone().unwrap_or_default();
    share(comm, || spare_the_input(path, &scene, &file))?;
    let count = start.x.len() as u64;
    let room = report::output_bytes(&scene, count).saturating_add(report::checkpoint_bytes(&scene, count));
    let place = Output::check_place(comm, &file, args.force, room);
    tell(&if comm.rank() == 0 { report::forewarnings(&scene, &start) } else { Vec::new() });
    if args.dry_run {
        let output = match &place {
            Ok(_) => file.display().to_string(),
            Err(why) => format!("would be refused: {why}"),
        };
        let plan = report::plan(comm, path, &scene, &start, threads, &output);
        if comm.rank() == 0 {
            launch::print(&plan);
        }
        return Ok(());
    }
    let place = place?;
    let beginning = Beginning::Start;
    simulation::dispatch(
        &scene,
        Execution { ground, name: path, file: &file, place: &place, scene: &scene, start: &start, beginning },
    )
}

/// The scene `path` and its particles, with the output file of the command line. Collective.
fn load_for_output(args: &Args, path: &Path, comm: &dyn Comm) -> Result<(Scene, Start), Error> {
    let (mut scene, start) = load(path, &args.set, comm)?;
    if let Some(file) = &args.output {
        if file.to_str().is_none() {
            return Err(Error::Input(format!("--output {}: the name is not UTF-8 text", file.display())));
        }
        scene.output.file = Some(file.clone());
    }
    Ok((scene, start))
}

/// Reads the scene `path` and its particles on rank 0 and checks them, with the `--set` options `sets`, on every rank
/// alike. Collective.
pub(crate) fn load(path: &Path, sets: &[String], comm: &dyn Comm) -> Result<(Scene, Start), Error> {
    let text = share(comm, || {
        let unreadable = |why| Error::Input(format!("{}: the scene cannot be read: {why}", path.display()));
        start::read_bytes(path)
            .map_err(|why| unreadable(why.to_string()))
            .and_then(|bytes| String::from_utf8(bytes).map_err(|_| unreadable("it is not UTF-8 text".into())))
    })?;
    let name = path.to_string_lossy();
    let mut scene = Scene::parse(&name, &text, sets)?;
    // 63 bits: what a TOML integer holds, so that the recorded scene can be read again.
    let seed = share(comm, || Ok((rand::random::<u64>() >> 1).to_string()))?;
    scene.set_seed_if_missing(seed.parse().expect("it was printed as a number"));
    let start = match &scene.particles.grid {
        Some(grid) => {
            agree(comm, check_memory(comm, &scene, grid.count))?;
            start::grid(&scene, grid)
        }
        None => {
            let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
            let mut read = Ok(Start::default());
            share(comm, || {
                read = start::read_csv(&scene, &folder);
                read.as_ref().map(|_| String::new()).map_err(Clone::clone)
            })?;
            let start = share_start(comm, read?);
            agree(comm, check_memory(comm, &scene, start.x.len() as u64))?;
            start
        }
    };
    start::check(&scene, &start)?;
    Ok((scene, start))
}

/// The particles of rank 0 on every rank. Collective.
fn share_start(comm: &dyn Comm, own: Start) -> Start {
    let both = |list: Vec<[f64; 3]>| {
        let mut bytes: Vec<u8> = list.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        comm.broadcast(&mut bytes);
        let number = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("chunks have eight bytes"));
        bytes
            .chunks_exact(24)
            .map(|row| [number(&row[..8]), number(&row[8..16]), number(&row[16..])])
            .collect()
    };
    Start { x: both(own.x), v: both(own.v), omega: both(own.omega) }
}

/// Refuses an output that would overwrite what the run is made from.
fn spare_the_input(path: &Path, scene: &Scene, output: &Path) -> Result<String, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let particles = scene.particles.file.as_ref().map(|file| folder.join(file));
    let same =
        |input: &Path| matches!((input.canonicalize(), output.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for (input, what) in [(Some(path.to_path_buf()), "the scene"), (particles, "particles.file")] {
        if input.is_some_and(|input| same(&input)) {
            let file = output.display();
            return Err(Error::Input(format!(
                "output.file = \"{file}\" is {what} itself; choose another name"
            )));
        }
    }
    Ok(String::new())
}

/// Refuses a scene of `count` particles that this machine cannot hold. Collective.
fn check_memory(comm: &dyn Comm, scene: &Scene, count: u64) -> Result<(), Error> {
    // Every rank holds the start of all particles and the solver's part of its own.
    let here = comm.ranks_on_node() as u64;
    let own = count.div_ceil(comm.size() as u64).saturating_mul(report::bytes_per_particle(scene));
    let needed = count.saturating_mul(report::START_BYTES).saturating_add(own).saturating_mul(here);
    let there = launch::physical_memory();
    if there > 0 && needed > there {
        return Err(Error::Input(format!(
            "{count} particles need about {} on each machine, and this one has {}: fewer particles or more machines \
             would do",
            output::size(needed),
            output::size(there)
        )));
    }
    Ok(())
}
