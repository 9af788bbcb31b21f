//! The scene: one TOML text and the `--set` options become a checked description of a run.
//!
//! `source` holds the text, merges `--set` into it, and points messages at their line. `keys` lists every key
//! with its unit and range. `check` checks a merged table against that list, and keys against each other.
//!
//! [`initial_condition`] checks what depends on the positions of particles.

pub mod caveats;
mod check;
mod check_starts;
pub mod contact_scales;
pub mod effects;
pub mod initial_condition;
mod keys;
pub mod materials;
mod schema;
mod source;
pub mod species;
pub mod starts;
pub mod stop;
mod sync_every;
pub mod walls;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::model::effects::FrictionLaw;
use crate::ode::{MethodName, NormName};
pub(crate) use check::cells_along;
use contact_scales::ContactScales;
pub use materials::{Material, MaterialPair};
pub use schema::schema;
use source::Source;
pub use source::split_values;
pub(crate) use source::{brief, shown};
use species::{Mixture, Species, SpeciesBy};
use starts::{Lattice, Random};
pub use sync_every::SyncEvery;

/// A checked scene with all defaults filled in. All numbers are in SI units.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &["particles.radius=0.08".to_owned()])?;
/// assert_eq!(scene.particles.radius, 0.08); // m, as set
/// assert_eq!(scene.t_end, 1.0); // s, from the text
/// assert_eq!(scene.particles.mass, 1.0); // kg, which no scene may leave out
/// assert!(scene.rotates());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Simulated time, s; > 0.
    pub t_end: f64,
    /// Acceleration of gravity, m/s^2.
    #[serde(default)]
    pub gravity: [f64; 3],
    /// The particles and their initial condition.
    pub particles: Particles,
    /// The species whose sizes are drawn; none: all spheres are alike, or a file says how they differ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub species: Vec<Species>,
    /// The walls; none by default.
    #[serde(default)]
    pub container: Container,
    /// The normal force of contacts.
    pub contact: Contact,
    /// The tangential force of contacts; `None`: the basic variant.
    pub friction: Option<Friction>,
    /// What spheres and walls are made of; `[]`: all have the coefficients of `contact` and `friction`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub material: Vec<Material>,
    /// The time integration.
    #[serde(default)]
    pub solver: Solver,
    /// The output file.
    #[serde(default)]
    pub output: Output,
    /// When checkpoints are written; `None`: only when the run is stopped.
    pub checkpoint: Option<Checkpoint>,
    /// Limits that stop the run early.
    pub limits: Option<Limits>,
    /// When the particles count as at rest, which ends the run.
    pub stop: Option<stop::Stop>,
    /// What `contact.overlap` was turned into by [`Scene::settle_contacts`], for those who tell it.
    #[serde(skip)]
    pub scales: Option<ContactScales>,
}

/// The spheres and the source of their initial condition: exactly one of `file`, `run`, `grid`, `random` and
/// `lattice` is `Some`.
///
/// Columns of the file, or species, may give each sphere a radius and a mass of its own. Then radius and mass
/// here are those of a typical sphere, from which scales follow that are left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Radius r of a particle, m; > 0.
    #[serde(default = "left_out")]
    pub radius: f64,
    /// Mass of one particle, kg; > 0. A density gives it as well.
    #[serde(default = "left_out")]
    pub mass: f64,
    /// Density of the particles, kg/m^3; > 0. [`Scene::parse`] turns it into the mass, and leaves `None`
    /// unless there is a file: each of its spheres may have a radius of its own.
    #[serde(default)]
    pub density: Option<f64>,
    /// What the shares of species are shares of; the number of spheres if it is left out.
    #[serde(default)]
    pub species_by: Option<SpeciesBy>,
    /// Seed of the order in which species and sizes are given to spheres; that of the source if it is left
    /// out.
    #[serde(default)]
    pub species_seed: Option<u64>,
    /// CSV file with the initial condition, as the user wrote it.
    ///
    /// It is absolute or relative to the folder of the scene.
    pub file: Option<PathBuf>,
    /// File of another run whose last frame is the initial condition; a path like that of `file`.
    pub run: Option<PathBuf>,
    /// Whether spheres that overlap at the start are pushed apart before the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub push_apart: bool,
    /// Randomly perturbed grid as the initial condition.
    pub grid: Option<Grid>,
    /// Random places without an overlap as the initial condition.
    pub random: Option<Random>,
    /// Hexagonal close packed lattice as the initial condition.
    pub lattice: Option<Lattice>,
}

