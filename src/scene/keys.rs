//! The list of all keys of a scene, with type, range, unit and a typical value. Messages quote it.

use super::SyncEvery;
use super::species::SpeciesBy;
use super::stop::Units;
use crate::model::effects::FrictionLaw;
use crate::ode::{MethodName, NormName};
use Kind::{Count, Number, NumberOrTable, Numbers, Pairs, Seed, Switch, Table, Tables, Text, Vector};
use Kind::{Word, WordOrNumber};
use Range::{Finite, NotNegative, PartOf, Positive, PositiveOrInfinite, Share};

/// The description of one key.
pub(super) struct Key {
    /// Dotted path from the top of the scene. All entries of `container.wall` share one path.
    pub path: &'static str,
    /// Type and range of its value.
    pub kind: Kind,
    /// Whether its table must contain it.
    pub required: bool,
    /// Its meaning, with symbol and unit. Messages put it after "it is".
    pub meaning: &'static str,
    /// A typical value, in TOML.
    pub example: &'static str,
}

/// Type and range of a value.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// A number within a range.
    Number(Range),
    /// Three numbers; `open` allows infinite ones.
    Vector { open: bool },
    /// This many finite numbers.
    Numbers(usize),
    /// Pairs of finite numbers, one or more.
    Pairs,
    /// Number of particles, in 1..=[`LARGEST_COUNT`].
    Count,
    /// An unsigned integer of 64 bits.
    Seed,
    /// `true` or `false`.
    Switch,
    /// Text that is not blank.
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// One of these words, or a number within a range.
    WordOrNumber(&'static [&'static str], Range),
    /// A number within a range, or a table of further keys.
    NumberOrTable(Range),
    /// A table of further keys.
    Table,
    /// A list of tables.
    Tables,
}

/// Range of a number. No range contains NaN, and only the last one contains infinity.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Range {
    Finite,
    Positive,
    NotNegative,
    Share,
    PartOf,
    PositiveOrInfinite,
}

/// Largest number of particles of one run.
pub(super) const LARGEST_COUNT: u64 = 1_000_000_000;

const fn required(path: &'static str, kind: Kind, meaning: &'static str, example: &'static str) -> Key {
    Key { path, kind, required: true, meaning, example }
}

const fn optional(path: &'static str, kind: Kind, meaning: &'static str, example: &'static str) -> Key {
    Key { path, kind, required: false, meaning, example }
}

