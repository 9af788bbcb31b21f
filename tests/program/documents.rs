//! Every command of README.md and of the book, run in the order of the page in a temporary folder.
//!
//! Indented blocks and blocks fenced as `sh` are commands, one a line (a line that ends with `\` goes on);
//! `python` is a script for the readers' Python; `toml` is a scene, saved under the name in its first comment
//! (else scene.toml) and checked with --dry-run; `text` is output, and `rust` is a program that `cargo test
//! --doc` builds. Any other fence is a mistake.
//!
//! `demhybrid` is a script of the test: a plain `cargo test` ends scenes at t = 0.3 s (1.2 s with a limit of
//! wall time) where the command does not say itself when it ends; with the feature `long-tests` commands run
//! as they stand. What cannot run is on the list below.

use crate::mpirun::{Job, PACKAGE, PROGRAM};
use crate::python::python;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use tempfile::TempDir;

/// What else may become of a command than to be run and leave with 0.
enum Fate {
    /// It cannot run here; why.
    Left(&'static str),
    /// It cannot run here; why, and what is done in its place.
    Replaced(&'static str, &'static str),
    /// It takes minutes: with the feature `long-tests` only.
    Long,
    /// It leaves with one of these codes, of which the text tells.
    Leaves(&'static [i32]),
}

use Fate::{Leaves, Left, Long, Replaced};

/// Commands, by how they begin, that are not simply run.
const EXCEPTIONS: &[(&str, Fate)] = &[
    (
        "bash launch/settle.sh",
        Replaced(
            "installs packages and the program",
            "cp configs/settle.toml . && mpirun -n 2 demhybrid settle.toml",
        ),
    ),
    ("bash launch/test.sh", Left("runs this test")),
    (
        "sbatch --array=1-10 launch/slurm.sbatch bed.toml",
        Replaced(
            "needs a cluster",
            "for k in 1 2 3; do SLURM_ARRAY_TASK_ID=$k LAUNCHER='mpirun -n 2' bash launch/slurm.sbatch bed.toml; done",
        ),
    ),
    ("sbatch ", Left("needs a cluster")),
    ("mkdir -p results && sbatch ", Left("needs a cluster")),
    ("qsub ", Left("needs a cluster")),
    ("squeue", Left("needs a cluster")),
    ("module load ", Left("names differ from site to site")),
    ("MPICC=mpicc HDF5_DIR=$HDF5_ROOT cargo install ", Left("installs the program")),
    ("cargo install ", Left("installs the program")),
    ("launch/strong-scaling.sh", Left("settles 20 000 spheres, which takes minutes")),
    ("launch/weak-scaling.sh", Left("settles 20 000 spheres, which takes minutes")),
    ("QUICK=1 launch/compare-peers.sh", Left("needs LAMMPS and LIGGGHTS, and takes long")),
    ("launch/peer-accuracy.sh", Left("needs LAMMPS, and takes minutes")),
    ("demhybrid accuracy configs/quick.toml", Long),
    ("demhybrid accuracy configs/settle.toml", Long),
    ("demhybrid accuracy bed.toml", Long),
    ("mpirun -n 2 demhybrid accuracy configs/settle.toml", Long),
    // The limit of 0.4 s; a machine that is fast enough is done before.
    ("demhybrid configs/bed.toml -o long.vtkhdf", Leaves(&[5, 0])),
];

/// How a command may begin that is run. Anything else is unknown, and fails.
const RUNNABLE: &[&str] = &[
    "demhybrid ",
    "mpirun -n 2 demhybrid ",
    "mpirun -n 2 -x RAYON_NUM_THREADS=4 demhybrid ",
    ". launch/env.sh",
    "cp ",
];

/// The program that the commands find, in its own words.
const WRAPPER: &str = r#"#!/bin/sh
# A scene ends early unless the command says itself when; one with a limit of wall time later, to reach the limit.
t_end=0.3
case " $* " in
*" --dry-run "* | *" --set t_end="* | *" --gather "*) SHORTEN= ;;
*" --set limits.wall="*) t_end=1.2 ;;
esac
case "$SHORTEN $1" in
"yes "*.toml | "yes ensemble") set -- "$@" --set t_end=$t_end ;;
esac
exec "$PROGRAM" "$@"
"#;

/// What stands in a document for somebody to use.
#[derive(Debug, PartialEq)]
enum Item {
    Command(String),
    Python(String),
    Scene(String, String),
}

