//! The sizes of a start that species give: how many spheres of each, how large they are, and which id has
//! which.

use rand::SeedableRng;
use rand::rand_core::Rng;
use rand_chacha::ChaCha8Rng;

use super::InitialCondition;
use super::sizes::{column, mass_of, mean};
use crate::model::columns::{Column, MASS, MATERIAL, RADIUS, SPECIES};
use crate::scene::Scene;
use crate::scene::species::Mixture;

/// The stream of the generator that gives sizes to ids. Stream 0 gives places.
const STREAM: u64 = 1;

/// The columns of `count` spheres of the species of a scene: species, radius and mass, as a particle file
/// gives them. `seed` is that of the source of places.
///
/// There are no radii and masses where all are alike, and no species where there is one and all are alike.
pub(super) fn columns(scene: &Scene, count: u64, seed: u64) -> Vec<(Column, Vec<f64>)> {
    let Some(mixture) = Mixture::of(scene) else { return Vec::new() };
    let alike = mixture.is_alike();
    if alike && mixture.parts.len() == 1 && scene.material.is_empty() {
        return Vec::new();
    }
    let mut spheres: Vec<(u32, f64)> = Vec::with_capacity(count as usize);
    for (k, (part, n)) in mixture.parts.iter().zip(mixture.counts(count)).enumerate() {
        spheres.extend(part.distribution.sizes(n).map(|r| (k as u32, r)));
    }
    shuffle(&mut spheres, scene.particles.species_seed.unwrap_or(seed));
    let names = mixture.parts.iter().map(|part| part.name.clone()).collect();
    let species: Vec<f64> = spheres.iter().map(|&(k, _)| f64::from(k)).collect();
    let materials =
        scene.species.iter().map(|species| species.material.clone().unwrap_or_default()).collect();
    let made_of = (Column { names: materials, ..column(MATERIAL, "1") }, species.clone());
    let mut columns = vec![(Column { names, ..column(SPECIES, "1") }, species)];
    if scene.species.iter().any(|species| species.material.is_some()) {
        columns.push(made_of);
    }
    if !alike {
        let mass = |&(k, r): &(u32, f64)| mass_of(r, mixture.parts[k as usize].density);
        columns.push((column(RADIUS, "m"), spheres.iter().map(|&(_, r)| r).collect()));
        columns.push((column(MASS, "kg"), spheres.iter().map(mass).collect()));
    }
    columns
}

/// Puts the list into an order that the seed gives; all orders are equally likely.
fn shuffle<T>(list: &mut [T], seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(STREAM);
    for last in (1..list.len()).rev() {
        // Spelt out, so that no version of a crate changes it. It favours none by more than 1e-10.
        let one = (u128::from(random.next_u64()) * (last as u128 + 1)) >> 64;
        list.swap(last, one as usize);
    }
}

