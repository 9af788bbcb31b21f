//! Functions of a distance: radial distribution, and porosity over height and over distance to the walls.

use super::union::{Region, Spheres, for_each_pair};
use crate::math::digits::short;
use crate::math::vector::Vec3;
use crate::scene::Scene;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Bins of the radial distribution in each radius.
const BINS_PER_RADIUS: f64 = 20.0;
/// Sections of the profiles in each radius.
const SECTIONS_PER_RADIUS: f64 = 10.0;
/// Largest number of sections of a profile.
const MOST_SECTIONS: f64 = 500.0;

/// Radial distribution function of the centres in a box: the middles of its bins (m) and its values.
///
/// A value of 1 means that pairs at this distance are as frequent as for independent centres.
///
/// The weight of a pair is the inverse of the volume of the box that has room for it. This translation
/// correction of Ohser and Stoyan removes the effect of the bounds of the box.
///
/// Empty if there are fewer than two centres, or if half of the shortest side is narrower than a bin.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::structure::radial_distribution;
/// use demhybrid::math::vector::Vec3;
///
/// // A cubic lattice has no neighbours below its spacing, and six there.
/// let at = |k: usize| 0.1 + 0.2 * k as f64;
/// let centres: Vec<Vec3> =
///     (0..125).map(|k| Vec3::new(at(k % 5), at(k / 5 % 5), at(k / 25))).collect();
/// let g = radial_distribution(&centres, 0.1, (Vec3::zeros(), Vec3::repeat(1.0)));
/// assert!(g.iter().all(|[distance, value]| *distance > 0.19 || *value == 0.0));
/// assert!(g.iter().any(|[distance, value]| (*distance - 0.2).abs() < 0.01 && *value > 1.0));
/// ```
pub fn radial_distribution(x: &[Vec3], r: f64, (low, high): (Vec3, Vec3)) -> Vec<[f64; 2]> {
    let inside: Vec<Vec3> =
        x.iter().filter(|x| (0..3).all(|k| (low[k]..=high[k]).contains(&x[k]))).copied().collect();
    let sides = high - low;
    let width = r / BINS_PER_RADIUS;
    // The correction is valid up to half the shortest side. Nothing happens beyond five diameters. With very
    // many spheres, there are too many pairs up to that distance.
    let most = if inside.len() > 100_000 { 6.0 * r } else { 10.0 * r };
    let cutoff = (0.5 * sides.min()).min(most);
    let bins = (cutoff / width).floor().max(0.0) as usize;
    if inside.len() < 2 || bins == 0 {
        return Vec::new();
    }
    let mut sums = vec![0.0; bins];
    for_each_pair(&inside, cutoff, |[i, j]| {
        let apart = inside[i] - inside[j];
        let bin = (apart.norm() / width) as usize;
        if bin < bins {
            let room: f64 = (0..3).map(|k| sides[k] - apart[k].abs()).product();
            sums[bin] += 2.0 / room;
        }
    });
    // The density of pairs of independent centres.
    let volume: f64 = sides.iter().product();
    let n = inside.len() as f64;
    let density2 = n * (n - 1.0) / (volume * volume);
    let shell = |k: usize| 4.0 / 3.0 * PI * width.powi(3) * (((k + 1) as f64).powi(3) - (k as f64).powi(3));
    sums.iter().enumerate().map(|(k, sum)| [(k as f64 + 0.5) * width, sum / (density2 * shell(k))]).collect()
}

/// The part of the bounds of `region` in which centres can lie, as its lower and upper corner, m.
///
/// It keeps a distance of one radius from the closed sides of the container's box.
pub fn room_of_centres(scene: &Scene, region: &Region) -> (Vec3, Vec3) {
    let (mut low, mut high) = region.bounds();
    if let Some(sides) = &scene.container.r#box {
        let r = scene.particles.radius;
        for k in 0..3 {
            low[k] = low[k].max(sides.min[k] + r);
            high[k] = high[k].min(sides.max[k] - r);
        }
    }
    (low, high)
}

/// Positions at equal distances between `from` and `to`, in the middle of their steps.
fn positions(from: f64, to: f64, r: f64) -> Vec<f64> {
    let count = ((to - from) / r * SECTIONS_PER_RADIUS).ceil().clamp(1.0, MOST_SECTIONS);
    (0..count as usize).map(|k| from + (to - from) * (k as f64 + 0.5) / count).collect()
}

/// Porosity of each section of `region` across `axis`: the share that no sphere covers.
fn porosities(spheres: &Spheres, region: &Region, axis: usize, positions: &[f64]) -> Vec<f64> {
    positions
        .par_iter()
        .map(|&at| 1.0 - spheres.section(region, axis, at) / region.section(axis, at))
        .collect()
}

/// Porosity over height in `region`: heights (m), and the exact porosity of the horizontal section at each.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::structure::over_height;
/// use demhybrid::beds::measures::union::{Region, Spheres};
/// use demhybrid::math::vector::Vec3;
///
/// let centre = [Vec3::repeat(0.5)];
/// let cube = Region::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) };
/// let profile = over_height(&Spheres::new(&centre, 0.5), &cube, 0.5);
/// let least = profile.iter().map(|[_, porosity]| *porosity).fold(1.0, f64::min);
/// assert!((least - (1.0 - std::f64::consts::PI / 4.0)).abs() < 1e-2); // half-way up
/// ```
pub fn over_height(spheres: &Spheres, region: &Region, r: f64) -> Vec<[f64; 2]> {
    let (low, high) = region.bounds();
    let heights = positions(low.z, high.z, r);
    let found = porosities(spheres, region, 2, &heights);
    heights.into_iter().zip(found).map(|(height, porosity)| [height, porosity]).collect()
}

