//! Turns the measured curves into one recommendation.

use super::ensemble::still_from;
use super::findings::medians;
use super::records::{Measure, Record, Statistic, Stepper, Study};
use crate::math::digits::{scientific, short};

/// The data behind a recommendation.
pub struct Question<'a> {
    /// All runs except those of a sweep.
    pub records: &'a [Record],
    /// Means over the seeds, except those of a sweep.
    pub statistics: &'a [Statistic],
    /// Time at which states are compared, s.
    pub time: Option<f64>,
    /// Radius of a sphere, m.
    pub radius: f64,
}

/// Relative error that a recommendation for impacts aims at.
const IMPACT_TARGET: f64 = 1e-3;

/// Recommends a solver, in a few sentences.
pub fn recommendation(question: &Question) -> String {
    // Aim at a hundredth of a radius, rounded to a power of ten.
    let position = 10f64.powf((0.01 * question.radius).log10().round());
    let of = |study| medians(question.records.iter().filter(|record| record.study == study));
    let state = question.time.and_then(|time| {
        let what =
            |target| format!("positions right to {} m at t = {} s", scientific(target, 1), short(time));
        sentence(&of(Study::State), Measure::PositionError, position, what)
    });
    let impact = || {
        let runs = of(Study::Impact);
        let rebound = |target| format!("rebound times right to {} of them", scientific(target, 1));
        let restitution = |target| format!("a restitution right to {} of it", scientific(target, 1));
        sentence(&runs, Measure::ReboundError, IMPACT_TARGET, rebound)
            .or_else(|| sentence(&runs, Measure::RestitutionError, IMPACT_TARGET, restitution))
    };
    let bed = bed_sentence(question);
    let all: Vec<String> = [state.or_else(impact), bed].into_iter().flatten().collect();
    if all.is_empty() {
        return "No run tells which solver to take: none has an error that is not 0, or all have failed."
            .to_owned();
    }
    all.join(" ")
}

/// Recommends the cheapest run that is as accurate as `target`, and says what ten times more accuracy costs.
///
/// If no run reaches the target, a power of ten above the smallest error takes its role. `None` if there is
/// no error to compare.
fn sentence(runs: &[Record], measure: Measure, target: f64, what: impl Fn(f64) -> String) -> Option<String> {
    let all: Vec<(f64, &Record)> = (runs.iter())
        .filter(|record| record.failure.is_none())
        .filter_map(|record| Some((*record.measures.get(&measure)?, record)))
        .filter(|(error, _)| error.is_finite())
        .collect();
    // The right fixed step is known only after the runs. Recommend one only if there is nothing else.
    let (fixed, controlled): (Vec<_>, Vec<_>) =
        all.iter().partition(|(_, record)| record.solver.step.is_some());
    let sound = if controlled.is_empty() { fixed.clone() } else { controlled };
    if sound.iter().all(|&(error, _)| error == 0.0) {
        // Nothing happened that a solver could get wrong.
        return None;
    }
    let smallest = sound.iter().map(|&(error, _)| error).min_by(f64::total_cmp)?;
    // The next power of ten above the smallest error.
    let target = if smallest <= target { target } else { 10f64.powf(smallest.log10().ceil()) };
    let (error, take) = cheapest(&sound, target)?;
    let rhs = take.work.rhs_evaluations;
    let first = format!(
        "For {} take {}: {} right-hand sides, error {}",
        what(target),
        parameters(take),
        grouped(rhs),
        scientific(error, 1)
    );
    let more = match cheapest(&sound, target / 10.0) {
        None => "no run here was ten times more accurate".to_owned(),
        Some((_, same)) if same.solver == take.solver => "that is ten times more accurate already".to_owned(),
        Some((_, better)) => {
            let times = better.work.rhs_evaluations as f64 / rhs as f64;
            format!("ten times more accuracy costs {times:.1} times as much ({})", parameters(better))
        }
    };
    let by_luck =
        cheapest(&fixed, target).filter(|(_, lucky)| lucky.work.rhs_evaluations < rhs).map(|(_, lucky)| {
            let rhs = grouped(lucky.work.rhs_evaluations);
            format!(
                " A fixed {} would do with {rhs}, but which step is right is known afterwards only.",
                parameters(lucky)
            )
        });
    Some(format!("{first}; {more}.{}", by_luck.unwrap_or_default()))
}

/// The run with the fewest right-hand sides among those whose error is at most `target`.
fn cheapest<'a>(runs: &[(f64, &'a Record)], target: f64) -> Option<(f64, &'a Record)> {
    // Allow for rounding, because the target is a computed power of ten.
    let enough = |(error, _): &&(f64, &Record)| *error <= target * (1.0 + 1e-9);
    runs.iter().filter(enough).min_by_key(|(_, record)| record.work.rhs_evaluations).copied()
}

/// Method with its tolerance or step, as a scene names them.
fn parameters(record: &Record) -> String {
    let solver = &record.solver;
    match (solver.tolerance, solver.step) {
        (Some(tolerance), _) => format!("{} at tolerance {tolerance:e}", solver.method),
        (None, Some(step)) => format!("step of {step:e} s ({})", solver.method),
        (None, None) => solver.method.to_string(),
    }
}

