//! The study `impact`: one sphere hits a floor. It falls under gravity, and it is thrown without gravity.
//!
//! Both motions have exact solutions.

use super::exact::Impact;
use super::findings::{Findings, measures};
use super::records::{Measure, Record, Solver, Study};
use super::solvers::{gravity, with_solver};
use crate::math::digits::short;
use crate::math::vector::Vec3;
use crate::scene::initial_condition::{InitialCondition, velocity_scale};
use crate::scene::{Container, Scene, WallPlane};
use crate::studies::job_pool::run::{run, work_limit};
use crate::studies::job_pool::{JobPool, Sample};

/// Number of frames in each of the two runs. At each frame the work is compared with its limit.
///
/// There are few, because a frame between two steps costs some methods right-hand sides.
const FRAMES: f64 = 4.0;
/// Height of the fall, m, if the scene does not determine one.
const HEIGHT: f64 = 1.0;

/// The impact of a sphere of a scene, and its exact solutions.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Gap at the release, m.
    pub height: f64,
    /// Gravity, m/s^2.
    pub g: f64,
    /// Speed of the throw without gravity, m/s.
    ///
    /// It is the speed of the fall at the interaction distance from the floor. If there is no fall, it is the
    /// velocity scale of the scene.
    speed: f64,
    law: Impact,
    /// Exact time to the next highest point, s; `None` without gravity, or if the sphere creeps to rest.
    pub rebound_time: Option<f64>,
    /// Exact speed of separation divided by speed of approach in the throw.
    pub restitution: f64,
    /// Exact time within the interaction distance of the floor in the throw, s.
    contact_time: f64,
    scene: Scene,
}

