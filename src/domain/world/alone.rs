//! One rank, and no MPI to start others: the build without the feature `mpi`. world/mpi.rs has the same names for the
//! build with it.

use super::comm::Solo;

/// What parallel HDF5 asks for: there is none.
#[derive(Debug, Clone, Copy)]
pub enum Communicator {}

/// All ranks: this one.
pub type World = Solo;

/// What lasts as long as the program.
pub struct Session {
    /// All ranks.
    pub world: World,
}

impl Session {
    /// Ends nothing.
    pub fn end(self) {}
}

/// Starts nothing.
pub fn start() -> Result<Session, &'static str> {
    Ok(Session { world: Solo })
}

/// How the program is built.
pub fn built() -> String {
    let hdf5 = if cfg!(feature = "bundled") { "bundled" } else { "the system's" };
    format!("without MPI, for one rank, with {hdf5}")
}

/// What to say where a launcher started more ranks than one.
pub fn foreign_launcher(_size: usize) -> String {
    "but it was built without MPI and can only be one: start it without mpirun or srun, or build it with MPI \
     (launch/setup.sh, or cargo install --locked --path .)"
        .into()
}
