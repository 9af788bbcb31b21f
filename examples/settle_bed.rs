//! How high and how dense is a bed that has settled?
//!
//! 64 spheres fall into a box and come to rest. Then the bed is measured.

use demhybrid::beds::measures::request::RegionRequest;
use demhybrid::beds::measures::union::Spheres;
use demhybrid::domain::Solo;
use demhybrid::engine::simulation::{Frame, Simulation};
use demhybrid::error::Error;
use demhybrid::math::vector::Vec3;
use demhybrid::model::columns::position;
use demhybrid::scene::{Scene, initial_condition};

/// The seed makes the start reproducible. The run ends where nothing moves, at `t_end` at the latest.
const SCENE: &str = "
    t_end = 4.0
    gravity = [0.0, 0.0, -9.81]
    particles = { radius = 0.1, mass = 1, grid = { count = 64, spacing = 0.25, bottom = 0.1, seed = 1 } }
    container.box = { max = [0.8, 0.8, inf] }
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
                dissipation_focusing = 10.0, interaction_distance = 0.1 }
    friction = { coefficient = 0.2, regularization_velocity = 0.01 }
    stop.kinetic_energy = 1e-4
    output.interval = 0.1
";

fn main() -> Result<(), Error> {
    let scene = Scene::parse("bed.toml", SCENE, &[])?;
    let grid = scene.particles.grid.as_ref().expect("the scene has a grid");
    let start = initial_condition::grid(&scene, grid);
    initial_condition::check(&scene, &start)?;

    // `Solo` is a single rank. The closure receives every frame; only the last one is kept.
    let (mut centres, mut height): (Vec<Vec3>, f64) = (Vec::new(), 0.0);
    let outcome = Simulation::new(&scene, &start, &Solo)?.run(&mut |frame: &Frame| {
        (centres, height) = (frame.rows.map(position), frame.bed_height);
        Ok(())
    })?;

    // The region is the bed without its top. Overlaps count once.
    let sizes = start.sizes(&scene);
    let (region, words) = RegionRequest::Bed.of(&scene, &centres, sizes.as_sizes());
    let volumes = Spheres::sized(&centres, sizes.as_sizes()).volumes(&region);
    let porosity = 1.0 - volumes.union / volumes.region;
    println!("{} spheres after {:.2} s, {} steps", centres.len(), outcome.time, outcome.counts.accepted);
    println!("height of the bed: {height:.3} m");
    println!("porosity of {words}: {porosity:.3}");
    assert!((0.4..1.2).contains(&height), "64 spheres of 0.2 m fill about 5 layers of 13");
    assert!((0.35..0.6).contains(&porosity), "a loose bed between walls");
    Ok(())
}
