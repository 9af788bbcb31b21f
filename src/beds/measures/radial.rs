//! The radial distribution function of the centres in any convex polyhedron.
//!
//! The weight of a pair is the inverse of the volume that the polyhedron has in common with itself, moved by
//! the vector d between the two centres: only from there can a pair with this vector have both of its centres
//! inside. This translation correction of Ohser and Stoyan removes the effect of the bounds, whatever the
//! polyhedron is.
//!
//! Pairs with almost the same d share the volume of their mean d. For each of 768 small sets of directions
//! the volume and its gradient are found exactly at the middle of the set, for eight distances, and a
//! polynomial goes through them. The error of g is below 1e-3.

use super::union::for_each_pair;
use crate::math::cells::Cells;
use crate::math::polyhedron::{Half, Polyhedron};
use crate::math::vector::Vec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Bins in each radius.
const BINS_PER_RADIUS: f64 = 20.0;
/// Sets of directions along each side of a face of the cube around all directions. It is even, so that sets
/// do not reach over the middle of a face, where the volumes of a box have a kink.
const SETS_PER_SIDE: usize = 16;
/// Sets of directions on three faces of the cube. The other three have the opposite directions, which count
/// as the same.
const SETS: usize = 3 * SETS_PER_SIDE * SETS_PER_SIDE;
/// Distances at which volumes are computed, for each set of directions.
const NODES: usize = 8;

/// Radial distribution function of the centres in `room`: the middles of its bins (m) and its values.
///
/// A value of 1 means that pairs at this distance are as frequent as for independent centres. `x` are the
/// centres (m) of spheres of radius `r` (m); `axes` are three unit vectors across each other, by which
/// directions are divided into sets.
///
/// Empty if there are fewer than two centres, or if half of the least width of the room is narrower than a
/// bin.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::radial::radial_distribution;
/// use demhybrid::math::polyhedron::Polyhedron;
/// use demhybrid::math::vector::Vec3;
///
/// // A cubic lattice has no neighbours below its spacing, and six there.
/// let at = |k: usize| 0.1 + 0.2 * k as f64;
/// let centres: Vec<Vec3> =
///     (0..125).map(|k| Vec3::new(at(k % 5), at(k / 5 % 5), at(k / 25))).collect();
/// let room = Polyhedron::cuboid(&Vec3::zeros(), &Vec3::repeat(1.0));
/// let g = radial_distribution(&centres, 0.1, &room, &[Vec3::x(), Vec3::y(), Vec3::z()]);
/// assert!(g.iter().all(|[distance, value]| *distance > 0.19 || *value == 0.0));
/// assert!(g.iter().any(|[distance, value]| (*distance - 0.2).abs() < 0.01 && *value > 1.0));
/// ```
pub fn radial_distribution(x: &[Vec3], r: f64, room: &Polyhedron, axes: &[Vec3; 3]) -> Vec<[f64; 2]> {
    let inside = those_inside(x, room);
    let Some(mut pairs) = Pairs::new(inside.len(), r, room, axes) else { return Vec::new() };
    if inside.len() < 2 {
        return Vec::new();
    }
    for_each_pair(&inside, pairs.cutoff, |[i, j]| pairs.add(inside[i] - inside[j]));
    // Each pair is two: that of one sphere with the other, and that of the other with it.
    let n = inside.len() as f64;
    pairs.distribution(2.0, n * (n - 1.0))
}

/// The same for pairs of a centre of `a` (m) with one of `b` (m): how frequent spheres of one class are
/// around those of another one.
///
/// `r` (m) is the mean of the mean radii of both classes. Empty also if one of them has no centre in the
/// room.
pub fn cross_distribution(
    a: &[Vec3],
    b: &[Vec3],
    r: f64,
    room: &Polyhedron,
    axes: &[Vec3; 3],
) -> Vec<[f64; 2]> {
    let [a, b] = [a, b].map(|x| those_inside(x, room));
    let Some(mut pairs) = Pairs::new(a.len() + b.len(), r, room, axes) else { return Vec::new() };
    let (few, many) = if a.len() < b.len() { (&a, &b) } else { (&b, &a) };
    if few.is_empty() {
        return Vec::new();
    }
    // Narrow cells, because most of what is in the wide ones around a place is too far from it.
    let cells = Cells::new(many, 0.5 * pairs.cutoff);
    for x in few {
        cells.for_each_within(x, pairs.cutoff, |j| pairs.add(x - many[j as usize]));
    }
    pairs.distribution(1.0, a.len() as f64 * b.len() as f64)
}

