//! What walls enclose, through the real program: a tube of planes that lies on its side, with gravity along
//! it.

use crate::mpirun::Job;
use serde_json::Value;
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const R: f64 = 0.1;
/// Distance of the 24 planes from the axis of the tube, m.
const TUBE: f64 = 0.8;
/// Position of the floor along x, m.
const FLOOR: f64 = -0.3;

/// A folder with tube.toml and its spheres, which do not touch: the axis is x, gravity is along -x, and the
/// tube is open at its upper end. Returns the number of spheres and the height of the highest point, m.
fn tube() -> (TempDir, usize, f64) {
    let place = |k: i32| 0.225 * f64::from(k);
    let mut rows = Vec::new();
    for layer in 0..6 {
        for i in -4..5 {
            for j in -4..5 {
                if place(i).hypot(place(j)) < TUBE - R - 0.02 {
                    let x = FLOOR + 0.12 + 0.23 * f64::from(layer);
                    rows.push(format!("{x:?},{:?},{:?}\n", place(i), place(j)));
                }
            }
        }
    }
    let side = |k: i32| {
        let angle = TAU * (f64::from(k) + 0.5) / 24.0;
        let n = [angle.cos(), angle.sin()];
        format!(
            "[[container.wall]]\npoint = [0, {:?}, {:?}]\nnormal = [0, {:?}, {:?}]\n",
            TUBE * n[0],
            TUBE * n[1],
            n[0],
            n[1]
        )
    };
    let walls: String = (0..24).map(side).collect();
    let scene = format!(
        "t_end = 1e-6
         gravity = [-9.81, 0, 0]
         particles = {{ radius = {R}, mass = 1, file = 'tube.csv' }}
         contact = {{ repulsion_at_contact = 10, stiffness_exponent = 1000, restitution = 0.4,
                      dissipation_focusing = 10, interaction_distance = 0.02 }}
         output = {{ interval = 1e-6 }}
         {walls}[[container.wall]]\npoint = [{FLOOR}, 0, 0]\nnormal = [-1, 0, 0]\n"
    );
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("tube.csv"), format!("x,y,z\n{}", rows.concat())).unwrap();
    fs::write(folder.path().join("tube.toml"), scene).unwrap();
    (folder, rows.len(), 0.12 + 0.23 * 5.0 + R)
}

fn json(folder: &Path, name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join(name)).unwrap()).unwrap()
}

#[track_caller]
fn near(what: &str, found: &Value, exact: f64, tolerance: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{what} is {found}"));
    assert!((found - exact).abs() <= tolerance, "{what}: {found} is not {exact}");
}

#[test]
fn a_lying_tube_of_planes_has_one_porosity_and_one_bed_height_everywhere() {
    let (folder, count, height) = tube();
    let path = folder.path();
    let run = |line: &str| Job::alone(path, &line.split(' ').collect::<Vec<_>>()).run().with_code(0);
    let said = run("tube.toml").stdout;
    // The spheres fall by 5e-12 m in 1e-6 s.
    assert!(said.contains(&format!("bed height        {height:.6} m")), "{said}");
    let said = run("analyze tube.vtkhdf --whole").stdout;
    assert!(said.contains(&format!("{height:.5} m")), "{said}");
    let found = json(path, "tube-analysis/summary.json");
    near("bed height", &found["rows"][0]["bed_height"], height, 1e-10);
    // A polygon of 24 sides around a circle has the area 24 R^2 tan(pi/24).
    let area = 24.0 * TUBE * TUBE * (PI / 24.0).tan();
    near("region", &found["region_volume"], area * height, 1e-9);
    let solid = count as f64 * 4.0 / 3.0 * PI * R.powi(3);
    let porosity = 1.0 - solid / (area * height);
    near("porosity", &found["rows"][0]["porosity"], porosity, 1e-9);
    let profile = found["height_profile"].as_array().unwrap();
    near("lowest height", &profile[0][0], height / (2.0 * profile.len() as f64), 1e-9);
    let mean = profile.iter().map(|row| row[1].as_f64().unwrap()).sum::<f64>() / profile.len() as f64;
    // Ten sections in each radius integrate parabolas to 1e-3.
    assert!((mean - porosity).abs() < 2e-3, "{mean} is not {porosity}");

    // The image is a box around the tube. What is outside the planes is neither pore nor solid.
    for (ones, at) in [("pore", 1u8), ("solid", 0)] {
        run(&format!("export tube.vtkhdf --to raw --ones {ones} --force -o tube.raw"));
        let header = json(path, "tube.raw.json");
        let image = fs::read(path.join("tube.raw")).unwrap();
        let number = |value: u8| image.iter().filter(|voxel| **voxel == value).count() as f64;
        assert_eq!(number(2), header["voxels_outside"].as_f64().unwrap());
        // The corners of the tube touch the box. The voxels along its walls are an error of a hundredth.
        let square = 4.0 * (TUBE / (PI / 24.0).cos()).powi(2);
        assert!((number(2) / image.len() as f64 - (1.0 - area / square)).abs() < 0.01);
        let share = number(at) / (number(0) + number(1));
        assert!((share - porosity).abs() < 5e-3, "{share} is not {porosity}");
        near("porosity of the header", &header["porosity"], share, 1e-12);
    }
    // What lies outside the walls is no region.
    Job::alone(path, &["analyze", "tube.vtkhdf", "-o", "none", "--box", "2,2,2,3,3,3"])
        .run()
        .with_code(2)
        .only_error(&["the box of --box", "inside the walls"]);
}
