//! The memories of contacts: which contacts have a row in the state, and where.
//!
//! A contact has a row while its gap at the last accepted state is within `Forces::memory_gap`. Rows are
//! numbered block by block, in the order of the listed pairs and then of the listed walls. A pair of
//! particles in two blocks, or on two ranks, has a row in both, with the same bits.
//!
//! Rows change between steps only. [`Forces::find_contacts`] looks at the bodies of the last stage of a trial
//! step, and [`Forces::take_contacts`] follows once that step is accepted.

use super::block_bodies::BlockBodies;
use super::blocks::each_block;
use super::pass::{StageMaker, Vectors};
use super::{BlockParts, Forces, sizes_of};
use crate::engine::kernel::{Laws, NO_ROW};
use crate::engine::neighbors::Block;
use crate::math::vector::Vec3;
use crate::model::columns::{position, spin, velocity};
use crate::model::history::{Partner, Touch};
use crate::model::size::{Partners, Sizes};
use crate::model::wall::Wall;
use crate::ode::{Part, Rows, Stage};
use crate::threads::Cut;

/// Number of rows whose stage is made at a time.
const ROWS: usize = 256;

/// Number of the partner in the key of a contact with wall 0; those of other walls follow. It is exact as a
/// double, and no particle has it as its id.
pub const FIRST_WALL: u64 = 1 << 52;

/// The contacts of a block within reach, where they are not those that have rows.
#[derive(Debug, Default)]
pub struct Found {
    /// Whether other contacts have rows than before.
    changed: bool,
    /// The place of every new row: index of the listed pair, or number of listed pairs plus that of the wall.
    places: Vec<u32>,
    /// The old row of every new one; [`NO_ROW`] for a new contact.
    sources: Vec<u32>,
    /// Rates of the memories of new contacts, in the order of their rows, 1/s.
    first_rates: Vec<f64>,
}

/// How rows follow from those before.
#[derive(Debug, Default)]
pub struct Turnover {
    /// The old row of every new one; [`NO_ROW`] for a new contact.
    pub sources: Vec<u32>,
    /// Rates of the memories of new contacts, in the order of their rows, 1/s.
    pub first_rates: Vec<f64>,
    /// Their keys, and whether they are counted here; see `Forces::assign_rows`.
    pub first_keys: Vec<([u64; 2], bool)>,
}

/// Items that belong to the rows of blocks. They are cut by blocks.
pub struct ByRows<'a, C> {
    /// First row of each of these blocks, and the end of the last one.
    pub bounds: &'a [usize],
    /// One item a row.
    pub items: C,
}

impl<C: Cut> Cut for ByRows<'_, C> {
    fn cut(self, at: usize) -> (Self, Self) {
        let (before, after) = self.items.cut(self.bounds[at] - self.bounds[0]);
        let (head, tail) = (&self.bounds[..=at], &self.bounds[at..]);
        (ByRows { bounds: head, items: before }, ByRows { bounds: tail, items: after })
    }
}

/// Near contacts of a block in the order of rows: whether each is within reach, its row, and its place.
fn near_contacts<'a>(
    (block, local): (&'a Block, &'a BlockBodies),
    walls: &'a [Wall],
    (sizes, gap): (Sizes<'a>, f64),
) -> impl Iterator<Item = (bool, u32, u32)> + 'a {
    let x = |slot: u32| position(local.body(slot as usize));
    let r = move |slot: u32| sizes.of(slot as usize).r;
    let pairs = block.near.iter().zip(&block.near_rows).zip(&block.near_places);
    let pairs = pairs.map(move |((&[i, j], &row), &place)| {
        // A distance that is NaN must not count as far.
        let reach = r(i) + r(j) + gap;
        let far = (x(i) - x(j)).norm_squared() > reach * reach;
        (!far, row, place)
    });
    let of_walls = block.near_walls.iter().zip(&block.near_wall_rows).zip(&block.near_wall_places);
    let of_walls = of_walls.map(move |((&[i, wall], &row), &place)| {
        let far = walls[wall as usize].depth(&x(i)) - r(i) > gap;
        (!far, row, block.pairs.len() as u32 + place)
    });
    pairs.chain(of_walls)
}

