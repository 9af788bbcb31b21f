//! End states of small many-body cases by an independent program: DOP853 of SciPy at rtol = 1e-11, in which
//! the paper's equations are written out anew (tests/data/reference; the parameters of NAME.json are those of
//! NAME.toml).

use crate::common::{root, run};
use demhybrid::scene::Scene;
use demhybrid::scene::initial_condition::read_csv;

/// The case as its file has it: Merson with the published error rate.
fn check(name: &str) {
    // m, m/s and rad/s alike. The reference is good to 1e-10 or so; collisions have amplified what each makes
    // wrong.
    let worst = deviation(name, None);
    assert!(worst < 1e-6, "{name}: {worst:e}");
}

/// Largest deviation of any component of the end state from the reference (m, m/s, rad/s), with the lines of
/// `solver` in place of the file's.
fn deviation(name: &str, solver: Option<&str>) -> f64 {
    let folder = root().join("tests/data/reference");
    let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
    let (head, rest) = text.split_once("[solver]").unwrap();
    let (own, tail) = rest.split_once("[output]").unwrap();
    let text = format!("{head}[solver]\n{}\n[output]{tail}", solver.unwrap_or(own));
    let mut scene = Scene::parse(&format!("{name}.toml"), &text, &[]).unwrap();
    let start = read_csv(&scene, &folder).unwrap();
    scene.particles.file = Some(format!("{name}.end.csv").into());
    let expected = read_csv(&scene, &folder).unwrap();
    let run = run(&scene, &start).unwrap();
    let end = run.end();
    let mut worst = 0.0f64;
    for (found, expected) in [(&end.x, &expected.x), (&end.v, &expected.v), (&end.omega, &expected.omega)] {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            worst = worst.max((found - nalgebra::Vector3::from(*expected)).amax());
        }
    }
    println!("{name} {solver:?}: largest deviation {worst:.1e}");
    worst
}

#[test]
fn every_method_comes_closer_to_the_reference_the_more_it_may_cost() {
    let coarse_and_fine = |method: &str, key: &str, [coarse, fine]: [f64; 2], allowed: f64| {
        for name in ["oblique_pair", "six_basic", "six_in_box"] {
            let found = [coarse, fine]
                .map(|value| deviation(name, Some(&format!("method = '{method}'\n{key} = {value:e}"))));
            assert!(found[1] < allowed, "{name} by {method} at {fine:e}: {:e}", found[1]);
            assert!(found[1] < found[0], "{name} by {method}: {found:?}");
        }
    };
    // Allowed is about ten times what was found, in the case that is worst.
    coarse_and_fine("dormand-prince", "tolerance", [1e-6, 1e-10], 4e-7);
    coarse_and_fine("merson", "tolerance", [1e-6, 1e-10], 5e-8);
    coarse_and_fine("auto", "tolerance", [1e-4, 1e-9], 3e-7);
    coarse_and_fine("chebyshev", "tolerance", [1e-4, 1e-8], 1e-4);
    coarse_and_fine("velocity-verlet", "step", [1e-4, 1e-6], 5e-4);
}

#[test]
fn an_oblique_spinning_pair_ends_where_the_reference_does() {
    check("oblique_pair");
}

#[test]
fn six_frictionless_spheres_in_a_box_end_where_the_reference_does() {
    check("six_basic");
}

#[test]
fn six_rubbing_spheres_in_a_box_end_where_the_reference_does() {
    check("six_in_box");
}
