//! Values of command line options: projections, sizes, ranges and colours.

use std::str::FromStr;

use clap::ValueEnum;

/// How depth is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Projection {
    /// As an eye sees it: distant spheres look smaller
    Perspective,
    /// Parallel rays: equal spheres have equal size
    Orthographic,
}

/// Width and height of a picture, pixels.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::pictures::Size;
///
/// assert_eq!("1280x960".parse(), Ok(Size { width: 1280, height: 960 }));
/// assert!("1280".parse::<Size>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Smallest and largest number of pixels of a side.
const SIDES: std::ops::RangeInclusive<usize> = 16..=16384;

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = "it must be WIDTHxHEIGHT in pixels, such as 1280x960";
        let (width, height) = text.split_once('x').ok_or(wrong)?;
        let side = |text: &str| text.parse::<usize>().map_err(|_| wrong);
        let size = Size { width: side(width)?, height: side(height)? };
        if SIDES.contains(&size.width) && SIDES.contains(&size.height) {
            Ok(size)
        } else {
            Err(format!("width and height must be {} to {} pixels", SIDES.start(), SIDES.end()))
        }
    }
}

/// Values at the two ends of the colour scale, in the unit of the quantity.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::pictures::Limits;
///
/// let limits: Limits = "0,2.5".parse()?;
/// assert_eq!(limits.share(1.25), 0.5);
/// assert_eq!(limits.share(100.0), 1.0);
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The first colour stands for this value and all smaller ones.
    pub low: f64,
    /// The last colour stands for this value and all larger ones; > `low`.
    pub high: f64,
}

impl Limits {
    /// Position of `value` between the ends, 0 to 1; 0 for NaN.
    pub fn share(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }
}

impl FromStr for Limits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = "it must be two numbers with a comma between them, such as 0,2.5";
        let (low, high) = text.split_once(',').ok_or(wrong)?;
        let end = |text: &str| text.trim().parse::<f64>().map_err(|_| wrong);
        let limits = Limits { low: end(low)?, high: end(high)? };
        if limits.low < limits.high && (limits.high - limits.low).is_finite() {
            Ok(limits)
        } else {
            Err("the first number must be less than the second, and both finite".into())
        }
    }
}

/// Colour behind the spheres, sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Background(pub [u8; 3]);

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let hexadecimal = |text: &str| {
            let digits = text.strip_prefix('#').unwrap_or(text);
            let right = digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
            right.then(|| {
                [0, 2, 4]
                    .map(|k| u8::from_str_radix(&digits[k..k + 2], 16).expect("these are hexadecimal digits"))
            })
        };
        match text {
            "white" => Ok(Background([255; 3])),
            "black" => Ok(Background([0; 3])),
            "grey" | "gray" => Ok(Background([128; 3])),
            digits => hexadecimal(digits).map(Background).ok_or_else(|| {
                "it must be white, black, grey or six hexadecimal digits RRGGBB, such as f0f0f0".into()
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_and_checked() {
        assert_eq!("1920x1080".parse(), Ok(Size { width: 1920, height: 1080 }));
        for wrong in ["", "1920", "1920,1080", "x", "-5x7", "1e3x5", "15x100", "100x16385"] {
            assert!(wrong.parse::<Size>().unwrap_err().contains("pixels"), "{wrong}");
        }
    }

    #[test]
    fn ranges_are_read_and_clamp() {
        let limits: Limits = "-1, 3".parse().unwrap();
        assert_eq!(limits, Limits { low: -1.0, high: 3.0 });
        assert_eq!([-9.0, -1.0, 0.0, 3.0, 9.0].map(|value| limits.share(value)), [0.0, 0.0, 0.25, 1.0, 1.0]);
        assert_eq!(limits.share(f64::NAN), 0.0);
        for wrong in ["", "1", "1,", "a,b", "2,1", "1,1", "0,inf", "nan,1", "1,2,3"] {
            assert!(wrong.parse::<Limits>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn backgrounds_have_names_or_digits() {
        assert_eq!("white".parse(), Ok(Background([255; 3])));
        assert_eq!("f0a01B".parse(), Ok(Background([0xf0, 0xa0, 0x1b])));
        assert_eq!("#000102".parse(), Ok(Background([0, 1, 2])));
        for wrong in ["", "red", "fff", "gggggg", "+f+f+f", "äöü"] {
            assert!(wrong.parse::<Background>().unwrap_err().contains("RRGGBB"), "{wrong}");
        }
    }
}
