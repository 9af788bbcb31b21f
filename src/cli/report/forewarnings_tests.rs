//! Each warning before a run: when it comes, and that what it advises silences it.

use super::super::testing::{scene, sized};
use super::*;

/// Any number of spheres with the radius and the mass of the scene.
fn alike() -> InitialCondition {
    InitialCondition::default()
}

/// Particles at the given centres with the given velocities.
fn bodies(list: &[[[f64; 3]; 2]]) -> InitialCondition {
    InitialCondition {
        x: list.iter().map(|&[x, _]| x).collect(),
        v: list.iter().map(|&[_, v]| v).collect(),
        omega: vec![[0.0; 3]; list.len()],
        ..InitialCondition::default()
    }
}

#[test]
fn the_paper_cuts_off_nothing_that_matters() {
    assert_eq!(cut_force_warning(&scene(&[]), &alike()), None);
    assert_eq!(cut_force_warning(&scene(&["gravity=[0,0,0]"]), &alike()), None);
}

#[test]
fn a_cut_force_is_warned_of_with_the_distance_that_would_do() {
    let warning = cut_force_warning(&scene(&["contact.stiffness_exponent=30"]), &alike()).unwrap();
    // 10 exp(-30 l) = 9.81e-3 at l = 0.230897 m.
    assert!(
        warning.contains("contact.interaction_distance = 0.1 m") && warning.contains("0.231 m"),
        "{warning}"
    );
    let enough = scene(&["contact.stiffness_exponent=30", "contact.interaction_distance=0.231"]);
    assert_eq!(cut_force_warning(&enough, &alike()), None);
    let weightless = scene(&["contact.stiffness_exponent=30", "gravity=[0,0,0]"]);
    // exp(-30 l) = 1e-3 at l = 0.23026 m.
    assert!(cut_force_warning(&weightless, &alike()).unwrap().contains("0.231 m"));
}

#[test]
fn of_unequal_spheres_the_lightest_one_and_the_one_that_sinks_most_are_warned_of() {
    // Weights of 9.81 and 0.0981 N: 10 exp(-30 l) = 9.81e-5 at l = 0.3844 m.
    let two = sized(vec![[0.5; 3]; 2], [0.1, 0.02], [1.0, 0.01]);
    let warning = cut_force_warning(&scene(&["contact.stiffness_exponent=30"]), &two).unwrap();
    assert!(warning.contains("of the weight of the lightest particle") && warning.contains("0.385 m"));

    // ln(9.81 m/5.8) is 1.677 for 3.163 kg: in 0.3 r of 0.05 m that takes kappa = 111.8 1/m.
    let heavy = sized(vec![[0.5; 3]; 3], [0.1, 0.05, 0.3], [1.0, 3.163, 3.163]);
    let soft =
        |kappa: &str| soft_contact_warning(&scene(&[&format!("contact.stiffness_exponent={kappa}")]), &heavy);
    let warning = soft("100").unwrap();
    assert!(warning.contains("particle 1 of 3.163 kg at rest on a floor overlaps it"), "{warning}");
    assert!(warning.contains("of its radius; contact.stiffness_exponent = 112 1/m"), "{warning}");
    assert_eq!(soft("112"), None);
}

#[test]
fn walls_given_twice_are_warned_of() {
    assert!(double_wall_warnings(&scene(&[])).is_empty());
    let floor = "container.wall=[{ point = [5, 5, 0], normal = [0, 0, -2] }, \
                                 { point = [0, 0, 9], normal = [0, 0, 1] }]";
    let warnings = double_wall_warnings(&scene(&[floor]));
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("container.wall[0]") && warnings[0].contains("z = 0 m"), "{warnings:?}");
}

