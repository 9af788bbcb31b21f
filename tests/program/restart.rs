//! Runs that are stopped, killed or robbed of their file, and taken up again: nothing that was on the disk is
//! lost, and the end is the same to the last bit.

use crate::mpirun::{Ended, Job, Running, kill, signal, signal_job};
use crate::results::{Results, assert_same_bits};
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Seconds that a job may live on after it was asked to stop, or after a fault.
const DEADLINE: u64 = 20;
/// Rounds of random kills: 3 here, 20 in launch/test-long.sh.
const KILLS: usize = if cfg!(feature = "long-tests") { 20 } else { 3 };

/// Frames after which a run is stopped, to be taken up on 1, 2 and 3 ranks: in the fall, in the impacts, near
/// the end.
const STOPS: &[usize] = if cfg!(feature = "long-tests") { &[5, 75, 140] } else { &[75] };

/// 200 spheres that fall, collide and roll until t = 0.6 s, with a frame every 4 ms.
const SCENE: &str = "
t_end = 0.6
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.1, mass = 1, grid = { count = 200, bottom = 0.2, seed = 5 } }
container.box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] }
friction = { coefficient = 0.2, regularization_velocity = 0.01 }
output.interval = 0.004
output.sync = 'frame'
checkpoint.interval = 0.02
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0,
            interaction_distance = 0.1 }
";
const FRAMES: usize = 151;

/// The run that nobody disturbed.
static WHOLE: LazyLock<Results> = LazyLock::new(|| undisturbed(&folder()));

/// What the scene in `folder` gives where nobody disturbs it.
fn undisturbed(folder: &TempDir) -> Results {
    Job::alone(folder.path(), &["scene.toml", "-q"]).run().with_code(0);
    // The file stays open when its name has gone.
    let results = Results::open(&folder.path().join("scene.vtkhdf"));
    assert_eq!(results.frames(), FRAMES);
    results
}

/// A folder with the scene.
fn folder() -> TempDir {
    folder_of(SCENE)
}

fn folder_of(scene: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    folder
}

/// A copy of all files of `folder`.
fn copy_of(folder: &Path) -> TempDir {
    let copy = TempDir::new().unwrap();
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), copy.path().join(entry.file_name())).unwrap();
    }
    copy
}

/// Starts the scene in `folder` and waits until it tells of so many frames.
fn started(ranks: usize, folder: &Path, frames: usize) -> Running {
    let arguments = ["scene.toml", "--threads", "1"];
    let job = if ranks == 0 { Job::alone(folder, &arguments) } else { Job::on(ranks, folder, &arguments) };
    let mut job = job.start();
    job.wait_for_frames(frames);
    job
}

/// Takes up the run in `folder`; without mpirun where `ranks` is 0.
fn resumed(ranks: usize, folder: &Path, more: &[&str]) -> Ended {
    let arguments = ["--resume", "scene.vtkhdf", "-q"];
    let job = if ranks == 0 { Job::alone(folder, &arguments) } else { Job::on(ranks, folder, &arguments) };
    job.and(more).run()
}

/// Takes up the run in `folder` and insists on the bits of the run that nobody disturbed.
#[track_caller]
fn assert_goes_on(ranks: usize, folder: &Path, what: &str) -> Ended {
    assert_goes_on_to(&WHOLE, ranks, folder, what)
}

#[track_caller]
fn assert_goes_on_to(whole: &Results, ranks: usize, folder: &Path, what: &str) -> Ended {
    let ended = resumed(ranks, folder, &[]).with_code(0);
    let results = Results::open(&folder.join("scene.vtkhdf"));
    assert_eq!((results.frames(), results.count("completed")), (FRAMES, 1), "{what}: {}", ended.stderr);
    assert_same_bits(whole, &results, what);
    ended
}

fn slots(folder: &Path) -> [PathBuf; 2] {
    ["a", "b"].map(|slot| folder.join(format!("scene.vtkhdf.ckpt-{slot}")))
}

