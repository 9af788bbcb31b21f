//! How the particles are spread over the ranks: which ones this rank owns, and which ghosts it needs.

use super::ContactRecords;
use crate::domain::halo::{Extent, Halo};
use crate::domain::migration::{self, Census};
use crate::domain::slabs::Slabs;
use crate::domain::{Comm, Table};
use crate::engine::neighbors::{Key, Order};
use crate::error::Error;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::{Changes, Columns, POSITION, RADIUS, position};

/// Particles of this rank that do not change during a step: ids, constant columns, ghosts.
pub struct Decomposition<'c> {
    pub comm: &'c dyn Comm,
    census: Census,
    pub slabs: Slabs,
    pub halo: Halo,
    /// Ids of the owned particles in summation order, then of the ghosts.
    pub ids: Vec<u64>,
    /// Number of owned particles.
    pub owned: usize,
    /// What a particle carries.
    pub columns: Columns,
    /// Columns that change only when lists are built: rows of the owned particles, then of the ghosts.
    pub constants: Vec<f64>,
}

/// Up to which distance of their centres two particles count: a share of both radii and a gap.
#[derive(Debug, Clone, Copy)]
pub struct PairReach {
    /// Share of the radii.
    pub share: f64,
    /// What is added to it, m.
    pub gap: f64,
    /// Radius of a typical particle, m.
    pub typical: f64,
}

impl PairReach {
    /// The distance (m) for particles with the radii `a` and `b` (m).
    pub fn between(&self, a: f64, b: f64) -> f64 {
        self.share * (a + b) + self.gap
    }
}

/// Where the particles of every rank are along the axis of the slabs, by octaves of their radii. So a large
/// particle makes ghosts only of what is near to itself.
struct SizeSlices {
    /// The largest radius of each class, m.
    largest: Vec<f64>,
    /// By rank and class, row after row.
    extents: Vec<Extent>,
}

impl SizeSlices {
    /// Those of particles with these `radii` (m) at these heights (m). Collective.
    fn of(comm: &dyn Comm, radii: &[f64], height: &dyn Fn(usize) -> f64) -> Self {
        let class = |r: f64| r.log2().floor();
        let ends = radii.iter().map(|&r| class(r));
        let mut ends = ends.fold([f64::NEG_INFINITY; 2], |[low, high], c| [larger(low, -c), larger(high, c)]);
        comm.max(&mut ends);
        let [first, last] = [-ends[0], ends[1]];
        let count = (last - first + 1.0).max(0.0) as usize;
        let mut own = vec![[f64::INFINITY, f64::NEG_INFINITY]; count];
        for (i, &r) in radii.iter().enumerate() {
            let [low, high] = &mut own[(class(r) - first) as usize];
            (*low, *high) = (low.min(height(i)), high.max(height(i)));
        }
        let mut all = vec![0.0; 2 * count * comm.size()];
        comm.all_gather(own.as_flattened(), &mut all);
        let extents = all.as_chunks().0.iter().map(|&[low, high]| Extent { low, high }).collect();
        SizeSlices { largest: (0..count).map(|c| (first + c as f64 + 1.0).exp2()).collect(), extents }
    }

    /// Whether a particle at `height` (m) with the radius `r` (m) is within `reach` of particles of rank `q`.
    fn are_near(&self, q: usize, height: f64, r: f64, reach: PairReach) -> bool {
        let of_rank = self.extents[q * self.largest.len()..].iter();
        of_rank.zip(&self.largest).any(|(extent, &most)| extent.is_near(height, reach.between(r, most)))
    }
}

/// Owned particles and ghosts after a relocation, by local index.
pub struct Bodies {
    /// Rows of the state.
    pub rows: Vec<f64>,
    /// Positions in the summation order.
    pub keys: Vec<Key>,
}

