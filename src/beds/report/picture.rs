//! A small picture of the bed from the front as SVG, with the farthest spheres drawn first.

use std::fmt::Write;

use crate::beds::measures::region;
use crate::math::vector::Vec3;
use crate::scene::Scene;

/// Largest number of spheres that are drawn.
const MOST: usize = 4000;
/// Longer side of the picture, px.
const SIDE: f64 = 420.0;

/// The spheres of radius `scene.particles.radius` around `x` (m), viewed along y, as an `svg` element.
///
/// `None` if there are too many of them.
pub fn picture(scene: &Scene, x: &[Vec3]) -> Option<String> {
    if x.len() > MOST {
        return None;
    }
    let r = scene.particles.radius;
    let (low, high) = region::extent(x, r);
    let (sides_low, sides_high) = region::container_box(scene, x);
    let finite = |value: f64, fallback: f64| if value.is_finite() { value } else { fallback };
    let left = finite(sides_low.x.min(low.x), low.x);
    let right = finite(sides_high.x.max(high.x), high.x);
    let bottom = finite(sides_low.z.min(low.z), low.z);
    // Leave out a lid that is high above the bed, because the bed would be small.
    let top = high.z.max(bottom + 2.0 * r);
    let scale = SIDE / (right - left).max(top - bottom);
    let (width, height) = (scale * (right - left), scale * (top - bottom));
    let mut order: Vec<&Vec3> = x.iter().collect();
    order.sort_by(|a, b| b.y.total_cmp(&a.y));
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
    for x in order {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.2}\" fill=\"url(#ball)\"/>",
            scale * (x.x - left),
            scale * (top - x.z),
            scale * r
        );
    }
    if scene.container.r#box.is_some() {
        let _ = writeln!(
            svg,
            "<path d=\"M0 0V{height:.1}H{width:.1}V0\" fill=\"none\" stroke=\"#555\" stroke-width=\"1.5\"/>"
        );
    }
    svg.push_str("</svg>");
    Some(svg)
}
