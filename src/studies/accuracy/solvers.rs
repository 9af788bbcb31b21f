//! The solvers that are compared, and how to put one into a scene.

use super::records::{Solver, Stepper, Study};
use super::request::Request;
use crate::ode::{MethodName, NormName};
use crate::scene::Scene;
use crate::scene::initial_condition::{InitialCondition, velocity_scale};

/// The methods that `--methods` accepts.
pub const METHODS: [MethodName; 5] = [
    MethodName::Auto,
    MethodName::Chebyshev,
    MethodName::Merson,
    MethodName::DormandPrince,
    MethodName::VelocityVerlet,
];

/// Default tolerances, decades from 1e-1 down.
const TOLERANCES: [f64; 8] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// How many of them a method of order two uses.
const SECOND_ORDER: usize = 6;
/// How many of them an ensemble uses.
const STATISTICAL: usize = 4;
/// Default fixed steps, as shares of the time scale of a swing or an impact.
const STEPS: [f64; 5] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];

/// A method with error control.
pub fn adaptive(method: MethodName, tolerance: f64) -> Solver {
    Solver { method: Stepper::Method(method), tolerance: Some(tolerance), step: None }
}

/// The published solver, with the tolerance of the paper.
fn published() -> Solver {
    Solver { method: Stepper::Published, tolerance: Some(0.1), step: None }
}

/// The solvers for a study of `scene`, method by method. Those of one method are sorted from loose to tight.
pub fn solvers(request: &Request, study: Study, scene: &Scene, start: &InitialCondition) -> Vec<Solver> {
    let ensemble = study == Study::Ensemble;
    let methods: Vec<MethodName> = match (request.methods.is_empty(), ensemble) {
        (false, _) => request.methods.clone(),
        (true, true) => vec![MethodName::Auto, MethodName::Chebyshev],
        (true, false) => METHODS.to_vec(),
    };
    let mut chosen = Vec::new();
    for method in methods {
        if method == MethodName::VelocityVerlet {
            let steps =
                if request.steps.is_empty() { default_steps(scene, start) } else { request.steps.clone() };
            let fixed = |step| Solver { method: Stepper::Method(method), tolerance: None, step: Some(step) };
            chosen.extend(descending(steps).into_iter().map(fixed));
            continue;
        }
        let count = match method {
            _ if ensemble => STATISTICAL,
            MethodName::Chebyshev => SECOND_ORDER,
            _ => TOLERANCES.len(),
        };
        let tolerances = if request.tolerances.is_empty() {
            TOLERANCES[..count].to_vec()
        } else {
            request.tolerances.clone()
        };
        chosen.extend(descending(tolerances).into_iter().map(|tolerance| adaptive(method, tolerance)));
    }
    if request.paper {
        chosen.push(published());
    }
    chosen
}

/// The numbers in descending order, without repetition.
fn descending(mut numbers: Vec<f64>) -> Vec<f64> {
    numbers.sort_by(|a, b| b.total_cmp(a));
    numbers.dedup();
    numbers
}

/// Default steps of velocity Verlet, s. They are shares of a time scale, rounded to two digits.
///
/// With gravity the scale is 1/sqrt(kappa g), the time in which a sphere at rest on a floor swings by one
/// radian. Without gravity it is 1/(kappa V), the time of an impact.
fn default_steps(scene: &Scene, start: &InitialCondition) -> Vec<f64> {
    let kappa = scene.contact.stiffness_exponent;
    let g = gravity(scene);
    let time =
        if g > 0.0 { (kappa * g).sqrt().recip() } else { (kappa * velocity_scale(scene, start)).recip() };
    STEPS.map(|share| rounded(share * time)).to_vec()
}

/// The number rounded to two significant digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

/// Magnitude of the gravity, m/s^2.
pub fn gravity(scene: &Scene) -> f64 {
    scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt()
}

/// A copy of `scene` that uses `solver`.
pub fn with_solver(scene: &Scene, solver: &Solver) -> Scene {
    let mut scene = scene.clone();
    // The scene's norm, unless that is the published rate, which methods other than Merson's are not made for.
    let own = if scene.solver.norm == NormName::Paper { NormName::Scaled } else { scene.solver.norm };
    (scene.solver.method, scene.solver.norm) = match solver.method {
        Stepper::Method(method) => (method, own),
        Stepper::Published => (MethodName::Merson, NormName::Paper),
    };
    (scene.solver.tolerance, scene.solver.step) = (solver.tolerance, solver.step);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::MethodName;
    use crate::studies::accuracy::testing::scene;

    #[test]
    fn a_study_has_the_tolerances_that_fit_it_unless_the_user_has_others() {
        let (scene, start) = scene();
        let labels = |request: &Request, study| -> Vec<String> {
            solvers(request, study, &scene, &start).iter().map(Solver::label).collect()
        };
        let open = Request::new("eight.toml");
        let all = labels(&open, Study::State);
        assert_eq!(all.len(), 8 + 6 + 8 + 8 + 5);
        // 1/sqrt(150 * 9.81) s = 26 ms.
        assert_eq!(all.last().map(String::as_str), Some("velocity-verlet 2.6e-6 s"));
        assert_eq!(labels(&open, Study::Ensemble).len(), 8);
        let chosen = Request {
            methods: vec![MethodName::Merson, MethodName::VelocityVerlet],
            tolerances: vec![1e-2, 1e-1, 1e-2],
            steps: vec![1e-5],
            paper: true,
            ..open
        };
        assert_eq!(
            labels(&chosen, Study::Impact),
            ["merson 1e-1", "merson 1e-2", "velocity-verlet 1e-5 s", "paper 1e-1"]
        );
    }

    #[test]
    fn a_scene_is_told_what_the_solver_is() {
        let (scene, _) = scene();
        let scene_of_paper = with_solver(&scene, &published());
        assert_eq!(
            (scene_of_paper.solver.method, scene_of_paper.solver.norm),
            (MethodName::Merson, NormName::Paper)
        );
        let method = Stepper::Method(MethodName::VelocityVerlet);
        let verlet = Solver { method, tolerance: None, step: Some(1e-5) };
        let verlet = with_solver(&scene, &verlet);
        assert_eq!((verlet.solver.tolerance, verlet.solver.step), (None, Some(1e-5)));
        assert_eq!(verlet.solver.norm, NormName::Scaled);
    }
}
