//! Scenes for the tests of measures.

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
