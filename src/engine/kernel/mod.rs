//! The contact law over batches of contacts, by the widest vector instructions that the processor has.
//!
//! Contacts are gathered into columns, evaluated with one loop that the compiler turns into vector instructions, and
//! added to their particles one after the other. All of it is compiled for every instruction set; all compute the
//! same operations in the same order, so all that fuse products with additions give the same bits, however wide they are.

use crate::engine::neighbors::{BATCH, Block};
use crate::math::elementary::{Arithmetic, inverse_root};
use crate::math::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::math::vector::{Vec3, dot, scaled};
use crate::model::contact::{Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::model::wall::Wall;

mod batch;

pub use batch::Batch;

/// What a sweep over contacts needs.
pub struct Sweep<'a, R, T, W> {
    /// Contact law.
    pub law: &'a Law<R, T>,
    /// Bodies by place: a block's own, then its visitors.
    pub bodies: &'a [Motion<W>],
    /// Scratch.
    pub batch: &'a mut Batch,
    /// Slopes of the first of these bodies: forces (N) and torques (N m) are added.
    pub slopes: &'a mut [Motion<W>],
}

/// Adds what `walls` do in the given `contacts` of place and wall, to bodies of which the first has the place `first`.
pub fn add_walls<R: Rebound, T: Tangential, W: Spin>(
    set: InstructionSet,
    first: usize,
    (contacts, walls): (&[[u32; 2]], &[Wall]),
    sweep: Sweep<R, T, W>,
) {
    run(set, Walls(first, contacts, walls, sweep));
}

/// Adds what the given pairs do. Returns how many of them are within `l_max` and have a slope here for their first particle.
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
                // What is not a number is not far: it must show.
                batch.near[k] = u64::from(!far);
                batch.put_normal(k, &scaled(inverse_d, &apart));
            }
            // A loop of its own: in one with the distances more operations wait for each other than the processor looks ahead,
            // and the whole run takes a tenth longer.
            for k in 0..Batch::rows(pairs.len()) {
                batch.evaluate::<L, R, T, W>(k, law, batch.near[k] != 0);
            }
            let near: u64 = batch.near[..pairs.len()].iter().sum();
            count += near - batch.scatter::<L, W>(pairs, slopes);
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
    /// Bodies by place.
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
