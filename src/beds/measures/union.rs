//! The volume of the union of spheres inside a region, accurate to almost all digits.
//!
//! A point inside several spheres belongs to the one with the least power |p - x_i|^2 - r_i^2; for equal
//! spheres that is the one with the nearest centre. The part of a sphere is therefore a ball that half-spaces
//! cut. Their planes are the radical planes with the spheres that it overlaps, which are half-way to equal
//! ones, or bounds of the region. Of a sphere inside another one nothing remains.
//!
//! If no two cuts meet inside the ball, it only loses spherical caps. Otherwise the areas of its horizontal
//! sections are integrated by Gauss's rule, between the heights at which their shape changes. These areas are
//! exact, see [`super::flat`]. A large sphere among small ones loses very many caps, few of which meet; see
//! `bites.rs`.

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use super::bites::{FEW, drop_shadowed, taken};
use super::flat::Flat;
use super::quadrature::integral;
use super::region::{Pillar, Region, cut_section};
use crate::engine::neighbors::{Key, Lists, Reach};
use crate::math::polyhedron::Half;
use crate::math::vector::Vec3;
use crate::model::size::{Size, Sizes};

/// Largest error of the volume of a ball, in r^3. It is far above rounding and far below any measured effect.
pub(super) const TOLERANCE: f64 = 1e-11;

/// Spheres, each with the radical planes between it and the spheres that it overlaps.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::region::Region;
/// use demhybrid::beds::measures::union::Spheres;
/// use demhybrid::math::vector::Vec3;
/// use std::f64::consts::PI;
///
/// // Two spheres overlap by a lens: two caps of height h = 0.25 m.
/// let centres = [Vec3::zeros(), Vec3::new(1.5, 0.0, 0.0)];
/// let all = Region::cuboid(Vec3::repeat(-3.0), Vec3::repeat(3.0));
/// let volumes = Spheres::new(&centres, 1.0).volumes(&all);
/// let cap = PI * 0.25 * 0.25 * (3.0 - 0.25) / 3.0;
/// assert!((volumes.spheres - 8.0 / 3.0 * PI).abs() < 1e-12); // m^3
/// assert!((volumes.union - (8.0 / 3.0 * PI - 2.0 * cap)).abs() < 1e-12);
/// ```
pub struct Spheres<'a> {
    x: &'a [Vec3],
    sizes: Sizes<'a>,
    cuts: Vec<Vec<Half>>,
    /// Whether each sphere is inside another one, or coincides with one of a lower index.
    covered: Vec<bool>,
}

/// Spheres whose radii are within a factor of 2.
struct Octave {
    /// Largest radius, m.
    r: f64,
    /// Distance from the origin along a direction (m) and index of each sphere, ascending.
    along: Vec<(f64, usize)>,
}

/// Volumes inside a region, m^3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volumes {
    /// Volume of all points inside any sphere.
    pub union: f64,
    /// Sum over all spheres. A point inside several spheres counts several times.
    pub spheres: f64,
    /// Volume of the region.
    pub region: f64,
}

impl Volumes {
    /// The sums of what [`Spheres::parts`] found in `region`.
    pub fn of(parts: &[[f64; 2]], region: &Region) -> Self {
        let sum = |k: usize| parts.iter().map(|volumes| volumes[k]).sum();
        Volumes { union: sum(0), spheres: sum(1), region: region.volume() }
    }
}

impl<'a> Spheres<'a> {
    /// Spheres of radius `r` (m) around the centres `x` (m).
    pub fn new(x: &'a [Vec3], r: f64) -> Self {
        Self::sized(x, Sizes::Equal(Size::new(r, 1.0)))
    }

