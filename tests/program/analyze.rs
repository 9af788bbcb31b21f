//! `demhybrid analyze` through the real program, on beds whose measures are known exactly.

use crate::mpirun::{Ended, Job, PACKAGE};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const R: f64 = 0.05;

/// A folder with bed.vtkhdf, whose frame 0 is at rest with these centres (m).
fn bed(x: &[[f64; 3]], container: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let rows: String = x.iter().map(|[x, y, z]| format!("{x:?},{y:?},{z:?}\n")).collect();
    fs::write(folder.path().join("bed.csv"), format!("x,y,z\n{rows}")).unwrap();
    let scene = format!(
        "t_end = 1e-4
         particles = {{ radius = {R}, mass = 1, file = 'bed.csv' }}
         {container}
         contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                      dissipation_focusing = 10, interaction_distance = 0.05 }}
         output = {{ interval = 1e-4 }}"
    );
    fs::write(folder.path().join("bed.toml"), scene).unwrap();
    Job::alone(folder.path(), &["bed.toml", "-q"]).run().with_code(0);
    folder
}

fn analyze(folder: &Path, line: &str) -> Ended {
    let words: Vec<&str> = ["analyze"].into_iter().chain(line.split_whitespace()).collect();
    Job::alone(folder, &words).run()
}

