//! How the particles are spread over ranks: slabs along z, ghosts beyond them, migration between them.

pub mod comm;
pub mod exact;
pub mod halo;
pub mod migration;
pub mod rows;
pub mod slabs;

pub use comm::{Comm, Parcels, Solo, World};
