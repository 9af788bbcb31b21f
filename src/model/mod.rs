//! What is simulated, as pure functions of numbers: the contact law, walls, effects, and what a particle is made of.

pub mod contact;
pub mod effects;
pub mod particle;
pub mod wall;
