//! Sums over all particles that do not depend on how the particles are spread over ranks.

use super::Comm;
use crate::math::exact::{Scale, largest, total};

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
        if largest[k].is_finite() { scales[k].value(total) } else { f64::NAN }
    })
}

/// Sum over all ranks of `term(i)` for i in 0..n, as by `exact_sums`. Collective.
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