    /// Spheres with these `sizes` around the centres `x` (m). Masses do not matter.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::beds::measures::region::Region;
    /// use demhybrid::beds::measures::union::Spheres;
    /// use demhybrid::math::vector::Vec3;
    /// use demhybrid::model::size::{Size, Sizes};
    /// use std::f64::consts::PI;
    ///
    /// // A sphere inside another one adds nothing.
    /// let centres = [Vec3::zeros(), Vec3::new(0.4, 0.0, 0.0)];
    /// let sizes = [Size::new(1.0, 1.0), Size::new(0.5, 1.0)];
    /// let all = Region::cuboid(Vec3::repeat(-3.0), Vec3::repeat(3.0));
    /// let volumes = Spheres::sized(&centres, Sizes::Each(&sizes)).volumes(&all);
    /// assert!((volumes.union - 4.0 / 3.0 * PI).abs() < 1e-12); // m^3
    /// assert!((volumes.spheres - 1.125 * 4.0 / 3.0 * PI).abs() < 1e-12);
    /// ```
    pub fn sized(x: &'a [Vec3], sizes: Sizes<'a>) -> Self {
        let mut cuts = vec![Vec::new(); x.len()];
        let mut covered = vec![false; x.len()];
        let r = |i: usize| sizes.of(i).r;
        let touching = Reach { sizes, shares: [1.0; 2], gaps: [0.0; 2] };
        let touching = match sizes {
            Sizes::Equal(size) => Reach::of_centres(2.0 * size.r, 2.0 * size.r),
            Sizes::Each(_) => touching,
        };
        for_each_within(x, touching, |[i, j]| {
            let apart = x[j] - x[i];
            let d = apart.norm();
            if d > 0.0 {
                let n = apart / d;
                // How much further than half-way the radical plane is from i; exactly 0 for equal spheres.
                let shift = (r(i) - r(j)) * (r(i) + r(j)) / (2.0 * d);
                cuts[i].push(Half { n, b: n.dot(&x[i]) + (d / 2.0 + shift) });
                cuts[j].push(Half { n: -n, b: (d / 2.0 - shift) - n.dot(&x[j]) });
            } else if r(i) == r(j) {
                covered[i.max(j)] = true;
            } else {
                covered[if r(i) < r(j) { i } else { j }] = true;
            }
        });
        let unequal = matches!(sizes, Sizes::Each(_));
        let each = x.par_iter().zip(&mut cuts).zip(&mut covered).enumerate();
        each.for_each(|(i, ((x, cuts), covered))| {
            let r = r(i);
            // Radical planes may have the centre beyond them.
            if unequal && (cuts.len() > FEW || cuts.iter().any(|half| half.beyond(x) > 0.0)) {
                *covered |= drop_shadowed(x, r, cuts);
            } else {
                drop_idle(x, r, cuts);
            }
        });
        Spheres { x, sizes, cuts, covered }
    }

    /// Radius of sphere `i`, m.
    fn r(&self, i: usize) -> f64 {
        self.sizes.of(i).r
    }

    /// Volumes inside `region`. The result has the same bits for any number of threads.
    pub fn volumes(&self, region: &Region) -> Volumes {
        Volumes::of(&self.parts(region), region)
    }

    /// For each sphere its part of the union inside `region`, and its own volume there, m^3.
    ///
    /// A point inside several spheres is in the part of one of them only.
    pub fn parts(&self, region: &Region) -> Vec<[f64; 2]> {
        let halves = region.halves();
        let pillar = region.pillar();
        (0..self.x.len())
            .into_par_iter()
            .map(|i| {
                let (x, r, cuts) = (&self.x[i], self.r(i), &self.cuts[i]);
                if region.body().faces.is_empty() || halves.iter().any(|half| half.beyond(x) >= r) {
                    return [0.0; 2];
                }
                let inside = Ball::new(x, r, halves.iter(), pillar);
                let whole = inside.volume();
                let own = if self.covered[i] {
                    0.0
                } else if cuts.is_empty() {
                    whole
                } else if cuts.len() > FEW && matches!(self.sizes, Sizes::Each(_)) {
                    (whole - taken(&inside, x, cuts)).max(0.0)
                } else {
                    Ball::new(x, r, halves.iter().chain(cuts), pillar).volume()
                };
                [own, whole]
            })
            .collect()
    }

