//! Two processes and one output file: one writes, the others are refused, and no file holds frames that
//! nobody computed.

use crate::mpirun::{Ended, Job, Running, kill, signal_job};
use crate::python::{python, run_python};
use crate::results::Results;
use rustix::process::Signal;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Seconds that a job may live on after it was asked to stop, or after a fault.
const DEADLINE: u64 = 90;
/// How often each is tried: once here, 20 times in launch/test-long.sh.
const TRIES: usize = if cfg!(feature = "long-tests") { 20 } else { 1 };

/// 27 spheres that fall and settle, in small steps: the run lasts for hours, and has many frames.
const SCENE: &str = "
t_end = 1e5
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.1, mass = 1.0, grid = { count = 27, bottom = 0.1, seed = 5 } }
container.box = { min = [0.0, 0.0, 0.0], max = [0.75, 0.75, inf] }
friction = { coefficient = 0.2, regularization_velocity = 0.01 }
solver.max_step = 1e-3
output.interval = 0.05
output.sync = 0.05
checkpoint.interval = 0.05
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.1 }
";
/// Sets of a run that comes to its end, and differs from the other one.
const SHORT: [&str; 5] = ["--set", "t_end=0.5", "--set", "particles.grid.seed=6", "-q"];

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    folder
}

/// Without mpirun where `ranks` is 0.
fn job(ranks: usize, folder: &Path, arguments: &[&str]) -> Job {
    let job = if ranks == 0 { Job::alone(folder, arguments) } else { Job::on(ranks, folder, arguments) };
    job.and(&["--threads", "1"])
}

/// Starts a run without an end in `folder` and waits until it is at work.
fn at_work(ranks: usize, folder: &Path, arguments: &[&str]) -> Running {
    let mut running = job(ranks, folder, arguments).start();
    running.wait_for_frames(10);
    running
}

fn stopped(mut running: Running) -> Ended {
    signal_job(&running, Signal::USR1);
    running.must_end_within(DEADLINE);
    running.end().with_code(5)
}

fn killed(mut running: Running, ranks: usize) {
    if ranks == 0 {
        signal_job(&running, Signal::KILL);
    } else {
        kill(running.process_of(0));
    }
    running.must_end_within(DEADLINE);
    assert_ne!(running.end().code, 0);
}

/// Fails unless a run has computed every frame; `complete` if it came to its end.
#[track_caller]
fn assert_sound(folder: &Path, complete: bool) {
    let results = Results::open(&folder.join("scene.vtkhdf"));
    assert_eq!(results.count("completed"), i64::from(complete));
    assert!(results.frames() > 0);
    let rows = 3 * results.particles();
    let all = results.reals("VTKHDF/Points");
    for (k, time) in results.times().into_iter().enumerate() {
        assert!((time - k as f64 * 0.05).abs() < 1e-9, "frame {k} at {time} s");
        let frame = &all[k * rows..(k + 1) * rows];
        assert!(frame.chunks(3).all(|x| x != [0.0; 3]), "frame {k} is one that nobody computed");
    }
    if let Some(python) = python() {
        let what = if complete { "complete" } else { "" };
        run_python(&python, "sound_frames.py", folder, &["scene.vtkhdf", "0.05", what]);
    }
}

/// The one message of a refusal.
#[track_caller]
fn assert_refused(ended: Ended, file: &str) {
    let ended = ended.with_code(2);
    let host = rustix::system::uname().nodename().to_string_lossy().into_owned();
    ended.only_error(&[
        &format!("output.file = \"{file}\": process "),
        &format!(" on {host}, since 20"),
        "is writing it; wait for the end of that run, or stop it, or write somewhere else",
    ]);
    assert!(ended.stdout.is_empty(), "{}", ended.stdout);
}

fn lock(folder: &Path) -> PathBuf {
    folder.join("scene.vtkhdf.lock")
}

/// Names of the files in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

