//! The hard cases: every scene of tests/scenes/hard states in its first lines what could break and the one
//! outcome that is right. Here each runs with every method on one rank, and with the default method on three.
//! docs/hard-cases.md has what was measured (`cargo test --test physics hard:: -- --nocapture` prints it).

mod judge;
mod methods;
mod program;
mod ranks;
#[cfg(feature = "long-tests")]
mod rest;
mod scene;
