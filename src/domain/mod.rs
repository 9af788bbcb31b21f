//! Domain decomposition: ranks own slabs of space, exchange ghosts, and pass particles on.

pub mod agreement;
pub mod comm;
pub mod exact;
pub mod halo;
pub mod launch;
pub mod migration;
pub mod rows;
pub mod slabs;
pub mod stdout;
pub mod table;
#[cfg_attr(feature = "mpi", path = "world/mpi.rs")]
#[cfg_attr(not(feature = "mpi"), path = "world/alone.rs")]
pub mod world;

pub use comm::{Comm, Parcels, Solo};
pub use table::Table;
pub use world::World;
