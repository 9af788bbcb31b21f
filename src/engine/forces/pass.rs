//! One right-hand side in one pass over memory: a stage is made for some particles at a time, their walls are summed while
//! they are in the caches, and pairs follow as soon as both of their particles are there.
//!
//! Particles that other threads and ranks must see come first, so that they travel while the next ones are made. None of
//! this changes the order in which a particle sums.

use super::site::{Site, allowed, distance_squared, furthest};
use super::{Forces, Seat, Setting, Windowed, each_block};
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
pub struct Place<'a, F, W> {
    /// `make(stage, first, items, bodies, slopes)` puts bodies from particle `first` on into place; `items` belong to them, and
    /// the slopes are what they were.
    pub make: &'a F,
    /// The stage.
    pub stage: usize,
    /// Where particles were when the lists were built, m.
    pub origin: &'a [Vec3],
    /// How far from there they may be, squared, m^2.
    pub free: f64,
    /// Bodies when the step began: the same since `Forces::begin`.
    pub start: &'a [Motion<W>],
}

impl<F, W> Clone for Place<'_, F, W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F, W> Copy for Place<'_, F, W> {}

/// What is the same for all particles.
struct Field<'a, R, T> {
    law: &'a Law<R, T>,
    setting: &'a Setting,
    set: InstructionSet,
}

/// What belongs to consecutive particles: slopes, and the items of a `Place`.
type Rows<'a, W, C> = (&'a mut [Motion<W>], C);

