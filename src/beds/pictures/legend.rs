//! The legend: a colour bar with title, unit and ticks, or the names of species; and the time.

use super::camera::Frame;
use super::options::{Limits, Size};
use super::picture::{Font, Picture};
use super::quantity::Quantity;
use super::species::Key;
use crate::error::Error;

/// Positions of the legend and the spheres in the picture.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Part of the picture that holds the spheres, pixels.
    pub frame: Frame,
    font: Font,
    margin: usize,
    /// Left end of the column of the legend; `None`: there is no legend.
    column: Option<usize>,
    contents: Option<Contents>,
}

/// The contents of the legend.
#[derive(Debug, Clone, PartialEq)]
enum Contents {
    Bar(Bar),
    Key(Key),
}

/// A colour bar.
#[derive(Debug, Clone, PartialEq)]
struct Bar {
    title: String,
    limits: Limits,
    /// Values with their labels.
    ticks: Vec<(f64, String)>,
}

impl Layout {
    /// The layout of pictures of `size` that show `quantity` between `limits`.
    ///
    /// If `plain`, there is no legend. `species` are the names of the species, for pictures that show them.
    /// `time` is the longest label of a time.
    pub fn new(
        size: Size,
        quantity: Quantity,
        limits: Limits,
        species: &[String],
        plain: bool,
        time: &str,
    ) -> Result<Self, Error> {
        let font = Font::for_picture(size);
        let margin = (size.height.min(size.width) / 24).max(1);
        let contents = match quantity {
            _ if plain => None,
            Quantity::None => None,
            Quantity::Species => Some(Contents::Key(Key::new(species))),
            _ => Some(Contents::Bar(Bar::new(quantity, limits))),
        };
        let mut layout = Layout { frame: [0.0; 4], font, margin, column: None, contents };
        let mut right = size.width - margin;
        if let Some(contents) = &layout.contents {
            let (title, width) = match contents {
                Contents::Bar(bar) => {
                    let labels = bar.ticks.iter().map(|(_, label)| label.len()).max().unwrap_or(0);
                    (&bar.title[..], layout.bar_width() + font.width() * (labels + 2))
                }
                Contents::Key(key) => (Key::TITLE, key.width(font)),
            };
            let widest = (font.width() * title.len().max(time.len())).max(width);
            let column = size.width.saturating_sub(widest + margin);
            if column < size.width / 3 || size.height < 12 * font.height() {
                return Err(Error::Input(format!(
                    "--size {}x{}: too small for the legend; choose a larger size, or --plain",
                    size.width, size.height
                )));
            }
            layout.column = Some(column);
            right = column.saturating_sub(margin);
        }
        layout.frame = [margin, margin, right, size.height - margin].map(|pixels| pixels as f64);
        Ok(layout)
    }

    fn bar_width(&self) -> usize {
        3 * self.font.height() / 2
    }

    /// Draws the legend and the time label on `picture`, in the colours `ink` on `background`.
    ///
    /// The column of the legend covers the spheres of a magnified picture.
    pub fn draw(
        &self,
        picture: &mut Picture,
        time: Option<&str>,
        [ink, background]: [[u8; 3]; 2],
        colour: impl Fn(f64) -> [u8; 3],
    ) {
        let Size { width, height } = picture.size;
        if let Some(column) = self.column {
            picture.fill([column - self.margin / 2, 0, width, height], background);
        }
        let font = self.font;
        if let Some(time) = time {
            picture.write(font, self.column.unwrap_or(self.margin), self.margin, time, ink);
        }
        let (Some(column), Some(contents)) = (self.column, &self.contents) else { return };
        let (top, bottom) = self.ends(picture.size);
        let bar = match contents {
            Contents::Bar(bar) => bar,
            Contents::Key(key) => {
                picture.write(font, column, top - 2 * font.height(), Key::TITLE, ink);
                key.draw(picture, font, column, [top, height - self.margin], ink);
                return;
            }
        };
        let right = column + self.bar_width();
        let line = font.height().div_ceil(16);
        picture.write(font, column, top - 2 * font.height(), &bar.title, ink);
        picture.fill([column - line, top - line, right + line, bottom + line], ink);
        for row in top..bottom {
            let share = 1.0 - (row - top) as f64 / (bottom - top - 1) as f64;
            picture.fill([column, row, right, row + 1], colour(share));
        }
        for (value, label) in &bar.ticks {
            let middle = bottom as f64 - bar.limits.share(*value) * (bottom - top) as f64;
            let row = (middle - line as f64 / 2.0).round() as usize;
            picture.fill([right, row, right + font.width(), row + line], ink);
            let row = (middle - font.height() as f64 / 2.0).round() as usize;
            picture.write(font, right + 3 * font.width() / 2, row, label, ink);
        }
    }

    /// First and last row of the bar.
    fn ends(&self, size: Size) -> (usize, usize) {
        let above = self.margin + 4 * self.font.height();
        let length = (size.height - 2 * above).min(size.height * 3 / 5);
        let top = (size.height - length) / 2;
        (top, top + length)
    }
}

