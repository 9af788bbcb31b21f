//! Regions: what walls enclose, as far as spheres reach or a user asks.

use std::f64::consts::{PI, TAU};

use super::flat::Flat;
use super::quadrature::integral;
use crate::math::polyhedron::{Half, Polyhedron, across};
use crate::math::vector::Vec3;
use crate::scene::Scene;
use crate::scene::walls::{ground, upwards, walls};

/// Sides of the prism inside a cylinder in which pairs of centres are counted. It has 0.995 of its section.
const SIDES_OF_PRISM: usize = 36;

/// What bounds a region on one side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The wall of this index in the list of [`crate::scene::walls::walls`].
    Wall(usize),
    /// No wall. The region ends with the spheres.
    End,
    /// A plane that the user asked for.
    Cut,
    /// A plane around a cylinder, which takes nothing from it.
    Around,
}

/// An upright cylinder, endless along z: x and y of its axis, and its radius, m.
pub type Pillar = ([f64; 2], f64);

/// The directions of a scene, and the height from which heights are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upright {
    /// Unit vector against gravity; z without gravity.
    pub up: Vec3,
    /// Two unit vectors across it. The first one is across the first wall that is not level, if there is one.
    pub across: [Vec3; 2],
    /// Height of the lowest point inside all walls, m; 0 if the walls leave the bottom open.
    pub ground: f64,
}

impl Upright {
    /// The directions of `scene`.
    ///
    /// They turn with walls and gravity, so a bed that is turned as a whole has the same measures.
    pub fn of(scene: &Scene) -> Self {
        let up = upwards(&scene.gravity.into());
        let walls = walls(&scene.container);
        let level = |n: &Vec3| n - up * n.dot(&up);
        let first = walls.iter().map(|wall| level(&wall.normal)).find(|part| part.norm() > 1e-6);
        let u = first.map_or_else(|| across(&up).0, |part| part.normalize());
        Upright { up, across: [u, up.cross(&u)], ground: ground(&walls, &up) }
    }

    /// Height of `x` (m) above the ground, m.
    pub fn height(&self, x: &Vec3) -> f64 {
        self.up.dot(x) - self.ground
    }

    /// Up, down, and both ways along the two directions across.
    pub fn ways(&self) -> [Vec3; 6] {
        let [u, v] = self.across;
        [self.up, -self.up, u, -u, v, -v]
    }
}

/// A convex part of space: a polyhedron, perhaps inside a cylinder along z.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::region::Region;
/// use demhybrid::math::vector::Vec3;
///
/// let tube = Region::cylinder([0.0, 0.0], 0.5, [0.0, 2.0]);
/// assert!((tube.volume() - std::f64::consts::PI / 2.0).abs() < 1e-14); // m^3
/// assert!(tube.holds(&Vec3::new(0.3, 0.3, 1.0)) && !tube.holds(&Vec3::new(0.4, 0.4, 1.0)));
/// assert!((tube.section(&Vec3::x(), 0.0) - 2.0).abs() < 1e-14); // m^2, through the axis
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The planes that bound it, each with what it is. None of them is idle.
    sides: Vec<(Half, Side)>,
    /// What the planes enclose.
    body: Polyhedron,
    pillar: Option<Pillar>,
    /// The directions in which it is measured.
    pub upright: Upright,
}

impl Region {
    /// What all `sides` enclose inside `pillar`. The sides must enclose a bounded part of space.
    pub fn new(sides: Vec<(Half, Side)>, pillar: Option<Pillar>, upright: Upright) -> Self {
        let halves: Vec<Half> = sides.iter().map(|(half, _)| *half).collect();
        let body = Polyhedron::of(&halves);
        let mut used: Vec<usize> = body.faces.iter().filter_map(|face| face.source).collect();
        used.sort_unstable();
        Region { sides: used.into_iter().map(|k| sides[k]).collect(), body, pillar, upright }
    }

    /// The box between two corners, m, with z up.
    pub fn cuboid(low: Vec3, high: Vec3) -> Self {
        Region::new(box_sides(&low, &high, Side::Cut), None, Upright::default())
    }

