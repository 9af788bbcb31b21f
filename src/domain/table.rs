//! Tables of numbers, a row for each owned particle: the one way in which they change owner and order.

/// Rows of equal width, in the order of the owned particles.
#[derive(Debug)]
pub struct Table<'a> {
    /// The numbers, row after row.
    pub numbers: &'a mut Vec<f64>,
    /// Numbers in a row.
    pub width: usize,
}

impl Table<'_> {
    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.numbers[i * self.width..(i + 1) * self.width]
    }

    /// Keeps the rows for which `keep` holds, in their order.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let mut kept = 0;
        for i in (0..self.numbers.len() / self.width).filter(|&i| keep(i)) {
            self.numbers.copy_within(i * self.width..(i + 1) * self.width, kept * self.width);
            kept += 1;
        }
        self.numbers.truncate(kept * self.width);
    }

    /// Puts row `order[k]` at index k, for all k.
    pub fn reorder(&mut self, order: &[usize]) {
        let mut numbers = Vec::with_capacity(self.numbers.len());
        order.iter().for_each(|&i| numbers.extend_from_slice(self.row(i)));
        *self.numbers = numbers;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_kept_and_reordered_as_a_whole() {
        let mut numbers = vec![0.0, 0.5, 1.0, 1.5, 2.0, 2.5];
        let mut table = Table { numbers: &mut numbers, width: 2 };
        table.reorder(&[2, 0, 1]);
        assert_eq!(*table.numbers, [2.0, 2.5, 0.0, 0.5, 1.0, 1.5]);
        table.retain(|i| i != 1);
        assert_eq!(*table.numbers, [2.0, 2.5, 1.0, 1.5]);
        assert_eq!(table.row(1), [1.0, 1.5]);
    }
}
