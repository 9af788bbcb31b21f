//! The right-hand side does not depend on which rank owns which particle, and slabs are cut by work.

mod memory;

use super::*;
use crate::domain::Solo;
use crate::domain::comm::team::team;
use crate::domain::rows;
use crate::domain::slabs::imbalance;
use crate::engine::forces::FREE;
use crate::engine::kernel;
use crate::model::columns::{Column, position, spin};
use crate::model::effects::{Effects, Variant};
use crate::model::wall::Wall;
use crate::ode::{DORMAND_PRINCE, Ivp, Method, Norm, RungeKutta, Stage, TrialStep, no_vectors};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Position, velocity, spin.
type Body = [f64; 9];

fn body(x: Vec3, v: Vec3, omega: Vec3) -> Body {
    std::array::from_fn(|k| [x, v, omega][k / 3][k % 3])
}

/// Bits of the slopes by id, at the start and after a move, and the number of pairs evaluated.
type Answer = (BTreeMap<u64, Vec<u64>>, u64);

fn parameters() -> BodyParameters {
    let walls = vec![
        Wall::new(Vec3::repeat(-0.1), -Vec3::z()),
        Wall::new(Vec3::new(1.4, 0.2, 0.0), Vec3::new(3.0, 0.1, 0.4)),
    ];
    BodyParameters { mass: 2.5, inverse_inertia: 40.0, gravity: Vec3::new(0.1, 0.0, -9.81), walls }
}

const LAW: LawParameters = LawParameters::PAPER;

const ALL_EFFECTS: Effects = Effects { variant: Variant::FrictionRotation, dissipative: true };

/// The equations of motion of the particles `ids` with the states `y`.
fn dynamics<'c>(
    comm: &'c dyn Comm,
    effects: Effects,
    parameters: BodyParameters,
    ids: Vec<u64>,
    y: &mut Vec<f64>,
) -> Dynamics<'c> {
    let kernel = |set| kernel::kernel(effects, LAW, set).into();
    let columns = Columns::new(effects.variant == Variant::FrictionRotation);
    let particles = Particles { ids, columns, constants: Vec::new(), y };
    Dynamics::new(comm, &kernel, parameters, 1.0, particles, &mut []).unwrap()
}

/// Slopes from `bounds.len() + 1` ranks, whose slabs have the inner bounds `bounds`.
fn slopes(bodies: &[Body], bounds: &[f64]) -> Answer {
    let ranks = bounds.len() + 1;
    let found = Mutex::new((BTreeMap::<u64, Vec<u64>>::new(), 0));
    team(ranks, |comm| {
        let own = rows::block(bodies.len() as u64, comm.rank(), ranks);
        let mut y: Vec<f64> = own.clone().flat_map(|id| bodies[id as usize]).collect();
        let mut dynamics = dynamics(comm, ALL_EFFECTS, parameters(), own.collect(), &mut y);
        dynamics.domain.slabs = Slabs::with_inner_bounds(bounds);
        dynamics.relocate(0.0, &mut y, &mut []).unwrap();
        let (low, high) = dynamics.slabs().of(comm.rank());
        assert!(y.chunks_exact(9).all(|body| low <= body[2] && body[2] < high), "every rank has its slab");
        dynamics.begin();
        // The second time all have moved, by less than the skin, and near pairs are picked again.
        for _ in 0..2 {
            let mut slope = y.clone();
            dynamics.rhs(0.0, &y, &mut slope);
            let mut found = found.lock().unwrap();
            for (id, slope) in dynamics.ids().iter().zip(slope.as_chunks::<9>().0) {
                found.0.entry(*id).or_default().extend(slope.map(f64::to_bits));
            }
            for (id, body) in dynamics.ids().iter().zip(y.as_chunks_mut::<9>().0) {
                for (axis, x) in (0..).zip(&mut body[POSITION]) {
                    *x += 0.02 * ((7 * id + 3 * axis) % 5) as f64 - 0.04;
                }
            }
        }
        found.lock().unwrap().1 += dynamics.own_pairs();
    });
    found.into_inner().unwrap()
}

