//! Ghosts: copies of particles of other ranks that owned particles may touch, refreshed at every stage.

use super::{Comm, Parcels};
use crate::ode::Rows;
use crate::threads::{self, GRAIN};

/// The range of a rank's particles along an axis; empty (`low > high`) if it owns none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Lowest coordinate of a centre, m.
    pub low: f64,
    /// Highest coordinate of a centre, m.
    pub high: f64,
}

impl Extent {
    /// The extent of the given coordinates (m).
    pub fn of(z: impl Iterator<Item = f64>) -> Self {
        z.fold(Extent { low: f64::INFINITY, high: f64::NEG_INFINITY }, |extent, z| Extent {
            low: extent.low.min(z),
            high: extent.high.max(z),
        })
    }

    /// The smallest extent that contains all of `extents`.
    pub fn around(extents: impl Iterator<Item = Extent>) -> Self {
        extents.fold(Extent::of(std::iter::empty()), |all, extent| Extent {
            low: all.low.min(extent.low),
            high: all.high.max(extent.high),
        })
    }

    /// Length, m; negative if the extent is empty.
    pub fn length(&self) -> f64 {
        self.high - self.low
    }

    /// Whether `z` (m) is at most `cutoff` (m) away from the extent; `false` if the extent is empty.
    pub fn is_near(&self, z: f64, cutoff: f64) -> bool {
        self.low <= self.high && z >= self.low - cutoff && z <= self.high + cutoff
    }
}

/// The plan of the ghost exchange: which owned particles go to which ranks, and which ghosts come back.
///
/// Any two ranks may be partners, not only neighbouring ones: slabs may be thinner than the cutoff.
#[derive(Debug, Default)]
pub struct Halo {
    /// Indices of the owned particles to send, parcel after parcel.
    picks: Vec<u32>,
    outgoing: Parcels,
    incoming: Parcels,
    ghosts: usize,
    /// Numbers in a row of the state.
    width: usize,
    /// Rows that go to, and come from, every rank.
    counts: [Vec<u64>; 2],
}

impl Halo {
    /// Number of ghosts of this rank.
    pub fn ghosts(&self) -> usize {
        self.ghosts
    }

    /// Indices of the owned particles that are ghosts on other ranks, in the order of the parcels.
    ///
    /// A particle that is a ghost on several ranks occurs several times.
    pub fn picks(&self) -> impl ExactSizeIterator<Item = usize> + Clone {
        self.picks.iter().map(|&i| i as usize)
    }

    /// Makes the plan: an owned particle that `is_near` another rank becomes a ghost there. Collective.
    ///
    /// `ids` are those of the owned particles, of which `is_near` takes the rank and the index. Rows of the
    /// state have `width` numbers. Returns the ids of this rank's ghosts, in the order in which `refresh`
    /// delivers them.
    pub fn plan(
        &mut self,
        comm: &dyn Comm,
        ids: &[u64],
        width: usize,
        is_near: &dyn Fn(usize, usize) -> bool,
    ) -> Vec<u64> {
        self.picks.clear();
        let mut counts = vec![0; comm.size()];
        for q in (0..comm.size()).filter(|&q| q != comm.rank()) {
            let first = self.picks.len();
            self.picks.extend((0..ids.len()).filter(|&i| is_near(q, i)).map(|i| i as u32));
            counts[q] = (self.picks.len() - first) as u64;
        }
        let received = comm.transpose(&counts);
        self.ghosts = received.iter().sum::<u64>() as usize;
        // Ids are sent as doubles, which are exact below 2^53.
        let mut outgoing = Parcels::with_counts(&counts);
        let mut incoming = Parcels::with_counts(&received);
        for (slot, &i) in outgoing.data.iter_mut().zip(&self.picks) {
            *slot = ids[i as usize] as f64;
        }
        comm.exchange(&outgoing, &mut incoming);
        let ghost_ids = incoming.data.iter().map(|&id| id as u64).collect();
        (self.width, self.counts) = (width, [counts, received]);
        [self.outgoing, self.incoming] = self.parcels(width);
        ghost_ids
    }

    /// Parcels to and from all partners for rows of `width` numbers.
    fn parcels(&self, width: usize) -> [Parcels; 2] {
        let widen = |counts: &Vec<u64>| counts.iter().map(|count| count * width as u64).collect::<Vec<_>>();
        self.counts.each_ref().map(|counts| Parcels::with_counts(&widen(counts)))
    }

    /// Rows of the ghosts in a table of the owned particles that changes only when lists are built: `table`
    /// has rows of `width` numbers. Collective for partner ranks.
    pub fn gather(&self, comm: &dyn Comm, table: &[f64], width: usize) -> Vec<f64> {
        let [mut outgoing, mut incoming] = self.parcels(width);
        for (slots, &i) in outgoing.data.chunks_exact_mut(width.max(1)).zip(&self.picks) {
            slots.copy_from_slice(&table[i as usize * width..(i as usize + 1) * width]);
        }
        comm.exchange(&outgoing, &mut incoming);
        incoming.data
    }

