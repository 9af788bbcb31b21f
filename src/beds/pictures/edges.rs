//! The edges of the container: lines in which two planes meet, as far as they are inside all other planes.

use crate::beds::measures::region::Upright;
use crate::math::polyhedron::{Half, Polyhedron, is_open};
use crate::math::vector::Vec3;
use crate::model::wall::Wall;

/// A straight edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Its ends, m.
    pub ends: [Vec3; 2],
    /// Length over which it fades out towards each end, m; 0: it does not fade.
    pub fades: [f64; 2],
}

/// The edges between `walls`, for a picture of spheres that end at `ends` (m) along the six ways of
/// `upright`.
///
/// The container is near in a direction if it ends at most half of the largest extent of the spheres beyond
/// them. Elsewhere the edges fade out at a limit above the spheres, as they do where the container is open.
pub fn edges(walls: &[Wall], upright: &Upright, ends: &[f64; 6]) -> Vec<Edge> {
    let extent = (0..3).map(|k| ends[2 * k] + ends[2 * k + 1]).fold(0.0, f64::max);
    let halves: Vec<Half> = walls.iter().map(Wall::half).collect();
    // The container, with open sides closed far outside.
    let ways = upright.ways();
    let mut closed = halves.clone();
    let mut open = [false; 6];
    for (k, way) in ways.iter().enumerate() {
        open[k] = is_open(&closed, way);
        if open[k] {
            closed.push(Half { n: *way, b: ends[k] + extent });
        }
    }
    let container = Polyhedron::of(&closed);
    let real = walls.len();
    let mut planes = walls.to_vec();
    for (k, way) in ways.iter().enumerate() {
        let end = container.reach(way);
        let is_near = !open[k] && end - ends[k] <= 0.5 * extent;
        // A limit outside a near end does not cut edges.
        let limit = if is_near { end.max(ends[k]) + 0.5 * extent } else { ends[k] + 0.2 * extent };
        planes.push(Wall::new(way * limit, *way));
    }
    let mut edges = Vec::new();
    for a in 0..real {
        for b in a + 1..real {
            edges.extend(common(&planes, a, b, real, 0.3 * extent));
        }
    }
    edges
}

/// The line that planes `a` and `b` share inside all others. It fades at ends cut by planes from `real` on.
fn common(planes: &[Wall], a: usize, b: usize, real: usize, fade: f64) -> Option<Edge> {
    let (first, second) = (&planes[a], &planes[b]);
    let along = first.normal.cross(&second.normal);
    let sine2 = along.norm_squared();
    if sine2 < 1e-12 {
        return None;
    }
    // The point on both planes that is nearest to the origin.
    let [p, q] = [first, second].map(|wall| wall.depth(&Vec3::zeros()));
    let point = (second.normal.cross(&along) * p + along.cross(&first.normal) * q) / sine2;
    let along = along / sine2.sqrt();
    let mut ends = [f64::NEG_INFINITY, f64::INFINITY];
    let mut cut_by = [None; 2];
    for (k, wall) in planes.iter().enumerate().filter(|(k, _)| *k != a && *k != b) {
        let (depth, slope) = (wall.depth(&point), wall.normal.dot(&along));
        if slope.abs() < 1e-9 {
            // The wall is parallel to the edge, so all of the edge is inside it, or nothing.
            if depth < -1e-9 * fade {
                return None;
            }
        } else {
            let (side, at) = (usize::from(slope > 0.0), depth / slope);
            if if side == 1 { at < ends[1] } else { at > ends[0] } {
                ends[side] = at;
                cut_by[side] = Some(k);
            }
        }
    }
    let length = ends[1] - ends[0];
    if !(length > 1e-9 * fade && length.is_finite()) {
        return None;
    }
    let fades = cut_by.map(|k| if k.is_some_and(|k| k >= real) { fade.min(length / 2.0) } else { 0.0 });
    Some(Edge { ends: ends.map(|at| point + along * at), fades })
}

