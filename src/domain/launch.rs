//! How the program was started and how it prints: the launcher and its ranks, threads and cores, memory, and
//! messages that ranks do not mix.

use crate::domain::{Comm, world};
use crate::error::Error;
use crate::math::instructions::InstructionSet;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Environment variables in which launchers give the number of ranks.
const WORLD_SIZE: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"];
/// Environment variables in which launchers give the rank of this process.
const WORLD_RANK: [&str; 4] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "MPI_LOCALRANKID"];
/// The same for srun, which sets them for every step: they do not show that its tasks are ranks of one job.
const SLURM_STEP_SIZE: &str = "SLURM_STEP_NUM_TASKS";
const SLURM_RANK: &str = "SLURM_PROCID";

fn number(names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Whether this process prints messages for the whole job before MPI has started.
///
/// It does if it is rank 0, or if no launcher gives a rank.
pub fn speaks_first() -> bool {
    number(&WORLD_RANK).is_none_or(|rank| rank == 0)
}

/// Fails if the launcher started another number of ranks than the `world_size` that the program sees.
///
/// That happens if the launcher belongs to another MPI than the program, or if the program was built without
/// MPI. Each rank would run the whole scene and write the same file. The first one reports the error.
pub fn check_launcher(world_size: usize) -> Result<(), Error> {
    let told = match number(&WORLD_SIZE) {
        Some(size) => [Some(size), number(&WORLD_RANK)],
        // srun sets these for every step. They count only if MPI sees a single rank: with several, MPI works,
        // and the numbers may be those of a larger job.
        None => [SLURM_STEP_SIZE, SLURM_RANK].map(|name| number(&[name]).filter(|_| world_size == 1)),
    };
    match told {
        [Some(started), rank] if started != world_size => {
            if rank.is_some_and(|rank| rank > 0) {
                return Err(Error::Elsewhere { code: Error::Input(String::new()).exit_code() });
            }
            let why = world::foreign_launcher(world_size);
            Err(Error::Input(format!("the launcher started {started} ranks, {why}")))
        }
        _ => Ok(()),
    }
}

/// Prints a line to stderr with a single write, so that the lines of several ranks never mix.
pub fn say(text: &str) {
    // If stderr is closed, there is nowhere to report that.
    let _ = std::io::stderr().write_all(format!("{}\n", text.trim_end()).as_bytes());
}

/// Makes a panic print one message that names the rank.
///
/// The panicking thread only prints. Only the main thread may call MPI; it aborts the job when the panic
/// reaches it. If several threads panic, the first one prints.
pub fn report_panics(rank: usize) {
    let told = AtomicBool::new(false);
    std::panic::set_hook(Box::new(move |panic| {
        if told.swap(true, Ordering::Relaxed) {
            return;
        }
        let place = panic.location().map(|at| format!(" at {}:{}", at.file(), at.line())).unwrap_or_default();
        let text = panic
            .payload()
            .downcast_ref::<&str>()
            .map(ToString::to_string)
            .or_else(|| panic.payload().downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "unknown cause".into());
        say(&format!("demhybrid: internal error on rank {rank}{place}: {text}"));
    }));
}

/// The threads of this rank.
pub struct Threads {
    /// Number of threads, including the calling one.
    pub count: usize,
    /// Whether there is a core for each of them, given the other ranks on this machine.
    pub have_cores: bool,
    /// A warning to print if this rank is bound to a single core while other cores are free.
    pub warning: Option<String>,
}

/// Starts the threads of this rank. Collective.
///
/// Their number is `wanted` (`--threads`), else RAYON_NUM_THREADS, else the share of this rank: the cores
/// that the ranks of this machine may use, divided by the number of these ranks.
///
/// The calling thread is one of them, so that a loop can start on it at once.
pub fn start_threads(comm: &dyn Comm, wanted: Option<usize>) -> Result<Threads, Error> {
    let own = usable_cores();
    let mut all: Vec<f64> = own.iter().map(|&usable| f64::from(u8::from(usable))).collect();
    comm.max(&mut all);
    let count = |usable: usize| usable.max(1);
    let (own, all) =
        (count(own.iter().filter(|&&usable| usable).count()), count(all.iter().sum::<f64>() as usize));
    let ranks = comm.ranks_on_node();
    // A container may show more cores than it allows to be used at a time.
    let allowed = thread::available_parallelism().map_or(own, usize::from);
    let quota = if allowed < own { allowed } else { all };
    let share = (quota.min(all) / ranks).clamp(1, own);
    let environment = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse().ok()).filter(|&n| n > 0);
    let threads = wanted.or(environment).unwrap_or(share);
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .use_current_thread()
        .build_global()
        .map_err(|why| Error::Input(format!("--threads {threads}: the threads cannot be started: {why}")))?;
    let bound = number(&WORLD_SIZE).is_some() && own == 1 && online_cores() > ranks;
    let warning = bound.then(|| {
        format!(
            "warning: this rank may use 1 of {} cores: mpirun binds each rank to one core unless told \
             otherwise (OMPI_MCA_hwloc_base_binding_policy=none, or source launch/env.sh)",
            online_cores()
        )
    });
    Ok(Threads { count: threads, have_cores: threads <= share, warning })
}

/// A warning if ranks run on machines with different instruction sets.
///
/// `common` is the set that all ranks use, `widest` the widest that any rank could use.
pub fn mixed_machines_warning(common: InstructionSet, widest: InstructionSet) -> Option<String> {
    (common != widest).then(|| {
        format!(
            "warning: some ranks run {} instructions, others only {}: all use {}, which may be slower; equal \
             bits are tested for ranks on machines of one type",
            widest.name(),
            common.name(),
            common.name()
        )
    })
}

/// Which cores this process may run on.
#[cfg(target_os = "linux")]
fn usable_cores() -> Vec<bool> {
    let set = rustix::thread::sched_getaffinity(None).unwrap_or_default();
    (0..rustix::thread::CpuSet::MAX_CPU).map(|core| set.is_set(core)).collect()
}

/// Which cores this process may run on: where the system does not tell, as many as the process may use.
#[cfg(not(target_os = "linux"))]
fn usable_cores() -> Vec<bool> {
    vec![true; online_cores()]
}

/// Number of cores of this machine, whether or not this process may use them.
#[cfg(target_os = "linux")]
fn online_cores() -> usize {
    let list = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    let count = |range: &str| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Some(last.parse::<usize>().ok()? - first.parse::<usize>().ok()? + 1)
    };
    list.trim().split(',').filter_map(count).sum::<usize>().max(1)
}

/// Number of cores that this process may use.
#[cfg(not(target_os = "linux"))]
fn online_cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Physical memory of this machine, bytes.
#[cfg(target_os = "linux")]
pub fn physical_memory() -> u64 {
    let info = rustix::system::sysinfo();
    info.totalram as u64 * u64::from(info.mem_unit)
}

/// Physical memory of this machine, bytes: 0, which is unknown.
#[cfg(not(target_os = "linux"))]
pub fn physical_memory() -> u64 {
    0
}

/// Peak memory of this process, bytes; 0 if the system does not report it.
pub fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|text| text.trim().trim_end_matches(" kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}
