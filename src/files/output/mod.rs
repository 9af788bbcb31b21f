//! The output file: one HDF5 file in the format VTKHDF 2.0 (temporal `PolyData`).
//!
//! ParaView, VTK, pyvista and h5py open it as it is. All ranks write the file together through MPI-IO. Every
//! rank writes its block of rows in the order of ids.
//!
//! A reader never finds half a frame, even after a crash. First all data are written and flushed. Then the
//! time and `NSteps` are written and flushed. Readers trust `NSteps` alone.
//!
//! Frames are held in memory and written many at a time, as often as [`SyncEvery`] says (decision 042).
//!
//! docs/file-format.md lists all groups and arrays.

mod arrays;
mod claim;
mod collective;
mod frames;
#[cfg_attr(not(feature = "mpi"), path = "serial.rs")]
mod mpio;
mod pace;
mod path;
mod reopen;
mod run_group;
#[cfg(test)]
mod tests;

use std::mem;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::domain::comm::Comm;
use crate::error::Error;
use crate::model::columns::{Column, Columns};
use crate::ode::{Dissipation, Limit, MethodName, NormName};
use crate::scene::SyncEvery;
pub use claim::Claim;
use claim::{Fate, Watch};
use frames::Frames;
use pace::Pace;

pub use reopen::{Bodies, Found, Species, bodies, first_frame, frame, inspect, prepare, whole_frame};

/// Description of a run, which is written once as attributes of `/run`.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Version of the program.
    pub version: String,
    /// Commit that the program was built from.
    pub commit: String,
    /// The scene with every default filled in, TOML.
    pub scene: String,
    /// `solver.method`.
    pub method: MethodName,
    /// `solver.tolerance`, in the units of `norm`; 0 for a method with a fixed step.
    pub tolerance: f64,
    /// `solver.step`, s; present only if the method has a fixed step.
    pub step: Option<f64>,
    /// `solver.norm`.
    pub norm: NormName,
    /// Speed that scales errors of velocity in the scaled norm, m/s.
    pub velocity_scale: f64,
    /// Largest gap at which the stabilised method evaluates contacts, m.
    pub contact_cutoff: f64,
    /// Whether `/run/series` has columns for the dissipated energy.
    pub energy: bool,
    /// Mass of one particle, kg; the mean where sizes differ.
    pub mass: f64,
    /// Number of MPI ranks.
    pub ranks: usize,
    /// Number of threads of each rank.
    pub threads: usize,
    /// Processor architecture and vector instructions in use, such as `x86_64 avx2`.
    pub instruction_set: String,
}

/// Measures of the run at a frame: one row of `/run/series`, and the attributes of `/run` that follow it.
///
/// Counts and sums cover the whole run and are the same on every rank. Times are those of rank 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures {
    /// Time of the frame, s.
    pub time: f64,
    /// Size of the last accepted step, s.
    pub step: f64,
    /// Number of accepted steps.
    pub steps_accepted: u64,
    /// Number of steps that were rejected because of their error.
    pub steps_rejected: u64,
    /// Number of trial steps in which a particle outran the contact lists.
    pub steps_outrun: u64,
    /// Number of evaluations of the right-hand side. A collective evaluation counts once.
    pub rhs_evaluations: u64,
    /// Number of evaluations of a pair of particles.
    pub pair_evaluations: u64,
    /// How often the contact lists were built.
    pub lists_built: u64,
    /// Number of steps accepted at `solver.min_step` in spite of their error; an attribute only.
    pub forced_accepts: u64,
    /// Number of accepted steps whose size each limit decided, in the order of `Limit::ALL`; attributes only.
    pub limits: [u64; Limit::ALL.len()],
    /// Kinetic energy of all particles, including rotation, J.
    pub kinetic_energy: f64,
    /// Potential energy of all particles, J.
    pub potential_energy: f64,
    /// Energy dissipated so far by rebound and by friction, J; written only if [`RunInfo::energy`] is set.
    pub dissipated: Dissipation,
    /// Largest overlap of two bodies, m.
    pub largest_overlap: f64,
    /// Height of the bed, m.
    pub bed_height: f64,
    /// Wall time of the run so far, s.
    pub wall_seconds: f64,
    /// Wall time in the parts of the work; attributes only.
    pub seconds: Seconds,
}

