//! The distribution of sizes, by number and by mass.

use serde::Serialize;

use crate::model::size::Size;

/// Up to this number of diameters each has a bin of its own.
const MOST_DIAMETERS: usize = 20;
/// Number of bins where there are more.
const BINS: usize = 20;

/// A bin of diameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Smallest diameter, m.
    pub from: f64,
    /// Largest diameter, m: that of the next bin does not belong to it.
    pub to: f64,
    /// Number of spheres.
    pub spheres: usize,
    /// Share of all spheres.
    pub number_share: f64,
    /// Share of the mass of all spheres.
    pub mass_share: f64,
}

/// The distribution of the diameters of some spheres.
///
/// d10, d50 and d90 are the smallest diameters such that spheres up to them are at least 10 %, 50 % and 90 %
/// of all.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::size_distribution::SizeDistribution;
/// use demhybrid::model::size::Size;
///
/// // Eight small spheres and a large one, which weighs as much as all of them.
/// let mut sizes = vec![Size::new(0.1, 1.0); 8];
/// sizes.push(Size::new(0.2, 8.0));
/// let found = SizeDistribution::of(&sizes);
/// assert_eq!(found.by_number, [0.2, 0.2, 0.4]); // d10, d50 and d90, m
/// assert_eq!(found.by_mass, [0.2, 0.2, 0.4]);
/// assert_eq!(found.bins.iter().map(|bin| bin.mass_share).collect::<Vec<_>>(), [0.5, 0.5]);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SizeDistribution {
    /// d10, d50 and d90 by number, m.
    pub by_number: [f64; 3],
    /// d10, d50 and d90 by mass, m.
    pub by_mass: [f64; 3],
    /// A bin for each diameter, or bins of equal ratios of their ends.
    pub bins: Vec<Bin>,
}

impl SizeDistribution {
    /// The distribution of these `sizes`. There must be at least one.
    pub fn of(sizes: &[Size]) -> Self {
        let mut sorted = sizes.to_vec();
        sorted.sort_by(|a, b| a.r.total_cmp(&b.r));
        let mass: f64 = sorted.iter().map(|size| size.mass).sum();
        let quantiles = |of: &dyn Fn(&Size) -> f64, all: f64| {
            [0.1, 0.5, 0.9].map(|share| {
                let mut sum = 0.0;
                // A sum that just reaches the share may be a little less by rounding.
                let reaches = |size: &&Size| {
                    sum += of(size);
                    sum >= share * all * (1.0 - 1e-12)
                };
                2.0 * sorted.iter().find(reaches).unwrap_or(&sorted[sorted.len() - 1]).r
            })
        };
        let by_number = quantiles(&|_| 1.0, sorted.len() as f64);
        let by_mass = quantiles(&|size| size.mass, mass);
        let mut diameters: Vec<f64> = sorted.iter().map(|size| 2.0 * size.r).collect();
        diameters.dedup();
        let (least, most) = (diameters[0], diameters[diameters.len() - 1]);
        let ends: Vec<[f64; 2]> = if diameters.len() <= MOST_DIAMETERS {
            diameters.iter().map(|&d| [d, d]).collect()
        } else {
            let end = |k: usize| match k {
                0 => least,
                BINS => most,
                _ => least * (most / least).powf(k as f64 / BINS as f64),
            };
            (0..BINS).map(|k| [end(k), end(k + 1)]).collect()
        };
        let first = |d: f64| sorted.partition_point(|size| 2.0 * size.r < d);
        let bin = |(k, &[from, to]): (usize, &[f64; 2])| {
            let next = ends.get(k + 1).map_or(sorted.len(), |next| first(next[0]));
            let own = &sorted[first(from)..next];
            let number_share = own.len() as f64 / sorted.len() as f64;
            let mass_share = own.iter().map(|size| size.mass).sum::<f64>() / mass;
            Bin { from, to, spheres: own.len(), number_share, mass_share }
        };
        let bins = ends.iter().enumerate().map(bin).collect();
        SizeDistribution { by_number, by_mass, bins }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_by_number_and_by_mass() {
        // Diameters 1 to 100 m, with masses such that the largest ten have half of all.
        let size = |k: usize| Size::new(0.5 * k as f64, if k > 90 { 9.0 } else { 1.0 });
        let sizes: Vec<Size> = (1..=100).rev().map(size).collect();
        let found = SizeDistribution::of(&sizes);
        assert_eq!(found.by_number, [10.0, 50.0, 90.0]);
        assert_eq!(found.by_mass, [18.0, 90.0, 98.0]);
        assert_eq!(found.bins.len(), 20);
        assert_eq!(found.bins.iter().map(|bin| bin.spheres).sum::<usize>(), 100);
        for two in found.bins.windows(2) {
            assert_eq!(two[0].to, two[1].from);
        }
        assert_eq!((found.bins[0].from, found.bins[19].to), (1.0, 100.0));
        // 100^(19/20) is 79.4, so 80 to 100 m are in the last bin.
        assert_eq!(found.bins[19].spheres, 21);
        assert!((found.bins[19].mass_share - 101.0 / 180.0).abs() < 1e-12);
        let shares: f64 = found.bins.iter().map(|bin| bin.number_share).sum();
        assert!((shares - 1.0).abs() < 1e-12);
    }
}
