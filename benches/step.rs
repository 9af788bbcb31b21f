//! One trial step of Merson's method in a packed bed: five right-hand sides, stages, error and agreement, for
//! the three variants.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::ode::{MERSON, Method, RungeKutta, StepStart, TrialStep};

mod common;

fn step(c: &mut Criterion) {
    for variant in common::VARIANTS {
        for n in [200, 2_000, 20_000, 200_000] {
            let mut simulation = common::simulation(&common::scene(variant), &common::bed(n));
            let mut group = c.benchmark_group(format!("step/{variant}"));
            group.sample_size(10).throughput(Throughput::Elements(n as u64));
            let mut step_start = StepStart::new(0.0, simulation.state().to_vec());
            let mut method = RungeKutta::new(&MERSON);
            let mut trial = TrialStep::default();
            let norm = common::norm(&simulation, true);
            group.bench_function(BenchmarkId::from_parameter(n), |b| {
                b.iter(|| {
                    step_start.slope_known = false;
                    method.attempt(simulation.dynamics_mut(), &mut step_start, 1e-5, &norm, &mut trial)
                })
            });
        }
    }
}

criterion_group!(benches, step);
criterion_main!(benches);