/// The centres that are in the room.
fn those_inside(x: &[Vec3], room: &Polyhedron) -> Vec<Vec3> {
    let tiny = 1e-12 * room.volume().max(0.0).cbrt();
    let is_inside = |x: &&Vec3| room.faces.iter().all(|face| face.half.beyond(x) <= tiny);
    x.iter().filter(is_inside).copied().collect()
}

/// Pairs of centres in a room, by set of directions and by bin.
struct Pairs<'a> {
    room: &'a Polyhedron,
    axes: &'a [Vec3; 3],
    /// Width of a bin, m.
    width: f64,
    bins: usize,
    /// Pairs within this distance count, m.
    cutoff: f64,
    /// Number of pairs and sum of their vectors (m), for each set of directions and each bin.
    found: Vec<(u32, Vec3)>,
}

impl<'a> Pairs<'a> {
    /// No pairs yet, of this number of spheres with the radius `r` (m). `None` if the room has no place for a
    /// bin.
    fn new(spheres: usize, r: f64, room: &'a Polyhedron, axes: &'a [Vec3; 3]) -> Option<Self> {
        let width = r / BINS_PER_RADIUS;
        if room.volume() <= 0.0 {
            return None;
        }
        // The correction is valid up to half the least width. Nothing happens beyond five diameters. With
        // very many spheres, there are too many pairs up to that distance.
        let most = if spheres > 100_000 { 6.0 * r } else { 10.0 * r };
        let cutoff = (0.5 * least_width(room)).min(most);
        // A whole number of bins may be a little less by rounding.
        let bins = (cutoff / width + 1e-9).floor().max(0.0) as usize;
        let found = vec![(0, Vec3::zeros()); SETS * bins];
        (bins > 0).then_some(Pairs { room, axes, width, bins, cutoff, found })
    }

    /// Counts a pair with the vector `apart` (m).
    fn add(&mut self, apart: Vec3) {
        let bin = (apart.norm() / self.width) as usize;
        if bin < self.bins {
            let along = Vec3::from(self.axes.map(|axis| axis.dot(&apart)));
            let (set, sign) = set_of(&along);
            let (count, sum) = &mut self.found[set * self.bins + bin];
            *count += 1;
            *sum += along * sign;
        }
    }

    /// The distribution, where every pair counts this `often` and there are `all` pairs at any distance.
    fn distribution(&self, often: f64, all: f64) -> Vec<[f64; 2]> {
        let Pairs { room, axes, width, bins, cutoff, found } = self;
        let (width, bins) = (*width, *bins);
        let halves: Vec<Half> = room.faces.iter().map(|face| face.half).collect();
        let turned = |d: &Vec3| axes[0] * d.x + axes[1] * d.y + axes[2] * d.z;
        let weights: Vec<Vec<f64>> = found
            .par_chunks(bins)
            .enumerate()
            .map(|(set, pairs)| {
                if pairs.iter().all(|(count, _)| *count == 0) {
                    return Vec::new();
                }
                let common = Common::along(room, &halves, &turned(&middle_of(set)), *cutoff);
                let weight = |(count, sum): &(u32, Vec3)| match count {
                    0 => 0.0,
                    _ => often * f64::from(*count) / common.volume(&turned(&(sum / f64::from(*count)))),
                };
                pairs.iter().map(weight).collect()
            })
            .collect();
        let mut sums = vec![0.0; bins];
        for weights in &weights {
            sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight);
        }
        // The density of pairs of independent centres.
        let volume = room.volume();
        let density2 = all / (volume * volume);
        let cube = |k: usize| (k as f64).powi(3);
        let shell = |k: usize| 4.0 / 3.0 * PI * width.powi(3) * (cube(k + 1) - cube(k));
        let at = |k: usize| (k as f64 + 0.5) * width;
        sums.iter().enumerate().map(|(k, sum)| [at(k), sum / (density2 * shell(k))]).collect()
    }
}

/// The least distance of a face from the opposite end of the polyhedron, m.
fn least_width(room: &Polyhedron) -> f64 {
    let width = |n: &Vec3| room.reach(n) + room.reach(&-n);
    room.faces.iter().map(|face| width(&face.half.n)).fold(f64::INFINITY, f64::min)
}

