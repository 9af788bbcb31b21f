//! One writer at a time: a lock that a process holds as long as it may write to a file or a folder.
//!
//! It is the system's own lock (flock) on a small file beside what is written. The kernel releases it when
//! the process ends, however that happens, so a dead job is in nobody's way. The text in the file says who
//! holds it. That text is also the second line of defence, where a file system has no locks, or has them on
//! each machine alone: a process whose text was replaced has lost the lock and must not write any more.

use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustix::fs::OFlags;
use rustix::process::{Pid, test_kill_process};
use serde::{Deserialize, Serialize};

/// How often a lock that another process holds is tried again: it may be about to end, or only looking.
const TRIES: usize = 25;
/// Time between two tries.
const PAUSE: Duration = Duration::from_millis(20);
/// More than any text of a lock file has, bytes.
const LONGEST_TEXT: u64 = 4096;

/// A process that holds a lock.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Holder {
    /// Name of its machine.
    host: String,
    /// Its number on that machine.
    process: i32,
    /// When it took the lock, UTC.
    since: String,
}

impl Holder {
    fn this_process() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Holder {
            host: rustix::system::uname().nodename().to_string_lossy().into_owned(),
            process: std::process::id().cast_signed(),
            since: utc(now.as_secs()),
        }
    }

    /// Whether this process has certainly ended: only of the own machine that can be known.
    fn is_gone(&self) -> bool {
        let here = self.host == Holder::this_process().host;
        here && Pid::from_raw(self.process)
            .is_none_or(|process| test_kill_process(process) == Err(rustix::io::Errno::SRCH))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "process {} on {}, since {} UTC", self.process, self.host, self.since)
    }
}

/// A lock that this process holds. Dropping it releases it and removes its file.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    /// Open as long as the lock is held. Nobody reads it.
    file: File,
    own: Holder,
}

