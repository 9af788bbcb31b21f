//! The measures of each class of spheres, and of pairs of classes.

use serde::Serialize;

use super::classes::Classes;
use super::contacts::{Contacts, Partner};
use super::layers::{Layer, layers};
use super::radial::{cross_distribution, radial_distribution};
use super::rattlers::{fewest_that_hold, rattlers};
use super::region::Region;
use super::row::centres;
use super::size_distribution::SizeDistribution;
use crate::files::run_file::State;
use crate::math::vector::Vec3;
use crate::model::size::Size;
use crate::scene::Scene;

/// The measures of one class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfClass {
    /// Name of the class.
    pub class: String,
    /// Number of its spheres.
    pub spheres: usize,
    /// Share of all spheres.
    pub number_share: f64,
    /// Mass of its spheres, kg.
    pub mass: f64,
    /// Share of the mass of all spheres.
    pub mass_share: f64,
    /// Mean radius, m.
    pub mean_radius: f64,
    /// Smallest radius, m.
    pub least_radius: f64,
    /// Largest radius, m.
    pub largest_radius: f64,
    /// Share of the region that the class covers. A point inside several spheres counts for one of them, so
    /// that these shares add up to the volume fraction.
    pub volume_fraction: f64,
    /// Mean number of spheres of any class that a sphere of this one is in contact with.
    pub mean_coordination: f64,
    /// Number of contacts with walls.
    pub wall_contacts: usize,
    /// Number of spheres that their contacts cannot hold.
    pub rattlers: usize,
}

/// The contacts of spheres of one class with those of another one, or among themselves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfPair {
    /// Name of the class.
    pub class: String,
    /// Name of the class of the partners.
    pub other_class: String,
    /// Number of contacts between both.
    pub contacts: usize,
    /// Mean number of spheres of the other class that a sphere of the class is in contact with.
    pub mean_coordination: f64,
    /// Mean normal force of these contacts, N; 0 without any.
    pub mean_force: f64,
}

/// How frequent spheres of one class are around those of another one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Around {
    /// Name of the class.
    pub class: String,
    /// Name of the other class.
    pub other_class: String,
    /// The mean diameter: the sum of the mean radii of both classes, m.
    pub mean_diameter: f64,
    /// Distances (m), with the radial distribution function of these pairs.
    pub distribution: Vec<[f64; 2]>,
}

/// All measures by class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByClass {
    /// One for each class.
    pub classes: Vec<OfClass>,
    /// One for each class with each class, itself included.
    pub contacts: Vec<OfPair>,
    /// One for each pair of classes and each class with itself.
    pub radial: Vec<Around>,
    /// Sizes over height.
    pub layers: Vec<Layer>,
    /// The distribution of sizes of all spheres.
    pub sizes: SizeDistribution,
}

impl ByClass {
    /// The measures of the `classes` of a state of `scene` with these `contacts`. `parts` has the part of
    /// each sphere in the volume of the union inside `region`, m^3.
    pub fn of(
        scene: &Scene,
        state: &State,
        region: &Region,
        classes: &Classes,
        contacts: &Contacts,
        parts: &[[f64; 2]],
    ) -> Self {
        let sizes = state.sizes(scene);
        let each: Vec<Size> = (0..state.x.len()).map(|i| sizes.of(i)).collect();
        let x = centres(state);
        let (rows, pairs) = rows(scene, region, classes, contacts, (&each, parts));
        ByClass {
            radial: radial(region, classes, &x, &rows),
            classes: rows,
            contacts: pairs,
            layers: layers(&region.upright, &x, sizes, classes),
            sizes: SizeDistribution::of(&each),
        }
    }
}

/// The measures of each class, and of each class with each one.
fn rows(
    scene: &Scene,
    region: &Region,
    classes: &Classes,
    contacts: &Contacts,
    (each, parts): (&[Size], &[[f64; 2]]),
) -> (Vec<OfClass>, Vec<OfPair>) {
    let count = classes.count();
    // Contacts and forces (N) of each class with each one. One within a class counts for both partners.
    let mut found = vec![(0usize, 0.0); count * count];
    let mut at_walls = vec![0; count];
    for contact in &contacts.pushing {
        let a = classes.of[contact.i];
        let Partner::Sphere(j) = contact.partner else {
            at_walls[a] += 1;
            continue;
        };
        let b = classes.of[j];
        for pair in [a * count + b, b * count + a] {
            found[pair] = (found[pair].0 + 1, found[pair].1 + contact.force);
        }
    }
    let loose = rattlers(each.len(), &contacts.pushing, fewest_that_hold(scene));
    let loose = classes.sums(|i| f64::from(u8::from(loose[i])));
    let volume = region.volume();
    let (volumes, masses) = (classes.sums(|i| parts[i][0]), classes.sums(|i| each[i].mass));
    let radii = classes.split(&each.iter().map(|size| size.r).collect::<Vec<f64>>());
    let all_mass: f64 = masses.iter().sum();
    let row = |k: usize| {
        let spheres = radii[k].len();
        let met: usize = (0..count).map(|l| found[k * count + l].0).sum();
        OfClass {
            class: classes.names[k].clone(),
            spheres,
            number_share: spheres as f64 / each.len() as f64,
            mass: masses[k],
            mass_share: masses[k] / all_mass,
            mean_radius: radii[k].iter().sum::<f64>() / spheres as f64,
            least_radius: radii[k].iter().copied().fold(f64::INFINITY, f64::min),
            largest_radius: radii[k].iter().copied().fold(0.0, f64::max),
            volume_fraction: volumes[k] / volume,
            mean_coordination: met as f64 / spheres as f64,
            wall_contacts: at_walls[k],
            rattlers: loose[k] as usize,
        }
    };
    let pair = |place: usize| {
        let (k, l) = (place / count, place % count);
        let (met, force) = found[place];
        OfPair {
            class: classes.names[k].clone(),
            other_class: classes.names[l].clone(),
            contacts: if k == l { met / 2 } else { met },
            mean_coordination: met as f64 / radii[k].len() as f64,
            mean_force: if met == 0 { 0.0 } else { force / met as f64 },
        }
    };
    ((0..count).map(row).collect(), (0..count * count).map(pair).collect())
}

/// The radial distribution functions of all pairs of classes.
///
/// Centres count that are as far from all walls as the largest sphere of both classes.
fn radial(region: &Region, classes: &Classes, x: &[Vec3], rows: &[OfClass]) -> Vec<Around> {
    let [u, v] = region.upright.across;
    let axes = [u, v, region.upright.up];
    let x = classes.split(x);
    let pairs = (0..rows.len()).flat_map(|k| (k..rows.len()).map(move |l| (k, l)));
    let around = |(k, l): (usize, usize)| {
        let (a, b) = (&rows[k], &rows[l]);
        let room = region.room_of_centres(a.largest_radius.max(b.largest_radius));
        let r = 0.5 * (a.mean_radius + b.mean_radius);
        let distribution = match k == l {
            true => radial_distribution(&x[k], r, &room, &axes),
            false => cross_distribution(&x[k], &x[l], r, &room, &axes),
        };
        Around { class: a.class.clone(), other_class: b.class.clone(), mean_diameter: 2.0 * r, distribution }
    };
    pairs.map(around).collect()
}

#[cfg(test)]
#[path = "by_class_tests.rs"]
mod tests;
