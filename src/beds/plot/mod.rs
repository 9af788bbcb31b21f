//! Figures as SVG files, which a browser can show.
//!
//! A figure has a title, a legend and one or more frames with axes.
//!
//! Every method has the same colour and the same marker in all figures. Colour-blind readers can distinguish
//! the colours, and the markers can be distinguished without colour.

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