/// Wall time of one rank in the parts of its work, s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seconds {
    /// Evaluating contacts and adding their forces, s.
    pub forces: f64,
    /// Waiting for ghosts and copying them, s.
    pub ghosts: f64,
    /// Building contact lists, migrating particles and balancing slabs, s.
    pub lists: f64,
    /// Agreeing on errors over ranks, s.
    pub reduction: f64,
    /// Measuring and writing frames, s.
    pub output: f64,
}

/// The particles of a file.
#[derive(Debug, Clone, Copy)]
pub struct Contents<'a> {
    /// Their number.
    pub count: u64,
    /// Their radius where the columns hold none, m.
    pub radius: f64,
    /// What each carries.
    pub columns: &'a Columns,
}

/// Returns the numbers of a column, row after row, for a block of ids. Columns are requested one by one, so
/// that only one is in memory.
pub type Numbers<'f> = dyn Fn(&Column) -> Vec<f64> + 'f;

/// The rows of a frame that this rank writes, in the order of ids.
///
/// The blocks of the ranks follow one another in the order of ranks. A block may be empty.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Id of the first row.
    pub first: u64,
    /// Returns one column of all rows.
    pub numbers: &'a Numbers<'a>,
}

/// An output file that grows by frames.
///
/// Every frame is forced to the disk, unless [`Output::with_sync`] asks for less. Whatever ends the run, and
/// dropping the `Output` too, brings the last frames into the file.
///
/// After an error no rank may touch the file any more, because the next collective call could wait for ever.
/// A failed `Output` therefore leaves the file open. It answers every later call with an error and makes no
/// call to HDF5. Dropping it is safe.
///
/// Some errors reach only some of the ranks. A rank that gets an error reports it and calls `Comm::abort`,
/// without finalising MPI, because that would make HDF5 close the file. The file then holds all complete
/// frames.
///
/// Dropping an `Output` that has not failed closes the file with `completed = 0`. That is collective too.
///
/// Before each write rank 0 looks at the file by its name. If that is gone, the run can still save itself, as
/// [`Error::Replaced`] says. If somebody else writes to the file, the `Output` has failed.
pub struct Output<'a> {
    comm: &'a dyn Comm,
    path: PathBuf,
    frames: Option<Frames>,
    pace: Pace,
    claim: Option<&'a Claim>,
    /// On rank 0 only.
    watch: Option<Watch>,
}

