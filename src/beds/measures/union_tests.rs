//! Tests of volumes of unions, against exact values and against the columns of
//! [`crate::beds::measures::columns`].

use super::*;
use crate::beds::measures::columns::{union_of_sized, union_volume_fraction};
use rand::{RngExt, SeedableRng};

const R: f64 = 0.1;
const SPHERE: f64 = 4.0 / 3.0 * PI * R * R * R;

fn cube(low: f64, high: f64) -> Region {
    Region::cuboid(Vec3::repeat(low), Vec3::repeat(high))
}

/// Points of the cubic lattice of the given spacing, `per_side` along each axis, the first at `start`.
fn cubic(per_side: usize, spacing: f64, start: Vec3) -> Vec<Vec3> {
    let along = |k: usize, step: usize| (k / step % per_side) as f64;
    (0..per_side.pow(3))
        .map(|k| start + Vec3::new(along(k, 1), along(k, per_side), along(k, per_side.pow(2))) * spacing)
        .collect()
}

/// Points of the face-centred cubic lattice of touching spheres, and the side of its cell, m.
fn face_centred() -> (Vec<Vec3>, f64) {
    let cell = 2.0 * 2f64.sqrt() * R;
    let corners = [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]];
    let of = |corner| cubic(5, cell, Vec3::from(corner) * cell - Vec3::repeat(cell));
    (corners.into_iter().flat_map(of).collect(), cell)
}

#[track_caller]
fn near(found: f64, exact: f64, tolerance: f64) {
    let error = (found - exact).abs();
    assert!(error <= tolerance, "{found} is not {exact}: off by {error:e}");
}

fn fraction(x: &[Vec3], region: &Region) -> f64 {
    let volumes = Spheres::new(x, R).volumes(region);
    volumes.union / volumes.region
}

/// Area of the section of the union across `n` at the distance `at` (m) from the origin, m^2.
fn section(spheres: &Spheres, region: &Region, n: &Vec3, at: f64) -> f64 {
    spheres.sections(n, &[at], |_| region.halves(), region.pillar())[0]
}

/// Volume of the intersection of two spheres whose centres are `d` (m) apart, m^3.
fn lens(d: f64) -> f64 {
    PI * (4.0 * R + d) * (2.0 * R - d).powi(2) / 12.0
}

#[test]
fn lattices_have_their_fractions_wherever_the_box_cuts_them() {
    for shift in [0.0, 0.0333, 0.1, 0.17] {
        // Some shifts put the corners of the box inside spheres.
        near(fraction(&cubic(8, 2.0 * R, Vec3::repeat(-0.2 + shift)), &cube(0.0, 1.0)), PI / 6.0, 1e-11);
    }
    let (x, cell) = face_centred();
    for shift in [0.0, 0.037, 0.05] {
        let low = Vec3::new(shift, 2.0 * shift, 3.0 * shift);
        let region = Region::cuboid(low, low + Vec3::repeat(2.0 * cell));
        near(fraction(&x, &region), PI / 18f64.sqrt(), 1e-11);
    }
    // A body-centred lattice with overlaps along the diagonals. Each sphere loses 8 caps.
    let cell = 0.22;
    let mut x = cubic(8, cell, Vec3::repeat(-2.0 * cell));
    x.extend(cubic(8, cell, Vec3::repeat(-1.5 * cell)));
    let exact = 2.0 * (SPHERE - 4.0 * lens(cell * 0.75f64.sqrt())) / cell.powi(3);
    for shift in [0.0, 0.013, 0.1] {
        near(fraction(&x, &cube(shift, shift + 3.0 * cell)), exact, 1e-11);
    }
}

