//! Migration: particles move to the rank that owns their height. A census finds lost and duplicated ones.

use super::slabs::Slabs;
use super::{Comm, Parcels, Table};
use crate::error::Error;
use crate::math::vector::Vec3;
use crate::model::columns::position;

/// Checksums over the ids of all particles. They are compared after every migration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Census {
    count: u64,
    sum: u64,
    mixed: u64,
}

impl Census {
    /// Takes the census of all ranks, where `ids` are those that this rank owns. Collective.
    pub fn take(comm: &dyn Comm, ids: &[u64]) -> Self {
        let mut sums = [ids.len() as u64, 0, 0];
        for &id in ids {
            sums[1] = sums[1].wrapping_add(id);
            sums[2] = sums[2].wrapping_add(scramble(id));
        }
        comm.sum(&mut sums);
        Census { count: sums[0], sum: sums[1], mixed: sums[2] }
    }

    /// Number of particles.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Takes the census again. If it differs, names the lowest id that is lost or duplicated. Collective.
    ///
    /// Ids must be 0..count. `t` (s) is the time for the error message.
    pub fn check(&self, comm: &dyn Comm, ids: &[u64], t: f64) -> Result<(), Error> {
        if Census::take(comm, ids) == *self {
            return Ok(());
        }
        // Each rank counts the occurrences of the ids in its own block.
        let block = self.count.div_ceil(comm.size() as u64).max(1);
        let home = |id: u64| ((id / block) as usize).min(comm.size() - 1);
        let mut counts = vec![0; comm.size()];
        ids.iter().for_each(|&id| counts[home(id)] += 1);
        counts[comm.rank()] = 0;
        let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
        let mut sorted: Vec<u64> = ids.iter().copied().filter(|&id| home(id) != comm.rank()).collect();
        sorted.sort_by_key(|&id| home(id));
        let mut outgoing = Parcels::with_counts(&counts);
        outgoing.data = sorted.iter().map(|&id| id as f64).collect();
        comm.exchange(&outgoing, &mut incoming);
        let first = block * comm.rank() as u64;
        let mut seen = vec![0u32; block.min(self.count.saturating_sub(first)) as usize];
        let kept = ids.iter().copied().filter(|&id| home(id) == comm.rank());
        for id in kept.chain(incoming.data.iter().map(|&id| id as u64)) {
            if let Some(times) = seen.get_mut((id - first) as usize) {
                *times += 1;
            }
        }
        // The lowest wrong id of all ranks: the maximum of the negative ids. An added 1/2 marks a duplicate.
        let wrong = seen.iter().position(|&times| times != 1);
        let mark = |k: usize| (first + k as u64) as f64 + if seen[k] > 1 { 0.5 } else { 0.0 };
        let mut lowest = [wrong.map_or(f64::NEG_INFINITY, |k| -mark(k))];
        comm.max(&mut lowest);
        let id = -lowest[0];
        let what = if id.fract() == 0.0 { "lost" } else { "duplicated" };
        Err(Error::Migration { id: id as u64, what, t })
    }
}

