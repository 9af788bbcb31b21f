//! Sums over the particles of all ranks, with the same bits for any number of ranks.

use super::Comm;
use crate::math::exact::{Scale, largest, total};

/// `K` sums over the terms of all ranks, with the same bits for any number of ranks. Collective.
///
/// Each term is rounded to 2^-60 of the largest of its sum and becomes an integer, so that the order of the
/// terms does not matter. All ranks together may have at most 2^33 terms.
///
/// `largest` holds the magnitude of this rank's largest term of each sum, infinite if a term is NaN. `totals`
/// returns the sums of this rank's terms as integers, in units of the given scales. A sum with a non-finite
/// term is NaN.
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
        if largest[k].is_finite() { scales[k].value(total) } else { f64::NAN }
    })
}

/// Sum of `term(i)` for i in 0..n over all ranks, each with its own n and terms; see [`exact_sums`].
/// Collective.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::domain::exact::exact_sum;
///
/// let terms = [0.1, 0.2, 0.3, -0.6];
/// let sum = exact_sum(&Solo, 4, |i| terms[i]);
/// assert_eq!(sum, exact_sum(&Solo, 4, |i| terms[3 - i])); // the same bits
/// ```
pub fn exact_sum(comm: &dyn Comm, n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let [sum] = exact_sums(comm, [largest(n, &term)], |[scale]| [total(n, &term, scale)]);
    sum
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
