//! The species of a scene together: how many spheres each gets, and the curves of all.

use super::{Distribution, Species, SpeciesBy};
use crate::scene::Scene;
use crate::scene::initial_condition::mass_of;

/// All species of a scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::Scene;
/// use demhybrid::scene::species::Mixture;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let species = "species=[{ name = 'fine', share = 0.9, density = 1000, radius = 0.05 },
///                         { name = 'coarse', share = 0.1, density = 1000,
///                           radius = { uniform = [0.1, 0.2] } }]";
/// let scene = Scene::parse("quick.toml", &text, &[species.replace('\n', " ")])?;
/// let mixture = Mixture::of(&scene).ok_or("there are no species")?;
/// assert_eq!(mixture.counts(1000), [900, 100]); // shares are by number if the scene does not say
/// assert!((mixture.quantile(Mixture::number_below, 0.95) - 0.15).abs() < 1e-9); // m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    /// The species, in the order of the scene.
    pub parts: Vec<Part>,
}

/// One species of a mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Density, kg/m^3.
    pub density: f64,
    /// Its radii.
    pub distribution: Distribution,
    /// Its share of the number of spheres, as asked for.
    pub by_number: f64,
    /// Its share of the mass of all spheres, as asked for.
    pub by_mass: f64,
}

impl Mixture {
    /// The species of a scene that was checked; `None` if it has none.
    pub fn of(scene: &Scene) -> Option<Self> {
        let by = scene.particles.species_by.unwrap_or_default();
        (!scene.species.is_empty()).then(|| Self::new(&scene.species, by))
    }

    /// These species with shares `by` number, volume or mass.
    pub(super) fn new(species: &[Species], by: SpeciesBy) -> Self {
        let mut parts: Vec<Part> = species
            .iter()
            .map(|species| {
                let (density, share) = (species.density.unwrap_or(f64::NAN), species.share.unwrap_or(1.0));
                let distribution = Distribution::of(&species.radius);
                let volume = distribution.mean_cube();
                let by_number = match by {
                    SpeciesBy::Number => share,
                    SpeciesBy::Volume => share / volume,
                    SpeciesBy::Mass => share / (volume * density),
                };
                let by_mass = by_number * volume * density;
                Part { name: species.name.clone(), density, distribution, by_number, by_mass }
            })
            .collect();
        let number: f64 = parts.iter().map(|part| part.by_number).sum();
        let mass: f64 = parts.iter().map(|part| part.by_mass).sum();
        for part in &mut parts {
            part.by_number /= number;
            part.by_mass /= mass;
        }
        Mixture { parts }
    }

    /// How many of `count` spheres are of each species: whole numbers nearest to the shares.
    pub fn counts(&self, count: u64) -> Vec<u64> {
        let exact: Vec<f64> = self.parts.iter().map(|part| part.by_number * count as f64).collect();
        let mut counts: Vec<u64> = exact.iter().map(|exact| exact.floor() as u64).collect();
        let mut order: Vec<usize> = (0..counts.len()).collect();
        // Those that lost most are the first to get one more; of equal ones the first of the scene.
        let lost = |k: usize| exact[k] - exact[k].floor();
        order.sort_by(|&a, &b| lost(b).total_cmp(&lost(a)));
        let missing = count.saturating_sub(counts.iter().sum());
        order.iter().cycle().take(missing.min(LARGEST_CORRECTION) as usize).for_each(|&k| counts[k] += 1);
        counts
    }

    /// The volume of `count` spheres together, m^3.
    pub fn volume(&self, count: u64) -> f64 {
        let volumes = self.parts.iter().zip(self.counts(count));
        volumes.map(|(part, n)| n as f64 * mass_of(1.0, 1.0) * part.distribution.mean_cube()).sum()
    }

    /// The least and the largest of `count` radii, m. Every species must have a sphere.
    pub fn range(&self, count: u64) -> [f64; 2] {
        let ranges = self.parts.iter().zip(self.counts(count)).map(|(part, n)| part.distribution.range(n));
        ranges.fold([f64::INFINITY, 0.0], |[low, high], [a, b]| [low.min(a), high.max(b)])
    }

    /// Whether all spheres have one radius and one mass.
    pub fn is_alike(&self) -> bool {
        let first = &self.parts[0];
        self.parts.iter().all(|part| {
            matches!(part.distribution, Distribution::One(_))
                && part.distribution == first.distribution
                && part.density == first.density
        })
    }

