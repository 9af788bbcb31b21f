//! Distributions of radii: by number, by volume, and the sizes that stand for them.

use statrs::function::erf::{erfc, erfc_inv};
use std::f64::consts::{PI, SQRT_2};

use super::{Radius, Spread};

/// Beyond this many standard deviations a normal distribution has nothing that a double could hold.
const FURTHEST: f64 = 40.0;

/// How the radii of a species are distributed. All radii are in m.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::species::Distribution;
///
/// let uniform = Distribution::Uniform { min: 1.0, max: 3.0 };
/// assert_eq!(uniform.number_below(2.0), 0.5);
/// assert_eq!(uniform.quantile(0.5), 2.0);
/// assert!((uniform.volume_below(2.0) - 15.0 / 80.0).abs() < 1e-15); // large spheres have most of the volume
/// assert_eq!((uniform.mean(), uniform.mean_cube()), (2.0, 10.0));
/// // Four spheres in its place have the same volume in all.
/// let cubes: f64 = uniform.sizes(4).map(|r| r.powi(3)).sum();
/// assert!((cubes / 40.0 - 1.0).abs() < 1e-14);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// All have this radius.
    One(f64),
    /// All radii between these are equally frequent.
    Uniform {
        /// The least radius.
        min: f64,
        /// The largest radius.
        max: f64,
    },
    /// A normal distribution that is cut off.
    Normal {
        /// Mean of the whole distribution.
        mean: f64,
        /// Standard deviation of the whole distribution.
        sd: f64,
        /// The least radius.
        min: f64,
        /// The largest radius.
        max: f64,
    },
    /// ln r has a normal distribution, which is cut off.
    Lognormal {
        /// Median of the whole distribution.
        median: f64,
        /// Standard deviation of ln r of the whole distribution.
        sigma: f64,
        /// The least radius.
        min: f64,
        /// The largest radius.
        max: f64,
    },
    /// A sieve curve, whose mass is spread evenly over the radii between two points.
    Sieve(Curve),
}

/// The points of a sieve curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Radii, each with the share of the mass below it, from 0 to 1.
    points: Vec<[f64; 2]>,
    /// At each point the number of spheres below it, in spheres of the largest radius that have all the mass.
    numbers: Vec<f64>,
}

impl Curve {
    /// The curve with these points: radii that rise from above 0, and shares that rise from 0 to 1.
    pub fn new(points: &[[f64; 2]]) -> Self {
        let last = points.last().map_or(1.0, |point| point[0]);
        let mut numbers = vec![0.0];
        for pair in points.windows(2) {
            let [[a, below], [b, above]] = [pair[0], pair[1]];
            let [a, b] = [a / last, b / last];
            // The integral of 1/r^3 from a to b, over its length.
            let number = (above - below) * (a + b) / (2.0 * (a * b).powi(2));
            numbers.push(numbers[numbers.len() - 1] + number);
        }
        Curve { points: points.to_vec(), numbers }
    }

    fn all(&self) -> f64 {
        self.numbers[self.numbers.len() - 1]
    }

    fn last(&self) -> f64 {
        self.points[self.points.len() - 1][0]
    }

    /// Below the radius `r`: share of the mass, and number in the units of `numbers`.
    fn below(&self, r: f64) -> [f64; 2] {
        let next = self.points.partition_point(|point| point[0] < r);
        match next {
            0 => [0.0; 2],
            _ if next == self.points.len() => [1.0, self.all()],
            _ => {
                let [[a, below], [b, above]] = [self.points[next - 1], self.points[next]];
                let mass = (above - below) * ((r - a) / (b - a));
                let [a, r] = [a / self.last(), r / self.last()];
                [below + mass, self.numbers[next - 1] + mass * (a + r) / (2.0 * (a * r).powi(2))]
            }
        }
    }

    /// The radius below which `number` spheres are, in the units of `numbers`.
    fn radius(&self, number: f64) -> f64 {
        // The last piece that begins below this number.
        let next = self.numbers.partition_point(|&below| below < number).clamp(1, self.points.len() - 1);
        let [[a, below], [b, above]] = [self.points[next - 1], self.points[next]];
        if above == below {
            return a;
        }
        // 1/r^2 = 1/a^2 - 2 number/density, with lengths in units of the largest radius.
        let density = (above - below) * self.last() / (b - a);
        let within = (number - self.numbers[next - 1]) * 2.0 * (a / self.last()).powi(2) / density;
        (a / (1.0 - within).sqrt()).clamp(a, b)
    }
}

