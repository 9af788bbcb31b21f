//! How the errors of rows become the error of a step.

use crate::math::larger;

/// The error of a row may be this many times that of the step, where the step has a mean of errors.
const GUARD: f64 = 5.0;

/// Units in which errors over the tolerance, and their squares, are summed: sums of integers do not depend on
/// their order.
const UNIT: f64 = (1u64 << 36) as f64;

/// Errors over the tolerance above this count as this. Such a step is rejected for its largest error.
const MOST: f64 = 8.0;

/// Errors of some rows. The error of a step is that of all rows.
///
/// With a mean it is sum e^2/sum e, the contraharmonic mean: rows without an error, however many, do not
/// change it, and a row that is alone with its error has it in full. It is at least a fifth of the largest.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::Errors;
///
/// let tolerance = 0.1;
/// let all = Errors::of_rows(&[0.02, 0.06, 0.0, 0.0], Some(tolerance));
/// assert!((all.error() - 0.05).abs() < 1e-9); // (0.02^2 + 0.06^2)/(0.02 + 0.06)
/// assert_eq!(all.largest, 0.06);
/// assert_eq!(Errors::largest(0.06).error(), 0.06); // without a mean
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Errors {
    /// The largest; +infinity where anything is not finite.
    pub largest: f64,
    /// Sums of errors over the tolerance, and of their squares, in units of 2^-36; 0 without a mean.
    pub sums: [u64; 2],
    /// The tolerance; 0 without a mean.
    pub tolerance: f64,
}

impl Errors {
    /// Rows whose largest error is `error`. There is no mean.
    pub fn largest(error: f64) -> Self {
        Errors { largest: error, ..Errors::default() }
    }

    /// Rows with these `errors`, for a mean with this `tolerance` if there is one. NaN counts as +infinity.
    #[inline(always)] // To be compiled with the instructions of its caller.
    pub fn of_rows(errors: &[f64], tolerance: Option<f64>) -> Self {
        // Numbers that are not negative have the order of their bits, and NaN is beyond infinity.
        let largest = errors.iter().fold(0, |most, error| error.to_bits().cast_signed().max(most));
        let largest = larger(0.0, f64::from_bits(largest.cast_unsigned()));
        let Some(tolerance) = tolerance else { return Errors::largest(largest) };
        let mut sums = [0; 2];
        for error in errors {
            // An error that is NaN or infinite shows in the largest.
            let e = (error / tolerance).min(MOST);
            sums[0] += whole(e * UNIT);
            sums[1] += whole(e * e * UNIT);
        }
        Errors { largest, sums, tolerance }
    }

    /// The errors of two groups of rows.
    pub fn merge(self, other: Self) -> Self {
        Errors {
            largest: larger(self.largest, other.largest),
            sums: [0, 1].map(|k| self.sums[k].saturating_add(other.sums[k])),
            tolerance: self.tolerance.max(other.tolerance),
        }
    }

    /// The error of the step.
    pub fn error(&self) -> f64 {
        if self.tolerance == 0.0 || self.largest == f64::INFINITY {
            return self.largest;
        }
        let mean = self.sums[1] as f64 / (self.sums[0] as f64).max(1.0);
        larger(self.tolerance * mean, self.largest / GUARD)
    }
}

/// The number without its fraction, from 0 to below 2^52. Processors have vector instructions for this, which
/// many lack for the plain conversion.
#[inline(always)]
fn whole(x: f64) -> u64 {
    /// The last bits of a number from here to twice that are its distance from here.
    const BASE: f64 = (1u64 << 52) as f64;
    (x.trunc() + BASE).to_bits() - BASE.to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(rows: &[f64]) -> Errors {
        Errors::of_rows(rows, Some(0.1))
    }

    #[test]
    fn idle_rows_change_nothing_and_one_row_counts_in_full() {
        for error in [1e-4, 0.01, 0.09, 0.2] {
            let alone = all(&[error]).error();
            assert!((alone / error - 1.0).abs() < 1e-4, "{alone}");
            let among = [vec![error], vec![0.0; 100_000]].concat();
            assert_eq!(all(&among).error(), alone);
        }
    }

    #[test]
    fn errors_are_cut_to_whole_units() {
        for e in [0.0, 1e-12, 0.3, 1.0, 2.9, 7.999_999, 8.0] {
            let units = [e * UNIT, e * e * UNIT].map(|number| number as u64);
            assert_eq!(Errors::of_rows(&[e], Some(1.0)).sums, units);
        }
        assert_eq!(Errors::of_rows(&[9.0, f64::NAN], Some(1.0)).sums, [2 << 39, 2 << 42]);
    }

    #[test]
    fn no_row_errs_by_more_than_five_times_the_error_of_the_step() {
        let rows = [vec![0.3], vec![0.001; 10_000]].concat();
        assert!((all(&rows).error() - 0.06).abs() < 1e-12);
        // Errors too small for the sums are not lost.
        assert_eq!(all(&[1e-14, 1e-15]).error(), 1e-14 / 5.0);
        assert_eq!(all(&[]).error(), 0.0);
    }

    #[test]
    fn the_order_of_the_rows_does_not_matter_and_nan_is_infinite() {
        let mut rows: Vec<f64> = (1..1000).map(|k| 0.05 * (f64::from(k) * 0.7).sin().abs()).collect();
        let forward = all(&rows);
        rows.reverse();
        assert_eq!(forward, all(&rows));
        for wrong in [f64::NAN, f64::INFINITY] {
            rows[500] = wrong;
            assert_eq!(all(&rows).error(), f64::INFINITY);
        }
    }
}
