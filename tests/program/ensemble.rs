//! `demhybrid ensemble` as a user starts it: alone, under mpirun, over runs that are there, with mistakes.

use crate::mpirun::{Job, PACKAGE};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Options that make a run short.
const SHORT: [&str; 4] = ["--set", "t_end=0.4", "--set", "solver.method=auto"];

/// A folder with the scene quick.toml, and the same without friction.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let text = fs::read_to_string(Path::new(PACKAGE).join("configs/quick.toml")).unwrap();
    fs::write(folder.path().join("quick.toml"), &text).unwrap();
    let (start, end) = (text.find("[friction]").unwrap(), text.find("[solver]").unwrap());
    fs::write(folder.path().join("smooth.toml"), format!("{}{}", &text[..start], &text[end..])).unwrap();
    folder
}

/// The rows of a table, each by the names of its columns.
fn rows(file: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(file).unwrap();
    let rows: Vec<HashMap<String, String>> = reader.deserialize().collect::<Result<_, _>>().unwrap();
    assert!(!rows.is_empty());
    rows
}

/// Whether two folders hold the same tables.
fn assert_same_tables(one: &Path, other: &Path) {
    for table in ["runs.csv", "summary.csv", "evolution.csv"] {
        let [one, other] = [one, other].map(|folder| fs::read_to_string(folder.join(table)).unwrap());
        assert!(one == other, "{table}:\n{one}\n{other}");
    }
}

#[test]
fn variants_stand_side_by_side_and_ranks_and_threads_change_no_byte() {
    let folder = folder();
    let scenes = ["ensemble", "smooth.toml", "quick.toml", "--seeds", "3,5"];
    let vary = ["--vary", "quick:friction.coefficient=0.1,0.2", "-q"];
    let job = |job: Job| job.and(&vary).and(&SHORT);
    let alone =
        job(Job::alone(folder.path(), &scenes)).and(&["-o", "alone", "--threads", "1"]).run().with_code(0);
    assert!(alone.stdout.contains("quick coefficient=0.1: 2 of 2 runs are sound"), "{}", alone.stdout);
    job(Job::on(2, folder.path(), &scenes)).and(&["-o", "shared", "--threads", "2"]).run().with_code(0);
    assert_same_tables(&folder.path().join("alone"), &folder.path().join("shared"));

    let runs = rows(&folder.path().join("alone/runs.csv"));
    let of = |run: &HashMap<String, String>| (run["case"].clone(), run["seed"].clone());
    let named: Vec<(String, String)> = runs.iter().map(of).collect();
    let expected = ["smooth", "quick coefficient=0.1", "quick coefficient=0.2"];
    let expected: Vec<(String, String)> = (expected.iter())
        .flat_map(|case| ["3", "5"].map(|seed| ((*case).to_owned(), seed.to_owned())))
        .collect();
    assert_eq!(named, expected);
    let number = |row: &HashMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
    for row in rows(&folder.path().join("alone/summary.csv")) {
        let values: Vec<f64> = (runs.iter())
            .filter(|run| run["case"] == row["case"] && !run[&row["measure"]].is_empty())
            .map(|run| number(run, &row["measure"]))
            .collect();
        assert_eq!(values.len(), 2, "{row:?}");
        assert_eq!(number(&row, "min"), values[0].min(values[1]));
        // Two roundings.
        let mean = (values[0] + values[1]) / 2.0;
        assert!((number(&row, "mean") - mean).abs() <= 1e-15 * mean.abs(), "{row:?}");
    }
    for figure in ["ranges.svg", "evolution.svg"] {
        let text = fs::read_to_string(folder.path().join("alone").join(figure)).unwrap();
        roxmltree::Document::parse(&text).unwrap();
        assert!(text.contains("coefficient=0.2") && text.contains("smooth"), "{figure}");
    }
}

