//! What the program wrote, and whether it is the same on any ranks and threads.

#![allow(dead_code)] // every test file uses a part

use crate::mpirun::{Job, signal_job};
use demhybrid::ode::Limit;
use hdf5::types::VarLenUnicode;
use rustix::process::Signal;
use std::path::Path;

/// An output file. There are as many frames as `NSteps` says, but no more than have times.
pub struct Results(hdf5::File);

impl Results {
    /// Opens a file, finished or not.
    pub fn open(path: &Path) -> Self {
        Results(
            hdf5::File::open(path).unwrap_or_else(|why| panic!("{} does not open: {why}", path.display())),
        )
    }

    /// Complete frames.
    pub fn frames(&self) -> usize {
        let steps = self.0.group("VTKHDF/Steps").unwrap();
        let declared = steps.attr("NSteps").unwrap().read_scalar::<i64>().unwrap() as usize;
        declared.min(steps.dataset("Values").unwrap().size())
    }

    /// Particles of every frame.
    pub fn particles(&self) -> usize {
        self.0.dataset("VTKHDF/PointData/id").unwrap().size()
    }

    /// Times of the complete frames, s.
    pub fn times(&self) -> Vec<f64> {
        self.reals("VTKHDF/Steps/Values")[..self.frames()].to_vec()
    }

    /// Path and shape of every array of the file, sorted.
    pub fn arrays(&self) -> Vec<(String, Vec<usize>)> {
        let mut found = Vec::new();
        list_arrays(&self.0, "", &mut found);
        found.sort();
        found
    }

    /// An array of reals, flat.
    pub fn reals(&self, name: &str) -> Vec<f64> {
        self.0.dataset(name).unwrap_or_else(|why| panic!("{name}: {why}")).read_raw().unwrap()
    }

    /// An array of counts, flat.
    pub fn counts(&self, name: &str) -> Vec<i64> {
        self.0.dataset(name).unwrap_or_else(|why| panic!("{name}: {why}")).read_raw().unwrap()
    }

    /// An array of reals or counts as bits.
    pub fn bits(&self, name: &str) -> Vec<u64> {
        if self.0.dataset(name).unwrap().dtype().unwrap().is::<f64>() {
            self.reals(name).into_iter().map(f64::to_bits).collect()
        } else {
            self.counts(name).into_iter().map(i64::cast_unsigned).collect()
        }
    }

    /// `Points`, `PointData/velocity` or `PointData/angular_velocity` of frame `k`, in id order.
    pub fn vectors(&self, name: &str, k: usize) -> Vec<[f64; 3]> {
        assert!(k < self.frames());
        let all = self.reals(&format!("VTKHDF/{name}"));
        let n = 3 * self.particles();
        all[k * n..(k + 1) * n].chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect()
    }

    /// Height of the lowest centre in the last frame, m.
    pub fn lowest(&self) -> f64 {
        let end = self.vectors("Points", self.frames() - 1);
        end.iter().map(|x| x[2]).fold(f64::INFINITY, f64::min)
    }

    /// Names of the vector arrays.
    pub fn vector_names(&self) -> Vec<&'static str> {
        let there = |name: &&str| self.0.link_exists(&format!("VTKHDF/{name}"));
        ["Points", "PointData/velocity", "PointData/angular_velocity"].into_iter().filter(there).collect()
    }

    /// A count among the attributes of `/run`.
    pub fn count(&self, name: &str) -> i64 {
        self.0.group("run").unwrap().attr(name).unwrap().read_scalar().unwrap()
    }

    /// A real among the attributes of `/run`.
    pub fn real(&self, name: &str) -> f64 {
        self.0.group("run").unwrap().attr(name).unwrap().read_scalar().unwrap()
    }

    /// A text among the attributes of `/run`.
    pub fn text(&self, name: &str) -> String {
        let attribute = self.0.group("run").unwrap().attr(name).unwrap();
        attribute.read_scalar::<VarLenUnicode>().unwrap().as_str().to_owned()
    }

    /// The scene that the file records.
    pub fn scene(&self) -> toml::Table {
        self.text("scene").parse().unwrap_or_else(|why| panic!("{why}\n{}", self.text("scene")))
    }
}

