//! Work on all blocks, one a thread.

use crate::kernel::Batch;
use crate::neighbors::Block;
use crate::parallel::{self, Cut};

/// A block and what belongs to it.
pub struct Part<'a, C> {
    /// Its particles and lists.
    pub block: &'a Block,
    /// Its scratch.
    pub batch: &'a mut Batch,
    /// The block's part of what there is of all owned particles.
    pub items: C,
}

/// Does `work` for every block, by as many threads as there are, and combines what it returns. `items` cover the
/// blocks' particles, of which there may be none.
pub fn each_block<C: Cut, A: Send>(
    (blocks, batches): (&[Block], &mut [Batch]),
    items: C,
    work: &(impl Fn(Part<C>) -> A + Sync),
    combine: &(impl Fn(A, A) -> A + Sync),
) -> A {
    if let ([block], [batch]) = (blocks, &mut *batches) {
        return work(Part { block, batch, items });
    }
    let half = blocks.len() / 2;
    let middle = blocks[half].range.start - blocks[0].range.start;
    let (blocks, batches) = (blocks.split_at(half), batches.split_at_mut(half));
    let items = items.cut(middle);
    let (a, b) = parallel::join(
        || each_block((blocks.0, batches.0), items.0, work, combine),
        || each_block((blocks.1, batches.1), items.1, work, combine),
    );
    combine(a, b)
}
