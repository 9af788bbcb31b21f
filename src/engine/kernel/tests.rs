//! Tests of the kernel with all instruction sets and with several numbers of blocks.

use super::*;
use crate::engine::forces::BodyParameters;
use crate::engine::neighbors::{Lists, Order, Reach};
use crate::math::elementary::Fused;
use crate::model::columns::{position, spin, velocity};
use crate::model::history::MemoryParameters;
use crate::model::size::Partners;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn parameters() -> BodyParameters {
    let walls = vec![
        Wall::new(Vec3::zeros(), -Vec3::z()),
        Wall::new(Vec3::new(1.0, 0.2, 0.0), Vec3::new(3.0, 0.1, 0.4)),
    ];
    BodyParameters { mass: 2.5, inverse_inertia: 40.0, gravity: Vec3::new(0.1, 0.0, -9.81), walls }
}

const LAW: LawParameters = LawParameters::PAPER;

/// Every combination of effects.
fn all_effects() -> impl Iterator<Item = Effects> {
    let variants = [Variant::Basic, Variant::Friction, Variant::FrictionRotation];
    variants.into_iter().flat_map(|variant| [false, true].map(|dissipative| Effects { variant, dissipative }))
}

/// A dense cloud of bodies of `width` numbers, and its lists, with near pairs and near walls picked.
fn cloud(width: usize, n: usize, blocks: usize) -> (Vec<f64>, Lists) {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.random::<f64>());
    let order = Order::new([1.0; 3], 0.36);
    let mut bodies: Vec<_> = (0..n as u64)
        .map(|id| {
            let (spin, x, v) = (vector(3.0), vector(1.1), vector(0.3) - Vec3::repeat(0.15));
            (order.key(&x, id), [x, v, spin])
        })
        .collect();
    bodies.sort_unstable_by_key(|(key, _)| *key);
    let (keys, bodies): (Vec<_>, Vec<_>) = bodies.into_iter().unzip();
    let x: Vec<Vec3> = bodies.iter().map(|body| body[0]).collect();
    let row = |body: &[Vec3; 3]| body.iter().flat_map(|v| [v.x, v.y, v.z]).take(width).collect::<Vec<_>>();
    let bodies: Vec<f64> = bodies.iter().flat_map(row).collect();
    let mut lists = Lists::default();
    lists.rebuild(&x, &keys, n, Reach::of_centres(0.36, 0.26), &parameters().walls, blocks);
    for block in &mut lists.blocks {
        let near: Vec<Vec3> = seated(block, &bodies, width).chunks_exact(width).map(position).collect();
        block.pick_near(&near, Reach::of_centres(0.31, 0.2), &parameters().walls);
    }
    (bodies, lists)
}

/// The bodies of a block by slot.
fn seated(block: &Block, bodies: &[f64], width: usize) -> Vec<f64> {
    let slots = 0..(block.range.len() + block.ghosts.len()) as u32;
    let body = |slot| &bodies[block.index(slot) * width..][..width];
    slots.flat_map(body).copied().collect()
}

/// Sizes of the bodies of a block by slot; none where all are alike.
fn sizes_of(block: &Block, sizes: &[Size]) -> Vec<Size> {
    let slots = 0..(block.range.len() + block.ghosts.len()) as u32;
    slots.filter_map(|slot| sizes.get(block.index(slot)).copied()).collect()
}

fn as_sizes(sizes: &[Size]) -> Sizes<'_> {
    if sizes.is_empty() { Sizes::Equal(Size::new(LAW.r, parameters().mass)) } else { Sizes::Each(sizes) }
}

/// No sizes: all are alike; or sizes that differ, for 300 bodies. No contact of these is beyond the lists.
fn all_sizes() -> [Vec<Size>; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let mut size = || Size::new(random.random_range(0.04..0.1), random.random_range(1.0..4.0));
    [Vec::new(), (0..300).map(|_| size()).collect()]
}

