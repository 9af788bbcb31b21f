//! Forces on the particles of one rank.
//!
//! Every particle sums its walls in the order of the scene, then its pairs in the summation order of
//! [`crate::engine::neighbors`]. No rank, thread or list changes this order: the sums have the same bits
//! everywhere.
//!
//! The owned particles are divided into blocks, one per thread; see [`Block`]. A pair is evaluated once, or
//! twice where its particles belong to two blocks or two ranks.
//!
//! The submodule `pass` explains how a right-hand side is evaluated in blocks, `block_bodies` how blocks
//! exchange bodies.

use crate::engine::kernel::{GapMeasure, Inertia, Kernel, Laws, Survey, measure_gaps};
use crate::engine::neighbors::{Block, Key, Lists, Reach};
use crate::math::instructions::InstructionSet;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::{position, spin, velocity};
use crate::model::contact::{Action, LawParameters};
use crate::model::size::{Size, Sizes, squared_scale};
use crate::model::wall::Wall;
use crate::threads;
use block_bodies::{BlockBodies, OutboxSlot, clear_for};
use blocks::each_block;
pub use memory::{FIRST_WALL, FREE, RowContact};
pub use pass::{CHUNK, StageMaker};

mod approach;
mod block_bodies;
mod blocks;
mod memory;
mod pass;

/// Inner skin, as a share of the radius: near pairs are picked up to a gap of `l_max` plus this.
const INNER_SKIN: f64 = 0.1;

/// Least number of particles of a block that is worth another thread.
///
/// The first number is for a thread of the spinning thread pool, the second for one that must be woken.
const BLOCK: [usize; 2] = [64, 512];

/// Parameters of the equations of motion besides the contact law.
#[derive(Debug, Clone)]
pub struct BodyParameters {
    /// Mass of a typical particle, kg; where they are alike, of every particle.
    pub mass: f64,
    /// Its 1/I, 1/(kg m^2); I = 2/5 m r^2 for a homogeneous sphere.
    pub inverse_inertia: f64,
    /// Gravitational acceleration, m/s^2.
    pub gravity: Vec3,
    /// Walls in the order in which their forces are summed.
    pub walls: Vec<Wall>,
}

impl BodyParameters {
    /// What turns forces and torques on spheres of radius `r` (m) into accelerations.
    pub fn inertia(&self, r: f64) -> Inertia {
        let BodyParameters { mass, gravity, .. } = *self;
        Inertia { mass, spin_per_force: r * r * self.inverse_inertia, gravity }
    }
}

/// A contact whose force is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Broken {
    /// Local indices, the earlier in the summation order first, and distance of the centres, m.
    Pair(usize, usize, f64),
    /// Local index, number of the wall, and overlap, m.
    Wall(usize, usize, f64),
}

/// Work of a particle without its pairs (stages, copies, walls), in units of half a pair.
///
/// What it costs in time is in docs/decisions/004.
const LOAD: u64 = 4;

/// Cost of handing a block over to another thread (2 us), in the same units. The last block has none.
const HANDOVER: u64 = 360;

/// Bounds of blocks are moved when a block has more than this many times the mean work.
const TOLERATED_IMBALANCE: f64 = 1.03;

/// Two numbers of every contact.
#[derive(Debug, Clone, Copy)]
pub enum Measure {
    /// Numbers that depend on the gap alone, and not on the materials.
    Gap(GapMeasure),
    /// The energy that the contact stores, J. The second number is 0.
    Stored,
    /// Power that the contact dissipates by rebound and by friction, W.
    Dissipation,
}

/// `sizes` of particles, or that of all of them where it is empty.
fn sizes_of<'a>(sizes: &'a [Size], kernel: &dyn Kernel, parameters: &BodyParameters) -> Sizes<'a> {
    match sizes {
        [] => Sizes::Equal(Size::new(kernel.law().r, parameters.mass)),
        sizes => Sizes::Each(sizes),
    }
}

/// Blocks, and the bodies of each.
type BlockParts<'a> = (&'a mut [Block], &'a mut [BlockBodies]);

/// Blocks and their bodies, and the outbox of each.
type WithOutbox<'a> = (BlockParts<'a>, &'a mut [Vec<f64>]);

