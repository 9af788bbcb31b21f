//! Sums over all particles that do not depend on how the particles are spread over ranks.

use super::Comm;

/// Sum of `terms` over all ranks, each rounded to 2^-60 of the largest: integers have no order, so the bits are the
/// same for any number of ranks. Non-finite terms make the sum NaN. At most 2^33 terms a job. Collective.
pub fn exact_sum(comm: &dyn Comm, terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let mut largest = [terms.clone().fold(0.0, |a, b| crate::ode::larger(a, b.abs()))];
    comm.max(&mut largest);
    let [largest] = largest;
    if largest == 0.0 {
        return 0.0;
    }
    if !largest.is_finite() {
        return f64::NAN;
    }
    // Powers of two scale without rounding; two factors reach where one would overflow.
    let exponent = largest.log2().floor() as i32 + 1;
    let (up, rest) = (60 - exponent - (60 - exponent) / 2, (60 - exponent) / 2);
    let scaled = |x: f64| (x * 2f64.powi(up) * 2f64.powi(rest)).round() as i128;
    let total: i128 = terms.map(scaled).sum();
    let mut limbs = [(total & 0xffff_ffff) as u64, (total >> 32) as i64 as u64];
    comm.sum(&mut limbs);
    let total = (i128::from(limbs[1] as i64) << 32) + i128::from(limbs[0]);
    total as f64 * 2f64.powi(-up) * 2f64.powi(-rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;

    #[test]
    fn the_order_of_the_terms_does_not_matter() {
        let mut terms: Vec<f64> = (0..1000).map(|k| (k as f64 * 0.7).sin() * 10f64.powi(k % 9 - 4)).collect();
        let forward = exact_sum(&Solo, terms.iter().copied());
        terms.reverse();
        assert_eq!(forward, exact_sum(&Solo, terms.iter().copied()));
        let plain: f64 = terms.iter().sum();
        assert!((forward - plain).abs() <= 1e-12 * plain.abs());
    }

    #[test]
    fn tiny_huge_and_missing_terms_are_summed() {
        let sum = |terms: &[f64]| exact_sum(&Solo, terms.iter().copied());
        assert_eq!(sum(&[]), 0.0);
        assert_eq!(sum(&[-3.25]), -3.25);
        assert_eq!(sum(&[1e300, 1e300]), 2e300);
        assert_eq!(sum(&[1e-300, 3e-300]), 4e-300);
        assert!(sum(&[1.0, f64::NAN]).is_nan());
        assert!(sum(&[1.0, f64::INFINITY]).is_nan());
    }
}
