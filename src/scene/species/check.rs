//! Checks the species of a scene, reads their tables, and fills in what follows from them.

use std::path::Path;

use super::mixture::Part;
use super::{Distribution, Mixture, Radius, Spread, sieve};
use crate::error::Error;
use crate::math::digits::{at_least, rough, short};
use crate::scene::initial_condition::mass_of;
use crate::scene::source::{Source, Span, brief};
use crate::scene::{Scene, shown};

/// Largest number of species.
const MOST: usize = 1000;

/// Shares may miss their sum by this.
const SHARES: f64 = 1e-6;

/// Radii may differ by this factor at most.
pub(in crate::scene) const WIDEST: f64 = 1e4;

/// Largest standard deviation of ln r. Radii would differ by more than anything can be computed with.
const LARGEST_SIGMA: f64 = 3.0;

/// Least share of a normal distribution that a truncation must leave, so that digits are left as well.
const LEAST_LEFT: f64 = 1e-6;

/// Radii (m) with the share of the mass below them.
type Points = Vec<[f64; 2]>;

/// Reads the text of a table that a species names.
pub(in crate::scene) type Reader<'a> = &'a dyn Fn(&Path) -> Result<String, Error>;

/// Checks the species of a scene in `folder`, puts densities and points of tables into them, and gives the
/// scene the radius and the mass of a typical sphere where it has none.
///
/// Masses and radii are then the means of the distributions; [`crate::engine::load::load`] puts those of the
/// spheres in their place.
pub(in crate::scene) fn settle(
    source: &Source,
    scene: &mut Scene,
    folder: &Path,
    read: Reader,
) -> Result<(), Error> {
    if scene.species.is_empty() {
        return needed(source);
    }
    one_source(source)?;
    names(source, scene)?;
    densities(source, scene)?;
    for k in 0..scene.species.len() {
        radii(source, scene, k, &|file| sieve::points(&shown(&folder.join(file)), &read(file)?))?;
    }
    shares(source, scene)?;
    let mixture = Mixture::of(scene).expect("there are species");
    sizes(source, scene, &mixture)?;
    typical(source, scene, &mixture)?;
    let particles = &mut scene.particles;
    // Every species has its own density now.
    particles.density = None;
    let mean =
        |of: &dyn Fn(&Part) -> f64| mixture.parts.iter().map(|part| part.by_number * of(part)).sum::<f64>();
    if let (true, Distribution::One(r)) = (mixture.is_alike(), &mixture.parts[0].distribution) {
        (particles.radius, particles.mass) = (*r, mass_of(*r, mixture.parts[0].density));
        return Ok(());
    }
    if particles.radius.is_nan() {
        particles.radius = mean(&|part| part.distribution.mean());
    }
    if particles.mass.is_nan() {
        particles.mass = mean(&|part| mass_of(1.0, part.density) * part.distribution.mean_cube());
    }
    Ok(())
}

/// Refuses keys that mean nothing without species.
fn needed(source: &Source) -> Result<(), Error> {
    for key in ["particles.species_by", "particles.species_seed"] {
        if source.key(key).is_some() {
            let message = format!(
                "{key} needs [[species]], of which there is none: leave it out, or give a species with name, \
                 density and radius"
            );
            return Err(source.error(source.key(key), &message));
        }
    }
    Ok(())
}

/// Refuses particles that have sizes of their own.
fn one_source(source: &Source) -> Result<(), Error> {
    for key in ["particles.file", "particles.run"] {
        if let Some(file) = source.key(key) {
            let message = format!(
                "{key} and [[species]] contradict each other: exactly one says how large the spheres are, \
                 the columns of the file or the species, whose spheres start e.g. from [particles.grid]"
            );
            return Err(source.error(Some(file), &message));
        }
    }
    Ok(())
}

fn names(source: &Source, scene: &Scene) -> Result<(), Error> {
    if scene.species.len() > MOST {
        let message = format!("there are {} species, and {MOST} must do", scene.species.len());
        return Err(source.error(source.key("species"), &message));
    }
    for (k, species) in scene.species.iter().enumerate() {
        let path = format!("species[{k}].name");
        let name = &species.name;
        let wrong = |why: &str| {
            let message = format!(
                "{path} = \"{}\" {why}: it is the name of the species, e.g. name = \"coarse\"",
                brief(name)
            );
            Err(source.error(source.value(&path), &message))
        };
        if name.chars().any(char::is_control) {
            return wrong(
                "holds a control character, such as the end of a line, and must be one line of text",
            );
        }
        if name.trim() != name {
            return wrong("begins or ends with a blank, and must not");
        }
        if scene.species[..k].iter().any(|other| other.name == *name) {
            return wrong("is the name of two species, and must tell one from all others");
        }
    }
    Ok(())
}

