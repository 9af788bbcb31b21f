//! Spheres of unequal sizes under mpirun: the same bits on any ranks and threads and through a resume, and
//! their sizes in the file.

use crate::mpirun::Job;
use crate::results::{Results, assert_goes_on_elsewhere, assert_same_anywhere, assert_same_bits, results_on};
use rand::{RngExt, SeedableRng};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;

const SCENE: &str = "
t_end = 0.5
gravity = [0.0, 0.0, -9.81]
particles = { density = 2000.0, file = 'start.csv' }
container.box = { min = [0.0, 0.0, 0.0], max = [0.8, 0.8, inf] }
friction = { law = 'history', coefficient = 0.3, rolling = { coefficient = 0.02 } }
output.interval = 0.005
output.sync = 'frame'
checkpoint.interval = 0.02
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 200.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.06 }
";

/// Radius (m) of particle `k`: many small ones, some large, and one that is six times as wide as the least.
fn radius(k: usize, random: &mut rand_chacha::ChaCha8Rng) -> f64 {
    if k == 17 { 0.12 } else { 0.02 * f64::exp(1.1 * random.random::<f64>().powi(2)) }
}

/// A folder with the scene and 250 spheres of two species in cells above the floor.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(9);
    let mut text = "x,y,z,vx,vy,vz,radius,species\n".to_owned();
    for k in 0..250 {
        let cell = [k % 6, k / 6 % 6, k / 36];
        let mut shift = |scale: f64| scale * (2.0 * random.random::<f64>() - 1.0);
        let [x, y, z] = cell.map(|c| 0.13 * (c as f64 + 0.5) + 0.02);
        let [x, y, z] = [x + shift(0.005), y + shift(0.005), z + shift(0.005)];
        let v = [shift(0.5), shift(0.5), shift(0.5) - z];
        let r = radius(k, &mut random);
        // The large one stands alone, above all others.
        let z = if k == 17 { 1.3 } else { z };
        let species = if r > 0.03 { "coarse" } else { "fine" };
        writeln!(text, "{x:?},{y:?},{z:?},{:?},{:?},{:?},{r:?},{species}", v[0], v[1], v[2]).unwrap();
    }
    fs::write(folder.path().join("start.csv"), text).unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    folder
}

static WHOLE: LazyLock<Results> = LazyLock::new(|| results_on(folder().path(), 0, "1"));

#[test]
fn ranks_and_threads_do_not_matter_to_spheres_of_unequal_sizes() {
    let lowest = WHOLE.lowest();
    assert!(lowest < 0.03, "the small ones have reached the floor: {lowest} m");
    assert_same_anywhere(&WHOLE, folder().path());
}

#[test]
fn a_run_with_sizes_goes_on_where_it_was_stopped() {
    assert_goes_on_elsewhere(&WHOLE, folder().path(), 40);
}

#[test]
fn the_file_holds_radii_masses_and_species() {
    let (radii, masses) = (WHOLE.reals("VTKHDF/PointData/radius"), WHOLE.reals("VTKHDF/PointData/mass"));
    assert_eq!((radii.len(), masses.len()), (250, 250));
    assert_eq!(radii[17], 0.12);
    for (r, mass) in radii.iter().zip(&masses) {
        let expected = 2000.0 * 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        assert!((mass / expected - 1.0).abs() < 1e-14, "{mass} {expected}");
    }
    let species = WHOLE.reals("VTKHDF/PointData/species");
    assert!(species.iter().zip(&radii).all(|(number, r)| (*number == species[17]) == (*r > 0.03)));
    let mean = radii.iter().sum::<f64>() / 250.0;
    let scene = WHOLE.scene();
    let typical = scene["particles"]["radius"].as_float().unwrap();
    assert!((typical / mean - 1.0).abs() < 1e-14, "{typical} {mean}");
    // The scene that is recorded gives the same run again: masses follow from the density.
    assert_eq!(scene["particles"]["density"].as_float(), Some(2000.0));
    assert!(scene["particles"].get("mass").is_none());
}

/// What a dry run says of the scene with this particle file.
fn dry_run(csv: &str, sets: &[&str]) -> (i32, String) {
    let folder = folder();
    fs::write(folder.path().join("start.csv"), csv).unwrap();
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    let ended = Job::alone(folder.path(), &["scene.toml", "--dry-run"]).and(&sets).run();
    (ended.code, ended.stderr.clone() + &ended.stdout)
}

#[test]
fn mistakes_in_columns_of_sizes_are_told_with_their_line() {
    for (csv, part) in [
        ("x,y,z,radius\n0.3,0.3,0.3,0.1\n0.6,0.6,0.3,-1\n", "start.csv:3: radius = \"-1\""),
        ("x,y,z,radius\n0.3,0.3,0.3,big\n", "start.csv:2: radius = \"big\""),
        ("x,y,z,radius,mass\n0.3,0.3,0.3,0.1,0\n", "start.csv:2: mass = \"0\""),
        (
            "x,y,z,radius,mass,density\n0.3,0.3,0.3,0.1,1,1\n",
            "start.csv:1: columns mass and density contradict",
        ),
        ("x,y,z,radius,radius\n0.3,0.3,0.3,0.1,0.1\n", "start.csv:1: column radius is named twice"),
        ("x,y,z,radius,species\n0.3,0.3,0.3,0.1,\n", "start.csv:2: species = \"\""),
        ("x,y,z\n0.3,0.3,0.3\n", "particles.radius is missing"),
        ("x,y,z,radius\n0.3,0.3,0.3,1e-9\n0.6,0.6,0.3,0.1\n", "a factor of 10000 between them is possible"),
    ] {
        let (code, text) = dry_run(csv, &[]);
        assert!(code == 2 && text.contains(part), "{csv}: {code} {text}");
    }
}

#[test]
fn sizes_may_stand_in_the_file_in_any_way() {
    // One radius for all and densities; a mass for all; masses of their own.
    for (csv, sets) in [
        ("x,y,z,density\n0.2,0.3,0.3,1000\n0.6,0.6,0.3,2000\n", &["particles.radius=0.1"][..]),
        ("x,y,z,radius\n0.2,0.3,0.3,0.1\n0.6,0.6,0.3,0.05\n", &[]),
        ("x,y,z,radius,mass\n0.2,0.3,0.3,0.1,3\n0.6,0.6,0.3,0.05,1\n", &[]),
    ] {
        let (code, text) = dry_run(csv, sets);
        assert!(code == 0 && text.contains("is valid"), "{csv}: {code} {text}");
    }
}

#[test]
fn a_column_of_one_radius_gives_the_bits_of_that_radius_in_the_scene() {
    let run = |csv: &str, sets: &[&str]| {
        let folder = folder();
        fs::write(folder.path().join("start.csv"), csv).unwrap();
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        Job::alone(folder.path(), &["scene.toml", "-q"]).and(&sets).run().with_code(0);
        Results::open(&folder.path().join(Path::new("scene.vtkhdf")))
    };
    let column = run("x,y,z,radius\n0.2,0.3,0.3,0.1\n0.25,0.3,0.55,0.1\n", &[]);
    let scene = run("x,y,z\n0.2,0.3,0.3\n0.25,0.3,0.55\n", &["particles.radius=0.1"]);
    assert_same_bits(&scene, &column, "a column of one radius");
}
