//! Particles in the order of their ids, in equal blocks over the ranks: what a frame of the output holds.

use super::{Comm, Parcels};
use crate::particle::{Motion, Spin};
use std::ops::Range;

/// The ids that `rank` of `size` ranks writes, of `count` in all.
pub fn block(count: u64, rank: usize, size: usize) -> Range<u64> {
    let length = count.div_ceil(size as u64);
    let start = |rank: usize| (length * rank as u64).min(count);
    start(rank)..start(rank + 1)
}

/// The states of this rank's block of ids, in order. Every id must be owned by exactly one rank. Collective.
pub fn by_id<W: Spin>(comm: &dyn Comm, count: u64, ids: &[u64], y: &[Motion<W>]) -> Vec<Motion<W>> {
    let own = block(count, comm.rank(), comm.size());
    let length = count.div_ceil(comm.size() as u64).max(1);
    let home = |id: u64| (id / length) as usize;
    let width = 1 + Motion::<W>::COMPONENTS;
    let mut counts = vec![0; comm.size()];
    ids.iter().filter(|&&id| home(id) != comm.rank()).for_each(|&id| counts[home(id)] += width as u64);
    let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
    let mut outgoing = Parcels::with_counts(&counts);
    let mut order: Vec<usize> = (0..ids.len()).filter(|&i| home(ids[i]) != comm.rank()).collect();
    order.sort_by_key(|&i| home(ids[i]));
    for (slots, &i) in outgoing.data.chunks_exact_mut(width).zip(&order) {
        // Ids travel as numbers: exact below 2^53.
        slots[0] = ids[i] as f64;
        y[i].pack(&mut slots[1..]);
    }
    comm.exchange(&outgoing, &mut incoming);
    let unset = Motion::unpack(&[f64::NAN; 9]);
    let mut rows = vec![unset; (own.end - own.start) as usize];
    for (&id, body) in ids.iter().zip(y).filter(|(id, _)| home(**id) == comm.rank()) {
        rows[(id - own.start) as usize] = *body;
    }
    for slots in incoming.data.chunks_exact(width) {
        rows[(slots[0] as u64 - own.start) as usize] = Motion::unpack(&slots[1..]);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;
    use crate::particle::{Spinning, Vec3};

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
                let rows = by_id(comm, count, &ids, &y);
                let expected: Vec<_> = block(count, comm.rank(), ranks).map(body).collect();
                assert_eq!(rows, expected);
            });
        }
    }
}
