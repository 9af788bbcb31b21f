//! From the command line to the exit code: reads and checks the scene, runs it, tells about it.

use crate::cli::Args;
use crate::contact::{Law, Rebound, Tangential};
use crate::domain::{Comm, rows};
use crate::dynamics::Clocks;
use crate::error::Error;
use crate::kernel::InstructionSet;
use crate::launch;
use crate::output::{self, Measures, Output, Quantity, Rows, RunInfo, Seconds};
use crate::particle::{Motion, Spin};
use crate::report::{self, Course, Progress, Watch};
use crate::scene::Scene;
use crate::simulation::{self, Frame, Observer, Simulation, Task};
use crate::start::{self, Start};
use fail::fail_point;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command line `args` on all ranks of `comm` and returns when it is done. Collective.
pub fn run(args: &Args, comm: &dyn Comm) -> Result<(), Error> {
    launch::check_launcher(comm.size())?;
    let (threads, bound) = agree(comm, launch::start_threads(comm, args.threads))?;
    let set = agree(comm, InstructionSet::chosen())?;
    let (scene, start) = load_for_output(args, comm)?;
    let file = scene.output.file.clone().unwrap_or_default();
    share(comm, || spare_the_input(args, &scene, &file))?;
    let room = report::output_bytes(&scene, start.x.len() as u64);
    let place = Output::check_place(comm, &file, args.force, room);
    if comm.rank() == 0 {
        let forewarnings = report::forewarnings(&scene, &start);
        bound.iter().chain(&forewarnings).for_each(|warning| launch::say(warning));
    }
    if args.dry_run {
        let output = match &place {
            Ok(_) => file.display().to_string(),
            Err(why) => format!("would be refused: {why}"),
        };
        let plan = report::plan(comm, &args.scene, &scene, &start, threads, &output);
        if comm.rank() == 0 {
            launch::print(&plan);
        }
        return Ok(());
    }
    let place = place?;
    simulation::dispatch(
        &scene,
        Run { args, scene: &scene, start: &start, comm, threads, set, place: &place },
    )
}

