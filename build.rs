//! Records the commit that the program is built from, so that every output file can name it.

use std::process::Command;

// Here, and not in the program, because this is compiled first.
#[cfg(all(feature = "mpi", feature = "bundled"))]
compile_error!(
    "the bundled HDF5 is a serial one and cannot be used with MPI: add --no-default-features for a program of one rank, \
     or leave the feature bundled out for one with MPI and the system's parallel HDF5"
);

fn main() {
    // hdf5-metno-sys tells what it has found.
    if std::env::var_os("CARGO_FEATURE_MPI").is_none() && std::env::var_os("DEP_HDF5_HAVE_PARALLEL").is_some()
    {
        println!(
            "cargo:warning=a build without MPI has found a parallel HDF5, and will need MPI's libraries after all; \
             HDF5_DIR chooses a serial one (Debian: HDF5_DIR=/usr/lib/x86_64-linux-gnu/hdf5/serial)"
        );
    }
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_string())
    };
    let commit = git(&["rev-parse", "HEAD"]).unwrap_or_else(|| "unknown".into());
    println!("cargo:rustc-env=DEMHYBRID_COMMIT={commit}");
    println!("cargo:rerun-if-changed=build.rs");
    if let Some(folder) = git(&["rev-parse", "--git-dir"]) {
        println!("cargo:rerun-if-changed={folder}/logs/HEAD");
    }
}
