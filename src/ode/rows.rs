//! Vectors of numbers, as rows in segments.
//!
//! A segment holds rows of one kind, one after the other. All rows of a segment have the same columns. A
//! vector holds the segments one after the other.

use super::Errors;
use super::sums::{Term, sum};
use crate::math::instructions::{Lanes, Vectorised, run_widest};
use crate::math::larger;
use crate::threads::Cut;
use std::ops::Range;

/// Rows of one kind: how many there are on this process, and what their columns are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Number of rows on this process.
    pub rows: usize,
    /// Numbers in a row, 576 at most.
    pub width: usize,
    /// Number of columns that are positions. They come first, and their velocities follow in the same order.
    ///
    /// Columns after these are of first order. Velocity Verlet treats them like velocities.
    pub positions: usize,
}

/// The segments of all vectors of a problem, in order.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{Layout, Segment};
///
/// // Ten particles with position and velocity, and five rows of another kind.
/// let particles = Segment { rows: 10, width: 6, positions: 3 };
/// let others = Segment { rows: 5, width: 1, positions: 0 };
/// let layout = Layout(vec![particles, others]);
/// assert_eq!(layout.len(), 65);
/// assert_eq!(layout.row(0, 2).range(), 12..18);
/// assert_eq!(layout.whole(1).range(), 60..65);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Layout(pub Vec<Segment>);

impl Layout {
    /// Numbers in a vector.
    pub fn len(&self) -> usize {
        self.0.iter().map(|segment| segment.rows * segment.width).sum()
    }

    /// Whether vectors hold no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All rows of segment `k`.
    pub fn whole(&self, k: usize) -> Part {
        let start = self.0[..k].iter().map(|segment| segment.rows * segment.width).sum();
        let Segment { rows, width, positions } = self.0[k];
        Part { segment: k, row: 0, start, len: rows * width, width, positions }
    }

    /// Row `i` of segment `k`.
    pub fn row(&self, k: usize, i: usize) -> Part {
        self.whole(k).rows(i..i + 1)
    }

    /// All segments, each as one part.
    pub fn parts(&self) -> impl Iterator<Item = Part> {
        (0..self.0.len()).map(|k| self.whole(k))
    }
}

/// Consecutive rows of one segment.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{Layout, Segment};
///
/// let part = Layout(vec![Segment { rows: 1, width: 2, positions: 1 }]).whole(0);
/// let mut numbers = [0.0, 1.0]; // x in m, v in m/s
/// part.kick(0.5, &[1.0, -2.0], &mut numbers); // the slope of v is the acceleration
/// assert_eq!(numbers, [0.0, 0.0]);
/// numbers[1] = 3.0;
/// part.drift(0.5, &mut numbers);
/// assert_eq!(numbers, [1.5, 3.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Index of the segment.
    pub segment: usize,
    /// Index of the first row in its segment.
    pub row: usize,
    /// Index of the first number in the vector.
    pub start: usize,
    /// Length in numbers.
    pub len: usize,
    /// Numbers in a row.
    pub width: usize,
    /// Columns that are positions, as for [`Segment::positions`].
    pub positions: usize,
}

impl Part {
    /// Indices of the numbers in the vector.
    pub fn range(&self) -> Range<usize> {
        self.start..self.start + self.len
    }

    /// Some rows of the part, by their index in it.
    pub fn rows(&self, rows: Range<usize>) -> Part {
        Part {
            row: self.row + rows.start,
            start: self.start + rows.start * self.width,
            len: rows.len() * self.width,
            ..*self
        }
    }

    /// Adds `h` times the slopes to all columns of `numbers` that are not positions.
    pub fn kick(&self, h: f64, slopes: &[f64], numbers: &mut [f64]) {
        let rows = numbers.chunks_exact_mut(self.width).zip(slopes.chunks_exact(self.width));
        for (row, slope) in rows {
            for (number, slope) in row[self.positions..].iter_mut().zip(&slope[self.positions..]) {
                *number += slope * h;
            }
        }
    }

    /// Adds `h` times the velocities to the positions in `numbers`.
    pub fn drift(&self, h: f64, numbers: &mut [f64]) {
        for row in numbers.chunks_exact_mut(self.width) {
            let (positions, rest) = row.split_at_mut(self.positions);
            for (x, v) in positions.iter_mut().zip(rest) {
                *x += *v * h;
            }
        }
    }
}

