//! The solvers that are compared, and how a scene is told to use one.

use super::records::{Solver, Study};
use crate::cli::AccuracyArgs;
use crate::scene::{PAPER_NORM, Scene};
use crate::start::{Start, velocity_scale};

/// The methods that `--methods` knows.
pub const METHODS: [&str; 5] = ["auto", "chebyshev", "merson", "dormand-prince", VELOCITY_VERLET];
const VELOCITY_VERLET: &str = "velocity-verlet";
/// The name of the published solver in tables and figures.
pub const PAPER: &str = "paper";

/// Tolerances by decades from 1e-1.
const TOLERANCES: [f64; 8] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Of them, those that a method of order two is asked for.
const SECOND_ORDER: usize = 6;
/// Of them, those that decide how far statistics move.
const STATISTICAL: usize = 4;
/// Fixed steps, in swings or impacts.
const STEPS: [f64; 5] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];

/// A method with error control.
pub fn adaptive(method: &str, tolerance: f64) -> Solver {
    Solver { method: method.to_owned(), tolerance: Some(tolerance), step: None }
}

/// The published solver.
fn paper() -> Solver {
    adaptive(PAPER, 0.1)
}

/// The solvers for the given study of `scene`, method by method, each from loose to tight.
pub fn solvers(args: &AccuracyArgs, study: Study, scene: &Scene, start: &Start) -> Vec<Solver> {
    let ensemble = study == Study::Ensemble;
    let methods: Vec<&str> = match (args.methods.is_empty(), ensemble) {
        (false, _) => args.methods.iter().map(String::as_str).collect(),
        (true, true) => vec!["auto", "chebyshev"],
        (true, false) => METHODS.to_vec(),
    };
    let mut chosen = Vec::new();
    for method in methods {
        if method == VELOCITY_VERLET {
            let steps = if args.steps.is_empty() { default_steps(scene, start) } else { args.steps.clone() };
            let fixed = |step| Solver { method: method.to_owned(), tolerance: None, step: Some(step) };
            chosen.extend(descending(steps).into_iter().map(fixed));
            continue;
        }
        let count = match method {
            _ if ensemble => STATISTICAL,
            "chebyshev" => SECOND_ORDER,
            _ => TOLERANCES.len(),
        };
        let tolerances =
            if args.tolerances.is_empty() { TOLERANCES[..count].to_vec() } else { args.tolerances.clone() };
        chosen.extend(descending(tolerances).into_iter().map(|tolerance| adaptive(method, tolerance)));
    }
    if args.paper {
        chosen.push(paper());
    }
    chosen
}

/// Each number once, the largest first.
fn descending(mut numbers: Vec<f64>) -> Vec<f64> {
    numbers.sort_by(|a, b| b.total_cmp(a));
    numbers.dedup();
    numbers
}

/// Steps of velocity-verlet where the user names none, s: shares of the time in which a sphere at rest on a floor swings
/// by one radian, 1/sqrt(kappa g), or without gravity of the time of an impact, 1/(kappa V). Two digits are enough.
fn default_steps(scene: &Scene, start: &Start) -> Vec<f64> {
    let kappa = scene.contact.stiffness_exponent;
    let g = gravity(scene);
    let time =
        if g > 0.0 { (kappa * g).sqrt().recip() } else { (kappa * velocity_scale(scene, start)).recip() };
    STEPS.map(|share| rounded(share * time)).to_vec()
}

/// Two digits of a number.
fn rounded(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

/// Size of the gravity, m/s^2.
pub fn gravity(scene: &Scene) -> f64 {
    scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt()
}

/// `scene` with this solver.
pub fn with_solver(scene: &Scene, solver: &Solver) -> Scene {
    let mut scene = scene.clone();
    let published = solver.method == PAPER;
    scene.solver.method = if published { "merson".to_owned() } else { solver.method.clone() };
    scene.solver.norm = if published { PAPER_NORM.to_owned() } else { "scaled".to_owned() };
    (scene.solver.tolerance, scene.solver.step) = (solver.tolerance, solver.step);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::testing::{args, scene};

    #[test]
    fn a_study_has_the_tolerances_that_fit_it_unless_the_user_has_others() {
        let (scene, start) = scene();
        let labels = |line: &str, study| -> Vec<String> {
            solvers(&args(line), study, &scene, &start).iter().map(Solver::label).collect()
        };
        let all = labels("", Study::State);
        assert_eq!(all.len(), 8 + 6 + 8 + 8 + 5);
        // 1/sqrt(150 * 9.81) s = 26 ms.
        assert_eq!(all.last().map(String::as_str), Some("velocity-verlet 2.6e-6 s"));
        assert_eq!(labels("", Study::Ensemble).len(), 8);
        assert_eq!(
            labels(
                "--methods merson,velocity-verlet --tolerances 1e-2,1e-1,1e-2 --steps 1e-5 --paper",
                Study::Impact
            ),
            ["merson 1e-1", "merson 1e-2", "velocity-verlet 1e-5 s", "paper 1e-1"]
        );
    }

    #[test]
    fn a_scene_is_told_what_the_solver_is() {
        let (scene, _) = scene();
        let published = with_solver(&scene, &paper());
        assert_eq!((published.solver.method.as_str(), published.solver.norm.as_str()), ("merson", "paper"));
        let verlet = Solver { method: VELOCITY_VERLET.to_owned(), tolerance: None, step: Some(1e-5) };
        let verlet = with_solver(&scene, &verlet);
        assert_eq!((verlet.solver.tolerance, verlet.solver.step), (None, Some(1e-5)));
        assert_eq!(verlet.solver.norm, "scaled");
    }
}
