//! The output file: VTKHDF 2.0, temporal PolyData, one HDF5 file that ParaView, VTK, pyvista and h5py open as it is.
//!
//! All ranks write one file through MPI-IO, each its block of rows in id order. A frame is written so that a reader or
//! a crash never meets half of one: all data and a flush, then the time and `NSteps` and another flush; readers trust
//! `NSteps` alone. docs/design.md has the list of groups and arrays.

mod collective;
mod frames;
#[cfg_attr(not(feature = "mpi"), path = "output/serial.rs")]
mod mpio;
mod path;
mod reopen;
#[cfg(test)]
mod tests;

use std::mem;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::domain::comm::Comm;
use crate::error::Error;
use crate::ode::{Dissipation, Limit, MethodName, NormName};
use frames::Frames;

pub use reopen::{Found, first_frame, frame, inspect, prepare};

/// What the run says of itself once, as attributes of `/run`.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Version of the program.
    pub version: String,
    /// Commit it was built from.
    pub commit: String,
    /// The scene as resolved, TOML.
    pub scene: String,
    /// `solver.method`.
    pub method: MethodName,
    /// `solver.tolerance`, in the units of `norm`; 0 for a method with a fixed step.
    pub tolerance: f64,
    /// `solver.step`, s; there exactly if the method has a fixed step.
    pub step: Option<f64>,
    /// `solver.norm`.
    pub norm: NormName,
    /// Speed that errors of velocity are compared with in the scaled norm, m/s.
    pub velocity_scale: f64,
    /// Largest gap at which the stabilised method evaluates contacts, m.
    pub contact_cutoff: f64,
    /// Whether `/run/series` has columns for the dissipated energy.
    pub energy: bool,
    /// Mass of one particle, kg.
    pub mass: f64,
    /// Number of MPI ranks.
    pub ranks: usize,
    /// Threads of each rank.
    pub threads: usize,
    /// Vector instructions in use, such as `avx2+fma`.
    pub instruction_set: String,
}

/// The run at the time of a frame: one row of `/run/series`, and the attributes of `/run` that count.
///
/// Counts and sums are of the whole run, the same on every rank; of times rank 0's are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures {
    /// Time of the frame, s.
    pub time: f64,
    /// Size of the last accepted step, s.
    pub step: f64,
    /// Accepted steps.
    pub steps_accepted: u64,
    /// Steps rejected for their error.
    pub steps_rejected: u64,
    /// Trials that outran the contact lists.
    pub steps_outrun: u64,
    /// Evaluations of the right-hand side; a collective one counts once.
    pub rhs_evaluations: u64,
    /// Evaluations of a pair of particles.
    pub pair_evaluations: u64,
    /// Times the contact lists were built.
    pub lists_built: u64,
    /// Steps accepted at `solver.min_step` in spite of their error; an attribute only.
    pub forced_accepts: u64,
    /// Accepted steps by what decided their size, in the order of `Limit::ALL`; attributes only.
    pub limits: [u64; Limit::ALL.len()],
    /// Kinetic energy of all particles, rotation included, J.
    pub kinetic_energy: f64,
    /// Potential energy of all particles, J.
    pub potential_energy: f64,
    /// Energy dissipated so far by rebound and by friction, J; written where [`RunInfo::energy`] asks for it.
    pub dissipated: Dissipation,
    /// Largest overlap of two bodies, m.
    pub largest_overlap: f64,
    /// Height of the bed, m.
    pub bed_height: f64,
    /// Wall time since the start, s.
    pub wall_seconds: f64,
    /// Where that time went; attributes only.
    pub seconds: Seconds,
}

/// Wall time in the parts of the work on one rank, s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seconds {
    /// Contacts and sums, s.
    pub forces: f64,
    /// Waiting for and copying ghosts, s.
    pub ghosts: f64,
    /// Contact lists, migration, slab bounds, s.
    pub lists: f64,
    /// Agreement on errors, s.
    pub reduction: f64,
    /// Frames: measures and output, s.
    pub output: f64,
}

/// A vector that every particle has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Centre, m.
    Position,
    /// Velocity, m/s.
    Velocity,
    /// Angular velocity, 1/s; asked for only where rotation is on.
    AngularVelocity,
}

/// The rows of a frame that this rank writes, from row `first` of the id order on. The blocks of the ranks follow one
/// another by rank and may be empty.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Id of the first row.
    pub first: u64,
    /// Makes one quantity of all rows; called for one after the other, so that only one is in memory.
    pub column: &'a dyn Fn(Quantity) -> Vec<[f64; 3]>,
}

