//! Interrupts of a run, as one rank receives them: signals, the clock and the stop file.

use crate::error::StopRequest;
use crate::files::checkpoint;
use crate::scene::Scene;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;
use std::cell::Cell;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Signals that stop a run. People and batch systems send them, and SIGHUP a terminal that is closed.
const SIGNALS: [i32; 4] = [SIGTERM, SIGINT, SIGUSR1, SIGHUP];
/// Another signal ends the process if it comes at least this long after the first one.
const IMPATIENCE: Duration = Duration::from_secs(1);
/// Time between two looks for the stop file. A look may take long on a shared file system.
const LOOK: Duration = Duration::from_millis(200);

/// Everything that may stop a run or request a checkpoint.
#[derive(Debug)]
pub struct Interrupts {
    /// Number of the first signal; 0 if none has come.
    signal: Arc<AtomicUsize>,
    /// Whether this is rank 0, the only rank that reads the clock and looks for the stop file.
    leads: bool,
    /// When the run began in this process.
    started: Instant,
    /// Wall time after which the run stops, s; infinite without a limit.
    limit: f64,
    /// Wall time between checkpoints, s; infinite if the scene sets none.
    between_checkpoints: f64,
    /// When the last checkpoint was written.
    saved: Cell<Instant>,
    stop_file: PathBuf,
    /// When rank 0 last looked for the stop file.
    looked: Cell<Instant>,
}

impl Interrupts {
    /// Interrupts for a run of `scene` that writes to `output` and began at `started`.
    ///
    /// From now on the first signal does not end the process. A signal at least one second later does.
    pub fn listen(scene: &Scene, output: &Path, rank: usize, started: Instant) -> io::Result<Self> {
        let signal = Arc::new(AtomicUsize::new(0));
        let heeded = SIGNALS.into_iter().filter(|&number| number != SIGHUP || !is_ignored(number));
        let (mut signals, heard) = (Signals::new(heeded)?, Arc::clone(&signal));
        // One stop request may come as several signals at once, from the batch system and from mpirun.
        thread::Builder::new().name("signals".into()).spawn(move || {
            let mut first = None;
            for number in signals.forever() {
                match first {
                    None => {
                        first = Some(Instant::now());
                        heard.store(number as usize, Ordering::Relaxed);
                    }
                    Some(then) if then.elapsed() >= IMPATIENCE => {
                        // This ends the process, unless even that is not allowed.
                        let _ = emulate_default_handler(number);
                    }
                    Some(_) => {}
                }
            }
        })?;
        Ok(Interrupts { signal, ..Interrupts::deaf(scene, output, rank, started) })
    }

    /// The same, but without a thread that waits for signals.
    fn deaf(scene: &Scene, output: &Path, rank: usize, started: Instant) -> Self {
        let limit = scene.limits.as_ref().and_then(|keys| keys.wall);
        let wall = scene.checkpoint.as_ref().and_then(|keys| keys.wall);
        Interrupts {
            signal: Arc::default(),
            leads: rank == 0,
            started,
            limit: limit.unwrap_or(f64::INFINITY),
            between_checkpoints: wall.unwrap_or(f64::INFINITY),
            saved: Cell::new(started),
            stop_file: checkpoint::stop_file(output),
            looked: Cell::new(started),
        }
    }

    /// What this rank requests now; the ranks then agree on one request.
    pub fn request(&self) -> StopRequest {
        if let Ok(number @ 1..) = u8::try_from(self.signal.load(Ordering::Relaxed)) {
            return StopRequest::Signal(number);
        }
        if !self.leads {
            return StopRequest::Nothing;
        }
        let now = Instant::now();
        if (now - self.started).as_secs_f64() >= self.limit {
            return StopRequest::WallLimit;
        }
        if now - self.looked.get() >= LOOK {
            self.looked.set(now);
            if self.stop_file.exists() {
                return StopRequest::StopFile;
            }
        }
        if (now - self.saved.get()).as_secs_f64() >= self.between_checkpoints {
            return StopRequest::Checkpoint;
        }
        StopRequest::Nothing
    }

    /// A checkpoint was just written: restarts the time to the next one.
    pub fn saved(&self) {
        self.saved.set(Instant::now());
    }

    /// The run has stopped by `request`. If that was the stop file, removes it, so that the user need not.
    pub fn granted(&self, request: StopRequest) {
        if self.leads && request == StopRequest::StopFile {
            // If the removal fails, the next run will stop at once and say why.
            let _ = std::fs::remove_file(&self.stop_file);
        }
    }
}

/// Whether the process was started with this signal ignored, as nohup does with SIGHUP. Then it stays so.
///
/// Only Linux tells. Elsewhere such a signal keeps the meaning that it has.
fn is_ignored(number: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (number - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interrupts(sets: &[&str], folder: &Path, rank: usize, age: f64) -> Interrupts {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let scene = Scene::parse("settle.toml", include_str!("../../../configs/settle.toml"), &sets).unwrap();
        let started = Instant::now().checked_sub(Duration::from_secs_f64(age)).unwrap();
        Interrupts::deaf(&scene, &folder.join("a.vtkhdf"), rank, started)
    }

    #[test]
    fn limits_are_rank_0_s_affair_and_the_stronger_request_comes_first() {
        let folder = tempfile::tempdir().unwrap();
        let of = |sets: &[&str], rank| interrupts(sets, folder.path(), rank, 10.0).request();
        assert_eq!(of(&[], 0), StopRequest::Nothing);
        assert_eq!(of(&["limits.wall=5"], 0), StopRequest::WallLimit);
        assert_eq!(of(&["limits.wall=5"], 1), StopRequest::Nothing);
        assert_eq!(of(&["limits.wall=1e300"], 0), StopRequest::Nothing);
        assert_eq!(of(&["checkpoint.wall=5"], 0), StopRequest::Checkpoint);
        assert_eq!(of(&["checkpoint.wall=5", "limits.wall=5"], 0), StopRequest::WallLimit);
    }

    #[test]
    fn a_stop_file_is_noticed_and_removed_when_it_is_granted() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.vtkhdf.stop");
        std::fs::write(&file, "").unwrap();
        let interrupts = interrupts(&[], folder.path(), 0, 1.0);
        assert_eq!(interrupts.request(), StopRequest::StopFile);
        interrupts.granted(StopRequest::Signal(15));
        assert!(file.exists());
        interrupts.granted(StopRequest::StopFile);
        assert!(!file.exists());
    }

    #[test]
    fn a_checkpoint_resets_the_clock_of_checkpoints() {
        let folder = tempfile::tempdir().unwrap();
        let interrupts = interrupts(&["checkpoint.wall=5"], folder.path(), 0, 10.0);
        assert_eq!(interrupts.request(), StopRequest::Checkpoint);
        interrupts.saved();
        assert_eq!(interrupts.request(), StopRequest::Nothing);
    }
}
