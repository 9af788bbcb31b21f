//! Threads at posts. A thread that is awake between two parallel loops looks at a post of its own, where work is handed over
//! by plain stores, in a fraction of a microsecond; and a part of a loop always goes to the same post, in whose caches its
//! particles are: the one before the last to post 1, and so on; the last stays with whoever hands them out. He does not
//! wait until his other stores are seen everywhere: what he shows to others at the end of a loop travels while the next one
//! begins.
//!
//! At any time the posts at which a thread may leave work are its own alone: it hands some on with a part, and has them
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
    posts: [usize; 2],
}

/// A task with its work and its result. The task comes first: whoever has a pointer to that has one to all of it.
#[repr(C)]
struct Errand<F, R> {
    task: Task,
    work: Cell<Option<F>>,
    result: UnsafeCell<Option<Result<R, Box<dyn Any + Send>>>>,
}

impl<F: FnOnce() -> R, R> Errand<F, R> {
    fn new(work: F, posts: [usize; 2]) -> Self {
        let task = Task { run: Self::run, posts };
        Errand { task, work: Cell::new(Some(work)), result: UnsafeCell::new(None) }
    }

    /// # Safety
    /// `task` is that of an errand of this type, which nobody else touches meanwhile.
    unsafe fn run(task: *const Task) {
        // SAFETY: the task is the first thing in the errand, and nobody else touches it.
        let errand = unsafe { &*task.cast::<Self>() };
        if let Some(work) = errand.work.take() {
            let result = catch_unwind(AssertUnwindSafe(work));
            // SAFETY: as above.
            unsafe { *errand.result.get() = Some(result) };
        }
    }
}

/// In lines of memory of its own, of which processors fetch two at a time.
#[repr(align(128))]
struct Apart<T>(T);

/// Where one thread looks out for work. At any time one other thread at most may leave some.
struct Post {
    /// How many tasks have been left, for whoever leaves them.
    left: Apart<AtomicU64>,
    order: Apart<Order>,
    news: Apart<News>,
}

/// What the thread at the post looks at.
struct Order {
    /// How many tasks have been left. Stored last.
    number: AtomicU64,
    /// The number of the last that somebody took up: whoever changes this does it.
    taken: AtomicU64,
    task: AtomicPtr<Task>,
}

/// What it tells.
struct News {
    /// The number of the last task that is over.
    done: AtomicU64,
    presence: AtomicU8,
}

const ABSENT: u8 = 0;
const AWAKE: u8 = 1;
const RESTING: u8 = 2;

impl Post {
    /// Nobody is there.
    fn new() -> Self {
        let order = Order {
            number: AtomicU64::new(0),
            taken: AtomicU64::new(0),
            task: AtomicPtr::new(ptr::null_mut()),
        };
        let news = News { done: AtomicU64::new(0), presence: AtomicU8::new(ABSENT) };
        Post { left: Apart(AtomicU64::new(0)), order: Apart(order), news: Apart(news) }
    }

    /// Leaves a task, unless nobody is there. Returns its number, and whether somebody seems to sleep. A thread that falls asleep
    /// at this moment may go unseen, as may one that is at some work of rayon's: the task is then taken back.
    fn leave(&self, task: *const Task) -> Option<(u64, bool)> {
        let left = self.left.0.load(Ordering::Relaxed);
        let presence = self.news.0.presence.load(Ordering::Relaxed);
        if presence == ABSENT {
            return None;
        }
        debug_assert_eq!(self.news.0.done.load(Ordering::Relaxed), left, "one task at a time");
        let number = left + 1;
        self.left.0.store(number, Ordering::Relaxed);
        self.order.0.task.store(task.cast_mut(), Ordering::Relaxed);
        self.order.0.number.store(number, Ordering::Release);
        Some((number, presence == RESTING))
    }

    /// Whether this thread is to do the task of this number.
    fn take(&self, number: u64) -> bool {
        let taken = &self.order.0.taken;
        taken.compare_exchange(number - 1, number, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }

    fn end(&self, number: u64) {
        self.news.0.done.store(number, Ordering::Release);
    }

    /// Takes the task of this number back, or waits until it is over. Returns whether it is this thread's again.
    fn call_in(&self, number: u64) -> bool {
        let done = || self.news.0.done.load(Ordering::Acquire) == number;
        if done() {
            return false;
        }
        if self.order.0.taken.load(Ordering::Relaxed) != number && self.take(number) {
            self.end(number);
            return true;
        }
        let mut watch = Monitor::default();
        while !done() {
            if !watch.goes_on() {
                std::thread::sleep(NAP);
            }
        }
        false
    }
}

/// All threads of a pool, during `attended`.
struct Crew {
    /// The first is nobody's: the last part of a loop is done by who hands out the others.
    posts: Vec<Post>,
    over: AtomicBool,
    /// Sleepers look at their posts with the lock.
    sleep: Mutex<()>,
    wake: Condvar,
}

/// What a thread may use: the crew to which it belongs, and the posts from the first, its own, to before the second.
#[derive(Clone, Copy)]
struct Membership {
    crew: *const Crew,
    posts: [usize; 2],
}

thread_local! {
    static MEMBERSHIP: Cell<Membership> = const { Cell::new(Membership { crew: ptr::null(), posts: [0; 2] }) };
}

/// Lets this thread use certain posts until it is dropped.
struct Using(Membership);

impl Using {
    fn posts(crew: &Crew, posts: [usize; 2]) -> Self {
        Using(MEMBERSHIP.replace(Membership { crew, posts }))
    }
}

impl Drop for Using {
    fn drop(&mut self) {
        MEMBERSHIP.set(self.0);
    }
}

/// Does `work` while the other threads of the pool are at their posts, and stay awake for a while each time. To be called
/// where the ranks of this machine have a core for every thread: on shared cores they would take time from others. Within
/// it there is none but this one.
pub fn attended<A>(work: impl FnOnce() -> A) -> A {
    /// Ends the attendance, also where `work` panics.
    struct End<'a>(&'a Crew);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.over.store(true, Ordering::Release);
            self.0.wake(&self.0.posts);
        }
    }
    let threads = rayon::current_num_threads();
    let home = rayon::current_thread_index().filter(|_| threads > 1 && !is_attended());
    let Some(home) = home else {
        return work();
    };
    let posts = (0..threads).map(|_| Post::new()).collect();
    let crew = Crew { posts, over: AtomicBool::new(false), sleep: Mutex::new(()), wake: Condvar::new() };
    let crew = &crew;
    rayon::in_place_scope(|scope| {
        let _end = End(crew);
        let _using = Using::posts(crew, [0, threads]);
        scope.spawn_broadcast(move |_, context| {
            let index = context.index();
            if index != home {
                crew.attend(if index < home { index + 1 } else { index });
            }
        });
        work()
    })
}

