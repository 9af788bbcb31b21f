//! Work on all blocks, one a thread.

use crate::threads::{self, Cut};

/// Does `work(own, items)` for every block, by as many threads as there are, and combines what it returns. Blocks begin at the
/// `bounds`, of which there is one more than blocks; `own` is what there is of every block, and `items` what there is of
/// their particles.
pub fn each_block<B: Cut, C: Cut, A: Send>(
    bounds: &[usize],
    own: B,
    items: C,
    work: &(impl Fn(B, C) -> A + Sync),
    combine: &(impl Fn(A, A) -> A + Sync),
) -> A {
    each_from(0, bounds.len() - 1, bounds, own, items, work, combine)
}

/// `each_block` from block `first` on, of `count` in all.
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
