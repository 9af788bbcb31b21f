//! From the command line to the exit code: reads and checks the scene, runs it, tells about it.

use crate::cli::Args;
use crate::contact::{Law, Rebound, Tangential};
use crate::domain::{Comm, rows};
use crate::error::Error;
use crate::launch;
use crate::output::{self, Measures, Output, Rows, RunInfo};
use crate::particle::{Motion, Spin};
use crate::report::{self, Last, Progress};
use crate::scene::Scene;
use crate::simulation::{self, Frame, Observer, Simulation, Task};
use crate::start::{self, Start};
use fail::fail_point;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command line `args` on all ranks of `comm` and returns when it is done. Collective.
pub fn run(args: &Args, comm: &dyn Comm) -> Result<(), Error> {
    launch::check_launcher(comm.size())?;
    let (threads, bound) = launch::start_threads(comm, args.threads)?;
    let (scene, start) = load(args, comm)?;
    check_memory(&scene, start.x.len() as u64)?;
    let file = scene.output.file.clone().unwrap_or_default();
    let room = report::output_bytes(&scene, start.x.len() as u64);
    let place = Output::check_place(comm, &file, args.force, room);
    let cut = report::cut_force_warning(&scene);
    if comm.rank() == 0 {
        bound.iter().chain(&cut).for_each(|warning| launch::say(warning));
    }
    if args.dry_run {
        let output = match &place {
            Ok(_) => file.display().to_string(),
            Err(why) => format!("{} will be refused: {why}", file.display()),
        };
        let plan = report::plan(comm, &args.scene, &scene, &start, threads, &output);
        if comm.rank() == 0 {
            launch::print(&plan);
        }
        return Ok(());
    }
    let place = place?;
    simulation::dispatch(&scene, Run { args, scene: &scene, start: &start, comm, threads, place: &place })
}

/// Reads the scene and its particles on rank 0 and checks them on every rank alike. Collective.
fn load(args: &Args, comm: &dyn Comm) -> Result<(Scene, Start), Error> {
    let text = share(comm, || {
        let unreadable =
            |why| Error::Input(format!("{}: the scene cannot be read: {why}", args.scene.display()));
        std::fs::read(&args.scene)
            .map_err(|why| unreadable(why.to_string()))
            .and_then(|bytes| String::from_utf8(bytes).map_err(|_| unreadable("it is not UTF-8 text".into())))
    })?;
    let name = args.scene.to_string_lossy();
    let mut scene = Scene::parse(&name, &text, &args.set)?;
    if let Some(file) = &args.output {
        if file.to_str().is_none() {
            return Err(Error::Input(format!("--output {}: the name is not UTF-8 text", file.display())));
        }
        scene.output.file = Some(file.clone());
    }
    // 63 bits: what a TOML integer holds, so that the recorded scene can be read again.
    let seed = share(comm, || Ok((rand::random::<u64>() >> 1).to_string()))?;
    scene.set_seed_if_missing(seed.parse().expect("it was printed as a number"));
    let start = match &scene.particles.grid {
        Some(grid) => start::grid(&scene, grid),
        None => {
            let folder = args.scene.parent().map(Path::to_path_buf).unwrap_or_default();
            let mut read = Ok(Start::default());
            share(comm, || {
                read = start::read_csv(&scene, &folder);
                read.as_ref().map(|_| String::new()).map_err(Clone::clone)
            })?;
            share_start(comm, read?)
        }
    };
    start::check(&scene, &start)?;
    Ok((scene, start))
}

/// What `make` gives on rank 0, text or mistake, on every rank. Collective.
fn share(comm: &dyn Comm, make: impl FnOnce() -> Result<String, Error>) -> Result<String, Error> {
    let mut bytes = Vec::new();
    if comm.rank() == 0 {
        let (flag, text) = match make() {
            Ok(text) => (0, text),
            Err(why) => (1, why.to_string()),
        };
        bytes.push(flag);
        bytes.extend_from_slice(text.as_bytes());
    }
    comm.broadcast(&mut bytes);
    let text = String::from_utf8_lossy(&bytes[1..]).into_owned();
    if bytes[0] == 0 { Ok(text) } else { Err(Error::Input(text)) }
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

/// Refuses a scene that this machine cannot hold.
fn check_memory(scene: &Scene, count: u64) -> Result<(), Error> {
    let (needed, there) =
        (count.saturating_mul(report::bytes_per_particle(scene)), launch::physical_memory());
    if there > 0 && needed > there {
        return Err(Error::Input(format!(
            "{count} particles need about {}, and this machine has {}: fewer particles or more machines would do",
            output::size(needed),
            output::size(there)
        )));
    }
    Ok(())
}

/// A run of a scene, once its effects are types.
struct Run<'a> {
    args: &'a Args,
    scene: &'a Scene,
    start: &'a Start,
    comm: &'a dyn Comm,
    threads: usize,
    place: &'a Path,
}