#[test]
fn two_overlapping_spheres_are_cut_by_a_box_exactly() {
    for d in [0.02, 0.1, 0.17] {
        // The pair is in the middle of a large box.
        let a = Vec3::new(0.4, 0.5, 0.6);
        let pair = [a, a + Vec3::new(0.6, 0.48, -0.64) * d];
        let volumes = Spheres::new(&pair, R).volumes(&cube(0.0, 1.0));
        near(volumes.spheres, 2.0 * SPHERE, 1e-14);
        near(volumes.union, 2.0 * SPHERE - lens(d), 1e-14);
        // A plane along the line of the centres halves both spheres. A second one quarters them.
        for (axis, side) in [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)] {
            let mut direction = Vec3::zeros();
            direction[axis] = d;
            let pair = [Vec3::repeat(0.5), Vec3::repeat(0.5) + direction];
            let mut low = Vec3::zeros();
            low[side] = 0.5;
            let mut region = Region::cuboid(low, Vec3::repeat(1.0));
            near(Spheres::new(&pair, R).volumes(&region).union, SPHERE - lens(d) / 2.0, 1e-14);
            low[3 - axis - side] = 0.5;
            region = Region::cuboid(low, Vec3::repeat(1.0));
            near(Spheres::new(&pair, R).volumes(&region).union, SPHERE / 2.0 - lens(d) / 4.0, 1e-14);
        }
        // A plane across the line of the centres, through the first centre. Half of the first sphere remains.
        // The second one loses the lens, and its part below the plane, which the first one covers there.
        let pair = [Vec3::repeat(0.5), Vec3::new(0.5, 0.5, 0.5 + d)];
        let region = Region::cuboid(Vec3::new(0.0, 0.0, 0.5), Vec3::repeat(1.0));
        let below = if d < R { PI * (R - d).powi(2) * (2.0 * R + d) / 3.0 } else { 0.0 };
        let exact = SPHERE / 2.0 + (SPHERE - below) - (lens(d) - below);
        near(Spheres::new(&pair, R).volumes(&region).union, exact, 1e-14);
    }
}

#[test]
fn spheres_on_one_point_count_once_and_those_outside_not_at_all() {
    let x = [Vec3::repeat(0.5); 5];
    let volumes = Spheres::new(&x, R).volumes(&cube(0.0, 1.0));
    near(volumes.union, SPHERE, 1e-15);
    near(volumes.spheres, 5.0 * SPHERE, 1e-15);
    let outside = [Vec3::new(0.5, 0.5, -0.1), Vec3::new(-0.08, -0.08, 0.5), Vec3::repeat(7.0)];
    assert_eq!(fraction(&outside, &cube(0.0, 1.0)), 0.0);
    assert_eq!(fraction(&[], &cube(0.0, 1.0)), 0.0);
}

#[test]
fn a_cylinder_cuts_spheres_as_a_fine_sum_of_slices_says() {
    let whole = Region::cylinder([0.0, 0.0], 0.3, [0.0, 1.0]);
    near(Spheres::new(&[Vec3::new(0.1, 0.0, 0.5)], R).volumes(&whole).union, SPHERE, 1e-15);
    near(Spheres::new(&[Vec3::new(0.1, 0.1, 1.0)], R).volumes(&whole).union, SPHERE / 2.0, 1e-15);
    // A sphere on the axis of a thin cylinder keeps the volume that drilling a hole removes: 4/3 pi (r^3 -
    // (r^2 - a^2)^(3/2)).
    let a: f64 = 0.06;
    let thin = Region::cylinder([0.5, 0.2], a, [0.0, 1.0]);
    let drilled = 4.0 / 3.0 * PI * (R.powi(3) - (R * R - a * a).powf(1.5));
    near(Spheres::new(&[Vec3::new(0.5, 0.2, 0.5)], R).volumes(&thin).union, drilled, 1e-13);
    // A bed that the wall of a cylinder cuts, compared with a sum of horizontal slices.
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    let x: Vec<Vec3> = (0..60).map(|_| Vec3::from_fn(|_, _| random.random_range(0.0..1.0))).collect();
    let region = Region::cylinder([0.5, 0.45], 0.35, [0.2, 0.9]);
    let spheres = Spheres::new(&x, R);
    let slices = 4000;
    let at = |k: usize| 0.2 + 0.7 * (k as f64 + 0.5) / slices as f64;
    let sum: f64 = (0..slices).map(|k| section(&spheres, &region, &Vec3::z(), at(k))).sum();
    near(spheres.volumes(&region).union, sum * 0.7 / slices as f64, 1e-8);
    // The same along another axis, where the section of the cylinder is a strip.
    let at = |k: usize| 0.15 + 0.7 * (k as f64 + 0.5) / slices as f64;
    let sum: f64 = (0..slices).map(|k| section(&spheres, &region, &Vec3::x(), at(k))).sum();
    near(spheres.volumes(&region).union, sum * 0.7 / slices as f64, 1e-6);
    let sum: f64 = (0..slices).map(|k| region.section(&Vec3::x(), at(k))).sum();
    near(region.volume(), sum * 0.7 / slices as f64, 1e-5);
}

