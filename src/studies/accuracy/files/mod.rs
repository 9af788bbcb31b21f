//! The files of a comparison: CSV with one row for each run, and JSON with all results.

mod table;

use super::records::{Measure, Record, Statistic};
use crate::beds::folder::cannot_write;
use crate::error::Error;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;
pub use table::table;

/// All results of one comparison.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Text of the scene.
    pub scene: String,
    /// Version of the program, with its commit.
    pub version: String,
    /// Every run.
    pub records: Vec<Record>,
    /// Means over the seeds.
    pub statistics: Vec<Statistic>,
    /// Time after which trajectories of different solvers are no longer comparable, s; `None` if the search
    /// ended before it.
    pub decorrelation_time: Option<f64>,
    /// The recommended solver, and why.
    pub recommendation: String,
    /// Notes that a reader needs to judge the numbers.
    pub notes: Vec<String>,
}

/// Columns before the measures: parameters and work of the run.
const ASKED_AND_COST: [&str; 11] = [
    "study",
    "variation",
    "method",
    "tolerance",
    "step",
    "seed",
    "rhs_evaluations",
    "pair_evaluations",
    "steps_accepted",
    "steps_rejected",
    "core_seconds",
];

/// Writes one row for each run: its parameters, its work, its measures and its failure.
///
/// Every measure of any run has a column, which is empty for runs without it. Numbers keep all digits.
pub fn write_csv(path: &Path, records: &[Record]) -> Result<(), Error> {
    let measures: BTreeSet<Measure> =
        records.iter().flat_map(|record| record.measures.keys().copied()).collect();
    let mut writer = csv::Writer::from_path(path).map_err(|why| cannot_write(path, why))?;
    let head =
        ASKED_AND_COST.into_iter().chain(measures.iter().map(|measure| measure.name())).chain(["failure"]);
    writer.write_record(head).map_err(|why| cannot_write(path, why))?;
    for record in records {
        writer.write_record(row(record, &measures)).map_err(|why| cannot_write(path, why))?;
    }
    writer.flush().map_err(|why| cannot_write(path, why))
}

fn row(record: &Record, measures: &BTreeSet<Measure>) -> Vec<String> {
    let Record { study, variation, solver, seed, work, .. } = record;
    let mut row = vec![
        study.name().to_owned(),
        variation.clone().unwrap_or_default(),
        solver.method.to_string(),
        number(solver.tolerance),
        number(solver.step),
        seed.map(|seed| seed.to_string()).unwrap_or_default(),
        work.rhs_evaluations.to_string(),
        work.pair_evaluations.to_string(),
        work.steps_accepted.to_string(),
        work.steps_rejected.to_string(),
        number(Some(work.core_seconds)),
    ];
    row.extend(measures.iter().map(|measure| number(record.measures.get(measure).copied())));
    row.push(record.failure.clone().unwrap_or_default());
    row
}

/// The fewest digits that read back as the same double; an empty cell for `None`.
fn number(value: Option<f64>) -> String {
    value.map(|value| format!("{value:?}")).unwrap_or_default()
}

/// Writes the report as JSON. Infinity and NaN become null, because JSON has neither.
pub fn write_json(path: &Path, report: &Report) -> Result<(), Error> {
    let mut text = serde_json::to_string_pretty(report).map_err(|why| cannot_write(path, why))?;
    text.push('\n');
    std::fs::write(path, text).map_err(|why| cannot_write(path, why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::interval::Interval;
    use crate::ode::MethodName;
    use crate::studies::accuracy::records::{Solver, Stepper, Study, Work};

    fn record(method: MethodName, measures: &[(Measure, f64)], failure: Option<&str>) -> Record {
        Record {
            study: Study::Impact,
            variation: None,
            solver: Solver { method: Stepper::Method(method), tolerance: Some(1e-3), step: None },
            seed: Some(7),
            work: Work { rhs_evaluations: 1234, core_seconds: 0.1 + 0.2, ..Work::default() },
            measures: measures.iter().copied().collect(),
            failure: failure.map(str::to_owned),
        }
    }

    #[test]
    fn a_csv_row_reads_back_as_the_run_it_came_from() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        let why = "no step, \"h\" too small\nat t = 0.1 s";
        let tiny = f64::MIN_POSITIVE / 3.0;
        let records = [
            record(
                MethodName::Merson,
                &[(Measure::PositionError, tiny), (Measure::ContactError, f64::INFINITY)],
                None,
            ),
            record(MethodName::Auto, &[(Measure::Restitution, 1.0)], Some(why)),
        ];
        write_csv(&path, &records).unwrap();

        let mut reader = csv::Reader::from_path(&path).unwrap();
        let head: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
        assert_eq!(head[..11], ASKED_AND_COST);
        assert_eq!(head[11..], ["error of contact time", "position error (m)", "restitution", "failure"]);
        let rows: Vec<csv::StringRecord> = reader.records().map(|row| row.unwrap()).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!((&rows[0][2], &rows[0][4], &rows[0][5], &rows[0][6]), ("merson", "", "7", "1234"));
        assert_eq!(rows[0][10].parse::<f64>().unwrap(), 0.1 + 0.2);
        assert_eq!(rows[0][11].parse::<f64>().unwrap(), f64::INFINITY);
        assert_eq!(rows[0][12].parse::<f64>().unwrap(), tiny);
        assert_eq!((&rows[0][13], &rows[0][14]), ("", ""));
        assert_eq!((&rows[1][11], &rows[1][13], &rows[1][14]), ("", "1.0", why));
    }

    #[test]
    fn no_run_gives_a_csv_file_with_its_first_line_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        write_csv(&path, &[]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 1);
    }

    #[test]
    fn infinities_become_null_in_json() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        let solver =
            Solver { method: Stepper::Method(MethodName::Merson), tolerance: Some(1e-3), step: None };
        let one_run = Interval { mean: 0.5, half_width: f64::INFINITY, count: 1 };
        let report = Report {
            scene: "[time]\nend = 1.0\n".to_owned(),
            version: "0.1.0".to_owned(),
            records: vec![record(MethodName::Merson, &[(Measure::PositionError, f64::NAN)], None)],
            statistics: vec![Statistic {
                variation: None,
                solver,
                measure: Measure::BedHeight,
                interval: one_run,
                paired: None,
            }],
            decorrelation_time: Some(f64::INFINITY),
            recommendation: "merson 1e-3".to_owned(),
            notes: vec!["one run".to_owned()],
        };
        write_json(&path, &report).unwrap();

        let read: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(read["records"][0]["study"], "impact");
        assert_eq!(read["records"][0]["work"]["core_seconds"].as_f64(), Some(0.1 + 0.2));
        assert!(read["records"][0]["measures"]["position error (m)"].is_null());
        assert!(read["statistics"][0]["interval"]["half_width"].is_null());
        assert_eq!(read["statistics"][0]["interval"]["count"], 1);
        assert_eq!(read["statistics"][0]["measure"], "bed height (m)");
        assert!(read["decorrelation_time"].is_null());
        assert_eq!(read["scene"], report.scene);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing").join("runs.csv");
        let error = write_csv(&path, &[]).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("runs.csv"), "{error}");
    }
}
