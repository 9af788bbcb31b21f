//! Loops over slices on several threads, where there is enough work.
//!
//! Results never depend on the number of threads: every item is computed on its own, and only maxima and
//! integers are folded.
//!
//! The threads are rayon's. They fall asleep between short loops and are slow to start again. Where such
//! loops follow each other closely, `with_spinning_threads` keeps the threads awake, so that work reaches
//! them much faster.

use rayon::prelude::*;
use std::ops::Range;

pub use spinning_pool::{is_spinning, join, with_spinning_threads};

pub mod huge_pages;
mod spinning_pool;

/// Number of items below which a second thread costs more than it saves. In a spinning pool a sixteenth of it
/// is used.
pub const GRAIN: usize = 2048;

/// What can be cut in two at an index.
///
/// # Examples
///
/// ```rust
/// use demhybrid::threads::Cut;
///
/// let (mut a, b) = ([1, 2, 3], [4.0, 5.0, 6.0]);
/// let (before, after) = (&mut a[..], &b[..]).cut(1);
/// assert_eq!((before.0.len(), before.1), (1, &[4.0][..]));
/// assert_eq!((after.0.len(), after.1), (2, &[5.0, 6.0][..]));
/// ```
pub trait Cut: Send + Sized {
    /// The part before the index, and the rest.
    fn cut(self, at: usize) -> (Self, Self);
}

impl<T: Send> Cut for &mut [T] {
    fn cut(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl<T: Sync> Cut for &[T] {
    fn cut(self, at: usize) -> (Self, Self) {
        self.split_at(at)
    }
}

impl Cut for Range<usize> {
    fn cut(self, at: usize) -> (Self, Self) {
        (self.start..self.start + at, self.start + at..self.end)
    }
}

impl Cut for () {
    fn cut(self, _at: usize) -> (Self, Self) {
        ((), ())
    }
}

impl<C: Cut, const K: usize> Cut for [C; K] {
    fn cut(self, at: usize) -> (Self, Self) {
        let mut rest = [const { None }; K];
        let mut slots = rest.iter_mut();
        let before = self.map(|items| {
            let (before, after) = items.cut(at);
            *slots.next().expect("there are as many") = Some(after);
            before
        });
        (before, rest.map(|after| after.expect("every place has been filled")))
    }
}

impl<A: Cut, B: Cut> Cut for (A, B) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a, c), (b, d)) = (self.0.cut(at), self.1.cut(at));
        ((a, b), (c, d))
    }
}

/// Calls `work(first, part)` for one part of `items` per thread, and folds the results.
///
/// `n` is the number of items, and `first` the index of the first item of the part. A thread receives the
/// same part of all slices of the same length, so that the part stays in its caches.
pub fn parts<C: Cut, A: Send>(
    n: usize,
    grain: usize,
    items: C,
    work: &(impl Fn(usize, C) -> A + Sync),
    fold: &(impl Fn(A, A) -> A + Sync),
) -> A {
    let grain = if is_spinning() { grain / 16 } else { grain };
    if n <= grain {
        return work(0, items);
    }
    let count = blocks(n, (grain / 2).max(1));
    in_parts(0..count, count, &|k| n * k / count, items, work, fold)
}

/// Calls `work(bound(k), part)` for the parts k in `which` of `items`, one per thread, and folds the results.
///
/// There are `count` parts in all. Part k begins at `bound(k)` and ends where part k + 1 begins. `items`
/// holds the parts in `which` only.
fn in_parts<C: Cut, A: Send>(
    which: Range<usize>,
    count: usize,
    bound: &(impl Fn(usize) -> usize + Sync),
    items: C,
    work: &(impl Fn(usize, C) -> A + Sync),
    fold: &(impl Fn(A, A) -> A + Sync),
) -> A {
    let first = bound(which.start);
    if which.len() == 1 {
        return work(first, items);
    }
    let middle = which.start.midpoint(which.end);
    let (a, b) = items.cut(bound(middle) - first);
    let (b, a) = join(
        count - middle,
        || in_parts(middle..which.end, count, bound, b, work, fold),
        || in_parts(which.start..middle, count, bound, a, work, fold),
    );
    fold(a, b)
}

/// Calls `work(first, chunk)` for consecutive chunks of `items`, and folds the results. `first` is the index
/// of the first item of the chunk.
pub fn chunks<T: Send, A: Send>(
    items: &mut [T],
    grain: usize,
    work: impl Fn(usize, &mut [T]) -> A + Sync,
    fold: impl Fn(A, A) -> A + Sync,
) -> A {
    parts(items.len(), grain, items, &work, &fold)
}

/// `chunks` for work without a result.
///
/// # Examples
///
/// ```rust
/// use demhybrid::threads::{GRAIN, for_chunks};
///
/// let mut numbers = vec![0; 10_000];
/// for_chunks(&mut numbers, GRAIN, |first, chunk| {
///     (first..).zip(chunk).for_each(|(i, number)| *number = 2 * i);
/// });
/// assert_eq!(numbers[4321], 8642);
/// ```
pub fn for_chunks<T: Send>(items: &mut [T], grain: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    chunks(items, grain, work, |(), ()| ());
}

/// `for_chunks` over two slices of the same length.
pub fn for_chunk_pairs<T: Send, U: Send>(
    a: &mut [T],
    b: &mut [U],
    grain: usize,
    work: impl Fn(usize, &mut [T], &mut [U]) + Sync,
) {
    debug_assert_eq!(a.len(), b.len(), "the lists are as long as each other");
    parts(a.len(), grain, (a, b), &|first, (a, b)| work(first, a, b), &|(), ()| ());
}

/// Folds `value(i)` for i in 0..n, from `identity`. The result must not depend on the order of the fold.
///
/// # Examples
///
/// ```rust
/// use demhybrid::threads::{GRAIN, fold};
///
/// let largest = fold(10_000, GRAIN, |i| i * 7 % 1000, 0, usize::max);
/// assert_eq!(largest, 999);
/// ```
pub fn fold<A: Send + Sync + Clone>(
    n: usize,
    grain: usize,
    value: impl Fn(usize) -> A + Sync,
    identity: A,
    fold: impl Fn(A, A) -> A + Sync + Send,
) -> A {
    let part = |_, range: Range<usize>| range.map(&value).fold(identity.clone(), &fold);
    parts(n, grain, 0..n, &part, &fold)
}

/// Number of blocks that keep all threads busy, if `n` items are cut into blocks of at least `grain`; at
/// least 1.
pub fn blocks(n: usize, grain: usize) -> usize {
    rayon::current_num_threads().min(n / grain).max(1)
}

/// Calls `work` for every item in parallel. There must be no more items than threads.
pub fn each<T: Send>(items: &mut [T], work: &(impl Fn(&mut T) + Sync)) {
    if items.is_empty() {
        return;
    }
    let alone = |_, item: &mut [T]| item.iter_mut().for_each(work);
    in_parts(0..items.len(), items.len(), &|k| k, items, &alone, &|(), ()| ());
}

/// Collects `value(i)` for i in 0..n, in this order.
///
/// # Examples
///
/// ```rust
/// use demhybrid::threads::{GRAIN, collect};
///
/// let squares = collect(10_000, GRAIN, |i| i * i);
/// assert_eq!(squares[99], 9801);
/// ```
pub fn collect<T: Send>(n: usize, grain: usize, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if rayon::current_num_threads() == 1 || n <= grain {
        return (0..n).map(value).collect();
    }
    spinning_pool::wake();
    (0..n).into_par_iter().with_min_len(grain / 2).map(&value).collect()
}

#[cfg(test)]
mod tests;
