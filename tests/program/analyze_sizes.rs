//! `demhybrid analyze` through the real program, on beds of unequal spheres whose measures are known.

use crate::mpirun::{Ended, Job};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const LARGE: f64 = 0.1;
const SMALL: f64 = 0.04;
const DENSITY: f64 = 2500.0;
/// Files of an analysis that only beds of unequal spheres have.
const OWN: [&str; 5] =
    ["classes.csv", "class-contacts.csv", "class-rdf.csv", "class-height.csv", "sizes.csv"];

/// A folder with bed.vtkhdf of these spheres at rest: lines of x, y, z, and further columns, which `head`
/// names.
fn bed(head: &str, lines: &str, particles: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("bed.csv"), format!("{head}\n{lines}")).unwrap();
    let scene = format!(
        "t_end = 1e-4
         gravity = [0, 0, -9.81]
         particles = {{ {particles}, file = 'bed.csv' }}
         container.box = {{ min = [0, 0, 0], max = [1, 1, inf] }}
         contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                      dissipation_focusing = 10, interaction_distance = 0.05 }}
         output = {{ interval = 1e-4 }}"
    );
    fs::write(folder.path().join("bed.toml"), scene).unwrap();
    Job::alone(folder.path(), &["bed.toml", "-q"]).run().with_code(0);
    folder
}

fn analyze(folder: &Path, line: &str) -> Ended {
    let words: Vec<&str> = ["analyze", "bed.vtkhdf", "--frame", "0", "--force"]
        .into_iter()
        .chain(line.split_whitespace())
        .collect();
    Job::alone(folder, &words).run()
}

fn summary(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("bed-analysis/summary.json")).unwrap()).unwrap()
}