/// The set that a direction belongs to, and the sign that brings it there: opposite directions are alike.
fn set_of(d: &Vec3) -> (usize, f64) {
    let axis = d.iamax();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let place = |c: f64| {
        let share = (c / d[axis] + 1.0) / 2.0 * SETS_PER_SIDE as f64;
        (share as usize).min(SETS_PER_SIDE - 1)
    };
    let set = (axis * SETS_PER_SIDE + place(d[u])) * SETS_PER_SIDE + place(d[v]);
    (set, if d[axis] < 0.0 { -1.0 } else { 1.0 })
}

/// The direction in the middle of a set, a unit vector.
fn middle_of(set: usize) -> Vec3 {
    let axis = set / SETS_PER_SIDE / SETS_PER_SIDE;
    let middle = |k: usize| (2 * k + 1) as f64 / SETS_PER_SIDE as f64 - 1.0;
    let mut d = Vec3::zeros();
    d[axis] = 1.0;
    d[(axis + 1) % 3] = middle(set / SETS_PER_SIDE % SETS_PER_SIDE);
    d[(axis + 2) % 3] = middle(set % SETS_PER_SIDE);
    d.normalize()
}

/// The volume that a polyhedron has in common with itself, moved along one direction.
struct Common {
    direction: Vec3,
    /// Distances (m), and there the volume (m^3) and its gradient (m^2).
    nodes: [(f64, f64, Vec3); NODES],
    /// Weights of the nodes in the barycentric formula of the polynomial through them.
    weights: [f64; NODES],
}

impl Common {
    /// The volumes up to the distance `cutoff` (m) along the unit vector `direction`. `halves` bound the
    /// room.
    fn along(room: &Polyhedron, halves: &[Half], direction: &Vec3, cutoff: f64) -> Self {
        // Chebyshev's points, where the polynomial is best.
        let angle = |k: usize| PI * (k as f64 + 0.5) / NODES as f64;
        let nodes = std::array::from_fn(|k| {
            let t = cutoff * (1.0 - angle(k).cos()) / 2.0;
            let (volume, gradient) = common(room, halves, &(direction * t));
            (t, volume, gradient)
        });
        let weights = std::array::from_fn(|k| angle(k).sin() * if k % 2 == 0 { 1.0 } else { -1.0 });
        Common { direction: *direction, nodes, weights }
    }

    /// The common volume for a vector `d` (m) near the direction, m^3.
    fn volume(&self, d: &Vec3) -> f64 {
        let t = d.norm();
        let aside = d - self.direction * t;
        let at = |(_, volume, gradient): &(f64, f64, Vec3)| volume + gradient.dot(&aside);
        if let Some(node) = self.nodes.iter().find(|node| node.0 == t) {
            return at(node);
        }
        let (mut sum, mut total) = (0.0, 0.0);
        for (node, weight) in self.nodes.iter().zip(&self.weights) {
            let share = weight / (t - node.0);
            sum += share * at(node);
            total += share;
        }
        sum / total
    }
}

