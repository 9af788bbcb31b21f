//! Tests of the kernel with all instruction sets and with several numbers of blocks.

use super::*;
use crate::engine::forces::{BodyParameters, Dissipated, Stored};
use crate::engine::neighbors::{Lists, Order};
use crate::math::elementary::{Fused, Separate};
use crate::model::contact::{Coulomb, Dissipative, Elastic, Frictionless};
use crate::model::particle::{Locked, Spinning};
use crate::ode::Linear;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn parameters() -> BodyParameters {
    let walls = vec![
        Wall::new(Vec3::zeros(), -Vec3::z()),
        Wall::new(Vec3::new(1.0, 0.2, 0.0), Vec3::new(3.0, 0.1, 0.4)),
    ];
    BodyParameters { mass: 2.5, inverse_inertia: 40.0, gravity: Vec3::new(0.1, 0.0, -9.81), walls }
}

fn law<R, T>(rebound: R, tangential: T) -> Law<R, T> {
    Law { r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, rebound, tangential }
}

/// A dense cloud of bodies and its lists, with near pairs and near walls picked.
fn cloud<W: Spin>(n: usize, blocks: usize) -> (Vec<Motion<W>>, Lists) {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.random::<f64>());
    let order = Order::new([1.0; 3], 0.36);
    let mut bodies: Vec<_> = (0..n as u64)
        .map(|id| {
            let spin = W::from_vector(vector(3.0));
            let body = Motion { x: vector(1.1), v: vector(0.3) - Vec3::repeat(0.15), omega: spin };
            (order.key(&body.x, id), body)
        })
        .collect();
    bodies.sort_unstable_by_key(|(key, _)| *key);
    let (keys, bodies): (Vec<_>, Vec<_>) = bodies.into_iter().unzip();
    let x: Vec<Vec3> = bodies.iter().map(|body| body.x).collect();
    let mut lists = Lists::default();
    lists.rebuild(&x, &keys, n, 0.36, (&parameters().walls, 0.26), blocks);
    for block in &mut lists.blocks {
        block.pick_near(&seated(block, &bodies), 0.31, (&parameters().walls, 0.2));
    }
    (bodies, lists)
}

/// The bodies of a block by slot.
fn seated<W: Spin>(block: &Block, bodies: &[Motion<W>]) -> Vec<Motion<W>> {
    let places = 0..(block.range.len() + block.ghosts.len()) as u32;
    places.map(|slot| bodies[block.index(slot)]).collect()
}

fn slopes<R: Rebound, T: Tangential, W: Spin>(
    law: &Law<R, T>,
    bodies: &[Motion<W>],
    lists: &Lists,
    set: InstructionSet,
) -> (Vec<Motion<W>>, u64) {
    let parameters = parameters();
    let mut slopes = bodies.to_vec();
    let mut count = 0;
    for block in &lists.blocks {
        let (mut batch, mut other) = (Batch::default(), Batch::default());
        let (bodies, slopes) = (&seated(block, bodies), &mut slopes[block.range.clone()]);
        for (slope, body) in slopes.iter_mut().zip(bodies) {
            *slope = Motion { x: body.v, ..Motion::zero() };
        }
        let walls = Sweep { law, bodies, batch: &mut batch, slopes: &mut *slopes };
        add_walls(set, 0, (&block.walls, &parameters.walls), walls);
        let pairs = Sweep { law, bodies, batch: &mut other, slopes: &mut *slopes };
        count += add_pairs(set, &block.near, pairs);
        for slope in slopes {
            slope.v = slope.v / parameters.mass + parameters.gravity;
            slope.omega = slope.omega.scaled(parameters.inverse_inertia);
        }
    }
    (slopes, count)
}

/// Acceleration and angular acceleration of body `i`, eqs. (2.13)-(2.15), summed contact by contact.
fn expected<R: Rebound, T: Tangential, W: Spin>(
    law: &Law<R, T>,
    bodies: &[Motion<W>],
    i: usize,
) -> (Vec3, Vec3) {
    let parameters = parameters();
    let (mut force, mut torque) = (Vec3::zeros(), Vec3::zeros());
    let mut add = |gap: f64, n: Vec3, v: Vec3, spins: W| {
        if gap <= law.l_max {
            let action = law.action::<Separate, _>(gap, &n, &v, &spins);
            force += action.force;
            torque += action.torque.vector();
        }
    };
    let a = &bodies[i];
    for wall in &parameters.walls {
        add(wall.depth(&a.x) - law.r, -wall.normal, a.v, a.omega);
    }
    for b in bodies.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| b) {
        let apart = a.x - b.x;
        add(apart.norm() - 2.0 * law.r, apart.normalize(), a.v - b.v, a.omega.plus(&b.omega));
    }
    (force / parameters.mass + parameters.gravity, torque * parameters.inverse_inertia)
}

