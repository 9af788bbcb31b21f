//! How the program was started: which rank of which MPI, how many cores and threads, and what ends all ranks when
//! one of them fails.

use crate::domain::{Comm, world};
use crate::error::Error;
use crate::math::instructions::InstructionSet;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Variables by which launchers tell a process how many of it there are.
const WORLD_SIZE: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"];
/// Variables by which launchers tell a process which one it is.
const WORLD_RANK: [&str; 4] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "MPI_LOCALRANKID"];
/// The same of srun, which does not tell whether the tasks of a step are to be ranks of one job.
const SLURM_STEP_SIZE: &str = "SLURM_STEP_NUM_TASKS";
const SLURM_RANK: &str = "SLURM_PROCID";

fn number(names: &[&str]) -> Option<usize> {
    names.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Whether this process speaks for the job before MPI has started.
pub fn speaks_first() -> bool {
    number(&WORLD_RANK).is_none_or(|rank| rank == 0)
}

/// Refuses to run when the launcher belongs to another MPI than the program, or the program was built without: it would
/// run as many times as there are ranks, and every copy would write the same file. The first copy says so.
pub fn check_launcher(world_size: usize) -> Result<(), Error> {
    let told = match number(&WORLD_SIZE) {
        Some(size) => [Some(size), number(&WORLD_RANK)],
        // srun sets these for every step. Where MPI has found its ranks they are as many, or parts of a larger job.
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

/// Prints with a single write, so that lines of several ranks never mix.
pub fn say(text: &str) {
    // Nobody is left to tell when stderr is gone.
    let _ = std::io::stderr().write_all(format!("{}\n", text.trim_end()).as_bytes());
}

/// Prints to stdout; a reader that has left, like `head`, is no failure.
pub fn print(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

/// Makes a panic one message that names the rank. Worker threads only print: MPI belongs to the main thread, which
/// ends the job when the panic reaches it. Several threads may panic at once; one message is enough.
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
    /// How many, the calling one among them.
    pub count: usize,
    /// Whether the ranks of this machine leave each of them a core.
    pub have_cores: bool,
    /// What to say where the rank is bound to a single core while others idle.
    pub warning: Option<String>,
}

/// Starts the threads of this rank: `--threads`, else RAYON_NUM_THREADS, else the cores that the ranks of this machine
/// may use divided by their number. The calling thread is one of them, so that loops start without a hand-over.
/// Collective.
pub fn start_threads(comm: &dyn Comm, wanted: Option<usize>) -> Result<Threads, Error> {
    let own = usable_cores();
    let mut all: Vec<f64> = own.iter().map(|&usable| f64::from(u8::from(usable))).collect();
    comm.max(&mut all);
    let count = |usable: usize| usable.max(1);
    let (own, all) =
        (count(own.iter().filter(|&&usable| usable).count()), count(all.iter().sum::<f64>() as usize));
    let ranks = comm.ranks_on_node();
    // A container may allow fewer cores at a time than it shows.
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
            "warning: this rank may use 1 of {} cores: mpirun binds each rank to one core unless told otherwise \
             (OMPI_MCA_hwloc_base_binding_policy=none, or source launch/env.sh)",
            online_cores()
        )
    });
    Ok(Threads { count: threads, have_cores: threads <= share, warning })
}

/// What to say where ranks sit on machines of different instruction sets, of which `common` is the one that all use.
pub fn mixed_machines_warning(common: InstructionSet, widest: InstructionSet) -> Option<String> {
    (common != widest).then(|| {
        format!(
            "warning: some ranks run {} instructions, others only {}: all use {}, which may be slower; equal bits are \
             tested for ranks on machines of one type",
            widest.name(),
            common.name(),
            common.name()
        )
    })
}

/// Which cores this process may run on.
fn usable_cores() -> Vec<bool> {
    let set = rustix::thread::sched_getaffinity(None).unwrap_or_default();
    (0..rustix::thread::CpuSet::MAX_CPU).map(|core| set.is_set(core)).collect()
}

/// Cores of this machine, whatever this process is bound to.
fn online_cores() -> usize {
    let list = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    let count = |range: &str| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Some(last.parse::<usize>().ok()? - first.parse::<usize>().ok()? + 1)
    };
    list.trim().split(',').filter_map(count).sum::<usize>().max(1)
}

/// Physical memory of this machine, bytes; none where the system does not tell.
pub fn physical_memory() -> u64 {
    let info = rustix::system::sysinfo();
    info.totalram as u64 * u64::from(info.mem_unit)
}

/// Largest memory that this process has held, bytes; 0 where the system does not tell.
pub fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|text| text.trim().trim_end_matches(" kB").trim().parse::<u64>().ok()).unwrap_or(0) * 1024
}
