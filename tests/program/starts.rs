//! Starts of the real program: the same on any ranks and threads, from the end of another run, and told in
//! plan and summary.

use crate::mpirun::Job;
use crate::results::{Results, assert_same_anywhere, results_on};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const REST: &str = "
t_end = 0.02
gravity = [0.0, 0.0, -9.81]
container.box = { min = [0.0, 0.0, 0.0], max = [1.0, 1.0, inf] }
friction = { law = 'history', coefficient = 0.3 }
output.interval = 0.01
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
            dissipation_focusing = 10.0, interaction_distance = 0.1 }
";

fn write(folder: &Path, name: &str, particles: &str) {
    fs::write(folder.join(name), format!("particles = {{ {particles} }}\n{REST}")).unwrap();
}

fn folder(particles: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    write(folder.path(), "scene.toml", particles);
    folder
}

/// 40 spheres at places that overlap deeply, two of them in one place.
fn heap() -> String {
    let place = |k: usize, prime: usize| 0.15 + 0.7 * ((k * prime) % 97) as f64 / 97.0;
    let row = |k: usize| format!("{},{},{}\n", place(k, 31), place(k, 43), place(k, 59));
    "x,y,z\n".to_owned() + &(0..39).map(row).collect::<String>() + &row(0)
}

#[test]
fn a_start_has_the_same_bits_on_any_ranks_and_threads() {
    for particles in [
        "radius = 0.1, mass = 1.0, random = { count = 200, fraction = 0.45, seed = 3 }",
        "radius = 0.1, mass = 1.0, push_apart = true, file = 'heap.csv'",
    ] {
        let folder = folder(particles);
        fs::write(folder.path().join("heap.csv"), heap()).unwrap();
        assert_same_anywhere(&results_on(folder.path(), 0, "1"), folder.path());
    }
}

#[test]
fn a_run_starts_from_the_last_frame_of_another_one() {
    let folder = folder("density = 2000.0, file = 'two.csv'");
    let rows = "x,y,z,vx,vy,vz,avx,avy,avz,radius,species\n0.3,0.5,0.1,0.5,0,0,1,2,3,0.1,coarse\n\
                0.7,0.5,0.5,0,0.1,0,0,0,-4,0.04,fine\n";
    fs::write(folder.path().join("two.csv"), rows).unwrap();
    Job::alone(folder.path(), &["scene.toml", "-q"]).run().with_code(0);
    write(folder.path(), "next.toml", "run = 'scene.vtkhdf'");
    Job::on(2, folder.path(), &["next.toml", "-q"]).run().with_code(0);
    let (first, next) = (folder.path().join("scene.vtkhdf"), folder.path().join("next.vtkhdf"));
    let (first, next) = (Results::open(&first), Results::open(&next));
    for name in ["Points", "PointData/velocity", "PointData/angular_velocity"] {
        assert_eq!(first.vectors(name, 2), next.vectors(name, 0), "{name}");
        assert_ne!(first.vectors(name, 2), first.vectors(name, 0), "{name} has changed");
    }
    for name in ["radius", "mass", "species"] {
        let name = format!("VTKHDF/PointData/{name}");
        assert_eq!(first.reals(&name), next.reals(&name), "{name}");
    }
    // The scene that is recorded has the sizes too, and gives the same run again.
    let recorded = next.scene();
    assert_eq!(recorded["particles"]["run"].as_str(), Some("scene.vtkhdf"));
    fs::write(folder.path().join("again.toml"), recorded.to_string()).unwrap();
    let again = ["again.toml", "-q", "-o", "again.vtkhdf"];
    Job::alone(folder.path(), &again).run().with_code(0);
    let again = Results::open(&folder.path().join("again.vtkhdf"));
    for name in ["Points", "PointData/velocity", "PointData/angular_velocity"] {
        assert_eq!(again.vectors(name, 2), next.vectors(name, 2), "{name}");
    }

    let refused = |arguments: &[&str], parts: &[&str]| {
        let out = Job::on(2, folder.path(), arguments).run().with_code(2);
        for part in parts {
            assert!(out.stderr.contains(part), "{part}: {}", out.stderr);
        }
    };
    let other = ["next.toml", "--set", "particles.radius=0.2", "-o", "a.vtkhdf"];
    refused(&other, &["particles.radius = 0.2 m contradicts particles.run", "must be left out"]);
    refused(&["next.toml", "--set", "particles.density=1", "-o", "a.vtkhdf"], &["density must be left out"]);
    refused(&["next.toml", "-o", "scene.vtkhdf", "--force"], &["is particles.run itself"]);
    // A run that was killed before its first frame was complete.
    // Copies, since programs that other tests start hold the locks of all files that this process has open.
    let copied = |from: &str, to: &str| {
        fs::copy(folder.path().join(from), folder.path().join(to)).unwrap();
    };
    copied("scene.vtkhdf", "changed.vtkhdf");
    let file = hdf5::File::open_rw(folder.path().join("changed.vtkhdf")).unwrap();
    file.group("VTKHDF/Steps").unwrap().attr("NSteps").unwrap().write_scalar(&0i64).unwrap();
    drop(file);
    copied("changed.vtkhdf", "begun.vtkhdf");
    let begun = ["next.toml", "--set", "particles.run=begun.vtkhdf", "-o", "a.vtkhdf"];
    refused(&begun, &["begun.vtkhdf: it holds no complete frame yet"]);
}

