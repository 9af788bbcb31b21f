//! A pool of spinning threads, which start short jobs quickly.
//!
//! The thread that calls [`with_spinning_threads`] starts the parallel loops. Every other thread of the pool
//! serves a slot: it polls the slot instead of falling asleep between two loops, and runs the jobs that are
//! offered there.
//!
//! The pool guarantees:
//!
//! - **One owner per slot.** At any time at most one thread may offer jobs at a slot: its owner. The owner
//!   passes some of its slots on with a job, and owns them again once that job is finished or taken back. So
//!   whenever a thread offers a job at a slot, the previous job there is over.
//! - **A job runs at most once.** Either the serving thread takes it, or the thread that offered it takes it
//!   back. One compare-and-swap of [`Inbox::taken`] decides. It runs exactly once unless the other half of
//!   its `join` panics.
//! - **No job outlives its `join`.** A `join` ends, also by a panic, only after its job is finished or taken
//!   back. So a job may lie on the stack of the thread that offers it, and may borrow from there.
//! - **The same part runs on the same thread** in all loops with the same number of parts, unless its job is
//!   taken back. So its data stay in the caches of that thread. Of n parts, part k goes to slot n - 1 - k.
//!   The last part stays with the thread that starts the loop.
//! - **Offering a job is cheap.** Unless the serving thread sleeps, it takes plain stores, without a fence or
//!   a compare-and-swap. The thread does not wait until its earlier stores are visible to others.
//! - **Panics arrive.** A panic in a job continues in the `join` that offered it, and the pool stays usable.

// A job lies on the stack of the thread that offers it, and its type is unknown to the thread that runs it.
// `End` in `SpinningPool::join` keeps it alive until it is finished or taken back.
#![allow(unsafe_code)]

use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::hint::spin_loop;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU8, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

/// How long a thread polls, for a job or for the end of one, before it sleeps: about the time that it takes
/// to wake a thread.
const PATIENCE: Duration = Duration::from_micros(100);

/// How long a thread sleeps at a time while it waits for the end of a job, where nobody wakes it.
const NAP: Duration = Duration::from_micros(50);

/// The part of a [`Job`] that does not depend on its types.
struct Task {
    run: unsafe fn(*const Task),
    /// The slots that the thread that runs the job owns meanwhile: from the first, its own, to before the
    /// second.
    slots: [usize; 2],
}

/// The second half of a `join`, with its result.
///
/// The task is the first field: a pointer to it, made from one to the whole job, can be cast back to the job.
#[repr(C)]
struct Job<F, R> {
    task: Task,
    work: Cell<Option<F>>,
    result: UnsafeCell<Option<Result<R, Box<dyn Any + Send>>>>,
}

impl<F: FnOnce() -> R, R> Job<F, R> {
    fn new(work: F, slots: [usize; 2]) -> Self {
        let task = Task { run: Self::run, slots };
        Job { task, work: Cell::new(Some(work)), result: UnsafeCell::new(None) }
    }

    /// # Safety
    ///
    /// `task` comes from a pointer to a whole `Job<F, R>`, which is alive. No other thread accesses the job
    /// during the call.
    unsafe fn run(task: *const Task) {
        // SAFETY: the task is the first field of the job (`repr(C)`). The caller guarantees that the job is
        // alive and that no other thread accesses it.
        let job = unsafe { &*task.cast::<Self>() };
        if let Some(work) = job.work.take() {
            let result = catch_unwind(AssertUnwindSafe(work));
            // SAFETY: as above; there is no other reference to the result.
            unsafe { *job.result.get() = Some(result) };
        }
    }
}

/// A value in cache lines of its own. Processors fetch lines in pairs, hence 128 bytes.
#[repr(align(128))]
struct Apart<T>(T);

/// A mailbox of one thread, the serving thread: another thread, the owner, offers jobs there.
struct Slot {
    /// Number of jobs offered so far. Only the owner of the slot uses it.
    left: Apart<AtomicU64>,
    inbox: Apart<Inbox>,
    status: Apart<Status>,
}

