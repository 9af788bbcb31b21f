//! Checks a scene: name, type and range of each key by the list of keys, then how keys relate to each other.

use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue};

use super::check_starts::starts;
use super::keys::{self, KEYS, Key, Kind, LARGEST_COUNT, Range};
use super::materials;
use super::source::{Source, Span, brief};
use super::stop::Stop;
use super::walls::{walls, walls_without_room};
use super::{BoxSides, Checkpoint, Container, Particles, Scene};
use crate::error::Error;
use crate::math::digits::{rough, short};
use crate::model::effects::FrictionLaw;
use crate::ode::MethodName;

/// Largest number of frames that a run may write.
const MOST_FRAMES: f64 = 1e7;

/// Tolerance for rounding: a side may be this fraction of a cell shorter than a whole number of cells.
const PART_OF_CELL: f64 = 1e-9;

/// Number of whole cells of size `spacing` (m) that fit into `side` (m).
pub(crate) fn cells_along(side: f64, spacing: f64) -> u64 {
    // `as` saturates, so an infinite or very long side gives the largest number.
    (side / spacing + PART_OF_CELL).floor() as u64
}

/// A mistake in one key: its position and the message.
struct Mistake {
    span: Option<Span>,
    /// Whether the key is missing. Such mistakes are reported after all mistakes in keys that are given.
    missing: bool,
    message: String,
}

/// Checks name, type and range of every key, and that no required key is missing.
///
/// Stores the position of each key in `source`. Reports the first mistake in the order of the text.
pub(super) fn keys_and_values(source: &mut Source, table: &DeTable) -> Result<(), Error> {
    let mut mistakes = Vec::new();
    check_table(source, table, "", "", None, &mut mistakes);
    let order = |mistake: &Mistake| (mistake.missing, mistake.span.as_ref().map_or(0, |span| span.start));
    match mistakes.into_iter().min_by_key(order) {
        Some(mistake) => Err(source.error(mistake.span, &mistake.message)),
        None => Ok(()),
    }
}

/// Checks one table.
///
/// `schema` is its path in the list of keys, `shown` the same path with the numbers of list entries.
fn check_table(
    source: &mut Source,
    table: &DeTable,
    schema: &str,
    shown: &str,
    span: Option<Span>,
    mistakes: &mut Vec<Mistake>,
) {
    for (name, value) in table {
        let path = joined(shown, name.get_ref());
        source.remember(&path, name.span(), value.span());
        match keys::of_table(schema).find(|key| key.name() == name.get_ref().as_ref()) {
            None => {
                let message = unknown(schema, shown, name.get_ref());
                mistakes.push(Mistake { span: Some(name.span()), missing: false, message });
            }
            Some(key) => check_value(source, key, &path, name.span(), value, mistakes),
        }
    }
    for key in keys::of_table(schema).filter(|key| key.required && !table.contains_key(key.name())) {
        let path = joined(shown, key.name());
        let path = if key.kind == Kind::Table { format!("[{path}]") } else { path };
        let message = format!("{path} is missing: {}", key.help());
        mistakes.push(Mistake { span: span.clone(), missing: true, message });
    }
}

fn check_value(
    source: &mut Source,
    key: &Key,
    path: &str,
    name: Span,
    value: &Spanned<DeValue>,
    mistakes: &mut Vec<Mistake>,
) {
    match (key.kind, value.get_ref()) {
        (Kind::Table, DeValue::Table(table)) => {
            check_table(source, table, key.path, path, Some(name), mistakes);
        }
        (Kind::Tables, DeValue::Array(entries)) if entries.iter().all(|entry| entry.get_ref().is_table()) => {
            for (number, entry) in entries.iter().enumerate() {
                if let DeValue::Table(table) = entry.get_ref() {
                    let path = format!("{path}[{number}]");
                    source.remember(&path, entry.span(), entry.span());
                    check_table(source, table, key.path, &path, Some(entry.span()), mistakes);
                }
            }
        }
        (Kind::NumberOrTable(_), DeValue::Table(table)) => {
            check_table(source, table, key.path, path, Some(name), mistakes);
        }
        (kind, given) => {
            if let Err(what) = fits(kind, given) {
                let mut written = source.written(&value.span());
                if given.is_str() && !written.starts_with(['"', '\'']) {
                    written = format!("\"{written}\"");
                }
                let need = key.need();
                let message = match what {
                    Misfit::Outside(range) => {
                        format!("{path} = {written} is outside {range}: {}", key.help())
                    }
                    Misfit::NotThat => format!("{path} = {written} must be {need}: {}", key.help()),
                };
                mistakes.push(Mistake { span: Some(value.span()), missing: false, message });
            }
        }
    }
}

