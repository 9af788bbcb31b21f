//! A bed that is turned with its walls and gravity keeps all of its measures.

use super::contacts::SHARE;
use super::profiles::{over_height, over_wall_distance};
use super::radial::radial_distribution;
use super::request::RegionRequest;
use super::row::{Row, centres};
use super::testing::alike;
use super::union::Spheres;
use crate::files::run_file::State;
use crate::math::vector::Vec3;
use crate::scene::Scene;
use nalgebra::Rotation3;

/// A settled bed of 200 spheres in a box of 1 m x 1 m, and the sphere that falls on it.
fn settled() -> Vec<Vec3> {
    let path = format!("{}/tests/scenes/hard/csv/onto-bed-1.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let numbers = |line: &str| -> Vec<f64> { line.split(',').map(|word| word.parse().unwrap()).collect() };
    text.lines().skip(1).map(|line| Vec3::from_column_slice(&numbers(line)[..3])).collect()
}

/// The walls of the box as planes, turned and then moved by `away` (m), with gravity turned alike.
fn turned_scene(turn: &Rotation3<f64>, away: &Vec3) -> Scene {
    let list = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let walls = [-Vec3::x(), Vec3::x(), -Vec3::y(), Vec3::y(), -Vec3::z()];
    let plane = |n: Vec3| {
        let point = if n.sum() > 0.0 { n } else { Vec3::zeros() };
        let (point, n) = (turn * point + away, turn * n);
        format!("[[container.wall]]\npoint = {}\nnormal = {}\n", list(point), list(n))
    };
    let text = format!(
        "t_end = 1
         gravity = {}
         particles = {{ radius = 0.1, mass = 1, file = 'start.csv' }}
         contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                      dissipation_focusing = 10, interaction_distance = 0.1 }}
         {}",
        list(turn * Vec3::new(0.0, 0.0, -9.81)),
        walls.map(plane).concat()
    );
    Scene::parse("turned.toml", &text, &[]).unwrap()
}

/// All measures of the bed, each with its name.
fn measures(turn: &Rotation3<f64>, away: &Vec3, request: &RegionRequest) -> Vec<(String, f64)> {
    let scene = turned_scene(turn, away);
    let x: Vec<[f64; 3]> = settled().iter().map(|x| (turn * x + away).into()).collect();
    let state = State {
        frame: 0,
        time: 0.0,
        v: vec![[0.0; 3]; x.len()],
        x,
        omega: None,
        sizes: Default::default(),
        materials: Default::default(),
    };
    let x = centres(&state);
    let (region, _) = request.of(&scene, &x, alike(&scene));
    let spheres = Spheres::new(&x, 0.1);
    let row = serde_json::to_value(Row::of(&scene, &state, &region, SHARE)).unwrap();
    let mut all: Vec<(String, f64)> = row
        .as_object()
        .unwrap()
        .iter()
        // The unit cube of the paper does not turn.
        .filter(|(name, _)| !name.ends_with("unit_cube"))
        .map(|(name, value)| (name.clone(), value.as_f64().unwrap()))
        .collect();
    all.push(("region".into(), region.volume()));
    let mut add = |name: String, values: Vec<f64>| {
        all.extend(values.into_iter().enumerate().map(|(k, value)| (format!("{name} {k}"), value)));
    };
    add("height".into(), over_height(&spheres, &region, 0.1).into_flattened());
    let (distances, walls) = over_wall_distance(&scene, &spheres, &region);
    assert_eq!(walls.len(), 4);
    add("distance".into(), distances);
    walls.into_iter().for_each(|(name, porosities)| add(name, porosities));
    let axes = [region.upright.across[0], region.upright.across[1], region.upright.up];
    let g = radial_distribution(&x, 0.1, &region.room_of_centres(0.1), &axes);
    add("g".into(), g.into_flattened());
    all
}

#[test]
fn a_bed_turned_with_its_walls_and_gravity_has_the_same_measures() {
    let none = Rotation3::identity();
    for request in [RegionRequest::Bed, RegionRequest::Whole, RegionRequest::Layer([0.2, 0.8])] {
        let upright = measures(&none, &Vec3::zeros(), &request);
        assert!(upright.len() > 400, "a layer has fewer sections, but all kinds of measures");
        for (turn, away) in [
            (Rotation3::from_euler_angles(0.3, -0.8, 1.9), Vec3::new(3.0, -1.0, 0.5)),
            (Rotation3::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0), Vec3::zeros()),
        ] {
            let turned = measures(&turn, &away, &request);
            assert_eq!(turned.len(), upright.len());
            for ((name, found), (_, exact)) in turned.iter().zip(&upright) {
                // The ground lies lower or higher by `away`, from which nothing is measured. Names of walls
                // across an axis differ.
                let error = (found - exact).abs() / exact.abs().max(1.0);
                assert!(error < 1e-6, "{request:?}, {name}: {found} is not {exact}");
            }
        }
    }
}
