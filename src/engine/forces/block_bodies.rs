//! The bodies of one block: its own particles, then its ghosts.
//!
//! Every block has its own copy of the bodies that it needs, and only its thread changes them. What others
//! need of a block, its thread copies to the outbox of the block. Blocks share nothing but these outboxes.
//!
//! So a thread may move the bodies of its block at any time, whatever the other threads are doing.

use super::INNER_SKIN;
use super::memory::Found;
use crate::engine::kernel::Batch;
use crate::engine::neighbors::{Block, Reach};
use crate::math::elementary::Separate;
use crate::math::larger;
use crate::math::vector::{Vec3, dot, minus};
use crate::model::columns::position;
use crate::model::contact::LawParameters;
use crate::model::size::{Size, Sizes, squared_scale};
use crate::model::wall::Wall;

/// Where the current state of a body can be read: number of the outbox, and index in that outbox.
///
/// Outbox b belongs to block b. The number after the last outbox stands for the ghosts of the rank.
pub type OutboxSlot = [u32; 2];

/// Three largest squared distances (m^2), by index:
///
/// 0. Own bodies from their positions when the lists were built.
/// 1. Own bodies from their positions at the start of the step.
/// 2. All bodies of the block, ghosts too, from their positions when near pairs were picked.
///
/// Where sizes differ, every distance is scaled by a typical radius over that of its body.
pub type Distances = [f64; 3];

/// The larger of the two values of each distance.
pub fn furthest(a: Distances, b: Distances) -> Distances {
    std::array::from_fn(|k| larger(a[k], b[k]))
}

/// |a - b|^2
#[inline(always)]
pub fn distance_squared(a: &Vec3, b: &Vec3) -> f64 {
    let way = minus(a, b);
    dot::<Separate>(&way, &way)
}

/// A bound on how far the own bodies of a block are from fixed positions, called marks.
///
/// It saves memory traffic: the marks need not be read in every stage. The first stage of a step measures how
/// far the bodies were from their marks at the start of the step.
///
/// Later stages add the distance that bodies have moved since the start of the step. By the triangle
/// inequality the sum is a bound. The marks are read again only if the bound exceeds the limit.
#[derive(Debug, Clone, Copy)]
pub struct Offset {
    /// Largest distance from the marks at the start of the step, m; infinite until it is known.
    known: f64,
    /// Square of that distance, over the bodies that this stage has measured so far, m^2.
    measured: f64,
}

impl Offset {
    const UNKNOWN: Offset = Offset { known: f64::INFINITY, measured: 0.0 };

    /// Largest squared distance (m^2) of some `bodies` from their `marks` (m), or 0 if it certainly does not
    /// exceed `limit` (m^2).
    ///
    /// `starts` are the same bodies at the start of the step. Both are rows of `width` numbers. `way` (m^2)
    /// is the largest squared distance of the bodies from their starts. It must be infinite if a position is
    /// NaN. `scale` is what the squared distance of a body, by its index, is multiplied by.
    pub fn furthest(
        &mut self,
        marks: &[Vec3],
        (bodies, starts, width): (&[f64], &[f64], usize),
        scale: impl Fn(usize) -> f64,
        way: f64,
        limit: f64,
    ) -> f64 {
        // Larger than the rounding error of the bound.
        const MARGIN: f64 = 1.0 + 1e-12;
        if (self.known + way.sqrt()).powi(2) * MARGIN <= limit {
            return 0.0;
        }
        let mut far = 0.0;
        let ends = bodies.chunks_exact(width).zip(starts.chunks_exact(width));
        for (k, (mark, (body, start))) in marks.iter().zip(ends).enumerate() {
            let scale = scale(k);
            far = larger(far, scale * distance_squared(&position(body), mark));
            self.measured = larger(self.measured, scale * distance_squared(&position(start), mark));
        }
        far
    }

    /// Ends a stage: all own bodies have been through `furthest`.
    fn end_stage(&mut self) {
        if self.known == f64::INFINITY {
            self.known = self.measured.sqrt();
        }
        self.measured = 0.0;
    }
}

