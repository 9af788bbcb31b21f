//! The materials of the particles of a start: from the column `material` of a particle file, or from the
//! species of the same name.

use super::InitialCondition;
use super::sizes::column;
use crate::error::Error;
use crate::model::columns::{Column, MATERIAL, SPECIES};
use crate::scene::materials::{NO_MATERIAL, known};
use crate::scene::{Scene, brief, shown};

/// What a name says about the material.
#[derive(Clone, Copy)]
enum Named {
    /// The number of the material, or of none.
    Material(usize),
    Blank,
    Unknown,
}

fn unknown(scene: &Scene, i: usize, name: &str) -> Error {
    let file = scene.particles.file.as_ref().map_or("the particles".to_owned(), |file| shown(file));
    Error::Input(format!(
        "{file}: particle {i} (row {} below the first line) has material = \"{}\", which is no material of the \
         scene: {}",
        i + 1,
        brief(name),
        known(scene)
    ))
}

impl InitialCondition {
    /// Gives every particle the material that its file names, or else the one named like its species, as
    /// numbers of the materials of `scene`. Where no particle has one, there is no column.
    ///
    /// Whoever reads a particle file by [`read_csv`](super::read_csv) has them settled.
    pub fn settle_materials(&mut self, scene: &Scene) -> Result<(), Error> {
        let names = |name: &str| {
            let found = self.columns.iter().find(|(column, _)| column.name == name);
            found.map(|(column, numbers)| (&column.names, numbers))
        };
        let (own, species) = (names(MATERIAL), names(SPECIES));
        if scene.material.is_empty() {
            if own.is_some() {
                self.columns.retain(|(column, _)| column.name != MATERIAL);
                self.unread.push(format!("{MATERIAL} (the scene has no [[material]])"));
            }
            return Ok(());
        }
        let none = scene.material.len();
        // By the numbers of names: nobody compares the names of a million particles.
        let looked_up = |names: &Vec<String>| -> Vec<Named> {
            let number = |name: &String| match scene.material_number(name) {
                Some(number) => Named::Material(number),
                None if name.is_empty() => Named::Blank,
                None if name == NO_MATERIAL => Named::Material(none),
                None => Named::Unknown,
            };
            names.iter().map(number).collect()
        };
        let by_column = own.map(|(names, numbers)| (looked_up(names), names, numbers));
        let by_species = species.map(|(names, numbers)| (looked_up(names), numbers));
        let mut found = Vec::with_capacity(self.x.len());
        for i in 0..self.x.len() {
            let number = match by_column.as_ref().map(|(table, _, numbers)| table[numbers[i] as usize]) {
                Some(Named::Material(number)) => number,
                Some(Named::Unknown) => {
                    let name =
                        by_column.as_ref().map_or("", |(_, names, numbers)| &names[numbers[i] as usize]);
                    return Err(unknown(scene, i, name));
                }
                Some(Named::Blank) | None => {
                    match by_species.as_ref().map(|(table, numbers)| table[numbers[i] as usize]) {
                        Some(Named::Material(number)) => number,
                        _ => none,
                    }
                }
            };
            found.push(number as f64);
        }
        self.columns.retain(|(column, _)| column.name != MATERIAL);
        if found.iter().any(|&number| number < none as f64) {
            let names = (0..=none).map(|number| scene.material_name(number).to_owned()).collect();
            self.columns.push((Column { names, ..column(MATERIAL, "1") }, found));
        }
        Ok(())
    }

    /// Checks that the column of materials has numbers of materials of `scene`, or of none.
    pub(crate) fn check_materials(&self, scene: &Scene) -> Result<(), Error> {
        let most = scene.material.len();
        let is_number = |number: f64| number.fract() == 0.0 && (0.0..=most as f64).contains(&number);
        let found = self.columns.iter().find(|(column, _)| column.name == MATERIAL && most > 0);
        let wrong = found
            .and_then(|(_, numbers)| numbers.iter().enumerate().find(|(_, number)| !is_number(**number)));
        match wrong {
            None => Ok(()),
            Some((i, number)) => Err(Error::Input(format!(
                "particle {i} has the material {number}: it must be the number of a [[material]], from 0 on, \
                 or {most} for none"
            ))),
        }
    }

