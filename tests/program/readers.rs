//! The output in h5py and in VTK's own HDF reader, by tests/read_frames.py.
//!
//! Both come with a Python environment that launch/test.sh makes: .venv in the package, named by
//! DEMHYBRID_PYTHON. A plain `cargo test` on a machine without it passes this file, and says that nothing was
//! read: the readers cannot be a condition for building the program, and launch/test.sh, which decides what
//! lands, always has them.

use crate::mpirun::{Job, PACKAGE, kill};
use crate::python::{python, run_python};
use crate::results::Results;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Reads `file` with `python`; it must find what `expected` says.
#[track_caller]
fn read(python: &Path, file: &Path, expected: &[&str]) -> String {
    let file = file.to_str().expect("paths of tests are text");
    let out = run_python(python, "read_frames.py", Path::new(PACKAGE), &[&[file], expected].concat());
    assert!(out.contains("h5py and VTK agree"), "{out}");
    out
}

/// quick.toml, a frame every 10 ms, in a folder of its own.
fn quick(ranks: usize, more: &[&str]) -> (TempDir, Job) {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    let job = Job::on(ranks, folder.path(), &[&scene, "--set", "output.interval=0.01"]).and(more);
    (folder, job)
}

#[test]
fn a_run_with_rotation_on_two_ranks_opens_in_h5py_and_vtk() {
    let Some(python) = python() else { return };
    let (folder, job) = quick(2, &["--set", "t_end=0.3"]);
    job.run().with_code(0);
    let expected =
        ["--particles", "27", "--frames", "31", "--rotation", "yes", "--energy", "no", "--fixed-step", "no"];
    let said = read(&python, &folder.path().join("quick.vtkhdf"), &expected);
    assert!(said.contains("last at 0.3 s") && said.contains(", completed"), "{said}");
}

#[test]
fn a_basic_run_opens_in_h5py_and_vtk_without_spins() {
    let Some(python) = python() else { return };
    let (folder, job) = quick(2, &["--set", "t_end=0.3", "--set", "friction.coefficient=0"]);
    job.run().with_code(0);
    let expected = ["--particles", "27", "--frames", "31", "--rotation", "no"];
    let said = read(&python, &folder.path().join("quick.vtkhdf"), &expected);
    assert!(said.contains(", completed"), "{said}");
}

#[test]
fn a_run_that_keeps_its_energy_balance_opens_in_h5py_and_vtk_with_what_was_dissipated() {
    let Some(python) = python() else { return };
    let (folder, job) = quick(2, &["--set", "t_end=0.3", "--set", "output.energy=true"]);
    job.run().with_code(0);
    let file = folder.path().join("quick.vtkhdf");
    read(&python, &file, &["--particles", "27", "--frames", "31", "--energy", "yes"]);
    // Reals of /run that the run above must have set.
    let results = Results::open(&file);
    // One rank, which is all there are without MPI, has no ghosts.
    let ghosts = cfg!(feature = "mpi").then_some("ghosts");
    for part in ["forces", "lists", "reduction", "output"].into_iter().chain(ghosts) {
        assert!(results.real(&format!("seconds_{part}")) > 0.0, "{part} took no time");
    }
}

#[test]
fn a_run_with_a_fixed_step_opens_in_h5py_and_vtk_with_that_step() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let scene = fs::read_to_string(format!("{PACKAGE}/configs/quick.toml")).unwrap();
    let (before, rest) = scene.split_once("[solver]").unwrap();
    let (_, output) = rest.split_once("[output]").unwrap();
    let solver = "[solver]\nmethod = \"velocity-verlet\"\nstep = 1e-4\n";
    fs::write(folder.path().join("quick.toml"), format!("{before}{solver}[output]{output}")).unwrap();
    Job::on(2, folder.path(), &["quick.toml", "--set", "t_end=0.1"]).run().with_code(0);
    let expected = ["--particles", "27", "--frames", "6", "--fixed-step", "yes", "--energy", "no"];
    read(&python, &folder.path().join("quick.vtkhdf"), &expected);
}

#[test]
fn the_file_of_a_killed_run_opens_in_h5py_and_vtk_up_to_its_last_frame() {
    let Some(python) = python() else { return };
    let (folder, job) = quick(2, &["--set", "t_end=1000", "--set", "output.sync=frame"]);
    let mut job = job.start();
    job.wait_for_frames(40);
    [1, 0].into_iter().for_each(|rank| kill(job.process_of(rank)));
    job.must_end_within(10);
    assert_ne!(job.end().code, 0);
    let file = folder.path().join("quick.vtkhdf");
    let frames = Results::open(&file).frames();
    assert!(frames >= 40, "{frames} frames");
    let said =
        read(&python, &file, &["--particles", "27", "--frames", &frames.to_string(), "--rotation", "yes"]);
    assert!(said.contains("not completed"), "{said}");
}
