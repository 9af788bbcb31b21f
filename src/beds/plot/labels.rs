//! Small labels beside points. A label is left out if it would cover something.

use super::canvas::{Area, Canvas, Drawn, Pixel, text_width};
use crate::beds::text::shortened;
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

/// Font size, px.
const TINY: i32 = 11;
/// Longest label, in characters.
const LENGTH: usize = 16;
/// Distance of a label from its point, px.
const GAP: i32 = 9;
/// Distance between the obstacles that represent a line, px.
const SPACING: i32 = 4;

/// The space for labels in a frame.
pub struct Labels {
    inside: Area,
    taken: Vec<Area>,
    obstacles: Vec<Pixel>,
}

impl Labels {
    /// The space in `inside`, all of it free.
    pub fn within(inside: Area) -> Labels {
        Labels { inside, taken: Vec::new(), obstacles: Vec::new() }
    }

    /// Keeps labels off the area.
    pub fn avoid(&mut self, area: Area) {
        self.taken.push(area);
    }

    /// Keeps labels off the marker at a point.
    pub fn avoid_marker(&mut self, (x, y): Pixel) {
        self.avoid(Area { left: x - 6, top: y - 6, right: x + 6, bottom: y + 6 });
    }

    /// Keeps labels off the line between two points.
    pub fn avoid_line(&mut self, (x0, y0): Pixel, (x1, y1): Pixel) {
        let parts = ((x1 - x0).abs().max((y1 - y0).abs()) / SPACING).max(1);
        for part in 0..=parts {
            self.obstacles.push((x0 + (x1 - x0) * part / parts, y0 + (y1 - y0) * part / parts));
        }
    }

    /// Writes `text` beside the point, if there is space on any side of it.
    pub fn write(&mut self, canvas: &Canvas, (x, y): Pixel, text: &str, colour: RGBColor) -> Drawn {
        let text = shortened(text, LENGTH);
        let (width, half) = (text_width(&text, TINY), TINY / 2 + 1);
        let aside = width / 2 + GAP;
        let sides = [
            (aside, 0),
            (-aside, 0),
            (0, -GAP - half),
            (0, GAP + half),
            (aside, -GAP),
            (-aside, -GAP),
            (aside, GAP),
            (-aside, GAP),
        ];
        let around = |(dx, dy): Pixel| Area {
            left: x + dx - width / 2,
            top: y + dy - half,
            right: x + dx + width / 2,
            bottom: y + dy + half,
        };
        let Some(area) = sides.into_iter().map(around).find(|&area| self.is_free(area)) else {
            return Ok(());
        };
        self.avoid(area);
        let middle = ((area.left + area.right) / 2, (area.top + area.bottom) / 2);
        canvas.text(&text, middle, TINY, colour, (HPos::Center, VPos::Center))
    }

    fn is_free(&self, area: Area) -> bool {
        let fits = area.left > self.inside.left
            && area.right < self.inside.right
            && area.top > self.inside.top
            && area.bottom < self.inside.bottom;
        fits && !self.taken.iter().any(|&other| area.overlaps(other))
            && !self.obstacles.iter().any(|&pixel| area.holds(pixel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INSIDE: Area = Area { left: 0, top: 0, right: 100, bottom: 100 };

    #[test]
    fn a_label_hides_no_marker_no_line_and_no_other_label() {
        let mut labels = Labels::within(INSIDE);
        let room = Area { left: 40, top: 40, right: 60, bottom: 60 };
        assert!(labels.is_free(room));
        labels.avoid_line((0, 0), (100, 30));
        labels.avoid_marker((30, 50));
        assert!(labels.is_free(room));
        assert!(!labels.is_free(Area { left: 36, ..room }));
        labels.avoid_line((30, 30), (70, 70));
        assert!(!labels.is_free(room));
    }

    #[test]
    fn a_label_stays_inside_the_frame() {
        let labels = Labels::within(INSIDE);
        assert!(!labels.is_free(Area { left: 80, top: 40, right: 104, bottom: 60 }));
        assert!(!labels.is_free(Area { left: 40, top: -4, right: 60, bottom: 10 }));
    }
}