/// Share of a normal distribution below `z` standard deviations above its mean.
fn normal_below(z: f64) -> f64 {
    0.5 * erfc(-z / SQRT_2)
}

/// Share between `a` and `b`; where both are above the mean, without the loss of digits near 1.
fn normal_between(a: f64, b: f64) -> f64 {
    if a > 0.0 { normal_below(-a) - normal_below(-b) } else { normal_below(b) - normal_below(a) }
}

/// Standard deviations above the mean below which the share `p` is; infinite at 0 and 1.
fn normal_quantile(p: f64) -> f64 {
    -SQRT_2 * erfc_inv(2.0 * p)
}

/// The density of the standard normal distribution.
fn normal_density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// The bounds of a truncated normal distribution, or a radius, in standard deviations above the mean.
fn standard(r: f64, mean: f64, sd: f64) -> f64 {
    ((r - mean) / sd).clamp(-FURTHEST, FURTHEST)
}

/// A radius in standard deviations of ln r above the median.
fn standard_log(r: f64, median: f64, sigma: f64) -> f64 {
    ((r / median).ln() / sigma).clamp(-FURTHEST, FURTHEST)
}

/// The mean of (r/median)^k over a lognormal distribution that is cut off at two radii.
fn log_moment(k: f64, median: f64, sigma: f64, ends: [f64; 2]) -> f64 {
    let [a, b] = ends.map(|r| standard_log(r, median, sigma));
    let shift = k * sigma;
    (0.5 * shift * shift).exp() * normal_between(a - shift, b - shift) / normal_between(a, b)
}

/// Standard deviations above the mean below which the share `p` of what lies between two `ends` is.
fn quantile_between([a, b]: [f64; 2], p: f64) -> f64 {
    let all = normal_between(a, b);
    if a > 0.0 {
        -normal_quantile(normal_below(-a) - p * all)
    } else {
        normal_quantile(normal_below(a) + p * all)
    }
}

/// The integral of r^3 over a normal distribution from `a` to `z` standard deviations above the mean.
fn normal_cubes(mean: f64, sd: f64, a: f64, z: f64) -> f64 {
    let [at_a, at_z] = [a, z].map(normal_density);
    // Moments of order 0 to 3 of the standard distribution.
    let zeroth = normal_between(a, z);
    let first = at_a - at_z;
    let second = zeroth + a * at_a - z * at_z;
    let third = 2.0 * first + a * a * at_a - z * z * at_z;
    mean.powi(3) * zeroth
        + 3.0 * mean.powi(2) * sd * first
        + 3.0 * mean * sd.powi(2) * second
        + sd.powi(3) * third
}

impl Distribution {
    /// The distribution of a species. A table must have been read.
    pub fn of(radius: &Radius) -> Self {
        match radius {
            Radius::One(r) => Distribution::One(*r),
            Radius::Spread(Spread { uniform: Some([min, max]), .. }) => {
                Distribution::Uniform { min: *min, max: *max }
            }
            Radius::Spread(Spread { normal: Some([mean, sd, min, max]), .. }) => {
                Distribution::Normal { mean: *mean, sd: *sd, min: *min, max: *max }
            }
            Radius::Spread(Spread { lognormal: Some([median, sigma, min, max]), .. }) => {
                Distribution::Lognormal { median: *median, sigma: *sigma, min: *min, max: *max }
            }
            Radius::Spread(Spread { points, .. }) => {
                Distribution::Sieve(Curve::new(points.as_deref().unwrap_or_default()))
            }
        }
    }