/// Slopes of all bodies, and the number of pairs within the cutoff.
fn slopes(kernel: &dyn Kernel, bodies: &[f64], sizes: &[Size], lists: &Lists) -> (Vec<f64>, u64) {
    let (parameters, width) = (parameters(), kernel.width());
    let mut slopes = vec![0.0; bodies.len()];
    let mut count = 0;
    for block in &lists.blocks {
        let (mut batch, mut other) = (Batch::default(), Batch::default());
        let bodies = &seated(block, bodies, width);
        let slopes = &mut slopes[block.range.start * width..block.range.end * width];
        kernel.start_slopes(&bodies[..slopes.len()], slopes);
        let of_block = sizes_of(block, sizes);
        let sizes = as_sizes(&of_block);
        let walls =
            Sweep { bodies, sizes, batch: &mut batch, slopes: &mut *slopes, memories: Memories::none() };
        kernel.add_walls(0, &block.walls, &parameters.walls, walls);
        count += kernel.add_pairs(
            &block.near,
            Sweep { bodies, sizes, batch: &mut other, slopes: &mut *slopes, memories: Memories::none() },
        );
        kernel.finish(&parameters.inertia(kernel.law().r), sizes, slopes);
    }
    (slopes, count)
}

/// Slopes of velocity and spin of body `i`, eqs. (2.13)-(2.15), summed contact by contact.
fn expected(kernel: &dyn Kernel, bodies: &[f64], sizes: &[Size], i: usize) -> (Vec3, Vec3) {
    let (parameters, law, width) = (parameters(), kernel.law(), kernel.width());
    let (mut force, mut turning) = (Vec3::zeros(), Vec3::zeros());
    let mut add = |gap: f64, n: Vec3, v: Vec3, spins: Vec3| {
        if gap <= law.l_max {
            let action = kernel.action(gap, &n, &v, &spins);
            force += action.force;
            turning += action.turning;
        }
    };
    let a = &bodies[i * width..][..width];
    let (r, own) = (|j: usize| as_sizes(sizes).of(j).r, as_sizes(sizes).of(i));
    for wall in &parameters.walls {
        add(wall.depth(&position(a)) - own.r, -wall.normal, velocity(a), spin(a));
    }
    for (j, b) in bodies.chunks_exact(width).enumerate().filter(|(j, _)| *j != i) {
        let apart = position(a) - position(b);
        let gap = apart.norm() - (own.r + r(j));
        add(gap, apart.normalize(), velocity(a) - velocity(b), spin(a) + spin(b));
    }
    let per_force = law.r * law.r * parameters.inverse_inertia * parameters.mass;
    (force / own.mass + parameters.gravity, turning * (per_force / own.mass))
}

fn check(effects: Effects, sizes: &[Size]) {
    let width = kernel(effects, LAW, InstructionSet::available()[0]).width();
    let (bodies, lists) = cloud(width, 300, 1);
    let x: Vec<Vec3> = bodies.chunks_exact(width).map(position).collect();
    let pairs = (0..300).flat_map(|i| (i + 1..300).map(move |j| (i, j)));
    let r = |i: usize| as_sizes(sizes).of(i).r;
    let count = pairs.filter(|&(i, j)| (x[i] - x[j]).norm() <= r(i) + r(j) + 0.1).count() as u64;
    for set in InstructionSet::available() {
        let kernel = kernel(effects, LAW, set);
        let reference = slopes(&*kernel, &bodies, sizes, &lists);
        for (i, slope) in reference.0.chunks_exact(width).enumerate() {
            let (v, omega) = expected(&*kernel, &bodies, sizes, i);
            assert!((velocity(slope) - v).norm() <= 1e-11 * v.norm());
            assert!((spin(slope) - omega).norm() <= 1e-11 * omega.norm().max(v.norm()));
            assert_eq!(position(slope), velocity(&bodies[i * width..]));
        }
        assert_eq!(reference.1, count);
        for blocks in [1, 2, 7] {
            let (bodies, lists) = cloud(width, 300, blocks);
            let found = slopes(&*kernel, &bodies, sizes, &lists);
            assert!(found == reference, "other bits: {}, {blocks} blocks", set.name());
        }
    }
    // The baseline has no fused multiply-add, all other sets have it.
    let fused = InstructionSet::available().split_off(1);
    let bits = |&set: &InstructionSet| slopes(&*kernel(effects, LAW, set), &bodies, sizes, &lists);
    assert!(fused.windows(2).all(|sets| bits(&sets[0]) == bits(&sets[1])));
}

