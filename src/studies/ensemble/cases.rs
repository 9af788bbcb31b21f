//! Turns the options of a command line into cases: each scene with every combination of the varied keys.

use super::measures::{Plan, simulated};
use super::{Case, Request, Vary, runs};
use crate::beds::folder::stem;
use crate::domain::Comm;
use crate::error::Error;
use crate::files::load::load as load_scene;
use crate::scene::{Scene, initial_condition};
use crate::studies::job_pool::JobPool;
use std::path::Path;

/// A scene that runs from many initial conditions.
#[derive(Debug)]
pub struct Variant {
    /// Name that tells it from the other cases.
    pub name: String,
    /// The scene. Its own seed is not used: each run takes the start with a seed of its own.
    pub scene: Scene,
}

/// Loads the cases and checks each of them with every seed. Collective.
pub fn load(request: &Request, comm: &dyn Comm) -> Result<Vec<Variant>, Error> {
    check_names(request)?;
    let mut variants = Vec::new();
    for path in &request.scenes {
        for combination in combinations(request, path) {
            variants.push(variant(request, path, &combination, comm)?);
        }
    }
    Ok(variants)
}

/// Whether `vary` applies to the scene at `path`.
fn means(vary: &Vary, path: &Path) -> bool {
    vary.scene.as_ref().is_none_or(|name| *name == stem(path) || path.to_str() == Some(name))
}

/// Checks that the names of scenes differ, that each prefix of `--vary` names a scene, and that no key varies
/// twice in a scene.
fn check_names(request: &Request) -> Result<(), Error> {
    for (k, path) in request.scenes.iter().enumerate() {
        if request.scenes[..k].iter().any(|other| stem(other) == stem(path)) {
            return Err(Error::Input(format!(
                "{}: another scene has the name {} too, and cases are told apart by the names of their \
                 scenes; give it another one",
                path.display(),
                stem(path)
            )));
        }
    }
    for (k, vary) in request.vary.iter().enumerate() {
        if let (Some(name), false) = (&vary.scene, request.scenes.iter().any(|path| means(vary, path))) {
            let names: Vec<String> = request.scenes.iter().map(|path| stem(path)).collect();
            return Err(Error::Input(format!(
                "--vary {name}:{}: no scene {name} is given; what stands before the colon must be one of {}",
                vary.key,
                names.join(", ")
            )));
        }
        let overlaps = |other: &&Vary| {
            other.key == vary.key && request.scenes.iter().any(|path| means(vary, path) && means(other, path))
        };
        if request.vary[..k].iter().any(|other| overlaps(&other)) {
            return Err(Error::Input(format!(
                "--vary {}: this key varies already; all of its values must stand in one option",
                vary.key
            )));
        }
    }
    Ok(())
}

