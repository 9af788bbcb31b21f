//! The reference for the comparison of states, its own error, and the time up to which states are comparable.

use super::solvers::{adaptive, gravity, with_solver};
use crate::math::vector::Vec3;
use crate::ode::MethodName;
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::studies::job_pool::run::{FrameData, run, work_limit};
use crate::studies::job_pool::{JobPool, Sample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The method of the reference.
const METHOD: MethodName = MethodName::DormandPrince;
/// Tolerances of the reference, most accurate first.
///
/// Two neighbours form a pair: the second shows the error of the first. If a pair fails, the next serves.
const TOLERANCES: [f64; 4] = [1e-10, 1e-9, 1e-8, 1e-7];
/// A reference may take this many times the work of other runs.
const PATIENCE: u64 = 3;
/// Shift of each sphere of the twin, in radii.
const SHIFT: f64 = 1e-9;
/// Trajectories have separated once the shift has grown by this factor.
const PARTED: f64 = 1000.0;
/// Number of frames in the search for the time of separation.
const FRAMES: usize = 100;
/// Number of frames in a run whose end alone matters. At each of them the work is compared with its limit.
///
/// There are few, because a frame between two steps costs some methods right-hand sides.
const END_FRAMES: f64 = 10.0;
/// The search ends at this time, s, or at 1.5 times the time of the longest fall if that is later.
const SEARCH: f64 = 1.0;

/// Distance between the reference and its shifted twin over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Separation {
    /// Times (s), with the largest distance of a particle from its twin (m).
    pub points: Vec<(f64, f64)>,
}

impl Separation {
    /// First time at which the distance has grown more than 1000-fold, s; `None` if it never does.
    pub fn decorrelation_time(&self) -> Option<f64> {
        let first = self.points.first()?.1;
        self.points.iter().find(|(_, distance)| *distance > PARTED * first).map(|&(time, _)| time)
    }

    /// Last time before `decorrelation_time`, s, but never the time of the first frame.
    ///
    /// `None` if there is no second frame.
    pub fn comparison_time(&self) -> Option<f64> {
        let parted = self.decorrelation_time().unwrap_or(f64::INFINITY);
        let before = self.points.iter().skip(1).map(|&(time, _)| time).take_while(|&time| time < parted);
        before.last().or(self.points.get(1).map(|&(time, _)| time))
    }
}

/// End of the search for the time of separation, s.
///
/// It is 1 s, or 1.5 times the time of a fall by `fall` (m) if that is longer. It is never beyond the end of
/// the scene.
pub fn horizon(scene: &Scene, fall: Option<f64>) -> f64 {
    let g = gravity(scene);
    let falling = fall.filter(|_| g > 0.0).map_or(0.0, |height| (2.0 * height / g).sqrt());
    scene.t_end.min(SEARCH.max(1.5 * falling))
}

/// Runs the reference and its twin until `horizon` (s) and compares them. Collective.
///
/// The second value is the reason if one of the two runs failed.
pub fn separation(
    pool: &JobPool,
    scene: &Scene,
    start: &InitialCondition,
    horizon: f64,
) -> (Separation, Option<String>) {
    let mut scene = with_solver(scene, &adaptive(METHOD, TOLERANCES[0]));
    (scene.t_end, scene.output.interval) = (horizon, Some(horizon / FRAMES as f64));
    scene.output.energy = false;
    let starts = [start.clone(), shifted(start, SHIFT * scene.particles.radius)];
    let samples = pool.run("reference and its twin", &starts, |start| {
        let mut numbers = Vec::new();
        let limit = PATIENCE * work_limit(start.x.len());
        let sample = run(&scene, start, limit, |frame| {
            numbers.push(frame.time);
            numbers.extend(frame.x.iter().flatten());
        });
        Sample { numbers, ..sample }
    });
    let width = 1 + 3 * start.x.len();
    let frames = samples[0].numbers.chunks_exact(width).zip(samples[1].numbers.chunks_exact(width));
    let points = frames.map(|(a, b)| (a[0], largest_distance(&a[1..], &b[1..]))).collect();
    (Separation { points }, samples.into_iter().find_map(|sample| sample.failure))
}

/// Moves every particle by `length` (m) in its own random direction.
///
/// The directions are the same on every rank and in every run.
fn shifted(start: &InitialCondition, length: f64) -> InitialCondition {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut shifted = start.clone();
    for x in &mut shifted.x {
        let direction = loop {
            let d = Vec3::from_fn(|_, _| 2.0 * random.random::<f64>() - 1.0);
            if (0.01..=1.0).contains(&d.norm()) {
                break d.normalize();
            }
        };
        *x = (Vec3::from(*x) + direction * length).into();
    }
    shifted
}

/// Largest distance between points with the same index in two lists of coordinates.
fn largest_distance(a: &[f64], b: &[f64]) -> f64 {
    let distance = |(a, b): (&[f64], &[f64])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    a.chunks_exact(3).zip(b.chunks_exact(3)).map(distance).fold(0.0, larger)
}

/// The larger of both, or infinity if `b` is NaN.
fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Largest differences of any particle between two states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Of positions, m.
    pub x: f64,
    /// Of velocities, m/s.
    pub v: f64,
    /// Of angular velocities, rad/s.
    pub omega: f64,
}

/// The frame as a list of numbers: all positions, then all velocities, then all angular velocities.
pub fn state(frame: &FrameData) -> Vec<f64> {
    frame.x.iter().chain(&frame.v).chain(&frame.omega).flatten().copied().collect()
}

