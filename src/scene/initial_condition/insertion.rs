//! Draws places for spheres one after the other, each where it overlaps none of those before if such a place
//! is found soon.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::Stuck;
use super::room::Room;
use crate::math::cells::coordinate;
use crate::math::vector::Vec3;

/// Draws that may be lost before a place that overlaps others is taken. So at a fraction of 0.3 nine spheres
/// of ten need not be moved, and beyond their contacts nothing tells where the others are.
const TRIES: u32 = 50;

/// From this volume fraction on nearly no place is free: the first that is drawn is taken.
const FULL: f64 = 0.3;

/// Draws for a place inside all walls at most: oblique ones may cut off most of the box around a room.
const MOST_DRAWS: u32 = 100_000;

/// No place.
const NONE: u32 = u32::MAX;

/// Draws centres (m) for spheres with these `radii` (m) inside all walls of `room`, the largest first.
///
/// Centres of spheres that found a free place are `apart` times the sum of radii from those before.
pub(super) fn places(
    radii: &[f64],
    room: &Room,
    apart: f64,
    random: &mut ChaCha8Rng,
) -> Result<Vec<Vec3>, Stuck> {
    let mut order: Vec<u32> = (0..radii.len() as u32).collect();
    // The sort is stable: of equal ones the lower id is first.
    order.sort_by(|&a, &b| radii[b as usize].total_cmp(&radii[a as usize]));
    let (mut x, mut classes) = (vec![Vec3::zeros(); radii.len()], Vec::<Class>::new());
    let whole: f64 = radii.iter().map(|r| r.powi(3)).sum();
    let mut filled = 0.0;
    for (rank, &i) in order.iter().enumerate() {
        let r = radii[i as usize];
        let tries = if room.fraction * filled < FULL * whole { TRIES } else { 1 };
        let mut place = inside(room, r, random)?;
        for _ in 1..tries {
            if classes.iter().all(|class| class.is_free(&place, r, apart, &x, radii)) {
                break;
            }
            place = inside(room, r, random)?;
        }
        x[i as usize] = place;
        filled += r.powi(3);
        if classes.last().is_none_or(|class| 2.0 * r <= class.largest) {
            let members = order[rank..].iter().take_while(|&&j| 2.0 * radii[j as usize] > r).count();
            classes.push(Class::new(r, apart, members, room, radii.len()));
        }
        classes.last_mut().expect("one was pushed").add(i, &place);
    }
    Ok(x)
}

/// A place (m) at least `r` (m) away from all walls.
fn inside(room: &Room, r: f64, random: &mut ChaCha8Rng) -> Result<Vec3, Stuck> {
    let [low, high] = room.corners;
    for _ in 0..MOST_DRAWS {
        let place = Vec3::from_fn(|axis, _| {
            // A room of exactly two radii has one place.
            let side = (high[axis] - low[axis] - 2.0 * r).max(0.0);
            low[axis] + r + random.random::<f64>() * side
        });
        if room.walls.iter().all(|wall| wall.depth(&place) >= r * (1.0 - 1e-9)) {
            return Ok(place);
        }
    }
    Err(Stuck::Place(r))
}

/// Spheres whose radii differ by less than a factor of 2, in cells that grow. The first is the largest.
struct Class {
    /// Largest radius, m.
    largest: f64,
    /// Width of a cell, m.
    width: f64,
    /// Buckets along each axis. Cells far from each other may share one.
    dims: [i64; 3],
    /// The last sphere that came into each bucket.
    last: Vec<u32>,
    /// The one that came into the bucket of each sphere before it.
    before: Vec<u32>,
}

impl Class {
    /// For about as many `members`, of `all` spheres.
    fn new(largest: f64, apart: f64, members: usize, room: &Room, all: usize) -> Class {
        // A later sphere is no larger, so that all it may overlap are in cells that touch its own.
        let width = 2.0 * largest * apart;
        let extent = (room.corners[1] - room.corners[0]).map(|side| (side / width).ceil() as i64 + 1);
        let mut dims: [i64; 3] = extent.into();
        let most = 4 * members as i64 + 64;
        while dims.iter().fold(1, |product: i64, &dim| product.saturating_mul(dim)) > most {
            let widest = (0..3).max_by_key(|&axis| dims[axis]).expect("there are three axes");
            dims[widest] = (dims[widest] + 1) / 2;
        }
        let buckets = dims.iter().product::<i64>() as usize;
        Class { largest, width, dims, last: vec![NONE; buckets], before: vec![NONE; all] }
    }

    fn bucket(&self, cell: [i64; 3]) -> usize {
        let [x, y, z] = [0, 1, 2].map(|axis| cell[axis].rem_euclid(self.dims[axis]));
        ((z * self.dims[1] + y) * self.dims[0] + x) as usize
    }

    fn cell(&self, x: &Vec3) -> [i64; 3] {
        [0, 1, 2].map(|axis| coordinate(x[axis], self.width))
    }

    fn add(&mut self, i: u32, x: &Vec3) {
        let bucket = self.bucket(self.cell(x));
        self.before[i as usize] = self.last[bucket];
        self.last[bucket] = i;
    }

    /// Whether a sphere of radius `r` (m) at `place` (m) is `apart` from all members.
    fn is_free(&self, place: &Vec3, r: f64, apart: f64, x: &[Vec3], radii: &[f64]) -> bool {
        let [cx, cy, cz] = self.cell(place);
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let mut j = self.last[self.bucket([cx + dx, cy + dy, cz + dz])];
                    while j != NONE {
                        let other = j as usize;
                        if (place - x[other]).norm_squared() < (apart * (r + radii[other])).powi(2) {
                            return false;
                        }
                        j = self.before[other];
                    }
                }
            }
        }
        true
    }
}
