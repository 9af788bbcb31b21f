//! How do I try a friction law of my own?
//!
//! Viscous friction: a sphere that slides on a floor slows down exponentially.

use demhybrid::domain::Solo;
use demhybrid::engine::kernel::compiled;
use demhybrid::engine::simulation::{Frame, Physics, Simulation, parameters};
use demhybrid::error::Error;
use demhybrid::math::elementary::Arithmetic;
use demhybrid::math::vector::{Vec3, scaled};
use demhybrid::model::columns::velocity;
use demhybrid::model::contact::{Elastic, Tangential};
use demhybrid::scene::initial_condition::InitialCondition;
use demhybrid::scene::{Scene, effects};

/// The force is `c` (kg/s) times the slip, against it, however hard surfaces press.
#[derive(Clone, Copy)]
struct Viscous {
    c: f64,
}

impl Tangential for Viscous {
    const RUBS: bool = true;
    /// Without rotation. `Turning(Viscous { .. })` would turn the spheres.
    const TURNS: bool = false;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, _repulsion: f64, slip: &Vec3) -> Vec3 {
        scaled(-self.c, slip)
    }
}

/// The sphere floats where the floor repels it as strongly as gravity pulls: F_0 is its weight, the gap is 0.
const SCENE: &str = "
    t_end = 1.0
    gravity = [0.0, 0.0, -10.0]
    particles = { radius = 0.1, mass = 1.0, file = 'placed by the program' }
    container.wall = [{ point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, -1.0] }]
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 1.0,
                dissipation_focusing = 10.0, interaction_distance = 0.1 }
    solver.tolerance = 1e-6
    output.interval = 0.25
";

fn main() -> Result<(), Error> {
    let scene = Scene::parse("slide.toml", SCENE, &[])?;
    let (x, v, omega) = (vec![[0.0, 0.0, 0.1]], vec![[0.5, 0.0, 0.0]], vec![[0.0; 3]]);
    let start = InitialCondition { x, v, omega, ..InitialCondition::default() };

    // The scene gives the numbers of the law, the program its parts: rebound and friction.
    let viscous = Viscous { c: 2.0 };
    let kernel = |set| compiled(effects::law(&scene), Elastic, viscous, set);
    let physics = Physics { kernel: &kernel, parameters: parameters(&scene) };

    let mut speed = 0.0;
    Simulation::with_physics(&scene, &start, physics, &Solo)?.run(&mut |frame: &Frame| {
        speed = velocity(frame.rows.row(0)).x;
        println!("t = {:.2} s: {speed:.6} m/s", frame.time);
        Ok(())
    })?;
    let exact = 0.5 * (-viscous.c * scene.t_end / scene.particles.mass).exp();
    println!("exact at the end: {exact:.6} m/s, off by {:.1e} m/s", (speed - exact).abs());
    assert!((speed - exact).abs() < 1e-5);
    Ok(())
}
