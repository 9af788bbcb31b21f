//! The region of a frame that is measured or exported.

use super::region::{Region, Side, Upright, box_sides, cylinder_sides, least_width};
use crate::math::polyhedron::{Half, Polyhedron, is_open};
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::scene::Scene;
use crate::scene::walls::walls;

/// The part of a frame in which volumes are measured.
///
/// All of them lie inside all walls: the sides of the box and the planes of `container.wall`. In a direction
/// that neither walls nor the request close, the region ends with the spheres, along gravity first. Without
/// walls it is the smallest box around all spheres.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::request::RegionRequest;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::size::{Size, Sizes};
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let size = Sizes::Equal(Size::new(0.1, 1.0));
/// let (region, words) = RegionRequest::Whole.of(&scene, &[Vec3::new(0.3, 0.3, 0.4)], size);
/// assert!((region.volume() - 0.75 * 0.75 * 0.5).abs() < 1e-14); // the box up to the top of the sphere, m^3
/// assert_eq!(words, "the whole bed");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub enum RegionRequest {
    /// The bed without its top.
    #[default]
    Bed,
    /// All that walls enclose, up to the highest point of any sphere where they leave the top open.
    Whole,
    /// The part between two heights above the ground, m.
    Layer([f64; 2]),
    /// The part in the box between two corners, m.
    Box {
        /// Lower corner, m.
        low: Vec3,
        /// Upper corner, m.
        high: Vec3,
    },
    /// The part in a cylinder along z.
    Cylinder {
        /// x and y of the axis, m.
        axis: [f64; 2],
        /// Radius, m.
        radius: f64,
        /// Lower and upper end along z, m.
        ends: [f64; 2],
    },
}

impl RegionRequest {
    /// The region to measure in a bed of `scene` of spheres with the centres `x` (m) and these `sizes`, and
    /// its name.
    ///
    /// It may be empty, where no sphere is inside the walls or the walls leave nothing of what is asked for.
    pub fn of(&self, scene: &Scene, x: &[Vec3], sizes: Sizes) -> (Region, &'static str) {
        let upright = Upright::of(scene);
        let mut sides = wall_sides(scene);
        let mut pillar = None;
        let words = match *self {
            RegionRequest::Whole => "the whole bed",
            RegionRequest::Bed => match bed_top(&sides, &upright, x, sizes) {
                Some(top) => {
                    sides.push((Half { n: upright.up, b: top }, Side::Cut));
                    "the bed, without its top"
                }
                None => "the whole bed",
            },
            RegionRequest::Layer([from, to]) => {
                let up = upright.up;
                sides.push((Half { n: -up, b: -(from + upright.ground) }, Side::Cut));
                sides.push((Half { n: up, b: to + upright.ground }, Side::Cut));
                "the layer of --layer"
            }
            RegionRequest::Box { low, high } => {
                sides.extend(box_sides(&low, &high, Side::Cut));
                "the box of --box"
            }
            RegionRequest::Cylinder { axis, radius, ends } => {
                sides.extend(cylinder_sides(axis, radius, ends));
                pillar = Some((axis, radius));
                "the cylinder of --cylinder"
            }
        };
        for way in upright.ways() {
            if is_open(&halves(&sides), &way) {
                let end = end_of_spheres(x, sizes, &way).unwrap_or(scene.particles.radius);
                sides.push((Half { n: way, b: end }, Side::End));
            }
        }
        (Region::new(sides, pillar, upright), words)
    }
}

/// The walls of a scene as sides of a region.
pub fn wall_sides(scene: &Scene) -> Vec<(Half, Side)> {
    walls(&scene.container).iter().enumerate().map(|(k, wall)| (wall.half(), Side::Wall(k))).collect()
}

fn halves(sides: &[(Half, Side)]) -> Vec<Half> {
    sides.iter().map(|(half, _)| *half).collect()
}

/// The largest distance of a point of any sphere from the origin along `way`, m; `None` without spheres.
fn end_of_spheres(x: &[Vec3], sizes: Sizes, way: &Vec3) -> Option<f64> {
    x.iter().enumerate().map(|(i, x)| way.dot(x) + sizes.of(i).r).reduce(f64::max)
}

/// The height along `up` from the origin (m) up to which the density of the bed is measured.
///
/// It is as far above the ground as the bed is wide between the closest two upright planes that hold it.
///
/// A bed is too shallow for that if less than a tenth of its centres are above. The region then ends at the
/// height below which three quarters of the centres lie. Centres of unequal spheres count by their volumes.
///
/// `None` if the walls leave the bed open below or on a side, or if it is not on its ground.
fn bed_top(walls: &[(Half, Side)], upright: &Upright, x: &[Vec3], sizes: Sizes) -> Option<f64> {
    let up = upright.up;
    let mut closed = halves(walls);
    closed.push(Half { n: up, b: end_of_spheres(x, sizes, &up)? });
    if upright.ways().iter().any(|way| is_open(&closed, way)) {
        return None;
    }
    let body = Polyhedron::of(&closed);
    if body.faces.is_empty() {
        return None;
    }
    let bottom = -body.reach(&-up);
    let as_high_as_wide = bottom + least_width(&body, &upright.across);
    // Each sphere counts by its volume; equal ones by their number.
    let weight = |i: usize| match sizes {
        Sizes::Equal(_) => 1.0,
        Sizes::Each(sizes) => sizes[i].r.powi(3),
    };
    let mut heights: Vec<(f64, f64)> = x.iter().enumerate().map(|(i, x)| (up.dot(x), weight(i))).collect();
    heights.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = heights.iter().map(|(_, weight)| weight).sum();
    let above: f64 = heights.iter().filter(|(z, _)| *z > as_high_as_wide).map(|(_, weight)| weight).sum();
    let top = if 10.0 * above >= total {
        as_high_as_wide
    } else {
        let mut below = 0.0;
        let reached = heights.iter().find(|(_, weight)| {
            below += weight;
            4.0 * below > 3.0 * total
        });
        reached.map_or(as_high_as_wide, |(z, _)| *z)
    };
    (top > bottom).then_some(top)
}
