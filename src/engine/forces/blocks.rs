//! Loop over the blocks of a rank, one block per thread.

use crate::threads::{self, Cut};

/// Calls `work(own, items)` once for every block, in parallel, and combines the results.
///
/// Block b holds the particles `bounds[b]..bounds[b + 1]`, so there is one bound more than blocks.
///
/// `own` holds one element per block, `items` one per particle. Both are cut: a call of `work` gets the
/// element of its block and the items of its particles.
pub fn each_block<B: Cut, C: Cut, A: Send>(
    bounds: &[usize],
    own: B,
    items: C,
    work: &(impl Fn(B, C) -> A + Sync),
    combine: &(impl Fn(A, A) -> A + Sync),
) -> A {
    each_from(0, bounds.len() - 1, bounds, own, items, work, combine)
}

/// `each_block` for the blocks between these `bounds`. The first of them is block `first`, of `count` in all.
fn each_from<B: Cut, C: Cut, A: Send>(
    first: usize,
    count: usize,
    bounds: &[usize],
    own: B,
    items: C,
    work: &(impl Fn(B, C) -> A + Sync),
    combine: &(impl Fn(A, A) -> A + Sync),
) -> A {
    if bounds.len() <= 2 {
        return work(own, items);
    }
    let half = bounds.len() / 2;
    let (own, items) = (own.cut(half), items.cut(bounds[half] - bounds[0]));
    let middle = first + half;
    let (b, a) = threads::join(
        count - middle,
        || each_from(middle, count, &bounds[half..], own.1, items.1, work, combine),
        || each_from(first, count, &bounds[..=half], own.0, items.0, work, combine),
    );
    combine(a, b)
}
