//! What accuracy costs: `demhybrid accuracy` runs a scene over methods and tolerances, compares with what is known
//! exactly or with a reference of its own, and shows the result as tables, files and figures.

mod advice;
pub mod command;
mod energy;
mod ensemble;
pub mod exact;
mod figures;
pub mod files;
mod findings;
mod impact;
pub mod plot;
pub mod records;
mod reference;
pub mod solvers;
mod starts;
mod state;
pub mod sweep;
#[cfg(test)]
mod testing;
pub(crate) mod text;