impl<'a> Output<'a> {
    /// Checks whether about `estimated_bytes` can be written to `path`. Creates nothing. Collective.
    ///
    /// Without `force` no file may exist there, and no other process may write it. Rank 0 checks, and all
    /// ranks return what it found: the one absolute name of the file, or an error that says what is wrong and
    /// what would be right. A run takes it by [`Claim::stake`], which makes the same checks.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::domain::Solo;
    /// use demhybrid::files::output::Output;
    ///
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("bed.vtkhdf");
    /// assert!(Output::check_path(&Solo, &path, false, 1000).is_ok());
    /// std::fs::write(&path, "an earlier run")?;
    /// let refused = Output::check_path(&Solo, &path, false, 1000).unwrap_err();
    /// assert!(refused.to_string().contains("--force"));
    /// assert!(Output::check_path(&Solo, &path, true, 1000).is_ok());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_path(
        comm: &dyn Comm,
        path: &Path,
        force: bool,
        estimated_bytes: u64,
    ) -> Result<PathBuf, Error> {
        path::share(comm, || path::look(path, force, estimated_bytes))
    }

    /// Creates the file, or replaces one that exists. Readers can open it and find no frames yet. Collective.
    ///
    /// `path` must be the same on every rank: the one of a [`Claim`]. `id_rows` is this rank's block of ids.
    /// `constants` returns its columns that change only when lists are built: these are written once.
    pub fn create(
        comm: &'a dyn Comm,
        path: &Path,
        info: &RunInfo,
        contents: &Contents,
        id_rows: Range<u64>,
        constants: &Numbers,
    ) -> Result<Output<'a>, Error> {
        let info = info.agreed(comm);
        path::share(comm, || path::remove_old(path).map(|()| path.to_path_buf()))?;
        let frames = Frames::create(comm, path, &info, contents, id_rows, constants)
            .map_err(|why| failure(path, &why))?;
        Ok(Self::with(comm, path, frames))
    }

    /// Opens the file of an earlier process, which [`prepare`] has cut to `complete` frames. Collective.
    pub fn open(
        comm: &'a dyn Comm,
        path: &Path,
        energy: bool,
        contents: &Contents,
        complete: u64,
    ) -> Result<Output<'a>, Error> {
        let frames =
            Frames::open(comm, path, energy, contents, complete).map_err(|why| failure(path, &why))?;
        Ok(Self::with(comm, path, frames))
    }

    fn with(comm: &'a dyn Comm, path: &Path, frames: Frames) -> Self {
        let mark = frames.written_once();
        let watch = (comm.rank() == 0).then(|| Watch::new(path, mark)).flatten();
        let path = path.to_path_buf();
        let pace = Pace::new(SyncEvery::Frame);
        Output { comm, path, frames: Some(frames), pace, claim: None, watch }
    }

    /// Stops writing where another process has taken over `claim`.
    #[must_use]
    pub fn with_claim(mut self, claim: &'a Claim) -> Self {
        self.claim = Some(claim);
        self
    }

    /// Forces frames to the disk as often as `sync` says. Between times they are held in memory.
    #[must_use]
    pub fn with_sync(mut self, sync: SyncEvery) -> Self {
        self.pace = Pace::new(sync);
        self
    }

    /// Fails if somebody else writes to the file, or has done so: it is never touched again. Collective.
    ///
    /// Returns what has happened to its name. This makes no call to HDF5, so a file that has only lost its
    /// name can still be written and closed.
    fn check_content(&mut self) -> Result<Option<&'static str>, Error> {
        let mut fate = Vec::new();
        if self.comm.rank() == 0 {
            let known = self.watch.map(|watch| watch.fate(&self.path, self.claim));
            fate = known.unwrap_or(Fate::Moved("removed")).to_bytes();
        }
        self.comm.broadcast(&mut fate);
        match Fate::from_bytes(&fate) {
            Fate::Intact => Ok(None),
            Fate::Moved(what) => Ok(Some(what)),
            Fate::Spoiled(why) => {
                mem::forget(self.frames.take());
                Err(Error::Output { file: self.path.display().to_string(), why })
            }
        }
    }

    /// Fails also if the file has been removed or replaced. Collective.
    fn check(&mut self) -> Result<(), Error> {
        match self.check_content()? {
            None => Ok(()),
            Some(what) => Err(Error::Replaced { file: self.path.display().to_string(), what }),
        }
    }

    /// Appends one frame, and forces it to the disk if its time has come. Collective.
    pub fn append(&mut self, rows: &Rows, measures: &Measures) -> Result<(), Error> {
        let measures = measures.agreed(self.comm);
        let due = self.pace.is_due(measures.wall_seconds);
        let write = due || self.frames.as_ref().is_some_and(Frames::are_full_with_the_next);
        if write {
            self.check()?;
        }
        self.guarded(|frames| frames.append(rows, &measures, write))?;
        if write {
            self.learn_length();
        }
        Ok(())
    }

    /// Forces all frames so far to the disk. Collective.
    ///
    /// A checkpoint needs this first: a run that goes on from it expects all frames before it in the file.
    pub fn sync(&mut self) -> Result<(), Error> {
        self.check_content()?;
        self.guarded(Frames::sync)?;
        self.learn_length();
        Ok(())
    }

    /// Remembers the length of the file after a write, until which nobody else may change it.
    fn learn_length(&mut self) {
        if let Some(watch) = &mut self.watch {
            watch.update(&self.path);
        }
    }

    /// Marks the run as completed and closes the file. Collective.
    ///
    /// `method` names the method that took the steps. `at_rest_by` is the key of `[stop]` that ended the run
    /// before `t_end`, if one did.
    pub fn finish(
        mut self,
        measures: &Measures,
        method: &str,
        at_rest_by: Option<&str>,
    ) -> Result<(), Error> {
        let measures = measures.agreed(self.comm);
        let method = agreed_text(self.comm, method);
        self.check()?;
        self.guarded(|frames| {
            frames.sync()?;
            at_rest_by.map_or(Ok(()), |by| frames.stopped(by))?;
            frames.complete(&measures, &method)
        })?;
        match self.frames.take() {
            Some(frames) => frames.close().map_err(|why| failure(&self.path, &why)),
            None => Ok(()),
        }
    }

    /// Writes what stopped the run before its end, and closes the file. Collective.
    pub fn stop(mut self, by: &str) -> Result<(), Error> {
        self.check()?;
        self.guarded(|frames| {
            frames.sync()?;
            frames.stopped(by)
        })?;
        match self.frames.take() {
            Some(frames) => frames.close().map_err(|why| failure(&self.path, &why)),
            None => Ok(()),
        }
    }

    /// How the rows of the last frame were written, as HDF5 itself reports it.
    ///
    /// `chunk collective`: all ranks wrote together. `independent (cause ...)`: the library fell back to
    /// independent writes. `serial`: the file is open without MPI.
    pub fn transfer_report(&self) -> &str {
        self.frames.as_ref().map_or("failed", Frames::transfer_report)
    }

    /// Calls `work` with the file. If that fails, the file is never touched again.
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
        // Closing is collective. A rank that panics cannot count on the others, so it leaves the file open.
        if std::thread::panicking() {
            mem::forget(self.frames.take());
        }
        // An error came first and is reported. After one of its own the file is left as it is.
        if self.frames.is_none() || self.check_content().is_err() {
            return;
        }
        if let Some(mut frames) = self.frames.take()
            && frames.sync().is_err()
        {
            mem::forget(frames);
        }
    }
}