/// What a scene says about the sizes of its particles, before it is checked: columns of the particle file may
/// say the rest.
#[derive(Debug, Default)]
pub(crate) struct LeftOut {
    /// `particles.file`
    pub file: Option<PathBuf>,
    /// `particles.run`
    pub run: Option<PathBuf>,
    /// `particles.radius`, m
    pub radius: Option<f64>,
    /// Whether there is a `particles.mass` or a `particles.density`.
    pub mass: bool,
    /// `particles.density`, kg/m^3
    pub density: Option<f64>,
}

impl LeftOut {
    /// Arguments and errors as for [`Scene::parse`]; what has the wrong type counts as left out.
    pub(crate) fn of(name: &str, text: &str, sets: &[String]) -> Result<Self, Error> {
        let source = Source::new(name, text, sets);
        let set_texts = source.set_documents()?;
        let table = source.merged(text, &set_texts)?;
        let Ok(table) = toml::Table::deserialize(toml::Deserializer::from(table)) else {
            return Ok(LeftOut::default());
        };
        let Some(particles) = table.get("particles").and_then(toml::Value::as_table) else {
            return Ok(LeftOut::default());
        };
        let number = |key: &str| {
            let value = particles.get(key)?;
            value.as_float().or_else(|| value.as_integer().map(|number| number as f64))
        };
        let text = |key: &str| particles.get(key).and_then(toml::Value::as_str);
        let path = |key: &str| text(key).filter(|text| !text.trim().is_empty()).map(PathBuf::from);
        Ok(LeftOut {
            // Species and a file contradict each other.
            file: path("file").filter(|_| !table.contains_key("species")),
            run: path("run").filter(|_| !table.contains_key("species")),
            radius: number("radius").or_else(|| particles.get("radius").map(|_| f64::NAN)),
            mass: particles.contains_key("mass") || particles.contains_key("density"),
            density: number("density"),
        })
    }
}

/// What a number with a unit is until [`Scene::parse`] gives it a default, which follows from other keys.
const LEFT_OUT: f64 = f64::NAN;

fn left_out() -> f64 {
    LEFT_OUT
}

/// Whether a number still is [`LEFT_OUT`]. By reference, as serde calls it.
fn is_left_out(number: &f64) -> bool {
    number.is_nan()
}

/// The paper's randomly perturbed grid (Fig. 4.2a), filled layer by layer from the bottom.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of particles, in 1..=1e9.
    #[serde(default = "usual_count")]
    pub count: u64,
    /// Side of a cubic cell, m; > 0, and no larger than the box in x and y. 2.5 radii if left out.
    #[serde(default = "left_out")]
    pub spacing: f64,
    /// Upper bound of the random shift of a centre along each axis, m; >= 0. A quarter of a radius if left
    /// out.
    #[serde(default = "left_out")]
    pub jitter: f64,
    /// Height of the lower face of the first layer of cells, m. 11 radii above the floor of the box, or above
    /// z = 0 if it has none, if left out.
    #[serde(default = "left_out")]
    pub bottom: f64,
    /// Seed of the random shifts; `Some` after [`Scene::set_seed_if_missing`].
    pub seed: Option<u64>,
}

fn usual_count() -> u64 {
    200
}

/// The walls of a scene.
///
/// Their numbers run over the finite sides of the box (min x, max x, min y, max y, min z, max z), then over
/// `wall`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Container {
    /// A box with sides along the axes.
    pub r#box: Option<BoxSides>,
    /// Further walls: planes of any direction.
    pub wall: Vec<WallPlane>,
}

/// A box given by two opposite corners, with `min < max` on each axis.
///
/// An infinite coordinate leaves that side open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxSides {
    /// Lower corner, m; -inf leaves a side open.
    pub min: [f64; 3],
    /// Upper corner, m; inf leaves a side open. If left out, 10 radii in x and y, and open in z.
    pub max: [f64; 3],
    /// Name of the material of its sides, if they have one.
    pub material: Option<String>,
}

impl Default for BoxSides {
    fn default() -> Self {
        BoxSides { min: [0.0; 3], max: [LEFT_OUT, LEFT_OUT, f64::INFINITY], material: None }
    }
}

/// A plane wall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallPlane {
    /// Any point of the plane, m.
    pub point: [f64; 3],
    /// Outward normal of any length except 0.
    pub normal: [f64; 3],
    /// Name of its material, if it has one.
    pub material: Option<String>,
}

impl Default for WallPlane {
    fn default() -> Self {
        WallPlane { point: [0.0; 3], normal: [0.0, 0.0, -1.0], material: None }
    }
}

