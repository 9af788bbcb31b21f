//! The files of a run: its output file, written and read, its checkpoints, and the lock of its one writer.

pub mod checkpoint;
pub mod load;
pub mod lock;
pub mod names;
pub mod output;
pub mod run_file;

use std::path::{Path, PathBuf};

/// The path of a file beside the output file of a run: its name with a dot and `ending` appended.
fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}