/// All keys. Those of one table are in the order in which messages list them.
#[rustfmt::skip]
pub(super) const KEYS: &[Key] = &[
    required("t_end", Number(Positive), "the simulated time in s", "8.0"),
    optional("gravity", Vector { open: false }, "the acceleration of gravity in m/s^2", "[0.0, 0.0, -9.81]"),
    required("particles", Table,
             "the table of the spheres and their source", "{ radius = 0.1, mass = 1, file = \"start.csv\" }"),
    optional("species", Tables, "the list of species, each opened by [[species]]",
             "[{ name = \"sand\", density = 2650.0, radius = { uniform = [0.05, 0.1] } }]"),
    optional("container", Table,
             "the table of the walls", "{ box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] } }"),
    required("contact", Table, "the table of the contact law",
             "[contact] with overlap and restitution"),
    optional("friction", Table,
             "the table of the friction law", "{ coefficient = 0.2, regularization_velocity = 0.01 }"),
    optional("material", Tables, "the list of materials, each opened by [[material]]",
             "[{ name = \"glass\", friction = 0.3 }]"),
    optional("solver", Table, "the table of the time stepping", "{ tolerance = 0.1 }"),
    optional("output", Table, "the table of the output file", "{ interval = 0.02 }"),
    optional("checkpoint", Table, "the table of the checkpoints", "{ interval = 0.5 }"),
    optional("limits", Table, "the table of what stops a run early", "{ wall = 3600.0 }"),
    optional("stop", Table,
             "the table of when the spheres are at rest, which ends the run", "{ kinetic_energy = 1e-6 }"),

    optional("particles.radius", Number(Positive),
             "the radius r of every sphere, or of a typical one where particles.file or species have radii, \
              in m",
             "0.1"),
    optional("particles.mass", Number(Positive),
             "the mass of one sphere, 4/3 pi r^3 times its density, in kg", "1.0"),
    optional("particles.density", Number(Positive), "the density of the spheres in kg/m^3", "2500.0"),
    optional("particles.species_by", Word(SpeciesBy::NAMES), "what the shares of species are shares of",
             "\"mass\""),
    optional("particles.species_seed", Seed,
             "the seed of the order in which species and sizes are given to spheres", "1"),
    optional("particles.file", Text,
             "the path of a CSV file with the columns x,y,z and perhaps radius, mass, density, species, \
              material",
             "\"start.csv\""),
    optional("particles.run", Text,
             "the path of the file of another run, whose last frame is the start", "\"other.vtkhdf\""),
    optional("particles.push_apart", Switch,
             "whether spheres that overlap at the start are pushed apart before the run", "true"),
    optional("particles.grid", Table,
             "the table of the randomly perturbed grid", "{ count = 200, spacing = 0.25 }"),
    optional("particles.grid.count", Count, "the number of spheres", "200"),
    optional("particles.grid.spacing", Number(Positive), "the side of a cell of the grid in m", "0.25"),
    optional("particles.grid.jitter", Number(NotNegative),
             "the largest random shift of a sphere in m", "0.025"),
    optional("particles.grid.bottom", Number(Finite), "the height of the lowest cells in m", "1.1"),
    optional("particles.grid.seed", Seed, "the seed of the random shifts", "1"),
    optional("particles.random", Table,
             "the table of random places without an overlap", "{ count = 200, fraction = 0.3 }"),
    required("particles.random.count", Count, "the number of spheres", "200"),
    optional("particles.random.fraction", Number(Positive),
             "the volume of the spheres over that of the room that they take, at most 0.5", "0.3"),
    optional("particles.random.seed", Seed, "the seed of the random places", "1"),
    optional("particles.random.region", Table, "the table of the part of the container where they start",
             "{ min = [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] }"),
    required("particles.random.region.min", Vector { open: true },
             "the lower corner of the region in m (-inf: as far as the walls)", "[0.0, 0.0, 0.0]"),
    required("particles.random.region.max", Vector { open: true },
             "the upper corner of the region in m (inf: as far as the walls)", "[1.0, 1.0, inf]"),
    optional("particles.lattice", Table,
             "the table of the hexagonal close packed lattice", "{ count = 200, spacing = 0.202 }"),
    required("particles.lattice.count", Count, "the number of spheres", "200"),
    optional("particles.lattice.spacing", Number(Positive),
             "the distance of neighbouring centres in m, at least 2 radii", "0.202"),
    optional("particles.lattice.jitter", Number(NotNegative),
             "the largest random shift of a sphere in m", "0.0"),
    optional("particles.lattice.bottom", Number(Finite),
             "the height in m of the plane on which the lowest layer lies", "0.0"),
    optional("particles.lattice.seed", Seed, "the seed of the random shifts", "1"),

    required("species.name", Text, "the name of the species", "\"coarse\""),
    optional("species.share", Number(Share),
             "the share of the species, of what particles.species_by says", "0.7"),
    optional("species.density", Number(Positive), "the density of its spheres in kg/m^3", "2500.0"),
    optional("species.material", Text, "the name of the material of its spheres", "\"glass\""),
    required("species.radius", NumberOrTable(Positive),
             "the radius of its spheres in m, or the table that says how they are spread", "0.1"),
    optional("species.radius.uniform", Numbers(2),
             "the least and the largest radius in m, between which all are equally frequent", "[0.05, 0.1]"),
    optional("species.radius.normal", Numbers(4),
             "mean, standard deviation, least and largest radius in m of a normal distribution by number",
             "[0.1, 0.02, 0.05, 0.15]"),
    optional("species.radius.lognormal", Numbers(4),
             "median, standard deviation of ln r, least and largest radius in m of a lognormal distribution by \
              number",
             "[0.1, 0.3]"),
    optional("species.radius.table", Text,
             "the path of a CSV file with the columns radius or diameter and share, the share of the mass \
              below it",
             "\"sieve.csv\""),
    optional("species.radius.points", Pairs,
             "the points of a sieve curve in place of a table: a radius in m and the share of the mass below \
              it",
             "[[0.05, 0.0], [0.15, 1.0]]"),

    optional("container.box", Table,
             "the table of the box", "{ min = [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] }"),
    optional("container.box.min", Vector { open: true },
             "the lower corner of the box in m (-inf: open)", "[0.0, 0.0, 0.0]"),
    optional("container.box.max", Vector { open: true },
             "the upper corner of the box in m (inf: open)", "[1.0, 1.0, inf]"),
    optional("container.box.material", Text, "the name of the material of all sides of the box",
             "\"steel\""),
    optional("container.wall", Tables, "the list of plane walls, each opened by [[container.wall]]",
             "[{ point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, -1.0] }]"),
    optional("container.wall.point", Vector { open: false }, "a point of the wall in m", "[0.0, 0.0, 0.0]"),
    optional("container.wall.normal", Vector { open: false },
             "the outward normal of the wall, of any length", "[0.0, 0.0, -1.0]"),
    optional("container.wall.material", Text, "the name of the material of the wall", "\"steel\""),

    optional("contact.overlap", Number(PartOf), "the largest share of the radius that a load presses in", "0.05"),
    optional("contact.drop", Number(Positive),
             "the speed in m/s of the hardest impact that contact.overlap is for", "0.5"),
    optional("contact.repulsion_at_contact", Number(Positive),
             "the repulsion F_0 of spheres that just touch in N", "10.0"),
    optional("contact.stiffness_exponent", Number(Positive), "the stiffness exponent kappa in 1/m", "150.0"),
    required("contact.restitution", Number(Share), "the coefficient of restitution (1 = elastic)", "0.4"),
    optional("contact.dissipation_focusing", Number(Positive), "the dissipation focusing psi in s/m", "10.0"),
    optional("contact.interaction_distance", Number(Positive),
             "the gap l_max in m beyond which spheres do not interact", "0.1"),

    optional("friction.law", Word(FrictionLaw::NAMES), "the law of friction", "\"history\""),
    required("friction.coefficient", Number(NotNegative), "the friction coefficient phi", "0.2"),
    optional("friction.regularization_velocity", Number(Positive),
             "the slip v_min in m/s below which friction is regularised", "0.01"),
    optional("friction.stiffness_ratio", Number(Positive),
             "the ratio of tangential to normal stiffness of friction with memory", "0.5"),
    optional("friction.damping", Number(NotNegative),
             "the damping of friction with memory as a share of critical", "1.0"),
    optional("friction.rotation", Switch, "whether friction turns the spheres", "true"),
    optional("friction.rolling", Table, "the table of rolling resistance", "{ coefficient = 0.05 }"),
    required("friction.rolling.coefficient", Number(NotNegative),
             "the coefficient of rolling resistance: the tangent of the slope on which a sphere still stands",
             "0.05"),
    optional("friction.twisting", Table, "the table of twisting resistance", "{ coefficient = 0.01 }"),
    required("friction.twisting.coefficient", Number(NotNegative),
             "the coefficient of twisting resistance: the largest moment over normal force and reduced \
              radius",
             "0.01"),

    required("material.name", Text, "the name of the material", "\"glass\""),
    optional("material.restitution", Number(Share), "the coefficient of restitution of the material", "0.9"),
    optional("material.friction", Number(NotNegative), "the friction coefficient of the material", "0.3"),
    optional("material.rolling", Number(NotNegative),
             "the coefficient of rolling resistance of the material", "0.01"),
    optional("material.twisting", Number(NotNegative),
             "the coefficient of twisting resistance of the material", "0.0"),
    optional("material.pair", Tables,
             "the list of what holds with other materials, each opened by [[material.pair]]",
             "[{ with = \"steel\", friction = 0.3 }]"),
    required("material.pair.with", Text, "the name of the other material of the pair", "\"steel\""),
    optional("material.pair.restitution", Number(Share), "the coefficient of restitution of the pair", "0.8"),
    optional("material.pair.friction", Number(NotNegative), "the friction coefficient of the pair", "0.3"),
    optional("material.pair.rolling", Number(NotNegative),
             "the coefficient of rolling resistance of the pair", "0.01"),
    optional("material.pair.twisting", Number(NotNegative),
             "the coefficient of twisting resistance of the pair", "0.0"),

    optional("solver.method", Word(MethodName::NAMES), "the time stepping method", "\"auto\""),
    optional("solver.tolerance", Number(Positive), "the error tolerance of a step", "1e-3"),
    optional("solver.norm", Word(NormName::NAMES), "the measure of the error", "\"scaled\""),
    optional("solver.velocity_scale", Number(Positive),
             "the speed in m/s that errors of velocity are compared with", "1.0"),
    optional("solver.neglected_force", Number(NotNegative),
             "the repulsion in N below which the stabilised method leaves contacts out", "0.0"),
    optional("solver.step", Number(Positive), "the fixed step of velocity-verlet in s", "1e-5"),
    optional("solver.initial_step", Number(Positive), "the largest first step in s", "0.1"),
    optional("solver.min_step", Number(Positive), "the smallest step in s", "1e-9"),
    optional("solver.max_step", Number(PositiveOrInfinite), "the largest step in s", "inf"),

    optional("output.file", Text, "the path of the output file", "\"settle.vtkhdf\""),
    optional("output.interval", Number(Positive), "the simulated time between frames in s", "0.02"),
    optional("output.energy", Switch, "whether dissipated energy is integrated and written", "false"),
    optional("output.sync", WordOrNumber(SyncEvery::WORDS, Positive),
             "how often frames are forced to the disk: wall time in s, every frame, or at the end", "1.0"),

    optional("checkpoint.interval", Number(Positive),
             "the simulated time in s between two checkpoints", "0.5"),
    optional("checkpoint.wall", Number(Positive), "the wall time in s between two checkpoints", "600.0"),

    optional("stop.kinetic_energy", Number(Positive),
             "the mean kinetic energy of a sphere at rest in J, at most", "1e-6"),
    optional("stop.unbalanced_force", Number(Positive),
             "the sum of net forces at rest over that of contact forces and weights, at most", "1e-3"),
    optional("stop.height_change", Number(Positive),
             "the change of the height of the bed at rest in m, at most", "1e-5"),
    optional("stop.speed", Number(Positive),
             "the speed of every sphere at rest in m/s, at most", "0.01"),
    optional("stop.window", Number(Positive),
             "the simulated time in s for which the spheres must be at rest", "0.1"),
    optional("stop.units", Word(Units::NAMES), "the units of [stop]: SI, or those of the scene", "\"scene\""),

    optional("limits.wall", Number(Positive),
             "the wall time in s after which the run saves itself and stops", "3600.0"),
];

