//! Numbers as text in few digits, for messages, tables and figures; and rounding to few digits.
//!
//! A quantity with a unit is written by [`short`] where somebody gave it and must find it again, by [`rough`]
//! where it was measured or estimated. Advice ("0.231 m or more would do") is rounded by [`at_least`] or
//! [`at_most`] first, so that the number that is printed is good enough.

/// A vector as text in round brackets, for messages: `(0.5, 1, 2)`.
pub fn triple(vector: &[f64; 3]) -> String {
    let [x, y, z] = vector.map(short);
    format!("({x}, {y}, {z})")
}

/// `number` in at most six significant digits, for messages: enough to find it in a file.
///
/// Magnitudes below 1e-4 and from 1e7 on get an exponent.
pub fn short(number: f64) -> String {
    without_idle_zeros(number, 6)
}

/// `number` in at most three significant digits: enough to judge it.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::digits::rough;
///
/// assert_eq!([0.1, 0.187_31, 2.3124e-6, 1234.5].map(rough), ["0.1", "0.187", "2.31e-6", "1230"]);
/// ```
pub fn rough(number: f64) -> String {
    without_idle_zeros(number, 3)
}

/// `number` in at most `digits` significant digits, without zeros at the end.
fn without_idle_zeros(number: f64, digits: usize) -> String {
    let rounded: f64 = format!("{number:.*e}", digits - 1).parse().unwrap_or(number);
    // A zero has no sign.
    let rounded = rounded + 0.0;
    match rounded.abs() {
        1e-4..1e7 | 0.0 => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

/// The least number of three significant digits that is not below `number`: for "or more would do".
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::digits::{at_least, at_most};
///
/// assert_eq!((at_least(2.3124e-6), at_most(2.3124e-6)), (2.32e-6, 2.31e-6));
/// assert_eq!((at_least(0.25), at_most(0.25)), (0.25, 0.25));
/// ```
pub fn at_least(number: f64) -> f64 {
    -at_most(-number)
}

/// The largest number of three significant digits that is not above `number`: for "or less would do".
pub fn at_most(number: f64) -> f64 {
    let nearest = format!("{number:.2e}");
    let Some((mantissa, exponent)) = nearest.split_once('e') else { return number };
    let (Ok(hundredths), Ok(exponent)) = (mantissa.replace('.', "").parse::<i64>(), exponent.parse::<i32>())
    else {
        return number;
    };
    let read = |hundredths: i64, exponent: i32| format!("{hundredths}e{exponent}").parse().unwrap_or(number);
    let rounded: f64 = read(hundredths, exponent - 2);
    match hundredths {
        _ if rounded <= number => rounded,
        // Below 1.00 the third digit counts a tenth of what it counts above.
        100 => read(999, exponent - 3),
        _ => read(hundredths - 1, exponent - 2),
    }
}

/// `value` in scientific notation with at most `digits` digits after the point: `1e-3`, `2.47e5`, `0`.
pub fn scientific(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let long = format!("{value:.digits$e}");
    match long.split_once('e') {
        Some((mantissa, exponent)) if mantissa.contains('.') => {
            format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
        }
        _ => long,
    }
}

/// `value` with `digits` significant digits, zeros at the end included, for columns: `3.61907`, `0.4810`.
///
/// Magnitudes below 1e-4 and from 1e6 on get an exponent, as by [`scientific`].
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::digits::{bytes, scientific, short, significant};
///
/// assert_eq!(significant(0.43471, 3), "0.435");
/// assert_eq!(scientific(247000.0, 2), "2.47e5");
/// assert_eq!(short(1.0 / 3.0), "0.333333");
/// assert_eq!(bytes(1536), "1.5 KiB");
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    let exponent = value.abs().log10().floor();
    if value == 0.0 || !(-4.0..6.0).contains(&exponent) {
        return scientific(value, digits.saturating_sub(1));
    }
    let places = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
    format!("{value:.places$}")
}

/// A number of bytes with a binary unit: `1.4 GiB`.
pub fn bytes(bytes: u64) -> String {
    let units = [(40, "TiB"), (30, "GiB"), (20, "MiB"), (10, "KiB")];
    match units.iter().find(|(power, _)| bytes >> power > 0) {
        Some((power, unit)) => format!("{:.1} {unit}", bytes as f64 / (1_u64 << power) as f64),
        None => format!("{bytes} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_carry_no_idle_zeros() {
        assert_eq!(scientific(1e-3, 2), "1e-3");
        assert_eq!(scientific(247_000.0, 2), "2.47e5");
        assert_eq!(scientific(-0.0999, 1), "-1e-1");
        assert_eq!(scientific(0.0, 2), "0");
        assert_eq!(scientific(f64::NAN, 2), "NaN");
        assert_eq!(scientific(f64::INFINITY, 2), "inf");
    }

    #[test]
    fn ordinary_numbers_have_no_exponent() {
        assert_eq!(significant(3.619_071_68, 6), "3.61907");
        assert_eq!(significant(0.481_23, 4), "0.4812");
        assert_eq!(significant(-15.0, 4), "-15.00");
        assert_eq!(significant(1e-9, 4), "1e-9");
        assert_eq!(significant(0.0, 4), "0");
        assert_eq!(significant(f64::NAN, 4), "NaN");
    }

    #[test]
    fn lengths_from_a_nanometre_to_a_kilometre_keep_their_digits() {
        let lengths = [1e-9, 5e-6, 4.1234e-5, 0.1, 1.0 / 3.0, 1.0, 25.0, 1000.0];
        let read = ["1e-9", "5e-6", "4.12e-5", "0.1", "0.333", "1", "25", "1000"];
        assert_eq!(lengths.map(rough), read);
        assert_eq!([1e-9, 4.1234e-5, 1000.0].map(short), ["1e-9", "4.1234e-5", "1000"]);
        assert_eq!([0.0, -0.25, f64::INFINITY, f64::NAN].map(rough), ["0", "-0.25", "inf", "NaN"]);
    }

    #[test]
    fn advice_is_rounded_to_the_safe_side_at_every_size() {
        for power in -320..308 {
            for mantissa in [1.0, 1.000_000_1, 1.234_56, 2.5, 9.99, 9.991, 9.999_999] {
                let number: f64 = mantissa * 10f64.powi(power);
                let (less, more) = (at_most(number), at_least(number));
                assert!(less <= number && number <= more, "{less:e} {number:e} {more:e}");
                // What is printed is what was meant.
                let read = |number: f64| short(number).parse::<f64>().unwrap();
                assert_eq!((read(less), read(more)), (less, more));
                // Numbers below 2.3e-308 have fewer digits of their own.
                assert!(power < -305 || (more - less) <= 0.0101 * number, "{less:e} {number:e} {more:e}");
            }
        }
        assert_eq!((at_least(0.0), at_most(0.0)), (0.0, 0.0));
        assert_eq!((at_least(0.999_6), at_most(1.000_4), at_most(0.999_96)), (1.0, 1.0, 0.999));
        assert_eq!((at_least(-1.239), at_most(-1.231)), (-1.23, -1.24));
        assert!(at_least(f64::INFINITY).is_infinite() && at_most(f64::NAN).is_nan());
    }
}
