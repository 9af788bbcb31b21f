//! How deep spheres overlap each other and walls at the start.

use super::InitialCondition;
use crate::math::sized_cells::SizedCells;
use crate::math::vector::Vec3;
use crate::scene::Scene;
use crate::scene::walls::walls;
use std::cmp::Ordering;

/// Overlaps of more than this share of the radius are deep: no load presses contacts so far that are hard
/// enough for it.
pub const DEEP: f64 = 0.3;

/// What a sphere overlaps.
#[derive(Debug, Clone, PartialEq)]
pub enum Partner {
    /// The sphere of this id.
    Sphere(usize),
    /// The wall of this index in the list of [`walls`].
    Wall(usize),
}

/// The overlaps of an initial condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlaps {
    /// The largest overlap, m.
    pub deepest: f64,
    /// The sphere with that overlap, and what it overlaps.
    pub between: (usize, Partner),
    /// The radius of that sphere, m; of two the smaller one.
    pub r: f64,
    /// Number of overlaps that are [`DEEP`].
    pub deep: u64,
}

/// The overlaps of spheres with each other and with walls; `None` if nothing overlaps.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::initial_condition::InitialCondition;
/// use demhybrid::scene::initial_condition::overlaps::{Partner, overlaps};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?; // radius 0.1 m, floor z = 0
/// let scene = Scene::parse("configs/quick.toml", &text, &["particles.grid.spacing=0.15".to_owned()])?;
/// let x = vec![[0.3, 0.3, 0.09], [0.3, 0.3, 0.24]];
/// let found = overlaps(&scene, &InitialCondition { x, ..InitialCondition::default() }).ok_or("none")?;
/// assert!((found.deepest - 0.05).abs() < 1e-12); // m; the overlap with the floor is 0.01 m
/// assert_eq!((found.between, found.deep), ((0, Partner::Sphere(1)), 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlaps(scene: &Scene, start: &InitialCondition) -> Option<Overlaps> {
    let own_sizes = start.sizes(scene);
    let (sizes, largest) = (own_sizes.as_sizes(), own_sizes.largest());
    let radius = |i: usize| sizes.of(i).r;
    let x: Vec<Vec3> = start.x.iter().map(|&x| x.into()).collect();
    let mut found: Option<Overlaps> = None;
    let mut meet = |overlap: f64, r: f64, between: &dyn Fn() -> (usize, Partner)| {
        if overlap <= 0.0 {
            return;
        }
        let deep = u64::from(overlap > DEEP * r);
        match &mut found {
            Some(found) if found.deepest >= overlap => found.deep += deep,
            Some(found) => {
                *found = Overlaps { deepest: overlap, between: between(), r, deep: found.deep + deep }
            }
            None => found = Some(Overlaps { deepest: overlap, between: between(), r, deep }),
        }
    };
    if !cells_keep_apart(scene, 2.0 * largest) {
        let touch = |a: f64, b: f64| a + b;
        let cells = SizedCells::new(&x, Some(&radius), &touch);
        for (i, centre) in x.iter().enumerate() {
            cells.for_each_near(centre, radius(i), &touch, |j| {
                if i < j {
                    let [a, b] = [radius(i), radius(j)];
                    meet(a + b - (centre - x[j]).norm(), a.min(b), &|| (i, Partner::Sphere(j)));
                }
            });
        }
    }
    for (k, wall) in walls(&scene.container).iter().enumerate() {
        for (i, centre) in x.iter().enumerate() {
            let r = radius(i);
            meet(r - wall.depth(centre), r, &|| (i, Partner::Wall(k)));
        }
    }
    found
}

/// The two lowest ids whose centres `x` (m) are the same, if any are.
pub(super) fn coincident(scene: &Scene, x: &[[f64; 3]]) -> Option<[usize; 2]> {
    // A grid whose shifts are shorter than its cells needs no look.
    if cells_keep_apart(scene, 1e-3 * scene.particles.radius) {
        return None;
    }
    let mut order: Vec<usize> = (0..x.len()).collect();
    let by_place =
        |&a: &usize, &b: &usize| x[a].partial_cmp(&x[b]).unwrap_or(Ordering::Equal).then(a.cmp(&b));
    order.sort_unstable_by(by_place);
    let pairs = order.windows(2).map(|pair| [pair[0], pair[1]]);
    pairs.filter(|&[i, j]| x[i] == x[j]).min()
}

/// Whether the cells of a grid keep centres at least `distance` (m) apart.
fn cells_keep_apart(scene: &Scene, distance: f64) -> bool {
    scene.particles.grid.as_ref().is_some_and(|grid| grid.spacing - grid.jitter >= distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(grid: &str) -> Scene {
        let text = "t_end = 1
            particles = { radius = 0.1, mass = 1, grid = {} }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }
            container.box = { max = [1, 1, 1] }";
        Scene::parse("a.toml", text, &[format!("particles.grid={grid}")]).unwrap()
    }

    #[test]
    fn the_deepest_of_all_overlaps_is_found_and_deep_ones_are_counted() {
        // Without order, so that any two can be neighbours.
        let coordinate = |k: usize, prime: usize| 0.08 + 0.84 * ((k * prime) % 997) as f64 / 997.0;
        let x: Vec<[f64; 3]> =
            (0..300).map(|k| [coordinate(k, 389), coordinate(k, 577), coordinate(k, 811)]).collect();
        let scene = scene("{ spacing = 0.05 }");
        let start = InitialCondition { x: x.clone(), ..InitialCondition::default() };
        let found = overlaps(&scene, &start).unwrap();
        let (mut deepest, mut deep) = ((0.0, 0, 0), 0);
        for i in 0..300 {
            for j in i + 1..300 {
                let overlap = 0.2 - (Vec3::from(x[i]) - Vec3::from(x[j])).norm();
                deep += u64::from(overlap > 0.03);
                if overlap > deepest.0 {
                    deepest = (overlap, i, j);
                }
            }
        }
        assert!(deep > 100 && deepest.0 > 0.1, "{deepest:?}, {deep}");
        // Centres are 0.08 m or more from the walls: those overlaps are not deep.
        assert_eq!((found.deepest, found.deep), (deepest.0, deep));
        assert_eq!(found.between, (deepest.1, Partner::Sphere(deepest.2)));
    }

    #[test]
    fn a_wall_can_be_what_is_overlapped_and_spheres_that_touch_overlap_nothing() {
        let at = |z| InitialCondition { x: vec![[0.5, 0.5, z]], ..InitialCondition::default() };
        let found = overlaps(&scene("{}"), &at(0.04)).unwrap();
        assert!((found.deepest - 0.06).abs() < 1e-15 && found.deep == 1, "{found:?}");
        assert_eq!(found.between, (0, Partner::Wall(4)));
        assert_eq!(overlaps(&scene("{}"), &at(0.1)), None);
    }

    #[test]
    fn the_first_two_in_one_place_are_found() {
        let (a, b) = ([0.5, 0.0, 0.25], [0.75, 0.5, 0.5]);
        let grid = scene("{ spacing = 0.01, jitter = 0.01 }");
        assert_eq!(coincident(&grid, &[b, a, [0.1; 3], [0.5, -0.0, 0.25], b, a]), Some([0, 4]));
        assert_eq!(coincident(&grid, &[b, a, [0.1; 3]]), None);
    }
}
