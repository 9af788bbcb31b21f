//! Figures of a comparison as SVG files that a browser shows.
//!
//! A figure is a title, a legend and one or more frames with axes. Every method keeps one colour and one marker in
//! all figures; the colours differ for colour-blind readers, and the markers on grey paper.

mod axis;
mod canvas;
mod ensemble;
mod frame;
mod labels;
mod legend;
mod look;
mod series;
#[cfg(test)]
mod tests;
mod work_precision;

pub use ensemble::{Across, Bar, Group, Panel, ensemble};
pub use series::{Line, series};
pub use work_precision::{Curve, Point, work_precision};
