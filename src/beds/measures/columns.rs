//! Share of a box that spheres cover, counted by columns: what the exact volumes are compared with.

use crate::math::vector::Vec3;

/// Share of the box from `low` to `high` (m, `low` < `high` on each axis) that spheres of radius `r` (m)
/// cover.
///
/// `x` are the centres (m). A point inside several spheres counts once.
///
/// The box is divided into columns along z, and the covered length in the middle of each column is exact.
/// Columns are r/80 wide. Beyond 1500 spheres they are wider, up to r/5, because the errors average out.
///
/// The error is 1e-6 for spheres at random positions, as in the bed of the paper. It is 1e-5 if all spheres
/// have the same position relative to the columns. For a single sphere it is 3e-5 of its volume (root mean
/// square), and 1e-4 at most.
pub fn union_volume_fraction(x: &[Vec3], r: f64, low: Vec3, high: Vec3) -> f64 {
    union_of_sized(&x.iter().map(|x| (*x, r)).collect::<Vec<_>>(), low, high)
}

/// The same for spheres with these centres (m) and radii (m). The smallest radius decides how wide columns
/// are.
pub fn union_of_sized(spheres: &[(Vec3, f64)], low: Vec3, high: Vec3) -> f64 {
    let is_inside = |(x, r): &(Vec3, f64)| (0..3).all(|k| x[k] + r > low[k] && x[k] - r < high[k]);
    let mut inside: Vec<(Vec3, f64)> = spheres.iter().copied().filter(is_inside).collect();
    // Sort by height, so that the intervals of a column arrive almost in order. The sorted order does not
    // depend on the order in `x`, so the sum is always the same to the last bit.
    inside.sort_unstable_by(|(a, _), (b, _)| {
        [2, 0, 1].map(|k| a[k]).partial_cmp(&[2, 0, 1].map(|k| b[k])).expect("no NaN is inside the box")
    });
    let least = inside.iter().map(|(_, r)| *r).fold(f64::MAX, f64::min);
    let width = least * (inside.len() as f64 * 1e-7).sqrt().clamp(1.0 / 80.0, 1.0 / 5.0);
    let rows = Lines::new(low.x, high.x, width);
    let columns = Lines::new(low.y, high.y, width);

    let mut spheres_of_row = vec![Vec::new(); rows.count];
    for sphere in &inside {
        for row in rows.within(sphere.0.x, sphere.1) {
            spheres_of_row[row].push(sphere);
        }
    }
    let mut covered = 0.0;
    let mut intervals = vec![Vec::new(); columns.count];
    for (row, spheres) in spheres_of_row.iter().enumerate() {
        let half_chord2 = |(x, r): &(Vec3, f64)| (r * r - (rows.middle(row) - x.x).powi(2)).max(0.0);
        for sphere in spheres {
            let x = &sphere.0;
            for column in columns.within(x.y, half_chord2(sphere).sqrt()) {
                let half = (half_chord2(sphere) - (columns.middle(column) - x.y).powi(2)).max(0.0).sqrt();
                intervals[column].push([(x.z - half).max(low.z), (x.z + half).min(high.z)]);
            }
        }
        // Visit only the columns that spheres cover. The first sphere of a column takes all of its intervals.
        for sphere in spheres {
            for column in columns.within(sphere.0.y, half_chord2(sphere).sqrt()) {
                covered += union_length(&mut intervals[column]);
            }
        }
    }
    covered / (rows.count * columns.count) as f64 / (high.z - low.z)
}

/// Total length of the union of `intervals`, m. Empties the list. An interval whose end is below its
/// beginning has no length.
fn union_length(intervals: &mut Vec<[f64; 2]>) -> f64 {
    intervals.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut length, mut end) = (0.0, f64::NEG_INFINITY);
    for [from, to] in intervals.drain(..) {
        if to > end {
            length += (to - from.max(end)).max(0.0);
            end = to;
        }
    }
    length
}

/// Strips of equal width that divide a range of one axis.
struct Lines {
    low: f64,
    width: f64,
    count: usize,
}

impl Lines {
    /// Strips from `low` to `high` (m), each at most as wide as `width` (m).
    fn new(low: f64, high: f64, width: f64) -> Self {
        let count = ((high - low) / width).ceil().max(1.0);
        Lines { low, width: (high - low) / count, count: count as usize }
    }

    fn middle(&self, k: usize) -> f64 {
        self.low + (k as f64 + 0.5) * self.width
    }

