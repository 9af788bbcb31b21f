//! The starts that keys of a scene describe: a random one and a lattice; and what all sources have in common.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Grid, Particles};

/// Largest volume fraction of a random start. Random packings end at 0.64, and from 0.55 on few rooms with
/// walls can be filled.
pub const LARGEST_FRACTION: f64 = 0.5;

/// Volume fraction of a random start in a room without a lid, if the scene gives none.
pub const OPEN_FRACTION: f64 = 0.3;

/// A random start: spheres at random places without an overlap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Random {
    /// Number of particles, in 1..=1e9.
    pub count: u64,
    /// Volume of the spheres over that of the room that they take; > 0 and at most [`LARGEST_FRACTION`].
    ///
    /// They fill region and walls from below as high as it asks. If it is left out, they fill all of it, or
    /// to [`OPEN_FRACTION`] where it is open above.
    pub fraction: Option<f64>,
    /// Seed of the places; `Some` after [`super::Scene::set_seed_if_missing`].
    pub seed: Option<u64>,
    /// The part of the container in which the spheres start; all of it if left out.
    pub region: Option<Region>,
}

/// A box for spheres, which need not have walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Lower corner, m; -inf: as far as the walls.
    pub min: [f64; 3],
    /// Upper corner, m; inf: as far as the walls.
    pub max: [f64; 3],
}

/// A hexagonal close packed lattice, filled layer by layer from the bottom.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lattice {
    /// Number of particles, in 1..=1e9.
    pub count: u64,
    /// Distance of neighbouring centres, m; at least 2 radii. 2.02 radii if left out.
    #[serde(default = "super::left_out")]
    pub spacing: f64,
    /// Upper bound of the random shift of a centre along each axis, m; >= 0. 0 if left out.
    #[serde(default)]
    pub jitter: f64,
    /// Height of the plane on which the first layer lies, m. The floor of the box, or z = 0 if it has none,
    /// if left out.
    #[serde(default = "super::left_out")]
    pub bottom: f64,
    /// Seed of the random shifts; `Some` after [`super::Scene::set_seed_if_missing`].
    pub seed: Option<u64>,
}

impl Particles {
    /// The keys that say where the spheres start, with whether the scene has each.
    pub(crate) fn sources(&self) -> [(&'static str, bool); 5] {
        [
            ("particles.file", self.file.is_some()),
            ("particles.grid", self.grid.is_some()),
            ("particles.random", self.random.is_some()),
            ("particles.lattice", self.lattice.is_some()),
            ("particles.run", self.run.is_some()),
        ]
    }

    /// The key of the source of the particles.
    pub fn source(&self) -> &'static str {
        self.sources().into_iter().find(|(_, there)| *there).map_or("particles", |(key, _)| key)
    }

    /// The file from which the particles come, if they come from one: a table or the file of a run.
    pub fn read_from(&self) -> Option<&Path> {
        self.file.as_deref().or(self.run.as_deref())
    }

    /// The number of particles, where keys give it.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?;
    /// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
    /// assert_eq!((scene.particles.count(), scene.particles.source()), (Some(27), "particles.grid"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn count(&self) -> Option<u64> {
        let Particles { grid, random, lattice, .. } = self;
        let grid = grid.as_ref().map(|grid| grid.count);
        let random = || random.as_ref().map(|random| random.count);
        grid.or_else(random).or_else(|| lattice.as_ref().map(|lattice| lattice.count))
    }

    /// The seed of the start, `Some(None)` where one is still to be drawn; `None` if the source has none.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?;
    /// let mut scene = Scene::parse("configs/quick.toml", &text, &[])?;
    /// *scene.particles.seed_mut().ok_or("no seed")? = Some(7);
    /// assert_eq!(scene.particles.grid.and_then(|grid| grid.seed), Some(7));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn seed_mut(&mut self) -> Option<&mut Option<u64>> {
        let Particles { grid, random, lattice, .. } = self;
        let grid = grid.as_mut().map(|Grid { seed, .. }| seed);
        let random = random.as_mut().map(|Random { seed, .. }| seed);
        grid.or(random).or(lattice.as_mut().map(|Lattice { seed, .. }| seed))
    }
}
