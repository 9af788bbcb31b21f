//! The reference that states are compared with, its own error, and the time after which nothing can be compared.

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
/// Tolerances of the reference; the second one of a pair shows the error of the first. A later pair serves where an
/// earlier one fails.
const TOLERANCES: [f64; 4] = [1e-10, 1e-9, 1e-8, 1e-7];
/// A reference may take so many times the work of other runs.
const PATIENCE: u64 = 3;
/// Shift of the twin, radii.
const SHIFT: f64 = 1e-9;
/// Growth of the shift after which trajectories have parted.
const PARTED: f64 = 1000.0;
/// Frames of the search for that time.
const FRAMES: usize = 100;
/// Frames of a run of which the end only is wanted: how often the work is compared with its limit. Few, because a frame
/// between two steps costs some methods right-hand sides.
const END_FRAMES: f64 = 10.0;
/// The search ends after this time, s, or after 1.5 times the longest fall.
const SEARCH: f64 = 1.0;

/// How the reference and its twin move apart.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Separation {
    /// Time (s) and largest distance of a particle from its twin (m).
    pub points: Vec<(f64, f64)>,
}

impl Separation {
    /// The first time at which the distance has grown more than 1000-fold, s.
    pub fn decorrelation_time(&self) -> Option<f64> {
        let first = self.points.first()?.1;
        self.points.iter().find(|(_, distance)| *distance > PARTED * first).map(|&(time, _)| time)
    }

    /// The last time before that, s, but never that of the start; none without any frame.
    pub fn comparison_time(&self) -> Option<f64> {
        let parted = self.decorrelation_time().unwrap_or(f64::INFINITY);
        let before = self.points.iter().skip(1).map(|&(time, _)| time).take_while(|&time| time < parted);
        before.last().or(self.points.get(1).map(|&(time, _)| time))
    }
}

/// How far to look for the time after which trajectories have parted, s: 1 s or, where the scene falls longer than that,
/// half as long again; at most to its end.
pub fn horizon(scene: &Scene, fall: Option<f64>) -> f64 {
    let g = gravity(scene);
    let falling = fall.filter(|_| g > 0.0).map_or(0.0, |height| (2.0 * height / g).sqrt());
    scene.t_end.min(SEARCH.max(1.5 * falling))
}

/// How the reference and its twin part until `horizon` (s), and the reason if one of them ends before. Collective.
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

/// Every particle moved by `length` (m) in a direction of its own, the same on every rank and in every run.
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

/// Largest distance of two points with the same place in two lists of coordinates.
fn largest_distance(a: &[f64], b: &[f64]) -> f64 {
    let distance = |(a, b): (&[f64], &[f64])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    a.chunks_exact(3).zip(b.chunks_exact(3)).map(distance).fold(0.0, larger)
}

/// The larger one, or infinity where one is no number.
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

/// A state as a list of numbers: all positions, then all velocities, then all angular velocities.
pub fn state(frame: &FrameData) -> Vec<f64> {
    frame.x.iter().chain(&frame.v).chain(&frame.omega).flatten().copied().collect()
}

/// How far two states differ.
pub fn difference(a: &[f64], b: &[f64]) -> Difference {
    let third = a.len() / 3;
    let part = |k: usize| largest_distance(&a[k * third..(k + 1) * third], &b[k * third..(k + 1) * third]);
    Difference { x: part(0), v: part(1), omega: part(2) }
}

/// The states at the end of the scene from every start, and their errors.
#[derive(Debug, Clone)]
pub struct Reference {
    /// Tolerance of the reference.
    pub tolerance: f64,
    /// State by start.
    pub states: Vec<Vec<f64>>,
    /// Largest difference to the reference of ten times the tolerance, by start.
    pub errors: Vec<Difference>,
    /// Right-hand sides of all runs that it took.
    pub rhs_evaluations: u64,
}

/// The most accurate states at t = `time` (s) that can be had, or why there are none. Collective.
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

/// Runs the scene with its solver to `time` (s); the numbers are the state there, or nothing after a failure.
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
        // Nothing can be compared at the start, so the first frame has to do.
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