#[test]
fn runs_that_are_there_give_the_tables_of_a_direct_run() {
    let folder = folder();
    for seed in ["1", "2"] {
        let set = format!("particles.grid.seed={seed}");
        let file = format!("quick-{seed}.vtkhdf");
        // Checkpoints and energies change no run.
        let more = ["--set", &set, "-o", &file, "-q", "--set", "checkpoint.interval=0.3"];
        Job::alone(folder.path(), &["quick.toml"]).and(&SHORT).and(&more).run().with_code(0);
    }
    let direct = ["ensemble", "quick.toml", "--seeds", "2", "-q", "-o", "direct"];
    Job::alone(folder.path(), &direct).and(&SHORT).run().with_code(0);
    let gather = ["ensemble", "--gather", "quick-2.vtkhdf", "quick-1.vtkhdf", "-q"];
    Job::alone(folder.path(), &gather).run().with_code(0);
    assert_same_tables(&folder.path().join("direct"), &folder.path().join("quick-ensemble"));

    let twice = ["ensemble", "--gather", "quick-1.vtkhdf", "./quick-1.vtkhdf", "--force"];
    Job::alone(folder.path(), &twice).run().with_code(2).only_error(&["quick-1.vtkhdf", "seed 1", "once"]);
    let foreign = ["ensemble", "--gather", "quick-1.vtkhdf", "quick.toml", "-o", "foreign"];
    Job::alone(folder.path(), &foreign).run().with_code(2).only_error(&["quick.toml", "HDF5"]);

    // A run that was stopped is named and left out.
    let stopped = ["quick.toml", "--set", "particles.grid.seed=3", "-o", "quick-3.vtkhdf", "-q"];
    Job::alone(folder.path(), &stopped).and(&SHORT).and(&["--set", "limits.wall=1e-9"]).run().with_code(5);
    let all = ["ensemble", "--gather", "quick-1.vtkhdf", "quick-2.vtkhdf", "quick-3.vtkhdf", "-o", "all"];
    let ended = Job::on(2, folder.path(), &all).run().with_code(0);
    assert!(ended.stderr.contains("quick-3.vtkhdf is not complete"), "{}", ended.stderr);
    assert!(ended.stdout.contains("quick: 2 of 3 runs are sound"), "{}", ended.stdout);
    let only = ["ensemble", "--gather", "quick-3.vtkhdf", "-o", "only", "-q"];
    let ended = Job::alone(folder.path(), &only).run().with_code(3);
    assert!(ended.stderr.contains("no run of quick"), "{}", ended.stderr);
}

#[test]
fn a_run_that_fails_is_told_and_the_others_count() {
    let folder = folder();
    // With the smallest step of 0.02 s a falling sphere moves too far.
    let vary = ["--vary", "solver.min_step=1e-9,0.02", "--seeds", "2"];
    let ended =
        Job::on(2, folder.path(), &["ensemble", "quick.toml"]).and(&vary).and(&SHORT).run().with_code(3);
    assert!(ended.stderr.contains("warning: quick min_step=0.02, seed 2, is left out"), "{}", ended.stderr);
    assert!(ended.stderr.contains("no run of quick min_step=0.02"), "{}", ended.stderr);
    assert!(ended.stdout.contains("quick min_step=1e-9: 2 of 2 runs are sound"), "{}", ended.stdout);
    let runs = rows(&folder.path().join("quick-ensemble/runs.csv"));
    assert!(
        runs.iter().all(|run| run["volume_fraction"].is_empty() != run["failure"].is_empty()),
        "{runs:?}"
    );
}

#[test]
fn mistakes_are_told_before_anything_is_run() {
    let folder = folder();
    for (options, parts) in [
        (&["--seeds", "0"][..], &["--seeds", "at least one"][..]),
        (&["--seeds", "5-3"], &["5-3", "empty"]),
        (&["--vary", "friction"], &["friction", "KEY=V1,V2"]),
        (&["--vary", "rough:friction.coefficient=1"], &["rough", "one of quick"]),
        (&["--vary", "friction.coefficient=-1"], &["--vary friction.coefficient=-1"]),
        (&["--vary", "frction.coefficient=1"], &["frction"]),
        (&["--measures", "height"], &["height", "bed_height"]),
        (&["--gather", "a.vtkhdf"], &["--gather"]),
        (&["--set", "particles.grid.bottom=-9"], &["beyond"]),
    ] {
        let ended = Job::alone(folder.path(), &["ensemble", "quick.toml"]).and(options).run().with_code(2);
        assert!(parts.iter().all(|part| ended.stderr.contains(part)), "{options:?}: {}", ended.stderr);
        assert!(!folder.path().join("quick-ensemble").exists());
    }
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/precious"), "mine").unwrap();
    let ended = Job::on(2, folder.path(), &["ensemble", "quick.toml", "-o", "full"]).run().with_code(2);
    ended.only_error(&["full", "--force"]);
}