/// Why a value does not fit its key.
enum Misfit {
    /// The type is right, but the value is outside a range with two ends.
    Outside(&'static str),
    /// Anything else. The message quotes what the key needs.
    NotThat,
}

fn fits(kind: Kind, value: &DeValue) -> Result<(), Misfit> {
    let fitting = match (kind, value) {
        (Kind::Number(range) | Kind::NumberOrTable(range), value) => match number(value) {
            Some(number) if range == Range::Share && !number.is_nan() && !range.holds(number) => {
                return Err(Misfit::Outside("0..1"));
            }
            number => number.is_some_and(|number| range.holds(number)),
        },
        (Kind::Vector { open }, DeValue::Array(list)) => {
            let fits = |number: f64| if open { !number.is_nan() } else { number.is_finite() };
            list.len() == 3 && list.iter().all(|value| number(value.get_ref()).is_some_and(fits))
        }
        (Kind::Numbers(count), DeValue::Array(list)) => list.len() == count && are_finite(list),
        (Kind::Pairs, DeValue::Array(pairs)) => {
            !pairs.is_empty()
                && pairs.iter().all(|pair| match pair.get_ref() {
                    DeValue::Array(pair) => pair.len() == 2 && are_finite(pair),
                    _ => false,
                })
        }
        (Kind::Count, DeValue::Integer(integer)) => {
            if !integer_of(integer).is_some_and(|count| (1..=i128::from(LARGEST_COUNT)).contains(&count)) {
                return Err(Misfit::Outside("1..1000000000"));
            }
            true
        }
        (Kind::Seed, DeValue::Integer(integer)) => {
            if integer_of(integer).is_none_or(|seed| u64::try_from(seed).is_err()) {
                return Err(Misfit::Outside("0..18446744073709551615"));
            }
            true
        }
        (Kind::Switch, DeValue::Boolean(_)) => true,
        (Kind::Text, DeValue::String(text)) => !text.trim().is_empty(),
        (Kind::Word(words) | Kind::WordOrNumber(words, _), DeValue::String(text)) => {
            words.contains(&text.as_ref())
        }
        (Kind::WordOrNumber(_, range), value) => number(value).is_some_and(|number| range.holds(number)),
        _ => false,
    };
    if fitting { Ok(()) } else { Err(Misfit::NotThat) }
}

fn are_finite(list: &[Spanned<DeValue>]) -> bool {
    list.iter().all(|value| number(value.get_ref()).is_some_and(f64::is_finite))
}

/// The value of a number or an integer; `None` if it is too large for a double, or an integer beyond 64 bits.
fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Float(float) => {
            let written = float.as_str();
            written.parse().ok().filter(|number: &f64| !number.is_infinite() || written.contains("inf"))
        }
        // An integer beyond 64 bits is refused, since serde would not read it as a number either.
        DeValue::Integer(integer) => integer_of(integer)
            .filter(|&integer| i64::try_from(integer).is_ok() || u64::try_from(integer).is_ok())
            .map(|integer| integer as f64),
        _ => None,
    }
}

fn integer_of(integer: &DeInteger) -> Option<i128> {
    i128::from_str_radix(integer.as_str(), integer.radix()).ok()
}

fn joined(table: &str, name: &str) -> String {
    if table.is_empty() { name.to_owned() } else { format!("{table}.{name}") }
}

