//! The materials of the particles of a start: from the column `material` of a particle file, or from the
//! species of the same name.

use super::InitialCondition;
use super::sizes::column;
use crate::error::Error;
use crate::model::columns::{Column, MATERIAL, SPECIES};
use crate::scene::materials::{NO_MATERIAL, known};
use crate::scene::{Scene, brief, shown};

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
        let name_of = |(names, numbers): (&Vec<String>, &Vec<f64>), i: usize| {
            names.get(numbers[i] as usize).cloned().unwrap_or_default()
        };
        let mut found = Vec::with_capacity(self.x.len());
        for i in 0..self.x.len() {
            let name = own.map(|own| name_of(own, i)).filter(|name| !name.is_empty());
            let number = match name {
                Some(name) if name == NO_MATERIAL => none,
                Some(name) => scene.material_number(&name).ok_or_else(|| {
                    let file = scene.particles.file.as_ref().map_or("the particles".to_owned(), |f| shown(f));
                    Error::Input(format!(
                        "{file}: particle {i} (row {} below the first line) has material = \"{}\", which is no \
                         material of the scene: {}",
                        i + 1,
                        brief(&name),
                        known(scene)
                    ))
                })?,
                None => {
                    let name = species.map(|species| name_of(species, i));
                    name.and_then(|name| scene.material_number(&name)).unwrap_or(none)
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
    fn without_materials_in_the_scene_nobody_reads_the_column() {
        let mut start = start(&[(MATERIAL, &["steel"][..], &[0.0; 3][..])]);
        start.settle_materials(&scene("")).unwrap();
        assert!(start.columns.is_empty());
        assert_eq!(start.unread, ["material (the scene has no [[material]])"]);
    }
}