    /// The cylinder of a radius (m) around the axis through x and y, between two heights along z (m).
    pub fn cylinder(axis: [f64; 2], radius: f64, ends: [f64; 2]) -> Self {
        Region::new(cylinder_sides(axis, radius, ends), Some((axis, radius)), Upright::default())
    }

    /// Volume, m^3.
    pub fn volume(&self) -> f64 {
        let Some((_, radius)) = self.pillar else { return self.body.volume() };
        let mut heights: Vec<f64> = self.body.corners().map(|x| x.z).collect();
        heights.sort_unstable_by(f64::total_cmp);
        let tiny = 1e-12 * radius;
        heights.dedup_by(|b, a| *b - *a <= tiny);
        let part = |ends: &[f64]| {
            let tolerance = 1e-12 * radius * radius * (ends[1] - ends[0]);
            integral(&mut |z| self.section(&Vec3::z(), z), [ends[0], ends[1]], tolerance)
        };
        heights.windows(2).map(part).sum()
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.volume() <= 0.0
    }

    /// Lower and upper corner of the smallest box around the polyhedron, m.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.body.bounds()
    }

    /// The two corners of the region, m, if it is a box along the axes.
    pub fn as_box(&self) -> Option<(Vec3, Vec3)> {
        let along_axis = |(half, _): &(Half, Side)| half.n.amax() == 1.0;
        (self.pillar.is_none() && self.sides.iter().all(along_axis)).then(|| self.bounds())
    }

    /// The largest distance of a point of the polyhedron from the origin along the unit vector `along`, m.
    pub fn reach(&self, along: &Vec3) -> f64 {
        self.body.reach(along)
    }

    /// Area of the section with the plane of all points whose distance from the origin along the unit vector
    /// `n` is `at` (m), m^2. `n` must be along or across the axis of a cylinder.
    pub fn section(&self, n: &Vec3, at: f64) -> f64 {
        self.section_within(&self.halves(), n, at)
    }

    /// The same inside `halves`, which may take the place of the planes of the region.
    pub fn section_within(&self, halves: &[Half], n: &Vec3, at: f64) -> f64 {
        let (low, high) = self.bounds();
        let middle = (low + high) / 2.0;
        let centre = middle + n * (at - n.dot(&middle));
        let mut flat = Flat::default();
        flat.within([0.0; 2], (high - low).norm());
        cut_section(&mut flat, n, &centre, halves, self.pillar);
        flat.area()
    }

    /// Whether `x` (m) is inside.
    pub fn holds(&self, x: &Vec3) -> bool {
        !self.body.faces.is_empty()
            && self.sides.iter().all(|(half, _)| half.beyond(x) <= 0.0)
            && self.pillar.is_none_or(|(axis, radius)| (x.x - axis[0]).hypot(x.y - axis[1]) <= radius)
    }

    /// The planes that bound the region, without those around a cylinder.
    pub fn halves(&self) -> Vec<Half> {
        self.sides.iter().filter(|(_, side)| *side != Side::Around).map(|(half, _)| *half).collect()
    }

    /// The cylinder that bounds the region.
    pub fn pillar(&self) -> Option<Pillar> {
        self.pillar
    }

    /// The planes that bound the region, each with what it is.
    pub fn sides(&self) -> &[(Half, Side)] {
        &self.sides
    }

    /// What the planes enclose.
    pub fn body(&self) -> &Polyhedron {
        &self.body
    }

    /// The part of the region in which the centres of spheres of radius `r` (m) can lie.
    ///
    /// It keeps a distance of one radius from walls, and from where the region ends with the spheres. A prism
    /// of many sides takes the place of a cylinder, which it almost fills.
    pub fn room_of_centres(&self, r: f64) -> Polyhedron {
        let inner = |(half, side): &(Half, Side)| match side {
            Side::Wall(_) | Side::End => Some(Half { b: half.b - r, ..*half }),
            Side::Cut => Some(*half),
            Side::Around => None,
        };
        let mut halves: Vec<Half> = self.sides.iter().filter_map(inner).collect();
        if let Some(([x, y], radius)) = self.pillar {
            halves.extend((0..SIDES_OF_PRISM).map(|k| {
                let angle = TAU * k as f64 / SIDES_OF_PRISM as f64;
                let n = Vec3::new(angle.cos(), angle.sin(), 0.0);
                let inscribed = radius * (PI / SIDES_OF_PRISM as f64).cos();
                Half { n, b: inscribed }.moved(&Vec3::new(x, y, 0.0))
            }));
        }
        Polyhedron::of(&halves)
    }

    /// The least distance of two upright planes with the polyhedron between them, m.
    pub fn least_width(&self) -> f64 {
        least_width(&self.body, &self.upright.across)
    }
}

