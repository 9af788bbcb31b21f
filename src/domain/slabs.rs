//! Slabs along an axis: which rank owns which particle. Bounds follow the particles; they never touch the physics.

use super::Comm;
use crate::math::vector::Vec3;

/// A rank may have this many times its fair share of the work before the bounds move.
const TOLERATED_IMBALANCE: f64 = 1.04;
/// An axis along which the particles extend this many times as far as along that of the slabs takes its place.
const FLATNESS: f64 = 1.5;
/// Rebuilds after which bounds that could not be balanced better, because heights were equal, are tried again.
const PATIENCE: u32 = 32;

/// Bounds of the slabs of all ranks, the same on every rank.
#[derive(Debug, Clone, PartialEq)]
pub struct Slabs {
    /// Across the slabs.
    axis: usize,
    /// Rank q owns `bounds[q] <= z < bounds[q + 1]` of heights z along the axis, m; the first is -infinity, the last
    /// +infinity.
    bounds: Vec<f64>,
    /// Imbalance that the last move of the bounds could not remove.
    achieved: f64,
    /// Rebuilds since then.
    age: u32,
}

impl Slabs {
    /// Slabs along z, or along x or y where the particles, which extend as far as `sizes` (m) tells, are flat: then fewer of
    /// them are ghosts. All belong to rank 0, until the bounds are balanced.
    pub fn new(ranks: usize, sizes: [f64; 3]) -> Self {
        let mut bounds = vec![f64::INFINITY; ranks + 1];
        bounds[0] = f64::NEG_INFINITY;
        Slabs { axis: best_axis(2, sizes), bounds, achieved: 1.0, age: 0 }
    }

    /// Slabs along z with these inner bounds (m, ascending), which stay where they are.
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

    /// Changes the axis where the particles, which extend as far as `sizes` (m, the same on all ranks) tells, have become
    /// flat along it. Returns whether it did; then the bounds must be balanced.
    pub fn turn(&mut self, sizes: [f64; 3]) -> bool {
        // Slabs that stay where they are keep their axis too.
        let best = if self.achieved.is_finite() { best_axis(self.axis, sizes) } else { self.axis };
        std::mem::replace(&mut self.axis, best) != best
    }

    /// The rank that owns height `z` (m).
    pub fn owner(&self, z: f64) -> usize {
        let inner = &self.bounds[1..self.bounds.len() - 1];
        inner.partition_point(|&bound| bound <= z)
    }

    /// Lower and upper bound of a rank's slab, m.
    pub fn of(&self, rank: usize) -> (f64, f64) {
        (self.bounds[rank], self.bounds[rank + 1])
    }

    /// Moves the bounds to equal loads if some rank has too much. `particles` are the height (m) and the load of every
    /// owned particle, `loads[q]` is the sum that rank q has now. Collective, and every rank decides alike. Returns
    /// whether the bounds moved.
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

    /// Moves the bounds so that every rank has the same load to within a thousandth of it, as far as equal heights and
    /// single particles allow. `particles` are the height (m) and the load of every owned particle. Collective.
    pub fn balance(&mut self, comm: &dyn Comm, particles: impl Iterator<Item = (f64, u64)>) {
        let ranks = comm.size();
        if ranks == 1 {
            return;
        }
        let mut particles: Vec<(f64, u64)> = particles.collect();
        particles.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Load of all particles before each in the order of heights, and of all.
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
        // Bisection on the bit patterns of all inner bounds at once: 64 rounds find any double, however far the
        // furthest particle is, and a load that is met ends the search of its bound.
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

/// Largest load over the mean load; 1 is perfect.
pub fn imbalance(loads: &[u64]) -> f64 {
    let total: u64 = loads.iter().sum();
    let largest = loads.iter().copied().max().unwrap_or(0);
    if total == 0 { 1.0 } else { largest as f64 * loads.len() as f64 / total as f64 }
}

/// Doubles as integers in the same order.
fn ordered(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// Inverse of `ordered`.
fn value(order: u64) -> f64 {
    f64::from_bits(if order >> 63 == 1 { order & !(1 << 63) } else { !order })
}

/// The axis along which the particles extend furthest, if that is much further than along `axis`.
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

    /// Particles of one load.
    fn alike(z: &[f64]) -> impl Iterator<Item = (f64, u64)> + '_ {
        z.iter().map(|&z| (z, 1))
    }

    #[test]
    fn bounds_share_the_load_and_not_the_particles() {
        for ranks in 2..=4 {
            team(ranks, |comm| {
                // The lower half of the particles has nine times the work of the upper half.
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
                // Rank 0 holds everything, one particle is very far away.
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
            // Once they have spread, the bounds follow all the same.
            let spread: Vec<f64> = (0..z.len()).map(|k| k as f64).collect();
            assert!((0..PATIENCE).any(|_| slabs.follow(comm, alike(&spread), &[0, 60, 0])));
            let mut owned = vec![0; 3];
            spread.iter().for_each(|&z| owned[slabs.owner(z)] += 1);
            comm.sum(&mut owned);
            assert_eq!(owned, [20, 20, 20]);
        });
    }
}
