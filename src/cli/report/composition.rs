//! What species have drawn, in a plan: spheres and quantiles of each, as asked for and as drawn, and a
//! histogram.

use crate::beds::measures::size_distribution::{Bin, SizeDistribution};
use crate::math::digits::rough;
use crate::model::columns::SPECIES;
use crate::model::size::{Size, Sizes};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::scene::species::Mixture;
use crate::scene::species::mixture::Part;

/// Letters of the longest bar.
const LONGEST: f64 = 24.0;
/// Letters of a name that are shown.
const NAME: usize = 11;

/// Species that are shown.
const MOST: usize = 20;

/// The shares of quantiles: d10, d50 and d90.
const SHARES: [f64; 3] = [0.1, 0.5, 0.9];

/// The lines about what species have drawn; none in a scene without species.
pub(super) fn lines(scene: &Scene, start: &InitialCondition) -> Vec<String> {
    let Some(mixture) = Mixture::of(scene) else { return Vec::new() };
    let sizes = start.sizes(scene);
    let all: Vec<Size> = (0..start.x.len()).map(|i| sizes.as_sizes().of(i)).collect();
    let species = start.columns.iter().find(|(column, _)| column.name == SPECIES);
    let of = |i: usize| species.map_or(0, |(_, numbers)| numbers[i] as usize);
    let mass: f64 = all.iter().map(|size| size.mass).sum();
    let mut text = vec![
        "d10, d50, d90: the diameters in m below which 10, 50, 90 % are, of the number n or the mass m"
            .to_owned(),
        row("", "", ["spheres", "number", "mass"], ["n d10", "n d50", "n d90", "m d10", "m d50", "m d90"]),
    ];
    for (k, part) in mixture.parts.iter().enumerate().take(MOST) {
        let own: Vec<Size> =
            all.iter().enumerate().filter(|(i, _)| of(*i) == k).map(|(_, size)| *size).collect();
        let name: String = part.name.chars().take(NAME).collect();
        let alone = Mixture { parts: vec![Part { by_number: 1.0, by_mass: 1.0, ..part.clone() }] };
        text.push(asked(&name, [part.by_number, part.by_mass], &alone));
        text.push(drawn(&own, all.len(), mass));
    }
    if mixture.parts.len() > MOST {
        text.push(format!("and {} more species", mixture.parts.len() - MOST));
    }
    if mixture.parts.len() > 1 {
        text.push(asked("all", [1.0; 2], &mixture));
        text.push(drawn(&all, all.len(), mass));
    }
    if let Sizes::Each(_) = sizes.as_sizes() {
        let [number, by_mass] = distances(&mixture, &all).map(rough);
        text.push(format!(
            "the drawn curves are within {number} by number and {by_mass} by mass of those asked for"
        ));
        text.extend(histogram(&all));
    }
    text
}

/// One row of the table.
fn row(name: &str, what: &str, counts: [&str; 3], quantiles: [&str; 6]) -> String {
    let cells: String = counts.iter().chain(&quantiles).map(|cell| format!("{cell:>9}")).collect();
    format!("{name:<NAME$} {what:<5}{cells}")
}

/// A share in per cent.
fn percent(share: f64) -> String {
    format!("{} %", rough(100.0 * share))
}

/// What is asked for, with its shares by number and by mass.
fn asked(name: &str, [by_number, by_mass]: [f64; 2], mixture: &Mixture) -> String {
    let number = SHARES.map(|p| rough(2.0 * mixture.quantile(Mixture::number_below, p)));
    let mass = SHARES.map(|p| rough(2.0 * mixture.quantile(Mixture::mass_below, p)));
    let [a, b, c] = number.each_ref().map(String::as_str);
    let [d, e, f] = mass.each_ref().map(String::as_str);
    row(name, "asked", ["", &percent(by_number), &percent(by_mass)], [a, b, c, d, e, f])
}

