//! Which effects a scene needs, and why. They are chosen once, before anything is computed.

use crate::model::contact::{Dissipative, Frictionless, Law, LawParameters};
use crate::model::effects::{Effects, FrictionLaw, Variant};
use crate::model::history::MemoryParameters;
use crate::model::materials::Coefficients;
use crate::scene::{DEFAULT_DAMPING, DEFAULT_STIFFNESS_RATIO, Resistance, Scene};

impl Effects {
    /// The effects of `scene`. An effect that could not change the result is left out.
    pub fn of(scene: &Scene) -> Self {
        let variant = match &scene.friction {
            Some(f) if scene.rubs() && f.rotation => Variant::FrictionRotation,
            Some(_) if scene.rubs() => Variant::Friction,
            _ => Variant::Basic,
        };
        Effects { variant, dissipative: scene.dissipates() }
    }

    /// The effects as text, a line for each: name, on or off, and the key that decides.
    pub fn explain(&self, scene: &Scene) -> Vec<String> {
        let e = scene.contact.restitution;
        // Where only materials have a coefficient, it is told with the materials.
        let of_material = |name: &str| format!("{name:<10} on   a [[material]] has it, see materials");
        let rebound = if self.dissipative && e == 1.0 {
            "rebound    on   a [[material]] has a restitution below 1, see materials".into()
        } else if self.dissipative {
            format!("rebound    on   contact.restitution = {e} is below 1")
        } else {
            format!(
                "rebound    off  contact.restitution = {e}: nothing is lost, the rebound function is not \
                 computed"
            )
        };
        let friction = match &scene.friction {
            None => "friction   off  the scene has no [friction]".into(),
            Some(f) if f.coefficient == 0.0 && scene.rubs() => of_material("friction"),
            Some(f) if f.coefficient == 0.0 => {
                "friction   off  friction.coefficient = 0: nothing would rub".to_string()
            }
            Some(f) => format!("friction   on   friction.coefficient = {}", f.coefficient),
        };
        let memory = match &scene.friction {
            Some(f) if scene.rubs() && f.law == FrictionLaw::History => {
                "history    on   friction.law = \"history\": contacts know how far they have been sheared"
            }
            Some(_) if scene.rubs() => "history    off  friction.law = \"regularized\"",
            _ => "history    off  without friction there is nothing to remember",
        };
        let resistance = |is_on: bool, name: &str, table: Option<&Resistance>| match table {
            Some(table) if self.variant == Variant::FrictionRotation && table.coefficient > 0.0 => {
                format!("{name:<10} on   friction.{name}.coefficient = {}", table.coefficient)
            }
            _ if is_on => of_material(name),
            Some(_) => format!("{name:<10} off  friction.{name}.coefficient = 0: nothing would resist"),
            None => format!("{name:<10} off  the scene has no [friction.{name}]"),
        };
        let friction_table = scene.friction.as_ref();
        let [rolls, twists] = scene.resists();
        let rolling = resistance(rolls, "rolling", friction_table.and_then(|f| f.rolling.as_ref()));
        let twisting = resistance(twists, "twisting", friction_table.and_then(|f| f.twisting.as_ref()));
        let rotation = match &scene.friction {
            Some(f) if scene.rubs() && f.rotation => "rotation   on   friction.rotation = true",
            Some(_) if scene.rubs() => "rotation   off  friction.rotation = false",
            _ => "rotation   off  without friction nothing makes a sphere turn",
        };
        let gravity = if scene.gravity == [0.0; 3] {
            "gravity    off  the scene has no gravity".to_string()
        } else {
            format!("gravity    on   gravity = {:?}", scene.gravity)
        };
        vec![rebound, friction, memory.into(), rotation.into(), rolling, twisting, gravity]
    }
}

/// The numbers of the scene's contact law. Where bodies have materials, it is that of two without any, and
/// [`materials::laws`](super::materials::laws) has the others.
pub fn law(scene: &Scene) -> LawParameters {
    law_with(scene, &scene.plain_coefficients())
}

/// `law` with other coefficients.
pub(super) fn law_with(scene: &Scene, coefficients: &Coefficients) -> LawParameters {
    let friction = scene.friction.as_ref();
    let v_min = friction.map_or(1.0, |f| f.regularization_velocity.unwrap_or(1.0));
    let remembers = friction.filter(|f| f.law == FrictionLaw::History && scene.rubs());
    let [rolls, twists] = scene.resists();
    let Coefficients { restitution, friction, rolling, twisting } = *coefficients;
    LawParameters {
        r: scene.particles.radius,
        f_0: scene.contact.repulsion_at_contact,
        kappa: scene.contact.stiffness_exponent,
        l_max: scene.contact.interaction_distance,
        e: restitution,
        psi: scene.contact.dissipation_focusing,
        phi: friction,
        v_min,
        memory: remembers.map(|f| MemoryParameters {
            stiffness_ratio: f.stiffness_ratio.unwrap_or(DEFAULT_STIFFNESS_RATIO),
            damping: f.damping.unwrap_or(DEFAULT_DAMPING),
            mass: scene.particles.mass,
            resistance: [rolls.then_some(rolling), twists.then_some(twisting)],
        }),
    }
}

/// The normal force of the scene's contacts, eqs. (2.1) to (2.5), without friction. With e = 1 the rebound
/// function is 1. Where bodies have materials, it is that of two without any.
pub fn normal_law(scene: &Scene) -> Law<Dissipative, Frictionless> {
    let parameters = law(scene);
    let rebound = Dissipative::new(parameters.e, parameters.psi);
    Law { parameters, rebound, tangential: Frictionless }
}