#[test]
fn signals_stop_a_run_with_a_checkpoint_from_which_it_goes_on() {
    for (number, name, ranks, resume_on) in
        [(Signal::TERM, "SIGTERM", 0, 2), (Signal::INT, "SIGINT", 0, 0), (Signal::USR1, "SIGUSR1", 2, 3)]
    {
        let folder = folder();
        let mut job = started(ranks, folder.path(), 20);
        signal_job(&job, number);
        job.must_end_within(DEADLINE);
        let ended = job.end().with_code(5);
        let line = format!("demhybrid: stopped by {name} at t = ");
        assert!(ended.stderr.contains(&line), "{}", ended.stderr);
        assert!(
            ended.stderr.contains("demhybrid --resume scene.vtkhdf goes on from there"),
            "{}",
            ended.stderr
        );
        assert!(ended.stdout.contains("scene.toml stopped: 200 particles"), "{}", ended.stdout);
        let results = Results::open(&folder.path().join("scene.vtkhdf"));
        assert_eq!((results.text("stopped_by"), results.count("completed")), (name.to_owned(), 0));
        assert!((20..FRAMES).contains(&results.frames()), "{} frames", results.frames());
        drop(results);
        let ended = assert_goes_on(resume_on, folder.path(), name);
        assert!(ended.stderr.contains("scene.vtkhdf goes on from t = 0."), "{}", ended.stderr);
    }
}

#[test]
fn a_second_signal_ends_a_run_at_once() {
    let folder = folder();
    // Nothing is looked at while the right-hand side sleeps.
    let mut job = Job::alone(folder.path(), &["scene.toml", "--threads", "1"])
        .with_variable("FAILPOINTS", "rhs=150*off->sleep(60000)")
        .start();
    let mut quiet = (String::new(), Instant::now());
    while quiet.0.is_empty() || quiet.1.elapsed() < Duration::from_secs(1) {
        sleep(Duration::from_millis(20));
        let said = job.stderr();
        if said != quiet.0 {
            quiet = (said, Instant::now());
        }
    }
    signal_job(&job, Signal::TERM);
    // So soon it is the same request again; later somebody has lost his patience.
    sleep(Duration::from_millis(200));
    signal_job(&job, Signal::INT);
    sleep(Duration::from_millis(1500));
    signal_job(&job, Signal::TERM);
    job.must_end_within(DEADLINE);
    job.end().with_code(128 + 15);
    assert!(Results::open(&folder.path().join("scene.vtkhdf")).frames() > 0);
}

#[test]
fn a_stop_file_and_a_wall_limit_stop_a_run() {
    let folder = folder();
    let job = started(3, folder.path(), 10);
    fs::write(folder.path().join("scene.vtkhdf.stop"), "").unwrap();
    let ended = job.end().with_code(5);
    assert!(ended.stderr.contains("stopped by the stop file at t = "), "{}", ended.stderr);
    assert!(!folder.path().join("scene.vtkhdf.stop").exists());
    // The next part stops by the clock, and the one after that by nothing.
    let ended = resumed(0, folder.path(), &["--set", "limits.wall=0.02"]).with_code(5);
    assert!(ended.stderr.contains("stopped by limits.wall at t = "), "{}", ended.stderr);
    assert_eq!(Results::open(&folder.path().join("scene.vtkhdf")).text("stopped_by"), "limits.wall");
    let ended = resumed(2, folder.path(), &["--set", "limits.wall=1e6"]).with_code(0);
    assert!(ended.stdout.contains("scene.vtkhdf done"), "{}", ended.stdout);
    let results = Results::open(&folder.path().join("scene.vtkhdf"));
    assert_eq!(results.count("completed"), 1);
    for name in WHOLE.vector_names() {
        assert_eq!(WHOLE.vectors(name, FRAMES - 1), results.vectors(name, FRAMES - 1), "{name}");
    }
    assert_eq!(WHOLE.count("rhs_evaluations"), results.count("rhs_evaluations"));
}

