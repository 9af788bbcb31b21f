//! Axes: the position of a value between the ends of an axis, and ticks at round numbers.

use crate::beds::text::shortened;
use crate::math::digits::scientific;

/// Approximate largest number of labels on a linear axis.
const LABELS: f64 = 8.0;
/// Largest number of decades that all have a label. A longer axis skips some labels.
const DECADES: f64 = 6.0;
/// Share of the range of values that stays free outside each end.
const MARGIN: f64 = 0.05;
/// Share of the axis that a band at one of its ends takes.
const BAND: f64 = 0.11;
/// Longest name of a category, in characters.
const NAME_LENGTH: usize = 26;
/// Largest value that is drawn. Differences of two such values do not overflow.
const LARGEST: f64 = 1e300;
/// Shortest linear axis. Steps between its ticks do not underflow.
const SMALLEST: f64 = 1e-300;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    Logarithmic,
}

/// A grid line, with or without a label.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Position on the axis, from 0 (start) to 1 (end).
    pub share: f64,
    /// Label; `None` for a minor line.
    pub text: Option<String>,
}

/// One axis of a frame.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Label of the axis, with the unit.
    pub label: String,
    scale: Scale,
    /// Ends of the scale: values, or their decimal logarithms.
    low: f64,
    high: f64,
    /// Shares of the axis that the bands before and after the scale take.
    before: f64,
    after: f64,
    /// Ticks: positions on the scale, with labels.
    ticks: Vec<(f64, Option<String>)>,
    /// Whether the ticks are names of categories.
    pub named: bool,
}

impl Axis {
    /// An axis from the smallest to the largest finite value. If all are equal, it extends to both sides.
    pub fn linear(label: &str, values: impl IntoIterator<Item = f64>) -> Axis {
        let (low, high) = ends(values).unwrap_or((0.0, 1.0));
        let size = low.abs().max(high.abs());
        // If differences are near rounding errors, ticks would need sixteen digits.
        let least = if size > 0.0 { (1e-6 * size).max(SMALLEST) } else { 1.0 };
        let (low, high) = widened(low, high, least);
        let step = round_step((high - low) / LABELS);
        let first = (low / step).ceil();
        let count = ((high / step).floor() - first).clamp(0.0, 4.0 * LABELS) as usize;
        let ticks = (0..=count)
            .map(|k| (first + k as f64) * step)
            .map(|at| (at, Some(linear_label(at, step, low.abs().max(high.abs())))))
            .collect();
        Axis::new(label, Scale::Linear, (low, high), ticks)
    }

    /// An axis over the positive finite values. It is at least one decade long.
    pub fn logarithmic(label: &str, values: impl IntoIterator<Item = f64>) -> Axis {
        let positive = values.into_iter().filter(|&value| value > 0.0);
        let (low, high) = ends(positive.map(f64::log10)).unwrap_or((-1.0, 0.0));
        let (low, high) = widened(low, high, 1.0);
        let stride = ((high - low) / (DECADES + 1.0)).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for decade in low.floor() as i32..=high.floor() as i32 {
            let labelled = decade.rem_euclid(stride) == 0;
            ticks.push((f64::from(decade), labelled.then(|| format!("1e{decade}"))));
            if high - low > DECADES {
                continue;
            }
            for digit in 2..10 {
                // In a short range, label 2 and 5 too. Otherwise there might be a single label.
                let labelled = high - low < 2.0 && (digit == 2 || digit == 5);
                let at = f64::from(decade) + f64::from(digit).log10();
                ticks.push((at, labelled.then(|| format!("{digit}e{decade}"))));
            }
        }
        ticks.retain(|&(at, _)| (low..=high).contains(&at));
        Axis::new(label, Scale::Logarithmic, (low, high), ticks)
    }

    /// An axis of categories at equal distances. The first one is at 0, the next at 1.
    pub fn named(label: &str, names: &[String]) -> Axis {
        let ticks = names
            .iter()
            .enumerate()
            .map(|(k, name)| (k as f64, Some(shortened(name, NAME_LENGTH))))
            .collect();
        let last = names.len().max(1) as f64 - 1.0;
        Axis { named: true, ..Axis::new(label, Scale::Linear, (-0.5, last + 0.5), ticks) }
    }

    fn new(label: &str, scale: Scale, (low, high): (f64, f64), ticks: Vec<(f64, Option<String>)>) -> Axis {
        let label = shortened(label, 60);
        Axis { label, scale, low, high, before: 0.0, after: 0.0, ticks, named: false }
    }

    /// The axis with a band before or after the scale, for values that the scale cannot show.
    pub fn with_bands(self, before: bool, after: bool) -> Axis {
        let share = |wanted| if wanted { BAND } else { 0.0 };
        Axis { before: share(before), after: share(after), ..self }
    }

    /// The two ends of the scale, as shares of the axis. They are 0 and 1 if there are no bands.
    pub fn scale_ends(&self) -> (f64, f64) {
        (self.before, 1.0 - self.after)
    }