#[test]
fn random_beds_agree_with_columns_and_with_themselves_turned() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    for count in [20, 200, 400] {
        let x: Vec<Vec3> = (0..count).map(|_| Vec3::from_fn(|_, _| random.random_range(0.0..1.0))).collect();
        let exact = fraction(&x, &cube(0.0, 1.0));
        near(union_volume_fraction(&x, R, Vec3::zeros(), Vec3::repeat(1.0)), exact, 1e-5);
        let turned: Vec<Vec3> = x.iter().map(Vec3::yzx).collect();
        near(fraction(&turned, &cube(0.0, 1.0)), exact, 1e-10);
        // The two halves add up to the whole.
        let lower = Region::cuboid(Vec3::zeros(), Vec3::new(1.0, 1.0, 0.4321));
        let upper = Region::cuboid(Vec3::new(0.0, 0.0, 0.4321), Vec3::repeat(1.0));
        let spheres = Spheres::new(&x, R);
        near(spheres.volumes(&lower).union + spheres.volumes(&upper).union, exact, 1e-10);
    }
}

#[test]
fn many_spheres_almost_on_one_point_take_no_longer_than_others() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let x: Vec<Vec3> =
        (0..300).map(|_| Vec3::from_fn(|_, _| 0.5 + 0.2 * R * random.random_range(-1.0..1.0))).collect();
    let volumes = Spheres::new(&x, R).volumes(&cube(0.0, 1.0));
    near(volumes.spheres, 300.0 * SPHERE, 1e-12);
    near(volumes.union, union_volume_fraction(&x, R, Vec3::zeros(), Vec3::repeat(1.0)), 1e-6);
    let lower = Region::cuboid(Vec3::zeros(), Vec3::new(1.0, 0.51, 1.0));
    let upper = Region::cuboid(Vec3::new(0.0, 0.51, 0.0), Vec3::repeat(1.0));
    let halves = [lower, upper].map(|region| Spheres::new(&x, R).volumes(&region).union);
    near(halves[0] + halves[1], volumes.union, 1e-11);
}

/// Spheres of these radii (m), with masses that no volume depends on.
fn sizes(radii: &[f64]) -> Vec<Size> {
    radii.iter().map(|&r| Size::new(r, 1.0)).collect()
}

fn ball(r: f64) -> f64 {
    4.0 / 3.0 * PI * r.powi(3)
}

/// Volume of the cap of height `h` (m) of a ball of radius `r` (m), m^3.
fn cap(r: f64, h: f64) -> f64 {
    PI * h * h * (3.0 * r - h) / 3.0
}

/// Volume that two balls whose centres are `d` (m) apart have in common, m^3.
fn common(a: f64, b: f64, d: f64) -> f64 {
    PI * (a + b - d).powi(2) * (d * d + 2.0 * d * (a + b) - 3.0 * (a - b).powi(2)) / (12.0 * d)
}

