//! Columns of a batch of contacts.
//!
//! They are filled from the bodies, then replaced by forces and torques, which are added to the slopes.

use super::{BATCH, Measure};
use crate::math::instructions::Lanes;
use crate::math::vector::Vec3;
use crate::model::contact::{Action, Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};

/// The number of evaluated rows is a multiple of this.
const STRIDE: usize = 8;

type Column = [f64; BATCH];

/// Columns of a batch of contacts, one row per contact. Signs are those for the first particle of a contact.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Batch {
    /// Gap, m.
    pub gap: Column,
    /// At first the difference of the centres (m) for a pair, then the unit normal; for a wall, at once the
    /// unit normal towards the particle. At last the force, N.
    pub n: [Column; 3],
    /// Velocity relative to the partner, m/s.
    v: [Column; 3],
    /// At first the sum of the angular velocities, rad/s. At last the torque, N m.
    spins: [Column; 3],
    /// 1 where a pair is within `l_max`, 0 elsewhere.
    pub near: [u64; BATCH],
}

impl Default for Batch {
    fn default() -> Self {
        let columns = [[0.0; BATCH]; 3];
        Batch { gap: [0.0; BATCH], n: columns, v: columns, spins: columns, near: [0; BATCH] }
    }
}

impl Batch {
    /// Number of rows to evaluate for this number of `contacts`: the next multiple of `STRIDE`.
    ///
    /// The rows after the last contact hold values of an earlier batch. Their results are not used.
    #[inline(always)]
    pub fn rows(contacts: usize) -> usize {
        let rows = contacts.next_multiple_of(STRIDE);
        // Tells the compiler that all rows exist.
        assert!(rows <= BATCH);
        rows
    }

    /// Fills the rows of `pairs`: differences of the centres and of the velocities, and sums of the spins.
    #[inline(always)]
    pub fn gather<L: Lanes, W: Spin>(&mut self, bodies: &[Motion<W>], pairs: &[[u32; 2]]) {
        let (fours, rest) = pairs.as_chunks::<4>();
        let mut heads = [L::row([0.0; 4]); 4];
        let mut tails = heads;
        // Velocities are subtracted, spins added.
        let signs = L::row([-1.0, -1.0, 1.0, 1.0]);
        for (quad, pairs) in fours.iter().enumerate() {
            let k = 4 * quad;
            for (p, &[i, j]) in pairs.iter().enumerate() {
                let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
                heads[p] = L::minus(head::<L, W>(a), head::<L, W>(b));
                tails[p] = L::add_products(signs, tail::<L, W>(b), tail::<L, W>(a));
                if W::COMPONENTS == 3 {
                    self.spins[2][k + p] = a.omega.vector().z + b.omega.vector().z;
                }
            }
            let [x, y, z, u] = L::transpose(heads);
            set::<L>(&mut self.n[0], k, x);
            set::<L>(&mut self.n[1], k, y);
            set::<L>(&mut self.n[2], k, z);
            set::<L>(&mut self.v[0], k, u);
            let [v, w, p, q] = L::transpose(tails);
            set::<L>(&mut self.v[1], k, v);
            set::<L>(&mut self.v[2], k, w);
            if W::COMPONENTS == 3 {
                set::<L>(&mut self.spins[0], k, p);
                set::<L>(&mut self.spins[1], k, q);
            }
        }
        for (k, &[i, j]) in (4 * fours.len()..).zip(rest) {
            let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
            self.put(k, &(a.x - b.x), &(a.v - b.v), &a.omega.plus(&b.omega));
        }
    }

    /// Fills row `k`, without the gap: normal or difference of centres, relative velocity, sum of spins.
    #[inline(always)]
    pub fn put<W: Spin>(&mut self, k: usize, n: &Vec3, v: &Vec3, spins: &W) {
        self.put_normal(k, n);
        (self.v[0][k], self.v[1][k], self.v[2][k]) = (v.x, v.y, v.z);
        if W::COMPONENTS == 3 {
            let w = spins.vector();
            (self.spins[0][k], self.spins[1][k], self.spins[2][k]) = (w.x, w.y, w.z);
        }
    }

