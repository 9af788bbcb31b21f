//! The scene: one TOML text and the `--set` options become a checked description of a run.
//!
//! `source` holds the text, merges `--set` and points at mistakes; `keys` lists every key with its unit and range;
//! `check` holds a merged table against that list. What depends on particle positions is checked in [`crate::scene::initial_condition`].

mod check;
pub mod effects;
pub mod initial_condition;
mod keys;
mod schema;
mod source;
pub mod walls;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::ode::{MethodName, NormName};
pub(crate) use check::cells_along;
pub use schema::schema;
use source::Source;
pub use source::split_values;
pub(crate) use source::{brief, shown};

/// A checked scene, every default filled in. SI units throughout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Simulated time, s; > 0.
    pub t_end: f64,
    /// Acceleration that acts on every particle, m/s^2.
    #[serde(default)]
    pub gravity: [f64; 3],
    /// What moves, and where it starts.
    pub particles: Particles,
    /// Walls; empty by default.
    #[serde(default)]
    pub container: Container,
    /// Normal force of every contact.
    pub contact: Contact,
    /// Tangential force of every contact; none: the basic variant.
    pub friction: Option<Friction>,
    /// Time integration.
    #[serde(default)]
    pub solver: Solver,
    /// What is written.
    #[serde(default)]
    pub output: Output,
    /// When checkpoints are written; none: only when the run is stopped.
    pub checkpoint: Option<Checkpoint>,
    /// What stops the run early.
    pub limits: Option<Limits>,
    /// When the particles are at rest, which ends the run.
    pub stop: Option<Stop>,
}

/// Identical spheres and one source of their initial state: exactly one of `file` and `grid` is there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// r, m; > 0.
    pub radius: f64,
    /// Mass of one particle, kg; > 0.
    #[serde(default = "unit_mass")]
    pub mass: f64,
    /// CSV file with the initial state, as the user wrote it: absolute or relative to the scene file.
    pub file: Option<PathBuf>,
    /// Randomly perturbed grid.
    pub grid: Option<Grid>,
}

fn unit_mass() -> f64 {
    1.0
}

/// The paper's randomly perturbed grid (Fig. 4.2a), filled layer by layer from the bottom.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Grid {
    /// Number of particles, 1..=1e9.
    pub count: u64,
    /// Side of a cubic cell, m; > 0, no larger than the box in x and y.
    pub spacing: f64,
    /// Upper bound of the three random shifts of a centre, m; >= 0.
    pub jitter: f64,
    /// Height of the lower face of the first layer of cells, m.
    pub bottom: f64,
    /// Seed of the random shifts; after [`Scene::set_seed_if_missing`] it is `Some`.
    pub seed: Option<u64>,
}

impl Default for Grid {
    fn default() -> Self {
        Grid { count: 200, spacing: 0.25, jitter: 0.025, bottom: 1.1, seed: None }
    }
}

/// Walls. They are numbered: finite box sides in the order min x, max x, min y, max y, min z, max z, then `wall`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Container {
    /// Axis-parallel box.
    pub r#box: Option<BoxSides>,
    /// Any planes.
    pub wall: Vec<WallPlane>,
}

/// Two opposite corners of a box, m; an infinite coordinate leaves that side open. `min < max` on each axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxSides {
    /// Lower corner, m; -inf: open.
    pub min: [f64; 3],
    /// Upper corner, m; inf: open.
    pub max: [f64; 3],
}

impl Default for BoxSides {
    fn default() -> Self {
        BoxSides { min: [0.0; 3], max: [1.0, 1.0, f64::INFINITY] }
    }
}

/// A plane wall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallPlane {
    /// Any point of the plane, m.
    pub point: [f64; 3],
    /// Outward normal, not zero, any length.
    pub normal: [f64; 3],
}

impl Default for WallPlane {
    fn default() -> Self {
        WallPlane { point: [0.0; 3], normal: [0.0, 0.0, -1.0] }
    }
}

/// Parameters of repulsion and rebound, eqs. (2.1)-(2.5).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// F_0, N; > 0.
    pub repulsion_at_contact: f64,
    /// kappa, 1/m; > 0.
    pub stiffness_exponent: f64,
    /// e, 0..=1.
    pub restitution: f64,
    /// psi, s/m; > 0.
    pub dissipation_focusing: f64,
    /// l_max, m; > 0.
    pub interaction_distance: f64,
}

