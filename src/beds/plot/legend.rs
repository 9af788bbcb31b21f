//! The legend. It is above the frames, where it covers nothing.

use super::canvas::{Area, Canvas, Drawn, INK, PLAIN, text_width};
use super::look::{Look, Mark};
use crate::beds::text::shortened;
use plotters::style::text_anchor::{HPos, VPos};

/// Height of a row, px.
const ROW: i32 = 22;
/// Length of the line sample of an entry, px.
const SAMPLE: i32 = 30;
/// Largest number of entries that are named. The others are only counted.
const MOST_ENTRIES: usize = 24;
/// Longest name, in characters.
const NAME_LENGTH: usize = 40;

/// Draws the names with their looks, in rows at the top of `area`. Returns the rest of the area.
pub fn legend(canvas: &Canvas, area: Area, names: &[&str], looks: &[Look]) -> Drawn<Area> {
    let (mut x, mut y) = (area.left + 4, area.top + ROW / 2);
    let start = x;
    for (name, look) in names.iter().zip(looks).take(MOST_ENTRIES) {
        let name = shortened(name, NAME_LENGTH);
        let width = SAMPLE + 6 + text_width(&name, PLAIN) + 18;
        if x > start && x + width > area.right {
            (x, y) = (start, y + ROW);
        }
        canvas.line(vec![(x, y), (x + SAMPLE, y)], look.colour, 2)?;
        look.marker(canvas, (x + SAMPLE / 2, y), Mark::Full)?;
        canvas.text(&name, (x + SAMPLE + 6, y), PLAIN, INK, (HPos::Left, VPos::Center))?;
        x += width;
    }
    if names.len() > MOST_ENTRIES {
        let more = format!("and {} more", names.len() - MOST_ENTRIES);
        y += ROW;
        canvas.text(&more, (start, y), PLAIN, INK, (HPos::Left, VPos::Center))?;
    }
    let used = if names.is_empty() { 0 } else { y + ROW / 2 + 6 - area.top };
    Ok(Area { top: area.top + used, ..area })
}