    /// The strips whose middle is within `distance` (m) of `centre` (m).
    fn within(&self, centre: f64, distance: f64) -> std::ops::Range<usize> {
        // Casts saturate, so a position below the first strip gives 0.
        let lines_below = |x: f64| ((x - self.low) / self.width + 0.5).floor() as usize;
        lines_below(centre - distance).min(self.count)..lines_below(centre + distance).min(self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use std::f64::consts::PI;

    const R: f64 = 0.1;
    const SPHERE: f64 = 4.0 / 3.0 * PI * R * R * R;
    /// In a lattice all spheres can have the same position on the columns, and errors add up to 1.2e-5.
    const ALIGNED: f64 = 2e-5;
    /// For 2000 random positions of one sphere, the largest error was 1.1e-4 of its volume.
    const ONE_SPHERE: f64 = 1.5e-4 * SPHERE;

    fn in_unit_cube(x: &[Vec3]) -> f64 {
        union_volume_fraction(x, R, Vec3::zeros(), Vec3::repeat(1.0))
    }

    /// Points of the cubic lattice of the given spacing, `per_side` along each axis, the first at `start`.
    fn cubic(per_side: usize, spacing: f64, start: Vec3) -> Vec<Vec3> {
        let along = |k: usize, step: usize| (k / step % per_side) as f64;
        (0..per_side.pow(3))
            .map(|k| start + Vec3::new(along(k, 1), along(k, per_side), along(k, per_side.pow(2))) * spacing)
            .collect()
    }

    #[test]
    fn a_simple_cubic_lattice_covers_pi_over_six() {
        let measured = in_unit_cube(&cubic(5, 2.0 * R, Vec3::repeat(R)));
        assert!((measured - PI / 6.0).abs() < ALIGNED, "{measured}");
        // The same if the box cuts the spheres, here at thirds of a cell.
        let shifted = in_unit_cube(&cubic(6, 2.0 * R, Vec3::repeat(R / 3.0)));
        assert!((shifted - PI / 6.0).abs() < ALIGNED, "{shifted}");
    }

    #[test]
    fn a_face_centred_cubic_lattice_covers_0_7405() {
        let cell = 2.0 * 2f64.sqrt() * R;
        let mut x = Vec::new();
        for corner in [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]] {
            x.extend(cubic(5, cell, Vec3::from(corner) * cell - Vec3::repeat(cell)));
        }
        let exact = PI / 18f64.sqrt();
        for shift in [0.0, 0.037] {
            let low = Vec3::new(shift, 2.0 * shift, 3.0 * shift);
            let measured = union_volume_fraction(&x, R, low, low + Vec3::repeat(2.0 * cell));
            assert!((measured - exact).abs() < ALIGNED, "{measured}");
        }
    }

    #[test]
    fn one_sphere_cut_by_the_box_counts_with_its_inner_part() {
        let close = |measured: f64, exact: f64| (measured - exact).abs() < ONE_SPHERE;
        assert!(close(in_unit_cube(&[Vec3::new(0.512, 0.377, 0.641)]), SPHERE));
        for axis in 0..3 {
            let mut x = Vec3::new(0.512, 0.377, 0.641);
            x[axis] = 0.0;
            assert!(close(in_unit_cube(&[x]), SPHERE / 2.0));
            // A cap of height r/2.
            x[axis] = 1.0 + R / 2.0;
            let cap = PI * (R / 2.0).powi(2) * (3.0 * R - R / 2.0) / 3.0;
            assert!(close(in_unit_cube(&[x]), cap));
            x[axis] = 1.0 + R;
            assert_eq!(in_unit_cube(&[x]), 0.0);
        }
    }

    #[test]
    fn the_lens_of_two_spheres_counts_once() {
        let a = Vec3::new(0.431, 0.467, 0.522);
        for direction in [Vec3::x(), Vec3::y(), Vec3::z(), Vec3::new(0.6, 0.48, -0.64)] {
            for d in [0.03, 0.1, 0.17] {
                let lens = PI * (4.0 * R + d) * (2.0 * R - d).powi(2) / 12.0;
                let union = in_unit_cube(&[a, a + direction * d]);
                assert!((union - (2.0 * SPHERE - lens)).abs() < ONE_SPHERE, "{direction} {d}");
            }
        }
        assert_eq!(in_unit_cube(&[a; 7]), in_unit_cube(&[a]));
    }

    #[test]
    fn a_bed_of_random_overlaps_has_the_poisson_fraction() {
        // For independent centres, the share not covered is exp(-number density * volume of a sphere).
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let x: Vec<Vec3> =
            (0..200_000).map(|_| Vec3::from_fn(|_, _| random.random_range(-0.1..1.1))).collect();
        let r = 0.01;
        let exact = 1.0 - (-(200_000.0 / 1.2f64.powi(3)) * SPHERE * 1e-3).exp();
        let measured = union_volume_fraction(&x, r, Vec3::zeros(), Vec3::repeat(1.0));
        // Deviation of one sample from the mean: about the square root of the volume of a sphere, 2e-3.
        assert!((measured - exact).abs() < 5e-3, "{measured} {exact}");
    }

    #[test]
    fn the_order_of_the_spheres_does_not_matter_and_which_axis_is_up_hardly() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut x: Vec<Vec3> =
            (0..200).map(|_| Vec3::new(random.random(), random.random(), random.random())).collect();
        let measured = in_unit_cube(&x);
        x.reverse();
        assert_eq!(in_unit_cube(&x), measured);
        x.rotate_left(77);
        assert_eq!(in_unit_cube(&x), measured);
        // This uses other columns, so the difference is the error for spheres at random positions.
        let turned: Vec<Vec3> = x.iter().map(Vec3::yzx).collect();
        let other = in_unit_cube(&turned);
        assert!((other - measured).abs() < 1e-5, "{measured} {other}: 1.5e-6 was seen");
    }
}
