//! A column of a hundred spheres that remember their shear.

use super::{G, R, gap_under, remembering};
use crate::common::{Case, assert_near};
use demhybrid::math::vector::Vec3;

#[test]
fn a_column_of_a_hundred_spheres_comes_to_rest_and_stays() {
    let n = 100;
    // Released where every contact bears nine tenths of what it must.
    let bearing = |k: usize, share: f64| gap_under(share * (n - k) as f64 * G);
    let mut case = remembering(Case::defaults(), true).heavy().floor().set("particles.mass", 1.0);
    let mut z = -R;
    for k in 0..n {
        z += 2.0 * R + bearing(k, 0.9);
        case = case.sphere(Vec3::new(0.5, 0.5, z), Vec3::zeros());
    }
    let run = case.set("t_end", 100.0).run();
    let end = run.end();
    let most = run.frames.iter().map(|frame| frame.kinetic_energy).fold(0.0, f64::max);
    println!(
        "{} right-hand sides; kinetic energy {:.1e} J, {most:.1e} J at most",
        end.counts.rhs, end.kinetic_energy
    );
    assert!(most > 1e-2, "it moves at first: {most:e} J");
    let below = std::iter::once(-R).chain(end.x.iter().map(|x| x.z));
    let gaps: Vec<f64> = end.x.iter().zip(below).map(|(x, below)| x.z - below - 2.0 * R).collect();
    let off = gaps.iter().enumerate().map(|(k, gap)| (gap - bearing(k, 1.0)).abs()).fold(0.0, f64::max);
    // Heights near 20 m have rounding errors of 4e-15 m.
    assert_near("largest error of a gap, m", off, 0.0, 1e-12);
    // Published to 0.01 mm.
    for (k, exact) in [(0, -34.21e-3), (90, -18.85e-3), (98, -8.12461e-3), (99, -3.50363e-3)] {
        assert_near(&format!("gap of sphere {k} from the floor, m"), gaps[k], exact, 1e-5);
    }
    assert!(end.kinetic_energy < 1e-15, "{:e} J", end.kinetic_energy);
    let aside = end.x.iter().map(|x| (x.x - 0.5).hypot(x.y - 0.5)).fold(0.0, f64::max);
    assert!(aside < 1e-9, "{aside:e} m");
}