/// Consecutive rows of a vector, lent to whoever changes them. They can be cut between rows.
#[derive(Debug)]
pub struct Rows<'a> {
    /// The numbers, row after row.
    pub numbers: &'a mut [f64],
    /// Numbers in a row; 0 for a vector that is not used, which holds no numbers.
    pub width: usize,
}

impl<'a> Rows<'a> {
    /// Rows of the given `width`; where there are no numbers, a vector that is not used.
    pub fn new(numbers: &'a mut [f64], width: usize) -> Self {
        let width = if numbers.is_empty() { 0 } else { width };
        Rows { numbers, width }
    }
}

impl Cut for Rows<'_> {
    fn cut(self, at: usize) -> (Self, Self) {
        let (before, after) = self.numbers.split_at_mut(at * self.width);
        (Rows { numbers: before, width: self.width }, Rows { numbers: after, width: self.width })
    }
}

/// How the error of a step is measured.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{Layout, Norm, Segment};
///
/// let part = Layout(vec![Segment { rows: 2, width: 2, positions: 1 }]).whole(0);
/// // Positions count ten times as much as velocities.
/// let norm = Norm { weights: vec![vec![10.0, 1.0]], rate: false, mean: None, rows: Vec::new() };
/// let errors = [0.01, -0.3, 0.02, f64::NAN];
/// assert_eq!(norm.largest(part.rows(0..1), &errors[..2]), 0.3);
/// assert_eq!(norm.largest(part, &errors), f64::INFINITY);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Norm {
    /// For every segment the weight of each column: what its numbers are multiplied by before they are
    /// compared with a tolerance.
    pub weights: Vec<Vec<f64>>,
    /// Whether the error is a rate, as in the paper: 3/h times the local error, as published for Merson's
    /// method. Otherwise it is the local error itself.
    pub rate: bool,
    /// For a mean of the errors of rows the tolerance; none where the largest error counts. See [`Errors`].
    pub mean: Option<f64>,
    /// For every row of the first segment a factor of the weights of some columns: of positions, or of what
    /// follows the velocities if the error is a rate. Empty where all are 1.
    pub rows: Vec<f64>,
}

impl Norm {
    /// Errors of the rows of `part`, of which the weighted sum of `terms` is the error.
    pub fn errors(&self, part: Part, terms: &[Term]) -> Errors {
        let weights = &self.weights[part.segment][..];
        assert_eq!(weights.len(), part.width, "every column of the segment has a weight");
        assert!(part.width <= NUMBERS, "a row has {NUMBERS} numbers at most");
        let own = part.segment == 0 && !self.rows.is_empty();
        let factors = if own { &self.rows[part.row..part.row + part.len / part.width] } else { &[] };
        let (start, end) = if self.rate { (2 * part.positions, part.width) } else { (0, part.positions) };
        run_widest(RowErrors { len: part.len, weights, factors, scaled: start..end, terms, mean: self.mean })
    }

    /// Largest weighted magnitude of the `numbers` of `part`; NaN counts as +infinity.
    pub fn largest(&self, part: Part, numbers: &[f64]) -> f64 {
        self.errors(part, &[(numbers, 1.0)]).largest
    }
}

/// Rows, and numbers, whose errors are found at a time. They stay in the first-level cache.
const ROWS: usize = 64;
const NUMBERS: usize = 576;

/// Finds the largest weighted magnitudes of rows, and what errors they are.
struct RowErrors<'a> {
    /// Length of the rows in numbers.
    len: usize,
    /// Weights of columns.
    weights: &'a [f64],
    /// For every row a factor of the weights of the columns `scaled`; empty where all are 1.
    factors: &'a [f64],
    scaled: Range<usize>,
    terms: &'a [Term<'a>],
    mean: Option<f64>,
}

impl Vectorised for RowErrors<'_> {
    type Output = Errors;

    #[inline(always)]
    fn work<L: Lanes>(self) -> Errors {
        let width = self.weights.len().max(1);
        let mut all = Errors::of_rows(&[], self.mean);
        let mut numbers = [0.0; NUMBERS];
        let most = ROWS.min(NUMBERS / width);
        for start in (0..self.len).step_by(most * width) {
            let numbers = &mut numbers[..(self.len - start).min(most * width)];
            sum(self.terms, start, numbers);
            let (count, mut errors) = (numbers.len() / width, [0.0; ROWS]);
            self.weigh(numbers, start / width, &mut errors[..count]);
            all = all.merge(Errors::of_rows(&errors[..count], self.mean));
        }
        all
    }
}

