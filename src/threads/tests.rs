//! Loops visit every item, with spinning threads and without, and a panic in a part arrives at the caller.

use super::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Runs `work` in a pool of `threads` threads, of which the others spin.
fn at_posts<A: Send>(threads: usize, work: impl FnOnce() -> A + Send) -> A {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| with_spinning_threads(work))
}

#[test]
fn every_item_is_visited_once_with_its_index() {
    let visit_all = || {
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
    };
    visit_all();
    for threads in 1..=4 {
        at_posts(threads, visit_all);
    }
}

#[test]
fn loops_that_follow_each_other_closely_do_every_part_once() {
    at_posts(2, || {
        assert!(is_spinning());
        let mut sums = [0u64; 2];
        for round in 0..100_000u64 {
            each(&mut sums, &|sum| *sum += round);
        }
        assert_eq!(sums, [100_000 * 99_999 / 2; 2]);
    });
    assert!(!is_spinning());
}

#[test]
fn another_thread_takes_up_its_part_at_once_or_from_sleep() {
    /// Whether both parts of a loop run at the same time before either has waited for 5 ms.
    fn both_at_once() -> bool {
        let begun = AtomicUsize::new(0);
        let mut met = [false; 2];
        each(&mut met, &|met| {
            begun.fetch_add(1, Ordering::Relaxed);
            let start = Instant::now();
            while !*met && start.elapsed() < Duration::from_millis(5) {
                *met = begun.load(Ordering::Relaxed) == 2;
                std::thread::yield_now();
            }
        });
        met[0]
    }
    at_posts(2, || {
        let start = Instant::now();
        for round in 0..10 {
            // Every other time this is long enough for the other thread to fall asleep. It may start late
            // where the machine is busy.
            std::thread::sleep(Duration::from_millis(round % 2 * 3));
            while !both_at_once() {
                assert!(start.elapsed() < Duration::from_secs(60), "round {round}: nobody takes up a part");
            }
        }
    });
}

#[test]
fn loops_inside_of_parts_use_their_own_posts() {
    for threads in [2, 3, 4, 7] {
        let total = at_posts(threads, || {
            let inner = |first: usize, part: &mut [u64]| {
                let count = part.len();
                fold(100_000, 16, |i| (i % (first + count)) as u64, 0, |a, b| a + b)
            };
            chunks(&mut vec![0; 64], 2, inner, |a, b| a + b)
        });
        let parts = threads.min(64);
        let of_part = |k: usize| {
            let [first, end] = [64 * k / parts, 64 * (k + 1) / parts];
            (0..100_000).map(|i| (i % end.max(first)) as u64).sum::<u64>()
        };
        assert_eq!(total, (0..parts).map(of_part).sum::<u64>());
    }
}

#[test]
fn a_panic_in_either_part_arrives_and_the_others_stay_at_their_posts() {
    at_posts(2, || {
        for round in 0..200 {
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                let mut parts = [0, 1];
                each(&mut parts, &|part| {
                    // The other part goes on meanwhile.
                    if *part == round % 2 {
                        panic!("part {part} breaks");
                    }
                    std::thread::sleep(Duration::from_micros(20));
                });
            }));
            let message = *outcome.unwrap_err().downcast::<String>().unwrap();
            assert_eq!(message, format!("part {} breaks", round % 2));
            let mut parts = [1, 2];
            each(&mut parts, &|part| *part *= 3);
            assert_eq!(parts, [3, 6]);
        }
    });
}
