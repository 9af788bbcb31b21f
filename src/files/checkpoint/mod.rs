//! Checkpoints: the files from which a run that was stopped or killed goes on.
//!
//! A run writes its checkpoints to two files beside its output, in turn. If a crash interrupts the writing of
//! one file, the other one is still whole.
//!
//! A file begins with the header ([`Header`]) and its checksum. Columns of numbers follow, in the order of
//! particle ids; every rank writes its block of rows. A table with the checksum of every block ends the file.
//!
//! Only this table depends on the number of ranks, and any number of ranks can read the file. A new file is
//! first written under a temporary name, then flushed to the disk, then renamed. The temporary name is the
//! process's own: a run that does not know yet that another one has taken its file over is in nobody's way.

mod file;
mod read;
#[cfg(test)]
mod tests;
mod write;

use crate::engine::simulation::{FrameSummary, Memory};
use crate::files::beside;
use crate::model::columns::{Changes, Columns};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use read::{look, read, verify};
pub use write::write;

/// Version of the file format. The program reads no other one.
pub const FORMAT: u32 = 8;

/// Everything in a checkpoint except the particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Number of checkpoints that this run has written, including this one.
    pub serial: u64,
    /// Version of the program that wrote the checkpoint.
    pub version: String,
    /// Processor architecture and vector instructions of the run.
    pub instruction_set: String,
    /// The scene with every default filled in, TOML.
    pub scene: String,
    /// Number of particles.
    pub count: u64,
    /// What a particle carries.
    pub columns: Columns,
    /// Contacts of a particle whose memories have room in its row, and the numbers in the memory of each; 0
    /// without friction that remembers.
    pub contact_slots: [u64; 2],
    /// Speed that scales errors of velocity, m/s.
    pub velocity_scale: f64,
    /// Wall time of the run so far, s.
    pub wall_seconds: f64,
    /// Summary of the frames so far.
    pub course: FrameSummary,
    /// What the next step depends on beside the particles.
    pub memory: Memory,
}

/// Paths of the two checkpoint files of the run that writes to `output`.
pub fn slots(output: &Path) -> [PathBuf; 2] {
    ["ckpt-a", "ckpt-b"].map(|ending| beside(output, ending))
}

/// Path of the stop file: if it exists, the run that writes to `output` stops.
pub fn stop_file(output: &Path) -> PathBuf {
    beside(output, "stop")
}

/// Path of the checkpoint number `serial`: an odd one goes to the first file, an even one to the second.
///
/// # Examples
///
/// ```rust
/// use demhybrid::files::checkpoint::{slot, slots, stop_file};
/// use std::path::Path;
///
/// let output = Path::new("bed.vtkhdf");
/// let [a, _] = slots(output);
/// assert_eq!(a, Path::new("bed.vtkhdf.ckpt-a"));
/// assert_eq!(slot(output, 4), Path::new("bed.vtkhdf.ckpt-b"));
/// assert_eq!(stop_file(output), Path::new("bed.vtkhdf.stop"));
/// ```
pub fn slot(output: &Path, serial: u64) -> PathBuf {
    let [a, b] = slots(output);
    if serial % 2 == 1 { a } else { b }
}

/// Path of the checkpoint `slot` as long as process number `process` writes it.
fn unfinished(slot: &Path, process: u32) -> PathBuf {
    beside(slot, &format!("{process}.tmp"))
}

/// Removes checkpoints and the stop file of an earlier run, so that nobody takes them for files of this run.
///
/// What cannot be removed stays, without an error.
pub fn clear(output: &Path) {
    clear_unfinished(output);
    for path in slots(output).into_iter().chain([stop_file(output)]) {
        let _ = std::fs::remove_file(path);
    }
}

/// Removes the checkpoints that earlier runs could not finish because they were killed.
///
/// What cannot be removed stays, without an error.
pub fn clear_unfinished(output: &Path) {
    let folder = output.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let slots = slots(output);
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if slots.iter().any(|slot| is_unfinished(slot, &path)) {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Whether a process wrote the checkpoint `slot` to `path` and did not finish.
fn is_unfinished(slot: &Path, path: &Path) -> bool {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let process = name(path)
        .strip_prefix(&name(slot))
        .and_then(|rest| rest.strip_prefix('.')?.strip_suffix(".tmp")?.parse::<u32>().ok());
    process.is_some()
}

/// Upper bound of the size of one checkpoint of `count` particles, bytes. The memory of a contact has
/// `memory` numbers.
pub fn bytes(count: u64, columns: &Columns, memory: usize) -> u64 {
    // As many contacts as equal spheres within the usual cutoff can have, each with the other id and with its
    // memory in three vectors.
    let contacts = if memory > 0 { 24 * (1 + 3 * memory as u64) } else { 0 };
    let [state, constants] = [Changes::EveryStage, Changes::WithLists].map(|changes| columns.width(changes));
    let numbers = 3 + (3 * state + constants) as u64 + contacts;
    // 64 KiB for the header and the table.
    (1 << 16) + count.saturating_mul(8 * numbers)
}
