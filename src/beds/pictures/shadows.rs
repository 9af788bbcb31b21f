//! Which balls cast shadows on a point of a sphere.
//!
//! Every sphere has a list of the balls around it. Much smaller ones are not on it: a large sphere would have
//! a list of all that lie on its surface, and every pixel would go through it. They are found in cells around
//! the point, an octave of radii at a time. So a pixel costs the same at any spread of sizes.

use rayon::prelude::*;

use super::light::SHADOW_RANGE;
use crate::math::cells::Cells;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;

/// Lists hold the balls of the octave of their sphere, all larger ones, and those of this many octaves below.
const LISTED: usize = 2;

/// The spheres of a picture, for a search of those around a point.
pub struct Shadows<'a> {
    sizes: Sizes<'a>,
    /// Centres in camera coordinates, m.
    centres: Vec<Vec3>,
    octaves: Vec<Octave>,
    /// The octave of each sphere.
    octave_of: Vec<u8>,
    /// The listed balls around each sphere, by ascending id.
    lists: Vec<Vec<u32>>,
}

/// Spheres whose radii differ by less than a factor of two.
struct Octave {
    cells: Cells,
    members: Vec<u32>,
    /// The largest radius, m.
    largest: f64,
}

impl<'a> Shadows<'a> {
    /// The spheres with the centres `x` (m), which in camera coordinates are `centres` (m).
    pub fn new(x: &[Vec3], centres: Vec<Vec3>, sizes: Sizes<'a>) -> Self {
        let radius = |i: usize| sizes.of(i).r;
        let most = (0..x.len()).map(radius).fold(0.0, f64::max);
        let octave_of: Vec<u8> =
            (0..x.len()).map(|i| (most / radius(i)).log2().floor().clamp(0.0, 255.0) as u8).collect();
        let mut members = vec![Vec::new(); 1 + octave_of.iter().copied().max().unwrap_or(0) as usize];
        for (i, &octave) in (0..).zip(&octave_of) {
            members[octave as usize].push(i);
        }
        let octave = |members: Vec<u32>| {
            let largest = members.iter().map(|&i| radius(i as usize)).fold(0.0, f64::max);
            let centres: Vec<Vec3> = members.iter().map(|&i| centres[i as usize]).collect();
            // Rounding of camera coordinates must not move a ball out of reach.
            let width = (1.0 + 1e-9) * SHADOW_RANGE * largest;
            Octave { cells: Cells::new(&centres, if width > 0.0 { width } else { 1.0 }), members, largest }
        };
        let octaves: Vec<Octave> = members.into_iter().map(octave).collect();
        let list = |i: usize| {
            let mut near = Vec::new();
            for Octave { cells, members, largest } in octaves.iter().take(octave_of[i] as usize + LISTED + 1)
            {
                cells.for_each_within(&centres[i], (1.0 + 1e-9) * reach(radius(i), *largest), |k| {
                    let j = members[k as usize];
                    let within = reach(radius(i), radius(j as usize));
                    if j as usize != i && (x[i] - x[j as usize]).norm_squared() <= within * within {
                        near.push(j);
                    }
                });
            }
            near.sort_unstable();
            near
        };
        let lists = (0..x.len()).into_par_iter().map(list).collect();
        Shadows { sizes, centres, octaves, octave_of, lists }
    }

    /// Calls `visit` for the balls that may cast a shadow on `point` (m), on the surface of sphere `i`: the
    /// centre relative to the point, and the radius, m.
    pub fn for_each(&self, i: usize, point: &Vec3, visit: &mut dyn FnMut(Vec3, f64)) {
        for &j in &self.lists[i] {
            visit(self.centres[j as usize] - point, self.sizes.of(j as usize).r);
        }
        for Octave { cells, members, largest } in
            self.octaves.iter().skip(self.octave_of[i] as usize + LISTED + 1)
        {
            cells.for_each_within(point, SHADOW_RANGE * largest, |k| {
                let j = members[k as usize] as usize;
                let (away, r) = (self.centres[j] - point, self.sizes.of(j).r);
                if away.norm_squared() <= (SHADOW_RANGE * r).powi(2) {
                    visit(away, r);
                }
            });
        }
    }
}

/// The distance of centres (m) up to which a ball of radius `b` is listed for a sphere of radius `a` (m).
///
/// Of equal spheres it is exactly the range of a shadow.
fn reach(a: f64, b: f64) -> f64 {
    SHADOW_RANGE * b + (a - b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::size::Size;
    use rand::{RngExt, SeedableRng};

    /// Spheres at random places with radii from 1 to 1/`widest` m.
    fn heap(widest: f64) -> (Vec<Vec3>, Vec<Size>) {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let x = (0..300).map(|_| Vec3::from_fn(|_, _| random.random_range(-3.0..3.0))).collect();
        let size = |_| Size::new(widest.powf(-random.random_range(0.0..1.0)), 1.0);
        (x, (0..300).map(size).collect())
    }

    #[test]
    fn a_point_sees_all_balls_whose_shadows_reach_its_sphere_and_small_ones_only_near_itself() {
        for widest in [1.0, 3.0, 200.0] {
            let (x, sizes) = heap(widest);
            let shadows = Shadows::new(&x, x.clone(), Sizes::Each(&sizes));
            for i in (0..300).step_by(11) {
                let point = x[i] + Vec3::z() * sizes[i].r;
                let mut found = Vec::new();
                shadows.for_each(i, &point, &mut |away, r| found.push((away, r)));
                let sees = |j: usize| {
                    let far = (x[j] - point).norm() > SHADOW_RANGE * sizes[j].r;
                    let much_smaller = shadows.octave_of[j] as usize > shadows.octave_of[i] as usize + LISTED;
                    match much_smaller {
                        true => !far,
                        false => (x[i] - x[j]).norm() <= reach(sizes[i].r, sizes[j].r),
                    }
                };
                let mut expected: Vec<_> =
                    (0..300).filter(|&j| j != i && sees(j)).map(|j| (x[j] - point, sizes[j].r)).collect();
                let by_place = |a: &(Vec3, f64), b: &(Vec3, f64)| a.0.x.total_cmp(&b.0.x);
                found.sort_by(by_place);
                expected.sort_by(by_place);
                assert_eq!(found, expected, "{widest} {i}");
            }
        }
    }

    #[test]
    fn a_large_sphere_among_many_small_ones_goes_through_few_of_them_at_a_point() {
        // A layer of 20 000 small spheres on a sphere of 1 m, by the golden angle.
        let count = 20_000;
        let on_it = |k: usize| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
            let (sine, angle) = ((1.0 - z * z).sqrt(), 2.399_963_229_728_653 * k as f64);
            Vec3::new(sine * angle.cos(), sine * angle.sin(), z) * 1.012
        };
        let x: Vec<Vec3> = [Vec3::zeros()].into_iter().chain((0..count).map(on_it)).collect();
        let mut sizes = vec![Size::new(0.012, 1.0); x.len()];
        sizes[0] = Size::new(1.0, 1.0);
        let shadows = Shadows::new(&x, x.clone(), Sizes::Each(&sizes));
        assert!(shadows.lists[0].is_empty() && shadows.lists[1].contains(&0));
        let mut visits = 0;
        shadows.for_each(0, &Vec3::z(), &mut |_, _| visits += 1);
        // A disc of four small radii holds 4^2 (0.012/2)^2 of them.
        assert!((5..40).contains(&visits), "{visits}");
    }
}