/// Porosity over the distance to upright walls: the distances (m), and a profile for each wall with its name.
///
/// The walls are those sides of the container's box that bound the region. Both lists are empty if the region
/// is not a box or the container has none.
pub fn over_wall_distance(
    scene: &Scene,
    spheres: &Spheres,
    region: &Region,
) -> (Vec<f64>, Vec<(String, Vec<f64>)>) {
    let r = scene.particles.radius;
    let (low, high) = region.bounds();
    let Some(sides) = scene.container.r#box.as_ref().filter(|_| matches!(region, Region::Box { .. })) else {
        return (Vec::new(), Vec::new());
    };
    let half = 0.5 * (high - low).xy().min();
    let distances = positions(0.0, half, r);
    let mut walls = Vec::new();
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        if sides.min[axis] == low[axis] {
            let at: Vec<f64> = distances.iter().map(|d| low[axis] + d).collect();
            walls.push((format!("{name} = {} m", short(low[axis])), porosities(spheres, region, axis, &at)));
        }
        if sides.max[axis] == high[axis] {
            let at: Vec<f64> = distances.iter().map(|d| high[axis] - d).collect();
            walls.push((format!("{name} = {} m", short(high[axis])), porosities(spheres, region, axis, &at)));
        }
    }
    (distances, walls)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    const R: f64 = 0.05;

    fn cubic() -> Vec<Vec3> {
        let along = |k: usize, step: usize| (k / step % 10) as f64 * 0.1 + 0.05;
        (0..1000).map(|k| Vec3::new(along(k, 1), along(k, 10), along(k, 100))).collect()
    }

    #[test]
    fn independent_centres_have_a_flat_radial_distribution() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let x: Vec<Vec3> = (0..20_000)
            .map(|_| {
                let [a, b, c]: [f64; 3] = std::array::from_fn(|_| random.random());
                Vec3::new(a, 2.0 * b, 0.5 * c)
            })
            .collect();
        let found = radial_distribution(&x, 0.1, (Vec3::zeros(), Vec3::new(1.0, 2.0, 0.5)));
        assert_eq!(found.len(), 50);
        // 20 000 centres give at least 10 000 pairs in every bin beyond 0.1 m. Without the correction, the
        // last value would be 0.5.
        for [at, g] in found.into_iter().filter(|[at, _]| *at > 0.1) {
            assert!((g - 1.0).abs() < 0.05, "{at}: {g}");
        }
    }

    #[test]
    fn the_first_peak_of_lattices_is_at_a_diameter_and_nothing_is_before() {
        let face: Vec<Vec3> = (0..14 * 14 * 14)
            .map(|k| [k % 14, k / 14 % 14, k / 196])
            .filter(|c| c.iter().sum::<usize>() % 2 == 0)
            .map(|c| Vec3::from(c.map(|c| (c as f64 + 0.5) * 1.0001 * 2.0 * R / 2f64.sqrt())))
            .collect();
        let side = 14.0 * 1.0001 * 2.0 * R / 2f64.sqrt();
        let slightly_apart: Vec<Vec3> = cubic().iter().map(|x| x * 1.0001).collect();
        for (x, side, neighbours, second) in
            [(slightly_apart, 1.0001, 6.0, 2f64.sqrt()), (face, side, 12.0, 2f64.sqrt())]
        {
            let g = radial_distribution(&x, R, (Vec3::zeros(), Vec3::repeat(side)));
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

    #[test]
    fn profiles_of_a_cubic_lattice_are_those_of_its_circles() {
        let text = "t_end = 8
             particles = { radius = 0.05, mass = 1, file = 'start.csv' }
             container.box = { min = [0, 0, 0], max = [1, 1, inf] }
             [contact]
             repulsion_at_contact = 10
             stiffness_exponent = 150
             restitution = 0.4
             dissipation_focusing = 10
             interaction_distance = 0.1";
        let scene = Scene::parse("bed.toml", text, &[]).unwrap();
        let x = cubic();
        let spheres = Spheres::new(&x, R);
        let region = Region::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) };
        let exact = |at: f64| {
            let from_centre = at % 0.1 - R;
            1.0 - PI * (R * R - from_centre * from_centre) / 0.01
        };
        let heights = over_height(&spheres, &region, R);
        assert_eq!(heights.len(), 200);
        for [at, porosity] in heights {
            assert!((porosity - exact(at)).abs() < 1e-10, "{at}: {porosity}");
        }
        let (distances, walls) = over_wall_distance(&scene, &spheres, &region);
        assert_eq!(walls.len(), 4);
        assert_eq!(distances.len(), 100);
        for (name, porosities) in &walls {
            for (at, porosity) in distances.iter().zip(porosities) {
                assert!((porosity - exact(*at)).abs() < 1e-10, "{name}, {at}: {porosity}");
            }
        }
        assert_eq!(room_of_centres(&scene, &region), (Vec3::repeat(R), Vec3::new(0.95, 0.95, 1.0)));
        // The walls of the box do not bound a cylinder.
        let pillar = Region::Cylinder { axis: [0.5, 0.5], radius: 0.4, ends: [0.0, 1.0] };
        assert!(over_wall_distance(&scene, &spheres, &pillar).1.is_empty());
    }
}