impl RowErrors<'_> {
    /// Finds the largest weighted magnitude in each row of `numbers`, or NaN, for the rows from `first` on.
    #[inline(always)]
    fn weigh(&self, numbers: &[f64], first: usize, errors: &mut [f64]) {
        let width = self.weights.len();
        let mut factors = [1.0; ROWS];
        let factors = &mut factors[..errors.len()];
        if !self.factors.is_empty() {
            factors.copy_from_slice(&self.factors[first..first + errors.len()]);
        }
        for (c, &weight) in self.weights.iter().enumerate() {
            let scaled = self.scaled.contains(&c);
            for ((error, row), factor) in errors.iter_mut().zip(numbers.chunks_exact(width)).zip(&*factors) {
                let weight = if scaled { weight * factor } else { weight };
                let weighted = (weight * row[c]).abs();
                // The bits of magnitudes have the same order, and NaN is beyond infinity.
                let is_larger = weighted.to_bits().cast_signed() > error.to_bits().cast_signed();
                *error = if is_larger { weighted } else { *error };
            }
        }
    }
}

/// Largest magnitude of some numbers; NaN counts as +infinity.
pub fn largest_magnitude(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, number| larger(most, number.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_second_segment_start_behind_the_first() {
        let segment = |rows, width, positions| Segment { rows, width, positions };
        let layout = Layout(vec![segment(4, 6, 3), segment(5, 3, 0)]);
        assert_eq!(layout.len(), 39);
        assert_eq!(layout.whole(1).range(), 24..39);
        assert_eq!(layout.row(1, 2).range(), 30..33);
        assert_eq!(layout.row(0, 3).range(), 18..24);
    }

    #[test]
    fn a_kick_changes_velocities_and_a_drift_positions() {
        let layout = Layout(vec![Segment { rows: 2, width: 3, positions: 1 }]);
        let mut y = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        layout.whole(0).kick(0.5, &[9.0, 2.0, 4.0, 9.0, 6.0, 8.0], &mut y);
        assert_eq!(y, [1.0, 3.0, 5.0, 4.0, 8.0, 10.0]);
        layout.whole(0).drift(0.5, &mut y);
        assert_eq!(y, [2.5, 3.0, 5.0, 8.0, 8.0, 10.0]);
    }

    #[test]
    fn the_largest_number_is_weighted_by_its_column_and_nan_is_infinite() {
        for width in [2, 6, 9] {
            let layout = Layout(vec![Segment { rows: 3, width, positions: 1 }]);
            let weights = (0..width).map(|c| if c == 1 { 10.0 } else { 1.0 }).collect();
            let norm = Norm { weights: vec![weights], rate: false, mean: None, rows: Vec::new() };
            let mut y = vec![1.0; 3 * width];
            y[width + 1] = -2.0;
            y[2 * width] = 7.0;
            assert_eq!(norm.largest(layout.whole(0), &y), 20.0);
            assert_eq!(norm.largest(layout.row(0, 2), &y[2 * width..]), 10.0);
            for at in 0..3 * width {
                let mut broken = y.clone();
                broken[at] = f64::NAN;
                assert_eq!(norm.largest(layout.whole(0), &broken), f64::INFINITY);
                assert_eq!(largest_magnitude(&broken), f64::INFINITY);
            }
        }
    }

    #[test]
    fn every_row_may_weigh_its_positions_or_what_follows_its_velocities() {
        let layout = Layout(vec![Segment { rows: 2, width: 3, positions: 1 }]);
        let norm = |rate| Norm { weights: vec![vec![1.0; 3]], rate, mean: None, rows: vec![4.0, 0.5] };
        let largest = |rate, row: usize, c: usize| {
            let numbers = [0, 1, 2].map(|k| f64::from(u8::from(k == c)));
            norm(rate).largest(layout.row(0, row), &numbers)
        };
        let all = |rate| [0, 1].map(|row| [0, 1, 2].map(|c| largest(rate, row, c)));
        assert_eq!(all(false), [[4.0, 1.0, 1.0], [0.5, 1.0, 1.0]]);
        assert_eq!(all(true), [[1.0, 1.0, 4.0], [1.0, 1.0, 0.5]]);
        assert_eq!(norm(false).largest(layout.whole(0), &[f64::NAN; 6]), f64::INFINITY);
    }
}
