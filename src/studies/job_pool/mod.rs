//! Distributes independent runs over ranks and threads, and gives the results to all ranks.

pub mod run;

use crate::domain::agreement::agree;
use crate::domain::{Comm, comm::Parcels, launch};
use crate::error::Error;
use fail::fail_point;
use serde::Serialize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The work that one run takes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Work {
    /// Evaluations of the right-hand side.
    pub rhs_evaluations: u64,
    /// Pairs evaluated in all right-hand sides.
    pub pair_evaluations: u64,
    /// Steps accepted.
    pub steps_accepted: u64,
    /// Steps rejected.
    pub steps_rejected: u64,
    /// Processor time of the thread that ran the job, s.
    pub core_seconds: f64,
}

/// The result of a job.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sample {
    /// The work it took.
    pub work: Work,
    /// Why it ended early, or `None`.
    pub failure: Option<String>,
    /// Its results, in an order that the study defines. After a failure some may be missing.
    pub numbers: Vec<f64>,
}

impl Sample {
    /// Result number `k`; NaN if the job ended before it.
    pub fn number(&self, k: usize) -> f64 {
        self.numbers.get(k).copied().unwrap_or(f64::NAN)
    }
}

/// The ranks and threads that run jobs.
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::studies::job_pool::{JobPool, Sample};
///
/// let pool = JobPool { comm: &Solo, threads: 2, quiet: true };
/// let samples = pool.run("squares", &[1.0, 2.0, 3.0], |x: &f64| Sample {
///     numbers: vec![x * x],
///     ..Sample::default()
/// });
/// assert_eq!(samples.iter().map(|sample| sample.number(0)).collect::<Vec<f64>>(), [1.0, 4.0, 9.0]);
/// assert!(samples[0].number(1).is_nan()); // there is no second number
/// ```
pub struct JobPool<'a> {
    /// The ranks. Job k runs on rank k modulo the number of ranks.
    pub comm: &'a dyn Comm,
    /// Threads of this rank. Each thread runs one job at a time.
    pub threads: usize,
    /// Whether to print no lines about progress.
    pub quiet: bool,
}

/// Shortest time between two lines about progress.
const PATIENCE: Duration = Duration::from_secs(3);

impl<'a> JobPool<'a> {
    /// Starts the threads of every rank: `threads` of them, or as many as its cores allow. Collective.
    ///
    /// Prints a warning if rank 0 is bound to a single core although others are free.
    pub fn start(comm: &'a dyn Comm, threads: Option<usize>, quiet: bool) -> Result<Self, Error> {
        launch::check_launcher(comm.size())?;
        let threads = agree(comm, launch::start_threads(comm, threads))?;
        if let (0, Some(warning)) = (comm.rank(), threads.warning) {
            launch::say(&warning);
        }
        Ok(JobPool { comm, threads: threads.count, quiet })
    }
}

impl JobPool<'_> {
    /// Runs all `jobs` and returns their samples in the order of the jobs, on every rank. Collective.
    ///
    /// `what` names the jobs in lines about progress.
    pub fn run<J: Sync>(&self, what: &str, jobs: &[J], work: impl Fn(&J) -> Sample + Sync) -> Vec<Sample> {
        let (rank, size) = (self.comm.rank(), self.comm.size());
        let own: Vec<&J> = jobs.iter().skip(rank).step_by(size).collect();
        let progress = Progress::new(self, what, jobs.len(), own.len());
        let samples = take_turns(self.threads, &own, |job| {
            fail_point!("job", |_| Sample::default());
            let sample = timed(|| work(job));
            progress.done();
            sample
        });
        let mut all: Vec<std::vec::IntoIter<Sample>> =
            gather(self.comm, &samples).into_iter().map(Vec::into_iter).collect();
        (0..jobs.len()).map(|k| all[k % size].next().expect("every rank did all of its jobs")).collect()
    }

    /// Prints a line about what comes next, on rank 0 and unless the pool is quiet.
    pub fn tell(&self, text: &str) {
        if self.comm.rank() == 0 && !self.quiet {
            launch::say(text);
        }
    }
}

/// Runs the jobs on `threads` threads. Each thread takes the next job that is free.
///
/// Parallel loops inside a job run on one thread.
fn take_turns<J: Sync>(threads: usize, jobs: &[J], work: impl Fn(&J) -> Sample + Sync) -> Vec<Sample> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(vec![None; jobs.len()]);
    let worker = || {
        // After a panic no thread starts another job, because the program is about to end.
        let _stop = StopAtPanic(&next);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
        loop {
            // This cannot overflow: each thread adds at most one job too many, a panic stores usize::MAX / 2.
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(k) else { return };
            let sample = alone.install(|| work(job));
            done.lock().expect("no thread panics with the results in its hand")[k] = Some(sample);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(jobs.len()) {
            scope.spawn(worker);
        }
    });
    let done = done.into_inner().expect("no thread panics with the results in its hand");
    done.into_iter().map(|sample| sample.expect("all jobs were taken")).collect()
}

struct StopAtPanic<'a>(&'a AtomicUsize);

impl Drop for StopAtPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(usize::MAX / 2, Ordering::Relaxed);
        }
    }
}