#[test]
fn a_run_at_work_keeps_every_other_writer_out_by_whatever_name_and_no_reader() {
    for ranks in [0, 2].repeat(TRIES) {
        let folder = folder();
        let at = folder.path();
        symlink("scene.vtkhdf", at.join("link")).unwrap();
        symlink(".", at.join("door")).unwrap();
        let first = at_work(ranks, at, &["scene.toml"]);
        let second = |ranks: usize, arguments: &[&str]| job(ranks, at, arguments).start_beside(&first).end();
        assert_refused(second(ranks, &[&["scene.toml", "--force"], &SHORT[..]].concat()), "scene.vtkhdf");
        assert_refused(second(0, &["scene.toml"]), "scene.vtkhdf");
        assert_refused(second(ranks, &["--resume", "scene.vtkhdf"]), "scene.vtkhdf");
        assert_refused(second(0, &["scene.toml", "--force", "-o", "link"]), "link");
        let name =
            "door/../".to_owned() + &folder.path().file_name().unwrap().to_string_lossy() + "/door/link";
        assert_refused(second(0, &["scene.toml", "--force", "-o", &name]), &name);
        let plan = second(0, &["scene.toml", "--force", "--dry-run"]).with_code(0);
        assert!(plan.line("output").contains("would be refused") && plan.stdout.contains("is writing it"));
        // A run of the same name elsewhere has nothing to do with it, and readers are welcome.
        fs::create_dir(at.join("other")).unwrap();
        second(0, &[&["scene.toml", "-o", "other/scene.vtkhdf"], &SHORT[..]].concat()).with_code(0);
        let table = Job::alone(at, &["analyze", "scene.vtkhdf", "-o", "bed"]).start_beside(&first).end();
        table.with_code(0);
        stopped(first);
        assert_sound(at, false);
        assert!(!lock(at).exists());
        // A run that goes on is as much at work, and one that goes on again.
        for _ in 0..2 {
            let resumed = at_work(ranks, at, &["--resume", "scene.vtkhdf"]);
            let second = |arguments: &[&str]| job(ranks, at, arguments).start_beside(&resumed).end();
            assert_refused(second(&["--resume", "scene.vtkhdf"]), "scene.vtkhdf");
            assert_refused(second(&[&["scene.toml", "--force"], &SHORT[..]].concat()), "scene.vtkhdf");
            stopped(resumed);
            assert_sound(at, false);
        }
        assert_eq!(names(at).iter().filter(|name| name.ends_with(".lock")).count(), 0);
    }
}

#[test]
fn of_runs_that_start_at_one_moment_one_writes() {
    for ranks in [0, 2].repeat(TRIES) {
        let folder = folder();
        let arguments = [&["scene.toml"][..], &SHORT].concat();
        let first = job(ranks, folder.path(), &arguments).start();
        let others = [(); 2].map(|()| job(ranks, folder.path(), &arguments).start_beside(&first));
        let ended: Vec<Ended> = [first].into_iter().chain(others).map(Running::end).collect();
        let mut codes: Vec<i32> = ended.iter().map(|ended| ended.code).collect();
        codes.sort_unstable();
        assert_eq!(codes, [0, 2, 2], "{ended:?}");
        for refused in ended.iter().filter(|ended| ended.code == 2) {
            // The winner may have come to its end before the loser looked.
            let why = refused.only_error(&["scene.vtkhdf"]);
            assert!(why.contains("is writing it") || why.contains("the file exists"), "{why}");
        }
        assert_sound(folder.path(), true);
        assert!(!lock(folder.path()).exists());
    }
}

#[test]
fn a_run_goes_on_although_a_reader_has_its_file_open() {
    for ranks in [0, 2] {
        let folder = folder();
        stopped(at_work(ranks, folder.path(), &["scene.toml"]));
        let reader = Results::open(&folder.path().join("scene.vtkhdf"));
        stopped(at_work(ranks, folder.path(), &["--resume", "scene.vtkhdf"]));
        assert!(reader.frames() >= 10);
        drop(reader);
        assert_sound(folder.path(), false);
    }
}

#[test]
fn a_run_that_was_killed_is_in_nobodys_way() {
    for ranks in [0, 2].repeat(TRIES) {
        let folder = folder();
        killed(at_work(ranks, folder.path(), &["scene.toml"]), ranks);
        assert!(lock(folder.path()).exists(), "a kill leaves the file of the lock");
        assert_sound(folder.path(), false);
        let resumed = at_work(2 - ranks, folder.path(), &["--resume", "scene.vtkhdf"]);
        assert_refused(
            job(0, folder.path(), &["--resume", "scene.vtkhdf"]).start_beside(&resumed).end(),
            "scene.vtkhdf",
        );
        killed(resumed, 2 - ranks);
        job(ranks, folder.path(), &[&["scene.toml", "--force"], &SHORT[..]].concat()).run().with_code(0);
        assert_sound(folder.path(), true);
        assert!(!lock(folder.path()).exists());
    }
}

