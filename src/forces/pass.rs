//! One right-hand side in one pass over memory: a stage is made for some particles at a time, their walls are summed while
//! they are in the caches, and pairs follow as soon as both of their particles are there.
//!
//! Particles that other ranks must see come first, so that they travel while the next ones are made; where threads share
//! the particles all of them are made before the first pair. None of this changes the order in which a particle sums.

use super::{Forces, Part, Setting, each_block, strayed};
use crate::contact::{Law, Rebound, Tangential};
use crate::elementary::Separate;
use crate::instructions::InstructionSet;
use crate::kernel::{self, Batch, Sweep};
use crate::neighbors::{BATCH, Block};
use crate::ode::larger;
use crate::parallel::Cut;
use crate::particle::{Motion, Spin, Vec3, dot, minus};
use fail::fail_point;
use std::ops::Range;

/// Particles that are made at a time: all that belongs to them stays in the first-level cache.
const CHUNK: usize = 64;

/// Particles that one thread makes while ghosts are under way: enough to be busy, and few enough to stay in the
/// second-level cache until their pairs come.
const AHEAD: usize = 1024;

/// Batches of pairs after which slopes are finished, while they are in the caches.
const BATCHES: usize = 8;

/// How the owned bodies come into place.
pub struct Place<'a, F> {
    /// `make(first, items, bodies, slopes)` puts bodies from particle `first` on into place; `items` belong to them, and the
    /// slopes are what they were.
    pub make: &'a F,
    /// Where particles were when the lists were built and when the step began, m.
    pub anchors: [&'a [Vec3]; 2],
}

impl<F> Clone for Place<'_, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Place<'_, F> {}

/// Largest squared distances of bodies from the two anchors and from where near pairs were picked, m^2.
pub type Ways = [f64; 3];

fn furthest(a: Ways, b: Ways) -> Ways {
    std::array::from_fn(|k| larger(a[k], b[k]))
}

/// What is the same for all particles.
struct Field<'a, R, T> {
    law: &'a Law<R, T>,
    setting: &'a Setting,
    set: InstructionSet,
    /// Where bodies were when near pairs were picked, m, and how far they may be from there, squared, m^2.
    picked: &'a [Vec3],
    allowed: f64,
}

/// What belongs to consecutive particles: bodies, slopes, and the items of a `Place`.
type Rows<'a, W, C> = (&'a mut [Motion<W>], (&'a mut [Motion<W>], C));

impl<R: Rebound, T: Tangential> Field<'_, R, T> {
    /// Brings the particles of `part` to their stage, and sets their slopes to velocities, forces (N) and torques (N m) of
    /// walls.
    fn advance<W: Spin, C: Cut>(
        &self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>])>,
        (block, batch): (&Block, &mut Batch),
        part: Range<usize>,
        mut rows: Rows<W, C>,
    ) -> Ways {
        let mut ways = [0.0; 3];
        let mut first = part.start;
        while first < part.end {
            let chunk = first..part.end.min(first + CHUNK);
            let ((bodies, (slopes, items)), rest) = rows.cut(chunk.len());
            rows = rest;
            (place.make)(first, items, bodies, slopes);
            let [origin, start] = place.anchors.map(|anchor| &anchor[chunk.clone()]);
            let from = origin.iter().zip(start).zip(&self.picked[chunk.clone()]);
            let mut far = [0.0; 3];
            for ((body, slope), ((origin, start), picked)) in bodies.iter().zip(&mut *slopes).zip(from) {
                for (far, from) in far.iter_mut().zip([origin, start, picked]) {
                    let way = minus(&body.x, from);
                    *far = larger(*far, dot::<Separate>(&way, &way));
                }
                clear(slope, body);
            }
            self.add_walls(far[2] <= self.allowed, (block, batch), chunk.clone(), bodies, slopes);
            ways = furthest(ways, far);
            first = chunk.end;
        }
        ways
    }

    /// Adds forces and torques of walls to the slopes of the particles of `part`: of those that were picked as near, while
    /// they hold, else of all.
    fn add_walls<W: Spin>(
        &self,
        near: bool,
        (block, batch): (&Block, &mut Batch),
        part: Range<usize>,
        bodies: &[Motion<W>],
        slopes: &mut [Motion<W>],
    ) {
        let contacts = if near { &block.near_walls } else { &block.walls };
        let before = |end: usize| contacts.partition_point(|contact| (contact[0] as usize) < end);
        let contacts = &contacts[before(part.start)..before(part.end)];
        let sweep = Sweep { law: self.law, bodies, range: part, batch, slopes };
        kernel::add_walls(self.set, (contacts, &self.setting.walls), sweep);
    }

    /// Makes accelerations of forces and torques, eqs. (2.13)-(2.15).
    fn finish<W: Spin>(&self, slopes: &mut [Motion<W>]) {
        let inverse_mass = 1.0 / self.setting.mass;
        for slope in slopes {
            slope.v = slope.v * inverse_mass + self.setting.gravity;
            slope.omega = slope.omega.scaled(self.setting.inverse_inertia);
        }
    }
}

