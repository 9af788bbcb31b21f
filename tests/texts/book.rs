//! The book under docs: its tables of scene keys are those of the program, and its chapters and links, and
//! those of the pages in the root, are there.

use demhybrid::scene::{Scene, schema};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")
}

/// Type, unit, default, range, equation and meaning of every key in the chapter.
fn chapter() -> BTreeMap<String, Vec<String>> {
    let text = fs::read_to_string(docs().join("keys.md")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| `"));
    let cells = |line: &str| line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect();
    let mut found = BTreeMap::new();
    for mut row in rows.map(cells).collect::<Vec<Vec<String>>>() {
        assert_eq!(row.len(), 7, "{row:?}");
        let key = row.remove(0).trim_matches('`').to_owned();
        assert!(found.insert(key.clone(), row).is_none(), "{key} is there twice");
    }
    found
}

/// Every key of the schema with its entry, and whether its table must have it.
fn keys(table: &Value, above: &str, found: &mut BTreeMap<String, (Value, bool)>) {
    let required = table["required"].as_array().unwrap();
    for (name, entry) in table["properties"].as_object().unwrap() {
        let path = format!("{above}{name}");
        let inner = [&entry["items"], &entry["anyOf"][1], entry];
        if let Some(inner) = inner.into_iter().find(|inner| inner["properties"].is_object()) {
            keys(inner, &format!("{path}."), found);
        }
        found.insert(path, (entry.clone(), required.contains(&Value::from(name.as_str()))));
    }
}

/// The unit in a meaning: the word behind the first "in" that is one.
fn unit(meaning: &str) -> &str {
    const UNITS: [&str; 9] = ["s", "m", "kg", "kg/m^3", "N", "J", "1/m", "s/m", "m/s"];
    let words: Vec<&str> = meaning.split([' ', ',']).collect();
    let follows = words.windows(2).filter(|pair| pair[0] == "in").map(|pair| pair[1]);
    follows.into_iter().find(|unit| UNITS.contains(unit) || *unit == "m/s^2").unwrap_or("-")
}

fn type_and_range(path: &str, entry: &Value) -> [String; 2] {
    let of = |kind: &str, range: &str| [kind.to_owned(), range.to_owned()];
    if let Some(words) = entry["enum"].as_array() {
        let words: Vec<String> = words.iter().map(|word| format!("`{}`", word.as_str().unwrap())).collect();
        return of("word", &format!("one of {}", words.join(", ")));
    }
    if let Some(either) = entry["anyOf"].as_array() {
        let both = either.iter().map(|one| type_and_range(path, one)).collect::<Vec<_>>();
        if both[1][0] == "table" {
            return of(&format!("{} or table", both[0][0]), &both[0][1]);
        }
        let joined = |k: usize, between: &str| [&both[0][k][..], &both[1][k]].join(between);
        return [joined(0, " or "), joined(1, ", or ")];
    }
    match entry["type"].as_str().unwrap() {
        "array" if entry["items"]["properties"].is_object() => of("tables", "-"),
        "array" if ["container.box.", "particles.random.region."].iter().any(|at| path.starts_with(at)) => {
            of("3 numbers", "finite or infinite")
        }
        "array" if entry["items"]["type"] == "array" => of("pairs of numbers", "finite"),
        "array" => of(&format!("{} numbers", entry["minItems"]), "finite"),
        "object" => of("table", "-"),
        "boolean" => of("switch", "true, false"),
        "string" => of("text", "not empty"),
        "integer" => of("integer", &format!("{}..{}", entry["minimum"], entry["maximum"])),
        _ if entry["exclusiveMaximum"] == 1 => of("number", "> 0 and < 1"),
        _ if entry["exclusiveMinimum"] == 0 => of("number", "> 0"),
        _ if entry["maximum"] == 1 => of("number", "0..1"),
        _ if entry["minimum"] == 0 => of("number", ">= 0"),
        _ => of("number", "finite"),
    }
}

