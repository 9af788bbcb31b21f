//! Where cases come from.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use std::fmt::Debug;
use std::fs;
use std::path::Path;

/// Files that mutations start from.
pub struct Corpus {
    files: Vec<Vec<u8>>,
}

/// Numbers at the ends of what formats hold, and beyond.
#[rustfmt::skip]
const EXTREMES: &[&str] = &[
    "0", "-0.0", "1", "-1", "1e308", "-1e308", "1.7976931348623157e308", "1e309", "5e-324", "2e-308",
    "1e-400", "nan", "-nan", "inf", "+inf", "-inf", "1000000000000000000", "9223372036854775807",
    "9223372036854775808", "18446744073709551615", "18446744073709551616", "-9223372036854775809",
    "0x7fffffffffffffff", "0b1", "0o17", "1_000", "1__0", "1e", "1.", ".5", "+", "1000000000", "1000000001",
    "0.1", "1e-3", "1e150", "1e-160",
];

/// Values of every type.
#[rustfmt::skip]
const VALUES: &[&str] = &[
    "true", "false", "\"\"", "\" \"", "\"text\"", "'start.csv'", "\"\\u0000\"", "\"a\\nb\"", "\"/\"",
    "\"..\"", "\"start.csv/x\"", "[]", "[1]", "[0, 0, 0]", "[1, 2, 3]", "[0.0, 0.0, -9.81]",
    "[inf, 0, -inf]", "[-inf, -inf, -inf]", "[inf, inf, inf]", "[1e308, 1e308, 1e308]",
    "[-1e308, 5e-324, 0]", "[nan, 0, 0]", "[[1, 2, 3]]", "[{}]", "[{}, {}]", "{}", "{ a = 1 }",
    "{ min = [0, 0, 0] }", "[{ normal = [1, 0, 0] }]",
    "[{ normal = [5e-324, 0, 0], point = [1e308, 0, 0] }]", "1979-05-27", "07:32:00", "\"auto\"",
    "\"merson\"", "\"dormand-prince\"", "\"chebyshev\"", "\"velocity-verlet\"", "\"scaled\"", "\"paper\"",
    "[{ name = \"a\", density = 1e3, radius = 0.1 }]", "[{ name = \"a\", density = 1e300, radius = 1e-100 }]",
    "[{ name = \"a\", density = 1e3, radius = { uniform = [0, 1e308] } }]",
    "[{ name = \"a\", density = 1e3, radius = { normal = [1e308, 5e-324, -1, 1] } }]",
    "[{ name = \"a\", density = 1e3, radius = { lognormal = [1e-100, 3, 1e-102, 1e-98] } }]",
    "[{ name = \"a\", density = 1e3, radius = { points = [[0.1, 0], [0.2, 1]] } }]",
    "[{ name = \"a\", share = 1e-300, density = 1, radius = 1 }, { name = \"b\", share = 1, density = 1, radius = 1 }]",
    "\"mean\"", "\"history\"", "\"regularized\"", "text", "=", "a=b",
    "[{ name = 'a' }]", "[{ name = 'a', friction = 0, pair = [{ with = 'b', restitution = 1 }] }, { name = 'b' }]",
    "\"a\"", "[{ name = 'a', rolling = 1, twisting = 1e308 }, { name = 'a' }]",
];