/// Every combination of the values that vary in the scene at `path`. The last key varies fastest.
fn combinations<'a>(request: &'a Request, path: &Path) -> Vec<Vec<(&'a Vary, &'a str)>> {
    let mut all: Vec<Vec<(&Vary, &str)>> = vec![Vec::new()];
    for vary in request.vary.iter().filter(|vary| means(vary, path)) {
        let longer = |combination: &Vec<(&'a Vary, &'a str)>| -> Vec<Vec<(&'a Vary, &'a str)>> {
            vary.values
                .iter()
                .map(|value| [combination.clone(), vec![(vary, value.as_str())]].concat())
                .collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

/// Loads one case and checks it with every seed. Collective.
fn variant(
    request: &Request,
    path: &Path,
    combination: &[(&Vary, &str)],
    comm: &dyn Comm,
) -> Result<Variant, Error> {
    let sets: Vec<String> = combination.iter().map(|(vary, value)| format!("{}={value}", vary.key)).collect();
    let all: Vec<String> = request.set.iter().chain(&sets).cloned().collect();
    let (mut scene, _) = load_scene(path, &all, comm).map_err(|why| explained(request, &sets, why))?;
    if scene.particles.seed_mut().is_none() {
        return Err(Error::Input(format!(
            "{}: its particles come from a file, so that all seeds would give the same run; an ensemble \
             needs [particles.grid], [particles.random] or [particles.lattice]",
            path.display()
        )));
    }
    let words = combination.iter().map(|(vary, value)| (vary.key.as_str(), value.to_string()));
    let variant = Variant { name: name(&stem(path), words), scene };
    for &seed in &request.seeds.0 {
        initial_condition::seeded(&variant.scene, seed)
            .map_err(|why| Error::Input(format!("{}, seed {seed}: {why}", variant.name)))?;
    }
    Ok(variant)
}

/// The name of a case: the name of its scene, then the last part of each key with its value.
pub fn name<'a>(scene: &str, words: impl IntoIterator<Item = (&'a str, String)>) -> String {
    let mut name = scene.to_owned();
    for (key, value) in words {
        let short = key.rsplit('.').next().unwrap_or(key);
        name += &format!(" {short}={value}");
    }
    name
}

/// The error of a scene, reworded for `--vary` if a varied value caused it.
fn explained(request: &Request, sets: &[String], why: Error) -> Error {
    let Error::Input(text) = why else { return why };
    let Some(set) = sets.iter().find(|set| text.contains(set.as_str())).or(sets.first()) else {
        return Error::Input(text);
    };
    let told = text.replace(&format!("--set {set}"), &format!("--vary {set}"));
    let hint = match request.scenes.len() > 1 {
        true => format!(
            "\nwith --vary {set}: the name of a scene and a colon before the key let that scene alone vary"
        ),
        false if told == text => format!("\nwith --vary {set}"),
        false => String::new(),
    };
    Error::Input(told + &hint)
}

/// Runs all cases from all seeds. Collective.
pub fn run(pool: &JobPool, variants: &[Variant], seeds: &[u64], plan: &Plan) -> Vec<Case> {
    let jobs: Vec<(&Variant, u64)> =
        variants.iter().flat_map(|variant| seeds.iter().map(move |&seed| (variant, seed))).collect();
    let mut samples = pool
        .run("ensemble", &jobs, |(variant, seed)| {
            let start = initial_condition::seeded(&variant.scene, *seed);
            simulated(&variant.scene, &start.expect("it was checked with every seed"), plan)
        })
        .into_iter();
    let mut case = |variant: &Variant| Case {
        name: variant.name.clone(),
        scene: variant.scene.resolved(),
        runs: runs(seeds.iter().copied(), samples.by_ref().take(seeds.len())),
    };
    variants.iter().map(&mut case).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Solo;
    use crate::studies::ensemble::testing::TEXT;
    use std::path::PathBuf;

    /// The request that a command line with these options makes.
    fn request(scenes: &[PathBuf], words: &[&str]) -> Request {
        let mut request =
            Request { scenes: scenes.to_vec(), seeds: "2".parse().unwrap(), vary: vec![], set: vec![] };
        for option in words.chunks(2) {
            match option[0] {
                "--vary" => request.vary.push(option[1].parse().unwrap()),
                _ => request.set.push(option[1].to_owned()),
            }
        }
        request
    }

    /// Names of the cases of two scenes: plain.toml, and rough.toml, which has friction.
    fn names(words: &[&str]) -> Result<Vec<String>, Error> {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, more: &str| -> PathBuf {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("{TEXT}\n{more}")).unwrap();
            path
        };
        let friction = "friction = { coefficient = 0.3, regularization_velocity = 0.01 }";
        let (plain, rough) = (file("plain.toml", ""), file("rough.toml", friction));
        load(&request(&[plain, rough], words), &Solo)
            .map(|variants| variants.into_iter().map(|variant| variant.name).collect())
    }

    #[test]
    fn cases_are_scenes_with_all_combinations_of_their_values() {
        assert_eq!(names(&[]).unwrap(), ["plain", "rough"]);
        let both =
            names(&["--vary", "contact.restitution=0.4,1", "--vary", "rough:friction.coefficient=0,0.1"]);
        let expected = [
            "plain restitution=0.4",
            "plain restitution=1",
            "rough restitution=0.4 coefficient=0",
            "rough restitution=0.4 coefficient=0.1",
            "rough restitution=1 coefficient=0",
            "rough restitution=1 coefficient=0.1",
        ];
        assert_eq!(both.unwrap(), expected);
    }

    #[test]
    fn what_cannot_vary_is_told_with_what_would() {
        for (words, parts) in [
            (&["--vary", "smooth:contact.restitution=1"][..], &["smooth", "plain, rough"][..]),
            (&["--vary", "friction.rotation=true"], &["--vary", "friction.coefficient", "a colon"]),
            (&["--vary", "contact.restitution=2"], &["--vary contact.restitution=2"]),
            (&["--vary", "t_end=1", "--vary", "rough:t_end=2"], &["t_end", "varies already"]),
            (&["--set", "contact.restitution=2"], &["--set contact.restitution=2"]),
            (&["--set", "particles.grid.bottom=-1"], &["beyond"]),
        ] {
            let why = names(words).unwrap_err();
            assert_eq!(why.exit_code(), 2);
            assert!(parts.iter().all(|part| why.to_string().contains(part)), "{words:?}: {why}");
        }
    }
}
