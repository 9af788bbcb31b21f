//! The memories of the contacts of a batch: from their rows to its columns, and their rates back.

use super::{BEHIND_MEMORIES, Batch, get, set};
use crate::math::instructions::Lanes;
use crate::model::history::SHEAR;

impl Batch {
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
}
