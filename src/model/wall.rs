//! Planar walls. Together they bound a convex container, which may be open on some sides.

use crate::math::polyhedron::Half;
use crate::math::vector::Vec3;

/// A planar wall. Its normal points away from the particles.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::wall::Wall;
///
/// let floor = Wall::new(Vec3::new(0.0, 0.0, 0.5), Vec3::new(0.0, 0.0, -2.0));
/// assert_eq!(floor.normal, -Vec3::z()); // of length 1
/// assert_eq!(floor.depth(&Vec3::new(7.0, 3.0, 2.0)), 1.5); // m above the floor
/// assert_eq!(floor.depth(&Vec3::zeros()), -0.5); // below it
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// Unit normal, pointing out of the container.
    pub normal: Vec3,
    /// Distance of the plane from the origin along `normal`, m.
    offset: f64,
}

impl Wall {
    /// The plane through `point` (m) with the outward `normal`, which may have any length except 0.
    pub fn new(point: Vec3, normal: Vec3) -> Self {
        // Divide by the largest component first, so that no square overflows or underflows.
        let normal = (normal / normal.amax()).normalize();
        Wall { normal, offset: normal.dot(&point) }
    }

    /// Whether the other wall is the same plane, given that both have the same normal.
    pub fn coincides(&self, other: &Wall) -> bool {
        (self.offset - other.offset).abs() <= 1e-12 * self.offset.abs().max(1.0)
    }

    /// The points inside the wall.
    pub fn half(&self) -> Half {
        Half { n: self.normal, b: self.offset }
    }

    /// Distance of the point `x` (m) from the plane, m: positive inside the container, negative beyond the
    /// plane.
    #[inline(always)]
    pub fn depth(&self, x: &Vec3) -> f64 {
        self.offset - self.normal.dot(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_measured_inwards() {
        let floor = Wall::new(Vec3::new(5.0, 3.0, 0.5), Vec3::new(0.0, 0.0, -7.0));
        assert_eq!(floor.normal, -Vec3::z());
        assert_eq!(floor.depth(&Vec3::new(1.0, 1.0, 2.0)), 1.5);
        assert_eq!(floor.depth(&Vec3::new(1.0, 1.0, 0.0)), -0.5);
    }
}