/// Every key, and some that are none.
#[rustfmt::skip]
const KEYS: &[&str] = &[
    "t_end", "gravity", "particles", "particles.radius", "particles.mass", "particles.density", "particles.file",
    "particles.grid", "particles.grid.count", "particles.grid.spacing", "particles.grid.jitter",
    "particles.grid.bottom", "particles.grid.seed", "container", "container.box", "container.box.min",
    "container.box.max", "container.wall", "contact", "contact.repulsion_at_contact",
    "contact.stiffness_exponent", "contact.restitution", "contact.dissipation_focusing",
    "contact.interaction_distance", "friction", "friction.coefficient", "friction.regularization_velocity",
    "friction.rotation", "friction.law", "friction.stiffness_ratio", "friction.damping", "solver", "solver.method", "solver.tolerance", "solver.norm",
    "solver.velocity_scale", "solver.neglected_force", "solver.step", "solver.initial_step", "solver.min_step", "solver.max_step",
    "output", "output.file", "output.interval", "output.energy", "output.sync", "checkpoint", "checkpoint.interval",
    "checkpoint.wall", "limits", "limits.wall", "stop", "stop.unbalanced_force", "stop.kinetic_energy",
    "stop.height_change", "stop.window", "stop.speed", "stop.units", "x", "particles.x", "t_end.x", "contact.resitution",
    "species", "species.radius", "particles.species_by", "particles.species_seed", "species.material",
    "container.wall.normal", "container.wall.material", "container.box.material", "material", "material.name",
    "material.pair", "material.pair.with", "material.friction", "a.b.c.d.e", "", "..", "\"quoted\"",
];

const CSV_FIELDS: &[&str] = &[
    "x", "y", "z", "vx", "vy", "vz", "avx", "avy", "avz", "id", "", " ", ",", "\n", "\r\n", "\"", "\u{feff}",
    ";", "\t",
];

fn read(folder: &str, extension: &str) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).unwrap();
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|other| other == extension));
    paths.sort();
    paths.into_iter().map(|path| fs::read(path).unwrap()).collect()
}

impl Corpus {
    /// Good scenes three times, and bad ones.
    pub fn scenes() -> Self {
        let good = [read("tests/scenes/good", "toml"), read("configs", "toml")].concat();
        let files = [good.clone(), good.clone(), good, read("tests/scenes/bad", "toml")].concat();
        assert!(files.len() > 100);
        Corpus { files }
    }

    /// The bad ones are short: they need good company.
    pub fn particle_files() -> Self {
        let all = "x,y,z,vx,vy,vz,avx,avy,avz\n0.5,0.5,0.5,1,2,3,4,5,6\n0.5,0.5,1.0,-1e-3,0,0,0,0,1\n0.1,.3,2.,0,0,0,0,0,0\n";
        let mut files = [read("tests/scenes/good", "csv"), read("tests/scenes/bad/csv", "csv")].concat();
        assert!(files.len() > 15);
        files.resize(2 * files.len(), all.as_bytes().to_vec());
        Corpus { files }
    }
}

/// A change of a text. Positions are shares of its length, in 1/65536.
#[derive(Debug, Clone)]
pub enum Edit {
    Byte(u16, u8),
    Insert(u16, Vec<u8>),
    Word(u16, &'static str),
    Delete(u16, u16),
    Truncate(u16),
    DeleteLine(u16),
    RepeatLine(u16, u8),
    MoveLine(u16, u16),
    /// The number nearest to the position becomes another one.
    Number(u16, String),
    /// A piece comes many times.
    Stutter(u16, u8, u16),
    /// Goes on with another file.
    Splice(u16, u16),
}

/// A file of the corpus and what is done to it.
#[derive(Debug, Clone)]
pub struct Mutation {
    file: usize,
    edits: Vec<Edit>,
}

fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => select(EXTREMES).prop_map(str::to_owned),
        1 => any::<f64>().prop_map(|x| format!("{x:?}")),
        1 => any::<i64>().prop_map(|x| x.to_string()),
        2 => (-12i32..12, 1u32..100).prop_map(|(power, digits)| format!("{digits}e{power}")),
    ]
}

