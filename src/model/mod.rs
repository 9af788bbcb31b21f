//! What is simulated, as pure functions: the contact law, what contacts remember, walls, effects, and the
//! size and state of a particle.

pub mod columns;
pub mod contact;
pub mod dahl;
pub mod effects;
pub mod history;
pub mod materials;
pub mod rolling;
pub mod size;
pub mod wall;
