//! Casts rays at spheres and edges, and computes the colour of each pixel from what they hit.
//!
//! The picture is divided into tiles. Each tile has a list of the balls and edges that it may show, nearest
//! first. Tiles are independent, so the picture does not depend on the number of threads.
//!
//! One ray through the middle of each pixel finds the pixels at outlines. Only those get 16 rays each.

use rayon::prelude::*;

use super::camera::{Ball, Camera, Ray};
use super::edges::Edge;
use super::light::{Lamps, Light, encoded, linear};
use super::options::Size;
use super::picture::Picture;
use super::shadows::Shadows;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;

/// Side of a tile, pixels.
const TILE: usize = 32;

/// Number of rays along each side of a pixel at an outline.
const FINE: usize = 4;

/// Balls with a smaller radius than this, in pixels, could lie between the middles of pixels.
const SMALL: f64 = 2.5;

/// The objects in a picture.
#[derive(Debug)]
pub struct Subject<'a> {
    /// Centres, m.
    pub x: &'a [Vec3],
    /// Sizes of the spheres.
    pub sizes: Sizes<'a>,
    /// Colour of each sphere, sRGB.
    pub colours: &'a [[u8; 3]],
    /// Edges of the container.
    pub edges: &'a [Edge],
    /// Unit vector upwards.
    pub up: Vec3,
    /// Colour of the background, sRGB.
    pub background: [u8; 3],
    /// Colour of the edges, sRGB.
    pub ink: [u8; 3],
}

/// A ball in the list that is sorted by distance.
struct Body {
    ball: Ball,
    /// Lower bound of the distance at which a ray can hit it, m.
    nearest: f64,
    id: u32,
}

/// An edge, projected onto the picture.
struct Line {
    edge: Edge,
    /// Ends, pixels.
    ends: [[f64; 2]; 2],
    /// Depths of the ends, m.
    depths: [f64; 2],
    /// Positions of the two ends along the edge, 0 to 1.
    shares: [f64; 2],
    /// Weights that turn a position along the line in the picture into one in space.
    weights: [f64; 2],
}

/// The objects that a tile may show: indices of bodies, nearest first, and of lines.
#[derive(Default, Clone)]
struct Tile {
    bodies: Vec<u32>,
    lines: Vec<u32>,
    /// Whether the tile has balls so small that a ray through the middle of a pixel could miss them.
    is_fine: bool,
}

/// Everything that is needed to cast rays.
struct Stage<'a> {
    camera: &'a Camera,
    bodies: Vec<Body>,
    lines: Vec<Line>,
    /// Half the width of a line, pixels.
    half_width: f64,
    lights: Vec<Light>,
    background: Light,
    ink: Light,
    lamps: Lamps,
    shadows: Shadows<'a>,
}

/// Draws `subject` for `camera`.
pub fn draw(subject: &Subject, camera: &Camera, size: Size) -> Picture {
    let stage = Stage::new(subject, camera, size);
    let across = size.width.div_ceil(TILE);
    let tiles = stage.tiles(size, across);
    let drawn: Vec<Vec<[u8; 3]>> = tiles
        .par_iter()
        .enumerate()
        .map(|(k, tile)| stage.pixels(tile, [k % across * TILE, k / across * TILE], size))
        .collect();
    let mut picture = Picture::new(size, subject.background);
    for (k, pixels) in drawn.iter().enumerate() {
        let (left, top) = (k % across * TILE, k / across * TILE);
        let width = TILE.min(size.width - left);
        for (row, line) in pixels.chunks(width).enumerate() {
            let first = (top + row) * size.width + left;
            picture.pixels[first..first + width].copy_from_slice(line);
        }
    }
    picture
}

impl<'a> Stage<'a> {
    fn new(subject: &Subject<'a>, camera: &'a Camera, size: Size) -> Self {
        let centres: Vec<Vec3> = subject.x.iter().map(|x| camera.coordinates(x)).collect();
        let mut bodies: Vec<Body> = centres
            .iter()
            .zip(0..)
            .map(|(x, id)| {
                let distance = if camera.is_perspective() { x.norm() } else { x.z };
                let r = subject.sizes.of(id as usize).r;
                Body { ball: (*x, r), nearest: distance - r, id }
            })
            .collect();
        bodies.sort_by(|a, b| a.nearest.total_cmp(&b.nearest).then(a.id.cmp(&b.id)));
        Stage {
            camera,
            bodies,
            lines: subject.edges.iter().filter_map(|edge| Line::new(edge, camera)).collect(),
            half_width: (size.height.min(size.width) as f64 / 1100.0).max(0.5),
            lights: subject.colours.iter().map(|&colour| linear(colour)).collect(),
            background: linear(subject.background),
            ink: linear(subject.ink),
            lamps: Lamps::new(camera.turned(&subject.up)),
            shadows: Shadows::new(subject.x, centres, subject.sizes),
        }
    }

