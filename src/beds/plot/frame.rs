//! A frame with two axes: grid, tick labels, axis labels and heading.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, INK, PLAIN, Pixel, SMALL, text_width};
use crate::beds::text::shortened;
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

/// Longest heading, in characters.
const HEADING_LENGTH: usize = 52;
const EDGE: RGBColor = RGBColor(110, 110, 110);
const MAJOR: RGBColor = RGBColor(218, 218, 218);
const MINOR: RGBColor = RGBColor(241, 241, 241);

/// A frame, with its axes.
pub struct Frame {
    /// The area inside, where values are drawn.
    pub inside: Area,
    heading: String,
    x: Axis,
    y: Axis,
    /// Height of the labels of the x axis if they are written upwards, px; otherwise 0.
    upward_height: i32,
}

impl Frame {
    /// The largest frame that fits into `outer` with its labels. An empty heading takes no space.
    pub fn within(outer: Area, heading: &str, x: Axis, y: Axis) -> Frame {
        let left = outer.left + PLAIN + 14 + text_width(y.longest_label(), SMALL);
        // Leave space, because the last label of the x axis may extend past the frame.
        let right = outer.right - 16;
        let upward_height = upward_height(&x, right - left);
        let below = upward_height.max(SMALL);
        Frame {
            inside: Area {
                left,
                top: outer.top + if heading.is_empty() { 6 } else { PLAIN + 14 },
                right,
                bottom: outer.bottom - below - 8 - if x.label.is_empty() { 6 } else { PLAIN + 14 },
            },
            heading: shortened(heading, HEADING_LENGTH),
            x,
            y,
            upward_height,
        }
    }

    /// Pixel of a pair of values; `None` if an axis cannot show one of them.
    pub fn at(&self, x: f64, y: f64) -> Option<Pixel> {
        Some((self.across(self.x.share(x)?), self.up(self.y.share(y)?)))
    }

    /// Column at a share of the x axis.
    pub fn across(&self, share: f64) -> i32 {
        let Area { left, right, .. } = self.inside;
        left + (share * f64::from(right - left)).round() as i32
    }

    /// Row at a share of the y axis.
    pub fn up(&self, share: f64) -> i32 {
        let Area { top, bottom, .. } = self.inside;
        bottom - (share * f64::from(bottom - top)).round() as i32
    }

    /// The x axis.
    pub fn x(&self) -> &Axis {
        &self.x
    }

    /// The y axis.
    pub fn y(&self) -> &Axis {
        &self.y
    }

    /// Draws everything except the values.
    pub fn draw(&self, canvas: &Canvas) -> Drawn {
        let Area { left, top, right, bottom } = self.inside;
        for labelled in [false, true] {
            let colour = if labelled { MAJOR } else { MINOR };
            for tick in self.x.ticks().filter(|tick| tick.text.is_some() == labelled) {
                let x = self.across(tick.share);
                canvas.line(vec![(x, top), (x, bottom)], colour, 1)?;
            }
            for tick in self.y.ticks().filter(|tick| tick.text.is_some() == labelled) {
                let y = self.up(tick.share);
                canvas.line(vec![(left, y), (right, y)], colour, 1)?;
            }
        }
        let corners = vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.line(corners, EDGE, 1)?;
        for tick in self.x.ticks() {
            let (at, text) = ((self.across(tick.share), bottom + 6), tick.text.unwrap_or_default());
            if self.upward_height > 0 {
                canvas.upward_text(&text, at, SMALL, INK, (HPos::Right, VPos::Center))?;
            } else {
                canvas.text(&text, at, SMALL, INK, (HPos::Center, VPos::Top))?;
            }
        }
        for tick in self.y.ticks() {
            let (at, text) = ((left - 6, self.up(tick.share)), tick.text.unwrap_or_default());
            canvas.text(&text, at, SMALL, INK, (HPos::Right, VPos::Center))?;
        }
        let middle = ((left + right) / 2, (top + bottom) / 2);
        let below = self.upward_height.max(SMALL);
        canvas.text(&self.x.label, (middle.0, bottom + below + 14), PLAIN, INK, (HPos::Center, VPos::Top))?;
        let beside = left - text_width(self.y.longest_label(), SMALL) - 12;
        canvas.upward_text(&self.y.label, (beside, middle.1), PLAIN, INK, (HPos::Center, VPos::Bottom))?;
        canvas.text(&self.heading, (middle.0, top - 8), PLAIN, INK, (HPos::Center, VPos::Bottom))
    }
}

/// Height of the labels of an x axis that is `width` px long, px, if they are written upwards; otherwise 0.
///
/// Names are written upwards if they are too long to fit side by side.
pub fn upward_height(x: &Axis, width: i32) -> i32 {
    let widest = text_width(x.longest_label(), SMALL);
    if x.named && x.labelled() as i32 * (widest + 8) > width { widest } else { 0 }
}
