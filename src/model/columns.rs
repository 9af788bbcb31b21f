//! What a particle carries: a table of columns.
//!
//! The columns that change at every stage of a step make up its state: position, velocity and, if the scene
//! has rotation, spin. All columns of one particle are adjacent in memory: they are a row.
//!
//! The spin is s = r w, the radius times the angular velocity: how fast the surface moves by rotation. The
//! frames of a run, and its file, have the angular velocity w itself in that place.
//!
//! Further columns stay the same during a step. They travel between ranks only when neighbour lists are
//! built.

use crate::math::vector::{Vec3, vector};
use crate::model::size::Size;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Columns of the position in the state, m.
pub const POSITION: Range<usize> = 0..3;
/// Columns of the velocity in the state, m/s.
pub const VELOCITY: Range<usize> = 3..6;
/// Columns of the spin s = r w in the state, m/s; only with rotation. In a frame: angular velocity, rad/s.
pub const SPIN: Range<usize> = 6..9;

/// Name of the column of radii (m), for particles of unequal sizes.
pub const RADIUS: &str = "radius";
/// Name of the column of masses (kg), for particles of unequal sizes.
pub const MASS: &str = "mass";
/// Name of the column of species: numbers from 0 on, each of which stands for a name.
pub const SPECIES: &str = "species";
/// Name of the column of materials: the numbers of the materials of the scene, and one more for none.
pub const MATERIAL: &str = "material";

/// The position in a row of the state, m.
#[inline(always)]
pub fn position(row: &[f64]) -> Vec3 {
    vector(&row[POSITION])
}

/// The velocity in a row of the state, m/s.
#[inline(always)]
pub fn velocity(row: &[f64]) -> Vec3 {
    vector(&row[VELOCITY])
}

/// The spin s = r w in a row of the state, m/s; zero without rotation. In a row of a frame it is the angular
/// velocity, rad/s.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::columns::{position, spin, velocity};
///
/// let row = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]; // a scene without rotation
/// assert_eq!(position(&row), Vec3::new(1.0, 2.0, 3.0));
/// assert_eq!(velocity(&row), Vec3::new(0.1, 0.2, 0.3));
/// assert_eq!(spin(&row), Vec3::zeros());
/// ```
#[inline(always)]
pub fn spin(row: &[f64]) -> Vec3 {
    row.get(SPIN).map_or_else(Vec3::zeros, vector)
}

/// Replaces the angular velocities w in rows of `width` numbers by spins r w, with the radius of each row.
///
/// Without rotation it does nothing.
pub fn put_spins(rows: &mut [f64], width: usize, r: impl Fn(usize) -> f64) {
    each_spin(rows, width, |i, w| r(i) * w);
}

/// Replaces the spins s in rows of `width` numbers by angular velocities s/r, with the radius of each row.
///
/// Without rotation it does nothing.
pub fn put_angular_velocities(rows: &mut [f64], width: usize, r: impl Fn(usize) -> f64) {
    each_spin(rows, width, |i, s| s / r(i));
}

fn each_spin(rows: &mut [f64], width: usize, of: impl Fn(usize, f64) -> f64) {
    for (i, row) in rows.chunks_exact_mut(width.max(1)).enumerate() {
        if let Some(spin) = row.get_mut(SPIN) {
            spin.iter_mut().for_each(|component| *component = of(i, *component));
        }
    }
}

/// When the numbers of a column change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Changes {
    /// At every stage of a step: the column belongs to the state.
    EveryStage,
    /// Only when neighbour lists are built.
    WithLists,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name, also in the output file.
    pub name: String,
    /// Numbers of one particle.
    pub width: usize,
    /// Its unit.
    pub unit: String,
    /// When its numbers change.
    pub changes: Changes,
    /// Whether it is in the output file.
    pub in_file: bool,
    /// What the numbers 0, 1, ... stand for; empty where they are just numbers.
    #[serde(default)]
    pub names: Vec<String>,
}

/// All columns of the particles of a scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::columns::{Changes, Column, Columns};
///
/// let mut columns = Columns::new(true);
/// assert_eq!(columns.width(Changes::EveryStage), 9); // position, velocity, angular velocity
/// columns.push(Column {
///     name: "tag".to_owned(),
///     width: 1,
///     unit: "1".to_owned(),
///     changes: Changes::WithLists,
///     in_file: true,
///     names: Vec::new(),
/// });
/// assert_eq!(columns.find("velocity"), Some((Changes::EveryStage, 3..6)));
/// assert_eq!(columns.find("tag"), Some((Changes::WithLists, 0..1)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Columns(Vec<Column>);

