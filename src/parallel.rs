//! Loops over slices by rayon threads, where there is enough to do. Results never depend on the number of threads:
//! every item is computed alone, and what is folded is a maximum or an integer.
//!
//! A right-hand side of a few hundred particles takes 20 us, and rayon's threads fall asleep after about 10 us: waking one
//! takes longer than the work. `attended` keeps them awake for as long as work comes up again and again.

use rayon::prelude::*;
use std::hint::spin_loop;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

/// Items below which a second thread costs more than it brings; an eighth of it where threads look out for work.
pub const GRAIN: usize = 2048;

/// How long a thread looks out for work, or for another thread to end its own, before it sleeps: about what it takes to
/// wake it.
const PATIENCE: Duration = Duration::from_micros(100);

/// Whether the other threads look out for work.
static ATTENDED: AtomicBool = AtomicBool::new(false);
/// Those of them that rest for the time being, and how they are called.
static RESTING: AtomicUsize = AtomicUsize::new(0);
static CALLS: Mutex<u64> = Mutex::new(0);
static CALL: Condvar = Condvar::new();

/// Does `work` while the other threads of the pool stay awake between two parallel loops, for a while each time. To be
/// called where the ranks of this machine have a core for every thread: on shared cores they would take time from others.
pub fn attended<A>(work: impl FnOnce() -> A) -> A {
    /// Ends the attendance, also where `work` panics.
    struct End<'a>(&'a AtomicU8);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            ATTENDED.store(false, Ordering::Relaxed);
            self.0.store(OVER, Ordering::Release);
            wake();
        }
    }
    let state = AtomicU8::new(UNDER_WAY);
    let home = rayon::current_thread_index();
    rayon::in_place_scope(|scope| {
        let _end = End(&state);
        if rayon::current_num_threads() > 1 && home.is_some() {
            ATTENDED.store(true, Ordering::Relaxed);
            scope.spawn_broadcast(|_, context| {
                if Some(context.index()) != home {
                    attend(&state);
                }
            });
        }
        work()
    })
}

/// Of `attended`, and of one half of a `join`.
const UNDER_WAY: u8 = 1;
const OVER: u8 = 2;

/// Takes up work of other threads until it is over.
fn attend(state: &AtomicU8) {
    let mut watch = Watch::default();
    while state.load(Ordering::Acquire) != OVER {
        match rayon::yield_now() {
            Some(rayon::Yield::Executed) => watch = Watch::default(),
            _ if watch.goes_on() => {}
            _ => {
                rest(state);
                watch = Watch::default();
            }
        }
    }
}

/// Sleeps until there is a call. Work that comes up in the very moment of falling asleep is done by whoever has it.
fn rest(state: &AtomicU8) {
    let mut calls = CALLS.lock().expect("nothing panics with the lock");
    let before = *calls;
    RESTING.fetch_add(1, Ordering::Relaxed);
    while *calls == before && state.load(Ordering::Acquire) != OVER {
        calls = CALL.wait(calls).expect("nothing panics with the lock");
    }
    RESTING.fetch_sub(1, Ordering::Relaxed);
}

/// Wakes the threads that are seen to rest.
fn call() {
    if RESTING.load(Ordering::Relaxed) > 0 {
        wake();
    }
}

/// Wakes the threads that rest, or are about to.
fn wake() {
    *CALLS.lock().expect("nothing panics with the lock") += 1;
    CALL.notify_all();
}

/// A wait without sleep, which ends by itself.
#[derive(Default)]
struct Watch {
    rounds: u32,
    since: Option<Instant>,
}

impl Watch {
    /// Passes a moment; false once it has been too many.
    fn goes_on(&mut self) -> bool {
        self.rounds += 1;
        if !self.rounds.is_multiple_of(32) {
            spin_loop();
            return true;
        }
        // Whoever shares this core goes first.
        std::thread::yield_now();
        self.since.get_or_insert_with(Instant::now).elapsed() < PATIENCE
    }
}

