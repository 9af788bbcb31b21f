//! Beds at rest, where the only motion is what the solver makes.

use crate::judge::run_scene;
use crate::scene::Case;
use demhybrid::domain::Solo;
use demhybrid::scene::Scene;

/// A scene of the hard cases with keys set.
fn told(name: &str, method: &str, sets: &[&str]) -> crate::judge::Tale {
    let case = Case::read(name);
    let (_, start) = case.set_up(method).unwrap();
    let mut all = case.sets(method);
    all.extend(sets.iter().map(ToString::to_string));
    let scene = Scene::parse(name, &case.text, &all).unwrap();
    let tale = run_scene(&scene, &start, &Solo);
    println!(
        "{name} {method} {sets:?}: kinetic {:.2e} J at the end, moved {:.2e} m, rise {:.1e} J, {:?}",
        tale.course.kinetic_energy,
        tale.moved,
        tale.course.largest_rise,
        tale.result.as_ref().map(|counts| (counts.accepted, counts.rhs))
    );
    tale
}

#[cfg(feature = "long-tests")]
#[test]
fn long_a_bed_of_27_stays_at_rest_for_a_thousand_seconds() {
    let tale = told("rest-27", "auto", &["t_end=1000.0", "output.interval=1.0"]);
    assert!(tale.result.is_ok() && tale.finite && tale.warnings.is_empty(), "{tale:?}");
}

#[cfg(feature = "long-tests")]
#[test]
fn long_a_thousand_spheres_fall_as_one_column_and_come_to_rest() {
    let tale = told("column-1000", "auto", &["t_end=20.0", "output.interval=0.1"]);
    assert!(tale.result.is_ok() && tale.finite, "{tale:?}");
}
