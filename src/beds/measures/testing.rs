//! Scenes for the tests of measures.

use crate::files::run_file::State;
use crate::model::size::{Size, Sizes};
use crate::scene::Scene;

/// Spheres of radius 0.1 m with the contacts of Tab. 4.2 of the paper. `more` has more top-level keys.
pub fn scene(more: &str) -> Scene {
    walled(more, "")
}

/// The same with tables at its end, such as `[[container.wall]]`.
pub fn walled(more: &str, tables: &str) -> Scene {
    let text = format!(
        "t_end = 8
         {more}
         particles = {{ radius = 0.1, mass = 1, file = 'start.csv' }}
              contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4, \
              dissipation_focusing = 10,
                      interaction_distance = 0.1 }}
         {tables}"
    );
    Scene::parse("bed.toml", &text, &[]).unwrap()
}

/// The same scene in a box.
pub fn boxed(min: &str, max: &str) -> Scene {
    scene(&format!("container.box = {{ min = {min}, max = {max} }}"))
}

/// Spheres of the size of the scene at rest around the centres `x` (m).
pub fn at_rest(x: Vec<[f64; 3]>) -> State {
    State {
        frame: 0,
        time: 0.0,
        v: vec![[0.0; 3]; x.len()],
        x,
        omega: None,
        sizes: Default::default(),
        materials: Default::default(),
    }
}

/// Spheres at rest, each with its centre (m), radius (m) and mass (kg).
pub fn sized(spheres: &[([f64; 3], f64, f64)]) -> State {
    let sizes: Vec<Size> = spheres.iter().map(|&(_, r, mass)| Size::new(r, mass)).collect();
    State { sizes: sizes.into(), ..at_rest(spheres.iter().map(|(x, ..)| *x).collect()) }
}

/// The one size of the spheres of a scene.
pub fn alike(scene: &Scene) -> Sizes<'static> {
    Sizes::Equal(Size::new(scene.particles.radius, scene.particles.mass))
}