/// Parameters of repulsion and rebound, eqs. (2.1)-(2.5).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The largest share of the radius that a load presses in, in place of F_0, kappa and l_max; > 0, below
    /// 1.
    /// `None` after [`Scene::settle_contacts`], which turns it into those three.
    #[serde(default)]
    pub overlap: Option<f64>,
    /// Speed of the hardest impact that counts as such a load, m/s; > 0. Only beside `overlap`.
    #[serde(default)]
    pub drop: Option<f64>,
    /// Repulsion F_0 of surfaces that just touch, N; > 0. It, kappa and l_max are NaN until `overlap` is
    /// turned into them.
    #[serde(default = "left_out", skip_serializing_if = "is_left_out")]
    pub repulsion_at_contact: f64,
    /// Stiffness exponent kappa, 1/m; > 0.
    #[serde(default = "left_out", skip_serializing_if = "is_left_out")]
    pub stiffness_exponent: f64,
    /// Coefficient of restitution e, in 0..=1.
    pub restitution: f64,
    /// Dissipation focusing psi, s/m; > 0. 10/sqrt(g r) if left out.
    #[serde(default = "left_out")]
    pub dissipation_focusing: f64,
    /// Gap l_max beyond which surfaces do not interact, m; > 0.
    #[serde(default = "left_out", skip_serializing_if = "is_left_out")]
    pub interaction_distance: f64,
}

/// Parameters of friction, eqs. (2.6)-(2.10), or with memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// The law of friction.
    #[serde(default)]
    pub law: FrictionLaw,
    /// Friction coefficient: phi of the paper's law, mu of the law with memory; >= 0.
    pub coefficient: f64,
    /// Slip v_min from which the paper's friction has its full strength, m/s; > 0. 0.01 sqrt(g r) if left
    /// out.
    #[serde(default)]
    pub regularization_velocity: Option<f64>,
    /// Tangential over normal stiffness of the law with memory; > 0. [`DEFAULT_STIFFNESS_RATIO`] if left out.
    #[serde(default)]
    pub stiffness_ratio: Option<f64>,
    /// Damping of the law with memory, a share of critical; >= 0. [`DEFAULT_DAMPING`] if left out.
    #[serde(default)]
    pub damping: Option<f64>,
    /// Whether friction rotates the particles.
    #[serde(default = "turning")]
    pub rotation: bool,
    /// Resistance to rolling. It needs the law with memory and rotation.
    #[serde(default)]
    pub rolling: Option<Resistance>,
    /// Resistance to twisting. It needs the law with memory and rotation.
    #[serde(default)]
    pub twisting: Option<Resistance>,
}

/// Resistance to rolling or to twisting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resistance {
    /// Largest moment over the normal force at rest and the reduced radius; >= 0.
    pub coefficient: f64,
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
    /// Bound on the error of a step in the norm; > 0.
    ///
    /// [`crate::engine::simulation::tolerance`] gives the default. With the paper's friction, the brake of
    /// which decides it, it stays `None` after [`Scene::parse`] if it is left out, and where the step is
    /// fixed.
    pub tolerance: Option<f64>,
    /// The norm in which the error of a step is measured.
    pub norm: NormName,
    /// Speed with which the scaled norm compares errors of velocity, m/s; > 0.
    ///
    /// [`initial_condition::velocity_scale`] gives the default.
    pub velocity_scale: Option<f64>,
    /// The stabilised method leaves out contacts with a repulsion below this force, N; >= 0 and below F_0.
    ///
    /// [`crate::engine::simulation::neglected_force`] gives the default.
    pub neglected_force: Option<f64>,
    /// Fixed step of velocity-verlet, s; > 0. `Some` for that method only.
    pub step: Option<f64>,
    /// Largest first trial step, s; > 0.
    pub initial_step: f64,
    /// Smallest step, s; > 0.
    pub min_step: f64,
    /// Largest step, s; >= `min_step`. It may be infinite.
    pub max_step: f64,
}

/// Tangential over normal stiffness of friction with memory in a scene that does not give it.
pub const DEFAULT_STIFFNESS_RATIO: f64 = 0.5;

/// Damping of friction with memory, a share of critical, in a scene that does not give it.
pub const DEFAULT_DAMPING: f64 = 1.0;

/// Tolerance of a scene that does not give one, at most.
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

