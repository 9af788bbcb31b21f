//! One run, new or resumed, until it is complete or stopped.

use super::Ground;
use crate::cli::report::{self, Monitor, Progress};
use crate::cli::run::interrupts::Interrupts;
use crate::domain::agreement::{agree, share, write_on_rank_0};
use crate::domain::{Comm, launch, rows, stdout};
use crate::engine::dynamics::Clocks;
use crate::engine::simulation::{Frame, FrameSummary, Observer, Outcome, Simulation, Snapshot, cutoff};
use crate::error::Error;
use crate::files::checkpoint::{self, Header};
use crate::files::output::{self, Claim, Contents, Measures, Output, Rows, RunInfo, Seconds};
use crate::model::columns::Column;
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use fail::fail_point;
use std::path::Path;

/// Where a run begins.
#[derive(Debug, Clone, Copy)]
pub(super) enum Beginning<'a> {
    /// At t = 0, in a new file.
    Start,
    /// At t = 0, in a file that already has the first `frames` frames.
    Again { frames: u64 },
    /// At the checkpoint in this file, which has been verified.
    Checkpoint(&'a Path),
}

/// A run of a scene.
pub(super) struct Execution<'a> {
    pub ground: &'a Ground<'a>,
    /// Name of the run in messages: the scene file, or the output file that is resumed.
    pub name: &'a Path,
    /// The output file as the user named it.
    pub file: &'a Path,
    /// The output file, which nobody else writes.
    pub claim: &'a Claim,
    pub scene: &'a Scene,
    /// All particles at t = 0.
    pub start: &'a InitialCondition,
    pub beginning: Beginning<'a>,
}

/// A simulation that is ready to run, and what is known about the run so far.
struct Ready<'c> {
    simulation: Simulation<'c>,
    count: u64,
    velocity_scale: f64,
    course: FrameSummary,
    /// Number of frames in the output file.
    frames: u64,
    /// Number of the next frame. Frames that the file has already are not written again.
    next: u64,
    /// Number of checkpoints so far.
    serial: u64,
    /// Wall time of the run so far, s.
    wall_seconds: f64,
}

impl Execution<'_> {
    /// Creates the simulation, from the initial condition or from a checkpoint. Collective.
    fn ready<'c>(&self, comm: &'c dyn Comm) -> Result<Ready<'c>, Error> {
        let (scene, start) = (self.scene, self.start);
        match self.beginning {
            Beginning::Start | Beginning::Again { .. } => {
                let count = start.x.len() as u64;
                Ok(Ready {
                    simulation: Simulation::new(scene, start, comm)?,
                    count,
                    velocity_scale: initial_condition::velocity_scale(scene, start),
                    course: FrameSummary { count, ..FrameSummary::default() },
                    frames: match self.beginning {
                        Beginning::Again { frames } => frames,
                        _ => 0,
                    },
                    next: 0,
                    serial: 0,
                    wall_seconds: 0.0,
                })
            }
            Beginning::Checkpoint(path) => {
                let (header, remembered) = checkpoint::read(comm, path)?;
                let Header { count, columns, velocity_scale, course, serial, wall_seconds, .. } = header;
                let frames = header.memory.progress.frame;
                let particles = (count, columns);
                let simulation = Simulation::resume(scene, comm, particles, velocity_scale, remembered)?;
                Ok(Ready {
                    simulation,
                    count,
                    velocity_scale,
                    course,
                    frames,
                    next: frames,
                    serial,
                    wall_seconds,
                })
            }
        }
    }

    fn info(&self, velocity_scale: f64, count: u64) -> RunInfo {
        let Ground { comm, threads, set, .. } = *self.ground;
        let scene = self.scene;
        RunInfo {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: env!("DEMHYBRID_COMMIT").into(),
            scene: scene.resolved(),
            method: scene.solver.method,
            tolerance: match scene.solver.step {
                Some(_) => 0.0,
                None => crate::engine::simulation::tolerance(scene, velocity_scale, count),
            },
            step: scene.solver.step,
            norm: scene.solver.norm,
            velocity_scale,
            contact_cutoff: cutoff(scene, velocity_scale * self.start.sizes(scene).lightest()),
            energy: scene.output.energy,
            mass: scene.particles.mass,
            ranks: comm.size(),
            threads,
            instruction_set: format!("{} {}", std::env::consts::ARCH, set.name()),
        }
    }

    /// Opens the output file, new or with its first `frames` frames. Collective.
    fn output<'c>(
        &'c self,
        comm: &'c dyn Comm,
        info: &RunInfo,
        contents: &Contents,
        frames: u64,
    ) -> Result<Output<'c>, Error> {
        let path = self.claim.path();
        if let Beginning::Start = self.beginning {
            let block = rows::block(contents.count, comm.rank(), comm.size());
            let numbers = |column: &Column| self.start.numbers(column, block.clone());
            let created = Output::create(comm, path, info, contents, block.clone(), &numbers)?
                .with_sync(self.scene.output.sync)
                .with_claim(self.claim);
            if comm.rank() == 0 {
                checkpoint::clear(path);
            }
            return Ok(created);
        }
        share(comm, || {
            let unusable = |why| {
                Error::Input(format!("--resume {}: it cannot be made ready: {why}", self.file.display()))
            };
            checkpoint::clear_unfinished(path);
            output::prepare(path, frames, info).map(|()| String::new()).map_err(unusable)
        })?;
        let opened = Output::open(comm, path, info.energy, contents, frames)?;
        Ok(opened.with_sync(self.scene.output.sync).with_claim(self.claim))
    }
}