/// The items of a Markdown text, in its order.
fn items(text: &str) -> Result<Vec<Item>, String> {
    let mut found = Vec::new();
    let mut lines = text.lines().peekable();
    let mut after_blank = true;
    while let Some(line) = lines.next() {
        if let Some(kind) = line.strip_prefix("```") {
            let mut block = Vec::new();
            loop {
                match lines.next() {
                    None => return Err(format!("the block ```{kind} has no end")),
                    Some("```") => break,
                    Some(line) => block.push(line),
                }
            }
            match kind {
                "sh" => found.extend(commands(&block)),
                "python" => found.push(Item::Python(block.join("\n"))),
                "toml" => {
                    let first = block.first().copied().unwrap_or_default();
                    let name = first.strip_prefix("# ").and_then(|words| words.split([' ', ':']).next());
                    let name = name.filter(|name| name.ends_with(".toml")).unwrap_or("scene.toml");
                    found.push(Item::Scene(name.to_owned(), block.join("\n") + "\n"));
                }
                "text" | "rust,no_run" => {}
                _ => return Err(format!("a block of an unknown kind: ```{kind}")),
            }
            after_blank = true;
        } else if after_blank && line.starts_with("    ") {
            let mut block = vec![line.trim()];
            while let Some(line) = lines.next_if(|line| line.starts_with("    ")) {
                block.push(line.trim());
            }
            found.extend(commands(&block));
        } else {
            after_blank = line.trim().is_empty();
        }
    }
    Ok(found)
}

/// One command a line, unless it goes on.
fn commands(block: &[&str]) -> Vec<Item> {
    let mut found: Vec<String> = Vec::new();
    let mut goes_on = false;
    for line in block.iter().map(|line| line.trim()).filter(|line| !line.is_empty() && !line.starts_with('#'))
    {
        let (line, more) = line.strip_suffix('\\').map_or((line, false), |line| (line, true));
        match found.last_mut() {
            Some(last) if goes_on => *last += line,
            _ => found.push(line.to_owned()),
        }
        goes_on = more;
    }
    found.into_iter().map(Item::Command).collect()
}

/// What is done with a command.
#[derive(Debug)]
struct Plan<'a> {
    /// What is run and the codes it may leave with; none: nothing.
    run: Option<(&'a str, &'static [i32])>,
    /// Why it is not run as it stands; empty where it is.
    why: &'static str,
}

fn plan(command: &str) -> Result<Plan<'_>, String> {
    let as_it_stands = Plan { run: Some((command, &[0])), why: "" };
    match EXCEPTIONS.iter().find(|(start, _)| command.starts_with(start)).map(|(_, fate)| fate) {
        Some(Left(why)) => Ok(Plan { run: None, why }),
        Some(Replaced(why, other)) => Ok(Plan { run: Some((other, &[0])), why }),
        Some(Long) if cfg!(feature = "long-tests") => Ok(as_it_stands),
        Some(Long) => Ok(Plan { run: None, why: "takes minutes: launch/test-long.sh runs it" }),
        Some(Leaves(codes)) => Ok(Plan { run: Some((command, codes)), why: "" }),
        None if RUNNABLE.iter().any(|start| command.starts_with(start)) => Ok(as_it_stands),
        None => Err(format!(
            "unknown command {command:?}: tests/program/documents.rs must know how to run it or why it cannot"
        )),
    }
}