#[test]
fn a_stopped_run_goes_on_to_the_same_bits_on_any_number_of_ranks_and_threads() {
    for &frames in STOPS {
        let folder = folder();
        let mut job = started(2, folder.path(), frames);
        signal_job(&job, Signal::USR1);
        job.must_end_within(DEADLINE);
        job.end().with_code(5);
        for (ranks, threads) in [(1, "2"), (2, "1"), (3, "1")] {
            let copy = copy_of(folder.path());
            resumed(ranks, copy.path(), &["--threads", threads]).with_code(0);
            let what = format!("stopped after {frames} frames, resumed on {ranks} ranks");
            assert_same_bits(&WHOLE, &Results::open(&copy.path().join("scene.vtkhdf")), &what);
        }
    }
}

#[test]
fn a_rank_that_is_killed_at_any_time_costs_nothing_that_was_on_the_disk() {
    // Moments that differ from round to round, the same in every run of the test.
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = |below: u64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) % below
    };
    for round in 0..KILLS {
        let folder = folder();
        let frames = 1 + next(FRAMES as u64 - 40) as usize;
        let job = started(2, folder.path(), frames);
        sleep(Duration::from_micros(next(20_000)));
        kill(job.process_of(next(2) as usize));
        let mut job = job;
        job.must_end_within(DEADLINE);
        let ended = job.end();
        assert_ne!(ended.code, 0, "round {round}: {}", ended.stdout);
        let there = Results::open(&folder.path().join("scene.vtkhdf")).frames();
        assert!(there >= frames, "round {round}: {there} frames of {frames} that were told of");
        assert_goes_on([0, 1, 3][round % 3], folder.path(), &format!("round {round}, {frames} frames"));
    }
    println!("{KILLS} ranks killed, {KILLS} runs taken up again, none lost");
}

#[test]
fn a_rank_of_a_run_whose_contacts_remember_is_killed_and_nothing_is_forgotten() {
    let (law, method) = ("law = 'history', coefficient = 0.3", "\nsolver.method = 'merson'");
    let remembering = SCENE.replace("coefficient = 0.2, regularization_velocity = 0.01", law);
    // The default method, and one that has memories of contacts far away.
    for (scene, frames, ranks) in
        [(remembering.clone(), [40, 110], [0, 3]), (remembering + method, [75, 120], [3, 1])]
    {
        let whole = undisturbed(&folder_of(&scene));
        for (victim, (frames, ranks)) in frames.into_iter().zip(ranks).enumerate() {
            let folder = folder_of(&scene);
            let mut job = started(2, folder.path(), frames);
            kill(job.process_of(victim));
            job.must_end_within(DEADLINE);
            assert_ne!(job.end().code, 0);
            let what = format!("rank {victim} killed after {frames} frames");
            let ended = assert_goes_on_to(&whole, ranks, folder.path(), &what);
            assert!(ended.stderr.contains("scene.vtkhdf goes on from t = 0."), "{what}: {}", ended.stderr);
        }
    }
}

#[test]
fn a_killed_run_keeps_the_frames_that_were_forced_to_the_disk() {
    // A slow clock forces the first frame to the disk, and then none before memory holds 72 of them, which is
    // all that it may hold of 200 spheres. "end" does not even force the first.
    for (sync, ranks, least) in [("0.05", 0, 2), ("1e6", 2, 73), ("end", 0, 72), ("end", 2, 72)] {
        let folder = folder();
        let sets = [
            ("output.sync", sync),
            ("output.interval", "0.001"),
            ("checkpoint.interval", "10"),
            ("t_end", "100"),
        ];
        let sets: Vec<String> = sets.iter().map(|(key, value)| format!("--set={key}={value}")).collect();
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        let job = if ranks == 0 {
            Job::alone(folder.path(), &["scene.toml"])
        } else {
            Job::on(ranks, folder.path(), &["scene.toml"])
        };
        let mut job = job.and(&sets).start();
        job.wait_for_frames(100);
        signal_job(&job, Signal::KILL);
        job.must_end_within(DEADLINE);
        assert_ne!(job.end().code, 0);
        let results = Results::open(&folder.path().join("scene.vtkhdf"));
        let there = results.frames();
        println!("output.sync = {sync}, {ranks} ranks: {there} frames");
        assert!(there >= least, "output.sync = {sync}: {there} frames");
        // There the frames come by 72, never a part of these.
        if sync != "0.05" {
            assert!((there - (least - 72)).is_multiple_of(72), "output.sync = {sync}: {there} frames");
        }
        let times: Vec<f64> = (0..there).map(|k| k as f64 * 0.001).collect();
        assert_eq!(results.times(), times);
        assert!(results.counts("run/series/steps_accepted")[..there].is_sorted());
        // The start is the same as that of the other run, whatever its frames.
        for (k, of_whole) in [(0, 0), (there / 4 * 4, there / 4), (4, 1)] {
            if k < there {
                assert_eq!(results.vectors("Points", k), WHOLE.vectors("Points", of_whole), "frame {k}");
            }
        }
    }
}

