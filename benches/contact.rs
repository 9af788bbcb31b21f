//! One contact: the law alone, for the three variants.

use criterion::{Criterion, criterion_group, criterion_main};
use demhybrid::engine::simulation::{Task, dispatch};
use demhybrid::math::elementary::Separate;
use demhybrid::math::vector::Vec3;
use demhybrid::model::contact::{Law, Rebound, Tangential};
use demhybrid::model::particle::Spin;
use std::hint::black_box;

mod common;

struct Contact<'a>(&'a mut Criterion, &'a str);

impl Task for Contact<'_> {
    type Output = ();
    fn with<R: Rebound, T: Tangential, W: Spin>(self, law: Law<R, T>) {
        let (n, v) = (Vec3::new(0.6, -0.48, 0.64), Vec3::new(0.1, 0.7, -0.2));
        let spins = W::from_vector(Vec3::new(3.0, -1.0, 2.0));
        self.0.bench_function(&format!("contact/{}", self.1), |b| {
            b.iter(|| {
                law.action::<Separate, W>(black_box(-0.003), black_box(&n), black_box(&v), black_box(&spins))
            })
        });
    }
}

fn contact(c: &mut Criterion) {
    for variant in common::VARIANTS {
        dispatch(&common::scene(variant), Contact(c, variant));
    }
    c.bench_function("contact/exp", |b| {
        b.iter(|| demhybrid::math::elementary::exp::<Separate>(black_box(-1.3)))
    });
}

criterion_group!(benches, contact);
criterion_main!(benches);
