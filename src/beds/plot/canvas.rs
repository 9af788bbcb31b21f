//! The canvas of a figure: texts, lines and areas in pixels, written to an SVG file.

use crate::beds::folder::cannot_write;
use crate::beds::text::shortened;
use crate::error::Error;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;

/// Result of drawing. It fails only if the canvas cannot be written.
pub type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// A point on the canvas: pixels from the left and from the top.
pub type Pixel = (i32, i32);

/// Colour of text.
pub const INK: RGBColor = RGBColor(40, 40, 40);
/// Font size of tick labels, px.
pub const SMALL: i32 = 12;
/// Font size of axis labels and legends, px.
pub const PLAIN: i32 = 13;
/// Font size of the title, px.
const TITLE: i32 = 18;
/// Longest title, in characters.
const TITLE_LENGTH: usize = 96;

/// A rectangle on the canvas, px.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// Left edge.
    pub left: i32,
    /// Upper edge.
    pub top: i32,
    /// Right edge.
    pub right: i32,
    /// Lower edge.
    pub bottom: i32,
}

impl Area {
    /// Whether the two areas share a pixel.
    pub fn overlaps(self, other: Area) -> bool {
        self.left <= other.right
            && other.left <= self.right
            && self.top <= other.bottom
            && other.top <= self.bottom
    }

    /// Whether the pixel lies in the area.
    pub fn holds(self, (x, y): Pixel) -> bool {
        (self.left..=self.right).contains(&x) && (self.top..=self.bottom).contains(&y)
    }
}

/// Approximate width of `text` in a common sans-serif font of `size` px. It is rather too large.
pub fn text_width(text: &str, size: i32) -> i32 {
    (text.chars().count() as f64 * f64::from(size) * 0.6).ceil() as i32
}

/// Horizontal and vertical position of the reference point of a text.
pub type Anchor = (HPos, VPos);

/// A canvas.
pub struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

impl Canvas<'_> {
    /// Writes `text` horizontally.
    pub fn text(&self, text: &str, at: Pixel, size: i32, colour: RGBColor, anchor: Anchor) -> Drawn {
        self.words(text, at, size, colour, anchor, FontTransform::None)
    }

    /// Writes `text` upwards. `anchor` refers to the text before it is rotated.
    pub fn upward_text(&self, text: &str, at: Pixel, size: i32, colour: RGBColor, anchor: Anchor) -> Drawn {
        self.words(text, at, size, colour, anchor, FontTransform::Rotate270)
    }

    fn words(
        &self,
        text: &str,
        at: Pixel,
        size: i32,
        colour: RGBColor,
        (horizontal, vertical): Anchor,
        transform: FontTransform,
    ) -> Drawn {
        // The backend divides font sizes by 1.24.
        let font = ("sans-serif", f64::from(size) * 1.24).into_font().transform(transform);
        let style = TextStyle::from(font).color(&colour).pos(Pos::new(horizontal, vertical));
        // XML does not allow control characters.
        self.area.draw(&Text::new(shortened(text, usize::MAX), at, style))
    }

    /// Draws a line of `width` px through the points.
    pub fn line(&self, points: Vec<Pixel>, colour: RGBColor, width: u32) -> Drawn {
        self.area.draw(&PathElement::new(points, colour.stroke_width(width)))
    }

    /// Fills the area.
    pub fn fill(&self, area: Area, colour: RGBColor) -> Drawn {
        let corners = [(area.left, area.top), (area.right, area.bottom)];
        self.area.draw(&Rectangle::new(corners, colour.filled()))
    }

    /// Fills the polygon and draws its outline.
    pub fn polygon(&self, corners: &[Pixel], inside: RGBColor, outline: RGBColor) -> Drawn {
        self.area.draw(&Polygon::new(corners.to_vec(), inside.filled()))?;
        let closed: Vec<Pixel> = corners.iter().chain(corners.first()).copied().collect();
        self.line(closed, outline, 1)
    }

    /// Fills the polygon with a transparent colour.
    pub fn veil(&self, corners: &[Pixel], colour: RGBColor) -> Drawn {
        self.area.draw(&Polygon::new(corners.to_vec(), colour.mix(0.2).filled()))
    }

    /// Fills the circle and draws its outline.
    pub fn circle(&self, at: Pixel, radius: i32, inside: RGBColor, outline: RGBColor) -> Drawn {
        self.area.draw(&Circle::new(at, radius, inside.filled()))?;
        self.area.draw(&Circle::new(at, radius, outline.stroke_width(1)))
    }
}

/// Draws a figure of `width` x `height` px with its title and writes it to a file.
///
/// `draw` gets the canvas and the area below the title.
pub fn save(
    path: &Path,
    (width, height): (i32, i32),
    title: &str,
    draw: impl FnOnce(&Canvas, Area) -> Drawn,
) -> Result<(), Error> {
    let mut svg = String::new();
    let sheet = (width.unsigned_abs(), height.unsigned_abs());
    let drawn = || -> Drawn {
        let canvas = Canvas { area: SVGBackend::with_string(&mut svg, sheet).into_drawing_area() };
        canvas.area.fill(&WHITE)?;
        canvas.text(&shortened(title, TITLE_LENGTH), (16, 12), TITLE, INK, (HPos::Left, VPos::Top))?;
        draw(&canvas, Area { left: 12, top: 12 + TITLE + 10, right: width - 12, bottom: height - 8 })?;
        canvas.area.present()
    };
    drawn().map_err(|why| cannot_write(path, why))?;
    std::fs::write(path, svg).map_err(|why| cannot_write(path, why))
}