fn densities(source: &Source, scene: &mut Scene) -> Result<(), Error> {
    for (k, species) in scene.species.iter_mut().enumerate() {
        species.density = species.density.or(scene.particles.density);
        if species.density.is_none() {
            let message = format!(
                "species[{k}].density is missing: it is the density of its spheres in kg/m^3, e.g. density = \
                 2500.0, or particles.density gives that of all"
            );
            return Err(source.error(source.value(&format!("species[{k}]")), &message));
        }
    }
    Ok(())
}

/// Checks how the radii of species `k` are spread, and reads its table.
fn radii(
    source: &Source,
    scene: &mut Scene,
    k: usize,
    read: &dyn Fn(&Path) -> Result<Points, Error>,
) -> Result<(), Error> {
    let Radius::Spread(spread) = &mut scene.species[k].radius else { return Ok(()) };
    let table = format!("species[{k}].radius");
    let Spread { uniform, normal, lognormal, table: file, points } = &*spread;
    let given: Vec<&str> = [
        ("uniform", uniform.is_some()),
        ("normal", normal.is_some()),
        ("lognormal", lognormal.is_some()),
        // A recorded scene has both.
        ("table", file.is_some() && points.is_none()),
        ("points", points.is_some()),
    ]
    .into_iter()
    .filter_map(|(name, given)| given.then_some(name))
    .collect();
    let [name] = given[..] else {
        let found = if given.is_empty() { "none".to_owned() } else { given.join(" and ") };
        let message = format!(
            "{table} has {found} of uniform, normal, lognormal, table and points, and exactly one says how \
             radii are spread, e.g. radius = {{ uniform = [0.05, 0.15] }}"
        );
        return Err(source.error(source.value(&table), &message));
    };
    let path = format!("{table}.{name}");
    let wrong = |why: String| {
        let written = source.value(&path).map(|span| source.written(&span)).unwrap_or_default();
        Err(source.error(source.value(&path), &format!("{path} = {written} {why}")))
    };
    let bounds = |[min, max]: [f64; 2], form: &str| match () {
        () if !min.is_normal() || min <= 0.0 => {
            wrong(format!("has the least radius {} m, which must be above 0: it is {form}", short(min)))
        }
        () if min >= max => wrong(format!(
            "has the least radius {} m, which must be below the largest, {} m: it is {form}",
            short(min),
            short(max)
        )),
        () => Ok(()),
    };
    let leaves = |name: &str, left: f64, [min, max]: [f64; 2], form: &str| {
        // A NaN is refused as well.
        if left >= LEAST_LEFT {
            return Ok(());
        }
        wrong(format!(
            "leaves nothing: the share {left:.1e} of the {name} distribution lies between {} m and {} m, and \
             it must be {LEAST_LEFT} at least: it is {form}",
            short(min),
            short(max)
        ))
    };
    if let Some(range) = *uniform {
        bounds(range, "[min, max] in m, e.g. uniform = [0.05, 0.15]")?;
    }
    if let Some([mean, sd, min, max]) = *normal {
        let form = "[mean, sd, min, max] in m, e.g. normal = [0.1, 0.02, 0.05, 0.15]";
        if sd <= 0.0 {
            return wrong(format!("has the standard deviation {sd} m, which must be above 0: it is {form}"));
        }
        bounds([min, max], form)?;
        leaves("normal", Distribution::Normal { mean, sd, min, max }.left(), [min, max], form)?;
    }
    if let Some([median, sigma, min, max]) = *lognormal {
        let form = "[median, sigma, min, max] in m, with the standard deviation sigma of ln r, e.g. \
                    lognormal = [0.1, 0.3, 0.05, 0.2]";
        if !median.is_normal() || median <= 0.0 {
            return wrong(format!("has the median {median} m, which must be above 0: it is {form}"));
        }
        if !(sigma.is_normal() && sigma > 0.0 && sigma <= LARGEST_SIGMA) {
            return wrong(format!(
                "has sigma {sigma}, which must be above 0 and {LARGEST_SIGMA} at most: it is {form}"
            ));
        }
        bounds([min, max], form)?;
        leaves("lognormal", Distribution::Lognormal { median, sigma, min, max }.left(), [min, max], form)?;
    }
    if let Some(rows) = points {
        let form = "[[radius in m, share of the mass below it], ...], whose shares must rise from 0 to 1, \
            e.g. points = [[0.01, 0.0], [0.02, 1.0]]";
        for (row, point) in rows.iter().enumerate() {
            let before = row.checked_sub(1).map(|before| &rows[before]);
            if let Err(why) = sieve::follows(before, *point, ["radius", "share"]) {
                return wrong(format!("has a mistake in pair {}: {why}: it is {form}", row + 1));
            }
        }
        let last = rows.last().map_or(0.0, |point| point[1]);
        if rows.len() < 2 || (last - 1.0).abs() > SHARES {
            return wrong(format!("ends with the share {last} after {} pairs: it is {form}", rows.len()));
        }
        spread.points = Some(sieve::in_radii(rows, 1.0));
    } else if let Some(file) = file {
        spread.points = Some(read(file)?);
    }
    Ok(())
}

