//! The build without MPI beside the one with it: the same bits in the files of both, and either goes on with
//! what the other began. launch/test-long.sh makes the other build and names it in DEMHYBRID_WITHOUT_MPI.

use crate::mpirun::{Job, PACKAGE, PROGRAM, signal_job};
use crate::results::{Results, assert_same_bits};
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The program that was built without MPI.
fn without_mpi() -> PathBuf {
    let path = std::env::var_os("DEMHYBRID_WITHOUT_MPI");
    let path =
        PathBuf::from(path.expect("DEMHYBRID_WITHOUT_MPI names the other build; see launch/test-long.sh"));
    assert!(path.is_absolute() && path.is_file(), "DEMHYBRID_WITHOUT_MPI={}", path.display());
    path
}

/// Runs `program` with `arguments` in `folder`, which must end well, and opens what it wrote.
fn written(program: &Path, folder: &Path, arguments: &[&str]) -> Results {
    let job = Job::alone(folder, arguments).and(&["-q", "--force", "-o", "run.vtkhdf"]).within(300);
    job.of(program.to_path_buf()).run().with_code(0);
    Results::open(&folder.join("run.vtkhdf"))
}

#[test]
fn both_builds_write_the_same_bits() {
    let (one, other) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    for (name, sets) in [
        ("quick", &[][..]),
        ("quick", &["--threads", "2", "--set", "output.energy=true"]),
        ("bed", &["--set", "t_end=0.8", "--set", "friction.rotation=false"]),
        ("paper/settle-basic", &["--set", "t_end=1"]),
    ] {
        let scene = format!("{PACKAGE}/configs/{name}.toml");
        let arguments = [&[&scene[..]], sets].concat();
        let with = written(PROGRAM.as_ref(), one.path(), &arguments);
        let without = written(&without_mpi(), other.path(), &arguments);
        assert!(with.frames() > 10);
        assert_same_bits(&with, &without, &format!("{name} {sets:?}"));
    }
}

#[test]
fn either_build_goes_on_with_what_the_other_began() {
    let scene = format!("{PACKAGE}/configs/quick.toml");
    let arguments = [&scene[..], "--set", "output.interval=0.005", "--set", "checkpoint.interval=0.1"];
    let folder = TempDir::new().unwrap();
    let whole = written(PROGRAM.as_ref(), folder.path(), &arguments);
    let (with, without) = (PathBuf::from(PROGRAM), without_mpi());
    for (first, second, ranks) in
        [(&with, &without, None), (&without, &with, None), (&without, &with, Some(2))]
    {
        let folder = TempDir::new().unwrap();
        let job = Job::alone(folder.path(), &arguments).and(&["--threads", "1", "-o", "run.vtkhdf"]);
        let mut job = job.of(first.clone()).start();
        job.wait_for_frames(whole.frames() / 3);
        signal_job(&job, Signal::TERM);
        job.must_end_within(20);
        job.end().with_code(5);
        let more = ["--resume", "run.vtkhdf", "-q"];
        let job =
            ranks.map_or_else(|| Job::alone(folder.path(), &more), |n| Job::on(n, folder.path(), &more));
        job.of(second.clone()).run().with_code(0);
        let resumed = Results::open(&folder.path().join("run.vtkhdf"));
        assert_same_bits(&whole, &resumed, &format!("{} goes on", second.display()));
    }
}

#[test]
fn without_mpi_it_refuses_to_be_one_of_several_ranks_with_one_message() {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    let ended = Job::on(3, folder.path(), &[&scene]).of(without_mpi()).run().with_code(2);
    ended.only_error(&[
        "the launcher started 3 ranks",
        "built without MPI",
        "cargo install --locked --path .",
    ]);
    assert!(ended.stdout.is_empty(), "{}", ended.stdout);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    Job::on(1, folder.path(), &[&scene, "-q"]).of(without_mpi()).run().with_code(0);
}