#[test]
fn two_unequal_spheres_are_cut_by_a_box_exactly() {
    let (a, b) = (0.2, 0.07);
    let both = sizes(&[a, b]);
    let union = |x: &[Vec3], region: &Region| Spheres::sized(x, Sizes::Each(&both)).volumes(region);
    for d in [0.26, 0.2, 0.18, 0.14] {
        // At 0.18 m and below the centre of the small one is beyond the radical plane.
        let exact = ball(a) + ball(b) - common(a, b, d);
        let middle = Vec3::repeat(0.5);
        let volumes = union(&[middle, middle + Vec3::new(0.6, 0.48, -0.64) * d], &cube(0.0, 1.0));
        near(volumes.spheres, ball(a) + ball(b), 1e-14);
        near(volumes.union, exact, 1e-14);
        for axis in 0..3 {
            let mut direction = Vec3::zeros();
            direction[axis] = d;
            let x = [middle, middle + direction];
            // Planes along the line of the centres: a half, and a quarter.
            let mut low = Vec3::zeros();
            low[(axis + 1) % 3] = 0.5;
            near(union(&x, &Region::cuboid(low, Vec3::repeat(1.0))).union, exact / 2.0, 1e-14);
            low[(axis + 2) % 3] = 0.5;
            near(union(&x, &Region::cuboid(low, Vec3::repeat(1.0))).union, exact / 4.0, 1e-14);
            // A plane across it where the spheres meet. What is beyond is a cap of the small one.
            let mut low = Vec3::zeros();
            let plane = (d * d + a * a - b * b) / (2.0 * d);
            low[axis] = 0.5 + plane;
            let beyond = union(&x, &Region::cuboid(low, Vec3::repeat(1.0))).union;
            near(beyond, cap(b, d + b - plane), 1e-14);
            // And one through the middle of the large one.
            low[axis] = 0.5;
            let beyond = union(&x, &Region::cuboid(low, Vec3::repeat(1.0))).union;
            near(beyond, exact - ball(a) / 2.0, 1e-14);
        }
    }
    // A cylinder around the line of the centres takes the same from both as a drill does.
    let d = 0.22;
    let x = [Vec3::repeat(0.5), Vec3::new(0.5, 0.5, 0.5 + d)];
    let hole: f64 = 0.01;
    let thin = Region::cylinder([0.5, 0.5], hole, [0.5, 1.0]);
    let dome = |r: f64| 2.0 / 3.0 * PI * (r.powi(3) - (r * r - hole * hole).powf(1.5));
    near(union(&x, &thin).union, PI * hole * hole * d + dome(b), 1e-13);
}

#[test]
fn lattices_of_two_sizes_have_their_fractions_with_and_without_overlap() {
    // Large spheres on a face-centred lattice and small ones half-way between them, as in rock salt.
    let cell = 0.5;
    let sites: Vec<[i32; 3]> =
        (0..11 * 11 * 11).map(|k| [k % 11 - 3, k / 11 % 11 - 3, k / 121 - 3]).collect();
    let x: Vec<Vec3> = sites.iter().map(|c| Vec3::from(c.map(|c| cell / 2.0 * f64::from(c)))).collect();
    let is_large = |c: &[i32; 3]| c.iter().sum::<i32>() % 2 == 0;
    for (large, small) in [(0.35, 0.146), (0.25, 0.25), (0.353, 0.02), (0.33, 0.19), (0.36, 0.16)] {
        let (large, small) = (large * cell, small * cell);
        let radii: Vec<f64> = sites.iter().map(|c| if is_large(c) { large } else { small }).collect();
        let sizes = sizes(&radii);
        let spheres = Spheres::sized(&x, Sizes::Each(&sizes));
        // Four of each in a cell. A large one has 6 small neighbours and 12 large ones.
        let (side, diagonal) = (cell / 2.0, cell / 2f64.sqrt());
        let mut exact = 4.0 * (ball(large) + ball(small));
        if large + small > side {
            exact -= 24.0 * common(large, small, side);
        }
        if 2.0 * large > diagonal {
            exact -= 24.0 * common(large, large, diagonal);
        }
        for shift in [0.0, 0.0333, 0.1234] {
            let volumes = spheres.volumes(&cube(shift, shift + 2.0 * cell));
            near(volumes.union / volumes.region, exact / cell.powi(3), 1e-9);
            let all = 4.0 * (ball(large) + ball(small)) / cell.powi(3);
            near(volumes.spheres / volumes.region, all, 1e-9);
        }
    }
}

