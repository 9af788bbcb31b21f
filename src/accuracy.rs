//! What accuracy costs: the runs of `demhybrid accuracy` as records, and their tables, files and figures.

pub mod files;
pub mod plot;
pub mod records;
mod text;