/// The message for a key that does not exist: with the most similar key, and the keys of its table.
fn unknown(schema: &str, shown: &str, name: &str) -> String {
    let known: Vec<_> = keys::of_table(schema).map(Key::name).collect();
    // Shorten the name first: time and memory for the distance of two words grow as the product of their
    // lengths.
    let name = &brief(name);
    let near = |other: &str| strsim::normalized_damerau_levenshtein(&name.to_lowercase(), other);
    let nearest = |names: &mut dyn Iterator<Item = &'static Key>, near_enough: f64| {
        names
            .map(|key| (near(key.name()), key))
            .filter(|&(near, _)| near >= near_enough)
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, key)| key)
    };
    // Of the few keys of the table itself one may differ by a third of its letters. Among all others a name
    // is meant only if it is the same but for a slip.
    const HERE: f64 = 0.6;
    const ELSEWHERE: f64 = 0.85;
    let here = nearest(&mut keys::of_table(schema), HERE);
    // What a material has is a variation of what [contact] and [friction] have.
    let elsewhere = |key: &&Key| key.table() != schema && !key.path.starts_with("material.");
    let anywhere = || nearest(&mut KEYS.iter().filter(elsewhere), ELSEWHERE);
    let hint = match here.map(|key| (key, "")).or_else(|| anywhere().map(|key| (key, " elsewhere"))) {
        None => String::new(),
        Some((key, "")) => format!("did you mean {}? ", joined(shown, key.name())),
        Some((key, _)) if key.kind == Kind::Table => format!("did you mean [{}]? ", key.path),
        Some((key, _)) if key.table().is_empty() => {
            format!("did you mean {}, which belongs above the first [table]? ", key.path)
        }
        Some((key, _)) => format!("did you mean {}? ", key.path),
    };
    let table = if shown.is_empty() { "the top of a scene".to_owned() } else { format!("[{shown}]") };
    format!("unknown key {}: {hint}{table} knows {}", joined(shown, name), known.join(", "))
}

/// Checks that there is a radius.
pub(super) fn one_radius(source: &Source, scene: &Scene) -> Result<(), Error> {
    match source.key("particles.radius") {
        None if scene.particles.radius.is_nan() => Err(source.error(
            source.key("particles"),
            "particles.radius is missing: it is the radius r of every sphere in m, e.g. radius = 0.1, or \
             particles.file has a column radius, or [[species]] have radii",
        )),
        _ => Ok(()),
    }
}

/// Checks how keys relate to each other.
pub(super) fn relations(source: &Source, scene: &Scene) -> Result<(), Error> {
    one_mass(source, scene)?;
    contacts(source, scene)?;
    if let Some(sides) = &scene.container.r#box {
        box_sides(source, sides)?;
    }
    for (number, wall) in scene.container.wall.iter().enumerate() {
        if wall.normal == [0.0; 3] {
            let path = format!("container.wall[{number}].normal");
            let message = format!(
                "{path} = [0, 0, 0] has no direction: it is the outward normal of the wall, e.g. normal = \
                 [0.0, 0.0, -1.0]"
            );
            return Err(source.error(source.value(&path), &message));
        }
    }
    materials::check(source, scene)?;
    room_between_walls(source, &scene.container)?;
    starts(source, scene)?;
    steps(source, scene)?;
    checkpoints(source, scene)?;
    frames(source, scene)
}

/// Checks that either the mass or the density of a sphere is given, and that both can be computed with.
fn one_mass(source: &Source, scene: &Scene) -> Result<(), Error> {
    let [mass, density] = ["particles.mass", "particles.density"].map(|path| source.key(path));
    let Particles { mass: found, radius, .. } = scene.particles;
    match (mass, density) {
        (Some(mass), Some(_)) => Err(source.error(
            Some(mass),
            "particles.mass and particles.density contradict each other: one of them says how heavy a sphere \
             is, e.g. mass = 1.0 (kg) or density = 2500.0 (kg/m^3)",
        )),
        (None, None) if scene.species.is_empty() => Err(source.error(
            source.key("particles"),
            "particles.mass is missing: it is the mass of one sphere in kg, e.g. mass = 1.0, or \
             particles.density gives it (kg/m^3), e.g. density = 2500.0",
        )),
        (None, Some(density)) if !found.is_normal() => Err(source.error(
            Some(density),
            &format!(
                "particles.density gives spheres of {} m a mass of {found:e} kg, which no arithmetic \
                 survives: it is the density in kg/m^3, e.g. density = 2500.0",
                short(radius)
            ),
        )),
        _ => Ok(()),
    }
}

