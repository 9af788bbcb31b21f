//! Shortens texts for tables and figures.

/// `text` on one line, with at most `most` characters. If some are cut off, the last one is an ellipsis.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::text::shortened;
///
/// assert_eq!(shortened("friction.coefficient", 10), "friction.…");
/// ```
pub fn shortened(text: &str, most: usize) -> String {
    let line: Vec<char> = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if line.len() <= most {
        return line.into_iter().collect();
    }
    let kept: String = line[..most.saturating_sub(1)].iter().collect();
    format!("{}…", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shortened_text_is_one_line_and_shows_that_something_is_missing() {
        assert_eq!(shortened("short", 5), "short");
        assert_eq!(shortened("no step can be made", 9), "no step…");
        assert_eq!(shortened("a\nb\u{1}", 9), "a b ");
        assert_eq!(shortened("čtyři kuličky", 6), "čtyři…");
    }
}