impl Default for Upright {
    /// z is up, and heights are measured from the origin.
    fn default() -> Self {
        Upright { up: Vec3::z(), across: [Vec3::x(), Vec3::y()], ground: 0.0 }
    }
}

/// The six sides of a box.
pub fn box_sides(low: &Vec3, high: &Vec3, side: Side) -> Vec<(Half, Side)> {
    Polyhedron::cuboid(low, high).faces.into_iter().map(|face| (face.half, side)).collect()
}

/// The two ends of a cylinder along z, and four planes around it.
pub fn cylinder_sides([x, y]: [f64; 2], radius: f64, ends: [f64; 2]) -> Vec<(Half, Side)> {
    let low = Vec3::new(x - radius, y - radius, ends[0]);
    let high = Vec3::new(x + radius, y + radius, ends[1]);
    let mut sides = box_sides(&low, &high, Side::Around);
    for (half, side) in &mut sides {
        if half.n.z != 0.0 {
            *side = Side::Cut;
        }
    }
    sides
}

/// Cuts a shape in the plane through `centre` (m) with the normal `n` by half-spaces and a cylinder.
///
/// The coordinates of the shape are those along [`across`] of `n`, from `centre`.
pub fn cut_section(flat: &mut Flat, n: &Vec3, centre: &Vec3, halves: &[Half], pillar: Option<Pillar>) {
    let (u, v) = across(n);
    for half in halves {
        flat.below([half.n.dot(&u), half.n.dot(&v)], -half.beyond(centre));
    }
    let Some((axis, radius)) = pillar else { return };
    let axis = Vec3::new(axis[0] - centre.x, axis[1] - centre.y, 0.0);
    if n.z.abs() > 0.5 {
        flat.within([axis.dot(&u), axis.dot(&v)], radius);
    } else {
        // The plane is along the axis and cuts a strip out of the cylinder.
        let half2 = radius.powi(2) - n.dot(&axis).powi(2);
        let half = if half2 > 0.0 { half2.sqrt() } else { f64::NEG_INFINITY };
        let sideways = Vec3::z().cross(n);
        for sign in [1.0, -1.0] {
            let m = sideways * sign;
            flat.below([m.dot(&u), m.dot(&v)], m.dot(&axis) + half);
        }
    }
}

/// The least distance of two parallel planes along no part of `across` that hold `body` between them, m.
///
/// One of them contains an edge of the outline of the body.
pub fn least_width(body: &Polyhedron, across: &[Vec3; 2]) -> f64 {
    let mut points: Vec<[f64; 2]> = body.corners().map(|x| [0, 1].map(|k| across[k].dot(x))).collect();
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0.0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    let width = |k: usize| {
        let (a, b) = (outline[k], outline[(k + 1) % outline.len()]);
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        outline.iter().map(|&c| turn(a, b, c) / length).fold(0.0, f64::max)
    };
    // Edges that are only rounding long have no direction.
    let longest = points.iter().flatten().map(|c| c.abs()).fold(0.0, f64::max);
    let is_edge = |k: &usize| {
        let (a, b) = (outline[*k], outline[(*k + 1) % outline.len()]);
        (b[0] - a[0]).hypot(b[1] - a[1]) > 1e-9 * longest
    };
    (0..outline.len()).filter(is_edge).map(width).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
#[path = "region_tests.rs"]
mod tests;
