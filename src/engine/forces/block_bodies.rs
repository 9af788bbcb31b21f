//! The bodies of one block: its own particles and its visitors. Blocks share nothing but windows, in which each shows what others
//! see of it, so every thread may put its particles into place when it likes.

use super::INNER_SKIN;
use crate::engine::kernel::Batch;
use crate::engine::neighbors::Block;
use crate::math::elementary::Separate;
use crate::math::larger;
use crate::math::vector::{Vec3, dot, minus};
use crate::model::contact::Law;
use crate::model::particle::{Motion, Spin};
use crate::model::wall::Wall;

/// Where a body is to be seen: the window, and the place in it. Ghosts have the window after the last.
pub type OutboxSlot = [u32; 2];

/// Largest squared distances of own bodies from where the lists were built and from where the step began, and of all from where near
/// pairs were picked, m^2.
pub type Distances = [f64; 3];

/// The larger of each.
pub fn furthest(a: Distances, b: Distances) -> Distances {
    std::array::from_fn(|k| larger(a[k], b[k]))
}

/// |a - b|^2
#[inline(always)]
pub fn distance_squared(a: &Vec3, b: &Vec3) -> f64 {
    let way = minus(a, b);
    dot::<Separate>(&way, &way)
}

/// How far own bodies are from places that were noted once. Once it is known how far they were where the step began, the way
/// since then mostly tells that they are near enough, and the places need not be read.
#[derive(Debug, Clone, Copy)]
pub struct Offset {
    /// Largest distance where the step began, m; infinite while it is not known.
    known: f64,
    /// Its square as far as it has been measured in the stage at hand, m^2.
    measured: f64,
}

impl Offset {
    const UNKNOWN: Offset = Offset { known: f64::INFINITY, measured: 0.0 };

    /// Largest squared distance (m^2) of some bodies from their `places`, or 0 where that is certainly not beyond the `limit` (m^2).
    /// The bodies have the given `starts`, and the largest squared distance `way` (m^2) from those.
    pub fn furthest<W: Spin>(
        &mut self,
        marks: &[Vec3],
        (bodies, starts): (&[Motion<W>], &[Motion<W>]),
        way: f64,
        limit: f64,
    ) -> f64 {
        // More than rounding can make of it.
        const MARGIN: f64 = 1.0 + 1e-12;
        if (self.known + way.sqrt()).powi(2) * MARGIN <= limit {
            return 0.0;
        }
        let mut far = 0.0;
        for ((mark, body), start) in marks.iter().zip(bodies).zip(starts) {
            far = larger(far, distance_squared(&body.x, mark));
            self.measured = larger(self.measured, distance_squared(&start.x, mark));
        }
        far
    }

    /// All bodies have come by.
    fn end_stage(&mut self) {
        if self.known == f64::INFINITY {
            self.known = self.measured.sqrt();
        }
        self.measured = 0.0;
    }
}

/// Bodies of a block, and what its thread needs besides.
pub struct BlockBodies<W> {
    /// By place: in the evaluation at hand, as far as they are in place.
    pub bodies: Vec<Motion<W>>,
    /// Where they were when the near pairs were picked, m.
    pub picked: Vec<Vec3>,
    /// How far own bodies are from there.
    pub from_picked: Offset,
    /// The same from where the lists were built.
    pub from_origin: Offset,
    /// Where the visitors are to be seen.
    pub ghost_sources: Vec<OutboxSlot>,
    /// How far bodies have moved in the right-hand side at hand.
    pub distances: Distances,
    /// Scratch.
    pub batch: Batch,
}

impl<W> Default for BlockBodies<W> {
    fn default() -> Self {
        BlockBodies {
            bodies: Vec::new(),
            picked: Vec::new(),
            from_picked: Offset::UNKNOWN,
            from_origin: Offset::UNKNOWN,
            ghost_sources: Vec::new(),
            distances: [0.0; 3],
            batch: Batch::default(),
        }
    }
}

/// How far a body may move before near pairs and walls must be picked afresh, squared, m^2; spheres have the radius `r` (m).
pub fn allowed(r: f64) -> f64 {
    (0.5 * INNER_SKIN * r).powi(2)
}

impl<W: Spin> BlockBodies<W> {
    /// Takes the bodies of a block out of all `bodies` of the rank, by local index.
    pub fn load(&mut self, block: &Block, bodies: &[Motion<W>]) {
        let ghosts = block.ghosts.iter().map(|&i| bodies[i as usize]);
        let count = block.range.len() + block.ghosts.len();
        clear_for(&mut self.bodies, count);
        clear_for(&mut self.picked, count);
        self.bodies.extend_from_slice(&bodies[block.range.clone()]);
        self.bodies.extend(ghosts);
    }

    /// A step begins, from other bodies than before.
    pub fn begin(&mut self) {
        (self.from_picked, self.from_origin) = (Offset::UNKNOWN, Offset::UNKNOWN);
    }

