//! The memories of contacts: which contacts have a row in the state, and where.
//!
//! A contact has a row while its gap at the last accepted state is within `Forces::memory_gap`. Every block
//! has rows of its own, and some of them are free: a contact that comes within reach takes one, and a contact
//! that leaves gives its row back. A pair of particles in two blocks, or on two ranks, has a row in both,
//! with the same bits. Nothing depends on which row a contact has.
//!
//! Contacts change between steps only. [`Forces::find_contacts`] looks at the bodies of the last stage of a
//! trial step, and [`Forces::take_contacts`] follows once that step is accepted.

use super::block_bodies::BlockBodies;
use super::blocks::each_block;
use super::pass::{StageMaker, Vectors};
use super::{BlockParts, Forces, sizes_of};
use crate::engine::kernel::{BEHIND_MEMORIES, Laws, NO_ROW};
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

/// The key of a row that no contact has. Its memory and its rate are 0, and stay so.
pub const FREE: [u64; 2] = [u64::MAX; 2];

/// The contact of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowContact {
    /// Ids of the first and the second body; a wall counts from [`FIRST_WALL`] on. [`FREE`] if no contact has
    /// the row.
    pub key: [u64; 2],
    /// Whether it is counted here: over all ranks every contact counts once.
    pub counted: bool,
    /// Its class.
    pub class: u32,
}

impl RowContact {
    /// Of a row that no contact has. It has no error and no energy, so it may well be counted.
    pub const NONE: RowContact = RowContact { key: FREE, counted: true, class: 0 };
}

/// Contacts of a block that came within reach, or went beyond it. A place is the index of a listed pair, or
/// the number of listed pairs plus the index of a listed wall.
#[derive(Debug, Default)]
pub struct Found {
    /// Places of contacts that want a row.
    gained: Vec<u32>,
    /// Rates of their memories, 1/s.
    first_rates: Vec<f64>,
    /// Places of contacts that need theirs no more.
    lost: Vec<u32>,
}

/// How rows change.
#[derive(Debug, Default)]
pub struct Turnover {
    /// The bounds of the rows of blocks before and after, where blocks got more rows; see
    /// `Forces::row_bounds`. New rows are the last ones of their block.
    pub grown: Option<[Vec<usize>; 2]>,
    /// Rows that contacts have left.
    pub freed: Vec<usize>,
    /// Rows that contacts took after that, and their contacts.
    pub taken: Vec<(usize, RowContact)>,
    /// Rates of the memories of these, 1/s.
    pub first_rates: Vec<f64>,
}

