//! The mean of many values with its confidence interval.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A mean with its confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Mean, in the unit of the values.
    pub mean: f64,
    /// Half-width of the 95 % confidence interval, same unit; infinite if the values do not bound the mean.
    pub half_width: f64,
    /// Number of values in the mean.
    pub count: usize,
}

/// Mean of the finite `values` with its 95 % confidence interval by Student's t; `None` without a finite
/// value.
///
/// The half-width is infinite for a single value. It is also infinite if any value is not finite: the runs
/// that remain are then no random sample of all runs.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::interval::interval;
///
/// let porosity = interval(&[0.41, 0.43, 0.42]).ok_or("no value is finite")?;
/// assert!((porosity.mean - 0.42).abs() < 1e-15);
/// assert!((porosity.half_width - 4.3027 * 0.01 / 3f64.sqrt()).abs() < 1e-6); // Student's t for 3 values
/// assert_eq!(interval(&[]), None);
/// # Ok::<(), &str>(())
/// ```
pub fn interval(values: &[f64]) -> Option<Interval> {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let count = finite.len();
    // Welford's recurrence keeps the digits of the spread even if the values are nearly equal.
    let (mut mean, mut squares) = (0.0, 0.0);
    for (k, value) in finite.iter().enumerate() {
        let deviation = value - mean;
        mean += deviation / (k + 1) as f64;
        squares += deviation * (value - mean);
    }
    if count == 0 || !mean.is_finite() {
        return None;
    }
    let bounded = count > 1 && count == values.len() && squares.is_finite();
    let half_width = if bounded {
        let freedom = (count - 1) as f64;
        student_quantile(freedom) * (squares / freedom / count as f64).sqrt()
    } else {
        f64::INFINITY
    };
    Some(Interval { mean, half_width, count })
}

/// The quantile of Student's t: |t| is below it with a probability of 95 %, for `freedom` >= 1 degrees of
/// freedom.
fn student_quantile(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).expect("scale and freedom are positive").inverse_cdf(0.975)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_are_those_of_the_tables() {
        // Printed tables give three decimals.
        for (freedom, quantile) in [(1.0, 12.706), (4.0, 2.776), (9.0, 2.262), (1e4, 1.960)] {
            assert!((student_quantile(freedom) - quantile).abs() < 6e-4, "{freedom}");
        }
    }

    #[test]
    fn the_interval_of_five_values_is_the_one_computed_by_hand() {
        let Interval { mean, half_width, count } = interval(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!((mean, count), (3.0, 5));
        // 2.7764 * sqrt(2.5 / 5); five digits of the quantile.
        assert!((half_width - 1.9632).abs() < 1e-4, "{half_width}");
    }

    #[test]
    fn equal_values_leave_no_doubt_and_one_value_leaves_every_doubt() {
        assert_eq!(interval(&[2.5; 8]).unwrap().half_width, 0.0);
        assert_eq!(interval(&[2.5]), Some(Interval { mean: 2.5, half_width: f64::INFINITY, count: 1 }));
        assert_eq!(interval(&[]), None);
    }

    #[test]
    fn a_value_that_is_not_a_number_takes_the_certainty_away() {
        assert_eq!(interval(&[f64::NAN, f64::INFINITY]), None);
        let marred = interval(&[1.0, f64::NAN, 3.0]).unwrap();
        assert_eq!((marred.mean, marred.half_width, marred.count), (2.0, f64::INFINITY, 2));
    }

    #[test]
    fn values_at_the_end_of_the_range_do_not_give_a_nan() {
        if let Some(interval) = interval(&[f64::MAX, -f64::MAX, f64::MAX]) {
            assert!(interval.mean.is_finite() && !interval.half_width.is_nan());
        }
    }
}
