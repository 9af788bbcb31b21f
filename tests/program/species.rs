//! Species under mpirun: the same bits on any ranks and threads, what is recorded, and what is told.

use crate::mpirun::Job;
use crate::results::{Results, assert_same_anywhere, assert_same_bits, results_on};
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;

const SCENE: &str = "
t_end = 0.2
gravity = [0.0, 0.0, -9.81]
particles = { density = 2000.0, species_by = 'volume', grid = { count = 200, bottom = 0.01, seed = 5 } }
friction = { law = 'history', coefficient = 0.3 }
output.interval = 0.02
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 200.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.06 }
[container]
box = { min = [0.0, 0.0, 0.0], max = [0.8, 0.8, inf] }
[[species]]
name = 'coarse'
share = 0.4
radius = { uniform = [0.06, 0.08] }
[[species]]
name = 'fine'
share = 0.6
density = 1500.0
radius = { table = 'sieve.csv' }
";

/// A folder with the scene and the sieve curve of one of its species.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    fs::write(folder.path().join("sieve.csv"), "radius,share\n0.03,0\n0.04,0.7\n0.05,1\n").unwrap();
    folder
}

static WHOLE: LazyLock<Results> = LazyLock::new(|| results_on(folder().path(), 0, "1"));

#[test]
fn ranks_and_threads_do_not_matter_to_drawn_sizes() {
    let lowest = WHOLE.lowest();
    assert!(lowest < 0.06, "they have reached the floor: {lowest} m");
    assert_same_anywhere(&WHOLE, folder().path());
}

#[test]
fn the_file_has_the_sizes_asked_for_and_their_means() {
    let [radii, masses, species] =
        ["radius", "mass", "species"].map(|name| WHOLE.reals(&format!("VTKHDF/PointData/{name}")));
    assert_eq!([radii.len(), masses.len(), species.len()], [200; 3]);
    let volume = |k: f64| -> f64 {
        radii.iter().zip(&species).filter(|(_, of)| **of == k).map(|(r, _)| r.powi(3)).sum()
    };
    let share = volume(0.0) / (volume(0.0) + volume(1.0));
    // Half a coarse sphere has 0.004 of the volume.
    assert!((share - 0.4).abs() < 0.004, "{share}");
    let fine: Vec<f64> =
        radii.iter().zip(&species).filter(|(_, of)| **of == 1.0).map(|(r, _)| r.powi(3)).collect();
    let below: f64 =
        fine.iter().filter(|cube| **cube < 0.04f64.powi(3)).sum::<f64>() / fine.iter().sum::<f64>();
    assert!((below - 0.7).abs() < 0.01, "{below}");
    for ((r, mass), of) in radii.iter().zip(&masses).zip(&species) {
        let density = if *of == 0.0 { 2000.0 } else { 1500.0 };
        assert!((mass / (density * 4.0 / 3.0 * std::f64::consts::PI * r.powi(3)) - 1.0).abs() < 1e-14);
    }
    let scene = WHOLE.scene();
    for (key, numbers) in [("radius", &radii), ("mass", &masses)] {
        let typical = scene["particles"][key].as_float().unwrap();
        let mean = numbers.iter().sum::<f64>() / 200.0;
        assert!((typical / mean - 1.0).abs() < 1e-13, "{key}: {typical} {mean}");
    }
}

#[test]
fn the_recorded_scene_gives_the_same_run_without_its_table() {
    let folder = TempDir::new().unwrap();
    let text = toml::to_string(&WHOLE.scene()).unwrap();
    assert!(text.contains("points") && text.contains("sieve.csv"), "{text}");
    fs::write(folder.path().join("again.toml"), text).unwrap();
    // It names the output file, and the scene in there is the same.
    Job::alone(folder.path(), &["again.toml", "-q", "--threads", "1"]).run().with_code(0);
    let again = Results::open(&folder.path().join("scene.vtkhdf"));
    assert_same_bits(&WHOLE, &again, "from the recorded scene");
}

