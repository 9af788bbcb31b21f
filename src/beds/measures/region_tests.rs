//! Tests of regions, against exact areas and volumes.

use super::*;
use crate::beds::measures::request::RegionRequest;
use crate::beds::measures::testing::{alike, boxed, scene, walled};

#[track_caller]
fn near(found: f64, exact: f64) {
    assert!((found - exact).abs() <= 1e-13 * exact.abs().max(1.0), "{found} is not {exact}");
}

fn whole(scene: &Scene, x: &[Vec3]) -> Region {
    RegionRequest::Whole.of(scene, x, alike(scene)).0
}

/// Planes of a tube of 24 sides at the distance 0.5 m from the line through x = y = 0, with a floor.
fn tube() -> String {
    let side = |k: usize| {
        let angle = TAU * (k as f64 + 0.5) / 24.0;
        let (x, y) = (angle.cos(), angle.sin());
        format!("[[container.wall]]\npoint = [{}, {}, 0]\nnormal = [{x:?}, {y:?}, 0]\n", 0.5 * x, 0.5 * y)
    };
    let sides: String = (0..24).map(side).collect();
    format!("{sides}[[container.wall]]\nnormal = [0, 0, -1]\n")
}

/// A scene with gravity along -z and these planes.
fn with_walls(walls: &str) -> Scene {
    walled("gravity = [0, 0, -9.81]", walls)
}

#[test]
fn open_sides_end_with_the_spheres() {
    let x = [Vec3::new(0.3, 0.4, 0.5), Vec3::new(0.6, 0.2, 0.9)];
    let corners = |min: &str, max: &str| whole(&boxed(min, max), &x).as_box().unwrap();
    let is = |(low, high): (Vec3, Vec3), from: [f64; 3], to: [f64; 3]| {
        let error = (low - Vec3::from(from)).amax().max((high - Vec3::from(to)).amax());
        assert!(error < 1e-14, "{low} {high}");
    };
    is(corners("[0, 0, 0]", "[1, 2, inf]"), [0.0; 3], [1.0, 2.0, 1.0]);
    is(corners("[-inf, 0, -inf]", "[1, inf, inf]"), [0.2, 0.0, 0.4], [1.0, 0.5, 1.0]);
    // Without walls, the box around all spheres.
    is(whole(&scene(""), &x).as_box().unwrap(), [0.2, 0.1, 0.4], [0.7, 0.5, 1.0]);
    // With a lid far above, the lid.
    is(corners("[0, 0, 0]", "[1, 2, 7]"), [0.0; 3], [1.0, 2.0, 7.0]);
    // All spheres are below the floor.
    assert!(whole(&boxed("[0, 0, 7]", "[1, 1, inf]"), &x).is_empty());
}

#[test]
fn the_bed_ends_the_region_along_gravity_whatever_its_direction() {
    let x = [Vec3::new(0.4, 0.5, 0.5), Vec3::new(0.9, 0.2, 0.7)];
    let of = |gravity: &str, min: &str, max: &str| {
        let more = format!("gravity = {gravity}\ncontainer.box = {{ min = {min}, max = {max} }}");
        whole(&scene(&more), &x)
    };
    let region = of("[-9.81, 0, 0]", "[0, 0, 0]", "[inf, 1, 1]");
    near(region.volume(), 1.0);
    assert_eq!(region.bounds().1, Vec3::repeat(1.0));
    let region = of("[0, 9.81, 0]", "[0, -inf, 0]", "[1, 1, 1]");
    near(region.volume(), 0.9);
    assert_eq!((region.upright.ground, region.upright.height(&x[1])), (-1.0, 0.8));
    // A corner in which gravity is along the diagonal: the surface of the bed cuts a tetrahedron off.
    let region = of("[-1, -1, -1]", "[0, 0, 0]", "[inf, inf, inf]");
    let top = 1.8 / 3f64.sqrt() + 0.1;
    // A plane at this distance from the corner meets all three edges at sqrt(3) times the distance.
    near(region.volume(), (3f64.sqrt() * top).powi(3) / 6.0);
}

