//! Which bodies are in contact is a matter of forces: it must not depend on how a scene splits a force into
//! F_0 and a gap.

use crate::common::{Case, Snapshot, assert_near};
use demhybrid::beds::measures::contacts::{Contacts, SHARE};
use demhybrid::beds::measures::rattlers::{coordination, fewest_that_hold, mean_coordination, rattlers};
use demhybrid::math::vector::Vec3;
use demhybrid::scene::{BoxSides, Scene};

const KAPPA: f64 = 1500.0;

/// The bed of `bed.toml` with this F_0 (N), until it is at rest.
fn bed(f_0: f64) -> Case {
    Case::config("bed.toml")
        .set("contact.repulsion_at_contact", f_0)
        .set("contact.stiffness_exponent", KAPPA)
        .set("contact.interaction_distance", 0.01)
        .set("stop.unbalanced_force", 1e-3)
}

/// The same scene from these centres (m), at rest.
fn from(case: Case, x: &[Vec3]) -> Case {
    x.iter().fold(case, |case, x| case.sphere(*x, Vec3::zeros()))
}

/// Contacts, the coordination number, and how many spheres are rattlers.
fn measured(scene: &Scene, end: &Snapshot) -> (Contacts, f64, usize) {
    let found = Contacts::of(scene, &end.state(0), SHARE);
    let mean = mean_coordination(end.x.len(), &found.pushing);
    let loose = rattlers(end.x.len(), &found.pushing, fewest_that_hold(scene));
    (found, mean, loose.iter().filter(|&&loose| loose).count())
}

#[test]
fn a_bed_has_as_many_contacts_across_gaps_as_in_overlap() {
    let soft = bed(10.0);
    let (scene, _) = soft.build();
    let run = soft.run();
    let (in_overlap, mean, loose) = measured(&scene, run.end());
    println!("F_0 = 10 N: coordination {mean}, {loose} rattlers, {} overlap", in_overlap.overlapping.len());
    // The weights of 200 spheres hold some 360 pairs in overlap.
    assert!(in_overlap.overlapping.len() > 400 && (4.0..4.6).contains(&mean), "{mean}");

    // With 1000 N spheres bear the same across ln(100)/kappa = 3.07 mm more. They move apart, and settle
    // anew.
    let hard = from(bed(1000.0), &run.end().x);
    let (hard_scene, _) = hard.build();
    let hard_run = hard.run();
    let (across_gaps, hard_mean, hard_loose) = measured(&hard_scene, hard_run.end());
    println!("F_0 = 1000 N: coordination {hard_mean}, {hard_loose} rattlers");
    assert!(across_gaps.overlapping.is_empty(), "{:?}", across_gaps.overlapping);
    // 24 seeds moved by 1.8 +- 2.4 % at tolerance 1e-3, and by 2.8 +- 2.5 % at the default.
    assert_near("coordination of the hard bed", hard_mean, mean, 0.1 * mean);
    assert!(hard_loose <= 6 && loose <= 6, "{hard_loose} {loose}");
    // The floor bears most of the weight, or more where spheres are wedged between walls that rub.
    let weight_of = |found: &Contacts| found.walls[4].normal_force / (200.0 * 9.81);
    assert!((0.5..1.5).contains(&weight_of(&across_gaps)), "{}", weight_of(&across_gaps));

    // The same state in other words: F_0 of 1000 N, spheres smaller by half of 3.07 mm, and walls as much
    // further out. Each force is what it was, so each contact must be.
    let less = 100f64.ln() / (2.0 * KAPPA);
    let mut words = scene.clone();
    words.contact.repulsion_at_contact = 1000.0;
    words.particles.radius -= less;
    let sides = BoxSides { min: [-less; 3], max: [1.0 + less, 1.0 + less, f64::INFINITY], material: None };
    words.container.r#box = Some(sides);
    let (other, other_mean, other_loose) = measured(&words, run.end());
    assert_eq!((other_mean, other_loose), (mean, loose));
    assert_eq!(
        coordination(200, &other.pushing),
        coordination(200, &in_overlap.pushing),
        "the words of a scene moved a contact"
    );
    for (a, b) in other.pushing.iter().zip(&in_overlap.pushing) {
        assert!(a.partner == b.partner && (a.force - b.force).abs() < 1e-9 * b.force, "{a:?} {b:?}");
    }
    assert!(other.overlapping.len() < in_overlap.overlapping.len() / 2);

    // Without gravity the mean push is the measure. It knows neither F_0 nor the interaction distance.
    let floating = |f_0: f64, l_max: f64| {
        let mut scene = scene.clone();
        scene.gravity = [0.0; 3];
        (scene.contact.repulsion_at_contact, scene.contact.interaction_distance) = (f_0, l_max);
        let found = Contacts::of(&scene, &run.end().state(0), SHARE);
        let partners: Vec<_> = found.pushing.iter().map(|contact| (contact.i, contact.partner)).collect();
        (partners, found.reference.newtons() / f_0)
    };
    let (partners, reference) = floating(10.0, 0.01);
    assert!((300..500).contains(&partners.len()), "{}", partners.len());
    for (f_0, l_max) in [(10.0, 0.004), (10.0, 0.05), (1000.0, 0.01), (0.1, 0.05)] {
        let (others, other_reference) = floating(f_0, l_max);
        assert_eq!(others, partners, "{f_0} N, {l_max} m");
        assert_near("reference over F_0", other_reference, reference, 1e-12 * reference);
    }
}
