//! Random starts and lattices: no overlaps, inside all walls, and random.

use super::*;
use crate::math::vector::Vec3;
use crate::model::wall::Wall;
use crate::scene::starts::Random;
use crate::scene::walls::walls;
use proptest::prelude::*;
use room::Room;
use std::f64::consts::PI;

const TEXT: &str = "t_end = 1
    contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                dissipation_focusing = 10, interaction_distance = 0.1 }
    particles = { radius = 0.1, mass = 1 }";

fn scene(sets: &[&str]) -> Result<Scene, Error> {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let mut scene = Scene::parse("a.toml", TEXT, &sets)?;
    scene.set_seed_if_missing(1);
    Ok(scene)
}

/// Centres of the start, and the scene.
fn start(sets: &[&str]) -> (Vec<Vec3>, Scene) {
    let scene = scene(sets).unwrap();
    let start = ready(&scene, made(&scene).unwrap()).unwrap();
    (start.x.iter().map(|&x| x.into()).collect(), scene)
}

/// The largest overlap of spheres with each other or with `walls` over the smaller radius; negative: a gap.
fn overlap(x: &[Vec3], radii: &[f64], walls: &[Wall]) -> f64 {
    let mut largest = f64::NEG_INFINITY;
    for i in 0..x.len() {
        for j in 0..i {
            let touch = radii[i] + radii[j];
            largest = largest.max((touch - (x[i] - x[j]).norm()) / radii[i].min(radii[j]));
        }
        largest = walls.iter().map(|wall| (radii[i] - wall.depth(&x[i])) / radii[i]).fold(largest, f64::max);
    }
    largest
}

/// A box, an oblique wall that cuts a corner off, and a roof on two sides.
const OBLIQUE: [&str; 2] = [
    "container.box={ max = [1, 1.2, 1.4] }",
    "container.wall=[{ point = [0.3, 0.2, 0], normal = [-1, -1, -1] },
                     { point = [0, 0, 1.4], normal = [1, 0, 2] }]",
];

#[test]
fn a_random_start_fills_the_box_as_high_as_the_fraction_asks() {
    for (fraction, asked) in [("", 0.3), (", fraction = 0.5", 0.5), (", fraction = 0.1", 0.1)] {
        let random = format!("particles.random={{ count = 300{fraction} }}");
        let (x, scene) = start(&[&random, "container.box={}"]);
        assert_eq!(x.len(), 300);
        assert!(overlap(&x, &[0.1; 300], &walls(&scene.container)) <= 0.0);
        let top = x.iter().map(|x| x.z).fold(0.0, f64::max) + 0.1;
        let height = 300.0 * 4.0 / 3.0 * PI * 1e-3 / asked;
        // The highest of 300 spheres is near the lid, and not above.
        assert!(top <= height * (1.0 + 1e-9) && top > height - 0.3, "{asked}: {top} of {height}");
    }
}

#[test]
fn a_random_start_lies_inside_oblique_walls_and_its_region() {
    let [sides, wall] = OBLIQUE;
    for random in [
        "{ count = 60 }",
        "{ count = 40, fraction = 0.4 }",
        "{ count = 30, region = { min = [-inf, 0.2, 0.3], max = [0.8, inf, inf] } }",
    ] {
        let (x, scene) = start(&[&format!("particles.random={random}"), sides, wall]);
        assert!(overlap(&x, &[0.1; 60], &walls(&scene.container)) <= 0.0, "{random}");
        if let Some(region) = scene.particles.random.unwrap().region {
            for x in &x {
                for axis in 0..3 {
                    assert!(x[axis] - region.min[axis] >= 0.1 && region.max[axis] - x[axis] >= 0.1, "{x}");
                }
            }
        }
    }
}

