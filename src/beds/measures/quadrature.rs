//! Integrals of smooth functions by Gauss's rule.

use std::num::NonZeroUsize;
use std::sync::OnceLock;

use gauss_quad::GaussLegendre;

/// Largest number of times that a range is halved.
const HALVINGS: u32 = 12;

/// Integral of `f` from `a` to `b`. The range is halved until two rules agree, so that the error is below
/// `tolerance`.
pub fn integral(f: &mut dyn FnMut(f64) -> f64, ends: [f64; 2], tolerance: f64) -> f64 {
    halved(f, ends, tolerance, HALVINGS)
}

fn halved(f: &mut dyn FnMut(f64) -> f64, [a, b]: [f64; 2], tolerance: f64, halvings: u32) -> f64 {
    static RULES: OnceLock<[GaussLegendre; 2]> = OnceLock::new();
    let [coarse, fine] = RULES
        .get_or_init(|| [6, 12].map(|n| GaussLegendre::new(NonZeroUsize::new(n).expect("neither is 0"))));
    let rough = coarse.integrate(a, b, &mut *f);
    let sum = fine.integrate(a, b, &mut *f);
    // The finer rule is far more accurate than the difference of the two.
    if halvings == 0 || (sum - rough).abs() <= 1e3 * tolerance {
        return sum;
    }
    let middle = (a + b) / 2.0;
    halved(f, [a, middle], tolerance / 2.0, halvings - 1)
        + halved(f, [middle, b], tolerance / 2.0, halvings - 1)
}