/// Begins the slope of a body in place. By component: as a whole it would take a detour over the stack.
fn clear<W: Spin>(slope: &mut Motion<W>, body: &Motion<W>) {
    (slope.x, slope.v, slope.omega) = (body.v, Vec3::zeros(), W::zero());
}

/// How far the pairs of a block have come.
struct Pairs<'a> {
    block: &'a Block,
    /// Batches that have been evaluated.
    batches: usize,
    /// The particles before this one have their accelerations.
    done: usize,
    /// Pairs that were within `l_max` and have their first particle in the block.
    count: u64,
}

impl<'a> Pairs<'a> {
    fn of(block: &'a Block) -> Self {
        Pairs { block, batches: 0, done: block.range.start, count: 0 }
    }

    /// Evaluates pairs, and finishes slopes, as far as that is possible with the particles before `limit` in place, besides
    /// those that are not of the block.
    fn follow<R: Rebound, T: Tangential, W: Spin>(
        &mut self,
        limit: usize,
        field: &Field<R, T>,
        batch: &mut Batch,
        bodies: &[Motion<W>],
        slopes: &mut [Motion<W>],
    ) {
        let Block { range, near, horizon, .. } = self.block;
        loop {
            let ready = horizon[self.batches..].iter().take(BATCHES);
            let ready = ready.take_while(|&&horizon| horizon as usize <= limit).count();
            if ready > 0 {
                let pairs = &near[self.batches * BATCH..near.len().min((self.batches + ready) * BATCH)];
                let slopes = &mut *slopes;
                let sweep = Sweep { law: field.law, bodies, range: range.clone(), batch, slopes };
                self.count += kernel::add_pairs(field.set, pairs, sweep);
                self.batches += ready;
            }
            // Pairs come by their first particles: those before the next one have met all of their partners.
            let next = near.get(self.batches * BATCH).map_or(limit, |pair| pair[0] as usize);
            if range.contains(&next) || self.batches == horizon.len() {
                let end = next.min(limit).max(self.done);
                field.finish(&mut slopes[self.done - range.start..end - range.start]);
                self.done = end;
            }
            if ready < BATCHES {
                return;
            }
        }
    }
}

impl<R: Rebound, T: Tangential, W: Spin> Forces<R, T, W> {
    /// From now on the owned particles `seen` are in place before any other, because ranks want to see them.
    pub fn show(&mut self, seen: impl Iterator<Item = usize>) {
        let blocks = &mut self.lists.blocks;
        for block in &mut *blocks {
            block.hidden = block.range.clone();
        }
        for i in seen {
            let block = blocks.partition_point(|block| block.range.end <= i);
            let Block { range, hidden, .. } = &mut blocks[block];
            // They lie at both ends of a block, if they do not lie everywhere.
            if i - range.start < range.end - i {
                hidden.start = hidden.start.max(i + 1);
            } else {
                hidden.end = hidden.end.min(i);
            }
            hidden.end = hidden.end.max(hidden.start);
        }
    }