    /// Share of the spheres with a radius below `r`.
    pub fn number_below(&self, r: f64) -> f64 {
        match self {
            Distribution::One(one) => f64::from(r > *one),
            Distribution::Uniform { min, max } => ((r - min) / (max - min)).clamp(0.0, 1.0),
            &Distribution::Normal { mean, sd, min, max } => {
                let [a, b, z] = [min, max, r.clamp(min, max)].map(|r| standard(r, mean, sd));
                normal_between(a, z) / normal_between(a, b)
            }
            &Distribution::Lognormal { median, sigma, min, max } => {
                let [a, b, z] = [min, max, r.clamp(min, max)].map(|r| standard_log(r, median, sigma));
                normal_between(a, z) / normal_between(a, b)
            }
            Distribution::Sieve(curve) => curve.below(r)[1] / curve.all(),
        }
    }

    /// Share of the volume, and so of the mass, of the spheres with a radius below `r`.
    pub fn volume_below(&self, r: f64) -> f64 {
        match self {
            Distribution::One(_) => self.number_below(r),
            Distribution::Uniform { min, max } => {
                let [a, r] = [min / max, (r / max).clamp(min / max, 1.0)];
                (r.powi(4) - a.powi(4)) / (1.0 - a.powi(4))
            }
            &Distribution::Normal { mean, sd, min, max } => {
                let [a, b, z] = [min, max, r.clamp(min, max)].map(|r| standard(r, mean, sd));
                (normal_cubes(mean, sd, a, z) / normal_cubes(mean, sd, a, b)).clamp(0.0, 1.0)
            }
            &Distribution::Lognormal { median, sigma, min, max } => {
                // By volume ln r is normal as well, with a mean that is 3 sigma^2 higher.
                let [a, b, z] =
                    [min, max, r.clamp(min, max)].map(|r| standard_log(r, median, sigma) - 3.0 * sigma);
                normal_between(a, z) / normal_between(a, b)
            }
            Distribution::Sieve(curve) => curve.below(r)[0],
        }
    }

    /// The radius below which the share `p` of the spheres is.
    pub fn quantile(&self, p: f64) -> f64 {
        match self {
            Distribution::One(r) => *r,
            Distribution::Uniform { min, max } => min + p * (max - min),
            &Distribution::Normal { mean, sd, min, max } => {
                let z = quantile_between([min, max].map(|r| standard(r, mean, sd)), p);
                (mean + sd * z).clamp(min, max)
            }
            &Distribution::Lognormal { median, sigma, min, max } => {
                let z = quantile_between([min, max].map(|r| standard_log(r, median, sigma)), p);
                (median * (sigma * z).exp()).clamp(min, max)
            }
            Distribution::Sieve(curve) => curve.radius(p * curve.all()),
        }
    }

    /// What a truncation leaves of a normal or lognormal distribution; 1 for the others.
    pub(super) fn left(&self) -> f64 {
        match *self {
            Distribution::Normal { mean, sd, min, max } => {
                let [a, b] = [min, max].map(|r| standard(r, mean, sd));
                normal_between(a, b)
            }
            Distribution::Lognormal { median, sigma, min, max } => {
                let [a, b] = [min, max].map(|r| standard_log(r, median, sigma));
                normal_between(a, b)
            }
            _ => 1.0,
        }
    }

    /// The mean radius of all spheres.
    pub fn mean(&self) -> f64 {
        match self {
            Distribution::One(r) => *r,
            Distribution::Uniform { min, max } => 0.5 * (min + max),
            &Distribution::Normal { mean, sd, min, max } => {
                let [a, b] = [min, max].map(|r| standard(r, mean, sd));
                let shift = (normal_density(a) - normal_density(b)) / normal_between(a, b);
                (mean + sd * shift).clamp(min, max)
            }
            &Distribution::Lognormal { median, sigma, min, max } => {
                (median * log_moment(1.0, median, sigma, [min, max])).clamp(min, max)
            }
            Distribution::Sieve(curve) => {
                let pieces = curve.points.windows(2).map(|pair| {
                    let [[a, below], [b, above]] = [pair[0], pair[1]];
                    (above - below) * (curve.last() / a) * (curve.last() / b)
                });
                curve.last() * pieces.sum::<f64>() / curve.all()
            }
        }
    }

