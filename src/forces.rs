//! Forces on the particles of one rank: every listed pair is evaluated once into an array, then every owned particle
//! sums its pairs in the order of their partners' ids, and its walls in the order of the scene. No rank, thread or
//! list changes an order, so the sums have the same bits everywhere.

use crate::contact::{Action, Law, Rebound, Tangential};
use crate::container::Wall;
use crate::neighbors::Lists;
use crate::ode::{Linear, Losses, add_losses, larger};
use crate::parallel::{self, GRAIN};
use crate::particle::{Motion, Spin, Vec3};
use fail::fail_point;

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
    /// What every listed pair does to its lower id.
    actions: Vec<Action<W>>,
}

impl<R: Rebound, T: Tangential, W: Spin> Forces<R, T, W> {
    /// No particles yet.
    pub fn new(law: Law<R, T>, setting: Setting) -> Self {
        Forces { law, setting, lists: Lists::default(), owned: 0, bodies: Vec::new(), actions: Vec::new() }
    }

    /// Takes the owned particles `y` and makes room for `ghosts` behind them.
    pub fn seat(&mut self, y: &[Motion<W>], ghosts: usize) {
        self.owned = y.len();
        self.bodies.clear();
        self.bodies.extend_from_slice(y);
        self.bodies.resize(y.len() + ghosts, Motion::zero());
    }

    /// Lists pairs within `reach` (m) and walls within `wall_reach` (m) of the centres of the bodies in place; `ids`
    /// are theirs.
    pub fn list(&mut self, ids: &[u64], reach: f64, wall_reach: f64) {
        let x: Vec<Vec3> = self.bodies.iter().map(|body| body.x).collect();
        self.lists.rebuild(&x, ids, self.owned, reach, &self.setting.walls, wall_reach);
        self.actions.clear();
        self.actions.resize(self.lists.pairs.len(), Action::none());
    }

    /// The ghosts, behind the owned bodies.
    pub fn ghosts(&mut self) -> &mut [Motion<W>] {
        &mut self.bodies[self.owned..]
    }

    /// Moves the owned bodies to `y` and returns the largest squared distances (m^2) from `origin` and `start`.
    pub fn place(&mut self, y: &[Motion<W>], origin: &[Vec3], start: &[Vec3]) -> [f64; 2] {
        let place = |first: usize, chunk: &mut [Motion<W>]| {
            let mut moved = [0.0; 2];
            for (k, body) in chunk.iter_mut().enumerate() {
                let i = first + k;
                *body = y[i];
                moved[0] = larger(moved[0], (body.x - origin[i]).norm_squared());
                moved[1] = larger(moved[1], (body.x - start[i]).norm_squared());
            }
            moved
        };
        let both = |a: [f64; 2], b: [f64; 2]| [larger(a[0], b[0]), larger(a[1], b[1])];
        parallel::chunks(&mut self.bodies[..self.owned], 4 * GRAIN, place, [0.0; 2], both)
    }

    /// Evaluates every listed pair, lower id first. Returns how many are within `l_max` and have their lower id here:
    /// over all ranks every pair is counted once.
    pub fn evaluate_pairs(&mut self) -> u64 {
        let (law, bodies, pairs, owned) = (&self.law, &self.bodies, &self.lists.pairs, self.owned);
        let cutoff = 2.0 * law.r + law.l_max;
        let evaluate = |first: usize, chunk: &mut [Action<W>]| {
            fail_point!("worker");
            let mut count = 0;
            for (action, &[i, j]) in chunk.iter_mut().zip(&pairs[first..]) {
                let (i, j) = (i as usize, j as usize);
                let (a, b) = (&bodies[i], &bodies[j]);
                let apart = a.x - b.x;
                let d2 = apart.norm_squared();
                *action = if d2 > cutoff * cutoff {
                    Action::none()
                } else {
                    count += u64::from(i < owned);
                    let d = d2.sqrt();
                    law.action(d - 2.0 * law.r, &(apart / d), &(a.v - b.v), &a.omega.plus(&b.omega))
                };
            }
            count
        };
        parallel::chunks(&mut self.actions, GRAIN, evaluate, 0, |a, b| a + b)
    }

    /// Eqs. (2.13)-(2.15) for every owned body in place, after `evaluate_pairs`.
    pub fn accelerate(&self, dydt: &mut [Motion<W>]) {
        let inverse_mass = 1.0 / self.setting.mass;
        parallel::for_chunks(dydt, GRAIN, |first, chunk| {
            for (k, slope) in chunk.iter_mut().enumerate() {
                let i = first + k;
                let total = self.total_action(i);
                slope.x = self.bodies[i].v;
                slope.v = total.force * inverse_mass + self.setting.gravity;
                slope.omega = total.torque.scaled(self.setting.inverse_inertia);
            }
        });
    }

