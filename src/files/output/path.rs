//! Checks whether a run can write where the user asks, before anything is computed or created.

use crate::math::digits;
use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access, statvfs};

/// The absolute form of `path` if a file of `estimated_bytes` can be written there, else the error message.
///
/// An existing file is accepted only with `force`. Nothing is created.
pub fn look(path: &Path, force: bool, estimated_bytes: u64) -> Result<PathBuf, String> {
    let named = path.display();
    let refuse = |what: String| Err(format!("output.file = \"{named}\": {what}"));
    if path.to_str().is_none_or(|text| text.contains('\0')) {
        return refuse("the name is not UTF-8 text, which HDF5 needs; choose another name".to_string());
    }
    let absolute = match std::path::absolute(path) {
        // Follow a link: the checkpoints of a run are beside its file, not beside the link.
        Ok(absolute) => absolute.canonicalize().unwrap_or(absolute),
        Err(why) => return refuse(format!("not a path ({why}); give the name of a file to write")),
    };
    let (Some(folder), false) = (absolute.parent(), ends_in_separator(path)) else {
        return refuse("names a folder; give the name of a file to write".to_string());
    };
    let mut reclaimed = 0;
    match fs::metadata(&absolute) {
        Ok(found) if found.is_dir() => {
            return refuse(format!(
                "is a folder; name a file in it, such as \"{}\"",
                path.join("run.vtkhdf").display()
            ));
        }
        Ok(found) if !found.is_file() => {
            return refuse("is not a regular file; give the name of a file to write".to_string());
        }
        Ok(_) if !force => {
            return refuse(
                "the file exists; use --force to replace it, or --output FILE for another".to_string(),
            );
        }
        Ok(found) => {
            if let Err(why) = access(&absolute, Access::WRITE_OK) {
                return refuse(format!("the file exists and cannot be replaced ({why}); make it writable"));
            }
            reclaimed = 512 * found.blocks(); // st_blocks counts units of 512 bytes on any file system
        }
        Err(why) if matches!(why.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            match fs::metadata(folder) {
                Ok(found) if found.is_dir() => {}
                Ok(_) => {
                    return refuse(format!("{} is not a folder; choose another path", folder.display()));
                }
                Err(_) => {
                    return refuse(format!("there is no folder {}; create it first", folder.display()));
                }
            }
            if let Err(why) = access(folder, Access::WRITE_OK | Access::EXEC_OK) {
                return refuse(format!(
                    "the folder {} cannot be written to ({why}); make it writable or choose another",
                    folder.display()
                ));
            }
        }
        Err(why) => return refuse(format!("cannot be looked at ({why}); choose another path")),
    }
    if let Some(free) = free_bytes(folder)
        && free.saturating_add(reclaimed) < estimated_bytes
    {
        return refuse(format!(
            "the run needs about {}, but {} has {} free; free some space, choose another path or a larger \
             output.interval",
            digits::bytes(estimated_bytes),
            folder.display(),
            digits::bytes(free.saturating_add(reclaimed))
        ));
    }
    Ok(absolute)
}

/// Device and inode of a file; none if it cannot be found.
pub fn identity(path: &Path) -> Option<(u64, u64)> {
    let found = fs::metadata(path).ok()?;
    Some((found.dev(), found.ino()))
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

/// The result of [`look`] as bytes, for the broadcast from rank 0: a mark, then the path or the message.
pub fn to_bytes(outcome: &Result<PathBuf, String>) -> Vec<u8> {
    match outcome {
        Ok(path) => [b"+", path.as_os_str().as_bytes()].concat(),
        Err(complaint) => [b"-", complaint.as_bytes()].concat(),
    }
}

/// The inverse of `to_bytes`.
pub fn from_bytes(bytes: &[u8]) -> Result<PathBuf, String> {
    match bytes.split_first() {
        Some((b'+', path)) => Ok(PathBuf::from(OsStr::from_bytes(path))),
        Some((_, complaint)) => Err(String::from_utf8_lossy(complaint).into_owned()),
        None => Err("output.file: rank 0 gave no answer about the path".to_string()),
    }
}
