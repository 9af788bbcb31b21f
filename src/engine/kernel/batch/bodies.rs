//! From bodies to the columns of a batch, and from its columns to the slopes of the bodies.
//!
//! Four contacts at a time: rows of four numbers, transposed in registers.

use super::{Batch, Column, get, set};
use crate::math::instructions::Lanes;
use crate::math::vector::{Vec3, vector};
use crate::model::columns::{POSITION, SPIN, VELOCITY};

impl Batch {
    /// Fills the rows of `pairs`: differences of the centres and of the velocities, and sums of the spins.
    #[inline(always)]
    pub fn gather<L: Lanes, const N: usize>(&mut self, bodies: &[[f64; N]], pairs: &[[u32; 2]]) {
        let (fours, rest) = pairs.as_chunks::<4>();
        let mut heads = [L::row([0.0; 4]); 4];
        let mut tails = heads;
        // Velocities are subtracted, spins added.
        let signs = L::row([-1.0, -1.0, 1.0, 1.0]);
        for (quad, pairs) in fours.iter().enumerate() {
            let k = 4 * quad;
            for (p, &[i, j]) in pairs.iter().enumerate() {
                let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
                heads[p] = L::minus(head::<L, N>(a), head::<L, N>(b));
                tails[p] = L::add_products(signs, tail::<L, N>(b), tail::<L, N>(a));
                if N == 9 {
                    self.spins[2][k + p] = a[8] + b[8];
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
            if N == 9 {
                set::<L>(&mut self.spins[0], k, p);
                set::<L>(&mut self.spins[1], k, q);
            }
        }
        for (k, &[i, j]) in (4 * fours.len()..).zip(rest) {
            let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
            let spins = if N == 9 { vector(&a[SPIN]) + vector(&b[SPIN]) } else { Vec3::zeros() };
            let apart = vector(&a[POSITION]) - vector(&b[POSITION]);
            self.put::<N>(k, &apart, &(vector(&a[VELOCITY]) - vector(&b[VELOCITY])), &spins);
        }
    }

    /// Adds forces and torques of `pairs` to the slopes of their particles.
    ///
    /// Ghosts have no slope here: their own block or rank evaluates the pair too. Returns the number of near
    /// pairs whose first particle is a ghost. `moments` says whether torques on partners differ, see
    /// `add_moments`.
    #[inline(always)]
    pub fn scatter<L: Lanes, const N: usize>(
        &self,
        pairs: &[[u32; 2]],
        slopes: &mut [[f64; N]],
        moments: bool,
    ) -> u64 {
        let mut elsewhere = 0;
        let sides = |k: usize| {
            let (heads, tails) = self.actions::<L, N>(k, &self.spins);
            let of_partner = if moments { self.actions::<L, N>(k, &self.turns) } else { (heads, tails) };
            ((heads, tails), of_partner)
        };
        let (fours, rest) = pairs.as_chunks::<4>();
        for (quad, pairs) in fours.iter().enumerate() {
            let ((heads, tails), (other_heads, other_tails)) = sides(4 * quad);
            for p in 0..4 {
                let both = [(heads[p], tails[p]), (other_heads[p], other_tails[p])];
                elsewhere += self.add::<L, N>(4 * quad + p, pairs[p], both, slopes);
            }
        }
        if !rest.is_empty() {
            let first = 4 * fours.len();
            let ((heads, tails), (other_heads, other_tails)) = sides(first);
            for (p, &pair) in rest.iter().enumerate() {
                let both = [(heads[p], tails[p]), (other_heads[p], other_tails[p])];
                elsewhere += self.add::<L, N>(first + p, pair, both, slopes);
            }
        }
        elsewhere
    }

    /// Forces and `torques` of the four contacts from row `k` on, as two rows of numbers for each.
    ///
    /// The first holds the force and the first component of the torque, the second the other two components.
    #[inline(always)]
    fn actions<L: Lanes, const N: usize>(
        &self,
        k: usize,
        torques: &[Column; 3],
    ) -> ([L::Row; 4], [L::Row; 4]) {
        let get = |column| get::<L>(column, k);
        let zeros = L::row([0.0; 4]);
        let [x, y, z] =
            if N == 9 { [get(&torques[0]), get(&torques[1]), get(&torques[2])] } else { [zeros; 3] };
        let force = [get(&self.n[0]), get(&self.n[1]), get(&self.n[2])];
        (L::transpose([force[0], force[1], force[2], x]), L::transpose([y, z, zeros, zeros]))
    }

    /// Adds force and torque of a pair to the slopes of its two particles, as far as these have slopes here.
    /// `sides` are force on the first particle and torque, for each of the two.
    ///
    /// Returns 1 if the first particle has none and the pair, in row `k`, is near; else 0.
    #[inline(always)]
    fn add<L: Lanes, const N: usize>(
        &self,
        k: usize,
        [i, j]: [u32; 2],
        [(head, tail), (other_head, other_tail)]: [(L::Row, L::Row); 2],
        slopes: &mut [[f64; N]],
    ) -> u64 {
        let mut elsewhere = 0;
        if let Some(slope) = slopes.get_mut(i as usize) {
            let sum = L::plus(slopes_head::<L, N>(slope), head);
            replace::<L, N>(slope, sum, tail);
        } else {
            elsewhere = self.near[k];
        }
        if let Some(slope) = slopes.get_mut(j as usize) {
            let signs = L::row([-1.0, -1.0, -1.0, 1.0]);
            let sum = L::add_products(signs, other_head, slopes_head::<L, N>(slope));
            replace::<L, N>(slope, sum, other_tail);
        }
        elsewhere
    }
}

/// Centre of a body, and the first component of its velocity.
#[inline(always)]
fn head<L: Lanes, const N: usize>(body: &[f64; N]) -> L::Row {
    L::row([body[0], body[1], body[2], body[3]])
}

/// The other two components of the velocity, and the first two of the spin.
#[inline(always)]
fn tail<L: Lanes, const N: usize>(body: &[f64; N]) -> L::Row {
    if N == 9 { L::row([body[4], body[5], body[6], body[7]]) } else { L::row([body[4], body[5], 0.0, 0.0]) }
}

/// Force in a slope, and the first component of its torque.
#[inline(always)]
fn slopes_head<L: Lanes, const N: usize>(slope: &[f64; N]) -> L::Row {
    L::row([slope[3], slope[4], slope[5], if N == 9 { slope[6] } else { 0.0 }])
}

/// Replaces the force and the first component of the torque in a slope by `head`. Adds the first two numbers
/// of `tail` to the other two components of the torque.
#[inline(always)]
fn replace<L: Lanes, const N: usize>(slope: &mut [f64; N], head: L::Row, tail: L::Row) {
    let [x, y, z, p] = L::numbers(head);
    (slope[3], slope[4], slope[5]) = (x, y, z);
    if N == 9 {
        let [q, s, ..] = L::numbers(tail);
        slope[6] = p;
        slope[7] += q;
        slope[8] += s;
    }
}
