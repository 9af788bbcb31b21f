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
use super::{BlockParts, Forces};
use crate::engine::kernel::{Kernel, NO_ROW};
use crate::engine::neighbors::Block;
use crate::model::columns::{position, spin, velocity};
use crate::model::history::{MEMORY, Partner};
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
    /// The new rows of listed pairs and of listed walls.
    pair_rows: Vec<u32>,
    wall_rows: Vec<u32>,
    /// The old row of every new one; [`NO_ROW`] for a new contact.
    sources: Vec<u32>,
    /// Rates of the memories of new contacts, in the order of their rows, 1/s.
    first_rates: Vec<[f64; MEMORY]>,
}

/// How rows follow from those before.
#[derive(Debug, Default)]
pub struct Turnover {
    /// The old row of every new one; [`NO_ROW`] for a new contact.
    pub sources: Vec<u32>,
    /// Rates of the memories of new contacts, in the order of their rows, 1/s.
    pub first_rates: Vec<[f64; MEMORY]>,
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

/// The listed contacts of a block whose gap is at most `gap` (m), in the order of rows: `take(place, first
/// slot, partner)`. The place counts pairs, then walls.
fn each_within(
    (block, local): (&Block, &BlockBodies),
    walls: &[Wall],
    [r, gap]: [f64; 2],
    take: &mut dyn FnMut(usize, bool),
) {
    let x = |slot: u32| position(local.body(slot as usize));
    let reach = 2.0 * r + gap;
    for (place, &[i, j]) in block.pairs.iter().enumerate() {
        // A distance that is NaN must not count as far.
        let far = (x(i) - x(j)).norm_squared() > reach * reach;
        take(place, !far);
    }
    for (place, &[i, wall]) in (block.pairs.len()..).zip(&block.walls) {
        let far = walls[wall as usize].depth(&x(i)) - r > gap;
        take(place, !far);
    }
}

/// Rate of the memory of a new contact, in place `place` of `each_within`.
fn first_rate(
    kernel: &dyn Kernel,
    (block, local): (&Block, &BlockBodies),
    walls: &[Wall],
    place: usize,
) -> [f64; MEMORY] {
    let r = kernel.law().r;
    let body = |slot: u32| local.body(slot as usize);
    if let Some(&[i, j]) = block.pairs.get(place) {
        let (a, b) = (body(i), body(j));
        let apart = position(a) - position(b);
        let d = apart.norm();
        let (v_rel, spins) = (velocity(a) - velocity(b), spin(a) + spin(b));
        return kernel.first_rate(Partner::Sphere, d - 2.0 * r, &(apart / d), &v_rel, &spins);
    }
    let [i, wall] = block.walls[place - block.pairs.len()];
    let (a, wall) = (body(i), &walls[wall as usize]);
    let gap = wall.depth(&position(a)) - r;
    kernel.first_rate(Partner::Wall, gap, &-wall.normal, &velocity(a), &spin(a))
}

/// Whether other near contacts are within reach than those that have rows.
fn has_changed(
    (block, local): (&Block, &BlockBodies),
    walls: &[Wall],
    [r, gap]: [f64; 2],
    rows: usize,
) -> bool {
    if block.pair_rows.len() != block.pairs.len() || block.wall_rows.len() != block.walls.len() {
        return true;
    }
    let x = |slot: u32| position(local.body(slot as usize));
    let reach = 2.0 * r + gap;
    let (mut kept, mut changed) = (0, false);
    for (&[i, j], &row) in block.near.iter().zip(&block.near_rows) {
        let within = (x(i) - x(j)).norm_squared() <= reach * reach;
        changed |= within != (row != NO_ROW);
        kept += usize::from(row != NO_ROW);
    }
    for (&[i, wall], &row) in block.near_walls.iter().zip(&block.near_wall_rows) {
        let within = walls[wall as usize].depth(&x(i)) - r <= gap;
        changed |= within != (row != NO_ROW);
        kept += usize::from(row != NO_ROW);
    }
    // A contact with a row that is no longer near is beyond reach.
    changed || kept != rows
}

impl Forces {
    /// Numbers of the memory of a contact.
    pub fn memory_width(&self) -> usize {
        self.kernel.memory()
    }

