//! Tests of what many spheres take from one, against balls that all of them cut at once.

use super::*;
use crate::beds::measures::region::Region;
use crate::beds::measures::union::Spheres;
use crate::model::size::{Size, Sizes};
use rand::{RngExt, SeedableRng};

#[track_caller]
fn near(found: f64, exact: f64, tolerance: f64) {
    assert!((found - exact).abs() <= tolerance, "{found} is not {exact}: off by {:e}", found - exact);
}

/// Directions that are spread evenly over a sphere.
fn spread(count: usize) -> Vec<Vec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    let at = |k: usize| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
        let (sine, cosine) = (golden * k as f64).sin_cos();
        Vec3::new(cosine, sine, 0.0) * (1.0 - z * z).sqrt() + Vec3::z() * z
    };
    (0..count).map(at).collect()
}

/// A ball of radius 1 m around the origin in a box, which cuts off its lower part and one side.
fn cut_ball() -> Ball {
    let half = |n: Vec3, b: f64| Half { n, b };
    let halves = [half(-Vec3::z(), 0.3), half(Vec3::x(), 0.55)];
    Ball::new(&Vec3::zeros(), 1.0, halves.iter(), Some(([0.1, 0.0], 0.95)))
}

#[test]
fn groups_take_what_all_cuts_take_at_once() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for count in [1, 3, 14, 25] {
        for _ in 0..6 {
            let cap = |n: Vec3| Half { n, b: random.random_range(0.75..0.99) };
            let mut caps: Vec<Half> = spread(count).into_iter().map(cap).collect();
            // Some are near each other, in groups of three.
            for k in 0..count / 5 {
                caps[3 * k + 1].n = (caps[3 * k].n + caps[3 * k + 1].n * 0.2).normalize();
            }
            for ball in [Ball::new(&Vec3::zeros(), 1.0, [].iter(), None), cut_ball()] {
                let rest = ball.cut(caps.iter().copied()).volume();
                near(ball.volume() - taken(&ball, &Vec3::zeros(), &caps), rest, 1e-9);
            }
        }
    }
}

#[test]
fn a_large_sphere_loses_a_lens_to_each_of_many_small_ones() {
    // The small ones overlap it a little, and each other not at all.
    for (count, small) in [(100, 0.05), (2000, 0.02)] {
        let d = 1.0 + 0.6 * small;
        let mut x = vec![Vec3::zeros()];
        x.extend(spread(count).into_iter().map(|n| n * d));
        let mut sizes = vec![Size::new(small, 1.0); count + 1];
        sizes[0] = Size::new(1.0, 1.0);
        let spheres = Spheres::sized(&x, Sizes::Each(&sizes));
        let lens =
            PI * (1.0 + small - d).powi(2) * (d * d + 2.0 * d * (1.0 + small) - 3.0 * (1.0 - small).powi(2))
                / (12.0 * d);
        let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
        let exact = ball(1.0) + count as f64 * (ball(small) - lens);
        let all = Region::cuboid(Vec3::repeat(-2.0), Vec3::repeat(2.0));
        near(spheres.volumes(&all).union, exact, 1e-9);
        // Two parts of it, one of them inside a plane that cuts some of the caps.
        let lower = Region::cuboid(Vec3::repeat(-2.0), Vec3::new(2.0, 2.0, 0.237));
        let upper = Region::cuboid(Vec3::new(-2.0, -2.0, 0.237), Vec3::repeat(2.0));
        let parts = [lower, upper].map(|region| spheres.volumes(&region).union);
        near(parts[0] + parts[1], exact, 1e-9);
        assert!(parts[1] < 0.5 * exact);
    }
}

#[test]
fn shadowed_cuts_have_no_effect_and_opposite_ones_leave_nothing() {
    let centre = Vec3::new(0.3, -0.2, 0.1);
    let half = |n: Vec3, b: f64| Half { n: n.normalize(), b }.moved(&centre);
    let mut halves = vec![
        half(Vec3::x(), -0.5),
        half(Vec3::new(1.0, 0.1, 0.0), 0.6),
        half(Vec3::y(), 0.2),
        half(Vec3::z(), 1.2),
    ];
    let all = Ball::new(&centre, 1.0, halves.iter(), None).volume();
    assert!(!drop_shadowed(&centre, 1.0, &mut halves));
    assert_eq!(halves.len(), 2);
    near(Ball::new(&centre, 1.0, halves.iter(), None).volume(), all, 1e-13);
    // Beyond x = -0.5 and below x = -0.4 of a ball nothing is left.
    let mut none = vec![half(Vec3::x(), -0.5), half(-Vec3::x(), 0.4)];
    assert!(drop_shadowed(&centre, 1.0, &mut none));
    assert!(drop_shadowed(&centre, 1.0, &mut vec![half(Vec3::x(), -1.0)]));
}