impl Execution<'_> {
    /// Runs the scene to its end, or until it is stopped. Collective.
    pub(super) fn run(self) -> Result<(), Error> {
        let Ground { args, comm, started, .. } = *self.ground;
        let scene = self.scene;
        let interrupts = agree(
            comm,
            Interrupts::listen(scene, self.claim.path(), comm.rank(), started)
                .map_err(|why| Error::Input(format!("signals cannot be listened to: {why}"))),
        )?;
        let request = || interrupts.request();
        let ready = self.ready(comm)?;
        let Ready { mut simulation, count, velocity_scale, course, frames, next, serial, wall_seconds } =
            ready;
        let info = self.info(velocity_scale, count);
        let columns = &simulation.columns().clone();
        let contents = Contents { count, radius: scene.particles.radius, columns };
        let output = self.output(comm, &info, &contents, frames)?;
        simulation.listen_to(&request);
        let mut recorder = Recorder {
            comm,
            output,
            info: &info,
            path: self.claim.path(),
            interrupts: &interrupts,
            progress: Progress::new(comm.rank(), scene.t_end, args.quiet, args.verbose),
            measures: None,
            course,
            monitor: Monitor::new(scene, self.start),
            kept: frames,
            next,
            written: 0,
            serial,
            earlier_seconds: wall_seconds,
            started,
        };
        let outcome = simulation.run(&mut recorder);
        recorder.progress.close();
        let outcome = outcome?;
        recorder.output.sync()?;
        let transfer = recorder.output.transfer_report().to_string();
        let wall_seconds = recorder.wall_seconds();
        let Recorder { output, measures, course, monitor, written, .. } = recorder;
        match (outcome.stopped, measures) {
            (Some(request), _) => {
                interrupts.granted(request);
                output.stop(&request.to_string())?;
            }
            (None, Some(measures)) => {
                let seconds = seconds(&outcome.clocks, outcome.output_seconds);
                let by = outcome.at_rest_by;
                output.finish(&Measures { wall_seconds, seconds, ..measures }, &outcome.choice, by)?;
            }
            (None, None) => {}
        }
        let written = format!("{}: {written} frames, {transfer}", self.file.display());
        let told = self.tell(&outcome, &course, &monitor, &written);
        match outcome.stopped {
            Some(request) => {
                if let (0, Err(why)) = (comm.rank(), told) {
                    launch::say(&format!("demhybrid: error: {why}"));
                }
                Err(Error::Stopped { request, t: outcome.time, file: self.file.display().to_string() })
            }
            None => told,
        }
    }
}