    /// Areas (m^2) of sections of the union with planes across the unit vector `n`, at distances `at` (m)
    /// from the origin along it. `halves(k)` and `pillar` bound the k-th section.
    ///
    /// The result has the same bits for any number of threads.
    pub fn sections(
        &self,
        n: &Vec3,
        at: &[f64],
        halves: impl Fn(usize) -> Vec<Half> + Sync,
        pillar: Option<Pillar>,
    ) -> Vec<f64> {
        let octaves = self.octaves(n);
        let unequal = matches!(self.sizes, Sizes::Each(_));
        let area = |k: usize| {
            let halves = halves(k);
            let mut flat = Flat::default();
            let mut area = 0.0;
            for Octave { r, along } in &octaves {
                let from = along.partition_point(|(place, _)| *place <= at[k] - r);
                let to = along.partition_point(|(place, _)| *place < at[k] + r);
                for &(place, i) in along.get(from..to).unwrap_or_default() {
                    let (x, r) = (&self.x[i], self.r(i));
                    if (at[k] - place).abs() < r && halves.iter().all(|half| half.beyond(x) < r) {
                        let mut ball = Ball::new(x, r, halves.iter().chain(&self.cuts[i]), pillar);
                        if unequal {
                            ball.keep_those_across(n, at[k] - place);
                        }
                        area += ball.section(n, at[k] - place, &mut flat);
                    }
                }
            }
            area
        };
        (0..at.len()).into_par_iter().map(area).collect()
    }

    /// The spheres that are not covered, by octaves of their radii and by their places along `n`.
    fn octaves(&self, n: &Vec3) -> Vec<Octave> {
        let left = || (0..self.x.len()).filter(|&i| !self.covered[i]);
        let most = left().map(|i| self.r(i)).fold(0.0, f64::max);
        let mut octaves: Vec<Octave> = Vec::new();
        for i in left() {
            let k = (most / self.r(i)).log2().floor() as usize;
            octaves.resize_with(octaves.len().max(k + 1), || Octave { r: 0.0, along: Vec::new() });
            octaves[k].r = octaves[k].r.max(self.r(i));
            octaves[k].along.push((n.dot(&self.x[i]), i));
        }
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        octaves.iter_mut().for_each(|octave| octave.along.sort_unstable_by(order));
        octaves
    }
}

/// Drops the half-spaces that have no effect on a ball at `x` (m): the other ones cut off their whole plane.
///
/// All half-spaces must contain the centre of the ball. If many spheres overlap, most of them have no effect.
fn drop_idle(x: &Vec3, r: f64, halves: &mut Vec<Half>) {
    let local = |half: &Half| half.b - half.n.dot(x);
    halves.sort_by(|a, b| local(a).total_cmp(&local(b)));
    let mut flat = Flat::default();
    let mut idle = |half: &Half, others: &mut dyn Iterator<Item = &Half>| {
        let (n, b) = (half.n, local(half));
        let u = if n.x.abs() < 0.6 { n.cross(&Vec3::x()) } else { n.cross(&Vec3::y()) }.normalize();
        let v = n.cross(&u);
        flat.clear();
        flat.within([0.0; 2], (r * r - b * b).max(0.0).sqrt());
        for other in others {
            flat.below([other.n.dot(&u), other.n.dot(&v)], local(other) - b * other.n.dot(&n));
        }
        flat.area() <= 1e-13 * r * r
    };
    // The nearest planes cut off most others, so take them first. Then drop those that later ones cut off.
    let mut kept: Vec<Half> = Vec::new();
    for half in halves.iter() {
        if !idle(half, &mut kept.iter()) {
            kept.push(*half);
        }
    }
    for k in (0..kept.len()).rev() {
        let (before, after) = kept.split_at(k);
        if idle(&after[0], &mut before.iter().chain(&after[1..])) {
            kept.remove(k);
        }
    }
    *halves = kept;
}

