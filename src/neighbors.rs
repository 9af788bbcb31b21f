//! Who may touch whom: a cell grid finds pairs within reach, lists remember them until a particle outruns the skin.

use crate::container::Wall;
use crate::particle::Vec3;
use rayon::prelude::*;

/// Particles sorted into cells as wide as the reach. The table wraps around, so that its size follows the number of
/// particles and not the distance between the furthest two.
struct Cells {
    width: f64,
    dims: [i64; 3],
    /// Start of each bucket in `items`; one more than there are buckets.
    start: Vec<u32>,
    items: Vec<u32>,
}

impl Cells {
    fn new(x: &[Vec3], width: f64) -> Self {
        let mut cells = Cells { width, dims: [1; 3], start: Vec::new(), items: vec![0; x.len()] };
        let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
        for x in x {
            for (axis, c) in cells.coordinates(x).into_iter().enumerate() {
                low[axis] = low[axis].min(c);
                high[axis] = high[axis].max(c);
            }
        }
        let room = 2 * x.len() as i64 + 64;
        let extent = |axis: usize| high[axis].saturating_sub(low[axis]).clamp(0, room) + 1;
        cells.dims = [extent(0), extent(1), extent(2)];
        while cells.dims.iter().product::<i64>() > room {
            let widest = (0..3).max_by_key(|&axis| cells.dims[axis]).expect("there are three axes");
            cells.dims[widest] = (cells.dims[widest] + 1) / 2;
        }
        let buckets = cells.dims.iter().product::<i64>() as usize;
        let home: Vec<u32> = x.iter().map(|x| cells.bucket(cells.coordinates(x)) as u32).collect();
        cells.start = vec![0; buckets + 1];
        for &b in &home {
            cells.start[b as usize + 1] += 1;
        }
        for b in 0..buckets {
            cells.start[b + 1] += cells.start[b];
        }
        let mut fill = cells.start.clone();
        for (i, &b) in home.iter().enumerate() {
            cells.items[fill[b as usize] as usize] = i as u32;
            fill[b as usize] += 1;
        }
        cells
    }

    /// Casts saturate: a particle beyond 1e18 cells shares the last one.
    fn coordinates(&self, x: &Vec3) -> [i64; 3] {
        [0, 1, 2].map(|axis| ((x[axis] / self.width).floor() as i64).clamp(-(1 << 60), 1 << 60))
    }

    fn bucket(&self, c: [i64; 3]) -> usize {
        let wrap = |axis: usize| c[axis].rem_euclid(self.dims[axis]);
        ((wrap(2) * self.dims[1] + wrap(1)) * self.dims[0] + wrap(0)) as usize
    }

    /// Calls `visit` for every particle in the cells around `x`, once each, in no order that matters.
    fn for_each_near(&self, x: &Vec3, mut visit: impl FnMut(u32)) {
        let c = self.coordinates(x);
        // Offsets that lead to different buckets: in a table of one or two cells some wrap onto each other.
        let offsets = |axis: usize| match self.dims[axis] {
            1 => 0..=0,
            2 => 0..=1,
            _ => -1..=1,
        };
        for dz in offsets(2) {
            for dy in offsets(1) {
                for dx in offsets(0) {
                    let b = self.bucket([c[0] + dx, c[1] + dy, c[2] + dz]);
                    for &j in &self.items[self.start[b] as usize..self.start[b + 1] as usize] {
                        visit(j);
                    }
                }
            }
        }
    }
}

/// One contact of an owned particle: a pair, and whether the particle is its lower or higher id.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry(u32);

impl Entry {
    fn new(pair: usize, higher: bool) -> Self {
        Entry((pair as u32) << 1 | u32::from(higher))
    }
    /// Index into `Lists::pairs`.
    #[inline(always)]
    pub fn pair(self) -> usize {
        (self.0 >> 1) as usize
    }
    /// The particle has the higher id: the pair's force acts on it with the opposite sign.
    #[inline(always)]
    pub fn is_higher(self) -> bool {
        self.0 & 1 == 1
    }
}

/// Pairs and walls that the owned particles of a rank may touch before a particle has moved by half the skin.
/// Every pair is listed once, also where only one of its particles is owned.
#[derive(Debug, Default)]
pub struct Lists {
    /// Local indices of the two particles, the lower id first. Owned particles come before ghosts.
    pub pairs: Vec<[u32; 2]>,
    /// Contacts of owned particle i: `entries[entry_start[i]..entry_start[i + 1]]`, by the id of the partner.
    entries: Vec<Entry>,
    entry_start: Vec<u32>,
    /// Walls near owned particle i, in the order of the scene.
    walls: Vec<u32>,
    wall_start: Vec<u32>,
}

