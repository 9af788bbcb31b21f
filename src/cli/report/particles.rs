//! The particles in a plan: their number, radii, masses and species.

use crate::math::digits::{rough, short};
use crate::model::columns::SPECIES;
use crate::model::size::{Size, Sizes};
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::scene::initial_condition::push_apart::Pushed;

/// Most names of species in a plan.
const MOST_NAMES: usize = 8;

/// The least and the largest of some numbers.
pub(super) fn range(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// `5000 of radius 0.1 m and mass 1 kg`, or the ranges of radii and masses where they differ.
pub(super) fn particles(scene: &Scene, start: &InitialCondition) -> String {
    let (count, typical) = (start.x.len(), &scene.particles);
    let sizes = start.sizes(scene);
    match sizes.as_sizes() {
        Sizes::Equal(Size { r, mass, .. }) => {
            format!("{count} of radius {} m and mass {} kg", short(r), short(mass))
        }
        Sizes::Each(sizes) => {
            let radii = spread(sizes.iter().map(|size| size.r), typical.radius, "m");
            format!(
                "{count} of radius {radii}, mass {}",
                spread(sizes.iter().map(|size| size.mass), typical.mass, "kg")
            )
        }
    }
}

/// `0.02 to 0.11 m (typical 0.05 m)`, or the number itself where all are the same.
fn spread(numbers: impl Iterator<Item = f64>, typical: f64, unit: &str) -> String {
    let [low, high] = range(numbers);
    match low == high {
        true => format!("{} {unit}", short(low)),
        false => format!("{} to {} {unit} (typical {} {unit})", rough(low), rough(high), rough(typical)),
    }
}

/// `4700 sand, 300 gravel`: how many particles there are of each species, if they have any.
pub(super) fn species(start: &InitialCondition) -> Option<String> {
    let (column, numbers) = start.columns.iter().find(|(column, _)| column.name == SPECIES)?;
    let mut counts = vec![0u64; column.names.len()];
    for &number in numbers {
        *counts.get_mut(number as usize)? += 1;
    }
    let more = match counts.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let counted = column.names.iter().zip(&counts).take(MOST_NAMES);
    let counted: Vec<String> = counted.map(|(name, count)| format!("{count} {name}")).collect();
    Some(counted.join(", ") + &more)
}

/// What `particles.push_apart` moved, if the scene asks for it.
pub(super) fn pushed_apart(start: &InitialCondition) -> Option<String> {
    let Pushed { overlapping, deepest, furthest, sweeps } = start.pushed?;
    let count = start.x.len();
    Some(match overlapping {
        0 => format!("none of {count} spheres overlapped, so push_apart moved none"),
        _ => format!(
            "{overlapping} of {count} spheres overlapped, by up to {} m; pushed apart in {sweeps} sweeps, the \
             furthest by {} m",
            rough(deepest),
            rough(furthest)
        ),
    })
}

/// What shares of a radius refer to in reports: all have this radius, or it is that of a typical one.
pub(super) fn whose_radius(start: &InitialCondition, scene: &Scene) -> &'static str {
    match start.sizes(scene).as_sizes() {
        Sizes::Equal(_) => "the radius",
        Sizes::Each(_) => "the radius, where that is most",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::report::testing::{scene, sized};
    use crate::model::columns::Column;
    use crate::scene::initial_condition::column;

    #[test]
    fn radii_and_masses_are_told_as_ranges_where_they_differ() {
        let (mut scene, x) = (scene(&[]), vec![[0.5; 3]; 3]);
        let alike = InitialCondition { x: x.clone(), ..InitialCondition::default() };
        assert_eq!(particles(&scene, &alike), "3 of radius 0.1 m and mass 1 kg");
        assert_eq!((species(&alike), whose_radius(&alike, &scene)), (None, "the radius"));

        let mut three = sized(x, [0.02, 0.05, 0.11], [0.1, 0.1, 0.1]);
        scene.particles.radius = 0.06;
        scene.particles.mass = 0.1;
        let told = particles(&scene, &three);
        assert_eq!(told, "3 of radius 0.02 to 0.11 m (typical 0.06 m), mass 0.1 kg");
        assert_eq!(whose_radius(&three, &scene), "the radius, where that is most");

        let names = ["sand", "gravel"].map(str::to_owned).into();
        three.columns.push((Column { names, ..column(SPECIES, "1") }, vec![0.0, 1.0, 0.0]));
        assert_eq!(species(&three).unwrap(), "2 sand, 1 gravel");
        let many: Vec<String> = (0..11).map(|k| format!("s{k}")).collect();
        three.columns.last_mut().unwrap().0.names = many;
        assert!(species(&three).unwrap().ends_with("0 s7 and 3 more"));
    }
}
