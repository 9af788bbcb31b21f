//! Particles in the order of their ids, as a frame stores them. Each rank handles an equal block of ids.

use super::{Comm, Parcels};
use crate::model::particle::{Motion, Spin};
use crate::threads::{self, GRAIN};
use std::ops::Range;

/// The block of ids that `rank` writes, out of `count` ids and `size` ranks.
pub fn block(count: u64, rank: usize, size: usize) -> Range<u64> {
    let length = count.div_ceil(size as u64);
    let start = |rank: usize| (length * rank as u64).min(count);
    start(rank)..start(rank + 1)
}

/// The states of this rank's block of ids, in id order.
///
/// States that this rank owns are borrowed, not copied.
#[derive(Debug)]
pub struct ById<'a, W> {
    own: &'a [Motion<W>],
    guests: Vec<Motion<W>>,
    /// For each id of the block: its index in `own`, or the length of `own` plus its index in `guests`.
    slots: Vec<u32>,
}

impl<'a, W: Spin> ById<'a, W> {
    /// Collects the states of this rank's block from their owners. Collective.
    ///
    /// This rank owns the particles `ids` with the states `y`. Each id below `count` must be owned by exactly
    /// one rank.
    pub fn new(comm: &dyn Comm, count: u64, ids: &[u64], y: &'a [Motion<W>]) -> Self {
        // Called once: the loops below would call MPI for each particle.
        let rank = comm.rank();
        let block = block(count, rank, comm.size());
        let length = count.div_ceil(comm.size() as u64).max(1);
        let home = |id: u64| (id / length) as usize;
        let width = 1 + Motion::<W>::COMPONENTS;
        let mut counts = vec![0; comm.size()];
        ids.iter().filter(|&&id| home(id) != rank).for_each(|&id| counts[home(id)] += width as u64);
        let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
        let mut outgoing = Parcels::with_counts(&counts);
        let mut order: Vec<usize> = (0..ids.len()).filter(|&i| home(ids[i]) != rank).collect();
        order.sort_by_key(|&i| home(ids[i]));
        for (numbers, &i) in outgoing.data.chunks_exact_mut(width).zip(&order) {
            // Ids are sent as doubles, which are exact below 2^53.
            numbers[0] = ids[i] as f64;
            y[i].pack(&mut numbers[1..]);
        }
        comm.exchange(&outgoing, &mut incoming);
        let arrived = || incoming.data.chunks_exact(width);
        let mut slots = vec![u32::MAX; (block.end - block.start) as usize];
        for (i, &id) in ids.iter().enumerate().filter(|(_, id)| home(**id) == rank) {
            slots[(id - block.start) as usize] = i as u32;
        }
        for (k, numbers) in arrived().enumerate() {
            slots[(numbers[0] as u64 - block.start) as usize] = (y.len() + k) as u32;
        }
        ById { own: y, guests: arrived().map(|numbers| Motion::unpack(&numbers[1..])).collect(), slots }
    }

    /// `of` of each state in id order, computed by the threads of this rank.
    pub fn map<T: Send>(&self, of: impl Fn(&Motion<W>) -> T + Sync) -> Vec<T> {
        threads::collect(self.slots.len(), GRAIN, |i| {
            let slot = self.slots[i] as usize;
            of(self.own.get(slot).unwrap_or_else(|| &self.guests[slot - self.own.len()]))
        })
    }

    /// The states in id order.
    pub fn iter(&self) -> impl Iterator<Item = &Motion<W>> {
        self.slots.iter().map(|&slot| {
            let slot = slot as usize;
            self.own.get(slot).unwrap_or_else(|| &self.guests[slot - self.own.len()])
        })
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
    use crate::math::vector::Vec3;
    use crate::model::particle::Spinning;

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
                let body = |id: u64| Motion {
                    x: Vec3::new(id as f64, 1.0, 2.0),
                    v: Vec3::zeros(),
                    omega: Spinning(Vec3::new(0.0, 0.0, id as f64)),
                };
                let owner = |id: u64| (id * 7 % ranks as u64) as usize;
                let ids: Vec<u64> = (0..count).rev().filter(|&id| owner(id) == comm.rank()).collect();
                let y: Vec<_> = ids.iter().map(|&id| body(id)).collect();
                let rows = ById::new(comm, count, &ids, &y);
                let expected: Vec<_> = block(count, comm.rank(), ranks).map(body).collect();
                assert_eq!(rows.map(|body| *body), expected);
                assert_eq!(rows.is_empty(), expected.is_empty());
            });
        }
    }
}