impl Crew {
    /// Takes up work at a post until there is no more.
    fn attend(&self, post: usize) {
        let Post { order: Apart(order), news: Apart(news), .. } = &self.posts[post];
        let mut last = 0;
        news.presence.store(AWAKE, Ordering::Release);
        let mut watch = Monitor::default();
        while !self.over.load(Ordering::Acquire) {
            let number = order.number.load(Ordering::Acquire);
            if number != last {
                last = number;
                if self.posts[post].take(number) {
                    let task = order.task.load(Ordering::Relaxed);
                    // SAFETY: this thread has taken it up: it is where it was, and nobody else touches it, until it is over. All
                    // of it was stored before its number.
                    unsafe {
                        let _using = Using::posts(self, (*task).posts);
                        ((*task).run)(task);
                    }
                    self.posts[post].end(number);
                }
                watch = Monitor::default();
            } else if watch.rounds % 16 == 15 && rayon::yield_now() == Some(rayon::Yield::Executed) {
                watch = Monitor::default();
            } else if !watch.goes_on() {
                self.rest(&self.posts[post], last);
                watch = Monitor::default();
            }
        }
        news.presence.store(ABSENT, Ordering::Release);
    }

    /// Sleeps until there is work at the post after that with the number `last`, or a call.
    fn rest(&self, post: &Post, last: u64) {
        let Post { order: Apart(order), news: Apart(news), .. } = post;
        let mut sleep = self.sleep.lock().expect("nothing panics with the lock");
        news.presence.store(RESTING, Ordering::Relaxed);
        while order.number.load(Ordering::Acquire) == last
            && news.presence.load(Ordering::Relaxed) == RESTING
            && !self.over.load(Ordering::Acquire)
        {
            sleep = self.wake.wait(sleep).expect("nothing panics with the lock");
        }
        news.presence.store(AWAKE, Ordering::Release);
    }

    /// Wakes those that sleep at some posts. They are awake from now on for whoever leaves work there.
    fn wake<'p>(&self, posts: impl IntoIterator<Item = &'p Post>) {
        let sleep = self.sleep.lock().expect("nothing panics with the lock");
        for Post { news: Apart(news), .. } in posts {
            if news.presence.load(Ordering::Relaxed) == RESTING {
                news.presence.store(AWAKE, Ordering::Relaxed);
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
        /// Sees to it that nobody touches an errand any more before it is dropped. Returns whether it is still to be done.
        struct End<'a>(&'a Post, Option<u64>);
        impl End<'_> {
            fn call_in(&mut self) -> bool {
                self.1.take().is_none_or(|number| self.0.call_in(number))
            }
        }
        impl Drop for End<'_> {
            fn drop(&mut self) {
                self.call_in();
            }
        }
        let post = &self.posts[k];
        let errand = Errand::new(b, [k, end]);
        let task = (&raw const errand).cast::<Task>();
        let left = post.leave(task);
        let mut away = End(post, left.map(|(number, _)| number));
        if left.is_some_and(|(_, rests)| rests) {
            self.wake([post]);
        }
        let a = {
            let _using = Using::posts(self, [first, k]);
            a()
        };
        if away.call_in() {
            let _using = Using::posts(self, [k, end]);
            // SAFETY: it is of this type, and nobody else's.
            unsafe { ((*task).run)(task) };
        }
        drop(away);
        match errand.result.into_inner().expect("it has been done") {
            Ok(b) => (a, b),
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// A wait without sleep, which ends by itself.
#[derive(Default)]
struct Monitor {
    rounds: u32,
    since: Option<Instant>,
}

impl Monitor {
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
    let Membership { crew, posts: [first, end] } = MEMBERSHIP.get();
    // SAFETY: a crew lives longer than the memberships: `attended` waits for its threads, and gives up its own before.
    match unsafe { crew.as_ref() } {
        Some(crew) if first < k && k < end => crew.join([first, k, end], a, b),
        Some(_) => (a(), b()),
        None => rayon::join(a, b),
    }
}

/// The other threads are at their posts: little work is worth sharing.
pub fn is_attended() -> bool {
    !MEMBERSHIP.get().crew.is_null()
}

/// Wakes those who rest: there is work for any thread.
pub fn wake() {
    // SAFETY: as in `join`.
    if let Some(crew) = unsafe { MEMBERSHIP.get().crew.as_ref() } {
        crew.wake(&crew.posts);
    }
}
