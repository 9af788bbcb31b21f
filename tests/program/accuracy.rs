//! `demhybrid accuracy` as a user starts it: alone, under mpirun, with mistakes.

use crate::mpirun::{Job, PACKAGE};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder with a sphere that bounces, and with five that fall into a small box.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    for name in ["bounce.toml", "bounce.csv", "quick.toml"] {
        fs::copy(Path::new(PACKAGE).join("configs").join(name), folder.path().join(name)).unwrap();
    }
    folder
}

/// The rows of runs.csv, each by the names of its columns.
fn runs(folder: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(folder.join("runs.csv")).unwrap();
    let rows: Vec<HashMap<String, String>> = reader.deserialize().collect::<Result<_, _>>().unwrap();
    assert!(!rows.is_empty());
    rows
}

#[test]
fn one_bounce_is_compared_with_its_exact_answers() {
    let folder = folder();
    let arguments =
        ["accuracy", "bounce.toml", "--methods", "dormand-prince,velocity-verlet", "--tolerances"];
    let ended = Job::alone(folder.path(), &arguments)
        .and(&["1e-3,1e-8", "--steps", "1e-4", "--studies", "impact,energy", "-q"])
        .run()
        .with_code(0);
    // The exact rebound time, as in docs/accuracy.md: 3.61907 s.
    assert!(ended.stdout.contains("highest again after 3.61907"), "{}", ended.stdout);
    assert!(ended.stdout.contains("recommendation"), "{}", ended.stdout);
    let results = folder.path().join("bounce-accuracy");
    let runs = runs(&results);
    let error = |tolerance: &str, measure: &str| -> f64 {
        let row = |row: &&HashMap<String, String>| {
            row["method"] == "dormand-prince"
                && row["tolerance"].parse::<f64>().unwrap() == tolerance.parse::<f64>().unwrap()
                && !row[measure].is_empty()
        };
        runs.iter().find(row).unwrap_or_else(|| panic!("{measure} at {tolerance}"))[measure].parse().unwrap()
    };
    let measures: Vec<String> =
        runs[0].keys().filter(|name| name.starts_with("error of re")).cloned().collect();
    assert!(!measures.is_empty(), "{:?}", runs[0].keys());
    for measure in &measures {
        let (loose, tight) = (error("1e-3", measure), error("1e-8", measure));
        assert!(tight < 1e-7 && tight <= loose, "{measure}: {tight} after {loose}");
    }
    for file in ["accuracy.json", "impact.svg", "energy.svg", "energies.svg"] {
        assert!(fs::metadata(results.join(file)).unwrap().len() > 1000, "{file}");
    }
}

#[test]
fn ranks_and_threads_share_the_runs_and_change_none() {
    let folder = folder();
    let arguments = ["accuracy", "quick.toml", "--methods", "auto,merson", "--tolerances", "1e-1,1e-2"];
    let more = ["--seeds", "2", "--until", "0.3", "--time", "0.3", "--studies", "state,ensemble", "-q", "-o"];
    let alone = Job::alone(folder.path(), &arguments).and(&more).and(&["alone", "--threads", "1"]);
    alone.run().with_code(0);
    let shared = Job::on(2, folder.path(), &arguments).and(&more).and(&["shared", "--threads", "2"]);
    shared.run().with_code(0);
    let without_seconds = |name: &str| {
        let mut rows = runs(&folder.path().join(name));
        rows.iter_mut().for_each(|row| assert!(row.remove("core_seconds").is_some()));
        rows
    };
    let (alone, shared) = (without_seconds("alone"), without_seconds("shared"));
    assert_eq!(alone, shared);
    assert!(alone.len() >= 12, "{} runs", alone.len());
}

#[test]
fn mistakes_in_options_are_told_before_anything_is_run() {
    let folder = folder();
    for (options, parts) in [
        (&["--tolerances", "0"][..], &["--tolerances", "0"][..]),
        (&["--time=-1"], &["--time", "-1"]),
        (&["--sweep", "contact.stiffness=1,2"], &["contact.stiffness"]),
        (&["--methods", "euler"], &["euler"]),
    ] {
        let ended = Job::alone(folder.path(), &["accuracy", "quick.toml"]).and(options).run().with_code(2);
        assert!(parts.iter().all(|part| ended.stderr.contains(part)), "{options:?}: {}", ended.stderr);
        assert!(!folder.path().join("quick-accuracy").exists());
    }
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/precious"), "mine").unwrap();
    let ended = Job::alone(folder.path(), &["accuracy", "bounce.toml", "-o", "full"]).run().with_code(2);
    ended.only_error(&["full", "--force"]);
}
