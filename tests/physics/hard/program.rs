//! What the real program says of hard cases, and the code it ends with: on three ranks, and as a dry run.

use super::scene::{Case, Outcome, folder};
use crate::mpirun::Job;

/// The file of the scene `name`.
fn file(name: &str) -> String {
    folder().join(format!("{name}.toml")).to_str().unwrap().to_owned()
}

#[test]
fn the_program_ends_hard_cases_on_three_ranks_with_the_stated_code_and_warning() {
    for name in [
        "rest-27",
        "two-aligned",
        "open-container",
        "min-step",
        "coincident",
        "outside",
        "tolerance-1e-14-scaled",
        "memory-corner",
    ] {
        let case = Case::read(name);
        let folder = tempfile::tempdir().unwrap();
        let arguments = [&file(name), "-q", "--threads", "1", "--output", "out.vtkhdf"];
        let ended = Job::on(3, folder.path(), &arguments).run();
        let warnings: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
        match &case.outcome {
            Outcome::Exit(code, text) => {
                assert_eq!(ended.code, *code, "{name}: {}", ended.stderr);
                ended.only_error(&[text]);
            }
            outcome => {
                assert_eq!(ended.code, 0, "{name}: {}", ended.stderr);
                match outcome {
                    Outcome::Warns(text) => {
                        assert!(warnings.iter().any(|warning| warning.contains(text)), "{name}: {warnings:?}")
                    }
                    _ => assert!(warnings.is_empty(), "{name}: {warnings:?}"),
                }
            }
        }
    }
}

#[test]
fn a_dry_run_warns_of_what_can_be_known_before() {
    for (name, warnings) in [
        ("barrier-wall", 1),
        ("barrier-pair", 1),
        ("kappa-30-cut", 1),
        ("tolerance-1e6", 1),
        ("overlap-90", 1),
        ("rest-27", 0),
        ("wall-100", 0),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let ended = Job::alone(folder.path(), &[&file(name), "--dry-run"]).run().with_code(0);
        let told: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
        assert_eq!(told.len(), warnings, "{name}: {told:?}");
        if let (1, Outcome::Warns(text)) = (warnings, Case::read(name).outcome) {
            assert!(told[0].contains(&text), "{name}: {told:?}");
        }
        assert!(ended.stdout.contains("nothing was run"), "{name}");
    }
}

#[test]
fn a_dry_run_refuses_a_start_with_the_message_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let said = [&["--dry-run"][..], &["-q", "--output", "out.vtkhdf"]].map(|options| {
        let ended = Job::alone(folder.path(), &[&file("coincident")]).and(options).run().with_code(2);
        assert!(!ended.stdout.contains("is valid"), "{}", ended.stdout);
        ended.stderr
    });
    assert!(said[0].contains("particles 1 and 2 (rows 2 and 3 below the first line) have the same centre"));
    assert_eq!(said[0], said[1]);
}
