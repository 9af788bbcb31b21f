//! One frame of a million particles with spin, from states in memory to the disk, and a plain write of as
//! many bytes. On one rank, through the serial driver. A frame should take at most twice as long.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::domain::Solo;
use demhybrid::domain::rows::ById;
use demhybrid::files::output::{Contents, Measures, Output, Rows, RunInfo, Seconds};
use demhybrid::model::columns::{Column, Columns};
use demhybrid::ode::{Limit, MethodName, NormName};
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Particles.
const COUNT: u64 = 1_000_000;
/// Numbers of a particle in a frame.
const NUMBERS: usize = 9;

fn info() -> RunInfo {
    RunInfo {
        version: String::new(),
        commit: String::new(),
        scene: String::new(),
        method: MethodName::Auto,
        tolerance: 0.1,
        step: None,
        norm: NormName::Scaled,
        velocity_scale: 1.0,
        contact_cutoff: 0.0662,
        energy: false,
        mass: 1.0,
        ranks: 1,
        threads: 1,
        instruction_set: String::new(),
    }
}

fn measures() -> Measures {
    Measures {
        time: 0.0,
        step: 0.0,
        steps_accepted: 0,
        steps_rejected: 0,
        steps_outrun: 0,
        rhs_evaluations: 0,
        pair_evaluations: 0,
        lists_built: 0,
        forced_accepts: 0,
        limits: [0; Limit::ALL.len()],
        kinetic_energy: 0.0,
        potential_energy: 0.0,
        dissipated: [0.0; 2],
        largest_overlap: 0.0,
        bed_height: 0.0,
        wall_seconds: 0.0,
        seconds: Seconds::default(),
    }
}

/// State of particle `id`.
fn body(id: u64) -> [f64; NUMBERS] {
    let x = [1.0, 0.5, -0.25].map(|component| component * id as f64);
    std::array::from_fn(|k| [1.0, 2.0, 3.0][k / 3] * x[k % 3])
}

fn output(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (ours, plain) = (folder.join("frame.vtkhdf"), folder.join("plain"));
    // Particles lie in memory by their cells: runs of ids here and there.
    let ids: Vec<u64> = (0..COUNT).map(|k| k / 100 * 7919 % (COUNT / 100) * 100 + k % 100).collect();
    let y: Vec<f64> = ids.iter().flat_map(|&id| body(id)).collect();
    let append = |mut output: Output<'static>| {
        let bodies = ById::new(&Solo, COUNT, &ids, &y, NUMBERS);
        let numbers = |column: &Column| {
            let (_, range) = Columns::new(true).find(&column.name).expect("it is one of the state");
            bodies.columns(range)
        };
        output.append(&Rows { first: 0, numbers: &numbers }, &measures()).expect("it can be written");
        // Under MPI-IO the writer does that by itself.
        File::open(&ours).and_then(|file| file.sync_all()).expect("it can be synchronised");
        output
    };
    // What all frames share, 32 bytes a particle, is on the disk before the clock starts.
    let create = || {
        let contents = Contents { count: COUNT, radius: 0.1, columns: &Columns::new(true) };
        let none = |_: &Column| panic!("all columns change");
        let output = Output::create(&Solo, &ours, &info(), &contents, 0..COUNT, &none);
        File::open(&ours).and_then(|file| file.sync_all()).expect("it can be synchronised");
        output.expect("it can be created")
    };
    let bytes: Vec<u8> = (0..COUNT * NUMBERS as u64).flat_map(|k| (k as f64).to_ne_bytes()).collect();
    let write = |mut file: File| {
        file.write_all(&bytes).and_then(|()| file.sync_all()).expect("it can be written");
        file
    };
    let open = || File::create(&plain).expect("it can be created");
    let mut group = c.benchmark_group("output");
    group.sample_size(10).throughput(Throughput::Bytes(bytes.len() as u64));
    group.bench_function("frame", |b| b.iter_batched(create, append, BatchSize::PerIteration));
    group.bench_function("plain", |b| b.iter_batched(open, write, BatchSize::PerIteration));
    group.finish();
    for path in [ours, plain] {
        // Not there where a filter left a function out.
        let _ = std::fs::remove_file(path);
    }
}

criterion_group!(benches, output);
criterion_main!(benches);
