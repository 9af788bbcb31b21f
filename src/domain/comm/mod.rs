//! What the solver needs from a group of ranks: a few reductions and one exchange.
//! `Solo` is the identity for a single rank; [`super::World`] is all ranks that were started.

#[cfg(test)]
pub mod team;

use super::world::Communicator;

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
    fn raw(&self) -> Option<Communicator> {
        None
    }
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
    fn abort(&self, code: i32) -> ! {
        std::process::exit(code)
    }
}