/// What the owner of the slot writes and the serving thread polls.
struct Inbox {
    /// Number of the last job offered. It is stored last, with `Release`: whoever loads it with `Acquire`
    /// sees that job.
    number: AtomicU64,
    /// Number of the last job taken. Whoever raises it to the number of a job, by compare-and-swap, has that
    /// job to itself.
    taken: AtomicU64,
    task: AtomicPtr<Task>,
}

/// What the owner of the slot needs to know of the serving thread.
struct Status {
    /// Number of the last finished job.
    done: AtomicU64,
    presence: AtomicU8,
}

const ABSENT: u8 = 0;
const AWAKE: u8 = 1;
const RESTING: u8 = 2;

impl Slot {
    /// A slot that no thread serves yet.
    fn new() -> Self {
        let inbox = Inbox {
            number: AtomicU64::new(0),
            taken: AtomicU64::new(0),
            task: AtomicPtr::new(ptr::null_mut()),
        };
        let status = Status { done: AtomicU64::new(0), presence: AtomicU8::new(ABSENT) };
        Slot { left: Apart(AtomicU64::new(0)), inbox: Apart(inbox), status: Apart(status) }
    }

    /// Offers a job. Returns its number and whether the serving thread seems to sleep; none if no thread
    /// serves the slot.
    ///
    /// The serving thread may be asleep all the same if it falls asleep at this moment, and it may be busy
    /// with work of rayon's. The owner then takes the job back.
    fn offer(&self, task: *const Task) -> Option<(u64, bool)> {
        let left = self.left.0.load(Ordering::Relaxed);
        let presence = self.status.0.presence.load(Ordering::Relaxed);
        if presence == ABSENT {
            return None;
        }
        debug_assert_eq!(self.status.0.done.load(Ordering::Relaxed), left, "one task at a time");
        let number = left + 1;
        self.left.0.store(number, Ordering::Relaxed);
        self.inbox.0.task.store(task.cast_mut(), Ordering::Relaxed);
        self.inbox.0.number.store(number, Ordering::Release);
        Some((number, presence == RESTING))
    }

    /// Tries to take the job of this number. Returns whether this thread has it now.
    fn take(&self, number: u64) -> bool {
        let taken = &self.inbox.0.taken;
        taken.compare_exchange(number - 1, number, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }

    fn end(&self, number: u64) {
        self.status.0.done.store(number, Ordering::Release);
    }

    /// Takes the job of this number back, or waits until it is finished. Returns whether it has been taken
    /// back.
    fn reclaim(&self, number: u64) -> bool {
        let done = || self.status.0.done.load(Ordering::Acquire) == number;
        if done() {
            return false;
        }
        if self.inbox.0.taken.load(Ordering::Relaxed) != number && self.take(number) {
            self.end(number);
            return true;
        }
        let mut backoff = Backoff::default();
        while !done() {
            if !backoff.goes_on() {
                std::thread::sleep(NAP);
            }
        }
        false
    }
}

/// The slots of the threads of a rayon pool, during `with_spinning_threads`.
struct SpinningPool {
    /// One slot a thread. No thread serves slot 0: it stands for the thread that starts the loops.
    slots: Vec<Slot>,
    over: AtomicBool,
    /// Held while a thread decides to sleep, and while others wake it.
    sleep: Mutex<()>,
    wake: Condvar,
}

/// What a thread may use: its pool, and the slots that it owns, from the first to before the second.
///
/// The first is the slot that it serves itself. It may offer jobs at the others.
#[derive(Clone, Copy)]
struct Assignment {
    pool: *const SpinningPool,
    slots: [usize; 2],
}

thread_local! {
    static ASSIGNMENT: Cell<Assignment> =
        const { Cell::new(Assignment { pool: ptr::null(), slots: [0; 2] }) };
}

/// Assigns slots to this thread until the guard is dropped.
struct SlotGuard(Assignment);

impl SlotGuard {
    fn slots(pool: &SpinningPool, slots: [usize; 2]) -> Self {
        SlotGuard(ASSIGNMENT.replace(Assignment { pool, slots }))
    }
}

impl Drop for SlotGuard {
    fn drop(&mut self) {
        ASSIGNMENT.set(self.0);
    }
}

/// Runs `work` while the other threads of this rayon pool spin.
///
/// Loops within `work` then start quickly. A thread that has had no job for a while sleeps until it is woken.
///
/// Call this only where the ranks of this machine have a core for every thread. On shared cores, spinning
/// threads take time from others.
///
/// Outside of a rayon pool, in a pool of one thread, and within another call this only runs `work`.
pub fn with_spinning_threads<A>(work: impl FnOnce() -> A) -> A {
    /// Ends the service of all threads, also if `work` panics.
    struct End<'a>(&'a SpinningPool);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.over.store(true, Ordering::Release);
            self.0.wake(&self.0.slots);
        }
    }
    let threads = rayon::current_num_threads();
    let home = rayon::current_thread_index().filter(|_| threads > 1 && !is_spinning());
    let Some(home) = home else {
        return work();
    };
    let slots = (0..threads).map(|_| Slot::new()).collect();
    let pool =
        SpinningPool { slots, over: AtomicBool::new(false), sleep: Mutex::new(()), wake: Condvar::new() };
    let pool = &pool;
    rayon::in_place_scope(|scope| {
        let _end = End(pool);
        let _using = SlotGuard::slots(pool, [0, threads]);
        scope.spawn_broadcast(move |_, context| {
            let index = context.index();
            if index != home {
                pool.serve(if index < home { index + 1 } else { index });
            }
        });
        work()
    })
}