impl Task for Run<'_> {
    type Output = Result<(), Error>;

    fn with<R: Rebound, T: Tangential, W: Spin>(self, law: Law<R, T>) -> Result<(), Error> {
        let Run { args, scene, start, comm, threads, place } = self;
        let started = Instant::now();
        let simulation = Simulation::<R, T, W>::new(scene, start, law, comm)?;
        let count = start.x.len() as u64;
        let info = RunInfo {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: env!("DEMHYBRID_COMMIT").into(),
            scene: scene.resolved(),
            method: scene.solver.method.clone(),
            tolerance: scene.solver.tolerance,
            mass: scene.particles.mass,
            ranks: comm.size(),
            threads,
            instruction_set: INSTRUCTION_SET.into(),
        };
        let block = rows::block(count, comm.rank(), comm.size());
        let rotation = W::COMPONENTS > 0;
        let output = Output::create(comm, place, &info, count, scene.particles.radius, rotation, block)?;
        let progress = Progress::new(comm.rank(), scene.t_end, args.quiet, args.verbose);
        let mut recorder =
            Recorder { output, progress, started, measures: None, last: Last::default(), frames: 0 };
        recorder.last.count = count;
        let outcome = simulation.run(&mut recorder);
        recorder.progress.close();
        let outcome = outcome?;
        let file = scene.output.file.clone().unwrap_or_else(|| PathBuf::from(place));
        let transfer = recorder.output.transfer_report().to_string();
        let Recorder { output, measures, last, frames, .. } = recorder;
        if let Some(measures) = measures {
            output.finish(&Measures { wall_seconds: started.elapsed().as_secs_f64(), ..measures })?;
        }
        let written = format!("{}: {frames} frames, {transfer}", file.display());
        let text = report::summary(comm, &args.scene, scene, &outcome, &last, threads, &written);
        if comm.rank() == 0 {
            launch::print(&text);
            report::doubts(scene, &outcome).iter().for_each(|doubt| launch::say(doubt));
        }
        Ok(())
    }
}

/// The instruction set of the contact kernel.
const INSTRUCTION_SET: &str =
    if cfg!(target_arch = "x86_64") { "x86_64 sse2" } else { std::env::consts::ARCH };

/// Writes frames and tells about them.
struct Recorder<'a> {
    output: Output<'a>,
    progress: Progress,
    started: Instant,
    measures: Option<Measures>,
    last: Last,
    frames: u64,
}

impl<W: Spin> Observer<W> for Recorder<'_> {
    fn frame(&mut self, frame: &Frame<W>) -> Result<(), Error> {
        fail_point!("output");
        let column = |of: fn(&Motion<W>) -> [f64; 3]| frame.rows.iter().map(of).collect::<Vec<_>>();
        let position = column(|body| body.x.into());
        let velocity = column(|body| body.v.into());
        let spin = (W::COMPONENTS > 0).then(|| column(|body| body.omega.vector().into()));
        let rows = Rows {
            first: frame.first,
            position: &position,
            velocity: &velocity,
            angular_velocity: spin.as_deref(),
        };
        let counts = frame.counts;
        let measures = Measures {
            time: frame.time,
            step: frame.step,
            steps_accepted: counts.accepted,
            steps_rejected: counts.rejected,
            steps_outrun: counts.outrun,
            rhs_evaluations: counts.rhs,
            pair_evaluations: counts.pairs,
            forced_accepts: counts.forced,
            kinetic_energy: frame.kinetic_energy,
            potential_energy: frame.potential_energy,
            largest_overlap: frame.largest_overlap,
            bed_height: frame.bed_height,
            wall_seconds: self.started.elapsed().as_secs_f64(),
        };
        self.output.append(&rows, &measures)?;
        self.measures = Some(measures);
        self.frames += 1;
        self.last.kinetic_energy = frame.kinetic_energy;
        self.last.potential_energy = frame.potential_energy;
        self.last.bed_height = frame.bed_height;
        self.progress.frame(frame);
        Ok(())
    }
}