#[test]
fn the_seed_decides_and_the_number_of_threads_does_not() {
    let of = |seed: &str| {
        let seed = format!("particles.random.seed={seed}");
        start(&[
            "particles.random={ count = 3000, fraction = 0.45 }",
            &seed,
            "container.box={ max = [2, 2, inf] }",
        ])
        .0
    };
    let in_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of("5"))
    };
    let alone = in_threads(1);
    assert_eq!(in_threads(2), alone);
    assert_ne!(of("6"), alone);
}

#[test]
fn distances_and_heights_in_a_random_start_show_no_order() {
    let n = 6000;
    let r = 0.1;
    // A cube of that volume at 0.3.
    let side = (n as f64 * 4.0 / 3.0 * PI * r * r * r / 0.3).cbrt();
    let sides = format!("container.box={{ max = [{side:?}, {side:?}, {side:?}] }}");
    let (x, _) = start(&[&format!("particles.random={{ count = {n} }}"), &sides]);
    // Only spheres that see no wall.
    let (margin, width) = (8.0 * r, 0.5 * r);
    let deep = |x: &&Vec3| x.min() > margin && x.max() < side - margin;
    let middles: Vec<&Vec3> = x.iter().filter(deep).collect();
    let mut counts = [0u64; 16];
    for a in &middles {
        for b in &x {
            let bin = ((*a - b).norm() / width) as usize;
            if bin < counts.len() {
                counts[bin] += 1;
            }
        }
    }
    let shell = |k: usize| {
        let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
        ball((k + 1) as f64 * width) - ball(k as f64 * width)
    };
    // From 4 radii on.
    let far = || counts.iter().enumerate().skip(8);
    let density =
        far().map(|(_, &count)| count as f64).sum::<f64>() / far().map(|(k, _)| shell(k)).sum::<f64>();
    for (k, &count) in far() {
        let expected = density * shell(k);
        // Most pairs are counted from both ends, so that twice as many counts are needed for an error.
        let error = (2.0 / expected).sqrt();
        let g = count as f64 / expected;
        assert!((g - 1.0).abs() < 4.0 * error, "g = {g} at {} r, error {error}", 0.5 * k as f64);
    }
    // Layers or cells would show in the coordinates. Half a radius is a quarter of a diameter.
    for axis in 0..3 {
        let mut layers = vec![0u64; ((side - 2.0 * margin) / width) as usize];
        for x in &x {
            if let Some(count) = layers.get_mut(((x[axis] - margin).max(-1.0) / width).floor() as usize)
                && x[axis] > margin
            {
                *count += 1;
            }
        }
        let mean = layers.iter().sum::<u64>() as f64 / layers.len() as f64;
        for (k, &count) in layers.iter().enumerate() {
            assert!(
                (count as f64 - mean).abs() < 4.5 * mean.sqrt(),
                "layer {k} across {axis}: {count} of {mean}"
            );
        }
    }
}

#[test]
fn a_room_that_is_too_small_is_told_with_what_would_do() {
    let told = |sets: &[&str]| match scene(sets) {
        Err(why) => why.to_string(),
        Ok(scene) => made(&scene).unwrap_err().to_string(),
    };
    let full = told(&["particles.random={ count = 300 }", "container.box={ max = [1, 1, 1] }"]);
    // 300 spheres of 0.004189 m^3 in 1 m^3.
    assert!(
        full.contains("fills its region to 1.26") && full.contains("119 spheres or fewer would do"),
        "{full}"
    );
    let high =
        told(&["particles.random={ count = 100, fraction = 0.1 }", "container.box={ max = [1, 1, 1] }"]);
    assert!(high.contains("needs 4.19 m^3") && high.contains("a fraction of 0.419 or more"), "{high}");
    // Twenty spheres in a cube of 5.5 radii: as many as fit in by no random way.
    let tight = told(&[
        "particles.random={ count = 20, fraction = 0.5 }",
        "container.box={ max = [0.55, 0.55, inf] }",
    ]);
    assert!(
        tight.contains("spheres still overlap by") && tight.contains("particles.random.fraction = 0."),
        "{tight}"
    );
    let advised = tight.split("particles.random.fraction = ").nth(1).unwrap().split(' ').next().unwrap();
    let looser = format!("particles.random={{ count = 20, fraction = {advised} }}");
    start(&[&looser, "container.box={ max = [0.55, 0.55, inf] }"]);
}

