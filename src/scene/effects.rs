//! Which effects a scene needs, and why. They are chosen once, before anything is computed.

use crate::model::contact::{Dissipative, Frictionless, Law, LawParameters};
use crate::model::effects::{Effects, FrictionLaw, Variant};
use crate::model::history::MemoryParameters;
use crate::scene::{DEFAULT_DAMPING, DEFAULT_STIFFNESS_RATIO, Resistance, Scene};

impl Effects {
    /// The effects of `scene`. An effect that could not change the result is left out.
    pub fn of(scene: &Scene) -> Self {
        let variant = match &scene.friction {
            Some(f) if f.coefficient > 0.0 && f.rotation => Variant::FrictionRotation,
            Some(f) if f.coefficient > 0.0 => Variant::Friction,
            _ => Variant::Basic,
        };
        Effects { variant, dissipative: scene.contact.restitution < 1.0 }
    }

    /// The effects as text, a line for each: name, on or off, and the key that decides.
    pub fn explain(&self, scene: &Scene) -> Vec<String> {
        let e = scene.contact.restitution;
        let rebound = if self.dissipative {
            format!("rebound    on   contact.restitution = {e} is below 1")
        } else {
            format!(
                "rebound    off  contact.restitution = {e}: nothing is lost, the rebound function is not \
                 computed"
            )
        };
        let friction = match &scene.friction {
            None => "friction   off  the scene has no [friction]".into(),
            Some(f) if f.coefficient == 0.0 => {
                "friction   off  friction.coefficient = 0: nothing would rub".to_string()
            }
            Some(f) => format!("friction   on   friction.coefficient = {}", f.coefficient),
        };
        let memory = match &scene.friction {
            Some(f) if f.coefficient > 0.0 && f.law == FrictionLaw::History => {
                "history    on   friction.law = \"history\": contacts know how far they have been sheared"
            }
            Some(f) if f.coefficient > 0.0 => "history    off  friction.law = \"regularized\"",
            _ => "history    off  without friction there is nothing to remember",
        };
        let resistance = |name: &str, table: Option<&Resistance>| match table {
            Some(table) if self.variant == Variant::FrictionRotation && table.coefficient > 0.0 => {
                format!("{name:<10} on   friction.{name}.coefficient = {}", table.coefficient)
            }
            Some(_) => format!("{name:<10} off  friction.{name}.coefficient = 0: nothing would resist"),
            None => format!("{name:<10} off  the scene has no [friction.{name}]"),
        };
        let friction_table = scene.friction.as_ref();
        let rolling = resistance("rolling", friction_table.and_then(|f| f.rolling.as_ref()));
        let twisting = resistance("twisting", friction_table.and_then(|f| f.twisting.as_ref()));
        let rotation = match &scene.friction {
            Some(f) if f.coefficient > 0.0 && f.rotation => "rotation   on   friction.rotation = true",
            Some(f) if f.coefficient > 0.0 => "rotation   off  friction.rotation = false",
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

/// The numbers of the scene's contact law.
pub fn law(scene: &Scene) -> LawParameters {
    let friction = scene.friction.as_ref();
    let (phi, v_min) =
        friction.map_or((0.0, 1.0), |f| (f.coefficient, f.regularization_velocity.unwrap_or(1.0)));
    let remembers = friction.filter(|f| f.law == FrictionLaw::History && f.coefficient > 0.0);
    LawParameters {
        r: scene.particles.radius,
        f_0: scene.contact.repulsion_at_contact,
        kappa: scene.contact.stiffness_exponent,
        l_max: scene.contact.interaction_distance,
        e: scene.contact.restitution,
        psi: scene.contact.dissipation_focusing,
        phi,
        v_min,
        memory: remembers.map(|f| MemoryParameters {
            stiffness_ratio: f.stiffness_ratio.unwrap_or(DEFAULT_STIFFNESS_RATIO),
            damping: f.damping.unwrap_or(DEFAULT_DAMPING),
            mass: scene.particles.mass,
            resistance: [&f.rolling, &f.twisting].map(|table| match table {
                Some(table) if f.rotation => table.coefficient,
                _ => 0.0,
            }),
        }),
    }
}

/// The normal force of the scene's contacts, eqs. (2.1) to (2.5), without friction. With e = 1 the rebound
/// function is 1.
pub fn normal_law(scene: &Scene) -> Law<Dissipative, Frictionless> {
    let parameters = law(scene);
    let rebound = Dissipative::new(parameters.e, parameters.psi);
    Law { parameters, rebound, tangential: Frictionless }
}
