//! Which spheres of a start are near each other, kept in lists for as long as nothing moved far.

use crate::math::sized_cells::SizedCells;
use crate::math::vector::Vec3;
use crate::threads;
use std::ops::Range;

/// Spheres in one piece of the lists. It is fixed, so that the order of partners never depends on threads.
const PIECE: usize = 4096;

/// For each sphere those that may come within reach while none moves by more than its share of the slack.
pub(super) struct Near {
    pieces: Vec<Piece>,
}

struct Piece {
    /// Start of the list of each sphere in `partners`, and the end of the last one.
    starts: Vec<u32>,
    partners: Vec<u32>,
}

impl Near {
    /// Lists all pairs whose centres `x` (m) are closer than `reach` times the sum of their `radii` (m).
    pub(super) fn new(x: &[Vec3], radii: &[f64], reach: f64) -> Near {
        let alike = radii.iter().all(|r| *r == radii[0]);
        let of_both = |a: f64, b: f64| reach * (a + b);
        // Where all are alike one grid of cells, without classes of sizes, finds them faster.
        let constant = |_: f64, _: f64| 2.0 * reach * radii.first().copied().unwrap_or(1.0);
        let radius = |i: usize| radii[i];
        let cells = match alike {
            true => SizedCells::new(x, None, &constant),
            false => SizedCells::new(x, Some(&radius), &of_both),
        };
        let piece = |k: usize| {
            let (mut starts, mut partners) = (vec![0], Vec::new());
            for i in own(k, x.len()) {
                let mut add = |j: usize| {
                    if j != i && (x[i] - x[j]).norm_squared() < of_both(radii[i], radii[j]).powi(2) {
                        partners.push(j as u32);
                    }
                };
                match alike {
                    true => cells.for_each_near(&x[i], 0.0, &constant, &mut add),
                    false => cells.for_each_near(&x[i], radii[i], &of_both, &mut add),
                }
                starts.push(partners.len() as u32);
            }
            Piece { starts, partners }
        };
        Near { pieces: threads::collect(x.len().div_ceil(PIECE), 2, piece) }
    }

    /// The partners of sphere `i`, always in the same order.
    #[inline]
    pub(super) fn of(&self, i: usize) -> &[u32] {
        let Piece { starts, partners } = &self.pieces[i / PIECE];
        let row = i % PIECE;
        &partners[starts[row] as usize..starts[row + 1] as usize]
    }
}

fn own(piece: usize, n: usize) -> Range<usize> {
    piece * PIECE..n.min((piece + 1) * PIECE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn lists_hold_every_pair_within_reach_in_one_order_and_nothing_else() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        // More than one piece.
        let x: Vec<Vec3> = (0..5000).map(|_| Vec3::from_fn(|_, _| random.random_range(0.0..4.0))).collect();
        let equal = vec![0.05; x.len()];
        let unequal: Vec<f64> = x.iter().map(|_| random.random_range(0.02..0.1)).collect();
        for radii in [equal, unequal] {
            let near = Near::new(&x, &radii, 1.3);
            for i in (0..x.len()).step_by(61) {
                let close = |j: &usize| *j != i && (x[i] - x[*j]).norm() < 1.3 * (radii[i] + radii[*j]);
                let expected: Vec<usize> = (0..x.len()).filter(close).collect();
                let mut found: Vec<usize> = near.of(i).iter().map(|&j| j as usize).collect();
                found.sort_unstable();
                assert_eq!(found, expected, "{i}");
            }
        }
    }
}
