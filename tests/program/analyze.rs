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
    // F_0 exp(kappa overlap) (1 + e^2)/2 at rest. Without gravity the mean push is what pushes are held against.
    let push = 10.0 * (150.0 * (2.0 * R - d)).exp() * 0.58;
    assert_eq!((&found["rows"][0]["contacts"], &found["rows"][0]["overlaps"]), (&1.into(), &1.into()));
    near("overlap", &found["rows"][0]["largest_overlap"], 2.0 * R - d, 1e-12);
    near("force", &found["rows"][0]["largest_force"], push, 1e-6);
    near("reference", &found["reference_force"], push, 1e-6);
    near("threshold", &found["rows"][0]["contact_threshold"], 0.1 * push, 1e-7);
    assert_eq!(found["reference"], "the mean push");
}

/// The rows of a table that `analyze` wrote into `bed-analysis`, without its head.
fn table(folder: &Path, name: &str) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(folder.join("bed-analysis").join(name)).unwrap();
    reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
}

/// Three spheres on a floor between three planes, and a fourth one that they carry: its scene and its start.
///
/// The planes keep the lower three so close that they push each other, too.
const HEAP: [&str; 2] = [
    "t_end = 20.0
     gravity = [0.0, 0.0, -9.81]
     particles = { radius = 0.1, mass = 1.0, file = 'heap.csv' }
     contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
                 dissipation_focusing = 10.0, interaction_distance = 0.1 }
     friction = { coefficient = 0.2, regularization_velocity = 0.01 }
     container.wall = [
       { normal = [0.0, 0.0, -1.0] },
       { point = [0.0, -0.15773502691896257, 0.0], normal = [0.0, -1.0, 0.0] },
       { point = [0.13660254037844388, 0.0788675134594812, 0.0], normal = [0.8660254037844386, 0.5, 0.0] },
       { point = [-0.13660254037844388, 0.0788675134594812, 0.0], normal = [-0.8660254037844386, 0.5, 0.0] },
     ]
     output.interval = 2.0",
    "x,y,z
     0,0.11547005383792516,0.1
     -0.1,-0.05773502691896258,0.1
     0.1,-0.05773502691896258,0.1
     0,0,0.2632993161855452",
];

#[test]
fn spheres_that_carry_another_one_across_gaps_are_in_contact_with_it() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("bed.toml"), HEAP[0]).unwrap();
    fs::write(folder.path().join("heap.csv"), HEAP[1].replace(' ', "")).unwrap();
    Job::alone(folder.path(), &["bed.toml", "-q"]).run().with_code(0);
    let found = |options: &str| {
        let said = analyze(folder.path(), &format!("bed.vtkhdf --force {options}")).with_code(0).stdout;
        let text = fs::read_to_string(folder.path().join("bed-analysis/summary.json")).unwrap();
        (said, serde_json::from_str::<Value>(&text).unwrap())
    };
    // No two spheres overlap, and yet the upper one lies still. It weighs on three, which push each other
    // apart with 2.78 N: six contacts, at gaps of 2.43 and 4.90 mm.
    let (said, of) = found("");
    let row = &of["rows"][0];
    assert_eq!((&row["contacts"], &row["wall_contacts"]), (&6.into(), &9.into()));
    assert_eq!((&row["overlaps"], &row["overlap_coordination"]), (&0.into(), &0.0.into()));
    assert_eq!((&row["rattlers"], &row["mean_coordination"]), (&0.into(), &3.0.into()));
    near("mean force", &row["mean_force"], (4.03 + 2.78) / 2.0, 0.01);
    near("threshold", &row["contact_threshold"], 0.981, 1e-12);
    assert_eq!((&of["share"], &of["reference"]), (&0.1.into(), &"the weight of a particle".into()));
    near("reference", &of["reference_force"], 9.81, 1e-12);
    for part in ["0.981 N, 0.1 of the weight of a particle", "0 pairs, 9 at walls", "N on container.wall[3]"]
    {
        assert!(said.contains(part), "nothing of {part:?} in\n{said}");
    }
    // The pushes on the upper sphere bear its weight: 3 F cos = m g, where the lower ones are `side` apart,
    // and side/sqrt(3) from the axis. Creep is 1e-4 of it.
    let contacts = table(folder.path(), "contacts.csv");
    let number = |row: &[String], column: usize| row[column].parse::<f64>().unwrap();
    let gap = |i: &str, j: &str| -number(contacts.iter().find(|row| row[0] == i && row[1] == j).unwrap(), 3);
    let side = 0.2 + (gap("0", "1") + gap("0", "2") + gap("1", "2")) / 3.0;
    let lift = contacts.iter().filter(|row| row[1] == "3").map(|row| {
        let d: f64 = 0.2 - number(row, 3);
        number(row, 4) * (d * d - side * side / 3.0).sqrt() / d
    });
    let lift = lift.sum::<f64>();
    assert!((lift - 9.81).abs() < 2e-3 * 9.81, "{lift} N lift the upper sphere");
    // The floor bears four weights, and walls go by their names.
    let walls = table(folder.path(), "wall-forces.csv");
    let names: Vec<&str> = walls.iter().map(|row| &row[0][..]).collect();
    assert_eq!(names, [0, 1, 2, 3].map(|k| format!("container.wall[{k}]")));
    assert!((number(&walls[0], 1) - 4.0 * 9.81).abs() < 2e-3 * 9.81, "{walls:?}");
    for (k, wall) in walls.iter().enumerate() {
        let listed = contacts.iter().filter(|row| row[2] == wall[0]).map(|row| number(row, 4)).sum::<f64>();
        // The upper sphere is 58 mm from the side walls: it pushes them with 5.8 exp(-8.7) N.
        let faint = if k == 0 { 0.0 } else { 5.8 * (-150.0 * 0.0577f64).exp() };
        assert!((number(wall, 1) - listed - faint).abs() < 1e-4, "{wall:?}, {listed} N are listed");
    }
    // Of those that bear more than 0.3 weights, the upper sphere has all.
    let (said, of) = found("--share 0.3");
    let row = &of["rows"][0];
    assert_eq!((&row["contacts"], &row["mean_coordination"]), (&3.into(), &1.5.into()));
    assert_eq!((&row["rattlers"], &of["share"]), (&0.into(), &0.3.into()));
    near("mean force", &row["mean_force"], 4.03, 0.01);
    assert!(said.contains("2.943 N, 0.3 of the weight of a particle"), "{said}");
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
    every_push_is_accounted_for(folder.path(), "quick");
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

