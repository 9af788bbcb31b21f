//! Statistics of the cases: at the end of the runs, over time, and differences between cases for equal seeds.

use super::measures::{MEASURES, OVER_TIME};
use super::{Case, Run};
use crate::math::interval::{Interval, interval};
use serde::Serialize;

/// Statistics of a measure over the runs of a case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean and its 95 % interval.
    #[serde(flatten)]
    pub interval: Interval,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Standard deviation of a single run, with n - 1 in the denominator; infinite if there is one run.
    pub standard_deviation: f64,
}

/// Statistics of the finite numbers among `values`; `None` if there are none.
pub fn spread(values: &[f64]) -> Option<Spread> {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let interval = interval(&finite)?;
    let squares: f64 = finite.iter().map(|value| (value - interval.mean).powi(2)).sum();
    let freedom = finite.len() as f64 - 1.0;
    Some(Spread {
        interval,
        min: finite.iter().copied().fold(f64::INFINITY, f64::min),
        max: finite.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        standard_deviation: if freedom > 0.0 { (squares / freedom).sqrt() } else { f64::INFINITY },
    })
}

/// Statistics of a measure at the end of the runs of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// Over the runs that did not fail; `None` if no run has the measure.
    pub spread: Option<Spread>,
    /// Mean difference to the first case, over the seeds whose runs failed in neither of the two cases.
    ///
    /// `None` for the first case.
    pub difference: Option<Interval>,
}

/// Statistics at one time of an evolution.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time, s.
    pub time: f64,
    /// The spread of every measure that can be followed over time.
    pub spreads: Vec<Option<Spread>>,
}

/// All statistics of an ensemble.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// For every case, all measures in the order of `MEASURES`.
    pub ends: Vec<Vec<End>>,
    /// For every case, its statistics over time.
    pub evolutions: Vec<Vec<Moment>>,
}

impl Summary {
    /// Computes the statistics of all `cases`.
    pub fn of(cases: &[Case]) -> Self {
        let end = |case: &Case, number: usize, k: usize| End {
            spread: spread(&values(case, k)),
            difference: if number == 0 { None } else { difference(case, &cases[0], k) },
        };
        let ends = |(number, case)| (0..MEASURES.len()).map(|k| end(case, number, k)).collect();
        Summary {
            ends: cases.iter().enumerate().map(ends).collect(),
            evolutions: cases.iter().map(evolution).collect(),
        }
    }
}

fn end_of(run: &Run, k: usize) -> Option<f64> {
    run.outcome.as_ref().ok().map(|followed| followed.end[k])
}

/// Values of measure `k` at the end of the runs that did not fail.
pub fn values(case: &Case, k: usize) -> Vec<f64> {
    case.runs.iter().filter_map(|run| end_of(run, k)).collect()
}

fn difference(case: &Case, first: &Case, k: usize) -> Option<Interval> {
    let pair = |run: &Run| {
        let other = first.runs.iter().find(|other| other.seed == run.seed)?;
        Some(end_of(run, k)? - end_of(other, k)?)
    };
    let differences: Vec<f64> =
        case.runs.iter().filter_map(pair).filter(|difference| difference.is_finite()).collect();
    interval(&differences)
}

/// The case over time. A run that ended early at rest keeps its last values.
fn evolution(case: &Case) -> Vec<Moment> {
    let sound: Vec<_> = case.runs.iter().filter_map(|run| run.outcome.as_ref().ok()).collect();
    let longest = sound.iter().map(|followed| followed.times.len()).max().unwrap_or(0);
    let moment = |row: usize| {
        let at = |length: usize| row.min(length.saturating_sub(1));
        let time = |times: &Vec<f64>| times.get(at(times.len())).copied().unwrap_or(f64::NAN);
        let of = |k: usize| {
            let value = |frames: &Vec<Vec<f64>>| frames.get(at(frames.len())).map_or(f64::NAN, |row| row[k]);
            spread(&sound.iter().map(|followed| value(&followed.frames)).collect::<Vec<_>>())
        };
        Moment {
            time: sound.iter().map(|followed| time(&followed.times)).fold(f64::NAN, f64::max),
            spreads: (0..OVER_TIME).map(of).collect(),
        }
    };
    (0..longest).map(moment).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::ensemble::measures::Followed;

    fn run(seed: u64, values: &[f64]) -> Run {
        let frames: Vec<Vec<f64>> = values.iter().map(|&value| vec![value; OVER_TIME]).collect();
        let last = values.last().copied().unwrap();
        let times = (0..values.len()).map(|k| k as f64).collect();
        Run { seed, outcome: Ok(Followed { times, frames, end: vec![last; MEASURES.len()] }) }
    }

    fn case(name: &str, runs: Vec<Run>) -> Case {
        Case { name: name.into(), scene: String::new(), runs }
    }

    #[test]
    fn a_spread_has_mean_range_deviation_and_students_interval() {
        let found = spread(&[1.0, 2.0, f64::NAN, 6.0]).unwrap();
        assert_eq!((found.min, found.max, found.interval.mean, found.interval.count), (1.0, 6.0, 3.0, 3));
        // Deviations -2, -1, 3: variance 14/2; t(0.975, 2) = 4.302653.
        assert!((found.standard_deviation - 7f64.sqrt()).abs() < 1e-14);
        assert!((found.interval.half_width - 4.302_652_73 * (7f64 / 3.0).sqrt()).abs() < 1e-6);
        assert_eq!(spread(&[f64::NAN]), None);
        assert!(spread(&[1.0]).unwrap().standard_deviation.is_infinite());
    }

    #[test]
    fn cases_are_compared_on_seeds_that_are_sound_in_both() {
        let failed = Run { seed: 3, outcome: Err("failed".into()) };
        let first = case("a", vec![run(1, &[0.5]), run(2, &[0.7]), run(3, &[0.9])]);
        let second = case("b", vec![run(1, &[0.6]), run(2, &[0.8]), failed, run(4, &[7.0])]);
        let summary = Summary::of(&[first, second]);
        assert_eq!(summary.ends[0][0].difference, None);
        let difference = summary.ends[1][0].difference.unwrap();
        assert!((difference.mean - 0.1).abs() < 1e-15 && difference.half_width < 1e-13, "{difference:?}");
        assert_eq!((difference.count, summary.ends[1][0].spread.unwrap().interval.count), (2, 3));
    }

    #[test]
    fn a_run_that_came_to_rest_keeps_its_last_values() {
        let summary = Summary::of(&[case("a", vec![run(1, &[1.0, 3.0]), run(2, &[1.0, 2.0, 5.0])])]);
        let means: Vec<(f64, f64)> = summary.evolutions[0]
            .iter()
            .map(|moment| (moment.time, moment.spreads[0].unwrap().interval.mean))
            .collect();
        assert_eq!(means, [(0.0, 1.0), (1.0, 2.5), (2.0, 4.0)]);
    }
}
