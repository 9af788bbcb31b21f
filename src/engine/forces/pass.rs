//! The right-hand side, evaluated block by block in one pass over memory.
//!
//! A right-hand side belongs to a stage of a step. One thread works on each block of owned particles. It does
//! three things for every particle:
//!
//! - It makes the body: the caller computes the state of the stage from the vectors of the method.
//! - It starts the slope of the particle with its velocity, and with the forces and torques of walls.
//! - It adds the forces and torques of pairs, and turns the sums into accelerations.
//!
//! The first two are done for [`CHUNK`] particles at a time, so that their data stay in the caches. Pairs
//! follow in batches, as soon as all of their bodies are made.
//!
//! Some bodies of a block are ghosts in other blocks or on other ranks: they are *exported*. All of them are
//! near the two ends of the block. The particles in the middle, none of them exported, are the *interior*.
//!
//! Exported bodies must be made first. So a right-hand side takes three calls:
//!
//! 1. `Forces::begin_stage` makes the bodies at both ends and copies the exported ones to the outboxes.
//! 2. `Forces::advance_interior` makes a part of the interior while messages between ranks are on their way.
//! 3. `Forces::finish_stage` fetches ghosts, makes the rest of the interior and sums pairs.
//!
//! The third call can include the first one of the next stage. This saves a parallel loop, and messages to
//! other ranks can leave at once.
//!
//! A block sums only its *near* pairs and walls. If a body has moved too far since these were picked, the
//! block picks them again and repeats its sums. None of this changes the order in which a particle sums.

use super::block_bodies::{BlockBodies, allowed, distance_squared, furthest};
use super::{BlockParts, BodyParameters, Forces, WithOutbox, each_block};
use crate::engine::kernel::{self, Sweep};
use crate::engine::neighbors::{BATCH, Block};
use crate::math::instructions::InstructionSet;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::contact::{Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::threads::Cut;
use fail::fail_point;
use std::ops::Range;

/// Number of particles whose bodies are made at a time. All of their data stay in the first-level cache.
pub const CHUNK: usize = 64;

/// Number of particles that one thread makes while messages with ghosts are on their way.
///
/// Enough to keep the thread busy, and few enough to stay in the second-level cache until their pairs follow.
const AHEAD: usize = 1024;

/// Number of batches of pairs after which complete slopes are finished, while they are still in the caches.
const BATCHES: usize = 8;

/// How the bodies of one stage are made.
pub struct StageMaker<'a, F, W> {
    /// `make(stage, first, items, bodies, slopes)` writes the stage of consecutive particles to `bodies`.
    ///
    /// `first` is the local index of the first particle. `items` are the parts of the caller's vectors for
    /// these particles. `slopes` still hold what the previous stage left there.
    pub make: &'a F,
    /// Number of the stage, which `make` gets.
    pub stage: usize,
    /// Positions of the owned particles when the lists were built, m.
    pub origin: &'a [Vec3],
    /// Square of the distance from `origin` up to which the lists hold, m^2.
    pub free: f64,
    /// Owned bodies at the start of the step. They must stay the same until the next `Forces::begin_step`.
    pub start: &'a [Motion<W>],
}

impl<F, W> Clone for StageMaker<'_, F, W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F, W> Copy for StageMaker<'_, F, W> {}

/// What is the same for all particles: contact law, body parameters and instruction set.
struct Field<'a, R, T> {
    law: &'a Law<R, T>,
    parameters: &'a BodyParameters,
    set: InstructionSet,
}

/// Slopes of consecutive particles, and the items from which a `StageMaker` makes their bodies.
type Rows<'a, W, C> = (&'a mut [Motion<W>], C);