#[test]
fn a_wall_that_cannot_hold_a_fall_is_warned_of_with_the_kappa_that_would_do() {
    // r = 0.1 m, kappa = 30: e^3/3 = 6.695 J; a fall over 1 m brings 9.81 J.
    let soft = scene(&["contact.stiffness_exponent=30"]);
    let fall = |height| bodies(&[[[0.5, 0.5, height], [0.0; 3]]]);
    let warning = wall_barrier_warning(&soft, &fall(1.0)).unwrap();
    assert!(warning.contains("particle 0 can meet the side z = 0 m"), "{warning}");
    assert!(warning.contains("with 9.81 J") && warning.contains("6.7 J"), "{warning}");
    assert_eq!(wall_barrier_warning(&soft, &fall(0.68)), None);
    // 10/kappa e^(kappa/10) = 9.81 J at kappa = 35.8: three digits, rounded up.
    let kappa: f64 =
        warning.split("stiffness_exponent = ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    let enough = scene(&[&format!("contact.stiffness_exponent={kappa:?}")]);
    assert_eq!(wall_barrier_warning(&enough, &fall(1.0)), None);
    let less = scene(&[&format!("contact.stiffness_exponent={:?}", 0.99 * kappa)]);
    assert!(wall_barrier_warning(&less, &fall(1.0)).is_some());
    assert_eq!(wall_barrier_warning(&scene(&[]), &fall(100.0)), None);
}

#[test]
fn a_sphere_that_leaves_a_wall_meets_it_only_if_gravity_brings_it_back() {
    let soft = |gravity: &str| scene(&["contact.stiffness_exponent=30", gravity]);
    let up = bodies(&[[[0.5, 0.5, 0.2], [0.0, 0.0, 4.0]]]);
    assert!(wall_barrier_warning(&soft("gravity=[0,0,-9.81]"), &up).is_some());
    assert_eq!(wall_barrier_warning(&soft("gravity=[0,0,0]"), &up), None);
}

#[test]
fn spheres_that_can_pass_through_each_other_are_warned_of() {
    // e^6/3 = 134.5 J; two that close at v = 40 m/s have 400 J, at 20 m/s 100 J.
    let soft = scene(&["contact.stiffness_exponent=30", "gravity=[0,0,0]"]);
    let pair = |v| bodies(&[[[0.2, 0.5, 0.5], [v, 0.0, 0.0]], [[0.8, 0.5, 0.5], [-v, 0.0, 0.0]]]);
    let warning = pair_barrier_warning(&soft, &pair(20.0)).unwrap();
    assert!(warning.contains("at 40 m/s, with 400 J") && warning.contains("134 J"), "{warning}");
    assert_eq!(pair_barrier_warning(&soft, &pair(10.0)), None);
    assert_eq!(pair_barrier_warning(&soft, &bodies(&[[[0.5; 3], [100.0, 0.0, 0.0]]])), None);
}

#[test]
fn a_tolerance_that_allows_everything_is_warned_of_in_either_norm() {
    let start = InitialCondition::default();
    let loose = |sets: &[&str]| loose_tolerance_warning(&scene(sets), &start);
    assert_eq!(loose(&[]), None);
    // kappa v^2 = 150 g r = 147 m/s^2.
    assert_eq!(loose(&["solver.tolerance=100"]), None);
    assert!(loose(&["solver.tolerance=150"]).unwrap().contains("does not control the step"));
    assert_eq!(loose(&["solver.norm=scaled", "solver.tolerance=0.9"]), None);
    assert!(loose(&["solver.norm=scaled", "solver.tolerance=1e6"]).unwrap().contains("= 1000000 does not"));
}

#[test]
fn a_tolerance_too_loose_for_the_brake_is_warned_of_with_one_that_would_do() {
    let start = bodies(&[[[0.5, 0.5, 0.1], [0.0; 3]]]);
    let warning = |sets: &[&str]| {
        let scaled = [&["solver.norm=scaled", "friction.regularization_velocity=1e-4"][..], sets].concat();
        shivering_warning(&scene(&scaled), &start)
    };
    // 0.4 * 1e-4/sqrt(9.81 * 0.1) = 4.0385e-5.
    let told = warning(&["solver.tolerance=0.1"]).unwrap();
    assert!(told.contains("= 0.1 allows errors of 0.099 m/s a step, 990 times"), "{told}");
    assert!(told.contains("4.03e-5 or less would do"), "{told}");
    assert_eq!(warning(&["solver.tolerance=4.03e-5"]), None);
    assert!(warning(&["solver.tolerance=4.04e-5"]).is_some());
    for sets in [&["solver.norm=paper"][..], &["gravity=[0,0,0]"], &["friction.law=history"]] {
        assert_eq!(warning(&[sets, &["solver.tolerance=0.1"]].concat()), None, "{sets:?}");
    }
    // The usual bed at the usual tolerance.
    let many = bodies(&[[[0.5, 0.5, 0.1], [0.0; 3]]; 200]);
    assert_eq!(shivering_warning(&scene(&["solver.norm=scaled"]), &many), None);
}

/// The scene with start.csv in place of its grid.
fn scene_of_a_file(extra: &[&str]) -> Scene {
    let scene = scene(extra);
    let file = Some("start.csv".into());
    Scene { particles: crate::scene::Particles { grid: None, file, ..scene.particles }, ..scene }
}

/// The number that `warning` advises, which stands after `before`, as it is written.
fn advised<'a>(warning: &'a str, before: &str) -> &'a str {
    let (_, rest) = warning.rsplit_once(before).unwrap_or_else(|| panic!("no {before} in {warning}"));
    rest.split(' ').next().unwrap()
}