/// Compares contacts.csv and wall-forces.csv of a run of `quick.toml` with forces from the exported state.
fn every_push_is_accounted_for(folder: &Path, run: &str) {
    let line = format!("export {run}.vtkhdf --to csv -o state.csv");
    Job::alone(folder, &line.split(' ').collect::<Vec<_>>()).run().with_code(0);
    let read = |path: &Path| -> Vec<csv::StringRecord> {
        csv::Reader::from_path(path).unwrap().records().map(Result::unwrap).collect()
    };
    let number = |text: &str| text.parse::<f64>().unwrap();
    let state: Vec<Vec<f64>> =
        read(&folder.join("state.csv")).iter().map(|row| row.iter().map(number).collect()).collect();
    // Eqs. (2.1) and (2.4): F_0 = 10 N, kappa = 150 1/m, e = 0.4, psi = 10 s/m, r = l_max = 0.1 m.
    let force = |gap: f64, closing: f64| {
        10.0 * (-150.0 * gap).exp() * (0.16 + 0.84 / (1.0 + (-20.0 * closing).exp()))
    };
    let mut pushes = std::collections::BTreeMap::new();
    let mut on_walls = std::collections::BTreeMap::<String, f64>::new();
    for (i, a) in state.iter().enumerate() {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            for (at, inward) in [(0.0, 1.0), (0.75, -1.0)] {
                let gap = (a[axis] - at) * inward - 0.1;
                if gap <= 0.1 && !(name == "z" && at > 0.0) {
                    let push = force(gap, -a[3 + axis] * inward);
                    let wall = format!("{name} = {at} m");
                    *on_walls.entry(wall.clone()).or_default() += push;
                    pushes.insert((i.to_string(), String::new(), wall), push);
                }
            }
        }
        for (j, b) in state.iter().enumerate().skip(i + 1) {
            let apart = [0, 1, 2].map(|k| a[k] - b[k]);
            let d = apart.iter().map(|x| x * x).sum::<f64>().sqrt();
            if d <= 0.3 {
                let closing = -(0..3).map(|k| apart[k] * (a[3 + k] - b[3 + k])).sum::<f64>() / d;
                pushes.insert((i.to_string(), j.to_string(), String::new()), force(d - 0.2, closing));
            }
        }
    }
    let analysis = folder.join(format!("{run}-analysis"));
    for row in &read(&analysis.join("wall-forces.csv")) {
        let (total, exact) = (number(&row[1]), on_walls.remove(&row[0]).unwrap_or(0.0));
        assert!((total - exact).abs() <= 1e-9 * exact, "{row:?}: {exact} N push the wall");
    }
    assert!(on_walls.is_empty(), "no forces on {on_walls:?}");
    pushes.retain(|_, push| *push > 0.981);
    for row in &read(&analysis.join("contacts.csv")) {
        let key = [0, 1, 2].map(|k| row[k].to_owned());
        let exact = pushes.remove(&key.clone().into()).unwrap_or_else(|| panic!("{row:?} is no contact"));
        assert!((number(&row[4]) - exact).abs() <= 1e-9 * exact, "{row:?}: {exact} N");
    }
    assert!(pushes.is_empty(), "not in contacts.csv: {pushes:?}");
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
    refused("bed.vtkhdf -o a --share -0.1", &["--share", "0 or more"]);
    refused("bed.vtkhdf -o a --share some", &["--share", "a number"]);
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
