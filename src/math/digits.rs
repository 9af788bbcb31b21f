//! Numbers as text in few digits, for messages, tables and figures.

/// A vector as text in round brackets, for messages: `(0.5, 1, 2)`.
pub fn triple(vector: &[f64; 3]) -> String {
    let [x, y, z] = vector.map(short);
    format!("({x}, {y}, {z})")
}

/// `number` in at most six significant digits, for messages: enough to find it in a file.
pub fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.5e}").parse().unwrap_or(number);
    match rounded.abs() {
        1e-4..1e7 | 0.0 => format!("{rounded}"),
        _ => format!("{rounded:e}"),
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

/// `value` with `digits` significant digits: `3.61907`, `0.4812`.
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
}