/// The bodies of a block, and what its thread needs to work on them.
#[derive(Default)]
pub struct BlockBodies {
    /// Bodies by slot, as rows of the state: own particles first, then the ghosts of the block.
    ///
    /// During a right-hand side, bodies that have not been made yet still hold an earlier stage.
    pub bodies: Vec<f64>,
    /// Their sizes; empty where all are alike.
    pub sizes: Vec<Size>,
    /// Numbers in a row of the state.
    pub width: usize,
    /// Positions of all bodies when the near pairs were picked, by slot, m.
    pub picked: Vec<Vec3>,
    /// How far own bodies are from `picked`.
    pub from_picked: Offset,
    /// How far own bodies are from their positions when the lists were built.
    pub from_origin: Offset,
    /// Where to read every ghost of the block, in the order of `Block::ghosts`.
    pub ghost_sources: Vec<OutboxSlot>,
    /// Distances found so far in the current right-hand side.
    pub distances: Distances,
    /// Scratch memory of the kernel.
    pub batch: Batch,
    /// Memories of the contacts of the block at the current stage, row after row.
    pub memories: Vec<f64>,
    /// Rows that no contact has. Their memories and rates are 0.
    pub free_rows: Vec<u32>,
    /// Contacts that get or lose rows when the trial step is accepted.
    pub found: Found,
}

impl Default for Offset {
    fn default() -> Self {
        Offset::UNKNOWN
    }
}

/// Square of the distance that a body may move before near pairs and walls must be picked again, m^2.
///
/// `r` is the radius of a typical sphere, m: distances are scaled where sizes differ.
pub fn allowed(r: f64) -> f64 {
    (0.5 * INNER_SKIN * r).powi(2)
}

impl BlockBodies {
    /// Copies the bodies of the block from `bodies`, which holds all bodies of the rank by local index. So do
    /// `sizes`, if they are not empty.
    ///
    /// Also empties `picked`, so `pick_near` must follow.
    pub fn load(&mut self, block: &Block, (bodies, sizes): (&[f64], &[Size]), width: usize) {
        self.width = width;
        let count = block.range.len() + block.ghosts.len();
        clear_for(&mut self.bodies, count * width);
        clear_for(&mut self.picked, count);
        self.bodies.extend_from_slice(&bodies[block.range.start * width..block.range.end * width]);
        for &ghost in &block.ghosts {
            self.bodies.extend_from_slice(&bodies[ghost as usize * width..(ghost as usize + 1) * width]);
        }
        self.sizes.clear();
        if !sizes.is_empty() {
            self.sizes.extend_from_slice(&sizes[block.range.clone()]);
            self.sizes.extend(block.ghosts.iter().map(|&ghost| sizes[ghost as usize]));
        }
    }

    /// The body in a slot.
    pub fn body(&self, slot: usize) -> &[f64] {
        &self.bodies[slot * self.width..(slot + 1) * self.width]
    }

    /// Starts a step. Its start is another state than before, so both offsets become unknown.
    pub fn begin(&mut self) {
        (self.from_picked, self.from_origin) = (Offset::UNKNOWN, Offset::UNKNOWN);
    }

    /// Ends a stage: all own bodies are made. Returns the distances found, and sets them to 0.
    pub fn end_stage(&mut self) -> Distances {
        self.from_picked.end_stage();
        self.from_origin.end_stage();
        std::mem::take(&mut self.distances)
    }

    /// Copies the exported bodies to the `outbox` of the block, which is as long as `Block::exported`.
    pub fn export(&self, block: &Block, outbox: &mut [f64]) {
        for (row, &slot) in outbox.chunks_exact_mut(self.width).zip(&block.exported) {
            row.copy_from_slice(self.body(slot as usize));
        }
    }

    /// Copies the ghosts of the block from the `outboxes` of all blocks and from the `ghosts` of the rank.
    ///
    /// Also finds how far they are from where near pairs were picked.
    ///
    /// A typical particle has the radius `r` (m).
    pub fn import_ghosts(&mut self, block: &Block, outboxes: &[Vec<f64>], ghosts: &[f64], r: f64) {
        let (first, width) = (block.range.len(), self.width);
        let rows = self.bodies[first * width..].chunks_exact_mut(width).enumerate();
        for (((n, ghost), &[outbox, k]), picked) in rows.zip(&self.ghost_sources).zip(&self.picked[first..]) {
            let source = outboxes.get(outbox as usize).map_or(ghosts, Vec::as_slice);
            ghost.copy_from_slice(&source[k as usize * width..(k as usize + 1) * width]);
            let way = (position(ghost) - picked).norm_squared() * squared_scale(&self.sizes, first + n, r);
            self.distances[2] = larger(self.distances[2], way);
        }
    }