/// Does `a` and `b`, the latter by another thread if one is free.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    /// Tells that `b` is over, also where it panics.
    struct End<'a>(&'a AtomicU8);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.store(OVER, Ordering::Release);
        }
    }
    call();
    let state = AtomicU8::new(0);
    rayon::join(
        || {
            let result = a();
            // What is soon over is waited for without falling asleep.
            let mut watch = Watch::default();
            while state.load(Ordering::Acquire) == UNDER_WAY && is_attended() && watch.goes_on() {}
            result
        },
        || {
            state.store(UNDER_WAY, Ordering::Release);
            let _end = End(&state);
            b()
        },
    )
}

/// The other threads look out for work: little of it is worth sharing.
pub fn is_attended() -> bool {
    ATTENDED.load(Ordering::Relaxed)
}

/// What can be cut in two at an index.
pub trait Cut: Send + Sized {
    /// What is before the index, and the rest.
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

/// Calls `work(first, part)` for one part of `items`, of which there are `n`, for every thread, `first` being the index of
/// the part's first item, and folds what the calls return. A thread has the same part of every list of the same length, so
/// that it stays in its caches.
pub fn parts<C: Cut, A: Send>(
    n: usize,
    grain: usize,
    items: C,
    work: &(impl Fn(usize, C) -> A + Sync),
    fold: &(impl Fn(A, A) -> A + Sync),
) -> A {
    fn some<C: Cut, A: Send>(
        which: Range<usize>,
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
        let (a, b) = join(
            || some(which.start..middle, bound, a, work, fold),
            || some(middle..which.end, bound, b, work, fold),
        );
        fold(a, b)
    }
    let grain = if is_attended() { grain / 8 } else { grain };
    if n <= grain {
        return work(0, items);
    }
    let count = blocks(n, grain / 2);
    some(0..count, &|k| n * k / count, items, work, fold)
}

/// Calls `work(first, chunk)` for consecutive chunks of `items`, `first` being the index of the chunk's first item,
/// and folds what the calls return.
pub fn chunks<T: Send, A: Send>(
    items: &mut [T],
    grain: usize,
    work: impl Fn(usize, &mut [T]) -> A + Sync,
    fold: impl Fn(A, A) -> A + Sync,
) -> A {
    parts(items.len(), grain, items, &work, &fold)
}

/// `chunks` for work that returns nothing.
pub fn for_chunks<T: Send>(items: &mut [T], grain: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    chunks(items, grain, work, |(), ()| ());
}

/// `for_chunks` over two lists of the same length at once.
pub fn for_chunk_pairs<T: Send, U: Send>(
    a: &mut [T],
    b: &mut [U],
    grain: usize,
    work: impl Fn(usize, &mut [T], &mut [U]) + Sync,
) {
    debug_assert_eq!(a.len(), b.len(), "the lists are as long as each other");
    parts(a.len(), grain, (a, b), &|first, (a, b)| work(first, a, b), &|(), ()| ());
}

/// Folds `value(i)` for i in 0..n. The fold must not care about the order.
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

/// How many blocks of at least `grain` of `n` items keep all threads busy.
pub fn blocks(n: usize, grain: usize) -> usize {
    rayon::current_num_threads().min(n / grain).max(1)
}

/// Calls `work` for every item, in parallel.
pub fn each<T: Send>(items: &mut [T], work: &(impl Fn(&mut T) + Sync)) {
    if items.len() > 1 {
        let (a, b) = items.split_at_mut(items.len() / 2);
        join(|| each(a, work), || each(b, work));
    } else {
        items.iter_mut().for_each(work);
    }
}

/// `value(i)` for i in 0..n.
pub fn collect<T: Send>(n: usize, grain: usize, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if rayon::current_num_threads() == 1 || n <= grain {
        return (0..n).map(value).collect();
    }
    call();
    (0..n).into_par_iter().with_min_len(grain / 2).map(&value).collect()
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
            assert_eq!(chunks(&mut items, 16, visit, |a, b| a + b), n);
            assert!(items.iter().enumerate().all(|(k, &item)| item == k + 1));
            assert_eq!(collect(n, 16, |k| k + 1), items);
        }
    }
}
