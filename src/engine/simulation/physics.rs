//! What a scene calls for: kernel, body parameters, norm, step control and methods.

use crate::engine::forces::BodyParameters;
use crate::engine::kernel::{Kernel, kernel};
use crate::math::instructions::InstructionSet;
use crate::model::columns::{Changes, Columns};
use crate::model::effects::{Effects, Variant};
use crate::ode::integrator::{AutoPlan, Integrator};
use crate::ode::{DORMAND_PRINCE, MERSON, MethodName, Norm, NormName, StepControl, StepRule};
use crate::scene::{Scene, effects};

/// A contact law of one's own and other body parameters than those of the scene.
pub struct Physics<'a> {
    /// Makes the kernel for an instruction set.
    pub kernel: &'a dyn Fn(InstructionSet) -> Box<dyn Kernel>,
    /// Mass, inertia, gravity and walls.
    pub parameters: BodyParameters,
}

/// The kernel with the effects of the scene.
pub(super) fn scene_kernel(scene: &Scene, set: InstructionSet) -> Box<dyn Kernel> {
    kernel(Effects::of(scene), effects::law(scene), set)
}

/// What acts on the particles besides their contacts.
pub fn parameters(scene: &Scene) -> BodyParameters {
    let r = scene.particles.radius;
    BodyParameters {
        mass: scene.particles.mass,
        inverse_inertia: 1.0 / (0.4 * scene.particles.mass * r * r),
        gravity: scene.gravity.into(),
        walls: crate::scene::walls::walls(&scene.container),
    }
}

/// How errors are measured and step sizes chosen. Velocities are compared with `scale` (m/s).
pub(super) fn error_control(scene: &Scene, scale: f64, columns: &Columns) -> (Norm, StepControl) {
    let (solver, r) = (&scene.solver, scene.particles.radius);
    let paper = solver.norm == NormName::Paper;
    // Positions over the radius, velocities and spins over the scale. The published norm is that of angular
    // velocities: spins over the radius.
    let [x, v, s] = if paper { [1.0, 1.0, 1.0 / r] } else { [1.0 / r, 1.0 / scale, 1.0 / scale] };
    let weights = [x, x, x, v, v, v, s, s, s];
    let norm = Norm { weights: vec![weights[..columns.width(Changes::EveryStage)].to_vec()], rate: paper };
    let control = match solver.step {
        Some(step) => StepControl::new(StepRule::Fixed, 1.0, step, step),
        None => {
            let rule = if paper { StepRule::Published } else { StepRule::ProportionalIntegral };
            let tolerance = solver.tolerance.unwrap_or(crate::scene::DEFAULT_TOLERANCE) * tightening(scene);
            StepControl::new(rule, tolerance, solver.min_step, solver.max_step)
        }
    };
    (norm, control)
}

/// Largest number of state vectors that the methods of the scene use.
pub fn state_vectors(scene: &Scene) -> usize {
    Integrator::new(scene.solver.method, auto_plan(scene)).vectors()
}

/// How `auto` starts. It switches to the stabilised method where that needs less work.
///
/// With friction the motion is stiff and not very smooth. Merson's method is accurate wherever it is stable,
/// and takes the first impacts, whose errors grow most.
///
/// Without friction the motion is smooth and mostly not stiff: there the method of Dormand and Prince is
/// cheaper.
pub(super) fn auto_plan(scene: &Scene) -> AutoPlan {
    let Effects { variant, dissipative } = Effects::of(scene);
    if variant == Variant::Basic {
        let reason = "without friction the motion is smooth";
        AutoPlan { explicit: &DORMAND_PRINCE, reason, is_damped: dissipative }
    } else {
        AutoPlan { explicit: &MERSON, reason: "friction is not very smooth", is_damped: true }
    }
}

/// Factor by which `auto` tightens the tolerance where the motion is smooth.
///
/// There two more digits cost about twice the work, and without damping errors grow.
pub fn tightening(scene: &Scene) -> f64 {
    let smooth = Effects::of(scene).variant == Variant::Basic;
    if smooth && scene.solver.method == MethodName::Auto { 0.01 } else { 1.0 }
}