/// Calls `visit` for every pair of centres within `cutoff` (m) of each other. The order depends on `x` alone.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::union::for_each_pair;
/// use demhybrid::math::vector::Vec3;
///
/// let centres = [0.0, 0.2, 0.4, 2.0].map(|x| Vec3::new(x, 0.0, 0.0));
/// let mut pairs = Vec::new();
/// for_each_pair(&centres, 0.3, |[i, j]| pairs.push([i.min(j), i.max(j)]));
/// pairs.sort();
/// assert_eq!(pairs, [[0, 1], [1, 2]]);
/// ```
pub fn for_each_pair(x: &[Vec3], cutoff: f64, visit: impl FnMut([usize; 2])) {
    for_each_within(x, Reach::of_centres(cutoff, cutoff), visit);
}

/// The same for every pair within `reach`, at a cost that does not depend on how unequal the spheres are.
pub fn for_each_within(x: &[Vec3], reach: Reach, visit: impl FnMut([usize; 2])) {
    let keys: Vec<Key> = (0..x.len() as u64).map(|id| ([0; 3], id)).collect();
    let mut lists = Lists::default();
    lists.rebuild(x, &keys, x.len(), reach, &[], 1);
    lists.blocks.iter().flat_map(|block| block.first_pairs()).for_each(visit);
}

/// The part of a ball around the origin that half-spaces, and perhaps an upright cylinder, leave.
pub(super) struct Ball {
    pub(super) r: f64,
    pub(super) halves: Vec<Half>,
    pub(super) pillar: Option<Pillar>,
    empty: bool,
}

