//! The results of an ensemble: CSV tables with all digits, a summary in JSON, and a table for the terminal.

use super::measures::{MEASURES, OVER_TIME};
use super::summary::{Spread, Summary};
use super::{Case, Run};
use crate::beds::folder::cannot_write;
use crate::beds::text::shortened;
use crate::error::Error;
use crate::math::digits::{scientific, significant};
use crate::math::interval::Interval;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Longest reason of a failure that the table shows, in characters.
const REASON: usize = 100;

/// Writes all CSV and JSON files into `folder`; returns their names.
pub fn write(folder: &Path, cases: &[Case], summary: &Summary) -> Result<Vec<String>, Error> {
    let mut written = Vec::new();
    let mut table = |name: &str, head: Vec<&str>, rows: Vec<Vec<String>>| -> Result<(), Error> {
        let path = folder.join(name);
        let mut writer = csv::Writer::from_path(&path).map_err(|why| cannot_write(&path, why))?;
        writer.write_record(head).map_err(|why| cannot_write(&path, why))?;
        rows.iter().try_for_each(|row| writer.write_record(row)).map_err(|why| cannot_write(&path, why))?;
        writer.flush().map_err(|why| cannot_write(&path, why))?;
        written.push(name.to_owned());
        Ok(())
    };
    let names = || MEASURES.iter().map(|measure| measure.name);
    let head = ["case", "seed"].into_iter().chain(names()).chain(["failure"]).collect();
    let rows = cases.iter().flat_map(|case| case.runs.iter().map(|run| run_row(case, run)));
    table("runs.csv", head, rows.collect())?;

    let mut head = vec!["case", "measure"];
    head.extend(SPREAD);
    head.extend(["difference_to_first_case", "difference_half_width_95"]);
    let rows = cases.iter().zip(&summary.ends).flat_map(|(case, ends)| {
        ends.iter().zip(names()).map(|(end, measure)| {
            let mut row = vec![case.name.clone(), measure.to_owned()];
            row.extend(spread_cells(end.spread.as_ref()));
            let difference = end.difference.map(|d| [d.mean, d.half_width]).unwrap_or([f64::NAN; 2]);
            row.extend(difference.map(cell));
            row
        })
    });
    table("summary.csv", head, rows.collect())?;

    let mut head = vec!["case", "time", "measure"];
    head.extend(SPREAD);
    let mut rows = Vec::new();
    for (case, moments) in cases.iter().zip(&summary.evolutions) {
        for moment in moments {
            for (spread, measure) in moment.spreads.iter().zip(&MEASURES[..OVER_TIME]) {
                let mut row = vec![case.name.clone(), cell(moment.time), measure.name.to_owned()];
                row.extend(spread_cells(spread.as_ref()));
                rows.push(row);
            }
        }
    }
    table("evolution.csv", head, rows)?;
    write_json(&folder.join("summary.json"), cases, summary)?;
    written.push("summary.json".to_owned());
    Ok(written)
}

const SPREAD: [&str; 6] = ["runs", "mean", "min", "max", "standard_deviation", "half_width_95"];

fn spread_cells(spread: Option<&Spread>) -> Vec<String> {
    let Some(spread) = spread else { return [vec!["0".to_owned()], vec![String::new(); 5]].concat() };
    let numbers =
        [spread.interval.mean, spread.min, spread.max, spread.standard_deviation, spread.interval.half_width];
    [vec![spread.interval.count.to_string()], numbers.map(cell).to_vec()].concat()
}

/// The number with all its digits; an empty cell if it is not finite.
fn cell(value: f64) -> String {
    if value.is_finite() { format!("{value:?}") } else { String::new() }
}

fn run_row(case: &Case, run: &Run) -> Vec<String> {
    let mut row = vec![case.name.clone(), run.seed.to_string()];
    match &run.outcome {
        Ok(followed) => {
            row.extend(followed.end.iter().enumerate().map(|(k, &value)| match k < OVER_TIME {
                true => cell(value),
                false => format!("{value}"),
            }));
            row.push(String::new());
        }
        Err(why) => {
            row.extend(vec![String::new(); MEASURES.len()]);
            row.push(shortened(why, usize::MAX));
        }
    }
    row
}

/// The summary as JSON holds it; infinite numbers are null.
#[derive(Serialize)]
struct Report<'a> {
    version: String,
    cases: Vec<CaseReport<'a>>,
}

#[derive(Serialize)]
struct CaseReport<'a> {
    name: &'a str,
    scene: &'a str,
    seeds: Vec<u64>,
    failures: Vec<Failure<'a>>,
    measures: BTreeMap<&'a str, Option<Spread>>,
    differences_to_first_case: BTreeMap<&'a str, Interval>,
}

#[derive(Serialize)]
struct Failure<'a> {
    seed: u64,
    why: &'a str,
}

fn write_json(path: &Path, cases: &[Case], summary: &Summary) -> Result<(), Error> {
    let cases = cases.iter().zip(&summary.ends).map(|(case, ends)| {
        let named = || MEASURES.iter().map(|measure| measure.name).zip(ends);
        CaseReport {
            name: &case.name,
            scene: &case.scene,
            seeds: case.runs.iter().map(|run| run.seed).collect(),
            failures: case
                .runs
                .iter()
                .filter_map(|run| Some(Failure { seed: run.seed, why: run.outcome.as_ref().err()? }))
                .collect(),
            measures: named().map(|(name, end)| (name, end.spread)).collect(),
            differences_to_first_case: named()
                .filter_map(|(name, end)| Some((name, end.difference?)))
                .collect(),
        }
    });
    let report = Report {
        version: format!("{} {}", env!("CARGO_PKG_VERSION"), env!("DEMHYBRID_COMMIT")),
        cases: cases.collect(),
    };
    let text = serde_json::to_string_pretty(&report).map_err(|why| cannot_write(path, why))?;
    std::fs::write(path, text + "\n").map_err(|why| cannot_write(path, why))
}