    /// Begins a right-hand side: brings those bodies that other ranks see to the stage that `place` makes. `items` belong to
    /// the owned particles. Needs no ghosts.
    pub fn open<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        self.ways = [0.0; 3];
        if self.lists.blocks.iter().any(|block| block.hidden != block.range) {
            let ends =
                |block: &Block| [block.range.start..block.hidden.start, block.hidden.end..block.range.end];
            self.advance(place, items, dydt, &ends);
        }
    }

    /// Goes on with bodies that no other rank sees, while ghosts are under way: with all where threads share them, else with
    /// the first ones. Needs no ghosts.
    pub fn go_on<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        let ahead = self.ahead();
        let next = |Block { hidden, .. }: &Block| {
            let end = hidden.end.min(hidden.start.saturating_add(ahead));
            [hidden.start..end, end..end]
        };
        self.advance(place, items, dydt, &next);
    }

    /// Particles of a block that `go_on` brings into place.
    fn ahead(&self) -> usize {
        if self.lists.blocks.len() > 1 { usize::MAX } else { AHEAD }
    }

    /// Brings two parts of every block into place.
    fn advance<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync>,
        items: C,
        dydt: &mut [Motion<W>],
        parts: &(impl Fn(&Block) -> [Range<usize>; 2] + Sync),
    ) {
        let allowed = self.allowed();
        let Forces { law, setting, set, picked, bodies, lists, batches, owned, .. } = self;
        let field = Field { law, setting, set: *set, picked, allowed };
        let work = |Part { block, batch, items: rows }: Part<Rows<W, C>>| {
            let [first, second] = parts(block);
            let rows = rows.cut(first.start - block.range.start).1;
            let (these, rows) = rows.cut(first.len());
            let those = rows.cut(second.start - first.end).1.cut(second.len()).0;
            let ways = field.advance(place, (block, batch), first, these);
            furthest(ways, field.advance(place, (block, batch), second, those))
        };
        let items = (&mut bodies[..*owned], (dydt, items));
        let ways = each_block((&lists.blocks, batches), items, &work, &furthest);
        self.ways = furthest(self.ways, ways);
    }

    /// Ends a right-hand side: brings the bodies that are left into place, adds pairs, and leaves accelerations in the slopes,
    /// eqs. (2.13)-(2.15). Ghosts are in place. Returns how many pairs are within `l_max` and have the earlier of their
    /// particles here: over all ranks every pair is counted once.
    pub fn close<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync>,
        items: C,
        dydt: &mut [Motion<W>],
    ) -> u64 {
        let ghosts = &self.bodies[self.owned..];
        self.ways[2] = larger(self.ways[2], strayed(ghosts, &self.picked[self.owned..]));
        let count = if self.lists.blocks.len() == 1 { self.close_alone(place, items, dydt) } else { None };
        count.unwrap_or_else(|| {
            self.strayed = self.ways[2];
            self.close_placed(dydt)
        })
    }

    /// `close` of one block. None where near pairs did not hold to the end: then all is in place, and nothing is summed.
    fn close_alone<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, C, &mut [Motion<W>], &mut [Motion<W>])>,
        items: C,
        dydt: &mut [Motion<W>],
    ) -> Option<u64> {
        let (allowed, ahead) = (self.allowed(), self.ahead());
        let Forces { law, setting, set, picked, bodies, lists, batches, ways, .. } = self;
        let field = Field { law, setting, set: *set, picked, allowed };
        let (block, batch) = (&lists.blocks[0], &mut batches[0]);
        fail_point!("worker");
        let Range { start, end } = block.hidden;
        let mut placed = end.min(start.saturating_add(ahead));
        let mut items = items.cut(placed).1;
        let mut pairs = Pairs::of(block);
        loop {
            // What is behind the hidden ones is in place too.
            let limit = if placed < end { placed } else { block.range.end };
            if ways[2] <= allowed {
                pairs.follow(limit, &field, batch, bodies, dydt);
            }
            if placed == end {
                break;
            }
            let part = placed..end.min(placed + CHUNK);
            let (these, rest) = items.cut(part.len());
            items = rest;
            let rows = (&mut bodies[part.clone()], (&mut dydt[part.clone()], these));
            *ways = furthest(*ways, field.advance(place, (block, &mut *batch), part.clone(), rows));
            placed = part.end;
        }
        (ways[2] <= allowed).then_some(pairs.count)
    }

    /// `close` where all bodies are in place and slopes hold what walls add, or, if near pairs have to be picked afresh,
    /// anything.
    fn close_placed(&mut self, dydt: &mut [Motion<W>]) -> u64 {
        let again = self.strayed > self.allowed();
        if again {
            self.pick_near();
        }
        let allowed = self.allowed();
        let Forces { law, setting, set, picked, bodies, lists, batches, .. } = self;
        let field = Field { law, setting, set: *set, picked, allowed };
        let bodies = &bodies[..];
        let work = |Part { block, batch, items: slopes }: Part<&mut [Motion<W>]>| {
            fail_point!("worker");
            if again {
                let own = &bodies[block.range.clone()];
                slopes.iter_mut().zip(own).for_each(|(slope, body)| clear(slope, body));
                field.add_walls(true, (block, batch), block.range.clone(), own, slopes);
            }
            let mut pairs = Pairs::of(block);
            pairs.follow(block.range.end, &field, batch, bodies, slopes);
            pairs.count
        };
        each_block((&lists.blocks, batches), dydt, &work, &|a, b| a + b)
    }

    /// Largest squared distances of the owned bodies in place from the two anchors, m^2.
    pub fn moved(&self) -> [f64; 2] {
        [self.ways[0], self.ways[1]]
    }
}
