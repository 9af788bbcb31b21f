//! Spheres of unequal sizes in cells, a grid of cells for each octave of radii.

use super::cells::Cells;
use crate::math::vector::Vec3;

/// Spheres in cells by size: a large one does not widen the cells of the small ones.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::sized_cells::SizedCells;
/// use demhybrid::math::vector::Vec3;
///
/// let (x, r) = ([0.0, 0.9, 5.0].map(|x| Vec3::new(x, 0.0, 0.0)), [0.8, 0.1, 0.1]);
/// let touch = |a: f64, b: f64| a + b; // centres within this distance count, m
/// let cells = SizedCells::new(&x, Some(&|i| r[i]), &touch);
/// let mut near = Vec::new();
/// cells.for_each_near(&x[0], r[0], &touch, |j| near.push(j));
/// assert!(near.contains(&1)); // and perhaps some that are further away
/// ```
pub struct SizedCells {
    classes: Vec<Class>,
}

struct Class {
    cells: Cells,
    /// Largest radius, m.
    largest: f64,
}

impl SizedCells {
    /// Spheres with the centres `x` (m) and these radii (m); without `radii` all have the radius 0.
    ///
    /// `between` is the distance of centres (m) within which spheres with two radii count.
    pub fn new(
        x: &[Vec3],
        radii: Option<&dyn Fn(usize) -> f64>,
        between: &dyn Fn(f64, f64) -> f64,
    ) -> SizedCells {
        let Some(radius) = radii else {
            let class = Class { cells: Cells::new(x, between(0.0, 0.0)), largest: 0.0 };
            return SizedCells { classes: vec![class] };
        };
        let most = (0..x.len()).map(radius).fold(0.0, f64::max);
        let mut members: Vec<Vec<u32>> = Vec::new();
        for i in 0..x.len() {
            let class = (most / radius(i)).log2().floor() as usize;
            members.resize_with(members.len().max(class + 1), Vec::new);
            members[class].push(i as u32);
        }
        let of_class = |members: Vec<u32>| {
            let largest = members.iter().map(|&i| radius(i as usize)).fold(0.0, f64::max);
            let centres: Vec<Vec3> = members.iter().map(|&i| x[i as usize]).collect();
            let mut cells = Cells::new(&centres, between(largest, largest));
            cells.rename(&members);
            Class { cells, largest }
        };
        let classes = members.into_iter().filter(|members| !members.is_empty()).map(of_class).collect();
        SizedCells { classes }
    }

    /// Calls `visit` once for the index of every sphere within reach of one with the centre `x` (m) and the
    /// radius `r` (m), and for some others, in any order. `between` is as for `new`.
    #[inline]
    pub fn for_each_near(
        &self,
        x: &Vec3,
        r: f64,
        between: &dyn Fn(f64, f64) -> f64,
        mut visit: impl FnMut(usize),
    ) {
        self.for_each_run_near(x, r, between, |_| true, |run| run.iter().for_each(|&i| visit(i as usize)));
    }

    /// `for_each_near` for whole runs of indices, see [`Cells::for_each_run_within`].
    #[inline]
    pub fn for_each_run_near(
        &self,
        x: &Vec3,
        r: f64,
        between: &dyn Fn(f64, f64) -> f64,
        is_wanted: impl Fn(&[u32]) -> bool,
        mut visit: impl FnMut(&[u32]),
    ) {
        for Class { cells, largest } in &self.classes {
            cells.for_each_run_within(x, between(r, *largest), &is_wanted, &mut visit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn every_sphere_within_reach_is_visited_once_at_any_sizes() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for widest in [1.5, 8.0, 100.0] {
            let x: Vec<Vec3> =
                (0..400).map(|_| Vec3::from_fn(|_, _| random.random_range(-1.0..1.0))).collect();
            let r: Vec<f64> = x.iter().map(|_| 0.2 / random.random_range(1.0..widest)).collect();
            let between = |a: f64, b: f64| 1.2 * (a + b) + 0.01;
            let cells = SizedCells::new(&x, Some(&|i| r[i]), &between);
            for i in (0..400).step_by(7) {
                let mut visits = vec![0; x.len()];
                cells.for_each_near(&x[i], r[i], &between, |j| visits[j] += 1);
                for (j, &visits) in visits.iter().enumerate() {
                    let far = (x[i] - x[j]).norm() > between(r[i], r[j]);
                    assert!(visits == 1 || visits == 0 && far, "{i} {j}: {visits}");
                }
            }
        }
    }
}
