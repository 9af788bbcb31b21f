//! Readers written in Python, where there is a Python with what they need.

#![allow(dead_code)] // every test file uses a part

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");

/// The Python with h5py and vtk, if there is one. One that is named must work.
pub fn python() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("DEMHYBRID_PYTHON") {
        return Some(named.into());
    }
    let local = Path::new(PACKAGE).join(".venv/bin/python");
    if local.is_file() {
        return Some(local);
    }
    // Not println: the test runner would hide it.
    let _ = writeln!(
        std::io::stderr(),
        "NOTHING WAS READ: DEMHYBRID_PYTHON is not set and there is no .venv; launch/test.sh makes it"
    );
    None
}

/// Runs `script` of the folder tests in `folder`; it must succeed. Returns what it said.
#[track_caller]
pub fn run_python(python: &Path, script: &str, folder: &Path, arguments: &[&str]) -> String {
    let script = Path::new(PACKAGE).join("tests").join(script);
    let ran = Command::new(python).arg(script).args(arguments).current_dir(folder).output();
    let ran = ran.unwrap_or_else(|why| panic!("{} does not start: {why}", python.display()));
    let [out, err] = [ran.stdout, ran.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(ran.status.success(), "{arguments:?}\n{out}\n{err}");
    out
}
