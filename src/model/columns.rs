//! What a particle carries: a table of columns.
//!
//! The columns that change at every stage of a step make up its state: position, velocity and, if the scene
//! has rotation, angular velocity. All columns of one particle are adjacent in memory: they are a row.
//!
//! Further columns stay the same during a step. They travel between ranks only when neighbour lists are
//! built.

use crate::math::vector::{Vec3, vector};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Columns of the position in the state, m.
pub const POSITION: Range<usize> = 0..3;
/// Columns of the velocity in the state, m/s.
pub const VELOCITY: Range<usize> = 3..6;
/// Columns of the angular velocity in the state, rad/s; only with rotation.
pub const SPIN: Range<usize> = 6..9;

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

/// The angular velocity in a row of the state, rad/s; zero without rotation.
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
/// });
/// assert_eq!(columns.find("velocity"), Some((Changes::EveryStage, 3..6)));
/// assert_eq!(columns.find("tag"), Some((Changes::WithLists, 0..1)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Columns(Vec<Column>);

impl Columns {
    /// Position and velocity and, with `rotation`, angular velocity.
    pub fn new(rotation: bool) -> Self {
        let state = |name: &str, unit: &str| Column {
            name: name.to_owned(),
            width: 3,
            unit: unit.to_owned(),
            changes: Changes::EveryStage,
            in_file: true,
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

    /// Whether the state has an angular velocity.
    pub fn rotation(&self) -> bool {
        self.width(Changes::EveryStage) == SPIN.end
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
    fn columns_are_found_among_those_that_change_like_them() {
        let mut columns = Columns::new(true);
        for (name, width) in [("mass", 1), ("colour", 3)] {
            let (changes, name) = (Changes::WithLists, name.to_owned());
            columns.push(Column { name, width, unit: "1".to_owned(), changes, in_file: true });
        }
        assert_eq!(columns.find("velocity"), Some((Changes::EveryStage, VELOCITY)));
        assert_eq!(columns.find("angular_velocity"), Some((Changes::EveryStage, SPIN)));
        assert_eq!(columns.find("colour"), Some((Changes::WithLists, 1..4)));
        assert_eq!(columns.find("radius"), None);
    }
}