    /// All own bodies have come to their stage. Returns how far they have moved.
    pub fn end_stage(&mut self) -> Distances {
        self.from_picked.end_stage();
        self.from_origin.end_stage();
        std::mem::take(&mut self.distances)
    }

    /// Shows in the `window` what others see of the block.
    pub fn export(&self, block: &Block, outbox: &mut [Motion<W>]) {
        for (shown, &slot) in outbox.iter_mut().zip(&block.exported) {
            *shown = self.bodies[slot as usize];
        }
    }

    /// Brings the visitors into place.
    pub fn import_ghosts(&mut self, block: &Block, outboxes: &[Vec<Motion<W>>], ghosts: &[Motion<W>]) {
        let first = block.range.len();
        let picked = &self.picked[first..];
        for ((ghost, &[outbox, k]), picked) in
            self.bodies[first..].iter_mut().zip(&self.ghost_sources).zip(picked)
        {
            *ghost = outboxes.get(outbox as usize).map_or(ghosts, Vec::as_slice)[k as usize];
            self.distances[2] = larger(self.distances[2], (ghost.x - picked).norm_squared());
        }
    }

    /// Picks near pairs and walls of the bodies in place.
    pub fn pick_near<R, T>(&mut self, block: &mut Block, law: &Law<R, T>, walls: &[Wall]) {
        let skin = INNER_SKIN * law.r;
        let (cutoff, wall_cutoff) = (2.0 * law.r + law.l_max + skin, law.r + law.l_max + 0.5 * skin);
        self.picked.clear();
        self.picked.extend(self.bodies.iter().map(|body| body.x));
        block.pick_near(&self.bodies, cutoff, (walls, wall_cutoff));
        (self.distances[2], self.from_picked) = (0.0, Offset::UNKNOWN);
    }

    /// Picks them afresh if a body in place has strayed too far from where they were picked.
    pub fn repick_if_strayed<R, T>(&mut self, block: &mut Block, law: &Law<R, T>, walls: &[Wall]) {
        let distances =
            self.bodies.iter().zip(&self.picked).map(|(body, picked)| (body.x - picked).norm_squared());
        if distances.fold(0.0, larger) > allowed(law.r) {
            self.pick_near(block, law, walls);
        }
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        self.bodies.capacity() * size_of::<Motion<W>>()
            + self.picked.capacity() * size_of::<Vec3>()
            + self.ghost_sources.capacity() * size_of::<OutboxSlot>()
            + size_of::<Batch>()
    }
}

/// Empties `vector` and makes room for `count`. Bodies that arrive one by one must not double the memory.
pub fn clear_for<T>(vector: &mut Vec<T>, count: usize) {
    if count > vector.capacity() {
        *vector = Vec::with_capacity(count + count / 16);
    }
    vector.clear();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::particle::Locked;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

        #[test]
        fn whoever_is_too_far_is_found_in_any_stage(
            marks in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 1..20),
            stages in proptest::collection::vec(proptest::array::uniform3(-0.3..0.3f64), 1..5),
            moved in proptest::array::uniform3(-0.3..0.3f64),
        ) {
            let limit = 0.1;
            let body = |x: Vec3| Motion { x, v: Vec3::zeros(), omega: Locked };
            let marks: Vec<Vec3> = marks.into_iter().map(Vec3::from).collect();
            // Where the step began they were not where they were noted, and none is moved like the others.
            let moved_by = |k: usize, way: [f64; 3]| Vec3::from(way) / (k + 1) as f64;
            let all = |way: &dyn Fn(usize) -> Vec3| -> Vec<_> {
                marks.iter().enumerate().map(|(k, mark)| body(mark + way(k))).collect()
            };
            let starts = all(&|k| moved_by(k, moved));
            let mut offset = Offset::UNKNOWN;
            for stage in stages {
                let bodies = all(&|k| moved_by(k, moved) + moved_by(k, stage));
                let furthest = |from: &[Vec3]| {
                    bodies.iter().zip(from).map(|(body, from)| distance_squared(&body.x, from)).fold(0.0, larger)
                };
                let way = furthest(&starts.iter().map(|start| start.x).collect::<Vec<_>>());
                let (found, exact) = (offset.furthest(&marks, (&bodies, &starts), way, limit), furthest(&marks));
                prop_assert!(found == exact || found == 0.0 && exact <= limit);
                offset.end_stage();
            }
            let far = marks.iter().zip(&starts).map(|(mark, start)| distance_squared(&start.x, mark));
            prop_assert_eq!(offset.known, far.fold(0.0, larger).sqrt());
        }

        #[test]
        fn a_body_that_is_nowhere_is_too_far(known in 0.0..1.0f64) {
            let nowhere = Motion { x: Vec3::repeat(f64::NAN), v: Vec3::zeros(), omega: Locked };
            let mark = [Vec3::zeros()];
            for mut offset in [Offset { known, measured: 0.0 }, Offset::UNKNOWN] {
                let found = offset.furthest(&mark, (&[nowhere], &[nowhere]), f64::INFINITY, 0.1);
                prop_assert_eq!(found, f64::INFINITY);
            }
        }
    }
}
