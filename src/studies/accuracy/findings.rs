//! The results of a study, and medians over runs with different seeds.

use super::records::{Measure, Record, Statistic, Work};
use std::collections::BTreeMap;

/// The results of a study.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// Its runs.
    pub records: Vec<Record>,
    /// Its means over the seeds.
    pub statistics: Vec<Statistic>,
    /// Notes that a reader needs to judge the numbers.
    pub notes: Vec<String>,
}

/// The measures in `list` that have a value. One that is NaN is left out.
pub fn measures<const N: usize>(list: [(Measure, f64); N]) -> BTreeMap<Measure, f64> {
    list.into_iter().filter(|(_, value)| !value.is_nan()).collect()
}

/// Groups the records by study, solver and variation, in the order of their first members.
pub fn by_solver<'a>(records: impl IntoIterator<Item = &'a Record>) -> Vec<Vec<&'a Record>> {
    let mut groups: Vec<Vec<&Record>> = Vec::new();
    for record in records {
        let like = |group: &&mut Vec<&Record>| {
            let first = group[0];
            (&first.solver, &first.variation, first.study)
                == (&record.solver, &record.variation, record.study)
        };
        match groups.iter_mut().find(like) {
            Some(group) => group.push(record),
            None => groups.push(vec![record]),
        }
    }
    groups
}

/// One record for each solver, with the medians of work and of every measure over its seeds.
///
/// The measures of a failed run count as infinite. If at least half of the runs failed, the record has failed
/// too, with the reason of the first failure.
pub fn medians<'a>(records: impl IntoIterator<Item = &'a Record>) -> Vec<Record> {
    by_solver(records).into_iter().map(|group| median_record(&group)).collect()
}

fn median_record(group: &[&Record]) -> Record {
    let of_work = |of: fn(&Work) -> f64| median(group.iter().map(|record| of(&record.work)).collect());
    let count = |of: fn(&Work) -> f64| of_work(of).round() as u64;
    let work = Work {
        rhs_evaluations: count(|work| work.rhs_evaluations as f64),
        pair_evaluations: count(|work| work.pair_evaluations as f64),
        steps_accepted: count(|work| work.steps_accepted as f64),
        steps_rejected: count(|work| work.steps_rejected as f64),
        core_seconds: of_work(|work| work.core_seconds),
    };
    let failures = group.iter().filter(|record| record.failure.is_some()).count();
    let mut measures = BTreeMap::new();
    for &measure in group.iter().flat_map(|record| record.measures.keys()) {
        let value = |record: &&Record| match (&record.failure, record.measures.get(&measure)) {
            (None, Some(&value)) => value,
            _ => f64::INFINITY,
        };
        measures.entry(measure).or_insert_with(|| median(group.iter().map(value).collect()));
    }
    let failed = 2 * failures >= group.len();
    if failed {
        measures.clear();
    }
    let failure = group.iter().find_map(|record| record.failure.clone()).filter(|_| failed);
    Record { seed: None, work, measures, failure, ..group[0].clone() }
}

/// The middle value, or the mean of the two in the middle; NaN for an empty list.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match (values.len(), values.len() / 2) {
        (0, _) => f64::NAN,
        (length, middle) if length % 2 == 1 => values[middle],
        (_, middle) => (values[middle - 1] + values[middle]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use crate::studies::accuracy::records::Study;
    use crate::studies::accuracy::solvers::adaptive;

    fn record(tolerance: f64, seed: u64, error: Option<f64>) -> Record {
        Record {
            study: Study::State,
            variation: None,
            solver: adaptive(MethodName::Merson, tolerance),
            seed: Some(seed),
            work: Work { rhs_evaluations: 100 * seed, ..Work::default() },
            measures: error.map(|error| (Measure::PositionError, error)).into_iter().collect(),
            failure: error.is_none().then(|| format!("seed {seed} failed")),
        }
    }

    #[test]
    fn a_median_is_not_moved_by_an_outlier_or_one_failure() {
        let records = [
            record(1e-1, 1, Some(1.0)),
            record(1e-2, 1, Some(0.1)),
            record(1e-1, 2, Some(900.0)),
            record(1e-1, 3, Some(2.0)),
            record(1e-2, 2, None),
            record(1e-2, 3, Some(0.3)),
        ];
        let medians = medians(&records);
        assert_eq!(medians.len(), 2);
        assert_eq!(
            (medians[0].measures[&Measure::PositionError], medians[0].work.rhs_evaluations),
            (2.0, 200)
        );
        assert_eq!((medians[1].measures[&Measure::PositionError], &medians[1].failure), (0.3, &None));
    }

    #[test]
    fn where_half_of_the_runs_fail_the_solver_has_failed() {
        let medians = medians(&[record(1e-1, 1, Some(1.0)), record(1e-1, 2, None)]);
        assert_eq!(medians[0].failure.as_deref(), Some("seed 2 failed"));
        assert!(medians[0].measures.is_empty());
    }
}