/// The volume (m^3) that `room` has in common with itself moved by `d` (m), and its gradient (m^2).
///
/// The volume shrinks by the area of a moved face times the way of the face.
fn common(room: &Polyhedron, halves: &[Half], d: &Vec3) -> (f64, Vec3) {
    let mut body = room.clone();
    body.faces.iter_mut().for_each(|face| face.source = None);
    for (k, half) in halves.iter().enumerate().filter(|(_, half)| half.n.dot(d) < 0.0) {
        body.cut(&half.moved(d), k);
    }
    let moved = body.faces.iter().filter(|face| face.source.is_some());
    (body.volume(), moved.map(|face| face.half.n * face.area()).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    const R: f64 = 0.05;
    const AXES: [Vec3; 3] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];

    fn half(n: [f64; 3], b: f64) -> Half {
        let n = Vec3::from(n);
        Half { n: n.normalize(), b: b / n.norm() }
    }

    /// The box of 1 m x 2 m x 0.5 m, a tube of 24 planes, a wedge and an octahedron.
    fn rooms() -> [(&'static str, Vec<Half>); 4] {
        let ends = [half([0.0, 0.0, 1.0], 1.2), half([0.0, 0.0, -1.0], 0.0)];
        let angle = |k: usize| 2.0 * PI * (k as f64 + 0.5) / 24.0;
        let tube = (0..24).map(|k| half([angle(k).cos(), angle(k).sin(), 0.0], 0.5)).chain(ends).collect();
        let wedge = vec![
            half([1.0, 0.0, -1.0], 0.0),
            half([-1.0, 0.0, -1.0], 0.0),
            half([0.0, 0.0, 1.0], 1.0),
            half([0.0, 1.0, 0.0], 1.5),
            half([0.0, -1.0, 0.0], 0.0),
        ];
        let sign = |k: usize, axis: usize| if k >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let octahedron = (0..8).map(|k| half([sign(k, 0), sign(k, 1), sign(k, 2)], 1.0)).collect();
        let cuboid = Polyhedron::cuboid(&Vec3::zeros(), &Vec3::new(1.0, 2.0, 0.5));
        let cuboid = cuboid.faces.iter().map(|face| face.half).collect();
        [("box", cuboid), ("tube", tube), ("wedge", wedge), ("octahedron", octahedron)]
    }

    #[test]
    fn independent_centres_have_a_flat_radial_distribution_in_any_polyhedron() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        for (name, halves) in rooms() {
            let room = Polyhedron::of(&halves);
            let (low, high) = room.bounds();
            let mut x = Vec::new();
            while x.len() < 10_000 {
                let at = Vec3::from_fn(|k, _| random.random_range(low[k]..high[k]));
                if halves.iter().all(|half| half.beyond(&at) < 0.0) {
                    x.push(at);
                }
            }
            // The last bin ends at half the least width.
            let r = 0.5 * least_width(&room) / 2.0;
            let found = radial_distribution(&x, r, &room, &AXES);
            assert_eq!(found.len(), 40, "{name}");
            let (n, volume) = (x.len() as f64, room.volume());
            // n centres show their density to 1/sqrt(n), which moves all bins together.
            let together = 1.0 / n.sqrt();
            for (k, [at, g]) in found.iter().enumerate() {
                // The pairs of a bin are counted with the error of their square root. Five times that does
                // not happen by chance in 160 bins. Near the bounds of the room fewer pairs count, by the
                // common volume, which is an eighth of the room at the least.
                let width = r / BINS_PER_RADIUS;
                let shell = 4.0 / 3.0 * PI * (3.0 * at * at * width + width.powi(3) / 4.0);
                let pairs = 0.5 * n * n * shell / volume;
                let room_for_pairs = (1.0 - k as f64 / 80.0).powi(3);
                let error = 1.0 / (pairs * room_for_pairs).sqrt();
                assert!((g - 1.0).abs() < 5.0 * error + together, "{name} at {at}: {g} +- {error}");
            }
            // Beyond the first bins the counting error is small, and all bins agree with 1 to a hundredth.
            let far = &found[10..];
            let mean = far.iter().map(|[_, g]| g).sum::<f64>() / far.len() as f64;
            assert!((mean - 1.0).abs() < together, "{name}: {mean}");
        }
    }

    #[test]
    fn classes_that_do_not_know_of_each_other_have_a_flat_cross_distribution() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(14);
        for (name, halves) in rooms() {
            let room = Polyhedron::of(&halves);
            let (low, high) = room.bounds();
            let mut draw = |count: usize| {
                let mut x = Vec::new();
                while x.len() < count {
                    let at = Vec3::from_fn(|k, _| random.random_range(low[k]..high[k]));
                    if halves.iter().all(|half| half.beyond(&at) < 0.0) {
                        x.push(at);
                    }
                }
                x
            };
            let (a, b) = (draw(6000), draw(9000));
            let r = 0.5 * least_width(&room) / 2.0;
            let found = cross_distribution(&a, &b, r, &room, &AXES);
            assert_eq!(found, cross_distribution(&b, &a, r, &room, &AXES), "{name}");
            let far = &found[10..];
            let mean = far.iter().map(|[_, g]| g).sum::<f64>() / far.len() as f64;
            assert!((mean - 1.0).abs() < 0.015, "{name}: {mean}");
        }
        // Two cubic lattices, one in the middles of the other: 8 neighbours at sqrt(3)/2 of a cell.
        let along = |k: usize, step: usize| (k / step % 10) as f64 * 0.1;
        let at =
            |k: usize, from: f64| Vec3::new(along(k, 1), along(k, 10), along(k, 100)) + Vec3::repeat(from);
        let (a, b): (Vec<Vec3>, Vec<Vec3>) = (0..1000).map(|k| (at(k, 0.0), at(k, 0.05))).unzip();
        let room = Polyhedron::cuboid(&Vec3::repeat(-0.025), &Vec3::repeat(0.975));
        let found = cross_distribution(&a, &b, R, &room, &AXES);
        let width = R / BINS_PER_RADIUS;
        let k = found.iter().position(|[_, g]| *g > 0.0).unwrap();
        assert!((found[k][0] - 0.05 * 3f64.sqrt()).abs() < width, "{:?}", found[k]);
        let shell = 4.0 / 3.0 * PI * width.powi(3) * ((k as f64 + 1.0).powi(3) - (k as f64).powi(3));
        let neighbours = found[k][1] * 1000.0 * shell;
        assert!((neighbours / 8.0 - 1.0).abs() < 0.02, "{neighbours}");
        assert!(cross_distribution(&a, &[], R, &room, &AXES).is_empty());
    }

    #[test]
    fn the_common_volume_is_exact_at_the_middle_of_each_set_and_to_a_thousandth_between() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        for (name, halves) in rooms() {
            let room = Polyhedron::of(&halves);
            let cutoff = 0.5 * least_width(&room);
            let (mut mean, mut worst) = (0.0, 0.0f64);
            const DRAWS: usize = 400;
            for _ in 0..DRAWS {
                // A random direction, and a random distance.
                let d = loop {
                    let d = Vec3::from_fn(|_, _| random.random_range(-1.0..1.0));
                    if d.norm() < 1.0 {
                        break d * cutoff;
                    }
                };
                let (set, sign) = set_of(&d);
                let found = Common::along(&room, &halves, &middle_of(set), cutoff).volume(&(d * sign));
                let exact = common(&room, &halves, &d).0;
                let ratio = found / exact - 1.0;
                mean += ratio / DRAWS as f64;
                worst = worst.max(ratio.abs());
                let along = middle_of(set) * d.norm();
                let middle = Common::along(&room, &halves, &middle_of(set), cutoff).volume(&along);
                // Exact at the middle of a set, up to the polynomial.
                let error = middle / common(&room, &halves, &along).0 - 1.0;
                assert!(error.abs() < 1e-3, "{name}: {error} at {d}");
            }
            // A kink within a set costs up to a few per cent there, and next to nothing in the mean.
            assert!(mean.abs() < 1e-3 && worst < 0.05, "{name}: {mean} {worst}");
        }
        // For a box, the product of what its sides have in common.
        let (name, halves) = &rooms()[0];
        let room = Polyhedron::of(halves);
        let d = Vec3::new(0.2, -0.3, 0.1);
        let exact = 0.8 * 1.7 * 0.4;
        assert!((common(&room, halves, &d).0 - exact).abs() < 1e-14, "{name}");
    }

    #[test]
    fn the_first_peak_of_lattices_is_at_a_diameter_and_nothing_is_before() {
        let along = |k: usize, step: usize| (k / step % 10) as f64 * 0.1 + 0.05;
        let cubic = (0..1000).map(|k| Vec3::new(along(k, 1), along(k, 10), along(k, 100)));
        let face: Vec<Vec3> = (0..14 * 14 * 14)
            .map(|k| [k % 14, k / 14 % 14, k / 196])
            .filter(|c| c.iter().sum::<usize>() % 2 == 0)
            .map(|c| Vec3::from(c.map(|c| (c as f64 + 0.5) * 1.0001 * 2.0 * R / 2f64.sqrt())))
            .collect();
        let side = 14.0 * 1.0001 * 2.0 * R / 2f64.sqrt();
        let slightly_apart: Vec<Vec3> = cubic.map(|x| x * 1.0001).collect();
        for (x, side, neighbours, second) in
            [(slightly_apart, 1.0001, 6.0, 2f64.sqrt()), (face, side, 12.0, 2f64.sqrt())]
        {
            let room = Polyhedron::cuboid(&Vec3::zeros(), &Vec3::repeat(side));
            let g = radial_distribution(&x, R, &room, &AXES);
            let width = R / BINS_PER_RADIUS;
            let peaks: Vec<&[f64; 2]> = g.iter().filter(|[_, g]| *g > 0.0).collect();
            assert!((peaks[0][0] - 2.0 * R).abs() < width, "{:?}", peaks[0]);
            assert!((peaks[1][0] - second * 2.0 * R).abs() < width, "{:?}", peaks[1]);
            // The area of the peak is the coordination number.
            let density = x.len() as f64 / side.powi(3);
            let bin = (2.0 * R * 1.0001 / width).floor();
            let shell = 4.0 / 3.0 * PI * width.powi(3) * ((bin + 1.0).powi(3) - bin.powi(3));
            let found = peaks[0][1] * density * shell;
            assert!((found / neighbours - 1.0).abs() < 0.02, "{found}");
        }
    }
}
