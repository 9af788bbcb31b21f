//! End states of small many-body cases by an independent program: DOP853 of SciPy at rtol = 1e-11, in which the
//! paper's equations are written out anew (tests/data/reference; the parameters of NAME.json are those of NAME.toml).

use crate::common::{root, run};
use demhybrid::scene::Scene;
use demhybrid::start::read_csv;

fn check(name: &str) {
    let folder = root().join("tests/data/reference");
    let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
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
    println!("{name}: largest deviation {worst:.1e}");
    // m, m/s and rad/s alike. The reference is good to 1e-10 or so; collisions have amplified what each makes wrong.
    assert!(worst < 1e-6, "{name}: {worst:e}");
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