/// Largest differences between two states.
pub fn difference(a: &[f64], b: &[f64]) -> Difference {
    let third = a.len() / 3;
    let part = |k: usize| largest_distance(&a[k * third..(k + 1) * third], &b[k * third..(k + 1) * third]);
    Difference { x: part(0), v: part(1), omega: part(2) }
}

/// Reference states for every initial state, and their errors.
#[derive(Debug, Clone)]
pub struct Reference {
    /// Tolerance of the reference.
    pub tolerance: f64,
    /// Reference state, by initial state.
    pub states: Vec<Vec<f64>>,
    /// Largest differences between this reference and the one with ten times the tolerance, by initial state.
    pub errors: Vec<Difference>,
    /// Right-hand sides of all runs, failed ones included.
    pub rhs_evaluations: u64,
}

/// Computes the most accurate states possible at t = `time` (s), or says why that failed. Collective.
pub fn reference(
    pool: &JobPool,
    scene: &Scene,
    starts: &[InitialCondition],
    time: f64,
) -> Result<Reference, String> {
    let mut why = String::new();
    let mut spent = 0;
    for pair in TOLERANCES.windows(2) {
        let jobs: Vec<(f64, &InitialCondition)> =
            starts.iter().flat_map(|start| pair.iter().map(move |&tolerance| (tolerance, start))).collect();
        let what = format!("reference, {METHOD} at tolerances {:e} and {:e}", pair[0], pair[1]);
        let limit = PATIENCE * work_limit(starts[0].x.len());
        let samples = pool.run(&what, &jobs, |&(tolerance, start)| {
            end_state(&with_solver(scene, &adaptive(METHOD, tolerance)), start, time, limit)
        });
        spent += samples.iter().map(|sample| sample.work.rhs_evaluations).sum::<u64>();
        if let Some(failure) = samples.iter().find_map(|sample| sample.failure.clone()) {
            why = failure;
            continue;
        }
        let errors =
            samples.chunks_exact(2).map(|pair| difference(&pair[0].numbers, &pair[1].numbers)).collect();
        let states = samples.into_iter().step_by(2).map(|sample| sample.numbers).collect();
        return Ok(Reference { tolerance: pair[0], states, errors, rhs_evaluations: spent });
    }
    Err(why)
}

/// Runs the scene with its solver to `time` (s).
///
/// The numbers of the sample are the state at that time. They are empty after a failure.
pub fn end_state(scene: &Scene, start: &InitialCondition, time: f64, limit: u64) -> Sample {
    let mut scene = scene.clone();
    (scene.t_end, scene.output.interval) = (time, Some(time / END_FRAMES));
    scene.output.energy = false;
    let mut end = Vec::new();
    let sample = run(&scene, start, limit, |frame| {
        if frame.time >= time {
            end = state(frame);
        }
    });
    Sample { numbers: end, ..sample }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::accuracy::testing::scene;

    fn grown(growth: &[f64]) -> Separation {
        Separation { points: growth.iter().enumerate().map(|(k, g)| (k as f64, 1e-10 * g)).collect() }
    }

    #[test]
    fn states_are_compared_before_the_separation_has_grown_a_thousandfold() {
        let parting = grown(&[1.0, 2.0, 999.0, 1001.0, 500.0, 1e6]);
        assert_eq!((parting.decorrelation_time(), parting.comparison_time()), (Some(3.0), Some(2.0)));
        let calm = grown(&[1.0, 2.0, 3.0]);
        assert_eq!((calm.decorrelation_time(), calm.comparison_time()), (None, Some(2.0)));
        // States are never compared at the start, so this case takes the second frame.
        let sudden = grown(&[1.0, 1e4]);
        assert_eq!((sudden.decorrelation_time(), sudden.comparison_time()), (Some(1.0), Some(1.0)));
        assert_eq!(grown(&[1.0]).comparison_time(), None);
    }

    #[test]
    fn the_search_ends_after_the_longest_fall_or_with_the_scene() {
        let (mut scene, _) = scene();
        assert_eq!(horizon(&scene, Some(0.5)), 1.0);
        scene.t_end = 8.0;
        assert_eq!(horizon(&scene, None), 1.0);
        let long = horizon(&scene, Some(16.0));
        assert!((long - 1.5 * (32.0f64 / 9.81).sqrt()).abs() < 1e-12, "{long}");
    }

    #[test]
    fn a_twin_is_shifted_everywhere_by_the_same_length() {
        let (_, start) = scene();
        let twin = shifted(&start, 1e-3);
        assert_eq!(twin, shifted(&start, 1e-3));
        for (a, b) in start.x.iter().zip(&twin.x) {
            assert!((largest_distance(a, b) - 1e-3).abs() < 1e-15);
        }
    }

    #[test]
    fn states_differ_by_their_largest_parts() {
        let frame = |s: f64| FrameData {
            x: vec![Vec3::zeros(), Vec3::repeat(s)],
            v: vec![Vec3::x() * s; 2],
            omega: vec![Vec3::zeros(); 2],
            ..FrameData::default()
        };
        let found = difference(&state(&frame(0.0)), &state(&frame(2.0)));
        assert_eq!(found, Difference { x: 12f64.sqrt(), v: 2.0, omega: 0.0 });
        assert_eq!(difference(&state(&frame(0.0)), &state(&frame(f64::NAN))).v, f64::INFINITY);
    }
}