/// Parameters of friction, eqs. (2.6)-(2.10).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// phi; >= 0.
    pub coefficient: f64,
    /// v_min, m/s; > 0.
    pub regularization_velocity: f64,
    /// Whether friction turns the spheres.
    #[serde(default = "turning")]
    pub rotation: bool,
}

fn turning() -> bool {
    true
}

/// Time integration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Solver {
    /// The method that takes the steps.
    pub method: MethodName,
    /// Bound on the error of a step in the given norm; > 0. `Some` after [`Scene::parse`] unless the method has a fixed
    /// step.
    pub tolerance: Option<f64>,
    /// How an error is measured.
    pub norm: NormName,
    /// Speed that errors of velocity are compared with in the scaled norm, m/s; > 0. Left out: see
    /// [`crate::scene::initial_condition::velocity_scale`].
    pub velocity_scale: Option<f64>,
    /// Contacts with a repulsion below this are left out by the stabilised method, N; >= 0 and below F_0. Left out: see
    /// [`crate::engine::simulation::neglected_force`].
    pub neglected_force: Option<f64>,
    /// Fixed step of velocity-verlet, s; > 0, and there exactly with that method.
    pub step: Option<f64>,
    /// Largest first trial step, s; > 0.
    pub initial_step: f64,
    /// Smallest step, s; > 0.
    pub min_step: f64,
    /// Largest step, s; >= `min_step`, may be infinite.
    pub max_step: f64,
}

/// Tolerance where the scene says nothing.
pub const DEFAULT_TOLERANCE: f64 = 0.1;

impl Default for Solver {
    fn default() -> Self {
        Solver {
            method: MethodName::Auto,
            tolerance: None,
            norm: NormName::Scaled,
            velocity_scale: None,
            neglected_force: None,
            step: None,
            initial_step: 0.1,
            min_step: 1e-9,
            max_step: f64::INFINITY,
        }
    }
}

/// What is written; file and interval are `Some` after [`Scene::parse`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Output {
    /// Output file, relative to the working folder.
    pub file: Option<PathBuf>,
    /// Simulated time between frames, s; > 0.
    pub interval: Option<f64>,
    /// Whether the energy that contacts dissipate is integrated and written.
    pub energy: bool,
}

/// When checkpoints are written; at least one of the two is there.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Checkpoint {
    /// Simulated time between two, s; > 0.
    pub interval: Option<f64>,
    /// Wall time between two, s; > 0.
    pub wall: Option<f64>,
}

/// What stops the run early.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Wall time, s; > 0.
    pub wall: Option<f64>,
}

/// When the particles are at rest: when one of the first three, of which at least one is there, has held for a window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stop {
    /// Largest kinetic energy of a particle on average, J; > 0.
    pub kinetic_energy: Option<f64>,
    /// Largest unbalanced force ([`crate::engine::dynamics::Dynamics::unbalanced_force`]); > 0.
    pub unbalanced_force: Option<f64>,
    /// Largest change of the height of the bed, m; > 0.
    pub height_change: Option<f64>,
    /// Simulated time for which it must hold, s; > 0.
    pub window: f64,
}

impl Default for Stop {
    fn default() -> Self {
        Stop { kinetic_energy: None, unbalanced_force: None, height_change: None, window: 0.1 }
    }
}

impl Scene {
    /// Reads and checks a scene. `name` is its path as the user typed it (for messages, and for the name of the
    /// output file), `text` its content, `sets` the KEY=VALUE of every `--set` in order.
    pub fn parse(name: &str, text: &str, sets: &[String]) -> Result<Scene, Error> {
        let mut source = Source::new(name, text, sets);
        let set_texts = source.set_documents()?;
        let table = source.merged(text, &set_texts)?;
        check::keys_and_values(&mut source, table.get_ref())?;
        let mut scene = Scene::deserialize(toml::Deserializer::from(table))
            .map_err(|mistake| source.error(mistake.span(), mistake.message()))?;
        scene.fill_in_output(name);
        scene.fill_in_tolerance();
        check::relations(&source, &scene)?;
        Ok(scene)
    }

    /// Fills in a missing seed. The caller draws it on rank 0 and broadcasts it.
    pub fn set_seed_if_missing(&mut self, seed: u64) {
        if let Some(grid) = &mut self.particles.grid {
            grid.seed.get_or_insert(seed);
        }
    }

    /// The scene as TOML with every default written out; parses to an equal scene under any name.
    pub fn resolved(&self) -> String {
        toml::to_string(self)
            .expect("a scene holds only tables, numbers, switches and text that came from TOML")
    }

