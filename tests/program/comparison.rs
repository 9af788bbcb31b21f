//! `demhybrid accuracy` through all studies: the same rows on any ranks, failed runs, faults, mistakes.

use crate::mpirun::Job;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Two spheres, one on top of the other, with friction and rotation; both have landed after 0.2 s.
const SCENE: &str = "
t_end = 0.2
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.1, mass = 1, grid = { count = 2, spacing = 0.25, jitter = 0.02, bottom = 0.01 } }
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.1 }
friction = { coefficient = 0.2, regularization_velocity = 0.1 }
container.box = { min = [0.0, 0.0, 0.0], max = [0.3, 0.3, inf] }
";

/// Few solvers; the second step of velocity-verlet is too small for the work that a run may take.
const FEW: &[&str] = &[
    "accuracy",
    "two.toml",
    "--methods",
    "merson,velocity-verlet",
    "--tolerances",
    "1e-2,1e-4",
    "--steps",
    "1e-4,1e-11",
    "--seeds",
    "2",
    "--paper",
    "--sweep",
    "contact.stiffness_exponent=100,200",
];

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("two.toml"), SCENE).unwrap();
    folder
}

/// The rows of runs.csv without the core seconds, which differ from run to run.
fn rows(folder: &Path) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(folder.join("runs.csv")).unwrap();
    let head = reader.headers().unwrap().clone();
    let timed = head.iter().position(|name| name == "core_seconds").unwrap();
    let row = |row: &csv::StringRecord| {
        let all = row.iter().enumerate();
        all.filter(|(column, _)| *column != timed).map(|(_, cell)| cell.to_owned()).collect()
    };
    let rows = reader.records().map(|record| row(&record.unwrap()));
    [row(&head)].into_iter().chain(rows).collect()
}

#[test]
fn all_studies_give_the_same_rows_alone_and_on_ranks_and_threads() {
    let folder = folder();
    let alone = Job::alone(folder.path(), FEW).and(&["--threads", "1"]).run().with_code(0);
    let ranks =
        Job::on(2, folder.path(), FEW).and(&["--threads", "2", "-q", "-o", "ranks"]).run().with_code(0);
    let found = rows(&folder.path().join("two-accuracy"));
    assert_eq!(found, rows(&folder.path().join("ranks")));

    // 5 solvers: impact and energy once, state and ensemble from 2 seeds; 2 values of the sweep: impact and 2
    // beds.
    assert_eq!(found.len(), 1 + 5 + 5 + 10 + 10 + 2 + 4);
    for svg in ["impact", "restitution", "state", "separation", "energy", "energies", "ensemble", "sweep"] {
        let text = fs::read_to_string(folder.path().join(format!("two-accuracy/{svg}.svg"))).unwrap();
        assert!(text.contains("two: ") && text.trim_end().ends_with("</svg>"), "{svg}");
    }
    assert!(alone.stderr.contains("runs to come"), "{}", alone.stderr);
    assert_eq!(ranks.stderr.lines().filter(|line| line.contains("runs")).count(), 0, "{}", ranks.stderr);
    for part in
        ["recommendation", "take merson at tolerance", "sweep: error of the model", "two-accuracy: runs.csv"]
    {
        assert!(alone.stdout.contains(part), "nothing of {part:?} in\n{}", alone.stdout);
    }
}

#[test]
fn a_failed_run_is_a_row_with_its_reason_and_ends_nothing() {
    let folder = folder();
    let job = Job::alone(folder.path(), FEW).and(&["--studies", "impact,state", "-q"]).run().with_code(0);
    assert!(job.stderr.is_empty(), "{}", job.stderr);
    let rows = rows(&folder.path().join("two-accuracy"));
    let failed: Vec<&Vec<String>> =
        rows.iter().skip(1).filter(|row| !row.last().unwrap().is_empty()).collect();
    assert_eq!(failed.len(), 3, "one impact and two states: {failed:?}");
    assert!(failed.iter().all(|row| row[2] == "velocity-verlet" && row[4] == "1e-11"), "{failed:?}");
    assert!(failed[0].last().unwrap().contains("right-hand sides"), "{failed:?}");
    assert!(job.stdout.contains("failed: "), "{}", job.stdout);
    let figure = fs::read_to_string(folder.path().join("two-accuracy/state.svg")).unwrap();
    assert!(figure.contains("failed"));
}

#[test]
fn a_bug_in_a_run_ends_all_ranks_with_code_70_and_a_full_disk_with_code_4() {
    let folder = folder();
    let job = Job::on(2, folder.path(), FEW).with_fault(1, "job=panic");
    let rank = if cfg!(feature = "mpi") { "internal error on rank 1" } else { "internal error on rank 0" };
    job.run().with_code(70).only_error(&[rank]);

    fs::remove_dir_all(folder.path().join("two-accuracy")).unwrap();
    fs::create_dir(folder.path().join("two-accuracy")).unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("two-accuracy/runs.csv")).unwrap();
    let job = Job::on(2, folder.path(), FEW).and(&["--studies", "impact", "--force"]);
    job.run().with_code(4).only_error(&["runs.csv"]);
}

#[test]
fn mistakes_end_with_code_2_before_anything_is_computed() {
    let folder = folder();
    for (more, parts) in [
        (vec!["--methods", "euler"], vec!["--methods", "euler", "merson"]),
        (vec!["--tolerances", "-1"], vec!["--tolerances", "-1", "greater than 0"]),
        (vec!["--sweep", "contact.softness=1"], vec!["--sweep contact.softness=1"]),
        (vec!["--sweep", "contact.restitution=2"], vec!["--sweep contact.restitution=2", "0..1"]),
        (vec!["--output", "two.toml"], vec!["--output two.toml", "folder"]),
        (vec!["--set", "t_end=-1"], vec!["--set t_end=-1"]),
    ] {
        let job = Job::alone(folder.path(), &["accuracy", "two.toml"]).and(&more).run().with_code(2);
        job.only_error(&parts);
    }
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/mine"), "").unwrap();
    let refused = ["accuracy", "two.toml", "-o", "full"];
    Job::on(2, folder.path(), &refused).run().with_code(2).only_error(&["--output full", "--force"]);
    assert_eq!(fs::read_dir(folder.path().join("full")).unwrap().count(), 1);
    assert!(!folder.path().join("two-accuracy").exists());
}
