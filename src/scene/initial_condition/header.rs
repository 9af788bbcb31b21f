//! What the names in the first line of a particle file may mean.

use super::file::{CENTRE, SPIN, VELOCITY};
use super::sizes::COLUMNS;
use crate::model::columns::{MATERIAL, SPECIES};
use crate::scene::brief;

/// Names that other programs give the three vectors, in lower case and without anything but letters.
const CENTRES: [&str; 9] =
    ["", "pos", "position", "point", "points", "centre", "center", "coord", "coordinate"];
const VELOCITIES: [&str; 4] = ["v", "vel", "velocity", "u"];
const SPINS: [&str; 7] = ["av", "w", "om", "omega", "spin", "angvel", "angularvelocity"];

/// The column that `name` most likely means: `vx` for `velocity_x`, `x` for `Points:0` and for `X [m]`.
pub(super) fn likely(name: &str) -> Option<&'static str> {
    let without_unit = name.split(['(', '[', '/']).next().unwrap_or_default();
    let plain: String = without_unit.to_lowercase().chars().filter(char::is_ascii_alphanumeric).collect();
    let with_axis_last = || {
        let axis = plain.chars().last()?;
        let stem = &plain[..plain.len() - 1];
        // A digit alone names no centre.
        "xyz".find(axis).or_else(|| "012".find(axis).filter(|_| !stem.is_empty())).map(|axis| (stem, axis))
    };
    let with_axis_first = || {
        let axis = "xyz".find(plain.chars().next()?)?;
        // A single letter may be anything: `xu` is a place in LAMMPS.
        Some((&plain[1..], axis)).filter(|(stem, _)| stem.len() > 1)
    };
    [with_axis_last(), with_axis_first()].into_iter().flatten().find_map(|(stem, axis)| {
        let vectors = [(&CENTRES[..], CENTRE), (&VELOCITIES, VELOCITY), (&SPINS, SPIN)];
        let (_, columns) = vectors.into_iter().find(|(names, _)| names.contains(&stem))?;
        Some(columns.names[axis])
    })
}

/// How columns of `header` must be named, so that the ones of `absent` are there; empty if none is like them.
pub(super) fn renamed(header: &[String], absent: &[&str]) -> String {
    let meant = |name: &String| likely(name).filter(|column| absent.contains(column));
    let pairs: Vec<_> = header
        .iter()
        .filter_map(|name| Some(format!("\"{}\" must be named {}", brief(name), meant(name)?)))
        .take(absent.len())
        .collect();
    pairs.join(", ")
}

/// The columns of `header` that nobody reads, each with a hint where there is one. A column without a name is
/// none.
pub(super) fn unread(header: &[String]) -> Vec<String> {
    let vectors = [CENTRE, VELOCITY, SPIN];
    let sizes = COLUMNS.iter().map(|(name, _)| *name).chain([SPECIES, MATERIAL]);
    let read: Vec<&str> = vectors.iter().flat_map(|columns| columns.names).chain(sizes).collect();
    let is_there = |column: &str| header.iter().any(|name| name == column);
    let described = |name: &String| {
        let hint = match (name.as_str(), likely(name).filter(|column| !is_there(column))) {
            ("id", _) => " (the order of rows gives ids)".to_owned(),
            (_, Some(column)) => format!(" (named {column} it would be read)"),
            _ => String::new(),
        };
        brief(name) + &hint
    };
    header.iter().filter(|name| !name.is_empty() && !read.contains(&name.as_str())).map(described).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_are_understood() {
        for (name, column) in [
            ("Points:0", "x"),
            ("Points_2", "z"),
            ("X [m]", "x"),
            ("y (m)", "y"),
            ("z/m", "z"),
            ("position_x", "x"),
            ("x_position", "x"),
            ("Center.Y", "y"),
            ("vel_x", "vx"),
            ("velocity:1", "vy"),
            ("v_z [m/s]", "vz"),
            ("wx", "avx"),
            ("omega_y", "avy"),
            ("angular_velocity:2", "avz"),
        ] {
            assert_eq!(likely(name), Some(column), "{name}");
        }
        for name in ["radius", "mass", "id", "0", "", "x0", "colour", "\u{e4}", "matrix", "1", "xu"] {
            assert_eq!(likely(name), None, "{name}");
        }
    }

    #[test]
    fn what_nobody_reads_is_named_with_a_hint_where_there_is_one() {
        let header = ["x", "y", "z", "wx", "radius", "tag", "", "X"].map(str::to_owned);
        assert_eq!(unread(&header), ["wx (named avx it would be read)", "tag", "X"]);
    }
}