/// Bodies, lists and forces of one rank.
pub struct Forces {
    /// The contact laws, with the effects of the scene compiled in.
    pub laws: Laws,
    /// Numbers in a row of the state.
    width: usize,
    /// Mass, inertia, gravity and walls.
    pub parameters: BodyParameters,
    /// Sizes of all particles by local index; empty where all are alike.
    sizes: Vec<Size>,
    /// Materials of all particles by local index; empty where nobody has one.
    materials: Vec<u32>,
    /// Neighbour lists, by block.
    pub lists: Lists,
    /// Number of owned particles; they have the first local indices, ghosts the next.
    pub owned: usize,
    /// Bounds of the blocks: first particle of each, and the number of owned particles at the end.
    bounds: Vec<usize>,
    /// The bounds as shares of the owned particles, from 0 to 1. They are kept when lists are rebuilt.
    shares: Vec<f64>,
    /// The bodies of every block.
    block_bodies: Vec<BlockBodies>,
    /// Outboxes of all blocks: copies of their exported bodies.
    outboxes: Vec<Vec<f64>>,
    /// Ghosts of the rank: copies of the particles of other ranks that may touch owned ones.
    ghosts: Vec<f64>,
    /// Where to read each of the particles that other ranks need.
    exports: Vec<OutboxSlot>,
    /// Contacts have a memory up to this gap, m.
    memory_gap: f64,
    /// Bounds of the rows of memories: first row of each block, and the number of rows at the end.
    row_bounds: Vec<usize>,
    /// How many interior bodies of a block `advance_interior` has made in the current stage, at most.
    ahead: usize,
    set: InstructionSet,
}

impl Forces {
    /// Forces without any particles. The processor must have the instructions of `set`.
    pub fn new(laws: Laws, parameters: BodyParameters, set: InstructionSet) -> Self {
        Forces {
            width: laws.first().width(),
            laws,
            parameters,
            sizes: Vec::new(),
            materials: Vec::new(),
            lists: Lists::default(),
            owned: 0,
            bounds: vec![0, 0],
            shares: Vec::new(),
            block_bodies: Vec::new(),
            outboxes: Vec::new(),
            ghosts: Vec::new(),
            exports: Vec::new(),
            memory_gap: f64::INFINITY,
            row_bounds: vec![0, 0],
            ahead: 0,
            set,
        }
    }

    /// Takes over `bodies`, rows of the state, and builds their neighbour lists. The first `owned` of them
    /// are the owned particles, the others are ghosts.
    ///
    /// Lists pairs and walls within the distances that `shares` of the radii and `gaps` (m) make, see
    /// [`Reach`]. `keys` belong to the bodies; those of the owned particles are ascending. So do `sizes`,
    /// which are empty where all particles are alike, and `materials`, which are empty where nobody has one.
    ///
    /// `exports` are the local indices of the owned particles that are ghosts on other ranks.
    pub fn list(
        &mut self,
        bodies: &[f64],
        (owned, sizes, materials): (usize, Vec<Size>, Vec<u32>),
        keys: &[Key],
        [shares, gaps]: [[f64; 2]; 2],
        exports: impl Iterator<Item = usize> + Clone,
    ) {
        (self.owned, self.sizes, self.materials) = (owned, sizes, materials);
        let grain = BLOCK[usize::from(!threads::is_spinning())];
        let blocks = threads::blocks(owned, grain);
        if self.shares.len() != blocks + 1 {
            self.shares = (0..=blocks).map(|b| b as f64 / blocks as f64).collect();
        }
        let x: Vec<Vec3> = bodies.chunks_exact(self.width).map(position).collect();
        let list = |forces: &mut Self| {
            let bound = |share: &f64| (share * owned as f64).round() as usize;
            forces.bounds = forces.shares.iter().map(bound).collect();
            let sizes = sizes_of(&forces.sizes, forces.laws.first(), &forces.parameters);
            let reach = Reach { sizes, shares, gaps };
            forces.lists.rebuild_between(&forces.bounds, &x, keys, reach, &forces.parameters.walls);
            forces.lists.sort_by_class(&forces.laws.classes, &forces.materials);
            forces.load_bodies(bodies, exports.clone());
        };
        list(self);
        if blocks > 1 && self.imbalance() > TOLERATED_IMBALANCE {
            self.share_out();
            list(self);
        }
    }

