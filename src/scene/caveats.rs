//! What the model of a scene does that nature does not, for whoever reads its results.

use super::Scene;
use crate::math::digits::short;
use crate::model::effects::{Effects, FrictionLaw, Variant};

/// What to bear in mind about results of `scene`, a sentence each. The model chapter has the figures.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::caveats::caveats;
///
/// let text = std::fs::read_to_string("configs/settle.toml")?;
/// let caveats = caveats(&Scene::parse("settle.toml", &text, &[])?);
/// assert!(caveats[0].contains("forgets"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn caveats(scene: &Scene) -> Vec<String> {
    let Effects { variant, dissipative } = Effects::of(scene);
    let forgets = scene.friction.as_ref().filter(|friction| friction.law == FrictionLaw::Regularized);
    let mut found = Vec::new();
    if let Some(friction) = forgets.filter(|_| variant != Variant::Basic) {
        if scene.gravity != [0.0; 3] {
            found.push(format!(
                "friction.law = \"regularized\" forgets: surfaces creep at up to v_min = {} m/s, so a bed settles \
                 on until it is nearly as dense as without friction; friction.law = \"history\" holds",
                friction.regularization_velocity.map_or_else(|| "friction.regularization_velocity".into(), short)
            ));
        }
        if variant == Variant::FrictionRotation {
            found.push(
                "friction.law = \"regularized\" turns pairs by the lever r, and their centres are 2 r + l apart: a \
                 free pair may gain a few per cent of angular momentum in an impact"
                    .to_owned(),
            );
        }
    }
    if dissipative {
        let restitution = match &scene.material[..] {
            [] => format!("contact.restitution = {}", short(scene.contact.restitution)),
            _ => "their coefficient of restitution".to_owned(),
        };
        found.push(format!(
            "impacts slower than 1/contact.dissipation_focusing = {} m/s lose less than {restitution} says, and \
             the slowest nothing",
            short(1.0 / scene.contact.dissipation_focusing)
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_told_of_the_effects_that_it_has_and_of_no_others() {
        let text = "t_end = 1
            gravity = [0, 0, -9.81]
            particles = { radius = 0.1, mass = 1.0, file = 'a.csv' }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }
            friction = { coefficient = 0.2, regularization_velocity = 0.02 }";
        let of = |sets: &[&str]| {
            let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
            caveats(&Scene::parse("a.toml", text, &sets).unwrap())
        };
        let all = of(&[]);
        assert!(all[0].contains("v_min = 0.02 m/s") && all[1].contains("angular momentum"), "{all:?}");
        assert!(all[2].contains("slower than 1/contact.dissipation_focusing = 0.1 m/s"), "{all:?}");
        assert_eq!(of(&["contact.restitution=1"]), all[..2]);
        assert_eq!(of(&["gravity=[0, 0, 0]"]), all[1..]);
        assert_eq!(of(&["friction.rotation=false"]), [all[0].clone(), all[2].clone()]);
        for no_creep in ["friction.law=history", "friction.coefficient=0"] {
            assert_eq!(of(&[no_creep]), all[2..], "{no_creep}");
        }
    }
}