/// What is drawn: `own` of a number of spheres `all` with this `mass` (kg).
fn drawn(own: &[Size], all: usize, mass: f64) -> String {
    let SizeDistribution { by_number, by_mass, .. } = SizeDistribution::of(own);
    let [a, b, c] = by_number.map(rough);
    let [d, e, f] = by_mass.map(rough);
    let share = own.iter().map(|size| size.mass).sum::<f64>() / mass;
    let counts = [own.len().to_string(), percent(own.len() as f64 / all as f64), percent(share)];
    let counts = counts.each_ref().map(String::as_str);
    row("", "drawn", counts, [&a, &b, &c, &d, &e, &f])
}

/// The largest distances of the curves by number and by mass of `sizes` from those that are asked for.
fn distances(mixture: &Mixture, sizes: &[Size]) -> [f64; 2] {
    let mut sorted = sizes.to_vec();
    sorted.sort_by(|a, b| a.r.total_cmp(&b.r));
    let (count, mass) = (sorted.len() as f64, sorted.iter().map(|size| size.mass).sum::<f64>());
    let (mut number_below, mut mass_below, mut found) = (0.0, 0.0, [0.0f64; 2]);
    for alike in sorted.chunk_by(|a, b| a.r == b.r) {
        // Just below this radius and just above it: a species of one radius makes a step there.
        for (side, add) in [(1.0 - 1e-9, 0.0), (1.0 + 1e-9, 1.0)] {
            let r = side * alike[0].r;
            number_below += add * alike.len() as f64;
            mass_below += add * alike.iter().map(|size| size.mass).sum::<f64>();
            found[0] = found[0].max((number_below / count - mixture.number_below(r)).abs());
            found[1] = found[1].max((mass_below / mass - mixture.mass_below(r)).abs());
        }
    }
    found
}

