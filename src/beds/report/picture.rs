//! A small picture of the bed from the front as SVG, with the farthest spheres drawn first.

use std::fmt::Write;

use crate::beds::measures::region::{Region, Side};
use crate::beds::measures::request::RegionRequest;
use crate::math::polyhedron::across;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::scene::Scene;

/// Largest number of spheres that are drawn.
const MOST: usize = 4000;
/// Longer side of the picture, px.
const SIDE: f64 = 420.0;

/// The spheres with the centres `x` (m) and these `sizes`, and the walls around them, as an `svg` element.
///
/// They are seen along y if z is up, and across gravity in any case. `None` if there are too many of them.
pub fn picture(scene: &Scene, x: &[Vec3], sizes: Sizes) -> Option<String> {
    if x.len() > MOST {
        return None;
    }
    let (region, _) = RegionRequest::Whole.of(scene, x, sizes);
    let up = region.upright.up;
    let (right, away) = across(&up);
    let end = |way: Vec3| {
        let ends = x.iter().enumerate().map(|(i, x)| way.dot(x) + sizes.of(i).r);
        let spheres = ends.fold(f64::NEG_INFINITY, f64::max);
        if region.is_empty() { spheres } else { spheres.max(region.reach(&way)) }
    };
    let (left, width) = (-end(-right), end(right) + end(-right));
    let bottom = -end(-up);
    // Leave out a lid that is high above the bed, because the bed would be small.
    let tops = x.iter().enumerate().map(|(i, x)| up.dot(x) + sizes.of(i).r);
    let top = tops.fold(bottom + 2.0 * scene.particles.radius, f64::max);
    let scale = SIDE / width.max(top - bottom);
    let (width, height) = (scale * width, scale * (top - bottom));
    let place = |x: &Vec3| [scale * (right.dot(x) - left), scale * (top - up.dot(x))];
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| away.dot(&x[b]).total_cmp(&away.dot(&x[a])));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-2 -2 {:.1} {:.1}\" width=\"{:.0}\" \
         role=\"img\" aria-label=\"the bed from the front\">\n\
         <defs><radialGradient id=\"ball\" cx=\"0.35\" cy=\"0.3\" r=\"0.8\">\
         <stop offset=\"0\" stop-color=\"#e8f1f8\"/><stop offset=\"0.5\" stop-color=\"#5c9cc9\"/>\
         <stop offset=\"1\" stop-color=\"#12466b\"/></radialGradient></defs>\n",
        width + 4.0,
        height + 4.0,
        width + 4.0
    );
    for i in order {
        let [column, row] = place(&x[i]);
        let _ = writeln!(
            svg,
            "<circle cx=\"{column:.1}\" cy=\"{row:.1}\" r=\"{:.2}\" fill=\"url(#ball)\"/>",
            scale * sizes.of(i).r
        );
    }
    let lines: String = wall_edges(&region).iter().map(|ends| line(ends.map(|end| place(&end)))).collect();
    if !lines.is_empty() {
        let _ = writeln!(svg, "<path d=\"{lines}\" fill=\"none\" stroke=\"#555\" stroke-width=\"1.5\"/>");
    }
    svg.push_str("</svg>");
    Some(svg)
}

/// The edges of all walls around a region, as their ends, m. Those of its open sides are left out.
fn wall_edges(region: &Region) -> Vec<[Vec3; 2]> {
    let (low, high) = region.bounds();
    let tiny = 1e-9 * (high - low).norm();
    let open: Vec<_> = region.sides().iter().filter(|(_, side)| *side == Side::End).collect();
    let on_one =
        |ends: &[Vec3; 2]| open.iter().any(|(half, _)| ends.iter().all(|end| half.beyond(end).abs() <= tiny));
    let edges = region.body().faces.iter().flat_map(|face| {
        let corners = &face.corners;
        (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]])
    });
    edges.filter(|ends| !on_one(ends)).collect()
}

/// A line between two points of the picture, as part of a path.
fn line([[a, b], [c, d]]: [[f64; 2]; 2]) -> String {
    format!("M{a:.1} {b:.1}L{c:.1} {d:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing::{alike, scene};
    use crate::model::size::Size;

    #[test]
    fn the_bed_stands_upright_whatever_the_direction_of_gravity() {
        let below = |svg: &str| {
            let rows =
                svg.split("cy=\"").skip(2).map(|rest| rest.split('"').next().unwrap().parse().unwrap());
            rows.collect::<Vec<f64>>()
        };
        for (gravity, low, high) in [
            ("[0, 0, -9.81]", [0.5, 0.5, 0.1], [0.5, 0.5, 0.9]),
            ("[-9.81, 0, 0]", [0.1, 0.5, 0.5], [0.9, 0.5, 0.5]),
            ("[0, 9.81, 0]", [0.5, 0.9, 0.5], [0.5, 0.1, 0.5]),
        ] {
            let scene = scene(&format!(
                "gravity = {gravity}\ncontainer.box = {{ min = [0, 0, 0], max = [1, 1, 1] }}"
            ));
            let svg = picture(&scene, &[low.into(), high.into()], alike(&scene)).unwrap();
            let rows = below(&svg);
            // The box is 1 m high; the lid is left out above the highest sphere, which ends at it here.
            assert!((rows[0] - 0.9 * SIDE).abs() < 0.1 && (rows[1] - 0.1 * SIDE).abs() < 0.1, "{rows:?}");
            // Twelve edges, each for two faces.
            assert_eq!(svg.matches('M').count(), 24);
        }
    }

    #[test]
    fn open_sides_have_no_line() {
        let open = scene("container.box = { min = [0, 0, 0], max = [1, 1, inf] }");
        let svg = picture(&open, &[Vec3::repeat(0.5)], alike(&open)).unwrap();
        // Without the four edges of the open top.
        assert_eq!(svg.matches('M').count(), 16);
        let free = scene("");
        assert!(!picture(&free, &[Vec3::repeat(0.5)], alike(&free)).unwrap().contains("path"));
    }

    #[test]
    fn spheres_are_as_large_as_they_are() {
        let sizes = [Size::new(0.3, 1.0), Size::new(0.1, 1.0)];
        let x = [Vec3::new(0.3, 0.3, 0.3), Vec3::new(0.9, 0.3, 0.1)];
        let open = scene("container.box = { min = [0, 0, 0], max = [1, 1, inf] }");
        let svg = picture(&open, &x, Sizes::Each(&sizes)).unwrap();
        let radii: Vec<&str> = svg.split(" r=\"").skip(2).filter_map(|rest| rest.split('"').next()).collect();
        assert_eq!(radii, [format!("{:.2}", 0.3 * SIDE), format!("{:.2}", 0.1 * SIDE)]);
    }
}