impl SpinningPool {
    /// Serves a slot: runs the jobs offered there, and work of rayon's, until the pool is over.
    fn serve(&self, slot: usize) {
        let Slot { inbox: Apart(inbox), status: Apart(status), .. } = &self.slots[slot];
        let mut last = 0;
        status.presence.store(AWAKE, Ordering::Release);
        let mut backoff = Backoff::default();
        while !self.over.load(Ordering::Acquire) {
            let number = inbox.number.load(Ordering::Acquire);
            if number != last {
                last = number;
                if self.slots[slot].take(number) {
                    let task = inbox.task.load(Ordering::Relaxed);
                    // SAFETY: `task` was offered by `join`, as a pointer to a whole job. This thread has
                    // taken it: until `end`, the job stays where it is and no other thread accesses it. All
                    // of it was stored before its number.
                    unsafe {
                        let _using = SlotGuard::slots(self, (*task).slots);
                        ((*task).run)(task);
                    }
                    self.slots[slot].end(number);
                }
                backoff = Backoff::default();
            } else if backoff.rounds % 16 == 15 && rayon::yield_now() == Some(rayon::Yield::Executed) {
                backoff = Backoff::default();
            } else if !backoff.goes_on() {
                self.rest(&self.slots[slot], last);
                backoff = Backoff::default();
            }
        }
        status.presence.store(ABSENT, Ordering::Release);
    }

    /// Sleeps until a job after number `last` is offered, the thread is woken for other work, or the pool is
    /// over.
    ///
    /// An offer wakes the thread only if it sees that the thread sleeps (see `Slot::offer`).
    fn rest(&self, slot: &Slot, last: u64) {
        let Slot { inbox: Apart(inbox), status: Apart(status), .. } = slot;
        let mut sleep = self.sleep.lock().expect("nothing panics with the lock");
        status.presence.store(RESTING, Ordering::Relaxed);
        while inbox.number.load(Ordering::Acquire) == last
            && status.presence.load(Ordering::Relaxed) == RESTING
            && !self.over.load(Ordering::Acquire)
        {
            sleep = self.wake.wait(sleep).expect("nothing panics with the lock");
        }
        status.presence.store(AWAKE, Ordering::Release);
    }