#[test]
fn any_blocks_and_all_sets_with_fused_operations_give_the_same_bits() {
    for sizes in all_sizes() {
        all_effects().for_each(|effects| check(effects, &sizes));
    }
}

/// What a contact does by [`Law::respond`] and the resistances, contact by contact: force, torques on both
/// partners over the radius (N), rates (1/s), and the power of friction (W).
fn one_by_one(
    (law, resistance): (&Law<Dissipative, History>, Option<&Resistance>),
    partner: Partner,
    touch: Touch,
    difference: &Vec3,
    memory: &[f64],
) -> (Vec3, [Vec3; 2], Vec<f64>, f64) {
    let found = law.respond::<Separate>(partner, Touch { memory: &vector(&memory[..3]), ..touch });
    let (mut turnings, mut power) = ([found.turning; 2], found.dissipation[1]);
    let mut rates: Vec<f64> = found.rate.iter().copied().collect();
    let mut add = |moment: crate::model::rolling::Moment| {
        turnings[0] += moment.moment * touch.size.arms[0];
        turnings[1] -= moment.moment * touch.size.arms[1];
        power += moment.dissipation;
        moment.rate
    };
    if let Some(resistance) = resistance {
        if let Some(rolling) = &resistance.rolling {
            let touch = Touch { memory: &vector(&memory[3..6]), ..touch };
            rates.extend(&add(resistance.roll::<Separate>(rolling, partner, touch, difference)));
        }
        if let Some(twisting) = &resistance.twisting {
            let touch = Touch { memory: &(touch.n * memory[memory.len() - 1]), ..touch };
            let rate = add(resistance.twist::<Separate>(twisting, partner, touch, difference));
            rates.push(rate.dot(touch.n));
        }
    }
    (found.force, turnings, rates, power)
}

/// Numbers in -1..1 for the contact of bodies `a` and `b`, or of body `a` with wall `b` - 1000, as `a` sees
/// it.
fn memory_of(a: usize, b: usize, numbers: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64((a.min(b) * 2000 + a.max(b)) as u64);
    turned_round(a > b, (0..numbers).map(|_| 2.0 * random.random::<f64>() - 1.0).collect())
}

/// A memory, or its rate, as the other body sees it if `turned`: vectors are reversed, a twist is the same.
fn turned_round(turned: bool, mut memory: Vec<f64>) -> Vec<f64> {
    let vectors = memory.len() / 3 * 3;
    memory[..vectors].iter_mut().filter(|_| turned).for_each(|number| *number = -*number);
    memory
}

/// Slopes of all bodies, the rate of every contact by its bodies, and the power of friction in units of
/// 2^-40.
type Remembered = (Vec<f64>, Vec<([usize; 2], Vec<f64>)>, i128);