    /// Numbers of the materials of all particles; empty where nobody has one.
    pub fn materials(&self) -> Vec<u32> {
        let found = self.columns.iter().find(|(column, _)| column.name == MATERIAL);
        found.map_or_else(Vec::new, |(_, numbers)| numbers.iter().map(|&number| number as u32).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(materials: &str) -> Scene {
        let text = format!(
            "t_end = 1
            particles = {{ radius = 0.1, mass = 1, file = 'a.csv' }}
            contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }}
            material = [{materials}]"
        );
        Scene::parse("a.toml", &text, &[]).unwrap()
    }

    fn start(columns: &[(&str, &[&str], &[f64])]) -> InitialCondition {
        let named = |&(name, names, numbers): &(&str, &[&str], &[f64])| {
            let names = names.iter().map(|&name| name.to_owned()).collect();
            (Column { names, ..column(name, "1") }, numbers.to_vec())
        };
        let x = vec![[0.0; 3]; 3];
        let columns = columns.iter().map(named).collect();
        InitialCondition { x: x.clone(), v: x.clone(), omega: x, columns, ..InitialCondition::default() }
    }

    const TWO: &str = "{ name = 'glass' }, { name = 'steel' }";

    #[test]
    fn the_column_wins_over_the_species_of_the_same_name() {
        let species = (SPECIES, &["steel", "sand"][..], &[0.0, 0.0, 1.0][..]);
        let of = |columns: &[(&str, &[&str], &[f64])]| {
            let mut start = start(columns);
            start.settle_materials(&scene(TWO)).unwrap();
            start.materials()
        };
        assert_eq!(of(&[species]), [1, 1, 2]);
        let own = (MATERIAL, &["", "glass", NO_MATERIAL][..], &[0.0, 1.0, 2.0][..]);
        assert_eq!(of(&[species, own]), [1, 0, 2]);
        assert!(of(&[(SPECIES, &["sand"][..], &[0.0; 3][..])]).is_empty());
    }

    #[test]
    fn settling_twice_changes_nothing_and_a_name_that_is_none_is_told() {
        let mut twice = start(&[(MATERIAL, &["steel", "glass"][..], &[0.0, 1.0, 0.0][..])]);
        twice.settle_materials(&scene(TWO)).unwrap();
        let once = twice.clone();
        twice.settle_materials(&scene(TWO)).unwrap();
        assert_eq!((twice.materials(), &twice), (vec![1, 0, 1], &once));
        let mut wrong = start(&[(MATERIAL, &["steel", "glas"][..], &[0.0, 0.0, 1.0][..])]);
        let message = wrong.settle_materials(&scene(TWO)).unwrap_err().to_string();
        assert!(message.starts_with("a.csv: particle 2 (row 3"), "{message}");
        assert!(
            message.contains("\"glas\"") && message.contains("one of: \"glass\", \"steel\""),
            "{message}"
        );
    }

    #[test]
    fn numbers_that_are_no_materials_are_refused() {
        let of = |numbers: &[f64]| {
            let why = start(&[(MATERIAL, &[][..], numbers)]).check_materials(&scene(TWO)).err();
            why.map(|why| why.to_string())
        };
        assert_eq!(of(&[0.0, 1.0, 2.0]), None);
        for wrong in [3.0, -1.0, 0.5, f64::NAN] {
            let message = of(&[0.0, wrong, 0.0]).unwrap();
            assert!(message.contains("particle 1") && message.contains("or 2 for none"), "{message}");
        }
    }

    #[test]
    fn without_materials_in_the_scene_nobody_reads_the_column() {
        let mut start = start(&[(MATERIAL, &["steel"][..], &[0.0; 3][..])]);
        start.settle_materials(&scene("")).unwrap();
        assert!(start.columns.is_empty());
        assert_eq!(start.unread, ["material (the scene has no [[material]])"]);
    }
}
