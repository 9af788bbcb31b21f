//! What an ensemble runs: its scenes, its seeds and the keys that vary.

use crate::scene::split_values;
use std::path::PathBuf;
use std::str::FromStr;

/// Largest number of seeds in an ensemble.
const MOST_SEEDS: usize = 100_000;

/// Scenes to run from many initial conditions.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Scene files. Several scenes are cases side by side.
    pub scenes: Vec<PathBuf>,
    /// Seeds of the initial conditions.
    pub seeds: Seeds,
    /// Keys that vary. Every combination of their values is a case.
    pub vary: Vec<Vary>,
    /// KEY=VALUE of every `--set`.
    pub set: Vec<String>,
}

/// Seeds in ascending order, without repetition. There is at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds(pub Vec<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "it must be a number of seeds such as 10 (seeds 1 to 10), a range such as 11-20, \
                    or a list such as 3,5,7";
        let number = |word: &str| word.trim().parse::<u64>().map_err(|_| form.to_owned());
        let mut seeds = Vec::new();
        let parts: Vec<&str> = text.split(',').collect();
        for part in &parts {
            let (from, to) = match part.split_once('-') {
                Some((from, to)) => (number(from)?, number(to)?),
                None if parts.len() == 1 => (1, number(part)?),
                None => (number(part)?, number(part)?),
            };
            if from > to {
                return Err(match parts.len() {
                    1 if to == 0 => "there must be at least one seed".to_owned(),
                    _ => format!("the range {part} is empty: its first number must not be above its last"),
                });
            }
            // The seed is stored in TOML, whose integers are signed and have 64 bits.
            if i64::try_from(to).is_err() {
                return Err(format!("{to} is too large: seeds go up to {}", i64::MAX));
            }
            if to - from >= MOST_SEEDS as u64 || seeds.len() >= MOST_SEEDS {
                return Err(format!("more than {MOST_SEEDS} seeds"));
            }
            seeds.extend(from..=to);
        }
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        match seeds.len() == count {
            true => Ok(Seeds(seeds)),
            false => Err("a seed is named twice".to_owned()),
        }
    }
}

/// A scene key and its values, for all scenes or for one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vary {
    /// Path or name of the scene that varies; `None`: all scenes.
    pub scene: Option<String>,
    /// Dotted path of the key.
    pub key: String,
    /// Values in TOML. There is at least one.
    pub values: Vec<String>,
}

impl FromStr for Vary {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "it must be KEY=V1,V2,.. such as friction.coefficient=0.1,0.2, or SCENE:KEY=V1,V2,..";
        let (head, list) = text.split_once('=').ok_or(form)?;
        let (scene, key) = match head.rsplit_once(':') {
            Some((scene, key)) => (Some(scene.trim().to_owned()), key),
            None => (None, head),
        };
        let (key, values) = (key.trim().to_owned(), split_values(list));
        if key.is_empty() || values.iter().any(String::is_empty) || scene.as_deref() == Some("") {
            return Err(form.into());
        }
        if ["grid", "random", "lattice"].iter().any(|start| key == format!("particles.{start}.seed")) {
            return Err(format!("{key} is what --seeds is for"));
        }
        if key == "output" || key.starts_with("output.") {
            return Err(format!("{key} is no part of the model: the files of an ensemble go to --output"));
        }
        Ok(Vary { scene, key, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_seeds_counts_from_one_and_lists_are_taken_as_they_are() {
        let seeds = |text: &str| text.parse::<Seeds>().map(|seeds| seeds.0);
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("7-7"), Ok(vec![7]));
        assert_eq!(seeds("3, 5,0"), Ok(vec![0, 3, 5]));
        assert_eq!(seeds("9,11-13"), Ok(vec![9, 11, 12, 13]));
        for (text, part) in [
            ("", "must be a number"),
            ("0", "at least one"),
            ("x", "must be a number"),
            ("5-3", "empty"),
            ("1,2,2", "twice"),
            ("1,2,,3", "must be a number"),
            ("-3", "must be a number"),
            ("99999999", "more than"),
            ("18446744073709551615-18446744073709551615", "too large"),
        ] {
            let why = seeds(text).unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }

    #[test]
    fn a_key_varies_in_all_scenes_or_in_one() {
        let vary: Vary = "friction.coefficient=0.1, 0.2".parse().unwrap();
        assert_eq!((vary.scene, vary.key.as_str()), (None, "friction.coefficient"));
        assert_eq!(vary.values, ["0.1", "0.2"]);
        let vary: Vary = "settle:gravity=[0,0,-1],[0,0,-2]".parse().unwrap();
        assert_eq!((vary.scene.as_deref(), vary.values.len()), (Some("settle"), 2));
        for (text, part) in [
            ("contact", "KEY=V1"),
            ("=1", "KEY=V1"),
            (":contact.restitution=1", "KEY=V1"),
            ("contact.restitution=1,,2", "KEY=V1"),
            ("particles.grid.seed=1,2", "--seeds"),
            ("particles.random.seed=1,2", "--seeds"),
            ("output.file=a,b", "--output"),
        ] {
            let why = text.parse::<Vary>().unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
    }
}