#[test]
fn a_sphere_inside_another_one_counts_once() {
    for (d, inner) in [(0.0, 0.05), (1e-9, 0.05), (0.04, 0.05), (0.05, 0.05), (0.0999, 1e-4)] {
        let x = [Vec3::repeat(0.5), Vec3::new(0.5 + 0.6 * d, 0.5 - 0.8 * d, 0.5)];
        for order in [[0, 1], [1, 0]] {
            let x = order.map(|k| x[k]);
            let sizes = sizes(&order.map(|k| [R, inner][k]));
            let spheres = Spheres::sized(&x, Sizes::Each(&sizes));
            near(spheres.volumes(&cube(0.0, 1.0)).union, SPHERE, 1e-15);
            let half = Region::cuboid(Vec3::zeros(), Vec3::new(1.0, 1.0, 0.5));
            near(spheres.volumes(&half).union, SPHERE / 2.0, 1e-15);
            near(section(&spheres, &cube(0.0, 1.0), &Vec3::z(), 0.5), PI * R * R, 1e-14);
        }
    }
}

#[test]
fn random_spheres_of_any_sizes_agree_with_columns_and_with_themselves_in_parts() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(6);
    for (count, widest) in [(60, 2.0), (200, 5.0), (300, 20.0)] {
        let draw = |_| {
            let x = Vec3::from_fn(|_, _| random.random_range(0.0..1.0));
            (x, 0.2 / random.random_range(1.0..widest))
        };
        let all: Vec<(Vec3, f64)> = (0..count).map(draw).collect();
        let (x, radii): (Vec<Vec3>, Vec<f64>) = all.iter().copied().unzip();
        let sizes = sizes(&radii);
        let spheres = Spheres::sized(&x, Sizes::Each(&sizes));
        let exact = spheres.volumes(&cube(0.0, 1.0)).union;
        near(union_of_sized(&all, Vec3::zeros(), Vec3::repeat(1.0)), exact, 2e-5);
        let lower = Region::cuboid(Vec3::zeros(), Vec3::new(1.0, 1.0, 0.4321));
        let upper = Region::cuboid(Vec3::new(0.0, 0.0, 0.4321), Vec3::repeat(1.0));
        near(spheres.volumes(&lower).union + spheres.volumes(&upper).union, exact, 1e-10);
        let turned: Vec<Vec3> = x.iter().map(Vec3::yzx).collect();
        near(Spheres::sized(&turned, Sizes::Each(&sizes)).volumes(&cube(0.0, 1.0)).union, exact, 1e-10);
        // The sum of many sections.
        let slices = 2000;
        let at = |k: usize| (k as f64 + 0.5) / slices as f64;
        let sum: f64 = (0..slices).map(|k| section(&spheres, &cube(0.0, 1.0), &Vec3::y(), at(k))).sum();
        near(sum / slices as f64, exact, 1e-6);
    }
}

#[test]
fn spheres_of_one_size_give_the_same_whether_each_has_its_own_or_not() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let x: Vec<Vec3> = (0..150).map(|_| Vec3::from_fn(|_, _| random.random_range(0.0..1.0))).collect();
    let each = sizes(&[R; 150]);
    let (equal, each) = (Spheres::new(&x, R), Spheres::sized(&x, Sizes::Each(&each)));
    let region = Region::cylinder([0.5, 0.45], 0.35, [0.2, 0.9]);
    near(each.volumes(&region).union, equal.volumes(&region).union, 1e-12);
    let [a, b] = [&equal, &each].map(|spheres| section(spheres, &region, &Vec3::z(), 0.55));
    near(a, b, 1e-13);
}
