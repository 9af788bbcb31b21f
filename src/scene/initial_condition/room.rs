//! The room in which a random start lies: what the walls and `particles.random.region` enclose, filled from
//! below as high as the volume fraction asks.

use crate::math::digits::{at_least, at_most, short};
use crate::math::polyhedron::{Half, Polyhedron, is_open, lowest};
use crate::math::vector::Vec3;
use crate::model::wall::Wall;
use crate::scene::starts::{LARGEST_FRACTION, OPEN_FRACTION, Random};
use crate::scene::walls::walls;
use crate::scene::{BoxSides, Container};

/// Rooms that are smaller by this share than what is asked for are accepted, since volumes are rounded.
const ROUNDING: f64 = 1e-9;

/// A bounded convex room for spheres.
#[derive(Debug, Clone)]
pub struct Room {
    /// The planes around it: first the walls of the scene, then the sides of the region and a lid. Spheres
    /// keep inside all of them.
    pub walls: Vec<Wall>,
    /// Lower and upper corner of the box around it, m.
    pub corners: [Vec3; 2],
    /// Share of its volume that the spheres take.
    pub fraction: f64,
}

/// Why there is no room, and the key of `particles.random` that the message is about.
#[derive(Debug, Clone, PartialEq)]
pub struct NoRoom {
    /// The key, such as `region.max`; empty: the table as a whole.
    pub key: &'static str,
    /// What is wrong and what would be right.
    pub why: String,
}

fn no_room(key: &'static str, why: String) -> NoRoom {
    NoRoom { key, why }
}

impl Room {
    /// The room that `random` asks for in `container`, for spheres of this `volume` in all (m^3), the
    /// largest of which has the radius `r` (m).
    pub fn of(container: &Container, random: &Random, volume: f64, r: f64) -> Result<Room, NoRoom> {
        let mut walls = walls(container);
        let region = random.region.as_ref().map(|region| Container {
            r#box: Some(BoxSides { min: region.min, max: region.max, material: None }),
            wall: Vec::new(),
        });
        walls.extend(region.iter().flat_map(crate::scene::walls::walls));
        let halves: Vec<Half> = walls.iter().map(Wall::half).collect();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            for (sign, side) in [(-1.0, "min"), (1.0, "max")] {
                let mut way = Vec3::zeros();
                way[axis] = sign;
                let upwards = axis == 2 && sign > 0.0;
                if !upwards && is_open(&halves, &way) {
                    let why = format!(
                        "particles.random has no end towards {side} {name}: it needs a box or a region that \
                         is finite in all directions but up, e.g. region = {{ min = [0.0, 0.0, 0.0], max = \
                         [1.0, 1.0, inf] }}"
                    );
                    return Err(no_room("", why));
                }
            }
        }
        // The lowest place for the centre of the largest sphere.
        let inner: Vec<Half> =
            halves.iter().map(|half| Half { b: half.b - r * (1.0 - ROUNDING), ..*half }).collect();
        let Some(lowest_centre) = lowest(&inner, &Vec3::z()) else {
            let why = format!(
                "particles.random has no room for one sphere of {} m between its region and the walls: both \
                 together must leave 2 radii, {} m, in every direction",
                short(r),
                short(2.0 * r)
            );
            return Err(no_room("region", why));
        };
        let open = is_open(&halves, &Vec3::z());
        let whole = if open { f64::INFINITY } else { Polyhedron::of(&halves).volume() };
        let asked = random.fraction.or(open.then_some(OPEN_FRACTION));
        let Some(fraction) = asked else {
            let fraction = volume / whole;
            if fraction > LARGEST_FRACTION * (1.0 + ROUNDING) {
                let why = format!(
                    "particles.random.count = {} fills its region to {}, and {LARGEST_FRACTION} at most is \
                     possible: {} spheres or fewer would do",
                    random.count,
                    short(at_least(fraction)),
                    (random.count as f64 * LARGEST_FRACTION / fraction).floor()
                );
                return Err(no_room("count", why));
            }
            return Ok(Room::within(walls, fraction));
        };
        let needed = volume / fraction;
        if needed > whole * (1.0 + ROUNDING) {
            let why = format!(
                "particles.random.count = {} at the fraction {} needs {} m^3, and region and walls leave \
                 {} m^3: {} spheres or fewer would do{}",
                random.count,
                short(fraction),
                short(at_least(needed)),
                short(at_most(whole)),
                (random.count as f64 * whole / needed).floor(),
                match volume / whole {
                    least if least <= LARGEST_FRACTION => {
                        format!(", or a fraction of {} or more", short(at_least(least)))
                    }
                    _ => String::new(),
                }
            );
            return Err(no_room("count", why));
        }
        if needed < whole * (1.0 - ROUNDING) {
            let lid = fill(&halves, needed).max(lowest_centre + r * 1.1);
            walls.push(Wall::new(Vec3::new(0.0, 0.0, lid), Vec3::z()));
        }
        Ok(Room::within(walls, fraction))
    }

    fn within(walls: Vec<Wall>, fraction: f64) -> Room {
        let halves: Vec<Half> = walls.iter().map(Wall::half).collect();
        let (low, high) = Polyhedron::of(&halves).bounds();
        Room { walls, corners: [low, high], fraction }
    }
}

/// The height (m) up to which the space inside all `halves` has the volume `needed` (m^3).
fn fill(halves: &[Half], needed: f64) -> f64 {
    let below = |height: f64| {
        let lid = Half { n: Vec3::z(), b: height };
        Polyhedron::of(&[halves, &[lid]].concat()).volume()
    };
    let floor = lowest(halves, &Vec3::z()).unwrap_or(0.0);
    let (mut low, mut more) = (0.0, needed.cbrt());
    // It doubles a thousand times at most before it is infinite.
    while below(floor + more) < needed && more.is_finite() {
        (low, more) = (more, 2.0 * more);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + more);
        if below(floor + middle) < needed { low = middle } else { more = middle }
    }
    floor + more
}