#[test]
fn what_is_pushed_apart_is_told_in_the_plan_and_in_the_summary() {
    let folder = folder("radius = 0.1, mass = 1.0, file = 'heap.csv'");
    fs::write(folder.path().join("heap.csv"), heap()).unwrap();
    let refused = Job::alone(folder.path(), &["scene.toml"]).run().with_code(2);
    assert!(refused.stderr.contains("particles 0 and 39 (rows 1 and 40"), "{}", refused.stderr);
    assert!(refused.stderr.contains("or particles.push_apart = true parts them"), "{}", refused.stderr);
    let parted = ["scene.toml", "-q", "--set", "particles.push_apart=true"];
    let plan = Job::alone(folder.path(), &parted).and(&["--dry-run"]).run().with_code(0);
    let summary = Job::alone(folder.path(), &parted).run().with_code(0);
    for out in [&plan, &summary] {
        let told =
            out.stdout.lines().find(|line| line.trim_start().starts_with("start ")).expect(&out.stdout);
        // Two spheres in one place overlap by 2 radii.
        for part in ["of 40 spheres overlapped, by up to 0.2 m; pushed apart in ", "the furthest by 0."] {
            assert!(told.contains(part), "{told}");
        }
        assert!(!out.stderr.contains("warning: at the start spheres overlap"), "{}", out.stderr);
    }
    let recorded = Results::open(&folder.path().join("scene.vtkhdf")).scene();
    assert_eq!(recorded["particles"]["push_apart"].as_bool(), Some(true));
}

#[test]
fn an_ensemble_draws_random_starts_by_their_seeds() {
    let folder = folder("radius = 0.1, mass = 1.0, random = { count = 20 }");
    let words = ["ensemble", "scene.toml", "--seeds", "2", "-o", "beds"];
    Job::alone(folder.path(), &words).run().with_code(0);
    let runs = fs::read_to_string(folder.path().join("beds/runs.csv")).unwrap();
    assert!(runs.lines().count() > 2, "{runs}");
    for seed in ["1", "2"] {
        let set = format!("particles.random.seed={seed}");
        let name = format!("bed-{seed}.vtkhdf");
        Job::alone(folder.path(), &["scene.toml", "-q", "--set", &set, "-o", &name]).run().with_code(0);
    }
    let gather = ["ensemble", "--gather", "bed-1.vtkhdf", "bed-2.vtkhdf", "-o", "gathered"];
    Job::alone(folder.path(), &gather).run().with_code(0);
    assert!(folder.path().join("gathered/summary.csv").exists());
}
