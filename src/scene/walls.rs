//! The walls of a scene: the sides of its box and the planes of `container.wall`.

use crate::math::digits::{short, triple};
use crate::math::polyhedron::{Half, lowest};
use crate::math::vector::Vec3;
use crate::model::wall::Wall;
use crate::scene;

/// The walls of a scene, each with its short name and a description for messages.
///
/// They are in the order in which their forces are summed. First come the finite sides of the box (min x,
/// max x, min y, max y, min z, max z), then `container.wall`.
fn named_walls(container: &scene::Container) -> Vec<(Wall, String, String)> {
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
                    let name = format!("{letter} = {} m", short(position));
                    let words = format!("the side {name} of the box (container.box.{corner})");
                    walls.push((Wall::new(along(position), along(sign)), name, words));
                }
            }
        }
    }
    walls.extend(container.wall.iter().enumerate().map(|(number, wall)| {
        let name = format!("container.wall[{number}]");
        let (point, normal) = (triple(&wall.point), triple(&wall.normal));
        let words = format!("{name} (point {point} m, outward normal {normal})");
        (Wall::new(wall.point.into(), wall.normal.into()), name, words)
    }));
    walls
}

/// The walls of a scene, each with a description for messages, in the order in which their forces are summed.
pub fn described_walls(container: &scene::Container) -> Vec<(Wall, String)> {
    named_walls(container).into_iter().map(|(wall, _, words)| (wall, words)).collect()
}

/// The short names of the walls of a scene for tables, in the order of [`described_walls`]: `z = 0 m` for a
/// side of the box, and `container.wall[0]`.
pub fn wall_names(container: &scene::Container) -> Vec<String> {
    named_walls(container).into_iter().map(|(_, name, _)| name).collect()
}

/// The walls of a scene, in the order of [`described_walls`].
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::walls::walls;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let walls = walls(&scene.container);
/// assert_eq!(walls.len(), 5); // a box without a lid
/// assert_eq!(walls[4].depth(&Vec3::new(0.1, 0.2, 0.3)), 0.3); // the floor, m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn walls(container: &scene::Container) -> Vec<Wall> {
    named_walls(container).into_iter().map(|(wall, ..)| wall).collect()
}

/// The unit vector against `gravity` (m/s^2); z without gravity.
pub fn upwards(gravity: &Vec3) -> Vec3 {
    (-gravity).try_normalize(0.0).unwrap_or(Vec3::z())
}

/// The height (m) from which heights are measured, along the unit vector `up` from the origin.
///
/// It is the lowest point inside all walls; that of the origin where the walls leave the bottom open.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::wall::Wall;
/// use demhybrid::scene::walls::ground;
///
/// let floor = Wall::new(Vec3::new(0.0, 0.0, -3.0), -Vec3::z());
/// assert_eq!(ground(&[floor], &Vec3::z()), -3.0);
/// assert_eq!(ground(&[floor], &Vec3::x()), 0.0); // nothing is below
/// ```
pub fn ground(walls: &[Wall], up: &Vec3) -> f64 {
    let halves: Vec<Half> = walls.iter().map(Wall::half).collect();
    lowest(&halves, up).unwrap_or(0.0)
}

/// Two walls that face each other from behind, so that nothing is inside of both: index and name of each.
pub(super) fn walls_without_room(container: &scene::Container) -> Option<[(usize, String); 2]> {
    let walls = described_walls(container);
    let origin = Vec3::zeros();
    // The room between two planes with opposite normals is the sum of the depths of any point.
    let no_room = |a: &Wall, b: &Wall| {
        (a.normal + b.normal).norm() < 1e-12 && a.depth(&origin) + b.depth(&origin) <= 0.0
    };
    walls.iter().enumerate().find_map(|(k, (b, second))| {
        let (j, (_, first)) = walls[..k].iter().enumerate().find(|(_, (a, _))| no_room(a, b))?;
        Some([(j, first.clone()), (k, second.clone())])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_that_face_each_other_from_behind_leave_no_room() {
        let plane = |z, up| scene::WallPlane { point: [0.5, 0.5, z], normal: [0.0, 0.0, up], material: None };
        let of = |wall: Vec<scene::WallPlane>| {
            walls_without_room(&scene::Container { r#box: None, wall }).map(|pair| pair.map(|(k, _)| k))
        };
        assert_eq!(of(vec![plane(0.0, -1.0), plane(1.0, 2.0)]), None);
        assert_eq!(of(vec![plane(2.0, -1.0), plane(1.0, 2.0)]), Some([0, 1]));
        assert_eq!(of(vec![plane(0.0, -1.0), plane(1.0, -1.0), plane(1.0, 1.0)]), Some([1, 2]));
    }

    #[test]
    fn open_sides_have_no_wall() {
        let sides = scene::BoxSides { min: [0.0, 0.0, 0.0], max: [1.0, 2.0, f64::INFINITY], material: None };
        let wall = scene::WallPlane { point: [0.0, 0.0, 9.0], normal: [0.0, 1.0, 1.0], material: None };
        let container = scene::Container { r#box: Some(sides), wall: vec![wall] };
        let walls = walls(&container);
        assert_eq!(walls.len(), 6);
        let centre = Vec3::new(0.25, 0.5, 0.75);
        let depths: Vec<f64> = walls.iter().map(|w| w.depth(&centre)).collect();
        assert_eq!(depths[..5], [0.25, 0.75, 0.5, 1.5, 0.75]);
        assert!((depths[5] - (9.0 - 1.25) / 2f64.sqrt()).abs() < 1e-14);
        let names = ["x = 0 m", "x = 1 m", "y = 0 m", "y = 2 m", "z = 0 m", "container.wall[0]"];
        assert_eq!(wall_names(&container), names);
        let described = described_walls(&container);
        assert!(names.iter().zip(&described).all(|(name, (_, words))| words.contains(name)), "{described:?}");
    }
}
