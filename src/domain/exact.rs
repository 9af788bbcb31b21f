//! Sums over all particles that do not depend on how the particles are spread over ranks.

use super::Comm;
use crate::ode::larger;
use crate::parallel::{self, GRAIN};

/// How terms become integers, which have no order: by a power of two that makes 2^60 of the largest.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Powers of two scale without rounding; two factors reach where one would overflow.
    up: [f64; 2],
    down: [f64; 2],
}

impl Scale {
    /// For terms up to `largest` in magnitude.
    fn of(largest: f64) -> Self {
        let regular = largest.is_finite() && largest > 0.0;
        let exponent = if regular { 60 - (largest.log2().floor() as i32 + 1) } else { 0 };
        let parts = [exponent - exponent / 2, exponent / 2];
        Scale { up: parts.map(|part| 2f64.powi(part)), down: parts.map(|part| 2f64.powi(-part)) }
    }

    /// The integer next to a term, away from zero where two are: `f64::round`, without a call of the C library.
    #[inline(always)]
    pub fn integer(&self, term: f64) -> i64 {
        let x = term * self.up[0] * self.up[1];
        let whole = x as i64;
        let rest = x - whole as f64;
        // What is beyond 64 bits, as where a term is infinite, is the largest there is.
        whole.saturating_add(i64::from(rest >= 0.5)).saturating_sub(i64::from(rest <= -0.5))
    }
}

/// Sums over all ranks of terms that are rounded to 2^-60 of the largest: integers have no order, so the bits are the
/// same for any number of ranks. `largest` are the magnitudes of this rank's largest terms, infinite where a term is not a
/// number; `totals` gives the sums of its terms as integers. Non-finite terms make a sum NaN. At most 2^33 terms a job.
/// Collective.
pub fn exact_sums<const K: usize>(
    comm: &dyn Comm,
    mut largest: [f64; K],
    totals: impl FnOnce([Scale; K]) -> [i128; K],
) -> [f64; K] {
    comm.max(&mut largest);
    let scales = largest.map(Scale::of);
    let mut limbs = totals(scales).map(|total| [(total & 0xffff_ffff) as u64, (total >> 32) as i64 as u64]);
    comm.sum(limbs.as_flattened_mut());
    std::array::from_fn(|k| {
        let total = (i128::from(limbs[k][1] as i64) << 32) + i128::from(limbs[k][0]);
        let [first, second] = scales[k].down;
        if largest[k].is_finite() { total as f64 * first * second } else { f64::NAN }
    })
}

/// Sum over all ranks of `term(i)` for i in 0..n, as by `exact_sums`. Collective.
pub fn exact_sum(comm: &dyn Comm, n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let [sum] = exact_sums(comm, [largest(n, &term)], |[scale]| [total(n, &term, scale)]);
    sum
}

/// Largest magnitude of `term(i)` for i in 0..n; infinite where one is not a number.
pub fn largest(n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    parallel::fold(n, GRAIN, |i| term(i).abs(), 0.0, larger)
}

/// Sum of `term(i)` for i in 0..n in units of `scale`.
pub fn total(n: usize, term: impl Fn(usize) -> f64 + Sync, scale: Scale) -> i128 {
    parallel::fold(n, GRAIN, |i| i128::from(scale.integer(term(i))), 0, |a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;

    #[test]
    fn the_order_of_the_terms_does_not_matter() {
        let mut terms: Vec<f64> = (0..1000).map(|k| (k as f64 * 0.7).sin() * 10f64.powi(k % 9 - 4)).collect();
        let forward = exact_sum(&Solo, terms.len(), |i| terms[i]);
        terms.reverse();
        assert_eq!(forward, exact_sum(&Solo, terms.len(), |i| terms[i]));
        let plain: f64 = terms.iter().sum();
        assert!((forward - plain).abs() <= 1e-12 * plain.abs());
    }

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

    #[test]
    fn tiny_huge_and_missing_terms_are_summed() {
        let sum = |terms: &[f64]| exact_sum(&Solo, terms.len(), |i| terms[i]);
        assert_eq!(sum(&[]), 0.0);
        assert_eq!(sum(&[-3.25]), -3.25);
        assert_eq!(sum(&[1e300, 1e300]), 2e300);
        assert_eq!(sum(&[1e-300, 3e-300]), 4e-300);
        assert!(sum(&[1.0, f64::NAN]).is_nan());
        assert!(sum(&[1.0, f64::INFINITY]).is_nan());
    }
}
