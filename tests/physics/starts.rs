//! Starts of beds: what begins without an overlap settles, and no sphere is thrown.

use crate::common::{Run, run};
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::{self, InitialCondition, overlaps::overlaps};
use rand::{RngExt, SeedableRng};

const TEXT: &str = "
gravity = [0.0, 0.0, -9.81]
output.interval = 0.02
particles = { radius = 0.1, mass = 1.0 }
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.1 }
friction = { law = 'history', coefficient = 0.345 }
";

/// Acceleration of gravity, m/s^2.
const G: f64 = 9.81;

fn scene(sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::parse("start.toml", TEXT, &sets).unwrap()
}

/// Heights of centres, m.
fn heights<X: std::ops::Index<usize, Output = f64>>(x: &[X]) -> impl Iterator<Item = f64> {
    x.iter().map(|x| x[2])
}

/// The height of the highest centre, m.
fn top<X: std::ops::Index<usize, Output = f64>>(x: &[X]) -> f64 {
    heights(x).fold(0.0, f64::max)
}

/// Checks that at no frame a sphere is faster than one that falls freely from the top of the start, or higher
/// than the top by more than `rise` (m).
fn nobody_is_thrown(run: &Run, start: &InitialCondition, rise: f64) {
    let highest = top(&start.x);
    let fastest = (2.0 * G * highest).sqrt();
    for frame in &run.frames {
        let speeds = frame.v.iter().map(|v| v.iter().map(|v| v * v).sum::<f64>().sqrt());
        let speed = speeds.fold(0.0, f64::max);
        assert!(speed < fastest, "{speed} m/s of {fastest} m/s at {} s", frame.time);
        assert!(top(&frame.x) < highest + rise, "{} m at {} s", top(&frame.x), frame.time);
    }
}

#[test]
fn a_dense_random_start_settles_and_throws_no_sphere() {
    let scene = scene(&[
        "t_end=0.4",
        "particles.random={ count = 300, fraction = 0.5, seed = 1 }",
        "container.box={ max = [1, 1, inf] }",
    ]);
    let start = initial_condition::ready(&scene, initial_condition::made(&scene).unwrap()).unwrap();
    assert_eq!(overlaps(&scene, &start), None);
    let run = run(&scene, &start).unwrap();
    // Spheres that nearly touch push each other a little: by less than a radius.
    nobody_is_thrown(&run, &start, 0.1);
    // There are as many heights before and after.
    assert!(heights(&run.end().x).sum::<f64>() < heights(&start.x).sum::<f64>(), "the bed has come down");
}

#[test]
fn deep_overlaps_are_pushed_apart_and_throw_no_sphere() {
    // 200 spheres anywhere in a box that they fill to 0.52: some are nearly in one place.
    let sets = [
        "t_end=0.4",
        "particles.file=start.csv",
        "particles.push_apart=true",
        "container.box={ max = [1, 1, 1.6] }",
    ];
    let scene = scene(&sets);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
    let mut place = |side: f64| 0.1 + (side - 0.2) * random.random::<f64>();
    let x: Vec<[f64; 3]> = (0..200).map(|_| [place(1.0), place(1.0), place(1.6)]).collect();
    let still = vec![[0.0; 3]; x.len()];
    let start = InitialCondition { x, v: still.clone(), omega: still, ..InitialCondition::default() };
    let before = overlaps(&scene, &start).unwrap();
    assert!(before.deepest > 0.17, "{before:?}");
    let start = initial_condition::ready(&scene, start).unwrap();
    let pushed = start.pushed.unwrap();
    assert!((pushed.deepest - before.deepest).abs() < 1e-12, "{pushed:?}");
    assert!(overlaps(&scene, &start).is_none_or(|after| after.deepest <= 1e-4));
    nobody_is_thrown(&run(&scene, &start).unwrap(), &start, 0.1);
}
