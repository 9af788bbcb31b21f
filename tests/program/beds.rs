//! From what a user knows to a bed at rest, through the real program: `init` with three options, at any size.

use crate::mpirun::Job;
use serde_json::Value;
use std::fs;
use tempfile::TempDir;

/// Number of spheres of a bed, and the side of its box in radii.
const BED: (u32, f64) = if cfg!(feature = "long-tests") { (2000, 30.0) } else { (150, 10.0) };

/// Settles a bed of spheres of the radius `r` (m) with contacts as `init` gives them; returns the largest
/// share of the radius that is pressed in at rest.
fn settled(r: f64) -> f64 {
    let folder = TempDir::new().unwrap();
    let (count, side) = (BED.0.to_string(), r * BED.1);
    let (radius, sides) = (format!("{r:?}"), format!("{side:?},{side:?}"));
    let options = ["init", "bed.toml", "--radius", &radius, "--count", &count, "--box", &sides];
    Job::alone(folder.path(), &options).run().with_code(0);
    let plan = Job::alone(folder.path(), &["bed.toml", "--dry-run"]).run().with_code(0);
    assert!(plan.stdout.contains("contact.overlap = 0.05: the bed, "), "{}", plan.stdout);
    assert!(!plan.stderr.contains("warning"), "{}", plan.stderr);
    let run = Job::alone(folder.path(), &["bed.toml"]).within(900).run().with_code(0);
    assert!(run.stdout.contains("at rest"), "{}", run.stdout);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
    Job::alone(folder.path(), &["analyze", "bed.vtkhdf", "-o", "a", "--whole"]).run().with_code(0);
    let measures = fs::read_to_string(folder.path().join("a/summary.json")).unwrap();
    let measures: Value = serde_json::from_str(&measures).unwrap();
    println!("radius {r} m: {}", run.line("right-hand sides"));
    println!("  {}\n  {}", run.line("wall time"), run.line("largest overlap"));
    measures["rows"][0]["largest_overlap"].as_f64().unwrap() / r
}

#[test]
fn beds_of_powder_beads_and_boulders_settle_and_are_pressed_in_as_far_as_was_asked() {
    for r in [5e-6, 0.5e-3, 0.5] {
        let share = settled(r);
        println!("  pressed in at rest by {share} of the radius");
        assert!((share / 0.05 - 1.0).abs() < 0.2, "{r}: {share}");
    }
}

#[test]
fn what_was_recorded_gives_the_same_run_without_the_key() {
    let folder = TempDir::new().unwrap();
    let options = ["init", "a.toml", "--radius", "1e-3", "--count", "30", "--overlap", "0.1"];
    Job::alone(folder.path(), &options).run().with_code(0);
    Job::alone(folder.path(), &["a.toml", "-q", "--set", "t_end=0.05"]).run().with_code(0);
    let file = crate::results::Results::open(&folder.path().join("a.vtkhdf"));
    let recorded = file.text("scene");
    assert!(recorded.contains("stiffness_exponent") && !recorded.contains("overlap ="), "{recorded}");
    fs::write(folder.path().join("b.toml"), recorded).unwrap();
    Job::alone(folder.path(), &["b.toml", "-q", "-o", "b.vtkhdf"]).run().with_code(0);
    let again = crate::results::Results::open(&folder.path().join("b.vtkhdf"));
    assert_eq!(file.bits("VTKHDF/Points"), again.bits("VTKHDF/Points"));
}

#[test]
fn mistakes_of_init_name_the_option() {
    let folder = TempDir::new().unwrap();
    for (options, parts) in [
        ("--radius 0", ["--radius", "greater than 0"]),
        ("--radius one", ["--radius", "must be a number"]),
        ("--radius inf", ["--radius", "finite"]),
        ("--density -1", ["--density", "greater than 0"]),
        ("--friction -0.1", ["--friction", "0 or more"]),
        ("--overlap 5", ["--overlap", "less than 1"]),
        ("--overlap 0", ["--overlap", "greater than 0"]),
        ("--box 0.1", ["--box", "two numbers"]),
        ("--box 0.1,0", ["--box", "two numbers greater than 0"]),
        ("--box 1e-4,1 --radius 1e-3", ["--box", "0.0025 m or more"]),
        ("--count 0", ["--count", "1..=1000000000"]),
        ("--count many", ["--count", "invalid digit"]),
    ] {
        let words: Vec<&str> = ["init", "no.toml"].into_iter().chain(options.split(' ')).collect();
        let ended = Job::alone(folder.path(), &words).run().with_code(2);
        assert!(parts.iter().all(|part| ended.stderr.contains(part)), "{options}: {}", ended.stderr);
        assert!(!folder.path().join("no.toml").exists());
    }
}
