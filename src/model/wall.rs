//! Planar walls: a convex region that keeps the particles in, open where no plane closes it.

use crate::math::vector::Vec3;

/// A plane; particles are on the side that its normal points away from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// Unit normal, pointing out of the container.
    pub normal: Vec3,
    /// Distance of the plane from the origin along `normal`, m.
    offset: f64,
}

impl Wall {
    /// The plane through `point` (m) with the outward `normal` of any length but 0.
    pub fn new(point: Vec3, normal: Vec3) -> Self {
        // Scaled by the largest component first, so that no square overflows or vanishes.
        let normal = (normal / normal.amax()).normalize();
        Wall { normal, offset: normal.dot(&point) }
    }

    /// The other wall, whose normal is the same, is the same plane.
    pub fn coincides(&self, other: &Wall) -> bool {
        (self.offset - other.offset).abs() <= 1e-12 * self.offset.abs().max(1.0)
    }

    /// How far inside the plane `x` lies, m; negative beyond it.
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