#[test]
fn a_run_goes_on_in_a_file_whose_arrays_are_longer_than_their_chunks() {
    let folder = folder();
    // The run ends without closing its file.
    let points = "output=12*off->panic(no frame today)";
    Job::alone(folder.path(), &["scene.toml"]).with_variable("FAILPOINTS", points).run().with_code(70);
    let path = folder.path().join("scene.vtkhdf");
    let results = Results::open(&path);
    let rows = results.arrays().into_iter().find(|(name, _)| name.ends_with("/Points")).unwrap().1[0] as u64;
    assert_eq!((results.frames() as u64 * 200, results.count("completed")), (rows, 0));
    drop(results);
    // A kill in mid-flush leaves lengths without the chunks for them. 13 frames of 200 spheres are a chunk.
    let shape = |rows: u64| [rows, 3, u64::MAX, 3].map(u64::to_le_bytes).concat();
    let (old, new) = (shape(rows), shape(30 * 200));
    let mut bytes = fs::read(&path).unwrap();
    let found: Vec<usize> = (0..bytes.len() - old.len()).filter(|&k| bytes[k..].starts_with(&old)).collect();
    assert_eq!(found.len(), 3, "positions, velocities and spins");
    found.iter().for_each(|&k| bytes[k..k + new.len()].copy_from_slice(&new));
    fs::write(&path, bytes).unwrap();
    for ranks in [0, 2] {
        assert_goes_on(ranks, copy_of(folder.path()).path(), &format!("{ranks} ranks"));
    }
}

#[test]
fn a_file_that_was_removed_or_replaced_ends_the_run_after_a_checkpoint() {
    for (replaced, what) in [(false, "removed"), (true, "replaced by another file")] {
        let folder = folder();
        let file = folder.path().join("scene.vtkhdf");
        let job = started(2, folder.path(), 10);
        fs::rename(&file, folder.path().join("kept")).unwrap();
        if replaced {
            fs::write(&file, "something else").unwrap();
        }
        let ended = job.end().with_code(4);
        ended.only_error(&["scene.vtkhdf was ", what, "while the run was writing to it"]);
        assert!(slots(folder.path()).iter().any(|slot| slot.exists()));
        if replaced {
            assert_eq!(fs::read_to_string(&file).unwrap(), "something else");
        }
        // Without its file the run does not go on; with it, it does.
        let refused = if replaced { "it cannot be opened as an HDF5 file" } else { "put it back" };
        resumed(0, folder.path(), &[]).with_code(2).only_error(&["--resume scene.vtkhdf: ", refused]);
        fs::rename(folder.path().join("kept"), &file).unwrap();
        assert_goes_on(0, folder.path(), what);
    }
}

#[test]
fn a_checkpoint_that_cannot_be_written_ends_the_run_and_leaves_the_one_before() {
    let folder = folder();
    let job = Job::on(2, folder.path(), &["scene.toml", "-q"]).with_fault(0, "checkpoint=3*off->return");
    job.run().with_code(4).only_error(&[
        "cannot write the checkpoint ",
        "scene.vtkhdf.ckpt-",
        "a fail point",
    ]);
    assert!(slots(folder.path()).iter().all(|slot| slot.exists()));
    assert!(Results::open(&folder.path().join("scene.vtkhdf")).frames() > 10);
    assert_goes_on(0, folder.path(), "after a checkpoint that failed");
}

