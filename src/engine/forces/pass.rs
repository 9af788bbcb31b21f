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

use super::block_bodies::{BlockBodies, allowed, furthest};
use super::memory::ByRows;
use super::{BlockParts, BodyParameters, Forces, WithOutbox, each_block, sizes_of};
use crate::engine::contact_classes::part;
use crate::engine::kernel::{Inertia, Kernel, Laws, Memories, Sweep};
use crate::engine::neighbors::{BATCH, Block};
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::POSITION;
use crate::model::size::squared_scale;
use crate::ode::{MakeStage, Part, Rows, Stage, VECTORS};
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

/// How the owned bodies of a stage are made.
#[derive(Clone, Copy)]
pub struct StageMaker<'a> {
    /// Writes the stage of consecutive particles to their bodies; see [`crate::ode::Ivp::rhs_of`].
    pub make: &'a MakeStage<'a>,
    /// Positions of the owned particles when the lists were built, m.
    pub origin: &'a [Vec3],
    /// Square of the distance from `origin` up to which the lists hold, m^2.
    pub free: f64,
    /// Owned bodies at the start of the step. They must stay the same until the next `Forces::begin_step`.
    pub start: &'a [f64],
}

/// The vectors of a method, for [`StageMaker::make`].
pub type Vectors<'a> = [Rows<'a>; VECTORS];

/// Rates of the memories of the contacts of blocks.
type Rates<'a> = ByRows<'a, Rows<'a>>;

fn rates_of<'a>(bounds: &'a [usize], rates: &'a mut [f64], kernel: &dyn Kernel) -> Rates<'a> {
    ByRows { bounds, items: Rows::new(rates, kernel.memory().max(1)) }
}

/// What is the same for all particles: laws, inertia and walls.
struct Field<'a> {
    laws: &'a Laws,
    /// The kernel for what is the same in all classes of contacts.
    kernel: &'a dyn Kernel,
    parameters: &'a BodyParameters,
    inertia: Inertia,
    /// Radius of a typical sphere, m.
    r: f64,
    /// Square of the distance that a body may move before near pairs must be picked again, m^2.
    allowed: f64,
}

impl<'a> Field<'a> {
    fn new(laws: &'a Laws, parameters: &'a BodyParameters) -> Self {
        let kernel = laws.first();
        let r = kernel.law().r;
        Field { laws, kernel, parameters, inertia: parameters.inertia(r), r, allowed: allowed(r) }
    }
}

/// Slopes of consecutive particles, and the vectors from which a `StageMaker` makes their bodies.
type Items<'a> = (Rows<'a>, Vectors<'a>);

impl Field<'_> {
    /// Makes the own bodies with slots in `part` and starts their slopes.
    ///
    /// The slopes then hold velocities, and forces and torques over the radius (N) of walls. `rows` belong to
    /// `part`. Also updates `BlockBodies::distances`.
    fn advance(
        &self,
        maker: StageMaker,
        (block, local): (&Block, &mut BlockBodies),
        part: Range<usize>,
        mut rows: Items,
        rates: &mut [f64],
    ) {
        let width = local.width;
        let mut first = part.start;
        while first < part.end {
            let chunk = first..part.end.min(first + CHUNK);
            let ((slopes, vectors), rest) = rows.cut(chunk.len());
            rows = rest;
            let bodies = &mut local.bodies[chunk.start * width..chunk.end * width];
            let own = block.range.start + chunk.start..block.range.start + chunk.end;
            let slopes = slopes.numbers;
            let made = Part {
                segment: 0,
                row: own.start,
                start: own.start * width,
                len: bodies.len(),
                width,
                positions: POSITION.end,
            };
            let vectors = vectors.map(|rows| rows.numbers);
            (maker.make)(Stage { part: made, vectors, state: bodies, slope: slopes });
            let starts = &maker.start[made.range()];
            let sizes = local.sizes.get(chunk.clone()).unwrap_or(&[]);
            let way = self.kernel.start_stage(bodies, starts, sizes, slopes);
            let scale = |k: usize| squared_scale(sizes, k, self.r);
            let ends = (&*bodies, starts, width);
            let from_origin = local.from_origin.furthest(&maker.origin[own], ends, scale, way, maker.free);
            let picked = &local.picked[chunk.clone()];
            let strayed = local.from_picked.furthest(picked, ends, scale, way, self.allowed);
            local.distances = furthest(local.distances, [from_origin, way, strayed]);
            self.add_walls(strayed <= self.allowed, (block, local), chunk.clone(), slopes, rates);
            first = chunk.end;
        }
    }

    /// Makes the bodies at both ends of the block, which are all but the interior, and copies the exported
    /// ones to the `outbox`. `front` and `back` are the rows of the two ends.
    fn export(
        &self,
        maker: StageMaker,
        (block, local): (&Block, &mut BlockBodies),
        outbox: &mut [f64],
        [front, back]: [Items; 2],
        rates: &mut [f64],
    ) {
        let Range { start, end } = block.interior;
        self.advance(maker, (block, local), 0..start, front, rates);
        self.advance(maker, (block, local), end..block.range.len(), back, rates);
        local.export(block, outbox);
    }

    /// Adds forces and torques of walls to `slopes`, which belong to the own particles with these `slots`.
    ///
    /// Takes the near walls of the block if `near` says that they hold, else all listed walls.
    fn add_walls(
        &self,
        near: bool,
        (block, local): (&Block, &mut BlockBodies),
        slots: Range<usize>,
        slopes: &mut [f64],
        rates: &mut [f64],
    ) {
        let (contacts, rows, ends) = if near {
            (&block.near_walls[..], &block.near_wall_rows, &block.ends.near_walls)
        } else {
            (&block.walls[..], &block.wall_rows, &block.ends.walls)
        };
        let BlockBodies { bodies, sizes, batch, width, memories, .. } = local;
        let bodies = &bodies[slots.start * *width..slots.end * *width];
        let sizes = sizes_of(sizes, self.kernel, self.parameters).from(slots.start);
        for class in 0..self.laws.count() {
            let all = part(ends, class, contacts.len());
            let of_class = &contacts[all.clone()];
            let before =
                |end: usize| all.start + of_class.partition_point(|contact| (contact[0] as usize) < end);
            let within = before(slots.start)..before(slots.end);
            if within.is_empty() {
                continue;
            }
            let rows = if rows.is_empty() { &[][..] } else { &rows[within.clone()] };
            let memories = Memories { rows, states: memories, rates: &mut *rates };
            let sweep = Sweep { bodies, sizes, batch: &mut *batch, slopes: &mut *slopes, memories };
            let walls = &self.parameters.walls;
            self.laws.of(class).add_walls(slots.start, &contacts[within], walls, sweep);
        }
    }

    /// Starts the slopes of all own particles again, with the velocities of their bodies and with near walls.
    fn begin_again(&self, (block, local): (&Block, &mut BlockBodies), slopes: &mut [f64], rates: &mut [f64]) {
        self.kernel.start_slopes(&local.bodies[..slopes.len()], slopes);
        self.add_walls(true, (block, local), 0..block.range.len(), slopes, rates);
    }
}