impl Lists {
    /// Lists every pair with an owned particle whose centres are within `reach` (m), and every wall within
    /// `wall_reach` (m) of an owned centre. `x` and `ids` hold the owned particles first, then the ghosts.
    pub fn rebuild(
        &mut self,
        x: &[Vec3],
        ids: &[u64],
        owned: usize,
        reach: f64,
        walls: &[Wall],
        wall_reach: f64,
    ) {
        let cells = Cells::new(x, reach);
        let near = |range: std::ops::Range<usize>| {
            let mut pairs = Vec::new();
            for i in range {
                let first = pairs.len();
                cells.for_each_near(&x[i], |j| {
                    // Both owned: found from both sides, kept from one.
                    if j as usize > i && (x[i] - x[j as usize]).norm_squared() <= reach * reach {
                        pairs.push([i as u32, j]);
                    }
                });
                pairs[first..].sort_unstable_by_key(|pair| ids[pair[1] as usize]);
            }
            pairs
        };
        self.pairs.clear();
        let threads = rayon::current_num_threads();
        if threads == 1 || owned < 2 * crate::parallel::GRAIN {
            self.pairs.extend(near(0..owned));
        } else {
            let size = owned.div_ceil(4 * threads);
            let parts: Vec<Vec<[u32; 2]>> = (0..owned.div_ceil(size))
                .into_par_iter()
                .map(|k| near(k * size..((k + 1) * size).min(owned)))
                .collect();
            parts.iter().for_each(|part| self.pairs.extend_from_slice(part));
        }
        for pair in &mut self.pairs {
            if ids[pair[0] as usize] > ids[pair[1] as usize] {
                pair.swap(0, 1);
            }
        }
        assert!(self.pairs.len() < 1 << 31, "a rank lists fewer than 2^31 pairs: more ranks share the work");
        self.list_entries(ids, owned);
        self.list_walls(x, owned, walls, wall_reach);
    }

    fn list_entries(&mut self, ids: &[u64], owned: usize) {
        self.entry_start.clear();
        self.entry_start.resize(owned + 1, 0);
        let ends =
            |pair: &[u32; 2]| [(pair[0] as usize, pair[1] as usize), (pair[1] as usize, pair[0] as usize)];
        for pair in &self.pairs {
            for (i, _) in ends(pair) {
                if i < owned {
                    self.entry_start[i + 1] += 1;
                }
            }
        }
        for i in 0..owned {
            self.entry_start[i + 1] += self.entry_start[i];
        }
        let mut fill = self.entry_start.clone();
        self.entries.clear();
        self.entries.resize(self.entry_start[owned] as usize, Entry(0));
        for (p, pair) in self.pairs.iter().enumerate() {
            for (side, (i, _)) in ends(pair).into_iter().enumerate() {
                if i < owned {
                    self.entries[fill[i] as usize] = Entry::new(p, side == 1);
                    fill[i] += 1;
                }
            }
        }
        let pairs = &self.pairs;
        let partner = |entry: &Entry| ids[pairs[entry.pair()][usize::from(!entry.is_higher())] as usize];
        for i in 0..owned {
            let range = self.entry_start[i] as usize..self.entry_start[i + 1] as usize;
            self.entries[range].sort_unstable_by_key(partner);
        }
    }

    fn list_walls(&mut self, x: &[Vec3], owned: usize, walls: &[Wall], wall_reach: f64) {
        self.walls.clear();
        self.wall_start.clear();
        self.wall_start.push(0);
        for x in &x[..owned] {
            let near = walls.iter().enumerate().filter(|(_, wall)| wall.depth(x) <= wall_reach);
            self.walls.extend(near.map(|(k, _)| k as u32));
            self.wall_start.push(self.walls.len() as u32);
        }
    }

    /// Contacts of owned particle `i` in the order of their partners' ids: sums over them have the same bits on
    /// every rank.
    #[inline(always)]
    pub fn entries(&self, i: usize) -> &[Entry] {
        &self.entries[self.entry_start[i] as usize..self.entry_start[i + 1] as usize]
    }

