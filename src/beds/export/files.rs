//! The files of an export: their names, whether they may be replaced, and the errors of writing.

use std::fs;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::domain::stdout::unless_reader_has_gone;
use crate::error::Error;

/// The file of frame `k` if there are several: `k` with four digits goes before the extension.
pub fn numbered(path: &Path, k: u64) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_os_string();
    name.push(format!("-{k:04}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The header file of a raw image.
pub fn header_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(".json");
    name.into()
}

/// Refuses a target that exists, unless `force`. Always refuses the run file itself.
pub fn check(target: &Path, run: &Path, force: bool) -> Result<(), Error> {
    let refuse = |why: &str| Err(Error::Input(format!("--output {}: {why}", target.display())));
    if target.file_name().is_none() || target.is_dir() {
        return refuse("this is a folder; it must be the name of a file");
    }
    if let (Ok(target), Ok(run)) = (target.canonicalize(), run.canonicalize())
        && target == run
    {
        return refuse("this is the file of the run itself; give another name");
    }
    if target.exists() && !force {
        return refuse("the file exists; use --force to replace it, or give another name");
    }
    Ok(())
}

/// A file that is being written.
pub struct File {
    path: PathBuf,
    out: BufWriter<fs::File>,
}

impl File {
    /// Creates the file, or says why that is not possible.
    pub fn create(path: &Path, force: bool) -> Result<Self, Error> {
        let mut options = fs::OpenOptions::new();
        let options = match force {
            true => options.write(true).create(true).truncate(true),
            false => options.write(true).create_new(true),
        };
        let file = options.open(path).map_err(|why| {
            let hint = match why.kind() {
                ErrorKind::NotFound => "its folder must exist",
                ErrorKind::AlreadyExists => "use --force to replace it",
                _ => "give another name",
            };
            Error::Input(format!("--output {}: the file cannot be made: {why}; {hint}", path.display()))
        })?;
        Ok(File { path: path.to_path_buf(), out: BufWriter::with_capacity(1 << 18, file) })
    }

    /// Appends what `content` writes.
    pub fn write(
        &mut self,
        content: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), Error> {
        unless_reader_has_gone(content(&mut self.out)).map_err(|why| lost(&self.path, why))
    }

    /// Writes buffered data and closes the file.
    pub fn finish(mut self) -> Result<(), Error> {
        unless_reader_has_gone(self.out.flush()).map_err(|why| lost(&self.path, why))
    }
}

fn lost(path: &Path, why: std::io::Error) -> Error {
    Error::Output { file: path.display().to_string(), why: why.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_before_the_extension() {
        assert_eq!(numbered(Path::new("a/bed.v2.vtp"), 7), Path::new("a/bed.v2-0007.vtp"));
        assert_eq!(numbered(Path::new("bed"), 12345), Path::new("bed-12345"));
        assert_eq!(header_of(Path::new("a/bed.raw")), Path::new("a/bed.raw.json"));
    }

    #[test]
    fn neither_the_run_nor_what_is_there_is_overwritten_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("run"), "r").unwrap();
        fs::write(at("there"), "t").unwrap();
        let refused = |name: &str, force| check(&at(name), &at("run"), force).unwrap_err().to_string();
        assert!(refused("there", false).contains("--force"));
        assert!(refused("run", true).contains("the run itself"));
        assert!(refused("", true).contains("a folder"));
        check(&at("there"), &at("run"), true).unwrap();
        check(&at("new"), &at("run"), false).unwrap();
        let nowhere = File::create(&at("no/new"), false).err().unwrap();
        assert!(nowhere.to_string().contains("its folder must exist"), "{nowhere}");
        assert_eq!(nowhere.exit_code(), 2);
    }
}