impl<R: Rebound, T: Tangential> Field<'_, R, T> {
    /// Makes the own bodies with slots in `part` and starts their slopes.
    ///
    /// The slopes then hold velocities, and forces (N) and torques (N m) of walls. `rows` belong to `part`.
    /// Also updates `BlockBodies::distances`.
    fn advance<W: Spin, C: Cut>(
        &self,
        maker: StageMaker<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]), W>,
        (block, local): (&Block, &mut BlockBodies<W>),
        part: Range<usize>,
        mut rows: Rows<W, C>,
    ) {
        let allowed = allowed(self.law.r);
        let mut first = part.start;
        while first < part.end {
            let chunk = first..part.end.min(first + CHUNK);
            let ((slopes, items), rest) = rows.cut(chunk.len());
            rows = rest;
            let (bodies, picked) = (&mut local.bodies[chunk.clone()], &local.picked[chunk.clone()]);
            let own = block.range.start + chunk.start..block.range.start + chunk.end;
            (maker.make)(maker.stage, own.start, items, bodies, slopes);
            let starts = &maker.start[own.clone()];
            let (mut way, mut sum) = (0.0, 0.0);
            for ((body, slope), start) in bodies.iter().zip(&mut *slopes).zip(starts) {
                let apart = distance_squared(&body.x, &start.x);
                way = if apart > way { apart } else { way };
                sum += apart;
                clear(slope, body);
            }
            // A position that is NaN counts as infinitely far. The comparison misses it, the sum does not.
            if sum.is_nan() {
                way = f64::INFINITY;
            }
            let ends = (&*bodies, starts);
            let from_origin = local.from_origin.furthest(&maker.origin[own], ends, way, maker.free);
            let strayed = local.from_picked.furthest(picked, ends, way, allowed);
            local.distances = furthest(local.distances, [from_origin, way, strayed]);
            self.add_walls(strayed <= allowed, (block, local), chunk.clone(), slopes);
            first = chunk.end;
        }
    }

    /// Makes the bodies at both ends of the block, which are all but the interior, and copies the exported
    /// ones to the `outbox`. `front` and `back` are the rows of the two ends.
    fn export<W: Spin, C: Cut>(
        &self,
        maker: StageMaker<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]), W>,
        (block, local): (&Block, &mut BlockBodies<W>),
        outbox: &mut [Motion<W>],
        [front, back]: [Rows<W, C>; 2],
    ) {
        let Range { start, end } = block.interior;
        self.advance(maker, (block, local), 0..start, front);
        self.advance(maker, (block, local), end..block.range.len(), back);
        local.export(block, outbox);
    }

    /// Adds forces and torques of walls to `slopes`, which belong to the own particles with slots in `part`.
    ///
    /// Takes the near walls of the block if `near` says that they hold, else all listed walls.
    fn add_walls<W: Spin>(
        &self,
        near: bool,
        (block, local): (&Block, &mut BlockBodies<W>),
        part: Range<usize>,
        slopes: &mut [Motion<W>],
    ) {
        let contacts = if near { &block.near_walls } else { &block.walls };
        let before = |end: usize| contacts.partition_point(|contact| (contact[0] as usize) < end);
        let contacts = &contacts[before(part.start)..before(part.end)];
        let BlockBodies { bodies, batch, .. } = local;
        let sweep = Sweep { law: self.law, bodies: &bodies[part.clone()], batch, slopes };
        kernel::add_walls(self.set, part.start, (contacts, &self.parameters.walls), sweep);
    }

    /// Starts the slopes of all own particles again, with the velocities of their bodies and with near walls.
    fn begin_again<W: Spin>(&self, (block, local): (&Block, &mut BlockBodies<W>), slopes: &mut [Motion<W>]) {
        slopes.iter_mut().zip(&local.bodies).for_each(|(slope, body)| clear(slope, body));
        self.add_walls(true, (block, local), 0..slopes.len(), slopes);
    }

    /// Turns forces and torques in `slopes` into accelerations, eqs. (2.13)-(2.15).
    fn finish<W: Spin>(&self, slopes: &mut [Motion<W>]) {
        let inverse_mass = 1.0 / self.parameters.mass;
        for slope in slopes {
            slope.v = slope.v * inverse_mass + self.parameters.gravity;
            slope.omega = slope.omega.scaled(self.parameters.inverse_inertia);
        }
    }
}

/// Starts the slope of a body: its velocity, no force, no torque.
///
/// Assigned by component, because the compiler would build the whole struct on the stack first.
fn clear<W: Spin>(slope: &mut Motion<W>, body: &Motion<W>) {
    (slope.x, slope.v, slope.omega) = (body.v, Vec3::zeros(), W::zero());
}

