//! Slabs along an axis: which rank owns which particle. Bounds follow the load and never change results.

use super::Comm;
use crate::math::vector::Vec3;

/// The bounds move if a rank has more than this multiple of the mean load.
const TOLERATED_IMBALANCE: f64 = 1.04;
/// Another axis replaces that of the slabs if the particles extend this many times as far along it.
const FLATNESS: f64 = 1.5;
/// Number of rebuilds after which balancing is tried again if equal heights limited it the last time.
const PATIENCE: u32 = 32;

/// The slabs of all ranks. Every rank holds the same values.
#[derive(Debug, Clone, PartialEq)]
pub struct Slabs {
    /// Axis across the slabs: 0 for x, 1 for y, 2 for z.
    axis: usize,
    /// Bounds, m, one more than ranks: rank q owns the heights z with `bounds[q] <= z < bounds[q + 1]`.
    ///
    /// The first is -infinity, the last +infinity.
    bounds: Vec<f64>,
    /// Imbalance that remained after the bounds were last balanced.
    achieved: f64,
    /// Number of rebuilds since then.
    age: u32,
}

impl Slabs {
    /// Slabs along z, or along x or y if the particles extend much further there: then fewer are ghosts.
    ///
    /// `sizes` (m) are the extents of all particles along x, y and z. Rank 0 owns everything until the bounds
    /// are balanced.
    pub fn new(ranks: usize, sizes: [f64; 3]) -> Self {
        let mut bounds = vec![f64::INFINITY; ranks + 1];
        bounds[0] = f64::NEG_INFINITY;
        Slabs { axis: best_axis(2, sizes), bounds, achieved: 1.0, age: 0 }
    }

    /// Slabs along z with fixed inner bounds (m, ascending).
    #[cfg(test)]
    pub fn with_inner_bounds(inner: &[f64]) -> Self {
        let bounds = [&[f64::NEG_INFINITY], inner, &[f64::INFINITY]].concat();
        Slabs { axis: 2, bounds, achieved: f64::INFINITY, age: 0 }
    }

    /// The axis across the slabs: 0 for x, 1 for y, 2 for z.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Height of `x` (m) along the axis.
    pub fn height(&self, x: &Vec3) -> f64 {
        x[self.axis]
    }

    /// Changes the axis if the particles now extend much further along another one. Returns whether it did.
    ///
    /// `sizes` (m) are the extents of all particles along x, y and z, the same on all ranks. After a change
    /// the bounds must be balanced.
    pub fn turn(&mut self, sizes: [f64; 3]) -> bool {
        // Slabs with fixed bounds keep their axis.
        let best = if self.achieved.is_finite() { best_axis(self.axis, sizes) } else { self.axis };
        std::mem::replace(&mut self.axis, best) != best
    }

    /// The rank that owns height `z` (m).
    pub fn owner(&self, z: f64) -> usize {
        let inner = &self.bounds[1..self.bounds.len() - 1];
        inner.partition_point(|&bound| bound <= z)
    }

    /// Lower and upper bound of the slab of `rank`, m.
    pub fn of(&self, rank: usize) -> (f64, f64) {
        (self.bounds[rank], self.bounds[rank + 1])
    }

    /// Balances the bounds if a rank has too much load. Returns whether it did. Collective.
    ///
    /// `particles` gives the height (m) and the load of each owned particle. `loads[q]` is the present load
    /// of rank q, the same on all ranks, so that all decide alike.
    pub fn follow(
        &mut self,
        comm: &dyn Comm,
        particles: impl Iterator<Item = (f64, u64)>,
        loads: &[u64],
    ) -> bool {
        self.age += 1;
        let expected = if self.age < PATIENCE { self.achieved } else { 1.0 };
        if comm.size() == 1 || imbalance(loads) <= TOLERATED_IMBALANCE * expected {
            return false;
        }
        self.balance(comm, particles);
        true
    }

    /// Moves the bounds so that all ranks have the same load. Collective.
    ///
    /// Each bound is exact to a thousandth of a rank's load, as far as equal heights and single particles
    /// allow. `particles` gives the height (m) and the load of each owned particle.
    pub fn balance(&mut self, comm: &dyn Comm, particles: impl Iterator<Item = (f64, u64)>) {
        let ranks = comm.size();
        if ranks == 1 {
            return;
        }
        let mut particles: Vec<(f64, u64)> = particles.collect();
        particles.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Sums of the loads, in the order of heights: before each particle, and of all particles.
        let mut load_below = vec![0];
        for (_, load) in &particles {
            load_below.push(load_below[load_below.len() - 1] + load);
        }
        let mut total = [load_below[particles.len()]];
        comm.sum(&mut total);
        let [total] = total;
        let wanted: Vec<u64> =
            (1..ranks as u128).map(|q| (u128::from(total) * q / ranks as u128) as u64).collect();
        let close = total / (1000 * ranks as u64);
        // Bisection of all inner bounds at once, on their bit patterns: 64 rounds find any double, however
        // far apart the particles are. The search of a bound ends when its load is met.
        let mut low = vec![ordered(f64::NEG_INFINITY); ranks - 1];
        let mut high = vec![ordered(f64::INFINITY); ranks - 1];
        let mut below = vec![0; ranks - 1];
        for _ in 0..64 {
            if low.iter().zip(&high).all(|(low, high)| high - low <= 1) {
                break;
            }
            let middle: Vec<u64> = low.iter().zip(&high).map(|(low, high)| low + (high - low) / 2).collect();
            for (load, &m) in below.iter_mut().zip(&middle) {
                let bound = value(m);
                *load = load_below[particles.partition_point(|(z, _)| *z < bound)];
            }
            comm.sum(&mut below);
            for k in 0..ranks - 1 {
                let met = below[k].abs_diff(wanted[k]) <= close;
                if met || below[k] < wanted[k] {
                    low[k] = middle[k];
                }
                if met || below[k] > wanted[k] {
                    high[k] = middle[k];
                }
            }
        }
        for (k, &h) in high.iter().enumerate() {
            self.bounds[k + 1] = value(h);
        }
        let mut loads = vec![0; ranks];
        particles.iter().for_each(|&(z, load)| loads[self.owner(z)] += load);
        comm.sum(&mut loads);
        self.achieved = imbalance(&loads);
        self.age = 0;
    }
}

