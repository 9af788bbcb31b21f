//! Particles as text: CSV, extended XYZ for OVITO, and the data file of LAMMPS.

use std::f64::consts::PI;
use std::io::{self, Write};

use super::{FrameData, vector};
use crate::files::output::Species;

/// Writes columns as `particles.file` of a scene reads them, with rows by id.
pub fn csv(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let state = frame.state;
    let spins = if state.omega.is_some() { ",avx,avy,avz" } else { "" };
    let own_sizes = if frame.is_sized() { ",radius,mass" } else { "" };
    let own_species = if frame.species.is_some() { ",species" } else { "" };
    let own_materials = if state.materials.is_empty() { "" } else { ",material" };
    writeln!(out, "x,y,z,vx,vy,vz{spins}{own_sizes}{own_species}{own_materials}")?;
    let names: Vec<String> =
        frame.species.map_or_else(Vec::new, |species| species.names.iter().map(|name| field(name)).collect());
    for (id, ([x, y, z], v)) in state.x.iter().zip(&state.v).enumerate() {
        write!(out, "{x:?},{y:?},{z:?}")?;
        vector(out, v, ",")?;
        if let Some(omega) = &state.omega {
            vector(out, &omega[id], ",")?;
        }
        if let Some(size) = state.sizes.get(id) {
            write!(out, ",{:?},{:?}", size.r, size.mass)?;
        }
        if let Some(species) = frame.species {
            write!(out, ",{}", names[species.of[id] as usize])?;
        }
        if let Some(&material) = state.materials.get(id) {
            write!(out, ",{}", field(frame.scene.material_name(material as usize)))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Text as a field of a CSV table.
fn field(text: &str) -> String {
    match text.contains([',', '"', '\r', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// Writes one frame of extended XYZ, with the names that OVITO knows. Several frames may follow each other.
pub fn xyz(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let state = frame.state;
    let (low, high) = frame.cell();
    let [a, b, c] = (high - low).into();
    let spins = if state.omega.is_some() { ":angular_velocity:R:3" } else { "" };
    let masses = if frame.is_sized() { ":mass:R:1" } else { "" };
    writeln!(out, "{}", state.x.len())?;
    writeln!(
        out,
        "Lattice=\"{a:?} 0.0 0.0 0.0 {b:?} 0.0 0.0 0.0 {c:?}\" Origin=\"{:?} {:?} {:?}\" pbc=\"F F F\" \
         Properties=species:S:1:pos:R:3:id:I:1:radius:R:1:velo:R:3{spins}{masses} Time={:?}",
        low.x, low.y, low.z, state.time
    )?;
    let sizes = frame.sizes();
    let names = frame.species.map_or_else(Vec::new, |species| words(&species.names));
    for (id, (x, v)) in state.x.iter().zip(&state.v).enumerate() {
        write!(out, "{}", frame.species.map_or("S", |species| &names[species.of[id] as usize]))?;
        vector(out, x, " ")?;
        write!(out, " {id} {:?}", sizes.of(id).r)?;
        vector(out, v, " ")?;
        if let Some(omega) = &state.omega {
            vector(out, &omega[id], " ")?;
        }
        if let Some(size) = state.sizes.get(id) {
            write!(out, " {:?}", size.mass)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// The names as single words, since blanks part columns: `coarse_sand` for `coarse sand`. All words differ.
fn words(names: &[String]) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for name in names {
        let word: String =
            name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
        let is_free = |word: &String| !words.contains(word) && (word == name || !names.contains(word));
        let numbered = (2..).map(|k| format!("{word}_{k}"));
        let free = [word.clone()].into_iter().chain(numbered).find(is_free);
        words.push(free.expect("one of endless words is free"));
    }
    words
}

/// Longest name of a species in a comment of a LAMMPS file, whose lines are short.
const MOST_LETTERS: usize = 60;

/// Writes the data file of LAMMPS for `atom_style sphere` and `units si`. Ids start at 1, and so do types:
/// those of species are in the order of their names, which comments have.
pub fn lammps(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let (state, sizes) = (frame.state, frame.sizes());
    let (low, high) = frame.cell();
    let version = env!("CARGO_PKG_VERSION");
    writeln!(
        out,
        "frame {} at {:?} s by demhybrid {version}, units si, atom_style sphere",
        state.frame, state.time
    )?;
    let names = frame.species.map_or(&[][..], |Species { names, .. }| names);
    writeln!(out, "\n{} atoms\n{} atom types\n", state.x.len(), names.len().max(1))?;
    for (k, name) in names.iter().enumerate() {
        let name: String = name.chars().map(|c| if matches!(c, ' '..='~') { c } else { '?' }).collect();
        let name = &name[..name.len().min(MOST_LETTERS)];
        writeln!(out, "# type {} is {name}", k + 1)?;
    }
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        writeln!(out, "{:?} {:?} {axis}lo {axis}hi", low[k], high[k])?;
    }
    // Id, type, diameter (m), density (kg/m^3), centre (m).
    writeln!(out, "\nAtoms # sphere\n")?;
    for (id, x) in state.x.iter().enumerate() {
        let (r, mass) = (sizes.of(id).r, sizes.of(id).mass);
        let density = mass / (4.0 / 3.0 * PI * r * r * r);
        let kind = frame.species.map_or(1, |species| species.of[id] + 1);
        write!(out, "{} {kind} {:?} {density:?}", id + 1, 2.0 * r)?;
        vector(out, x, " ")?;
        writeln!(out)?;
    }
    // Id, velocity (m/s), angular velocity (1/s).
    writeln!(out, "\nVelocities\n")?;
    for (id, v) in state.v.iter().enumerate() {
        write!(out, "{}", id + 1)?;
        vector(out, v, " ")?;
        vector(out, &state.omega.as_ref().map_or([0.0; 3], |omega| omega[id]), " ")?;
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::export::testing::{NAMES, sized};

    fn written(write: impl Fn(&FrameData, &mut dyn Write) -> io::Result<()>) -> Vec<String> {
        let (scene, state, species) = sized();
        let frame = FrameData { scene: &scene, state: &state, species: Some(&species) };
        let mut text = Vec::new();
        write(&frame, &mut text).unwrap();
        String::from_utf8(text).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn every_sphere_has_its_own_size_and_species_in_text() {
        let rows = written(csv);
        assert_eq!(rows[0], "x,y,z,vx,vy,vz,radius,mass,species");
        assert_eq!(rows[2], "0.5,0.5,0.2,0.0,0.0,-1.0,0.05,0.25,\"b, or \"\"c\"\"\"");

        let rows = written(xyz);
        assert!(rows[1].contains(":velo:R:3:mass:R:1 Time="), "{}", rows[1]);
        assert_eq!(rows[2], "coarse_sand 0.4 0.5 0.3 0 0.1 0.1 0.0 0.0 2.0");
        assert_eq!(rows[3].split(' ').next(), Some("b,_or_\"c\""));

        let rows = written(lammps);
        assert!(rows.contains(&"3 atom types".to_owned()));
        assert!(rows.contains(&format!("# type 1 is {}", NAMES[0])), "{rows:?}");
        let atoms = rows.iter().position(|row| row.starts_with("Atoms")).unwrap();
        let numbers: Vec<f64> = rows[atoms + 3].split(' ').map(|word| word.parse().unwrap()).collect();
        assert_eq!(numbers[..3], [2.0, 2.0, 0.1]);
        assert!((numbers[3] - 0.25 / (4.0 / 3.0 * PI * 1.25e-4)).abs() < 1e-9, "{numbers:?}");
    }

    #[test]
    fn words_of_names_have_no_blanks_and_differ() {
        let names = ["a b", "a_b", "a\tb", "c"].map(str::to_owned);
        assert_eq!(words(&names), ["a_b_2", "a_b", "a_b_3", "c"]);
    }
}
