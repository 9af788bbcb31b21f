//! A frame of spheres of unequal sizes for the tests of exports.

use crate::beds::measures::testing;
use crate::files::output::Species;
use crate::files::run_file::State;
use crate::model::size::Size;
use crate::scene::Scene;

/// The names of its species.
pub const NAMES: [&str; 3] = ["coarse sand", "b, or \"c\"", "d"];

/// Three spheres in a box of 1 m that is open above: two of radius 0.1 and 0.05 m, and below a small one of
/// 0.02 m. Nothing overlaps.
pub fn sized() -> (Scene, State, Species) {
    let mut scene = testing::boxed("[0, 0, 0]", "[1, 1, inf]");
    scene.particles.radius = 0.17 / 3.0;
    let x = vec![[0.4, 0.5, 0.3], [0.5, 0.5, 0.2], [0.5, 0.6, 0.05]];
    let v = vec![[0.1, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0; 3]];
    let sizes = [Size::new(0.1, 2.0), Size::new(0.05, 0.25), Size::new(0.02, 0.016)].into();
    let species = Species { names: NAMES.map(str::to_owned).into(), of: vec![0, 1, 2] };
    (scene, State { frame: 0, time: 0.5, x, v, omega: None, sizes, materials: Default::default() }, species)
}