#[test]
fn the_tables_have_the_keys_types_units_ranges_and_meanings_of_the_schema() {
    let mut known = BTreeMap::new();
    keys(&serde_json::from_str(&schema()).unwrap(), "", &mut known);
    let chapter = chapter();
    let names = |map: Vec<&String>| map.into_iter().cloned().collect::<Vec<_>>();
    assert_eq!(names(chapter.keys().collect()), names(known.keys().collect()));
    for (path, (entry, required)) in &known {
        let row = &chapter[path];
        let meaning = entry["description"].as_str().unwrap();
        assert_eq!([&row[0], &row[3]].map(String::as_str), type_and_range(path, entry), "{path}");
        assert_eq!(row[1], unit(meaning), "unit of {path}");
        assert_eq!(row[2] == "required", *required, "default of {path}");
        assert_eq!(row[5], meaning, "{path}");
    }
}

#[test]
fn the_defaults_are_those_of_a_scene_that_says_as_little_as_it_may() {
    let text = "
        t_end = 8
        particles = { radius = 0.1, mass = 1, grid = {} }
        container = { box = {}, wall = [{}] }
        friction = { coefficient = 0.2, regularization_velocity = 0.01 }
        stop = { height_change = 1 }
        [contact]
        repulsion_at_contact = 10
        stiffness_exponent = 150
        restitution = 0.4
        dissipation_focusing = 10
        interaction_distance = 0.1";
    let scene = Scene::parse("bed.toml", text, &[]).unwrap();
    let resolved: toml::Table = scene.resolved().parse().unwrap();
    // What a scene cannot say in TOML: computed, drawn, or absent.
    let in_words = BTreeMap::from([
        ("container.box.max", "10 radii in x and y, inf"),
        ("contact.dissipation_focusing", "10/sqrt(g r); required without gravity"),
        ("contact.interaction_distance", "required; or `contact.overlap`"),
        ("contact.repulsion_at_contact", "required; or `contact.overlap`"),
        ("contact.stiffness_exponent", "required; or `contact.overlap`"),
        ("output.file", "name of the scene"),
        ("output.interval", "t_end/100"),
        ("particles.density", "none; this or `particles.mass`"),
        ("particles.mass", "none; this or `particles.density`"),
        ("particles.file", "none; this or another source"),
        ("particles.run", "none; this or another source"),
        ("particles.push_apart", "false"),
        ("particles.random.fraction", "0.3 if open above, else as count and region give"),
        ("particles.random.seed", "drawn"),
        ("particles.lattice.bottom", "the floor"),
        ("particles.lattice.jitter", "0"),
        ("particles.lattice.seed", "drawn"),
        ("particles.lattice.spacing", "2.02 radii"),
        ("particles.species_by", "\"number\""),
        ("particles.species_seed", "the seed of the source"),
        ("species.density", "`particles.density`"),
        ("species.material", "the material of its name, if there is one"),
        ("species.share", "1 for a species that is alone"),
        ("particles.grid.bottom", "11 radii above the floor"),
        ("particles.grid.jitter", "radius/4"),
        ("particles.grid.seed", "drawn"),
        ("particles.grid.spacing", "2.5 radii"),
        ("friction.regularization_velocity", "0.01 sqrt(g r); required by `regularized` without gravity"),
        ("particles.radius", "none; required unless `particles.file` or species have radii"),
        ("friction.stiffness_ratio", "0.5"),
        ("friction.damping", "1"),
        ("material.restitution", "that of `[contact]`"),
        ("material.friction", "that of `[friction]`"),
        ("material.rolling", "that of `[friction]`"),
        ("material.twisting", "that of `[friction]`"),
        ("material.pair.restitution", "geometric mean"),
        ("material.pair.friction", "geometric mean"),
        ("material.pair.rolling", "geometric mean"),
        ("material.pair.twisting", "geometric mean"),
        ("solver.norm", "\"scaled\"; \"mean\" with `friction.law = \"history\"`"),
        ("solver.step", "none; required by velocity-verlet"),
        ("solver.neglected_force", "from the tolerance"),
        ("solver.tolerance", "0.1, less for a small `friction.regularization_velocity`"),
        ("solver.velocity_scale", "from gravity and radius"),
        ("stop.speed", "0.01 v, at least 5 v_min"),
        ("stop.window", "r/v"),
    ]);
    assert_eq!(resolved["output"]["file"].as_str(), Some("bed.vtkhdf"));
    assert_eq!(resolved["output"]["interval"].as_float(), Some(8.0 / 100.0));
    for (path, row) in chapter() {
        let default = row[2].as_str();
        if default == "required" || ["table", "tables"].contains(&row[0].as_str()) {
            continue;
        }
        if let Some(&words) = in_words.get(path.as_str()) {
            assert_eq!(default, words, "{path}");
            continue;
        }
        // The only criterion of [stop] that the scene above had to give.
        if path == "stop.height_change" {
            assert_eq!(default, "none");
            continue;
        }
        let first = |value: &toml::Value| match value {
            toml::Value::Array(list) if list[0].is_table() => list[0].clone(),
            other => other.clone(),
        };
        let value = path
            .split('.')
            .try_fold(toml::Value::Table(resolved.clone()), |table, name| table.get(name).map(first));
        let Some(value) = value else {
            assert_eq!(default, "none", "{path}");
            continue;
        };
        let said = &format!("x = {default}")
            .parse::<toml::Table>()
            .unwrap_or_else(|why| panic!("{path}: {why}"))["x"];
        let numbers = |value: &toml::Value| -> Option<Vec<f64>> {
            let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|n| n as f64));
            match value {
                toml::Value::Array(list) => list.iter().map(number).collect(),
                other => number(other).map(|number| vec![number]),
            }
        };
        assert!(
            said == &value || numbers(said).is_some_and(|said| numbers(&value) == Some(said)),
            "{path}: {value} is not {default}"
        );
    }
}

