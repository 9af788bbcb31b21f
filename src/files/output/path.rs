//! Checks whether a run can write where the user asks, before anything is computed, and takes the lock there.

use crate::domain::Comm;
use crate::domain::agreement;
use crate::error::Error;
use crate::files::beside;
use crate::files::lock::Lock;
use crate::math::digits;
use std::fs;
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access, statvfs};

/// Links that are followed one after the other at most, as by the system itself.
const LINKS: usize = 40;

/// The one name of the file `path` if a file of `estimated_bytes` can be written there, else the error
/// message.
///
/// An existing file is accepted only with `force`, and none that another process writes. Nothing is created.
pub fn look(path: &Path, force: bool, estimated_bytes: u64) -> Result<PathBuf, String> {
    let absolute = only_name(path).map_err(|why| refusal(path, &why))?;
    if let Some(held) = Lock::held(&lock_file(&absolute)) {
        return Err(refusal(path, &held));
    }
    check(path, &absolute, force, estimated_bytes)
}

/// Makes the checks of [`look`], and takes the lock of the one writer of the file.
pub fn lock(path: &Path, force: bool, estimated_bytes: u64) -> Result<(PathBuf, Lock), String> {
    let absolute = only_name(path).map_err(|why| refusal(path, &why))?;
    check(path, &absolute, true, estimated_bytes)?;
    let lock = Lock::take(&lock_file(&absolute)).map_err(|why| refusal(path, &why))?;
    // Whether the file exists is certain only now that nobody else can make it.
    Ok((check(path, &absolute, force, estimated_bytes)?, lock))
}

/// Why `path` is no place for the output.
fn refusal(path: &Path, why: &str) -> String {
    format!("output.file = \"{}\": {why}", path.display())
}

/// Checks the place `absolute`, if nobody else writes there, and returns it. Its name in messages is `path`.
pub fn check(path: &Path, absolute: &Path, force: bool, estimated_bytes: u64) -> Result<PathBuf, String> {
    match complaint(path, absolute, force, estimated_bytes) {
        Ok(()) => Ok(absolute.to_path_buf()),
        Err(why) => Err(refusal(path, &why)),
    }
}

fn complaint(path: &Path, absolute: &Path, force: bool, estimated_bytes: u64) -> Result<(), String> {
    let (Some(folder), false) = (absolute.parent(), ends_in_separator(path)) else {
        return Err("names a folder; give the name of a file to write".into());
    };
    let mut reclaimed = 0;
    match fs::metadata(absolute) {
        Ok(found) if found.is_dir() => {
            let example = path.join("run.vtkhdf");
            return Err(format!("is a folder; name a file in it, such as \"{}\"", example.display()));
        }
        Ok(found) if !found.is_file() => {
            return Err("is not a regular file; give the name of a file to write".into());
        }
        Ok(_) if !force => {
            return Err("the file exists; use --force to replace it, or --output FILE for another".into());
        }
        Ok(found) => {
            if let Err(why) = access(absolute, Access::WRITE_OK) {
                return Err(format!("the file exists and cannot be replaced ({why}); make it writable"));
            }
            reclaimed = 512 * found.blocks(); // st_blocks counts units of 512 bytes on any file system
        }
        Err(why) if matches!(why.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            match fs::metadata(folder) {
                Ok(found) if found.is_dir() => {}
                Ok(_) => {
                    return Err(format!("{} is not a folder; choose another path", folder.display()));
                }
                Err(_) => {
                    return Err(format!("there is no folder {}; create it first", folder.display()));
                }
            }
        }
        Err(why) => return Err(format!("cannot be looked at ({why}); choose another path")),
    }
    // A run makes files beside its output: the lock and the checkpoints.
    if let Err(why) = access(folder, Access::WRITE_OK | Access::EXEC_OK) {
        return Err(format!(
            "the folder {} cannot be written to ({why}); make it writable or choose another",
            folder.display()
        ));
    }
    if let Some(free) = free_bytes(folder)
        && free.saturating_add(reclaimed) < estimated_bytes
    {
        return Err(format!(
            "the run needs about {}, but {} has {} free; free some space, choose another path or a larger \
             output.interval",
            digits::bytes(estimated_bytes),
            folder.display(),
            digits::bytes(free.saturating_add(reclaimed))
        ));
    }
    Ok(())
}

/// Removes the file that a run replaces.
///
/// The new one is another file for whoever has the old one open, a reader or a writer. So there is never a
/// file with frames of both, whatever becomes of locks.
pub fn remove_old(path: &Path) -> Result<(), String> {
    match fs::remove_file(path) {
        Err(why) if why.kind() != ErrorKind::NotFound => {
            Err(refusal(path, &format!("the file exists and cannot be replaced ({why}); remove it")))
        }
        _ => Ok(()),
    }
}

/// The lock file of the run that writes to `output`.
fn lock_file(output: &Path) -> PathBuf {
    beside(output, "lock")
}

/// The one name of a file that may not exist yet: links are followed, also one that leads nowhere yet.
///
/// The checkpoints and the lock of a run are beside its file, not beside the link.
fn only_name(path: &Path) -> Result<PathBuf, String> {
    if path.to_str().is_none_or(|text| text.contains('\0')) {
        return Err("the name is not UTF-8 text, which HDF5 needs; choose another name".into());
    }
    let mut path = std::path::absolute(path)
        .map_err(|why| format!("not a path ({why}); give the name of a file to write"))?;
    for _ in 0..LINKS {
        match (fs::read_link(&path), path.parent()) {
            (Ok(target), Some(folder)) => path = folder.join(target),
            _ => break,
        }
    }
    Ok(match (path.canonicalize(), path.parent().map(Path::canonicalize), path.file_name()) {
        (Ok(there), ..) => there,
        (_, Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => path,
    })
}

/// What tells a file from others, and how long it is.
#[derive(Debug, Clone, Copy)]
pub struct Identity {
    device: u64,
    inode: u64,
    /// Length, bytes.
    pub length: u64,
}

impl Identity {
    /// Whether both are the same file, whatever its length.
    pub fn is_same_file(&self, other: &Identity) -> bool {
        (self.device, self.inode) == (other.device, other.inode)
    }
}

/// Looks a file up; none if it cannot be found.
pub fn identity(path: &Path) -> Option<Identity> {
    let found = fs::metadata(path).ok()?;
    Some(Identity { device: found.dev(), inode: found.ino(), length: found.len() })
}

/// Bytes that this user may still write to the file system of `folder`; none if the system does not say.
pub fn free_bytes(folder: &Path) -> Option<u64> {
    fail::fail_point!("room", |_| None);
    let all = statvfs(folder).ok()?;
    Some(all.f_bavail.saturating_mul(all.f_frsize))
}

/// Whether `path` names a folder by its form alone: `results/` does, whether it exists or not.
fn ends_in_separator(path: &Path) -> bool {
    path.as_os_str().as_bytes().ends_with(b"/") || path.file_name().is_none()
}

/// Calls `find` on rank 0 and returns its path or its error message on every rank. Collective.
pub fn share(comm: &dyn Comm, find: impl FnOnce() -> Result<PathBuf, String>) -> Result<PathBuf, Error> {
    let text = agreement::share(comm, || {
        let path = find().map_err(Error::Input)?;
        Ok(path.into_os_string().into_string().expect("a name that is not UTF-8 text was refused"))
    })?;
    Ok(text.into())
}
