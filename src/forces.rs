//! Forces on the particles of one rank: every particle sums its walls in the order of the scene, then its pairs in the
//! order of sums of [`crate::neighbors`]. No rank, thread or list changes an order, so the sums have the same bits
//! everywhere. A pair is evaluated once, or twice where its particles belong to two ranks or two threads.

use crate::contact::{Action, Energies, Law, Rebound, Tangential};
use crate::container::Wall;
use crate::elementary::{Arithmetic, Separate};
use crate::instructions::InstructionSet;
use crate::kernel::{self, Batch, Measure, Survey};
use crate::neighbors::{Block, Key, Lists};
use crate::ode::{Linear, larger};
use crate::parallel;
use crate::particle::{Motion, Spin, Vec3};
use blocks::{Part, each_block};
pub use pass::Place;

mod blocks;
mod pass;

/// How far beyond the cut-off near pairs are picked, as a share of the radius.
const INNER_SKIN: f64 = 0.1;

/// Particles below which a block of its own is not worth a thread that looks out for work, and one that must be woken.
const BLOCK: [usize; 2] = [64, 512];

/// What the equations of motion need besides the contact law.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Mass of every particle, kg.
    pub mass: f64,
    /// 1/I, 1/(kg m^2); I = 2/5 m r^2 for a homogeneous sphere.
    pub inverse_inertia: f64,
    /// Gravitational acceleration, m/s^2.
    pub gravity: Vec3,
    /// Walls in the order in which their forces are summed.
    pub walls: Vec<Wall>,
}

/// A contact whose force is not finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Broken {
    /// Local indices, lower id first, and distance of the centres, m.
    Pair(usize, usize, f64),
    /// Local index, wall and overlap, m.
    Wall(usize, usize, f64),
}

/// Work of a particle without pairs (stages, copies, walls), in units of half a pair; docs/performance.md has the costs.
const LOAD: u64 = 4;

/// A block may have this many times its fair share of the work before blocks are cut anew.
const TOLERATED_IMBALANCE: f64 = 1.03;

/// Largest squared distance of `bodies` from where they were, m^2.
fn strayed<W: Spin>(bodies: &[Motion<W>], from: &[Vec3]) -> f64 {
    let way = |k: usize| (bodies[k].x - from[k]).norm_squared();
    parallel::fold(bodies.len(), parallel::GRAIN, way, 0.0, larger)
}

/// How far a contact is below the largest gap at which surfaces interact, which it holds, and its overlap, m; 0 where it
/// is not.
pub struct Depth(pub f64);

impl<W: Spin> Measure<W> for Depth {
    const MOVES: bool = false;
    #[inline(always)]
    fn of<A: Arithmetic>(&self, gap: f64, _n: &Vec3, _v_rel: &Vec3, _spins: &W) -> [f64; 2] {
        let above = |x: f64| if x > 0.0 { x } else { 0.0 };
        [above(self.0 - gap), above(-gap)]
    }
}

/// What a contact stores, J.
pub struct Stored<'a, R, T>(pub Energies<'a, R, T>);

impl<R: Rebound, T: Tangential, W: Spin> Measure<W> for Stored<'_, R, T> {
    const MOVES: bool = false;
    #[inline(always)]
    fn of<A: Arithmetic>(&self, gap: f64, _n: &Vec3, _v_rel: &Vec3, _spins: &W) -> [f64; 2] {
        [self.0.stored::<A>(gap), 0.0]
    }
}

/// Power that a contact dissipates by rebound and by friction, W.
pub struct Dissipated<'a, R, T>(pub Energies<'a, R, T>);

impl<R: Rebound, T: Tangential, W: Spin> Measure<W> for Dissipated<'_, R, T> {
    const MOVES: bool = true;
    #[inline(always)]
    fn of<A: Arithmetic>(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &W) -> [f64; 2] {
        self.0.dissipation::<A, W>(gap, n, v_rel, spins)
    }
}

/// Bodies, lists and forces of one rank.
pub struct Forces<R, T, W> {
    /// Contact law.
    pub law: Law<R, T>,
    /// Masses, gravity and walls.
    pub setting: Setting,
    /// Who may touch whom.
    pub lists: Lists,
    /// Number of owned particles; they come first in `bodies`.
    pub owned: usize,
    /// State of the owned particles and the ghosts in the evaluation at hand.
    pub bodies: Vec<Motion<W>>,
    /// Where the bodies were when the near pairs were picked, m.
    picked: Vec<Vec3>,
    /// Largest squared distance of a body from there, m^2.
    strayed: f64,
    /// How far the bodies of the right-hand side at hand have come.
    ways: pass::Ways,
    /// Bounds of the blocks, from 0 to 1, as shares of the owned particles.
    shares: Vec<f64>,
    /// One for every block.
    batches: Vec<Batch>,
    set: InstructionSet,
}