    /// Indices of the walls near owned particle `i`, ascending.
    #[inline(always)]
    pub fn walls(&self, i: usize) -> &[u32] {
        &self.walls[self.wall_start[i] as usize..self.wall_start[i + 1] as usize]
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        self.pairs.capacity() * 8
            + (self.entries.capacity() + self.entry_start.capacity()) * 4
            + (self.walls.capacity() + self.wall_start.capacity()) * 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::collections::BTreeSet;

    fn cloud(n: usize, size: [f64; 3], seed: u64) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| Vec3::from_fn(|axis, _| size[axis] * (rng.random::<f64>() - 0.3))).collect()
    }

    fn listed(x: &[Vec3], ids: &[u64], owned: usize, reach: f64) -> (Lists, BTreeSet<[u32; 2]>) {
        let mut lists = Lists::default();
        lists.rebuild(x, ids, owned, reach, &[], 0.0);
        let set: BTreeSet<_> = lists.pairs.iter().copied().collect();
        assert_eq!(set.len(), lists.pairs.len(), "a pair is listed twice");
        (lists, set)
    }

    fn brute_force(x: &[Vec3], ids: &[u64], owned: usize, reach: f64) -> BTreeSet<[u32; 2]> {
        let mut set = BTreeSet::new();
        for i in 0..owned {
            for j in i + 1..x.len() {
                if (x[i] - x[j]).norm_squared() <= reach * reach {
                    let (i, j) = if ids[i] < ids[j] { (i, j) } else { (j, i) };
                    set.insert([i as u32, j as u32]);
                }
            }
        }
        set
    }

    #[test]
    fn lists_hold_the_pairs_that_brute_force_finds() {
        let boxes = [[1.0, 1.0, 1.0], [0.1, 0.1, 0.1], [5.0, 0.2, 0.2], [0.3, 4.0, 0.5], [1e7, 1.0, 1.0]];
        for (seed, size) in boxes.into_iter().enumerate() {
            for n in [1, 2, 40, 150] {
                let x = cloud(n, size, seed as u64);
                let ids: Vec<u64> = (0..n as u64).map(|k| (k * 7919) % 10_007).collect();
                for owned in [0, n / 2, n] {
                    assert_eq!(listed(&x, &ids, owned, 0.3).1, brute_force(&x, &ids, owned, 0.3));
                }
            }
        }
    }

    #[test]
    fn contacts_are_ordered_by_the_id_of_the_partner() {
        let x = cloud(120, [1.0, 1.0, 0.5], 3);
        let ids: Vec<u64> = (0..120).map(|k| (k * 7919) % 10_007).collect();
        let owned = 90;
        let (lists, set) = listed(&x, &ids, owned, 0.3);
        for i in 0..owned {
            let partners: Vec<u64> = lists
                .entries(i)
                .iter()
                .map(|entry| {
                    let pair = lists.pairs[entry.pair()];
                    assert_eq!(pair[usize::from(entry.is_higher())] as usize, i);
                    ids[pair[usize::from(!entry.is_higher())] as usize]
                })
                .collect();
            assert!(partners.windows(2).all(|w| w[0] < w[1]));
            assert_eq!(partners.len(), set.iter().filter(|pair| pair.contains(&(i as u32))).count());
        }
    }

    #[test]
    fn a_far_away_particle_costs_no_memory_and_slows_no_search() {
        let mut x = cloud(1000, [1.0, 1.0, 1.0], 9);
        for far in [1e5, -1e12, 1e300, -1e300] {
            x[500] = Vec3::new(0.0, far, far);
            let cells = Cells::new(&x, 0.3);
            assert!(cells.start.len() <= 2065);
            let mut visited = 0;
            cells.for_each_near(&x[0], |_| visited += 1);
            assert!(visited < 1000, "{visited} of 1000 visited: the bulk is no longer resolved");
        }
    }

    #[test]
    fn walls_are_listed_within_their_reach() {
        let walls = [Wall::new(Vec3::zeros(), -Vec3::z()), Wall::new(Vec3::new(1.0, 0.0, 0.0), Vec3::x())];
        let x = [Vec3::new(0.9, 0.0, 0.15), Vec3::new(0.5, 0.0, 0.1), Vec3::new(0.5, 0.0, 0.5)];
        let mut lists = Lists::default();
        lists.rebuild(&x, &[4, 5, 6], 3, 0.01, &walls, 0.2);
        assert_eq!(lists.walls(0), [0, 1]);
        assert_eq!(lists.walls(1), [0]);
        assert!(lists.walls(2).is_empty());
    }
}