/// Says below which tolerance the statistics of the bed no longer change.
fn bed_sentence(question: &Question) -> Option<String> {
    let mut methods: Vec<Stepper> = Vec::new();
    // A single initial state gives no interval, so leave it out.
    let compared =
        |s: &&Statistic| s.solver.step.is_none() && s.paired.is_some_and(|paired| paired.count > 1);
    for statistic in question.statistics.iter().filter(compared) {
        if !methods.contains(&statistic.solver.method) {
            methods.push(statistic.solver.method);
        }
    }
    let ensembles = question.records.iter().filter(|record| record.study == Study::Ensemble);
    let runs = medians(ensembles);
    let method = *methods.first()?;
    let tried = runs.iter().filter(|record| record.solver.method == method);
    let loosest = tried.clone().filter_map(|record| record.solver.tolerance).fold(0.0, f64::max);
    let Some(from) = still_from(question.statistics, method, question.radius) else {
        return Some(format!(
            "That statistics of the bed stand still is not shown at any tolerance tried ({method}): \
             more --seeds give narrower intervals, smaller --tolerances smaller differences."
        ));
    };
    let rhs = tried
        .filter(|record| record.solver.tolerance == Some(from))
        .map(|r| r.work.rhs_evaluations)
        .next()?;
    let cost = format!("{} right-hand sides a bed", grouped(rhs));
    Some(if from == loosest {
        format!(
            "Statistics of the bed do not move even at tolerance {from:e} ({method}), \
             the loosest tried: {cost}."
        )
    } else {
        format!("Statistics of the bed do not move below tolerance {from:e} ({method}): {cost}.")
    })
}

/// The count with a space after every three digits.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let first = digits.len() % 3;
    let parts: Vec<&str> = [&digits[..first]]
        .into_iter()
        .filter(|part| !part.is_empty())
        .chain((first..digits.len()).step_by(3).map(|k| &digits[k..k + 3]))
        .collect();
    parts.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::interval::Interval;
    use crate::ode::MethodName;
    use crate::studies::accuracy::records::Work;
    use crate::studies::accuracy::solvers::adaptive;

    fn record(
        study: Study,
        method: MethodName,
        tolerance: f64,
        rhs: u64,
        measure: Measure,
        value: f64,
    ) -> Record {
        Record {
            study,
            variation: None,
            solver: adaptive(method, tolerance),
            seed: Some(1),
            work: Work { rhs_evaluations: rhs, ..Work::default() },
            measures: [(measure, value)].into_iter().collect(),
            failure: None,
        }
    }

    fn advice(records: &[Record], statistics: &[Statistic]) -> String {
        recommendation(&Question { records, statistics, time: Some(0.6), radius: 0.1 })
    }

    #[test]
    fn the_cheapest_run_that_is_accurate_enough_is_recommended() {
        let state = |method, tolerance, rhs, error| {
            record(Study::State, method, tolerance, rhs, Measure::PositionError, error)
        };
        let records = [
            state(MethodName::Auto, 1e-2, 8_000, 5e-3),
            state(MethodName::Auto, 1e-3, 15_280, 9e-4),
            state(MethodName::Merson, 1e-2, 30_000, 5e-4),
            state(MethodName::Auto, 1e-4, 29_032, 8e-5),
        ];
        assert_eq!(
            advice(&records, &[]),
            "For positions right to 1e-3 m at t = 0.6 s take auto at tolerance 1e-3: \
             15 280 right-hand sides, error 9e-4; \
             ten times more accuracy costs 1.9 times as much (auto at tolerance 1e-4)."
        );
        assert!(advice(&records[..3], &[]).contains("no run here was ten times more accurate"));
        let mut lucky = state(MethodName::VelocityVerlet, 1e-9, 9_000, 9e-4);
        (lucky.solver.tolerance, lucky.solver.step) = (None, Some(1e-5));
        let text = advice(&[records[1].clone(), lucky.clone()], &[]);
        assert!(text.contains("take auto") && text.contains("fixed step of 1e-5 s"), "{text}");
        assert!(advice(&[lucky], &[]).contains("take step of 1e-5 s (velocity-verlet)"));
        // If no run is accurate enough, the target is the next power of ten that one reaches.
        assert!(advice(&records[..1], &[]).contains("right to 1e-2 m"), "{}", advice(&records[..1], &[]));
    }

    #[test]
    fn impacts_speak_where_states_are_missing_and_failures_leave_nothing() {
        let impact = record(Study::Impact, MethodName::Merson, 1e-4, 700, Measure::ReboundError, 1e-5);
        assert!(advice(std::slice::from_ref(&impact), &[]).contains("rebound times right to 1e-3"));
        let failed = Record { failure: Some("no".to_owned()), ..impact };
        assert!(advice(&[failed], &[]).contains("No run tells"));
        let untouched = record(Study::State, MethodName::Auto, 1e-3, 19, Measure::PositionError, 0.0);
        assert!(advice(&[untouched], &[]).contains("No run tells"));
    }

    #[test]
    fn the_bed_has_a_sentence_of_its_own() {
        let overlap = Measure::LargestOverlap;
        let runs = [1e-1, 1e-2, 1e-3]
            .map(|tolerance| record(Study::Ensemble, MethodName::Auto, tolerance, 1_000_000, overlap, 0.01));
        let mean = Interval { mean: 0.01, half_width: 1e-4, count: 5 };
        let difference = |mean| Some(Interval { mean, half_width: 1e-5, count: 5 });
        let statistic = |tolerance, paired| Statistic {
            variation: None,
            solver: adaptive(MethodName::Auto, tolerance),
            measure: overlap,
            interval: mean,
            paired,
        };
        let list = |loosest| {
            [statistic(1e-1, difference(loosest)), statistic(1e-2, difference(0.0)), statistic(1e-3, None)]
        };
        let text = advice(&runs, &list(0.02));
        assert!(text.contains("do not move below tolerance 1e-2 (auto): 1 000 000 right-hand"), "{text}");
        assert!(advice(&runs, &list(0.0)).contains("do not move even at tolerance 1e-1"));
    }

    #[test]
    fn counts_are_written_in_groups_of_three_digits() {
        assert_eq!([7, 15_280, 123_456, 1_000_000].map(grouped), ["7", "15 280", "123 456", "1 000 000"]);
    }
}
