//! Figures of a comparison as SVG files that a browser shows.
//!
//! A figure is a title, a legend and one or more frames with axes. Every method keeps one colour and one marker in
//! all figures; the colours differ for colour-blind readers, and the markers on grey paper.

mod axis;
mod bands;
mod canvas;
mod ensemble;
mod frame;
mod labels;
mod legend;
mod look;
mod ranges;
mod series;
mod sheet;
#[cfg(test)]
mod tests;
mod work_precision;

pub use bands::{Band, Bands, bands};
pub use ensemble::{Across, Bar, Group, Panel, ensemble};
pub use ranges::{Ranges, ranges};
pub use series::{Line, series};
pub use work_precision::{Curve, Point, work_precision};
