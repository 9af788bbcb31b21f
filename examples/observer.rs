//! How does a program look at a run while it goes on?
//!
//! An observer of one's own finds the fastest sphere of every frame: the speed of the first sphere goes
//! from one to the next.

use demhybrid::domain::Solo;
use demhybrid::engine::simulation::{Frame, Observer, Simulation};
use demhybrid::error::Error;
use demhybrid::model::columns::velocity;
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::InitialCondition;

/// A row of spheres without gravity. They are elastic, so that they pass on what the first one brings.
const SCENE: &str = "
    t_end = 0.8
    particles = { radius = 0.1, mass = 1, file = 'placed by the program' }
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 500.0, restitution = 1.0,
                dissipation_focusing = 10.0, interaction_distance = 0.05 }
    solver.tolerance = 1e-4
    output.interval = 0.1
";

/// The fastest sphere of every frame: its id, and its speed in m/s.
#[derive(Default)]
struct Fastest {
    found: Vec<(usize, f64)>,
}

impl Observer for Fastest {
    fn frame(&mut self, frame: &Frame) -> Result<(), Error> {
        // One value of each sphere, in the order of their ids.
        let speeds = frame.rows.map(|row| velocity(row).norm());
        let fastest = speeds.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let (id, speed) = fastest.expect("there are spheres");
        println!("t = {:.1} s: sphere {id} is the fastest, {speed:.4} m/s", frame.time);
        self.found.push((id, speed));
        Ok(())
    }
}

fn main() -> Result<(), Error> {
    let scene = Scene::parse("row.toml", SCENE, &[])?;
    let start = InitialCondition {
        x: (0..4).map(|k| [0.5 * f64::from(k), 0.0, 0.0]).collect(),
        v: vec![[4.0, 0.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]],
        omega: vec![[0.0; 3]; 4],
        ..InitialCondition::default()
    };
    let mut fastest = Fastest::default();
    let outcome = Simulation::new(&scene, &start, &Solo)?.run(&mut fastest)?;
    println!("{} frames, {} right-hand sides", fastest.found.len(), outcome.counts.rhs);

    // The sphere that is hit takes over all of the speed.
    assert_eq!(fastest.found[0], (0, 4.0));
    let (id, speed) = fastest.found[8];
    assert_eq!(id, 3);
    assert!((speed - 4.0).abs() < 0.01, "{speed} m/s");
    Ok(())
}