/// Checks that the numbers of contacts are given, or what they follow from.
fn contacts(source: &Source, scene: &Scene) -> Result<(), Error> {
    let contact = &scene.contact;
    let numbers = [
        ("contact.repulsion_at_contact", contact.repulsion_at_contact),
        ("contact.stiffness_exponent", contact.stiffness_exponent),
        ("contact.interaction_distance", contact.interaction_distance),
    ];
    let pulled = scene.gravity != [0.0; 3];
    let Some(overlap) = contact.overlap else {
        if let Some(speed) = contact.drop {
            let message = format!(
                "{} is for contact.overlap alone: leave it out, or give contact.overlap in place of \
                 repulsion_at_contact, stiffness_exponent and interaction_distance",
                source.assignment("contact.drop", speed, "m/s")
            );
            return Err(source.error(source.value("contact.drop"), &message));
        }
        let left_out = numbers.iter().find(|(_, number)| number.is_nan());
        return left_out.map_or_else(
            || speeds(source, scene),
            |(path, _)| {
                Err(missing(
                    source,
                    path,
                    "or contact.overlap = 0.05 in place of all three lengths and forces",
                ))
            },
        );
    };
    let overlap = source.assignment("contact.overlap", overlap, "of the radius");
    if let Some((path, _)) = numbers.iter().find(|(_, number)| !number.is_nan()) {
        let message = format!(
            "{overlap} and {path} contradict each other: repulsion_at_contact, stiffness_exponent and \
             interaction_distance follow from it: leave it out, or leave out contact.overlap"
        );
        return Err(source.error(source.key(path), &message));
    }
    if !pulled && contact.drop.is_none() {
        let message = format!(
            "{overlap} needs a load: gravity, e.g. gravity = [0.0, 0.0, -9.81], or the speed of the hardest \
             impact in m/s, e.g. drop = 0.5 under [contact]"
        );
        return Err(source.error(source.value("contact.overlap"), &message));
    }
    speeds(source, scene)
}

/// Checks that speeds of the laws are given where nothing says how fast spheres are.
fn speeds(source: &Source, scene: &Scene) -> Result<(), Error> {
    if scene.contact.dissipation_focusing.is_nan() {
        return Err(missing(source, "contact.dissipation_focusing", "with gravity it may be left out"));
    }
    Ok(())
}

/// The error of a key that is missing; `or` says what would do in its place.
fn missing(source: &Source, path: &str, or: &str) -> Error {
    let key = KEYS.iter().find(|key| key.path == path);
    let (help, table) = (key.map(Key::help).unwrap_or_default(), key.map_or("", |key| key.table()));
    source.error(source.key(table), &format!("{path} is missing: {help}; {or}"))
}

fn box_sides(source: &Source, sides: &BoxSides) -> Result<(), Error> {
    for (axis, (min, max)) in ["x", "y", "z"].into_iter().zip(sides.min.into_iter().zip(sides.max)) {
        if min == f64::INFINITY || max == f64::NEG_INFINITY {
            let (corner, value, open) =
                if min == f64::INFINITY { ("min", "inf", "-inf") } else { ("max", "-inf", "inf") };
            let path = format!("container.box.{corner}");
            let message = format!(
                "{path} is {value} in {axis}, which leaves no room: {open} opens that side of the box"
            );
            return Err(source.error(source.value(&path), &message));
        }
        if min >= max {
            let span = source.value("container.box.max").or_else(|| source.value("container.box.min"));
            let message = format!(
                "container.box is empty in {axis}: container.box.min = {} m must be less than \
                 container.box.max = {} m",
                short(min),
                short(max)
            );
            return Err(source.error(span, &message));
        }
    }
    Ok(())
}

/// Checks that no wall faces another one from behind.
fn room_between_walls(source: &Source, container: &Container) -> Result<(), Error> {
    let Some([(_, first), (k, second)]) = walls_without_room(container) else { return Ok(()) };
    let message = format!(
        "{first} and {second} leave no room between them: a normal must point outward, away from the \
         spheres, e.g. normal = [0.0, 0.0, -1.0] for a floor"
    );
    // Of two sides of a box one is below the other, so that the second wall is one of the list.
    let sides = walls(container).len() - container.wall.len();
    let path = format!("container.wall[{}]", k.saturating_sub(sides));
    let span = source.value(&format!("{path}.normal")).or_else(|| source.value(&format!("{path}.point")));
    Err(source.error(span.or_else(|| source.key("container.wall")), &message))
}

/// Checks that velocity-verlet has a fixed step and no tolerance, and that no other method has a fixed step.
fn fixed_step(source: &Source, scene: &Scene) -> Result<(), Error> {
    let solver = &scene.solver;
    let fixed = solver.method == MethodName::VelocityVerlet;
    let given = |path: &str| {
        let value = source.value(path).map(|span| source.written(&span)).unwrap_or_default();
        format!("{path} = {value}")
    };
    let (key, message) = match (fixed, solver.step, solver.tolerance) {
        (true, None, _) => (
            "solver.method",
            "solver.step is missing: velocity-verlet takes a fixed step in s, e.g. step = 1e-5".to_owned(),
        ),
        (true, Some(_), Some(_)) => (
            "solver.tolerance",
            format!(
                "{} has no meaning for velocity-verlet, whose step is fixed by solver.step: leave it out",
                given("solver.tolerance")
            ),
        ),
        (false, Some(_), _) => (
            "solver.step",
            format!(
                "{} is for method = \"velocity-verlet\" alone: leave it out, the step of {} follows from \
                 solver.tolerance",
                given("solver.step"),
                solver.method
            ),
        ),
        _ => return Ok(()),
    };
    Err(source.error(source.value(key), &message))
}