/// What the summary of frame 0 says.
#[track_caller]
fn summary(folder: &Path, line: &str) -> Value {
    analyze(folder, &format!("bed.vtkhdf --frame 0 --force {line}")).with_code(0);
    let text = fs::read_to_string(folder.join("bed-analysis/summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[track_caller]
fn near(what: &str, found: &Value, exact: f64, tolerance: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{what} is {found}"));
    let error = (found - exact).abs();
    assert!(error <= tolerance, "{what}: {found} is not {exact}: off by {error:e}");
}

/// A cubic lattice of 1000 points with this spacing.
fn cubic(spacing: f64) -> Vec<[f64; 3]> {
    (0..1000).map(|k| [k % 10, k / 10 % 10, k / 100].map(|c| R + spacing * c as f64)).collect()
}

/// A face-centred cubic lattice, 10 layers of each kind, whose neighbours are `spacing` apart.
fn face_centred(spacing: f64) -> Vec<[f64; 3]> {
    (0..1000)
        .map(|k| [k % 10, k / 10 % 10, k / 100])
        .filter(|c| c.iter().sum::<usize>() % 2 == 0)
        .map(|c| c.map(|c| R + spacing / 2f64.sqrt() * c as f64))
        .collect()
}

#[test]
fn lattices_fill_what_they_fill_to_1e_9() {
    let walls = "container = { box = { min = [0, 0, 0], max = [1, 1, inf] } }";
    let folder = bed(&cubic(2.0 * R), walls);
    for region in ["--whole", "--box 0,0,0,1,1,1", "--box 0.03,0.04,0.05,0.93,0.94,0.95"] {
        let found = summary(folder.path(), region);
        near(region, &found["rows"][0]["volume_fraction"], PI / 6.0, 1e-9);
        near(region, &found["rows"][0]["overlap_fraction"], 0.0, 1e-9);
    }
    let found = summary(folder.path(), "");
    // The paper counts cells whose centre is covered: of a sphere on a corner of cells with 5 cells to a
    // radius, 552.
    near("paper", &found["rows"][0]["paper_count_in_unit_cube"], 0.552, 1e-12);
    let heights = found["height_profile"].as_array().unwrap();
    for pair in heights {
        let (height, porosity) = (pair[0].as_f64().unwrap(), &pair[1]);
        let from_centre = height % 0.1 - R;
        near("porosity over height", porosity, 1.0 - PI * (R * R - from_centre.powi(2)) / 0.01, 1e-8);
    }

    let folder = bed(&face_centred(2.0 * R), "");
    let cell = 2.0 * 2f64.sqrt() * R;
    for shift in [0.09, 0.1234] {
        let [low, high] = [shift, shift + 2.0 * cell];
        let found = summary(folder.path(), &format!("--box {low},{low},{low},{high},{high},{high}"));
        near("fcc", &found["rows"][0]["volume_fraction"], PI / 18f64.sqrt(), 1e-9);
    }
}

#[test]
fn two_overlapping_spheres_in_a_box_and_a_cylinder_are_exact() {
    let d = 0.06;
    let folder = bed(&[[0.3, 0.3, 0.3], [0.3, 0.3 + d, 0.3]], "");
    let sphere = 4.0 / 3.0 * PI * R.powi(3);
    let lens = PI * (4.0 * R + d) * (2.0 * R - d).powi(2) / 12.0;
    // All, a half along the line of the centres, a quarter; and one of the two mirror images.
    for (region, share) in [
        ("0,0,0,1,1,1", 1.0),
        ("0.3,0,0,1,1,1", 0.5),
        ("0.3,0,0.3,1,1,1", 0.25),
        ("0,0.33,0,1,1,1", 0.5),
        ("0.3,0.33,0,1,1,0.3", 0.125),
    ] {
        let found = summary(folder.path(), &format!("--box {region}"));
        let volume = &found["region_volume"].as_f64().unwrap();
        near(region, &found["rows"][0]["volume_fraction"], share * (2.0 * sphere - lens) / volume, 1e-9);
    }
    let found = summary(folder.path(), "--box 0,0,0,1,1,1");
    near("overlap", &found["rows"][0]["overlap_fraction"], lens, 1e-9);
    let found = summary(folder.path(), "--cylinder 0.3,0.33,0.2,0.3,0.5");
    let volume = PI * 0.04 * 0.2;
    near("cylinder", &found["rows"][0]["volume_fraction"], (2.0 * sphere - lens) / 2.0 / volume, 1e-9);
    assert_eq!(found["rows"][0]["contacts"], 1);
    near("overlap", &found["rows"][0]["largest_overlap"], 2.0 * R - d, 1e-12);
    // F_0 exp(kappa overlap) (1 + e^2)/2 at rest.
    near("force", &found["rows"][0]["largest_force"], 10.0 * (150.0 * (2.0 * R - d)).exp() * 0.58, 1e-6);
}

#[test]
fn spheres_of_lattices_touch_6_and_12_others_and_g_peaks_at_their_distance() {
    for (x, neighbours, inner) in [(cubic(1.999 * R), 6, 512), (face_centred(1.999 * R), 12, 256)] {
        let folder = bed(&x, "");
        let found = summary(folder.path(), "");
        let histogram = found["coordination"].as_array().unwrap();
        assert_eq!(histogram.len(), neighbours + 1);
        assert_eq!(histogram[neighbours], inner);
        // Nothing holds a free cubic block: corners have 3 contacts, and without them the edges have.
        if neighbours == 6 {
            assert_eq!(found["rows"][0]["rattlers"], 1000);
        }
        let g = found["radial_distribution"].as_array().unwrap();
        assert!(folder.path().join("bed-analysis/rdf.svg").exists());
        let first = g.iter().find(|pair| pair[1].as_f64() > Some(0.0)).unwrap();
        near("first peak", &first[0], 1.999 * R, R / 20.0);
        let highest = g.iter().map(|pair| pair[1].as_f64().unwrap()).fold(0.0, f64::max);
        near("first peak is the highest", &first[1], highest, 0.0);
    }
}

#[test]
fn a_folder_holds_tables_figures_and_a_page_that_needs_no_network() {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    Job::alone(folder.path(), &[&scene, "-q", "--set", "t_end=0.5", "--set", "output.energy=true"])
        .run()
        .with_code(0);
    let said = analyze(folder.path(), "quick.vtkhdf --frame all").with_code(0);
    for part in ["volume fraction of the union", "the paper's count", "rattlers", "bed height", "t = 0.5 s"] {
        assert!(said.stdout.contains(part), "nothing of {part:?} in\n{}", said.stdout);
    }
    let at = |name: &str| folder.path().join("quick-analysis").join(name);
    let text = |name: &str| fs::read_to_string(at(name)).unwrap_or_else(|why| panic!("{name}: {why}"));
    let rows = |name: &str| text(name).lines().count() - 1;
    assert_eq!((rows("frames.csv"), rows("series.csv")), (26, 26));
    assert!(text("series.csv").starts_with("time,kinetic_energy,potential_energy,bed_height"));
    let contacts: Value = serde_json::from_str(&text("summary.json")).unwrap();
    let last = &contacts["rows"][25];
    assert_eq!(
        rows("contacts.csv") as u64,
        last["contacts"].as_u64().unwrap() + last["wall_contacts"].as_u64().unwrap()
    );
    let page = text("report.html");
    for figure in ["height", "walls", "coordination", "overlaps", "forces", "fraction", "energies", "steps"] {
        let svg = text(&format!("{figure}.svg"));
        roxmltree::Document::parse(&svg).unwrap_or_else(|why| panic!("{figure}.svg: {why}"));
        assert!(page.contains(svg.trim()), "{figure}.svg is not on the page");
    }
    // The region is too small for two centres to be a diameter apart in it.
    assert!(!at("rdf.svg").exists());
    // Nothing is loaded: the only addresses are names of XML.
    for part in ["<script", "<link", "<img", "src=", "href=", "url(http", "@import"] {
        assert!(!page.contains(part), "{part} in the page");
    }
    for part in ["</html>", "the bed from the front", "rhs_evaluations", "stiffness_exponent = 150"] {
        assert!(page.contains(part), "nothing of {part:?} in the page");
    }
}

#[test]
fn mistakes_are_told_in_one_line() {
    let folder = bed(&[[0.3, 0.3, 0.3]], "");
    fs::create_dir(folder.path().join("bed-analysis")).unwrap();
    fs::write(folder.path().join("bed-analysis/mine.txt"), "precious").unwrap();
    let refused = |line: &str, parts: &[&str]| {
        analyze(folder.path(), line).with_code(2).only_error(parts);
    };
    refused("bed.vtkhdf", &["--output bed-analysis", "not empty", "--force"]);
    refused("bed.vtkhdf -o bed.csv", &["--output bed.csv", "name of a folder"]);
    refused("bed.vtkhdf -o a --frame 7", &["--frame 7", "0 to 1"]);
    refused("bed.vtkhdf -o a --box 0,0,0,1,1", &["--box", "6 finite numbers"]);
    refused("bed.vtkhdf -o a --cylinder 0,0,-1,0,1", &["--cylinder", "greater than 0"]);
    refused("bed.vtkhdf -o a --whole --box 0,0,0,1,1,1", &["--whole", "--box"]);
    refused("none.vtkhdf -o a", &["none.vtkhdf", "no such file"]);
    refused("bed.toml -o a", &["bed.toml", "HDF5"]);
    assert!(!folder.path().join("a").exists());
    // One sphere alone is a bed of its own.
    let said = analyze(folder.path(), "bed.vtkhdf -o a").with_code(0);
    let exact = PI / 6.0;
    assert!(said.stdout.contains(&format!("{exact:.6}")), "{}", said.stdout);
}