impl Bar {
    fn new(quantity: Quantity, limits: Limits) -> Self {
        let (name, unit) = quantity.title();
        let largest = limits.low.abs().max(limits.high.abs());
        // Move a power of ten into the title, so that labels stay short.
        let power = match largest {
            0.01..1e5 => 0,
            _ => (largest.log10().floor() as i32).clamp(-300, 300),
        };
        let factor = 10f64.powi(power);
        let title =
            if power == 0 { format!("{name} ({unit})") } else { format!("{name} (1e{power} {unit})") };
        let scaled = Limits { low: limits.low / factor, high: limits.high / factor };
        let ticks = ticks(scaled).into_iter().map(|(value, label)| (value * factor, label)).collect();
        Bar { title, limits, ticks }
    }
}

/// Three to eight round numbers between the limits: multiples of 1, 2 or 5 times a power of ten.
fn ticks(limits: Limits) -> Vec<(f64, String)> {
    let power = ((limits.high - limits.low) / 8.0).log10().floor() as i32;
    let bounds = |step: f64| ((limits.low / step - 1e-6).ceil(), (limits.high / step + 1e-6).floor());
    let fits = |(times, power): &(f64, i32)| {
        let (first, last) = bounds(times * 10f64.powi(*power));
        last - first < 8.0
    };
    let steps = [(1.0, power), (2.0, power), (5.0, power), (1.0, power + 1)];
    let (times, power) = steps.into_iter().find(fits).unwrap_or((2.0, power + 1));
    let step = times * 10f64.powi(power);
    let digits = (-power).max(0) as usize;
    let (first, last) = bounds(step);
    let count = (last - first).clamp(0.0, 20.0) as i32;
    (0..=count)
        .map(|k| {
            // Adding 0 turns -0 into 0.
            let value = (first + f64::from(k)) * step + 0.0;
            (value, format!("{value:.digits$}"))
        })
        .collect()
}

/// The label of a time. It has enough digits to tell frames apart that are `interval` (s) apart.
pub fn time_label(time: f64, interval: f64) -> String {
    let digits = (-(interval.log10() + 1e-9).floor()).clamp(0.0, 12.0) as usize;
    // One more digit if the interval is not 1 to 9 times a power of ten.
    let whole = interval * 10f64.powi(digits as i32);
    let digits = if (whole - whole.round()).abs() > 1e-6 * whole { digits + 1 } else { digits };
    format!("t = {time:.digits$} s")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        ticks(Limits { low, high }).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_numbers_within_the_range() {
        assert_eq!(labels(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(0.07, 1.33), ["0.2", "0.4", "0.6", "0.8", "1.0", "1.2"]);
        assert_eq!(labels(-3.0, 3.0), ["-3", "-2", "-1", "0", "1", "2", "3"]);
        assert_eq!(labels(0.0, 6000.0), ["0", "1000", "2000", "3000", "4000", "5000", "6000"]);
    }

    #[test]
    fn every_range_has_some_ticks() {
        for k in 0..400 {
            let low = -2.0 + 0.01 * f64::from(k);
            for width in [1e-3, 0.013, 0.7, 1.0, 33.3, 9e4] {
                let found = ticks(Limits { low, high: low + width });
                assert!((3..=8).contains(&found.len()), "{low} {width}: {found:?}");
                assert!(
                    found
                        .iter()
                        .all(|(tick, _)| *tick > low - width * 1e-5 && *tick < low + width * 1.000_01)
                );
                let labels: std::collections::BTreeSet<_> = found.iter().map(|(_, label)| label).collect();
                assert_eq!(labels.len(), found.len(), "{found:?}");
            }
        }
    }

    #[test]
    fn small_and_large_numbers_have_their_power_in_the_title() {
        let bar = Bar::new(Quantity::Overlap, Limits { low: 0.0, high: 0.004 });
        assert_eq!(bar.title, "overlap (1e-3 m)");
        assert_eq!(bar.ticks.last().unwrap().1, "4");
        assert!((bar.ticks.last().unwrap().0 - 0.004).abs() < 1e-12);
        assert_eq!(Bar::new(Quantity::Force, Limits { low: 0.0, high: 2e7 }).title, "normal force (1e7 N)");
        assert_eq!(Bar::new(Quantity::Height, Limits { low: 0.0, high: 2.0 }).title, "height (m)");
    }

    #[test]
    fn times_have_the_digits_that_tell_frames_apart() {
        assert_eq!(time_label(8.0, 0.02), "t = 8.00 s");
        assert_eq!(time_label(1.0, 0.025), "t = 1.000 s");
        assert_eq!(time_label(2.0, 1.0), "t = 2 s");
        assert_eq!(time_label(0.5, 0.1), "t = 0.5 s");
        assert_eq!(time_label(20.0, 10.0), "t = 20 s");
    }

    #[test]
    fn a_picture_too_small_for_a_legend_is_refused() {
        let layout = |width, height, plain| {
            Layout::new(
                Size { width, height },
                Quantity::Height,
                Limits { low: 0.0, high: 1.0 },
                &[],
                plain,
                "t = 1 s",
            )
        };
        let refused = layout(150, 150, false).unwrap_err();
        assert!(refused.to_string().starts_with("--size 150x150: too small"), "{refused}");
        layout(150, 150, true).unwrap();
        layout(320, 240, false).unwrap();
    }
}
