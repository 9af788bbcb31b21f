//! What accuracy costs: `demhybrid accuracy` runs a scene with several methods and tolerances.
//!
//! It compares results with exact solutions or with its own reference, and writes tables, files and figures.

mod advice;
mod comparison;
mod energy;
mod ensemble;
pub mod exact;
mod figures;
pub mod files;
mod findings;
mod impact;
pub mod records;
mod reference;
mod request;
pub mod solvers;
mod starts;
mod state;
pub mod sweep;
#[cfg(test)]
mod testing;

pub use comparison::{Comparison, Found};
pub use records::Study;
pub use request::Request;
pub use solvers::METHODS;
pub use sweep::Sweep;
