//! One right-hand side of a packed bed, for the three variants and growing numbers of particles of one
//! density. Criterion's throughput is particles per second: the same for all sizes when the cost is linear.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::ode::Ivp;

mod common;

fn rhs(c: &mut Criterion) {
    for variant in common::VARIANTS {
        for n in [200, 2_000, 20_000, 200_000] {
            let mut simulation = common::simulation(&common::scene(variant), &common::bed(n));
            let mut group = c.benchmark_group(format!("rhs/{variant}"));
            group.sample_size(10).throughput(Throughput::Elements(n as u64));
            let y = simulation.state().to_vec();
            let mut slopes = y.clone();
            group.bench_function(BenchmarkId::from_parameter(n), |b| {
                simulation.dynamics_mut().begin();
                b.iter(|| simulation.dynamics_mut().rhs(0.0, &y, &mut slopes))
            });
        }
    }
}

criterion_group!(benches, rhs);
criterion_main!(benches);
