//! The figures of an ensemble: ranges and means at the end of the runs, and over time.

use super::Case;
use super::measures::{MEASURES, OVER_TIME};
use super::summary::{Moment, Summary, values};
use crate::beds::plot::{Band, Bands, Ranges, bands, ranges};
use crate::error::Error;
use std::path::Path;

/// Draws those of the measures `chosen` that have a value; returns the names of the files.
pub fn draw(
    folder: &Path,
    title: &str,
    cases: &[Case],
    summary: &Summary,
    chosen: &[usize],
) -> Result<Vec<String>, Error> {
    let mut drawn = Vec::new();
    let shown =
        || chosen.iter().copied().filter(|&k| summary.ends.iter().any(|ends| ends[k].spread.is_some()));
    let panel = |k: usize| Ranges {
        name: MEASURES[k].label.to_owned(),
        cases: (cases.iter().zip(&summary.ends))
            .map(|(case, ends)| (case.name.clone(), values(case, k), ends[k].spread.map(|s| s.interval)))
            .collect(),
    };
    let panels: Vec<Ranges> = shown().map(panel).collect();
    if !panels.is_empty() {
        ranges(&folder.join("ranges.svg"), &format!("{title}: at the end of the runs"), &panels)?;
        drawn.push("ranges.svg".to_owned());
    }
    let over_time = |k: usize| Bands {
        name: MEASURES[k].label.to_owned(),
        x_label: "time (s)".to_owned(),
        bands: (cases.iter().zip(&summary.evolutions))
            .map(|(case, moments)| band(&case.name, moments, k))
            .collect(),
    };
    let panels: Vec<Bands> = shown().filter(|&k| k < OVER_TIME).map(over_time).collect();
    if panels.iter().flat_map(|panel| &panel.bands).any(|band| band.points.len() > 1) {
        bands(&folder.join("evolution.svg"), &format!("{title}: over time"), &panels)?;
        drawn.push("evolution.svg".to_owned());
    }
    Ok(drawn)
}

fn band(name: &str, moments: &[Moment], k: usize) -> Band {
    let point = |moment: &Moment| moment.spreads[k].map(|s| [moment.time, s.min, s.interval.mean, s.max]);
    Band { name: name.to_owned(), points: moments.iter().filter_map(point).collect() }
}
