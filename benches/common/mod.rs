//! Packed beds for benches and what it takes to evaluate them.

#![allow(dead_code)] // every bench uses a part

use demhybrid::domain::{Comm, Solo};
use demhybrid::engine::simulation::Simulation;
use demhybrid::model::columns::Changes;
use demhybrid::ode::Norm;
use demhybrid::scene::initial_condition::InitialCondition;
use demhybrid::scene::{Container, Scene};
use rand::{RngExt, SeedableRng};

/// The paper's scene in one of its variants, without walls.
pub fn scene(variant: &str) -> Scene {
    let text = match variant {
        "basic" => include_str!("../../configs/paper/settle-basic.toml"),
        "friction" => include_str!("../../configs/paper/settle-friction.toml"),
        _ => include_str!("../../configs/paper/settle.toml"),
    };
    Scene {
        container: Container::default(),
        ..Scene::parse(variant, text, &[]).unwrap_or_else(|why| panic!("{why}"))
    }
}

/// The three variants.
pub const VARIANTS: [&str; 3] = ["basic", "friction", "friction+rotation"];

/// `n` spheres of radius 0.1 m packed as densely as a settled bed, 5 across and 10 deep, with small random
/// shifts and velocities.
pub fn bed(n: usize) -> InitialCondition {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut vector =
        |size: f64| -> [f64; 3] { std::array::from_fn(|_| size * (random.random::<f64>() - 0.5)) };
    let mut start = InitialCondition::default();
    for k in 0..n {
        let cell = [k / 50, k % 5, k / 5 % 10];
        let shift = vector(0.02);
        start.x.push(std::array::from_fn(|axis| 0.187 * cell[axis] as f64 + shift[axis]));
        start.v.push(vector(0.1));
        start.omega.push([0.0; 3]);
    }
    start
}

/// A simulation of `start`.
pub fn simulation(scene: &Scene, start: &InitialCondition) -> Simulation<'static> {
    simulation_on(&Solo, scene, start)
}

/// `simulation` on several ranks. Collective.
pub fn simulation_on<'c>(comm: &'c dyn Comm, scene: &Scene, start: &InitialCondition) -> Simulation<'c> {
    Simulation::new(scene, start, comm).unwrap_or_else(|why| panic!("{why}"))
}

/// A norm in which all components have the weight 1.
pub fn norm(simulation: &Simulation, rate: bool) -> Norm {
    let width = simulation.dynamics().columns().width(Changes::EveryStage);
    Norm { weights: vec![vec![1.0; width]], rate, mean: None, rows: Vec::new() }
}
