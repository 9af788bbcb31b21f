//! Checks where the spheres of a scene start: one source, and room for it.

use super::check::cells_along;
use super::initial_condition::room::Room;
use super::source::{Source, Span};
use super::starts::{LARGEST_FRACTION, Lattice, Random, Region};
use super::{Container, Scene};
use crate::error::Error;
use crate::math::digits::short;

/// Checks that there is one source, and that its keys fit the radius and the container.
pub(super) fn starts(source: &Source, scene: &Scene) -> Result<(), Error> {
    let Scene { particles, container, .. } = scene;
    one_source(source, scene)?;
    if particles.run.is_some()
        && let Some(density) = source.key("particles.density")
    {
        let message = "particles.density and particles.run contradict each other: the run says how heavy \
                       each sphere is, so density must be left out";
        return Err(source.error(Some(density), message));
    }
    if let Some(grid) = &particles.grid {
        room_for_cells(source, container, "particles.grid", ("one cell of the grid", grid.spacing))?;
    }
    if let Some(lattice) = &particles.lattice {
        spacing_of_lattice(source, lattice, scene.largest_radius())?;
        room_for_cells(
            source,
            container,
            "particles.lattice",
            ("one sphere of the lattice", lattice.spacing),
        )?;
    }
    match &particles.random {
        Some(random) => room_for_random(source, scene, random),
        None => Ok(()),
    }
}

fn one_source(source: &Source, scene: &Scene) -> Result<(), Error> {
    let given = scene.particles.sources().into_iter().filter(|(_, there)| *there).map(|(key, _)| key);
    let given: Vec<&str> = given.collect();
    let example = "file = \"start.csv\" or [particles.grid]";
    match &given[..] {
        [_] => Ok(()),
        [] => Err(source.error(
            source.key("particles"),
            &format!(
                "particles.file or particles.grid is missing: one of them must say where the spheres start, \
                 {example}; particles.random, particles.lattice or particles.run do so too"
            ),
        )),
        [first, second, ..] => Err(source.error(
            source.key(first),
            &format!(
                "{first} and {second} contradict each other: exactly one says where the spheres start, \
                 such as {example}"
            ),
        )),
    }
}

/// Checks that the box is finite in x and y, and at least as wide there as one cell of the source `key`. A
/// cell has a name for messages, and a width (m).
fn room_for_cells(
    source: &Source,
    container: &Container,
    key: &str,
    (cell, spacing): (&str, f64),
) -> Result<(), Error> {
    let Some(sides) = &container.r#box else {
        let message = format!(
            "{key} needs container.box with finite sides in x and y, which is missing, e.g. box = {{ min = \
             [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] }} under [container]"
        );
        return Err(source.error(source.key(key), &message));
    };
    for (axis, (min, max)) in ["x", "y"].into_iter().zip(sides.min.into_iter().zip(sides.max)) {
        for (corner, value) in [("min", min), ("max", max)] {
            if value.is_infinite() {
                let path = format!("container.box.{corner}");
                let span = source.value(&path).or_else(|| source.key(key));
                let message =
                    format!("{path} is {value} in {axis}: {key} needs a box that is finite in x and y");
                return Err(source.error(span, &message));
            }
        }
        let side = max - min;
        if cells_along(side, spacing) == 0 {
            let path = format!("{key}.spacing");
            let message = format!(
                "{} is larger than the side of container.box in {axis}, {} m: not {cell} fits in, it must be \
                 at most that",
                source.assignment(&path, spacing, "m"),
                short(side)
            );
            let span = source.value(&path).or_else(|| source.value("container.box.max"));
            return Err(source.error(span.or_else(|| source.key(key)), &message));
        }
    }
    Ok(())
}

fn spacing_of_lattice(source: &Source, lattice: &Lattice, r: f64) -> Result<(), Error> {
    let span = source.value("particles.lattice.spacing");
    if span.is_none() || lattice.spacing >= 2.0 * r {
        return Ok(());
    }
    let message = format!(
        "{} is less than 2 radii, so that spheres would overlap: it is the distance of their centres and \
         must be {} m or more, or left out",
        source.assignment("particles.lattice.spacing", lattice.spacing, "m"),
        short(2.0 * r)
    );
    Err(source.error(span, &message))
}

/// Checks fraction and region, and that the spheres fit in.
fn room_for_random(source: &Source, scene: &Scene, random: &Random) -> Result<(), Error> {
    if random.fraction.is_some_and(|fraction| fraction > LARGEST_FRACTION) {
        let span = source.value("particles.random.fraction");
        let written = span.as_ref().map(|span| source.written(span)).unwrap_or_default();
        let message = format!(
            "particles.random.fraction = {written} is outside 0..{LARGEST_FRACTION}: it is the volume of the \
             spheres over that of the room that they take, and random spheres of one size jam beyond 0.6"
        );
        return Err(source.error(span, &message));
    }
    if let Some(region) = &random.region {
        sides_of_region(source, scene, region)?;
    }
    let r = scene.largest_radius();
    let at = |key: &str| -> Option<Span> {
        let table = "particles.random";
        let path = if key.is_empty() { table.to_owned() } else { format!("{table}.{key}") };
        source
            .value(&path)
            .filter(|_| !key.is_empty())
            .or_else(|| source.key(&path))
            .or_else(|| source.key(table))
    };
    match Room::of(&scene.container, random, scene.volume_of(random.count), r) {
        Ok(_) => Ok(()),
        Err(no) if no.key == "region" => {
            Err(source.error(source.key("particles.random.region").or_else(|| at("")), &no.why))
        }
        Err(no) => Err(source.error(at(no.key), &no.why)),
    }
}

fn sides_of_region(source: &Source, scene: &Scene, region: &Region) -> Result<(), Error> {
    let r = scene.largest_radius();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let (min, max) = (region.min[axis], region.max[axis]);
        let (span_min, span_max) =
            (source.value("particles.random.region.min"), source.value("particles.random.region.max"));
        if min == f64::INFINITY || max == f64::NEG_INFINITY || min >= max {
            let message = format!(
                "particles.random.region is empty in {name}: particles.random.region.min = {} m must be less \
                 than particles.random.region.max = {} m",
                short(min),
                short(max)
            );
            return Err(source.error(span_max, &message));
        }
        let sides = scene.container.r#box.as_ref();
        let beyond = sides.and_then(|sides| {
            let low =
                (min.is_finite() && min < sides.min[axis]).then_some(("min", min, sides.min[axis], span_min));
            let high = (max.is_finite() && max > sides.max[axis]).then_some((
                "max",
                max,
                sides.max[axis],
                span_max.clone(),
            ));
            low.or(high)
        });
        if let Some((corner, value, side, span)) = beyond {
            let message = format!(
                "particles.random.region.{corner} = {} m is outside container.box in {name}, which ends at \
                 {} m: it must be within",
                short(value),
                short(side)
            );
            return Err(source.error(span, &message));
        }
        if max - min < 2.0 * r * (1.0 - 1e-9) {
            let message = format!(
                "particles.random.region is {} m wide in {name}, too narrow for one sphere: it must be {} \
                 m or more, 2 radii",
                short(max - min),
                short(2.0 * r)
            );
            return Err(source.error(span_max, &message));
        }
    }
    Ok(())
}