/// The paper's bed with all lengths times `scale`, and times and masses so that the motion is the same.
fn scaled(scale: f64, extra: &[&str]) -> Scene {
    let time = scale.sqrt();
    let sets = [
        ("t_end", 8.0 * time),
        ("particles.radius", 0.1 * scale),
        ("particles.mass", scale.powi(3)),
        ("particles.grid.spacing", 0.25 * scale),
        ("particles.grid.jitter", 0.025 * scale),
        ("particles.grid.bottom", 1.1 * scale),
        ("contact.repulsion_at_contact", 10.0 * scale.powi(3)),
        ("contact.stiffness_exponent", 150.0 / scale),
        ("contact.dissipation_focusing", 10.0 / time),
        ("contact.interaction_distance", 0.1 * scale),
        ("friction.regularization_velocity", 0.01 * time),
        ("output.interval", 0.02 * time),
    ];
    let side = format!("container.box.max=[{scale:?}, {scale:?}, inf]");
    let mut sets: Vec<String> = sets.iter().map(|(key, value)| format!("{key}={value:?}")).collect();
    sets.extend([side, "solver.norm=scaled".to_owned()]);
    sets.extend(extra.iter().map(ToString::to_string));
    Scene::parse("settle.toml", include_str!("../../../configs/paper/settle.toml"), &sets).unwrap()
}

fn of_grid(scene: &Scene) -> InitialCondition {
    initial_condition::grid(scene, scene.particles.grid.as_ref().unwrap())
}

#[test]
fn a_sound_bed_of_any_size_is_not_warned_of() {
    for scale in [1e-5, 5e-5, 1e-2, 1.0, 1e3] {
        let scene = scaled(scale, &[]);
        assert_eq!(forewarnings(&scene, &of_grid(&scene)), Vec::<String>::new(), "{scale}");
    }
}

#[test]
fn what_a_warning_advises_silences_it_at_every_size() {
    for scale in [1e-6, 5e-5, 1.0, 1e3] {
        let of = |key: &str, value: f64| format!("{key}={value:?}");
        for (set, key, before) in [
            (
                of("contact.interaction_distance", 0.02 * scale),
                "contact.interaction_distance",
                "will suffer; ",
            ),
            (
                of("contact.repulsion_at_contact", 0.1 * scale.powi(3)),
                "contact.stiffness_exponent",
                "of the radius; contact.stiffness_exponent = ",
            ),
            (
                of("contact.repulsion_at_contact", 1e5 * scale.powi(3)),
                "contact.repulsion_at_contact",
                "times its weight; contact.repulsion_at_contact = ",
            ),
            (
                of("particles.grid.spacing", 0.12 * scale),
                "particles.grid.spacing",
                "particles.grid.spacing = ",
            ),
            (of("particles.grid.bottom", -0.08 * scale), "particles.grid.bottom", "particles.grid.bottom = "),
            (of("solver.tolerance", 2.0), "solver.tolerance", "may create energy; "),
            (of("friction.regularization_velocity", 1e-3 * scale.sqrt()), "solver.tolerance", "too fast; "),
            (
                of("solver.min_step", 3e-5 * scale.sqrt()),
                "solver.min_step",
                "m/s: steps will be accepted in spite of their error; ",
            ),
        ] {
            let stiffer = |scene: &Scene| {
                let start = of_grid(scene);
                forewarnings(scene, &start).into_iter().find(|warning| warning.contains(before))
            };
            let warning = stiffer(&scaled(scale, &[&set]))
                .unwrap_or_else(|| panic!("no warning of {set} at the size {scale}"));
            let advice = format!("{key}={}", advised(&warning, before));
            assert_eq!(stiffer(&scaled(scale, &[&set, &advice])), None, "{warning}: {advice}");
        }
    }
}