    /// The mean of the third power of the radius, m^3.
    pub fn mean_cube(&self) -> f64 {
        match self {
            Distribution::One(r) => r.powi(3),
            Distribution::Uniform { min, max } => 0.25 * (min + max) * (min * min + max * max),
            &Distribution::Normal { mean, sd, min, max } => {
                let [a, b] = [min, max].map(|r| standard(r, mean, sd));
                normal_cubes(mean, sd, a, b) / normal_between(a, b)
            }
            &Distribution::Lognormal { median, sigma, min, max } => {
                median.powi(3) * log_moment(3.0, median, sigma, [min, max])
            }
            Distribution::Sieve(curve) => curve.last().powi(3) / curve.all(),
        }
    }

    /// Radii between which all of the spheres are.
    pub fn support(&self) -> [f64; 2] {
        [0.0, 1.0].map(|p| self.quantile(p))
    }

    /// The radii of `count` spheres in place of the distribution, from the least to the largest.
    ///
    /// Sphere `k` stands for the spheres between the quantiles k/count and (k + 1)/count, and has their mean
    /// volume. So the curve by number is right within 1/count, that by volume at each of these quantiles, and
    /// the volume of all as well.
    pub fn sizes(&self, count: u64) -> impl Iterator<Item = f64> {
        let mut low = self.edge(0, count);
        (0..count).map(move |k| {
            let high = self.edge(k + 1, count);
            let r = self.between(low, high, count);
            low = high;
            r
        })
    }

    /// The least and the largest of `count` sizes.
    pub fn range(&self, count: u64) -> [f64; 2] {
        let of = |k: u64| self.between(self.edge(k, count), self.edge(k + 1, count), count);
        [of(0), of(count.saturating_sub(1))]
    }

    /// The quantile k/count, with the share of the volume below it.
    fn edge(&self, k: u64, count: u64) -> [f64; 2] {
        let r = self.quantile(k as f64 / count.max(1) as f64);
        let volume = match k {
            0 => 0.0,
            k if k == count => 1.0,
            _ => self.volume_below(r),
        };
        [r, volume]
    }

