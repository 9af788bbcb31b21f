//! The force that pushes are compared with, to tell contacts from the faint repulsion of near surfaces.

use super::contacts::{Partner, SHARE};
use crate::files::run_file::State;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::scene::Scene;

/// Without gravity the reference force is never less than this share of F_0.
///
/// With the usual [`SHARE`] no force below 1e-3 F_0 is then a contact. Warnings of cut forces and the cutoff
/// of the stabilised method take this force as nothing, too.
const LEAST_OF_F_0: f64 = 0.01;

/// The force that pushes are compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reference {
    /// With gravity: the weight of a particle, N.
    Weight(f64),
    /// With gravity, where particles have masses of their own: the weight of the lighter partner. At a wall
    /// it is that of the particle. The weight of a heavy partner would not do: a light sphere that lies on it
    /// pushes it with its own weight only.
    Weights {
        /// Weight of the lightest particle, N.
        lightest: f64,
        /// Mean weight, N.
        mean: f64,
    },
    /// Without gravity: the mean of all pushes that are more than a tenth of this mean, N.
    ///
    /// The mean of all repulsions would depend on how many faint ones the interaction distance lets in. This
    /// one does not. It scales with F_0, as all forces of a bed without gravity do.
    MeanPush(f64),
}

impl Reference {
    /// The smallest force that the reference of any state of `scene` can be, if its particles have the sizes
    /// of `state`.
    pub fn least(scene: &Scene, state: &State) -> Self {
        let g = Vec3::from(scene.gravity).norm();
        let weight = scene.particles.mass * g;
        match (weight > 0.0, &state.sizes[..]) {
            (true, []) => Reference::Weight(weight),
            (true, sizes) => {
                let masses = sizes.iter().map(|size| size.mass);
                let lightest = g * masses.clone().fold(f64::INFINITY, f64::min);
                Reference::Weights { lightest, mean: g * masses.sum::<f64>() / sizes.len() as f64 }
            }
            (false, _) => Reference::MeanPush(LEAST_OF_F_0 * scene.contact.repulsion_at_contact),
        }
    }

    /// The reference of a `state` of `scene` with these `pushes` (N) between all bodies.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::beds::measures::reference_force::Reference;
    /// use demhybrid::scene::Scene;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?;
    /// let pushes = [4.0, 2.0, 0.2, 0.01, 0.01];
    /// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
    /// # use demhybrid::files::run_file::State;
    /// # let (x, v, omega, sizes, materials) = (vec![], vec![], None, Default::default(), Default::default());
    /// # let state = State { frame: 0, time: 0.0, x, v, omega, sizes, materials };
    /// assert_eq!(Reference::of(&scene, &state, pushes), Reference::Weight(9.81));
    /// let scene = Scene::parse("configs/quick.toml", &text, &["gravity=[0,0,0]".to_owned()])?;
    /// assert_eq!(Reference::of(&scene, &state, pushes), Reference::MeanPush(3.0)); // of 4 N and 2 N
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of(scene: &Scene, state: &State, pushes: impl IntoIterator<Item = f64>) -> Self {
        match Self::least(scene, state) {
            Reference::MeanPush(least) => Reference::MeanPush(mean_push(least, pushes.into_iter().collect())),
            weight => weight,
        }
    }

    /// The force, N. Of weights it is the mean one.
    pub fn newtons(self) -> f64 {
        match self {
            Reference::Weight(force) | Reference::MeanPush(force) => force,
            Reference::Weights { mean, .. } => mean,
        }
    }

    /// The smallest force that any contact is compared with, N.
    pub fn smallest(self) -> f64 {
        match self {
            Reference::Weights { lightest, .. } => lightest,
            same => same.newtons(),
        }
    }

    /// The force that a push between sphere `i` and `partner` is compared with, N, if the spheres of `scene`
    /// have these `sizes`.
    pub fn between(self, scene: &Scene, sizes: Sizes, i: usize, partner: Partner) -> f64 {
        let Reference::Weights { .. } = self else { return self.newtons() };
        let mass = match partner {
            Partner::Sphere(j) => sizes.of(i).mass.min(sizes.of(j).mass),
            Partner::Wall(_) => sizes.of(i).mass,
        };
        mass * Vec3::from(scene.gravity).norm()
    }