/// Clouds of all shapes: flat ones, columns, overlapping spheres, and distant ones.
fn cloud() -> impl Strategy<Value = Vec<Body>> {
    let vector = |size: f64| vec(-size..size, 3).prop_map(|v| Vec3::new(v[0], v[1], v[2]));
    let sizes = vec(prop_oneof![Just(0.0), Just(0.3), Just(1.2), Just(1e6)], 3);
    let vectors = (vector(0.5), vector(1.0), vector(20.0));
    (sizes, vec(vectors, 1..80)).prop_map(|(sizes, bodies)| {
        let shifted = |(k, (x, v, omega)): (usize, (Vec3, Vec3, Vec3))| {
            // No two centres coincide.
            let shift = Vec3::repeat(1e-3 * k as f64);
            body(Vec3::from_fn(|axis, _| sizes[axis] * x[axis]) + shift, v, omega)
        };
        bodies.into_iter().enumerate().map(shifted).collect()
    })
}

/// Positions of bounds: anywhere, at the height of a particle, or beyond all particles.
#[derive(Debug, Clone)]
enum Bound {
    At(f64),
    Of(prop::sample::Index),
}

fn bounds() -> impl Strategy<Value = Vec<Bound>> {
    let bound = prop_oneof![
        (-0.7..0.7f64).prop_map(Bound::At),
        any::<prop::sample::Index>().prop_map(Bound::Of),
        prop_oneof![Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e300)].prop_map(Bound::At),
    ];
    vec(bound, 1..5)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 150,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_slab_bounds_give_the_same_bits(bodies in cloud(), bounds in bounds()) {
        let mut inner: Vec<f64> = bounds
            .iter()
            .map(|bound| match bound {
                Bound::At(z) => *z,
                Bound::Of(index) => index.get(&bodies)[2],
            })
            .collect();
        inner.sort_by(f64::total_cmp);
        let (alone, pairs) = slopes(&bodies, &[]);
        prop_assert_eq!(alone.len(), bodies.len());
        prop_assert!(slopes(&bodies, &inner) == (alone, pairs), "other bits with bounds {:?}", inner);
    }
}

#[test]
fn ranks_with_different_instruction_sets_all_use_the_narrowest() {
    use InstructionSet::{Avx2, Avx512, Baseline};
    for (sets, ends) in [
        ([Avx512, Avx2, Avx512], [Avx2, Avx512]),
        ([Baseline, Avx512, Avx2], [Baseline, Avx512]),
        ([Avx2; 3], [Avx2; 2]),
        ([Avx512; 3], [Avx512; 2]),
        ([Baseline; 3], [Baseline; 2]),
    ] {
        team(3, |comm| assert_eq!(common_instructions(comm, sets[comm.rank()]), ends));
    }
}

/// Point `k` of a lattice of width `d` (m), 10 across. It is slightly tilted, so that no two heights are
/// equal.
fn place(k: usize, d: f64) -> Vec3 {
    let [a, b, c] = [k % 10, k / 10 % 10, k / 100].map(|k| k as f64);
    Vec3::new(d * a, d * b, d * c + 1e-4 * (10.0 * b + a))
}

#[test]
fn slabs_share_out_near_pairs_and_not_particles() {
    // 500 spheres that touch, and 500 distant ones above them.
    let x: Vec<Vec3> = (0..1000).map(|k| place(k, if k < 500 { 0.19 } else { 0.6 })).collect();
    // Near pairs are those within the cutoff plus a tenth of the radius. A particle without pairs counts 4.
    let at = |i: u64| x[i as usize];
    let work = |i: u64| 3 + x.iter().filter(|other| (at(i) - *other).norm() <= 0.31).count() as u64;
    for ranks in 2..=3 {
        team(ranks, |comm| {
            let ids: Vec<u64> = (0..1000).filter(|id| *id as usize % ranks == comm.rank()).collect();
            let body = |&id: &u64| [x[id as usize], Vec3::zeros()];
            let mut y = ids.iter().flat_map(body).flat_map(|v| [v.x, v.y, v.z]).collect();
            let parameters =
                BodyParameters { mass: 1.0, inverse_inertia: 0.0, gravity: Vec3::zeros(), walls: Vec::new() };
            let effects = Effects { variant: Variant::Basic, dissipative: false };
            let mut dynamics = dynamics(comm, effects, parameters, ids, &mut y);
            // There were no lists yet when the first bounds were set.
            dynamics.rebuild(&mut StepStart::new(0.0, y)).unwrap();
            let expected: Vec<u64> = dynamics.ids().iter().map(|&id| work(id)).collect();
            assert_eq!(dynamics.forces.loads(), expected);
            let (mut loads, mut counts) = (vec![0; ranks], vec![0; ranks]);
            loads[comm.rank()] = expected.iter().sum();
            counts[comm.rank()] = expected.len() as u64;
            comm.sum(&mut loads);
            comm.sum(&mut counts);
            assert!(imbalance(&loads) < 1.1, "{loads:?}");
            assert!(imbalance(&counts) > 1.3, "{counts:?}");
        });
    }
}

