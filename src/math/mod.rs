//! Mathematics without physics: vectors, points in cells, elementary functions, exact sums, vector
//! instructions, statistics, and numbers as text.

pub mod cells;
pub mod digits;
pub mod elementary;
pub mod exact;
pub mod instructions;
pub mod interval;
pub mod polyhedron;
pub mod sized_cells;
pub mod vector;

/// The larger of two magnitudes; a NaN in `b` counts as +infinity (`f64::max` would drop it).
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::larger;
///
/// assert_eq!(larger(1.0, 2.0), 2.0);
/// assert_eq!(larger(1.0, f64::NAN), f64::INFINITY);
/// ```
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if b <= a {
        a
    } else if b.is_nan() {
        f64::INFINITY
    } else {
        // a < b. `a` is never NaN: callers fold magnitudes from 0.
        b
    }
}
