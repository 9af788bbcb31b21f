//! Runs a hard case and judges it: the stated outcome and nothing else, within what physics allows.

use super::scene::{Case, Outcome};
use demhybrid::cli::report::{self, Monitor};
use demhybrid::domain::Comm;
use demhybrid::engine::simulation::{Counts, Frame, FrameSummary, Simulation, tolerance};
use demhybrid::error::Error;
use demhybrid::model::columns::{position, spin, velocity};
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::{self, InitialCondition};
use std::time::Instant;

/// Energy may rise from one frame to a later one by this share of the tolerance, as a share of the largest
/// kinetic energy (or of m v^2 at the velocity scale v, if that is more): 1 % at the default tolerance of
/// 0.1. A step may be wrong by the tolerance times v in velocity, so that its energy may be wrong by the
/// tolerance times m v^2; the tenth was measured.
const ENERGY_PER_TOLERANCE: f64 = 0.1;
/// The same for methods that one must ask for; Dormand-Prince lets contacts at rest shiver within the
/// tolerance.
const ENERGY_OF_OTHERS: f64 = 0.5;
/// The share for a fixed step, which has no tolerance.
const ENERGY_OF_VERLET: f64 = 1e-3;
/// A bed has settled when a particle has less than this share of m g r (of F_0/kappa without gravity) as
/// kinetic energy.
const AT_REST: f64 = 1e-3;
/// Seconds that a run may take, so that one whose steps never end fails. It must not be reached by three ranks
/// that wait for each other on two busy cores: they take a hundred times what one takes alone.
const PATIENCE: f64 = 600.0;

/// What a run told.
#[derive(Debug)]
pub struct Tale {
    pub result: Result<Counts, Error>,
    pub warnings: Vec<String>,
    pub course: FrameSummary,
    /// The largest overlap of any frame, m.
    pub overlap: f64,
    /// A number that depends on every bit of every frame, and not on who computed it.
    pub digest: u64,
    pub finite: bool,
    /// Largest distance of a particle from where it started, m.
    pub moved: f64,
    pub seconds: f64,
}

/// Runs the case with `method`. Collective.
pub fn run(case: &Case, method: &str, comm: &dyn Comm) -> Tale {
    let clock = Instant::now();
    let mut tale = match case.set_up(method) {
        Ok((scene, start)) => run_scene(&scene, &start, comm),
        Err(why) => Tale::broken(why),
    };
    tale.seconds = clock.elapsed().as_secs_f64();
    tale
}

/// Runs a scene. Collective.
pub fn run_scene(scene: &Scene, start: &InitialCondition, comm: &dyn Comm) -> Tale {
    let mut tale = Tale::broken(Error::Elsewhere { code: 70 });
    tale.warnings = report::forewarnings(scene, start);
    let simulation = match Simulation::new(scene, start, comm) {
        Ok(simulation) => simulation,
        Err(why) => return Tale { result: Err(why), ..tale },
    };
    let mut monitor = Monitor::new(scene, start);
    let result = simulation.run(&mut |frame: &Frame| {
        tale.course.follow(frame);
        monitor.follow(frame);
        tale.look(frame, start, comm);
        Ok(())
    });
    tale.result = result.map(|outcome| {
        tale.warnings.extend(report::doubts(comm, scene, start, &outcome, &tale.course, &monitor));
        tale.overlap = outcome.largest_overlap.length;
        outcome.counts
    });
    tale
}

impl Tale {
    fn broken(why: Error) -> Self {
        Tale {
            result: Err(why),
            warnings: vec![],
            course: FrameSummary::default(),
            overlap: 0.0,
            digest: 0,
            finite: true,
            moved: 0.0,
            seconds: 0.0,
        }
    }