/// An output file that grows by frames.
///
/// After an error nothing of the file may be touched any more, by any rank: the next collective call could wait for
/// ever. So a failed `Output` leaves the file open and answers every later call with an error, without any call to
/// HDF5; dropping it is safe. Which ranks see an error depends on the error: whoever gets one says so and calls
/// `Comm::abort`, without finalising MPI (which would make HDF5 close the file). The file then holds all complete
/// frames.
///
/// Dropping a sound `Output` closes the file at its last frame, with `completed = 0`; that is collective too.
pub struct Output<'a> {
    comm: &'a dyn Comm,
    path: PathBuf,
    frames: Option<Frames>,
    transfer: String,
    /// Device and inode of the file, on rank 0.
    identity: Option<(u64, u64)>,
}

impl<'a> Output<'a> {
    /// Whether about `estimated_bytes` can be written to `path`; without `force` nothing may be there yet. Rank 0
    /// looks, all ranks get its verdict: the absolute path, or what is wrong and what would be right. Creates nothing.
    /// Collective.
    pub fn check_path(
        comm: &dyn Comm,
        path: &Path,
        force: bool,
        estimated_bytes: u64,
    ) -> Result<PathBuf, Error> {
        let mut outcome = Vec::new();
        if comm.rank() == 0 {
            outcome = path::to_bytes(&path::look(path, force, estimated_bytes));
        }
        comm.broadcast(&mut outcome);
        path::from_bytes(&outcome).map_err(Error::Input)
    }

    /// Creates the file, replacing one that exists, with everything a reader needs to find no frames yet. `path` is
    /// the same on every rank, as `check_place` gives it. `count` spheres of `radius` (m); `id_rows` is this rank's
    /// block of ids. Collective.
    pub fn create(
        comm: &'a dyn Comm,
        path: &Path,
        info: &RunInfo,
        count: u64,
        radius: f64,
        rotation: bool,
        id_rows: Range<u64>,
    ) -> Result<Output<'a>, Error> {
        let info = info.agreed(comm);
        let frames = Frames::create(comm, path, &info, count, radius, rotation, id_rows)
            .map_err(|why| failure(path, &why))?;
        Ok(Self::with(comm, path, frames))
    }

    /// Opens the file of an earlier process, which [`prepare`] has made ready to go on after `complete` frames.
    /// Collective.
    pub fn open(
        comm: &'a dyn Comm,
        path: &Path,
        energy: bool,
        count: u64,
        rotation: bool,
        complete: u64,
    ) -> Result<Output<'a>, Error> {
        let frames =
            Frames::open(comm, path, energy, count, rotation, complete).map_err(|why| failure(path, &why))?;
        Ok(Self::with(comm, path, frames))
    }

    fn with(comm: &'a dyn Comm, path: &Path, frames: Frames) -> Self {
        let identity = (comm.rank() == 0).then(|| path::identity(path)).flatten();
        let path = path.to_path_buf();
        Output { comm, path, frames: Some(frames), transfer: "none yet".to_string(), identity }
    }

    /// Fails where the file is not in its place any more, without a word to HDF5: the file could still be closed, and
    /// nothing of it is lost but its name. Collective.
    fn check_identity(&self) -> Result<(), Error> {
        let mut outcome = Vec::new();
        if self.comm.rank() == 0 {
            outcome.push(match path::identity(&self.path) {
                found if found == self.identity => 0,
                None => 1,
                Some(_) => 2,
            });
        }
        self.comm.broadcast(&mut outcome);
        let what = match outcome.first() {
            Some(1) => "removed",
            Some(2) => "replaced by another file",
            _ => return Ok(()),
        };
        Err(Error::Replaced { file: self.path.display().to_string(), what })
    }

    /// Appends one frame. Collective.
    pub fn append(&mut self, rows: &Rows, measures: &Measures) -> Result<(), Error> {
        self.check_identity()?;
        let measures = measures.agreed(self.comm);
        self.transfer = self.guarded(|frames| frames.append(rows, &measures))?;
        Ok(())
    }

    /// Marks the run as completed, by the method that `choice` names and before its end by the key `at_rest_by`, and closes
    /// the file. Collective.
    pub fn finish(
        mut self,
        measures: &Measures,
        choice: &str,
        at_rest_by: Option<&str>,
    ) -> Result<(), Error> {
        let measures = measures.agreed(self.comm);
        let choice = agreed_text(self.comm, choice);
        self.guarded(|frames| {
            at_rest_by.map_or(Ok(()), |by| frames.stopped(by))?;
            frames.complete(&measures, &choice)
        })?;
        match self.frames.take() {
            Some(frames) => frames.close().map_err(|why| failure(&self.path, &why)),
            None => Ok(()),
        }
    }

    /// Says what stopped the run before its end, and closes the file. Collective.
    pub fn stop(mut self, by: &str) -> Result<(), Error> {
        self.guarded(|frames| frames.stopped(by))?;
        match self.frames.take() {
            Some(frames) => frames.close().map_err(|why| failure(&self.path, &why)),
            None => Ok(()),
        }
    }

    /// How the rows of the last frame really travelled, as HDF5 itself reports it: `chunk collective` when all ranks
    /// wrote together, `independent (cause ...)` when the library fell back, `serial` without MPI.
    pub fn transfer_report(&self) -> &str {
        &self.transfer
    }

    /// Does something to the file and never touches it again if that fails.
    fn guarded<R>(&mut self, work: impl FnOnce(&mut Frames) -> hdf5::Result<R>) -> Result<R, Error> {
        let Some(mut frames) = self.frames.take() else {
            return Err(Error::Output {
                file: self.path.display().to_string(),
                why: "an earlier write had failed".to_string(),
            });
        };
        match work(&mut frames) {
            Ok(result) => {
                self.frames = Some(frames);
                Ok(result)
            }
            Err(why) => {
                let error = failure(&self.path, &why);
                mem::forget(frames);
                Err(error)
            }
        }
    }
}