impl Ball {
    pub(super) fn new<'h>(
        x: &Vec3,
        r: f64,
        halves: impl Iterator<Item = &'h Half>,
        pillar: Option<Pillar>,
    ) -> Self {
        let local = halves.map(|half| half.moved(&-x));
        let halves: Vec<Half> = local.filter(|half| half.b < r).collect();
        let pillar = pillar.map(|(axis, radius)| ([axis[0] - x.x, axis[1] - x.y], radius));
        let away = |axis: [f64; 2]| axis[0].hypot(axis[1]);
        let mut empty = halves.iter().any(|half| half.b <= -r);
        empty |= pillar.is_some_and(|(axis, radius)| away(axis) >= radius + r);
        let pillar = pillar.filter(|&(axis, radius)| away(axis) + r > radius);
        Ball { r, halves, pillar, empty }
    }

    /// This ball, cut by further `halves`, whose places are those around its centre.
    pub(super) fn cut(&self, halves: impl Iterator<Item = Half>) -> Self {
        let halves: Vec<Half> = self.halves.iter().copied().chain(halves).collect();
        let empty = self.empty || halves.iter().any(|half| half.b <= -self.r);
        Ball { r: self.r, halves, pillar: self.pillar, empty }
    }

    /// Drops the half-spaces whose planes miss the section across `n` at the distance `at` (m).
    fn keep_those_across(&mut self, n: &Vec3, at: f64) {
        let radius = (self.r * self.r - at * at).max(0.0).sqrt();
        let mut empty = self.empty;
        self.halves.retain(|half| {
            let slope = half.n.dot(n);
            let (room, width) = (half.b - at * slope, radius * (1.0 - slope * slope).max(0.0).sqrt());
            empty |= room <= -width;
            room < width
        });
        self.empty = empty;
    }

    pub(super) fn volume(&self) -> f64 {
        let r = self.r;
        if self.empty {
            return 0.0;
        }
        if self.pillar.is_none() && self.caps_are_apart() {
            let caps = self.halves.iter().map(|half| {
                let h = r - half.b;
                PI * h * h * (3.0 * r - h) / 3.0
            });
            return (4.0 / 3.0 * PI * r.powi(3) - caps.sum::<f64>()).max(0.0);
        }
        let mut flat = Flat::default();
        let area = |z: f64| self.section(&Vec3::z(), z, &mut flat);
        volume_between(&self.heights(), area, TOLERANCE * r.powi(3))
    }

    /// Whether no two of the caps that are cut off meet.
    ///
    /// The angle between their axes must be at least the sum of the angles between axis and rim of each.
    fn caps_are_apart(&self) -> bool {
        let opening = |half: &Half| (half.b / self.r).clamp(-1.0, 1.0).acos();
        self.halves.iter().enumerate().all(|(k, a)| {
            self.halves[..k].iter().all(|b| a.n.dot(&b.n).clamp(-1.0, 1.0).acos() >= opening(a) + opening(b))
        })
    }

    /// Heights at which the section changes its shape, ascending. With a cylinder, some may be missing.
    pub(super) fn heights(&self) -> Vec<f64> {
        let (r, z) = (self.r, Vec3::z());
        let (mut low, mut high) = (-r, r);
        let mut found = Vec::new();
        let mut add = |point: Vec3| {
            if self.halves.iter().all(|half| half.n.dot(&point) <= half.b + 1e-9 * r) {
                found.push(point.z);
            }
        };
        for (k, a) in self.halves.iter().enumerate() {
            if a.n.z.abs() > 1.0 - 1e-14 {
                if a.n.z > 0.0 {
                    high = high.min(a.b)
                } else {
                    low = low.max(-a.b)
                }
                continue;
            }
            // The highest and the lowest point of the circle in which the plane cuts the ball.
            let uphill = (z - a.n * a.n.z).normalize();
            let radius = (r * r - a.b * a.b).max(0.0).sqrt();
            [radius, -radius].into_iter().for_each(|t| add(a.n * a.b + uphill * t));
            for (l, b) in self.halves[..k].iter().enumerate() {
                let line = a.n.cross(&b.n);
                let sine2 = line.norm_squared();
                if sine2 < 1e-20 {
                    continue;
                }
                let cosine = a.n.dot(&b.n);
                let foot = (a.n * (a.b - b.b * cosine) + b.n * (b.b - a.b * cosine)) / sine2;
                let half_chord2 = r * r - foot.norm_squared();
                if half_chord2 <= 0.0 {
                    continue;
                }
                let along = line / sine2.sqrt();
                [1.0, -1.0].into_iter().for_each(|sign| add(foot + along * (sign * half_chord2.sqrt())));
                for c in &self.halves[..l] {
                    let slope = c.n.dot(&along);
                    let t = (c.b - c.n.dot(&foot)) / slope;
                    if slope.abs() > 1e-12 && t * t < half_chord2 {
                        add(foot + along * t);
                    }
                }
            }
        }
        if let Some((axis, radius)) = self.pillar {
            // The heights at which the section of the ball touches that of the cylinder.
            let touching = r * r - (radius - axis[0].hypot(axis[1])).powi(2);
            if touching > 0.0 {
                found.extend([touching.sqrt(), -touching.sqrt()]);
            }
        }
        found.retain(|&height| height > low && height < high);
        found.extend([low, high.max(low)]);
        found.sort_unstable_by(f64::total_cmp);
        found.dedup_by(|b, a| *b - *a < 1e-13 * r);
        found
    }

    /// Area of the section with the plane across the unit vector `n`, at the distance `at` (m) from the
    /// centre along it, m^2.
    pub(super) fn section(&self, n: &Vec3, at: f64, flat: &mut Flat) -> f64 {
        flat.clear();
        flat.within([0.0; 2], (self.r * self.r - at * at).max(0.0).sqrt());
        cut_section(flat, n, &(n * at), &self.halves, self.pillar);
        if self.empty { 0.0 } else { flat.area() }
    }
}

/// Integral of the `area` (m^2) of sections over the height, m^3. It is smooth between two of the `heights`
/// (m), which ascend. The error is below `tolerance` (m^3).
pub(super) fn volume_between(heights: &[f64], mut area: impl FnMut(f64) -> f64, tolerance: f64) -> f64 {
    let part = |ends: &[f64]| {
        let (middle, half) = ((ends[0] + ends[1]) / 2.0, (ends[1] - ends[0]) / 2.0);
        // At both ends the area grows like a square root. It is smooth as a function of the angle with the
        // sine `s`.
        let mut area = |s: f64| {
            let (sine, cosine) = (FRAC_PI_2 * s).sin_cos();
            half * FRAC_PI_2 * cosine * area(middle + half * sine)
        };
        integral(&mut area, [-1.0, 1.0], tolerance / heights.len() as f64)
    };
    heights.windows(2).map(part).sum()
}

#[cfg(test)]
#[path = "union_tests.rs"]
mod tests;
