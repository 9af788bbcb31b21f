//! What accuracy costs: the runs of `demhybrid accuracy` as records, and their tables, files and figures.

pub mod files;
pub mod records;
mod text;