/// Bars of the shares by number and by mass of diameters.
fn histogram(sizes: &[Size]) -> Vec<String> {
    let bins = SizeDistribution::of(sizes).bins;
    // Bins of a single diameter stay. Of others two become one: there are many.
    let joined = |pair: &[Bin]| {
        let [first, last] = [pair[0], pair[pair.len() - 1]];
        Bin {
            to: last.to,
            number_share: pair.iter().map(|bin| bin.number_share).sum(),
            mass_share: pair.iter().map(|bin| bin.mass_share).sum(),
            ..first
        }
    };
    let together = if bins.iter().all(|bin| bin.from == bin.to) { 1 } else { 2 };
    let bins: Vec<Bin> = bins.chunks(together).map(joined).collect();
    let most = bins.iter().map(|bin| bin.number_share.max(bin.mass_share)).fold(0.0, f64::max);
    let bar = |share: f64| "#".repeat((LONGEST * share / most).round() as usize);
    let width = LONGEST as usize + 9;
    let head = format!("{:<22}{:<width$}of their mass", "diameter, m", "of the spheres");
    let line = |bin: &Bin| {
        let range = match [bin.from, bin.to].map(rough) {
            [from, to] if bin.from == bin.to || from == to => from,
            [from, to] => format!("{from} to {to}"),
        };
        let [number, mass] =
            [bin.number_share, bin.mass_share].map(|share| format!("{} {}", bar(share), percent(share)));
        format!("{range:<22}{:<width$}{}", number.trim_start(), mass.trim_start())
    };
    std::iter::once(head).chain(bins.iter().map(line)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::report::testing::scene;
    use crate::scene::initial_condition;

    fn told(species: &str, more: &[&str]) -> Vec<String> {
        let species = format!("species=[{species}]");
        let mut sets = vec![species.as_str()];
        sets.extend(more);
        let scene = scene(&sets);
        lines(&scene, &initial_condition::grid(&scene, scene.particles.grid.as_ref().unwrap()))
    }

    fn words(line: &str) -> Vec<&str> {
        line.split_whitespace().collect()
    }

    #[test]
    fn every_species_and_all_are_told_as_asked_and_as_drawn() {
        let two = "{ name = 'coarse', share = 0.25, density = 1000, radius = 0.1 },
                   { name = 'fine', share = 0.75, density = 1000, radius = { uniform = [0.02, 0.06] } }";
        let text = told(&two.replace('\n', " "), &["particles.grid.count=400", "particles.grid.spacing=0.3"]);
        let mixed = 3.0 * 0.25 * 0.08 * (0.02f64.powi(2) + 0.06f64.powi(2));
        let coarse = format!("{} %", rough(100.0 * 1e-3 / (1e-3 + mixed)));
        assert_eq!(words(&text[2])[..6], ["coarse", "asked", "25", "%", &coarse[..4], "%"]);
        assert_eq!(words(&text[3])[..4], ["drawn", "100", "25", "%"]);
        // Diameters: 0.04 + p 0.08.
        assert_eq!(words(&text[4])[..4], ["fine", "asked", "75", "%"]);
        assert_eq!(words(&text[4])[6..9], ["0.048", "0.08", "0.112"]);
        assert_eq!(words(&text[5])[..4], ["drawn", "300", "75", "%"]);
        assert_eq!(words(&text[6])[..2], ["all", "asked"]);
        assert_eq!(words(&text[7])[..4], ["drawn", "400", "100", "%"]);
        assert!(text[8].starts_with("the drawn curves are within 0.0"), "{}", text[8]);
        assert_eq!(text[9][..8], *"diameter");
        assert_eq!(text.len(), 20, "{text:#?}");
        assert!(text.iter().all(|line| line.chars().count() <= 98), "{text:#?}");
    }

    #[test]
    fn the_curves_of_what_is_drawn_are_near_those_asked_for() {
        let one = "{ name = 'a', density = 1, radius = { lognormal = [0.03, 0.4, 0.005, 0.18] } }";
        let scene =
            scene(&[&format!("species=[{one}]"), "particles.grid.count=10000", "particles.grid.spacing=0.4"]);
        let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().unwrap());
        let sizes: Vec<Size> = (0..10_000).map(|i| start.sizes(&scene).as_sizes().of(i)).collect();
        let mixture = Mixture::of(&scene).unwrap();
        let [number, mass] = distances(&mixture, &sizes);
        assert!(number <= 1.01e-4 && mass < 0.005, "{number} {mass}");
        // Others are found to be others.
        let larger: Vec<Size> = sizes.iter().map(|size| Size::new(1.2 * size.r, size.mass)).collect();
        assert!(distances(&mixture, &larger)[0] > 0.1);
    }

    #[test]
    fn spheres_of_few_radii_have_a_bar_each_and_equal_ones_have_none() {
        let two = "{ name = 'a', share = 0.5, density = 1, radius = 0.05 }, \
                   { name = 'b', share = 0.5, density = 1, radius = 0.1 }";
        let text = told(two, &[]);
        let bars = &text[text.len() - 2..];
        // Half of the number is 24 x 0.5/0.889 = 13.5 letters where 8/9 of the mass is 24.
        let half = words(&bars[0])[1].len();
        assert!((13..=14).contains(&half), "{bars:?}");
        let half = "#".repeat(half);
        assert_eq!(words(&bars[0]), ["0.1", &half, "50", "%", "###", "11.1", "%"]);
        assert_eq!(words(&bars[1]), ["0.2", &half, "50", "%", &"#".repeat(24), "88.9", "%"]);
        // The mass of the scene must be that of its spheres.
        let mass = format!("particles.mass={:?}", initial_condition::mass_of(0.1, 1.0));
        let one = told("{ name = 'a', density = 1, radius = 0.1 }", &[&mass]);
        assert_eq!(one.len(), 4);
        assert_eq!(words(&one[3])[..4], ["drawn", "200", "100", "%"]);
    }
}