/// The table for the terminal: a block for every measure of `chosen`, a line for every case.
pub fn table(cases: &[Case], summary: &Summary, chosen: &[usize]) -> String {
    let width = cases.iter().map(|case| case.name.chars().count()).max().unwrap_or(0).max(4);
    let mut text = String::new();
    for &k in chosen {
        if summary.ends.iter().all(|ends| ends[k].spread.is_none()) {
            continue;
        }
        text += &format!("{} ({})\n", MEASURES[k].label, MEASURES[k].name);
        let columns = ["runs", "mean", "+- 95 %", "min", "max", "deviation"];
        text += &format!("  {:<width$}", "case");
        text += &columns.map(|column| format!("{column:>11}")).concat();
        text +=
            &if cases.len() > 1 { format!("{:>14}{:>11}\n", "difference", "+- 95 %") } else { "\n".into() };
        for (case, ends) in cases.iter().zip(&summary.ends) {
            let mut line = format!("  {:<width$}", case.name);
            match &ends[k].spread {
                None => line += "  no sound run has it",
                Some(Spread { interval, min, max, standard_deviation, .. }) => {
                    line += &format!("{:>11}", interval.count);
                    line += &format!("{:>11}", significant(interval.mean, 5));
                    line += &format!("{:>11}", scientific(interval.half_width, 2));
                    line += &format!("{:>11}{:>11}", significant(*min, 5), significant(*max, 5));
                    line += &format!("{:>11}", scientific(*standard_deviation, 2));
                }
            }
            if let Some(difference) = &ends[k].difference {
                let [mean, half] = [difference.mean, difference.half_width].map(|x| scientific(x, 2));
                line += &format!("{mean:>14}{half:>11}");
            }
            text += line.trim_end();
            text.push('\n');
        }
        text.push('\n');
    }
    for case in cases {
        let failed: Vec<(u64, &str)> = case
            .runs
            .iter()
            .filter_map(|run| Some((run.seed, run.outcome.as_ref().err()?.as_str())))
            .collect();
        let count = case.runs.len();
        text += &format!("{}: {} of {count} runs are sound", case.name, count - failed.len());
        if let Some((seed, why)) = failed.first() {
            text += &format!("; seed {seed}: {}", shortened(why, REASON));
        }
        text.push('\n');
    }
    if cases.len() > 1 {
        text += &format!("differences are to {}, between runs of the same seed\n", cases[0].name);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::ensemble::measures::Followed;

    fn cases() -> Vec<Case> {
        let run = |seed: u64, value: f64| Run {
            seed,
            outcome: Ok(Followed {
                times: vec![0.0],
                frames: vec![vec![value; OVER_TIME]],
                end: vec![value; MEASURES.len()],
            }),
        };
        let failed = Run { seed: 2, outcome: Err("no step\ncan be made".into()) };
        let case = |name: &str, runs| Case { name: name.into(), scene: "t_end = 1".into(), runs };
        vec![case("soft", vec![run(1, 3.0), run(2, 4.0)]), case("hard", vec![run(1, 5.0), failed])]
    }

    #[test]
    fn the_table_says_how_many_runs_count_and_why_others_do_not() {
        let cases = cases();
        let text = table(&cases, &Summary::of(&cases), &[0]);
        let cells = |head: &str| -> Vec<String> {
            let line = text.lines().find(|line| line.starts_with(head)).unwrap();
            line.split_whitespace().map(str::to_owned).collect()
        };
        assert_eq!(cells("  soft")[..3], ["soft", "2", "3.5000"]);
        assert_eq!(cells("  hard"), ["hard", "1", "5.0000", "inf", "5.0000", "5.0000", "inf", "2e0", "inf"]);
        assert!(text.contains("hard: 1 of 2 runs are sound; seed 2: no step can be made"), "{text}");
    }

    #[test]
    fn every_run_has_a_row_and_every_measure_its_statistics() {
        let folder = tempfile::tempdir().unwrap();
        let cases = cases();
        let written = write(folder.path(), &cases, &Summary::of(&cases)).unwrap();
        assert_eq!(written, ["runs.csv", "summary.csv", "evolution.csv", "summary.json"]);
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let rows = read("runs.csv");
        assert_eq!(rows.lines().count(), 5);
        assert!(rows.lines().nth(4).unwrap().ends_with(",no step can be made"), "{rows}");
        let row = read("summary.csv").lines().nth(1).unwrap().to_owned();
        assert!(row.starts_with("soft,volume_fraction,2,3.5,3.0,4.0,0.7071067811865476,"), "{row}");
        let json: serde_json::Value = serde_json::from_str(&read("summary.json")).unwrap();
        assert_eq!(json["cases"][1]["failures"][0]["seed"], 2);
        assert_eq!(json["cases"][0]["measures"]["volume_fraction"]["mean"], 3.5);
    }
}
