//! The files of a run: its output file, written and read, and its checkpoints.

pub mod checkpoint;
pub mod names;
pub mod output;
pub mod run_file;
