//! What a scene calls for: kernel, body parameters, norm, step control and methods.

use super::tolerance::tolerance;
use crate::engine::dynamics::Dynamics;
use crate::engine::forces::BodyParameters;
use crate::engine::kernel::{Kernel, Laws, kernel};
use crate::math::instructions::InstructionSet;
use crate::math::larger;
use crate::model::columns::{Changes, Columns};
use crate::model::effects::{Effects, Variant};
use crate::ode::integrator::{AutoPlan, Integrator};
use crate::ode::method_switch::{LITTLE_PATIENCE, PATIENCE};
use crate::ode::{DORMAND_PRINCE, MERSON, MethodName, Norm, NormName, StepControl, StepRule};
use crate::scene::{Scene, effects, materials};

/// Impacts with at most this coefficient of restitution lose three quarters of their energy.
const LOSSY: f64 = 0.5;

/// Steps longer than this over the frequency of a contact are long, see [`long_step`].
const LONG: f64 = 0.3;

/// Steps longer than this (s) do not follow the oscillations of contacts with memory. Velocities are compared
/// with `scale` (m/s), and the frequency of a contact that carries the typical force is v sqrt(kappa/r).
pub(super) fn long_step(scene: &Scene, scale: f64) -> f64 {
    let law = effects::law(scene);
    let frequency = scale * (law.kappa / law.r).sqrt();
    if law.memory.is_some() { LONG / frequency } else { f64::INFINITY }
}

/// A contact law of one's own and other body parameters than those of the scene.
pub struct Physics<'a> {
    /// Makes the kernel for an instruction set.
    pub kernel: &'a dyn Fn(InstructionSet) -> Box<dyn Kernel>,
    /// Mass, inertia, gravity and walls.
    pub parameters: BodyParameters,
}