fn remembered(kernel: &dyn Kernel, all_sizes: &[Size], blocks: usize) -> Remembered {
    let (width, numbers, parameters) = (kernel.width(), kernel.memory(), parameters());
    let (bodies, mut lists) = cloud(width, 300, blocks);
    let (mut slopes, mut rates, mut power) = (vec![0.0; bodies.len()], Vec::new(), 0);
    for block in &mut lists.blocks {
        let bodies = &seated(block, &bodies, width);
        let pairs = block.near.iter().map(|&[i, j]| [block.index(i), block.index(j)]);
        let walls = block.walls.iter().map(|&[i, wall]| [block.index(i), 1000 + wall as usize]);
        let keys: Vec<_> = pairs.chain(walls).collect();
        let mut states: Vec<f64> = keys.iter().flat_map(|&[a, b]| memory_of(a, b, numbers)).collect();
        let of_walls: Vec<u32> = (block.near.len() as u32..keys.len() as u32).collect();
        let of_pairs: Vec<u32> = (0..block.near.len() as u32).collect();
        let mut found = vec![0.0; states.len()];
        states.resize(states.len() + BEHIND_MEMORIES, 0.0);
        let slopes = &mut slopes[block.range.start * width..block.range.end * width];
        kernel.start_slopes(&bodies[..slopes.len()], slopes);
        let batch = &mut Batch::default();
        let memories = Memories { rows: &of_walls, states: &states, rates: &mut found };
        let of_block = sizes_of(block, all_sizes);
        let sizes = as_sizes(&of_block);
        let sweep = Sweep { bodies, sizes, batch, slopes: &mut *slopes, memories };
        kernel.add_walls(0, &block.walls, &parameters.walls, sweep);
        let batch = &mut Batch::default();
        let memories = Memories { rows: &of_pairs, states: &states, rates: &mut found };
        kernel.add_pairs(&block.near, Sweep { bodies, sizes, batch, slopes: &mut *slopes, memories });
        kernel.finish(&parameters.inertia(0.1), sizes, slopes);
        rates.extend(
            keys.iter()
                .zip(found.chunks_exact(numbers))
                .map(|(&[a, b], rate)| ([a.min(b), a.max(b)], turned_round(a > b, rate.to_vec()))),
        );
        (block.near_rows, block.wall_rows) = (of_pairs, of_walls);
        let batch = &mut Batch::default();
        let (walls, block, memories) = (&parameters.walls[..], &*block, &states[..]);
        let survey = Survey { walls, bodies, sizes, width, block, class: 0, batch, memories };
        kernel.measure_dissipation(survey, &mut |[_, friction]: [&[f64]; 2]| {
            power += friction.iter().map(|w| (w * 2f64.powi(40)).round() as i128).sum::<i128>();
        });
    }
    // A pair of two blocks has two rows.
    rates.sort_by_key(|(key, _)| *key);
    rates.dedup();
    (slopes, rates, power)
}