fn edit(words: &'static [&'static str]) -> impl Strategy<Value = Edit> {
    prop_oneof![
        2 => any::<(u16, u8)>().prop_map(|(at, byte)| Edit::Byte(at, byte)),
        1 => (any::<u16>(), vec(any::<u8>(), 1..8)).prop_map(|(at, bytes)| Edit::Insert(at, bytes)),
        1 => (any::<u16>(), select(words)).prop_map(|(at, word)| Edit::Word(at, word)),
        1 => (any::<u16>(), 0u16..2000).prop_map(|(at, length)| Edit::Delete(at, length)),
        1 => any::<u16>().prop_map(Edit::Truncate),
        2 => any::<u16>().prop_map(Edit::DeleteLine),
        1 => any::<(u16, u8)>().prop_map(|(at, times)| Edit::RepeatLine(at, times)),
        1 => any::<(u16, u16)>().prop_map(|(from, to)| Edit::MoveLine(from, to)),
        6 => (any::<u16>(), number()).prop_map(|(at, text)| Edit::Number(at, text)),
        1 => any::<(u16, u8, u16)>().prop_map(|(at, length, times)| Edit::Stutter(at, length, times)),
        1 => any::<(u16, u16)>().prop_map(|(at, file)| Edit::Splice(at, file)),
    ]
}

fn mutations(corpus: &Corpus, words: &'static [&'static str]) -> impl Strategy<Value = Mutation> + use<> {
    // Changed numbers alone leave more that is accepted.
    let figures = (any::<u16>(), number()).prop_map(|(at, text)| Edit::Number(at, text));
    let edits = prop_oneof![2 => vec(edit(words), 1..6), 1 => vec(figures, 1..4)];
    (0..corpus.files.len(), edits).prop_map(|(file, edits)| Mutation { file, edits })
}

/// Scenes with a few changes.
pub fn scenes(corpus: &Corpus) -> impl Strategy<Value = Mutation> + use<> {
    mutations(corpus, VALUES)
}

/// Particle files with a few changes.
pub fn particle_files(corpus: &Corpus) -> impl Strategy<Value = Mutation> + use<> {
    mutations(corpus, CSV_FIELDS)
}

/// Bytes that mutations may grow a text to.
const LARGEST: usize = 1 << 20;

fn position_at(text: &[u8], share: u16) -> usize {
    text.len() * usize::from(share) / (1 << 16)
}

