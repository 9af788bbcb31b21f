//! A hard case: a scene file, what it says of itself, and the scene and particles with one of the methods.

use demhybrid::error::Error;
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::{self, InitialCondition};
use std::path::PathBuf;

/// Steps of velocity-verlet where a scene names none, s: a tenth of what the friction of the paper's material
/// bears.
const VERLET_STEP: &str = "1e-5";

/// The methods, the default first.
pub const METHODS: [&str; 5] = ["auto", "merson", "dormand-prince", "chebyshev", "velocity-verlet"];

/// The one outcome that is right.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Comes to rest, without a warning.
    Settles,
    /// Reaches its end, without a warning; where nothing makes it settle.
    Ends,
    /// Reaches its end with this warning.
    Warns(String),
    /// Ends with this exit code and message.
    Exit(i32, String),
}

/// A scene of tests/scenes/hard.
#[derive(Debug, Clone)]
pub struct Case {
    pub name: String,
    pub text: String,
    pub outcome: Outcome,
    /// What could break.
    pub peril: String,
    /// Further warnings that must be there.
    pub and_warns: Vec<String>,
    /// Warnings that one method or another may give.
    pub may_warn: Vec<String>,
    /// Something that is right here and wrong elsewhere.
    pub allowed: Vec<String>,
    /// Kinetic energy at the end, at least and at most, J.
    pub kinetic: Option<[f64; 2]>,
    /// Most steps of the default method.
    pub most_steps: u64,
    /// Methods that have no business here.
    without: Vec<String>,
    /// Keys to set with a method: name and KEY=VALUE.
    sets: Vec<(String, String)>,
}

/// The folder of the scenes.
pub fn folder() -> PathBuf {
    crate::common::root().join("tests/scenes/hard")
}

/// All hard cases, by name.
pub fn cases() -> Vec<Case> {
    let mut files: Vec<_> = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    assert!(files.len() >= 51, "{} scenes", files.len());
    let name = |file: &PathBuf| file.file_stem().unwrap().to_str().unwrap().to_owned();
    files.iter().map(|file| Case::read(&name(file))).collect()
}

impl Case {
    /// Reads the scene `name` and its first lines.
    pub fn read(name: &str) -> Self {
        let text = std::fs::read_to_string(folder().join(format!("{name}.toml"))).unwrap();
        let mut case = Case {
            name: name.into(),
            text: text.clone(),
            outcome: Outcome::Ends,
            peril: String::new(),
            and_warns: vec![],
            may_warn: vec![],
            allowed: vec![],
            kinetic: None,
            most_steps: 0,
            without: vec![],
            sets: vec![],
        };
        let mut expected = None;
        for line in text.lines().map_while(|line| line.strip_prefix("# ")) {
            let (key, value) = line.split_once(": ").unwrap_or((line, ""));
            match key.split(' ').collect::<Vec<_>>()[..] {
                ["what", ..] => case.peril = value.into(),
                ["expected"] => expected = Some(outcome(name, value)),
                ["and", "warns"] => case.and_warns.push(value.into()),
                ["may", "warn"] => case.may_warn.push(value.into()),
                ["but"] => case.allowed.push(value.into()),
                ["kinetic"] => {
                    let (low, high) = value.split_once(" to ").unwrap();
                    case.kinetic = Some([low, high].map(|number| number.parse().unwrap()));
                }
                ["steps"] => case.most_steps = value.strip_prefix("at most ").unwrap().parse().unwrap(),
                ["not", "with"] => case.without = value.split(", ").map(str::to_owned).collect(),
                ["with", method] => case.sets.push((method.into(), value.into())),
                _ => panic!("{name}: what does \"{line}\" mean?"),
            }
        }
        case.outcome = expected.unwrap_or_else(|| panic!("{name} states no outcome"));
        assert!(!case.peril.is_empty(), "{name} does not say what could break");
        case
    }

    /// Whether the method has any business here.
    pub fn is_for(&self, method: &str) -> bool {
        !self.without.iter().any(|other| other == method)
    }

    /// Whether what is wrong elsewhere is right here.
    pub fn allows(&self, what: &str) -> bool {
        self.allowed.iter().any(|allowed| allowed == what)
    }

    /// The keys to set for `method`.
    pub fn sets(&self, method: &str) -> Vec<String> {
        let mut sets = vec![format!("solver.method={method}")];
        if method == "velocity-verlet" {
            sets.push(format!("solver.step={VERLET_STEP}"));
        }
        let own = self.sets.iter().filter(|(name, _)| name == method || name == "all");
        sets.extend(own.map(|(_, set)| set.clone()));
        sets
    }

    /// What the program does before the first step.
    pub fn set_up(&self, method: &str) -> Result<(Scene, InitialCondition), Error> {
        // A fixed step has no tolerance: that line goes.
        let kept = |line: &&str| method != "velocity-verlet" || !line.starts_with("tolerance");
        let text: String = self.text.lines().filter(kept).flat_map(|line| [line, "\n"]).collect();
        let scene = Scene::parse(&self.name, &text, &self.sets(method))?;
        let start = match &scene.particles.grid {
            Some(grid) => initial_condition::grid(&scene, grid),
            None => initial_condition::read_csv(&scene, &folder())?,
        };
        initial_condition::check(&scene, &start)?;
        Ok((scene, start))
    }
}

fn outcome(name: &str, text: &str) -> Outcome {
    match text.split_once(' ') {
        None if text == "settles" => Outcome::Settles,
        None if text == "ends" => Outcome::Ends,
        Some(("warns", warning)) => Outcome::Warns(warning.into()),
        Some(("exit", rest)) => {
            let (code, message) = rest.split_once(' ').unwrap();
            Outcome::Exit(code.parse().unwrap(), message.into())
        }
        _ => panic!("{name}: \"{text}\" is no outcome"),
    }
}