impl<'c> Decomposition<'c> {
    /// Takes the particles `ids` with the states `y` and the constant columns `constants`. They may be spread
    /// over the ranks in any way. Collective.
    pub fn new(comm: &'c dyn Comm, ids: Vec<u64>, columns: Columns, constants: Vec<f64>, y: &[f64]) -> Self {
        let width = columns.width(Changes::EveryStage);
        let mut slabs = Slabs::new(comm.size(), sizes(comm, y, width));
        let heights: Vec<_> = y.chunks_exact(width).map(|row| (slabs.height(&position(row)), 1)).collect();
        slabs.balance(comm, heights.into_iter());
        let (census, owned) = (Census::take(comm, &ids), ids.len());
        Decomposition { comm, census, slabs, halo: Halo::default(), ids, owned, columns, constants }
    }

    /// Ids of the owned particles.
    pub fn own_ids(&self) -> &[u64] {
        &self.ids[..self.owned]
    }

    /// Constant columns of the owned particles.
    pub fn own_constants(&self) -> &[f64] {
        &self.constants[..self.owned * self.columns.width(Changes::WithLists)]
    }

    /// Number of particles on all ranks.
    pub fn count(&self) -> u64 {
        self.census.count()
    }

    /// Brings particles to their owners, adapts the slab bounds to the `loads` of the owned particles, and
    /// finds ghosts whose centres are within `reach` of those of other ranks. Collective.
    ///
    /// The first of the `tables` is the state; the others move along, and so do the `records` of contacts.
    pub fn relocate(
        &mut self,
        t: f64,
        loads: &[u64],
        tables: Vec<Table>,
        reach: PairReach,
        records: &mut ContactRecords,
    ) -> Result<Bodies, Error> {
        let cutoff = reach.between(reach.typical, reach.typical);
        let (comm, width) = (self.comm, tables[0].width);
        let constant = self.columns.width(Changes::WithLists);
        self.ids.truncate(self.owned);
        self.constants.truncate(self.owned * constant);
        let mut constants = std::mem::take(&mut self.constants);
        let mut tables: Vec<Table<'_>> = tables;
        if constant > 0 {
            tables.push(Table { numbers: &mut constants, width: constant });
        }
        if comm.size() > 1 {
            let own = loads.iter().sum::<u64>() as f64;
            let all: Vec<u64> = gather(comm, [own]).into_iter().map(|[load]| load as u64).collect();
            let y = &*tables[0].numbers;
            let turned = self.slabs.turn(sizes(comm, y, width));
            let heights = y.chunks_exact(width).map(|row| self.slabs.height(&position(row)));
            let particles: Vec<_> = heights.zip(loads.iter().copied()).collect();
            if turned {
                self.slabs.balance(comm, particles.into_iter());
            } else {
                self.slabs.follow(comm, particles.into_iter(), &all);
            }
        }
        let owners = migration::owners(&self.slabs, &tables[0]);
        records.follow(comm, &self.ids, &owners);
        migration::migrate(comm, &owners, &mut self.ids, &mut tables);
        self.owned = self.ids.len();
        self.census.check(comm, &self.ids, t)?;
        let [a, b, c] = extents(tables[0].numbers, width);
        let extents = gather(comm, [a.low, a.high, b.low, b.high, c.low, c.high]).into_iter();
        let extents: Vec<[Extent; 3]> =
            extents.map(|ends| [0, 2, 4].map(|k| Extent { low: ends[k], high: ends[k + 1] })).collect();
        let size = |axis: usize| Extent::around(extents.iter().map(|axes| axes[axis])).length();
        let order = Order::new([0, 1, 2].map(size), cutoff);
        migration::sort(|x, id| order.key(x, id), &mut self.ids, &mut tables);
        let axis = self.slabs.axis();
        let y = &tables[0].numbers[..];
        let height = |i: usize| y[i * width + axis];
        // The constant columns are the last table.
        let radii = self.columns.find(RADIUS).map(|(_, range)| {
            let rows = tables[tables.len() - 1].numbers.chunks_exact(constant);
            rows.map(|row| row[range.start]).collect::<Vec<_>>()
        });
        let ghost_ids = match radii {
            None => {
                let is_near = |q: usize, i: usize| extents[q][axis].is_near(height(i), cutoff);
                self.halo.plan(comm, &self.ids, width, &is_near)
            }
            Some(radii) => {
                let slices = SizeSlices::of(comm, &radii, &height);
                let is_near = |q: usize, i: usize| slices.are_near(q, height(i), radii[i], reach);
                self.halo.plan(comm, &self.ids, width, &is_near)
            }
        };
        self.ids.extend(ghost_ids);
        let mut rows = Vec::with_capacity(y.len() + self.halo.ghosts() * width);
        rows.extend_from_slice(y);
        rows.resize(y.len() + self.halo.ghosts() * width, 0.0);
        self.halo.refresh(comm, y, &mut rows[y.len()..]);
        drop(tables);
        if constant > 0 {
            let of_ghosts = self.halo.gather(comm, &constants, constant);
            constants.extend(of_ghosts);
        }
        self.constants = constants;
        let key = |(row, &id): (&[f64], &u64)| order.key(&position(row), id);
        let keys = rows.chunks_exact(width).zip(&self.ids).map(key).collect();
        Ok(Bodies { rows, keys })
    }

