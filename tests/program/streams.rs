//! Where the streams of the program lead nowhere: what it could not say is told, and no run is lost.

use crate::mpirun::{Ended, Job, PROGRAM, signal_job};
use crate::results::Results;
use rustix::process::Signal;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Two spheres that fall, for a moment.
const SCENE: &str = "
t_end = 0.05
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.1, mass = 1.0, grid = { count = 2, spacing = 0.3, bottom = 0.01, seed = 1 } }
container.box = { min = [0.0, 0.0, 0.0], max = [0.6, 0.6, inf] }
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.1 }
";

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    folder
}

/// Runs the program by a shell. Its exit code is that of the program, also before a pipe.
fn shell(folder: &Path, line: &str) -> Ended {
    let script = match line.split_once('|') {
        Some((line, reader)) => {
            format!("{{ \"$PROGRAM\" {line}; echo $? >code; }} | {reader}; exit $(cat code)")
        }
        None => format!("exec \"$PROGRAM\" {line}"),
    };
    Job::alone(folder, &["-c", &script]).of("/bin/sh".into()).with_variable("PROGRAM", PROGRAM).run()
}

#[test]
fn a_summary_that_cannot_be_printed_is_told_and_the_run_is_complete() {
    let folder = folder();
    let run = "scene.toml --force --threads 1 -q";
    for (stdout, why) in
        [(">/dev/full", "No space left on device"), (">&-", "it is closed"), ("| true", "Broken pipe")]
    {
        // The reader must have gone before the summary comes; two spheres are done in no time.
        let stdout = if stdout == "| true" { "--set t_end=5 | true" } else { stdout };
        let ended = shell(folder.path(), &format!("{run} {stdout}")).with_code(4);
        ended.only_error(&["cannot write to stdout: ", why, "complete all the same, in scene.vtkhdf"]);
        assert_eq!(Results::open(&folder.path().join("scene.vtkhdf")).count("completed"), 1);
    }
    // A run that was stopped says both, and its code is that of the stop.
    let ended = shell(folder.path(), &format!("{run} --set t_end=1e5 --set limits.wall=0.1 >/dev/full"));
    let ended = ended.with_code(5);
    assert!(ended.stderr.contains("stopped and saved all the same, in scene.vtkhdf"), "{}", ended.stderr);
}

#[test]
fn what_a_tool_cannot_print_is_told_but_not_to_a_reader_who_has_enough() {
    let folder = folder();
    shell(folder.path(), "scene.toml --threads 1 -q").with_code(0);
    let runs = "--threads 1 -q --force -o runs";
    for line in [
        "schema",
        "man",
        "completions bash",
        "--help",
        "--version",
        "ensemble --help",
        "scene.toml --force --dry-run",
        "analyze scene.vtkhdf --force -o bed",
        &format!("ensemble scene.toml --seeds 1 --times 0 {runs}"),
        &format!("accuracy scene.toml --studies impact --methods auto --tolerances 1e-1 {runs}"),
    ] {
        for (stdout, why) in [(">/dev/full", "No space left on device"), (">&-", "it is closed")] {
            let ended = shell(folder.path(), &format!("{line} {stdout}")).with_code(4);
            ended.only_error(&["cannot write to stdout: ", why]);
        }
        let ended = shell(folder.path(), &format!("{line} | true")).with_code(0);
        assert!(ended.errors().is_empty(), "{line}: {}", ended.stderr);
    }
    let csv = "export scene.vtkhdf --to csv -o /dev/stdout --force";
    shell(folder.path(), &format!("{csv} >/dev/full")).with_code(4).only_error(&["No space left on device"]);
    shell(folder.path(), &format!("{csv} | true")).with_code(0);
}

#[test]
fn a_run_needs_nobody_to_listen_to_its_progress() {
    let folder = folder();
    for stderr in ["2>&-", "2>/dev/full", "2>&- <&-"] {
        let ended = shell(folder.path(), &format!("scene.toml --force --threads 1 {stderr}")).with_code(0);
        assert!(ended.stdout.contains("scene.toml done"), "{}", ended.stdout);
        assert_eq!(Results::open(&folder.path().join("scene.vtkhdf")).count("completed"), 1);
    }
}

#[test]
fn a_hangup_stops_a_run_with_a_checkpoint_but_not_one_under_nohup() {
    let folder = folder();
    for (before, ends) in [("", 5), ("nohup ", 0)] {
        let script = format!("exec {before}\"$PROGRAM\" scene.toml --force --threads 1 --set t_end=20");
        // 2e5 steps: the signal comes before the end, and the end soon enough.
        let script = script + " --set output.interval=0.01 --set solver.max_step=1e-4";
        let job = Job::alone(folder.path(), &["-c", &script]).of("/bin/sh".into());
        let mut job = job.with_variable("PROGRAM", PROGRAM).start();
        job.wait_for_frames(10);
        signal_job(&job, Signal::HUP);
        let ended = job.end().with_code(ends);
        if ends == 5 {
            assert!(ended.stderr.contains("stopped by SIGHUP at t = "), "{}", ended.stderr);
            assert!(folder.path().join("scene.vtkhdf.ckpt-a").exists());
        } else {
            assert!(ended.stdout.contains("scene.toml done"), "{}", ended.stdout);
        }
    }
}
