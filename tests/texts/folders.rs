//! The folders of src/ have one order: each uses only those below it. This reads all imports.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// From the top down; `main` and `lib` are the files beside the folders and may use all of them.
const ORDER: [&str; 12] = [
    "cli", "studies", "beds", "files", "engine", "domain", "scene", "model", "ode", "error", "math",
    "threads",
];

/// Entries of src/ at most.
const MOST_ENTRIES: usize = 14;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All Rust files below `folder`.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// The folder or file of src/ that `file` belongs to: `ode` of src/ode/verlet.rs, `error` of src/error.rs.
fn owner(file: &Path) -> String {
    let within = file.strip_prefix(source()).unwrap();
    let first = within.components().next().unwrap().as_os_str().to_str().unwrap();
    first.trim_end_matches(".rs").to_owned()
}

/// The source without comments, where paths in prose would count.
fn without_comments(text: &str) -> String {
    let code = |line: &str| {
        let end = line.find("//").unwrap_or(line.len());
        line[..end].to_owned()
    };
    text.lines().map(code).collect::<Vec<_>>().join("\n")
}

/// The folders that `text` names by a path from the root of the crate: `crate::a::b`, `crate::{a, b::c}`.
fn uses(text: &str) -> BTreeSet<String> {
    let word = |text: &str| -> String {
        text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let mut found = BTreeSet::new();
    for rest in without_comments(text).split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            None => {
                found.insert(word(rest));
            }
            Some(group) => {
                let mut depth = 1;
                let mut names = vec![String::new()];
                for c in group.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        ',' if depth == 1 => names.push(String::new()),
                        _ if depth == 1 => names.last_mut().unwrap().push(c),
                        _ => {}
                    }
                    if depth == 0 {
                        break;
                    }
                }
                found.extend(names.iter().map(|name| word(name)).filter(|name| !name.is_empty()));
            }
        }
    }
    found
}

/// Imports of a file of `owner` with this `text` that point to the side or up.
fn upward_imports(owner: &str, text: &str) -> Vec<String> {
    let height = |name: &str| ORDER.iter().position(|folder| *folder == name);
    let Some(own) = height(owner) else { return Vec::new() };
    let upward = |name: &String| height(name).is_none_or(|other| other < own);
    uses(text).into_iter().filter(upward).collect()
}

#[test]
fn src_holds_the_folders_of_the_order_and_nothing_else() {
    let entries: BTreeSet<String> = fs::read_dir(source())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_str().unwrap().trim_end_matches(".rs").to_owned())
        .collect();
    let expected = ORDER.iter().chain(&["main", "lib"]).map(ToString::to_string).collect();
    assert_eq!(entries, expected);
    assert!(entries.len() <= MOST_ENTRIES);
}

#[test]
fn a_folder_uses_only_those_below_it() {
    let mut faults = Vec::new();
    for file in rust_files(&source()) {
        let text = fs::read_to_string(&file).unwrap();
        for name in upward_imports(&owner(&file), &text) {
            faults.push(format!("{} uses {name}, which is not below it", file.display()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_module_with_children_is_a_folder_with_a_file_mod_rs() {
    for file in rust_files(&source()) {
        let folder = file.with_extension("");
        assert!(!folder.is_dir(), "{} stands beside {}", file.display(), folder.display());
    }
}

#[test]
fn every_module_says_first_what_it_is_for() {
    for file in rust_files(&source()) {
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("//! "), "{} has no first line", file.display());
    }
}

#[test]
fn an_upward_import_is_found_in_every_form() {
    for text in [
        "use crate::cli::Args;",
        "use crate::{error::Error, cli};",
        "use crate::{\n    math::{larger, vector::Vec3},\n    cli::run,\n};",
        "fn f() { crate::cli::run() }",
        "    use crate::cli;",
    ] {
        assert_eq!(upward_imports("engine", text), ["cli"], "{text}");
    }
    for text in
        ["use crate::ode::Method;", "// crate::cli", "/// See [`crate::cli`].", "use crate::engine::load;"]
    {
        assert!(upward_imports("engine", text).is_empty(), "{text}");
    }
}
