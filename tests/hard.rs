//! The hard cases: every scene of tests/scenes/hard states in its first lines what could break and the one outcome that
//! is right. Here each runs with every method on one rank, and with the default method on three. docs/hard-cases.md has
//! what was measured (`cargo test --test hard -- --nocapture` prints it).

mod common;
#[path = "common/mpirun.rs"]
mod mpirun;

#[path = "hard/judge.rs"]
mod judge;
#[path = "hard/methods.rs"]
mod methods;
#[path = "hard/program.rs"]
mod program;
#[path = "hard/ranks.rs"]
mod ranks;
#[cfg(feature = "long-tests")]
#[path = "hard/rest.rs"]
mod rest;
#[path = "hard/scene.rs"]
mod scene;
