//! Resistance to rolling and twisting in the contacts of a batch.

use super::{Batch, get_vector, put};
use crate::engine::kernel::BATCH;
use crate::math::instructions::Lanes;
use crate::math::vector::{Vec3, dot, scaled};
use crate::model::history::{Partner, SHEAR};
use crate::model::rolling::Resistance;

impl Batch {
    /// Fills the differences of the spins of contacts, m/s, from the spins of both partners. Those of unequal
    /// spheres count by their arms: 2 R (w_i - w_j).
    #[inline(always)]
    pub fn put_turns(&mut self, spins: impl Iterator<Item = [Vec3; 2]>) {
        for (k, [a, b]) in spins.enumerate() {
            put(&mut self.turns, k, &(a * self.partners[3][k] - b * self.partners[4][k]));
        }
    }

    /// Moments and rates of `resistance` in the first `count` rows, of which all but those must be set. It
    /// comes before `evaluate`.
    ///
    /// `within` says whether a row with this gap, and this entry in `near`, is within the cutoff.
    #[inline(always)]
    pub fn resist<L: Lanes>(
        &mut self,
        count: usize,
        resistance: &Resistance,
        partner: Partner,
        within: impl Fn(f64, u64) -> bool,
    ) {
        let mut next = SHEAR;
        self.moment = [[0.0; BATCH]; 3];
        if let Some(rolling) = &resistance.rolling {
            for k in 0..Batch::rows(count) {
                let near = within(self.gap[k], self.near[k]);
                let memory = self.rolled(k);
                let (n, v_rel, spins) = (&self.normal(k), &self.velocity(k), &self.spins::<9>(k));
                let touch = self.touch(k, n, v_rel, spins, &memory);
                let found = resistance.roll::<L>(rolling, partner, touch, &get_vector(&self.turns, k));
                for c in 0..3 {
                    self.moment[c][k] = if near { found.moment[c] } else { 0.0 };
                    self.memory[SHEAR + c][k] = if near { found.rate[c] } else { 0.0 };
                }
            }
            next += 3;
        }
        if let Some(twisting) = &resistance.twisting {
            for k in 0..Batch::rows(count) {
                let near = within(self.gap[k], self.near[k]);
                let (n, v_rel, spins) = (&self.normal(k), &self.velocity(k), &self.spins::<9>(k));
                let memory = scaled(self.memory[next][k], n);
                let touch = self.touch(k, n, v_rel, spins, &memory);
                let found = resistance.twist::<L>(twisting, partner, touch, &get_vector(&self.turns, k));
                for c in 0..3 {
                    self.moment[c][k] += if near { found.moment[c] } else { 0.0 };
                }
                self.memory[next][k] = if near { dot::<L>(&found.rate, n) } else { 0.0 };
            }
        }
    }

    /// Adds the moments of `resist` to the torques of `evaluate` in the first `count` rows. Torques on
    /// partners differ from now on.
    #[inline(always)]
    pub fn add_moments(&mut self, count: usize) {
        for c in 0..3 {
            for k in 0..Batch::rows(count) {
                let (both, moment) = (self.spins[c][k], self.moment[c][k]);
                self.spins[c][k] = both + self.partners[3][k] * moment;
                self.turns[c][k] = both - self.partners[4][k] * moment;
            }
        }
    }

    /// The memory of rolling in row `k`, which follows that of the shear.
    #[inline(always)]
    fn rolled(&self, k: usize) -> Vec3 {
        Vec3::new(self.memory[SHEAR][k], self.memory[SHEAR + 1][k], self.memory[SHEAR + 2][k])
    }

    /// Power that `resistance` dissipates in row `k`, with the unit normal `n`, W. All but that must be set.
    #[inline(always)]
    pub fn resisted_power<L: Lanes>(
        &self,
        k: usize,
        resistance: &Resistance,
        partner: Partner,
        n: &Vec3,
    ) -> f64 {
        let (v_rel, spins) = (&self.velocity(k), &self.spins::<9>(k));
        let (difference, mut power, mut next) = (get_vector(&self.turns, k), 0.0, SHEAR);
        if let Some(rolling) = &resistance.rolling {
            let memory = &self.rolled(k);
            let touch = self.touch(k, n, v_rel, spins, memory);
            power += resistance.roll::<L>(rolling, partner, touch, &difference).dissipation;
            next += 3;
        }
        if let Some(twisting) = &resistance.twisting {
            let memory = &scaled(self.memory[next][k], n);
            let touch = self.touch(k, n, v_rel, spins, memory);
            power += resistance.twist::<L>(twisting, partner, touch, &difference).dissipation;
        }
        power
    }
}
