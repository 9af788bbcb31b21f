//! Weighted sums of vectors, by the widest vector instructions of this process.
//!
//! Every product is rounded before it is added, so all instruction sets give the same bits. A block of
//! numbers is read before any of it is written: else the compiler must expect that vectors overlap.

use crate::math::instructions::{Lanes, Vectorised, run_widest};

/// Numbers that are summed side by side. Registers hold their sums.
const LANES: usize = 32;

/// A vector of a weighted sum, and its weight.
pub type Term<'a> = (&'a [f64], f64);

/// Writes `y` plus the weighted sum of `terms` to `state`. All slices have the same length.
pub fn add_to(y: &[f64], terms: &[Term], state: &mut [f64]) {
    run_widest(Advance { y, terms, change: None, state });
}

/// Makes `change` the weighted sum of itself and `terms`, and writes `y` plus that to `state`.
///
/// Without a `weight` of its own, what `change` holds does not matter. All slices have the same length.
pub fn advance(y: &[f64], (change, weight): (&mut [f64], Option<f64>), terms: &[Term], state: &mut [f64]) {
    run_widest(Advance { y, terms, change: Some((change, weight)), state });
}

struct Advance<'a> {
    y: &'a [f64],
    terms: &'a [Term<'a>],
    change: Option<(&'a mut [f64], Option<f64>)>,
    state: &'a mut [f64],
}

impl Vectorised for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn work<L: Lanes>(mut self) {
        let (blocks, rest) = std::mem::take(&mut self.state).as_chunks_mut::<LANES>();
        let end = LANES * blocks.len();
        for (start, block) in (0..end).step_by(LANES).zip(blocks) {
            self.advance(start, block);
        }
        for (start, number) in (end..).zip(rest.as_chunks_mut::<1>().0) {
            self.advance(start, number);
        }
    }
}

impl Advance<'_> {
    #[inline(always)]
    fn advance<const N: usize>(&mut self, start: usize, state: &mut [f64; N]) {
        let mut sums = [0.0; N];
        if let Some((change, Some(weight))) = &self.change {
            add_term(&mut sums, (change, *weight), start);
        }
        add_terms(&mut sums, self.terms, start);
        if let Some((change, _)) = &mut self.change {
            change[start..start + N].copy_from_slice(&sums);
        }
        let y = at::<N>(self.y, start);
        for lane in 0..N {
            state[lane] = y[lane] + sums[lane];
        }
    }
}

/// Writes the weighted sum of `terms` from number `start` on to `sums`.
///
/// To be inlined into the work of a job, so that it is compiled with its instructions.
#[inline(always)]
pub(super) fn sum(terms: &[Term], mut start: usize, sums: &mut [f64]) {
    let (blocks, rest) = sums.as_chunks_mut::<LANES>();
    for block in blocks {
        *block = [0.0; LANES];
        add_terms(block, terms, start);
        start += LANES;
    }
    for number in rest.as_chunks_mut::<1>().0 {
        *number = [0.0];
        add_terms(number, terms, start);
        start += 1;
    }
}

#[inline(always)]
fn add_terms<const N: usize>(sums: &mut [f64; N], terms: &[Term], start: usize) {
    let mut in_registers = *sums;
    for &term in terms {
        add_term(&mut in_registers, term, start);
    }
    *sums = in_registers;
}

#[inline(always)]
fn add_term<const N: usize>(sums: &mut [f64; N], (numbers, weight): Term, start: usize) {
    let numbers = at::<N>(numbers, start);
    for lane in 0..N {
        sums[lane] += numbers[lane] * weight;
    }
}

/// The numbers from `start` on, as an array.
#[inline(always)]
fn at<const N: usize>(numbers: &[f64], start: usize) -> &[f64; N] {
    numbers[start..].first_chunk().expect("all slices have the length of the state")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::instructions::{InstructionSet, run};

    #[test]
    fn every_instruction_set_gives_the_bits_of_a_plain_loop() {
        let vector = |k: usize, n: usize| (0..n).map(|i| ((i * (k + 3)) as f64).sin()).collect::<Vec<f64>>();
        for n in [0, 1, LANES, 3 * LANES + 5] {
            let [y, a, b, old] = [0, 1, 2, 3].map(|k| vector(k, n));
            let terms = [(&a[..], 0.3), (&b[..], -1.7)];
            for weight in [None, Some(0.7)] {
                let own = |i: usize| weight.map_or(0.0, |weight| 0.0 + old[i] * weight);
                let sums: Vec<f64> = (0..n).map(|i| own(i) + a[i] * 0.3 + b[i] * -1.7).collect();
                let expected: Vec<f64> = (0..n).map(|i| y[i] + sums[i]).collect();
                for set in InstructionSet::available() {
                    let (mut change, mut state) = (old.clone(), vec![f64::NAN; n]);
                    let of_change = Some((&mut change[..], weight));
                    run(set, Advance { y: &y, terms: &terms, change: of_change, state: &mut state });
                    assert_eq!((&change, &state), (&sums, &expected), "{set:?}");
                }
            }
        }
    }
}
