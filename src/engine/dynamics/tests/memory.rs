//! Contacts keep their memory over new lists, begin and end as they should, and are found on old lists.

use super::*;
use crate::model::history::MemoryParameters;

/// Spheres that remember, without walls and weight, at these states.
fn remembering<'c>(
    comm: &'c dyn Comm,
    states: &[Body],
    resistance: [Option<f64>; 2],
) -> (Dynamics<'c>, StepStart) {
    let memory = MemoryParameters { stiffness_ratio: 0.5, damping: 1.0, mass: 2.5, resistance };
    let law = LawParameters { memory: Some(memory), ..LAW };
    let kernel = move |set| kernel::kernel(ALL_EFFECTS, law, set).into();
    let parameters =
        BodyParameters { mass: 2.5, inverse_inertia: 40.0, gravity: Vec3::zeros(), walls: Vec::new() };
    let ids: Vec<u64> = rows::block(states.len() as u64, comm.rank(), comm.size()).collect();
    let mut y: Vec<f64> = ids.iter().flat_map(|&id| states[id as usize]).collect();
    let particles = Particles { ids, columns: Columns::new(true), constants: Vec::new(), y: &mut y };
    let mut dynamics = Dynamics::new(comm, &kernel, parameters, 1.0, particles, &mut []).unwrap();
    dynamics.remember_within(0.05);
    dynamics.start_contacts(&mut y);
    (dynamics, StepStart::new(0.0, y))
}

/// A sphere at `x` (m) along the x axis.
fn at(x: f64) -> Body {
    body(Vec3::x() * x, Vec3::zeros(), Vec3::zeros())
}

/// Finds the slopes at the start of the step.
fn first_slopes(dynamics: &mut Dynamics, step_start: &mut StepStart) {
    step_start.slope_known = false;
    dynamics.begin();
    step_start.find_slope(dynamics);
}

/// Slope of the state of particle 0 at the start of the step.
fn first_slope(dynamics: &mut Dynamics, step_start: &mut StepStart) -> Body {
    first_slopes(dynamics, step_start);
    let first = dynamics.ids().iter().position(|&id| id == 0).unwrap();
    step_start.slope.as_chunks().0[first]
}

#[test]
fn a_memory_keeps_its_direction_where_new_lists_turn_the_pair_round() {
    // Cells are 0.36 m wide: at first particle 0 is in the lower cell, then in the higher one.
    let (mut dynamics, mut start) = remembering(&Solo, &[at(0.3), at(0.45)], [0.05, 0.02].map(Some));
    // The first row is that of the contact, the others are free.
    assert_eq!(dynamics.contacts.keys[..2], [[0, 1], FREE]);
    // Shear and rolling along y, and a twist.
    start.y[18..25].copy_from_slice(&[0.0, 0.3, 0.0, 0.0, 0.4, 0.0, 0.5]);
    let before = first_slope(&mut dynamics, &mut start);
    // Elastic friction is -L_0 s p over the mass. Moments over the radius are half of that, as R = r/2.
    let s = (0.5f64 * 150.0 * 0.05).exp();
    let limit = |coefficient: f64| coefficient * 0.58 * 10.0 * s;
    let spin_per_force = 0.1 * 0.1 * 40.0;
    // The first lies to the left of the second, so that the normal, about which it twists, is -x.
    let expected = [
        -limit(0.2) * 0.3 / 2.5,
        0.5 * limit(0.02) * 0.5 * spin_per_force,
        -0.5 * limit(0.05) * 0.4 * spin_per_force,
    ];
    for (found, expected) in [before[4], before[6], before[7]].iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-12, "{before:?} {expected:?}");
    }
    (start.y[0], start.y[9]) = (0.85, 0.7);
    dynamics.rebuild(&mut start).unwrap();
    assert_eq!(dynamics.contacts.keys[..2], [[1, 0], FREE]);
    let after = first_slope(&mut dynamics, &mut start);
    // Now the normal is x: the twist and the torque of friction are reversed, the others are not.
    for (k, sign) in [(4, 1.0), (6, -1.0), (7, 1.0), (8, -1.0)] {
        assert!((after[k] / before[k] * sign - 1.0).abs() < 1e-12, "{k}: {before:?} {after:?}");
    }
}

/// A sphere at `x` (m) that moves along x and y with `v` (m/s) each, and turns.
fn fast(x: f64, v: f64) -> Body {
    body(Vec3::x() * x, Vec3::new(v, v, 0.0), Vec3::new(0.2 * v, 0.1 * v, 0.3))
}

/// Takes a step of 2 ms and takes over the contacts at its end.
fn step(dynamics: &mut Dynamics, start: &mut StepStart) {
    let norm = Norm { weights: vec![vec![1.0; 9], vec![1.0; 7]], rate: false, mean: None, rows: Vec::new() };
    let (mut trial, mut method) = (TrialStep::default(), RungeKutta::new(&DORMAND_PRINCE));
    method.attempt(dynamics, start, 2e-3, &norm, &mut trial);
    std::mem::swap(&mut start.y, &mut trial.next);
    std::mem::swap(&mut start.slope, &mut trial.slope);
    dynamics.follow_contacts(start);
}

