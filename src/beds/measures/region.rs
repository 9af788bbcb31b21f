//! Regions that are measured or exported.

use super::bed::bed_region;
use super::union::Region;
use crate::math::vector::Vec3;
use crate::scene::Scene;

/// The part of a bed in which volumes are measured.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::region::RegionRequest;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let (region, words) = RegionRequest::Whole.of(&scene, &[Vec3::new(0.3, 0.3, 0.4)]);
/// assert!((region.volume() - 0.75 * 0.75 * 0.5).abs() < 1e-15); // the box up to the top of the sphere, m^3
/// assert_eq!(words, "the whole bed");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub enum RegionRequest {
    /// The bed without its top.
    #[default]
    Bed,
    /// The container up to the highest point of any sphere.
    Whole,
    /// The box between two corners, m.
    Box {
        /// Lower corner, m.
        low: Vec3,
        /// Upper corner, m.
        high: Vec3,
    },
    /// An upright cylinder.
    Cylinder {
        /// x and y of the axis, m.
        axis: [f64; 2],
        /// Radius, m.
        radius: f64,
        /// Lower and upper end, m.
        ends: [f64; 2],
    },
}

impl RegionRequest {
    /// The region to measure in a bed of `scene` with the centres `x` (m), and its name.
    pub fn of(&self, scene: &Scene, x: &[Vec3]) -> (Region, &'static str) {
        let inner = match *self {
            RegionRequest::Box { low, high } => return (Region::Box { low, high }, "the box of --box"),
            RegionRequest::Cylinder { axis, radius, ends } => {
                return (Region::Cylinder { axis, radius, ends }, "the cylinder of --cylinder");
            }
            RegionRequest::Bed => bed_region(scene, x),
            RegionRequest::Whole => None,
        };
        let words = match inner {
            Some(_) => "the bed, without its top",
            None => "the whole bed",
        };
        let (low, high) = inner.unwrap_or_else(|| container_box(scene, x));
        (Region::Box { low, high }, words)
    }
}

/// The smallest box around spheres of radius `r` (m) with the centres `x` (m), as its two corners, m.
///
/// Without spheres it is the box around one sphere at the origin.
pub fn extent(x: &[Vec3], r: f64) -> (Vec3, Vec3) {
    let ends = |x: &Vec3| (x - Vec3::repeat(r), x + Vec3::repeat(r));
    let all = x.iter().map(ends).reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)));
    all.unwrap_or_else(|| ends(&Vec3::zeros()))
}

/// The box of the container, as its lower and upper corner, m.
///
/// An open side ends with the spheres, whose centres are `x` (m): an open top is at the bed height. The box
/// is at least one diameter wide in each open direction.
pub fn container_box(scene: &Scene, x: &[Vec3]) -> (Vec3, Vec3) {
    let r = scene.particles.radius;
    let (mut low, mut high) = extent(x, r);
    if let Some(sides) = &scene.container.r#box {
        for axis in 0..3 {
            let (from, to) = (sides.min[axis], sides.max[axis]);
            match (from.is_finite(), to.is_finite()) {
                (true, true) => (low[axis], high[axis]) = (from, to),
                (true, false) => (low[axis], high[axis]) = (from, high[axis].max(from + 2.0 * r)),
                (false, true) => (low[axis], high[axis]) = (low[axis].min(to - 2.0 * r), to),
                (false, false) => {}
            }
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing::boxed;

    #[test]
    fn open_sides_end_with_the_spheres() {
        let x = [Vec3::new(0.3, 0.4, 0.5), Vec3::new(0.6, 0.2, 0.9)];
        let (low, high) = container_box(&boxed("[0, 0, 0]", "[1, 2, inf]"), &x);
        assert_eq!((low, high), (Vec3::zeros(), Vec3::new(1.0, 2.0, 1.0)));
        let (low, high) = container_box(&boxed("[-inf, 0, -inf]", "[1, inf, inf]"), &x);
        assert!((low - Vec3::new(0.2, 0.0, 0.4)).amax() < 1e-15, "{low}");
        assert!((high - Vec3::new(1.0, 0.5, 1.0)).amax() < 1e-15, "{high}");
        // All spheres are below the floor.
        let (low, high) = container_box(&boxed("[0, 0, 7]", "[1, 1, inf]"), &x);
        assert_eq!((low.z, high.z), (7.0, 7.2));
    }
}
