//! A step takes no memory once its vectors have their size: allocators cost time, and memory that grows ends
//! long runs. On one thread; rayon's queues are its own matter, and so is what MPI does in C.

#[path = "../benches/common/mod.rs"]
mod beds;
#[path = "program/mpirun.rs"]
mod mpirun;

use beds::{bed, norm, scene, simulation_on};
use demhybrid::domain::{Comm, Solo, world};
use demhybrid::engine::simulation::Simulation;
use demhybrid::ode::{
    Chebyshev, DORMAND_PRINCE, Ivp, MERSON, Method, RungeKutta, StepStart, TrialStep, Verlet,
};
use demhybrid::scene::Scene;
use demhybrid::scene::walls::walls;
use std::process::Command;

/// Takes steps of different sizes by every method, and counts. With `audited` right-hand sides also tell what
/// they dissipate, as `output.energy` asks for.
fn count_allocations(mut simulation: Simulation, audited: bool, ranks: usize) {
    let y = simulation.state().to_vec();
    let norm = norm(&simulation, false);
    let dynamics = simulation.dynamics_mut();
    if audited {
        dynamics.audit();
    }
    let mut methods: Vec<Box<dyn Method>> = vec![
        Box::new(RungeKutta::new(&MERSON)),
        Box::new(RungeKutta::new(&DORMAND_PRINCE)),
        Box::new(Chebyshev::new(f64::INFINITY)),
        Box::new(Verlet),
    ];
    let mut trial = TrialStep::default();
    for method in &mut methods {
        let mut step_start = StepStart::new(0.0, y.clone());
        let mut steps = |sizes: &[f64]| {
            for &h in sizes {
                method.stable_step(dynamics, &mut step_start, &mut trial);
                method.attempt(dynamics, &mut step_start, h, &norm, &mut trial);
                std::mem::swap(&mut step_start.y, &mut trial.next);
                step_start.slope_known = false;
                step_start.t += h;
            }
        };
        steps(&[1e-4, 1e-4]);
        let info = allocation_counter::measure(|| steps(&[1e-5, 1e-4, 3e-4, 1e-5, 2e-4, 1e-4]));
        assert_eq!(info.count_total, 0, "{} allocates in a step: {info:?}", method.name());
    }
    let mut energies = || (dynamics.kinetic_energy(&y), dynamics.potential_energy(&y));
    let info = allocation_counter::measure(|| _ = std::hint::black_box(energies()));
    assert_eq!(info.count_total, 0, "the energies of a frame allocate: {info:?}");
    // The counter counts.
    let info = allocation_counter::measure(|| drop(std::hint::black_box(vec![0u8; 100])));
    assert_eq!(info.count_total, 1);
    assert!((dynamics.ghosts() > 0) == (ranks > 1) && dynamics.small_length() > 0.0);
    assert!((dynamics.dissipation() != [0.0; 2]) == audited, "lost: {:?} W", dynamics.dissipation());
}

/// All variants, between walls, audited and not. Collective.
fn steps_of_all_variants(comm: &dyn Comm) {
    for variant in beds::VARIANTS {
        // The spheres lie against three of five walls.
        let text = include_str!("../configs/bed.toml")
            .replace("min = [0.0, 0.0, 0.0]", "min = [-0.1, -0.1, -0.1]")
            .replace("max = [1.0, 1.0, inf]", "max = [9.0, 9.0, inf]");
        let walled = Scene::parse("bed", &text, &[]).expect("the scene is valid");
        assert_eq!(walls(&walled.container).len(), 5);
        let scene = Scene { container: walled.container, ..scene(variant) };
        for audited in [false, true] {
            count_allocations(simulation_on(comm, &scene, &bed(500)), audited, comm.size());
        }
    }
}

#[test]
fn a_step_allocates_nothing() {
    steps_of_all_variants(&Solo);
}

/// Set for the ranks of `a_step_on_two_or_three_ranks_allocates_nothing`, which are this program again.
const RANK: &str = "DEMHYBRID_TEST_IS_A_RANK";

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "a build without MPI has one rank")]
fn a_step_on_two_or_three_ranks_allocates_nothing() {
    let name = "a_step_on_two_or_three_ranks_allocates_nothing";
    if std::env::var_os(RANK).is_some() {
        let session = world::start().expect("MPI starts");
        assert!(session.world.size() > 1);
        steps_of_all_variants(&session.world);
        return;
    }
    for ranks in ["2", "3"] {
        let program = std::env::current_exe().expect("a test has a program");
        let mut job = Command::new("timeout");
        job.args(["90", "mpirun", "-n", ranks]).arg(program).args(["--exact", name, "--nocapture"]);
        let ended = job.envs(mpirun::OPEN_MPI).env(RANK, "1").output().expect("mpirun starts");
        let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(ended.status.success(), "{}{}", said(&ended.stdout), said(&ended.stderr));
        assert_eq!(said(&ended.stdout).matches("1 passed").count().to_string(), ranks);
    }
}
