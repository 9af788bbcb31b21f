//! Exact sums: terms as integers, whose sum has the same bits in any order and in any number of parts.

use super::larger;
use crate::threads::{self, GRAIN};

/// A power of two that turns the terms of a sum into integers of at most 2^60.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::exact::{Scale, largest, total};
///
/// let terms = [1e16, 1.0, -1e16];
/// let scale = Scale::of(largest(3, |i| terms[i]));
/// assert_eq!(scale.value(total(3, |i| terms[i], scale)), 1.0);
/// assert_eq!(terms.iter().sum::<f64>(), 0.0); // a plain sum loses it
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Two factors, since one could overflow. Powers of two scale without rounding.
    up: [f64; 2],
    down: [f64; 2],
}

impl Scale {
    /// The scale for terms up to `largest` in magnitude; 1 if that is 0 or not finite.
    pub fn of(largest: f64) -> Self {
        let regular = largest.is_finite() && largest > 0.0;
        let exponent = if regular { 60 - (largest.log2().floor() as i32 + 1) } else { 0 };
        let parts = [exponent - exponent / 2, exponent / 2];
        Scale { up: parts.map(|part| 2f64.powi(part)), down: parts.map(|part| 2f64.powi(-part)) }
    }

    /// The scaled term rounded to the nearest integer, halves away from zero.
    ///
    /// The same as `f64::round`, but without a call of the C library.
    #[inline(always)]
    pub fn integer(&self, term: f64) -> i64 {
        let x = term * self.up[0] * self.up[1];
        let whole = x as i64;
        let rest = x - whole as f64;
        // A term beyond 64 bits, such as an infinite one, becomes the largest integer.
        whole.saturating_add(i64::from(rest >= 0.5)).saturating_sub(i64::from(rest <= -0.5))
    }

    /// The value of a sum of integers.
    pub fn value(&self, total: i128) -> f64 {
        total as f64 * self.down[0] * self.down[1]
    }
}

/// Largest magnitude of `term(i)` for i in 0..n; infinite if a term is NaN.
pub fn largest(n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    threads::fold(n, GRAIN, |i| term(i).abs(), 0.0, larger)
}

/// Sum of `term(i)` for i in 0..n as an integer, in units of `scale`.
pub fn total(n: usize, term: impl Fn(usize) -> f64 + Sync, scale: Scale) -> i128 {
    threads::fold(n, GRAIN, |i| i128::from(scale.integer(term(i))), 0, |a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_are_those_that_rounding_gives() {
        let scale = Scale::of(1.5);
        let unit = 2f64.powi(-59);
        for k in [
            0.0,
            0.49,
            0.5,
            1.5,
            2.5,
            2.51,
            1e6 + 0.5,
            2f64.powi(40) + 0.5,
            2f64.powi(52) + 1.0,
            2f64.powi(59),
        ] {
            for x in [k, -k] {
                assert_eq!(scale.integer(x * unit), x.round() as i64, "{x}");
            }
        }
        for x in [f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, f64::NAN] {
            assert_eq!(scale.integer(x), x.round() as i64, "{x}");
        }
    }
}
