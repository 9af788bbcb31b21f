//! Rows of four numbers. The kernel loads and stores particles by rows, and turns four rows into columns.

use crate::math::elementary::Arithmetic;

/// Operations on rows of four numbers, with the arithmetic of single numbers.
pub trait Lanes: Arithmetic {
    /// A row of four numbers.
    type Row: Copy;
    /// The row of these numbers.
    fn row(numbers: [f64; 4]) -> Self::Row;
    /// The row of four numbers that are adjacent in memory.
    ///
    /// One instruction. The compiler does not always turn `row` into one.
    fn load(numbers: &[f64; 4]) -> Self::Row;
    /// The numbers of a row.
    fn numbers(row: Self::Row) -> [f64; 4];
    /// a + b
    fn plus(a: Self::Row, b: Self::Row) -> Self::Row;
    /// a - b
    fn minus(a: Self::Row, b: Self::Row) -> Self::Row;
    /// a b + c
    fn add_products(a: Self::Row, b: Self::Row, c: Self::Row) -> Self::Row;
    /// The transpose: number k of row p becomes number p of row k.
    fn transpose(rows: [Self::Row; 4]) -> [Self::Row; 4];
}

/// Rows as plain arrays: the compiler chooses the instructions.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

impl Arithmetic for Plain {
    /// Fused if every processor of the architecture has the instruction, which those of x86-64 do not.
    #[inline(always)]
    fn add_product(a: f64, b: f64, c: f64) -> f64 {
        if cfg!(target_arch = "x86_64") { a * b + c } else { a.mul_add(b, c) }
    }
}

impl Lanes for Plain {
    type Row = [f64; 4];
    #[inline(always)]
    fn row(numbers: [f64; 4]) -> Self::Row {
        numbers
    }
    #[inline(always)]
    fn load(numbers: &[f64; 4]) -> Self::Row {
        *numbers
    }
    #[inline(always)]
    fn numbers(row: Self::Row) -> [f64; 4] {
        row
    }
    #[inline(always)]
    fn plus(a: Self::Row, b: Self::Row) -> Self::Row {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
    }
    #[inline(always)]
    fn minus(a: Self::Row, b: Self::Row) -> Self::Row {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
    }
    #[inline(always)]
    fn add_products(a: Self::Row, b: Self::Row, c: Self::Row) -> Self::Row {
        let [x, y, z, w] = [0, 1, 2, 3].map(|k| Self::add_product(a[k], b[k], c[k]));
        [x, y, z, w]
    }
    #[inline(always)]
    fn transpose([a, b, c, d]: [Self::Row; 4]) -> [Self::Row; 4] {
        [
            [a[0], b[0], c[0], d[0]],
            [a[1], b[1], c[1], d[1]],
            [a[2], b[2], c[2], d[2]],
            [a[3], b[3], c[3], d[3]],
        ]
    }
}

#[cfg(target_arch = "x86_64")]
pub use wide::Wide;

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::Lanes;
    use crate::math::elementary::{Arithmetic, Fused};
    use std::arch::x86_64::*;

    /// Rows as AVX2 registers, with fused multiply-add.
    ///
    /// Only for functions that are compiled for AVX2 and FMA, and only on processors that have both.
    #[derive(Debug, Clone, Copy)]
    pub struct Wide;

    impl Arithmetic for Wide {
        #[inline(always)]
        fn add_product(a: f64, b: f64, c: f64) -> f64 {
            Fused::add_product(a, b, c)
        }
    }

    // Unsafe code, because the compiler does not find these permutations by itself, and plain arrays are
    // slower.
    #[allow(unsafe_code)]
    impl Lanes for Wide {
        type Row = __m256d;
        #[inline(always)]
        fn row([x, y, z, w]: [f64; 4]) -> Self::Row {
            // SAFETY: `run` uses these lanes only where the processor has AVX2; the same for all below.
            unsafe { _mm256_set_pd(w, z, y, x) }
        }
        #[inline(always)]
        fn load(numbers: &[f64; 4]) -> Self::Row {
            // SAFETY: see `row`; four numbers are there.
            unsafe { _mm256_loadu_pd(numbers.as_ptr()) }
        }
        #[inline(always)]
        fn numbers(row: Self::Row) -> [f64; 4] {
            // SAFETY: both are four numbers.
            unsafe { std::mem::transmute(row) }
        }
        #[inline(always)]
        fn plus(a: Self::Row, b: Self::Row) -> Self::Row {
            // SAFETY: see `row`.
            unsafe { _mm256_add_pd(a, b) }
        }
        #[inline(always)]
        fn minus(a: Self::Row, b: Self::Row) -> Self::Row {
            // SAFETY: see `row`.
            unsafe { _mm256_sub_pd(a, b) }
        }
        #[inline(always)]
        fn add_products(a: Self::Row, b: Self::Row, c: Self::Row) -> Self::Row {
            // SAFETY: see `row`; FMA comes with it.
            unsafe { _mm256_fmadd_pd(a, b, c) }
        }
        #[inline(always)]
        fn transpose([a, b, c, d]: [Self::Row; 4]) -> [Self::Row; 4] {
            // SAFETY: see `row`.
            unsafe {
                let (ab, cd) = (
                    [_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b)],
                    [_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d)],
                );
                [
                    _mm256_permute2f128_pd::<0x20>(ab[0], cd[0]),
                    _mm256_permute2f128_pd::<0x20>(ab[1], cd[1]),
                    _mm256_permute2f128_pd::<0x31>(ab[0], cd[0]),
                    _mm256_permute2f128_pd::<0x31>(ab[1], cd[1]),
                ]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<L: Lanes>() {
        let row = |first: f64| L::row([first, first + 1.0, first + 2.0, first + 3.0]);
        let rows = [0.0, 10.0, 20.0, 30.0].map(row);
        assert_eq!(L::numbers(rows[2]), [20.0, 21.0, 22.0, 23.0]);
        assert_eq!(L::numbers(L::load(&[1.0, 2.0, 3.0, 4.0])), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(L::numbers(L::plus(rows[1], rows[2])), [30.0, 32.0, 34.0, 36.0]);
        assert_eq!(L::numbers(L::minus(rows[1], rows[3])), [-20.0; 4]);
        assert_eq!(L::numbers(L::add_products(rows[0], rows[1], rows[2])), [20.0, 32.0, 46.0, 62.0]);
        let columns = L::transpose(rows).map(L::numbers);
        assert_eq!(columns[1], [1.0, 11.0, 21.0, 31.0]);
        assert_eq!(columns[3], [3.0, 13.0, 23.0, 33.0]);
        assert_eq!(L::transpose(L::transpose(rows)).map(L::numbers), rows.map(L::numbers));
    }

    #[test]
    fn rows_and_columns_are_what_they_say() {
        check::<Plain>();
        #[cfg(target_arch = "x86_64")]
        if super::super::InstructionSet::available().len() > 1 {
            check::<Wide>();
        }
    }
}