fn list_arrays(group: &hdf5::Group, path: &str, found: &mut Vec<(String, Vec<usize>)>) {
    for name in group.member_names().unwrap() {
        let below = if path.is_empty() { name.clone() } else { format!("{path}/{name}") };
        match group.group(&name) {
            Ok(inner) => list_arrays(&inner, &below, found),
            Err(_) => found.push((below, group.dataset(&name).unwrap().shape())),
        }
    }
}

/// Fails unless two files hold the same data to the last bit; seconds are the only data that may differ.
#[track_caller]
pub fn assert_same_bits(one: &Results, other: &Results, what: &str) {
    let arrays = one.arrays();
    assert_eq!(arrays, other.arrays(), "{what}: names and shapes of the arrays");
    for (name, _) in arrays.iter().filter(|(name, _)| name != "run/series/wall_seconds") {
        let (a, b) = (one.bits(name), other.bits(name));
        let differing: Vec<usize> = (0..a.len()).filter(|&k| a[k] != b[k]).collect();
        assert!(
            differing.is_empty(),
            "{what}: {} of {} numbers of {name} differ, the first at {}: {:#x} and {:#x}",
            differing.len(),
            a.len(),
            differing[0],
            a[differing[0]],
            b[differing[0]]
        );
    }
    let counts = ["steps_accepted", "steps_rejected", "steps_outrun", "rhs_evaluations", "forced_accepts"];
    let counts = counts.into_iter().chain(["pair_evaluations", "lists_built"]).map(str::to_owned);
    let limits = Limit::ALL.into_iter().map(|limit| format!("limited_by_{}", limit.name()));
    for name in counts.chain(limits) {
        assert_eq!(one.count(&name), other.count(&name), "{what}: {name}");
    }
    for name in ["scene", "norm", "choice"] {
        assert_eq!(one.text(name), other.text(name), "{what}: {name}");
    }
    for name in ["tolerance", "velocity_scale", "contact_reach"] {
        assert_eq!(one.real(name).to_bits(), other.real(name).to_bits(), "{what}: {name}");
    }
}

/// Runs `scene.toml` of a folder on some ranks, without mpirun for 0, and opens what it wrote.
pub fn results_on(folder: &Path, ranks: usize, threads: &str) -> Results {
    let arguments = ["scene.toml", "--threads", threads, "-q", "--force"];
    let job = if ranks == 0 { Job::alone(folder, &arguments) } else { Job::on(ranks, folder, &arguments) };
    job.run().with_code(0);
    Results::open(&folder.join("scene.vtkhdf"))
}

/// Fails unless `scene.toml` of a folder has the bits of `alone`, a run of one thread, on any ranks and
/// threads.
#[track_caller]
pub fn assert_same_anywhere(alone: &Results, folder: &Path) {
    for (ranks, threads) in [(0, "2"), (2, "1"), (3, "2")] {
        let results = results_on(folder, ranks, threads);
        assert_same_bits(alone, &results, &format!("{ranks} ranks, {threads} threads"));
    }
}

/// Fails unless `scene.toml` of a folder, stopped on two ranks after some `frames` and taken up on three,
/// gives the bits of the `whole` run.
#[track_caller]
pub fn assert_goes_on_elsewhere(whole: &Results, folder: &Path, frames: usize) {
    let mut job = Job::on(2, folder, &["scene.toml", "--threads", "1"]).start();
    job.wait_for_frames(frames);
    signal_job(&job, Signal::USR1);
    job.must_end_within(120);
    job.end().with_code(5);
    Job::on(3, folder, &["--resume", "scene.vtkhdf", "-q"]).run().with_code(0);
    assert_same_bits(whole, &Results::open(&folder.join("scene.vtkhdf")), "resumed on three ranks");
}