#[test]
fn a_tube_of_planes_is_no_box() {
    let scene = with_walls(&tube());
    let x = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.0, 0.0, 1.1)];
    let region = whole(&scene, &x);
    let area = 24.0 * 0.25 * (PI / 24.0).tan();
    near(region.volume(), area * 1.2);
    near(region.section(&Vec3::z(), 0.7), area);
    near(region.least_width(), 1.0);
    assert!(region.as_box().is_none() && region.sides().len() == 26);
    // Centres can be where they have their radius of 0.1 m to all walls, and to the highest point.
    near(region.room_of_centres(0.1).volume(), 0.64 * area * 1.0);
    let layer = RegionRequest::Layer([0.25, 0.5]).of(&scene, &x, alike(&scene)).0;
    near(layer.volume(), area * 0.25);
    // A box or a cylinder is cut by the walls, and reaches as far up as asked for.
    let high = Vec3::new(3.0, 3.0, 2.0);
    near(RegionRequest::Box { low: -high, high }.of(&scene, &x, alike(&scene)).0.volume(), area * 2.0);
    let cylinder = |radius| {
        let request = RegionRequest::Cylinder { axis: [0.0; 2], radius, ends: [-1.0, 0.5] };
        request.of(&scene, &x, alike(&scene)).0.volume()
    };
    near(cylinder(0.5), PI * 0.25 * 0.5);
    near(cylinder(0.6), area * 0.5);
}

#[test]
fn a_tilted_floor_cuts_a_cylinder_and_heights_start_at_the_lowest_point() {
    let floor = "[[container.wall]]\nnormal = [-1, 0, -1]\n";
    let scene = with_walls(floor);
    let request = RegionRequest::Cylinder { axis: [0.0, 0.0], radius: 0.5, ends: [-2.0, 2.0] };
    // The floor halves the cylinder, whatever its slope.
    let region = request.of(&scene, &[Vec3::new(0.0, 0.0, 1.0)], alike(&scene)).0;
    assert!((region.volume() - PI * 0.25 * 2.0).abs() < 1e-9, "{}", region.volume());
    // Nothing holds spheres on the slope, so heights start at the origin.
    assert_eq!(region.upright.ground, 0.0);
    let wedge = format!("{floor}[[container.wall]]\npoint = [0, 0, -1]\nnormal = [1, 0, -1]\n");
    // The planes x + z = 0 and z - x = -1 meet at z = -1/2.
    near(Upright::of(&with_walls(&wedge)).ground, -0.5);
}

/// Centres at equal vertical distances, from 0 to `top`.
fn up_to(top: f64) -> Vec<Vec3> {
    (0..=100).map(|k| Vec3::new(0.5, 0.5, top * k as f64 / 100.0)).collect()
}

fn bed(scene: &Scene, x: &[Vec3]) -> (Vec3, Vec3) {
    let (region, words) = RegionRequest::Bed.of(scene, x, alike(scene));
    assert_eq!(words, "the bed, without its top");
    region.as_box().unwrap()
}

#[test]
fn a_deep_bed_is_measured_as_high_as_it_is_wide() {
    let (low, high) = bed(&boxed("[0, 0, 0]", "[1, 1, inf]"), &up_to(1.3));
    assert!(low.amax() < 1e-14 && (high - Vec3::repeat(1.0)).amax() < 1e-14, "{low} {high}");
    let (low, high) = bed(&boxed("[-1, 2, -3]", "[1, 2.5, 7]"), &up_to(5.0));
    assert!((low - Vec3::new(-1.0, 2.0, -3.0)).amax() < 1e-14, "{low}");
    assert!((high - Vec3::new(1.0, 2.5, -2.5)).amax() < 1e-14, "{high}");
    // In a tube, as wide as two of its sides are apart.
    let (region, _) = RegionRequest::Bed.of(&with_walls(&tube()), &up_to(1.3), alike(&with_walls(&tube())));
    near(region.reach(&Vec3::z()), 1.0);
}

#[test]
fn a_shallow_bed_is_measured_up_to_three_quarters_of_its_centres() {
    let (low, high) = bed(&boxed("[0, 0, 0]", "[1, 1, inf]"), &up_to(0.8));
    assert!(low.amax() < 1e-14 && (high - Vec3::new(1.0, 1.0, 0.6)).amax() < 1e-14, "{high}");
}

#[test]
fn an_open_base_or_a_bed_below_the_floor_is_measured_as_a_whole() {
    let words = |scene: &Scene, x: &[Vec3]| RegionRequest::Bed.of(scene, x, alike(scene)).1;
    for (min, max) in [
        ("[-inf, 0, 0]", "[1, 1, inf]"),
        ("[0, -inf, 0]", "[1, 1, inf]"),
        ("[0, 0, -inf]", "[1, 1, inf]"),
        ("[0, 0, 0]", "[inf, 1, inf]"),
        ("[0, 0, 0]", "[1, inf, inf]"),
    ] {
        assert_eq!(words(&boxed(min, max), &up_to(2.0)), "the whole bed");
    }
    assert_eq!(words(&boxed("[0, 0, 0]", "[1, 1, inf]"), &up_to(-2.0)), "the whole bed");
    assert_eq!(words(&boxed("[0, 0, 0]", "[1, 1, inf]"), &[]), "the whole bed");
    assert_eq!(words(&scene(""), &up_to(2.0)), "the whole bed");
}
