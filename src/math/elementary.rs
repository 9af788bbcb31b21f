//! Elementary functions of the contact law: exponential, reciprocal and reciprocal square root.
//!
//! They use only operations whose rounding IEEE 754 defines, so every machine with the same [`Arithmetic`]
//! gives the same bits. They have no table, no branch and no library call, so the compiler can vectorise
//! loops over them.
//!
//! Reciprocals and roots start from a cheap result in single precision. A series in its error then adds the
//! missing digits.

/// How a product is added to a number: rounded once or twice.
pub trait Arithmetic: Copy + Send + Sync + 'static {
    /// a b + c
    fn add_product(a: f64, b: f64, c: f64) -> f64;
}

/// The product is rounded before it is added: two roundings.
#[derive(Debug, Clone, Copy)]
pub struct Separate;

/// Fused multiply-add: one rounding. Slow on a processor without an instruction for it.
#[derive(Debug, Clone, Copy)]
pub struct Fused;

impl Arithmetic for Separate {
    #[inline(always)]
    fn add_product(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

impl Arithmetic for Fused {
    #[inline(always)]
    fn add_product(a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }
}

/// The larger of `x` and `low`; NaN if `x` is NaN.
#[inline(always)]
pub fn at_least(low: f64, x: f64) -> f64 {
    if low > x { low } else { x }
}

/// The smaller of `x` and `high`; NaN if `x` is NaN.
#[inline(always)]
pub fn at_most(high: f64, x: f64) -> f64 {
    if high < x { high } else { x }
}

/// e^x within 2 ulp. Below x = -708 the result is e^-708 = 3e-308, above x = 709 it is +infinity; NaN gives
/// NaN.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::{Fused, Separate, exp};
///
/// assert!((exp::<Separate>(1.0) - std::f64::consts::E).abs() < 1e-15);
/// assert!((exp::<Fused>(-1.5) - 0.22313016014842982).abs() < 1e-16);
/// assert_eq!(exp::<Separate>(800.0), f64::INFINITY);
/// ```
#[inline(always)]
pub fn exp<A: Arithmetic>(x: f64) -> f64 {
    let y = exp_within::<A>(at_most(709.0, at_least(-708.0, x)));
    if x > 709.0 { f64::INFINITY } else { y }
}

/// e^x within 2 ulp, for x in -708..709; NaN gives NaN.
#[inline(always)]
pub fn exp_within<A: Arithmetic>(x: f64) -> f64 {
    const LOG2_E: f64 = std::f64::consts::LOG2_E;
    // ln 2 as a sum of two numbers. The high one has 32 trailing zero bits, so k * LN2_HIGH is exact.
    const LN2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
    const LN2_LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);
    // Adding and then subtracting 1.5 * 2^52 rounds to the nearest integer.
    const ROUND: f64 = 6755399441055744.0;
    let shifted = A::add_product(x, LOG2_E, ROUND);
    let k = shifted - ROUND;
    let s = A::add_product(-k, LN2_LOW, A::add_product(-k, LN2_HIGH, x));
    // The polynomial that interpolates (e^s - 1 - s)/s^2 at the ten Chebyshev points of |s| <= ln(2)/2. Apart
    // from rounding, it gives e^s with a relative error of 1.6e-17. Even and odd powers are summed
    // separately, which shortens the chain of operations that wait for each other.
    let s2 = s * s;
    let power = |c: f64, sum: f64| A::add_product(s2, sum, c);
    let even = power(
        0.5000000000000001,
        power(
            0.04166666666662413,
            power(0.0013888888917213717, power(2.4801521295954376e-5, 2.7620088445409746e-7)),
        ),
    );
    let odd = power(
        0.16666666666666669,
        power(
            0.008333333333330062,
            power(0.00019841269863053618, power(2.7557268459997064e-6, 2.510038549551032e-8)),
        ),
    );
    let p = 1.0 + A::add_product(s2, A::add_product(s, odd, even), s);
    // Multiply by 2^k: add k to the exponent. The lowest bits of `shifted` hold k. A conversion to an integer
    // would not be a vector instruction on every machine.
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// 1/x within 2 ulp, for |x| in 1e-38..1e38. 0 and NaN give a result that is not finite.
#[inline(always)]
pub fn inverse<A: Arithmetic>(x: f64) -> f64 {
    let y = f64::from(1.0 / x as f32);
    // 1/x = y (1 + e + e^2 + ...) with |e| < 2e-7, so the series may stop after e^2.
    let e = A::add_product(-x, y, 1.0);
    A::add_product(y, A::add_product(e, e, e), y)
}

/// 1/sqrt(x) within 2 ulp, for x in 1e-37..1e38. 0, negative numbers, infinity and NaN give a result that is
/// not finite.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::{Separate, inverse, inverse_root};
///
/// assert!((inverse_root::<Separate>(16.0) - 0.25).abs() < 1e-16);
/// assert!((inverse::<Separate>(8.0) - 0.125).abs() < 1e-16);
/// ```
#[inline(always)]
pub fn inverse_root<A: Arithmetic>(x: f64) -> f64 {
    let y = f64::from(1.0 / (x as f32).sqrt());
    // 1/sqrt(x) = y (1 + e/2 + 3/8 e^2 + ...) with |e| < 3e-7, so the series may stop after e^2.
    let e = A::add_product(-(x * y), y, 1.0);
    A::add_product(y * e, A::add_product(0.375, e, 0.5), y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ulps(found: f64, exact: f64) -> f64 {
        let ulp = f64::from_bits(exact.abs().to_bits() + 1) - exact.abs();
        (found - exact).abs() / ulp
    }

    fn worst(of: impl Fn(f64) -> f64) -> f64 {
        (0..400_001).map(|k| of(k as f64 / 400_000.0)).fold(0.0, f64::max)
    }

    fn check<A: Arithmetic>() {
        let at = |share: f64| -700.0 + 1400.0 * share + 1e-7;
        let exponential = worst(|share| ulps(exp::<A>(at(share)), at(share).exp()));
        assert!(exponential <= 2.0, "exp: {exponential} ulp");
        let at = |share: f64| 10f64.powf(-37.0 + 75.0 * share);
        let reciprocal = worst(|share| ulps(inverse::<A>(at(share)), 1.0 / at(share)));
        assert!(reciprocal <= 2.0, "1/x: {reciprocal} ulp");
        let root = worst(|share| ulps(inverse_root::<A>(at(share)), 1.0 / at(share).sqrt()));
        assert!(root <= 2.0, "1/sqrt(x): {root} ulp");
    }

    #[test]
    fn functions_are_within_two_units_in_the_last_place() {
        check::<Separate>();
        check::<Fused>();
    }

    #[test]
    fn exp_has_no_surprises_at_its_ends() {
        assert_eq!(exp::<Fused>(0.0), 1.0);
        for far in [-708.0, -709.0, -1e300, f64::NEG_INFINITY] {
            assert!((0.0..1e-307).contains(&exp::<Fused>(far)));
        }
        assert_eq!(exp::<Fused>(710.0), f64::INFINITY);
        assert_eq!(exp::<Fused>(f64::INFINITY), f64::INFINITY);
        assert!(exp::<Fused>(f64::NAN).is_nan());
        assert!(exp::<Fused>(709.0).is_finite());
    }

    #[test]
    fn what_is_not_a_finite_number_shows() {
        assert!(inverse::<Fused>(f64::NAN).is_nan());
        assert!(inverse_root::<Fused>(f64::NAN).is_nan());
        for x in [0.0, -1.0, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!inverse_root::<Fused>(x).is_finite());
        }
        assert!(!inverse::<Fused>(0.0).is_finite());
        assert_eq!(
            [at_least(1.0, 0.5), at_least(1.0, 2.0), at_most(1.0, 0.5), at_most(1.0, 2.0)],
            [1.0, 2.0, 0.5, 1.0]
        );
        assert!(at_least(1.0, f64::NAN).is_nan() && at_most(1.0, f64::NAN).is_nan());
    }
}
