//! Runs on one rank inside a test, and what they gave: states as plain vectors, energies and counts.

// Every test binary uses a part of these helpers.
#![allow(dead_code)]

use demhybrid::domain::Solo;
use demhybrid::engine::forces::BodyParameters;
use demhybrid::engine::kernel::compiled;
use demhybrid::engine::simulation::{Counts, Frame, Outcome, Physics, Simulation, parameters};
use demhybrid::error::Error;
use demhybrid::math::vector::Vec3;
use demhybrid::model::contact::{Rebound, Tangential};
use demhybrid::scene::initial_condition::{self, InitialCondition};
use demhybrid::scene::{Scene, effects};
use demhybrid::studies::job_pool::run::FrameData;
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// The material of Tab. 4.2 without friction. The tolerance is tight: 1e-9 (m/s, m/s^2) of error rate makes
/// at most 3e-10 of error a second before the motion amplifies it. Surfaces interact up to 0.2 m, where the
/// force is 1e-12 N: its jump there is below that tolerance and costs no steps.
const TIGHT: &str = "
    t_end = 1.0
    particles = { radius = 0.1, mass = 1, file = 'bodies of the test' }
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
                dissipation_focusing = 10.0, interaction_distance = 0.2 }
    solver = { method = 'merson', norm = 'paper', tolerance = 1e-9, initial_step = 1e-4 }
";

/// A scene and its particles, put together in the words of the scene file.
#[derive(Debug, Clone)]
pub struct Case {
    name: String,
    text: String,
    sets: Vec<String>,
    walls: Vec<String>,
    start: InitialCondition,
}

impl Case {
    /// No particle yet, no walls, no gravity, the material of Tab. 4.2 without friction, tight tolerance.
    pub fn tight() -> Self {
        Self::from_text("test.toml", TIGHT)
    }

    /// No particle yet, no walls, no gravity, the material of Tab. 4.2 without friction, the default solver.
    pub fn defaults() -> Self {
        let (scene, _) = TIGHT.split_once("    solver").unwrap();
        Self::from_text("test.toml", scene)
    }

    /// A scene of the folder `configs`.
    pub fn config(name: &str) -> Self {
        let path = root().join("configs").join(name);
        Self::from_text(name, &std::fs::read_to_string(path).unwrap())
    }

    fn from_text(name: &str, text: &str) -> Self {
        let (sets, walls) = (Vec::new(), Vec::new());
        Case { name: name.into(), text: text.into(), sets, walls, start: InitialCondition::default() }
    }

    /// Overrides `key`, as `--set` does.
    pub fn set(mut self, key: &str, value: impl std::fmt::Debug) -> Self {
        self.sets.push(format!("{key}={value:?}"));
        self
    }

    /// Overrides a key by the text of a `--set`.
    pub fn raw(mut self, set: &str) -> Self {
        self.sets.push(set.to_owned());
        self
    }

    /// Gravity of 9.81 m/s^2 down z.
    pub fn heavy(self) -> Self {
        self.set("gravity", [0.0, 0.0, -9.81])
    }

    /// Friction of Tab. 4.2.
    pub fn rough(self, rotation: bool) -> Self {
        self.set("friction.coefficient", 0.2)
            .set("friction.regularization_velocity", 0.01)
            .set("friction.rotation", rotation)
    }

    /// The floor z = 0.
    pub fn floor(self) -> Self {
        self.wall(Vec3::zeros(), -Vec3::z())
    }

    /// A plane through `point` (m) with the outward `normal`.
    pub fn wall(mut self, point: Vec3, normal: Vec3) -> Self {
        let [point, normal]: [[f64; 3]; 2] = [point.into(), normal.into()];
        self.walls.push(format!("{{ point = {point:?}, normal = {normal:?} }}"));
        self
    }

    /// A sphere at `x` (m) with velocity `v` (m/s).
    pub fn sphere(self, x: Vec3, v: Vec3) -> Self {
        self.spinning_sphere(x, v, Vec3::zeros())
    }

    /// A sphere at `x` (m) with velocity `v` (m/s) and angular velocity `omega` (rad/s).
    pub fn spinning_sphere(mut self, x: Vec3, v: Vec3, omega: Vec3) -> Self {
        self.start.x.push(x.into());
        self.start.v.push(v.into());
        self.start.omega.push(omega.into());
        self
    }

