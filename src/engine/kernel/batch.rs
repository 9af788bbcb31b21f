//! Columns of a batch of contacts.
//!
//! They are filled from the bodies, then replaced by forces and torques, which are added to the slopes. A
//! torque is given over the radius, N.

use super::{BATCH, spin};
use crate::math::instructions::Lanes;
use crate::math::vector::{Vec3, dot, scaled, vector};
use crate::model::columns::{POSITION, SPIN, VELOCITY};
use crate::model::contact::{Action, Law, Rebound, Tangential};
use crate::model::history::{Partner, Response, SHEAR, Touch};
use crate::model::rolling::Resistance;
use crate::model::size::{Partners, Size};

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
    /// At first the sum of the spins, m/s. At last the torque over the radius, N.
    spins: [Column; 3],
    /// 1 where a pair is within `l_max`, 0 elsewhere.
    pub near: [u64; BATCH],
    /// The memory of the contact; after `evaluate` and `resist` its rate, 1/s. Only for laws with memory.
    memory: [Column; MOST_MEMORY],
    /// Of spheres that resist rolling or twisting: at first the difference of the spins, m/s; at last the
    /// torque over the radius on the partner, N.
    turns: [Column; 3],
    /// Their moment over the radius, N.
    moment: [Column; 3],
    /// r_i + r_j of a pair, r of a sphere at a wall, m.
    pub surfaces: Column,
    /// Only for laws with memory: what else the sizes of the partners mean, see [`Partners`].
    partners: [Column; 5],
    /// Only for laws with memory, where spheres differ: (w_i + w_j)/2, rad/s.
    mean_spin: [Column; 3],
    /// Only for laws with memory: the spin about the normal with which the contact turns, rad/s.
    spin_n: Column,
}

/// Most numbers in the memory of a contact: shear, rolling and twisting.
pub const MOST_MEMORY: usize = SHEAR + 3 + 1;

/// Numbers behind the memories of the contacts of a block, all 0; as many as the longest memory has, and
/// enough for a row of [`Lanes`] that begins with them.
pub const BEHIND_MEMORIES: usize = MOST_MEMORY;

