//! The table of a comparison, as plain text for the terminal.

use crate::beds::text::shortened;
use crate::math::digits::{scientific, significant};
use crate::math::interval::Interval;
use crate::studies::accuracy::records::{Measure, Record, Solver, Statistic, Study};
use std::collections::BTreeSet;

/// Largest number of measures of a study that have a column. The others are only in the CSV file.
const MOST_MEASURES: usize = 4;
/// Longest reason of a failure, in characters.
const REASON: usize = 60;

/// One block for each study, with one line for each run: method, tolerance or step, work, and measures.
///
/// The measures are the first ones by name. A failed run has its reason instead. The runs of an ensemble
/// share one line for each solver, and the statistics over their seeds come last.
pub fn table(records: &[Record], statistics: &[Statistic]) -> String {
    let mut blocks = Vec::new();
    for study in [Study::Impact, Study::State, Study::Energy] {
        let of_study: Vec<&Record> = records.iter().filter(|record| record.study == study).collect();
        if !of_study.is_empty() {
            blocks.push(format!("{}\n{}", study.name(), runs(&of_study)));
        }
    }
    let of_ensemble: Vec<&Record> = records.iter().filter(|record| record.study == Study::Ensemble).collect();
    if !of_ensemble.is_empty() {
        blocks.push(format!("ensemble: mean work of a run\n{}", ensemble(&of_ensemble)));
    }
    if !statistics.is_empty() {
        blocks.push(format!(
            "ensemble: means with 95 % intervals, and differences to the most accurate solver \
             on the same seeds\n{}",
            means(statistics)
        ));
    }
    blocks.join("\n")
}

/// One line for each run.
fn runs(records: &[&Record]) -> String {
    let all: BTreeSet<Measure> = records.iter().flat_map(|record| record.measures.keys().copied()).collect();
    let names: Vec<&str> = all.iter().map(|measure| measure.name()).collect();
    let shown: Vec<Measure> = all.into_iter().take(MOST_MEASURES).collect();
    let mut grid = Grid::new(
        &["variation", "method", "tolerance", "right-hand sides", "core seconds"],
        &names[..shown.len()],
    );
    for record in records {
        let mut line = asked(record.variation.as_deref(), &record.solver);
        line.push(record.work.rhs_evaluations.to_string());
        line.push(scientific(record.work.core_seconds, 2));
        line.extend(shown.iter().map(|measure| {
            record.measures.get(measure).map_or("-".to_owned(), |&value| cell(*measure, value))
        }));
        let reason = record.failure.as_ref().map(|why| format!("failed: {}", shortened(why, REASON)));
        grid.push(line, reason);
    }
    let mut text = grid.text();
    if names.len() > shown.len() {
        text += &format!("  also in the CSV file: {}\n", names[shown.len()..].join(", "));
    }
    text
}

/// A measure as text. An error needs its order of magnitude, any other quantity its digits.
fn cell(measure: Measure, value: f64) -> String {
    if measure.is_error() { scientific(value, 2) } else { significant(value, 6) }
}

/// One line for each solver, with the means over its seeds.
fn ensemble(records: &[&Record]) -> String {
    let mut groups: Vec<Vec<&Record>> = Vec::new();
    for record in records {
        let like = |group: &&mut Vec<&Record>| {
            group[0].solver == record.solver && group[0].variation == record.variation
        };
        match groups.iter_mut().find(like) {
            Some(group) => group.push(record),
            None => groups.push(vec![record]),
        }
    }
    let head = ["variation", "method", "tolerance", "right-hand sides", "core seconds", "runs", "failed"];
    let mut grid = Grid::new(&head, &[]);
    for group in groups {
        let runs = group.len() as f64;
        let failures: Vec<&String> = group.iter().filter_map(|record| record.failure.as_ref()).collect();
        let mut line = asked(group[0].variation.as_deref(), &group[0].solver);
        let rhs = group.iter().map(|record| record.work.rhs_evaluations as f64).sum::<f64>() / runs;
        let seconds = group.iter().map(|record| record.work.core_seconds).sum::<f64>() / runs;
        line.extend([format!("{rhs:.0}"), scientific(seconds, 2)]);
        line.extend([group.len().to_string(), failures.len().to_string()]);
        grid.push(line, failures.first().map(|why| format!("first: {}", shortened(why, REASON))));
    }
    grid.text()
}

/// One line for each solver and measure.
fn means(statistics: &[Statistic]) -> String {
    let head = ["variation", "method", "tolerance", "measure", "mean", "+-", "n", "difference", "+-"];
    let mut grid = Grid::new(&head, &[]);
    for statistic in statistics {
        let mut line = asked(statistic.variation.as_deref(), &statistic.solver);
        let Interval { mean, half_width, count } = statistic.interval;
        line.extend([statistic.measure.to_string(), significant(mean, 4), scientific(half_width, 1)]);
        line.push(count.to_string());
        line.extend(match statistic.paired {
            Some(paired) => [scientific(paired.mean, 2), scientific(paired.half_width, 1)],
            None => ["-".to_owned(), "-".to_owned()],
        });
        grid.push(line, None);
    }
    grid.text()
}

