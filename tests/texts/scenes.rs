//! Scenes as data: every file in tests/scenes/good is accepted, every one in tests/scenes/bad is refused with
//! the message it carries in its first lines, `# expect: TEXT` for each part of it. The scenes of configs/
//! are good too.

use std::path::{Path, PathBuf};

use demhybrid::domain::Solo;
use demhybrid::error::Error;
use demhybrid::files::load::load;
use demhybrid::model::effects::FrictionLaw;
use demhybrid::ode::NormName;
use demhybrid::scene::initial_condition::{self, InitialCondition};
use demhybrid::scene::{Scene, Solver};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// All scenes of a folder, in the order of their names; never none.
fn scenes(name: &str) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(folder(name))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "there is no scene in {name}");
    files
}

/// What the program does with a scene before the first step.
fn set_up(file: &Path, sets: &[&str]) -> Result<(Scene, InitialCondition), Error> {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    load(file, &sets, &Solo)
}

fn refusal(file: &Path, sets: &[&str]) -> String {
    match set_up(file, sets) {
        Ok(_) => panic!("{} {sets:?} is accepted", file.display()),
        Err(mistake) => {
            assert_eq!(mistake.exit_code(), 2, "{mistake}");
            mistake.to_string()
        }
    }
}

#[test]
fn good_scenes_are_accepted_and_their_resolved_text_gives_the_same_run() {
    let files = [scenes("tests/scenes/good"), scenes("configs"), scenes("configs/paper")].concat();
    for file in files {
        let (scene, start) =
            set_up(&file, &[]).unwrap_or_else(|mistake| panic!("{}: {mistake}", file.display()));
        let again = Scene::parse("resolved.toml", &scene.resolved(), &[])
            .unwrap_or_else(|mistake| panic!("{}: {mistake}\n{}", file.display(), scene.resolved()));
        assert_eq!(again, scene, "{}", file.display());
        assert_eq!((start.v.len(), start.omega.len()), (start.x.len(), start.x.len()));
    }
}

#[test]
fn bad_scenes_are_refused_with_the_message_they_carry() {
    let mut wrong = Vec::new();
    for file in scenes("tests/scenes/bad") {
        let text = std::fs::read_to_string(&file).unwrap();
        let expected: Vec<_> = text.lines().map_while(|line| line.strip_prefix("# expect: ")).collect();
        assert!(!expected.is_empty(), "{} says nothing of its message", file.display());
        let message = refusal(&file, &[]);
        wrong.extend(
            expected
                .iter()
                .filter(|&&part| !message.contains(part))
                .map(|part| format!("{}\n  expected: {part}\n  message:  {message}", file.display())),
        );
    }
    assert!(wrong.is_empty(), "{} messages are not as expected:\n{}", wrong.len(), wrong.join("\n"));
}

/// Bad scenes whose mistake has no line: something is missing at the top, or a file as a whole is wrong.
/// Particles that do not fit the walls are named by id, and by the row of their file.
const WITHOUT_LINE: [&str; 23] = [
    "contact-missing",
    "csv-beyond-a-wall",
    "csv-beyond-arithmetic",
    "csv-comments-only",
    "csv-empty",
    "csv-faster-than-light",
    "csv-file-is-a-device",
    "csv-file-is-a-folder",
    "csv-file-missing",
    "csv-material-unknown",
    "csv-no-rows",
    "csv-on-the-floor",
    "csv-one-centre-twice",
    "csv-outside-the-box",
    "csv-surface-faster-than-light",
    "empty",
    "grid-below-the-floor",
    "lattice-below-a-lid",
    "particles-missing",
    "species-table-missing",
    "run-is-a-table",
    "run-missing",
    "t-end-missing",
];

/// How messages say what would be right.
const RIGHT: [&str; 16] = [
    "must",
    "e.g.",
    "did you mean",
    " knows ",
    "expected",
    "is outside",
    "exactly one",
    "leave it out",
    "may stand there once",
    "opens that side",
    " needs ",
    "go together",
    "commas",
    "lower case",
    "left out",
    "would do",
];