impl<R: Rebound, T: Tangential> Field<'_, R, T> {
    /// Brings the particles with places in `part` to their stage, and sets their slopes to velocities, forces (N) and torques
    /// (N m) of walls.
    fn advance<W: Spin, C: Cut>(
        &self,
        place: Place<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]), W>,
        (block, site): (&Block, &mut Site<W>),
        part: Range<usize>,
        mut rows: Rows<W, C>,
    ) {
        let allowed = allowed(self.law.r);
        let mut first = part.start;
        while first < part.end {
            let chunk = first..part.end.min(first + CHUNK);
            let ((slopes, items), rest) = rows.cut(chunk.len());
            rows = rest;
            let (bodies, picked) = (&mut site.bodies[chunk.clone()], &site.picked[chunk.clone()]);
            let own = block.range.start + chunk.start..block.range.start + chunk.end;
            (place.make)(place.stage, own.start, items, bodies, slopes);
            let starts = &place.start[own.clone()];
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
            let from_origin = site.from_origin.furthest(&place.origin[own], ends, way, place.free);
            let strayed = site.from_picked.furthest(picked, ends, way, allowed);
            site.ways = furthest(site.ways, [from_origin, way, strayed]);
            self.add_walls(strayed <= allowed, (block, site), chunk.clone(), slopes);
            first = chunk.end;
        }
    }

    /// Brings the particles at both ends, up to the last that others see, to their stage, and shows those that are seen in the
    /// window; the rows belong to the two ends.
    fn show<W: Spin, C: Cut>(
        &self,
        place: Place<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]), W>,
        (block, site): (&Block, &mut Site<W>),
        window: &mut [Motion<W>],
        [front, back]: [Rows<W, C>; 2],
    ) {
        let Range { start, end } = block.hidden;
        self.advance(place, (block, site), 0..start, front);
        self.advance(place, (block, site), end..block.range.len(), back);
        site.show(block, window);
    }

    /// Adds forces and torques of walls to the slopes of the particles of `part`: of those that were picked as near, while
    /// they hold, else of all.
    fn add_walls<W: Spin>(
        &self,
        near: bool,
        (block, site): (&Block, &mut Site<W>),
        part: Range<usize>,
        slopes: &mut [Motion<W>],
    ) {
        let contacts = if near { &block.near_walls } else { &block.walls };
        let before = |end: usize| contacts.partition_point(|contact| (contact[0] as usize) < end);
        let contacts = &contacts[before(part.start)..before(part.end)];
        let Site { bodies, batch, .. } = site;
        let sweep = Sweep { law: self.law, bodies: &bodies[part.clone()], batch, slopes };
        kernel::add_walls(self.set, part.start, (contacts, &self.setting.walls), sweep);
    }

    /// Begins the slopes of all own particles in place anew, with velocities and walls.
    fn begin_again<W: Spin>(&self, (block, site): (&Block, &mut Site<W>), slopes: &mut [Motion<W>]) {
        slopes.iter_mut().zip(&site.bodies).for_each(|(slope, body)| clear(slope, body));
        self.add_walls(true, (block, site), 0..slopes.len(), slopes);
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
    fn follow<R: Rebound, T: Tangential, W: Spin>(
        &mut self,
        limit: usize,
        field: &Field<R, T>,
        (block, site): (&Block, &mut Site<W>),
        slopes: &mut [Motion<W>],
    ) {
        let Block { near, horizon, .. } = block;
        loop {
            let ready = horizon[self.batches..].iter().take(BATCHES);
            let ready = ready.take_while(|&&horizon| horizon as usize <= limit).count();
            if ready > 0 {
                let pairs = &near[self.batches * BATCH..near.len().min((self.batches + ready) * BATCH)];
                let Site { bodies, batch, .. } = &mut *site;
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
    pub fn begin(&mut self) {
        self.sites.iter_mut().for_each(Site::begin);
    }

    /// Begins a right-hand side: brings those bodies that others see to the stage that `place` makes. `items` belong to the
    /// owned particles. Needs no ghosts.
    pub fn open<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        let Forces { law, setting, lists, bounds, sites, windows, shown, set, .. } = self;
        let windows = &mut windows[*shown][..];
        if windows.iter().all(Vec::is_empty) {
            return;
        }
        let field = Field { law, setting, set: *set };
        let work = move |((blocks, sites), windows): Windowed<W>, rows: Rows<W, C>| {
            let (block, site) = (&blocks[0], &mut sites[0]);
            let (front, rows) = rows.cut(block.hidden.start);
            let back = rows.cut(block.hidden.len()).1;
            field.show(place, (block, site), &mut windows[0], [front, back]);
        };
        let own = ((&mut lists.blocks[..], &mut sites[..]), windows);
        each_block(bounds, own, (dydt, items), &work, &|(), ()| ());
    }

    /// Goes on with bodies that nobody else sees, while ghosts are under way. Needs no ghosts.
    pub fn go_on<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        items: C,
        dydt: &mut [Motion<W>],
    ) {
        self.ahead = AHEAD;
        let Forces { law, setting, lists, bounds, sites, set, .. } = self;
        let field = Field { law, setting, set: *set };
        let work = move |(blocks, sites): Seat<W>, rows: Rows<W, C>| {
            let (block, site) = (&blocks[0], &mut sites[0]);
            let Range { start, end } = block.hidden;
            let end = end.min(start + AHEAD);
            let rows = rows.cut(start).1.cut(end - start).0;
            field.advance(place, (block, site), start..end, rows);
        };
        each_block(bounds, (&mut lists.blocks[..], &mut sites[..]), (dydt, items), &work, &|(), ()| ());
    }

    /// Ends a right-hand side: brings the bodies that are left into place, adds pairs, and leaves accelerations in the slopes,
    /// eqs. (2.13)-(2.15). Ghosts are in place. Where `goes_on` it opens the next stage of the same `place` and items as well, and
    /// slopes of particles at both ends are begun anew. Returns how many pairs are within `l_max` and have the earlier of
    /// their particles here, so that over all ranks every pair is counted once, and the largest squared distances of the owned
    /// bodies from where the lists were built, as far as they may exceed `free`, and from where the step began, m^2.
    pub fn close<C: Cut>(
        &mut self,
        place: Place<impl Fn(usize, usize, C, &mut [Motion<W>], &mut [Motion<W>]) + Sync, W>,
        goes_on: bool,
        items: C,
        dydt: &mut [Motion<W>],
    ) -> (u64, [f64; 2]) {
        let ahead = std::mem::take(&mut self.ahead);
        let Forces { law, setting, lists, bounds, sites, windows, shown, ghosts, set, .. } = self;
        let (law, setting) = (&*law, &*setting);
        let (field, allowed) = (Field { law, setting, set: *set }, allowed(law.r));
        let [even, odd] = windows;
        let (windows, next_windows) = if *shown == 0 { (even, odd) } else { (odd, even) };
        let goes_on = goes_on && !windows.iter().all(Vec::is_empty);
        let (windows, ghosts) = (&windows[..], &ghosts[..]);
        let work = move |((blocks, sites), next_windows): Windowed<W>, (slopes, items): Rows<W, C>| {
            fail_point!("worker");
            let (block, site) = (&mut blocks[0], &mut sites[0]);
            site.look(block, windows, ghosts);
            let (own, Range { start, end }) = (block.range.len(), block.hidden.clone());
            let mut placed = end.min(start + ahead);
            let (front, items) = items.cut(start);
            let (items, back) = items.cut(end - start);
            let mut items = items.cut(placed - start).1;
            let mut pairs = Pairs::default();
            loop {
                // What is behind the hidden ones is in place too.
                let limit = if placed < end { placed } else { own };
                if site.ways[2] <= allowed {
                    pairs.follow(limit, &field, (block, site), slopes);
                }
                if placed == end {
                    break;
                }
                let part = placed..end.min(placed + CHUNK);
                let (these, rest) = items.cut(part.len());
                items = rest;
                field.advance(place, (block, site), part.clone(), (&mut slopes[part.clone()], these));
                placed = part.end;
            }
            let [from_origin, from_start, strayed] = site.end_stage();
            if strayed > allowed {
                site.pick_near(block, law, &setting.walls);
                field.begin_again((block, site), slopes);
                pairs = Pairs::default();
                pairs.follow(own, &field, (block, site), slopes);
            }
            if goes_on {
                let next = Place { stage: place.stage + 1, ..place };
                let (first, rest) = slopes.split_at_mut(start);
                let last = &mut rest[end - start..];
                field.show(next, (block, site), &mut next_windows[0], [(first, front), (last, back)]);
            }
            (pairs.count, [from_origin, from_start])
        };
        let both = |a: (u64, [f64; 2]), b: (u64, [f64; 2])| {
            (a.0 + b.0, [larger(a.1[0], b.1[0]), larger(a.1[1], b.1[1])])
        };
        let own = ((&mut lists.blocks[..], &mut sites[..]), &mut next_windows[..]);
        let found = each_block(bounds, own, (dydt, items), &work, &both);
        *shown ^= usize::from(goes_on);
        found
    }
}
