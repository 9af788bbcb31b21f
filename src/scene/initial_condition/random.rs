//! Random starts: places that are drawn one by one, then pushed apart until no two spheres overlap.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::push_apart::{Aim, spread};
use super::room::Room;
use super::{InitialCondition, draw, sizes::mass_of};
use crate::error::Error;
use crate::math::digits::{rough, short};
use crate::math::vector::Vec3;
use crate::model::columns::RADIUS;
use crate::scene::Scene;
use crate::scene::starts::Random;

/// Sweeps after which a start counts as impossible. At a fraction of 0.5 it takes about 110 in a wide room,
/// and 150 in one that is 12 radii wide.
const MOST_SWEEPS: u32 = 3000;

/// Draws for the place of one sphere at most: oblique walls may cut off most of the box around a room.
const MOST_DRAWS: u32 = 100_000;

/// Pairs are pushed to this distance over the sum of their radii: pushing ends sooner, and forces at the
/// start are weaker. A longer one would leave a trace in the distances of spheres.
const APART: f64 = 1.01;

/// Why spheres could not be put into a room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stuck {
    /// No place was found that is at least the radius away from all walls; the radius, m.
    Place(f64),
    /// This overlap over the smaller radius remained.
    Overlap(f64),
}

/// Centres (m) of spheres with these `radii` (m), at random places of `room` without an overlap.
///
/// The same `seed` gives the same bits, on any number of ranks and threads.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::initial_condition::random::centres;
/// use demhybrid::scene::initial_condition::room::Room;
///
/// let sets = ["particles={ radius = 0.1, mass = 1, random = { count = 200 } }".to_owned()];
/// let text = "t_end = 1
///     contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
///                 dissipation_focusing = 10, interaction_distance = 0.1 }
///     container.box = {}";
/// let scene = Scene::parse("a.toml", text, &sets)?; // a box of 1 m x 1 m
/// let random = scene.particles.random.as_ref().ok_or("there is none")?;
/// let room = Room::of(&scene.container, random, 200.0 * 0.00419, 0.1).map_err(|no| no.why)?;
/// let x = centres(&[0.1; 200], &room, 1).map_err(|stuck| format!("{stuck:?}"))?;
/// assert!(x.iter().all(|x| x[2] >= 0.1)); // m above the floor
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn centres(radii: &[f64], room: &Room, seed: u64) -> Result<Vec<[f64; 3]>, Stuck> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut x = Vec::with_capacity(radii.len());
    for &r in radii {
        x.push(place(room, r, &mut random)?);
    }
    let aim = Aim { apart: APART, remains: 0.0, sweeps: MOST_SWEEPS };
    spread(&mut x, radii, &room.walls, &aim).map_err(Stuck::Overlap)?;
    Ok(x.into_iter().map(Into::into).collect())
}

/// A place (m) at least `r` (m) away from all walls.
fn place(room: &Room, r: f64, random: &mut ChaCha8Rng) -> Result<Vec3, Stuck> {
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

/// The random start of a scene, at rest. A pure function: it gives the same on every rank.
pub(super) fn random(scene: &Scene, random: &Random) -> Result<InitialCondition, Error> {
    let columns = draw::columns(scene, random.count, random.seed.unwrap_or(0));
    let drawn = columns.iter().find(|(column, _)| column.name == RADIUS).map(|(_, radii)| radii.clone());
    let radii = drawn.unwrap_or_else(|| vec![scene.particles.radius; random.count as usize]);
    let volume: f64 = radii.iter().map(|&r| mass_of(r, 1.0)).sum();
    let largest = radii.iter().copied().fold(0.0, f64::max);
    let room_at = |fraction| {
        let random = Random { fraction, ..random.clone() };
        Room::of(&scene.container, &random, volume, largest)
    };
    let room = room_at(random.fraction).map_err(|no| Error::Input(no.why))?;
    let seed = random.seed.unwrap_or(0);
    let x = centres(&radii, &room, seed).map_err(|stuck| {
        let why = match stuck {
            Stuck::Place(r) => format!("no place for a sphere of {} m was found in its room", short(r)),
            Stuck::Overlap(overlap) => format!(
                "after {MOST_SWEEPS} sweeps spheres still overlap by {} of the smaller radius at the \
                 fraction {} of its room",
                rough(overlap),
                short(room.fraction)
            ),
        };
        // What is possible is tried, since it depends on the shape of the room.
        let lower = (1..10).map(|tenths| room.fraction * (1.0 - 0.1 * f64::from(tenths)));
        let possible = lower.map(|fraction| (fraction * 100.0).floor() / 100.0).find(|&fraction| {
            fraction > 0.0 && room_at(Some(fraction)).is_ok_and(|room| centres(&radii, &room, seed).is_ok())
        });
        let would_do = match possible {
            Some(fraction) => format!("particles.random.fraction = {} would do", short(fraction)),
            None => "a smaller count, or a region that is less narrow, would do".to_owned(),
        };
        Error::Input(format!("particles.random: {why}; {would_do}"))
    })?;
    let still = vec![[0.0; 3]; x.len()];
    Ok(InitialCondition { x, v: still.clone(), omega: still, columns, ..InitialCondition::default() })
}
