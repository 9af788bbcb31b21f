//! What is simulated, as pure functions: the contact law, walls, effects, and the state of a particle.

pub mod columns;
pub mod contact;
pub mod effects;
pub mod wall;