    /// A frame was made. Collective.
    fn look(&mut self, frame: &Frame, start: &InitialCondition, comm: &dyn Comm) {
        let rows = frame.rows.map(|row| [position(row), velocity(row), spin(row)]);
        let mut moved = [0.0f64];
        let mut sums = [0u64, 0];
        for (id, row) in (frame.first..).zip(&rows) {
            let from = row[0] - demhybrid::math::vector::Vec3::from(start.x[id as usize]);
            moved[0] = moved[0].max(from.norm());
            let numbers = row.iter().flat_map(|vector| vector.iter());
            sums[1] += numbers.clone().filter(|number| !number.is_finite()).count() as u64;
            // A hash a particle; a sum does not ask who adds.
            let mix =
                |hash: u64, bits: u64| (hash ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
            sums[0] =
                sums[0].wrapping_add(numbers.fold(mix(id, 1), |hash, number| mix(hash, number.to_bits())));
        }
        comm.max(&mut moved);
        comm.sum(&mut sums);
        self.moved = moved[0];
        self.finite &= sums[1] == 0 && frame.kinetic_energy.is_finite() && frame.potential_energy.is_finite();
        self.digest = self.digest.rotate_left(7) ^ sums[0];
    }

    /// The energy that rose, as a share of the largest kinetic energy or of what the velocity scale makes.
    pub fn rise(&self, scene: &Scene, start: &InitialCondition) -> f64 {
        let least = scene.particles.mass * initial_condition::velocity_scale(scene, start).powi(2);
        self.course.largest_rise / self.course.largest_kinetic_energy.max(least)
    }
}

/// All that is wrong with what the run told.
pub fn faults(case: &Case, method: &str, tale: &Tale) -> Vec<String> {
    let mut faults = Vec::new();
    let mut hold = |right: bool, wrong: String| {
        if !right {
            faults.push(format!("{} with {method}: {wrong}", case.name));
        }
    };
    hold(tale.seconds < PATIENCE, format!("took {:.0} s", tale.seconds));
    let counts = match (&tale.result, &case.outcome) {
        (Err(why), Outcome::Exit(code, text)) => {
            let right = why.exit_code() == *code && why.to_string().contains(text.as_str());
            hold(right, format!("exit {} instead of {code} {text}: {why}", why.exit_code()));
            return faults;
        }
        (Err(why), _) => {
            hold(false, format!("ended early: {why}"));
            return faults;
        }
        (Ok(_), Outcome::Exit(code, text)) => {
            hold(false, format!("reached its end instead of exit {code} {text}"));
            return faults;
        }
        (Ok(counts), _) => counts,
    };
    let (scene, start) = case.set_up(method).expect("it ran");
    hold(tale.finite, "a number is not finite".into());
    let mut named: Vec<&str> = case.and_warns.iter().map(String::as_str).collect();
    if let Outcome::Warns(text) = &case.outcome {
        named.push(text);
    }
    for text in &named {
        hold(
            tale.warnings.iter().any(|w| w.contains(text)),
            format!("no warning {text:?}: {:?}", tale.warnings),
        );
    }
    named.extend(case.may_warn.iter().map(String::as_str));
    if method != "auto" {
        named.push("energy was created");
    }
    for warning in &tale.warnings {
        hold(named.iter().any(|text| warning.contains(text)), format!("unexpected {warning}"));
    }
    if !case.allows("centres may go beyond walls") {
        hold(!tale.warnings.iter().any(|w| w.contains(" m beyond ")), "a centre went beyond a wall".into());
    }
    let per_tolerance = if method == "auto" { ENERGY_PER_TOLERANCE } else { ENERGY_OF_OTHERS };
    let scale = initial_condition::velocity_scale(&scene, &start);
    let bound = match scene.solver.step {
        Some(_) => ENERGY_OF_VERLET,
        None => per_tolerance * tolerance(&scene, scale, start.x.len() as u64),
    };
    let rise = tale.rise(&scene, &start);
    let rounding = 1e-12 * tale.course.start_energy.abs();
    if !case.allows("energy may be created") {
        hold(
            rise <= bound || tale.course.largest_rise <= rounding,
            format!("energy rose by {rise:.1e} of the kinetic energy, more than {bound:.1e}"),
        );
    }
    if case.outcome == Outcome::Settles {
        let least = rest_energy(&scene) * start.x.len() as f64;
        let kinetic = tale.course.kinetic_energy;
        hold(kinetic <= least, format!("does not rest: {kinetic:.2e} J, more than {least:.2e} J"));
    }
    if let Some([low, high]) = case.kinetic {
        let kinetic = tale.course.kinetic_energy;
        hold(
            (low..=high).contains(&kinetic),
            format!("kinetic energy {kinetic:e} J is not from {low:e} to {high:e} J"),
        );
    }
    let steps = counts.accepted + counts.rejected + counts.outrun;
    match scene.solver.step {
        Some(step) => hold(
            (counts.accepted as f64 - scene.t_end / step).abs() <= 2.0,
            format!("{} steps of {step} s to {} s", counts.accepted, scene.t_end),
        ),
        None if method == "auto" => {
            hold(steps <= case.most_steps, format!("{steps} steps, more than {}", case.most_steps))
        }
        None => {}
    }
    faults
}

/// Kinetic energy that a particle of a settled bed may have, J.
fn rest_energy(scene: &Scene) -> f64 {
    let g = scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let fall = scene.particles.mass * g * scene.particles.radius;
    AT_REST
        * if g > 0.0 { fall } else { scene.contact.repulsion_at_contact / scene.contact.stiffness_exponent }
}

/// A line of the table.
pub fn line(case: &Case, method: &str, tale: &Tale) -> String {
    let head = format!("{:22} {method:16}", case.name);
    match &tale.result {
        Err(why) => format!("{head} exit {} after {:.1} s: {why}", why.exit_code(), tale.seconds),
        Ok(counts) => {
            let (scene, start) = case.set_up(method).expect("it ran");
            format!(
                "{head} {:>8} steps {:>6} rejected {:>4} forced {:>9} rhs; kinetic {:8.1e} J at the end, {:8.1e} J at most; \
                 rise {:8.1e} J, {:7.1e}; overlap {:6.2e} r; moved {:.2e} m; {:5.2} s{}",
                counts.accepted,
                counts.rejected + counts.outrun,
                counts.forced,
                counts.rhs,
                tale.course.kinetic_energy,
                tale.course.largest_kinetic_energy,
                tale.course.largest_rise,
                tale.rise(&scene, &start),
                tale.overlap / scene.particles.radius,
                tale.moved,
                tale.seconds,
                tale.warnings.iter().map(|w| format!("\n    {w}")).collect::<String>()
            )
        }
    }
}

/// Runs all `cases` with `method`, prints what happened, and fails with everything that is wrong.
pub fn all_are_right(cases: &[Case], method: &str, comm: &dyn Comm) {
    let mut wrong = Vec::new();
    for case in cases.iter().filter(|case| case.is_for(method)) {
        let tale = run(case, method, comm);
        println!("{}", line(case, method, &tale));
        wrong.extend(faults(case, method, &tale));
    }
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}