/// How many rows a block with this number of contacts has free at first. Contacts come and go at most steps
/// of a bed that falls, so rows are not numbered anew each time.
fn spare(contacts: usize) -> usize {
    contacts / 8 + 8
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

/// Adds the rate of the memory of a new contact, in place `place`, to `rates`; see [`Found`].
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
            let numbers = (rows.bounds[1] - rows.bounds[0]) * width;
            memories.truncate(numbers);
            memories.resize(numbers + BEHIND_MEMORIES, 0.0);
            for states in memories[..numbers].chunks_mut(ROWS * width) {
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
            found.gained.clear();
            found.first_rates.clear();
            found.lost.clear();
            let mut near = 0;
            for (within, row, place) in near_contacts((block, local), walls, (sizes, gap)) {
                near += usize::from(row != NO_ROW);
                match (within, row) {
                    (true, NO_ROW) => {
                        found.gained.push(place);
                        let rates = &mut found.first_rates;
                        add_first_rate(laws, (block, local), (walls, sizes), place as usize, rates);
                    }
                    (false, row) if row != NO_ROW => found.lost.push(place),
                    _ => (),
                }
            }
            // A contact with a row that is no longer near is beyond reach.
            if near + local.free_rows.len() != rows.bounds[1] - rows.bounds[0] {
                block.add_places_left(&mut found.lost);
            }
            block_bodies[0].found = found;
        };
        let own = (&mut lists.blocks[..], &mut block_bodies[..]);
        let rows = ByRows { bounds: row_bounds, items: () };
        each_block(bounds, (own, rows), (), &work, &|(), ()| ());
    }

    /// Gives rows to the contacts that `find_contacts` found, and takes them from those that it found beyond
    /// reach. `ids` are those of the bodies by local index.
    pub fn take_contacts(&mut self, ids: &[u64]) -> Option<Turnover> {
        let changes = |local: &BlockBodies| !local.found.gained.is_empty() || !local.found.lost.is_empty();
        if !self.block_bodies.iter().any(changes) {
            return None;
        }
        let mut turnover = Turnover::default();
        let mut after = vec![0];
        let before = &self.row_bounds;
        for ((block, local), bounds) in
            self.lists.blocks.iter_mut().zip(&mut self.block_bodies).zip(before.windows(2))
        {
            let (first, rows) = (after[after.len() - 1], bounds[1] - bounds[0]);
            let (found, free) = (&mut local.found, &mut local.free_rows);
            for place in found.lost.drain(..) {
                let row = std::mem::replace(block.row_mut(place), NO_ROW);
                turnover.freed.push(first + row as usize);
                free.push(row);
            }
            let wanted = found.gained.len().saturating_sub(free.len());
            let more = if wanted > 0 { wanted + spare(rows) } else { 0 };
            free.splice(0..0, (rows as u32..(rows + more) as u32).rev());
            for place in found.gained.drain(..) {
                let row = free.pop().expect("there are enough");
                *block.row_mut(place) = row;
                turnover.taken.push((first + row as usize, block.contact(ids, place as usize)));
            }
            turnover.first_rates.append(&mut found.first_rates);
            block.look_up_rows();
            after.push(first + rows + more);
        }
        if after != self.row_bounds {
            turnover.grown = Some([std::mem::replace(&mut self.row_bounds, after.clone()), after]);
        }
        Some(turnover)
    }

    /// Gives rows to the contacts for whose key `has_row` holds, of the near ones or of all that are listed.
    /// Returns the contact of every row.
    ///
    /// `ids` are those of the bodies by local index.
    pub fn assign_rows(
        &mut self,
        ids: &[u64],
        near: bool,
        has_row: &mut dyn FnMut([u64; 2]) -> bool,
    ) -> Vec<RowContact> {
        let mut contacts = Vec::new();
        self.row_bounds.truncate(1);
        for (block, local) in self.lists.blocks.iter_mut().zip(&mut self.block_bodies) {
            block.forget_rows(true);
            let mut next = 0;
            for place in block.places(near) {
                let contact = block.contact(ids, place as usize);
                if has_row(contact.key) {
                    *block.row_mut(place) = next;
                    contacts.push(contact);
                    next += 1;
                }
            }
            let more = spare(next as usize);
            contacts.extend(std::iter::repeat_n(RowContact::NONE, more));
            local.free_rows.clear();
            local.free_rows.extend((next..next + more as u32).rev());
            local.found = Found::default();
            block.look_up_rows();
            self.row_bounds.push(contacts.len());
        }
        contacts
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

    /// The places of the near contacts, or of all that are listed.
    fn places(&self, near: bool) -> Vec<u32> {
        let pairs = self.pairs.len() as u32;
        if !near {
            return (0..pairs + self.walls.len() as u32).collect();
        }
        let walls = self.near_wall_places.iter().map(|place| pairs + place);
        self.near_places.iter().copied().chain(walls).collect()
    }

    /// Adds the places of the contacts that have a row and are not near.
    fn add_places_left(&self, lost: &mut Vec<u32>) {
        let mut add = |rows: &[u32], near: &[u32], first: u32| {
            let mut near = near.iter().copied().peekable();
            for (place, &row) in (0..).zip(rows) {
                if near.next_if_eq(&place).is_none() && row != NO_ROW {
                    lost.push(first + place);
                }
            }
        };
        add(&self.pair_rows, &self.near_places, 0);
        add(&self.wall_rows, &self.near_wall_places, self.pairs.len() as u32);
    }

    /// The row of the contact in a place.
    fn row_mut(&mut self, place: u32) -> &mut u32 {
        let place = place as usize;
        match place.checked_sub(self.pair_rows.len()) {
            None => &mut self.pair_rows[place],
            Some(wall) => &mut self.wall_rows[wall],
        }
    }

    /// The contact in a place.
    fn contact(&self, ids: &[u64], place: usize) -> RowContact {
        let class = self.class_of(place) as u32;
        if let Some(&pair) = self.pairs.get(place) {
            let key = pair.map(|slot| ids[self.index(slot)]);
            return RowContact { key, counted: self.owns(pair[0]), class };
        }
        let [slot, wall] = self.walls[place - self.pairs.len()];
        RowContact { key: [ids[self.index(slot)], FIRST_WALL + u64::from(wall)], counted: true, class }
    }
}