    /// Wakes the threads that sleep at these slots. From now on they count as awake for whoever offers a job.
    fn wake<'p>(&self, slots: impl IntoIterator<Item = &'p Slot>) {
        let sleep = self.sleep.lock().expect("nothing panics with the lock");
        for Slot { status: Apart(status), .. } in slots {
            if status.presence.load(Ordering::Relaxed) == RESTING {
                status.presence.store(AWAKE, Ordering::Relaxed);
            }
        }
        drop(sleep);
        self.wake.notify_all();
    }

    /// `join` for a thread that owns the slots `first..end` and offers `b` at slot `k`, with
    /// `first < k < end`.
    ///
    /// The thread that runs `b` owns the slots `k..end` meanwhile, and this thread keeps `first..k`.
    fn join<A, B: Send>(
        &self,
        [first, k, end]: [usize; 3],
        a: impl FnOnce() -> A,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        /// Makes sure that no other thread accesses the job any more before it is dropped. Holds its number.
        struct End<'a>(&'a Slot, Option<u64>);
        impl End<'_> {
            fn reclaim(&mut self) -> bool {
                self.1.take().is_none_or(|number| self.0.reclaim(number))
            }
        }
        impl Drop for End<'_> {
            fn drop(&mut self) {
                self.reclaim();
            }
        }
        let slot = &self.slots[k];
        let job = Job::new(b, [k, end]);
        let task = (&raw const job).cast::<Task>();
        let left = slot.offer(task);
        let mut away = End(slot, left.map(|(number, _)| number));
        if left.is_some_and(|(_, rests)| rests) {
            self.wake([slot]);
        }
        let a = {
            let _using = SlotGuard::slots(self, [first, k]);
            a()
        };
        if away.reclaim() {
            let _using = SlotGuard::slots(self, [k, end]);
            // SAFETY: `task` points to `job`, which is alive and has this type. No other thread has it: it
            // was never offered, or has been taken back.
            unsafe { ((*task).run)(task) };
        }
        drop(away);
        match job.result.into_inner().expect("it has been done") {
            Ok(b) => (a, b),
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// Waits for a limited time without sleeping.
#[derive(Default)]
struct Backoff {
    rounds: u32,
    since: Option<Instant>,
}

impl Backoff {
    /// Waits for a moment. Returns false once [`PATIENCE`] is over.
    fn goes_on(&mut self) -> bool {
        self.rounds += 1;
        if self.rounds < 128 || !self.rounds.is_multiple_of(32) {
            spin_loop();
            return true;
        }
        // Other threads of this core go first.
        std::thread::yield_now();
        self.since.get_or_insert_with(Instant::now).elapsed() < PATIENCE
    }
}

/// Runs `a` on this thread and `b` on another one if possible. Returns both results.
///
/// `b` is offered at slot `k` of a spinning pool if this thread owns that slot. If it does not, this thread
/// runs `a` and then `b`. Outside of a spinning pool this is rayon's `join`.
pub fn join<A: Send, B: Send>(
    k: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    let Assignment { pool, slots: [first, end] } = ASSIGNMENT.get();
    // SAFETY: the pool outlives all assignments that point to it. `with_spinning_threads` drops its own
    // first, and waits for its threads, which drop theirs after every job.
    match unsafe { pool.as_ref() } {
        Some(pool) if first < k && k < end => pool.join([first, k, end], a, b),
        Some(_) => (a(), b()),
        None => rayon::join(a, b),
    }
}

/// Whether loops of this thread run in a spinning pool. Even small amounts of work are then worth sharing.
pub fn is_spinning() -> bool {
    !ASSIGNMENT.get().pool.is_null()
}

/// Wakes all sleeping threads of the pool, for work of rayon's.
pub fn wake() {
    // SAFETY: as in `join`.
    if let Some(pool) = unsafe { ASSIGNMENT.get().pool.as_ref() } {
        pool.wake(&pool.slots);
    }
}