    /// Whether particles have spins: friction with rotation, and a coefficient that is not 0.
    pub fn rotates(&self) -> bool {
        self.friction.as_ref().is_some_and(|friction| friction.rotation && friction.coefficient > 0.0)
    }

    fn fill_in_tolerance(&mut self) {
        let solver = &mut self.solver;
        if solver.step.is_none() {
            solver.tolerance.get_or_insert(DEFAULT_TOLERANCE);
        }
    }

    fn fill_in_output(&mut self, name: &str) {
        let t_end = self.t_end;
        self.output.interval.get_or_insert(t_end / 100.0);
        self.output.file.get_or_insert_with(|| {
            let mut file = Path::new(name).file_stem().unwrap_or("scene".as_ref()).to_owned();
            file.push(".vtkhdf");
            file.into()
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: &str = "
        t_end = 8
        particles = { radius = 0.1, file = 'start.csv' }
        [contact]
        repulsion_at_contact = 10
        stiffness_exponent = 150
        restitution = 0.4
        dissipation_focusing = 10
        interaction_distance = 0.1
    ";

    fn parse(sets: &[&str]) -> Result<Scene, Error> {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Scene::parse("folder/short.toml", SHORT, &sets)
    }

    #[test]
    fn what_is_left_out_has_the_documented_defaults() {
        let scene = parse(&[]).unwrap();
        assert_eq!(scene.gravity, [0.0; 3]);
        assert_eq!(scene.particles.mass, 1.0);
        assert_eq!(scene.container, Container { r#box: None, wall: vec![] });
        assert_eq!(scene.friction, None);
        assert_eq!((scene.solver.method, scene.solver.norm), (MethodName::Auto, NormName::Scaled));
        assert_eq!((scene.solver.tolerance, scene.solver.initial_step), (Some(DEFAULT_TOLERANCE), 0.1));
        assert_eq!((scene.solver.min_step, scene.solver.max_step), (1e-9, f64::INFINITY));
        assert_eq!(scene.output.file, Some("short.vtkhdf".into()));
        assert_eq!(scene.output.interval, Some(0.08));
    }

    #[test]
    fn a_resolved_scene_parses_to_an_equal_one_under_another_name() {
        let everything = [
            "friction={ coefficient = 0.1, regularization_velocity = 1e-300 }",
            "container.box={ min = [-inf, -1e-7, 0.1], max = [inf, 1e17, 0.30000000000000004] }",
            "container.wall=[{}, { point = [1, 2, 3], normal = [0, 7, 0] }]",
            "output.file=a \"quoted\" file.vtkhdf",
            "solver.max_step=0.5",
            "solver.velocity_scale=2",
            "output.energy=true",
        ];
        let scene = parse(&everything).unwrap();
        assert_eq!(Scene::parse("other.toml", &scene.resolved(), &[]).unwrap(), scene);
        let scene = parse(&[]).unwrap();
        assert_eq!(Scene::parse("other.toml", &scene.resolved(), &[]).unwrap(), scene);
    }

    #[test]
    fn a_seed_of_64_bits_survives_and_a_drawn_one_does_not_replace_it() {
        let text = SHORT.replace("file = 'start.csv'", "grid = { count = 1 }");
        let sets = ["container.box={}".to_owned(), format!("particles.grid.seed={}", u64::MAX)];
        let mut given = Scene::parse("grid.toml", &text, &sets).unwrap();
        given.set_seed_if_missing(7);
        let seed = |scene: &Scene| scene.particles.grid.as_ref().unwrap().seed;
        assert_eq!(seed(&given), Some(u64::MAX));
        assert_eq!(seed(&Scene::parse("grid.toml", &given.resolved(), &[]).unwrap()), Some(u64::MAX));
        let mut drawn = Scene::parse("grid.toml", &text, &sets[..1]).unwrap();
        assert_eq!(seed(&drawn), None);
        drawn.set_seed_if_missing(7);
        assert_eq!(seed(&drawn), Some(7));
    }

    #[test]
    fn spins_need_friction_that_is_not_zero_and_rotation() {
        assert!(!parse(&[]).unwrap().rotates());
        let friction = |phi, rotation| {
            let table = format!("coefficient = {phi}, regularization_velocity = 0.01, rotation = {rotation}");
            parse(&[&format!("friction={{ {table} }}")]).unwrap()
        };
        assert!(friction(0.2, true).rotates());
        assert!(!friction(0.2, false).rotates());
        assert!(!friction(0.0, true).rotates());
    }
}