impl Setup {
    /// The fall of one sphere without friction, from the highest initial centre of the scene onto a floor.
    pub fn of(scene: &Scene, start: &InitialCondition) -> Setup {
        let (r, g) = (scene.particles.radius, gravity(scene));
        let contact = &scene.contact;
        let law = Impact {
            mass: scene.particles.mass,
            f_0: contact.repulsion_at_contact,
            kappa: contact.stiffness_exponent,
            e: contact.restitution,
            psi: contact.dissipation_focusing,
            l_max: contact.interaction_distance,
        };
        let height = fall_height(scene, start).map_or(HEIGHT, |centre| centre - r);
        let height = if height > 0.0 { height } else { HEIGHT };
        let scale = velocity_scale(scene, start);
        let fall = (2.0 * g * (height - law.l_max).max(0.0)).sqrt();
        let speed = if fall > 0.0 { fall } else { scale };
        let rebound_time = Some(law.rebound_time(height, g)).filter(|time| g > 0.0 && time.is_finite());
        let mut alone = scene.clone();
        alone.friction = None;
        // Of a sphere without a material.
        alone.material.clear();
        alone.container = Container { r#box: None, wall: vec![WallPlane::default()] };
        alone.gravity = [0.0, 0.0, -g];
        alone.output.energy = false;
        // Errors then have the same weight as in the scene itself.
        alone.solver.velocity_scale = Some(scale);
        Setup {
            height,
            g,
            speed,
            law,
            rebound_time,
            restitution: law.restitution(speed),
            contact_time: law.contact_time(speed, law.l_max).0,
            scene: alone,
        }
    }

    /// Simulates the throw and the fall with `solver`.
    ///
    /// The numbers are the restitution, the contact time (s) and, if the fall has one, the time to the next
    /// highest point (s).
    pub fn simulate(&self, solver: &Solver) -> Sample {
        let scene = with_solver(&self.scene, solver);
        let mut sample = self.throw(scene.clone());
        if let (Some(time), None) = (self.rebound_time, &sample.failure) {
            let fall = self.fall(scene, time);
            let (work, more) = (&mut sample.work, fall.work);
            work.rhs_evaluations += more.rhs_evaluations;
            work.pair_evaluations += more.pair_evaluations;
            work.steps_accepted += more.steps_accepted;
            work.steps_rejected += more.steps_rejected;
            sample.failure = fall.failure;
            sample.numbers.extend(fall.numbers);
        }
        sample
    }

    /// The throw without gravity. Its numbers are the restitution and the contact time (s).
    ///
    /// The sphere starts one `l_max` outside the interaction distance. The run ends once the exact solution
    /// is as far away again.
    fn throw(&self, mut scene: Scene) -> Sample {
        let cutoff = self.law.l_max;
        scene.gravity = [0.0; 3];
        let out = self.restitution * self.speed;
        scene.t_end = cutoff / self.speed + self.contact_time + cutoff / out;
        let (mut sample, gap, v) = self.end(scene, 2.0 * cutoff, -self.speed);
        if sample.failure.is_none() {
            let t_end = cutoff / self.speed + self.contact_time + cutoff / out;
            let contact = t_end - (gap - cutoff) / v - cutoff / self.speed;
            sample.numbers = vec![v / self.speed, contact];
        }
        sample
    }

    /// The fall from rest until the exact time of the next highest point.
    ///
    /// Its number is the simulated time of that point (s), from the parabola through the last state.
    fn fall(&self, mut scene: Scene, time: f64) -> Sample {
        scene.t_end = time;
        let (mut sample, gap, v) = self.end(scene, self.height, 0.0);
        if sample.failure.is_none() {
            sample.numbers = vec![time - v / self.law.acceleration(gap, v, self.g)];
        }
        sample
    }

    /// Runs the sphere from the gap `gap` (m) with the rate `v` (m/s).
    ///
    /// Returns the sample, the gap at the end (m) and the rate at the end (m/s).
    fn end(&self, mut scene: Scene, gap: f64, v: f64) -> (Sample, f64, f64) {
        scene.output.interval = Some(scene.t_end / FRAMES);
        let r = scene.particles.radius;
        let start = InitialCondition {
            x: vec![[0.0, 0.0, r + gap]],
            v: vec![[0.0, 0.0, v]],
            omega: vec![[0.0; 3]],
            ..InitialCondition::default()
        };
        let (mut gap, mut v) = (f64::NAN, f64::NAN);
        let sample = run(&scene, &start, work_limit(1), |frame| (gap, v) = (frame.x[0].z - r, frame.v[0].z));
        (sample, gap, v)
    }

    /// The sample as a record, with the errors against the exact solutions.
    pub fn record(&self, solver: &Solver, sample: &Sample) -> Record {
        let (restitution, contact, rebound) = (sample.number(0), sample.number(1), sample.number(2));
        let off = |found: f64, exact: f64| (found / exact - 1.0).abs();
        let measures = measures([
            (Measure::Restitution, restitution),
            (Measure::RestitutionError, off(restitution, self.restitution)),
            (Measure::ContactError, off(contact, self.contact_time)),
            (Measure::ReboundTime, rebound),
            (Measure::ReboundError, self.rebound_time.map_or(f64::NAN, |exact| off(rebound, exact))),
        ]);
        Record {
            study: Study::Impact,
            variation: None,
            solver: solver.clone(),
            seed: None,
            work: sample.work,
            measures,
            failure: sample.failure.clone(),
        }
    }
}

/// Largest distance of an initial centre from a floor, m; `None` if there is no floor.
pub fn fall_height(scene: &Scene, start: &InitialCondition) -> Option<f64> {
    let floors = floors(scene);
    let depths = start.x.iter().flat_map(|x| floors.iter().map(move |floor| floor.depth(&Vec3::from(*x))));
    depths.fold(None, |most: Option<f64>, depth| Some(most.map_or(depth, |most| most.max(depth))))
}

/// The floors: all walls whose outward normal is within 45 degrees of the direction of gravity.
pub fn floors(scene: &Scene) -> Vec<crate::model::wall::Wall> {
    let (down, g) = (Vec3::from(scene.gravity), gravity(scene));
    let below = |wall: &crate::model::wall::Wall| g > 0.0 && wall.normal.dot(&down) > 0.5f64.sqrt() * g;
    crate::scene::walls::walls(&scene.container).into_iter().filter(below).collect()
}

/// Simulates the impact with every solver. Collective.
pub fn study(pool: &JobPool, scene: &Scene, start: &InitialCondition, solvers: &[Solver]) -> Findings {
    let setup = Setup::of(scene, start);
    let samples = pool.run("impact", solvers, |solver| setup.simulate(solver));
    let records = solvers.iter().zip(&samples).map(|(solver, sample)| setup.record(solver, sample)).collect();
    let mut notes = Vec::new();
    let throw = format!(
        "impact: thrown at a floor with {} m/s, a sphere keeps {:.6} of its speed (exact)",
        short(setup.speed),
        setup.restitution
    );
    match setup.rebound_time {
        Some(time) => notes.push(format!(
            "{throw}; dropped from {} m it is highest again after {} s (exact)",
            short(setup.height),
            short(time)
        )),
        None if setup.g > 0.0 => notes.push(format!("{throw}; dropped it does not turn but creeps to rest")),
        None => notes.push(format!("{throw}; without gravity there is no fall")),
    }
    Findings { records, notes, ..Findings::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;
    use crate::ode::MethodName;
    use crate::studies::accuracy::solvers::adaptive;
    use crate::studies::accuracy::testing::scene;

    #[test]
    fn a_tight_solver_finds_the_exact_answers() {
        let (scene, start) = scene();
        let setup = Setup::of(&scene, &start);
        let record = |tolerance| {
            let solver = adaptive(MethodName::DormandPrince, tolerance);
            setup.record(&solver, &setup.simulate(&solver))
        };
        let tight = record(1e-9);
        for measure in [Measure::ReboundError, Measure::RestitutionError, Measure::ContactError] {
            // The tolerance allows for a few hundred steps, each wrong by 1e-9 of its scale.
            assert!(tight.measures[&measure] < 1e-6, "{measure}: {:?}", tight.measures);
            assert!(record(1e-2).measures[&measure] > tight.measures[&measure], "{measure}");
        }
    }

    #[test]
    fn without_gravity_a_sphere_is_thrown_only() {
        let (mut scene, start) = scene();
        scene.gravity = [0.0; 3];
        let pool = JobPool { comm: &Solo, threads: 1, quiet: true };
        let found = study(&pool, &scene, &start, &[adaptive(MethodName::Merson, 1e-6)]);
        assert!(found.records[0].measures[&Measure::RestitutionError] < 1e-4, "{:?}", found.records);
        assert!(!found.records[0].measures.contains_key(&Measure::ReboundTime));
        assert!(found.notes[0].contains("without gravity"), "{:?}", found.notes);
    }

    #[test]
    fn a_sphere_falls_from_where_the_highest_of_the_scene_starts() {
        let (scene, start) = scene();
        let setup = Setup::of(&scene, &start);
        let highest = start.x.iter().map(|x| x[2]).fold(0.0, f64::max);
        assert_eq!(setup.height, highest - 0.1);
        let mut open = scene.clone();
        open.container = Container::default();
        assert_eq!(Setup::of(&open, &start).height, HEIGHT);
    }
}
