//! Threads at posts. A thread that is awake between two parallel loops looks at a post of its own, where work is handed over
//! by plain stores, in a fraction of a microsecond; and a part of a loop always goes to the same post, in whose caches its
//! particles are: the one before the last to post 1, and so on; the last stays with whoever hands them out. He does not
//! wait until his other stores are seen everywhere: what he shows to others at the end of a loop travels while the next one
//! begins.
//!
//! At any time the posts at which a thread may offer work are its own alone: it hands some on with a part, and has them
//! back once that part is over, or taken back. So nobody else leaves anything meanwhile, and whatever has been left before
//! is over.

// Work lies on the stack of the thread that hands it over, and has a type that the one at the post does not know. It stays
// there until it has been done, or taken back: `End`, below, sees to it.
#![allow(unsafe_code)]

use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::hint::spin_loop;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU8, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

/// How long a thread looks out for work, or for another to end its own, before it sleeps: about what it takes to wake it.
const PATIENCE: Duration = Duration::from_micros(100);

/// How long it then sleeps at a time where nobody wakes it.
const NAP: Duration = Duration::from_micros(50);

/// One half of a `join`, as whoever does it knows it.
struct Task {
    run: unsafe fn(*const Task),
    /// The posts at which parts of it may be left: its own, and the one after the last.
    slots: [usize; 2],
}

/// A task with its work and its result. The task comes first: whoever has a pointer to that has one to all of it.
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
    /// `task` is that of an job of this type, which nobody else touches meanwhile.
    unsafe fn run(task: *const Task) {
        // SAFETY: the task is the first thing in the job, and nobody else touches it.
        let job = unsafe { &*task.cast::<Self>() };
        if let Some(work) = job.work.take() {
            let result = catch_unwind(AssertUnwindSafe(work));
            // SAFETY: as above.
            unsafe { *job.result.get() = Some(result) };
        }
    }
}

/// In lines of memory of its own, of which processors fetch two at a time.
#[repr(align(128))]
struct Apart<T>(T);

/// Where one thread looks out for work. At any time one other thread at most may offer some.
struct Slot {
    /// How many tasks have been left, for whoever leaves them.
    left: Apart<AtomicU64>,
    inbox: Apart<Inbox>,
    status: Apart<Status>,
}

/// What the thread at the post looks at.
struct Inbox {
    /// How many tasks have been left. Stored last.
    number: AtomicU64,
    /// The number of the last that somebody took up: whoever changes this does it.
    taken: AtomicU64,
    task: AtomicPtr<Task>,
}

/// What it tells.
struct Status {
    /// The number of the last task that is over.
    done: AtomicU64,
    presence: AtomicU8,
}

const ABSENT: u8 = 0;
const AWAKE: u8 = 1;
const RESTING: u8 = 2;

impl Slot {
    /// Nobody is there.
    fn new() -> Self {
        let inbox = Inbox {
            number: AtomicU64::new(0),
            taken: AtomicU64::new(0),
            task: AtomicPtr::new(ptr::null_mut()),
        };
        let status = Status { done: AtomicU64::new(0), presence: AtomicU8::new(ABSENT) };
        Slot { left: Apart(AtomicU64::new(0)), inbox: Apart(inbox), status: Apart(status) }
    }

    /// Leaves a task, unless nobody is there. Returns its number, and whether somebody seems to sleep. A thread that falls asleep
    /// at this moment may go unseen, as may one that is at some work of rayon's: the task is then taken back.
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

    /// Whether this thread is to do the task of this number.
    fn take(&self, number: u64) -> bool {
        let taken = &self.inbox.0.taken;
        taken.compare_exchange(number - 1, number, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }

    fn end(&self, number: u64) {
        self.status.0.done.store(number, Ordering::Release);
    }

    /// Takes the task of this number back, or waits until it is over. Returns whether it is this thread's again.
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

/// All threads of a pool, during `with_spinning_threads`.
struct SpinningPool {
    /// The first is nobody's: the last part of a loop is done by who hands out the others.
    slots: Vec<Slot>,
    over: AtomicBool,
    /// Sleepers look at their posts with the lock.
    sleep: Mutex<()>,
    wake: Condvar,
}

/// What a thread may use: the pool to which it belongs, and the posts from the first, its own, to before the second.
#[derive(Clone, Copy)]
struct Assignment {
    pool: *const SpinningPool,
    slots: [usize; 2],
}

thread_local! {
    static ASSIGNMENT: Cell<Assignment> = const { Cell::new(Assignment { pool: ptr::null(), slots: [0; 2] }) };
}

/// Lets this thread use certain posts until it is dropped.
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

/// Does `work` while the other threads of the pool are at their posts, and stay awake for a while each time. To be called
/// where the ranks of this machine have a core for every thread: on shared cores they would take time from others. Within
/// it there is none but this one.
pub fn with_spinning_threads<A>(work: impl FnOnce() -> A) -> A {
    /// Ends the attendance, also where `work` panics.
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
    /// Takes up work at a post until there is no more.
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
                    // SAFETY: this thread has taken it up: it is where it was, and nobody else touches it, until it is over. All
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

    /// Sleeps until there is work at the post after that with the number `last`, or a call.
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

    /// Wakes those that sleep at some posts. They are awake from now on for whoever leaves work there.
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

    /// `join` where this thread may use the post `k` and those up to before `end`.
    fn join<A, B: Send>(
        &self,
        [first, k, end]: [usize; 3],
        a: impl FnOnce() -> A,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        /// Sees to it that nobody touches an job any more before it is dropped. Returns whether it is still to be done.
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
            // SAFETY: it is of this type, and nobody else's.
            unsafe { ((*task).run)(task) };
        }
        drop(away);
        match job.result.into_inner().expect("it has been done") {
            Ok(b) => (a, b),
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// A wait without sleep, which ends by itself.
#[derive(Default)]
struct Backoff {
    rounds: u32,
    since: Option<Instant>,
}

impl Backoff {
    /// Passes a moment; false once it has been too many.
    fn goes_on(&mut self) -> bool {
        self.rounds += 1;
        if self.rounds < 128 || !self.rounds.is_multiple_of(32) {
            spin_loop();
            return true;
        }
        // Whoever shares this core goes first.
        std::thread::yield_now();
        self.since.get_or_insert_with(Instant::now).elapsed() < PATIENCE
    }
}

/// Does `a` and `b`, the latter, whose last part belongs to post `k`, by another thread if one is free.
pub fn join<A: Send, B: Send>(
    k: usize,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    let Assignment { pool, slots: [first, end] } = ASSIGNMENT.get();
    // SAFETY: a pool lives longer than the memberships: `with_spinning_threads` waits for its threads, and gives up its own before.
    match unsafe { pool.as_ref() } {
        Some(pool) if first < k && k < end => pool.join([first, k, end], a, b),
        Some(_) => (a(), b()),
        None => rayon::join(a, b),
    }
}

/// The other threads are at their posts: little work is worth sharing.
pub fn is_spinning() -> bool {
    !ASSIGNMENT.get().pool.is_null()
}

/// Wakes those who rest: there is work for any thread.
pub fn wake() {
    // SAFETY: as in `join`.
    if let Some(pool) = unsafe { ASSIGNMENT.get().pool.as_ref() } {
        pool.wake(&pool.slots);
    }
}
