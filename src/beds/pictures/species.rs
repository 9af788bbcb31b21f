//! Colours of species, and the legend that names them.

use super::picture::{Font, Picture};

/// Most letters of a name in the legend.
const MOST_LETTERS: usize = 20;

/// The colour of the species with this index, sRGB.
///
/// The first ten are chosen by hand to differ. Further ones go around the circle of hues by the golden angle,
/// which is never near where it has been, at three values of lightness in turn.
pub fn colour(index: usize) -> [u8; 3] {
    if let Some(colorous::Color { r, g, b }) = colorous::TABLEAU10.get(index) {
        return [*r, *g, *b];
    }
    let further = index - colorous::TABLEAU10.len();
    let hue = (0.4 + further as f64 * 0.618_033_988_749_894_9).fract();
    let lightness = [0.3, 0.5, 0.8][further % 3];
    // Hue and lightness, of full saturation, to red, green and blue.
    let spread = f64::min(lightness, 1.0 - lightness);
    [0.0, 8.0, 4.0].map(|shift| {
        let k = (shift + 12.0 * hue) % 12.0;
        let part = lightness - spread * f64::min(k - 3.0, 9.0 - k).clamp(-1.0, 1.0);
        (255.0 * part).round() as u8
    })
}

/// The legend of species: a square of its colour before each name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    names: Vec<String>,
}

impl Key {
    /// Title of the legend.
    pub const TITLE: &'static str = "species";

    /// The legend of species with these names.
    pub fn new(names: &[String]) -> Self {
        Key { names: names.iter().map(|name| written(name)).collect() }
    }

    /// Width of the squares and the names, pixels.
    pub fn width(&self, font: Font) -> usize {
        let letters = self.names.iter().map(|name| name.len()).max().unwrap_or(0);
        font.height() + font.width() * (letters + 1)
    }

    /// Draws the rows from the pixel `column`, between two rows of pixels; what has no room is counted in the
    /// last row.
    pub fn draw(
        &self,
        picture: &mut Picture,
        font: Font,
        column: usize,
        [top, bottom]: [usize; 2],
        ink: [u8; 3],
    ) {
        let step = font.height() + font.height() / 2;
        let room = ((bottom - top) / step).max(1);
        let shown = if self.names.len() <= room { self.names.len() } else { room - 1 };
        let text = column + font.height() + font.width();
        for (k, name) in self.names[..shown].iter().enumerate() {
            let row = top + k * step;
            picture.fill([column, row, column + font.height(), row + font.height()], colour(k));
            picture.write(font, text, row, name, ink);
        }
        if shown < self.names.len() {
            let more = format!("and {} more", self.names.len() - shown);
            picture.write(font, column, top + shown * step, &more, ink);
        }
    }
}

/// A name in the letters of the font, and not too long for the legend.
fn written(name: &str) -> String {
    let letter = |letter: char| if matches!(letter, ' '..='~') { letter } else { '?' };
    match name.chars().count() {
        0..=MOST_LETTERS => name.chars().map(letter).collect(),
        _ => name.chars().take(MOST_LETTERS - 2).map(letter).chain("..".chars()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::options::Size;
    use super::*;

    #[test]
    fn species_have_colours_that_differ_from_each_other_and_from_black_and_white() {
        let apart = |a: [u8; 3], b: [u8; 3]| {
            let squares = (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let mut colours = vec![[255; 3], [0; 3]];
        for index in 0..24 {
            let new = colour(index);
            let nearest = colours.iter().map(|&old| apart(old, new)).fold(f64::INFINITY, f64::min);
            assert!(nearest > 50.0, "{index}: {new:?} {nearest}");
            colours.push(new);
        }
    }

    #[test]
    fn names_are_written_in_letters_of_the_font_and_cut_if_they_are_long() {
        assert_eq!(written("sand"), "sand");
        assert_eq!(written("s\u{e4}nd"), "s?nd");
        assert_eq!(written("12345678901234567890"), "12345678901234567890");
        assert_eq!(written("123456789012345678901"), "123456789012345678..");
    }

    #[test]
    fn what_has_no_room_is_counted() {
        let names: Vec<String> = (0..9).map(|k| format!("s{k}")).collect();
        let size = Size { width: 200, height: 400 };
        let font = Font::for_picture(size);
        let drawn = |rows: usize| {
            let mut picture = Picture::new(size, [255; 3]);
            let step = font.height() + font.height() / 2;
            Key::new(&names).draw(&mut picture, font, 10, [20, 20 + rows * step], [0; 3]);
            (0..9).filter(|&k| picture.pixels.contains(&colour(k))).count()
        };
        assert_eq!([drawn(1), drawn(5), drawn(8), drawn(9)], [0, 4, 7, 9]);
    }
}
