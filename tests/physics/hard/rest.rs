//! Long runs: beds and columns that come to rest, and what still moves in them. launch/test-long.sh runs
//! them, by the feature `long-tests`, and shows the figures that they print.

use super::judge::{Tale, run_scene};
use super::scene::Case;
use crate::common::Case as Config;
use demhybrid::domain::Solo;
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::InitialCondition;

fn tell(what: &str, scene: &Scene, start: &InitialCondition) -> Tale {
    let tale = run_scene(scene, start, &Solo);
    let counts = tale.result.as_ref().unwrap_or_else(|why| panic!("{what}: {why}"));
    println!(
        "{what}: {} steps, {} right-hand sides; kinetic {:.2e} J at the end, {:.2e} J at most; energy rose by {:.1e} J; \
         overlap {:.3} r; moved up to {:.2e} m; {:?}",
        counts.accepted,
        counts.rhs,
        tale.course.kinetic_energy,
        tale.course.largest_kinetic_energy,
        tale.course.largest_rise,
        tale.overlap / scene.particles.radius,
        tale.moved,
        tale.warnings
    );
    assert!(tale.finite, "{what}");
    tale
}

/// A hard case with other keys.
fn hard_case(name: &str, sets: &[&str]) -> Tale {
    let case = Case::read(name);
    let (_, start) = case.set_up("auto").unwrap();
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let scene = Scene::parse(name, &case.text, &sets).unwrap();
    tell(&format!("{name} {sets:?}"), &scene, &start)
}

#[test]
fn a_bed_of_27_stays_at_rest_for_a_thousand_seconds() {
    let tale = hard_case("rest-27", &["t_end=1000", "output.interval=1"]);
    assert!(tale.warnings.is_empty());
    // A tenth of what rest means for the bed of the short run, and rolling spheres move no further than to a
    // neighbour.
    assert!(tale.course.kinetic_energy < 27.0 * 1e-4, "{}", tale.course.kinetic_energy);
    assert!(tale.moved < 0.1, "{}", tale.moved);
}

#[test]
fn a_thousand_spheres_fall_as_one_column_and_come_to_rest() {
    let tale = hard_case("column-1000", &["t_end=20", "output.interval=0.05"]);
    assert!(
        tale.warnings.iter().any(|warning| warning.contains("the largest overlap is")),
        "{:?}",
        tale.warnings
    );
    assert!(!tale.warnings.iter().any(|warning| warning.contains("beyond a wall")), "{:?}", tale.warnings);
    // Nothing rises by more than the tolerance of a step allows.
    assert!(tale.course.largest_rise <= 1e-2 * tale.course.largest_kinetic_energy);
}

#[test]
fn what_still_moves_in_a_stiff_bed_is_the_tolerance_not_the_model() {
    // The paper's bed without friction at kappa = 500, where it speaks of vibrations: what is left at t = 8 s
    // with the published solver and tolerance, and with an accurate one.
    let kinetic = |method: &str, norm: &str, tolerance: f64| {
        let case = Config::config("paper/settle-basic.toml").set("contact.stiffness_exponent", 500.0);
        let case =
            case.set("solver.method", method).set("solver.norm", norm).set("solver.tolerance", tolerance);
        let (scene, start) = case.build();
        tell(&format!("kappa = 500, {method}, norm {norm}, {tolerance}"), &scene, &start)
            .course
            .kinetic_energy
    };
    let published = kinetic("merson", "paper", 0.1);
    let tighter = kinetic("merson", "paper", 1e-4);
    let other = kinetic("dormand-prince", "scaled", 1e-6);
    assert!(published > 1e3 * tighter && published > 1e3 * other, "{published:e} {tighter:e} {other:e}");
    // 200 spheres at 1e-6 m/s.
    assert!(tighter.max(other) < 1e-10, "{tighter:e} {other:e}");
}
