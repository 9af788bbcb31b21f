//! What a scene takes in memory and on disk, before it runs.

use crate::checkpoint;
use crate::scene::Scene;
use crate::simulation::state_vectors;

/// Pairs a particle has on its lists in a packed bed, about.
const LISTED_PAIRS: f64 = 13.0;
/// Of these, pairs near enough to be evaluated, about.
const NEAR_PAIRS: f64 = 8.5;

/// Memory of the start of one particle, which every rank holds for all, bytes.
pub const START_BYTES: u64 = 72;

/// Memory of the solver for one particle, bytes, about: states, slopes and lists in a packed bed.
pub fn bytes_per_particle(scene: &Scene) -> u64 {
    let components = if scene.rotates() { 9.0 } else { 6.0 };
    // Those of the method, and the one that forces are evaluated at; three old places and an id.
    let states = (state_vectors(scene) + 1) as f64 * 8.0 * components + 3.0 * 24.0 + 8.0;
    (states + 8.0 * (LISTED_PAIRS + NEAR_PAIRS)) as u64
}

/// Size of an output file without frames, bytes: mostly room for small arrays.
const OUTPUT_BYTES: u64 = 600 << 10;

/// Bytes that the output file will take, about.
pub fn output_bytes(scene: &Scene, count: u64) -> u64 {
    let per_row = if scene.rotates() { 72 } else { 48 };
    frames(scene).saturating_mul(count).saturating_mul(per_row).saturating_add(OUTPUT_BYTES)
}

/// Bytes that the two checkpoints will take at most, if the scene asks for them.
pub fn checkpoint_bytes(scene: &Scene, count: u64) -> u64 {
    let slots = if scene.checkpoint.is_some() { 2 } else { 0 };
    checkpoint::bytes(count, scene.rotates()).saturating_mul(slots)
}

/// Frames of the scene, the one at t = 0 included.
pub fn frames(scene: &Scene) -> u64 {
    scene.output.interval.map_or(101, |interval| (scene.t_end / interval - 1e-9).ceil() as u64 + 1)
}
