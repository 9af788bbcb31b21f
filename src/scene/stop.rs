//! `[stop]`: when the particles count as at rest, which ends a run.

use super::{Friction, Scene};
use crate::model::effects::FrictionLaw;
use serde::{Deserialize, Serialize};

/// Largest speed at rest where the scene gives none, in units of the scene.
const SLOW: f64 = 0.01;
/// The same in units of v_min. Surfaces of the paper's friction creep at up to v_min on each other, and layers
/// add up: a bed of ten layers that creeps moves at up to 2 v_min. One sphere that rolls is faster.
const CREEP: f64 = 5.0;

/// When the particles count as at rest: a criterion has held for the time `window`.
///
/// At least one of the first four numbers is `Some`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stop {
    /// Largest mean kinetic energy of a particle; > 0.
    pub kinetic_energy: Option<f64>,
    /// Largest unbalanced force ([`crate::engine::dynamics::Dynamics::unbalanced_force`]), 1; > 0.
    pub unbalanced_force: Option<f64>,
    /// Largest change of the height of the bed; > 0.
    pub height_change: Option<f64>,
    /// Largest speed of a centre; > 0. No other criterion holds while a particle is faster.
    pub speed: Option<f64>,
    /// Simulated time for which a criterion must hold; > 0.
    pub window: Option<f64>,
    /// What the numbers above count.
    pub units: Units,
}

/// The units of `[stop]`, as `stop.units` names them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// J, m, m/s, s.
    #[default]
    Si,
    /// Of the scene: with the velocity scale v and the radius r, energies are in m v^2, lengths in r, speeds
    /// in v and times in r/v. Where gravity sets v = sqrt(g r), m v^2 = m g r.
    Scene,
}

impl Units {
    /// The names of all units.
    pub const NAMES: &[&str] = &["si", "scene"];
}

/// What rest means in a scene, in SI units. Criteria that the scene leaves out are infinite or absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Largest mean kinetic energy of a particle, J.
    pub kinetic_energy: Option<f64>,
    /// Largest unbalanced force, 1.
    pub unbalanced_force: Option<f64>,
    /// Largest change of the height of the bed, m.
    pub height_change: Option<f64>,
    /// Largest speed of a centre, m/s.
    pub speed: f64,
    /// Simulated time for which a criterion must hold, s.
    pub window: f64,
}

impl Rest {
    /// The rest that `scene` asks for, if it has `[stop]`; `scale` is its velocity scale, m/s.
    ///
    /// A speed that is left out is 0.01 of the scale, and at least 5 v_min with the paper's friction, because
    /// that creeps. A window that is left out is the radius over the scale.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    /// use demhybrid::scene::stop::Rest;
    ///
    /// let text = std::fs::read_to_string("configs/settle.toml")?;
    /// let sets = ["stop.height_change=1e-3".to_owned(), "stop.units=scene".to_owned()];
    /// let rest = Rest::of(&Scene::parse("settle.toml", &text, &sets)?, 1.0).expect("it has [stop]");
    /// assert!((rest.height_change.expect("it is given") - 1e-4).abs() < 1e-15); // m: r is 0.1 m
    /// assert!((rest.speed - 0.05).abs() < 1e-15); // m/s: v_min is 0.01 m/s
    /// assert!((rest.window - 0.1).abs() < 1e-15); // s
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(scene: &Scene, scale: f64) -> Option<Rest> {
        let stop = scene.stop.as_ref()?;
        let (r, mass) = (scene.particles.radius, scene.particles.mass);
        let [energy, length, speed, time] = match stop.units {
            Units::Si => [1.0; 4],
            Units::Scene => [mass * scale * scale, r, scale, r / scale],
        };
        let creeps = |friction: &&Friction| friction.law == FrictionLaw::Regularized && scene.rubs();
        let creeping = scene.friction.as_ref().filter(creeps);
        let creep = creeping.and_then(|friction| friction.regularization_velocity).unwrap_or(0.0);
        Some(Rest {
            kinetic_energy: stop.kinetic_energy.map(|most| most * energy),
            unbalanced_force: stop.unbalanced_force,
            height_change: stop.height_change.map(|most| most * length),
            speed: stop.speed.map_or((SLOW * scale).max(CREEP * creep), |most| most * speed),
            window: stop.window.map_or(r / scale, |window| window * time),
        })
    }

    /// Whether nothing but speed is asked for.
    pub fn is_speed_alone(&self) -> bool {
        self.kinetic_energy.is_none() && self.unbalanced_force.is_none() && self.height_change.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rest(sets: &[&str]) -> Rest {
        let text = "t_end = 1
            particles = { radius = 2e-3, mass = 3.0, file = 'a.csv' }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }";
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Rest::of(&Scene::parse("a.toml", text, &sets).unwrap(), 0.5).unwrap()
    }

    #[test]
    fn numbers_are_in_units_of_si_or_of_the_scene() {
        let given = ["stop.kinetic_energy=2", "stop.height_change=3", "stop.speed=4", "stop.window=5"];
        let si = rest(&given);
        assert_eq!(
            (si.kinetic_energy, si.height_change, si.speed, si.window),
            (Some(2.0), Some(3.0), 4.0, 5.0)
        );
        let scene = rest(&[&given[..], &["stop.units=scene"]].concat());
        assert_eq!((scene.kinetic_energy, scene.height_change), (Some(2.0 * 0.75), Some(3.0 * 2e-3)));
        assert_eq!((scene.speed, scene.window), (2.0, 5.0 * 4e-3));
    }

    #[test]
    fn what_is_left_out_follows_the_scene_and_its_creep() {
        let left_out = |more: &[&str]| {
            let rest = rest(&[&["stop.unbalanced_force=1e-3"], more].concat());
            (rest.speed, rest.window)
        };
        assert_eq!(left_out(&[]), (0.005, 4e-3));
        assert_eq!(left_out(&["stop.units=scene"]), (0.005, 4e-3));
        let friction = |law: &str| {
            let friction = ["friction.coefficient=0.2", "friction.regularization_velocity=0.02", law];
            left_out(&friction).0
        };
        assert_eq!(friction("friction.law=regularized"), 0.1);
        assert_eq!(friction("friction.law=history"), 0.005);
        assert_eq!(friction("friction.coefficient=0"), 0.005);
    }
}