    /// What the force is, in words.
    pub fn words(self) -> &'static str {
        match self {
            Reference::Weight(_) => "the weight of a particle",
            Reference::Weights { .. } => "the weight of the lighter partner",
            Reference::MeanPush(_) => "the mean push",
        }
    }
}

/// The smallest force from `least` (N) on that is no less than the mean of all `pushes` (N) above a tenth of
/// it.
fn mean_push(least: f64, mut pushes: Vec<f64>) -> f64 {
    // From the strongest on. The order of the sum is that of the numbers, so the ids do not matter.
    pushes.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut reference = least;
    loop {
        let strong = &pushes[..pushes.partition_point(|&push| push > SHARE * reference)];
        let mean = strong.iter().sum::<f64>() / strong.len() as f64;
        // The mean can only grow, because the weakest leave. Of no pushes at all it is NaN.
        if mean.is_nan() || mean <= reference {
            return reference;
        }
        reference = mean;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing::{at_rest, scene, sized};

    #[test]
    fn the_reference_is_a_weight_wherever_there_is_gravity_in_any_direction() {
        let tilted = scene("gravity = [3, 0, -4]");
        let state = at_rest(vec![[0.0; 3]]);
        assert_eq!(Reference::of(&tilted, &state, [100.0; 5]), Reference::Weight(5.0));
        assert_eq!(Reference::least(&tilted, &state), Reference::Weight(5.0));
    }

    #[test]
    fn the_lighter_partner_decides_and_at_a_wall_the_sphere_itself() {
        let tilted = scene("gravity = [3, 0, -4]");
        let state = sized(&[([0.0; 3], 0.1, 1.0), ([1.0, 0.0, 0.0], 0.2, 8.0), ([2.0, 0.0, 0.0], 0.2, 3.0)]);
        let weights = Reference::of(&tilted, &state, [100.0; 5]);
        assert_eq!(weights, Reference::Weights { lightest: 5.0, mean: 20.0 });
        assert_eq!((weights.newtons(), weights.smallest()), (20.0, 5.0));
        let between = |i, partner| weights.between(&tilted, state.sizes(&tilted), i, partner);
        assert_eq!(between(0, Partner::Sphere(1)), 5.0);
        assert_eq!(between(1, Partner::Sphere(2)), 15.0);
        assert_eq!(between(1, Partner::Wall(0)), 40.0);
        // Without gravity there are no weights.
        let push = Reference::of(&scene(""), &state, [4.0, 2.0]);
        assert_eq!(
            (push, push.between(&tilted, state.sizes(&tilted), 1, Partner::Wall(0))),
            (Reference::MeanPush(3.0), 3.0)
        );
    }

    #[test]
    fn faint_pushes_do_not_lower_the_mean_however_many_the_interaction_distance_lets_in() {
        // Pushes of 1 to 20 N, and a tail that falls e-fold from one to the next.
        let strong: Vec<f64> = (1..=20).map(f64::from).collect();
        let mean = |tail: usize| {
            let faint = (0..tail).map(|k| 0.5 * (-(k as f64)).exp());
            mean_push(0.1, strong.iter().copied().chain(faint).collect())
        };
        // 1 N is less than a tenth of 10.5 N, so it is not in the mean: (2 + ... + 20)/19 = 11.
        for tail in [0, 1, 10, 100] {
            assert_eq!(mean(tail), 11.0, "{tail}");
        }
    }

    #[test]
    fn the_mean_scales_with_the_forces_and_ends_at_a_hundredth_of_f_0() {
        let pushes = [7.0, 3.0, 2.0, 0.2, 1e-6];
        let of = |scale: f64| mean_push(0.1 * scale, pushes.iter().map(|push| push * scale).collect());
        assert_eq!(of(1.0), 4.0);
        assert_eq!(of(1024.0), 4096.0);
        // A grid of spheres that are far apart: faint repulsion, and nothing stronger to compare it with.
        assert_eq!(mean_push(0.1, vec![3e-3; 50]), 0.1);
        assert_eq!(mean_push(0.1, Vec::new()), 0.1);
        assert_eq!(mean_push(0.1, vec![f64::INFINITY, 1.0]), f64::INFINITY);
    }
}