impl InitialCondition {
    /// Gives the scene the mean `radius` and the mean `mass` of spheres that species have drawn, where the
    /// scene left them out.
    pub(crate) fn settle_drawn(&self, scene: &mut Scene, radius: bool, mass: bool) {
        if scene.species.is_empty() {
            return;
        }
        // From the least to the largest: rounding is the same for all seeds, so that they have one scene.
        let mean_of = |name: &str| {
            let mut numbers = self.column(name)?.to_vec();
            numbers.sort_unstable_by(f64::total_cmp);
            Some(mean(numbers.into_iter()))
        };
        if let Some(found) = radius.then(|| mean_of(RADIUS)).flatten() {
            scene.particles.radius = found;
        }
        if let Some(found) = mass.then(|| mean_of(MASS)).flatten() {
            scene.particles.mass = found;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::initial_condition::grid;

    const TEXT: &str = "t_end = 1
        particles = { density = 1000, grid = { count = 400 } }
        contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                    dissipation_focusing = 10, interaction_distance = 0.1 }
        container.box = {}";

    fn scene(species: &str, sets: &[&str]) -> Scene {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let mut scene = Scene::parse("a.toml", &format!("{TEXT}\nspecies = [{species}]"), &sets).unwrap();
        scene.set_seed_if_missing(1);
        scene
    }

    fn start(scene: &Scene) -> InitialCondition {
        grid(scene, scene.particles.grid.as_ref().unwrap())
    }

    fn sizes(scene: &Scene) -> [Vec<f64>; 3] {
        let start = start(scene);
        [SPECIES, RADIUS, MASS].map(|name| start.column(name).unwrap_or_default().to_vec())
    }

    const MIXED: &str = "{ name = 'fine', share = 0.6, radius = { lognormal = [0.03, 0.3, 0.007, 0.12] } },
                         { name = 'coarse', share = 0.4, density = 2000, radius = { uniform = [0.1, 0.2] } }";

    #[test]
    fn every_source_has_spheres_of_the_same_sizes() {
        let mut of_grid = sizes(&scene(MIXED, &[]));
        for source in ["random={ count = 400, seed = 1 }", "lattice={ count = 400, seed = 1 }"] {
            // One source in place of the other.
            let (name, keys) = source.split_once("=").unwrap();
            let text = TEXT.replace("grid = { count = 400 }", &format!("{name} = {keys}"));
            let scene = Scene::parse("a.toml", &format!("{text}\nspecies = [{MIXED}]"), &[]).unwrap();
            let start = crate::scene::initial_condition::made(&scene).unwrap();
            let found = [SPECIES, RADIUS, MASS].map(|name| start.column(name).unwrap().to_vec());
            let sorted = |list: &mut Vec<f64>| list.sort_by(f64::total_cmp);
            let mut found = found;
            found.iter_mut().chain(&mut of_grid).for_each(sorted);
            assert_eq!(found, of_grid, "{source}");
            // No two overlap, whatever their sizes are.
            let checked = crate::scene::initial_condition::ready(&scene, start).unwrap();
            assert_eq!(
                crate::scene::initial_condition::overlaps::overlaps(&scene, &checked),
                None,
                "{source}"
            );
        }
    }

    #[test]
    fn a_species_may_have_a_material() {
        let mixed = MIXED.replace("density = 2000", "density = 2000, material = 'steel'");
        let materials = "material=[{ name = 'fine', friction = 0.1 }, { name = 'steel', friction = 0.5 }]";
        let friction = "friction={ law = 'history', coefficient = 0.3 }";
        let scene = scene(&mixed, &[materials, friction]);
        let mut start = start(&scene);
        start.settle_materials(&scene).unwrap();
        // The fine ones have the material of their name, the coarse ones that of their key.
        let species: Vec<u32> = start.column(SPECIES).unwrap().iter().map(|&k| k as u32).collect();
        assert_eq!(start.materials(), species);
        assert_eq!(Scene::parse("again.toml", &scene.resolved(), &[]).unwrap(), scene);
    }

    #[test]
    fn columns_are_those_of_a_particle_file() {
        let scene = scene(MIXED, &[]);
        let [species, radii, masses] = sizes(&scene);
        assert_eq!([&species, &radii, &masses].map(Vec::len), [400; 3]);
        assert_eq!(start(&scene).columns[0].0.names, ["fine", "coarse"]);
        assert_eq!(species.iter().filter(|k| **k == 1.0).count(), 160);
        for ((k, r), mass) in species.iter().zip(&radii).zip(&masses) {
            assert!(if *k == 1.0 { (0.1..0.2).contains(r) } else { *r < 0.1 });
            assert_eq!(*mass, mass_of(*r, 1000.0 * (1.0 + k)));
        }
    }

    #[test]
    fn a_seed_gives_the_same_sizes_for_ever_and_another_one_another_order() {
        let [_, radii, _] = sizes(&scene(MIXED, &[]));
        // Other values would make every seed another start. Last digits are those of the system's functions.
        for (r, pinned) in [radii[0], radii[1], radii[399]].into_iter().zip(PINNED) {
            assert!((r / pinned - 1.0).abs() < 1e-9, "{r} {pinned}");
        }
        assert_eq!(sizes(&scene(MIXED, &["particles.grid.seed=1"]))[1], radii);
        let [_, mut others, _] = sizes(&scene(MIXED, &["particles.grid.seed=2"]));
        assert_ne!(others, radii);
        let same_sizes = [&mut others, &mut radii.clone()].map(|list| {
            list.sort_by(f64::total_cmp);
            list.clone()
        });
        assert_eq!(same_sizes[0], same_sizes[1]);
        // A seed of its own goes before that of the grid.
        let own = |seed: u64| {
            sizes(&scene(MIXED, &["particles.species_seed=1", &format!("particles.grid.seed={seed}")]))
        };
        assert_eq!((&own(1)[1], &own(2)[1]), (&radii, &radii));
    }

    const PINNED: [f64; 3] = [0.04331514422190016, 0.18593767506986775, 0.1628126999357754];

    #[test]
    fn neither_places_nor_other_sizes_correlate_with_sizes() {
        let scene = scene(MIXED, &["particles.grid.count=20000", "container.box.max=[12, 12, inf]"]);
        let (start, [_, radii, _]) = (start(&scene), sizes(&scene));
        let mean = mean(radii.iter().copied());
        let spread: Vec<f64> = radii.iter().map(|r| r - mean).collect();
        let variance: f64 = spread.iter().map(|r| r * r).sum();
        let n = radii.len();
        for lag in [1, 2, 30, 900] {
            let together: f64 = (0..n - lag).map(|k| spread[k] * spread[k + lag]).sum();
            // Correlations of independent numbers are 1/sqrt(20 000) = 0.007.
            assert!((together / variance).abs() < 0.03, "{lag}: {}", together / variance);
        }
        for axis in 0..3 {
            let x: Vec<f64> = start.x.iter().map(|x| x[axis]).collect();
            let middle = x.iter().sum::<f64>() / n as f64;
            let width: f64 = x.iter().map(|x| (x - middle).powi(2)).sum();
            let together: f64 = x.iter().zip(&spread).map(|(x, r)| (x - middle) * r).sum();
            assert!((together / (width * variance).sqrt()).abs() < 0.03, "{axis}");
        }
    }

    #[test]
    fn one_species_of_one_radius_is_a_scene_of_equal_spheres() {
        let alike = scene("{ name = 'only', radius = 0.07 }", &[]);
        let plain = format!("{}\nspecies = []", TEXT.replace("density", "radius = 0.07, density"));
        let mut plain = Scene::parse("a.toml", &plain, &[]).unwrap();
        plain.set_seed_if_missing(1);
        assert_eq!(start(&alike), start(&plain));
        let Scene { species, .. } = alike.clone();
        assert_eq!(alike, Scene { species, ..plain });
        // Two species that are alike in all but their names have names alone.
        let two = "{ name = 'a', share = 0.5, radius = 0.07 }, { name = 'b', share = 0.5, radius = 0.07 }";
        let two = start(&scene(two, &[]));
        assert_eq!(two.columns.len(), 1);
        assert_eq!((two.columns[0].0.name.as_str(), &two.x), (SPECIES, &start(&alike).x));
    }

    #[test]
    fn a_typical_sphere_has_the_means_of_all_and_lengths_follow_from_the_largest() {
        let mut scene = scene(MIXED, &[]);
        let (start, [_, radii, masses]) = (start(&scene), sizes(&scene));
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let grid = scene.particles.grid.as_ref().unwrap();
        assert_eq!([grid.spacing, grid.jitter, grid.bottom], [2.5, 0.25, 11.0].map(|k| k * largest));
        assert_eq!(scene.container.r#box.as_ref().unwrap().max[..2], [10.0 * largest; 2]);
        let means = [radii, masses].map(|mut numbers| {
            numbers.sort_by(f64::total_cmp);
            mean(numbers.into_iter())
        });
        // The scene alone has the means of the distributions.
        assert!((scene.particles.radius / means[0] - 1.0).abs() < 1e-3);
        assert!((scene.particles.mass / means[1] - 1.0).abs() < 1e-12);
        start.settle_drawn(&mut scene, true, true);
        assert_eq!([scene.particles.radius, scene.particles.mass], means);
        assert!(scene.particles.density.is_none());
        let again = Scene::parse("again.toml", &scene.resolved(), &[]).unwrap();
        assert_eq!(again, scene);
        assert_eq!(self::start(&again), start);
        // What the scene gives stays.
        start.settle_drawn(&mut scene, false, false);
        let mut given = self::scene(MIXED, &["particles.radius=0.15"]);
        start.settle_drawn(&mut given, false, true);
        assert_eq!([given.particles.radius, given.particles.mass], [0.15, means[1]]);
    }
}