    /// Number of rows.
    pub fn memory_rows(&self) -> usize {
        self.row_bounds.last().copied().unwrap_or(0)
    }

    /// From now on contacts have a memory while their gap is at most `gap` (m) at an accepted state.
    pub fn remember_within(&mut self, gap: f64) {
        self.memory_gap = gap;
    }

    /// Makes the stage of all memories, and sets their rates to 0. `vectors` and `rates` have one row for
    /// each.
    pub fn make_memories(&mut self, maker: StageMaker, first: usize, vectors: Vectors, rates: &mut [f64]) {
        let Forces { lists, bounds, block_bodies, row_bounds, .. } = self;
        let work = |((_, block_bodies), rows): (BlockParts, ByRows<(Rows, Vectors)>), ()| {
            let memories = &mut block_bodies[0].memories;
            let (mut rest, mut row) = (rows.items, rows.bounds[0]);
            memories.resize((rows.bounds[1] - rows.bounds[0]) * MEMORY, 0.0);
            for states in memories.chunks_mut(ROWS * MEMORY) {
                let ((slopes, vectors), behind) = rest.cut(states.len() / MEMORY);
                rest = behind;
                let start = first + row * MEMORY;
                let part = Part { segment: 1, row, start, len: states.len(), width: MEMORY, positions: 0 };
                row += states.len() / MEMORY;
                let vectors = vectors.map(|rows| rows.numbers);
                (maker.make)(Stage { part, vectors, state: states, slope: slopes.numbers });
                slopes.numbers.fill(0.0);
            }
        };
        let items = (Rows::new(rates, MEMORY), vectors);
        let own = (&mut lists.blocks[..], &mut block_bodies[..]);
        each_block(bounds, (own, ByRows { bounds: row_bounds, items }), (), &work, &|(), ()| ());
    }

    /// Finds out which contacts are within reach in the current bodies. `take_contacts` takes them over.
    pub fn find_contacts(&mut self) {
        if self.memory_width() == 0 {
            return;
        }
        let Forces { kernel, parameters, lists, bounds, block_bodies, row_bounds, memory_gap, .. } = self;
        let (kernel, walls) = (&**kernel, &parameters.walls[..]);
        let law = kernel.law();
        let reach = [law.r, memory_gap.min(law.l_max)];
        let work = |((blocks, block_bodies), rows): (BlockParts, ByRows<()>), ()| {
            let (block, local) = (&blocks[0], &mut block_bodies[0]);
            let mut found = std::mem::take(&mut local.found);
            found.changed = has_changed((block, local), walls, reach, rows.bounds[1] - rows.bounds[0]);
            if found.changed {
                found.pair_rows.clear();
                found.wall_rows.clear();
                found.sources.clear();
                found.first_rates.clear();
                each_within((block, local), walls, reach, &mut |place, within| {
                    let next = if within { found.sources.len() as u32 } else { NO_ROW };
                    let (old, new) = match place.checked_sub(block.pairs.len()) {
                        None => (block.pair_rows.get(place), &mut found.pair_rows),
                        Some(wall) => (block.wall_rows.get(wall), &mut found.wall_rows),
                    };
                    new.push(next);
                    if within {
                        let old = old.copied().unwrap_or(NO_ROW);
                        found.sources.push(old);
                        if old == NO_ROW {
                            found.first_rates.push(first_rate(kernel, (block, local), walls, place));
                        }
                    }
                });
            }
            local.found = found;
        };
        let own = (&mut lists.blocks[..], &mut block_bodies[..]);
        let rows = ByRows { bounds: row_bounds, items: () };
        each_block(bounds, (own, rows), (), &work, &|(), ()| ());
    }