#[test]
fn a_dry_run_tells_what_is_asked_and_what_is_drawn() {
    let folder = folder();
    let ended = Job::on(2, folder.path(), &["scene.toml", "--dry-run"]).run().with_code(0);
    for part in ["fine", "coarse", "n d10", "m d90", "asked", "drawn", "the drawn curves are within"] {
        assert!(ended.stdout.contains(part), "{part}: {}", ended.stdout);
    }
    let own = ended.stdout.lines().skip_while(|line| !line.starts_with("sizes"));
    let own: Vec<&str> = own.take_while(|line| !line.starts_with("time")).collect();
    // Quantiles of two species and of all, and bars of ten bins.
    assert_eq!(own.len(), 20, "{}", ended.stdout);
    assert!(own.iter().all(|line| line.chars().count() <= 110), "{}", ended.stdout);
}

#[test]
fn mistakes_end_all_ranks_with_one_message() {
    let folder = folder();
    fs::write(folder.path().join("sieve.csv"), "radius,share\n0.03,0\n0.04,0.7\n0.05,0.6\n").unwrap();
    let ended = Job::on(2, folder.path(), &["scene.toml"]).run().with_code(2);
    ended.only_error(&["sieve.csv:4: share = 0.6 falls"]);
    let ended = Job::on(2, folder.path(), &["scene.toml", "--set", "species=[]"]).run().with_code(2);
    ended.only_error(&["particles.species_by needs [[species]]"]);
    fs::remove_file(folder.path().join("sieve.csv")).unwrap();
    let ended = Job::on(2, folder.path(), &["scene.toml"]).run().with_code(2);
    ended.only_error(&["sieve.csv: cannot read the sieve curve"]);
}

#[test]
fn the_output_does_not_overwrite_a_sieve_curve() {
    let folder = folder();
    let ended = Job::alone(folder.path(), &["scene.toml", "-o", "sieve.csv", "--force"]).run().with_code(2);
    ended.only_error(&["output.file = \"sieve.csv\" is the sieve curve of a species itself"]);
    assert!(fs::read_to_string(folder.path().join("sieve.csv")).unwrap().starts_with("radius,share"));
}

#[test]
fn an_ensemble_has_the_spheres_of_its_seeds() {
    let folder = folder();
    let short = ["--set", "t_end=0.1", "-q"];
    for seed in ["1", "2"] {
        let (set, file) = (format!("particles.grid.seed={seed}"), format!("scene-{seed}.vtkhdf"));
        Job::alone(folder.path(), &["scene.toml", "--set", &set, "-o", &file]).and(&short).run().with_code(0);
    }
    let radii = |seed: &str| {
        let file = folder.path().join(format!("scene-{seed}.vtkhdf"));
        Results::open(&file).reals("VTKHDF/PointData/radius")
    };
    let sorted = |mut radii: Vec<f64>| {
        radii.sort_by(f64::total_cmp);
        radii
    };
    assert_ne!(radii("1"), radii("2"));
    assert_eq!(sorted(radii("1")), sorted(radii("2")));
    Job::alone(folder.path(), &["ensemble", "scene.toml", "--seeds", "2", "-o", "direct"])
        .and(&short)
        .run()
        .with_code(0);
    let gather = ["ensemble", "--gather", "scene-1.vtkhdf", "scene-2.vtkhdf", "-o", "gathered", "-q"];
    Job::alone(folder.path(), &gather).run().with_code(0);
    let table = |name: &str| fs::read_to_string(folder.path().join(name).join("runs.csv")).unwrap();
    // One case of two runs, measured alike.
    assert_eq!(table("direct").lines().count(), 3);
    assert_eq!(table("direct"), table("gathered"));
    assert!(Path::new(&folder.path().join("direct/summary.csv")).exists());
}
