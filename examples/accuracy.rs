//! What does a smaller tolerance cost, and what does it bring?
//!
//! A sphere falls on a floor and bounces. Each tolerance gives a height at the end, which is compared with
//! that of the smallest tolerance.

use demhybrid::domain::Solo;
use demhybrid::error::Error;
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::InitialCondition;
use demhybrid::studies::job_pool::run::run;
use demhybrid::studies::job_pool::{JobPool, Sample};

const SCENE: &str = "
    t_end = 2.0
    gravity = [0.0, 0.0, -9.81]
    particles = { radius = 0.1, mass = 1, file = 'placed by the program' }
    container.wall = [{ point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, -1.0] }]
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.7,
                dissipation_focusing = 10.0, interaction_distance = 0.1 }
    solver.method = 'dormand-prince'
";

/// A run with this tolerance. Its result is the height of the centre at the end, m.
fn bounce(tolerance: f64) -> Result<Sample, Error> {
    let scene = Scene::parse("bounce.toml", SCENE, &[format!("solver.tolerance={tolerance:e}")])?;
    let (x, still) = (vec![[0.0, 0.0, 1.1]], vec![[0.0; 3]]);
    let start = InitialCondition { x, v: still.clone(), omega: still, ..InitialCondition::default() };
    let mut height = 0.0;
    // The run would end after a million right-hand sides.
    let sample = run(&scene, &start, 1_000_000, |frame| height = frame.x[0].z);
    Ok(Sample { numbers: vec![height], ..sample })
}

fn main() -> Result<(), Error> {
    let tolerances = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-10];
    // The runs are independent of each other: a pool shares them out over threads.
    let pool = JobPool { comm: &Solo, threads: 2, quiet: true };
    let samples = pool.run("bounces", &tolerances, |&tolerance| {
        bounce(tolerance).unwrap_or_else(|why| Sample { failure: Some(why.to_string()), ..Sample::default() })
    });
    assert!(samples.iter().all(|sample| sample.failure.is_none()), "{samples:?}");

    let [.., reference] = &samples[..] else { unreachable!("there is a sample for every tolerance") };
    let errors: Vec<f64> =
        samples.iter().map(|sample| (sample.number(0) - reference.number(0)).abs()).collect();
    println!("tolerance   error, m   right-hand sides");
    for ((tolerance, error), sample) in tolerances.iter().zip(&errors).zip(&samples) {
        println!("{tolerance:9.0e} {error:10.1e} {:18}", sample.work.rhs_evaluations);
    }
    let cost = |k: usize| samples[k].work.rhs_evaluations as f64;
    println!("from 1e-1 to 1e-5: error / {:.0}, work * {:.1}", errors[0] / errors[4], cost(4) / cost(0));
    assert!(errors[4] < 1e-2 * errors[0], "{errors:?}");
    assert!(cost(4) < 10.0 * cost(0));
    Ok(())
}