impl Execution<'_> {
    /// Prints the closing summary and the warnings of doubtful results. Collective.
    fn tell(
        &self,
        outcome: &Outcome,
        course: &FrameSummary,
        monitor: &Monitor,
        written: &str,
    ) -> Result<(), Error> {
        let Ground { comm, threads, .. } = *self.ground;
        let run = (self.scene, self.start);
        let text = report::summary(comm, self.name, run, outcome, course, threads, written);
        let doubts = report::doubts(comm, self.scene, self.start, outcome, course, monitor);
        let state = if outcome.stopped.is_some() { "stopped and saved" } else { "complete" };
        let kept = format!("; the run is {state} all the same, in {}", self.file.display());
        let printed = write_on_rank_0(comm, || stdout::deliver(&text, &kept));
        if comm.rank() == 0 {
            doubts.iter().for_each(|doubt| launch::say(doubt));
        }
        printed
    }
}

/// Observer of a run: writes frames and checkpoints, and shows the progress.
struct Recorder<'a> {
    comm: &'a dyn Comm,
    output: Output<'a>,
    info: &'a RunInfo,
    path: &'a Path,
    interrupts: &'a Interrupts,
    progress: Progress,
    measures: Option<Measures>,
    course: FrameSummary,
    monitor: Monitor,
    /// Number of frames that the file had at the beginning.
    kept: u64,
    /// Number of the next frame.
    next: u64,
    /// Number of frames that this process has written.
    written: u64,
    serial: u64,
    earlier_seconds: f64,
    started: std::time::Instant,
}

/// Wall time in the parts of the work, s; `output` is the time for frames, s.
fn seconds(clocks: &Clocks, output: f64) -> Seconds {
    let Clocks { forces, ghosts, lists, reduction } = *clocks;
    let [forces, ghosts, lists, reduction] =
        [forces, ghosts, lists, reduction].map(|part| part.as_secs_f64());
    Seconds { forces, ghosts, lists, reduction, output }
}

impl Recorder<'_> {
    /// Wall time of the run in this process and earlier ones, s.
    fn wall_seconds(&self) -> f64 {
        self.earlier_seconds + self.started.elapsed().as_secs_f64()
    }
}

impl Observer for Recorder<'_> {
    fn frame(&mut self, frame: &Frame) -> Result<(), Error> {
        fail_point!("output");
        let rows = Rows { first: frame.first, numbers: &|column| frame.numbers(column) };
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
            wall_seconds: self.wall_seconds(),
            seconds: seconds(&frame.clocks, frame.output_seconds),
        };
        if self.next >= self.kept {
            self.output.append(&rows, &measures)?;
            self.written += 1;
        }
        self.measures = Some(measures);
        self.next += 1;
        self.course.follow(frame);
        self.monitor.follow(frame);
        self.progress.frame(frame);
        Ok(())
    }

    fn checkpoint(&mut self, snapshot: &Snapshot) -> Result<(), Error> {
        let header = Header {
            serial: self.serial + 1,
            version: self.info.version.clone(),
            instruction_set: self.info.instruction_set.clone(),
            scene: self.info.scene.clone(),
            count: snapshot.count,
            contact_slots: snapshot.contact_slots,
            columns: snapshot.columns.clone(),
            velocity_scale: self.info.velocity_scale,
            wall_seconds: self.wall_seconds(),
            course: self.course,
            memory: snapshot.memory,
        };
        // The checkpoint counts on the frames before it.
        self.output.sync()?;
        checkpoint::write(self.comm, &checkpoint::slot(self.path, header.serial), &header, snapshot)?;
        self.serial = header.serial;
        self.interrupts.saved();
        Ok(())
    }
}
