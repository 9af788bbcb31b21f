//! Estimates before a run: bytes of its output and its checkpoints, and the number of its frames.

use crate::files::checkpoint;
use crate::model::columns::Columns;
use crate::scene::{Scene, effects};

/// Size of an output file without frames, bytes: mostly chunks of the small arrays.
const OUTPUT_BYTES: u64 = 600 << 10;

/// Estimated size of the output file, bytes.
pub fn output_bytes(scene: &Scene, count: u64) -> u64 {
    let per_row = if scene.rotates() { 72 } else { 48 };
    frames(scene).saturating_mul(count).saturating_mul(per_row).saturating_add(OUTPUT_BYTES)
}

/// Upper bound of the size of both checkpoints together, bytes; 0 if the scene asks for none.
pub fn checkpoint_bytes(scene: &Scene, count: u64) -> u64 {
    let slots = if scene.checkpoint.is_some() { 2 } else { 0 };
    let numbers = effects::law(scene).memory.map_or(0, |memory| memory.numbers());
    checkpoint::bytes(count, &Columns::new(scene.rotates()), numbers).saturating_mul(slots)
}

/// Number of frames of the scene, including the one at t = 0.
pub fn frames(scene: &Scene) -> u64 {
    scene.output.interval.map_or(101, |interval| (scene.t_end / interval - 1e-9).ceil() as u64 + 1)
}