/// The output file. `file` and `interval` are `Some` after [`Scene::parse`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Output {
    /// Path of the output file, absolute or relative to the working folder.
    pub file: Option<PathBuf>,
    /// Simulated time between frames, s; > 0.
    pub interval: Option<f64>,
    /// Whether the energy that contacts dissipate is integrated and written to the file.
    pub energy: bool,
    /// How often frames are forced to the disk.
    pub sync: SyncEvery,
}

/// When checkpoints are written. At least one of the two is `Some`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Checkpoint {
    /// Simulated time between two checkpoints, s; > 0.
    pub interval: Option<f64>,
    /// Wall time between two checkpoints, s; > 0.
    pub wall: Option<f64>,
}

/// Limits that stop the run early.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Wall time after which the run writes a checkpoint and stops, s; > 0.
    pub wall: Option<f64>,
}

impl Scene {
    /// Reads and checks a scene.
    ///
    /// `name` is the path of the scene as the user typed it, for messages and for the name of the output
    /// file. `text` is its content. `sets` are the KEY=VALUE of all `--set` options, in order. Tables of
    /// species are read, relative to the folder of `name`.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    ///
    /// let mistake = Scene::parse("a.toml", "t_end = -1.0", &[]).unwrap_err();
    /// let text = mistake.to_string();
    /// assert!(text.starts_with("a.toml:1: t_end = -1.0 must be"), "{text}"); // where and what
    /// assert_eq!(mistake.exit_code(), 2);
    /// ```
    pub fn parse(name: &str, text: &str, sets: &[String]) -> Result<Scene, Error> {
        let folder = Path::new(name).parent().unwrap_or(Path::new(""));
        Scene::parse_in(folder, name, text, sets)
    }

    /// [`Scene::parse`] for a scene in another `folder` than its `name` says.
    pub fn parse_in(folder: &Path, name: &str, text: &str, sets: &[String]) -> Result<Scene, Error> {
        Scene::parse_with(folder, name, text, sets, &|table| species::read(table, folder))
    }

    /// [`Scene::parse_in`] where `read` gives the text of a table that a species names.
    pub(crate) fn parse_with(
        folder: &Path,
        name: &str,
        text: &str,
        sets: &[String],
        read: &dyn Fn(&Path) -> Result<String, Error>,
    ) -> Result<Scene, Error> {
        let mut source = Source::new(name, text, sets);
        let set_texts = source.set_documents()?;
        let table = source.merged(text, &set_texts)?;
        check::keys_and_values(&mut source, table.get_ref())?;
        let mut scene = Scene::deserialize(toml::Deserializer::from(table))
            .map_err(|mistake| source.error(mistake.span(), mistake.message()))?;
        species::check::settle(&source, &mut scene, folder, read)?;
        check::one_radius(&source, &scene)?;
        scene.fill_in_mass();
        scene.fill_in_lengths();
        scene.fill_in_speeds();
        scene.fill_in_output(name);
        scene.fill_in_tolerance();
        let remembers = scene.friction.as_ref().is_some_and(|friction| friction.law == FrictionLaw::History);
        if remembers && source.key("solver.norm").is_none() {
            scene.solver.norm = NormName::Mean;
        }
        check::relations(&source, &scene)?;
        Ok(scene)
    }

    /// Fills in `seed` if the scene gives none.
    ///
    /// It must be the same on all ranks: rank 0 draws it and broadcasts it.
    pub fn set_seed_if_missing(&mut self, seed: u64) {
        if let Some(own) = self.particles.seed_mut() {
            own.get_or_insert(seed);
        }
    }

