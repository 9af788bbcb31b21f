//! The contact kernel: evaluates the contact law for batches of contacts with vector instructions.
//!
//! Contacts are gathered into columns. One loop evaluates them, which the compiler turns into vector
//! instructions. The results are added to the particles one after the other.
//!
//! All of this is compiled once for every instruction set. All sets do the same operations in the same order.
//! So all sets with fused multiply-add give the same bits, whatever their width.

use crate::engine::neighbors::{BATCH, Block};
use crate::math::elementary::{Arithmetic, inverse_root};
use crate::math::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::math::vector::{Vec3, dot, scaled};
use crate::model::contact::{Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::model::wall::Wall;

mod batch;

pub use batch::Batch;

/// The data of a sweep over contacts, which adds forces and torques to slopes.
pub struct Sweep<'a, R, T, W> {
    /// Contact law.
    pub law: &'a Law<R, T>,
    /// Bodies by slot: the own particles of a block, then its ghosts.
    pub bodies: &'a [Motion<W>],
    /// Scratch memory.
    pub batch: &'a mut Batch,
    /// Slopes of the first of these bodies, at most of the own particles. During a sweep they hold forces (N)
    /// and torques (N m), to which the sweep adds.
    pub slopes: &'a mut [Motion<W>],
}

/// Adds forces and torques of `walls` to the slopes of the sweep.
///
/// A contact is a slot and the number of a wall. The bodies and the slopes of the sweep begin with slot
/// `first`.
pub fn add_walls<R: Rebound, T: Tangential, W: Spin>(
    set: InstructionSet,
    first: usize,
    (contacts, walls): (&[[u32; 2]], &[Wall]),
    sweep: Sweep<R, T, W>,
) {
    run(set, Walls(first, contacts, walls, sweep));
}

/// Adds forces and torques of `pairs`, given by their slots, to the slopes of the sweep.
///
/// A body without a slope is a ghost; nothing is added for it. Returns the number of pairs within `l_max`
/// whose first particle has a slope.
pub fn add_pairs<R: Rebound, T: Tangential, W: Spin>(
    set: InstructionSet,
    pairs: &[[u32; 2]],
    sweep: Sweep<R, T, W>,
) -> u64 {
    run(set, Pairs(pairs, sweep))
}

impl<R: Rebound, T: Tangential, W: Spin> Sweep<'_, R, T, W> {
    #[inline(always)]
    fn sum_walls<L: Lanes>(self, first: usize, contacts: &[[u32; 2]], walls: &[Wall]) {
        let Sweep { law, bodies, batch, slopes } = self;
        for contacts in contacts.chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize - first], &walls[wall as usize]);
                // A wall is a motionless partner with n = -n_k.
                batch.gap[k] = wall.depth(&body.x) - law.r;
                batch.put(k, &-wall.normal, &body.v, &body.omega);
            }
            for k in 0..Batch::rows(contacts.len()) {
                batch.evaluate::<L, R, T, W>(k, law, batch.gap[k] <= law.l_max);
            }
            for (k, &[i, _]) in contacts.iter().enumerate() {
                let slope = &mut slopes[i as usize - first];
                slope.v += batch.force(k);
                slope.omega = slope.omega.plus(&batch.torque(k));
            }
        }
    }

    #[inline(always)]
    fn sum_pairs<L: Lanes>(self, pairs: &[[u32; 2]]) -> u64 {
        let Sweep { law, bodies, batch, slopes } = self;
        let cutoff = 2.0 * law.r + law.l_max;
        let mut count = 0;
        for pairs in pairs.chunks(BATCH) {
            batch.gather::<L, W>(bodies, pairs);
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, inverse_d) = distance::<L>(&apart);
                let far = d2 > cutoff * cutoff;
                batch.gap[k] = L::add_product(d2, inverse_d, -2.0 * law.r);
                // A distance that is NaN must not count as far: the fault has to show in the forces.
                batch.near[k] = u64::from(!far);
                batch.put_normal(k, &scaled(inverse_d, &apart));
            }
            // A separate loop. Together with the distances, more operations would wait for each other than
            // the processor can look ahead.
            for k in 0..Batch::rows(pairs.len()) {
                batch.evaluate::<L, R, T, W>(k, law, batch.near[k] != 0);
            }
            let near: u64 = batch.near[..pairs.len()].iter().sum();
            count += near - batch.scatter::<L, W>(pairs, slopes);
        }
        count
    }
}

/// Square of the length of a vector, and the inverse of its length.
#[inline(always)]
fn distance<L: Lanes>(apart: &Vec3) -> (f64, f64) {
    let d2 = dot::<L>(apart, apart);
    (d2, inverse_root::<L>(d2))
}

/// Two numbers of a contact, such as energies, whose maxima or sums over all contacts are wanted.
pub trait Measure<W>: Sync {
    /// Whether the numbers depend on velocities and spins. If not, `of` gets meaningless values for these.
    const MOVES: bool;
    /// The numbers of one contact. Arguments as for [`Law::action`], but the gap may have any size.
    fn of<A: Arithmetic>(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &W) -> [f64; 2];
}

/// The contacts of one block to be measured. Over all blocks of all ranks, each contact is measured once.
pub struct Survey<'a, W> {
    /// Radius of every sphere, m.
    pub r: f64,
    /// The walls.
    pub walls: &'a [Wall],
    /// Bodies of the block by slot.
    pub bodies: &'a [Motion<W>],
    /// The block with its lists: near pairs and all listed walls are measured.
    pub block: &'a Block,
    /// Scratch memory.
    pub batch: &'a mut Batch,
}

/// Calls `take` with the numbers of every contact of the survey. The order must not matter to `take`.
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
                // Other pairs are counted in the block of their first particle.
                if block.owns(*i) {
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

struct Walls<'a, R, T, W>(usize, &'a [[u32; 2]], &'a [Wall], Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Walls<'_, R, T, W> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Walls(first, contacts, walls, sweep) = self;
        sweep.sum_walls::<L>(first, contacts, walls);
    }
}

struct Pairs<'a, R, T, W>(&'a [[u32; 2]], Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Pairs<'_, R, T, W> {
    type Output = u64;
    #[inline(always)]
    fn work<L: Lanes>(self) -> u64 {
        self.1.sum_pairs::<L>(self.0)
    }
}

#[cfg(test)]
mod tests;