fn check_memory(resistance: [Option<f64>; 2], numbers: usize, sizes: &[Size]) {
    let memory = MemoryParameters { stiffness_ratio: 0.5, damping: 0.7, mass: 2.5, resistance };
    let law = LawParameters { memory: Some(memory), ..LAW };
    let effects = Effects { variant: Variant::FrictionRotation, dissipative: true };
    let (rebound, tangential) = (Dissipative::new(law.e, law.psi), History::new(&law, memory, true));
    let resistance = Resistance::new(&law, &memory);
    let alone = Law { parameters: law, rebound, tangential };
    let contact = |partner, touch: Touch, difference: &Vec3, memory: &[f64]| {
        one_by_one((&alone, resistance.as_ref()), partner, touch, difference, memory)
    };
    let (bodies, _) = cloud(9, 300, 1);
    let rows: Vec<&[f64]> = bodies.chunks_exact(9).collect();
    let (mut forces, mut turnings, mut power) = ([Vec3::zeros(); 300], [Vec3::zeros(); 300], 0.0);
    let mut rates = Vec::new();
    for (i, a) in rows.iter().enumerate() {
        for (k, wall) in parameters().walls.iter().enumerate() {
            let own = as_sizes(sizes).of(i);
            let gap = wall.depth(&position(a)) - own.r;
            if gap <= law.l_max {
                let (n, v_rel, spins, memory) = (&-wall.normal, &velocity(a), &spin(a), &Vec3::zeros());
                let (spin_n, size) = (0.5 * spins.dot(n) / own.r, Partners::of_wall(&own, 2.5));
                let touch = Touch { gap, n, v_rel, spins, spin_n, size, memory };
                let found = contact(Partner::Wall, touch, spins, &memory_of(i, 1000 + k, numbers));
                forces[i] += found.0;
                turnings[i] += found.1[0];
                rates.push(([i, 1000 + k], found.2));
                power += found.3;
            }
        }
        for (j, b) in rows.iter().enumerate().skip(i + 1) {
            let apart = position(a) - position(b);
            let [first, second] = [i, j].map(|i| as_sizes(sizes).of(i));
            let gap = apart.norm() - (first.r + second.r);
            if gap <= law.l_max {
                let (n, v_rel, spins) =
                    (&apart.normalize(), &(velocity(a) - velocity(b)), &(spin(a) + spin(b)));
                let size = Partners::of_pair(&first, &second, 2.5);
                let spin_n = 0.5 * (spin(a) / first.r + spin(b) / second.r).dot(n);
                let touch = Touch { gap, n, v_rel, spins, spin_n, size, memory: &Vec3::zeros() };
                let memory = memory_of(i, j, numbers);
                // 2 R (w_i - w_j), with the reduced radius R.
                let reduced = first.r * second.r / (first.r + second.r);
                let turns = (spin(a) / first.r - spin(b) / second.r) * (2.0 * reduced);
                let found = contact(Partner::Sphere, touch, &turns, &memory);
                forces[i] += found.0;
                forces[j] -= found.0;
                turnings[i] += found.1[0];
                turnings[j] += found.1[1];
                rates.push(([i, j], found.2));
                power += found.3;
            }
        }
    }
    rates.sort_by_key(|(key, _)| *key);
    let mut bits = Vec::new();
    for set in InstructionSet::available() {
        let kernel = kernel(effects, law, set);
        assert_eq!(kernel.memory(), numbers);
        let reference = remembered(&*kernel, sizes, 1);
        for (i, slope) in reference.0.chunks_exact(9).enumerate() {
            let mass = as_sizes(sizes).of(i).mass;
            let force = forces[i] / mass + parameters().gravity;
            let turning = turnings[i] * (0.01 * 40.0 * 2.5 / mass);
            let off = (velocity(slope) - force).norm() / force.norm();
            assert!(off <= 1e-11, "{i}: {off} {}", set.name());
            assert!((spin(slope) - turning).norm() <= 1e-11 * turning.norm().max(force.norm()));
        }
        // Contacts beyond the cutoff, which are listed, have no rates.
        let moving = reference.1.iter().filter(|(_, rate)| rate.iter().any(|number| *number != 0.0));
        let moving: Vec<_> = moving.collect();
        assert_eq!(moving.len(), rates.len());
        for ((found_key, found), (key, rate)) in moving.into_iter().zip(&rates) {
            assert_eq!(found_key, key);
            let largest = rate.iter().fold(0.0f64, |most, number| most.max(number.abs()));
            let agrees = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-10 * largest;
            assert!(found.iter().zip(rate).all(agrees), "{found:?} {rate:?}");
        }
        let sum = reference.2 as f64 * 2f64.powi(-40);
        assert!((sum - power).abs() <= 1e-9 * power, "{sum} {power}");
        for blocks in [2, 7] {
            assert!(remembered(&*kernel, sizes, blocks) == reference, "other bits: {}, {blocks}", set.name());
        }
        bits.push(reference);
    }
    assert!(bits[1..].windows(2).all(|sets| sets[0] == sets[1]));
}

#[test]
fn contacts_that_remember_are_summed_alike_by_any_blocks_and_sets() {
    for sizes in all_sizes() {
        let (rolling, twisting) = (Some(0.05), Some(0.02));
        for (resistance, numbers) in
            [([None; 2], 3), ([rolling, None], 6), ([None, twisting], 4), ([rolling, twisting], 7)]
        {
            check_memory(resistance, numbers, &sizes);
        }
    }
}

/// What is measured.
#[derive(Clone, Copy)]
enum What {
    Stored,
    Dissipated,
}