#[test]
fn where_there_are_no_locks_the_text_of_the_lock_file_keeps_others_out() {
    let folder = folder();
    let at = folder.path();
    let without = |job: Job| job.with_variable("FAILPOINTS", "locks=return");
    let mut first = without(job(0, at, &["scene.toml"])).start();
    first.wait_for_frames(10);
    let force = [&["scene.toml", "--force"], &SHORT[..]].concat();
    let refused = without(job(0, at, &force)).start_beside(&first).end().with_code(2);
    refused.only_error(&["scene.vtkhdf\": process ", "has no locks", "remove ", "scene.vtkhdf.lock"]);
    killed(first, 0);
    // A process of this machine that has ended is known to have ended.
    without(job(0, at, &force)).run().with_code(0);
    assert_sound(at, true);
    // Of another machine nothing is known.
    fs::write(lock(at), "host = 'far'\nprocess = 1\nsince = '2020-01-01 00:00:00'\n").unwrap();
    let refused = without(job(2, at, &force)).run().with_code(2);
    refused.only_error(&["process 1 on far, since 2020-01-01 00:00:00 UTC, is writing it", "remove "]);
    fs::remove_file(lock(at)).unwrap();
    without(job(2, at, &force)).run().with_code(0);
}

#[test]
fn a_run_that_has_lost_its_file_to_others_ends_with_4_and_claims_nothing() {
    for ranks in [0, 2].repeat(TRIES) {
        // Another machine took the lock, which did not reach this one.
        let folder_of_lock = folder();
        let mut first = at_work(ranks, folder_of_lock.path(), &["scene.toml"]);
        let thief = "host = 'far'\nprocess = 1\nsince = '2020-01-01 00:00:00'\n";
        fs::write(lock(folder_of_lock.path()), thief).unwrap();
        first.must_end_within(DEADLINE);
        let ended = first.end().with_code(4);
        let why = "process 1 on far, since 2020-01-01 00:00:00 UTC, has taken it over";
        assert!(ended.errors()[0].contains(why), "{}", ended.stderr);
        assert_sound(folder_of_lock.path(), false);

        // Somebody removed the lock file, and another run began.
        let folder_of_force = folder();
        let mut first = at_work(ranks, folder_of_force.path(), &["scene.toml"]);
        fs::remove_file(lock(folder_of_force.path())).unwrap();
        let force = [&["scene.toml", "--force"], &SHORT[..]].concat();
        job(0, folder_of_force.path(), &force).start_beside(&first).end().with_code(0);
        first.must_end_within(DEADLINE);
        first.end().with_code(4);
        assert_sound(folder_of_force.path(), true);

        // Another program wrote over the file.
        for content in [0, 20_000_000].map(|length| vec![b'x'; length]) {
            let folder = folder();
            let mut first = at_work(ranks, folder.path(), &["scene.toml"]);
            let path = folder.path().join("scene.vtkhdf");
            fs::write(&path, content).unwrap();
            first.must_end_within(DEADLINE);
            let ended = first.end().with_code(4);
            assert!(ended.errors()[0].contains("another program has changed it"), "{}", ended.stderr);
            let completed = |file: hdf5::File| file.group("run")?.attr("completed")?.read_scalar::<i64>();
            let completed = hdf5::File::open(&path).and_then(completed);
            assert!(!matches!(completed, Ok(1)), "it claims to be complete");
        }
    }
}

#[test]
fn a_file_with_two_names_is_not_gone_on_with_and_a_new_run_leaves_the_other_name_alone() {
    let folder = folder();
    let [file, copy] = ["scene.vtkhdf", "backup"].map(|name| folder.path().join(name));
    let arguments = [&["scene.toml"][..], &SHORT].concat();
    job(0, folder.path(), &[&arguments[..], &["--set", "limits.wall=1e-6"]].concat()).run().with_code(5);
    fs::hard_link(&file, &copy).unwrap();
    let before = fs::read(&copy).unwrap();
    let refused = job(0, folder.path(), &["--resume", "scene.vtkhdf"]).run().with_code(2);
    refused.only_error(&["--resume scene.vtkhdf: the file has 2 names", "copy"]);
    job(0, folder.path(), &[&arguments[..], &["--force"]].concat()).run().with_code(0);
    assert_eq!(fs::read(&copy).unwrap(), before);
    assert_sound(folder.path(), true);
}