impl Edge {
    /// How strongly the edge is drawn at the share `u` of the way between its ends, 0 to 1.
    pub fn strength(&self, u: f64) -> f64 {
        let length = (self.ends[1] - self.ends[0]).norm();
        let at = |fade: f64, away: f64| if fade > 0.0 { (away / fade).min(1.0) } else { 1.0 };
        at(self.fades[0], u * length) * at(self.fades[1], (1.0 - u) * length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::scene::{BoxSides, Container, WallPlane};

    /// The edges around spheres between the origin and `high` (m).
    fn edges_of(min: [f64; 3], max: [f64; 3], wall: Vec<WallPlane>, high: Vec3) -> Vec<Edge> {
        let container = Container { r#box: Some(BoxSides { min, max, material: None }), wall };
        let ends = [high.z, 0.0, high.x, 0.0, high.y, 0.0];
        edges(&crate::scene::walls::walls(&container), &Upright::default(), &ends)
    }

    #[test]
    fn a_closed_box_has_twelve_edges_with_firm_ends() {
        let edges = edges_of([0.0; 3], [1.0, 2.0, 1.5], vec![], Vec3::new(0.9, 1.9, 1.2));
        assert_eq!(edges.len(), 12);
        let total: f64 = edges.iter().map(|edge| (edge.ends[1] - edge.ends[0]).norm()).sum();
        assert!((total - 4.0 * 4.5).abs() < 1e-9, "{total}");
        assert!(edges.iter().all(|edge| edge.fades == [0.0; 2] && edge.strength(0.0) == 1.0));
    }

    #[test]
    fn an_open_box_has_four_edges_that_fade_above_the_spheres() {
        for top in [f64::INFINITY, 10.0] {
            let edges = edges_of([0.0; 3], [1.0, 1.0, top], vec![], Vec3::new(1.0, 1.0, 0.8));
            assert_eq!(edges.len(), 8, "{top}");
            let fading: Vec<&Edge> = edges.iter().filter(|edge| edge.fades != [0.0; 2]).collect();
            assert_eq!(fading.len(), 4);
            for edge in fading {
                let upper = usize::from(edge.ends[1].z > edge.ends[0].z);
                assert!((edge.ends[upper].z - 1.0).abs() < 1e-9 && edge.ends[1 - upper].z.abs() < 1e-9);
                assert!(edge.strength(upper as f64) == 0.0 && edge.strength(0.5) == 1.0);
            }
        }
    }

    #[test]
    fn an_oblique_wall_cuts_the_box() {
        // This wall cuts off the corner at x = z = 0.
        let wall = WallPlane { point: [0.5, 0.0, 0.0], normal: [-1.0, 0.0, -1.0], material: None };
        let edges = edges_of([0.0; 3], [1.0; 3], vec![wall], Vec3::repeat(1.0));
        // The result is a prism over a pentagon.
        assert_eq!(edges.len(), 15);
        let inside = |x: &Vec3| x.x + x.z > 0.5 - 1e-9;
        assert!(edges.iter().flat_map(|edge| &edge.ends).all(inside));
    }

    #[test]
    fn a_tube_of_planes_has_two_rings_or_one_below_an_open_top() {
        let sides = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / 24.0;
            Wall::new(Vec3::new(angle.cos(), angle.sin(), 0.0), Vec3::new(angle.cos(), angle.sin(), 0.0))
        };
        let mut walls: Vec<Wall> = (0..24).map(sides).collect();
        walls.push(Wall::new(Vec3::zeros(), -Vec3::z()));
        let ends = [1.5, 0.0, 0.9, 0.9, 0.9, 0.9];
        let open = edges(&walls, &Upright::default(), &ends);
        assert_eq!(open.len(), 24 + 24);
        assert_eq!(open.iter().filter(|edge| edge.fades != [0.0; 2]).count(), 24);
        walls.push(Wall::new(Vec3::z() * 1.6, Vec3::z()));
        let closed = edges(&walls, &Upright::default(), &ends);
        assert_eq!(closed.len(), 24 + 24 + 24);
        assert!(closed.iter().all(|edge| edge.fades == [0.0; 2]));
    }
}