    /// Force (N) and torque (N m) on owned particle `i` by its pairs and walls.
    #[inline(always)]
    fn total_action(&self, i: usize) -> Action<W> {
        let mut total: Action<W> = Action::none();
        for entry in self.lists.entries(i) {
            let action = &self.actions[entry.pair()];
            if entry.is_higher() {
                total.force -= action.force;
            } else {
                total.force += action.force;
            }
            total.torque = total.torque.plus(&action.torque);
        }
        let body = &self.bodies[i];
        for &k in self.lists.walls(i) {
            if let Some(action) = self.wall_action(&self.setting.walls[k as usize], body) {
                total.force += action.force;
                total.torque = total.torque.plus(&action.torque);
            }
        }
        total
    }

    /// A wall is a motionless partner with n = -n_k.
    #[inline(always)]
    fn wall_action(&self, wall: &Wall, body: &Motion<W>) -> Option<Action<W>> {
        let gap = wall.depth(&body.x) - self.law.r;
        (gap <= self.law.l_max).then(|| self.law.action(gap, &-wall.normal, &body.v, &body.omega))
    }

    /// Gap of a listed pair, m; negative: overlap.
    fn pair_gap(&self, pair: [u32; 2]) -> f64 {
        let [i, j] = pair.map(|k| self.bodies[k as usize].x);
        (i - j).norm() - 2.0 * self.law.r
    }

    /// Gap of owned particle `i` and wall `k`, m.
    fn wall_gap(&self, i: usize, k: u32) -> f64 {
        self.setting.walls[k as usize].depth(&self.bodies[i].x) - self.law.r
    }

    /// Energy of owned particle `i`: half of what its pairs store, all that its walls store, and its height, J.
    pub fn potential_energy(&self, i: usize) -> f64 {
        let pair = |pair: usize| 0.5 * self.law.stored_energy(self.pair_gap(self.lists.pairs[pair]));
        let pairs: f64 = self.lists.entries(i).iter().map(|entry| pair(entry.pair())).sum();
        let walls: f64 =
            self.lists.walls(i).iter().map(|&k| self.law.stored_energy(self.wall_gap(i, k))).sum();
        pairs + walls - self.setting.mass * self.setting.gravity.dot(&self.bodies[i].x)
    }

    /// Power that the contacts of owned particle `i` dissipate by rebound and by friction, W: half of what its pairs do,
    /// all of what its walls do.
    pub fn dissipation(&self, i: usize) -> Losses {
        let mut sum = [0.0; 2];
        for entry in self.lists.entries(i) {
            let [a, b] = self.lists.pairs[entry.pair()].map(|k| &self.bodies[k as usize]);
            let apart = a.x - b.x;
            let d = apart.norm();
            let (gap, n) = (d - 2.0 * self.law.r, apart / d);
            let losses = self.law.dissipation(gap, &n, &(a.v - b.v), &a.omega.plus(&b.omega));
            add_losses(&mut sum, 0.5, &losses);
        }
        let body = &self.bodies[i];
        for &k in self.lists.walls(i) {
            let n = -self.setting.walls[k as usize].normal;
            add_losses(&mut sum, 1.0, &self.law.dissipation(self.wall_gap(i, k), &n, &body.v, &body.omega));
        }
        sum
    }

    /// Largest overlap of the bodies in place with each other and with walls, m; 0 without any.
    pub fn largest_overlap(&self) -> f64 {
        let pairs = self.lists.pairs.iter().map(|&pair| self.pair_gap(pair));
        let walls =
            (0..self.owned).flat_map(|i| self.lists.walls(i).iter().map(move |&k| self.wall_gap(i, k)));
        pairs.chain(walls).fold(0.0, |overlap, gap| f64::max(overlap, -gap))
    }

    /// The contacts whose force is not finite, after `evaluate_pairs`.
    pub fn broken(&self) -> impl Iterator<Item = Broken> {
        let finite = |action: &Action<W>| (action.force.norm_squared() + action.torque.max_abs()).is_finite();
        let pairs = self.actions.iter().zip(&self.lists.pairs).filter(move |(action, _)| !finite(action));
        let pairs = pairs.map(|(_, &[i, j])| {
            let d = self.pair_gap([i, j]) + 2.0 * self.law.r;
            Broken::Pair(i as usize, j as usize, d)
        });
        let walls = (0..self.owned).flat_map(|i| self.lists.walls(i).iter().map(move |&k| (i, k)));
        let walls = walls.filter(move |&(i, k)| {
            let action = self.wall_action(&self.setting.walls[k as usize], &self.bodies[i]);
            action.is_some_and(|action| !finite(&action))
        });
        pairs.chain(walls.map(|(i, k)| Broken::Wall(i, k as usize, -self.wall_gap(i, k))))
    }

    /// Memory held, bytes.
    pub fn bytes(&self) -> usize {
        self.lists.bytes()
            + self.bodies.capacity() * size_of::<Motion<W>>()
            + self.actions.capacity() * size_of::<Action<W>>()
    }
}
