//! The program against exact answers for the paper's contact model, and what no change of the code may break.
//! Where an exact value is derived: docs/model.md. All runs are on one rank, inside the test.

mod balance;
#[path = "../../benches/common/mod.rs"]
mod beds;
mod brake;
mod common;
mod contacts;
mod friction;
mod hard;
mod impact;
mod materials;
mod memory;
#[path = "../program/mpirun.rs"]
mod mpirun;
#[cfg(feature = "long-tests")]
mod packing;
mod properties;
mod reference;
mod rest;
mod rolling;
mod scaling;
mod sizes;
mod solver;
mod starts;
