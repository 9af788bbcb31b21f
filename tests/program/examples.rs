//! The programs in `examples/`: each ends well and prints what it is for. They check their own results.

use crate::mpirun::PACKAGE;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Every example with a part of what it prints.
const EXAMPLES: [(&str, &str); 6] = [
    ("accuracy", "tolerance   error, m   right-hand sides"),
    ("observer", "t = 0.8 s: sphere 3 is the fastest"),
    ("own_friction", "exact at the end: 0.067668 m/s"),
    ("own_ode", "after one period of 6.2832: off by"),
    ("read_run_file", "sphere 0 and z = 0 m: 8.12e-3 m, 19.62 N"),
    ("settle_bed", "porosity of the bed, without its top: 0.4"),
];

/// The folder of the examples that `cargo test` has built, beside that of this test.
fn built() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(Path::parent).unwrap().join("examples")
}

#[test]
fn every_example_runs_and_prints_its_result() {
    for (name, part) in EXAMPLES {
        let program = built().join(name);
        assert!(program.exists(), "{} is missing: cargo build --examples makes it", program.display());
        let output = Command::new(&program).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {errors}");
        assert!(text.contains(part), "{name} does not print {part:?}:\n{text}");
    }
}

#[test]
fn every_example_is_run_here_and_is_in_the_book() {
    let files: BTreeSet<String> = fs::read_dir(Path::new(PACKAGE).join("examples"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(files, EXAMPLES.iter().map(|(name, _)| format!("{name}.rs")).collect());
    let page = fs::read_to_string(Path::new(PACKAGE).join("docs/library.md")).unwrap();
    for (name, _) in EXAMPLES {
        assert!(page.contains(&format!("`cargo run --example {name}`")), "{name} is not in docs/library.md");
    }
}
