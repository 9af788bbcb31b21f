//! Loops over slices by rayon threads, where there is enough to do. Results never depend on the number of threads:
//! every item is computed alone, and what is folded is a maximum or an integer.

use rayon::prelude::*;

/// Items below which a second thread costs more than it brings: waking it takes as long as about a thousand pairs.
/// (Tried: with 1024, the paper's 200 spheres with their 1600 pairs were 15 % slower on 2 threads than on 1.)
pub const GRAIN: usize = 2048;

/// Calls `work(first, chunk)` for consecutive chunks of `items`, `first` being the index of the chunk's first item,
/// and folds what the calls return.
pub fn chunks<T, A>(
    items: &mut [T],
    grain: usize,
    work: impl Fn(usize, &mut [T]) -> A + Sync,
    identity: A,
    fold: impl Fn(A, A) -> A + Sync,
) -> A
where
    T: Send,
    A: Send + Sync + Clone,
{
    let threads = rayon::current_num_threads();
    if threads == 1 || items.len() <= grain {
        return fold(identity, work(0, items));
    }
    let size = chunk_size(items.len(), threads, grain);
    items
        .par_chunks_mut(size)
        .enumerate()
        .map(|(k, chunk)| work(k * size, chunk))
        .reduce(|| identity.clone(), &fold)
}

/// `chunks` for work that returns nothing.
pub fn for_chunks<T: Send>(items: &mut [T], grain: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    chunks(items, grain, work, (), |_, _| ());
}

/// `for_chunks` over two lists of the same length at once.
pub fn for_chunk_pairs<T: Send, U: Send>(
    a: &mut [T],
    b: &mut [U],
    grain: usize,
    work: impl Fn(usize, &mut [T], &mut [U]) + Sync,
) {
    debug_assert_eq!(a.len(), b.len(), "the lists are as long as each other");
    let threads = rayon::current_num_threads();
    if threads == 1 || a.len() <= grain {
        return work(0, a, b);
    }
    let size = chunk_size(a.len(), threads, grain);
    a.par_chunks_mut(size)
        .zip(b.par_chunks_mut(size))
        .enumerate()
        .for_each(|(k, (a, b))| work(k * size, a, b));
}

/// Folds `value(i)` for i in 0..n. The fold must not care about the order.
pub fn fold<A: Send + Sync + Clone>(
    n: usize,
    grain: usize,
    value: impl Fn(usize) -> A + Sync,
    identity: A,
    fold: impl Fn(A, A) -> A + Sync + Send,
) -> A {
    let threads = rayon::current_num_threads();
    if threads == 1 || n <= grain {
        return (0..n).map(value).fold(identity, fold);
    }
    let size = chunk_size(n, threads, grain);
    let part = |k: usize| (k * size..((k + 1) * size).min(n)).map(&value).fold(identity.clone(), &fold);
    (0..n.div_ceil(size)).into_par_iter().map(part).reduce(|| identity.clone(), &fold)
}

/// How many blocks of at least `grain` of `n` items keep all threads busy.
pub fn blocks(n: usize, grain: usize) -> usize {
    rayon::current_num_threads().min(n / grain).max(1)
}

/// Calls `work` for every item, in parallel.
pub fn each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Sync + Send) {
    match items {
        [item] => work(item),
        items => items.par_iter_mut().for_each(work),
    }
}

/// `value(i)` for i in 0..n.
pub fn collect<T: Send>(n: usize, grain: usize, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if rayon::current_num_threads() == 1 || n <= grain {
        return (0..n).map(value).collect();
    }
    (0..n).into_par_iter().with_min_len(grain / 2).map(&value).collect()
}

/// A few chunks a thread, so that a slow one is helped out.
fn chunk_size(n: usize, threads: usize, grain: usize) -> usize {
    n.div_ceil(4 * threads).max(grain / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_visited_once_with_its_index() {
        for n in [0, 1, 5, 1000, 70_000] {
            let mut items = vec![0usize; n];
            let visit = |first: usize, chunk: &mut [usize]| {
                chunk.iter_mut().enumerate().for_each(|(k, item)| *item += first + k + 1);
                chunk.len()
            };
            assert_eq!(chunks(&mut items, 16, visit, 0, |a, b| a + b), n);
            assert!(items.iter().enumerate().all(|(k, &item)| item == k + 1));
            assert_eq!(collect(n, 16, |k| k + 1), items);
        }
    }
}