#[test]
fn a_run_without_a_checkpoint_begins_again_and_loses_no_frame() {
    let folder = folder();
    let arguments = ["scene.toml", "--threads", "1", "--set", "checkpoint.interval=10"];
    let mut job = Job::alone(folder.path(), &arguments).start();
    job.wait_for_frames(20);
    signal_job(&job, Signal::KILL);
    job.must_end_within(DEADLINE);
    job.end().with_code(128 + 9);
    let file = folder.path().join("scene.vtkhdf");
    let there = Results::open(&file).frames();
    let stopped =
        resumed(0, folder.path(), &["--set", "checkpoint.interval=10", "--set", "limits.wall=0.001"]);
    assert!(stopped.stderr.contains(&format!("the {there} frames that it holds stay")), "{}", stopped.stderr);
    assert!(Results::open(&file).frames() >= there);
    // Even so the part made a step, and a link to the file is as good as the file.
    std::os::unix::fs::symlink(&file, folder.path().join("link")).unwrap();
    let sets = ["--set", "checkpoint.interval=0.02", "--set", "limits.wall=1e6"];
    let ended = Job::on(2, folder.path(), &["--resume", "link", "-q"]).and(&sets).run().with_code(0);
    assert!(ended.stderr.contains("link goes on from t = "), "{}", ended.stderr);
    let results = Results::open(&file);
    assert_eq!((results.frames(), results.count("completed")), (FRAMES, 1));
    assert_eq!(WHOLE.count("rhs_evaluations"), results.count("rhs_evaluations"));
    for name in WHOLE.vector_names() {
        for k in [0, there / 2, there, FRAMES - 1] {
            assert_eq!(WHOLE.vectors(name, k), results.vectors(name, k), "{name} of frame {k}");
        }
    }
}

#[test]
fn a_complete_run_is_left_alone_and_a_longer_one_equals_one_that_was_longer_from_the_start() {
    let folder = folder();
    // An end between two frames: its frame is no frame of the longer run.
    let sets = ["--set", "t_end=0.3333"];
    Job::alone(folder.path(), &["scene.toml", "-q"]).and(&sets).run().with_code(0);
    let file = folder.path().join("scene.vtkhdf");
    let before = (fs::read(&file).unwrap(), fs::metadata(&file).unwrap().modified().unwrap());
    let ended = resumed(2, folder.path(), &[]).with_code(0);
    assert!(
        ended.stderr.contains("scene.vtkhdf is complete, to t = 0.3333 s: nothing to do"),
        "{}",
        ended.stderr
    );
    assert!(ended.stdout.is_empty(), "{}", ended.stdout);
    assert_eq!(before, (fs::read(&file).unwrap(), fs::metadata(&file).unwrap().modified().unwrap()));
    for (set, parts) in [
        ("t_end=0.2", ["t_end=0.2", "only a larger one"]),
        ("solver.tolerance=1", ["solver.tolerance is part of what was computed", "t_end (larger)"]),
        ("output.interval=1", ["output.interval is part of", "limits.*"]),
        ("checkpoint.interval=0", ["checkpoint.interval = 0 must be", "interval = 0.5"]),
    ] {
        let refused = resumed(0, folder.path(), &["--set", set]).with_code(2);
        refused.only_error(&[&["--resume scene.vtkhdf: "][..], &parts].concat());
    }
    assert_eq!(before.0, fs::read(&file).unwrap());
    resumed(2, folder.path(), &["--set", "t_end=0.6"]).with_code(0);
    assert_same_bits(&WHOLE, &Results::open(&file), "a longer run");
}

