//! The sizes of the particles of a start: columns of radii, and of masses or densities.

use super::InitialCondition;
use crate::error::Error;
use crate::math::digits::short;
use crate::model::columns::{Changes, Column, MASS, RADIUS};
use crate::model::size::{Size, Sizes};
use crate::scene::species::WIDEST;
use crate::scene::{Particles, Scene, shown};
use std::f64::consts::PI;

/// Name of the column of densities (kg/m^3) in a particle file.
pub(super) const DENSITY: &str = "density";

/// The columns of sizes in a particle file, with their units.
pub(super) const COLUMNS: [(&str, &str); 3] = [(RADIUS, "m"), (MASS, "kg"), (DENSITY, "kg/m^3")];

/// A column of one number for each particle, which is in the file of the run.
pub fn column(name: &str, unit: &str) -> Column {
    let (name, unit) = (name.to_owned(), unit.to_owned());
    Column { name, width: 1, unit, changes: Changes::WithLists, in_file: true, names: Vec::new() }
}

/// The mass of a sphere with the radius `r` (m) and the `density` (kg/m^3), kg.
pub fn mass_of(r: f64, density: f64) -> f64 {
    4.0 / 3.0 * PI * r.powi(3) * density
}

/// The mean of some numbers; exactly their value where all are the same.
pub(super) fn mean(numbers: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = numbers.clone().count();
    let first = numbers.clone().next().unwrap_or(f64::NAN);
    if numbers.clone().all(|number| number == first) { first } else { numbers.sum::<f64>() / count as f64 }
}

impl InitialCondition {
    pub(super) fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(column, _)| column.name == name).map(|(_, numbers)| &numbers[..])
    }

    /// The sizes of all particles.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    /// use demhybrid::scene::initial_condition::InitialCondition;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?; // radius 0.1 m, mass 1 kg
    /// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
    /// let alike = InitialCondition::default();
    /// assert_eq!(alike.sizes(&scene).as_sizes().of(7).r, 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sizes(&self, scene: &Scene) -> OwnSizes {
        let typical = Size::new(scene.particles.radius, scene.particles.mass);
        let each = match (self.column(RADIUS), self.column(MASS)) {
            (Some(r), Some(mass)) => r.iter().zip(mass).map(|(&r, &mass)| Size::new(r, mass)).collect(),
            _ => Vec::new(),
        };
        OwnSizes { typical, each }
    }

    /// The mean radius (m), if there is a column of radii, and the mean mass (kg), if there is one of masses
    /// or densities; those without a radius of their own have the radius `r` (m).
    pub(crate) fn means(&self, r: Option<f64>) -> [Option<f64>; 2] {
        let radii = self.column(RADIUS);
        let radius = |i: usize| radii.map_or(r, |radii| Some(radii[i])).unwrap_or(f64::NAN);
        let density = |densities: &[f64]| {
            let masses: Vec<f64> =
                densities.iter().enumerate().map(|(i, &density)| mass_of(radius(i), density)).collect();
            mean(masses.iter().copied())
        };
        let masses = self.column(MASS).map(|masses| mean(masses.iter().copied()));
        [radii.map(|radii| mean(radii.iter().copied())), masses.or_else(|| self.column(DENSITY).map(density))]
    }

    /// Turns columns of radii, masses and densities into radii and masses of all particles, or into the
    /// radius and the mass of the scene where all are alike. `density` (kg/m^3) is that of the scene, if it
    /// gives one.
    ///
    /// Whoever reads a particle file by [`read_csv`](super::read_csv) calls it before a run;
    /// [`crate::engine::load::load`] does so.
    pub fn settle_sizes(&mut self, scene: &mut Scene, density: Option<f64>) {
        let (radii, masses, densities) = (self.column(RADIUS), self.column(MASS), self.column(DENSITY));
        if radii.or(masses).or(densities).is_none() {
            return;
        }
        let (typical, count) = (&scene.particles, self.x.len());
        let size = |i: usize| {
            let r = radii.map_or(typical.radius, |radii| radii[i]);
            let own = masses.map(|masses| masses[i]);
            let dense =
                || densities.map(|densities| densities[i]).or(density).map(|density| mass_of(r, density));
            (r, own.or_else(dense).unwrap_or(typical.mass))
        };
        let overruled = masses.or(densities).is_some();
        let (radii, masses): (Vec<f64>, Vec<f64>) = (0..count).map(size).unzip();
        let names = COLUMNS.map(|(name, _)| name);
        self.columns.retain(|(column, _)| !names.contains(&&column.name[..]));
        let alike = |numbers: &[f64]| numbers.iter().all(|number| *number == numbers[0]);
        if overruled {
            // Columns go before keys.
            scene.particles.density = None;
        }
        if alike(&radii) && alike(&masses) {
            (scene.particles.radius, scene.particles.mass) = (radii[0], masses[0]);
            return;
        }
        if scene.particles.density.is_none() {
            scene.particles.mass = mean(masses.iter().copied());
        }
        self.columns.push((column(RADIUS, "m"), radii));
        self.columns.push((column(MASS, "kg"), masses));
    }

    /// Checks columns of sizes: both or none, positive, and within what the lists of neighbours manage.
    pub(crate) fn check_sizes(&self, scene: &Scene) -> Result<(), Error> {
        let source = scene.particles.read_from().map_or("the particles".to_owned(), shown);
        let wrong = |why: String| Err(Error::Input(format!("{source}: {why}")));
        let Particles { radius, mass, .. } = scene.particles;
        if !(mass.is_normal() && mass > 0.0 && radius > 0.0) {
            return wrong(format!(
                "a sphere of {} m would have a mass of {mass:e} kg, which no arithmetic survives",
                short(radius)
            ));
        }
        if self.column(RADIUS).is_some() != self.column(MASS).is_some() {
            return wrong("columns of radii and of masses go together".to_owned());
        }
        for (name, unit) in [COLUMNS[0], COLUMNS[1]] {
            let Some(numbers) = self.column(name) else { continue };
            if let Some((i, number)) =
                numbers.iter().enumerate().find(|(_, number)| !number.is_normal() || **number <= 0.0)
            {
                return wrong(format!(
                    "particle {i} has the {name} {} {unit}: it must be greater than 0, and not so small or \
                     large that no arithmetic survives it",
                    short(*number)
                ));
            }
        }
        let Some(radii) = self.column(RADIUS) else { return Ok(()) };
        let (least, most) =
            radii.iter().fold((f64::INFINITY, 0.0f64), |(low, high), &r| (low.min(r), high.max(r)));
        if most > WIDEST * least {
            return wrong(format!(
                "radii reach from {} m to {} m, and a factor of {WIDEST} between them is possible",
                short(least),
                short(most)
            ));
        }
        Ok(())
    }
}

/// The sizes of all particles of a start.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnSizes {
    typical: Size,
    each: Vec<Size>,
}

impl OwnSizes {
    /// The sizes, by id.
    pub fn as_sizes(&self) -> Sizes<'_> {
        if self.each.is_empty() { Sizes::Equal(self.typical) } else { Sizes::Each(&self.each) }
    }

    /// Root of m/r of the particle for which it is least, over that of a typical one: how much weaker a force
    /// must be than for a typical one, to the power of 2, so that no particle feels it. At most 1.
    pub fn lightest(&self) -> f64 {
        self.typical.lightest_of(self.each.iter().copied())
    }

    /// The largest radius, m.
    pub fn largest(&self) -> f64 {
        self.each.iter().map(|size| size.r).reduce(f64::max).unwrap_or(self.typical.r)
    }
}