    fn tiles(&self, size: Size, across: usize) -> Vec<Tile> {
        let down = size.height.div_ceil(TILE);
        let mut tiles = vec![Tile::default(); across * down];
        // Columns or rows of the tiles with the pixels from `low` to `high`, and two pixels on each side.
        let span = |low: f64, high: f64, count: usize| {
            let tile = |pixel: f64| (pixel / TILE as f64).floor().clamp(-1.0, count as f64);
            let (first, last) = (tile(low - 2.0).max(0.0), tile(high + 2.0).min(count as f64 - 1.0));
            first as usize..(last + 1.0).max(0.0) as usize
        };
        for (k, body) in (0..).zip(&self.bodies) {
            let Some([left, top, right, bottom]) = self.camera.bounds(&body.ball) else { continue };
            for row in span(top, bottom, down) {
                for column in span(left, right, across) {
                    let tile = &mut tiles[row * across + column];
                    tile.bodies.push(k);
                    tile.is_fine |= right - left < 2.0 * SMALL || bottom - top < 2.0 * SMALL;
                }
            }
        }
        for (k, line) in (0..).zip(&self.lines) {
            let [[x0, y0], [x1, y1]] = line.ends;
            let wide = self.half_width;
            for row in span(y0.min(y1) - wide, y0.max(y1) + wide, down) {
                for column in span(x0.min(x1) - wide, x0.max(x1) + wide, across) {
                    tiles[row * across + column].lines.push(k);
                }
            }
        }
        tiles
    }