    /// Share of the number of spheres with a radius below `r` (m), as asked for.
    pub fn number_below(&self, r: f64) -> f64 {
        self.parts.iter().map(|part| part.by_number * part.distribution.number_below(r)).sum()
    }

    /// Share of the mass of all spheres with a radius below `r` (m), as asked for.
    pub fn mass_below(&self, r: f64) -> f64 {
        self.parts.iter().map(|part| part.by_mass * part.distribution.volume_below(r)).sum()
    }

    /// The radius (m) below which the share `p` is by `below`, such as [`Mixture::mass_below`].
    pub fn quantile(&self, below: impl Fn(&Self, f64) -> f64, p: f64) -> f64 {
        let supports = self.parts.iter().map(|part| part.distribution.support());
        let [mut low, mut high] =
            supports.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], [a, b]| [low.min(a), high.max(b)]);
        // Halving of a factor of 1e20 reaches neighbouring doubles in 60 steps.
        for _ in 0..80 {
            let middle = (low * high).sqrt();
            if below(self, middle) < p { low = middle } else { high = middle }
        }
        high
    }
}

/// Rounding down loses less than one sphere of each species, and there are 1000 species at most.
const LARGEST_CORRECTION: u64 = 1000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::species::Radius;

    fn species(name: &str, share: f64, density: f64, r: f64) -> Species {
        let (name, share, density) = (name.into(), Some(share), Some(density));
        Species { name, share, density, material: None, radius: Radius::One(r) }
    }

    #[test]
    fn counts_add_up_and_are_nearest_to_the_shares() {
        let third = 1.0 / 3.0;
        let three = ["a", "b", "c"].map(|name| species(name, third, 1.0, 1.0));
        let mixture = Mixture::new(&three, SpeciesBy::Number);
        assert_eq!(mixture.counts(9), [3, 3, 3]);
        assert_eq!(mixture.counts(200), [67, 67, 66]);
        assert_eq!(mixture.counts(1), [1, 0, 0]);
        assert_eq!(mixture.counts(1_000_000_000).iter().sum::<u64>(), 1_000_000_000);
    }

    #[test]
    fn shares_by_volume_and_by_mass_are_those_of_the_spheres() {
        let two = [species("heavy", 0.5, 3.0, 1.0), species("light", 0.5, 1.0, 2.0)];
        let of = |by| Mixture::new(&two, by).counts(2700);
        assert_eq!(of(SpeciesBy::Number), [1350, 1350]);
        // One of the light ones has the volume of eight heavy ones, and 8/3 of their mass.
        assert_eq!(of(SpeciesBy::Volume), [2400, 300]);
        let [heavy, light] = of(SpeciesBy::Mass)[..] else { panic!() };
        assert_eq!((heavy, light), (1964, 736));
        assert!((3.0 * heavy as f64 / (8.0 * light as f64) - 1.0).abs() < 2e-3);
    }

    #[test]
    fn quantiles_of_a_mixture_invert_its_curves() {
        let spread = |name: &str, share, radius| Species { radius, ..species(name, share, 2.0, 1.0) };
        let table = |text: &str| Radius::Spread(toml::from_str(text).unwrap());
        let mixed = [
            spread("a", 0.25, table("uniform = [0.1, 0.3]")),
            spread("b", 0.75, table("lognormal = [0.2, 0.4, 0.02, 2.0]")),
        ];
        let mixture = Mixture::new(&mixed, SpeciesBy::Mass);
        for p in [0.1, 0.5, 0.9] {
            let number = mixture.number_below(mixture.quantile(Mixture::number_below, p));
            let mass = mixture.mass_below(mixture.quantile(Mixture::mass_below, p));
            assert!((number - p).abs() < 1e-12 && (mass - p).abs() < 1e-12, "{p}: {number} {mass}");
        }
        assert!((mixture.parts[0].by_mass - 0.25).abs() < 1e-15);
        // Two sizes: the curve has steps, and a quantile is one of them.
        let steps = [species("a", 0.3, 1.0, 0.1), species("b", 0.7, 1.0, 0.2)];
        let steps = Mixture::new(&steps, SpeciesBy::Number);
        let found = [0.2, 0.4].map(|p| steps.quantile(Mixture::number_below, p));
        assert!((found[0] - 0.1).abs() < 1e-12 && (found[1] - 0.2).abs() < 1e-12, "{found:?}");
    }
}
