//! Scenes and starts for the tests of reports.

use crate::model::columns::{MASS, RADIUS};
use crate::scene::Scene;
use crate::scene::initial_condition::{InitialCondition, column};

/// `configs/paper/settle.toml` with `sets`.
pub fn scene(sets: &[&str]) -> Scene {
    let text = include_str!("../../../configs/paper/settle.toml");
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Scene::parse("settle.toml", text, &sets).unwrap()
}

/// Spheres at rest at `x` (m) with these radii (m) and masses (kg).
pub fn sized<const N: usize>(x: Vec<[f64; 3]>, radii: [f64; N], masses: [f64; N]) -> InitialCondition {
    let still = vec![[0.0; 3]; x.len()];
    let columns = vec![(column(RADIUS, "m"), radii.to_vec()), (column(MASS, "kg"), masses.to_vec())];
    InitialCondition { x, v: still.clone(), omega: still, columns, ..InitialCondition::default() }
}
