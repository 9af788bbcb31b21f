//! A scene for the tests of ensembles.

use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};

/// The scene in TOML: eight spheres above the bottom of a box.
pub const TEXT: &str = "t_end = 1
    gravity = [0, 0, -9.81]
    particles = { radius = 0.1, mass = 1, grid = { count = 8, bottom = 0.2, seed = 1 } }
    contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                dissipation_focusing = 10, interaction_distance = 0.1 }
    container.box = { max = [0.5, 0.5, inf] }";

/// Eight spheres that fall into a box.
pub fn scene(sets: &[&str]) -> (Scene, InitialCondition) {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let scene = Scene::parse("eight.toml", TEXT, &sets).unwrap();
    let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().unwrap());
    (scene, start)
}
