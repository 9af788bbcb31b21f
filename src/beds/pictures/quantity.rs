//! The quantities that colours can show: a number for every sphere.

use clap::ValueEnum;

use crate::beds::measures::contacts::Partner;
use crate::beds::measures::region::Upright;
use crate::engine::neighbors::{Lists, Reach};
use crate::files::output::Species;
use crate::files::run_file::State;
use crate::math::elementary::Separate;
use crate::math::vector::Vec3;
use crate::scene::Scene;
use crate::scene::materials::NormalLaws;

use super::options::Limits;

/// The quantity that the colours show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Quantity {
    /// Height of the centre above the lowest point inside all walls, against gravity, m; above the origin
    /// where the bottom is open, and along z without gravity
    Height,
    /// Speed of the centre, m/s
    Speed,
    /// Angular speed, rad/s
    Spin,
    /// Sum of the normal forces of all contacts with spheres and walls, rebound included, N: how hard the
    /// sphere is squeezed
    Force,
    /// Deepest overlap with a sphere or a wall, m
    Overlap,
    /// Radius, m, where radii differ
    Radius,
    /// Species, a colour for each, where the particle file names them
    Species,
    /// Nothing: all spheres have the same colour
    None,
}

impl Quantity {
    /// Title of the legend, and unit.
    pub fn title(self) -> (&'static str, &'static str) {
        match self {
            Quantity::Height => ("height", "m"),
            Quantity::Speed => ("speed", "m/s"),
            Quantity::Spin => ("spin", "rad/s"),
            Quantity::Force => ("normal force", "N"),
            Quantity::Overlap => ("overlap", "m"),
            Quantity::Radius => ("radius", "m"),
            Quantity::Species => ("species", ""),
            Quantity::None => ("", ""),
        }
    }

    /// The value for every sphere of a frame; of a species its index. For spins and for species, the run must
    /// have them.
    pub fn values(
        self,
        scene: &Scene,
        state: &State,
        species: Option<&Species>,
        upright: &Upright,
    ) -> Vec<f64> {
        let norms = |vectors: &[[f64; 3]]| vectors.iter().map(|v| Vec3::from(*v).norm()).collect();
        match self {
            Quantity::Height => state.x.iter().map(|x| upright.height(&Vec3::from(*x))).collect(),
            Quantity::Speed => norms(&state.v),
            Quantity::Spin => norms(state.omega.as_deref().expect("the caller has looked for spins")),
            Quantity::Force => {
                let laws = NormalLaws::of(scene, &state.materials);
                let mut sums = vec![0.0; state.x.len()];
                for_each_contact(scene, state, laws.shared().l_max, |i, partner, gap, n, v_rel| {
                    let law = match partner {
                        Partner::Sphere(j) => laws.of_pair(i, j),
                        Partner::Wall(k) => laws.of_wall(i, k),
                    };
                    sums[i] += law.action::<Separate>(gap, n, v_rel, &Vec3::zeros()).force.norm();
                });
                sums
            }
            Quantity::Overlap => {
                let mut deepest = vec![0.0; state.x.len()];
                for_each_contact(scene, state, 0.0, |i, _, gap, _, _| {
                    deepest[i] = f64::max(deepest[i], -gap)
                });
                deepest
            }
            Quantity::Radius => {
                let sizes = state.sizes(scene);
                (0..state.x.len()).map(|i| sizes.of(i).r).collect()
            }
            Quantity::Species => {
                let species = species.expect("the caller has looked for species");
                species.of.iter().map(|&index| f64::from(index)).collect()
            }
            Quantity::None => vec![0.0; state.x.len()],
        }
    }

    /// The limits of the legend for values from `low` to `high`. All quantities except heights and radii
    /// begin at 0.
    pub fn limits(self, low: f64, high: f64) -> Limits {
        // A force may overflow, so the legend has an upper limit.
        let from_low = matches!(self, Quantity::Height | Quantity::Radius);
        let (low, high) = (if from_low { low } else { 0.0 }, high.min(1e300));
        if high - low > 1e-9 * high.abs().max(low.abs()) {
            Limits { low, high }
        } else {
            let room = if high == 0.0 { 1.0 } else { 0.5 * high.abs() };
            Limits { low: low - if from_low { room } else { 0.0 }, high: high + room }
        }
    }
}