/// How far the sums over the near pairs of a block have come.
#[derive(Default)]
struct Pairs {
    /// Number of batches that have been evaluated.
    batches: usize,
    /// Own particles with slots below this one have their accelerations.
    done: usize,
    /// Number of evaluated pairs within `l_max` whose first particle is an own one.
    count: u64,
}

impl Pairs {
    /// Evaluates the next pairs and finishes slopes, as far as possible while only the own bodies with slots
    /// below `limit` are made. The ghosts of the block must be there.
    ///
    /// `slopes` are those of all own particles of the block.
    fn sum_ready<R: Rebound, T: Tangential, W: Spin>(
        &mut self,
        limit: usize,
        field: &Field<R, T>,
        (block, local): (&Block, &mut BlockBodies<W>),
        slopes: &mut [Motion<W>],
    ) {
        let Block { near, horizon, .. } = block;
        loop {
            let ready = horizon[self.batches..].iter().take(BATCHES);
            let ready = ready.take_while(|&&horizon| horizon as usize <= limit).count();
            if ready > 0 {
                let pairs = &near[self.batches * BATCH..near.len().min((self.batches + ready) * BATCH)];
                let BlockBodies { bodies, batch, .. } = &mut *local;
                let sweep = Sweep { law: field.law, bodies, batch, slopes: &mut *slopes };
                self.count += kernel::add_pairs(field.set, pairs, sweep);
                self.batches += ready;
            }
            // Pairs are sorted by their first particles. So own particles before the first particle of the
            // next pair have met all of their partners. Where that one is a ghost, its slot is of no use.
            let next = near.get(self.batches * BATCH).map(|pair| pair[0]);
            if next.is_none_or(|next| block.owns(next)) {
                let end = next.map_or(limit, |next| limit.min(next as usize)).max(self.done);
                field.finish(&mut slopes[self.done..end]);
                self.done = end;
            }
            if ready < BATCHES {
                return;
            }
        }
    }
}

impl<R: Rebound, T: Tangential, W: Spin> Forces<R, T, W> {
    /// Starts a step. From now on `StageMaker::start` may be another state than before.
    pub fn begin_step(&mut self) {
        self.block_bodies.iter_mut().for_each(BlockBodies::begin);
    }