/// A floor, on which the lowest layer of the bed lies.
fn floor() -> BodyParameters {
    BodyParameters { walls: vec![Wall::new(Vec3::repeat(-0.09), -Vec3::z())], ..parameters() }
}

/// A bed of `n` spheres, 4 deep and 8 wide, that overlap a little, with velocities and spins.
fn bed(n: usize) -> Vec<Body> {
    let sphere = |k: usize| {
        let [a, b, c] = [k % 4, k / 4 % 8, k / 32].map(|k| k as f64);
        let shake = |s: usize| 0.02 * ((k * s % 17) as f64 / 17.0 - 0.5);
        let x = Vec3::new(0.19 * c + shake(5), 0.19 * b + shake(7), 0.19 * a + shake(11));
        body(x, Vec3::from_fn(|axis, _| 20.0 * shake(axis + 2)), Vec3::repeat(shake(13)))
    };
    (0..n).map(sphere).collect()
}

/// The slopes of this rank with their ids, and its number of pairs, after a move by `way(id)` (m) along y.
///
/// The lists are those from before the move.
fn after_a_move(comm: &dyn Comm, bodies: &[Body], way: &dyn Fn(u64) -> f64) -> (Vec<(u64, Body)>, u64) {
    let own = rows::block(bodies.len() as u64, comm.rank(), comm.size());
    let mut y: Vec<f64> = own.clone().flat_map(|id| bodies[id as usize]).collect();
    let mut dynamics = dynamics(comm, ALL_EFFECTS, floor(), own.collect(), &mut y);
    assert_eq!(dynamics.forces.lists.blocks.len(), rayon::current_num_threads());
    // The slabs are cut across the long axis of the bed.
    assert!(comm.size() == 1 || dynamics.slabs().axis() == 0);
    let start = y.clone();
    for (body, &id) in y.as_chunks_mut::<9>().0.iter_mut().zip(dynamics.ids()) {
        body[1] += way(id);
    }
    // First as the second stage of a step, then as a state of its own.
    dynamics.begin();
    let mut second = y.clone();
    for state in [&start, &y] {
        let make = |stage: Stage| stage.state.copy_from_slice(&state[stage.part.range()]);
        dynamics.rhs_of(0.0, &start, no_vectors(), &mut second, &make);
    }
    let pairs = dynamics.own_pairs();
    dynamics.begin();
    let mut slope = y.clone();
    dynamics.rhs(0.0, &y, &mut slope);
    assert_eq!(slope, second);
    let slopes = slope.as_chunks().0.iter().copied();
    (dynamics.ids().iter().copied().zip(slopes).collect(), dynamics.own_pairs() - pairs)
}

/// The same by id, from `ranks` ranks of `threads` threads each.
fn by_ranks_and_threads(
    bodies: &[Body],
    way: &(dyn Fn(u64) -> f64 + Sync),
    ranks: usize,
    threads: usize,
) -> (Vec<Body>, u64) {
    let found = Mutex::new((vec![[0.0; 9]; bodies.len()], 0));
    team(ranks, |comm| {
        // The loops run on this thread and others.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build().unwrap();
        let (slopes, pairs) = after_a_move(comm, bodies, way);
        drop(pool);
        let mut found = found.lock().unwrap();
        slopes.into_iter().for_each(|(id, slope)| found.0[id as usize] = slope);
        found.1 += pairs;
    });
    found.into_inner().unwrap()
}

