//! The ranks of an MPI job: the build with the feature `mpi`. world/alone.rs has the names for the other.

use super::comm::{Comm, Parcels};
use mpi::Threading;
use mpi::collective::SystemOperation;
use mpi::environment::Universe;
use mpi::request::{WaitGuard, scope};
use mpi::topology::{Communicator as _, SimpleCommunicator};
use mpi::traits::*;
use smallvec::SmallVec;

/// Number of partners up to which an exchange allocates no memory.
///
/// Partners are the ranks of the next slabs, and of further ones if slabs are thin.
const PARTNERS: usize = 8;

/// The communicator for parallel HDF5.
pub type Communicator = mpi::ffi::MPI_Comm;

/// An MPI session. MPI ends when this is dropped.
pub struct Session {
    /// All ranks.
    pub world: World,
    // Declared last, so that it is dropped after the communicator.
    _universe: Universe,
}

impl Session {
    /// Ends MPI.
    pub fn end(self) {}
}

/// Starts MPI. Only the calling thread, which must be the main one, may use it.
pub fn start() -> Result<Session, &'static str> {
    let (universe, threading) =
        mpi::initialize_with_threading(Threading::Funneled).ok_or("MPI cannot be started")?;
    if threading < Threading::Funneled {
        return Err("this MPI does not allow threads beside the one that calls it");
    }
    Ok(Session { world: World(universe.world()), _universe: universe })
}

/// How the program is built, such as `with MPI (Open MPI v4.1.4) and`.
pub fn built() -> String {
    let library = library();
    format!("with MPI ({}) and", library.split([',', '\n']).next().unwrap_or_default().trim())
}

/// End of the error message if a launcher started more ranks than the `size` that MPI sees.
pub fn foreign_launcher(size: usize) -> String {
    format!(
        "but MPI sees a world of {size}: this mpirun belongs to another MPI than the one demhybrid is \
         built with ({})",
        library()
    )
}

/// Name and version of the MPI library.
fn library() -> String {
    let text = mpi::environment::library_version().unwrap_or_default();
    text.trim_end_matches('\0').trim().to_string()
}

/// All ranks of the MPI job.
pub struct World(SimpleCommunicator);

impl Comm for World {
    fn rank(&self) -> usize {
        self.0.rank() as usize
    }
    fn size(&self) -> usize {
        self.0.size() as usize
    }
    fn max(&self, values: &mut [f64]) {
        debug_assert!(values.iter().all(|x| !x.is_nan()), "MPI_MAX does not order NaN");
        let own: SmallVec<[f64; 8]> = SmallVec::from_slice(values);
        self.0.all_reduce_into(&own[..], values, SystemOperation::max());
    }
    fn sum(&self, counts: &mut [u64]) {
        let own: SmallVec<[u64; 8]> = SmallVec::from_slice(counts);
        self.0.all_reduce_into(&own[..], counts, SystemOperation::sum());
    }
    fn all_gather(&self, own: &[f64], all: &mut [f64]) {
        self.0.all_gather_into(own, all);
    }
    fn transpose(&self, to: &[u64]) -> Vec<u64> {
        let mut from = vec![0; to.len()];
        self.0.all_to_all_into(to, &mut from[..]);
        from
    }
    fn exchange_during(&self, outgoing: &Parcels, incoming: &mut Parcels, work: &mut dyn FnMut()) {
        scope(|s| {
            let mut pending: SmallVec<[_; PARTNERS]> = SmallVec::new();
            let mut rest = &mut incoming.data[..];
            for (&q, b) in incoming.ranks.iter().zip(incoming.bounds.windows(2)) {
                let (parcel, tail) = rest.split_at_mut(b[1] - b[0]);
                rest = tail;
                let partner = self.0.process_at_rank(q as i32);
                pending.push(WaitGuard::from(partner.immediate_receive_into(s, parcel)));
            }
            let mut sent: SmallVec<[_; PARTNERS]> = SmallVec::new();
            for (q, parcel) in outgoing.iter() {
                sent.push(WaitGuard::from(self.0.process_at_rank(q as i32).immediate_send(s, parcel)));
            }
            work();
            // The guards wait for their requests when they are dropped, even if `work` panics. A request left
            // open would end the process without a message.
        });
    }
    fn broadcast(&self, bytes: &mut Vec<u8>) {
        let root = self.0.process_at_rank(0);
        let mut length = bytes.len() as u64;
        root.broadcast_into(&mut length);
        bytes.resize(length as usize, 0);
        // MPI counts have 32 bits, so long texts are sent in pieces.
        for piece in bytes.chunks_mut(1 << 30) {
            root.broadcast_into(piece);
        }
    }
    fn ranks_on_node(&self) -> usize {
        self.0.split_shared(self.0.rank()).size() as usize
    }
    fn raw(&self) -> Option<Communicator> {
        Some(self.0.as_raw())
    }
    fn abort(&self, code: i32) -> ! {
        self.0.abort(code)
    }
}