/// Adds the rate of the memory of a new contact, in place `place`, to `rates`; see `Found::places`.
fn add_first_rate(
    laws: &Laws,
    (block, local): (&Block, &BlockBodies),
    (walls, sizes): (&[Wall], Sizes),
    place: usize,
    rates: &mut Vec<f64>,
) {
    let kernel = laws.of(block.class_of(place));
    let (law, memory) = (kernel.law(), &Vec3::zeros());
    let typical = law.memory.map_or(1.0, |memory| memory.mass);
    let size = |slot: u32| sizes.of(slot as usize);
    // The turning of a memory of 0 is 0.
    let spin_n = 0.0;
    let body = |slot: u32| local.body(slot as usize);
    if let Some(&[i, j]) = block.pairs.get(place) {
        let (a, b) = (body(i), body(j));
        let apart = position(a) - position(b);
        let d = apart.norm();
        let (n, v_rel, spins) = (&(apart / d), &(velocity(a) - velocity(b)), &(spin(a) + spin(b)));
        let size = Partners::of_pair(&size(i), &size(j), typical);
        let touch = Touch { gap: d - size.surfaces, n, v_rel, spins, spin_n, size, memory };
        let difference = spin(a) * size.arms[0] - spin(b) * size.arms[1];
        return kernel.add_first_rate(Partner::Sphere, touch, &difference, rates);
    }
    let [i, wall] = block.walls[place - block.pairs.len()];
    let (a, wall) = (body(i), &walls[wall as usize]);
    let (n, v_rel, spins) = (&-wall.normal, &velocity(a), &spin(a));
    let size = Partners::of_wall(&size(i), typical);
    let touch =
        Touch { gap: wall.depth(&position(a)) - size.surfaces, n, v_rel, spins, spin_n, size, memory };
    kernel.add_first_rate(Partner::Wall, touch, spins, rates);
}

impl Forces {
    /// Numbers of the memory of a contact.
    pub fn memory_width(&self) -> usize {
        self.laws.first().memory()
    }

    /// Number of rows.
    pub fn memory_rows(&self) -> usize {
        self.row_bounds.last().copied().unwrap_or(0)
    }

    /// The class of the contact of every row; empty where there is one class only.
    pub fn row_classes(&self) -> Vec<u32> {
        if self.laws.count() == 1 {
            return Vec::new();
        }
        let of_block = |block: &Block| {
            let rows = block.pair_rows.iter().chain(&block.wall_rows).enumerate();
            let rows = rows.filter(|(_, row)| **row != NO_ROW);
            // Rows of a block are in the order of places.
            rows.map(|(place, _)| block.class_of(place) as u32).collect::<Vec<_>>()
        };
        self.lists.blocks.iter().flat_map(of_block).collect()
    }

    /// From now on contacts have a memory while their gap is at most `gap` (m) at an accepted state.
    pub fn remember_within(&mut self, gap: f64) {
        self.memory_gap = gap;
    }

    /// Makes the stage of all memories, and sets their rates to 0. `vectors` and `rates` have one row for
    /// each.
    pub fn make_memories(&mut self, maker: StageMaker, first: usize, vectors: Vectors, rates: &mut [f64]) {
        let Forces { laws, lists, bounds, block_bodies, row_bounds, .. } = self;
        let width = laws.first().memory();
        let work = |((_, block_bodies), rows): (BlockParts, ByRows<(Rows, Vectors)>), ()| {
            let memories = &mut block_bodies[0].memories;
            let (mut rest, mut row) = (rows.items, rows.bounds[0]);
            memories.resize((rows.bounds[1] - rows.bounds[0]) * width, 0.0);
            for states in memories.chunks_mut(ROWS * width) {
                let ((slopes, vectors), behind) = rest.cut(states.len() / width);
                rest = behind;
                let start = first + row * width;
                let part = Part { segment: 1, row, start, len: states.len(), width, positions: 0 };
                row += states.len() / width;
                let vectors = vectors.map(|rows| rows.numbers);
                (maker.make)(Stage { part, vectors, state: states, slope: slopes.numbers });
                slopes.numbers.fill(0.0);
            }
        };
        let items = (Rows::new(rates, width), vectors);
        let own = (&mut lists.blocks[..], &mut block_bodies[..]);
        each_block(bounds, (own, ByRows { bounds: row_bounds, items }), (), &work, &|(), ()| ());
    }