/// The rows of a table, with its head.
fn table(folder: &Path, name: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder.join("bed-analysis").join(name)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[track_caller]
fn near(found: &str, exact: f64, tolerance: f64) {
    let number: f64 = found.parse().unwrap();
    assert!((number - exact).abs() <= tolerance, "{found} is not {exact}");
}

/// A large sphere on the floor and two small ones that overlap it from above and from the side, and a small
/// one far away from all.
fn group(kinds: bool) -> TempDir {
    let d = LARGE + SMALL - 0.01;
    let end = |species: &str| if kinds { format!(",{species}") } else { String::new() };
    let lines = format!(
        "0.5,0.5,{LARGE},{LARGE}{}\n0.5,0.5,{},{SMALL}{}\n{},0.5,{LARGE},{SMALL}{}\n0.2,0.2,0.7,{SMALL}{}\n",
        end("stone"),
        LARGE + d,
        end("sand"),
        0.5 + d,
        end("sand"),
        end("dust"),
    );
    let head = if kinds { "x,y,z,radius,species" } else { "x,y,z,radius" };
    bed(head, &lines, &format!("density = {DENSITY}"))
}

#[test]
fn unequal_spheres_are_measured_exactly_and_by_class() {
    let folder = group(false);
    let said = analyze(folder.path(), "--box 0,0,0,1,1,1").with_code(0).stdout;
    let of = summary(folder.path());
    let (a, b, d): (f64, f64, f64) = (LARGE, SMALL, LARGE + SMALL - 0.01);
    let lens = PI * (a + b - d).powi(2) * (d * d + 2.0 * d * (a + b) - 3.0 * (a - b).powi(2)) / (12.0 * d);
    let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
    let union = ball(a) + 3.0 * ball(b) - 2.0 * lens;
    let row = &of["rows"][0];
    near(&row["volume_fraction"].to_string(), union, 1e-12);
    near(&row["overlap_fraction"].to_string(), 2.0 * lens, 1e-12);
    near(&row["bed_height"].to_string(), 0.74, 1e-12);
    // The large sphere touches the floor, and pushes it with less than a tenth of its weight.
    let walls = (&row["wall_contacts"], &row["wall_overlaps"]);
    assert_eq!((&row["contacts"], &row["overlaps"], walls), (&2.into(), &2.into(), (&0.into(), &1.into())));
    // The mean weight is the reference that is written; the lighter partner decides.
    let mean = 9.81 * DENSITY * (ball(a) + 3.0 * ball(b)) / 4.0;
    near(&of["reference_force"].to_string(), mean, 1e-9);
    assert_eq!(of["reference"], "the weight of the lighter partner");
    let lightest = format!("{:.6}", 0.981 * DENSITY * ball(b));
    assert!(said.contains(&lightest), "nothing of {lightest} N in\n{said}");
    let spheres = "r = 0.1 m: 1 spheres (25.00 %), 83.89 % of the mass, mean radius 0.1 m";
    assert!(said.contains(spheres), "{said}");

    let classes = table(folder.path(), "classes.csv");
    assert_eq!((&classes[1][0][..], &classes[2][0][..]), ("r = 0.04 m", "r = 0.1 m"));
    let place = |name: &str| classes[0].iter().position(|word| word == name).unwrap();
    near(&classes[2][place("mass")], DENSITY * ball(a), 1e-12);
    near(&classes[1][place("mass_share")], 3.0 * ball(b) / (ball(a) + 3.0 * ball(b)), 1e-12);
    near(&classes[1][place("mean_coordination")], 2.0 / 3.0, 1e-12);
    near(&classes[2][place("mean_coordination")], 2.0, 1e-12);
    let parts = [1, 2].map(|k| classes[k][place("volume_fraction")].parse::<f64>().unwrap());
    assert!((parts[0] + parts[1] - union).abs() < 1e-12, "{parts:?}");
    let plane = (d * d + a * a - b * b) / (2.0 * d);
    let cap = PI * (a - plane).powi(2) * (3.0 * a - (a - plane)) / 3.0;
    assert!((parts[1] - (ball(a) - 2.0 * cap)).abs() < 1e-12, "{parts:?}");
    let contacts = table(folder.path(), "class-contacts.csv");
    let counts: Vec<&str> = contacts[1..].iter().map(|row| &row[2][..]).collect();
    assert_eq!(counts, ["0", "2", "2", "0"]);
    near(&contacts[2][4], 5.8 * (150.0f64 * 0.01).exp(), 1e-9);
    let sizes = table(folder.path(), "sizes.csv");
    assert_eq!(sizes.len(), 3);
    near(&sizes[1][0], 0.08, 1e-15);
    near(&sizes[1][3], 0.75, 1e-15);
    near(&sizes[2][6], 1.0, 1e-15);
    // All of the mass is in the layers, which reach from the floor to the highest point.
    let layers = table(folder.path(), "class-height.csv");
    let masses: f64 = layers[1..].iter().map(|row| row[4].parse::<f64>().unwrap()).sum();
    assert!((masses - DENSITY * (ball(a) + 3.0 * ball(b))).abs() < 1e-12);
    near(&layers[1][0], 0.0, 1e-15);
    near(&layers[layers.len() - 1][1], 0.74, 1e-12);
    assert_eq!(layers[0][5..], ["mass share of r = 0.04 m", "mass share of r = 0.1 m"]);
    assert_eq!(table(folder.path(), "class-rdf.csv")[0].len(), 5);
}

#[test]
fn species_are_the_classes_unless_a_number_is_asked_for() {
    let folder = group(true);
    let names =
        || table(folder.path(), "classes.csv")[1..].iter().map(|row| row[0].clone()).collect::<Vec<_>>();
    analyze(folder.path(), "").with_code(0);
    assert_eq!(names(), ["stone", "sand", "dust"]);
    analyze(folder.path(), "--classes 2").with_code(0);
    assert_eq!(names(), ["r = 0.04 m", "r = 0.1 m"]);
    analyze(folder.path(), "--classes 1").with_code(0);
    assert_eq!(names(), ["r = 0.04 to 0.1 m"]);
    assert_eq!(summary(folder.path())["by_class"]["classes"][0]["spheres"], 4);
    analyze(folder.path(), "--classes 0").with_code(2);
}

#[test]
fn beds_of_equal_spheres_have_no_classes() {
    let folder = bed("x,y,z", "0.5,0.5,0.1\n0.5,0.5,0.3\n", "radius = 0.1, mass = 1");
    analyze(folder.path(), "").with_code(0);
    for name in OWN {
        assert!(!folder.path().join("bed-analysis").join(name).exists(), "{name}");
    }
    assert!(summary(folder.path()).get("by_class").is_none());
    let refused = analyze(folder.path(), "--classes 2").with_code(2);
    assert!(refused.stderr.contains("all spheres have one size"), "{}", refused.stderr);
}
