//! Sizes over height: how many spheres of which class are in which layer.

use serde::Serialize;

use super::classes::Classes;
use super::region::Upright;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;

/// Largest number of layers.
const MOST: f64 = 100.0;

/// A level layer of the bed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Layer {
    /// Lower end above the ground, m.
    pub from: f64,
    /// Upper end above the ground, m.
    pub to: f64,
    /// Number of centres in it.
    pub spheres: usize,
    /// Mean radius of the spheres whose centres are in it, m; `None` without any.
    pub mean_radius: Option<f64>,
    /// Mass of the parts of spheres in it, kg.
    pub mass: f64,
    /// Share of each class in this mass; none where there is no mass.
    pub mass_shares: Vec<f64>,
}

/// Layers of equal heights, from the lowest point of any sphere to the highest one.
///
/// They are about as high as a mean sphere, and at most a hundred. `x` are the centres (m). A sphere that
/// reaches into several layers counts in each with its part, as a ball of even density.
pub fn layers(upright: &Upright, x: &[Vec3], sizes: Sizes, classes: &Classes) -> Vec<Layer> {
    if x.is_empty() {
        return Vec::new();
    }
    let r = |i: usize| sizes.of(i).r;
    let heights: Vec<f64> = x.iter().map(|x| upright.height(x)).collect();
    let ends = heights.iter().enumerate().map(|(i, height)| [height - r(i), height + r(i)]);
    let [low, high] = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).expect("there are spheres");
    let mean = (0..x.len()).map(r).sum::<f64>() / x.len() as f64;
    let count = ((high - low) / (2.0 * mean) - 1e-9).ceil().clamp(1.0, MOST) as usize;
    let bound = |k: usize| low + (high - low) * (k as f64 / count as f64);
    let of = |height: f64| (((height - low) / (high - low) * count as f64) as usize).min(count - 1);
    let mut masses = vec![vec![0.0; classes.count()]; count];
    let mut centres = vec![(0usize, 0.0); count];
    for (i, &height) in heights.iter().enumerate() {
        let (spheres, sum) = &mut centres[of(height)];
        (*spheres, *sum) = (*spheres + 1, *sum + r(i));
        let first = of(height - r(i));
        for (k, masses) in masses[..=of(height + r(i))].iter_mut().enumerate().skip(first) {
            let share = below((bound(k + 1) - height) / r(i)) - below((bound(k) - height) / r(i));
            masses[classes.of[i]] += sizes.of(i).mass * share;
        }
    }
    let layer = |k: usize| {
        let (spheres, sum) = centres[k];
        let mass = masses[k].iter().sum::<f64>();
        let mean_radius = (spheres > 0).then(|| sum / spheres as f64);
        let mass_shares =
            if mass > 0.0 { masses[k].iter().map(|part| part / mass).collect() } else { Vec::new() };
        Layer { from: bound(k), to: bound(k + 1), spheres, mean_radius, mass, mass_shares }
    };
    (0..count).map(layer).collect()
}

/// Share of a ball of radius 1 that is below the height `z` over its centre.
fn below(z: f64) -> f64 {
    let z = z.clamp(-1.0, 1.0);
    (2.0 + 3.0 * z - z.powi(3)) / 4.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing::{scene, sized};

    #[test]
    fn layers_share_the_mass_of_spheres_as_planes_cut_them() {
        // A large sphere on the floor, three small ones at its height and above, with gravity along x.
        let scene = scene("gravity = [-9.81, 0, 0]");
        let state = sized(&[
            ([1.0, 0.0, 0.0], 1.0, 10.0),
            ([0.5, 3.0, 0.0], 0.5, 1.0),
            ([1.5, 3.0, 0.0], 0.5, 2.0),
            ([2.5, 0.0, 0.0], 0.5, 4.0),
        ]);
        let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
        let sizes = state.sizes(&scene);
        let classes = Classes::of(&state.sizes, None, None).unwrap();
        let found = layers(&Upright::of(&scene), &x, sizes, &classes);
        // From 0 to 3 m in layers no higher than 1.25 m.
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        assert_eq!(found.len(), 3);
        assert_eq!([0, 1, 2].map(|k| found[k].spheres), [1, 2, 1]);
        near(found[0].mean_radius.unwrap(), 0.5);
        near(found[1].mean_radius.unwrap(), 0.75);
        for (k, small) in [1.0, 2.0, 4.0].into_iter().enumerate() {
            near(found[k].from, k as f64);
            let large = [5.0, 5.0, 0.0][k];
            near(found[k].mass, small + large);
            near(found[k].mass_shares[0], small / (small + large));
            near(found[k].mass_shares[1], large / (small + large));
        }
    }

    #[test]
    fn a_layer_without_spheres_has_neither_radius_nor_shares() {
        let scene = scene("");
        let state = sized(&[([0.0, 0.0, 0.0], 0.1, 1.0), ([0.0, 0.0, 4.0], 0.1, 3.0)]);
        let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
        let classes = Classes { names: vec!["all".to_owned()], of: vec![0; 2] };
        let found = layers(&Upright::of(&scene), &x, state.sizes(&scene), &classes);
        assert_eq!(found.len(), 21);
        assert_eq!((found[10].spheres, found[10].mean_radius, found[10].mass_shares.len()), (0, None, 0));
        let masses: f64 = found.iter().map(|layer| layer.mass).sum();
        assert!((masses - 4.0).abs() < 1e-12);
    }
}