#[test]
fn messages_of_bad_scenes_show_the_line_and_say_what_is_right() {
    let (files, mut wrong) = (scenes("tests/scenes/bad"), Vec::new());
    let mut tables = 0;
    for file in &files {
        let (text, message) = (std::fs::read_to_string(file).unwrap(), refusal(file, &[]));
        let name = file.file_stem().unwrap().to_str().unwrap();
        let mut complain = |what: String| wrong.push(format!("{name}: {what}\n  message: {message}"));
        if !RIGHT.iter().any(|right| message.contains(right)) {
            complain("it does not say what would be right".into());
        }
        tables += usize::from(name.starts_with("csv-"));
        let first = message.lines().next().unwrap();
        // PATH:LINE: TEXT
        let mut parts = first.splitn(3, ':');
        let (path, line) = (parts.next().unwrap(), parts.next().and_then(|line| line.parse::<usize>().ok()));
        let Some(line) = line else {
            if !WITHOUT_LINE.contains(&name) {
                complain("it names no line".into());
            }
            continue;
        };
        if !text
            .lines()
            .any(|expected| expected.starts_with("# expect: ") && expected.contains(&format!(":{line}: ")))
        {
            complain(format!("no expectation says line {line}"));
        }
        if path.ends_with(".toml") {
            let shown = text.lines().nth(line - 1).unwrap_or_default().trim();
            if !message.contains(shown) || message.lines().count() != 4 {
                complain(format!("it does not show line {line}: {shown}"));
            }
        } else {
            // The value that is wrong stands in that line of the table.
            let table = std::fs::read(path).unwrap();
            let there = String::from_utf8_lossy(&table).lines().nth(line - 1).unwrap_or_default().to_owned();
            let value = first
                .split_once(" = ")
                .map(|(_, rest)| rest.split([' ', ',']).next().unwrap().trim_matches('"'));
            if !value.is_none_or(|value| there.contains(value)) {
                complain(format!("line {line} is {there}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{} messages say too little:\n{}", wrong.len(), wrong.join("\n"));
    // Not println: the test runner would hide it.
    let counts =
        format!("bad inputs: {} scenes and {tables} with a bad particle file\n", files.len() - tables);
    std::io::Write::write_all(&mut std::io::stderr(), counts.as_bytes()).unwrap();
    assert!(files.len() - tables >= 130 && tables >= 40, "{counts}");
}

#[test]
fn every_csv_file_of_the_bad_scenes_is_used() {
    let texts: String =
        scenes("tests/scenes/bad").iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    for entry in std::fs::read_dir(folder("tests/scenes/bad/csv")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(texts.contains(&format!("\"csv/{name}\"")), "{name} belongs to no scene");
    }
}

#[test]
fn the_settling_scenes_hold_the_parameters_of_table_4_2() {
    let (scene, start) = set_up(&folder("configs/paper/settle.toml"), &[]).unwrap();
    let (contact, friction) = (&scene.contact, scene.friction.as_ref().unwrap());
    assert_eq!((start.x.len(), scene.particles.radius, scene.particles.mass), (200, 0.1, 1.0));
    assert_eq!((scene.t_end, scene.gravity), (8.0, [0.0, 0.0, -9.81]));
    assert_eq!((contact.repulsion_at_contact, contact.stiffness_exponent), (10.0, 150.0));
    assert_eq!((contact.restitution, contact.dissipation_focusing), (0.4, 10.0));
    assert_eq!(contact.interaction_distance, 0.1);
    assert_eq!((friction.coefficient, friction.regularization_velocity), (0.2, Some(0.01)));
    assert_eq!((scene.solver.tolerance, scene.solver.initial_step), (Some(0.1), 0.1));
    assert_eq!((scene.solver.method.name(), scene.solver.norm.name()), ("merson", "paper"));
    assert!(scene.rotates());

    let variant = |name| set_up(&folder(name), &[]).unwrap();
    let (mut basic, same_start) = variant("configs/paper/settle-basic.toml");
    assert_eq!((&basic.friction, &same_start), (&None, &start));
    basic.friction.clone_from(&scene.friction);
    basic.output.file.clone_from(&scene.output.file);
    assert_eq!(basic, scene);
    let (mut locked, same_start) = variant("configs/paper/settle-friction.toml");
    assert!(!locked.rotates() && same_start == start);
    locked.friction.clone_from(&scene.friction);
    locked.output.file.clone_from(&scene.output.file);
    assert_eq!(locked, scene);
    let default = Solver::default();
    let (mut settle, same_start) = variant("configs/settle.toml");
    assert!(same_start == start && settle.solver == default);
    settle.solver.clone_from(&scene.solver);
    settle.output.file.clone_from(&scene.output.file);
    assert_eq!(settle, scene);
    // The same bed with friction that remembers: what a sphere at rest feels is 2 phi/(1 + e^2) = 0.345.
    let (mut bed, same_start) = variant("configs/bed.toml");
    assert!(
        same_start == start && bed.solver == Solver { norm: NormName::Mean, tolerance: Some(0.1), ..default }
    );
    let remembers = bed.friction.take().unwrap();
    assert_eq!((remembers.law, remembers.coefficient), (FrictionLaw::History, 0.345));
    bed.friction.clone_from(&scene.friction);
    bed.solver.clone_from(&scene.solver);
    bed.output.file.clone_from(&scene.output.file);
    assert_eq!(bed, scene);
    let (mut quick, few) = variant("configs/quick.toml");
    assert_eq!(few.x.len(), 27);
    quick.t_end = scene.t_end;
    quick.particles.grid.clone_from(&scene.particles.grid);
    quick.container.clone_from(&scene.container);
    quick.output.file.clone_from(&scene.output.file);
    assert_eq!(quick, scene);
}

#[test]
fn the_bouncing_sphere_starts_16_m_above_the_floor() {
    let (scene, start) = set_up(&folder("configs/bounce.toml"), &[]).unwrap();
    assert_eq!(
        (start.x.as_slice(), start.v.as_slice()),
        ([[0.0, 0.0, 16.1]].as_slice(), [[0.0; 3]].as_slice())
    );
    assert_eq!((scene.contact.restitution, scene.contact.stiffness_exponent), (1.0, 150.0));
    assert!(scene.container.r#box.is_none() && scene.container.wall.len() == 1 && scene.friction.is_none());
}

#[test]
fn set_overrides_any_key_of_the_scene() {
    let settle = folder("configs/settle.toml");
    let sets = [
        "solver.tolerance=1e-3",
        "particles.grid.count = 27",
        "t_end=1",
        "solver.max_step=0.5",
        "output.file=folder/other name.vtkhdf",
        "gravity=[0, 0, -1.62]",
        "container.wall=[{ normal = [0, 1, 0], point = [0, 9, 0] }]",
        "container.box.max=[2.0, 2.0, inf]",
        "t_end=2",
    ];
    let (scene, start) = set_up(&settle, &sets).unwrap();
    assert_eq!(
        (scene.solver.tolerance, scene.solver.max_step, scene.solver.min_step),
        (Some(1e-3), 0.5, 1e-9)
    );
    assert_eq!((start.x.len(), scene.t_end, scene.gravity[2]), (27, 2.0, -1.62));
    assert_eq!(scene.output.file, Some("folder/other name.vtkhdf".into()));
    assert_eq!((scene.container.wall.len(), scene.container.r#box.unwrap().min), (1, [0.0; 3]));

    let basic = folder("configs/paper/settle-basic.toml");
    let sets = ["friction.coefficient=0.1", "friction.regularization_velocity=0.01"];
    assert!(set_up(&basic, &sets).unwrap().0.rotates(), "the missing table [friction] is created");
}

#[test]
fn a_mistake_in_a_set_names_the_set() {
    let settle = folder("configs/settle.toml");
    for (sets, expected) in [
        (
            &["contact.restitution=1.4"][..],
            "--set contact.restitution=1.4: contact.restitution = 1.4 is outside 0..1",
        ),
        (&["t_end=soon"], "--set t_end=soon: t_end = \"soon\" must be a finite number > 0"),
        (&["t_end="], "--set t_end=: t_end = \"\" must be a finite number > 0"),
        (&["solver.tolerance=1e-3x"], "--set solver.tolerance=1e-3x: solver.tolerance = \"1e-3x\" must be"),
        (&["tolerance=1"], "--set tolerance=1: unknown key tolerance: did you mean solver.tolerance?"),
        (&["solvr.tolerance=1"], "--set solvr.tolerance=1: unknown key solvr: did you mean solver?"),
        (&["output.file=7"], "--set output.file=7: output.file = 7 must be text in quotes"),
        (&["t_end=1", "t_end=-1"], "--set t_end=-1: t_end = -1 must be"),
        (&["t_end=-1", "gravity=[0, 0]"], "--set t_end=-1: t_end = -1 must be"),
        (&["t_end.x=1"], "--set t_end.x=1: t_end is not a table in the scene and has no key x"),
        (&["contact={ x = 1 }"], "--set contact={ x = 1 }: unknown key contact.x"),
        (
            &["particles.file=a.csv"],
            "--set particles.file=a.csv: particles.file and particles.grid contradict each other",
        ),
        (&["solver.max_step=1e-10"], "--set solver.max_step=1e-10: solver.max_step = 1e-10 s is less than"),
        (&["container.wall=[{normal=[0,0,0]}]"], "container.wall[0].normal = [0, 0, 0] has no direction"),
        (&["solver.tolerance"], "--set solver.tolerance: there is no = in it: it must be KEY=VALUE"),
        (&["=1"], "--set =1: there is no key before the ="),
        (&[""], "--set : there is no = in it"),
        (&["a..b=1"], "--set a..b=1: \"a..b\" is not a key"),
        (&["container.wall[0].normal=1"], "is not a key, which is made of words with dots between them"),
        (&["t end=1"], "--set t end=1: \"t end\" is not a key"),
    ] {
        let message = refusal(&settle, sets);
        assert!(message.contains(expected), "{sets:?}\n  expected: {expected}\n  message:  {message}");
    }
    let basic = folder("configs/paper/settle-basic.toml");
    let message = refusal(&basic, &["friction.rotation=false"]);
    let expected = "--set friction.rotation=false: friction.coefficient is missing";
    assert!(message.starts_with(expected), "{message}");
}

#[test]
fn a_key_is_suggested_only_where_its_name_is_alike() {
    let settle = folder("configs/settle.toml");
    for set in ["output.format=vtk", "particles.weight=1", "contact.kappa=150", "solver.dt=1", "contact.mu=1"]
    {
        let message = refusal(&settle, &[set]);
        assert!(!message.contains("did you mean") && message.contains(" knows "), "{message}");
    }
    for (set, key) in [
        ("output.intervall=1", "output.interval"),
        ("solver.max_stp=1", "solver.max_step"),
        ("particle.radius=1", "particles"),
        ("solver.restitution=1", "contact.restitution"),
        ("tolerence=1", "solver.tolerance"),
        ("contact.friction={ coefficient = 1 }", "[friction]"),
    ] {
        let message = refusal(&settle, &[set]);
        assert!(message.contains(&format!("did you mean {key}?")), "{message}");
    }
}

#[test]
fn a_scene_with_one_mistake_does_not_bring_the_program_down() {
    // Every prefix, and every single character replaced: refused or accepted, never a panic.
    let text = std::fs::read_to_string(folder("tests/scenes/good/every-key.toml")).unwrap();
    for (at, _) in text.char_indices() {
        let _ = Scene::parse("cut.toml", &text[..at], &[]);
        for other in ["\u{e4}", "[", "\"", "\n", "-"] {
            let _ = Scene::parse("changed.toml", &format!("{}{other}{}", &text[..at], &text[at + 1..]), &[]);
        }
    }
}

#[test]
fn the_scene_of_the_readme_runs_as_it_is_printed() {
    let readme = include_str!("../../README.md");
    let (_, rest) = readme.split_once("```toml\n").expect("the README shows a scene");
    let (text, _) = rest.split_once("```").expect("the scene of the README ends");
    let scene = Scene::parse("readme.toml", text, &[]).unwrap_or_else(|why| panic!("{why}"));
    let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().expect("it has a grid"));
    assert_eq!(initial_condition::check(&scene, &start), Ok(()));
}