    /// Sets the normal, or the difference of the centres, in row `k`.
    #[inline(always)]
    pub fn put_normal(&mut self, k: usize, n: &Vec3) {
        (self.n[0][k], self.n[1][k], self.n[2][k]) = (n.x, n.y, n.z);
    }

    /// The normal, or the difference of the centres, in row `k`.
    #[inline(always)]
    pub fn normal(&self, k: usize) -> Vec3 {
        Vec3::new(self.n[0][k], self.n[1][k], self.n[2][k])
    }

    /// Replaces the first two components of the normal in row `k` by the two numbers of the measure.
    #[inline(always)]
    pub fn measure<L: Lanes, W: Spin, M: Measure<W>>(&mut self, k: usize, measure: &M, gap: f64, n: &Vec3) {
        let v = Vec3::new(self.v[0][k], self.v[1][k], self.v[2][k]);
        [self.n[0][k], self.n[1][k]] = measure.of::<L>(gap, n, &v, &self.torque::<W>(k));
    }

    /// Evaluates the contact law for row `k`: force and torque replace normal and spins.
    ///
    /// The gap, normal, velocity and spins must be set. Force and torque are zero unless the contact is
    /// `near`.
    #[inline(always)]
    pub fn evaluate<L: Lanes, R: Rebound, T: Tangential, W: Spin>(
        &mut self,
        k: usize,
        law: &Law<R, T>,
        near: bool,
    ) {
        let v = Vec3::new(self.v[0][k], self.v[1][k], self.v[2][k]);
        let Action { force, torque } =
            law.action::<L, W>(self.gap[k], &self.normal(k), &v, &self.torque::<W>(k));
        self.n[0][k] = if near { force.x } else { 0.0 };
        self.n[1][k] = if near { force.y } else { 0.0 };
        self.n[2][k] = if near { force.z } else { 0.0 };
        if W::COMPONENTS == 3 {
            let torque = torque.vector();
            self.spins[0][k] = if near { torque.x } else { 0.0 };
            self.spins[1][k] = if near { torque.y } else { 0.0 };
            self.spins[2][k] = if near { torque.z } else { 0.0 };
        }
    }

    /// The force in row `k`, after `evaluate`, N.
    #[inline(always)]
    pub fn force(&self, k: usize) -> Vec3 {
        self.normal(k)
    }

    /// The torque in row `k`, after `evaluate`, N m. Before, the sum of the spins, rad/s.
    #[inline(always)]
    pub fn torque<W: Spin>(&self, k: usize) -> W {
        if W::COMPONENTS == 3 {
            W::from_vector(Vec3::new(self.spins[0][k], self.spins[1][k], self.spins[2][k]))
        } else {
            W::zero()
        }
    }

    /// Adds forces and torques of `pairs` to the slopes of their particles.
    ///
    /// Ghosts have no slope here: their own block or rank evaluates the pair too. Returns the number of near
    /// pairs whose first particle is a ghost.
    #[inline(always)]
    pub fn scatter<L: Lanes, W: Spin>(&self, pairs: &[[u32; 2]], slopes: &mut [Motion<W>]) -> u64 {
        let mut elsewhere = 0;
        let (fours, rest) = pairs.as_chunks::<4>();
        for (quad, pairs) in fours.iter().enumerate() {
            let (heads, tails) = self.actions::<L, W>(4 * quad);
            for p in 0..4 {
                elsewhere += self.add::<L, W>(4 * quad + p, pairs[p], (heads[p], tails[p]), slopes);
            }
        }
        if !rest.is_empty() {
            let first = 4 * fours.len();
            let (heads, tails) = self.actions::<L, W>(first);
            for (p, &pair) in rest.iter().enumerate() {
                elsewhere += self.add::<L, W>(first + p, pair, (heads[p], tails[p]), slopes);
            }
        }
        elsewhere
    }

