//! Random starts: spheres at places drawn one by one, then pushed apart until none overlaps.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::push_apart::{Aim, spread};
use super::room::Room;
use super::{InitialCondition, sizes::mass_of};
use crate::error::Error;
use crate::math::digits::{rough, short};
use crate::math::vector::Vec3;
use crate::scene::Scene;
use crate::scene::starts::Random;

/// Sweeps after which a start counts as impossible. It takes about 100 at a fraction of 0.5 in a wide room,
/// and 400 in one that is 10 radii wide.
const MOST_SWEEPS: u32 = 3000;

/// Draws for the centre of one sphere at most: oblique walls may cut most of the box around a room away.
const MOST_DRAWS: u32 = 100_000;

/// Spheres are pushed apart as if they took this share of the room, so that they keep a little more than no
/// distance. That takes a third of the sweeps.
const SHARE_WITH_GAPS: f64 = 0.55;

/// The gaps are at most this share of the sum of radii.
const WIDEST_GAP: f64 = 0.05;

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
    let [low, high] = room.corners;
    let mut x = Vec::with_capacity(radii.len());
    for &r in radii {
        let place = (0..MOST_DRAWS).find_map(|_| {
            let place = Vec3::from_fn(|axis, _| {
                let (least, most) = (low[axis] + r, high[axis] - r);
                // A room of exactly two radii has one place.
                least + random.random::<f64>() * (most - least).max(0.0)
            });
            let inside = room.walls.iter().all(|wall| wall.depth(&place) >= r * (1.0 - 1e-9));
            inside.then_some(place)
        });
        x.push(place.ok_or(Stuck::Place(r))?);
    }
    let gap = (SHARE_WITH_GAPS / room.fraction).cbrt() - 1.0;
    let aim = Aim { apart: 1.0 + gap.clamp(0.0, WIDEST_GAP), remains: 0.0, sweeps: MOST_SWEEPS };
    spread(&mut x, radii, &room.walls, &aim).map_err(Stuck::Overlap)?;
    Ok(x.into_iter().map(Into::into).collect())
}

/// The random start of a scene, at rest. A pure function: it gives the same on every rank.
pub(super) fn random(scene: &Scene, random: &Random) -> Result<InitialCondition, Error> {
    let radii = vec![scene.particles.radius; random.count as usize];
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
                "after {MOST_SWEEPS} sweeps spheres still overlap by {} of the smaller radius at the fraction \
                 {} of its room",
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
            None => "a smaller count, or a region that is wider in its narrowest direction, would do".to_owned(),
        };
        Error::Input(format!("particles.random: {why}; {would_do}"))
    })?;
    let still = vec![[0.0; 3]; x.len()];
    Ok(InitialCondition { x, v: still.clone(), omega: still, ..InitialCondition::default() })
}