/// The keys of a table; `""` is the top of the scene.
pub(super) fn of_table(table: &str) -> impl Iterator<Item = &'static Key> {
    KEYS.iter().filter(move |key| key.table() == table)
}

impl Key {
    /// Path of the table that contains the key; `""` for the top of the scene.
    pub fn table(&self) -> &'static str {
        self.path.rsplit_once('.').map_or("", |(table, _)| table)
    }

    /// Name of the key within its table.
    pub fn name(&self) -> &'static str {
        self.path.rsplit_once('.').map_or(self.path, |(_, name)| name)
    }

    /// Type and range of its value. Messages put it after "must be".
    pub fn need(&self) -> String {
        match self.kind {
            Number(range) => range.need().to_owned(),
            Vector { open: false } => "a list of three finite numbers".to_owned(),
            Vector { open: true } => "a list of three numbers".to_owned(),
            Numbers(count) => format!("a list of {count} finite numbers"),
            Pairs => "a list of pairs of finite numbers".to_owned(),
            Count => "an integer in 1..1000000000".to_owned(),
            Seed => "an integer in 0..18446744073709551615".to_owned(),
            Switch => "true or false".to_owned(),
            Text => "text in quotes, not empty".to_owned(),
            Word(words) => format!("one of: {}", quoted(words)),
            WordOrNumber(words, range) => format!("one of: {}, or {}", quoted(words), range.need()),
            NumberOrTable(range) => format!("{}, or a table", range.need()),
            Table => "a table".to_owned(),
            Tables => "a list of tables".to_owned(),
        }
    }

    /// Its meaning and a typical value: the second half of most messages.
    pub fn help(&self) -> String {
        match self.path {
            "contact" => format!("it is {}, e.g. {}", self.meaning, self.example),
            _ => format!("it is {}, e.g. {} = {}", self.meaning, self.name(), self.example),
        }
    }
}