#[test]
fn a_run_that_ends_at_rest_is_complete_and_says_why() {
    let folder = folder();
    let stop = "stop={ unbalanced_force = 0.5, speed = 10, window = 0.02 }";
    let sets = ["--set", stop, "-q"];
    let ended = Job::alone(folder.path(), &["scene.toml", "-o", "one.vtkhdf"]).and(&sets).run().with_code(0);
    assert!(
        ended.line("at rest").contains("by stop.unbalanced_force for 0.02 s, no particle faster than 10 m/s"),
        "{}",
        ended.stdout
    );
    Job::on(3, folder.path(), &["scene.toml", "-o", "three.vtkhdf"]).and(&sets).run().with_code(0);
    let [one, three] =
        ["one", "three"].map(|name| Results::open(&folder.path().join(format!("{name}.vtkhdf"))));
    let end = *one.times().last().unwrap();
    assert!(end > 0.1 && end < 0.6, "{end} s");
    assert_eq!((one.text("stopped_by"), one.count("completed")), ("stop.unbalanced_force".to_owned(), 1));
    assert_eq!((one.times(), one.count("rhs_evaluations")), (three.times(), three.count("rhs_evaluations")));
    for name in one.vector_names() {
        assert_eq!(one.vectors(name, one.frames() - 1), three.vectors(name, one.frames() - 1), "{name}");
    }
    drop((one, three));
    let again = Job::alone(folder.path(), &["--resume", "one.vtkhdf"]).run().with_code(0);
    assert!(again.stderr.contains("one.vtkhdf is complete"), "{}", again.stderr);
}

#[test]
fn what_cannot_be_taken_up_is_refused_with_one_message() {
    let temporary = folder();
    let folder = temporary.path();
    let mut job = started(0, folder, 30);
    signal_job(&job, Signal::TERM);
    job.must_end_within(DEADLINE);
    job.end().with_code(5);
    let file = folder.join("scene.vtkhdf");
    let (whole, [a, b]) = (fs::read(&file).unwrap(), slots(folder));
    let (first, second) = (fs::read(&a).unwrap(), fs::read(&b).unwrap());
    let mut tried = 0;
    let mut refuse = |ranks: usize, parts: &[&str]| {
        let ended = resumed(ranks, folder, &[]).with_code(2);
        ended.only_error(&[&["--resume scene.vtkhdf: "][..], parts].concat());
        assert!(ended.stdout.is_empty(), "{}", ended.stdout);
        tried += 1;
    };
    // Files that are none, or only a part of one.
    for (content, part) in [
        (&b"no HDF5"[..], "it cannot be opened as an HDF5 file"),
        (&[][..], "it cannot be opened as an HDF5 file"),
        (&whole[..whole.len() / 3], "it cannot be opened as an HDF5 file"),
        (&whole[..100], "it cannot be opened as an HDF5 file"),
    ] {
        fs::write(&file, content).unwrap();
        refuse(0, &[part]);
    }
    refuse(2, &["it cannot be opened as an HDF5 file"]);
    let foreign = hdf5::File::create(&file).unwrap();
    foreign.create_group("run").unwrap();
    drop(foreign);
    refuse(0, &["it is not an output file of demhybrid"]);
    fs::remove_file(&file).unwrap();
    refuse(0, &["there is no such file", "put it back"]);
    fs::write(&file, &whole).unwrap();
    // Checkpoints: both broken, of another run, of a file that held more.
    for slot in [&a, &b] {
        fs::write(slot, &first[..first.len() / 2]).unwrap();
    }
    refuse(2, &["ckpt-a is not a checkpoint that can be used", "ckpt-b is not", "begins again"]);
    let other = TempDir::new().unwrap();
    let sets = ["--set", "particles.grid.seed=6", "--set", "t_end=0.05", "-q"];
    fs::write(other.path().join("scene.toml"), SCENE).unwrap();
    Job::alone(other.path(), &["scene.toml"]).and(&sets).run().with_code(0);
    for (slot, of_another) in slots(folder).iter().zip(slots(other.path())) {
        fs::copy(of_another, slot).unwrap();
    }
    refuse(0, &["ckpt-a is a checkpoint of another run"]);
    // One that is broken in its particles gives way to the one before.
    fs::write(&a, &first).unwrap();
    fs::write(&b, &second).unwrap();
    let newest = newest_of(&a, &b);
    let mut broken = fs::read(newest).unwrap();
    let at = broken.len() - 2000;
    broken[at] ^= 4;
    fs::write(newest, &broken).unwrap();
    let ended = assert_goes_on(2, folder, "with one sound checkpoint");
    assert!(ended.stderr.contains("do not match their checksum"), "{}", ended.stderr);
    println!("{tried} refusals");
}

