//! Measures of a packed bed. The count of the paper is here; the exact volume is in [`union`].

mod bites;
pub mod by_class;
pub mod classes;
#[cfg(test)]
pub mod columns;
pub mod contacts;
pub mod flat;
pub mod layers;
pub mod profiles;
mod quadrature;
pub mod radial;
pub mod rattlers;
pub mod reference_force;
pub mod region;
pub mod request;
pub mod row;
pub mod size_distribution;
#[cfg(test)]
pub mod testing;
#[cfg(test)]
mod turned_tests;
pub mod union;

use crate::math::vector::Vec3;

/// Cells along each side of the paper's counting grid.
const CELLS: usize = 100;

/// Volume fraction of solids in the unit cube [0, 1]^3, counted like the program of the paper (Fig. 4.3).
///
/// A sphere of radius `r` (m) scores one hit for each cell of a 100^3 grid whose centre it covers. Overlaps
/// count twice, so the fraction of the union, [`union::Spheres::volumes`], is smaller.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::paper_volume_fraction;
/// use demhybrid::math::vector::Vec3;
///
/// let one = paper_volume_fraction(&[Vec3::repeat(0.5)], 0.5);
/// assert!((one - std::f64::consts::PI / 6.0).abs() < 1e-3);
/// // Overlaps count twice.
/// assert_eq!(paper_volume_fraction(&[Vec3::repeat(0.5); 2], 0.5), 2.0 * one);
/// ```
pub fn paper_volume_fraction(x: &[Vec3], r: f64) -> f64 {
    paper_count(x, |_| r)
}

/// The same for spheres of which number `k` has the radius `r(k)`, m.
pub fn paper_count(x: &[Vec3], r: impl Fn(usize) -> f64) -> f64 {
    let centre = |k: usize| (k as f64 + 0.5) / CELLS as f64;
    let cells = |c: f64, r: f64| {
        let index = |x: f64| (x * CELLS as f64).floor().clamp(0.0, CELLS as f64) as usize;
        index(c - r)..(index(c + r) + 1).min(CELLS)
    };
    let mut hits = 0u64;
    for (number, x) in x.iter().enumerate() {
        let r = r(number);
        for i in cells(x.x, r) {
            for j in cells(x.y, r) {
                for k in cells(x.z, r) {
                    let apart = Vec3::new(centre(i), centre(j), centre(k)) - x;
                    hits += u64::from(apart.norm_squared() <= r * r);
                }
            }
        }
    }
    hits as f64 / CELLS.pow(3) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simple_cubic_lattice_fills_half_of_space() {
        let x: Vec<Vec3> = (0..125)
            .map(|k| {
                Vec3::new(k as f64 % 5.0, (k / 5) as f64 % 5.0, (k / 25) as f64) * 0.2 + Vec3::repeat(0.1)
            })
            .collect();
        let exact = std::f64::consts::PI / 6.0;
        // All spheres have the same position relative to the grid, which makes each of them 0.8 % too large.
        assert!((paper_volume_fraction(&x, 0.1) - exact).abs() < 5e-3);
    }

    #[test]
    fn overlaps_count_twice_and_what_is_outside_not_at_all() {
        let one = paper_volume_fraction(&[Vec3::repeat(0.5)], 0.1);
        assert!((one - 4.0 / 3.0 * std::f64::consts::PI * 1e-3).abs() < 5e-5);
        assert_eq!(paper_volume_fraction(&[Vec3::repeat(0.5); 2], 0.1), 2.0 * one);
        assert_eq!(paper_volume_fraction(&[Vec3::new(0.5, 0.5, -0.2), Vec3::new(3.0, 0.0, 0.0)], 0.1), 0.0);
        let half = paper_volume_fraction(&[Vec3::new(0.5, 0.5, 0.0)], 0.1);
        assert!((half - 0.5 * one).abs() < 1e-4);
    }
}
