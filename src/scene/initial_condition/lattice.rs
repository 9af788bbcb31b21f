//! The hexagonal close packed lattice, filled layer by layer from the bottom.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{InitialCondition, draw};
use crate::error::Error;
use crate::math::digits::short;
use crate::math::polyhedron::{Half, Polyhedron, is_open};
use crate::math::vector::Vec3;
use crate::model::wall::Wall;
use crate::scene::Scene;
use crate::scene::starts::Lattice;
use crate::scene::walls::walls;

/// Layers without a place after which the walls count as leaving none.
const MOST_EMPTY_LAYERS: u64 = 1000;

/// Rounding: a side may be this share of the spacing shorter than what the lattice takes.
const ROUNDING: f64 = 1e-9;

/// The lattice of a scene, at rest: `count` places, row by row along x, then y, then layer by layer.
///
/// Rows along x are spacing sqrt(3)/2 apart, layers spacing sqrt(2/3), and every other layer lies in the
/// hollows of the one below. The first layer touches `bottom` but for half of what the spacing is longer
/// than two radii. Places whose sphere would not be inside all walls are left out. Shifts in 0..jitter along
/// each axis are drawn in id order. A pure function: it gives the same on every rank.
pub(super) fn lattice(scene: &Scene, lattice: &Lattice) -> Result<InitialCondition, Error> {
    let (spacing, jitter, r) = (lattice.spacing, lattice.jitter, scene.largest_radius());
    let walls = walls(&scene.container);
    let halves: Vec<Half> = walls.iter().map(Wall::half).collect();
    let top = match is_open(&halves, &Vec3::z()) {
        true => f64::INFINITY,
        false => Polyhedron::of(&halves).bounds().1.z,
    };
    let sides = scene.container.r#box.as_ref();
    let (low, high) = sides.map_or(([0.0; 3], [0.0; 3]), |sides| (sides.min, sides.max));
    let slack = ROUNDING * spacing;
    let mut random = ChaCha8Rng::seed_from_u64(lattice.seed.unwrap_or(0));
    let (mut x, mut empty) = (Vec::new(), 0);
    for layer in 0u64.. {
        let z = lattice.bottom + 0.5 * spacing + layer as f64 * spacing * (2.0f64 / 3.0).sqrt();
        if x.len() as u64 == lattice.count || z + jitter > top || empty > MOST_EMPTY_LAYERS {
            break;
        }
        let before = x.len();
        let hollow = (layer % 2) as f64;
        for row in 0u64.. {
            let y = low[1] + 0.5 * spacing + row as f64 * spacing * 0.75f64.sqrt();
            let y = y + hollow * spacing / 12.0f64.sqrt();
            if y + 0.5 * spacing + jitter > high[1] + slack || x.len() as u64 == lattice.count {
                break;
            }
            let shifted = if (row + layer) % 2 == 1 { 0.5 * spacing } else { 0.0 };
            for column in 0u64.. {
                let place = Vec3::new(low[0] + 0.5 * spacing + shifted + column as f64 * spacing, y, z);
                if place.x + 0.5 * spacing + jitter > high[0] + slack || x.len() as u64 == lattice.count {
                    break;
                }
                // The sphere is inside the walls wherever its shift takes it.
                let corner = |wall: &Wall| {
                    let outwards = wall.normal.map(|n| jitter * n.max(0.0)).sum();
                    wall.depth(&place) - outwards
                };
                if walls.iter().all(|wall| corner(wall) >= r - slack) {
                    x.push(place);
                }
            }
        }
        empty = if x.len() == before { empty + 1 } else { 0 };
    }
    if (x.len() as u64) < lattice.count {
        return Err(Error::Input(format!(
            "particles.lattice.count = {}: the walls leave {} places of the lattice with \
             particles.lattice.spacing = {} m; {} spheres or fewer, or a larger container would do",
            lattice.count,
            x.len(),
            short(spacing),
            x.len()
        )));
    }
    let x: Vec<[f64; 3]> = x
        .into_iter()
        .map(|place| <[f64; 3]>::from(place).map(|c| c + random.random::<f64>() * jitter))
        .collect();
    let still = vec![[0.0; 3]; x.len()];
    let columns = draw::columns(scene, lattice.count, lattice.seed.unwrap_or(0));
    Ok(InitialCondition { x, v: still.clone(), omega: still, columns, ..InitialCondition::default() })
}
