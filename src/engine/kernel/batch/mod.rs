//! Columns of a batch of contacts.
//!
//! They are filled from the bodies, then replaced by forces and torques, which are added to the slopes. A
//! torque is given over the radius, N.
//!
//! `bodies` moves bodies in and forces out, `memories` the memories of contacts and their rates, and
//! `resistance` evaluates resistance to rolling and twisting.

mod bodies;
mod memories;
mod resistance;

use super::{BATCH, spin};
use crate::math::instructions::Lanes;
use crate::math::vector::{Vec3, dot};
use crate::model::contact::{Action, Law, Rebound, Tangential};
use crate::model::history::{Partner, Response, SHEAR, Touch};
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
