//! Draws quantities over time as lines.

use super::axis::Axis;
use super::canvas::{Drawn, Pixel, save};
use super::frame::Frame;
use super::legend::legend;
use super::look::{Look, Mark};
use crate::error::Error;
use std::path::Path;

/// Size of the figure, px.
const SIZE: (i32, i32) = (960, 540);
/// Number of markers on a line. They distinguish the lines without colour.
const MARKERS: i32 = 7;

/// One line.
#[derive(Debug, Clone)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Pairs of values, in the order in which they are joined.
    ///
    /// The line has a gap where a value is not finite or, on a logarithmic axis, not positive.
    pub points: Vec<(f64, f64)>,
}

/// Draws the lines over a common linear x axis.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::plot::{Line, series};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("height.svg");
/// let points = (0..100).map(|k| 0.01 * f64::from(k)).map(|t| (t, 1.0 - t * t)).collect();
/// let lines = [Line { name: "fall".to_owned(), points }];
/// series(&path, "A fall", "time in s", "height in m", false, &lines)?;
/// assert!(std::fs::read_to_string(&path)?.contains("A fall"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn series(
    path: &Path,
    title: &str,
    x_label: &str,
    y_label: &str,
    log_y: bool,
    lines: &[Line],
) -> Result<(), Error> {
    let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
    let looks: Vec<Look> = (0..lines.len()).map(Look::number).collect();
    let points = || lines.iter().flat_map(|line| &line.points);
    let x = Axis::linear(x_label, points().map(|&(x, _)| x));
    let values = points().map(|&(_, y)| y);
    let y = if log_y { Axis::logarithmic(y_label, values) } else { Axis::linear(y_label, values) };
    save(path, SIZE, title, |canvas, area| {
        let area = legend(canvas, area, &names, &looks)?;
        let frame = Frame::within(area, "", x, y);
        frame.draw(canvas)?;
        for (line, look) in lines.iter().zip(&looks) {
            for piece in pieces(&frame, &line.points) {
                canvas.line(piece, look.colour, 2)?;
            }
        }
        for (number, (line, look)) in lines.iter().zip(&looks).enumerate() {
            for at in markers(&frame, &line.points, number as i32, lines.len() as i32) {
                look.marker(canvas, at, Mark::Full)?;
            }
        }
        Drawn::Ok(())
    })
}

/// The parts of the line between its gaps, in pixels.
fn pieces(frame: &Frame, points: &[(f64, f64)]) -> Vec<Vec<Pixel>> {
    let pixels: Vec<Option<Pixel>> = points.iter().map(|&(x, y)| frame.at(x, y)).collect();
    pixels.split(Option::is_none).map(|piece| thinned(piece.iter().flatten().copied())).collect()
}

/// The line with at most four pixels in each column: the first, the highest, the lowest and the last.
///
/// The picture stays the same.
fn thinned(pixels: impl Iterator<Item = Pixel>) -> Vec<Pixel> {
    let mut kept: Vec<Pixel> = Vec::new();
    // Index of the first pixel of the current column in `kept`.
    let mut column = 0;
    for pixel in pixels {
        if kept.get(column).is_none_or(|&(x, _)| x != pixel.0) {
            column = kept.len();
        }
        kept.push(pixel);
        if let [(x, first), a, b, c, (_, last)] = kept[column..] {
            let (low, high) = (a.1.min(b.1).min(c.1), a.1.max(b.1).max(c.1));
            kept.truncate(column);
            kept.extend([(x, first), (x, low), (x, high), (x, last)]);
        }
    }
    kept.dedup();
    kept
}

/// Points of line `number` that get a marker. They are about evenly spaced, and shifted from line to line.
fn markers(frame: &Frame, points: &[(f64, f64)], number: i32, lines: i32) -> Vec<Pixel> {
    let spacing = (frame.inside.right - frame.inside.left) / MARKERS;
    let first = frame.inside.left + spacing * (2 * number + 1) / (2 * lines);
    let pixels = points.iter().filter_map(|&(x, y)| frame.at(x, y));
    let mut next = first;
    let mut chosen = Vec::new();
    for (x, y) in pixels {
        if x >= next {
            chosen.push((x, y));
            next = first + ((x - first) / spacing + 1) * spacing;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_line_keeps_its_extremes_with_few_pixels() {
        let dense = (0..10_000).map(|k| (k / 1000, [5, 9, 1, 7][k as usize % 4]));
        let thin = thinned(dense);
        assert_eq!(thin.len(), 40);
        assert_eq!(thin[..4], [(0, 5), (0, 1), (0, 9), (0, 7)]);
    }

    #[test]
    fn a_short_line_keeps_all_its_pixels() {
        let line = vec![(0, 3), (4, 1), (4, 2), (8, 0)];
        assert_eq!(thinned(line.iter().copied()), line);
    }
}
