//! One right-hand side of a packed bed, for the three variants and growing numbers of particles of one
//! density. Criterion's throughput is particles per second: the same for all sizes when the cost is linear.

use common::Job;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::engine::simulation::Simulation;
use demhybrid::model::contact::{Rebound, Tangential};
use demhybrid::model::particle::Spin;
use demhybrid::ode::Ivp;

mod common;

struct RightHandSide<'a>(&'a mut Criterion, &'a str, usize);

impl Job for RightHandSide<'_> {
    fn run<R: Rebound, T: Tangential, W: Spin>(self, mut simulation: Simulation<R, T, W>) {
        let mut group = self.0.benchmark_group(format!("rhs/{}", self.1));
        group.sample_size(10).throughput(Throughput::Elements(self.2 as u64));
        let y = simulation.state().to_vec();
        let mut slopes = y.clone();
        group.bench_function(BenchmarkId::from_parameter(self.2), |b| {
            simulation.dynamics_mut().begin();
            b.iter(|| simulation.dynamics_mut().rhs(0.0, &y, &mut slopes))
        });
    }
}

fn rhs(c: &mut Criterion) {
    for variant in common::VARIANTS {
        for n in [200, 2_000, 20_000, 200_000] {
            common::simulate(&common::scene(variant), &common::bed(n), RightHandSide(c, variant, n));
        }
    }
}

criterion_group!(benches, rhs);
criterion_main!(benches);