/// The first three columns of a line: variation, method and accuracy.
fn asked(variation: Option<&str>, solver: &Solver) -> Vec<String> {
    let accuracy = match (solver.tolerance, solver.step) {
        (Some(tolerance), _) => format!("{tolerance:e}"),
        (None, Some(step)) => format!("{step:e} s"),
        (None, None) => "-".to_owned(),
    };
    vec![variation.unwrap_or_default().to_owned(), solver.method.to_string(), accuracy]
}

/// Lines of cells, each followed by a remark. The first line is the head.
struct Grid {
    lines: Vec<(Vec<String>, String)>,
}

impl Grid {
    fn new(head: &[&str], more: &[&str]) -> Grid {
        let head = head.iter().chain(more).map(|&name| name.to_owned()).collect();
        Grid { lines: vec![(head, String::new())] }
    }

    fn push(&mut self, cells: Vec<String>, remark: Option<String>) {
        self.lines.push((cells, remark.unwrap_or_default()));
    }

    /// The lines as text, with words on the left of their column and numbers on the right.
    ///
    /// Each column is as wide as its widest cell.
    ///
    /// A column that is empty below its head is left out.
    fn text(&self) -> String {
        let columns = self.lines[0].0.len();
        let below = |column: usize| self.lines[1..].iter().map(move |(cells, _)| cells[column].as_str());
        let shown: Vec<(usize, usize, bool)> = (0..columns)
            .filter(|&column| below(column).any(|cell| !cell.is_empty()))
            .map(|column| {
                let width = self.lines.iter().map(|(cells, _)| cells[column].chars().count()).max();
                let words = matches!(self.lines[0].0[column].as_str(), "variation" | "method" | "measure");
                (column, width.unwrap_or(0), words)
            })
            .collect();
        let mut text = String::new();
        for (cells, remark) in &self.lines {
            let mut line = String::new();
            for &(column, width, words) in &shown {
                let cell = &cells[column];
                line += "  ";
                line += &if words { format!("{cell:<width$}") } else { format!("{cell:>width$}") };
            }
            if !remark.is_empty() {
                line += "  ";
                line += remark;
            }
            text += line.trim_end();
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use crate::studies::accuracy::records::{Stepper, Work};

    fn record(study: Study, method: MethodName, failure: Option<&str>) -> Record {
        Record {
            study,
            variation: None,
            solver: Solver { method: Stepper::Method(method), tolerance: Some(1e-3), step: None },
            seed: None,
            work: Work { rhs_evaluations: 12_345, core_seconds: 0.25, ..Work::default() },
            measures: [(Measure::PositionError, 1.234e-7)].into_iter().collect(),
            failure: failure.map(str::to_owned),
        }
    }

    #[test]
    fn a_run_is_one_aligned_line_with_work_and_error() {
        let mut verlet = record(Study::Impact, MethodName::VelocityVerlet, None);
        verlet.solver =
            Solver { method: Stepper::Method(MethodName::VelocityVerlet), tolerance: None, step: Some(1e-5) };
        let text = table(&[record(Study::Impact, MethodName::Merson, None), verlet], &[]);
        assert_eq!(
            text,
            "impact
  method           tolerance  right-hand sides  core seconds  position error (m)
  merson                1e-3             12345        2.5e-1             1.23e-7
  velocity-verlet     1e-5 s             12345        2.5e-1             1.23e-7
"
        );
    }

    #[test]
    fn a_failed_run_gives_a_short_reason_on_its_own_line() {
        let why = format!("no step can be made\n{}", "x".repeat(500));
        let text = table(&[record(Study::State, MethodName::Auto, Some(&why))], &[]);
        let line = text.lines().find(|line| line.contains("failed: no step can be made")).unwrap();
        assert!(line.chars().count() < 160 && line.ends_with('…'), "{line}");
    }

    #[test]
    fn the_seeds_of_an_ensemble_share_a_line() {
        let mut records = vec![record(Study::Ensemble, MethodName::Merson, None); 3];
        records[1].failure = Some("too fast".to_owned());
        records.push(record(Study::Ensemble, MethodName::Chebyshev, None));
        let text = table(&records, &[]);
        let merson: Vec<&str> = text.lines().filter(|line| line.contains("merson")).collect();
        assert_eq!(merson.len(), 1, "{text}");
        let cells: Vec<&str> = merson[0].split_whitespace().collect();
        assert_eq!(cells[..6], ["merson", "1e-3", "12345", "2.5e-1", "3", "1"]);
        assert!(merson[0].ends_with("first: too fast"));
    }

    #[test]
    fn a_statistic_shows_its_uncertainty_and_the_paired_difference() {
        let statistic = Statistic {
            variation: Some("contact.stiffness_exponent=30".to_owned()),
            solver: Solver { method: Stepper::Method(MethodName::Merson), tolerance: Some(1e-3), step: None },
            measure: Measure::BedHeight,
            interval: Interval { mean: 0.51234, half_width: f64::INFINITY, count: 1 },
            paired: Some(Interval { mean: -2e-6, half_width: 1e-6, count: 9 }),
        };
        let text = table(&[], &[statistic]);
        let last = text.lines().last().unwrap();
        assert_eq!(
            last.split_whitespace().collect::<Vec<_>>()[1..],
            ["merson", "1e-3", "bed", "height", "(m)", "0.5123", "inf", "1", "-2e-6", "1e-6"]
        );
        assert!(last.contains("contact.stiffness_exponent=30"));
    }

    #[test]
    fn nothing_found_gives_nothing_to_read() {
        assert_eq!(table(&[], &[]), "");
    }
}