#[test]
fn a_powder_is_advised_in_its_own_size() {
    let cut = scaled(5e-5, &["contact.interaction_distance=1e-6"]);
    let warning = cut_force_warning(&cut, &alike()).unwrap();
    // ln(1 000 * 10/9.81)/kappa with kappa = 3e6 1/m: 2.3089e-6 m.
    assert!(warning.contains("contact.interaction_distance = 1e-6 m"), "{warning}");
    assert!(warning.ends_with("2.31e-6 m or more would do"), "{warning}");
}

#[test]
fn impacts_that_nothing_holds_back_are_told_with_a_stiffness_that_does_at_every_size() {
    for scale in [1e-6, 1.0, 1e3] {
        let soft = format!("contact.stiffness_exponent={:?}", 15.0 / scale);
        let start = bodies(&[
            [[0.3 * scale, 0.5 * scale, 20.0 * scale], [0.0; 3]],
            [[0.7 * scale, 0.5 * scale, 20.0 * scale], [0.0; 3]],
        ]);
        for warning_of in [wall_barrier_warning, pair_barrier_warning] {
            let warning = warning_of(&scaled(scale, &[&soft]), &start).unwrap();
            let advice =
                format!("contact.stiffness_exponent={}", advised(&warning, "contact.stiffness_exponent = "));
            assert_eq!(warning_of(&scaled(scale, &[&advice]), &start), None, "{warning}");
        }
    }
}

#[test]
fn overlaps_at_the_start_are_told_with_who_and_how_many() {
    let touching = |gap: f64| bodies(&[[[0.5; 3], [0.0; 3]], [[0.5, 0.5, 0.5 + gap], [0.0; 3]]]);
    assert_eq!(overlap_warning(&scene(&[]), &touching(0.171)), None);
    let from_file = scene_of_a_file(&[]);
    let warning = overlap_warning(&from_file, &touching(0.0125)).unwrap();
    for part in [
        "by up to 0.188 m, 1.88 of the radius (particles 0 and 1): ",
        // The force, 10 exp(150 * 0.1875) N, opens such a contact within 3e-8 s.
        "no step from solver.min_step = 1e-9 s on can follow that",
        "overlaps of 0.03 m or less in particles.file would do, and particles.push_apart = true parts them",
    ] {
        assert!(warning.contains(part), "{warning}");
    }
    let apart = overlap_warning(&from_file, &touching(0.1)).unwrap();
    assert!(apart.contains("0.1 m, 1 of the radius (particles 0 and 1): they will fly apart"), "{apart}");
    let sunk = overlap_warning(&from_file, &bodies(&[[[0.5, 0.5, 0.05], [0.0; 3]]])).unwrap();
    assert!(sunk.contains("(particle 0 and the side z = 0 m of the box (container.box.min))"), "{sunk}");
}

#[test]
fn a_force_beyond_a_double_is_told_before_the_run() {
    let hard = scene_of_a_file(&["contact.stiffness_exponent=1e5"]);
    let warning = overlap_warning(&hard, &bodies(&[[[0.5; 3], [0.0; 3]], [[0.5, 0.5, 0.68], [0.0; 3]]]));
    assert!(warning.unwrap().contains("by up to 0.02 m, 0.2 of the radius"));
}

#[test]
fn columns_that_nobody_reads_are_told_but_never_too_many() {
    let from_file = scene_of_a_file(&[]);
    let with = |names: &[String]| InitialCondition { unread: names.to_vec(), ..InitialCondition::default() };
    assert_eq!(unread_column_warning(&from_file, &with(&[])), None);
    let warning = unread_column_warning(&from_file, &with(&["tag".to_owned()])).unwrap();
    assert!(warning.starts_with("warning: start.csv: nobody reads the column tag: "), "{warning}");
    let many: Vec<String> = (0..20).map(|k| format!("c{k}")).collect();
    let warning = unread_column_warning(&from_file, &with(&many)).unwrap();
    assert!(warning.contains("nobody reads the columns c0, c1") && warning.contains("c7 and 12 more: "));
}