impl Range {
    /// Whether the range contains `value`, which must not be NaN.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Finite => value.is_finite(),
            Positive => value > 0.0 && value.is_finite(),
            NotNegative => value >= 0.0 && value.is_finite(),
            Share => (0.0..=1.0).contains(&value),
            PartOf => value > 0.0 && value < 1.0,
            PositiveOrInfinite => value > 0.0,
        }
    }

    fn need(self) -> &'static str {
        match self {
            Finite => "a finite number",
            Positive => "a finite number > 0",
            NotNegative => "a finite number >= 0",
            Share => "a number in 0..1",
            PartOf => "a number > 0 and < 1",
            PositiveOrInfinite => "a number > 0 or inf",
        }
    }
}

fn quoted(words: &[&str]) -> String {
    words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// Keys that exclude others. The tables among them are other sources than `particles.grid`.
    const ALTERNATIVES: [&str; 12] = [
        "particles.density",
        "particles.file",
        "particles.run",
        "particles.random",
        "particles.lattice",
        "contact.overlap",
        "contact.drop",
        "solver.step",
        "species.radius.lognormal",
        "species.radius.normal",
        "species.radius.points",
        "species.radius.table",
    ];

    const STARTS: [&str; 3] = ["particles.grid", "particles.random", "particles.lattice"];

    /// All examples as one scene, with the table `start` as the source of particles.
    fn scene_of_examples(start: &str) -> String {
        let mut text = String::new();
        for table in [
            "",
            "particles",
            start,
            &format!("{start}.region"),
            "container.box",
            "contact",
            "friction",
            "friction.rolling",
            "friction.twisting",
            "solver",
            "output",
            "checkpoint",
            "limits",
            "stop",
        ] {
            if !table.is_empty() && of_table(table).next().is_some() {
                text += &format!("[{table}]\n");
            }
            for key in of_table(table) {
                let alternative = ALTERNATIVES.contains(&key.path);
                if !matches!(key.kind, Table | Tables) && !alternative {
                    text += &format!("{} = {}\n", key.name(), key.example);
                }
            }
        }
        let example = |name: &str| KEYS.iter().find(|key| key.path == name).unwrap().example;
        for (name, share, radius) in [
            ("\"a\"", "0.3", format!("{{ uniform = {} }}", example("species.radius.uniform"))),
            (example("species.name"), example("species.share"), example("species.radius").to_owned()),
        ] {
            let [density, material] = ["species.density", "species.material"].map(example);
            text += &format!(
                "[[species]]\nname = {name}\nshare = {share}\ndensity = {density}\nradius = {radius}\n\
                 material = {material}\n"
            );
        }
        text += "[[container.wall]]\npoint = [0, 0, 0]\nnormal = [0, 0, -1]\nmaterial = \"steel\"\n";
        for table in ["material", "material.pair"] {
            text += &format!("[[{table}]]\n");
            for key in of_table(table).filter(|key| !matches!(key.kind, Tables)) {
                text += &format!("{} = {}\n", key.name(), key.example);
            }
        }
        text + "[[material]]\nname = \"steel\"\n"
    }

    #[test]
    fn every_example_is_a_valid_value() {
        for start in STARTS {
            Scene::parse("examples.toml", &scene_of_examples(start), &[]).unwrap();
        }
    }

    #[test]
    fn the_keys_of_the_list_are_the_keys_of_the_structs() {
        let mut paths: Vec<_> = ALTERNATIVES.map(str::to_owned).into();
        fn collect(table: &toml::Table, above: &str, paths: &mut Vec<String>) {
            for (name, value) in table {
                let path = format!("{above}{name}");
                match value {
                    toml::Value::Table(inner) => collect(inner, &format!("{path}."), paths),
                    toml::Value::Array(list) if list[0].is_table() => {
                        collect(list[0].as_table().unwrap(), &format!("{path}."), paths);
                    }
                    _ => {}
                }
                paths.push(path);
            }
        }
        for start in STARTS {
            let scene = Scene::parse("examples.toml", &scene_of_examples(start), &[]).unwrap();
            let resolved: toml::Table = scene.resolved().parse().unwrap();
            collect(&resolved, "", &mut paths);
        }
        paths.sort();
        paths.dedup();
        let mut listed: Vec<_> = KEYS.iter().map(|key| key.path.to_owned()).collect();
        listed.sort();
        assert_eq!(paths, listed);
    }
}