    /// The scene as TOML with all defaults written out. Parsing it gives an equal scene, under any name.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?;
    /// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
    /// assert_eq!(Scene::parse("other.toml", &scene.resolved(), &[])?, scene);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn resolved(&self) -> String {
        let why = "a scene holds only tables, numbers, switches and text that came from TOML";
        if self.particles.density.is_none() {
            return toml::to_string(self).expect(why);
        }
        let mut table = toml::Table::try_from(self).expect(why);
        if let Some(particles) = table.get_mut("particles").and_then(toml::Value::as_table_mut) {
            // One of the two says how heavy the particles are.
            particles.remove("mass");
        }
        table.to_string()
    }

    /// Whether particles rotate: the scene has friction with rotation, and its coefficient is not 0.
    pub fn rotates(&self) -> bool {
        self.friction.as_ref().is_some_and(|friction| friction.rotation) && self.rubs()
    }

    /// The largest radius of a sphere, m; where a file has the spheres, that of a typical one.
    fn largest_radius(&self) -> f64 {
        let drawn = Mixture::of(self).zip(self.particles.count());
        drawn.map_or(self.particles.radius, |(mixture, count)| mixture.range(count)[1])
    }

    /// The volume of `count` spheres together, m^3.
    fn volume_of(&self, count: u64) -> f64 {
        let alike = || count as f64 * initial_condition::mass_of(self.particles.radius, 1.0);
        Mixture::of(self).map_or_else(alike, |mixture| mixture.volume(count))
    }

    /// A density gives the mass of a sphere.
    fn fill_in_mass(&mut self) {
        let Particles { radius, mass, density, file, .. } = &mut self.particles;
        if let Some(density) = if file.is_some() { *density } else { density.take() } {
            *mass = initial_condition::mass_of(*radius, density);
        }
    }

    /// Lengths that are left out follow from the radius: a bed of spheres of any size is the same bed. Of
    /// species the largest sphere counts.
    fn fill_in_lengths(&mut self) {
        let r = self.largest_radius();
        let fill_in = |length: &mut f64, default: f64| {
            if length.is_nan() {
                // A scene of any radius can be written with its lengths.
                *length = default.min(f64::MAX);
            }
        };
        let mut floor = 0.0;
        if let Some(sides) = &mut self.container.r#box {
            sides.max.iter_mut().for_each(|max| fill_in(max, 10.0 * r));
            floor = Some(sides.min[2]).filter(|floor| floor.is_finite()).unwrap_or(0.0);
        }
        if let Some(grid) = &mut self.particles.grid {
            fill_in(&mut grid.spacing, 2.5 * r);
            fill_in(&mut grid.jitter, 0.25 * r);
            fill_in(&mut grid.bottom, floor + 11.0 * r);
        }
        if let Some(lattice) = &mut self.particles.lattice {
            fill_in(&mut lattice.spacing, 2.02 * r);
            fill_in(&mut lattice.bottom, floor);
        }
    }

    fn fill_in_tolerance(&mut self) {
        let braked = self.friction.as_ref().is_some_and(|f| f.law == FrictionLaw::Regularized);
        let solver = &mut self.solver;
        // The brake of the paper's friction, the speeds and the number of spheres decide it, see
        // [`crate::engine::simulation::tolerance`].
        let decided_later = braked && solver.norm != NormName::Paper;
        if solver.step.is_none() && !decided_later {
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
        particles = { radius = 0.1, mass = 1, file = 'start.csv' }
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
        assert_eq!((scene.output.interval, scene.output.sync), (Some(0.08), SyncEvery::Seconds(1.0)));
    }

    #[test]
    fn a_density_gives_the_mass_and_is_recorded_where_spheres_of_a_file_may_differ() {
        let of_file = SHORT.replace("mass = 1,", "density = 2500,");
        assert_ne!(of_file, SHORT);
        let of_grid = of_file.replace("file = 'start.csv'", "grid = {}");
        for (text, recorded) in [(of_file, "density"), (of_grid, "mass")] {
            let scene = Scene::parse("dense.toml", &text, &["container.box={}".to_owned()]).unwrap();
            // Spheres of 0.1 m.
            assert!((scene.particles.mass - 10.471_975_511_965_978).abs() < 1e-14);
            let resolved = scene.resolved();
            let other = if recorded == "mass" { "density" } else { "mass" };
            assert!(resolved.contains(recorded) && !resolved.contains(other), "{resolved}");
            assert_eq!(Scene::parse("again.toml", &resolved, &[]).unwrap(), scene);
        }
    }

    #[test]
    fn lengths_that_are_left_out_follow_from_the_radius() {
        let text = SHORT.replace("file = 'start.csv'", "grid = {}");
        let of = |sets: &[&str]| {
            let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
            let scene = Scene::parse("grid.toml", &text, &sets).unwrap();
            let (grid, sides) = (scene.particles.grid.unwrap(), scene.container.r#box.unwrap());
            (grid.count, [grid.spacing, grid.jitter, grid.bottom], sides.max)
        };
        let paper = (200, [0.25, 0.025, 1.1], [1.0, 1.0, f64::INFINITY]);
        assert_eq!(of(&["container.box={}"]), paper);
        let (_, lengths, max) = of(&["container.box={}", "particles.radius=0.0078125"]);
        // Powers of two: the products are exact.
        assert_eq!(lengths, [0.25, 0.025, 1.1].map(|length| length * 0.078125));
        assert_eq!(max, [0.078125, 0.078125, f64::INFINITY]);
        let (_, [_, _, bottom], _) = of(&["container.box={ min = [0, 0, 2] }"]);
        assert_eq!(bottom, 3.1);
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
            "output.sync=end",
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