/// How far the sums over the near pairs of a block have come.
#[derive(Default)]
struct Pairs {
    /// The class of the pairs that come next.
    class: usize,
    /// Number of batches that have been evaluated.
    batches: usize,
    /// Number of pairs that have been evaluated.
    pairs: usize,
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
    fn sum_ready(
        &mut self,
        limit: usize,
        field: &Field,
        (block, local): (&Block, &mut BlockBodies),
        slopes: &mut [f64],
        rates: &mut [f64],
    ) {
        let Block { near, near_rows, horizon, .. } = block;
        loop {
            let end = block.near_of(self.class).end;
            let left = (end - self.pairs).div_ceil(BATCH).min(BATCHES);
            let ready = horizon[self.batches..].iter().take(left);
            let ready = ready.take_while(|&&horizon| horizon as usize <= limit).count();
            if ready > 0 {
                let range = self.pairs..end.min(self.pairs + ready * BATCH);
                let pairs = &near[range.clone()];
                let rows = if near_rows.is_empty() { &[][..] } else { &near_rows[range] };
                let BlockBodies { bodies, sizes, batch, memories, .. } = &mut *local;
                let memories = Memories { rows, states: memories, rates: &mut *rates };
                let sizes = sizes_of(sizes, field.kernel, field.parameters);
                let sweep = Sweep { bodies, sizes, batch, slopes: &mut *slopes, memories };
                self.count += field.laws.of(self.class).add_pairs(pairs, sweep);
                self.batches += ready;
                self.pairs += pairs.len();
            }
            if self.class + 1 < field.laws.count() {
                // Own particles may have partners in a class that follows.
                if self.pairs == end {
                    self.class += 1;
                } else if ready < BATCHES {
                    return;
                }
                continue;
            }
            // Pairs of the last class are sorted by their first particles. So own particles before the first
            // particle of the next pair have met all of their partners. Where that one is a ghost, its slot
            // is of no use.
            let next = near.get(self.pairs).map(|pair| pair[0]);
            if next.is_none_or(|next| block.owns(next)) {
                let end = next.map_or(limit, |next| limit.min(next as usize)).max(self.done);
                let width = local.width;
                let sizes = sizes_of(&local.sizes, field.kernel, field.parameters).from(self.done);
                field.kernel.finish(&field.inertia, sizes, &mut slopes[self.done * width..end * width]);
                self.done = end;
            }
            if ready < BATCHES {
                return;
            }
        }
    }
}

impl Forces {
    /// Starts a step. From now on `StageMaker::start` may be another state than before.
    pub fn begin_step(&mut self) {
        self.block_bodies.iter_mut().for_each(BlockBodies::begin);
    }

