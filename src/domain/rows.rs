//! Particles in the order of their ids, as a frame stores them. Each rank handles an equal block of ids.

use super::{Comm, Parcels};
use crate::threads::{self, GRAIN};
use std::ops::Range;

/// The block of ids that `rank` writes, out of `count` ids and `size` ranks.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::rows::block;
///
/// assert_eq!([0, 1, 2].map(|rank| block(10, rank, 3)), [0..4, 4..8, 8..10]);
/// ```
pub fn block(count: u64, rank: usize, size: usize) -> Range<u64> {
    let length = count.div_ceil(size as u64);
    let start = |rank: usize| (length * rank as u64).min(count);
    start(rank)..start(rank + 1)
}

/// Rows of this rank's block of ids, in id order.
///
/// Rows that this rank owns are borrowed, not copied.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::domain::rows::ById;
///
/// // Two columns of three particles, in the order in which a rank keeps them.
/// let by_id = ById::new(&Solo, 3, &[2, 0, 1], &[20.0, 21.0, 0.0, 1.0, 10.0, 11.0], 2);
/// assert_eq!(by_id.row(2), [20.0, 21.0]);
/// assert_eq!(by_id.map(|row| row[0]), [0.0, 10.0, 20.0]);
/// assert_eq!(by_id.columns(1..2), [1.0, 11.0, 21.0]);
/// ```
#[derive(Debug)]
pub struct ById<'a> {
    own: &'a [f64],
    guests: Vec<f64>,
    /// Numbers in a row.
    width: usize,
    /// Number of rows in `own`.
    owned: usize,
    /// For each id of the block: the index of its row in `own`, or the number of rows in `own` plus that in
    /// `guests`.
    slots: Vec<u32>,
}

impl<'a> ById<'a> {
    /// Collects the rows of this rank's block from their owners. Collective.
    ///
    /// This rank owns the particles `ids`, with the rows `own` of `width` numbers. Each id below `count` must
    /// be owned by exactly one rank.
    pub fn new(comm: &dyn Comm, count: u64, ids: &[u64], own: &'a [f64], width: usize) -> Self {
        // Called once: the loops below would call MPI for each particle.
        let rank = comm.rank();
        let block = block(count, rank, comm.size());
        let length = count.div_ceil(comm.size() as u64).max(1);
        let home = |id: u64| (id / length) as usize;
        let parcel = 1 + width;
        let mut counts = vec![0; comm.size()];
        ids.iter().filter(|&&id| home(id) != rank).for_each(|&id| counts[home(id)] += parcel as u64);
        let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
        let mut outgoing = Parcels::with_counts(&counts);
        let mut order: Vec<usize> = (0..ids.len()).filter(|&i| home(ids[i]) != rank).collect();
        order.sort_by_key(|&i| home(ids[i]));
        for (numbers, &i) in outgoing.data.chunks_exact_mut(parcel).zip(&order) {
            // Ids are sent as doubles, which are exact below 2^53.
            numbers[0] = ids[i] as f64;
            numbers[1..].copy_from_slice(&own[i * width..(i + 1) * width]);
        }
        comm.exchange(&outgoing, &mut incoming);
        let arrived = || incoming.data.chunks_exact(parcel);
        let mut slots = vec![u32::MAX; (block.end - block.start) as usize];
        for (i, &id) in ids.iter().enumerate().filter(|(_, id)| home(**id) == rank) {
            slots[(id - block.start) as usize] = i as u32;
        }
        for (k, numbers) in arrived().enumerate() {
            slots[(numbers[0] as u64 - block.start) as usize] = (ids.len() + k) as u32;
        }
        let guests = arrived().flat_map(|numbers| &numbers[1..]).copied().collect();
        ById { own, guests, width, owned: ids.len(), slots }
    }

    /// No rows.
    pub fn none() -> Self {
        ById { own: &[], guests: Vec::new(), width: 0, owned: 0, slots: Vec::new() }
    }

    /// The row of index `i` in the block.
    pub fn row(&self, i: usize) -> &[f64] {
        let (slot, owned) = (self.slots[i] as usize, self.owned);
        let (rows, k) = if slot < owned { (self.own, slot) } else { (&self.guests[..], slot - owned) };
        &rows[k * self.width..(k + 1) * self.width]
    }

    /// `of` of each row in id order, computed by the threads of this rank.
    pub fn map<T: Send>(&self, of: impl Fn(&[f64]) -> T + Sync) -> Vec<T> {
        threads::collect(self.slots.len(), GRAIN, |i| of(self.row(i)))
    }

    /// The numbers in some columns of each row, in id order, collected by the threads of this rank.
    pub fn columns(&self, columns: Range<usize>) -> Vec<f64> {
        let width = columns.len();
        let number = |k: usize| self.row(k / width)[columns.start + k % width];
        threads::collect(self.slots.len() * width, GRAIN, number)
    }

    /// The rows in id order.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        (0..self.slots.len()).map(|i| self.row(i))
    }

    /// Whether the block has no ids.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn blocks_cover_all_ids_once() {
        for count in [1, 2, 7, 200] {
            for size in 1..=9 {
                let ids: Vec<u64> = (0..size).flat_map(|rank| block(count, rank, size)).collect();
                assert_eq!(ids, (0..count).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn rows_are_in_id_order_for_every_number_of_ranks() {
        for (ranks, count) in [(1, 10), (2, 11), (3, 200), (5, 4)] {
            team(ranks, |comm| {
                let body = |id: u64| [id as f64, 1.0, 2.0, 0.5 * id as f64];
                let owner = |id: u64| (id * 7 % ranks as u64) as usize;
                let ids: Vec<u64> = (0..count).rev().filter(|&id| owner(id) == comm.rank()).collect();
                let y: Vec<f64> = ids.iter().flat_map(|&id| body(id)).collect();
                let rows = ById::new(comm, count, &ids, &y, 4);
                let expected: Vec<_> = block(count, comm.rank(), ranks).map(|id| body(id).to_vec()).collect();
                assert_eq!(rows.map(|row| row.to_vec()), expected);
                assert_eq!(rows.columns(1..3), [1.0, 2.0].repeat(expected.len()));
                assert_eq!(rows.is_empty(), expected.is_empty());
            });
        }
    }
}
