//! Which effects a scene calls for, and why: decided once, before anything is computed.

use crate::model::contact::{Coulomb, Dissipative, Elastic, Frictionless, Law};
use crate::model::effects::{Effects, Variant};
use crate::scene::Scene;

impl Effects {
    /// What `scene` calls for: nothing that could not change the result.
    pub fn of(scene: &Scene) -> Self {
        let variant = match &scene.friction {
            Some(f) if f.coefficient > 0.0 && f.rotation => Variant::FrictionRotation,
            Some(f) if f.coefficient > 0.0 => Variant::Friction,
            _ => Variant::Basic,
        };
        Effects { variant, dissipative: scene.contact.restitution < 1.0 }
    }

    /// The choice in words, a line an effect: name, on or off, and the key that decides.
    pub fn explain(&self, scene: &Scene) -> Vec<String> {
        let e = scene.contact.restitution;
        let rebound = if self.dissipative {
            format!("rebound    on   contact.restitution = {e} is below 1")
        } else {
            format!(
                "rebound    off  contact.restitution = {e}: nothing is lost, the rebound function is not computed"
            )
        };
        let friction = match &scene.friction {
            None => "friction   off  the scene has no [friction]".into(),
            Some(f) if f.coefficient == 0.0 => {
                "friction   off  friction.coefficient = 0: nothing would rub".to_string()
            }
            Some(f) => format!("friction   on   friction.coefficient = {}", f.coefficient),
        };
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
        vec![rebound, friction, rotation.into(), gravity]
    }
}

/// The scene's contact law with the given effects.
pub fn law<R, T>(scene: &Scene, rebound: R, tangential: T) -> Law<R, T> {
    Law {
        r: scene.particles.radius,
        f_0: scene.contact.repulsion_at_contact,
        kappa: scene.contact.stiffness_exponent,
        l_max: scene.contact.interaction_distance,
        rebound,
        tangential,
    }
}

/// The scene's rebound function, eq. (2.4).
pub fn dissipative(scene: &Scene) -> Dissipative {
    Dissipative::new(scene.contact.restitution, scene.contact.dissipation_focusing)
}

/// No loss on rebound.
pub fn elastic(_scene: &Scene) -> Elastic {
    Elastic
}

/// The scene's friction, eqs. (2.6)-(2.10); none where the scene has none.
pub fn coulomb(scene: &Scene) -> Coulomb {
    let (phi, v_min) =
        scene.friction.as_ref().map_or((0.0, 1.0), |f| (f.coefficient, f.regularization_velocity));
    Coulomb::new(phi, v_min)
}

/// No friction.
pub fn frictionless(_scene: &Scene) -> Frictionless {
    Frictionless
}