    /// Starts a right-hand side: makes the bodies at both ends of every block, and copies the exported ones
    /// to the outboxes. Needs no ghosts.
    ///
    /// `vectors` and `dydt` belong to the owned particles, by local index, `rates` to the memories of
    /// contacts, which are made already. Without exports nothing is done here.
    pub fn begin_stage(&mut self, maker: StageMaker, vectors: Vectors, dydt: &mut [f64], rates: &mut [f64]) {
        let Forces { laws, parameters, lists, bounds, block_bodies, outboxes, row_bounds, width, .. } = self;
        let outboxes = &mut outboxes[..];
        if outboxes.iter().all(Vec::is_empty) {
            return;
        }
        let field = Field::new(laws, parameters);
        let work = move |(((blocks, block_bodies), outboxes), rates): (WithOutbox, Rates), rows: Items| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let (front, rows) = rows.cut(block.interior.start);
            let back = rows.cut(block.interior.len()).1;
            field.export(maker, (block, local), &mut outboxes[0], [front, back], rates.items.numbers);
        };
        let own = ((&mut lists.blocks[..], &mut block_bodies[..]), outboxes);
        let own = (own, rates_of(row_bounds, rates, laws.first()));
        each_block(bounds, own, (Rows::new(dydt, *width), vectors), &work, &|(), ()| ());
    }

    /// Makes the first interior bodies of every block, `AHEAD` at most, while ghosts are on their way.
    ///
    /// Arguments as for `begin_stage`.
    pub fn advance_interior(
        &mut self,
        maker: StageMaker,
        vectors: Vectors,
        dydt: &mut [f64],
        rates: &mut [f64],
    ) {
        self.ahead = AHEAD;
        let Forces { laws, parameters, lists, bounds, block_bodies, row_bounds, width, .. } = self;
        let field = Field::new(laws, parameters);
        let work = move |((blocks, block_bodies), rates): (BlockParts, Rates), rows: Items| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let Range { start, end } = block.interior;
            let end = end.min(start + AHEAD);
            let rows = rows.cut(start).1.cut(end - start).0;
            field.advance(maker, (block, local), start..end, rows, rates.items.numbers);
        };
        each_block(
            bounds,
            ((&mut lists.blocks[..], &mut block_bodies[..]), rates_of(row_bounds, rates, laws.first())),
            (Rows::new(dydt, *width), vectors),
            &work,
            &|(), ()| (),
        );
    }

    /// Ends a right-hand side: makes the remaining bodies, adds pairs, and leaves accelerations in `dydt`,
    /// eqs. (2.13)-(2.15). The ghosts of the rank must have arrived.
    ///
    /// Returns the number of pairs within `l_max` whose first particle is owned by this rank. So over all
    /// ranks every pair counts once.
    ///
    /// Also returns two largest squared distances of owned bodies, m^2: from their positions when the lists
    /// were built, and from those at the start of the step. The first is 0 if it is certainly not beyond
    /// `free`.
    pub fn finish_stage(
        &mut self,
        maker: StageMaker,
        vectors: Vectors,
        dydt: &mut [f64],
        rates: &mut [f64],
    ) -> (u64, [f64; 2]) {
        let ahead = std::mem::take(&mut self.ahead);
        let Forces {
            laws, parameters, lists, bounds, block_bodies, outboxes, ghosts, row_bounds, width, ..
        } = self;
        let (field, law) = (Field::new(laws, parameters), laws.first().law());
        let (outboxes, ghosts) = (&outboxes[..], &ghosts[..]);
        let work = move |((blocks, block_bodies), rates): (BlockParts, Rates), (slopes, items): Items| {
            let rates = rates.items.numbers;
            fail_point!("worker");
            let (block, local) = (&mut blocks[0], &mut block_bodies[0]);
            let (slopes, width) = (slopes.numbers, local.width);
            local.import_ghosts(block, outboxes, ghosts, field.r);
            let (own, Range { start, end }) = (block.range.len(), block.interior.clone());
            let mut placed = end.min(start + ahead);
            let mut items = items.cut(placed).1.cut(end - placed).0;
            let mut pairs = Pairs::default();
            loop {
                // Bodies behind the interior were made before: once it is complete, all own bodies are there.
                let limit = if placed < end { placed } else { own };
                if local.distances[2] <= field.allowed {
                    pairs.sum_ready(limit, &field, (block, local), slopes, rates);
                }
                if placed == end {
                    break;
                }
                let part = placed..end.min(placed + CHUNK);
                let (these, rest) = items.cut(part.len());
                items = rest;
                let of_part = &mut slopes[part.start * width..part.end * width];
                field.advance(maker, (block, local), part.clone(), (Rows::new(of_part, width), these), rates);
                placed = part.end;
            }
            let [from_origin, from_start, strayed] = local.end_stage();
            if strayed > field.allowed {
                local.pick_near(block, &law, &field.parameters.walls);
                field.begin_again((block, local), slopes, rates);
                pairs = Pairs::default();
                pairs.sum_ready(own, &field, (block, local), slopes, rates);
            }
            (pairs.count, [from_origin, from_start])
        };
        let both = |a: (u64, [f64; 2]), b: (u64, [f64; 2])| {
            (a.0 + b.0, [larger(a.1[0], b.1[0]), larger(a.1[1], b.1[1])])
        };
        let own = ((&mut lists.blocks[..], &mut block_bodies[..]), rates_of(row_bounds, rates, laws.first()));
        each_block(bounds, own, (Rows::new(dydt, *width), vectors), &work, &both)
    }
}
