//! Checkpoints: what a run needs to go on later, in two files beside its output that take turns, so that a crash while one
//! is written leaves the other.
//!
//! One file is a head (`Header`, with a checksum), then columns of numbers in the order of the particles' ids, which every
//! rank writes its block of, then a table with the checksum of every block. Nothing in it depends on the number of ranks
//! but the table, and any number of ranks can read it. It is written under another name, brought to the disk, and renamed.

mod file;
mod read;
#[cfg(test)]
mod tests;
mod write;

use crate::engine::simulation::{FrameSummary, Memory};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use read::{look, read, verify};
pub use write::write;

/// Format of the files; another one cannot be read.
pub const FORMAT: u32 = 1;

/// All of a checkpoint but the particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// How many checkpoints this run has written, this one included.
    pub serial: u64,
    /// Version of the program.
    pub version: String,
    /// Vector instructions of the run.
    pub instruction_set: String,
    /// The scene as resolved, TOML.
    pub scene: String,
    /// Particles.
    pub count: u64,
    /// Whether particles have spins.
    pub rotation: bool,
    /// Speed that errors of velocity are compared with, m/s.
    pub velocity_scale: f64,
    /// Wall time of the run so far, s.
    pub wall_seconds: f64,
    /// What the frames so far told.
    pub course: FrameSummary,
    /// What the next step depends on.
    pub memory: Memory,
}

/// The two files of the run that writes to `output`.
pub fn slots(output: &Path) -> [PathBuf; 2] {
    ["ckpt-a", "ckpt-b"].map(|ending| beside(output, ending))
}

/// The file whose existence stops the run that writes to `output`.
pub fn stop_file(output: &Path) -> PathBuf {
    beside(output, "stop")
}

/// The slot that the checkpoint of this `serial` number goes to.
pub fn slot(output: &Path, serial: u64) -> PathBuf {
    let [a, b] = slots(output);
    if serial % 2 == 1 { a } else { b }
}

/// `output` with another ending after its own.
fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}

/// Removes what an earlier run left, so that nobody takes it for this one's. Whatever cannot be removed stays.
pub fn clear(output: &Path) {
    for slot in slots(output) {
        let _ = std::fs::remove_file(beside(&slot, "tmp"));
        let _ = std::fs::remove_file(slot);
    }
    let _ = std::fs::remove_file(stop_file(output));
}

/// Bytes of one checkpoint of `count` particles, with or without spins, at most.
pub fn bytes(count: u64, rotation: bool) -> u64 {
    let numbers = 3 + 3 * file::width(rotation);
    // Head and table.
    (1 << 16) + count.saturating_mul(8 * numbers)
}