/// The laws with the effects of the scene: one kernel for every class of contacts.
pub(super) fn scene_laws(scene: &Scene, set: InstructionSet) -> Laws {
    let (laws, classes) = materials::laws(scene);
    let effects = Effects::of(scene);
    Laws::new(laws.into_iter().map(|law| kernel(effects, law, set)).collect(), classes)
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

/// How errors of `count` spheres are measured and step sizes chosen. Velocities are compared with `scale`
/// (m/s).
pub(super) fn error_control(
    scene: &Scene,
    (scale, count): (f64, u64),
    columns: &Columns,
) -> (Norm, StepControl) {
    let (solver, r) = (&scene.solver, scene.particles.radius);
    let paper = solver.norm == NormName::Paper;
    let law = effects::law(scene);
    // Against the radius, an error of many 1/kappa would count as none.
    let way = law.position_scale(r);
    // Positions over that way, velocities and spins over the scale. The published norm is that of angular
    // velocities: spins over the radius.
    let [x, v, s] = if paper { [1.0, 1.0, 1.0 / r] } else { [1.0 / way, 1.0 / scale, 1.0 / scale] };
    let weights = [x, x, x, v, v, v, s, s, s];
    let mut weights = vec![weights[..columns.width(Changes::EveryStage)].to_vec()];
    if let Some(memory) = law.memory {
        // The memory of a contact with the typical force m v^2/r is compared with its limit. In the published
        // norm the shear counts as a length.
        let typical = memory.mass * scale * scale / (r * law.f_0);
        let laws = scene_laws(scene, InstructionSet::Baseline);
        // Of several classes the longest shear: no error counts for less than it is.
        let full = |k: usize| laws.elements().map(|elements| elements[k].1.full).fold(0.0, larger);
        let weights_of = laws.first().elements().iter().enumerate().flat_map(|(k, (numbers, _))| {
            let weight = if paper { full(k) } else { 1.0 / typical.sqrt() };
            std::iter::repeat_n(weight, *numbers)
        });
        weights.push(weights_of.collect());
    }
    let control = match solver.step {
        Some(step) => StepControl::new(StepRule::Fixed, 1.0, step, step),
        None => {
            let rule = if paper { StepRule::Published } else { StepRule::ProportionalIntegral };
            let tolerance = tolerance(scene, scale, count) * tightening(scene);
            StepControl::new(rule, tolerance, solver.min_step, solver.max_step)
        }
    };
    let mean = (solver.norm == NormName::Mean).then_some(control.tolerance);
    let norm = Norm { weights, rate: paper, mean, rows: Vec::new() };
    let free = control.rule == StepRule::ProportionalIntegral;
    let long = if free { long_step(scene, scale) } else { f64::INFINITY };
    (norm, StepControl { long, ..control })
}

/// Factors of weights for every particle, see [`Norm::rows`]: errors of positions are compared with its own
/// radius. The published norm has angular velocities: spins over the own radius.
pub(super) fn own_weights(dynamics: &Dynamics, norm: &Norm) -> Vec<f64> {
    if norm.rate { dynamics.spin_weights() } else { dynamics.position_weights() }
}

/// Largest number of state vectors that the methods of the scene use.
pub fn state_vectors(scene: &Scene) -> usize {
    Integrator::new(scene.solver.method, auto_plan(scene, &[], f64::INFINITY)).vectors()
}

/// How `auto` starts. It switches to the stabilised method where that needs less work.
///
/// With friction the motion is stiff and not very smooth. Merson's method is accurate wherever it is stable,
/// and takes the first impacts, whose errors grow most.
///
/// With friction that remembers stiffness does not jump. Where impacts lose most of their energy, too, the
/// stabilised method may take the first ones. Where they lose none it would create some: it is never asked.
///
/// Without friction the motion is smooth and mostly not stiff: there the method of Dormand and Prince is
/// cheaper.
///
/// `materials` are the numbers of those that spheres have.
pub(super) fn auto_plan(scene: &Scene, materials: &[usize], long: f64) -> AutoPlan {
    let Effects { variant, dissipative } = Effects::of(scene);
    if variant == Variant::Basic {
        let reason = "without friction the motion is smooth";
        AutoPlan { explicit: &DORMAND_PRINCE, reason, is_damped: dissipative, patience: PATIENCE, long }
    } else {
        let e = greatest_restitution(scene, materials);
        let remembers = effects::law(scene).memory.is_some();
        let patience = if remembers && e <= LOSSY { LITTLE_PATIENCE } else { PATIENCE };
        let is_damped = !remembers || e < 1.0;
        AutoPlan { explicit: &MERSON, reason: "friction is not very smooth", is_damped, patience, long }
    }
}

/// The greatest coefficient of restitution of any contact between spheres of the materials with these
/// numbers, and of theirs with walls.
fn greatest_restitution(scene: &Scene, spheres: &[usize]) -> f64 {
    let partners = [spheres, &scene.wall_materials()].concat();
    let pairs = spheres.iter().flat_map(|&a| partners.iter().map(move |&b| (a, b)));
    pairs.map(|(a, b)| scene.between_materials(a, b).coefficients.restitution).fold(0.0, larger)
}

/// Factor by which `auto` tightens the tolerance where the motion is smooth.
///
/// There two more digits cost about twice the work, and without damping errors grow. Where nothing is lost on
/// rebound either, energy must not fade: two more digits cost a third more, and a sphere keeps its energy
/// within 0.2 % over a thousand impacts, where it lost a tenth to a third.
pub fn tightening(scene: &Scene) -> f64 {
    let Effects { variant, dissipative } = Effects::of(scene);
    match (variant, scene.solver.method) {
        (Variant::Basic, MethodName::Auto) if dissipative => 0.01,
        (Variant::Basic, MethodName::Auto) => 1e-4,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_auto_starts_follows_from_the_contacts_that_can_be() {
        let text = include_str!("../../../configs/bed.toml");
        let materials = "material=[{ name = 'a', restitution = 0.2 }, { name = 'b', restitution = 0.8 }, \
             { name = 'c', restitution = 1 }]";
        let set = [materials, "container.box.material='b'", "contact.restitution=0.5"].map(str::to_owned);
        let scene = Scene::parse("bed.toml", text, &set).unwrap();
        // Number 3 stands for what has no material.
        for (spheres, patience, is_damped) in [
            (&[0][..], LITTLE_PATIENCE, true),
            (&[0, 1], PATIENCE, true),
            (&[0, 2], PATIENCE, false),
            (&[3], PATIENCE, true),
            (&[0, 3], PATIENCE, true),
        ] {
            let plan = auto_plan(&scene, spheres, 1.0);
            assert_eq!((plan.patience, plan.is_damped), (patience, is_damped), "{spheres:?}");
        }
        let plain = |set: &str| {
            let plan = auto_plan(&Scene::parse("bed.toml", text, &[set.to_owned()]).unwrap(), &[0], 1.0);
            (plan.patience, plan.is_damped)
        };
        assert_eq!(plain("contact.restitution=0.5"), (LITTLE_PATIENCE, true));
        assert_eq!(plain("contact.restitution=1.0"), (PATIENCE, false));
        let paper = "friction={law='regularized',regularization_velocity=0.01}";
        assert_eq!(plain(paper), (PATIENCE, true));
    }
}