    /// Finds out which contacts are within reach in the current bodies. `take_contacts` takes them over.
    pub fn find_contacts(&mut self) {
        if self.memory_width() == 0 {
            return;
        }
        let Forces { laws, parameters, lists, bounds, block_bodies, row_bounds, memory_gap, .. } = self;
        let (laws, walls) = (&*laws, &parameters.walls[..]);
        let gap = memory_gap.min(laws.first().law().l_max);
        let work = |((blocks, block_bodies), rows): (BlockParts, ByRows<()>), ()| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let mut found = std::mem::take(&mut local.found);
            let local = &*local;
            let sizes = sizes_of(&local.sizes, laws.first(), parameters);
            let (mut kept, mut changed) = (0, false);
            for (within, row, _) in near_contacts((block, local), walls, (sizes, gap)) {
                changed |= within != (row != NO_ROW);
                kept += usize::from(row != NO_ROW);
            }
            // A contact with a row that is no longer near is beyond reach.
            found.changed = changed || kept != rows.bounds[1] - rows.bounds[0];
            if found.changed {
                found.places.clear();
                found.sources.clear();
                found.first_rates.clear();
                for (_, row, place) in
                    near_contacts((block, local), walls, (sizes, gap)).filter(|(within, ..)| *within)
                {
                    found.places.push(place);
                    found.sources.push(row);
                    if row == NO_ROW {
                        let rates = &mut found.first_rates;
                        add_first_rate(laws, (block, local), (walls, sizes), place as usize, rates);
                    }
                }
            }
            block_bodies[0].found = found;
        };
        let own = (&mut lists.blocks[..], &mut block_bodies[..]);
        let rows = ByRows { bounds: row_bounds, items: () };
        each_block(bounds, (own, rows), (), &work, &|(), ()| ());
    }

    /// Gives rows to the contacts that `find_contacts` found, if these are others than before. `ids` are
    /// those of the bodies by local index.
    pub fn take_contacts(&mut self, ids: &[u64]) -> Option<Turnover> {
        if !self.block_bodies.iter().any(|local| local.found.changed) {
            return None;
        }
        let mut turnover = Turnover::default();
        let old = self.row_bounds.clone();
        self.row_bounds.truncate(1);
        for ((block, local), bounds) in
            self.lists.blocks.iter_mut().zip(&mut self.block_bodies).zip(old.windows(2))
        {
            let found = &mut local.found;
            if std::mem::take(&mut found.changed) {
                block.forget_rows(true);
                for ((row, &place), &source) in (0..).zip(&found.places).zip(&found.sources) {
                    let place = place as usize;
                    match place.checked_sub(block.pairs.len()) {
                        None => block.pair_rows[place] = row,
                        Some(wall) => block.wall_rows[wall] = row,
                    }
                    if source == NO_ROW {
                        turnover.first_keys.push(block.key(ids, place));
                    }
                }
                block.look_up_rows();
                let moved = |&row: &u32| if row == NO_ROW { row } else { row + bounds[0] as u32 };
                turnover.sources.extend(found.sources.iter().map(moved));
                turnover.first_rates.append(&mut found.first_rates);
            } else {
                turnover.sources.extend(bounds[0] as u32..bounds[1] as u32);
            }
            self.row_bounds.push(turnover.sources.len());
        }
        Some(turnover)
    }

    /// Gives a row to every listed contact for whose key `has_row` holds. Returns the keys of all rows, in
    /// order, and whether each is counted here: over all ranks every contact counts once.
    ///
    /// A key holds the ids of the first and the second body; a wall counts from [`FIRST_WALL`] on. `ids` are
    /// those of the bodies by local index.
    pub fn assign_rows(
        &mut self,
        ids: &[u64],
        has_row: &mut dyn FnMut([u64; 2]) -> bool,
    ) -> Vec<([u64; 2], bool)> {
        let mut keys = Vec::new();
        self.row_bounds.truncate(1);
        for (block, local) in self.lists.blocks.iter_mut().zip(&mut self.block_bodies) {
            block.forget_rows(true);
            let mut next = 0;
            for place in 0..block.pairs.len() + block.walls.len() {
                let key = block.key(ids, place);
                if has_row(key.0) {
                    match place.checked_sub(block.pairs.len()) {
                        None => block.pair_rows[place] = next,
                        Some(wall) => block.wall_rows[wall] = next,
                    }
                    keys.push(key);
                    next += 1;
                }
            }
            local.found.changed = false;
            block.look_up_rows();
            self.row_bounds.push(keys.len());
        }
        keys
    }
}

impl Block {
    /// From now on no contact has a row.
    pub(super) fn forget_rows(&mut self, remembers: bool) {
        self.remembers = remembers;
        let (pairs, walls) = if remembers { (self.pairs.len(), self.walls.len()) } else { (0, 0) };
        self.pair_rows.clear();
        self.pair_rows.resize(pairs, NO_ROW);
        self.wall_rows.clear();
        self.wall_rows.resize(walls, NO_ROW);
    }

    /// The key of the contact in a place, see `Found::places`, and whether it is counted here.
    fn key(&self, ids: &[u64], place: usize) -> ([u64; 2], bool) {
        if let Some(&pair) = self.pairs.get(place) {
            return (pair.map(|slot| ids[self.index(slot)]), self.owns(pair[0]));
        }
        let [slot, wall] = self.walls[place - self.pairs.len()];
        ([ids[self.index(slot)], FIRST_WALL + u64::from(wall)], true)
    }
}