    /// Position of the value on the axis, from 0 (start) to 1 (end).
    ///
    /// `None` if the scale cannot show the value. A value outside the range is at the nearest end.
    pub fn share(&self, value: f64) -> Option<f64> {
        let value = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic if value > 0.0 => value.log10(),
            Scale::Logarithmic => return None,
        };
        value.is_finite().then(|| self.scaled_share(value))
    }

    fn scaled_share(&self, at: f64) -> f64 {
        let (start, end) = self.scale_ends();
        let inner = (at.clamp(self.low, self.high) - self.low) / (self.high - self.low);
        start + inner * (end - start)
    }

    /// The ticks, in order.
    pub fn ticks(&self) -> impl Iterator<Item = Tick> + '_ {
        self.ticks.iter().map(|(at, text)| Tick { share: self.scaled_share(*at), text: text.clone() })
    }

    /// The longest label of a tick.
    pub fn longest_label(&self) -> &str {
        let texts = self.ticks.iter().filter_map(|(_, text)| text.as_deref());
        texts.max_by_key(|text| text.chars().count()).unwrap_or_default()
    }

    /// Number of ticks with a label.
    pub fn labelled(&self) -> usize {
        self.ticks.iter().filter(|(_, text)| text.is_some()).count()
    }
}

/// The smallest and the largest finite value.
fn ends(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    finite.map(|value| value.clamp(-LARGEST, LARGEST)).fold(None, |ends, value| match ends {
        None => Some((value, value)),
        Some((low, high)) => Some((low.min(value), high.max(value))),
    })
}

/// The range with margins, at least `least` long.
fn widened(low: f64, high: f64, least: f64) -> (f64, f64) {
    let missing = (least - (high - low)).max(0.0) / 2.0;
    let margin = MARGIN * (high - low).max(least);
    (low - missing - margin, high + missing + margin)
}

/// The smallest number of the form 1, 2 or 5 times a power of ten that is at least `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let digits = [1.0, 2.0, 5.0].into_iter().find(|digit| digit * power >= step);
    digits.unwrap_or(10.0) * power
}

/// The label of a tick, with enough digits to differ from its neighbours.
fn linear_label(at: f64, step: f64, largest: f64) -> String {
    if at.abs() < 1e-6 * step {
        return "0".to_owned();
    }
    let digit = step.log10().floor() as i32;
    if (1e-3..1e5).contains(&largest) && digit >= -6 {
        format!("{at:.*}", (-digit).max(0).unsigned_abs() as usize)
    } else {
        let digits = at.abs().log10().floor() as i32 - digit;
        scientific(at, digits.max(0).unsigned_abs() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().filter_map(|tick| tick.text).collect()
    }

    #[test]
    fn decades_are_labelled_and_equally_far_apart() {
        let axis = Axis::logarithmic("error", [1e-5, 1e-2]);
        assert_eq!(labels(&axis), ["1e-5", "1e-4", "1e-3", "1e-2"]);
        let at = |value| axis.share(value).unwrap();
        assert!((at(1e-4) - at(1e-5) - at(1e-2) + at(1e-3)).abs() < 1e-12);
    }

    #[test]
    fn labels_stay_few_and_at_least_two_over_any_range() {
        for (low, high) in [(1.0, 1.0), (2.9e4, 3.1e4), (1e-16, 1e-1), (f64::MIN_POSITIVE, f64::MAX)] {
            let shown = labels(&Axis::logarithmic("", [low, high]));
            assert!((2..=9).contains(&shown.len()), "{low:e}..{high:e}: {shown:?}");
        }
        for (low, high) in [(3.0, 3.0), (0.0, 0.0), (-2e-9, 7e-9), (1e9, 1.0001e9), (-f64::MAX, f64::MAX)] {
            let mut shown = labels(&Axis::linear("", [low, high]));
            let count = shown.len();
            shown.dedup();
            assert!((2..=9).contains(&count) && count == shown.len(), "{low:e}..{high:e}: {shown:?}");
        }
    }

    #[test]
    fn round_numbers_are_written_shortly() {
        assert_eq!(labels(&Axis::linear("", [0.0, 1.0])), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert!(labels(&Axis::linear("", [0.0, 3e-7])).contains(&"1e-7".to_owned()));
    }

    #[test]
    fn a_value_that_the_scale_cannot_show_is_not_drawn() {
        let axis = Axis::logarithmic("", [1e-3, f64::NAN, 0.0, 1.0]);
        assert_eq!(axis.share(0.0), None);
        assert_eq!(axis.share(f64::NAN), None);
        assert_eq!(axis.share(f64::INFINITY), None);
        assert!((0.0..0.1).contains(&axis.share(1e-3).unwrap()));
    }

    #[test]
    fn bands_keep_values_away_from_their_end() {
        let axis = Axis::logarithmic("", [1e-3, 1.0]).with_bands(true, true);
        let (start, end) = axis.scale_ends();
        assert!(axis.share(1e-3).unwrap() > start && axis.share(1.0).unwrap() < end);
        assert!(start > 0.05 && end < 0.95);
    }
}
