//! A single rank: the build without the feature `mpi`. world/mpi.rs has the same names for the other build.

use super::comm::Solo;

/// The communicator for parallel HDF5: there is none.
#[derive(Debug, Clone, Copy)]
pub enum Communicator {}

/// All ranks: this one only.
pub type World = Solo;

/// The counterpart of an MPI session: nothing starts or ends.
pub struct Session {
    /// All ranks.
    pub world: World,
}

impl Session {
    /// Ends the session: does nothing.
    pub fn end(self) {}
}

/// Starts the session. It never fails.
pub fn start() -> Result<Session, &'static str> {
    Ok(Session { world: Solo })
}

/// How the program is built, such as `without MPI, for one rank, with bundled`.
pub fn built() -> String {
    let hdf5 = if cfg!(feature = "bundled") { "bundled" } else { "the system's" };
    format!("without MPI, for one rank, with {hdf5}")
}

/// End of the error message if a launcher started more ranks than one.
pub fn foreign_launcher(_size: usize) -> String {
    "but it was built without MPI and can only be one: start it without mpirun or srun, or build it with MPI \
     (launch/setup.sh, or cargo install --locked --path .)"
        .into()
}