/// Checks that the law of friction has what it needs, and what rolling and twisting resistance need.
fn friction(source: &Source, scene: &Scene) -> Result<(), Error> {
    let Some(friction) = &scene.friction else { return Ok(()) };
    for (name, resistance) in [("rolling", &friction.rolling), ("twisting", &friction.twisting)] {
        let law_is_wrong = friction.law != FrictionLaw::History;
        let (key, needed) = if law_is_wrong {
            ("friction.law", "friction.law = \"history\"")
        } else if !friction.rotation {
            ("friction.rotation", "friction.rotation = true")
        } else {
            ("friction.coefficient", "a friction.coefficient above 0")
        };
        let met = !law_is_wrong && friction.rotation && scene.rubs();
        if resistance.is_some() && !met {
            let message = format!(
                "[friction.{name}] needs {needed}: without it no contact would resist {name}; or leave the table \
                 out"
            );
            let span = source.value(key).or_else(|| source.value(&format!("friction.{name}")));
            return Err(source.error(span, &message));
        }
    }
    if friction.law == FrictionLaw::History || friction.regularization_velocity.is_some() {
        return Ok(());
    }
    let or = "with gravity it may be left out, and law = \"history\" needs none";
    Err(missing(source, "friction.regularization_velocity", or))
}

fn steps(source: &Source, scene: &Scene) -> Result<(), Error> {
    fixed_step(source, scene)?;
    friction(source, scene)?;
    let solver = &scene.solver;
    let f_0 = scene.contact.repulsion_at_contact;
    if let Some(force) = solver.neglected_force.filter(|&force| force >= f_0) {
        let message = format!(
            "{} must be less than {}, or spheres that touch would not be evaluated",
            source.assignment("solver.neglected_force", force, "N"),
            source.assignment("contact.repulsion_at_contact", f_0, "N")
        );
        return Err(source.error(source.value("solver.neglected_force"), &message));
    }
    if solver.max_step >= solver.min_step {
        return Ok(());
    }
    let span = source.value("solver.max_step").or_else(|| source.value("solver.min_step"));
    let message = format!(
        "{} is less than {}: the largest step must not be below the smallest",
        source.assignment("solver.max_step", solver.max_step, "s"),
        source.assignment("solver.min_step", solver.min_step, "s")
    );
    Err(source.error(span, &message))
}

/// Checks that `[stop]`, if given, has a criterion, and `[checkpoint]`, if given, one of its two times.
fn checkpoints(source: &Source, scene: &Scene) -> Result<(), Error> {
    let none = |stop: &Stop| {
        let Stop { kinetic_energy, unbalanced_force, height_change, speed, .. } = stop;
        [kinetic_energy, unbalanced_force, height_change, speed].into_iter().all(Option::is_none)
    };
    if scene.stop.as_ref().is_some_and(none) {
        return Err(source.error(
            source.key("stop"),
            "[stop] needs kinetic_energy (J a sphere), unbalanced_force, height_change (m) or speed (m/s), \
             e.g. unbalanced_force = 1e-3",
        ));
    }
    match &scene.checkpoint {
        Some(Checkpoint { interval: None, wall: None }) => Err(source.error(
            source.key("checkpoint"),
            "[checkpoint] needs interval (simulated time in s) or wall (wall time in s), e.g. interval = 0.5",
        )),
        _ => Ok(()),
    }
}

fn frames(source: &Source, scene: &Scene) -> Result<(), Error> {
    let interval = scene.output.interval.unwrap_or(scene.t_end / 100.0);
    let frames = scene.t_end / interval;
    if frames <= MOST_FRAMES {
        return Ok(());
    }
    let span = source.value("output.interval").or_else(|| source.value("t_end"));
    let message = format!(
        "{} would write {} frames until {}, more than {}: it is the simulated time between frames in s, \
         e.g. interval = {}",
        source.assignment("output.interval", interval, "s"),
        rough(frames),
        source.assignment("t_end", scene.t_end, "s"),
        short(MOST_FRAMES),
        short(scene.t_end / 100.0)
    );
    Err(source.error(span, &message))
}
