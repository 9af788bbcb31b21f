//! Draws the values of several cases side by side: every run, the range, the mean and its interval.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn};
use super::ensemble::names_room;
use super::frame::Frame;
use super::look::{Look, Mark, looks};
use super::sheet::Sheet;
use crate::error::Error;
use crate::math::interval::Interval;
use std::path::Path;

/// Length of the caps at the ends of a range, px.
const CAP: i32 = 14;
/// Half the width of the box that shows an interval, px.
const BOX: i32 = 8;
/// Distance of the range to the left of the position of the case, px.
const ASIDE: i32 = 24;
/// Width over which the dots of runs are spread, px.
const SPREAD: i32 = 30;
/// Radius of a dot, px.
const DOT: i32 = 2;
const REMARK: &str = "Lines: from the smallest to the largest run. \
     Markers: means, shaded: their 95 % intervals. Dots: runs, by seed from left to right.";

/// A panel for one measure.
#[derive(Debug, Clone)]
pub struct Ranges {
    /// Name of the measure, with the unit.
    pub name: String,
    /// The cases: the name, the value of every run, and the mean of the finite values.
    pub cases: Vec<(String, Vec<f64>, Option<Interval>)>,
}

/// Draws a panel for every measure. All panels must have the same cases.
pub fn ranges(path: &Path, title: &str, panels: &[Ranges]) -> Result<(), Error> {
    let names: Vec<String> = panels
        .first()
        .map(|panel| panel.cases.iter().map(|case| case.0.clone()).collect())
        .unwrap_or_default();
    let looks = looks(names.iter().map(String::as_str));
    let extra = names_room(&names);
    let sheet = Sheet { title, names: &[], looks: &[], remark: REMARK, panels: panels.len(), extra };
    sheet.save(path, |canvas, k, area| draw(canvas, area, &panels[k], &names, &looks))
}

fn draw(canvas: &Canvas, outer: Area, panel: &Ranges, names: &[String], looks: &[Look]) -> Drawn {
    let all = panel.cases.iter().flat_map(|(_, values, _)| values.iter().copied());
    let frame = Frame::within(outer, &panel.name, Axis::named("", names), Axis::linear("", all));
    frame.draw(canvas)?;
    for (number, ((_, values, mean), look)) in panel.cases.iter().zip(looks).enumerate() {
        let (Some((low, high)), Some(mean)) = (ends(values), mean) else { continue };
        let at = |value: f64| frame.at(number as f64, value);
        let (Some((x, bottom)), Some((_, top)), Some((_, middle))) = (at(low), at(high), at(mean.mean))
        else {
            continue;
        };
        let (left, right) = (x - ASIDE, x - ASIDE / 4);
        canvas.line(vec![(left, bottom), (left, top)], look.colour, 2)?;
        for end in [bottom, top] {
            canvas.line(vec![(left - CAP / 2, end), (left + CAP / 2, end)], look.colour, 2)?;
        }
        if mean.half_width.is_finite() {
            let ends = [mean.mean + mean.half_width, mean.mean - mean.half_width];
            if let [Some((_, top)), Some((_, bottom))] = ends.map(at) {
                canvas.veil(
                    &[(left - BOX, top), (left + BOX, top), (left + BOX, bottom), (left - BOX, bottom)],
                    look.colour,
                )?;
            }
        }
        look.marker(canvas, (left, middle), Mark::Full)?;
        for (k, &value) in values.iter().enumerate() {
            if let Some((_, y)) = at(value) {
                let share = (k as f64 + 0.5) / values.len() as f64;
                let x = right + (share * f64::from(SPREAD)).round() as i32;
                canvas.circle((x, y), DOT, look.colour, look.colour)?;
            }
        }
    }
    Ok(())
}

/// The smallest and the largest finite value.
fn ends(values: &[f64]) -> Option<(f64, f64)> {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    finite.map(|value| (value, value)).reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
}