    /// Copies all bodies to their blocks, sets up the outboxes, and picks near pairs and walls.
    fn load_bodies(&mut self, bodies: &[f64], exports: impl Iterator<Item = usize> + Clone) {
        let Forces { lists, owned, block_bodies, outboxes, ghosts, width, .. } = self;
        let width = *width;
        lists.find_exported(exports.clone());
        let blocks = lists.blocks.len();
        // No contact of the new lists has a row yet.
        self.row_bounds.clear();
        self.row_bounds.resize(blocks + 1, 0);
        for block in &mut lists.blocks {
            block.forget_rows(self.laws.first().memory() > 0);
        }
        let source = |i: usize| match i.checked_sub(*owned) {
            None => lists.outbox_slot(i),
            Some(ghost) => [blocks as u32, ghost as u32],
        };
        self.exports.clear();
        self.exports.extend(exports.map(source));
        block_bodies.resize_with(blocks, BlockBodies::default);
        clear_for(ghosts, bodies.len() - *owned * width);
        ghosts.extend_from_slice(&bodies[*owned * width..]);
        outboxes.resize_with(blocks, Vec::new);
        for (block, outbox) in lists.blocks.iter().zip(outboxes) {
            clear_for(outbox, block.exported.len() * width);
            outbox.resize(block.exported.len() * width, 0.0);
        }
        for (block, local) in lists.blocks.iter().zip(block_bodies) {
            local.distances = [0.0; 3];
            local.free_rows.clear();
            local.begin();
            local.ghost_sources.clear();
            local.ghost_sources.extend(block.ghosts.iter().map(|&i| source(i as usize)));
        }
        let Forces { laws, parameters, lists, bounds, block_bodies, sizes, .. } = self;
        let law = laws.first().law();
        let load_bodies = |(blocks, block_bodies): BlockParts, ()| {
            block_bodies[0].load(&blocks[0], (bodies, sizes), width);
            block_bodies[0].pick_near(&mut blocks[0], &law, &parameters.walls);
        };
        each_block(bounds, (&mut lists.blocks[..], &mut block_bodies[..]), (), &load_bodies, &|(), ()| ());
    }

    /// Largest work of a block, over the mean of all blocks.
    fn imbalance(&self) -> f64 {
        let count = self.lists.blocks.len();
        let loads = self.lists.blocks.iter().enumerate().map(|(b, block)| {
            HANDOVER * u64::from(b + 1 < count)
                + LOAD * block.range.len() as u64
                + 2 * block.near.len() as u64
        });
        let (sum, most) = loads.fold((0, 0), |(sum, most), load| (sum + load, load.max(most)));
        (most * self.lists.blocks.len() as u64) as f64 / sum as f64
    }

    /// Sets `shares` such that every block gets about the same work.
    fn share_out(&mut self) {
        // A pair of particles in two blocks is evaluated in both.
        let loads = self.loads_with(2);
        let blocks = self.shares.len() as u64 - 1;
        let total = loads.iter().sum::<u64>() + (blocks - 1) * HANDOVER;
        let (mut below, mut next) = (0, 1);
        for (i, load) in loads.iter().enumerate() {
            while next < blocks && (below + next * HANDOVER) * blocks >= next * total {
                self.shares[next as usize] = i as f64 / self.owned as f64;
                next += 1;
            }
            below += load;
        }
    }

    /// From now on evaluates contacts up to `gap` (m). The lists must cover that gap.
    pub fn evaluate_within(&mut self, gap: f64) {
        self.laws.set_cutoff(gap);
        let Forces { laws, parameters, lists, bounds, block_bodies, .. } = self;
        let law = laws.first().law();
        let pick = |(blocks, block_bodies): BlockParts, ()| {
            block_bodies[0].pick_near(&mut blocks[0], &law, &parameters.walls)
        };
        each_block(bounds, (&mut lists.blocks[..], &mut block_bodies[..]), (), &pick, &|(), ()| ());
    }

    /// The ghosts of the rank, by local index, for whoever refreshes them.
    pub fn ghosts(&mut self) -> &mut [f64] {
        &mut self.ghosts
    }