    /// Starts a right-hand side: makes the bodies at both ends of every block, and copies the exported ones
    /// to the outboxes. Needs no ghosts.
    ///
    /// `items` and `dydt` belong to the owned particles, by local index. Without exports nothing is done
    /// here.
    pub fn begin_stage<C: Cut>(
        &mut self,
        maker: StageMaker<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        let Forces { law, parameters, lists, bounds, block_bodies, outboxes, current, set, .. } = self;
        let outboxes = &mut outboxes[*current][..];
        if outboxes.iter().all(Vec::is_empty) {
            return;
        }
        let field = Field { law, parameters, set: *set };
        let work = move |((blocks, block_bodies), outboxes): WithOutbox<W>, rows: Rows<W, C>| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let (front, rows) = rows.cut(block.interior.start);
            let back = rows.cut(block.interior.len()).1;
            field.export(maker, (block, local), &mut outboxes[0], [front, back]);
        };
        let own = ((&mut lists.blocks[..], &mut block_bodies[..]), outboxes);
        each_block(bounds, own, (dydt, items), &work, &|(), ()| ());
    }

    /// Makes the first interior bodies of every block, `AHEAD` at most, while ghosts are on their way.
    ///
    /// Arguments as for `begin_stage`.
    pub fn advance_interior<C: Cut>(
        &mut self,
        maker: StageMaker<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        self.ahead = AHEAD;
        let Forces { law, parameters, lists, bounds, block_bodies, set, .. } = self;
        let field = Field { law, parameters, set: *set };
        let work = move |(blocks, block_bodies): BlockParts<W>, rows: Rows<W, C>| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let Range { start, end } = block.interior;
            let end = end.min(start + AHEAD);
            let rows = rows.cut(start).1.cut(end - start).0;
            field.advance(maker, (block, local), start..end, rows);
        };
        each_block(
            bounds,
            (&mut lists.blocks[..], &mut block_bodies[..]),
            (dydt, items),
            &work,
            &|(), ()| (),
        );
    }

    /// Ends a right-hand side: makes the remaining bodies, adds pairs, and leaves accelerations in `dydt`,
    /// eqs. (2.13)-(2.15). The ghosts of the rank must have arrived.
    ///
    /// With `begins_next` it then starts the next stage as `begin_stage` would, with the same `maker` and
    /// `items`. The slopes of particles at both ends of a block are then already those of the next stage.
    ///
    /// Returns the number of pairs within `l_max` whose first particle is owned by this rank. So over all
    /// ranks every pair counts once.
    ///
    /// Also returns two largest squared distances of owned bodies, m^2: from their positions when the lists
    /// were built, and from those at the start of the step. The first is 0 if it is certainly not beyond
    /// `free`.
    pub fn finish_stage<C: Cut>(
        &mut self,
        maker: StageMaker<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        begins_next: bool,
        items: C,
        dydt: &mut [Motion<W>],
    ) -> (u64, [f64; 2]) {
        let ahead = std::mem::take(&mut self.ahead);
        let Forces { law, parameters, lists, bounds, block_bodies, outboxes, current, ghosts, set, .. } =
            self;
        let (law, parameters) = (&*law, &*parameters);
        let (field, allowed) = (Field { law, parameters, set: *set }, allowed(law.r));
        let [even, odd] = outboxes;
        let (outboxes, next_windows) = if *current == 0 { (even, odd) } else { (odd, even) };
        let begins_next = begins_next && !outboxes.iter().all(Vec::is_empty);
        let (outboxes, ghosts) = (&outboxes[..], &ghosts[..]);
        let work = move |((blocks, block_bodies), next_windows): WithOutbox<W>,
                         (slopes, items): Rows<W, C>| {
            fail_point!("worker");
            let (block, local) = (&mut blocks[0], &mut block_bodies[0]);
            local.import_ghosts(block, outboxes, ghosts);
            let (own, Range { start, end }) = (block.range.len(), block.interior.clone());
            let mut placed = end.min(start + ahead);
            let (front, items) = items.cut(start);
            let (items, back) = items.cut(end - start);
            let mut items = items.cut(placed - start).1;
            let mut pairs = Pairs::default();
            loop {
                // Bodies behind the interior were made before: once it is complete, all own bodies are there.
                let limit = if placed < end { placed } else { own };
                if local.distances[2] <= allowed {
                    pairs.sum_ready(limit, &field, (block, local), slopes);
                }
                if placed == end {
                    break;
                }
                let part = placed..end.min(placed + CHUNK);
                let (these, rest) = items.cut(part.len());
                items = rest;
                field.advance(maker, (block, local), part.clone(), (&mut slopes[part.clone()], these));
                placed = part.end;
            }
            let [from_origin, from_start, strayed] = local.end_stage();
            if strayed > allowed {
                local.pick_near(block, law, &parameters.walls);
                field.begin_again((block, local), slopes);
                pairs = Pairs::default();
                pairs.sum_ready(own, &field, (block, local), slopes);
            }
            if begins_next {
                let next = StageMaker { stage: maker.stage + 1, ..maker };
                let (first, rest) = slopes.split_at_mut(start);
                let last = &mut rest[end - start..];
                field.export(next, (block, local), &mut next_windows[0], [(first, front), (last, back)]);
            }
            (pairs.count, [from_origin, from_start])
        };
        let both = |a: (u64, [f64; 2]), b: (u64, [f64; 2])| {
            (a.0 + b.0, [larger(a.1[0], b.1[0]), larger(a.1[1], b.1[1])])
        };
        let own = ((&mut lists.blocks[..], &mut block_bodies[..]), &mut next_windows[..]);
        let found = each_block(bounds, own, (dydt, items), &work, &both);
        *current ^= usize::from(begins_next);
        found
    }
}