#[test]
fn a_lattice_is_hexagonal_close_packed_on_the_floor() {
    let (x, scene) = start(&[
        "particles.lattice={ count = 400 }",
        "container.box={ min = [0, 0, 0.5], max = [1.5, 1.5, inf] }",
    ]);
    assert!(overlap(&x, &[0.1; 400], &walls(&scene.container)) <= 0.0);
    // The first layer lies on the floor, the next in its hollows.
    let spacing = 0.202;
    assert!((x[0].z - 0.5 - 0.5 * spacing).abs() < 1e-12);
    let middle = Vec3::new(0.75, 0.75, 1.0);
    let inner = x.iter().min_by(|a, b| (*a - middle).norm().total_cmp(&(*b - middle).norm())).unwrap();
    let neighbours: Vec<f64> =
        x.iter().map(|x| (x - inner).norm()).filter(|d| *d > 0.0 && *d < 1.2 * spacing).collect();
    assert_eq!(neighbours.len(), 12);
    assert!(neighbours.iter().all(|d| (d - spacing).abs() < 1e-12), "{neighbours:?}");
    // Every second layer is right above, as it is not in the cubic lattice.
    let above = inner + Vec3::new(0.0, 0.0, spacing * (8.0f64 / 3.0).sqrt());
    assert!(x.iter().any(|x| (x - above).norm() < 1e-12));
}

#[test]
fn a_lattice_leaves_out_places_at_oblique_walls_and_shifts_by_its_seed() {
    let [sides, wall] = OBLIQUE;
    let jitter = "particles.lattice={ count = 60, spacing = 0.23, jitter = 0.015 }";
    let (x, within) = start(&[jitter, sides, wall]);
    assert!(overlap(&x, &[0.1; 60], &walls(&within.container)) <= 0.0);
    let (other, _) = start(&[jitter, "particles.lattice.seed=2", sides, wall]);
    let moved = x.iter().zip(&other).map(|(a, b)| (a - b).amax());
    assert!(moved.clone().all(|d| d < 0.015) && moved.fold(0.0, f64::max) > 0.01);
    let few = scene(&["particles.lattice={ count = 5000 }", sides, wall]).unwrap();
    let told = made(&few).unwrap_err().to_string();
    assert!(
        told.starts_with("particles.lattice.count = 5000: the walls leave ") && told.contains("would do"),
        "{told}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn no_spheres_of_any_sizes_overlap_at_any_fraction(
        radii in proptest::collection::vec(1.0f64..5.0, 60..250),
        fraction in 0.02f64..0.38,
        cut in 0.0f64..0.4,
        seed in any::<u64>(),
    ) {
        let volume: f64 = radii.iter().map(|&r| mass_of(r, 1.0)).sum();
        let side = (volume / fraction).cbrt();
        // A cube with one edge cut off, and open above.
        let sides = format!("container.box={{ max = [{side:?}, {side:?}, inf] }}");
        let wall = format!("container.wall=[{{ point = [{:?}, 0, 0], normal = [-1, 0, -1] }}]", cut * side);
        let of = scene(&["particles.radius=1", "particles.random={ count = 60 }", &sides, &wall]).unwrap();
        let random = Random { fraction: Some(fraction), ..of.particles.random.clone().unwrap() };
        let room = Room::of(&of.container, &random, volume, 5.0).unwrap();
        let x = random::centres(&radii, &room, seed).unwrap();
        let x: Vec<Vec3> = x.into_iter().map(Into::into).collect();
        prop_assert!(overlap(&x, &radii, &room.walls) <= 0.0);
        prop_assert!(overlap(&x, &radii, &walls(&of.container)) <= 0.0);
    }
}
