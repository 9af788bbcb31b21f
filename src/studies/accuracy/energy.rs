//! The study `energy`: how far the energy of a run deviates from what forces and dissipation allow.

use super::findings::{Findings, measures};
use super::records::{Measure, Record, Solver, Study};
use super::solvers::{adaptive, with_solver};
use crate::beds::plot::Line;
use crate::math::digits::short;
use crate::ode::MethodName;
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::studies::job_pool::run::{FrameData, run, work_limit};
use crate::studies::job_pool::{JobPool, Sample};

/// Number of frames in which deviations are measured.
const FRAMES: f64 = 200.0;
/// Numbers of a frame in a sample: time, kinetic, potential, dissipated by rebound, dissipated by friction.
const WIDTH: usize = 5;

/// The energies of one run over time.
#[derive(Debug, Clone, Default)]
pub struct Energies {
    /// Lines of a figure: energy (J) over time (s).
    pub lines: Vec<Line>,
}

/// The measure for this scene: drift or balance.
pub fn measure(scene: &Scene) -> Measure {
    if !scene.dissipates() && !scene.rubs() { Measure::EnergyDrift } else { Measure::EnergyBalance }
}

/// Measures the energy until t = `time` (s) for every solver. Collective.
///
/// Also returns the energies of one accurate run, for the figure.
pub fn study(
    pool: &JobPool,
    scene: &Scene,
    (seed, start): (Option<u64>, &InitialCondition),
    solvers: &[Solver],
    time: f64,
) -> (Findings, Energies) {
    let mut scene = scene.clone();
    (scene.t_end, scene.output.interval, scene.output.energy) = (time, Some(time / FRAMES), true);
    let shown = adaptive(MethodName::DormandPrince, 1e-8);
    let jobs: Vec<&Solver> = [&shown].into_iter().chain(solvers).collect();
    let samples = pool.run("energy", &jobs, |solver| {
        let mut numbers = Vec::new();
        let sample = run(&with_solver(&scene, solver), start, work_limit(start.x.len()), |frame| {
            numbers.extend(energies(frame));
        });
        Sample { numbers, ..sample }
    });
    let measure = measure(&scene);
    let record = |(solver, sample): (&&Solver, &Sample)| Record {
        study: Study::Energy,
        variation: None,
        solver: (*solver).clone(),
        seed,
        work: sample.work,
        measures: measures([(measure, deviation(&sample.numbers, measure == Measure::EnergyBalance))]),
        failure: sample.failure.clone(),
    };
    let records = jobs.iter().zip(&samples).skip(1).map(record).collect();
    let what = if measure == Measure::EnergyDrift {
        "nothing is lost in this scene: the drift is the largest change of the energy"
    } else {
        "the balance is the largest energy that is neither there nor lost by rebound or friction"
    };
    let notes = vec![format!(
        "energy: {what}, over the largest kinetic energy, in {FRAMES} frames up to t = {} s",
        short(time)
    )];
    (Findings { records, notes, ..Findings::default() }, Energies { lines: lines(&samples[0].numbers) })
}

fn energies(frame: &FrameData) -> [f64; WIDTH] {
    let [rebound, friction] = frame.dissipated;
    [frame.time, frame.kinetic_energy, frame.potential_energy, rebound, friction]
}

/// Largest deviation of the energy from its first value, divided by the largest kinetic energy.
///
/// If `balance`, the dissipated energy is added to the energy. NaN if nothing moves.
fn deviation(numbers: &[f64], balance: bool) -> f64 {
    let total = |frame: &[f64]| {
        let dissipated = if balance { frame[3] + frame[4] } else { 0.0 };
        frame[1] + frame[2] + dissipated
    };
    let frames = || numbers.chunks_exact(WIDTH);
    let first = frames().next().map_or(f64::NAN, total);
    let largest = frames().map(|frame| (total(frame) - first).abs()).fold(0.0, f64::max);
    let kinetic = frames().map(|frame| frame[1]).fold(0.0, f64::max);
    if kinetic > 0.0 { largest / kinetic } else { f64::NAN }
}

/// Lines of all energies that are not zero throughout. The potential energy counts from its first value.
fn lines(numbers: &[f64]) -> Vec<Line> {
    let first = numbers.get(2).copied().unwrap_or(0.0);
    let line = |name: &str, of: fn(&[f64], f64) -> f64| Line {
        name: name.to_owned(),
        points: numbers.chunks_exact(WIDTH).map(|frame| (frame[0], of(frame, first))).collect(),
    };
    let all = vec![
        line("kinetic", |frame, _| frame[1]),
        line("potential, from the start", |frame, first| frame[2] - first),
        line("lost on rebound", |frame, _| frame[3]),
        line("lost by friction", |frame, _| frame[4]),
        line("sum", |frame, first| frame[1] + frame[2] - first + frame[3] + frame[4]),
    ];
    all.into_iter().filter(|line| line.points.iter().any(|&(_, energy)| energy != 0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;
    use crate::studies::accuracy::testing::scene;

    const POOL: JobPool = JobPool { comm: &Solo, threads: 1, quiet: true };

    #[test]
    fn the_balance_of_a_lossy_scene_closes_with_the_tolerance() {
        let (scene, start) = scene();
        let solvers = [adaptive(MethodName::DormandPrince, 1e-3), adaptive(MethodName::DormandPrince, 1e-7)];
        let (found, energies) = study(&POOL, &scene, (Some(1), &start), &solvers, 0.5);
        let balance = |k: usize| found.records[k].measures[&Measure::EnergyBalance];
        assert!(balance(1) < 1e-5 && balance(1) < balance(0), "{:?}", found.records);
        let names: Vec<&str> = energies.lines.iter().map(|line| line.name.as_str()).collect();
        assert_eq!(names, ["kinetic", "potential, from the start", "lost on rebound", "sum"]);
    }

    #[test]
    fn an_elastic_scene_without_friction_has_a_drift() {
        let (mut scene, start) = scene();
        scene.contact.restitution = 1.0;
        let solvers = [adaptive(MethodName::DormandPrince, 1e-7)];
        let (found, _) = study(&POOL, &scene, (None, &start), &solvers, 0.4);
        assert!(found.records[0].measures[&Measure::EnergyDrift] < 1e-4, "{:?}", found.records);
        assert!(found.notes[0].contains("nothing is lost"));
    }
}