    /// Moves the owned bodies to `y`, in all blocks. The ghosts of the rank must be up to date.
    pub fn put(&mut self, y: &[f64]) {
        let Forces { laws, parameters, lists, bounds, block_bodies, outboxes, ghosts, width, .. } = self;
        let (law, width) = (laws.first().law(), *width);
        let own = ((&mut lists.blocks[..], &mut block_bodies[..]), &mut outboxes[..]);
        let put = |((blocks, block_bodies), outboxes): WithOutbox, ()| {
            let range = blocks[0].range.start * width..blocks[0].range.end * width;
            block_bodies[0].bodies[..range.len()].copy_from_slice(&y[range]);
            block_bodies[0].export(&blocks[0], &mut outboxes[0]);
        };
        each_block(bounds, own, (), &put, &|(), ()| ());
        let follow = |(blocks, block_bodies): BlockParts, ()| {
            block_bodies[0].import_ghosts(&blocks[0], outboxes, ghosts, law.r);
            block_bodies[0].repick_if_strayed(&mut blocks[0], &law, &parameters.walls);
            block_bodies[0].distances = [0.0; 3];
        };
        each_block(bounds, (&mut lists.blocks[..], &mut block_bodies[..]), (), &follow, &|(), ()| ());
    }

    /// Export `k`: the current body of the k-th particle that other ranks need, in the order given to `list`.
    pub fn export(&self, k: usize) -> &[f64] {
        let [outbox, slot] = self.exports[k];
        let start = slot as usize * self.width;
        &self.outboxes[outbox as usize][start..start + self.width]
    }

    /// Current bodies of all owned particles, by local index.
    pub fn state(&self) -> Vec<f64> {
        let own =
            |(block, local): (&Block, &BlockBodies)| local.bodies[..block.range.len() * self.width].to_vec();
        self.lists.blocks.iter().zip(&self.block_bodies).flat_map(own).collect()
    }

