//! A friction law of one's own: this file is all that it takes.

use crate::common::{Case, assert_near, run_law};
use demhybrid::math::elementary::Arithmetic;
use demhybrid::math::vector::{Vec3, scaled};
use demhybrid::model::contact::{Dissipative, Tangential};

/// Viscous friction: the force is `c` (kg/s) times the slip, against it, however hard surfaces press.
#[derive(Clone, Copy)]
struct Viscous {
    c: f64,
}

impl Tangential for Viscous {
    const RUBS: bool = true;
    const TURNS: bool = false;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, _repulsion: f64, slip: &Vec3) -> Vec3 {
        scaled(-self.c, slip)
    }
}

/// A sphere slides on a floor with v' = -c v/m, so v = v(0) e^(-c t/m): after 1 s with c/m = 2/s, e^-2 is left.
#[test]
fn a_sphere_slows_down_exponentially_under_viscous_friction() {
    let slide = Case::tight().heavy().rough(false).floor();
    let (scene, start) = slide.sphere(Vec3::new(0.0, 0.0, 0.1), Vec3::new(0.3, -0.4, 0.0)).build();
    let viscous = Viscous { c: 2.0 * scene.particles.mass };
    let run = run_law(&scene, &start, Dissipative::new(0.4, 10.0), viscous).unwrap();
    let left = (-2.0f64).exp();
    assert_near("speed along x, m/s", run.end().v[0].x, 0.3 * left, 1e-8);
    assert_near("speed along y, m/s", run.end().v[0].y, -0.4 * left, 1e-8);
    assert_near("way along x, m", run.end().x[0].x, 0.15 * (1.0 - left), 1e-8);
}
