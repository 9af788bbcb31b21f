//! Mathematics without physics: vectors, elementary functions, exact sums, vector lanes, statistics, digits.

pub mod digits;
pub mod elementary;
pub mod exact;
pub mod instructions;
pub mod interval;
pub mod vector;

/// The larger of two magnitudes where NaN counts as +infinity (`f64::max` would drop it).
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if b <= a {
        a
    } else if b.is_nan() {
        f64::INFINITY
    } else {
        // a < b, or a is NaN, which no caller passes: magnitudes are folded from 0.
        b
    }
}
