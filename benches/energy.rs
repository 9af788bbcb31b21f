//! What energies cost: the potential energy of a frame, and a right-hand side with and without what contacts
//! dissipate.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::ode::Ivp;

mod common;

fn energies(c: &mut Criterion) {
    for n in [2_000, 20_000, 200_000] {
        let mut simulation = common::simulation(&common::scene("friction+rotation"), &common::bed(n));
        let mut group = c.benchmark_group("energy");
        group.sample_size(10).throughput(Throughput::Elements(n as u64));
        let id = |what: &str| BenchmarkId::new(what, n);
        let y = simulation.state().to_vec();
        let mut slopes = y.clone();
        let dynamics = simulation.dynamics_mut();
        group.bench_function(id("potential"), |b| b.iter(|| dynamics.potential_energy(&y)));
        group.bench_function(id("kinetic"), |b| b.iter(|| dynamics.kinetic_energy(&y)));
        dynamics.begin();
        group.bench_function(id("rhs"), |b| b.iter(|| dynamics.rhs(0.0, &y, &mut slopes)));
        dynamics.audit();
        group.bench_function(id("rhs, audited"), |b| b.iter(|| dynamics.rhs(0.0, &y, &mut slopes)));
    }
}

criterion_group!(benches, energies);
criterion_main!(benches);