    /// Forces and torques of the four contacts from row `k` on, as two rows of numbers for each.
    ///
    /// The first holds the force and the first component of the torque, the second the other two components.
    #[inline(always)]
    fn actions<L: Lanes, W: Spin>(&self, k: usize) -> ([L::Row; 4], [L::Row; 4]) {
        let get = |column| get::<L>(column, k);
        let zeros = L::row([0.0; 4]);
        let [x, y, z] = if W::COMPONENTS == 3 {
            [get(&self.spins[0]), get(&self.spins[1]), get(&self.spins[2])]
        } else {
            [zeros; 3]
        };
        let force = [get(&self.n[0]), get(&self.n[1]), get(&self.n[2])];
        (L::transpose([force[0], force[1], force[2], x]), L::transpose([y, z, zeros, zeros]))
    }

    /// Adds force and torque of a pair to the slopes of its two particles, as far as these have slopes here.
    ///
    /// Returns 1 if the first particle has none and the pair, in row `k`, is near; else 0.
    #[inline(always)]
    fn add<L: Lanes, W: Spin>(
        &self,
        k: usize,
        [i, j]: [u32; 2],
        (head, tail): (L::Row, L::Row),
        slopes: &mut [Motion<W>],
    ) -> u64 {
        let mut elsewhere = 0;
        if let Some(slope) = slopes.get_mut(i as usize) {
            let sum = L::plus(slopes_head::<L, W>(slope), head);
            replace::<L, W>(slope, sum, tail);
        } else {
            elsewhere = self.near[k];
        }
        if let Some(slope) = slopes.get_mut(j as usize) {
            let signs = L::row([-1.0, -1.0, -1.0, 1.0]);
            let sum = L::add_products(signs, head, slopes_head::<L, W>(slope));
            replace::<L, W>(slope, sum, tail);
        }
        elsewhere
    }
}

/// Centre of a body, and the first component of its velocity.
#[inline(always)]
fn head<L: Lanes, W: Spin>(body: &Motion<W>) -> L::Row {
    L::row([body.x.x, body.x.y, body.x.z, body.v.x])
}

/// The other two components of the velocity, and the first two of the spin.
#[inline(always)]
fn tail<L: Lanes, W: Spin>(body: &Motion<W>) -> L::Row {
    let w = body.omega.vector();
    L::row([body.v.y, body.v.z, w.x, w.y])
}

/// Force in a slope, and the first component of its torque.
#[inline(always)]
fn slopes_head<L: Lanes, W: Spin>(slope: &Motion<W>) -> L::Row {
    L::row([slope.v.x, slope.v.y, slope.v.z, slope.omega.vector().x])
}

/// Replaces the force and the first component of the torque in a slope by `head`. Adds the first two numbers
/// of `tail` to the other two components of the torque.
#[inline(always)]
fn replace<L: Lanes, W: Spin>(slope: &mut Motion<W>, head: L::Row, tail: L::Row) {
    let w = slope.omega.vector();
    let [x, y, z, p] = L::numbers(head);
    slope.v = Vec3::new(x, y, z);
    if W::COMPONENTS == 3 {
        let [q, s, ..] = L::numbers(tail);
        slope.omega = W::from_vector(Vec3::new(p, w.y + q, w.z + s));
    }
}

/// The four numbers of a column from row `k` on.
#[inline(always)]
fn get<L: Lanes>(column: &Column, k: usize) -> L::Row {
    L::load(column[k..].first_chunk().expect("columns are evaluated by eights"))
}

/// Sets the four numbers of a column from row `k` on.
#[inline(always)]
fn set<L: Lanes>(column: &mut Column, k: usize, row: L::Row) {
    column[k..k + 4].copy_from_slice(&L::numbers(row));
}
