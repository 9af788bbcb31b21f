//! Surfaces as binary STL. A sphere is an icosahedron with divided triangles, projected onto a sphere.
//!
//! That sphere is a little larger than the particle, so that the triangles enclose the volume of the
//! particle.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::io::{self, Write};

use super::FrameData;
use crate::error::Error;
use crate::math::vector::Vec3;

/// Triangles around the origin: the corners, and three indices for each triangle.
///
/// The corners of a triangle are counter-clockwise from outside.
struct Mesh {
    corners: Vec<Vec3>,
    triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// The regular icosahedron, with its triangles divided into four `subdivisions` times.
    fn icosphere(subdivisions: u32) -> Self {
        let golden = (1.0 + 5f64.sqrt()) / 2.0;
        let mut corners = Vec::new();
        for axis in 0..3 {
            for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
                let mut corner = Vec3::zeros();
                corner[(axis + 1) % 3] = a;
                corner[(axis + 2) % 3] = b;
                corners.push(corner.normalize());
            }
        }
        let edge = 2.0 / (1.0 + golden * golden).sqrt();
        let near = |i: usize, j: usize| (corners[i] - corners[j]).norm() < 1.01 * edge;
        let mut triangles = Vec::new();
        for i in 0..12 {
            for j in i + 1..12 {
                for k in j + 1..12 {
                    if near(i, j) && near(j, k) && near(k, i) {
                        let outward = (corners[j] - corners[i]).cross(&(corners[k] - corners[i]));
                        triangles.push(if outward.dot(&corners[i]) > 0.0 { [i, j, k] } else { [i, k, j] });
                    }
                }
            }
        }
        let mut mesh = Mesh { corners, triangles };
        (0..subdivisions).for_each(|_| mesh.divide());
        mesh
    }

    /// The same with the volume of the unit sphere.
    fn of_equal_volume(subdivisions: u32) -> Self {
        let mut mesh = Mesh::icosphere(subdivisions);
        let reach = (4.0 / 3.0 * PI / mesh.volume()).cbrt();
        mesh.corners.iter_mut().for_each(|corner| *corner *= reach);
        mesh
    }

    /// Volume within the triangles: a sum of tetrahedra with one corner at the origin.
    fn volume(&self) -> f64 {
        let tetrahedron =
            |&[i, j, k]: &[usize; 3]| self.corners[i].dot(&self.corners[j].cross(&self.corners[k])) / 6.0;
        self.triangles.iter().map(tetrahedron).sum()
    }

    fn divide(&mut self) {
        let mut middles: HashMap<[usize; 2], usize> = HashMap::new();
        let corners = &mut self.corners;
        let mut middle = |i: usize, j: usize| {
            *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                corners.push((corners[i] + corners[j]).normalize());
                corners.len() - 1
            })
        };
        self.triangles = self
            .triangles
            .iter()
            .flat_map(|&[i, j, k]| {
                let [a, b, c] = [middle(i, j), middle(j, k), middle(k, i)];
                [[i, a, c], [a, j, b], [c, b, k], [a, b, c]]
            })
            .collect();
    }
}

/// Distance of the corners of a sphere's triangles from its centre, in radii.
pub fn reach(subdivisions: u32) -> f64 {
    Mesh::of_equal_volume(subdivisions).corners[0].norm()
}

fn triangles(frame: &FrameData, subdivisions: u32) -> u64 {
    frame.state.x.len() as u64 * 20 * 4u64.pow(subdivisions)
}

/// Refuses more triangles than the format can count.
pub fn check(frame: &FrameData, subdivisions: u32) -> Result<(), Error> {
    let count = triangles(frame, subdivisions);
    if count > u64::from(u32::MAX) {
        return Err(Error::Input(format!(
            "--subdivisions {subdivisions}: {count} triangles for {} spheres, and STL counts to {}: \
             choose a smaller number",
            frame.state.x.len(),
            u32::MAX
        )));
    }
    Ok(())
}

/// Writes the surfaces, in m. Overlapping spheres are not joined.
pub fn write(frame: &FrameData, subdivisions: u32, out: &mut dyn Write) -> io::Result<()> {
    let mesh = Mesh::of_equal_volume(subdivisions);
    let mut head = [b' '; 80];
    let text = b"demhybrid, binary STL, m";
    head[..text.len()].copy_from_slice(text);
    out.write_all(&head)?;
    out.write_all(&(triangles(frame, subdivisions) as u32).to_le_bytes())?;
    let sizes = frame.sizes();
    for (i, &x) in frame.state.x.iter().enumerate() {
        let (centre, r) = (Vec3::from(x), sizes.of(i).r);
        for triangle in &mesh.triangles {
            let corners = triangle.map(|k| mesh.corners[k]);
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
            for vector in [normal].into_iter().chain(corners.map(|corner| centre + corner * r)) {
                for number in vector.iter() {
                    out.write_all(&(*number as f32).to_le_bytes())?;
                }
            }
            out.write_all(&[0; 2])?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_icosphere_is_closed_points_outwards_and_approaches_the_sphere() {
        for (subdivisions, missing) in [(0, 0.4), (2, 0.05), (4, 0.003)] {
            let mesh = Mesh::icosphere(subdivisions);
            assert_eq!(mesh.triangles.len(), 20 * 4usize.pow(subdivisions));
            // Euler's formula: V - E + F = 2 with E = 3/2 F.
            assert_eq!(mesh.corners.len(), 2 + mesh.triangles.len() / 2);
            let mut edges = std::collections::HashSet::new();
            for &[i, j, k] in &mesh.triangles {
                for edge in [[i, j], [j, k], [k, i]] {
                    assert!(edges.insert(edge), "twice in one direction: {edge:?}");
                }
            }
            assert!(edges.iter().all(|&[i, j]| edges.contains(&[j, i])));
            let share = mesh.volume() / (4.0 / 3.0 * PI);
            assert!(share < 1.0 && share > 1.0 - missing, "{subdivisions}: {share}");
            let equal = Mesh::of_equal_volume(subdivisions).volume() / (4.0 / 3.0 * PI);
            assert!((equal - 1.0).abs() < 1e-12, "{subdivisions}: {equal}"); // round-off of a sum
            assert!((reach(subdivisions).powi(3) * share - 1.0).abs() < 1e-12);
        }
    }
    #[test]
    fn the_triangles_of_each_sphere_have_its_own_volume() {
        let (scene, state, _) = crate::beds::export::testing::sized();
        let frame = FrameData { scene: &scene, state: &state, species: None };
        let mut bytes = Vec::new();
        write(&frame, 1, &mut bytes).unwrap();
        let number = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
        for (i, size) in state.sizes.iter().enumerate() {
            let mut volume = 0.0;
            for triangle in 80 * i..80 * (i + 1) {
                let corner = |k: usize| {
                    let at = 84 + 50 * triangle + 12 * (k + 1);
                    Vec3::from_fn(|axis, _| number(at + 4 * axis)) - Vec3::from(state.x[i])
                };
                volume += corner(0).dot(&corner(1).cross(&corner(2))) / 6.0;
            }
            // Coordinates have single precision.
            let share = volume / (4.0 / 3.0 * PI * size.r.powi(3));
            assert!((share - 1.0).abs() < 1e-5, "{i}: {share}");
        }
    }
}