/// Mixes the bits of an id, so that errors do not cancel in a sum: the finaliser of SplitMix64.
pub fn scramble(id: u64) -> u64 {
    let mut z = id.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The ranks that own the heights of the particles in `state`, by index.
pub fn owners(slabs: &Slabs, state: &Table) -> Vec<usize> {
    let count = state.numbers.len() / state.width;
    (0..count).map(|i| slabs.owner(slabs.height(&position(state.row(i))))).collect()
}

/// Sends particle i to the rank `owners[i]`, for all i. Collective.
///
/// `ids` and `tables` are those of the owned particles. Particles that arrive are appended; the caller sorts
/// them.
pub fn migrate(comm: &dyn Comm, owners: &[usize], ids: &mut Vec<u64>, tables: &mut [Table]) {
    if comm.size() == 1 {
        return;
    }
    let width = 1 + tables.iter().map(|table| table.width).sum::<usize>();
    let mut counts = vec![0; comm.size()];
    owners.iter().filter(|&&q| q != comm.rank()).for_each(|&q| counts[q] += width as u64);
    let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
    let mut outgoing = Parcels::with_counts(&counts);
    let mut leaving: Vec<usize> = (0..ids.len()).filter(|&i| owners[i] != comm.rank()).collect();
    leaving.sort_by_key(|&i| owners[i]);
    for (slots, &i) in outgoing.data.chunks_exact_mut(width).zip(&leaving) {
        // Ids are sent as doubles, which are exact below 2^53.
        slots[0] = ids[i] as f64;
        let mut rest = &mut slots[1..];
        for table in tables.iter() {
            let (own, others) = rest.split_at_mut(table.width);
            own.copy_from_slice(table.row(i));
            rest = others;
        }
    }
    comm.exchange(&outgoing, &mut incoming);
    let keep = |i: usize| owners[i] == comm.rank();
    let mut index = 0..;
    ids.retain(|_| index.next().is_none_or(keep));
    tables.iter_mut().for_each(|table| table.retain(keep));
    for slots in incoming.data.chunks_exact(width) {
        ids.push(slots[0] as u64);
        let mut rest = &slots[1..];
        for table in tables.iter_mut() {
            let (own, others) = rest.split_at(table.width);
            table.numbers.extend_from_slice(own);
            rest = others;
        }
    }
}

/// Sorts the owned particles by a key made of position (m) and id. The first table is the state; the others
/// move along.
pub fn sort<K: Ord>(key: impl Fn(&Vec3, u64) -> K, ids: &mut Vec<u64>, tables: &mut [Table]) {
    let state = &tables[0];
    let keys: Vec<K> = ids.iter().enumerate().map(|(i, &id)| key(&position(state.row(i)), id)).collect();
    if keys.is_sorted() {
        return;
    }
    let mut order: Vec<usize> = (0..ids.len()).collect();
    order.sort_unstable_by(|&i, &j| keys[i].cmp(&keys[j]));
    tables.iter_mut().for_each(|table| table.reorder(&order));
    *ids = order.iter().map(|&i| ids[i]).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;
    use crate::domain::comm::team::team;

    fn body(id: u64) -> [f64; 6] {
        [0.5, 0.0, (id as f64 * 0.37).sin(), id as f64, 0.0, 0.0]
    }

    #[test]
    fn particles_arrive_at_the_owner_of_their_height_sorted_by_id() {
        for ranks in 1..=5 {
            team(ranks, |comm| {
                let mut ids: Vec<u64> =
                    (0..200).rev().filter(|id| *id as usize % ranks == comm.rank()).collect();
                let mut y: Vec<f64> = ids.iter().flat_map(|&id| body(id)).collect();
                let census = Census::take(comm, &ids);
                assert_eq!(census.count(), 200);
                let mut slabs = Slabs::new(ranks, [1.0; 3]);
                slabs.balance(comm, y.chunks_exact(6).map(|row| (row[2], 1)));
                let mut twins: Vec<f64> = ids.iter().flat_map(|&id| [id as f64, 0.25]).collect();
                let mut tables =
                    [Table { numbers: &mut y, width: 6 }, Table { numbers: &mut twins, width: 2 }];
                let owners = owners(&slabs, &tables[0]);
                migrate(comm, &owners, &mut ids, &mut tables);
                assert_eq!(census.check(comm, &ids, 0.0), Ok(()));
                sort(|_, id| id, &mut ids, &mut tables);
                assert!(ids.is_sorted());
                let height = |row: &[f64]| slabs.height(&position(row));
                assert!(y.chunks_exact(6).all(|row| slabs.owner(height(row)) == comm.rank()));
                assert!(ids.iter().zip(y.chunks_exact(6)).all(|(&id, found)| *found == body(id)));
                assert!(ids.iter().zip(twins.chunks_exact(2)).all(|(&id, twin)| *twin == [id as f64, 0.25]));
            });
        }
    }

    #[test]
    fn a_lost_particle_is_named() {
        let ids: Vec<u64> = (0..100).collect();
        let census = Census::take(&Solo, &ids);
        let fewer: Vec<u64> = ids.iter().copied().filter(|&id| id != 42).collect();
        assert_eq!(census.check(&Solo, &fewer, 1.5), Err(Error::Migration { id: 42, what: "lost", t: 1.5 }));
        let mut twice = fewer.clone();
        twice.push(17);
        assert_eq!(
            census.check(&Solo, &twice, 1.5),
            Err(Error::Migration { id: 17, what: "duplicated", t: 1.5 })
        );
    }

    #[test]
    fn a_particle_lost_on_any_rank_is_named_on_all() {
        for ranks in 2..=4 {
            team(ranks, |comm| {
                let mut ids: Vec<u64> = (0..50).filter(|id| *id as usize % ranks == comm.rank()).collect();
                let census = Census::take(comm, &ids);
                ids.retain(|&id| id != 31);
                let lost = Error::Migration { id: 31, what: "lost", t: 0.25 };
                assert_eq!(census.check(comm, &ids, 0.25), Err(lost));
            });
        }
    }
}