/// Runs all of a document in a folder that looks like the project's, and returns the folder.
fn follow(document: &str) -> TempDir {
    let text = fs::read_to_string(Path::new(PACKAGE).join(document)).unwrap();
    let items = items(&text).unwrap_or_else(|why| panic!("{document}: {why}"));
    let folder = TempDir::new().unwrap();
    for name in ["configs", "launch"] {
        symlink(Path::new(PACKAGE).join(name), folder.path().join(name)).unwrap();
    }
    // Where launch/env.sh looks for what cargo installed.
    let bin = folder.path().join(".cargo/bin");
    fs::create_dir_all(&bin).unwrap();
    fs::write(bin.join("demhybrid"), WRAPPER).unwrap();
    fs::set_permissions(bin.join("demhybrid"), fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let run = |command: &str, codes: &[i32]| {
        let ended = Job::alone(folder.path(), &["-e", "-c", command])
            .of("sh".into())
            .with_variable("PATH", &path)
            .with_variable("CARGO_INSTALL_ROOT", &folder.path().join(".cargo").to_string_lossy())
            .with_variable("PROGRAM", PROGRAM)
            .with_variable("SHORTEN", if cfg!(feature = "long-tests") { "" } else { "yes" })
            .within(if cfg!(feature = "long-tests") { 1500 } else { 90 })
            .run();
        println!("{document}: {:.1} s, code {}: {command}", ended.took.as_secs_f64(), ended.code);
        assert!(
            codes.contains(&ended.code),
            "{document}: {command}\nleft with {}\n{}\n{}",
            ended.code,
            ended.stdout,
            ended.stderr
        );
    };
    for item in &items {
        match item {
            Item::Command(command) => {
                let Plan { run: instead, why } =
                    plan(command).unwrap_or_else(|why| panic!("{document}: {why}"));
                if !why.is_empty() {
                    println!("{document}: not run as it stands ({why}): {command}");
                }
                if let Some((command, codes)) = instead {
                    run(command, codes);
                }
            }
            Item::Scene(name, text) => {
                fs::write(folder.path().join(name), text).unwrap();
                run(&format!("demhybrid {name} --dry-run --set output.file=never.vtkhdf"), &[0]);
            }
            Item::Python(script) => {
                let Some(python) = python() else { continue };
                fs::write(folder.path().join("script.py"), script).unwrap();
                run(&format!("'{}' script.py", python.display()), &[0]);
            }
        }
    }
    assert!(items.len() > 2, "{document}: {items:?}");
    folder
}

/// A test for each page whose commands are run, and the list of these pages.
macro_rules! follow {
    ($($page:literal: $test:ident,)*) => {
        const FOLLOWED: &[&str] = &["README.md", $($page),*];
        $(#[test] fn $test() { follow($page); })*
    };
}

follow! {
    "docs/accuracy.md": accuracy_of_a_scene,
    "docs/clusters.md": runs_on_a_cluster,
    "docs/ensembles.md": many_seeds_and_cases,
    "docs/exports.md": a_bed_for_another_program,
    "docs/file-format.md": a_file_read_frame_by_frame,
    "docs/measures.md": measures_of_a_bed,
    "docs/performance.md": scaling_on_your_machine,
    "docs/pictures.md": pictures_and_films,
    "docs/restart.md": a_run_that_stops_and_goes_on,
    "docs/results.md": results_in_python,
    "docs/running.md": a_scene_from_init_to_two_ranks,
    "docs/scene.md": a_scene_with_every_table,
    "docs/tutorial-bed.md": a_bed_for_a_pore_scale_solver,
    "docs/tutorial-beads.md": a_bed_of_beads,
    "docs/tutorial-ensemble.md": an_ensemble_on_a_cluster,
    "docs/tutorial-sieve.md": from_a_sieve_curve_to_voxels,
    "docs/tutorial-tolerance.md": choosing_a_tolerance,
}

#[test]
fn every_command_of_the_readme_does_what_it_says() {
    let folder = follow("README.md");
    for made in ["bed.png", "settle-analysis/report.html", "pores.raw.json", "fall.gif", "soft.vtkhdf"] {
        assert!(folder.path().join(made).exists(), "nothing made {made}");
    }
}

#[test]
fn no_page_with_commands_is_forgotten() {
    let mut pages = 0;
    for folder in ["", "docs", "docs/decisions"] {
        for entry in fs::read_dir(Path::new(PACKAGE).join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "md") {
                continue;
            }
            let page = path.strip_prefix(PACKAGE).unwrap().to_str().unwrap();
            let items =
                items(&fs::read_to_string(&path).unwrap()).unwrap_or_else(|why| panic!("{page}: {why}"));
            assert_eq!(!items.is_empty(), FOLLOWED.contains(&page), "{page}: {items:?}");
            pages += 1;
        }
    }
    assert!(pages > 60, "{pages}");
}

#[test]
fn a_block_that_nobody_knows_is_a_mistake() {
    let text = "Words.\n\n    demhybrid a.toml   # why\n    b \\\n      c\n\n```python\nx\n```\n```toml\n# a.toml\n```\n";
    let command = |text: &str| Item::Command(text.to_owned());
    let found = items(text).unwrap();
    assert_eq!(found[..2], [command("demhybrid a.toml   # why"), command("b c")]);
    assert_eq!(found[2], Item::Python("x".to_owned()));
    assert_eq!(found[3], Item::Scene("a.toml".to_owned(), "# a.toml\n".to_owned()));
    assert!(items("```perl\n```\n").unwrap_err().contains("perl"));
    assert!(items("```sh\n").unwrap_err().contains("no end"));
    assert_eq!(items("```text\nx\n```\nA line\n    that is wrapped\n").unwrap(), []);
    assert!(plan("rm -rf /").unwrap_err().contains("unknown command"));
    assert!(plan("sbatch --array=1-10 launch/slurm.sbatch bed.toml").unwrap().run.is_some());
    assert!(plan("apt install x").is_err() && plan("qsub x").unwrap().run.is_none());
}