    /// Whether this rank neither sends nor receives ghosts.
    pub fn is_idle(&self) -> bool {
        self.outgoing.ranks.is_empty() && self.incoming.ranks.is_empty()
    }

    /// Packs the particles that are ghosts on other ranks into parcels.
    ///
    /// `picked(k, i)` returns the state of the owned particle `i`, which is number `k` of [`Self::picks`].
    pub fn pack<'y>(&mut self, picked: impl Fn(usize, usize) -> &'y [f64] + Sync) {
        let rows = Rows { numbers: &mut self.outgoing.data, width: self.width };
        let pack = |first: usize, (rows, picks): (Rows, &[u32])| {
            for (k, (slots, &i)) in rows.numbers.chunks_exact_mut(rows.width).zip(picks).enumerate() {
                slots.copy_from_slice(picked(first + k, i as usize));
            }
        };
        threads::parts(self.picks.len(), GRAIN, (rows, &self.picks[..]), &pack, &|(), ()| ());
    }

    /// Exchanges the parcels that `pack` filled, and does `work` during the exchange. Collective for partner
    /// ranks.
    ///
    /// `deliver` then stores the ghosts that were received.
    pub fn exchange_during(&mut self, comm: &dyn Comm, work: &mut dyn FnMut()) {
        comm.exchange_during(&self.outgoing, &mut self.incoming, work);
    }

    /// Stores the states that the last exchange received in `ghosts`, one for each ghost.
    pub fn deliver(&self, ghosts: &mut [f64]) {
        threads::for_chunks(ghosts, 8 * GRAIN, |first, ghosts| {
            ghosts.copy_from_slice(&self.incoming.data[first..first + ghosts.len()]);
        });
    }

    /// Updates the ghosts from their owners' states `y`. Collective for partner ranks.
    pub fn refresh(&mut self, comm: &dyn Comm, y: &[f64], ghosts: &mut [f64]) {
        let width = self.width;
        self.pack(|_, i| &y[i * width..(i + 1) * width]);
        self.exchange_during(comm, &mut || ());
        self.deliver(ghosts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn an_empty_extent_is_near_nothing() {
        let none = Extent::of(std::iter::empty());
        assert!(!none.is_near(0.0, f64::INFINITY));
        assert!(Extent::of([1.0].into_iter()).is_near(1.5, 0.5));
        assert!(!Extent::of([1.0].into_iter()).is_near(1.51, 0.5));
    }

    #[test]
    fn ghosts_are_all_particles_of_other_ranks_within_reach() {
        // Layers of 0.1 m, one for each rank. They are thinner than the cutoff, so partners may be further
        // away than the next slab.
        for ranks in [1, 2, 4, 5] {
            team(ranks, |comm| {
                let body = |id: u64| [id as f64, 0.0, 0.1 * (id % ranks as u64) as f64, 0.5, -(id as f64)];
                let owner = |id: u64| (id % ranks as u64) as usize;
                let ids: Vec<u64> =
                    (0..40).filter(|&id| owner(id) == comm.rank() && owner(id) != 3).collect();
                let mut y: Vec<f64> = ids.iter().flat_map(|&id| body(id)).collect();
                let extents: Vec<Extent> = (0..ranks)
                    .map(|q| Extent::of((0..40).filter(|&id| owner(id) == q && q != 3).map(|id| body(id)[2])))
                    .collect();
                let mut halo = Halo::default();
                let is_near = |q: usize, i: usize| extents[q].is_near(y[5 * i + 2], 0.25);
                let ghost_ids = halo.plan(comm, &ids, 5, &is_near);
                let own_z = 0.1 * comm.rank() as f64;
                let mut expected: Vec<u64> = (0..40)
                    .filter(|&id| owner(id) != comm.rank() && owner(id) != 3)
                    .filter(|&id| comm.rank() != 3 && (body(id)[2] - own_z).abs() <= 0.25)
                    .collect();
                expected.sort_by_key(|&id| (owner(id), id));
                assert_eq!(ghost_ids, expected);
                // A refresh delivers what the owners have changed.
                let constants: Vec<f64> = ids.iter().flat_map(|&id| [id as f64, 0.5]).collect();
                y.chunks_exact_mut(5).for_each(|row| row[3] = 7.0);
                let mut ghosts = vec![0.0; 5 * halo.ghosts()];
                halo.refresh(comm, &y, &mut ghosts);
                for (ghost, &id) in ghosts.chunks_exact(5).zip(&ghost_ids) {
                    let mut sent = body(id);
                    sent[3] = 7.0;
                    assert_eq!(ghost, sent);
                }
                // So do columns that travel with the lists alone.
                let expected: Vec<f64> = ghost_ids.iter().flat_map(|&id| [id as f64, 0.5]).collect();
                assert_eq!(halo.gather(comm, &constants, 2), expected);
                assert!(halo.gather(comm, &[], 0).is_empty());
            });
        }
    }
}
