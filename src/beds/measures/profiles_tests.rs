//! Tests of profiles, against exact areas of circles.

use super::*;
use crate::beds::measures::request::RegionRequest;
use crate::beds::measures::testing::alike;
use crate::math::vector::Vec3;
use std::f64::consts::{PI, TAU};

const R: f64 = 0.05;

fn cubic() -> Vec<Vec3> {
    let along = |k: usize, step: usize| (k / step % 10) as f64 * 0.1 + 0.05;
    (0..1000).map(|k| Vec3::new(along(k, 1), along(k, 10), along(k, 100))).collect()
}

#[test]
fn profiles_of_a_cubic_lattice_are_those_of_its_circles() {
    let text = "t_end = 8
         particles = { radius = 0.05, mass = 1, file = 'start.csv' }
         container.box = { min = [0, 0, 0], max = [1, 1, inf] }
         [contact]
         repulsion_at_contact = 10
         stiffness_exponent = 150
         restitution = 0.4
         dissipation_focusing = 10
         interaction_distance = 0.1";
    let scene = Scene::parse("bed.toml", text, &[]).unwrap();
    let x = cubic();
    let spheres = Spheres::new(&x, R);
    let region =
        RegionRequest::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) }.of(&scene, &x, alike(&scene)).0;
    let exact = |at: f64| {
        let from_centre = at % 0.1 - R;
        1.0 - PI * (R * R - from_centre * from_centre) / 0.01
    };
    let heights = over_height(&spheres, &region, R);
    assert_eq!(heights.len(), 200);
    for [at, porosity] in heights {
        assert!((porosity - exact(at)).abs() < 1e-10, "{at}: {porosity}");
    }
    let (distances, walls) = over_wall_distance(&scene, &spheres, &region);
    assert_eq!(walls.len(), 4);
    assert_eq!(distances.len(), 100);
    for (name, porosities) in &walls {
        for (at, porosity) in distances.iter().zip(porosities) {
            assert!((porosity - exact(*at)).abs() < 1e-10, "{name}, {at}: {porosity}");
        }
    }
    // The walls of the box do not bound a cylinder.
    let pillar = Region::cylinder([0.5, 0.5], 0.4, [0.0, 1.0]);
    assert!(over_wall_distance(&scene, &spheres, &pillar).1.is_empty());
}

/// A tube of `sides` planes at 1 m from the z axis, 1 m high.
fn tube(sides: usize) -> Scene {
    let side = |k: usize| {
        let angle = TAU * k as f64 / sides as f64;
        let (x, y) = (angle.cos(), angle.sin());
        format!("[[container.wall]]\npoint = [{x:?}, {y:?}, 0]\nnormal = [{x:?}, {y:?}, 0]\n")
    };
    let walls: String = (0..sides).map(side).collect();
    let text = format!(
        "t_end = 1
         gravity = [0, 0, -9.81]
         particles = {{ radius = 0.2, mass = 1, file = 'start.csv' }}
         contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                      dissipation_focusing = 10, interaction_distance = 0.05 }}
         container.box = {{ min = [-inf, -inf, 0], max = [inf, inf, 1] }}
         {walls}"
    );
    Scene::parse("tube.toml", &text, &[]).unwrap()
}

#[test]
fn a_tube_of_many_planes_has_one_profile_over_the_distance_to_the_nearest() {
    // A sphere on the axis covers, at the distance d from all planes, the rings between polygons and its
    // circles; a sphere at a wall is within its own sector.
    let scene = tube(24);
    let x = [Vec3::new(0.8, 0.0, 0.5)];
    let region = RegionRequest::Whole.of(&scene, &x, alike(&scene)).0;
    let (distances, walls) = over_wall_distance(&scene, &Spheres::new(&x, 0.2), &region);
    assert_eq!(walls.len(), 1);
    assert_eq!(walls[0].0, "nearest of 24 upright walls");
    assert_eq!(distances.len(), 50);
    for (d, porosity) in distances.iter().zip(&walls[0].1) {
        // The sections are sides of a regular polygon, 1 m high. The sphere is 0.2 m from its wall, whose
        // section at the distance d is 2 (1 - d) tan(pi/24) wide.
        let width = 2.0 * (1.0 - d) * (PI / 24.0).tan();
        let radius2 = 0.04 - (d - 0.2).powi(2);
        if radius2 > 0.0 && radius2.sqrt() < width / 2.0 {
            let exact = 1.0 - PI * radius2 / (24.0 * width);
            assert!((porosity - exact).abs() < 1e-12, "{d}: {porosity} {exact}");
        }
        // No sphere reaches further than 0.4 m from the wall.
        assert!(*d < 0.4 || (porosity - 1.0).abs() < 1e-12, "{d}: {porosity}");
    }
    // A tube of six planes has a profile for each.
    let scene = tube(6);
    let region = RegionRequest::Whole.of(&scene, &x, alike(&scene)).0;
    let (_, walls) = over_wall_distance(&scene, &Spheres::new(&x, 0.2), &region);
    let names: Vec<&str> = walls.iter().map(|(name, _)| &name[..]).collect();
    assert_eq!(names[..3], ["container.wall[0]", "container.wall[1]", "container.wall[2]"]);
}

#[test]
fn heights_are_above_the_lowest_point_and_along_gravity() {
    let text = |gravity: &str, min: &str, max: &str| {
        format!(
            "t_end = 1
             gravity = {gravity}
             particles = {{ radius = 0.5, mass = 1, file = 'start.csv' }}
             contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                          dissipation_focusing = 10, interaction_distance = 0.05 }}
             container.box = {{ min = {min}, max = {max} }}"
        )
    };
    let x = [Vec3::new(-1.5, 0.5, 0.5)];
    for (gravity, min, max) in
        [("[-9.81, 0, 0]", "[-2, 0, 0]", "[inf, 1, 1]"), ("[3, 0, 0]", "[-inf, 0, 0]", "[-1, 1, 1]")]
    {
        let scene = Scene::parse("x.toml", &text(gravity, min, max), &[]).unwrap();
        let region = RegionRequest::Whole.of(&scene, &x, alike(&scene)).0;
        let profile = over_height(&Spheres::new(&x, 0.5), &region, 0.5);
        assert_eq!(profile.len(), 20);
        for [height, porosity] in profile {
            let exact = 1.0 - PI * (0.25 - (height - 0.5).powi(2));
            assert!((porosity - exact).abs() < 1e-12, "{height}: {porosity}");
        }
    }
}
