//! The pairs whose partners approach each other fast. They are few, and found by vector instructions.

use super::{Batch, rows};
use crate::engine::neighbors::BATCH;
use crate::math::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::math::vector::dot;
use crate::model::columns::SPIN;

/// Margin for rounding: no pair that counts is left out.
const MARGIN: f64 = 1e-9;

/// The pairs to be looked through, and what counts.
pub struct Closing<'a> {
    /// Bodies by slot, as rows of the state.
    pub bodies: &'a [f64],
    /// Numbers in a row of the state.
    pub width: usize,
    /// The pairs, given by their slots.
    pub pairs: &'a [[u32; 2]],
    /// Scratch memory.
    pub batch: &'a mut Batch,
    /// Approaches that are not faster do not count, m/s.
    pub slow: f64,
    /// Centres further apart do not count, m.
    pub reach: f64,
}

/// Passes every pair that closes faster than `slow` within `reach` to `take`, and a few that nearly do.
///
/// `take` returns the speed that is to be exceeded from then on, m/s.
pub fn for_closing_pairs(set: InstructionSet, closing: Closing, take: &mut dyn FnMut([u32; 2]) -> f64) {
    if closing.width == SPIN.end {
        run(set, Search::<{ SPIN.end }>(closing, take));
    } else {
        run(set, Search::<{ SPIN.start }>(closing, take));
    }
}

struct Search<'a, const N: usize>(Closing<'a>, &'a mut dyn FnMut([u32; 2]) -> f64);

impl<const N: usize> Vectorised for Search<'_, N> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Search(Closing { bodies, pairs, batch, mut slow, reach, .. }, take) = self;
        let bodies = rows::<N>(bodies);
        let far = reach * reach * (1.0 + MARGIN);
        for pairs in pairs.chunks(BATCH) {
            batch.gather::<L, N>(bodies, pairs);
            let too_slow = slow * slow * (1.0 - MARGIN);
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, opening) = (dot::<L>(&apart, &apart), dot::<L>(&apart, &batch.velocity(k)));
                // What is NaN counts: the fault has to show.
                let idle = (opening >= 0.0) | (opening * opening <= too_slow * d2) | (d2 > far);
                batch.near[k] = u64::from(!idle);
            }
            for (k, &pair) in pairs.iter().enumerate() {
                if batch.near[k] != 0 {
                    slow = take(pair);
                }
            }
        }
    }
}
