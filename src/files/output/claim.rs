//! The claim of a run on its output file: it alone writes there, and it notices if that is so no longer.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use super::path;
use crate::domain::comm::Comm;
use crate::error::Error;
use crate::files::lock::Lock;

/// The right to write an output file, its checkpoints and its stop file. Dropping it gives that up.
#[derive(Debug)]
pub struct Claim {
    path: PathBuf,
    /// Of the process that is rank 0.
    lock: Option<Lock>,
}

impl Claim {
    /// Claims the file `path`. Collective.
    ///
    /// Rank 0 makes the checks of [`Output::check_path`](super::Output::check_path) and takes the lock. All
    /// ranks return what came of it.
    pub fn stake(comm: &dyn Comm, path: &Path, force: bool, estimated_bytes: u64) -> Result<Self, Error> {
        let mut lock = None;
        let path = path::share(comm, || {
            let (path, taken) = path::lock(path, force, estimated_bytes)?;
            lock = Some(taken);
            Ok(path)
        })?;
        Ok(Claim { path, lock })
    }

    /// Checks whether the file may grow to about `estimated_bytes`. Collective.
    ///
    /// `name` is its name in messages.
    pub fn check_room(&self, comm: &dyn Comm, name: &Path, estimated_bytes: u64) -> Result<(), Error> {
        path::share(comm, || path::check(name, &self.path, true, estimated_bytes)).map(drop)
    }

    /// The file, by the one name that it has for all ranks and processes.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// What became of an output file since this process wrote to it last.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fate {
    /// It is as it was.
    Intact,
    /// Its name has gone, or another file has it. The file itself may be as it was.
    Moved(&'static str),
    /// Somebody else writes to it, or has done so.
    Spoiled(String),
}

/// The output file as this process left it, as rank 0 sees it.
#[derive(Debug, Clone, Copy)]
pub struct Watch {
    file: path::Identity,
    /// Place and content of eight bytes that are written once.
    mark: Option<(u64, [u8; 8])>,
}

impl Watch {
    /// Begins to watch a file that was just written. Its bytes from `mark` on are written once, and not 0.
    ///
    /// The bytes tell of a change that the length does not: HDF5 makes a file that is cut short in the middle
    /// of a write as long as it was.
    pub fn new(path: &Path, mark: Option<u64>) -> Option<Self> {
        let known = |offset| Some((offset, bytes_at(path, offset)?));
        let mark = mark.and_then(known).filter(|(_, bytes)| *bytes != [0; 8]);
        Some(Watch { file: path::identity(path)?, mark })
    }

    /// Learns the length of the file after a write.
    pub fn update(&mut self, path: &Path) {
        if let Some(found) = path::identity(path).filter(|found| found.is_same_file(&self.file)) {
            self.file = found;
        }
    }

    /// Looks at the file and at the lock. One rank calls it.
    pub fn fate(&self, path: &Path, claim: Option<&Claim>) -> Fate {
        if let Some(by) = claim.and_then(|claim| claim.lock.as_ref()?.lost()) {
            return Fate::Spoiled(format!("{by}, has taken it over; nothing more is written"));
        }
        match path::identity(path) {
            None => Fate::Moved("removed"),
            Some(found) if !found.is_same_file(&self.file) => Fate::Moved("replaced by another file"),
            Some(found) if found.length != self.file.length => Fate::Spoiled(format!(
                "another program has changed it: it has {} bytes, and this run left {}; nothing more is \
                 written",
                found.length, self.file.length
            )),
            Some(_) if self.mark.is_some_and(|(offset, bytes)| bytes_at(path, offset) != Some(bytes)) => {
                Fate::Spoiled("another program has changed it; nothing more is written".into())
            }
            Some(_) => Fate::Intact,
        }
    }
}

/// Eight bytes of a file; none if it cannot be read or is too short.
fn bytes_at(path: &Path, offset: u64) -> Option<[u8; 8]> {
    let mut bytes = [0; 8];
    File::open(path).and_then(|file| file.read_exact_at(&mut bytes, offset)).ok()?;
    Some(bytes)
}

impl Fate {
    /// As bytes, for the broadcast from rank 0.
    pub fn to_bytes(&self) -> Vec<u8> {
        let (mark, text) = match self {
            Fate::Intact => (b'=', ""),
            Fate::Moved(what) => (b'>', *what),
            Fate::Spoiled(why) => (b'!', why.as_str()),
        };
        [&[mark], text.as_bytes()].concat()
    }

    /// The inverse of `to_bytes`.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        match bytes.split_first() {
            Some((b'>', b"removed")) => Fate::Moved("removed"),
            Some((b'>', _)) => Fate::Moved("replaced by another file"),
            Some((b'!', why)) => Fate::Spoiled(String::from_utf8_lossy(why).into_owned()),
            _ => Fate::Intact,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;

    #[test]
    fn what_happens_to_a_file_is_noticed_and_survives_a_broadcast() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("a"), folder.path().join("b"));
        let claim = Claim::stake(&Solo, &path, false, 0).unwrap();
        std::fs::write(&path, "mark me").unwrap();
        let mut watch = Watch::new(&path, Some(0)).unwrap();
        assert!(watch.mark.is_none(), "it is too short");
        std::fs::write(&path, "mark of a run").unwrap();
        watch = Watch::new(&path, Some(0)).unwrap();
        let mut fate = || {
            let fate = watch.fate(&path, Some(&claim));
            watch.update(&path);
            assert_eq!(Fate::from_bytes(&fate.to_bytes()), fate);
            fate
        };
        assert_eq!(fate(), Fate::Intact);
        std::fs::write(&path, "mark of a longer run").unwrap();
        assert!(matches!(fate(), Fate::Spoiled(why) if why.contains("20 bytes, and this run left 13")));
        std::fs::write(&path, "mark of a shorter run").unwrap();
        fate();
        assert_eq!(fate(), Fate::Intact, "the mark is there, and the length is known");
        std::fs::write(&path, "mask of a shorter run").unwrap();
        assert!(matches!(fate(), Fate::Spoiled(why) if why.contains("another program has changed it;")));
        std::fs::write(&path, "mark of a shorter run").unwrap();
        std::fs::rename(&path, &other).unwrap();
        assert_eq!(fate(), Fate::Moved("removed"));
        std::fs::write(&path, "").unwrap();
        assert_eq!(fate(), Fate::Moved("replaced by another file"));
        std::fs::rename(&other, &path).unwrap();
        assert_eq!(fate(), Fate::Intact);
        let thief = "host = 'far'\nprocess = 1\nsince = 'now'\n";
        std::fs::write(folder.path().join("a.lock"), thief).unwrap();
        assert!(matches!(fate(), Fate::Spoiled(why) if why.contains("process 1 on far, since now UTC, has")));
    }
}