impl Lock {
    /// Takes the lock with the file `path`. An error says who holds it, or why there can be none.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::files::lock::Lock;
    ///
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("bed.vtkhdf.lock");
    /// let lock = Lock::take(&path)?;
    /// let refused = Lock::take(&path).unwrap_err();
    /// assert!(refused.contains(&format!("process {}", std::process::id())));
    /// drop(lock);
    /// assert!(!path.exists());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn take(path: &Path) -> Result<Lock, String> {
        let cannot = |why: io::Error| format!("its lock file {} cannot be made ({why})", path.display());
        let own = Holder::this_process();
        let mut tries = 0;
        loop {
            let mut file = open(path, true).map_err(cannot)?;
            let found = read(&mut file).map_err(cannot)?;
            if let Text::Foreign = found {
                return Err(format!("{} is not a lock of demhybrid; move it away", path.display()));
            }
            if let Some(held) = held(&file, &found, path, File::try_lock) {
                tries += 1;
                if tries == TRIES {
                    return Err(held);
                }
                sleep(PAUSE);
            } else if is_named(&file, path) {
                let text = toml::to_string(&own).expect("a holder has a number and texts");
                let written = file.set_len(0).and_then(|()| file.write_all_at(text.as_bytes(), 0));
                // Other machines of a shared file system see it when it is on the disk of the server.
                written.and_then(|()| file.sync_all()).map_err(cannot)?;
                return Ok(Lock { path: path.to_path_buf(), file, own });
            }
            // Else its holder has removed the file between the opening and the lock: there is a new one.
        }
    }

    /// Who holds the lock with the file `path`, and what would do; nothing if nobody does. Changes nothing.
    pub fn held(path: &Path) -> Option<String> {
        let mut file = open(path, false).ok()?;
        let found = read(&mut file).ok()?;
        held(&file, &found, path, File::try_lock_shared)
    }

    /// Who has taken the lock although this process held it. Nobody can where the file system has locks.
    pub fn lost(&self) -> Option<String> {
        match read(&mut open(&self.path, false).ok()?).ok()? {
            Text::Of(holder) if holder != self.own => Some(holder.to_string()),
            _ => None,
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // The file goes before the lock does. Whoever has opened it meanwhile sees that its name has gone.
        if self.lost().is_none() && is_named(&self.file, &self.path) {
            // One that cannot be removed is in nobody's way.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// What a lock file says.
enum Text {
    /// Nothing yet.
    Nothing,
    Of(Holder),
    /// It is not a lock file.
    Foreign,
}

fn open(path: &Path, create: bool) -> io::Result<File> {
    let mut options = File::options();
    // Never through a link that somebody else has put there.
    options.read(true).custom_flags(OFlags::NOFOLLOW.bits().cast_signed());
    if create {
        options.write(true).create(true).truncate(false);
    }
    options.open(path)
}

fn read(file: &mut File) -> io::Result<Text> {
    let mut text = Vec::new();
    file.take(LONGEST_TEXT).read_to_end(&mut text)?;
    if text.is_empty() {
        return Ok(Text::Nothing);
    }
    Ok(toml::from_slice(&text).map_or(Text::Foreign, Text::Of))
}

/// Whether `path` is the name of this open file.
fn is_named(file: &File, path: &Path) -> bool {
    let same = |a: &fs::Metadata, b: &fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    // A look at an open file is fresh on a shared file system too, one at a name may not be.
    let there = open(path, false).and_then(|file| file.metadata());
    matches!((file.metadata(), there), (Ok(own), Ok(there)) if same(&own, &there))
}

/// Tries to lock the file. If another process has it, says so.
///
/// Without locks the text decides: a process of this machine that has ended holds nothing.
fn held(
    file: &File,
    text: &Text,
    path: &Path,
    try_lock: impl FnOnce(&File) -> Result<(), TryLockError>,
) -> Option<String> {
    let who = match text {
        Text::Of(holder) => holder.to_string(),
        _ => "another process".to_string(),
    };
    match seize(file, try_lock) {
        Ok(()) => None,
        Err(TryLockError::WouldBlock) => Some(format!(
            "{who}, is writing it; wait for the end of that run, or stop it, or write somewhere else"
        )),
        Err(TryLockError::Error(_)) => match text {
            Text::Of(holder) if !holder.is_gone() => Some(format!(
                "{who}, is writing it; wait for its end, or write somewhere else; this file system has no \
                 locks, so if that process has been killed, remove {}",
                path.display()
            )),
            _ => None,
        },
    }
}

fn seize(file: &File, try_lock: impl FnOnce(&File) -> Result<(), TryLockError>) -> Result<(), TryLockError> {
    fail::fail_point!("locks", |_| Err(TryLockError::Error(io::ErrorKind::Unsupported.into())));
    try_lock(file)
}

/// A time since 1970 in seconds as date and time of day.
fn utc(seconds: u64) -> String {
    let (mut days, rest) = (seconds / 86_400, seconds % 86_400);
    let is_leap =
        |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while days >= lengths[month] {
        days -= lengths[month];
        month += 1;
    }
    let (hours, minutes) = (rest / 3600, rest / 60 % 60);
    format!("{year}-{:02}-{:02} {hours:02}:{minutes:02}:{:02}", month + 1, days + 1, rest % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn path() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.lock");
        (folder, path)
    }

    #[test]
    fn times_are_those_of_the_calendar() {
        // GNU date --utc --date=@N.
        for (seconds, text) in [
            (0, "1970-01-01 00:00:00"),
            (951_782_399, "2000-02-28 23:59:59"),
            (951_868_799, "2000-02-29 23:59:59"),
            (1_795_967_287, "2026-11-29 15:48:07"),
            (4_107_542_400, "2100-03-01 00:00:00"),
        ] {
            assert_eq!(utc(seconds), text);
        }
    }

    #[test]
    fn a_lock_is_refused_while_it_is_held_and_leaves_nothing_behind() {
        let (folder, path) = path();
        assert_eq!(Lock::held(&path), None);
        let lock = Lock::take(&path).unwrap();
        for refused in [Lock::take(&path).unwrap_err(), Lock::held(&path).unwrap()] {
            let own = Holder::this_process();
            for part in [format!("process {} on {}, since 20", own.process, own.host), "is writing".into()] {
                assert!(refused.contains(&part), "{refused}");
            }
        }
        assert_eq!(lock.lost(), None);
        // Another one is nobody else's affair.
        drop(Lock::take(&folder.path().join("b.lock")).unwrap());
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        drop(Lock::take(&path).unwrap());
    }

    #[test]
    fn a_lock_of_a_dead_process_is_in_nobodys_way() {
        let (_folder, path) = path();
        // What a kill leaves: the file and its text, perhaps empty, and no lock. The host may be another.
        for text in ["", "host = 'gone'\nprocess = 1\nsince = '2020-01-01 00:00:00'\n"] {
            fs::write(&path, text).unwrap();
            assert_eq!(Lock::held(&path), None);
            let lock = Lock::take(&path).unwrap();
            let text = fs::read_to_string(&path).unwrap();
            assert!(text.contains(&format!("process = {}", std::process::id())), "{text}");
            drop(lock);
            assert!(!path.exists());
        }
    }

    #[test]
    fn of_all_that_try_at_one_moment_one_has_the_lock_at_a_time() {
        let (_folder, path) = path();
        let (inside, won) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let Ok(lock) = Lock::take(&path) else { continue };
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0, "two hold it");
                        std::thread::yield_now();
                        inside.fetch_sub(1, Ordering::SeqCst);
                        won.fetch_add(1, Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
        assert!(won.load(Ordering::SeqCst) >= 50, "{won:?}");
        assert!(!path.exists());
    }

    #[test]
    fn a_lock_that_another_process_took_over_is_known_to_be_lost_and_left_to_it() {
        let (_folder, path) = path();
        let lock = Lock::take(&path).unwrap();
        // On a file system whose locks do not reach the other machine.
        let other = "host = 'far'\nprocess = 1\nsince = '2020-01-01 00:00:00'\n";
        fs::write(&path, other).unwrap();
        assert_eq!(lock.lost().unwrap(), "process 1 on far, since 2020-01-01 00:00:00 UTC");
        drop(lock);
        assert_eq!(fs::read_to_string(&path).unwrap(), other);
        // One whose file somebody has removed is not lost.
        let lock = Lock::take(&path).unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!(lock.lost(), None);
    }

    #[test]
    fn without_locks_the_text_decides() {
        let (_folder, path) = path();
        let text = |process: u32, host: &str| {
            let host = if host.is_empty() { Holder::this_process().host } else { host.into() };
            Text::Of(Holder { host, process: process.cast_signed(), since: "then".into() })
        };
        let none = |_: &File| Err(TryLockError::Error(io::ErrorKind::Unsupported.into()));
        let file = open(&path, true).unwrap();
        let held = |text: &Text| held(&file, text, &path, none);
        assert_eq!(held(&Text::Nothing), None);
        // No process has the largest number there is.
        assert_eq!(held(&text(i32::MAX as u32, "")), None);
        for refused in [text(std::process::id(), ""), text(i32::MAX as u32, "far")] {
            let refused = held(&refused).unwrap();
            assert!(refused.contains("remove") && refused.contains("a.lock"), "{refused}");
        }
    }

    #[test]
    fn a_file_that_is_no_lock_is_left_alone() {
        let (folder, path) = path();
        fs::write(&path, "precious").unwrap();
        assert!(Lock::take(&path).unwrap_err().contains("move it away"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        let link = folder.path().join("link.lock");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(Lock::take(&link).unwrap_err().contains("cannot be made"));
        assert!(Lock::take(&folder.path().join("no/a.lock")).unwrap_err().contains("cannot be made"));
    }
}