/// What stands for a key in the formulas of the model. All other keys stand in none.
const SYMBOLS: &[(&str, &[&str])] = &[
    ("contact.dissipation_focusing", &["psi"]),
    ("contact.interaction_distance", &["l_max"]),
    ("contact.repulsion_at_contact", &["F_0"]),
    ("contact.restitution", &["e"]),
    ("contact.stiffness_exponent", &["kappa"]),
    ("container.box.max", &["d"]),
    ("container.box.min", &["d"]),
    ("container.wall.normal", &["d", "n"]),
    ("container.wall.point", &["d"]),
    ("friction.coefficient", &["phi"]),
    ("friction.regularization_velocity", &["v_min"]),
    ("friction.rotation", &["omega", "tau"]),
    ("gravity", &["g"]),
    ("particles.mass", &["m"]),
    ("particles.radius", &["r"]),
];

/// Equations of the paper that are of walls only.
const OF_WALLS: [&str; 4] = ["(2.5)", "(2.9)", "(2.10)", "(2.12)"];

/// The numbers in "(2.3), (2.5)-(2.7)", all of them; a reference of another kind as it is.
fn equations(cell: &str) -> BTreeSet<String> {
    let last =
        |number: &str| number.trim_matches(['(', ')']).strip_prefix("2.").unwrap().parse::<u32>().unwrap();
    let mut found = BTreeSet::new();
    for part in cell.split(", ").filter(|part| !["", "-"].contains(part)) {
        match part.split_once(")-(") {
            Some((from, to)) => found.extend((last(from)..=last(to)).map(|k| format!("(2.{k})"))),
            None => _ = found.insert(part.to_owned()),
        }
    }
    found
}