/// Calls `visit(i, partner, gap, n, v_rel)` for every sphere i of every contact with a gap of at most
/// `widest` (m).
///
/// A pair gives two calls, a wall one. The conventions are those of [`crate::model::contact`].
fn for_each_contact(
    scene: &Scene,
    state: &State,
    widest: f64,
    mut visit: impl FnMut(usize, Partner, f64, &Vec3, &Vec3),
) {
    let sizes = state.sizes(scene);
    let r = |i: usize| sizes.of(i).r;
    let walls = crate::scene::walls::walls(&scene.container);
    let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
    let v = |i: usize| Vec3::from(state.v[i]);
    let keys: Vec<_> = (0..x.len() as u64).map(|id| ([0; 3], id)).collect();
    let mut lists = Lists::default();
    lists.rebuild(&x, &keys, x.len(), Reach { sizes, shares: [1.0; 2], gaps: [widest; 2] }, &walls, 1);
    for block in &lists.blocks {
        for [i, j] in block.first_pairs() {
            let apart = x[i] - x[j];
            let d = apart.norm();
            // The centres coincide, so any direction will do.
            let n = if d > 0.0 { apart / d } else { Vec3::z() };
            let v_rel = v(i) - v(j);
            let gap = d - (r(i) + r(j));
            visit(i, Partner::Sphere(j), gap, &n, &v_rel);
            visit(j, Partner::Sphere(i), gap, &-n, &-v_rel);
        }
        for [i, k] in block.wall_contacts() {
            visit(i, Partner::Wall(k), walls[k].depth(&x[i]) - r(i), &-walls[k].normal, &v(i));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing;
    use crate::model::size::Size;

    /// Two spheres of radius 0.1 m. The lower one overlaps the floor by 0.01 m and the upper one by 0.02 m.
    fn pair() -> (Scene, State) {
        let scene = testing::scene(
            "gravity = [0, 0, -9.81]
             container.box = { min = [0, 0, 0], max = [inf, inf, inf] }",
        );
        let x = vec![[1.0, 1.0, 0.09], [1.0, 1.0, 0.27]];
        let v = vec![[0.0; 3], [3.0, 0.0, 4.0]];
        (
            scene,
            State {
                frame: 0,
                time: 0.0,
                x,
                v,
                omega: Some(vec![[0.0; 3], [0.0, -2.0, 0.0]]),
                sizes: Default::default(),
                materials: Default::default(),
            },
        )
    }

    fn close(found: &[f64], exact: &[f64]) {
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12 * b.abs().max(1.0);
        assert!(found.len() == exact.len() && found.iter().zip(exact).all(near), "{found:?} {exact:?}");
    }

    #[test]
    fn values_are_those_of_the_spheres() {
        let (scene, state) = pair();
        let values = |quantity: Quantity| quantity.values(&scene, &state, None, &Upright::of(&scene));
        close(&values(Quantity::Height), &[0.09, 0.27]);
        close(&values(Quantity::Speed), &[0.0, 5.0]);
        close(&values(Quantity::Spin), &[0.0, 2.0]);
        close(&values(Quantity::Overlap), &[0.02, 0.02]);
        // Eqs. (2.1), (2.4): the floor is at rest and has the share (1 + e^2)/2.
        // The pair separates at 4 m/s and has the share e^2.
        let floor = 10.0 * (150.0 * 0.01f64).exp() * (1.0 + 0.16) / 2.0;
        let pair = 10.0 * (150.0 * 0.02f64).exp() * (0.16 + 0.84 / (1.0 + (20.0 * 4.0f64).exp()));
        close(&values(Quantity::Force), &[floor + pair, pair]);
    }

    #[test]
    fn contacts_of_unequal_spheres_have_the_radii_of_both() {
        let (scene, mut state) = pair();
        // The lower one has a radius of 0.08 m and overlaps nothing below; the upper one 0.105 m.
        state.sizes = [Size::new(0.08, 1.0), Size::new(0.105, 2.0)].into();
        let species = Species { names: vec!["a".into(), "b".into()], of: vec![1, 0] };
        let values =
            |quantity: Quantity| quantity.values(&scene, &state, Some(&species), &Upright::of(&scene));
        close(&values(Quantity::Overlap), &[0.005, 0.005]);
        close(&values(Quantity::Radius), &[0.08, 0.105]);
        close(&values(Quantity::Species), &[1.0, 0.0]);
        let floor = 10.0 * (-150.0 * 0.01f64).exp() * (1.0 + 0.16) / 2.0;
        let pair = 10.0 * (150.0 * 0.005f64).exp() * (0.16 + 0.84 / (1.0 + (20.0 * 4.0f64).exp()));
        close(&values(Quantity::Force), &[floor + pair, pair]);
    }

    #[test]
    fn a_legend_has_two_different_ends() {
        assert_eq!(Quantity::Speed.limits(2.0, 5.0), Limits { low: 0.0, high: 5.0 });
        assert_eq!(Quantity::Height.limits(2.0, 5.0), Limits { low: 2.0, high: 5.0 });
        assert_eq!(Quantity::Radius.limits(0.1, 0.3), Limits { low: 0.1, high: 0.3 });
        assert_eq!(Quantity::Speed.limits(0.0, 0.0), Limits { low: 0.0, high: 1.0 });
        assert_eq!(Quantity::Force.limits(1.0, f64::INFINITY), Limits { low: 0.0, high: 1e300 });
        assert_eq!(Quantity::Height.limits(3.0, 3.0), Limits { low: 1.5, high: 4.5 });
    }
}
