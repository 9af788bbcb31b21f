//! Species: spheres of one kind, with their share, their density and the radii that are drawn for them.
//!
//! `distribution` has the mathematics of radii, [`mixture`] the numbers of spheres of all species, `sieve`
//! reads tables, and `check` holds what a scene says against what is possible.

pub(super) mod check;
mod distribution;
pub mod mixture;
mod sieve;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Value;

pub(super) use check::WIDEST;
pub use distribution::{Curve, Distribution};
pub use mixture::Mixture;
pub(crate) use sieve::read;

/// One species.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Species {
    /// Its name.
    pub name: String,
    /// Its share of all spheres by [`SpeciesBy`]; 1 if it is left out, which one species alone may do.
    pub share: Option<f64>,
    /// Density, kg/m^3; > 0. `Some` after [`super::Scene::parse`]: that of the scene if it is left out.
    pub density: Option<f64>,
    /// Name of the material of its spheres; a material of the name of the species if it is left out, if there
    /// is one.
    #[serde(default)]
    pub material: Option<String>,
    /// Its radii, m.
    pub radius: Radius,
}

impl Species {
    /// The file of its sieve curve, if it has one: absolute or relative to the folder of the scene.
    pub fn table(&self) -> Option<&Path> {
        match &self.radius {
            Radius::Spread(Spread { table, .. }) => table.as_deref(),
            Radius::One(_) => None,
        }
    }
}

/// What the shares of species are shares of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SpeciesBy {
    /// Of the number of spheres.
    #[default]
    Number,
    /// Of the volume of all spheres.
    Volume,
    /// Of the mass of all spheres.
    Mass,
}

impl SpeciesBy {
    /// The names that a scene may give.
    pub const NAMES: &[&str] = &["number", "volume", "mass"];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// The radii of a species: one for all, or how they are spread.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::species::Radius;
///
/// // A scene whose spheres have no radius and no mass of their own.
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let text = text.replace("radius = ", "# ").replace("mass = ", "# ");
/// let of = |radius: &str| {
///     let species = format!("species=[{{ name = 'a', density = 1000, radius = {radius} }}]");
///     Scene::parse("quick.toml", &text, &[species]).map(|scene| scene.species[0].radius.clone())
/// };
/// assert_eq!(of("0.05")?, Radius::One(0.05)); // m
/// let Radius::Spread(spread) = of("{ uniform = [0.05, 0.1] }")? else { panic!() };
/// assert_eq!(spread.uniform, Some([0.05, 0.1])); // m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Value", into = "Value")]
pub enum Radius {
    /// All have this radius, m.
    One(f64),
    /// They differ.
    Spread(Spread),
}

/// How radii are spread: one of the keys, or a table with the points that were read from it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// The least and the largest radius, m, and all between are equally frequent.
    pub uniform: Option<[f64; 2]>,
    /// Mean (m), standard deviation (m), least and largest radius (m) of a normal distribution by number.
    pub normal: Option<[f64; 4]>,
    /// Median (m), standard deviation of ln r, least and largest radius (m) of a lognormal distribution by
    /// number.
    pub lognormal: Option<[f64; 4]>,
    /// CSV file of a sieve curve, as the user wrote it: absolute or relative to the folder of the scene.
    pub table: Option<PathBuf>,
    /// A sieve curve: radii (m), each with the share of the mass below it. `Some` where there is a table,
    /// after [`super::Scene::parse`]: so the scene in the file of a run needs no other file.
    pub points: Option<Vec<[f64; 2]>>,
}

/// The check of keys and values gives the message for a scene. It comes before this.
impl TryFrom<Value> for Radius {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value {
            Value::Integer(radius) => Ok(Radius::One(radius as f64)),
            Value::Float(radius) => Ok(Radius::One(radius)),
            Value::Table(table) => table.try_into().map(Radius::Spread).map_err(|why| why.to_string()),
            other => Err(format!("{other} is no number and no table")),
        }
    }
}

impl From<Radius> for Value {
    fn from(radius: Radius) -> Value {
        match radius {
            Radius::One(radius) => radius.into(),
            Radius::Spread(spread) => {
                Value::try_from(spread).expect("a spread holds numbers and text that came from TOML")
            }
        }
    }
}
