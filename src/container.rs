//! Planar walls: a convex region that keeps the particles in, open where no plane closes it.

use crate::particle::Vec3;
use crate::scene;

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

/// The walls of a scene, each with words that a user recognises. Their order is also the order in which their forces
/// are summed: finite sides of the box (min x, max x, min y, max y, min z, max z), then `container.wall`.
pub fn described_walls(container: &scene::Container) -> Vec<(Wall, String)> {
    let mut walls = Vec::new();
    if let Some(sides) = &container.r#box {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            for (corner, position, sign) in [("min", sides.min[axis], -1.0), ("max", sides.max[axis], 1.0)] {
                if position.is_finite() {
                    let along = |length: f64| {
                        let mut v = Vec3::zeros();
                        v[axis] = length;
                        v
                    };
                    let name =
                        format!("the side {letter} = {position} m of the box (container.box.{corner})");
                    walls.push((Wall::new(along(position), along(sign)), name));
                }
            }
        }
    }
    walls.extend(container.wall.iter().enumerate().map(|(number, wall)| {
        let name = format!(
            "container.wall[{number}] (point {} m, outward normal {})",
            triple(&wall.point),
            triple(&wall.normal)
        );
        (Wall::new(wall.point.into(), wall.normal.into()), name)
    }));
    walls
}

/// The walls of a scene, in the same order.
pub fn walls(container: &scene::Container) -> Vec<Wall> {
    described_walls(container).into_iter().map(|(wall, _)| wall).collect()
}

/// A vector in round brackets, for messages.
pub(crate) fn triple(vector: &[f64; 3]) -> String {
    let [x, y, z] = vector.map(short);
    format!("({x}, {y}, {z})")
}

/// Six digits are enough to find a number again.
pub(crate) fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.5e}").parse().unwrap_or(number);
    match rounded.abs() {
        1e-4..1e7 | 0.0 => format!("{rounded}"),
        _ => format!("{rounded:e}"),
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

    #[test]
    fn open_sides_have_no_wall() {
        let sides = scene::BoxSides { min: [0.0, 0.0, 0.0], max: [1.0, 2.0, f64::INFINITY] };
        let wall = scene::WallPlane { point: [0.0, 0.0, 9.0], normal: [0.0, 1.0, 1.0] };
        let container = scene::Container { r#box: Some(sides), wall: vec![wall] };
        let walls = walls(&container);
        assert_eq!(walls.len(), 6);
        let centre = Vec3::new(0.25, 0.5, 0.75);
        let depths: Vec<f64> = walls.iter().map(|w| w.depth(&centre)).collect();
        assert_eq!(depths[..5], [0.25, 0.75, 0.5, 1.5, 0.75]);
        assert!((depths[5] - (9.0 - 1.25) / 2f64.sqrt()).abs() < 1e-14);
    }
}
