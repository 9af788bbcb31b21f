//! The program against exact answers for the paper's contact model, and what no change of the code may break.
//! Where an exact value is derived: docs/design.md. All runs are on one rank, inside the test.

mod common;

#[path = "physics/balance.rs"]
mod balance;
#[path = "physics/friction.rs"]
mod friction;
#[path = "physics/impact.rs"]
mod impact;
#[path = "physics/reference.rs"]
mod reference;
#[path = "physics/rest.rs"]
mod rest;
#[path = "physics/solver.rs"]
mod solver;