impl Columns {
    /// Position and velocity and, with `rotation`, angular velocity: what the file has.
    ///
    /// The state has the spin in place of the angular velocity.
    pub fn new(rotation: bool) -> Self {
        let state = |name: &str, unit: &str| Column {
            name: name.to_owned(),
            width: 3,
            unit: unit.to_owned(),
            changes: Changes::EveryStage,
            in_file: true,
            names: Vec::new(),
        };
        let mut columns = vec![state("position", "m"), state("velocity", "m/s")];
        if rotation {
            columns.push(state("angular_velocity", "rad/s"));
        }
        Columns(columns)
    }

    /// Adds a column that changes only when lists are built.
    pub fn push(&mut self, column: Column) {
        debug_assert_eq!(column.changes, Changes::WithLists, "the kernel knows what belongs to the state");
        self.0.push(column);
    }

    /// The columns, in their order.
    pub fn iter(&self) -> impl Iterator<Item = &Column> {
        self.0.iter()
    }

    /// Numbers of one particle in all columns that change like this.
    pub fn width(&self, changes: Changes) -> usize {
        self.0.iter().filter(|column| column.changes == changes).map(|column| column.width).sum()
    }

    /// Whether particles rotate.
    pub fn rotation(&self) -> bool {
        self.width(Changes::EveryStage) == SPIN.end
    }

    /// Whether particles differ in their sizes: then there are columns of radii and of masses.
    pub fn sized(&self) -> bool {
        self.find(RADIUS).is_some()
    }

    /// The sizes in rows of the columns that change only when lists are built; empty where all are alike.
    pub fn sizes(&self, constants: &[f64]) -> Vec<Size> {
        let (Some((_, r)), Some((_, mass))) = (self.find(RADIUS), self.find(MASS)) else { return Vec::new() };
        let rows = constants.chunks_exact(self.width(Changes::WithLists));
        rows.map(|row| Size::new(row[r.start], row[mass.start])).collect()
    }

    /// The materials in rows of the columns that change only when lists are built; empty where nobody has
    /// one.
    pub fn materials(&self, constants: &[f64]) -> Vec<u32> {
        let Some((_, material)) = self.find(MATERIAL) else { return Vec::new() };
        let rows = constants.chunks_exact(self.width(Changes::WithLists));
        rows.map(|row| row[material.start] as u32).collect()
    }

    /// Where the column `name` is: when it changes, and its numbers within a row of all columns that change
    /// like it.
    pub fn find(&self, name: &str) -> Option<(Changes, Range<usize>)> {
        let found = self.0.iter().position(|column| column.name == name)?;
        let Column { changes, width, .. } = self.0[found];
        let alike = self.0[..found].iter().filter(|column| column.changes == changes);
        let start = alike.map(|column| column.width).sum();
        Some((changes, start..start + width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_without_rotation_has_no_angular_velocity() {
        for (rotation, width) in [(false, 6), (true, 9)] {
            let columns = Columns::new(rotation);
            assert_eq!((columns.width(Changes::EveryStage), columns.width(Changes::WithLists)), (width, 0));
            assert_eq!(columns.find("angular_velocity").is_some(), rotation);
            assert_eq!(columns.rotation(), rotation);
        }
        assert_eq!(spin(&[0.0; 6]), Vec3::zeros());
    }

    #[test]
    fn spins_are_the_radius_times_angular_velocities_and_nothing_else_changes() {
        let angular: Vec<f64> = (0..18).map(f64::from).collect();
        let mut rows = angular.clone();
        put_spins(&mut rows, 9, |_| 0.5);
        for (k, (spin, angular)) in rows.iter().zip(&angular).enumerate() {
            let factor = if SPIN.contains(&(k % 9)) { 0.5 } else { 1.0 };
            assert_eq!(*spin, factor * angular);
        }
        put_angular_velocities(&mut rows, 9, |_| 0.5);
        assert_eq!(rows, angular);
        let mut still = angular[..12].to_vec();
        put_spins(&mut still, 6, |_| 0.5);
        assert_eq!(still, angular[..12]);
    }

    #[test]
    fn columns_are_found_among_those_that_change_like_them() {
        let mut columns = Columns::new(true);
        for (name, width) in [("mass", 1), ("colour", 3)] {
            let (changes, name) = (Changes::WithLists, name.to_owned());
            columns.push(Column {
                name,
                width,
                unit: "1".to_owned(),
                changes,
                in_file: true,
                names: Vec::new(),
            });
        }
        assert_eq!(columns.find("velocity"), Some((Changes::EveryStage, VELOCITY)));
        assert_eq!(columns.find("angular_velocity"), Some((Changes::EveryStage, SPIN)));
        assert_eq!(columns.find("colour"), Some((Changes::WithLists, 1..4)));
        assert_eq!(columns.find("radius"), None);
    }
}
