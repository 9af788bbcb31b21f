//! Lists: time to rebuild them, for growing beds of one density. Divide by the number of particles to
//! compare.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demhybrid::engine::neighbors::{Lists, Order, Reach};
use demhybrid::math::vector::Vec3;

mod common;

fn neighbors(c: &mut Criterion) {
    let mut group = c.benchmark_group("lists");
    group.sample_size(10);
    for n in [200, 2_000, 20_000, 200_000] {
        let x: Vec<Vec3> = common::bed(n).x.into_iter().map(Vec3::from).collect();
        let order = Order::new([f64::INFINITY, 1.0, 1.0], 0.36);
        let mut keyed: Vec<_> = (0..n as u64).zip(x).map(|(id, x)| (order.key(&x, id), x)).collect();
        keyed.sort_unstable_by_key(|(key, _)| *key);
        let (keys, x): (Vec<_>, Vec<_>) = keyed.into_iter().unzip();
        let mut lists = Lists::default();
        group.throughput(Throughput::Elements(n as u64));
        group.bench_function(BenchmarkId::from_parameter(n), |b| {
            b.iter(|| lists.rebuild(&x, &keys, n, Reach::of_centres(0.36, 0.0), &[], 1))
        });
    }
}

criterion_group!(benches, neighbors);
criterion_main!(benches);