    /// Centres of the owned particles with the states `y`, m.
    pub fn centres(&self, y: &[f64]) -> impl Iterator<Item = Vec3> {
        y.chunks_exact(self.columns.width(Changes::EveryStage)).map(position)
    }
}

/// The numbers `own` of every rank, by rank. Collective.
pub fn gather<const K: usize>(comm: &dyn Comm, own: [f64; K]) -> Vec<[f64; K]> {
    let mut all = vec![[0.0; K]; comm.size()];
    comm.all_gather(&own, all.as_flattened_mut());
    all
}

/// Extent of the particles of this rank along each axis.
fn extents(y: &[f64], width: usize) -> [Extent; 3] {
    [0, 1, 2].map(|axis| Extent::of(y.chunks_exact(width).map(|row| row[POSITION.start + axis])))
}

/// Extent of the particles of all ranks along each axis, m; negative if there are none. Collective.
fn sizes(comm: &dyn Comm, y: &[f64], width: usize) -> [f64; 3] {
    let mut ends = extents(y, width).map(|extent| [-extent.low, extent.high]);
    comm.max(ends.as_flattened_mut());
    ends.map(|[low, high]| high + low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn a_large_sphere_makes_ghosts_of_its_own_partners_and_of_no_small_ones_beyond() {
        // 90 spheres up to z = 3 m; every ninth is 20 times as wide as the others.
        let radius = |id: usize| if id.is_multiple_of(9) { 0.2 } else { 0.01 + 1e-4 * (id % 7) as f64 };
        let height = |id: usize| 3.0 * ((id as f64 * 0.618_034) % 1.0);
        let reach = PairReach { share: 1.3, gap: 0.02, typical: 0.03 };
        for ranks in [2, 3] {
            team(ranks, |comm| {
                let owner = |id: usize| (height(id) / 3.0 * ranks as f64) as usize;
                let own: Vec<usize> = (0..90).filter(|&id| owner(id) == comm.rank()).collect();
                let radii: Vec<f64> = own.iter().map(|&id| radius(id)).collect();
                let slices = SizeSlices::of(comm, &radii, &|i| height(own[i]));
                let (mut needed, mut kept) = (0, 0);
                for &i in &own {
                    for q in (0..ranks).filter(|&q| q != comm.rank()) {
                        let near = slices.are_near(q, height(i), radius(i), reach);
                        let theirs = || (0..90).filter(|&j| owner(j) == q);
                        let apart = |j: usize| (height(i) - height(j)).abs();
                        let is_needed = theirs().any(|j| apart(j) <= reach.between(radius(i), radius(j)));
                        assert!(near || !is_needed, "{i} is no ghost of rank {q}");
                        // A class reaches as far as twice the radii in it.
                        let may_be = theirs().any(|j| apart(j) <= reach.between(radius(i), 2.0 * radius(j)));
                        assert!(!near || may_be, "{i} is a ghost of rank {q} for nothing");
                        needed += usize::from(is_needed);
                        kept += usize::from(near);
                    }
                }
                assert!(needed >= 2 && kept < own.len(), "{needed} and {kept} of {}", own.len());
            });
        }
    }
}
