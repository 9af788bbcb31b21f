//! Finds the cause where a right-hand side is not finite or a step is not accurate.

use super::Dynamics;
use super::decomposition::gather;
use crate::engine::forces::Broken;
use crate::error::Error;
use crate::math::larger;
use crate::model::columns::{position, spin, velocity};
use crate::model::contact::LawParameters;

impl Dynamics<'_> {
    /// The contact because of which the right-hand side at `y` and time `t` (s) is not finite, if any.
    /// Collective.
    ///
    /// Of several it is the one with the lowest ids. Pairs come before walls, whose names for messages are
    /// `wall_names`.
    pub fn explain(&mut self, y: &[f64], t: f64, wall_names: &[String]) -> Option<Error> {
        self.put_bodies(y);
        let ids = |i: usize| self.domain.ids[i] as f64;
        let sort = |broken: Broken| match broken {
            Broken::Pair(i, j, d) => [0.0, ids(i), ids(j), d, self.size(i).r + self.size(j).r - d],
            Broken::Wall(i, k, overlap) => [1.0, ids(i), k as f64, overlap, overlap - self.size(i).r],
        };
        let order = |a: &[f64; 5], b: &[f64; 5]| a.partial_cmp(b).expect("ids and lengths are not NaN");
        let own = self.forces.broken().map(sort).min_by(order);
        let all = gather(self.domain.comm, own.unwrap_or([f64::INFINITY; 5]));
        match all.into_iter().min_by(order)? {
            [0.0, i, j, 0.0, _] => Some(Error::Coincident { i: i as u64, j: j as u64, t }),
            [0.0, i, j, _, overlap] => {
                let pair = Error::PairForce { i: i as u64, j: j as u64, overlap, t };
                Some(if self.overflows(overlap) { pair } else { self.out_of_range([i, j], y, t) })
            }
            [1.0, i, k, overlap, beyond] => {
                let name = wall_names.get(k as usize).cloned();
                let wall = name.unwrap_or_else(|| format!("the wall with index {k}"));
                Some(if !self.overflows(overlap) {
                    self.out_of_range([i, i], y, t)
                } else if beyond > 0.0 {
                    Error::BeyondWall { i: i as u64, wall, beyond, t }
                } else {
                    Error::WallForce { i: i as u64, wall, overlap, t }
                })
            }
            _ => None,
        }
    }

    /// Whether the repulsion at this `overlap` (m) is beyond a double.
    fn overflows(&self, overlap: f64) -> bool {
        let LawParameters { f_0, kappa, .. } = self.law();
        let exponent = f_0.ln() + kappa * overlap;
        exponent.is_nan() || exponent >= f64::MAX.ln()
    }

    /// Why forces on one of the particles with these `ids` are not finite, at the state `y` and the time `t`
    /// (s), where no repulsion overflows: the particle whose state is larger. Collective.
    fn out_of_range(&self, ids: [f64; 2], y: &[f64], t: f64) -> Error {
        let layout = &self.layout;
        let sizes = |id: f64| {
            let own = self.ids().iter().position(|&own| own == id as u64);
            own.map_or([0.0; 3], |i| {
                let (row, r) = (&y[layout.row(0, i).range()], self.size(i).r);
                [position(row).amax(), velocity(row).amax(), spin(row).amax() / r]
            })
        };
        let [a, b] = ids.map(sizes);
        let all = gather(self.domain.comm, [a[0], a[1], a[2], b[0], b[1], b[2]]);
        let most =
            all.into_iter().fold([0.0; 6], |most, found| std::array::from_fn(|k| larger(most[k], found[k])));
        let [a, b] = [[most[0], most[1], most[2]], [most[3], most[4], most[5]]];
        let size = |sizes: [f64; 3]| sizes.into_iter().fold(0.0, larger);
        let (id, [position, speed, spin]) = if size(b) > size(a) { (ids[1], b) } else { (ids[0], a) };
        Error::OutOfRange { i: id as u64, position, speed, spin, t }
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