impl Default for Batch {
    fn default() -> Self {
        let columns = [[0.0; BATCH]; 3];
        Batch {
            gap: [0.0; BATCH],
            n: columns,
            v: columns,
            spins: columns,
            near: [0; BATCH],
            memory: [[0.0; BATCH]; MOST_MEMORY],
            turns: columns,
            moment: columns,
            surfaces: [0.0; BATCH],
            partners: [[0.0; BATCH]; 5],
            mean_spin: columns,
            spin_n: [0.0; BATCH],
        }
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

    /// Fills row `k`, without the gap: normal or difference of centres, relative velocity, sum of spins.
    #[inline(always)]
    pub fn put<const N: usize>(&mut self, k: usize, n: &Vec3, v: &Vec3, spins: &Vec3) {
        self.put_normal(k, n);
        (self.v[0][k], self.v[1][k], self.v[2][k]) = (v.x, v.y, v.z);
        if N == 9 {
            (self.spins[0][k], self.spins[1][k], self.spins[2][k]) = (spins.x, spins.y, spins.z);
        }
    }

    /// Fills the first rows, as many as `contacts` need, for partners that are alike: pairs of equal spheres,
    /// or equal spheres at walls.
    #[inline(always)]
    pub fn set_alike(&mut self, r: f64, partner: Partner, remembers: bool, contacts: usize) {
        let (partners, rows) =
            (Partners::alike(r, partner == Partner::Wall), Batch::rows(contacts.min(BATCH)));
        self.surfaces[..rows].fill(partners.surfaces);
        if remembers {
            let Partners { per_surfaces, slipped, turned, arms, .. } = partners;
            for (column, number) in
                self.partners.iter_mut().zip([per_surfaces, slipped, turned, arms[0], arms[1]])
            {
                column[..rows].fill(number);
            }
        }
    }

    /// Fills the rows of `pairs` of spheres with these `sizes`, by slot. With a memory a typical sphere has
    /// the mass `typical` (kg); `resists` says whether anything resists rolling or twisting.
    #[inline(always)]
    pub fn put_pairs<const N: usize>(
        &mut self,
        (bodies, sizes): (&[[f64; N]], &[Size]),
        pairs: &[[u32; 2]],
        (typical, resists): (Option<f64>, bool),
    ) {
        for (k, pair) in pairs.iter().enumerate() {
            let [i, j] = pair.map(|slot| &sizes[slot as usize]);
            self.surfaces[k] = i.r + j.r;
            if typical.is_some() {
                // For the next loop, which has vector instructions.
                [self.partners[0][k], self.partners[1][k]] = [i.r, j.r];
                [self.partners[2][k], self.partners[3][k]] = [i.per_mass, j.per_mass];
                let [a, b] = pair.map(|slot| spin(&bodies[slot as usize]));
                put(&mut self.mean_spin, k, &(a * (0.5 * i.per_r) + b * (0.5 * j.per_r)));
            }
        }
        let Some(typical) = typical else { return };
        for k in 0..Batch::rows(pairs.len()) {
            let columns = &self.partners;
            let (r, per_mass) = ([columns[0][k], columns[1][k]], [columns[2][k], columns[3][k]]);
            self.put_partners(k, Partners::between(r, per_mass, typical, resists));
        }
    }

    /// Fills row `k` for a sphere at a wall. With a memory a typical sphere has the mass `typical` (kg).
    #[inline(always)]
    pub fn put_wall<const N: usize>(
        &mut self,
        k: usize,
        (body, size): (&[f64; N], &Size),
        typical: Option<f64>,
    ) {
        self.surfaces[k] = size.r;
        if let Some(typical) = typical {
            self.put_partners(k, Partners::of_wall(size, typical));
            put(&mut self.mean_spin, k, &(spin(body) * (0.5 * size.per_r)));
        }
    }

    #[inline(always)]
    fn put_partners(&mut self, k: usize, partners: Partners) {
        let Partners { per_surfaces, slipped, turned, arms, .. } = partners;
        for (column, number) in
            self.partners.iter_mut().zip([per_surfaces, slipped, turned, arms[0], arms[1]])
        {
            column[k] = number;
        }
    }

    /// What the sizes of the partners in row `k` mean.
    #[inline(always)]
    fn partners(&self, k: usize) -> Partners {
        // Written out, like all that is done for every row. Behind a closure the compiler does not see that
        // row `k` exists, and computes the last rows of a batch one by one.
        let columns = &self.partners;
        Partners {
            surfaces: self.surfaces[k],
            per_surfaces: columns[0][k],
            slipped: columns[1][k],
            turned: columns[2][k],
            arms: [columns[3][k], columns[4][k]],
        }
    }

    /// Finds the spins about the normals with which the first `count` contacts turn. Normals and spins must
    /// be set; `alike` says that all partners are alike.
    #[inline(always)]
    pub fn find_spins<L: Lanes, const N: usize>(&mut self, count: usize, partner: Partner, alike: bool) {
        let rows = 0..Batch::rows(count);
        if alike {
            // 1/(2 r), for pairs and for walls.
            let share = if partner == Partner::Wall { 0.5 } else { 1.0 };
            for k in rows {
                let per_diameter = share * self.partners[0][k];
                self.spin_n[k] = per_diameter * dot::<L>(&self.spins::<N>(k), &self.normal(k));
            }
        } else {
            for k in rows {
                self.spin_n[k] = dot::<L>(&get_vector(&self.mean_spin, k), &self.normal(k));
            }
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

    /// The relative velocity in row `k`, m/s.
    #[inline(always)]
    pub fn velocity(&self, k: usize) -> Vec3 {
        Vec3::new(self.v[0][k], self.v[1][k], self.v[2][k])
    }

    /// Replaces the first two components of the normal in row `k` by two numbers.
    #[inline(always)]
    pub fn put_numbers(&mut self, k: usize, numbers: [f64; 2]) {
        [self.n[0][k], self.n[1][k]] = numbers;
    }

    /// Divides the first of the two numbers in each row by that of `radii`.
    pub fn divide_numbers(&mut self, radii: impl Iterator<Item = f64>) {
        self.n[0].iter_mut().zip(radii).for_each(|(number, r)| *number /= r);
    }

    /// The numbers that `put_numbers` left in the first `count` rows, as two columns.
    pub fn number_columns(&self, count: usize) -> [&[f64]; 2] {
        [&self.n[0][..count], &self.n[1][..count]]
    }

    /// The numbers that `put_numbers` left in row `k`.
    #[inline(always)]
    pub fn numbers(&self, k: usize) -> [f64; 2] {
        [self.n[0][k], self.n[1][k]]
    }

    /// Evaluates the contact law for row `k`: force and torque replace normal and spins.
    ///
    /// The gap, normal, velocity and spins must be set. Force and torque are zero unless the contact is
    /// `near`.
    #[inline(always)]
    pub fn evaluate<L: Lanes, R: Rebound, T: Tangential, const N: usize>(
        &mut self,
        k: usize,
        law: &Law<R, T>,
        partner: Partner,
        near: bool,
    ) {
        let (n, v) = (self.normal(k), self.velocity(k));
        if T::REMEMBERS {
            let Response { force, turning, rate, .. } = self.respond::<L, R, T, N>(k, law, partner, &n);
            for (c, [force, rate]) in
                [[force.x, rate.x], [force.y, rate.y], [force.z, rate.z]].iter().enumerate()
            {
                self.n[c][k] = if near { *force } else { 0.0 };
                self.memory[c][k] = if near { *rate } else { 0.0 };
            }
            if N == 9 {
                self.spins[0][k] = if near { turning.x } else { 0.0 };
                self.spins[1][k] = if near { turning.y } else { 0.0 };
                self.spins[2][k] = if near { turning.z } else { 0.0 };
            }
            return;
        }
        let Action { force, turning } = law.action::<L>(self.gap[k], &n, &v, &self.spins::<N>(k));
        self.n[0][k] = if near { force.x } else { 0.0 };
        self.n[1][k] = if near { force.y } else { 0.0 };
        self.n[2][k] = if near { force.z } else { 0.0 };
        if N == 9 {
            self.spins[0][k] = if near { turning.x } else { 0.0 };
            self.spins[1][k] = if near { turning.y } else { 0.0 };
            self.spins[2][k] = if near { turning.z } else { 0.0 };
        }
    }

    /// What the law with memory gives for row `k`, with the unit normal `n`. All but that must be set.
    #[inline(always)]
    pub fn respond<L: Lanes, R: Rebound, T: Tangential, const N: usize>(
        &self,
        k: usize,
        law: &Law<R, T>,
        partner: Partner,
        n: &Vec3,
    ) -> Response {
        let memory = Vec3::new(self.memory[0][k], self.memory[1][k], self.memory[2][k]);
        law.respond::<L>(partner, self.touch(k, n, &self.velocity(k), &self.spins::<N>(k), &memory))
    }

    /// The contact in row `k`.
    #[inline(always)]
    fn touch<'a>(
        &self,
        k: usize,
        n: &'a Vec3,
        v_rel: &'a Vec3,
        spins: &'a Vec3,
        memory: &'a Vec3,
    ) -> Touch<'a> {
        Touch { gap: self.gap[k], n, v_rel, spins, spin_n: self.spin_n[k], size: self.partners(k), memory }
    }

    /// Fills the memories of contacts whose rows are `rows`; 0 for a contact without a row. Each memory has
    /// `width` numbers. [`BEHIND_MEMORIES`] zeros follow the last of the `states`.
    #[inline(always)]
    pub fn put_memories<L: Lanes>(&mut self, rows: &[u32], states: &[f64], width: usize) {
        let Some(end) = states.len().checked_sub(BEHIND_MEMORIES) else {
            let filled = self.memory.iter_mut().take(width);
            return filled.for_each(|column| column[..rows.len()].fill(0.0));
        };
        // The zeros are those of a contact without a row.
        let start = |row: u32| (row as usize * width).min(end);
        let (fours, rest) = if width == SHEAR { rows.as_chunks::<4>() } else { (&[][..], rows) };
        for (quad, rows) in fours.iter().enumerate() {
            let load = |row: u32| L::load(states[start(row)..].first_chunk().expect("zeros follow"));
            let [x, y, z, _] = L::transpose([load(rows[0]), load(rows[1]), load(rows[2]), load(rows[3])]);
            for (column, numbers) in self.memory.iter_mut().zip([x, y, z]) {
                set::<L>(column, 4 * quad, numbers);
            }
        }
        for (k, &row) in (4 * fours.len()..).zip(rest) {
            for (column, number) in self.memory.iter_mut().zip(&states[start(row)..][..width]) {
                column[k] = *number;
            }
        }
    }

    /// Writes the rates of the memories that `evaluate` and `resist` found to the rows of the contacts.
    #[inline(always)]
    pub fn take_rates<L: Lanes>(&self, rows: &[u32], rates: &mut [f64], width: usize) {
        let (fours, rest) = if width == SHEAR { rows.as_chunks::<4>() } else { (&[][..], rows) };
        let zeros = L::row([0.0; 4]);
        for (quad, rows) in fours.iter().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|c| get::<L>(&self.memory[c], 4 * quad));
            for (&row, rate) in rows.iter().zip(L::transpose([x, y, z, zeros])) {
                let start = row as usize * SHEAR;
                if let Some(numbers) = rates.get_mut(start..start + SHEAR) {
                    numbers.copy_from_slice(&L::numbers(rate)[..SHEAR]);
                }
            }
        }
        for (k, &row) in (4 * fours.len()..).zip(rest) {
            let start = row as usize * width;
            if let Some(rate) = rates.get_mut(start..start + width) {
                for (number, component) in rate.iter_mut().zip(&self.memory) {
                    *number = component[k];
                }
            }
        }
    }

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

    /// The force in row `k`, after `evaluate`, N.
    #[inline(always)]
    pub fn force(&self, k: usize) -> Vec3 {
        self.normal(k)
    }

    /// The sum of the spins in row `k`, m/s. After `evaluate`, the torque over the radius, N.
    #[inline(always)]
    pub fn spins<const N: usize>(&self, k: usize) -> Vec3 {
        if N == 9 { Vec3::new(self.spins[0][k], self.spins[1][k], self.spins[2][k]) } else { Vec3::zeros() }
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

/// The vector in row `k` of three columns.
#[inline(always)]
fn get_vector(columns: &[Column; 3], k: usize) -> Vec3 {
    Vec3::new(columns[0][k], columns[1][k], columns[2][k])
}

/// Sets the vector in row `k` of three columns.
#[inline(always)]
fn put(columns: &mut [Column; 3], k: usize, vector: &Vec3) {
    (columns[0][k], columns[1][k], columns[2][k]) = (vector.x, vector.y, vector.z);
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