/// The slot that a resumed run would take: found by taking it up in a copy of the folder.
fn newest_of<'a>(a: &'a Path, b: &'a Path) -> &'a Path {
    let copy = copy_of(a.parent().unwrap());
    let ended = resumed(0, copy.path(), &["--set", "limits.wall=0.01"]);
    if ended.stderr.contains("ckpt-a)") { a } else { b }
}

#[test]
fn a_new_run_forgets_the_checkpoints_of_an_old_one() {
    let folder = folder();
    let sets = ["--set", "t_end=0.06", "-q"];
    Job::alone(folder.path(), &["scene.toml"]).and(&sets).run().with_code(0);
    assert!(slots(folder.path()).iter().all(|slot| slot.exists()));
    let sets = ["--set", "t_end=0.01", "--set", "checkpoint.interval=1", "-q", "--force"];
    Job::alone(folder.path(), &["scene.toml"]).and(&sets).run().with_code(0);
    // The one of the end.
    let there: Vec<bool> = slots(folder.path()).iter().map(|slot| slot.exists()).collect();
    assert_eq!(there, [true, false]);
}

#[test]
fn a_full_disk_ends_the_run_and_leaves_what_was_there() {
    // A small file system of its own, for this job alone; some containers do not allow that.
    let folder = folder();
    let script = |command: &str| {
        format!("mount -t tmpfs -o size=1500k tmpfs small && cp scene.toml small && cd small && {command}")
    };
    fs::create_dir(folder.path().join("small")).unwrap();
    let keep = "; code=$?; ls -l; cp scene.vtkhdf* ..; exit $code";
    let program = if cfg!(feature = "mpi") { "mpirun -n 2 \"$PROGRAM\"" } else { "\"$PROGRAM\"" };
    let run = script(&format!("{program} scene.toml -q --set output.interval=0.002{keep}"));
    if Job::shell(folder.path(), &script("true")).run().code != 0 {
        println!("no file system can be mounted here: a full disk was not tried");
        return;
    }
    // The estimate is right: the run is refused before it begins, unless it is misled.
    let refused = Job::shell(folder.path(), &run).run().with_code(2);
    refused.only_error(&["the run needs about", "free some space"]);
    let misled = Job::shell(folder.path(), &run).with_variable("FAILPOINTS", "room=return").run();
    // Each rank may have met it before it heard of the other.
    let errors = misled.errors();
    assert!(misled.code == 4 && !errors.is_empty(), "{}\n{}", misled.stdout, misled.stderr);
    assert!(errors.iter().all(|error| error.contains("cannot write")), "{}", misled.stderr);
    let there = Results::open(&folder.path().join("scene.vtkhdf"));
    assert!((10..300).contains(&there.frames()), "{} frames", there.frames());
    drop(there);
    // On a larger disk it goes on.
    resumed(2, folder.path(), &[]).with_code(0);
    let results = Results::open(&folder.path().join("scene.vtkhdf"));
    for name in WHOLE.vector_names() {
        assert_eq!(WHOLE.vectors(name, FRAMES - 1), results.vectors(name, results.frames() - 1), "{name}");
    }
}

#[test]
fn signals_of_a_resumed_run_are_heard_as_well() {
    let folder = folder();
    let mut job = started(0, folder.path(), 15);
    signal_job(&job, Signal::TERM);
    job.must_end_within(DEADLINE);
    job.end().with_code(5);
    let mut job = Job::on(2, folder.path(), &["--resume", "scene.vtkhdf"]).start();
    job.wait_for_frames(10);
    signal(job.process_of(1), Signal::TERM);
    job.must_end_within(DEADLINE);
    let ended = job.end().with_code(5);
    assert!(ended.stderr.contains("stopped by SIGTERM"), "{}", ended.stderr);
    assert_goes_on(0, folder.path(), "stopped twice");
}
