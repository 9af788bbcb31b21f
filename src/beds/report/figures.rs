//! The figures of a report.

use std::path::Path;

use super::classes;
use super::measured::Measured;
use crate::beds::measures::contacts::{Contact, Partner, between_spheres};
use crate::beds::measures::row::Row;
use crate::beds::plot::{Line, series};
use crate::error::Error;
use crate::files::names::Series;

/// Number of bins in a distribution.
const BINS: usize = 30;

/// A figure that was drawn.
pub struct Figure {
    /// Name of its file.
    pub file: String,
    /// What it shows.
    pub caption: &'static str,
}

/// Draws all figures that have data.
pub fn draw(folder: &Path, run: &str, measured: &Measured) -> Result<Vec<Figure>, Error> {
    let mut drawn = Vec::new();
    let time = measured.column(Series::Time).unwrap_or_default();
    let over_time = |name: &str, values: &[f64]| Line {
        name: name.to_owned(),
        points: time.iter().copied().zip(values.iter().copied()).collect(),
    };
    let of = |shown: &[(Series, &str)]| -> Vec<Line> {
        let line = |&(series, name): &(Series, &str)| Some(over_time(name, measured.column(series)?));
        shown.iter().filter_map(line).collect()
    };
    let mut figure = |file: &str, caption: &'static str, [x, y]: [&str; 2], log: bool, lines: Vec<Line>| {
        if lines.iter().any(|line| line.points.len() > 1) {
            series(&folder.join(file), &format!("{run}: {caption}"), x, y, log, &lines)?;
            drawn.push(Figure { file: file.to_owned(), caption });
        }
        Ok::<(), Error>(())
    };
    let points = |name: &str, rows: &[[f64; 2]]| Line {
        name: name.to_owned(),
        points: rows.iter().map(|&[x, y]| (x, y)).collect(),
    };

    figure(
        "height.svg",
        "porosity over height",
        ["height (m)", "porosity of the section"],
        false,
        vec![points("porosity", &measured.height_profile)],
    )?;
    let mut walls: Vec<Line> = measured
        .wall_profiles
        .iter()
        .map(|(wall, porosities)| Line {
            name: wall.clone(),
            points: measured.wall_distances.iter().copied().zip(porosities.iter().copied()).collect(),
        })
        .collect();
    if walls.len() > 1 {
        let mean = |k: usize| walls.iter().map(|wall| wall.points[k].1).sum::<f64>() / walls.len() as f64;
        let mean =
            (0..measured.wall_distances.len()).map(|k| (measured.wall_distances[k], mean(k))).collect();
        walls = vec![Line { name: format!("mean of {} walls", walls.len()), points: mean }];
    }
    let labels = ["distance to the wall (m)", "porosity of the section"];
    figure("walls.svg", "porosity over the distance to upright walls", labels, false, walls)?;
    // A small bed has no pair of centres at these distances, so it has no such figure.
    let apart = measured.radial_distribution.iter().any(|&[_, g]| g > 0.0);
    let g = if apart { vec![points("g", &measured.radial_distribution)] } else { Vec::new() };
    figure("rdf.svg", "radial distribution function", ["distance of the centres (m)", "g"], false, g)?;
    if let Some(found) = &measured.by_class {
        let labels = ["distance of the centres over the mean diameter", "g"];
        let caption = "radial distribution functions of pairs of classes";
        figure("class-rdf.svg", caption, labels, false, classes::radial(found))?;
        let labels = ["height (m)", "share of the mass"];
        figure("class-height.svg", "classes over height", labels, false, classes::heights(found))?;
        let labels = ["diameter (m)", "share of spheres up to it"];
        figure("sizes.svg", "distribution of sizes", labels, false, classes::sizes(found))?;
    }
    let spheres = measured.coordination.iter().map(|&spheres| spheres as f64);
    let steps: Vec<(f64, f64)> = spheres
        .enumerate()
        .flat_map(|(k, spheres)| [(k as f64 - 0.5, spheres), (k as f64 + 0.5, spheres)])
        .collect();
    let lines = vec![Line { name: "spheres".to_owned(), points: steps }];
    let labels = ["contacts with other spheres", "spheres"];
    figure("coordination.svg", "how many spheres have how many contacts", labels, false, lines)?;

    let overlapping = between_spheres(&measured.contacts.overlapping);
    // Over the mean of both radii, where spheres differ.
    let radius = |i: usize| measured.sizes.get(i).map_or(measured.radius, |size| size.r);
    let mean = |contact: &Contact| match contact.partner {
        Partner::Sphere(j) => 0.5 * (radius(contact.i) + radius(j)),
        Partner::Wall(_) => radius(contact.i),
    };
    let overlaps: Vec<f64> = overlapping.map(|contact| contact.overlap / mean(contact)).collect();
    let label =
        if measured.sizes.is_empty() { "overlap over the radius" } else { "overlap over the mean radius" };
    let labels = [label, "probability density"];
    figure("overlaps.svg", "distribution of overlaps", labels, false, distribution("overlaps", &overlaps))?;
    let mean = measured.last().mean_force;
    let pushing = between_spheres(&measured.contacts.pushing);
    let forces: Vec<f64> = pushing.map(|contact| contact.force / mean).collect();
    let labels = ["normal force over its mean", "probability density"];
    figure("forces.svg", "distribution of contact forces", labels, true, distribution("forces", &forces))?;

    if measured.rows.len() > 1 {
        let of = |name: &str, value: &dyn Fn(&Row) -> f64| Line {
            name: name.to_owned(),
            points: measured.rows.iter().map(|row| (row.time, value(row))).collect(),
        };
        let mut lines = vec![of("union in the region", &|row| row.volume_fraction)];
        if measured.rows.iter().any(|row| row.paper_count_in_unit_cube.is_some()) {
            lines.push(of("the paper's count in [0, 1]^3", &|row| {
                row.paper_count_in_unit_cube.unwrap_or(0.0)
            }));
        }
        let labels = ["time (s)", "volume fraction"];
        figure("fraction.svg", "volume fraction over time (Fig. 4.3)", labels, false, lines)?;
        let lines = vec![
            of("all spheres", &|row| row.mean_coordination),
            of("without rattlers", &|row| row.mean_coordination_without_rattlers),
        ];
        let labels = ["time (s)", "mean coordination number"];
        figure("coordination-time.svg", "coordination number over time", labels, false, lines)?;
    }
    let heights: Vec<Line> = measured
        .trajectories
        .iter()
        .enumerate()
        .map(|(id, heights)| over_time(&format!("sphere {id}"), heights))
        .collect();
    let labels = ["time (s)", "height of the centre (m)"];
    figure("trajectories.svg", "heights of the spheres (Fig. 4.1)", labels, false, heights)?;
    let energies = of(&[
        (Series::KineticEnergy, "kinetic"),
        (Series::PotentialEnergy, "potential"),
        (Series::DissipatedRebound, "dissipated by rebound"),
        (Series::DissipatedFriction, "dissipated by friction"),
    ]);
    figure("energies.svg", "energies", ["time (s)", "energy (J)"], false, energies)?;
    let labels = ["time (s)", "highest point of any sphere (m)"];
    figure("bed-height.svg", "bed height", labels, false, of(&[(Series::BedHeight, "bed height")]))?;
    let steps = of(&[
        (Series::StepsAccepted, "accepted"),
        (Series::StepsRejected, "rejected"),
        (Series::StepsOutrun, "outrun"),
    ]);
    figure("steps.svg", "steps so far (Fig. 4.4)", ["time (s)", "steps"], false, steps)?;
    let size = of(&[(Series::Step, "step")]);
    figure("step.svg", "size of the step at every frame", ["time (s)", "step (s)"], true, size)?;
    Ok(drawn)
}

/// Probability density of the values, as the points of a staircase.
///
/// The bins have equal width, from 0 to the largest value.
fn distribution(name: &str, values: &[f64]) -> Vec<Line> {
    let largest = values.iter().copied().fold(0.0, f64::max);
    if values.len() < 2 || largest <= 0.0 || !largest.is_finite() {
        return Vec::new();
    }
    let width = largest / BINS as f64;
    let mut counts = [0usize; BINS];
    for value in values {
        counts[((value / width) as usize).min(BINS - 1)] += 1;
    }
    let density = |count: usize| count as f64 / values.len() as f64 / width;
    let stairs = counts.iter().enumerate().flat_map(|(k, &count)| {
        [(k as f64 * width, density(count)), ((k + 1) as f64 * width, density(count))]
    });
    vec![Line { name: format!("{} {name}", values.len()), points: stairs.collect() }]
}
