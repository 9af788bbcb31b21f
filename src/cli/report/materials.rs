//! Materials in a plan: what is of which, and what holds between every two of them.

use crate::math::digits::{rough, short};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::scene::materials::{Between, COEFFICIENTS};

/// Most pairs in a plan.
const MOST_PAIRS: usize = 40;

/// How many there are of each material: `20 glass, 5 (none)`.
fn counted(scene: &Scene, numbers: impl Iterator<Item = usize>) -> (String, Vec<u64>) {
    let mut counts = vec![0u64; scene.material.len() + 1];
    numbers.for_each(|number| counts[number] += 1);
    let named = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    let named: Vec<String> = named.map(|(k, count)| format!("{count} {}", scene.material_name(k))).collect();
    (named.join(", "), counts)
}

/// The coefficients of a pair, with where they are from; those within a material are its own.
fn coefficients(between: &Between, own: bool) -> String {
    let found = between.coefficients;
    let numbers = [found.restitution, found.friction, found.rolling, found.twisting];
    let one = |k: usize| match (own, between.given[k]) {
        (true, _) => format!("{} {}", COEFFICIENTS[k], short(numbers[k])),
        (false, true) => format!("{} {} given", COEFFICIENTS[k], short(numbers[k])),
        (false, false) => format!("{} {} mixed", COEFFICIENTS[k], rough(numbers[k])),
    };
    [0, 1, 2, 3].map(one).join(", ")
}

/// Lines about the materials of a scene; none without any. The first says what is of which material, the
/// others what holds between two of them.
pub(super) fn materials(scene: &Scene, start: &InitialCondition) -> Vec<String> {
    let none = scene.material.len();
    if none == 0 {
        return Vec::new();
    }
    let mut own: Vec<usize> = start.materials().into_iter().map(|number| number as usize).collect();
    own.resize(start.x.len(), none);
    let (spheres, of_spheres) = counted(scene, own.into_iter());
    let (walls, of_walls) = counted(scene, scene.wall_materials().into_iter());
    let mut lines = vec![if walls.is_empty() { spheres } else { format!("{spheres}; walls: {walls}") }];
    // What has no material counts only where there is such a thing.
    let count = none + usize::from(of_spheres[none] + of_walls[none] > 0);
    let pairs = (0..count).flat_map(|a| (a..count).map(move |b| (a, b)));
    let described = |(a, b): (usize, usize)| {
        let names = format!("{} - {}", scene.material_name(a), scene.material_name(b));
        format!("{names:<20} {}", coefficients(&scene.between_materials(a, b), a == b))
    };
    lines.extend(pairs.take(MOST_PAIRS).map(described));
    if count * (count + 1) / 2 > MOST_PAIRS {
        lines.push(format!("and {} more pairs", count * (count + 1) / 2 - MOST_PAIRS));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::report::testing::scene;

    #[test]
    fn materials_are_told_with_what_holds_between_them_and_a_plan_without_any_says_nothing() {
        let start = InitialCondition { x: vec![[0.5; 3]; 2], ..InitialCondition::default() };
        assert!(materials(&scene(&[]), &start).is_empty());
        let of = |material: &str| materials(&scene(&[material]), &start);
        let found = of("material=[{ name = 'a', restitution = 0.9 }, \
                        { name = 'b', pair = [{ with = 'a', restitution = 0.3 }] }]");
        assert!(found[0].starts_with("2 (none)"), "{found:?}");
        assert_eq!(found.len(), 1 + 6);
        assert!(found[1].starts_with("a - a                restitution 0.9, "), "{found:?}");
        assert!(found[2].contains("a - b                restitution 0.3 given, friction"), "{found:?}");
        assert!(found[3].starts_with("a - (none)") && found[3].contains(" mixed"), "{found:?}");
        let names: Vec<String> = (0..12).map(|k| format!("{{ name = 'm{k}' }}")).collect();
        let many = of(&format!("material=[{}]", names.join(", ")));
        assert_eq!(many.last().unwrap(), "and 51 more pairs");
    }
}