#[test]
fn a_contact_that_parts_leaves_nothing_in_its_row() {
    // They part with 2 m/s: they are within reach, and 2 ms later beyond it.
    let (mut dynamics, mut start) =
        remembering(&Solo, &[fast(0.0, -1.0), fast(0.248, 1.0)], [0.05, 0.02].map(Some));
    assert_eq!(dynamics.contacts.keys[..2], [[0, 1], FREE]);
    start.y[18..25].copy_from_slice(&[0.1, 0.3, 0.0, 0.0, 0.4, 0.0, 0.5]);
    step(&mut dynamics, &mut start);
    assert!(dynamics.contacts.keys.iter().all(|key| *key == FREE));
    assert!(start.y[18..].iter().chain(&start.slope[18..]).all(|number| *number == 0.0), "{:?}", start.y);
}

#[test]
fn a_new_contact_begins_with_its_own_rate() {
    // They close with 2 m/s and slip; at first they are out of reach.
    let (mut dynamics, mut start) =
        remembering(&Solo, &[fast(0.0, 1.0), fast(0.252, -1.0)], [0.05, 0.02].map(Some));
    assert!(dynamics.contacts.keys.iter().all(|key| *key == FREE));
    step(&mut dynamics, &mut start);
    assert_eq!(dynamics.contacts.keys[..2], [[0, 1], FREE]);
    assert_eq!(start.y.len(), start.slope.len());
    assert!(start.y[18..].iter().chain(&start.slope[25..]).all(|number| *number == 0.0));
    let kept = start.slope[18..25].to_vec();
    first_slope(&mut dynamics, &mut start);
    assert!([1, 4, 6].iter().all(|&k| kept[k].abs() > 1.0), "{kept:?}");
    for (kept, found) in kept.iter().zip(&start.slope[18..25]) {
        assert!((kept - found).abs() <= 1e-12 * kept.abs(), "{kept} {found}");
    }
}

/// What lists near the end of their life answer, and then new ones: the slopes by id, and the fastest
/// approach; from ranks with these inner `bounds` of their slabs, along z. Contacts are evaluated up to `gap`
/// (m), and particles may move by `path` (m).
fn answers_of_old_and_new_lists(
    states: &[Body],
    bounds: &[f64],
    [gap, path]: [f64; 2],
) -> [(BTreeMap<u64, [u64; 9]>, f64); 2] {
    let found = Mutex::new([0, 1].map(|_| (BTreeMap::new(), 0.0f64)));
    team(bounds.len() + 1, |comm| {
        let (mut dynamics, mut start) = remembering(comm, states, [None, None]);
        dynamics.domain.slabs = Slabs::with_inner_bounds(bounds);
        dynamics.rebuild(&mut start).unwrap();
        dynamics.evaluate_within(gap);
        let way = 0.999_999 * dynamics.free_path();
        assert!((way / path - 1.0).abs() < 1e-5, "{way}");
        let mut ghosts = [dynamics.ghosts() as u64];
        comm.sum(&mut ghosts);
        assert!(bounds.is_empty() || ghosts[0] > 0, "slabs end between partners");
        for (body, &id) in start.y.as_chunks_mut::<9>().0.iter_mut().zip(dynamics.ids()) {
            body[2] += if id % 2 == 0 { way } else { -way };
        }
        let mut listed = [0; 2];
        for (k, listed) in listed.iter_mut().enumerate() {
            first_slopes(&mut dynamics, &mut start);
            let mut found = found.lock().unwrap();
            for (&id, slope) in dynamics.ids().iter().zip(start.slope.as_chunks().0) {
                found[k].0.insert(id, slope.map(f64::to_bits));
            }
            found[k].1 = found[k].1.max(dynamics.fastest_approach(0.0));
            drop(found);
            *listed = dynamics.listed_pairs() as u64;
            dynamics.rebuild(&mut start).unwrap();
        }
        comm.sum(&mut listed);
        assert!(listed[0] < listed[1], "there are pairs on new lists only: {listed:?}");
    });
    found.into_inner().unwrap()
}

#[test]
fn lists_at_the_end_of_their_life_answer_as_new_ones_do() {
    // Pairs in a row, whose gaps are about as wide as the lists reach, 0.16 m. The partners move towards each
    // other, the faster the wider their gap is. Pair 20 is the last one that counts,
    // and two slabs part it.
    let pairs = (0..41).map(|k| (f64::from(k), 0.3496 + 5e-4 * f64::from(k)));
    let states = pairs.flat_map(|(k, apart)| {
        let sphere = |z, v| body(Vec3::z() * z, Vec3::z() * v, Vec3::y() * v);
        [sphere(k, 2.0 + k), sphere(k + apart, -2.0 - k)]
    });
    let states: Vec<Body> = states.collect();
    for limits in [[f64::INFINITY, 0.02], [0.05, 0.045]] {
        let [_, alone] = answers_of_old_and_new_lists(&states, &[], limits);
        assert!(alone.1 > 0.0 && alone.0.len() == states.len());
        for bounds in [&[][..], &[20.2], &[13.2, 27.2]] {
            for found in answers_of_old_and_new_lists(&states, bounds, limits) {
                assert!(found == alone, "{bounds:?}: {} and {}", found.1, alone.1);
            }
        }
    }
}
