//! What a scene takes in memory and on disk, before it runs.

use crate::files::checkpoint;
use crate::scene::Scene;

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