impl<R: Rebound, T: Tangential, W: Spin> Forces<R, T, W> {
    /// No particles yet. This processor must have the instructions of `set`.
    pub fn new(law: Law<R, T>, setting: Setting, set: InstructionSet) -> Self {
        Forces {
            law,
            setting,
            lists: Lists::default(),
            owned: 0,
            bodies: Vec::new(),
            picked: Vec::new(),
            strayed: 0.0,
            ways: [0.0; 3],
            shares: Vec::new(),
            batches: Vec::new(),
            set,
        }
    }

    /// Takes the owned particles `y` and makes room for `ghosts` behind them.
    pub fn seat(&mut self, y: &[Motion<W>], ghosts: usize) {
        self.owned = y.len();
        self.bodies.clear();
        self.bodies.extend_from_slice(y);
        self.bodies.resize(y.len() + ghosts, Motion::zero());
    }

    /// Lists pairs within `reach` (m) and walls within `wall_reach` (m) of the centres of the bodies in place; `keys`
    /// are theirs, those of the owned ones ascending.
    pub fn list(&mut self, keys: &[Key], reach: f64, wall_reach: f64) {
        let grain = BLOCK[usize::from(!parallel::is_attended())];
        let blocks = parallel::blocks(self.owned, grain);
        if self.shares.len() != blocks + 1 {
            self.shares = (0..=blocks).map(|b| b as f64 / blocks as f64).collect();
        }
        let x: Vec<Vec3> = self.bodies.iter().map(|body| body.x).collect();
        self.list_blocks(&x, keys, reach, wall_reach);
        if blocks > 1 && self.imbalance() > TOLERATED_IMBALANCE {
            self.share_out();
            self.list_blocks(&x, keys, reach, wall_reach);
        }
    }

    fn list_blocks(&mut self, x: &[Vec3], keys: &[Key], reach: f64, wall_reach: f64) {
        let bounds: Vec<usize> =
            self.shares.iter().map(|share| (share * self.owned as f64).round() as usize).collect();
        self.lists.rebuild_between(&bounds, x, keys, reach, (&self.setting.walls, wall_reach));
        self.batches.resize_with(self.lists.blocks.len(), Batch::default);
        self.show(std::iter::empty());
        self.pick_near();
    }

    /// The largest work of a block over the mean of all.
    fn imbalance(&self) -> f64 {
        let loads = self
            .lists
            .blocks
            .iter()
            .map(|block| LOAD * block.range.len() as u64 + 2 * block.near.len() as u64);
        let (sum, most) = loads.fold((0, 0), |(sum, most), load| (sum + load, load.max(most)));
        (most * self.lists.blocks.len() as u64) as f64 / sum as f64
    }

    /// Gives every block the same work.
    fn share_out(&mut self) {
        let loads = self.loads();
        let total: u64 = loads.iter().sum();
        let blocks = self.shares.len() as u64 - 1;
        let (mut below, mut next) = (0, 1);
        for (i, load) in loads.iter().enumerate() {
            while next < blocks && below * blocks >= next * total {
                self.shares[next as usize] = i as f64 / self.owned as f64;
                next += 1;
            }
            below += load;
        }
    }

    /// Distance of centres (m) within which pairs are evaluated until a body has moved by half of its excess over the
    /// cut-off.
    fn near_reach(&self) -> f64 {
        2.0 * self.law.r + self.law.l_max + INNER_SKIN * self.law.r
    }

    /// From now on evaluates contacts up to `gap` (m), which the lists must cover.
    pub fn evaluate_within(&mut self, gap: f64) {
        self.law.l_max = gap;
        self.pick_near();
    }

    fn pick_near(&mut self) {
        let (reach, bodies) = (self.near_reach(), &self.bodies);
        let walls = (&self.setting.walls[..], self.law.r + self.law.l_max + 0.5 * INNER_SKIN * self.law.r);
        self.picked.clear();
        self.picked.extend(bodies.iter().map(|body| body.x));
        parallel::each(&mut self.lists.blocks, &|block: &mut Block| block.pick_near(bodies, reach, walls));
        self.strayed = 0.0;
    }

    /// How far a body may move before near pairs and walls must be picked afresh, squared, m^2.
    fn allowed(&self) -> f64 {
        (0.5 * INNER_SKIN * self.law.r).powi(2)
    }

    /// The ghosts, behind the owned bodies.
    pub fn ghosts(&mut self) -> &mut [Motion<W>] {
        &mut self.bodies[self.owned..]
    }

    /// Moves the owned bodies to `y`; the ghosts are in place.
    pub fn put(&mut self, y: &[Motion<W>]) {
        self.bodies[..self.owned].copy_from_slice(y);
        self.strayed = strayed(&self.bodies, &self.picked);
        if self.strayed > self.allowed() {
            self.pick_near();
        }
    }

    /// The owned bodies in place.
    pub fn own(&self) -> &[Motion<W>] {
        &self.bodies[..self.owned]
    }

