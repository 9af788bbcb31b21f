//! The work per particle does not grow with the number of particles. Counts, not times: those are in
//! benches/rhs.rs.

use crate::beds::{bed, scene, simulation};
use demhybrid::ode::Ivp;

/// Pairs evaluated in one right-hand side, and pairs listed, per particle of a bed of `n`.
fn pairs_per_particle(n: usize) -> [f64; 2] {
    let mut simulation = simulation(&scene("friction+rotation"), &bed(n));
    let y = simulation.state().to_vec();
    let mut slopes = y.clone();
    let dynamics = simulation.dynamics_mut();
    let before = dynamics.pair_evaluations();
    dynamics.begin();
    dynamics.rhs(0.0, &y, &mut slopes);
    let evaluated = dynamics.pair_evaluations() - before;
    [evaluated as f64, dynamics.listed_pairs() as f64].map(|pairs| pairs / n as f64)
}

#[test]
fn pair_evaluations_per_particle_do_not_grow_with_the_number_of_particles() {
    let counts = [2_000, 20_000, 200_000].map(pairs_per_particle);
    println!("pairs evaluated and listed per particle: {counts:?}");
    for kind in 0..2 {
        let of: Vec<f64> = counts.iter().map(|count| count[kind]).collect();
        let (least, most) = of.iter().fold((f64::MAX, 0.0f64), |(a, b), &c| (a.min(c), b.max(c)));
        assert!(most / least < 1.05, "{of:?}");
    }
    // Pinned: a change of these figures is a change of what is evaluated.
    let [evaluated, listed] = counts[2];
    assert!((evaluated - 7.541).abs() < 1e-3 && (listed - 10.520).abs() < 1e-3, "{evaluated} {listed}");
}
