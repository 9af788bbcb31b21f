//! A sheet of panels, with one legend above and one remark below.

use super::canvas::{Area, Canvas, Drawn, INK, SMALL, save};
use super::legend::legend;
use super::look::Look;
use crate::error::Error;
use plotters::style::text_anchor::{HPos, VPos};
use std::path::Path;

/// Width of the figure, px.
pub const WIDTH: i32 = 960;
/// Height of a panel, px.
const PANEL_HEIGHT: i32 = 310;
/// Height of the title, the legend and the remark together, px.
const AROUND: i32 = 100;
/// Height of a figure with a single panel, px.
const ALONE: i32 = 540;

/// The parts of a sheet around its panels.
pub struct Sheet<'a> {
    /// The title.
    pub title: &'a str,
    /// Names in the legend. It may be empty.
    pub names: &'a [&'a str],
    /// The looks of the names.
    pub looks: &'a [Look],
    /// The line below the panels.
    pub remark: &'a str,
    /// Number of panels.
    pub panels: usize,
    /// Additional height of a panel, px.
    pub extra: i32,
}

impl Sheet<'_> {
    /// Number of columns: two, or one if there is a single panel.
    fn columns(&self) -> usize {
        self.panels.clamp(1, 2)
    }

    /// Writes the figure. `draw(canvas, k, area)` draws panel `k`.
    pub fn save(&self, path: &Path, draw: impl Fn(&Canvas, usize, Area) -> Drawn) -> Result<(), Error> {
        let columns = self.columns();
        let rows = self.panels.div_ceil(columns).max(1);
        let height = if self.panels < 2 { ALONE } else { AROUND + rows as i32 * (PANEL_HEIGHT + self.extra) };
        save(path, (WIDTH, height), self.title, |canvas, area| {
            let area = legend(canvas, area, self.names, self.looks)?;
            let (at, anchor) = ((area.left + 4, area.bottom), (HPos::Left, VPos::Bottom));
            canvas.text(self.remark, at, SMALL, INK, anchor)?;
            let width = (area.right - area.left) / columns as i32;
            let height = (area.bottom - SMALL - 8 - area.top) / rows as i32;
            for k in 0..self.panels {
                let (row, column) = ((k / columns) as i32, (k % columns) as i32);
                let (left, top) = (area.left + column * width, area.top + row * height);
                draw(canvas, k, Area { left, top, right: left + width, bottom: top + height })?;
            }
            Ok(())
        })
    }
}