    /// The radius with the mean volume of the spheres between two edges.
    fn between(&self, low: [f64; 2], high: [f64; 2], count: u64) -> f64 {
        match self {
            Distribution::One(r) => *r,
            // Rounding must not lead out of the interval. Sizes beyond all arithmetic have none.
            _ if low[0] <= high[0] => {
                (self.mean_cube() * count as f64 * (high[1] - low[1])).cbrt().clamp(low[0], high[0])
            }
            _ => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of each kind.
    fn all() -> Vec<Distribution> {
        vec![
            Distribution::Uniform { min: 0.02, max: 0.1 },
            Distribution::Normal { mean: 0.05, sd: 0.02, min: 0.01, max: 0.08 },
            // Far above the mean, and on both sides far beyond the standard deviation.
            Distribution::Normal { mean: 0.01, sd: 0.01, min: 0.05, max: 0.09 },
            Distribution::Normal { mean: 0.05, sd: 0.001, min: 0.01, max: 0.09 },
            Distribution::Lognormal { median: 0.03, sigma: 0.5, min: 0.005, max: 0.15 },
            Distribution::Lognormal { median: 0.03, sigma: 0.3, min: 0.04, max: 0.06 },
            Distribution::Sieve(Curve::new(&[
                [0.01, 0.0],
                [0.02, 0.3],
                [0.03, 0.3],
                [0.05, 0.9],
                [0.06, 1.0],
            ])),
        ]
    }

    /// The integral of `f` over the spheres, by the midpoint rule on quantiles.
    fn integral(distribution: &Distribution, f: impl Fn(f64) -> f64) -> f64 {
        const PARTS: u64 = 200_000;
        (0..PARTS).map(|k| f(distribution.quantile((k as f64 + 0.5) / PARTS as f64))).sum::<f64>()
            / PARTS as f64
    }

    #[test]
    fn quantiles_invert_the_shares_by_number() {
        for distribution in all() {
            for p in [1e-6, 0.001, 0.1, 0.25, 0.5, 0.9, 0.999] {
                let found = distribution.number_below(distribution.quantile(p));
                // erfc_inv of statrs has 11 digits or so.
                assert!((found - p).abs() < 1e-10, "{distribution:?}: {p} {found}");
            }
        }
    }

    #[test]
    fn means_and_volumes_are_those_of_the_spheres() {
        for distribution in all() {
            let cube = |r: f64| r.powi(3);
            let (mean, cubes) = (integral(&distribution, |r| r), integral(&distribution, cube));
            assert!((distribution.mean() / mean - 1.0).abs() < 1e-5, "{distribution:?}: {mean}");
            // The midpoint rule is coarse in the tail of the lognormal distribution.
            assert!((distribution.mean_cube() / cubes - 1.0).abs() < 1e-3, "{distribution:?}: {cubes}");
            for p in [0.2, 0.5, 0.8] {
                let r = distribution.quantile(p);
                let below = integral(&distribution, |x| if x < r { cube(x) } else { 0.0 }) / cubes;
                let found = distribution.volume_below(r);
                assert!((found - below).abs() < 1e-3, "{distribution:?}: {p} {found} {below}");
            }
        }
    }

    /// The largest distance of the curves by number and by volume of some radii, which rise, from those of
    /// the distribution.
    fn distances(distribution: &Distribution, radii: &[f64]) -> [f64; 2] {
        let (count, volume) = (radii.len() as f64, radii.iter().map(|r| r.powi(3)).sum::<f64>());
        let (mut number, mut cubes, mut found) = (0.0, 0.0, [0.0f64; 2]);
        for r in radii {
            let asked = [distribution.number_below(*r), distribution.volume_below(*r)];
            // Both sides of the step at this radius.
            for step in [0.0, 1.0] {
                number += step;
                cubes += step * r.powi(3);
                found[0] = found[0].max((number / count - asked[0]).abs());
                found[1] = found[1].max((cubes / volume - asked[1]).abs());
            }
        }
        found
    }

    #[test]
    fn the_sizes_of_spheres_follow_the_curves_by_number_and_by_volume() {
        for distribution in all() {
            let radii: Vec<f64> = distribution.sizes(100_000).collect();
            assert!(radii.is_sorted(), "{distribution:?}");
            let [number, volume] = distances(&distribution, &radii);
            // Within 1/count by number, and within the share of the largest sphere by volume.
            assert!(number <= 1.0001e-5, "{distribution:?}: {number}");
            assert!(volume < 0.01, "{distribution:?}: {volume}");
            let cubes: f64 = radii.iter().map(|r| r.powi(3)).sum();
            assert!((cubes / (1e5 * distribution.mean_cube()) - 1.0).abs() < 1e-9, "{distribution:?}");
        }
    }

    #[test]
    fn few_spheres_have_the_volume_and_the_range_of_all() {
        for distribution in all() {
            for count in [1, 2, 7, 200] {
                let radii: Vec<f64> = distribution.sizes(count).collect();
                let cubes: f64 = radii.iter().map(|r| r.powi(3)).sum();
                let expected = count as f64 * distribution.mean_cube();
                assert!((cubes / expected - 1.0).abs() < 1e-9, "{distribution:?}: {count}");
                assert_eq!(distribution.range(count), [radii[0], radii[radii.len() - 1]]);
                let [low, high] = distribution.support();
                assert!(low <= radii[0] && radii[radii.len() - 1] <= high, "{distribution:?}");
            }
        }
        assert_eq!(Distribution::One(0.3).sizes(3).collect::<Vec<_>>(), [0.3; 3]);
    }

    #[test]
    fn a_gap_in_a_sieve_curve_has_no_spheres() {
        let curve = Distribution::Sieve(Curve::new(&[[1.0, 0.0], [2.0, 0.5], [4.0, 0.5], [8.0, 1.0]]));
        // But for one that may stand for spheres on both sides of it.
        assert!(curve.sizes(1000).filter(|r| (2.01..3.99).contains(r)).count() <= 1);
        assert_eq!(curve.volume_below(3.0), 0.5);
        // Numbers go with 1/r^3: 0.5 (1 + 2)/(2 2^2) against 0.5 (4 + 8)/(2 32^2).
        let fine = 0.1875 / (0.1875 + 0.5 * 12.0 / 2048.0);
        assert!((curve.number_below(3.0) - fine).abs() < 1e-14);
    }
}
