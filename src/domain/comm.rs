//! What the solver needs from a group of ranks: a few reductions and one exchange.
//! `Solo` is the identity for a single rank; `World` is MPI.

#[cfg(test)]
pub mod team;

use mpi::collective::SystemOperation;
use mpi::ffi::MPI_Comm;
use mpi::request::{WaitGuard, scope};
use mpi::topology::SimpleCommunicator;
use mpi::traits::*;
use smallvec::SmallVec;

/// Partners of a rank for whose messages no memory is allocated: the next slabs, and those beyond where slabs are thin.
const PARTNERS: usize = 8;

/// Messages to or from several ranks in one flat buffer: `data[bounds[k]..bounds[k + 1]]` belongs to `ranks[k]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parcels {
    /// Partner ranks, ascending, never the own rank.
    pub ranks: Vec<usize>,
    /// Start of each parcel in `data`, and the end of the last one; length `ranks.len() + 1` (or 0 when empty).
    pub bounds: Vec<usize>,
    /// The numbers.
    pub data: Vec<f64>,
}

impl Parcels {
    /// Room for `counts[q]` numbers from or to every rank `q`; partners with a count of 0 are left out.
    pub fn with_counts(counts: &[u64]) -> Self {
        let ranks: Vec<usize> = (0..counts.len()).filter(|&q| counts[q] > 0).collect();
        let mut bounds = Vec::with_capacity(ranks.len() + 1);
        bounds.push(0);
        let mut end = 0;
        for &q in &ranks {
            end += counts[q] as usize;
            bounds.push(end);
        }
        Parcels { ranks, bounds, data: vec![0.0; end] }
    }

    /// Partner and parcel, in rank order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.ranks.iter().zip(self.bounds.windows(2)).map(|(&q, b)| (q, &self.data[b[0]..b[1]]))
    }
}

/// A group of ranks that compute one scene together. All methods but `rank`, `size` and `abort` are collective:
/// every rank calls them in the same order.
///
/// MPI allows calls from the main thread only; `dyn Comm` is not `Sync`, so the compiler checks that.
pub trait Comm {
    /// This rank, 0-based.
    fn rank(&self) -> usize;
    /// Number of ranks.
    fn size(&self) -> usize;
    /// Element-wise maximum over ranks, in place. Values must not be NaN. Collective.
    fn max(&self, values: &mut [f64]);
    /// Element-wise wrapping sum over ranks, in place. Collective.
    fn sum(&self, counts: &mut [u64]);
    /// The `own` of every rank, one after the other: `all.len() == size * own.len()`. Collective.
    fn all_gather(&self, own: &[f64], all: &mut [f64]);
    /// `to[q]` is handed to rank `q`; the answer holds what every rank handed to this one. Collective.
    fn transpose(&self, to: &[u64]) -> Vec<u64>;
    /// Sends every parcel of `outgoing` and fills every parcel of `incoming`, whose sizes must match what the
    /// partners send; does `work` while the parcels are under way. Collective for the partners.
    fn exchange_during(&self, outgoing: &Parcels, incoming: &mut Parcels, work: &mut dyn FnMut());
    /// `exchange_during` without work. Collective for the partners.
    fn exchange(&self, outgoing: &Parcels, incoming: &mut Parcels) {
        self.exchange_during(outgoing, incoming, &mut || ());
    }
    /// The bytes of rank 0, on every rank. Collective.
    fn broadcast(&self, bytes: &mut Vec<u8>);
    /// How many ranks share this machine. Collective.
    fn ranks_on_node(&self) -> usize;
    /// The MPI communicator, if there is one; parallel HDF5 asks for it.
    fn raw(&self) -> Option<MPI_Comm>;
    /// Ends all ranks at once.
    fn abort(&self, code: i32) -> !;
}

/// One rank alone: every operation is the identity.
#[derive(Debug, Clone, Copy, Default)]
pub struct Solo;

impl Comm for Solo {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn max(&self, _values: &mut [f64]) {}
    fn sum(&self, _counts: &mut [u64]) {}
    fn all_gather(&self, own: &[f64], all: &mut [f64]) {
        all.copy_from_slice(own);
    }
    fn transpose(&self, to: &[u64]) -> Vec<u64> {
        to.to_vec()
    }
    fn exchange_during(&self, outgoing: &Parcels, _incoming: &mut Parcels, work: &mut dyn FnMut()) {
        debug_assert!(outgoing.ranks.is_empty(), "a lone rank has no partners");
        work();
    }
    fn broadcast(&self, _bytes: &mut Vec<u8>) {}
    fn ranks_on_node(&self) -> usize {
        1
    }
    fn raw(&self) -> Option<MPI_Comm> {
        None
    }
    fn abort(&self, code: i32) -> ! {
        std::process::exit(code)
    }
}

/// All ranks of the MPI job.
pub struct World(SimpleCommunicator);

impl World {
    /// Wraps MPI's world communicator. MPI must have been initialised by this thread.
    pub fn new(world: SimpleCommunicator) -> Self {
        World(world)
    }
}

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
            // Guards wait when they go, also where `work` panics: an open request would end the process without a word.
        });
    }
    fn broadcast(&self, bytes: &mut Vec<u8>) {
        let root = self.0.process_at_rank(0);
        let mut length = bytes.len() as u64;
        root.broadcast_into(&mut length);
        bytes.resize(length as usize, 0);
        // MPI counts are 32-bit: long texts go in pieces.
        for piece in bytes.chunks_mut(1 << 30) {
            root.broadcast_into(piece);
        }
    }
    fn ranks_on_node(&self) -> usize {
        self.0.split_shared(self.0.rank()).size() as usize
    }
    fn raw(&self) -> Option<MPI_Comm> {
        Some(self.0.as_raw())
    }
    fn abort(&self, code: i32) -> ! {
        self.0.abort(code)
    }
}