/// The line around a position, with its end.
fn line(text: &[u8], share: u16) -> std::ops::Range<usize> {
    let at = position_at(text, share);
    let start = text[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    let end = text[at..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |end| at + end + 1);
    start..end
}

/// The first number from a position on, if any.
fn number_at(text: &[u8], share: u16) -> Option<std::ops::Range<usize>> {
    let at = position_at(text, share);
    let part = |byte: &u8| byte.is_ascii_digit() || b"+-.".contains(byte);
    let start = at + text[at..].iter().position(part)?;
    let end = start
        + text[start..].iter().position(|byte| !part(byte) && *byte != b'e').unwrap_or(text.len() - start);
    Some(start..end)
}

/// The text that a mutation makes.
pub fn edited(corpus: &Corpus, mutation: &Mutation) -> Vec<u8> {
    let mut text = corpus.files[mutation.file].clone();
    for edit in &mutation.edits {
        match edit {
            Edit::Byte(at, byte) => {
                let at = position_at(&text, *at);
                if let Some(old) = text.get_mut(at) {
                    *old = *byte;
                }
            }
            Edit::Insert(at, bytes) => {
                let at = position_at(&text, *at);
                text.splice(at..at, bytes.iter().copied());
            }
            Edit::Word(at, word) => {
                let at = position_at(&text, *at);
                text.splice(at..at, word.bytes());
            }
            Edit::Delete(at, length) => {
                let at = position_at(&text, *at);
                let end = text.len().min(at + usize::from(*length));
                text.drain(at..end);
            }
            Edit::Truncate(at) => text.truncate(position_at(&text, *at)),
            Edit::DeleteLine(at) => drop(text.drain(line(&text, *at))),
            Edit::RepeatLine(at, times) => {
                let line = line(&text, *at);
                let more = text[line.clone()].repeat(usize::from(*times));
                if text.len() + more.len() <= LARGEST {
                    text.splice(line.end..line.end, more);
                }
            }
            Edit::MoveLine(from, to) => {
                let moved: Vec<u8> = text.drain(line(&text, *from)).collect();
                let to = line(&text, *to).start;
                text.splice(to..to, moved);
            }
            Edit::Number(at, number) => {
                if let Some(old) = number_at(&text, *at) {
                    text.splice(old, number.bytes());
                }
            }
            Edit::Stutter(at, length, times) => {
                let at = position_at(&text, *at);
                let end = text.len().min(at + usize::from(*length));
                let more = text[at..end].repeat(usize::from(*times));
                if text.len() + more.len() <= LARGEST {
                    text.splice(at..at, more);
                }
            }
            Edit::Splice(at, file) => {
                let other = &corpus.files[usize::from(*file) % corpus.files.len()];
                text.truncate(position_at(&text, *at));
                text.extend_from_slice(&other[position_at(other, *at)..]);
            }
        }
    }
    text
}

/// Noise, or keys, values and punctuation in any order.
pub fn words() -> impl Strategy<Value = String> {
    let punctuation = select(
        &["=", "\n", "[", "]", "[[", "]]", ".", ",", "{", "}", "\"", "'", "#", " ", "\"\"\"", "\u{e4}"][..],
    );
    let word = prop_oneof![
        3 => select(KEYS).prop_map(str::to_owned),
        2 => select(VALUES).prop_map(str::to_owned),
        2 => number(),
        6 => punctuation.prop_map(str::to_owned),
        3 => (select(KEYS), select(VALUES)).prop_map(|(key, value)| format!("{key} = {value}\n")),
        1 => select(KEYS).prop_map(|key| format!("\n[{key}]\n")),
    ];
    prop_oneof![
        1 => any::<String>(),
        1 => vec(any::<u8>(), 0..300).prop_map(|bytes| String::from_utf8_lossy(&bytes).into_owned()),
        6 => vec(word, 0..40).prop_map(|words| words.concat()),
    ]
}

/// A good scene some of whose keys have other values.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Which of `BASES`.
    base: usize,
    /// Key, value, and whether it comes by `--set` or stands in the text.
    values: Vec<(&'static str, String, bool)>,
}

/// Scenes with a grid, with a file, and with contacts that remember.
const BASES: [&str; 3] = [
    include_str!("../../scenes/good/every-key.toml"),
    include_str!("../../scenes/good/required-keys-only.toml"),
    include_str!("../../scenes/good/memory.toml"),
];

impl Settings {
    /// The text; what is no TOML stands in it as it is.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut table: toml::Table = BASES[self.base].parse().expect("it is a scene");
        for (key, value, _) in self.values.iter().filter(|(_, _, set)| !set) {
            match format!("v = {value}").parse::<toml::Table>() {
                Ok(mut parsed) => put(&mut table, key, parsed.remove("v")),
                Err(_) => text += &format!("{key} = {value}\n"),
            }
        }
        text + &table.to_string()
    }

    pub fn sets(&self) -> Vec<String> {
        let sets = self.values.iter().filter(|(_, _, set)| *set);
        sets.map(|(key, value, _)| format!("{key}={value}")).collect()
    }
}

fn put(table: &mut toml::Table, key: &str, value: Option<toml::Value>) {
    let Some(value) = value else { return };
    match key.split_once('.') {
        None => drop(table.insert(key.to_owned(), value)),
        Some((first, rest)) => {
            let inner = table.entry(first).or_insert_with(|| toml::Table::new().into());
            if let Some(inner) = inner.as_table_mut() {
                put(inner, rest, Some(value));
            }
        }
    }
}

