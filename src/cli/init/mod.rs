//! `demhybrid init`: writes a scene to start from.

mod bed;

use crate::domain::launch;
use crate::error::Error;
use bed::Known;
use clap::Args;
use std::fs::OpenOptions;
use std::io::{Write, stderr, stdin};
use std::path::{Path, PathBuf};

/// The scene, with every key that exists. Keys that may be left out are behind `#`, with their defaults.
pub const SCENE: &str = include_str!("scene.toml");

/// What `demhybrid init` is asked for.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct InitArgs {
    /// Scene file to write
    #[arg(default_value = "scene.toml")]
    scene: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    known: Known,
    /// Ask for what the options leave out
    #[arg(long)]
    ask: bool,
}

/// Writes the scene that `args` ask for: with all keys, or a bed of which something is known.
pub fn run(args: &InitArgs) -> Result<(), Error> {
    let known = args.known.clone();
    let text = match args.ask {
        true => known.ask(&mut stdin().lock(), &mut stderr())?.scene()?,
        false if known.is_empty() => SCENE.to_owned(),
        false => known.scene()?,
    };
    write(&args.scene, args.force, &text)
}

/// Writes `text` to `path`; with `force` it replaces a file that exists.
fn write(path: &Path, force: bool, text: &str) -> Result<(), Error> {
    let named = path.display();
    let mut options = OpenOptions::new();
    let options = if force {
        options.write(true).create(true).truncate(true)
    } else {
        options.write(true).create_new(true)
    };
    options.open(path).and_then(|mut file| file.write_all(text.as_bytes())).map_err(|why| {
        Error::Input(match why.kind() {
            std::io::ErrorKind::AlreadyExists => {
                format!("{named}: the file exists; use --force to replace it, or give another name")
            }
            _ => format!("{named}: the scene cannot be written: {why}"),
        })
    })?;
    launch::say(&format!(
        "demhybrid: {named} is written; demhybrid {named} --dry-run tells what it would do"
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{DEFAULT_DAMPING, DEFAULT_STIFFNESS_RATIO, Scene, schema};

    /// The scene with all keys that are behind `#`. Sentences have a blank after the `#` and stay comments.
    fn with_all_keys() -> String {
        let uncommented = |line: &'static str| match line.strip_prefix("#") {
            Some(key) if !key.starts_with(' ') => key,
            _ => line,
        };
        SCENE.lines().map(|line| uncommented(line).to_owned() + "\n").collect()
    }

    #[test]
    fn it_is_a_valid_scene_and_so_are_its_defaults() {
        let scene = Scene::parse("scene.toml", SCENE, &[]).unwrap();
        assert_eq!(scene.particles.grid.as_ref().unwrap().count, 200);
        // Keys behind # have their defaults. They change nothing, except for those without a default.
        let all = with_all_keys();
        let mut spelt_out =
            Scene::parse("scene.toml", &all, &[]).unwrap_or_else(|why| panic!("{why}\n{all}"));
        assert!(spelt_out.checkpoint.take().is_some() && spelt_out.limits.take().is_some());
        assert!(spelt_out.stop.take().is_some());
        spelt_out.container.wall.clear();
        assert!(spelt_out.species.pop().is_some() && spelt_out.species.is_empty());
        assert!(spelt_out.particles.species_by.take().is_some());
        assert!(spelt_out.particles.species_seed.take().is_some());
        spelt_out.material.clear();
        // These values are computed if they are left out.
        (spelt_out.solver.velocity_scale, spelt_out.solver.neglected_force) = (None, None);
        let friction = spelt_out.friction.as_mut().unwrap();
        assert_eq!(friction.stiffness_ratio.take(), Some(DEFAULT_STIFFNESS_RATIO));
        assert_eq!(friction.damping.take(), Some(DEFAULT_DAMPING));
        friction.regularization_velocity = None;
        assert!(friction.rolling.take().is_some() && friction.twisting.take().is_some());
        assert_eq!(spelt_out, scene);
    }

    #[test]
    fn every_key_is_mentioned() {
        let schema: serde_json::Value = serde_json::from_str(&schema()).unwrap();
        fn keys(table: &serde_json::Value, found: &mut Vec<String>) {
            let inner = [&table["items"], &table["anyOf"][1], table];
            let inner = inner.into_iter().find_map(|inner| inner["properties"].as_object());
            for (name, value) in inner.into_iter().flatten() {
                found.push(name.clone());
                keys(value, found);
            }
        }
        let mut found = Vec::new();
        keys(&schema, &mut found);
        assert!(found.len() > 40, "{found:?}");
        let missing: Vec<_> = found.iter().filter(|name| !SCENE.contains(name.as_str())).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn a_file_that_is_there_is_kept_unless_told_otherwise() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "precious").unwrap();
        let refused = write(&path, false, SCENE).unwrap_err();
        assert!(refused.to_string().contains("a.toml: the file exists; use --force"), "{refused}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
        write(&path, true, SCENE).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), SCENE);
        assert_eq!(write(&folder.path().join("no/a.toml"), false, SCENE).unwrap_err().exit_code(), 2);
    }
}
