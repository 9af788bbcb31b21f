//! The output folder of tables and figures.

use crate::error::Error;
use std::fmt::Display;
use std::path::Path;

/// Name of the file without its folder and extension; `scene` if there is none.
pub fn stem(file: &Path) -> String {
    file.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned())
}

/// Creates the folder, or says why it cannot be used. A folder with files in it needs `force`.
pub fn prepare(folder: &Path, force: bool) -> Result<(), Error> {
    let refuse = |why: String| Error::Input(format!("--output {}: {why}", folder.display()));
    if folder.exists() && !folder.is_dir() {
        return Err(refuse("this is a file; it must be the name of a folder".into()));
    }
    std::fs::create_dir_all(folder)
        .map_err(|why| refuse(format!("the folder cannot be made: {why}; choose another one")))?;
    let mut entries =
        std::fs::read_dir(folder).map_err(|why| refuse(format!("the folder cannot be read: {why}")))?;
    if entries.next().is_some() && !force {
        return Err(refuse("the folder is not empty; choose another one, or allow it with --force".into()));
    }
    // Try to write a file now, so that the user learns of a read-only folder before hours of work.
    let probe = folder.join(".demhybrid");
    std::fs::write(&probe, "")
        .and_then(|()| std::fs::remove_file(&probe))
        .map_err(|why| refuse(format!("nothing can be written there: {why}; choose another one")))
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
        prepare(&folder, false).unwrap();
        prepare(&folder, false).unwrap();
        std::fs::write(folder.join("something"), "").unwrap();
        let why = prepare(&folder, false).unwrap_err();
        assert!(why.exit_code() == 2 && why.to_string().contains("--force"), "{why}");
        prepare(&folder, true).unwrap();
        assert!(prepare(&folder.join("something"), true).unwrap_err().to_string().contains("a file"));
    }
}