/// The scene and its particles, with the output file of the command line. Collective.
fn load_for_output(args: &Args, comm: &dyn Comm) -> Result<(Scene, Start), Error> {
    let (mut scene, start) = load(&args.scene, &args.set, comm)?;
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
        std::fs::read(path)
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

/// What `make` gives on rank 0, text or mistake, on every rank. Collective.
pub(crate) fn share(comm: &dyn Comm, make: impl FnOnce() -> Result<String, Error>) -> Result<String, Error> {
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

/// Makes the failure of one rank everybody's: the lowest rank that failed says why, all leave together. Collective.
pub(crate) fn agree<T>(comm: &dyn Comm, own: Result<T, Error>) -> Result<T, Error> {
    let rank = comm.rank() as f64;
    let mut first = [if own.is_err() { -rank } else { f64::NEG_INFINITY }];
    comm.max(&mut first);
    match own {
        own if first[0] == f64::NEG_INFINITY => own,
        Err(why) if first[0] == -rank => {
            if comm.rank() == 0 {
                return Err(why);
            }
            launch::say(&format!("demhybrid: error on rank {rank}: {why}"));
            Err(Error::Elsewhere { code: why.exit_code() })
        }
        // Every failure here is one of input.
        _ => Err(Error::Elsewhere { code: 2 }),
    }
}

/// Refuses an output that would overwrite what the run is made from.
fn spare_the_input(args: &Args, scene: &Scene, output: &Path) -> Result<String, Error> {
    let folder = args.scene.parent().unwrap_or(Path::new(""));
    let particles = scene.particles.file.as_ref().map(|file| folder.join(file));
    let same =
        |input: &Path| matches!((input.canonicalize(), output.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for (input, what) in [(Some(args.scene.clone()), "the scene"), (particles, "particles.file")] {
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

/// A run of a scene, once its effects are types.
struct Run<'a> {
    args: &'a Args,
    scene: &'a Scene,
    start: &'a Start,
    comm: &'a dyn Comm,
    threads: usize,
    set: InstructionSet,
    place: &'a Path,
}

impl Task for Run<'_> {
    type Output = Result<(), Error>;

    fn with<R: Rebound, T: Tangential, W: Spin>(self, law: Law<R, T>) -> Result<(), Error> {
        let Run { args, scene, start, comm, threads, set, place } = self;
        let started = Instant::now();
        let simulation = Simulation::<R, T, W>::new(scene, start, law, comm)?;
        let count = start.x.len() as u64;
        let info = RunInfo {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: env!("DEMHYBRID_COMMIT").into(),
            scene: scene.resolved(),
            method: scene.solver.method.clone(),
            tolerance: scene.solver.tolerance.unwrap_or(0.0),
            step: scene.solver.step,
            norm: scene.solver.norm.clone(),
            velocity_scale: start::velocity_scale(scene, start),
            energy: scene.output.energy,
            mass: scene.particles.mass,
            ranks: comm.size(),
            threads,
            instruction_set: format!("{} {}", std::env::consts::ARCH, set.name()),
        };
        let block = rows::block(count, comm.rank(), comm.size());
        let rotation = W::COMPONENTS > 0;
        let output = Output::create(comm, place, &info, count, scene.particles.radius, rotation, block)?;
        let progress = Progress::new(comm.rank(), scene.t_end, args.quiet, args.verbose);
        let course = Course { count, ..Course::default() };
        let watch = Watch::new(scene, start);
        let mut recorder =
            Recorder { output, scene, progress, started, measures: None, course, watch, frames: 0 };
        let outcome = simulation.run(&mut recorder);
        recorder.progress.close();
        let outcome = outcome?;
        let file = scene.output.file.clone().unwrap_or_else(|| PathBuf::from(place));
        let transfer = recorder.output.transfer_report().to_string();
        let Recorder { output, measures, course, watch, frames, .. } = recorder;
        if let Some(measures) = measures {
            let seconds = seconds(&outcome.clocks, outcome.output_seconds);
            let wall_seconds = started.elapsed().as_secs_f64();
            output.finish(&Measures { wall_seconds, seconds, ..measures }, &outcome.choice)?;
        }
        let written = format!("{}: {frames} frames, {transfer}", file.display());
        let text = report::summary(comm, &args.scene, scene, &outcome, &course, threads, &written);
        let doubts = report::doubts(comm, scene, start, &outcome, &course, &watch);
        if comm.rank() == 0 {
            launch::print(&text);
            doubts.iter().for_each(|doubt| launch::say(doubt));
        }
        Ok(())
    }
}

/// Writes frames and tells about them.
struct Recorder<'a> {
    output: Output<'a>,
    scene: &'a Scene,
    progress: Progress,
    started: Instant,
    measures: Option<Measures>,
    course: Course,
    watch: Watch,
    frames: u64,
}

/// The time that went into the parts of the work.
fn seconds(clocks: &Clocks, output: f64) -> Seconds {
    let Clocks { forces, ghosts, lists, reduction } = *clocks;
    let [forces, ghosts, lists, reduction] =
        [forces, ghosts, lists, reduction].map(|part| part.as_secs_f64());
    Seconds { forces, ghosts, lists, reduction, output }
}

impl<W: Spin> Observer<W> for Recorder<'_> {
    fn frame(&mut self, frame: &Frame<W>) -> Result<(), Error> {
        fail_point!("output");
        let column = |quantity| {
            let vector = |body: &Motion<W>| match quantity {
                Quantity::Position => body.x.into(),
                Quantity::Velocity => body.v.into(),
                Quantity::AngularVelocity => body.omega.vector().into(),
            };
            frame.rows.map(vector)
        };
        let rows = Rows { first: frame.first, column: &column };
        let counts = frame.counts;
        let measures = Measures {
            time: frame.time,
            step: frame.step,
            steps_accepted: counts.accepted,
            steps_rejected: counts.rejected,
            steps_outrun: counts.outrun,
            rhs_evaluations: counts.rhs,
            pair_evaluations: counts.pairs,
            lists_built: counts.rebuilds,
            forced_accepts: counts.forced,
            limits: counts.limits,
            kinetic_energy: frame.kinetic_energy,
            potential_energy: frame.potential_energy,
            dissipated: frame.dissipated,
            largest_overlap: frame.largest_overlap,
            bed_height: frame.bed_height,
            wall_seconds: self.started.elapsed().as_secs_f64(),
            seconds: seconds(&frame.clocks, frame.output_seconds),
        };
        let overlap = report::overlap_warning(self.scene, frame.largest_overlap);
        if let (0, true, Some(warning)) = (self.frames, frame.first == 0 && !frame.rows.is_empty(), overlap) {
            launch::say(&warning);
        }
        self.output.append(&rows, &measures)?;
        self.measures = Some(measures);
        self.frames += 1;
        self.course.follow(frame);
        self.watch.follow(frame);
        self.progress.frame(frame);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn a_failure_that_only_one_rank_meets_ends_all() {
        for failing in 0..3 {
            team(3, |comm| {
                let mistake = Error::Input("too little of something".into());
                let own = if comm.rank() == failing { Err(mistake.clone()) } else { Ok(comm.rank()) };
                let agreed = agree(comm, own);
                // Rank 0 tells its own at the end, as it does with what all ranks know.
                let tells_later = failing == 0 && comm.rank() == 0;
                assert_eq!(agreed, Err(if tells_later { mistake } else { Error::Elsewhere { code: 2 } }));
            });
        }
        team(3, |comm| assert_eq!(agree(comm, Ok(comm.rank())), Ok(comm.rank())));
    }
}
