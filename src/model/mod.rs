//! What is simulated, as pure functions: the contact law, friction with memory, walls, effects, and the state
//! of a particle.

pub mod columns;
pub mod contact;
pub mod effects;
pub mod history;
pub mod wall;
