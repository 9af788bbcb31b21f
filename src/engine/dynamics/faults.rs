//! Finds the cause where a right-hand side is not finite or a step is not accurate.

use super::Dynamics;
use super::decomposition::gather;
use crate::engine::forces::Broken;
use crate::error::Error;
use crate::math::larger;

impl Dynamics<'_> {
    /// The contact because of which the right-hand side at `y` and time `t` (s) is not finite, if any.
    /// Collective.
    ///
    /// Of several it is the one with the lowest ids. Pairs come before walls.
    pub fn explain(&mut self, y: &[f64], t: f64) -> Option<Error> {
        self.put_bodies(y);
        let ids = |i: usize| self.domain.ids[i] as f64;
        let sort = |broken: Broken| match broken {
            Broken::Pair(i, j, d) => [0.0, ids(i), ids(j), d],
            Broken::Wall(i, k, overlap) => [1.0, ids(i), k as f64, overlap],
        };
        let order = |a: &[f64; 4], b: &[f64; 4]| a.partial_cmp(b).expect("ids and lengths are not NaN");
        let own = self.forces.broken().map(sort).min_by(order);
        let all = gather(self.domain.comm, own.unwrap_or([f64::INFINITY; 4]));
        match all.into_iter().min_by(order)? {
            [0.0, i, j, 0.0] => Some(Error::Coincident { i: i as u64, j: j as u64, t }),
            [0.0, i, j, d] => {
                let overlap = 2.0 * self.law().r - d;
                Some(Error::PairForce { i: i as u64, j: j as u64, overlap, t })
            }
            [1.0, i, k, overlap] => Some(Error::WallForce { i: i as u64, wall: k as usize, overlap, t }),
            _ => None,
        }
    }

    /// The id of the particle with the largest `badness`; the lowest id where several have it. Collective.
    ///
    /// `badness` receives the local index. NaN counts as the largest value.
    pub fn worst(&self, badness: impl Fn(usize) -> f64) -> u64 {
        let mut own = [f64::NEG_INFINITY, f64::INFINITY];
        for (i, &id) in self.ids().iter().enumerate() {
            let found = larger(0.0, badness(i));
            if found > own[0] || found == own[0] && (id as f64) < own[1] {
                own = [found, id as f64];
            }
        }
        let all = gather(self.domain.comm, own);
        let top = all.iter().fold(f64::NEG_INFINITY, |top, own| top.max(own[0]));
        all.iter().filter(|own| own[0] == top).fold(f64::INFINITY, |id, own| id.min(own[1])) as u64
    }
}
