//! A picture in memory, with text on it.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::options::Size;

/// A picture: its pixels in sRGB, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Its size.
    pub size: Size,
    /// The colours.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// A picture of a single colour.
    pub fn new(size: Size, colour: [u8; 3]) -> Self {
        Picture { size, pixels: vec![colour; size.width * size.height] }
    }

    /// All bytes, in the order of the file formats.
    pub fn bytes(&self) -> &[u8] {
        self.pixels.as_flattened()
    }

    /// Blends `ink` over a pixel with the given strength, 0 to 255. Outside the picture it does nothing.
    pub fn ink(&mut self, column: usize, row: usize, ink: [u8; 3], strength: u8) {
        if column < self.size.width && row < self.size.height {
            let pixel = &mut self.pixels[row * self.size.width + column];
            let strength = u32::from(strength);
            for (old, new) in pixel.iter_mut().zip(ink) {
                *old = ((u32::from(*old) * (255 - strength) + u32::from(new) * strength + 127) / 255) as u8;
            }
        }
    }

    /// Fills the columns from `left` to `right` and the rows from `top` to `bottom`, without the last ones.
    pub fn fill(&mut self, [left, top, right, bottom]: [usize; 4], ink: [u8; 3]) {
        for row in top..bottom {
            for column in left..right {
                self.ink(column, row, ink, 255);
            }
        }
    }

    /// Writes the ASCII `text` with its upper left corner at the given pixel.
    pub fn write(&mut self, font: Font, column: usize, row: usize, text: &str, ink: [u8; 3]) {
        for (k, letter) in text.chars().enumerate() {
            let Some(glyph) = get_raster(letter, FontWeight::Regular, font.raster) else { continue };
            for (y, line) in glyph.rows().enumerate() {
                for (x, &strength) in line.iter().enumerate().filter(|(_, strength)| **strength > 0) {
                    for dot in 0..font.times * font.times {
                        let (dx, dy) = (dot % font.times, dot / font.times);
                        self.ink(
                            column + k * font.width() + x * font.times + dx,
                            row + y * font.times + dy,
                            ink,
                            strength,
                        );
                    }
                }
            }
        }
    }
}

/// A font of one size. All letters have the same width.
#[derive(Debug, Clone, Copy)]
pub struct Font {
    raster: RasterHeight,
    /// Pixels of the picture for each pixel of the font; > 1 in pictures too large for the largest font.
    times: usize,
}

impl Font {
    /// The font size that suits a picture of `size`.
    pub fn for_picture(size: Size) -> Self {
        match size.height.min(size.width) / 36 {
            0..18 => Font { raster: RasterHeight::Size16, times: 1 },
            18..23 => Font { raster: RasterHeight::Size20, times: 1 },
            23..29 => Font { raster: RasterHeight::Size24, times: 1 },
            wanted => Font { raster: RasterHeight::Size32, times: ((wanted + 16) / 32).max(1) },
        }
    }

    /// Height of a line, pixels.
    pub fn height(self) -> usize {
        self.raster.val() * self.times
    }

    /// Width of a letter, pixels.
    pub fn width(self) -> usize {
        get_raster_width(FontWeight::Regular, self.raster) * self.times
    }
}