#[test]
fn slopes_of_a_long_bed_are_the_sums_of_its_contacts_by_any_ranks_and_threads() {
    // There are more particles than are computed ahead of their pairs. Since the lists were built, they have
    // not moved, or all have moved, or only the last ones, when most pairs have been evaluated with what was
    // picked before.
    let bodies = bed(3000);
    let law = kernel::kernel(ALL_EFFECTS, LAW, InstructionSet::available()[0]);
    let ways: [&(dyn Fn(u64) -> f64 + Sync); 3] =
        [&|_| 0.0, &|id| 0.029 * ((id % 3) as f64 - 1.0), &|id| if id > 2900 { 0.029 } else { 0.0 }];
    for way in ways {
        let alone = by_ranks_and_threads(&bodies, way, 1, 1);
        let mut moved = bodies.clone();
        (0u64..).zip(&mut moved).for_each(|(id, body)| body[1] += way(id));
        for i in (0..3000).step_by(37).chain(2900..2910) {
            let (mut force, mut turning) = (Vec3::zeros(), Vec3::zeros());
            let mut add = |gap: f64, n: Vec3, v: Vec3, spins: Vec3| {
                if gap <= 0.1 {
                    let action = law.action(gap, &n, &v, &spins);
                    force += action.force;
                    turning += action.turning;
                }
            };
            let a = &moved[i];
            for wall in &floor().walls {
                add(wall.depth(&position(a)) - 0.1, -wall.normal, velocity(a), spin(a));
            }
            for b in moved.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| b) {
                let apart = position(a) - position(b);
                let (v, spins) = (velocity(a) - velocity(b), spin(a) + spin(b));
                add(apart.norm() - 0.2, apart.normalize(), v, spins);
            }
            let (slope, acceleration) = (&alone.0[i], force / 2.5 + floor().gravity);
            assert!((velocity(slope) - acceleration).norm() <= 1e-10 * (1.0 + force.norm()), "particle {i}");
            assert!(
                (spin(slope) - turning * 0.1 * 0.1 * 40.0).norm() <= 1e-9 * (1.0 + force.norm()),
                "particle {i}"
            );
            assert_eq!(position(slope), velocity(a));
        }
        for (ranks, threads) in [(2, 1), (3, 1), (1, 2), (1, 3), (2, 2)] {
            let shared = by_ranks_and_threads(&bodies, way, ranks, threads);
            assert!(shared == alone, "other bits from {ranks} ranks of {threads} threads");
        }
    }
}

#[test]
fn columns_that_do_not_change_follow_particles_and_their_ghosts() {
    let bodies = bed(300);
    let mut columns = Columns::new(true);
    let (name, unit, changes) = ("tag".to_owned(), "1".to_owned(), Changes::WithLists);
    columns.push(Column { name, width: 2, unit, changes, in_file: false, names: Vec::new() });
    let tags = |ids: &[u64]| ids.iter().flat_map(|&id| [id as f64, 0.5 - id as f64]).collect::<Vec<_>>();
    for ranks in 1..=3 {
        team(ranks, |comm| {
            let ids: Vec<u64> = rows::block(300, comm.rank(), ranks).collect();
            let mut y: Vec<f64> = ids.iter().flat_map(|&id| bodies[id as usize]).collect();
            let constants = tags(&ids);
            let particles = Particles { ids, columns: columns.clone(), constants, y: &mut y };
            let kernel = |set| kernel::kernel(ALL_EFFECTS, LAW, set).into();
            let dynamics = Dynamics::new(comm, &kernel, floor(), 1.0, particles, &mut []).unwrap();
            assert!(ranks == 1 || dynamics.ghosts() > 0);
            assert_eq!(dynamics.domain.constants, tags(&dynamics.domain.ids));
            assert_eq!(dynamics.constants(), tags(dynamics.ids()));
        });
    }
}
