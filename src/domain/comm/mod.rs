//! The communicator: what the solver needs from a group of ranks, which is a few reductions and one exchange.
//!
//! [`Solo`] is a single rank. [`super::World`] is all ranks that were started.

#[cfg(test)]
pub mod team;

use super::world::Communicator;

/// Messages to or from several ranks in one flat buffer.
///
/// `data[bounds[k]..bounds[k + 1]]` is the parcel to or from `ranks[k]`.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Parcels;
///
/// let mut parcels = Parcels::with_counts(&[2, 0, 1]);
/// parcels.data.copy_from_slice(&[1.0, 2.0, 3.0]);
/// let all: Vec<(usize, &[f64])> = parcels.iter().collect();
/// assert_eq!(all, [(0, &[1.0, 2.0][..]), (2, &[3.0][..])]); // nothing for rank 1
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parcels {
    /// Partner ranks, ascending, without the own rank.
    pub ranks: Vec<usize>,
    /// Start of each parcel in `data`, then the end of the last one: `ranks.len() + 1` entries (or none if
    /// empty).
    pub bounds: Vec<usize>,
    /// The numbers of all parcels.
    pub data: Vec<f64>,
}

impl Parcels {
    /// Parcels of `counts[q]` zeros for each rank `q`, except ranks with a count of 0.
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

    /// Each partner with its parcel, in rank order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.ranks.iter().zip(self.bounds.windows(2)).map(|(&q, b)| (q, &self.data[b[0]..b[1]]))
    }
}

/// A group of ranks that compute one scene together.
///
/// All methods except `rank`, `size`, `raw` and `abort` are collective: every rank must call them in the same
/// order.
///
/// MPI allows calls from the main thread only. `dyn Comm` is not `Sync`, so the compiler checks that.
pub trait Comm {
    /// Number of this rank, from 0.
    fn rank(&self) -> usize;
    /// Number of ranks.
    fn size(&self) -> usize;
    /// Replaces each of `values` by its maximum over all ranks. Values must not be NaN. Collective.
    fn max(&self, values: &mut [f64]);
    /// Replaces each of `counts` by its wrapping sum over all ranks. Collective.
    fn sum(&self, counts: &mut [u64]);
    /// Fills `all` with the `own` of every rank in rank order: `all.len() == size * own.len()`. Collective.
    fn all_gather(&self, own: &[f64], all: &mut [f64]);
    /// Sends `to[q]` to each rank `q` and returns the number from each rank, in rank order. Collective.
    fn transpose(&self, to: &[u64]) -> Vec<u64>;
    /// Sends the parcels of `outgoing`, fills those of `incoming`, and does `work` during the exchange.
    /// Collective for the partners.
    ///
    /// The sizes of the incoming parcels must match what the partners send.
    fn exchange_during(&self, outgoing: &Parcels, incoming: &mut Parcels, work: &mut dyn FnMut());
    /// [`Self::exchange_during`] without work. Collective for the partners.
    fn exchange(&self, outgoing: &Parcels, incoming: &mut Parcels) {
        self.exchange_during(outgoing, incoming, &mut || ());
    }
    /// Replaces `bytes` by those of rank 0. Collective.
    fn broadcast(&self, bytes: &mut Vec<u8>);
    /// Number of ranks on this machine. Collective.
    fn ranks_on_node(&self) -> usize;
    /// The MPI communicator, if there is one. Parallel HDF5 needs it.
    fn raw(&self) -> Option<Communicator> {
        None
    }
    /// Ends all ranks at once, with this exit code.
    fn abort(&self, code: i32) -> !;
}

/// A single rank: every operation is the identity.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::{Comm, Solo};
///
/// let comm: &dyn Comm = &Solo;
/// assert_eq!((comm.rank(), comm.size()), (0, 1));
/// let mut values = [1.5, -2.0];
/// comm.max(&mut values);
/// assert_eq!(values, [1.5, -2.0]);
/// ```
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