#[test]
fn the_equations_of_a_key_are_those_in_which_the_model_has_its_symbol() {
    let model = fs::read_to_string(docs().join("model.md")).unwrap();
    let formulas = model.split("## In formulas").nth(1).unwrap().split("\n\n").nth(1).unwrap();
    let rows: Vec<(BTreeSet<&str>, BTreeSet<String>)> = formulas
        .lines()
        .skip(2)
        .map(|line| {
            let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
            assert_eq!(cells.len(), 3, "{line}");
            let words = cells[1].split(|c: char| !c.is_alphanumeric() && c != '_').collect();
            (words, equations(cells[2]))
        })
        .collect();
    for (key, row) in chapter() {
        let symbols = SYMBOLS.iter().find(|(name, _)| *name == key).map_or(&[][..], |(_, symbols)| symbols);
        let has = |words: &BTreeSet<&str>, symbol: &&str| words.contains(symbol);
        assert!(symbols.iter().all(|symbol| rows.iter().any(|(words, _)| has(words, symbol))), "{key}");
        let expected = rows
            .iter()
            .filter(|(words, _)| symbols.iter().any(|symbol| has(words, symbol)))
            .flat_map(|(_, numbers)| numbers.clone())
            .filter(|number| !key.starts_with("container.") || OF_WALLS.contains(&number.as_str()))
            .collect();
        assert_eq!(equations(&row[4]), expected, "{key}");
    }

    // The model has all equations of the paper's section 2, and the table of the crate says where each is
    // computed.
    let of_the_paper = equations("(2.1)-(2.15)");
    let of_the_model: BTreeSet<String> = rows.into_iter().flat_map(|(_, numbers)| numbers).collect();
    assert!(of_the_model.is_superset(&of_the_paper), "{of_the_model:?}");
    let of_the_crate: BTreeSet<String> = include_str!("../../src/lib.rs")
        .lines()
        .filter_map(|line| line.strip_prefix("//! | (")?.split(" | ").next())
        .flat_map(|cell| equations(&format!("({cell}")))
        .collect();
    assert_eq!(of_the_crate, of_the_paper);
}

/// The Markdown files of a folder, below the root of the package.
fn pages(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).unwrap();
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    found.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    found.sort();
    found
}

#[test]
fn every_page_is_a_chapter() {
    let summary = fs::read_to_string(docs().join("SUMMARY.md")).unwrap();
    let chapters = [pages("docs"), pages("docs/decisions")].concat();
    for path in &chapters {
        let name = path.strip_prefix(docs()).unwrap().to_str().unwrap();
        assert!(name == "SUMMARY.md" || summary.contains(&format!("({name})")), "{name} is no chapter");
    }
    assert!(chapters.len() > 60, "{chapters:?}");
    for path in pages("docs/decisions") {
        let name = format!("(decisions/{})", path.file_name().unwrap().to_str().unwrap());
        assert!(
            fs::read_to_string(docs().join("decisions.md")).unwrap().contains(&name),
            "{name} is not listed"
        );
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut links = 0;
    for path in [pages(""), pages("docs"), pages("docs/decisions")].concat() {
        let text = fs::read_to_string(&path).unwrap();
        for link in text.split("](").skip(1) {
            let target = link.split(')').next().unwrap();
            if target.starts_with("http") {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(file.exists(), "{} links to {target}", path.display());
            let there = heading.is_empty() || headings(&fs::read_to_string(&file).unwrap()).contains(heading);
            assert!(there, "{} links to {target}", path.display());
            links += 1;
        }
    }
    assert!(links > 200, "{links}");
}

/// The headings of a page as links name them: lower case, with hyphens for blanks.
fn headings(text: &str) -> BTreeSet<String> {
    let lines = text.lines().filter(|line| line.starts_with('#'));
    let name = |line: &str| -> String {
        let words = line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
        words.chars().filter(|c| c.is_alphanumeric() || "-_".contains(*c)).collect()
    };
    lines.map(name).collect()
}
