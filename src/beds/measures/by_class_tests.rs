//! Tests of the measures by class, on a lattice of two sizes whose measures are known.

use super::*;
use crate::beds::measures::contacts::SHARE;
use crate::beds::measures::testing::{scene, sized};
use crate::beds::measures::union::{Spheres, Volumes};
use std::f64::consts::PI;

const SIDE: f64 = 0.2;
const COUNT: usize = 8;

/// Large and small spheres in turn at the points of a cubic lattice, in touch with their neighbours.
fn salt(large: f64, small: f64) -> State {
    let site = |k: usize| [k % COUNT, k / COUNT % COUNT, k / COUNT / COUNT];
    let sphere = |k: usize| {
        let is_large = site(k).iter().sum::<usize>() % 2 == 0;
        let r = if is_large { large } else { small };
        (site(k).map(|c| SIDE * c as f64), r, 1000.0 * r * r * r)
    };
    sized(&(0..COUNT.pow(3)).map(sphere).collect::<Vec<_>>())
}

fn measured(scene: &Scene, state: &State, region: &Region, classes: &Classes) -> (ByClass, Volumes) {
    let contacts = Contacts::of(scene, state, SHARE);
    let x = centres(state);
    let parts = Spheres::sized(&x, state.sizes(scene)).parts(region);
    (ByClass::of(scene, state, region, classes, &contacts, &parts), Volumes::of(&parts, region))
}

#[track_caller]
fn near(found: f64, exact: f64, tolerance: f64) {
    assert!((found - exact).abs() <= tolerance, "{found} is not {exact}");
}

#[test]
fn a_lattice_of_two_sizes_has_partial_measures() {
    let (large, small) = (0.13, 0.07 + 1e-4);
    let (state, scene) = (salt(large, small), scene(""));
    let classes = Classes::of(&state.sizes, None, None).unwrap();
    // Four cells of the lattice inside it.
    let region = Region::cuboid(Vec3::repeat(0.3 * SIDE), Vec3::repeat(4.3 * SIDE));
    let (found, volumes) = measured(&scene, &state, &region, &classes);
    assert_eq!(found.classes.iter().map(|row| row.spheres).collect::<Vec<_>>(), [256, 256]);
    let [a, b] = [&found.classes[0], &found.classes[1]];
    near(a.mean_radius, small, 1e-15);
    near(b.mean_radius, large, 1e-15);
    near(b.mass_share, large.powi(3) / (large.powi(3) + small.powi(3)), 1e-12);
    near(a.number_share, 0.5, 1e-15);
    near(a.volume_fraction + b.volume_fraction, volumes.union / volumes.region, 1e-13);
    // Each large sphere loses a cap to each of its six neighbours, and so does each small one.
    let plane = (SIDE * SIDE + large * large - small * small) / (2.0 * SIDE);
    let cap = |r: f64, h: f64| PI * h * h * (3.0 * r - h) / 3.0;
    let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
    near(b.volume_fraction, 0.5 * (ball(large) - 6.0 * cap(large, large - plane)) / SIDE.powi(3), 1e-9);
    near(
        a.volume_fraction,
        0.5 * (ball(small) - 6.0 * cap(small, small + plane - SIDE)) / SIDE.powi(3),
        1e-9,
    );
    // Contacts are between the classes only: 3 * 7 * 8^2, of which each is one for both partners.
    let contacts: Vec<usize> = found.contacts.iter().map(|pair| pair.contacts).collect();
    assert_eq!(contacts, [0, 1344, 1344, 0]);
    near(found.contacts[1].mean_coordination, 1344.0 / 256.0, 1e-12);
    near(a.mean_coordination, 5.25, 1e-12);
    near(found.contacts[2].mean_force, 5.8 * (150.0f64 * 1e-4).exp(), 1e-9);
    assert_eq!((found.contacts[0].mean_force, a.wall_contacts), (0.0, 0));
    // Nothing holds a free cubic block: corners have 3 contacts, and without them the edges have.
    assert_eq!((a.rattlers, b.rattlers), (256, 256));
    // The sizes: half of all spheres are small.
    assert_eq!(found.sizes.by_number, [2.0 * small, 2.0 * small, 2.0 * large]);
    // They have 0.135 of the mass.
    assert_eq!(found.sizes.by_mass, [2.0 * small, 2.0 * large, 2.0 * large]);
}

#[test]
fn neighbours_of_the_other_class_are_at_the_side_of_the_lattice() {
    let (state, scene) = (salt(0.13, 0.07), scene(""));
    let classes = Classes::of(&state.sizes, None, None).unwrap();
    let ends = Vec3::repeat(-0.5 * SIDE);
    let region = Region::cuboid(ends, Vec3::repeat((COUNT as f64 - 0.5) * SIDE));
    let (found, _) = measured(&scene, &state, &region, &classes);
    let names: Vec<[&str; 2]> =
        found.radial.iter().map(|around| [&around.class[..], &around.other_class]).collect();
    let (a, b) = ("r = 0.07 m", "r = 0.13 m");
    assert_eq!(names, [[a, a], [a, b], [b, b]]);
    // The first neighbours of the same class are across the faces of the cells: 12 of them; of the other
    // class there are 6 along the edges.
    let density = 0.5 / SIDE.powi(3);
    for (around, distance, neighbours) in
        [(0, SIDE * 2f64.sqrt(), 12.0), (1, SIDE, 6.0), (2, SIDE * 2f64.sqrt(), 12.0)]
    {
        let g = &found.radial[around].distribution;
        let k = g.iter().position(|[_, g]| *g > 0.0).unwrap();
        let width = 2.0 * g[0][0];
        near(g[k][0], distance, width);
        let shell = 4.0 / 3.0 * PI * width.powi(3) * ((k as f64 + 1.0).powi(3) - (k as f64).powi(3));
        near(g[k][1] * density * shell, neighbours, 0.05 * neighbours);
    }
    near(found.radial[1].mean_diameter, 0.2, 1e-15);
    near(found.radial[2].mean_diameter, 0.26, 1e-15);
}
