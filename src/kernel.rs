//! The contact law over batches of contacts, by the widest vector instructions that the processor has.
//!
//! Contacts are gathered into columns, evaluated with one loop that the compiler turns into vector instructions, and
//! added to their particles one after the other. All of it is compiled for every instruction set; all compute the
//! same operations in the same order, so all that fuse products with additions give the same bits, however wide they are.

use crate::contact::{Law, Rebound, Tangential};
use crate::container::Wall;
use crate::elementary::{Arithmetic, inverse_root};
use crate::forces::Setting;
use crate::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::neighbors::Block;
use crate::particle::{Motion, Spin, Vec3, dot, scaled};
use batch::BATCH;

mod batch;

pub use batch::Batch;

/// What a sweep over the contacts of one block needs.
pub struct Sweep<'a, R, T, W> {
    /// Contact law.
    pub law: &'a Law<R, T>,
    /// Masses, gravity and walls.
    pub setting: &'a Setting,
    /// Owned particles, then ghosts; or those of the block.
    pub bodies: &'a [Motion<W>],
    /// The block's lists.
    pub block: &'a Block,
    /// Scratch.
    pub batch: &'a mut Batch,
    /// Slopes of the block's particles.
    pub slopes: &'a mut [Motion<W>],
}

/// Adds the forces (N) and torques (N m) of the given contacts with walls to the slopes; `bodies` are those of the block.
pub fn add_walls<R: Rebound, T: Tangential, W: Spin>(
    set: InstructionSet,
    contacts: &[[u32; 2]],
    sweep: Sweep<R, T, W>,
) {
    run(set, Walls(contacts, sweep));
}

/// Adds the forces and torques of the near pairs of all `bodies` to the slopes, and makes accelerations of them,
/// eqs. (2.13)-(2.15). Returns how many pairs are within `l_max` and have their first particle in the block.
pub fn add_pairs<R: Rebound, T: Tangential, W: Spin>(set: InstructionSet, sweep: Sweep<R, T, W>) -> u64 {
    run(set, Pairs(sweep))
}

impl<R: Rebound, T: Tangential, W: Spin> Sweep<'_, R, T, W> {
    #[inline(always)]
    fn sum_walls<L: Lanes>(self, contacts: &[[u32; 2]]) {
        let Sweep { law, setting, bodies, block, batch, slopes } = self;
        let first = block.range.start;
        for contacts in contacts.chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize - first], &setting.walls[wall as usize]);
                // A wall is a motionless partner with n = -n_k.
                batch.gap[k] = wall.depth(&body.x) - law.r;
                batch.put(k, &-wall.normal, &body.v, &body.omega);
            }
            for k in 0..Batch::rows(contacts.len()) {
                let gap = batch.gap[k];
                batch.evaluate::<L, R, T, W>(k, law, gap <= law.l_max, gap, &batch.normal(k));
            }
            for (k, &[i, _]) in contacts.iter().enumerate() {
                let slope = &mut slopes[i as usize - first];
                slope.v += batch.force(k);
                slope.omega = slope.omega.plus(&batch.torque(k));
            }
        }
    }

    #[inline(always)]
    fn sum_pairs<L: Lanes>(self) -> u64 {
        let Sweep { law, setting, bodies, block, batch, slopes } = self;
        let cutoff = 2.0 * law.r + law.l_max;
        let mut count = 0;
        for pairs in block.near.chunks(BATCH) {
            batch.gather::<L, W>(bodies, pairs);
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, inverse_d) = distance::<L>(&apart);
                let far = d2 > cutoff * cutoff;
                let gap = L::add_product(d2, inverse_d, -2.0 * law.r);
                // What is not a number is not far: it must show.
                batch.evaluate::<L, R, T, W>(k, law, !far, gap, &scaled(inverse_d, &apart));
            }
            count += batch.scatter::<L, W>(pairs, &block.range, slopes);
        }
        let inverse_mass = 1.0 / setting.mass;
        for slope in slopes {
            slope.v = slope.v * inverse_mass + setting.gravity;
            slope.omega = slope.omega.scaled(setting.inverse_inertia);
        }
        count
    }
}

/// Square of the length of a vector, and one over its length.
#[inline(always)]
fn distance<L: Lanes>(apart: &Vec3) -> (f64, f64) {
    let d2 = dot::<L>(apart, apart);
    (d2, inverse_root::<L>(d2))
}

/// Two numbers that every contact has, of which whole systems have maxima or sums.
pub trait Measure<W>: Sync {
    /// Whether velocities and spins matter.
    const MOVES: bool;
    /// The numbers of one contact, at any gap; arguments as for [`Law::action`].
    fn of<A: Arithmetic>(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &W) -> [f64; 2];
}

/// The contacts of one block, each once over all blocks of all ranks.
pub struct Survey<'a, W> {
    /// Radius of every sphere, m.
    pub r: f64,
    /// The walls.
    pub walls: &'a [Wall],
    /// Owned particles, then ghosts.
    pub bodies: &'a [Motion<W>],
    /// The block's lists.
    pub block: &'a Block,
    /// Scratch.
    pub batch: &'a mut Batch,
}

/// Hands the numbers of all contacts of the survey to `take`, in no order that matters.
pub fn measure<W: Spin, M: Measure<W>>(
    set: InstructionSet,
    survey: Survey<W>,
    measure: &M,
    take: impl FnMut([f64; 2]),
) {
    run(set, Measuring(survey, measure, take));
}

struct Measuring<'a, W, M, F>(Survey<'a, W>, &'a M, F);

impl<W: Spin, M: Measure<W>, F: FnMut([f64; 2])> Vectorised for Measuring<'_, W, M, F> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Measuring(Survey { r, walls, bodies, block, batch }, measure, mut take) = self;
        for pairs in block.near.chunks(BATCH) {
            if M::MOVES {
                batch.gather::<L, W>(bodies, pairs);
            } else {
                for (k, &[i, j]) in pairs.iter().enumerate() {
                    batch.put_normal(k, &(bodies[i as usize].x - bodies[j as usize].x));
                }
            }
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, inverse_d) = distance::<L>(&apart);
                let gap = L::add_product(d2, inverse_d, -2.0 * r);
                batch.measure::<L, W, M>(k, measure, gap, &scaled(inverse_d, &apart));
            }
            for (k, [i, _]) in pairs.iter().enumerate() {
                // The others are counted where their first particle is.
                if block.range.contains(&(*i as usize)) {
                    take([batch.n[0][k], batch.n[1][k]]);
                }
            }
        }
        for contacts in block.walls.chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize], &walls[wall as usize]);
                batch.gap[k] = wall.depth(&body.x) - r;
                batch.put(k, &-wall.normal, &body.v, &body.omega);
            }
            for k in 0..Batch::rows(contacts.len()) {
                batch.measure::<L, W, M>(k, measure, batch.gap[k], &batch.normal(k));
            }
            for k in 0..contacts.len() {
                take([batch.n[0][k], batch.n[1][k]]);
            }
        }
    }
}

struct Walls<'a, R, T, W>(&'a [[u32; 2]], Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Walls<'_, R, T, W> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        self.1.sum_walls::<L>(self.0);
    }
}

struct Pairs<'a, R, T, W>(Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Pairs<'_, R, T, W> {
    type Output = u64;
    #[inline(always)]
    fn work<L: Lanes>(self) -> u64 {
        self.0.sum_pairs::<L>()
    }
}

#[cfg(test)]
mod tests;