impl RunInfo {
    /// The description of rank 0, on every rank. Collective.
    ///
    /// Metadata that differ between ranks would break the file.
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
    /// The same measures with the times of rank 0. Collective.
    fn agreed(&self, comm: &dyn Comm) -> Measures {
        let Seconds { forces, ghosts, lists, reduction, output } = self.seconds;
        let clocks = [self.wall_seconds, forces, ghosts, lists, reduction, output];
        let clocks = agreed(comm, clocks.map(f64::to_le_bytes)).map(f64::from_le_bytes);
        let [wall_seconds, forces, ghosts, lists, reduction, output] = clocks;
        Measures { wall_seconds, seconds: Seconds { forces, ghosts, lists, reduction, output }, ..*self }
    }
}

/// The numbers of rank 0, on every rank. Collective.
fn agreed<const K: usize>(comm: &dyn Comm, own: [[u8; 8]; K]) -> [[u8; 8]; K] {
    let mut bytes = own.as_flattened().to_vec();
    comm.broadcast(&mut bytes);
    let mut numbers = own;
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
        number.copy_from_slice(bytes);
    }
    numbers
}

/// The text of rank 0, on every rank. Collective.
fn agreed_text(comm: &dyn Comm, own: &str) -> String {
    let mut bytes = own.as_bytes().to_vec();
    comm.broadcast(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// An error with the message of HDF5.
///
/// It adds the free space if the disk is full, because HDF5 often does not say so.
fn failure(path: &Path, why: &hdf5::Error) -> Error {
    // A message of HDF5 has several lines. Ours have one line.
    let mut why = why.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some(folder) = path.parent()
        && let Some(free) = path::free_bytes(folder)
        && free < 1 << 20
    {
        why = format!("{why} ({free} bytes are free in {})", folder.display());
    }
    Error::Output { file: path.display().to_string(), why }
}