    /// The checked scene and its particles: those of the case, else those of the scene's grid or file.
    pub fn build(&self) -> (Scene, InitialCondition) {
        let mut sets = self.sets.clone();
        if !self.walls.is_empty() {
            sets.push(format!("container.wall=[{}]", self.walls.join(", ")));
        }
        let scene = Scene::parse(&self.name, &self.text, &sets).unwrap();
        let start = match &scene.particles.grid {
            _ if !self.start.x.is_empty() => self.start.clone(),
            Some(grid) => initial_condition::grid(&scene, grid),
            None => initial_condition::read_csv(&scene, &root().join("configs")).unwrap(),
        };
        initial_condition::check(&scene, &start).unwrap();
        (scene, start)
    }

    /// Runs to the end, which must be reached.
    pub fn run(&self) -> Run {
        self.try_run().unwrap()
    }

    /// Runs to the end or to an error.
    pub fn try_run(&self) -> Result<Run, Error> {
        let (scene, start) = self.build();
        run(&scene, &start)
    }
}

/// The folder of the package.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}

/// All particles at one time, and the work so far.
#[derive(Debug, Clone)]
pub struct Snapshot {
    data: FrameData,
    pub counts: Counts,
}

impl Deref for Snapshot {
    type Target = FrameData;

    fn deref(&self) -> &FrameData {
        &self.data
    }
}

impl Snapshot {
    /// Kinetic and potential energy, J.
    pub fn energy(&self) -> f64 {
        self.kinetic_energy + self.potential_energy
    }

    /// Bits of all positions, velocities and spins.
    pub fn bits(&self) -> Vec<u64> {
        let vectors = self.x.iter().chain(&self.v).chain(&self.omega);
        vectors.flat_map(|vector| vector.iter().map(|number| number.to_bits())).collect()
    }
}

/// What a run gave.
#[derive(Debug)]
pub struct Run {
    /// Every frame, from t = 0 to t_end.
    pub frames: Vec<Snapshot>,
    /// How it went.
    pub outcome: Outcome,
}

impl Run {
    /// The state at t_end.
    pub fn end(&self) -> &Snapshot {
        self.frames.last().unwrap()
    }

    /// Bits of the states of all frames.
    pub fn bits(&self) -> Vec<u64> {
        self.frames.iter().flat_map(Snapshot::bits).collect()
    }
}

/// Runs `scene` with the kernel of its effects.
pub fn run(scene: &Scene, start: &InitialCondition) -> Result<Run, Error> {
    collect(Simulation::new(scene, start, &Solo)?)
}

/// Runs `scene` with a kernel of these effects, whatever its own are. Spheres rotate if `tangential` turns
/// them.
pub fn run_law<R: Rebound, T: Tangential>(
    scene: &Scene,
    start: &InitialCondition,
    rebound: R,
    tangential: T,
) -> Result<Run, Error> {
    run_physics(scene, start, rebound, tangential, parameters(scene))
}

/// `run_law` with spheres that no torque can turn: 1/I = 0.
pub fn run_unturnable<R: Rebound, T: Tangential>(
    scene: &Scene,
    start: &InitialCondition,
    rebound: R,
    tangential: T,
) -> Result<Run, Error> {
    let parameters = BodyParameters { inverse_inertia: 0.0, ..parameters(scene) };
    run_physics(scene, start, rebound, tangential, parameters)
}

fn run_physics<R: Rebound, T: Tangential>(
    scene: &Scene,
    start: &InitialCondition,
    rebound: R,
    tangential: T,
    parameters: BodyParameters,
) -> Result<Run, Error> {
    let law = effects::law(scene);
    let kernel = |set| compiled(law, rebound, tangential, set);
    collect(Simulation::with_physics(scene, start, Physics { kernel: &kernel, parameters }, &Solo)?)
}

fn collect(simulation: Simulation) -> Result<Run, Error> {
    let mut frames = Vec::new();
    let outcome = simulation.run(&mut |frame: &Frame| {
        frames.push(Snapshot { data: frame.into(), counts: frame.counts });
        Ok(())
    })?;
    Ok(Run { frames, outcome })
}

/// Fails unless `found` is within `tolerance` of `exact`, and says what it is.
#[track_caller]
pub fn assert_near(what: &str, found: f64, exact: f64, tolerance: f64) {
    let error = (found - exact).abs();
    assert!(error <= tolerance, "{what}: {found} is not {exact}: off by {error:e}, more than {tolerance:e}");
    println!("{what}: {found} (exact {exact}, off by {error:.1e}, allowed {tolerance:.1e})");
}
