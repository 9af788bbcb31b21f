//! Points in cubic cells: finds those near a place without a look at all others.

use crate::math::vector::Vec3;

/// Points sorted into cubic cells.
///
/// The table of cells is periodic: cells far from each other may share a bucket. So its size depends on the
/// number of points, not on the distance between the furthest two.
pub struct Cells {
    /// Width of a cell, m.
    width: f64,
    /// The lowest cell along each axis that holds a point.
    low: [i64; 3],
    /// Number of buckets along each axis.
    dims: [i64; 3],
    /// Start of each bucket in `items`; one more than there are buckets.
    start: Vec<u32>,
    /// Indices of the points, bucket after bucket.
    items: Vec<u32>,
}

impl Cells {
    /// The points `x` (m) in cells of the given `width` (m).
    pub fn new(x: &[Vec3], width: f64) -> Self {
        let coordinates: Vec<[i64; 3]> = x.iter().map(|x| coordinates(x, width)).collect();
        let (mut low, mut high) = ([LAST; 3], [-LAST; 3]);
        for c in &coordinates {
            for axis in 0..3 {
                low[axis] = low[axis].min(c[axis]);
                high[axis] = high[axis].max(c[axis]);
            }
        }
        let room = 2 * x.len() as i64 + 64;
        let extent = |axis: usize| high[axis].saturating_sub(low[axis]).clamp(0, room) + 1;
        let mut dims = [extent(0), extent(1), extent(2)];
        let product = |dims: [i64; 3]| dims.into_iter().fold(1, i64::saturating_mul);
        while product(dims) > room {
            let widest = (0..3).max_by_key(|&axis| dims[axis]).expect("there are three axes");
            dims[widest] = (dims[widest] + 1) / 2;
        }
        let buckets = product(dims) as usize;
        let mut cells = Cells { width, low, dims, start: vec![0; buckets + 1], items: vec![0; x.len()] };
        let home = |c: [i64; 3]| {
            let [a, b, c] = [0, 1, 2].map(|axis| cells.wrap(axis, c[axis]));
            cells.row(b, c) + a as usize
        };
        let home: Vec<u32> = coordinates.into_iter().map(|c| home(c) as u32).collect();
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

    /// From now on the point with the index `k` has the index `names[k]`. The names must be ascending.
    pub fn rename(&mut self, names: &[u32]) {
        self.items.iter_mut().for_each(|k| *k = names[*k as usize]);
    }

    /// The bucket along one axis of the cell `c`. Only cells outside of the table need a slow division.
    fn wrap(&self, axis: usize, c: i64) -> i64 {
        let (c, dims) = (c - self.low[axis], self.dims[axis]);
        if (0..dims).contains(&c) { c } else { c.rem_euclid(dims) }
    }

    /// The first bucket of a row, which runs along x.
    fn row(&self, y: i64, z: i64) -> usize {
        ((z * self.dims[1] + y) * self.dims[0]) as usize
    }

    /// Calls `visit` once for the index of every point within the width of a cell of `x` (m), and for some
    /// others, in any order.
    pub fn for_each_near(&self, x: &Vec3, visit: impl FnMut(u32)) {
        self.for_each_within(x, self.width, visit);
    }

    /// Calls `visit` once for the index of every point within `distance` (m) of `x` (m), and for some others,
    /// in any order.
    pub fn for_each_within(&self, x: &Vec3, distance: f64, mut visit: impl FnMut(u32)) {
        self.for_each_run_within(x, distance, |_| true, |run| run.iter().for_each(|&j| visit(j)));
    }

    /// `for_each_within` for whole runs of indices: buckets that follow each other along x make one run.
    ///
    /// `is_wanted` gets the indices in a bucket, which are ascending. Every run begins and ends with a bucket
    /// that is wanted.
    #[inline]
    pub fn for_each_run_within(
        &self,
        x: &Vec3,
        distance: f64,
        is_wanted: impl Fn(&[u32]) -> bool,
        mut visit: impl FnMut(&[u32]),
    ) {
        let c = coordinates(x, self.width);
        let rings = ((distance / self.width).ceil() as i64).max(1);
        // Only cells that are in different buckets: along an axis of few buckets, all of them once. Of each
        // axis the first bucket, and how many follow it. After the last bucket comes the first again.
        let [(x, along_x), (y, along_y), (z, along_z)] = [0, 1, 2].map(|axis| {
            let (home, dims) = (self.wrap(axis, c[axis]), self.dims[axis]);
            match rings.saturating_mul(2) {
                all if dims <= all => (home, dims),
                sides if home < rings => (home - rings + dims, sides + 1),
                sides => (home - rings, sides + 1),
            }
        });
        let back = |bucket: i64, dims: i64| if bucket < dims { bucket } else { bucket - dims };
        let before_end = along_x.min(self.dims[0] - x);
        let runs = [[x, x + before_end], [0, along_x - before_end]];
        for z in z..z + along_z {
            for y in y..y + along_y {
                let row = self.row(back(y, self.dims[1]), back(z, self.dims[2]));
                for [from, to] in runs {
                    let [mut from, mut to] = [from, to].map(|bucket| row + bucket as usize);
                    while from < to && !is_wanted(self.items_of(from, from + 1)) {
                        from += 1;
                    }
                    while from < to && !is_wanted(self.items_of(to - 1, to)) {
                        to -= 1;
                    }
                    if from < to {
                        visit(self.items_of(from, to));
                    }
                }
            }
        }
    }

    /// The indices in the buckets from `from` on, before `to`.
    fn items_of(&self, from: usize, to: usize) -> &[u32] {
        &self.items[self.start[from] as usize..self.start[to] as usize]
    }
}

/// Cell of a point `x` (m), in cells of the given `width` (m).
fn coordinates(x: &Vec3, width: f64) -> [i64; 3] {
    [0, 1, 2].map(|axis| coordinate(x[axis], width))
}

/// The last cell along an axis; the first one is as far on the other side.
const LAST: i64 = 1 << 60;

/// Cell of a coordinate `x` (m) along one axis, in cells of the given `width` (m).
///
/// The cast saturates: all points beyond 1e18 cells share the last one.
pub fn coordinate(x: f64, width: f64) -> i64 {
    ((x / width).floor() as i64).clamp(-LAST, LAST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A lattice of 1 000 points in a cube of 1 m.
    fn lattice() -> Vec<Vec3> {
        let place = |k: usize| 0.05 + 0.1 * k as f64;
        (0..1000).map(|k| Vec3::new(place(k % 10), place(k / 10 % 10), place(k / 100))).collect()
    }

    #[test]
    fn every_point_within_the_width_is_visited_once() {
        let x = lattice();
        let cells = Cells::new(&x, 0.15);
        for a in x.iter().step_by(37) {
            let mut visits = vec![0; x.len()];
            cells.for_each_near(a, |j| visits[j as usize] += 1);
            for (b, &visits) in x.iter().zip(&visits) {
                assert!(visits == 1 || visits == 0 && (a - b).norm() > 0.15, "{a} {b}: {visits}");
            }
        }
    }

    #[test]
    fn every_point_within_several_widths_is_visited_once() {
        let x = lattice();
        for width in [0.04, 0.11, 0.3] {
            let cells = Cells::new(&x, width);
            for a in x.iter().step_by(37) {
                let mut visits = vec![0; x.len()];
                cells.for_each_within(a, 0.25, |j| visits[j as usize] += 1);
                for (b, &visits) in x.iter().zip(&visits) {
                    assert!(visits == 1 || visits == 0 && (a - b).norm() > 0.25, "{a} {b}: {visits}");
                }
            }
        }
    }

    #[test]
    fn runs_leave_out_unwanted_buckets_at_their_ends_only() {
        let x = lattice();
        let cells = Cells::new(&x, 0.15);
        for (i, a) in x.iter().enumerate().step_by(37) {
            let (mut later, mut visited) = (BTreeSet::new(), BTreeSet::new());
            cells.for_each_near(a, |j| later.extend((j as usize > i).then_some(j)));
            let is_wanted = |bucket: &[u32]| bucket.last().is_some_and(|&j| j as usize > i);
            cells.for_each_run_within(a, 0.15, is_wanted, |run| visited.extend(run));
            assert!(visited.is_superset(&later) && visited.len() < 2 * later.len() + 27);
        }
    }

    #[test]
    fn cells_without_points_are_searched_in_vain() {
        Cells::new(&[], 0.3).for_each_near(&Vec3::repeat(-1e300), |j| panic!("{j} does not exist"));
    }

    #[test]
    fn a_far_away_point_costs_no_memory_and_slows_no_search() {
        let mut x = lattice();
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
    fn a_table_for_many_points_that_are_far_apart_does_not_overflow() {
        // From about a million points on, the product of the three sizes of the table exceeds 64 bits.
        let x: Vec<Vec3> =
            (0..1_100_000).map(|k| Vec3::repeat(if k % 2 == 0 { 0.0 } else { 1e12 })).collect();
        assert!(Cells::new(&x, 0.3).start.len() <= 2 * x.len() + 65);
    }
}
