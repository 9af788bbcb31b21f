//! Porosity over height and over the distance to upright walls.

use super::region::{Region, Side};
use super::union::Spheres;
use crate::math::polyhedron::Half;
use crate::scene::Scene;
use crate::scene::walls::wall_names;

/// Sections of the profiles in each radius.
const SECTIONS_PER_RADIUS: f64 = 10.0;
/// Largest number of sections of a profile.
const MOST_SECTIONS: f64 = 500.0;
/// Largest number of upright walls that have a profile each.
const MOST_WALLS: usize = 6;

/// Positions at equal distances between `from` and `to`, in the middle of their steps.
fn positions(from: f64, to: f64, r: f64) -> Vec<f64> {
    let count = ((to - from) / r * SECTIONS_PER_RADIUS).ceil().clamp(1.0, MOST_SECTIONS);
    (0..count as usize).map(|k| from + (to - from) * (k as f64 + 0.5) / count).collect()
}

/// Porosity over height in `region`: heights (m), and the exact porosity of the level section at each.
///
/// Heights are those above the ground, against gravity. Empty for a cylinder that is oblique to gravity,
/// whose sections are ellipses.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::profiles::over_height;
/// use demhybrid::beds::measures::region::Region;
/// use demhybrid::beds::measures::union::Spheres;
/// use demhybrid::math::vector::Vec3;
///
/// let centre = [Vec3::repeat(0.5)];
/// let cube = Region::cuboid(Vec3::zeros(), Vec3::repeat(1.0));
/// let profile = over_height(&Spheres::new(&centre, 0.5), &cube, 0.5);
/// let least = profile.iter().map(|[_, porosity]| *porosity).fold(1.0, f64::min);
/// assert!((least - (1.0 - std::f64::consts::PI / 4.0)).abs() < 1e-2); // half-way up
/// ```
pub fn over_height(spheres: &Spheres, region: &Region, r: f64) -> Vec<[f64; 2]> {
    let up = region.upright.up;
    let tilt = up.z.abs().min(up.xy().norm());
    if region.pillar().is_some() && tilt > 1e-9 {
        return Vec::new();
    }
    let heights = positions(-region.reach(&-up), region.reach(&up), r);
    let halves = region.halves();
    let solid = spheres.sections(&up, &heights, |_| halves.clone(), region.pillar());
    let row = |(height, solid): (f64, f64)| {
        [height - region.upright.ground, 1.0 - solid / region.section(&up, height)]
    };
    heights.into_iter().zip(solid).map(row).collect()
}

/// Porosity over the distance to upright walls: the distances (m), and profiles with their names.
///
/// The walls are those that bound the region. Each has a profile of its own, of sections along the wall.
/// Where they are more than six, there is one profile for all, which counts each point with its nearest wall.
///
/// Both lists are empty if the region is a cylinder, or no upright wall bounds it.
pub fn over_wall_distance(
    scene: &Scene,
    spheres: &Spheres,
    region: &Region,
) -> (Vec<f64>, Vec<(String, Vec<f64>)>) {
    let up = region.upright.up;
    let upright: Vec<(Half, usize)> = (region.sides().iter())
        .filter_map(|&(half, side)| match side {
            Side::Wall(k) if half.n.dot(&up).abs() < 1e-9 => Some((half, k)),
            _ => None,
        })
        .collect();
    if region.pillar().is_some() || upright.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let half_width = 0.5 * region.least_width();
    let distances = positions(0.0, half_width, scene.particles.radius);
    let halves = region.halves();
    // Areas of pores and of all at each distance from a wall, inside the planes that `within` gives.
    let areas = |wall: &Half, within: &(dyn Fn(usize) -> Vec<Half> + Sync)| {
        let at: Vec<f64> = distances.iter().map(|d| wall.b - d).collect();
        let solid = spheres.sections(&wall.n, &at, within, None);
        let all = at.iter().enumerate().map(|(k, at)| region.section_within(&within(k), &wall.n, *at));
        solid.into_iter().zip(all).collect::<Vec<(f64, f64)>>()
    };
    let porosity = |(solid, all): &(f64, f64)| 1.0 - solid / all;
    if upright.len() <= MOST_WALLS {
        let names = wall_names(&scene.container);
        let profile = |(wall, k): &(Half, usize)| {
            let porosities = areas(wall, &|_| halves.clone()).iter().map(porosity).collect();
            (names[*k].clone(), porosities)
        };
        let profiles = upright.iter().map(profile).collect();
        return (distances, profiles);
    }
    let mut sums = vec![(0.0, 0.0); distances.len()];
    for (wall, _) in &upright {
        // Points that are nearer to another upright wall are outside that wall, moved inwards.
        let within = |k: usize| {
            let moved = |half: &Half| {
                let is_other = half != wall && upright.iter().any(|(other, _)| other == half);
                if is_other { Half { b: half.b - distances[k], ..*half } } else { *half }
            };
            halves.iter().map(moved).collect()
        };
        for (sum, (solid, all)) in sums.iter_mut().zip(areas(wall, &within)) {
            *sum = (sum.0 + solid, sum.1 + all);
        }
    }
    let name = format!("nearest of {} upright walls", upright.len());
    let porosities = sums.iter().map(porosity).collect();
    (distances, vec![(name, porosities)])
}

#[cfg(test)]
#[path = "profiles_tests.rs"]
mod tests;
