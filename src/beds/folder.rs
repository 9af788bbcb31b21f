//! The output folder of tables and figures.

use crate::domain::Comm;
use crate::domain::agreement::share;
use crate::error::Error;
use crate::files::lock::Lock;
use std::fmt::Display;
use std::path::Path;

/// Name of the file without its folder and extension; `scene` if there is none.
pub fn stem(file: &Path) -> String {
    file.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned())
}

/// Name of the lock file in a folder that somebody writes to.
const LOCK: &str = ".demhybrid.lock";

/// Creates the folder, or says why it cannot be used. A folder with files in it needs `force`.
///
/// Nobody else writes there as long as the lock lives. It also shows, before hours of work, that the folder
/// is not read-only.
pub fn prepare(folder: &Path, force: bool) -> Result<Lock, Error> {
    let refuse = |why: String| Error::Input(format!("--output {}: {why}", folder.display()));
    if folder.exists() && !folder.is_dir() {
        return Err(refuse("this is a file; it must be the name of a folder".into()));
    }
    std::fs::create_dir_all(folder)
        .map_err(|why| refuse(format!("the folder cannot be made: {why}; choose another one")))?;
    let lock = Lock::take(&folder.join(LOCK)).map_err(refuse)?;
    let entries =
        std::fs::read_dir(folder).map_err(|why| refuse(format!("the folder cannot be read: {why}")))?;
    let mut others = entries.filter(|entry| entry.as_ref().map_or(true, |entry| entry.file_name() != LOCK));
    if others.next().is_some() && !force {
        return Err(refuse("the folder is not empty; choose another one, or allow it with --force".into()));
    }
    Ok(lock)
}

/// The same on rank 0, which alone writes there. Collective.
pub fn prepare_together(comm: &dyn Comm, folder: &Path, force: bool) -> Result<Option<Lock>, Error> {
    let mut lock = None;
    share(comm, || {
        lock = Some(prepare(folder, force)?);
        Ok(String::new())
    })?;
    Ok(lock)
}

/// The error for a file that cannot be written.
pub fn cannot_write(path: &Path, why: impl Display) -> Error {
    Error::Output { file: path.display().to_string(), why: why.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_something_in_it_is_refused_unless_forced() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new").join("deep");
        let lock = prepare(&folder, false).unwrap();
        let why = prepare(&folder, true).unwrap_err();
        assert!(why.exit_code() == 2 && why.to_string().contains("is writing it; wait"), "{why}");
        drop(lock);
        drop(prepare(&folder, false).unwrap());
        std::fs::write(folder.join("something"), "").unwrap();
        let why = prepare(&folder, false).unwrap_err();
        assert!(why.exit_code() == 2 && why.to_string().contains("--force"), "{why}");
        drop(prepare(&folder, true).unwrap());
        assert!(prepare(&folder.join("something"), true).unwrap_err().to_string().contains("a file"));
    }
}