/// Runs the job and measures the processor time of this thread.
fn timed(work: impl FnOnce() -> Sample) -> Sample {
    let clock = || {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    let started = clock();
    let mut sample = work();
    sample.work.core_seconds = clock() - started;
    sample
}

/// The samples of all ranks, by rank. Collective.
fn gather(comm: &dyn Comm, own: &[Sample]) -> Vec<Vec<Sample>> {
    let (rank, size) = (comm.rank(), comm.size());
    let message = packed(own);
    // Every other rank gets the same message. This rank sends nothing to itself.
    let length = |other: usize| if other == rank { 0 } else { message.len() as u64 };
    let lengths: Vec<u64> = (0..size).map(length).collect();
    let mut incoming = Parcels::with_counts(&comm.transpose(&lengths));
    let mut outgoing = Parcels::with_counts(&lengths);
    if !message.is_empty() {
        outgoing.data.chunks_exact_mut(message.len()).for_each(|copy| copy.copy_from_slice(&message));
    }
    comm.exchange(&outgoing, &mut incoming);
    let mut all = vec![Vec::new(); size];
    all[rank] = own.to_vec();
    incoming.iter().for_each(|(other, parcel)| all[other] = unpacked(parcel));
    all
}

/// Packs samples into one list of numbers.
fn packed(samples: &[Sample]) -> Vec<f64> {
    let mut list = Vec::new();
    for Sample { work, failure, numbers } in samples {
        let counts = [work.rhs_evaluations, work.pair_evaluations, work.steps_accepted, work.steps_rejected];
        // Counts below 2^53 are exact in f64.
        list.extend(counts.map(|count| count as f64));
        let why = failure.as_deref().unwrap_or_default();
        let failed = f64::from(u8::from(failure.is_some()));
        list.extend([work.core_seconds, failed, why.len() as f64, numbers.len() as f64]);
        list.extend(why.bytes().map(f64::from));
        list.extend(numbers);
    }
    list
}

/// Count of numbers in a packed sample before its text and its results.
const HEAD: usize = 8;

/// The inverse of `packed`.
fn unpacked(mut list: &[f64]) -> Vec<Sample> {
    let mut samples = Vec::new();
    while let [rhs, pairs, accepted, rejected, core_seconds, failed, text, numbers, ..] = *list {
        let (text, rest) = list[HEAD..].split_at(text as usize);
        let (numbers, rest) = rest.split_at(numbers as usize);
        let bytes: Vec<u8> = text.iter().map(|&byte| byte as u8).collect();
        samples.push(Sample {
            work: Work {
                rhs_evaluations: rhs as u64,
                pair_evaluations: pairs as u64,
                steps_accepted: accepted as u64,
                steps_rejected: rejected as u64,
                core_seconds,
            },
            failure: (failed > 0.0).then(|| String::from_utf8_lossy(&bytes).into_owned()),
            numbers: numbers.to_vec(),
        });
        list = rest;
    }
    samples
}

/// Prints how many jobs are done. Threads share it.
struct Progress<'a> {
    speaks: bool,
    what: &'a str,
    own: usize,
    whose: &'static str,
    state: Mutex<(usize, Instant)>,
}

impl<'a> Progress<'a> {
    fn new(pool: &JobPool, what: &'a str, all: usize, own: usize) -> Self {
        let speaks = pool.comm.rank() == 0 && !pool.quiet;
        if speaks {
            launch::say(&format!("{what}: {all} runs"));
        }
        let whose = if pool.comm.size() > 1 { " of this rank" } else { "" };
        Progress { speaks, what, own, whose, state: Mutex::new((0, Instant::now())) }
    }

    /// Counts one more job as done.
    fn done(&self) {
        let Ok(mut state) = self.state.lock() else { return };
        state.0 += 1;
        if self.speaks && state.1.elapsed() > PATIENCE {
            state.1 = Instant::now();
            launch::say(&format!("{}: {} of {} runs{} done", self.what, state.0, self.own, self.whose));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;
    use crate::domain::comm::team::team;

    fn work(job: &u64) -> Sample {
        Sample {
            work: Work { rhs_evaluations: job * job, ..Work::default() },
            failure: (job % 3 == 1).then(|| format!("job {job} řekl: nan")),
            numbers: (0..job % 4).map(|k| if k == 2 { f64::NAN } else { (k as f64).exp() }).collect(),
        }
    }

    /// The samples with numbers as bits, because NaN does not equal itself.
    fn bits(samples: &[Sample]) -> Vec<(u64, Option<String>, Vec<u64>)> {
        let of = |sample: &Sample| {
            let numbers = sample.numbers.iter().map(|number| number.to_bits()).collect();
            (sample.work.rhs_evaluations, sample.failure.clone(), numbers)
        };
        samples.iter().map(of).collect()
    }

    #[test]
    fn samples_come_in_the_order_of_the_jobs_from_any_number_of_ranks_and_threads() {
        let jobs: Vec<u64> = (0..11).collect();
        let expected: Vec<Sample> = jobs.iter().map(work).collect();
        for (ranks, threads) in [(1, 1), (1, 3), (2, 2), (3, 1), (13, 1)] {
            team(ranks, |comm| {
                let pool = JobPool { comm, threads, quiet: true };
                assert_eq!(bits(&pool.run("test", &jobs, work)), bits(&expected));
                assert_eq!(pool.run("nothing", &[], work), []);
            });
        }
    }

    #[test]
    fn a_job_runs_its_loops_on_one_thread() {
        let pool = JobPool { comm: &Solo, threads: 2, quiet: true };
        let samples = pool.run("test", &[(); 4], |()| Sample {
            numbers: vec![rayon::current_num_threads() as f64],
            ..Sample::default()
        });
        assert!(samples.iter().all(|sample| sample.numbers == [1.0]));
    }

    #[test]
    #[should_panic(expected = "scoped thread panicked")]
    fn a_panic_in_a_job_reaches_the_caller() {
        let pool = JobPool { comm: &Solo, threads: 2, quiet: true };
        pool.run("test", &[1, 2, 3], |&job| {
            assert!(job != 2, "a bug");
            work(&job)
        });
    }
}
