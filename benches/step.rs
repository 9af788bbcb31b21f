//! One trial step of Merson's method in a packed bed: five right-hand sides, stages, error and agreement, for
//! the three variants.

use common::Job;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::engine::simulation::Simulation;
use demhybrid::model::contact::{Rebound, Tangential};
use demhybrid::model::particle::Spin;
use demhybrid::ode::{MERSON, Method, Norm, RungeKutta, StepStart, TrialStep, Weights};

mod common;

struct Step<'a>(&'a mut Criterion, &'a str, usize);

impl Job for Step<'_> {
    fn run<R: Rebound, T: Tangential, W: Spin>(self, mut simulation: Simulation<R, T, W>) {
        let mut group = self.0.benchmark_group(format!("step/{}", self.1));
        group.sample_size(10).throughput(Throughput::Elements(self.2 as u64));
        let mut step_start = StepStart::new(0.0, simulation.state().to_vec());
        let mut method = RungeKutta::new(&MERSON);
        let mut trial = TrialStep::default();
        let norm = Norm { weights: Weights::MIXED, rate: true };
        group.bench_function(BenchmarkId::from_parameter(self.2), |b| {
            b.iter(|| {
                step_start.slope_known = false;
                method.attempt(simulation.dynamics_mut(), &mut step_start, 1e-5, &norm, &mut trial)
            })
        });
    }
}

fn step(c: &mut Criterion) {
    for variant in common::VARIANTS {
        for n in [200, 2_000, 20_000, 200_000] {
            common::simulate(&common::scene(variant), &common::bed(n), Step(c, variant, n));
        }
    }
}

criterion_group!(benches, step);
criterion_main!(benches);
