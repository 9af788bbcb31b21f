//! The work per particle does not grow with the number of particles. Counts, not times: those are in
//! benches/rhs.rs.

use crate::beds::{Job, bed, scene, simulate};
use demhybrid::engine::simulation::Simulation;
use demhybrid::model::contact::{Rebound, Tangential};
use demhybrid::model::particle::Spin;
use demhybrid::ode::Ivp;

/// Pairs evaluated in one right-hand side, and pairs listed, per particle.
struct Count<'a>(&'a mut Vec<[f64; 2]>);

impl Job for Count<'_> {
    fn run<R: Rebound, T: Tangential, W: Spin>(self, mut simulation: Simulation<R, T, W>) {
        let y = simulation.state().to_vec();
        let mut slopes = y.clone();
        let dynamics = simulation.dynamics_mut();
        let before = dynamics.pair_evaluations();
        dynamics.begin();
        dynamics.rhs(0.0, &y, &mut slopes);
        let n = y.len() as f64;
        let evaluated = (dynamics.pair_evaluations() - before) as f64;
        self.0.push([evaluated / n, dynamics.listed_pairs() as f64 / n]);
    }
}

#[test]
fn pair_evaluations_per_particle_do_not_grow_with_the_number_of_particles() {
    let mut counts = Vec::new();
    for n in [2_000, 20_000, 200_000] {
        simulate(&scene("friction+rotation"), &bed(n), Count(&mut counts));
    }
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
