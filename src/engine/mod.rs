//! The solver: neighbour lists, the contact kernel, forces, the right-hand side, and the driver of a run.

pub mod contact_classes;
pub mod dynamics;
pub mod forces;
pub mod kernel;
pub mod load;
mod near_pairs;
pub mod neighbors;
mod pair_search;
pub mod simulation;
