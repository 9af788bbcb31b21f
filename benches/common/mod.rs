//! Packed beds for benches and what it takes to evaluate them.

#![allow(dead_code)] // every bench uses a part

use demhybrid::domain::{Comm, Solo};
use demhybrid::engine::simulation::{Simulation, Task, dispatch};
use demhybrid::model::contact::{Rebound, Tangential};
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

/// Hands a simulation of `start` to `job`, with the scene's effects as types.
pub fn simulate(scene: &Scene, start: &InitialCondition, job: impl Job) {
    simulate_on(&Solo, scene, start, job);
}

/// `simulate` on several ranks. Collective.
pub fn simulate_on(comm: &dyn Comm, scene: &Scene, start: &InitialCondition, job: impl Job) {
    struct Bench<'a, J>(&'a dyn Comm, &'a Scene, &'a InitialCondition, J);
    impl<J: Job> Task for Bench<'_, J> {
        type Output = ();
        fn with<R: Rebound, T: Tangential, W: demhybrid::model::particle::Spin>(
            self,
            law: demhybrid::model::contact::Law<R, T>,
        ) {
            let simulation = Simulation::<R, T, W>::new(self.1, self.2, law, self.0);
            self.3.run(simulation.unwrap_or_else(|why| panic!("{why}")));
        }
    }
    dispatch(scene, Bench(comm, scene, start, job));
}

/// Work for any variant.
pub trait Job {
    /// Does it.
    fn run<R: Rebound, T: Tangential, W: demhybrid::model::particle::Spin>(
        self,
        simulation: Simulation<R, T, W>,
    );
}