impl Drop for Output<'_> {
    fn drop(&mut self) {
        // Closing is collective; a rank that panics is alone.
        if std::thread::panicking() {
            mem::forget(self.frames.take());
        }
    }
}

impl RunInfo {
    /// Rank 0's, on every rank: metadata that differ between ranks would break the file. Collective.
    fn agreed(&self, comm: &dyn Comm) -> RunInfo {
        let text = |own: &str| agreed_text(comm, own);
        let count = |own: usize| {
            let [bytes] = agreed(comm, [(own as u64).to_le_bytes()]);
            u64::from_le_bytes(bytes) as usize
        };
        RunInfo {
            version: text(&self.version),
            commit: text(&self.commit),
            scene: text(&self.scene),
            method: self.method,
            tolerance: self.tolerance,
            step: self.step,
            norm: self.norm,
            velocity_scale: self.velocity_scale,
            contact_cutoff: self.contact_cutoff,
            energy: self.energy,
            mass: self.mass,
            ranks: count(self.ranks),
            threads: count(self.threads),
            instruction_set: text(&self.instruction_set),
        }
    }
}

impl Measures {
    /// The same with rank 0's clocks. Collective.
    fn agreed(&self, comm: &dyn Comm) -> Measures {
        let Seconds { forces, ghosts, lists, reduction, output } = self.seconds;
        let clocks = [self.wall_seconds, forces, ghosts, lists, reduction, output];
        let clocks = agreed(comm, clocks.map(f64::to_le_bytes)).map(f64::from_le_bytes);
        let [wall_seconds, forces, ghosts, lists, reduction, output] = clocks;
        Measures { wall_seconds, seconds: Seconds { forces, ghosts, lists, reduction, output }, ..*self }
    }
}

/// Rank 0's numbers. Collective.
fn agreed<const K: usize>(comm: &dyn Comm, own: [[u8; 8]; K]) -> [[u8; 8]; K] {
    let mut bytes = own.as_flattened().to_vec();
    comm.broadcast(&mut bytes);
    let mut numbers = own;
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
        number.copy_from_slice(bytes);
    }
    numbers
}

/// Rank 0's text. Collective.
fn agreed_text(comm: &dyn Comm, own: &str) -> String {
    let mut bytes = own.as_bytes().to_vec();
    comm.broadcast(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// What HDF5 said, and whether the disk is full, which it often does not say.
fn failure(path: &Path, why: &hdf5::Error) -> Error {
    // HDF5 breaks its lines; a message of ours is one line.
    let mut why = why.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some(folder) = path.parent()
        && let Some(free) = path::free_bytes(folder)
        && free < 1 << 20
    {
        why = format!("{why} ({free} bytes are free in {})", folder.display());
    }
    Error::Output { file: path.display().to_string(), why }
}
