//! One contact: the law alone, for the three variants.

use criterion::{Criterion, criterion_group, criterion_main};
use demhybrid::engine::kernel::kernel;
use demhybrid::math::elementary::Separate;
use demhybrid::math::instructions::InstructionSet;
use demhybrid::math::vector::Vec3;
use demhybrid::model::effects::Effects;
use demhybrid::scene::effects::law;
use std::hint::black_box;

mod common;

fn contact(c: &mut Criterion) {
    let (n, v) = (Vec3::new(0.6, -0.48, 0.64), Vec3::new(0.1, 0.7, -0.2));
    let spins = Vec3::new(3.0, -1.0, 2.0);
    for variant in common::VARIANTS {
        let scene = common::scene(variant);
        let kernel = kernel(Effects::of(&scene), law(&scene), InstructionSet::Baseline);
        c.bench_function(&format!("contact/{variant}"), |b| {
            b.iter(|| kernel.action(black_box(-0.003), black_box(&n), black_box(&v), black_box(&spins)))
        });
    }
    c.bench_function("contact/exp", |b| {
        b.iter(|| demhybrid::math::elementary::exp::<Separate>(black_box(-1.3)))
    });
}

criterion_group!(benches, contact);
criterion_main!(benches);
