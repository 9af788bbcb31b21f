//! Draws means over time, with the ranges around them.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, Pixel};
use super::frame::Frame;
use super::look::{Look, Mark, looks};
use super::sheet::Sheet;
use crate::error::Error;
use std::path::Path;

const REMARK: &str = "Lines: means. Areas: from the smallest to the largest run.";

/// A panel for one measure.
#[derive(Debug, Clone)]
pub struct Bands {
    /// Name of the measure, with the unit.
    pub name: String,
    /// Label of the x axis, with the unit.
    pub x_label: String,
    /// One band for each case.
    pub bands: Vec<Band>,
}

/// The band of one case.
#[derive(Debug, Clone)]
pub struct Band {
    /// Name of the case.
    pub name: String,
    /// x, smallest value, mean, largest value.
    pub points: Vec<[f64; 4]>,
}

/// Draws a panel for every measure. All panels must have the same cases.
pub fn bands(path: &Path, title: &str, panels: &[Bands]) -> Result<(), Error> {
    let names: Vec<&str> = panels
        .first()
        .map(|panel| panel.bands.iter().map(|band| band.name.as_str()).collect())
        .unwrap_or_default();
    let looks = looks(names.iter().copied());
    let sheet =
        Sheet { title, names: &names, looks: &looks, remark: REMARK, panels: panels.len(), extra: 20 };
    sheet.save(path, |canvas, k, area| draw(canvas, area, &panels[k], &looks))
}

fn draw(canvas: &Canvas, outer: Area, panel: &Bands, looks: &[Look]) -> Drawn {
    let points = || panel.bands.iter().flat_map(|band| &band.points);
    let x = Axis::linear(&panel.x_label, points().map(|point| point[0]));
    let y = Axis::linear("", points().flat_map(|point| point[1..].iter().copied()));
    let frame = Frame::within(outer, &panel.name, x, y);
    frame.draw(canvas)?;
    let line = |band: &Band, k: usize| -> Vec<Pixel> {
        band.points.iter().filter_map(|point| frame.at(point[0], point[k])).collect()
    };
    for (band, look) in panel.bands.iter().zip(looks) {
        let around: Vec<Pixel> = line(band, 1).into_iter().chain(line(band, 3).into_iter().rev()).collect();
        if around.len() > 2 {
            canvas.veil(&around, look.colour)?;
        }
    }
    for (band, look) in panel.bands.iter().zip(looks) {
        let means = line(band, 2);
        let last = means.last().copied();
        canvas.line(means, look.colour, 2)?;
        if let Some(at) = last {
            look.marker(canvas, at, Mark::Full)?;
        }
    }
    Ok(())
}
