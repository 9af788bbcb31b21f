//! Numbers on the command line.

/// Reads a number that is greater than 0 and finite.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        Ok(_) => Err("it must be greater than 0 and finite".into()),
        Err(_) => Err("it must be a number, such as 1e-3".into()),
    }
}