    /// A wall is a motionless partner with n = -n_k.
    fn wall_action(&self, wall: &Wall, body: &Motion<W>) -> Option<Action<W>> {
        let gap = wall.depth(&body.x) - self.law.r;
        (gap <= self.law.l_max)
            .then(|| self.law.action::<Separate, _>(gap, &-wall.normal, &body.v, &body.omega))
    }

    /// What a pair in place does to its first particle.
    fn pair_action(&self, [i, j]: [usize; 2]) -> Action<W> {
        let (a, b) = (&self.bodies[i], &self.bodies[j]);
        let apart = a.x - b.x;
        let d = apart.norm();
        let gap = d - 2.0 * self.law.r;
        if gap > self.law.l_max {
            return Action::none();
        }
        self.law.action::<Separate, _>(gap, &(apart / d), &(a.v - b.v), &a.omega.plus(&b.omega))
    }

    /// Gap of a pair, m; negative: overlap.
    fn pair_gap(&self, [i, j]: [usize; 2]) -> f64 {
        (self.bodies[i].x - self.bodies[j].x).norm() - 2.0 * self.law.r
    }

    /// Gap of owned particle `i` and wall `k`, m.
    fn wall_gap(&self, [i, k]: [usize; 2]) -> f64 {
        self.setting.walls[k].depth(&self.bodies[i].x) - self.law.r
    }

    /// Listed pairs, each with its earlier particle on this rank, so that over all ranks every pair comes once.
    fn pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        self.lists.blocks.iter().flat_map(Block::first_pairs)
    }

    /// Owned particle and wall of every listed wall contact.
    fn wall_contacts(&self) -> impl Iterator<Item = [usize; 2]> {
        self.lists.blocks.iter().flat_map(Block::wall_contacts)
    }

    /// Largest of each of the two numbers of all contacts of the bodies in place, by magnitude; 0 without any, infinite
    /// where one is not a number.
    pub fn largest(&mut self, measure: &impl Measure<W>) -> [f64; 2] {
        let add = |a: [f64; 2], b: [f64; 2]| std::array::from_fn(|k| larger(a[k], b[k].abs()));
        self.survey(measure, [0.0; 2], add, add)
    }

    /// Sums of the integers that stand for the two numbers of all contacts of the bodies in place.
    pub fn total(
        &mut self,
        measure: &impl Measure<W>,
        integers: impl Fn([f64; 2]) -> [i64; 2] + Sync,
    ) -> [i128; 2] {
        let add = |a: [i128; 2], b: [i128; 2]| std::array::from_fn(|k| a[k] + b[k]);
        let take = |sum, terms| add(sum, integers(terms).map(i128::from));
        self.survey(measure, [0; 2], take, add)
    }

    /// Folds the numbers of all contacts of the bodies in place, each contact once over all ranks. The order must not
    /// matter.
    fn survey<A: Copy + Send + Sync>(
        &mut self,
        measure: &impl Measure<W>,
        identity: A,
        take: impl Fn(A, [f64; 2]) -> A + Sync,
        combine: impl Fn(A, A) -> A + Sync,
    ) -> A {
        let (r, walls, bodies, set) = (self.law.r, &self.setting.walls[..], &self.bodies[..], self.set);
        let work = |Part { block, batch, .. }: Part<()>| {
            let mut sum = identity;
            let survey = Survey { r, walls, bodies, block, batch };
            kernel::measure(set, survey, measure, |terms| sum = take(sum, terms));
            sum
        };
        each_block((&self.lists.blocks, &mut self.batches), (), &work, &combine)
    }

    /// The contacts of the bodies in place whose force is not finite.
    pub fn broken(&self) -> impl Iterator<Item = Broken> {
        let finite = |action: &Action<W>| (action.force.norm_squared() + action.torque.max_abs()).is_finite();
        let pairs = self.pairs().filter(move |&pair| !finite(&self.pair_action(pair)));
        let pairs = pairs.map(|[i, j]| Broken::Pair(i, j, self.pair_gap([i, j]) + 2.0 * self.law.r));
        let walls = self.wall_contacts().filter(move |&[i, k]| {
            let action = self.wall_action(&self.setting.walls[k], &self.bodies[i]);
            action.is_some_and(|action| !finite(&action))
        });
        pairs.chain(walls.map(|[i, k]| Broken::Wall(i, k, -self.wall_gap([i, k]))))
    }

    /// Work that every owned particle makes in a right-hand side, in units of one of its near pairs.
    pub fn loads(&self) -> Vec<u64> {
        let mut loads = vec![LOAD; self.owned];
        for block in &self.lists.blocks {
            for &i in block.near.iter().flatten().filter(|&&i| block.range.contains(&(i as usize))) {
                loads[i as usize] += 1;
            }
        }
        loads
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        self.lists.bytes()
            + self.bodies.capacity() * size_of::<Motion<W>>()
            + self.picked.capacity() * size_of::<Vec3>()
            + self.batches.capacity() * size_of::<Batch>()
    }
}