/// Largest load divided by the mean load; 1 is perfect balance.
pub fn imbalance(loads: &[u64]) -> f64 {
    let total: u64 = loads.iter().sum();
    let largest = loads.iter().copied().max().unwrap_or(0);
    if total == 0 { 1.0 } else { largest as f64 * loads.len() as f64 / total as f64 }
}

/// A double as an integer, in the same order as the doubles.
fn ordered(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// The double of such an integer: the inverse of `ordered`.
fn value(order: u64) -> f64 {
    f64::from_bits(if order >> 63 == 1 { order & !(1 << 63) } else { !order })
}

/// The axis of the largest extent, if that is much larger than the extent along `axis`; else `axis`.
fn best_axis(axis: usize, sizes: [f64; 3]) -> usize {
    let longest = (0..3).fold(axis, |a, b| if sizes[b] > sizes[a] { b } else { a });
    if sizes[longest] > FLATNESS * sizes[axis] { longest } else { axis }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn integers_keep_the_order_of_doubles() {
        let sorted = [f64::NEG_INFINITY, -1e300, -1.0, -1e-300, 0.0, 1e-300, 2.0, 1e300, f64::INFINITY];
        assert!(sorted.windows(2).all(|w| ordered(w[0]) < ordered(w[1])));
        assert!(sorted.iter().all(|&x| value(ordered(x)) == x));
    }

    #[test]
    fn every_height_has_one_owner() {
        let slabs = Slabs {
            axis: 2,
            bounds: vec![f64::NEG_INFINITY, 0.0, 0.0, 2.5, f64::INFINITY],
            achieved: 1.0,
            age: 0,
        };
        for (z, rank) in [(-1e300, 0), (-0.1, 0), (0.0, 2), (2.4, 2), (2.5, 3), (1e300, 3)] {
            assert_eq!(slabs.owner(z), rank);
            let (low, high) = slabs.of(rank);
            assert!(low <= z && z < high);
        }
    }

    /// Particles at the heights `z` with equal loads.
    fn alike(z: &[f64]) -> impl Iterator<Item = (f64, u64)> + '_ {
        z.iter().map(|&z| (z, 1))
    }

    #[test]
    fn bounds_share_the_load_and_not_the_particles() {
        for ranks in 2..=4 {
            team(ranks, |comm| {
                // Each particle of the lower half has nine times the load of one of the upper half.
                let particles = || {
                    let load = |k: u64| if k < 5000 { 9 } else { 1 };
                    (0..10_000).skip(comm.rank()).step_by(ranks).map(move |k| (k as f64, load(k)))
                };
                let mut slabs = Slabs::new(ranks, [1.0; 3]);
                slabs.balance(comm, particles());
                let (mut loads, mut counts) = (vec![0; ranks], vec![0; ranks]);
                for (z, load) in particles() {
                    loads[slabs.owner(z)] += load;
                    counts[slabs.owner(z)] += 1;
                }
                comm.sum(&mut loads);
                comm.sum(&mut counts);
                assert!(imbalance(&loads) < 1.003, "{loads:?}");
                assert!(imbalance(&counts) > 1.4, "{counts:?}");
            });
        }
    }

    #[test]
    fn bounds_give_every_rank_its_share() {
        for ranks in 2..=5 {
            team(ranks, |comm| {
                // Rank 0 owns everything, and one particle is very far away.
                let z: Vec<f64> = match comm.rank() {
                    0 => {
                        (0..1000).map(|k| if k == 77 { -1e200 } else { f64::from(k % 500).sqrt() }).collect()
                    }
                    _ => Vec::new(),
                };
                let mut slabs = Slabs::new(ranks, [1.0; 3]);
                let mut counts = vec![0; ranks];
                counts[0] = 1000;
                assert!(slabs.follow(comm, alike(&z), &counts));
                let mut owned = vec![0; ranks];
                z.iter().for_each(|&z| owned[slabs.owner(z)] += 1);
                comm.sum(&mut owned);
                assert!(owned.iter().all(|&n| n.abs_diff(1000 / ranks as u64) <= 3), "{owned:?}");
                assert!(!slabs.follow(comm, alike(&z), &owned));
            });
        }
    }

    #[test]
    fn equal_heights_stay_together_without_a_search_at_every_rebuild() {
        team(3, |comm| {
            let z = vec![1.0; if comm.rank() == 1 { 60 } else { 0 }];
            let mut slabs = Slabs::new(3, [1.0; 3]);
            assert!(slabs.follow(comm, alike(&z), &[0, 60, 0]));
            let owner = slabs.owner(1.0);
            assert!(owner < 3);
            assert!(!slabs.follow(comm, alike(&z), &[0, 60, 0]));
            // When the particles have spread, the bounds follow.
            let spread: Vec<f64> = (0..z.len()).map(|k| k as f64).collect();
            assert!((0..PATIENCE).any(|_| slabs.follow(comm, alike(&spread), &[0, 60, 0])));
            let mut owned = vec![0; 3];
            spread.iter().for_each(|&z| owned[slabs.owner(z)] += 1);
            comm.sum(&mut owned);
            assert_eq!(owned, [20, 20, 20]);
        });
    }
}