    /// The sizes of the particles by local index.
    pub fn sizes(&self) -> Sizes<'_> {
        sizes_of(&self.sizes, self.laws.first(), &self.parameters)
    }

    /// What the squared distance that a particle moves is multiplied by, see [`squared_scale`]. `i` is its
    /// local index.
    pub fn squared_scale(&self, i: usize) -> f64 {
        squared_scale(&self.sizes, i, self.law().r)
    }

    /// The parameters of the law that all classes of contacts share, with the cutoff in use. The coefficients
    /// are those of the first class.
    pub fn law(&self) -> LawParameters {
        self.laws.first().law()
    }

    /// What a wall does to a body with the radius `r` (m) by the law of a `class`; nothing beyond the cutoff.
    /// A wall is a motionless partner with n = -n_k.
    fn wall_action(&self, class: usize, wall: &Wall, body: &[f64], r: f64) -> Option<Action> {
        let kernel = self.laws.of(class);
        let gap = wall.depth(&position(body)) - r;
        let action = || kernel.action(gap, &-wall.normal, &velocity(body), &spin(body));
        (gap <= kernel.law().l_max).then(action)
    }

    /// What the contact of a pair of a `class` does to its first particle, `a`. `surfaces` (m) is the sum of
    /// the radii.
    fn pair_action(&self, class: usize, a: &[f64], b: &[f64], surfaces: f64) -> Action {
        let kernel = self.laws.of(class);
        let apart = position(a) - position(b);
        let d = apart.norm();
        let gap = d - surfaces;
        if gap > kernel.law().l_max {
            return Action::none();
        }
        kernel.action(gap, &(apart / d), &(velocity(a) - velocity(b)), &(spin(a) + spin(b)))
    }

    /// Largest magnitude of each of the two numbers of `measure`, over all contacts of the current bodies.
    ///
    /// It is 0 without contacts, and infinite if a number is NaN.
    pub fn largest(&mut self, measure: Measure) -> [f64; 2] {
        let add = |a: [f64; 2], b: [f64; 2]| std::array::from_fn(|k| larger(a[k], b[k].abs()));
        self.survey(measure, [0.0; 2], add, add)
    }

    /// Sum of each of the two numbers of `measure`, over all contacts of the current bodies.
    ///
    /// The numbers are summed as `integers`, so that the order does not matter.
    pub fn total(&mut self, measure: Measure, integers: impl Fn([f64; 2]) -> [i64; 2] + Sync) -> [i128; 2] {
        let add = |a: [i128; 2], b: [i128; 2]| std::array::from_fn(|k| a[k] + b[k]);
        let take = |sum, terms| add(sum, integers(terms).map(i128::from));
        self.survey(measure, [0; 2], take, add)
    }

    /// Folds the numbers of `measure` over all contacts of the current bodies. Over all ranks each contact
    /// counts once. The order of the fold must not matter.
    fn survey<A: Copy + Send + Sync>(
        &mut self,
        measure: Measure,
        identity: A,
        take: impl Fn(A, [f64; 2]) -> A + Sync,
        combine: impl Fn(A, A) -> A + Sync,
    ) -> A {
        let Forces { laws, parameters, lists, bounds, block_bodies, set, width, .. } = self;
        let work = |(blocks, block_bodies): (&[Block], &mut [BlockBodies]), ()| {
            let BlockBodies { bodies, sizes, batch, memories, .. } = &mut block_bodies[0];
            let mut sum = identity;
            let (walls, block, width) = (&parameters.walls[..], &blocks[0], *width);
            let sizes = sizes_of(sizes, laws.first(), parameters);
            for class in 0..laws.count() {
                let (kernel, batch) = (laws.of(class), &mut *batch);
                let survey = Survey { walls, bodies, sizes, width, block, class, batch, memories };
                let take = &mut |[first, second]: [&[f64]; 2]| {
                    let numbers = first.iter().zip(second);
                    sum = numbers.fold(sum, |sum, (&first, &second)| take(sum, [first, second]));
                };
                match &measure {
                    Measure::Gap(gap) => measure_gaps(*set, survey, gap, take),
                    Measure::Stored => measure_gaps(*set, survey, &kernel.stored_energy(), take),
                    Measure::Dissipation => kernel.measure_dissipation(survey, take),
                }
            }
            sum
        };
        each_block(bounds, (&lists.blocks[..], &mut block_bodies[..]), (), &work, &combine)
    }

    /// Contacts of the current bodies whose force is not finite. Over all ranks each counts once.
    pub fn broken(&self) -> impl Iterator<Item = Broken> {
        let finite = |action: &Action| (action.force.norm_squared() + action.turning.amax()).is_finite();
        self.lists.blocks.iter().zip(&self.block_bodies).flat_map(move |(block, local)| {
            let body = |slot: u32| local.body(slot as usize);
            let r = move |slot: u32| self.sizes().of(block.index(slot)).r;
            let pairs = block.pairs.iter().enumerate().filter(|(_, [i, _])| block.owns(*i));
            let action = move |place: usize, i: u32, j: u32| {
                self.pair_action(block.class_of(place), body(i), body(j), r(i) + r(j))
            };
            let pairs = pairs.filter(move |&(place, &[i, j])| !finite(&action(place, i, j)));
            let pairs = pairs.map(move |(_, &[i, j])| {
                let apart = position(body(i)) - position(body(j));
                Broken::Pair(block.index(i), block.index(j), apart.norm())
            });
            let walls = block.walls.iter().enumerate().filter(move |&(place, &[i, k])| {
                let (class, wall) =
                    (block.class_of(block.pairs.len() + place), &self.parameters.walls[k as usize]);
                self.wall_action(class, wall, body(i), r(i)).is_some_and(|action| !finite(&action))
            });
            let overlap =
                move |i: u32, k: u32| r(i) - self.parameters.walls[k as usize].depth(&position(body(i)));
            let of_wall = move |(_, &[i, k]): (usize, &[u32; 2])| {
                Broken::Wall(block.index(i), k as usize, overlap(i, k))
            };
            pairs.chain(walls.map(of_wall))
        })
    }

    /// Work that every owned particle causes in a right-hand side, in units of half a pair.
    pub fn loads(&self) -> Vec<u64> {
        self.loads_with(1)
    }

    /// `loads`, where a pair with a ghost of the block counts as `across` for its own particle. A pair of two
    /// own particles counts as 1 for each of them.
    fn loads_with(&self, across: u64) -> Vec<u64> {
        let mut loads = vec![LOAD; self.owned];
        for block in &self.lists.blocks {
            for pair in &block.near {
                let part = if pair.iter().all(|&slot| block.owns(slot)) { 1 } else { across };
                for &slot in pair.iter().filter(|&&slot| block.owns(slot)) {
                    loads[block.index(slot)] += part;
                }
            }
        }
        loads
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        let outboxes = self.outboxes.iter().map(Vec::capacity).sum::<usize>() + self.ghosts.capacity();
        self.lists.bytes()
            + self.block_bodies.iter().map(BlockBodies::bytes).sum::<usize>()
            + outboxes * size_of::<f64>()
            + self.exports.capacity() * size_of::<OutboxSlot>()
            + self.sizes.capacity() * size_of::<Size>()
            + self.materials.capacity() * size_of::<u32>()
    }
}