fn shares(source: &Source, scene: &Scene) -> Result<(), Error> {
    let alone = scene.species.len() == 1;
    for (k, species) in scene.species.iter().enumerate() {
        if species.share.is_none() && !alone {
            let message = format!(
                "species[{k}].share is missing: it is the share of the species, e.g. share = 0.5, and only a \
                 species that is alone needs none"
            );
            return Err(source.error(source.value(&format!("species[{k}]")), &message));
        }
        if species.share == Some(0.0) {
            let path = format!("species[{k}].share");
            let message =
                format!("{path} = 0 gives no sphere to the species: it must be above 0, or leave it out");
            return Err(source.error(source.value(&path), &message));
        }
    }
    let sum: f64 = scene.species.iter().map(|species| species.share.unwrap_or(1.0)).sum();
    if (sum - 1.0).abs() <= SHARES {
        return Ok(());
    }
    let last = scene.species.len() - 1;
    let message = format!(
        "species[{last}].share ends a sum of {}: the shares of all species must add up to 1 within {SHARES}",
        short(sum)
    );
    Err(source.error(source.value(&format!("species[{last}].share")), &message))
}

/// Checks that every species gets a sphere, and that arithmetic survives all sizes.
fn sizes(source: &Source, scene: &Scene, mixture: &Mixture) -> Result<(), Error> {
    // Without a source there is another message.
    let Some(count) = scene.particles.count() else { return Ok(()) };
    let at = |k: usize, key: &str| -> Option<Span> {
        source.value(&format!("species[{k}].{key}")).or_else(|| source.value(&format!("species[{k}]")))
    };
    // Masses of single spheres first: shares are computed with them.
    for (k, part) in mixture.parts.iter().enumerate() {
        arithmetic(source, at(k, "radius"), k, part, part.distribution.range(1))?;
    }
    let counts = mixture.counts(count);
    let mut all = [f64::INFINITY, 0.0f64];
    for (k, (part, &n)) in mixture.parts.iter().zip(&counts).enumerate() {
        if n == 0 {
            let share = part.by_number * count as f64;
            let message = format!(
                "species[{k}].share gives the species {} of {count} spheres, which is none: it must be one \
                 at least, e.g. of {} spheres",
                rough(share),
                short(at_least(1.0 / part.by_number))
            );
            return Err(source.error(at(k, "share"), &message));
        }
        let range = part.distribution.range(n);
        arithmetic(source, at(k, "radius"), k, part, range)?;
        all = [all[0].min(range[0]), all[1].max(range[1])];
        if all[1] > WIDEST * all[0] {
            let message = format!(
                "species[{k}].radius makes radii reach from {} m to {} m: a factor of {WIDEST} between them \
                 is possible, and they must be nearer to each other",
                short(all[0]),
                short(all[1])
            );
            return Err(source.error(at(k, "radius"), &message));
        }
    }
    Ok(())
}

/// Checks that the radius of the scene is one that a sphere may have, and its mass too where all are alike.
///
/// A recorded scene has both.
fn typical(source: &Source, scene: &Scene, mixture: &Mixture) -> Result<(), Error> {
    let Some(count) = scene.particles.count() else { return Ok(()) };
    let radii = mixture.range(count);
    let masses = match mixture.is_alike() {
        true => radii.map(|r| mass_of(r, mixture.parts[0].density)),
        false => [0.0, f64::INFINITY],
    };
    for (key, given, [low, high], unit) in
        [("radius", scene.particles.radius, radii, "m"), ("mass", scene.particles.mass, masses, "kg")]
    {
        // A NaN was left out.
        if given < low || given > high {
            let path = format!("particles.{key}");
            let message = format!(
                "{} contradicts [[species]], whose spheres have {} {unit} to {} {unit}: it must be that of a \
                 typical sphere, or leave it out",
                source.assignment(&path, given, unit),
                short(low),
                short(high)
            );
            return Err(source.error(source.value(&path), &message));
        }
    }
    Ok(())
}

/// Checks that species `k` has spheres that can be computed with: `range` has the least and the largest
/// radius, m.
fn arithmetic(
    source: &Source,
    at: Option<Span>,
    k: usize,
    part: &Part,
    range: [f64; 2],
) -> Result<(), Error> {
    let fine = |number: f64| number.is_normal() && number > 0.0;
    let masses = range.map(|r| mass_of(r, part.density));
    if range.into_iter().chain(masses).chain(range.map(|r| r.powi(3))).all(fine) {
        return Ok(());
    }
    let spheres = if range.into_iter().all(f64::is_finite) {
        let [least, most] = range.map(short);
        format!("spheres of {least} m to {most} m with masses of {:e} kg to {:e} kg", masses[0], masses[1])
    } else {
        "sizes that are too far apart".to_owned()
    };
    let message = format!(
        "species[{k}].radius gives {spheres}, which no arithmetic survives: it must be in m, and the density \
         in kg/m^3"
    );
    Err(source.error(at, &message))
}
