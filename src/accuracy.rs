//! What accuracy costs: `demhybrid accuracy` runs a scene over methods and tolerances, compares with what is known
//! exactly or with a reference of its own, and shows the result as tables, files and figures.

pub mod exact;
pub mod files;
pub mod plot;
pub mod records;
mod text;