/// Keys that take a number > 0.
#[rustfmt::skip]
const POSITIVE: &[&str] = &[
    "t_end", "particles.radius", "particles.mass", "particles.grid.spacing", "particles.grid.jitter",
    "particles.grid.bottom", "contact.repulsion_at_contact", "contact.stiffness_exponent",
    "contact.dissipation_focusing", "contact.interaction_distance", "friction.coefficient",
    "friction.regularization_velocity", "friction.stiffness_ratio", "friction.damping", "friction.rolling.coefficient",
    "friction.twisting.coefficient", "solver.tolerance",
    "solver.velocity_scale", "solver.initial_step", "solver.min_step", "solver.max_step", "output.interval", "checkpoint.interval", "checkpoint.wall",
    "limits.wall",
];

/// Settings that are right, so that steps are taken by every method and of every effect.
#[rustfmt::skip]
const RIGHT: &[(&str, &str)] = &[
    ("contact.restitution", "1"), ("contact.restitution", "0"), ("contact.restitution", "0.7"),
    ("friction.coefficient", "0"), ("friction", "{ coefficient = 0.2, regularization_velocity = 0.01 }"),
    ("friction", "{ law = \"history\", coefficient = 0.3 }"), ("friction.law", "\"history\""),
    ("friction", "{ law = \"history\", coefficient = 0.3, rolling = { coefficient = 0.1 } }"),
    ("friction.rolling", "{ coefficient = 0.05 }"), ("friction.twisting", "{ coefficient = 0 }"),
    ("friction", "{ law = \"history\", coefficient = 0.3, twisting = { coefficient = 10 } }"),
    ("friction.law", "\"regularized\""), ("friction.damping", "0"), ("solver.norm", "\"mean\""),
    ("friction.rotation", "false"), ("output.energy", "true"), ("output.sync", "\"end\""),
    ("solver", "{ method = \"velocity-verlet\", step = 1e-4 }"),
    ("solver", "{ method = \"velocity-verlet\", step = 1e300 }"), ("solver.method", "\"auto\""),
    ("solver.method", "\"chebyshev\""), ("solver.method", "\"dormand-prince\""),
    ("solver.norm", "\"scaled\""), ("gravity", "[0, 0, 0]"), ("gravity", "[1e308, 1e308, 1e308]"),
    ("species", "[{ name = \"a\", density = 1e3, radius = { lognormal = [0.05, 0.4, 0.02, 0.1] } }]"),
    ("species", "[{ name = \"a\", density = 1e3, radius = { normal = [0.05, 0.04, 0.01, 0.1] } }]"),
    ("gravity", "[0, 5e-324, 0]"), ("particles.grid.count", "1"), ("particles.grid.count", "60"),
    ("particles.grid.count", "1000000000"),
    ("container.wall", "[{ normal = [0, 0, -1], point = [0, 0, -1e300] }]"),
    ("particles.grid.bottom", "-0.3"),
    ("container.box", "{ min = [-1e308, -1e308, -1e308], max = [1e308, 1e308, 1e308] }"),
    ("container.box", "{ min = [-1e9, -1e9, -inf], max = [1e9, 1e9, inf] }"),
];

/// Known keys with values of any type and size.
pub fn settings() -> impl Strategy<Value = Settings> {
    let text = any::<String>().prop_map(|text| toml::Value::String(text).to_string());
    let any_value = prop_oneof![
        3 => number(),
        2 => select(VALUES).prop_map(str::to_owned),
        1 => text,
        2 => (number(), number(), number()).prop_map(|(a, b, c)| format!("[{a}, {b}, {c}]")),
        1 => any::<String>(),
    ];
    let positive = prop_oneof![
        (-310i32..309).prop_map(|power| format!("1e{power}")),
        (-4i32..4, 1u32..100).prop_map(|(power, digits)| format!("{digits}e{power}")),
    ];
    let pair = prop_oneof![
        2 => (select(KEYS), any_value),
        8 => (select(POSITIVE), positive),
        5 => select(RIGHT).prop_map(|(key, value)| (key, value.to_owned())),
    ];
    let pair = (pair, any::<bool>()).prop_map(|((key, value), set)| (key, value, set));
    (0..BASES.len(), vec(pair, 1..5)).prop_map(|(base, values)| Settings { base, values })
}
