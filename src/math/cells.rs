//! Points in cubic cells: finds those near a place without a look at all others.

use crate::math::vector::Vec3;

/// Points sorted into cubic cells.
///
/// The table of cells is periodic: cells far from each other may share a bucket. So its size depends on the
/// number of points, not on the distance between the furthest two.
pub struct Cells {
    /// Width of a cell, m.
    width: f64,
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
        let product = |dims: [i64; 3]| dims.into_iter().fold(1, i64::saturating_mul);
        while product(cells.dims) > room {
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

    fn coordinates(&self, x: &Vec3) -> [i64; 3] {
        [0, 1, 2].map(|axis| coordinate(x[axis], self.width))
    }

    fn bucket(&self, c: [i64; 3]) -> usize {
        let wrap = |axis: usize| c[axis].rem_euclid(self.dims[axis]);
        ((wrap(2) * self.dims[1] + wrap(1)) * self.dims[0] + wrap(0)) as usize
    }

    /// Calls `visit` once for the index of every point within the width of a cell of `x` (m), and for some
    /// others, in any order.
    pub fn for_each_near(&self, x: &Vec3, visit: impl FnMut(u32)) {
        self.for_each_within(x, self.width, visit);
    }

    /// Calls `visit` once for the index of every point within `distance` (m) of `x` (m), and for some others,
    /// in any order.
    pub fn for_each_within(&self, x: &Vec3, distance: f64, mut visit: impl FnMut(u32)) {
        let c = self.coordinates(x);
        let rings = ((distance / self.width).ceil() as i64).max(1);
        // Only offsets that lead to different buckets. Along an axis of few buckets, some offsets would wrap
        // around to the same one.
        let offsets = |axis: usize| match self.dims[axis] {
            dims if dims <= rings.saturating_mul(2) => 0..=dims - 1,
            _ => -rings..=rings,
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

/// Cell of a coordinate `x` (m) along one axis, in cells of the given `width` (m).
///
/// The cast saturates: all points beyond 1e18 cells share the last one.
pub fn coordinate(x: f64, width: f64) -> i64 {
    ((x / width).floor() as i64).clamp(-(1 << 60), 1 << 60)
}

#[cfg(test)]
mod tests {
    use super::*;

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
