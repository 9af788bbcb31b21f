//! Colours and markers. A method has the same ones in all figures.

use super::canvas::{Canvas, Drawn, Pixel};
use crate::ode::{MethodName, NormName};
use plotters::style::{RGBColor, WHITE};

/// Methods in the order of their looks. A method has the same look in every comparison.
const METHODS: [&str; 6] = [
    MethodName::Merson.name(),
    MethodName::DormandPrince.name(),
    MethodName::Chebyshev.name(),
    MethodName::Auto.name(),
    MethodName::VelocityVerlet.name(),
    NormName::Paper.name(),
];

/// The colours of Okabe and Ito (2008), which colour-blind readers can distinguish.
///
/// Their yellow is left out, because it is hard to see on white.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(0, 0, 0),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// Half the size of a marker, px.
const RADIUS: i32 = 5;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Circle,
    Square,
    Triangle,
    Diamond,
    TriangleDown,
    Pentagon,
}

/// The number of shapes and the number of colours differ by one, so that 42 looks differ.
const SHAPES: [Shape; 6] =
    [Shape::Circle, Shape::Square, Shape::Triangle, Shape::Diamond, Shape::TriangleDown, Shape::Pentagon];

/// How a point is marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// An ordinary point.
    Full,
    /// A point with missing information.
    Hollow,
    /// A failed point.
    Crossed,
}

/// The colour and the marker of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// Colour of lines, markers and labels.
    pub colour: RGBColor,
    shape: Shape,
}

impl Look {
    /// The look with this number. Large numbers start again from the first look.
    pub fn number(number: usize) -> Look {
        Look { colour: COLOURS[number % COLOURS.len()], shape: SHAPES[number % SHAPES.len()] }
    }

    /// Draws the marker.
    pub fn marker(self, canvas: &Canvas, (x, y): Pixel, mark: Mark) -> Drawn {
        let r = RADIUS;
        let inside = if mark == Mark::Full { self.colour } else { WHITE };
        let corners: &[Pixel] = match self.shape {
            Shape::Circle => &[],
            Shape::Square => &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
            Shape::Triangle => &[(0, -6), (6, 4), (-6, 4)],
            Shape::Diamond => &[(0, -6), (6, 0), (0, 6), (-6, 0)],
            Shape::TriangleDown => &[(0, 6), (6, -4), (-6, -4)],
            Shape::Pentagon => &[(0, -6), (6, -2), (4, 5), (-4, 5), (-6, -2)],
        };
        if corners.is_empty() {
            canvas.circle((x, y), r, inside, self.colour)?;
        } else {
            let corners: Vec<Pixel> = corners.iter().map(|&(dx, dy)| (x + dx, y + dy)).collect();
            canvas.polygon(&corners, inside, self.colour)?;
        }
        if mark == Mark::Crossed {
            canvas.line(vec![(x - r - 2, y - r - 2), (x + r + 2, y + r + 2)], self.colour, 2)?;
            canvas.line(vec![(x - r - 2, y + r + 2), (x + r + 2, y - r - 2)], self.colour, 2)?;
        }
        Ok(())
    }
}

/// The looks of `names`, in their order. Known methods have fixed looks; other names get the next free ones.
pub fn looks<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Look> {
    let numbers: Vec<Option<usize>> =
        names.into_iter().map(|name| METHODS.iter().position(|&method| method == name)).collect();
    let mut free = (0..).filter(|number| !numbers.contains(&Some(*number)));
    numbers.iter().filter_map(|number| number.or_else(|| free.next())).map(Look::number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_looks_the_same_whatever_it_is_compared_with() {
        let all = looks(METHODS);
        let two = looks(["chebyshev", "merson"]);
        assert_eq!(two, [all[2], all[0]]);
    }

    #[test]
    fn forty_two_names_look_different() {
        let names: Vec<String> = (0..42).map(|k| format!("line {k}")).collect();
        let looks = looks(names.iter().map(String::as_str));
        for (k, look) in looks.iter().enumerate() {
            assert!(!looks[..k].contains(look), "{k}");
        }
    }
}