    /// The pixels of a tile, row by row. `[left, top]` is its upper left pixel.
    fn pixels(&self, tile: &Tile, [left, top]: [usize; 2], size: Size) -> Vec<[u8; 3]> {
        let (width, height) = (TILE.min(size.width - left), TILE.min(size.height - top));
        if tile.bodies.is_empty() && tile.lines.is_empty() {
            return vec![encoded(self.background); width * height];
        }
        // What the rays through the middles of the pixels hit, with a border of one pixel.
        let wide = width + 2;
        let hits: Vec<Option<(f64, u32)>> = (0..wide * (height + 2))
            .map(|k| {
                let (column, row) = (k % wide + left, k / wide + top);
                self.hit(tile, &self.camera.ray(column as f64 - 0.5, row as f64 - 0.5))
            })
            .collect();
        let body = |k: usize| hits[k].map(|(_, body)| body);
        let mut pixels = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let k = (row + 1) * wide + column + 1;
                let around = [
                    k - wide - 1,
                    k - wide,
                    k - wide + 1,
                    k - 1,
                    k + 1,
                    k + wide - 1,
                    k + wide,
                    k + wide + 1,
                ];
                let (x, y) = ((left + column) as f64, (top + row) as f64);
                let is_smooth = !tile.is_fine
                    && around.iter().all(|&other| body(other) == body(k))
                    && !self.has_line(tile, x + 0.5, y + 0.5);
                let light = if is_smooth {
                    let ray = self.camera.ray(x + 0.5, y + 0.5);
                    hits[k].map_or(self.background, |hit| self.shade(&ray, hit))
                } else {
                    self.fine(tile, x, y)
                };
                pixels.push(encoded(light));
            }
        }
        pixels
    }

    /// The mean over many rays through the pixel with the upper left corner `(x, y)`.
    fn fine(&self, tile: &Tile, x: f64, y: f64) -> Light {
        let mut sum = [0.0; 3];
        for k in 0..FINE * FINE {
            let at = |k: usize| (k as f64 + 0.5) / FINE as f64;
            let (column, row) = (x + at(k % FINE), y + at(k / FINE));
            let ray = self.camera.ray(column, row);
            let hit = self.hit(tile, &ray);
            let mut light = hit.map_or(self.background, |hit| self.shade(&ray, hit));
            let depth = hit.map_or(f64::INFINITY, |(t, _)| (ray.origin + ray.along * t).z);
            for &line in &tile.lines {
                let strength = self.lines[line as usize].strength(column, row, self.half_width, depth) as f32;
                for (c, ink) in light.iter_mut().zip(self.ink) {
                    *c += (ink - *c) * strength;
                }
            }
            for (sum, c) in sum.iter_mut().zip(light) {
                *sum += c;
            }
        }
        sum.map(|c| c / (FINE * FINE) as f32)
    }

    /// The first ball that the ray hits: the distance along the ray (m), and the index of the body.
    fn hit(&self, tile: &Tile, ray: &Ray) -> Option<(f64, u32)> {
        let mut first: Option<(f64, u32)> = None;
        for &k in &tile.bodies {
            let body = &self.bodies[k as usize];
            if first.is_some_and(|(t, _)| t <= body.nearest) {
                break;
            }
            let (x, r) = body.ball;
            let away = x - ray.origin;
            let along = away.dot(&ray.along);
            // Measure from the foot of the perpendicular. This loses no digits if the camera is far away.
            let miss2 = (away - ray.along * along).norm_squared();
            if miss2 <= r * r {
                let t = along - (r * r - miss2).sqrt();
                if t > 0.0 && first.is_none_or(|(nearest, _)| t < nearest) {
                    first = Some((t, k));
                }
            }
        }
        first
    }

    fn shade(&self, ray: &Ray, (t, body): (f64, u32)) -> Light {
        let body = &self.bodies[body as usize];
        let point = ray.origin + ray.along * t;
        let (centre, r) = body.ball;
        let normal = (point - centre) / r;
        let i = body.id as usize;
        let around = |visit: &mut dyn FnMut(Vec3, f64)| self.shadows.for_each(i, &point, visit);
        self.lamps.shade(self.lights[i], &normal, &ray.along, around)
    }

    fn has_line(&self, tile: &Tile, column: f64, row: f64) -> bool {
        tile.lines.iter().any(|&line| {
            self.lines[line as usize].strength(column, row, self.half_width + 1.0, f64::INFINITY) > 0.0
        })
    }
}

impl Line {
    /// The part of an edge in front of the camera; `None` if there is none.
    fn new(edge: &Edge, camera: &Camera) -> Option<Self> {
        let ends = edge.ends.map(|x| camera.coordinates(&x));
        let near = 1e-6 * (ends[1] - ends[0]).norm();
        let mut shares = [0.0, 1.0];
        for side in 0..2 {
            let (here, there) = (ends[side].z, ends[1 - side].z);
            if here < near {
                if there <= near {
                    return None;
                }
                let share = (near - here) / (there - here);
                shares[side] = if side == 0 { share } else { 1.0 - share };
            }
        }
        let at = shares.map(|u| ends[0] + (ends[1] - ends[0]) * u);
        let depths = at.map(|x| x.z);
        // In perspective, 1/depth is linear in the picture.
        let weights = if camera.is_perspective() { depths } else { [1.0; 2] };
        Some(Line { edge: *edge, ends: at.map(|x| camera.pixel(&x)), depths, shares, weights })
    }

    /// How strongly the line covers a point of the picture, 0 to 1. The object behind it is at `depth` (m).
    fn strength(&self, column: f64, row: f64, half_width: f64, depth: f64) -> f64 {
        let [[x0, y0], [x1, y1]] = self.ends;
        let (dx, dy) = (x1 - x0, y1 - y0);
        let length2 = dx * dx + dy * dy;
        let s = (((column - x0) * dx + (row - y0) * dy) / length2.max(1e-12)).clamp(0.0, 1.0);
        let (away_x, away_y) = (column - x0 - s * dx, row - y0 - s * dy);
        if away_x * away_x + away_y * away_y > half_width * half_width {
            return 0.0;
        }
        let [here, there] = self.weights;
        let u = s * here / (s * here + (1.0 - s) * there);
        let z = self.depths[0] + (self.depths[1] - self.depths[0]) * u;
        if z >= depth {
            return 0.0;
        }
        self.edge.strength(self.shares[0] + (self.shares[1] - self.shares[0]) * u)
    }
}