fn check<R: Rebound, T: Tangential, W: Spin>(law: Law<R, T>) {
    let (bodies, lists) = cloud::<W>(300, 1);
    let near = |i: usize, j: usize| (bodies[i].x - bodies[j].x).norm() <= 0.3;
    let pairs = (0..300).flat_map(|i| (i + 1..300).map(move |j| (i, j)));
    let count = pairs.filter(|&(i, j)| near(i, j)).count() as u64;
    for set in InstructionSet::available() {
        let reference = slopes(&law, &bodies, &lists, set);
        for (i, slope) in reference.0.iter().enumerate() {
            let (v, omega) = expected(&law, &bodies, i);
            assert!((slope.v - v).norm() <= 1e-11 * v.norm());
            let spin = if W::COMPONENTS == 3 { omega } else { Vec3::zeros() };
            assert!((slope.omega.vector() - spin).norm() <= 1e-11 * spin.norm().max(v.norm()));
            assert_eq!(slope.x, bodies[i].v);
        }
        assert_eq!(reference.1, count);
        for blocks in [1, 2, 7] {
            let (bodies, lists) = cloud::<W>(300, blocks);
            let found = slopes(&law, &bodies, &lists, set);
            assert!(found == reference, "other bits: {}, {blocks} blocks", set.name());
        }
    }
    // The baseline has no fused multiply-add, all other sets have it.
    let fused = InstructionSet::available().split_off(1);
    let bits = |&set: &InstructionSet| slopes(&law, &bodies, &lists, set);
    assert!(fused.windows(2).all(|sets| bits(&sets[0]) == bits(&sets[1])));
}

#[test]
fn any_blocks_and_all_sets_with_fused_operations_give_the_same_bits() {
    check::<_, _, Locked>(law(Elastic, Frictionless));
    check::<_, _, Locked>(law(Dissipative::new(0.4, 10.0), Frictionless));
    check::<_, _, Locked>(law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01)));
    check::<_, _, Spinning>(law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01)));
}

/// Sums, in units of 2^-40, and maxima of a measure over all contacts.
fn measured<W: Spin>(
    set: InstructionSet,
    blocks: usize,
    numbers: &impl Measure<W>,
) -> ([i128; 2], [f64; 2], Vec<Motion<W>>) {
    let (bodies, lists) = cloud::<W>(300, blocks);
    let walls = &parameters().walls[..];
    let (mut sums, mut maxima) = ([0; 2], [0.0; 2]);
    for block in &lists.blocks {
        let batch = &mut Batch::default();
        let survey = Survey { r: 0.1, walls, bodies: &seated(block, &bodies), block, batch };
        measure(set, survey, numbers, |terms| {
            for k in 0..2 {
                sums[k] += (terms[k] * 2f64.powi(40)).round() as i128;
                maxima[k] = f64::max(maxima[k], terms[k]);
            }
        });
    }
    (sums, maxima, bodies)
}

/// Checks the sums and maxima of a measure, with any instruction set and number of blocks.
fn check_measure<W: Spin>(numbers: &impl Measure<W>) {
    for set in InstructionSet::available() {
        let (sums, maxima, bodies) = measured(set, 1, numbers);
        for blocks in [2, 7] {
            let found = measured(set, blocks, numbers);
            assert!((found.0, found.1) == (sums, maxima), "other bits: {}, {blocks} blocks", set.name());
        }
        check_sums(&bodies, sums, maxima, numbers);
    }
    let fused = InstructionSet::available().split_off(1);
    let bits = |&set: &InstructionSet| measured(set, 1, numbers);
    assert!(fused.windows(2).all(|sets| bits(&sets[0]) == bits(&sets[1])));
}

/// Checks sums and maxima against a loop over all pairs of bodies and all walls, contact by contact.
fn check_sums<W: Spin>(bodies: &[Motion<W>], sums: [i128; 2], maxima: [f64; 2], numbers: &impl Measure<W>) {
    let (mut expected, mut largest) = ([0.0; 2], [0.0f64; 2]);
    let mut add = |terms: [f64; 2]| {
        for k in 0..2 {
            expected[k] += terms[k];
            largest[k] = largest[k].max(terms[k]);
        }
    };
    for (i, a) in bodies.iter().enumerate() {
        for wall in &parameters().walls {
            add(numbers.of::<Fused>(wall.depth(&a.x) - 0.1, &-wall.normal, &a.v, &a.omega));
        }
        for b in &bodies[i + 1..] {
            let apart = a.x - b.x;
            let n = apart.normalize();
            add(numbers.of::<Fused>(apart.norm() - 0.2, &n, &(a.v - b.v), &a.omega.plus(&b.omega)));
        }
    }
    for k in 0..2 {
        let found = sums[k] as f64 * 2f64.powi(-40);
        assert!((found - expected[k]).abs() <= 1e-9 * expected[k].abs(), "{found} {}", expected[k]);
        assert!((maxima[k] - largest[k]).abs() <= 1e-12 * largest[k]);
    }
}

#[test]
fn every_contact_is_measured_once_with_any_instructions_and_blocks() {
    let basic = law(Dissipative::new(0.4, 10.0), Frictionless);
    let full = law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01));
    check_measure::<Locked>(&Stored(basic.energies()));
    check_measure::<Spinning>(&Stored(full.energies()));
    check_measure::<Locked>(&Dissipated(basic.energies()));
    check_measure::<Spinning>(&Dissipated(full.energies()));
}

#[test]
fn coincident_centres_and_bodies_that_are_not_numbers_show() {
    let law = law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01));
    for set in InstructionSet::available() {
        for broken in [0.0, f64::NAN] {
            let (mut bodies, lists) = cloud::<Spinning>(100, 1);
            let [i, j] = lists.blocks[0].near[17].map(|i| i as usize);
            bodies[j].x = bodies[i].x + Vec3::repeat(broken);
            let (slopes, _) = slopes(&law, &bodies, &lists, set);
            assert!(!slopes[i].v.x.is_finite() && !slopes[j].v.x.is_finite());
        }
    }
}
