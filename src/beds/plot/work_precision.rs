//! Draws work over error: the work that each method needs for its accuracy.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, INK, Pixel, SMALL, save};
use super::frame::Frame;
use super::labels::Labels;
use super::legend::legend;
use super::look::{Look, Mark, looks};
use crate::error::Error;
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};
use std::path::Path;

/// Size of the figure, px.
const SIZE: (i32, i32) = (1000, 560);
const REMARK: &str = "Numbers at the ends of a curve and at failed runs: tolerance, or step with its unit.";
const BAND: RGBColor = RGBColor(246, 240, 236);
const BAND_INK: RGBColor = RGBColor(120, 80, 60);

/// The runs of one method.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name of the method.
    pub name: String,
    /// Runs. A line joins them in this order.
    pub points: Vec<Point>,
}

/// One run.
#[derive(Debug, Clone)]
pub struct Point {
    /// Short label: tolerance or step.
    pub label: String,
    /// Error, in the unit of the error label. A run without a valid error counts as failed.
    pub error: f64,
    /// Evaluations of the right-hand side.
    pub rhs: f64,
    /// Processor time, s.
    pub core_seconds: f64,
    /// Whether the run ended early.
    pub failed: bool,
}

/// Position of a run on the axis of errors.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Position {
    Zero,
    At(f64),
    Failed,
}

impl Point {
    fn position(&self) -> Position {
        if self.failed || !self.error.is_finite() || self.error < 0.0 {
            Position::Failed
        } else if self.error == 0.0 {
            Position::Zero
        } else {
            Position::At(self.error)
        }
    }
}

/// A kind of work.
struct Cost {
    label: &'static str,
    of: fn(&Point) -> f64,
}

const COSTS: [Cost; 2] = [
    Cost { label: "right-hand sides", of: |point| point.rhs },
    Cost { label: "core time (s)", of: |point| point.core_seconds },
];

/// Draws the right-hand sides (left) and the core time (right) over the error, on logarithmic axes.
///
/// A run with the error 0 is in a band at the left edge. A failed run is crossed out, in a band at the right
/// edge. Both are drawn at the work they have done.
pub fn work_precision(path: &Path, title: &str, error_label: &str, curves: &[Curve]) -> Result<(), Error> {
    let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
    let looks = looks(names.iter().copied());
    save(path, SIZE, title, |canvas, area| {
        let area = legend(canvas, area, &names, &looks)?;
        canvas.text(REMARK, (area.left + 4, area.bottom), SMALL, INK, (HPos::Left, VPos::Bottom))?;
        let area = Area { bottom: area.bottom - SMALL - 8, ..area };
        let middle = (area.left + area.right) / 2;
        let halves = [Area { right: middle - 4, ..area }, Area { left: middle + 4, ..area }];
        for (half, cost) in halves.into_iter().zip(&COSTS) {
            panel(canvas, half, error_label, curves, &looks, cost)?;
        }
        Ok(())
    })
}

fn panel(
    canvas: &Canvas,
    outer: Area,
    error_label: &str,
    curves: &[Curve],
    looks: &[Look],
    cost: &Cost,
) -> Drawn {
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let any = |position| points().any(|point| point.position() == position);
    let errors = points().filter(|point| point.position() != Position::Failed).map(|point| point.error);
    let x = Axis::logarithmic(error_label, errors).with_bands(any(Position::Zero), any(Position::Failed));
    let frame = Frame::within(outer, "", x, Axis::logarithmic(cost.label, points().map(cost.of)));
    bands(canvas, &frame)?;
    frame.draw(canvas)?;

    let pixels: Vec<Vec<Pixel>> = curves
        .iter()
        .enumerate()
        .map(|(number, curve)| {
            let sideways = (number as f64 + 1.0) / (curves.len() as f64 + 1.0);
            curve.points.iter().map(|point| pixel(&frame, point, cost, sideways)).collect()
        })
        .collect();
    let mut labels = Labels::within(frame.inside);
    labels.avoid(failed_word(&frame));
    for ((curve, pixels), look) in curves.iter().zip(&pixels).zip(looks) {
        for k in 1..pixels.len() {
            let joined = [k - 1, k].map(|k| curve.points[k].position() != Position::Failed);
            if joined == [true, true] {
                canvas.line(vec![pixels[k - 1], pixels[k]], look.colour, 2)?;
                labels.avoid_line(pixels[k - 1], pixels[k]);
            }
        }
        pixels.iter().for_each(|&at| labels.avoid_marker(at));
    }
    for ((curve, pixels), look) in curves.iter().zip(&pixels).zip(looks) {
        for (point, &at) in curve.points.iter().zip(pixels) {
            let mark = if point.position() == Position::Failed { Mark::Crossed } else { Mark::Full };
            look.marker(canvas, at, mark)?;
        }
        for k in labelled(&curve.points) {
            labels.write(canvas, pixels[k], &curve.points[k].label, look.colour)?;
        }
    }
    Ok(())
}

/// The points with a label: the first run, the last one, and all that failed.
fn labelled(points: &[Point]) -> Vec<usize> {
    let last = points.len().saturating_sub(1);
    (0..points.len()).filter(|&k| k == 0 || k == last || points[k].position() == Position::Failed).collect()
}

/// Pixel of a run. In a band, `sideways` from 0 to 1 keeps the methods apart.
fn pixel(frame: &Frame, point: &Point, cost: &Cost, sideways: f64) -> Pixel {
    let (start, end) = frame.x().scale_ends();
    let across = match point.position() {
        Position::Zero => sideways * start,
        Position::At(error) => frame.x().share(error).unwrap_or(start),
        Position::Failed => end + sideways * (1.0 - end),
    };
    // A run that failed before its first step has done no work, which a logarithmic axis cannot show.
    let up = frame.y().share((cost.of)(point)).unwrap_or(0.0);
    (frame.across(across), frame.up(up))
}

/// Fills the bands and labels them.
fn bands(canvas: &Canvas, frame: &Frame) -> Drawn {
    let (start, end) = frame.x().scale_ends();
    let Area { left, right, bottom, .. } = frame.inside;
    if start > 0.0 {
        canvas.fill(Area { right: frame.across(start), ..frame.inside }, BAND)?;
        let middle = (left + frame.across(start)) / 2;
        canvas.text("0", (middle, bottom + 6), SMALL, BAND_INK, (HPos::Center, VPos::Top))?;
    }
    if end < 1.0 {
        canvas.fill(Area { left: frame.across(end), ..frame.inside }, BAND)?;
        let word = failed_word(frame);
        let middle = ((frame.across(end) + right) / 2, word.top);
        canvas.text("failed", middle, SMALL, BAND_INK, (HPos::Center, VPos::Top))?;
    }
    Ok(())
}

/// The area of the word "failed", at the top of its band.
fn failed_word(frame: &Frame) -> Area {
    let Area { top, right, .. } = frame.inside;
    Area { left: frame.across(frame.x().scale_ends().1), top: top + 6, right, bottom: top + 6 + SMALL }
}