/// Sums, in units of 2^-40, and maxima of a measure over all contacts.
fn measured(kernel: &dyn Kernel, set: InstructionSet, blocks: usize, what: What) -> ([i128; 2], [f64; 2]) {
    let width = kernel.width();
    let (bodies, lists) = cloud(width, 300, blocks);
    let walls = &parameters().walls[..];
    let (mut sums, mut maxima) = ([0; 2], [0.0; 2]);
    let mut take = |columns: [&[f64]; 2]| {
        for (k, terms) in columns.iter().enumerate() {
            for &term in *terms {
                sums[k] += (term * 2f64.powi(40)).round() as i128;
                maxima[k] = f64::max(maxima[k], term);
            }
        }
    };
    for block in &lists.blocks {
        let batch = &mut Batch::default();
        let survey = Survey {
            walls,
            bodies: &seated(block, &bodies, width),
            sizes: as_sizes(&[]),
            width,
            block,
            class: 0,
            batch,
            memories: &[],
        };
        match what {
            What::Stored => measure_gaps(set, survey, &kernel.stored_energy(), &mut take),
            What::Dissipated => kernel.measure_dissipation(survey, &mut take),
        }
    }
    (sums, maxima)
}

/// A contact law compiled in, whose terms the test knows one by one.
fn check_measure<R: Rebound, T: Tangential, const N: usize>(rebound: R, tangential: T, what: What) {
    let law = Law { parameters: LAW, rebound, tangential };
    let compiled = |set| compiled(LAW, rebound, tangential, set);
    for set in InstructionSet::available() {
        let one = measured(&*compiled(set), set, 1, what);
        for blocks in [2, 7] {
            let found = measured(&*compiled(set), set, blocks, what);
            assert!(found == one, "other bits: {}, {blocks} blocks", set.name());
        }
        check_sums::<R, T, N>(&law, one, what);
    }
    let fused = InstructionSet::available().split_off(1);
    let bits = |&set: &InstructionSet| measured(&*compiled(set), set, 1, what);
    assert!(fused.windows(2).all(|sets| bits(&sets[0]) == bits(&sets[1])));
}

/// Checks sums and maxima against a loop over all pairs of bodies and all walls, contact by contact.
fn check_sums<R: Rebound, T: Tangential, const N: usize>(
    law: &Law<R, T>,
    (sums, maxima): ([i128; 2], [f64; 2]),
    what: What,
) {
    let (bodies, _) = cloud(N, 300, 1);
    let energies = law.energies();
    let (mut expected, mut largest) = ([0.0; 2], [0.0f64; 2]);
    let mut add = |gap: f64, n: &Vec3, v: &Vec3, spins: &Vec3| {
        let terms = match what {
            What::Stored => [energies.stored::<Fused>(gap), 0.0],
            What::Dissipated => energies.dissipation::<Fused>(gap, n, v, spins),
        };
        for k in 0..2 {
            expected[k] += terms[k];
            largest[k] = largest[k].max(terms[k]);
        }
    };
    let bodies: Vec<&[f64]> = bodies.chunks_exact(N).collect();
    for (i, a) in bodies.iter().enumerate() {
        for wall in &parameters().walls {
            add(wall.depth(&position(a)) - 0.1, &-wall.normal, &velocity(a), &spin(a));
        }
        for b in &bodies[i + 1..] {
            let apart = position(a) - position(b);
            let (v, spins) = (velocity(a) - velocity(b), spin(a) + spin(b));
            add(apart.norm() - 0.2, &apart.normalize(), &v, &spins);
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
    let (rebound, friction) = (Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01));
    for what in [What::Stored, What::Dissipated] {
        check_measure::<_, _, 6>(rebound, Frictionless, what);
        check_measure::<_, _, 9>(rebound, Turning(friction), what);
    }
}

#[test]
fn coincident_centres_and_bodies_that_are_not_numbers_show() {
    let effects = Effects { variant: Variant::FrictionRotation, dissipative: true };
    for set in InstructionSet::available() {
        let kernel = kernel(effects, LAW, set);
        for broken in [0.0, f64::NAN] {
            let (mut bodies, lists) = cloud(9, 100, 1);
            let [i, j] = lists.blocks[0].near[17].map(|i| 9 * i as usize);
            for axis in 0..3 {
                bodies[j + axis] = bodies[i + axis] + broken;
            }
            let (slopes, _) = slopes(&*kernel, &bodies, &[], &lists);
            assert!(!slopes[i + VELOCITY.start].is_finite() && !slopes[j + VELOCITY.start].is_finite());
        }
    }
}
