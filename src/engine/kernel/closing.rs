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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::columns::{position, velocity};
    use rand::{RngExt, SeedableRng};

    #[test]
    fn all_fast_approaches_are_found_with_and_without_spins_and_hardly_any_others() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        // Two full batches and a rest that fills no row of lanes.
        let pairs: Vec<[u32; 2]> = (0..2 * BATCH as u32 + 3).map(|k| [k % 40, 40 + k % 37]).collect();
        let (slow, reach) = (0.3, 0.9);
        for width in [SPIN.start, SPIN.end] {
            let mut bodies: Vec<f64> = (0..77 * width).map(|_| random.random_range(-0.5..0.5)).collect();
            // A fault must not be passed over.
            bodies[3] = f64::NAN;
            let mut found = Vec::new();
            let closing =
                Closing { bodies: &bodies, width, pairs: &pairs, batch: &mut Batch::default(), slow, reach };
            for_closing_pairs(InstructionSet::chosen().unwrap(), closing, &mut |pair| {
                found.push(pair);
                slow
            });
            let counts = |[i, j]: [u32; 2]| {
                let [a, b] = [i, j].map(|slot| &bodies[slot as usize * width..]);
                let apart = position(a) - position(b);
                let closing = -apart.dot(&(velocity(a) - velocity(b))) / apart.norm();
                (closing.is_nan() || closing > slow) && apart.norm() <= reach
            };
            let expected: Vec<_> = pairs.iter().copied().filter(|&pair| counts(pair)).collect();
            assert!((20..pairs.len() / 2).contains(&expected.len()), "{}", expected.len());
            // No pair of these is within the margin of rounding.
            assert_eq!(found, expected);
        }
    }
}
