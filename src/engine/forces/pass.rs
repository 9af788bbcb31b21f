//! One right-hand side in one pass over memory: a stage is made for some particles at a time, their walls are summed while
//! they are in the caches, and pairs follow as soon as both of their particles are there.
//!
//! Particles that other threads and ranks must see come first, so that they travel while the next ones are made. None of
//! this changes the order in which a particle sums.

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

/// Particles that are made at a time: all that belongs to them stays in the first-level cache.
pub const CHUNK: usize = 64;

/// Particles that one thread makes while ghosts are under way: enough to be busy, and few enough to stay in the
/// second-level cache until their pairs come.
const AHEAD: usize = 1024;

/// Batches of pairs after which slopes are finished, while they are in the caches.
const BATCHES: usize = 8;

/// How the owned bodies come into place.
pub struct StageMaker<'a, F, W> {
    /// `make(stage, first, items, bodies, slopes)` puts bodies from particle `first` on into place; `items` belong to them, and
    /// the slopes are what they were.
    pub make: &'a F,
    /// The stage.
    pub stage: usize,
    /// Where particles were when the lists were built, m.
    pub origin: &'a [Vec3],
    /// How far from there they may be, squared, m^2.
    pub free: f64,
    /// Bodies when the step began: the same since `Forces::begin_step`.
    pub start: &'a [Motion<W>],
}

impl<F, W> Clone for StageMaker<'_, F, W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F, W> Copy for StageMaker<'_, F, W> {}

/// What is the same for all particles.
struct Field<'a, R, T> {
    law: &'a Law<R, T>,
    parameters: &'a BodyParameters,
    set: InstructionSet,
}

/// What belongs to consecutive particles: slopes, and the items of a `Place`.
type Rows<'a, W, C> = (&'a mut [Motion<W>], C);

impl<R: Rebound, T: Tangential> Field<'_, R, T> {
    /// Brings the particles with places in `part` to their stage, and sets their slopes to velocities, forces (N) and torques
    /// (N m) of walls.
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
            // A body that is nowhere is far from everything, although not further.
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

    /// Brings the particles at both ends, up to the last that others see, to their stage, and shows those that are seen in the
    /// window; the rows belong to the two ends.
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

    /// Adds forces and torques of walls to the slopes of the particles of `part`: of those that were picked as near, while
    /// they hold, else of all.
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

    /// Begins the slopes of all own particles in place anew, with velocities and walls.
    fn begin_again<W: Spin>(&self, (block, local): (&Block, &mut BlockBodies<W>), slopes: &mut [Motion<W>]) {
        slopes.iter_mut().zip(&local.bodies).for_each(|(slope, body)| clear(slope, body));
        self.add_walls(true, (block, local), 0..slopes.len(), slopes);
    }

    /// Makes accelerations of forces and torques, eqs. (2.13)-(2.15).
    fn finish<W: Spin>(&self, slopes: &mut [Motion<W>]) {
        let inverse_mass = 1.0 / self.parameters.mass;
        for slope in slopes {
            slope.v = slope.v * inverse_mass + self.parameters.gravity;
            slope.omega = slope.omega.scaled(self.parameters.inverse_inertia);
        }
    }
}

/// Begins the slope of a body in place. By component: as a whole it would take a detour over the stack.
fn clear<W: Spin>(slope: &mut Motion<W>, body: &Motion<W>) {
    (slope.x, slope.v, slope.omega) = (body.v, Vec3::zeros(), W::zero());
}

/// How far the pairs of a block have come.
#[derive(Default)]
struct Pairs {
    /// Batches that have been evaluated.
    batches: usize,
    /// The particles before this place have their accelerations.
    done: usize,
    /// Pairs that were within `l_max` and have their first particle in the block.
    count: u64,
}

impl Pairs {
    /// Evaluates pairs, and finishes slopes, as far as that is possible with the own particles before `limit` in place,
    /// besides the visitors.
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
            // Pairs come by their first particles: own ones before the next such have met all of their partners.
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
    /// A step begins: from a `Place::start` that no right-hand side so far had.
    pub fn begin_step(&mut self) {
        self.block_bodies.iter_mut().for_each(BlockBodies::begin);
    }

    /// Begins a right-hand side: brings those bodies that others see to the stage that `place` makes. `items` belong to the
    /// owned particles. Needs no ghosts.
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

    /// Goes on with bodies that nobody else sees, while ghosts are under way. Needs no ghosts.
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

    /// Ends a right-hand side: brings the bodies that are left into place, adds pairs, and leaves accelerations in the slopes,
    /// eqs. (2.13)-(2.15). Ghosts are in place. Where `goes_on` it opens the next stage of the same `place` and items as well, and
    /// slopes of particles at both ends are begun anew. Returns how many pairs are within `l_max` and have the earlier of
    /// their particles here, so that over all ranks every pair is counted once, and the largest squared distances of the owned
    /// bodies from where the lists were built, as far as they may exceed `free`, and from where the step began, m^2.
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
                // What is behind the hidden ones is in place too.
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
