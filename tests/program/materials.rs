//! Materials under mpirun: the same bits on any ranks and threads and through a resume; what the file, the
//! plan and the exports say of them.

use crate::mpirun::Job;
use crate::results::{Results, assert_goes_on_elsewhere, assert_same_anywhere, results_on};
use rand::{RngExt, SeedableRng};
use std::fmt::Write;
use std::fs;
use std::sync::LazyLock;
use tempfile::TempDir;

const SCENE: &str = "
t_end = 0.2
gravity = [0.0, 0.0, -9.81]
particles = { radius = 0.05, mass = 0.5, file = 'start.csv' }
friction = { law = 'history', coefficient = 0.3 }
output = { interval = 0.005, sync = 'frame', energy = true }
checkpoint.interval = 0.02
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 200.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.06 }

[container]
box = { min = [0.0, 0.0, 0.0], max = [0.5, 0.5, inf], material = 'steel' }

[[container.wall]]
point = [0.0, 0.0, -0.02]
normal = [0.2, 0.0, -1.0]
material = 'glass'

[[material]]
name = 'glass'
restitution = 0.9
friction = 0.1
rolling = 0.002

[[material.pair]]
with = 'steel'
friction = 0.5
twisting = 0.03

[[material]]
name = 'steel'
restitution = 0.6
friction = 0.2

[[material]]
name = 'clay, wet'
restitution = 0.0
friction = 0.8
rolling = 0.2
";
const FRAMES: usize = 41;

/// A folder with the scene and 100 spheres above the floor: glass, wet clay, those of the species steel, and
/// some without a material.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    let mut text = "x,y,z,vx,vy,vz,avx,avy,avz,species,material\n".to_owned();
    for k in 0..100 {
        let mut shift = |scale: f64| scale * (2.0 * random.random::<f64>() - 1.0);
        let [x, y, z] = [k % 4, k / 4 % 4, k / 16].map(|c| 0.115 * (f64::from(c) + 0.5) + 0.02);
        let [x, y, z] = [x + shift(0.004), y + shift(0.004), z + 0.1 + shift(0.004)];
        let names = ["steel,", "sand,glass", "sand,\"clay, wet\"", "steel,(none)", "sand,"][k as usize % 5];
        let [a, b, c] = [shift(0.5), shift(0.5), shift(0.5) - z];
        writeln!(text, "{x:?},{y:?},{z:?},{a:?},{b:?},{c:?},{:?},0,1,{names}", shift(3.0)).unwrap();
    }
    fs::write(folder.path().join("start.csv"), text).unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    folder
}

static WHOLE: LazyLock<Results> = LazyLock::new(|| results_on(folder().path(), 0, "1"));

#[test]
fn ranks_and_threads_do_not_matter_to_a_bed_of_several_materials() {
    let lowest = WHOLE.lowest();
    assert!(lowest < 0.07, "the lowest have reached the floor: {lowest} m");
    assert_same_anywhere(&WHOLE, folder().path());
}

#[test]
fn a_run_of_several_materials_goes_on_where_it_was_stopped_on_other_ranks() {
    assert_goes_on_elsewhere(&WHOLE, folder().path(), 10);
}

#[test]
fn the_file_and_what_is_made_of_it_know_the_materials() {
    // Glass is 0, steel 1, clay 2, and 3 stands for none. The column wins over the species.
    let numbers = WHOLE.reals("VTKHDF/PointData/material");
    let expected: Vec<f64> = (0..100).map(|k| [1.0, 0.0, 2.0, 3.0, 3.0][k % 5]).collect();
    assert_eq!(numbers, expected);
    // The energy that is lost is what contacts dissipate.
    let column = |name: &str| WHOLE.reals(&format!("run/series/{name}"));
    let names = ["kinetic_energy", "potential_energy", "dissipated_rebound", "dissipated_friction"];
    let columns = names.map(column);
    let sum = |k: usize| columns.iter().map(|column| column[k]).sum::<f64>();
    let scale = columns[0][0] + columns[1][0];
    for k in 0..FRAMES {
        assert!((sum(k) - sum(0)).abs() < 0.02 * scale, "frame {k}: {} J of {scale} J", sum(k) - sum(0));
    }
    let folder = folder();
    Job::alone(folder.path(), &["scene.toml", "-q", "--set", "t_end=0.1"]).run().with_code(0);
    let export = ["export", "scene.vtkhdf", "--to", "csv", "-o", "end.csv"];
    Job::alone(folder.path(), &export).run().with_code(0);
    let csv = fs::read_to_string(folder.path().join("end.csv")).unwrap();
    let mut rows = csv.lines();
    assert!(rows.next().unwrap().ends_with(",species,material"));
    let ends = ["steel,steel", "sand,glass", "sand,\"clay, wet\"", "steel,(none)", "sand,(none)"];
    assert!(rows.zip(ends.iter().cycle()).all(|(row, end)| row.ends_with(end)), "{csv}");
    // It starts the next run, with the same materials.
    let again =
        ["scene.toml", "-q", "--set", "particles.file=end.csv", "--set", "t_end=0.02", "-o", "b.vtkhdf"];
    Job::alone(folder.path(), &again).run().with_code(0);
    let again = Results::open(&folder.path().join("b.vtkhdf"));
    assert_eq!(again.reals("VTKHDF/PointData/material"), expected);
    let vtp = ["export", "scene.vtkhdf", "--to", "vtp", "-o", "end.vtp"];
    Job::alone(folder.path(), &vtp).run().with_code(0);
    let vtp = fs::read_to_string(folder.path().join("end.vtp")).unwrap();
    assert!(vtp.contains("Name=\"material\"") && vtp.contains("Name=\"material_names\""));
    Job::alone(folder.path(), &["analyze", "scene.vtkhdf", "-o", "measures"]).run().with_code(0);
}

#[test]
fn a_plan_shows_what_holds_between_all_materials_and_where_it_is_from() {
    let folder = folder();
    let ended = Job::alone(folder.path(), &["scene.toml", "--dry-run"]).run();
    let text = ended.stdout.clone() + &ended.stderr;
    assert_eq!(ended.code, 0, "{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "materials 20 glass, 20 steel, 20 clay, wet, 40 (none)",
        "walls: 1 glass, 5 steel",
        "glass - steel restitution 0.735 mixed, friction 0.5 given, rolling 0 mixed, twisting 0.03 given",
        "glass - glass restitution 0.9, friction 0.1, rolling 0.002, twisting 0",
        "steel - (none) restitution 0.49 mixed, friction 0.245 mixed, rolling 0 mixed, twisting 0 mixed",
        "rolling on a [[material]] has it",
    ] {
        assert!(words.contains(part), "{part}\n{text}");
    }
}