    /// Picks near pairs and walls for the current bodies, and stores the positions of these in `picked`.
    pub fn pick_near(&mut self, block: &mut Block, law: &LawParameters, walls: &[Wall]) {
        let sizes = match &self.sizes[..] {
            [] => Sizes::Equal(Size::new(law.r, 1.0)),
            sizes => Sizes::Each(sizes),
        };
        let reach = Reach { sizes, shares: [1.0 + 0.5 * INNER_SKIN; 2], gaps: [law.l_max; 2] };
        self.picked.clear();
        self.picked.extend(self.bodies.chunks_exact(self.width).map(position));
        block.pick_near(&self.picked, reach, walls);
        (self.distances[2], self.from_picked) = (0.0, Offset::UNKNOWN);
    }

    /// Picks near pairs and walls again if a body has moved too far since they were picked.
    pub fn repick_if_strayed(&mut self, block: &mut Block, law: &LawParameters, walls: &[Wall]) {
        let bodies = self.bodies.chunks_exact(self.width).zip(&self.picked).enumerate();
        let distances = bodies.map(|(slot, (body, picked))| {
            (position(body) - picked).norm_squared() * squared_scale(&self.sizes, slot, law.r)
        });
        if distances.fold(0.0, larger) > allowed(law.r) {
            self.pick_near(block, law, walls);
        }
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        self.bodies.capacity() * size_of::<f64>()
            + self.picked.capacity() * size_of::<Vec3>()
            + self.ghost_sources.capacity() * size_of::<OutboxSlot>()
            + self.memories.capacity() * size_of::<f64>()
            + self.free_rows.capacity() * size_of::<u32>()
            + self.sizes.capacity() * size_of::<Size>()
            + size_of::<Batch>()
    }
}

/// Empties `vector` and reserves memory for `count` elements.
///
/// A new allocation gets one sixteenth more than needed. A growing `Vec` would double its memory instead.
pub fn clear_for<T>(vector: &mut Vec<T>, count: usize) {
    if count > vector.capacity() {
        *vector = Vec::with_capacity(count + count / 16);
    }
    vector.clear();
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 300,
            failure_persistence: None,
            rng_seed: RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn whoever_is_too_far_is_found_in_any_stage(
            marks in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 1..20),
            stages in proptest::collection::vec(proptest::array::uniform3(-0.3..0.3f64), 1..5),
            moved in proptest::array::uniform3(-0.3..0.3f64),
        ) {
            let limit = 0.1;
            let body = |x: Vec3| [x.x, x.y, x.z, 0.0];
            let marks: Vec<Vec3> = marks.into_iter().map(Vec3::from).collect();
            // At the start of the step the bodies are not at their marks, and each has moved differently.
            let moved_by = |k: usize, way: [f64; 3]| Vec3::from(way) / (k + 1) as f64;
            let all = |way: &dyn Fn(usize) -> Vec3| -> Vec<f64> {
                marks.iter().enumerate().flat_map(|(k, mark)| body(mark + way(k))).collect()
            };
            let starts = all(&|k| moved_by(k, moved));
            let centres = |rows: &[f64]| rows.chunks_exact(4).map(position).collect::<Vec<_>>();
            let mut offset = Offset::UNKNOWN;
            for stage in stages {
                let bodies = all(&|k| moved_by(k, moved) + moved_by(k, stage));
                let furthest = |from: &[Vec3]| {
                    let apart = centres(&bodies).into_iter().zip(from);
                    apart.map(|(x, from)| distance_squared(&x, from)).fold(0.0, larger)
                };
                let way = furthest(&centres(&starts));
                let (found, exact) =
                    (offset.furthest(&marks, (&bodies, &starts, 4), |_| 1.0, way, limit), furthest(&marks));
                prop_assert!(found == exact || found == 0.0 && exact <= limit);
                offset.end_stage();
            }
            let starts = centres(&starts);
            let far = marks.iter().zip(&starts).map(|(mark, start)| distance_squared(start, mark));
            prop_assert_eq!(offset.known, far.fold(0.0, larger).sqrt());
        }

        #[test]
        fn a_body_that_is_nowhere_is_too_far(known in 0.0..1.0f64) {
            let nowhere = [f64::NAN; 4];
            let mark = [Vec3::zeros()];
            for mut offset in [Offset { known, measured: 0.0 }, Offset::UNKNOWN] {
                let found = offset.furthest(&mark, (&nowhere, &nowhere, 4), |_| 1.0, f64::INFINITY, 0.1);
                prop_assert_eq!(found, f64::INFINITY);
            }
        }
    }
}
