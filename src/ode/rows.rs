//! Vectors of numbers, as rows in segments.
//!
//! A segment holds rows of one kind, one after the other. All rows of a segment have the same columns. A
//! vector holds the segments one after the other.

use super::Errors;
use crate::math::larger;
use crate::threads::Cut;
use std::ops::Range;

/// Rows of one kind: how many there are on this process, and what their columns are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Number of rows on this process.
    pub rows: usize,
    /// Numbers in a row.
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
/// assert_eq!(norm.largest(part.rows(0..1), |k| errors[k]), 0.3);
/// assert_eq!(norm.largest(part, |k| errors[k]), f64::INFINITY);
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
    /// Errors of the rows of `part`, with the weighted magnitude of `value(k)` as in `largest`.
    pub fn errors(&self, part: Part, value: impl Fn(usize) -> f64) -> Errors {
        if self.mean.is_none() {
            return Errors::largest(self.largest(part, value));
        }
        let rows = 0..part.len / part.width.max(1);
        let of = |i: usize| Errors::of_row(self.largest(part.rows(i..i + 1), &value), self.mean);
        let none = Errors { tolerance: self.mean.unwrap_or(0.0), ..Errors::default() };
        rows.map(of).fold(none, Errors::merge)
    }

    /// Largest weighted magnitude of `value(k)` over the numbers k of `part`; NaN counts as +infinity.
    ///
    /// The index k counts from the start of the vector.
    pub fn largest(&self, part: Part, value: impl Fn(usize) -> f64) -> f64 {
        let weights = &self.weights[part.segment][..];
        assert_eq!(weights.len(), part.width, "every column of the segment has a weight");
        if part.segment == 0 && !self.rows.is_empty() {
            let own = &self.rows[part.row..part.row + part.len / part.width];
            return (part.start..).step_by(part.width).zip(own).fold(0.0, |most, (row, &factor)| {
                (0..part.width).fold(most, |most, c| {
                    let scaled = if self.rate { c >= 2 * part.positions } else { c < part.positions };
                    let weight = if scaled { weights[c] * factor } else { weights[c] };
                    larger(most, weight * value(row + c).abs())
                })
            });
        }
        match weights.len() {
            // The usual widths, which the compiler then knows.
            3 => largest::<3>(weights, part, value),
            6 => largest::<6>(weights, part, value),
            9 => largest::<9>(weights, part, value),
            width => {
                let weight = |k: usize| weights[(k - part.start) % width];
                part.range().fold(0.0, |most, k| larger(most, weight(k) * value(k).abs()))
            }
        }
    }
}

fn largest<const N: usize>(weights: &[f64], part: Part, value: impl Fn(usize) -> f64) -> f64 {
    let (mut most, mut sum) = ([0.0; N], [0.0; N]);
    for row in (part.start..part.start + part.len).step_by(N) {
        for c in 0..N {
            let weighted = weights[c] * value(row + c).abs();
            most[c] = if weighted > most[c] { weighted } else { most[c] };
            sum[c] += weighted;
        }
    }
    // The comparison misses what is NaN, the sum does not.
    if sum.iter().any(|sum| sum.is_nan()) {
        return f64::INFINITY;
    }
    most.into_iter().fold(0.0, larger)
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
            assert_eq!(norm.largest(layout.whole(0), |k| y[k]), 20.0);
            assert_eq!(norm.largest(layout.row(0, 2), |k| y[k]), 10.0);
            for at in 0..3 * width {
                let mut broken = y.clone();
                broken[at] = f64::NAN;
                assert_eq!(norm.largest(layout.whole(0), |k| broken[k]), f64::INFINITY);
                assert_eq!(largest_magnitude(&broken), f64::INFINITY);
            }
        }
    }

    #[test]
    fn every_row_may_weigh_its_positions_or_what_follows_its_velocities() {
        let layout = Layout(vec![Segment { rows: 2, width: 3, positions: 1 }]);
        let norm = |rate| Norm { weights: vec![vec![1.0; 3]], rate, mean: None, rows: vec![4.0, 0.5] };
        let largest = |rate, row: usize, c: usize| {
            norm(rate).largest(layout.row(0, row), |k| f64::from(u8::from(k == 3 * row + c)))
        };
        let all = |rate| [0, 1].map(|row| [0, 1, 2].map(|c| largest(rate, row, c)));
        assert_eq!(all(false), [[4.0, 1.0, 1.0], [0.5, 1.0, 1.0]]);
        assert_eq!(all(true), [[1.0, 1.0, 4.0], [1.0, 1.0, 0.5]]);
        assert_eq!(norm(false).largest(layout.whole(0), |_| f64::NAN), f64::INFINITY);
    }
}