    /// Gives rows to the contacts that `find_contacts` found, if these are others than before.
    pub fn take_contacts(&mut self) -> Option<Turnover> {
        if !self.block_bodies.iter().any(|local| local.found.changed) {
            return None;
        }
        let mut turnover = Turnover::default();
        let law = self.kernel.law();
        let old = self.row_bounds.clone();
        self.row_bounds.truncate(1);
        for ((block, local), bounds) in
            self.lists.blocks.iter_mut().zip(&mut self.block_bodies).zip(old.windows(2))
        {
            if std::mem::take(&mut local.found.changed) {
                std::mem::swap(&mut block.pair_rows, &mut local.found.pair_rows);
                std::mem::swap(&mut block.wall_rows, &mut local.found.wall_rows);
                let moved = |&row: &u32| if row == NO_ROW { row } else { row + bounds[0] as u32 };
                turnover.sources.extend(local.found.sources.iter().map(moved));
                turnover.first_rates.append(&mut local.found.first_rates);
                local.pick_near(block, &law, &self.parameters.walls);
            } else {
                turnover.sources.extend(bounds[0] as u32..bounds[1] as u32);
            }
            self.row_bounds.push(turnover.sources.len());
        }
        Some(turnover)
    }

    /// Gives a row to every listed contact whose key has one: `row_of(key)` says whether it does. A key holds
    /// the ids, by local index, of the first and the second body; a wall counts from [`FIRST_WALL`] on.
    pub fn assign_rows(&mut self, ids: &[u64], has_row: &dyn Fn([u64; 2]) -> bool) {
        let law = self.kernel.law();
        self.row_bounds.truncate(1);
        let mut rows = 0;
        for (block, local) in self.lists.blocks.iter_mut().zip(&mut self.block_bodies) {
            let mut next = 0;
            let mut row = |key: [u64; 2]| {
                let found = has_row(key);
                next += u32::from(found);
                if found { next - 1 } else { NO_ROW }
            };
            let pair_rows: Vec<u32> = block.pair_keys(ids).map(&mut row).collect();
            let wall_rows: Vec<u32> = block.wall_keys(ids).map(&mut row).collect();
            (block.pair_rows, block.wall_rows) = (pair_rows, wall_rows);
            local.found.changed = false;
            rows += next as usize;
            self.row_bounds.push(rows);
            local.pick_near(block, &law, &self.parameters.walls);
        }
    }

    /// Keys of all rows, in order, and whether each is counted here: over all ranks every contact counts
    /// once.
    pub fn contact_keys<'a>(&'a self, ids: &'a [u64]) -> impl Iterator<Item = ([u64; 2], bool)> + 'a {
        self.lists.blocks.iter().flat_map(move |block| {
            let counted = block.pairs.iter().map(|pair| block.owns(pair[0]));
            let pairs = block.pair_keys(ids).zip(counted).zip(&block.pair_rows);
            let walls = block.wall_keys(ids).map(|key| (key, true)).zip(&block.wall_rows);
            pairs.chain(walls).filter(|(_, row)| **row != NO_ROW).map(|(contact, _)| contact)
        })
    }
}

impl Block {
    /// Ids of the listed pairs, the first body of each first.
    fn pair_keys<'a>(&'a self, ids: &'a [u64]) -> impl Iterator<Item = [u64; 2]> + 'a {
        self.pairs.iter().map(|pair| pair.map(|slot| ids[self.index(slot)]))
    }

    /// Id of the particle, and number of the wall from [`FIRST_WALL`] on, of the listed walls.
    fn wall_keys<'a>(&'a self, ids: &'a [u64]) -> impl Iterator<Item = [u64; 2]> + 'a {
        self.walls.iter().map(|&[slot, wall]| [ids[self.index(slot)], FIRST_WALL + u64::from(wall)])
    }
}
