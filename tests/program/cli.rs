//! The command line as a user meets it: help, dry runs, names of files, exit codes, what a file records.

use crate::mpirun::{Job, PACKAGE, progress_lines};
use crate::results::{Results, assert_same_bits};
use demhybrid::math::digits::short;
use demhybrid::math::instructions::InstructionSet;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Eight spheres with friction and rotation that touch each other and the floor within 0.1 s.
const SCENE: &str = "
t_end = 0.1
gravity = [0.0, 0.0, -9.81]
[particles]
radius = 0.1
mass = 1.0
[particles.grid]
count = 8
spacing = 0.21
jitter = 0.005
bottom = 0.01
[container]
box = { min = [0.0, 0.0, 0.0], max = [0.42, 0.42, inf] }
[contact]
repulsion_at_contact = 10.0
stiffness_exponent = 150.0
restitution = 0.4
dissipation_focusing = 10.0
interaction_distance = 0.1
[friction]
coefficient = 0.2
regularization_velocity = 0.1
";

/// A folder with the scene under the name heap.toml.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("heap.toml"), SCENE).unwrap();
    folder
}

/// Names of the files in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

#[test]
fn help_and_version_go_to_stdout_and_touch_nothing() {
    let folder = folder();
    let help = Job::alone(folder.path(), &["--help"]).run().with_code(0);
    let options = ["--output", "--threads", "--set", "--dry-run", "--force", "--quiet", "--verbose"];
    for part in options.iter().chain(&["Usage: demhybrid", "Exit codes", "mpirun -n"]) {
        assert!(help.stdout.contains(part), "nothing of {part} in\n{}", help.stdout);
    }
    let short = Job::alone(folder.path(), &["-V"]).run().with_code(0);
    assert_eq!(short.stdout, format!("demhybrid {}\n", env!("CARGO_PKG_VERSION")));
    let version = Job::alone(folder.path(), &["--version"]).run().with_code(0);
    assert!(version.stdout.starts_with(&short.stdout), "{}", version.stdout);
    let mpi = if cfg!(feature = "mpi") { "built with MPI (" } else { "built without MPI, " };
    assert!(version.line("built").starts_with(mpi) && version.line("built").contains("HDF5"));
    assert!(version.line("commit").len() >= "commit unknown".len());
    assert!(help.stderr.is_empty() && version.stderr.is_empty());
    assert_eq!(names(folder.path()), ["heap.toml"]);
}

#[test]
fn a_launcher_that_starts_copies_in_place_of_ranks_is_refused_by_the_first_copy_for_all() {
    let folder = folder();
    let cure = if cfg!(feature = "mpi") { "belongs to another MPI" } else { "built without MPI" };
    for [size, rank] in [
        ["OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"],
        ["PMI_SIZE", "PMI_RANK"],
        ["SLURM_STEP_NUM_TASKS", "SLURM_PROCID"],
    ] {
        let copy = |number: &str| {
            let job = Job::alone(folder.path(), &["heap.toml", "-q"]).with_variable(size, "2");
            job.with_variable(rank, number).run().with_code(2)
        };
        copy("0").only_error(&["the launcher started 2 ranks", cure]);
        assert_eq!(copy("1").stderr, "", "{rank}");
    }
    assert_eq!(names(folder.path()), ["heap.toml"]);
    let job = Job::alone(folder.path(), &["heap.toml", "-q", "--set", "t_end=0.01"]);
    job.with_variable("SLURM_STEP_NUM_TASKS", "1").with_variable("SLURM_NTASKS", "4").run().with_code(0);
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "a build without MPI has one rank")]
fn a_dry_run_tells_effects_counts_memory_and_slabs_and_writes_nothing() {
    let folder = folder();
    let scene = format!("{PACKAGE}/configs/paper/settle.toml");
    let told = Job::on(2, folder.path(), &[&scene, "--dry-run", "--threads", "3"]).run().with_code(0);
    assert!(told.line("variant").contains("friction+rotation (dissipative)"));
    for (effect, why) in [
        ("rebound    on", "contact.restitution = 0.4"),
        ("friction   on", "friction.coefficient = 0.2"),
        ("rotation   on", "friction.rotation = true"),
        ("gravity    on", "-9.81"),
    ] {
        let line = told.stdout.lines().find(|line| line.contains(effect));
        assert!(line.is_some_and(|line| line.contains(why)), "{effect}, {why}:\n{}", told.stdout);
    }
    assert!(told.line("particles").contains("200 of radius 0.1 m"));
    assert!(told.line("time").contains("to t = 8 s, 401 frames"));
    assert!(told.line("solver").contains("merson, tolerance 0.1 in the paper's norm"));
    assert!(told.line("memory").contains("bytes a particle"));
    assert!(told.line("output").contains("settle.vtkhdf") && !told.stdout.contains("refused"));
    assert!(told.line("ranks").contains("2 with 3 threads"));
    assert!(told.line("slabs").contains("rank 0: -inf") && told.line("slabs").contains("100 particles"));
    assert!(told.line("rank 1").contains("100 particles"));
    assert_eq!(told.stdout.matches("is valid").count(), 1, "one rank speaks:\n{}", told.stdout);
    assert_eq!(progress_lines(&told.stderr), 0);
    assert_eq!(names(folder.path()), ["heap.toml"]);
}

#[test]
fn effects_that_change_nothing_are_left_out_and_the_dry_run_says_so() {
    let folder = folder();
    fs::write(folder.path().join("heap.vtkhdf"), b"old").unwrap();
    let mut sets = vec!["--set", "friction.coefficient=0", "--set", "contact.restitution=1"];
    // A window longer than the run.
    sets.extend(["--set", "stop.kinetic_energy=2", "--set", "stop.units=scene", "--set", "stop.window=100"]);
    let told = Job::alone(folder.path(), &["heap.toml", "--dry-run"]).and(&sets).run().with_code(0);
    assert!(told.line("variant").contains("basic (elastic)"), "{}", told.stdout);
    for (effect, why) in [
        ("rebound    off", "contact.restitution = 1"),
        ("friction   off", "friction.coefficient = 0"),
        ("rotation   off", "without friction"),
    ] {
        let line = told.stdout.lines().find(|line| line.contains(effect));
        assert!(line.is_some_and(|line| line.contains(why)), "{effect}, {why}:\n{}", told.stdout);
    }
    // 2 m g r, 0.01 sqrt(g r) and 100 sqrt(r/g); without friction nothing creeps.
    let rest = "ends the run: mean kinetic energy at most 1.962 J, and no particle faster than 0.0099 \
                m/s, for 10.1 s";
    assert!(told.line("rest").contains(rest), "{}", told.stdout);
    assert!(told.stderr.contains("its window of 10.1 s (stop.window)"), "{}", told.stderr);
    // A real run would be refused: better to know before.
    let output = told.line("output");
    assert!(
        output.contains("heap.vtkhdf") && output.contains("exists") && output.contains("--force"),
        "{output}"
    );
    assert_eq!(fs::read(folder.path().join("heap.vtkhdf")).unwrap(), b"old");
}

#[test]
fn a_run_without_mpirun_writes_the_scenes_stem_into_the_working_folder() {
    let (scenes, work) = (folder(), TempDir::new().unwrap());
    let scene = scenes.path().join("heap.toml");
    let ended = Job::alone(work.path(), &[scene.to_str().unwrap(), "-q"]).run().with_code(0);
    assert_eq!(ended.stderr, "", "-q leaves nothing but warnings and errors");
    assert_eq!(
        (names(work.path()), names(scenes.path())),
        (vec!["heap.vtkhdf".into()], vec!["heap.toml".into()])
    );
    assert!(
        ended.stdout.contains("heap.toml done: 8 particles, friction+rotation, to t = 0.1 s"),
        "{}",
        ended.stdout
    );
    for part in ["accepted", "rejected", "right-hand sides", "forces", "ghosts", "output"] {
        assert!(ended.stdout.contains(part), "nothing of {part} in\n{}", ended.stdout);
    }
    let results = Results::open(&work.path().join("heap.vtkhdf"));
    assert_eq!((results.frames(), results.particles(), results.count("completed")), (101, 8, 1));
    assert_eq!((results.count("ranks"), results.text("method").as_str()), (1, "auto"));
    let cores = std::thread::available_parallelism().unwrap().get();
    assert_eq!(results.count("threads"), cores as i64);
    assert_eq!(results.text("version"), env!("CARGO_PKG_VERSION"));
    assert_eq!((results.real("tolerance"), results.real("mass")), (0.1, 1.0));
    assert!(results.real("wall_seconds") > 0.0 && !results.text("commit").is_empty());
    // The attributes are those of the last frame, and the summary's.
    for name in ["steps_accepted", "steps_rejected", "steps_outrun", "rhs_evaluations", "lists_built"] {
        assert_eq!(
            results.counts(&format!("run/series/{name}")).last(),
            Some(&results.count(name)),
            "{name}"
        );
    }
    let [accepted, rejected] = ["steps_accepted", "steps_rejected"].map(|name| results.count(name));
    assert!(accepted > 10 && ended.stdout.contains(&format!("{accepted} accepted, {rejected} rejected")));
    let method = ended.line("method");
    assert!(
        method.contains(&results.text("choice")) && method.contains("0.1 in the scaled norm"),
        "{method}"
    );
    let sizes = ended.line("step sizes");
    let limits = ["error", "growth", "stability", "travel", "contact", "maximum", "minimum", "first", "end"];
    for (name, steps) in limits.map(|name| (name, results.count(&format!("limited_by_{name}")))) {
        assert_eq!(sizes.contains(&format!("{name} {steps}")), steps > 0, "{name} of {steps} steps: {sizes}");
    }
    assert!(!ended.stdout.contains("dissipated"), "nobody asked for it:\n{}", ended.stdout);
    // Frames are a product of number and interval, the last one is t_end's.
    let times = results.times();
    assert!((0..100).all(|k| times[k] == k as f64 * 0.001) && times[100] == 0.1, "{times:?}");
}

#[test]
fn the_summary_closes_the_energy_balance_where_it_is_kept() {
    let folder = folder();
    let sets = ["output.energy=true", "solver.method=dormand-prince", "solver.tolerance=1e-7"];
    let sets: Vec<_> = sets.into_iter().flat_map(|set| ["--set", set]).collect();
    let ended = Job::alone(folder.path(), &["heap.toml", "-q"]).and(&sets).run().with_code(0);
    assert_eq!(ended.stderr, "", "nothing to warn of");
    let results = Results::open(&folder.path().join("heap.vtkhdf"));
    let last = |name: &str| *results.reals(&format!("run/series/{name}")).last().unwrap();
    let [rebound, friction] = ["dissipated_rebound", "dissipated_friction"].map(last);
    let told = format!("by rebound {} J, by friction {} J", short(rebound), short(friction));
    assert!(rebound > 0.0 && ended.line("dissipated").ends_with(&told), "{}", ended.stdout);
    let first = |name: &str| results.reals(&format!("run/series/{name}"))[0];
    let energy = |of: &dyn Fn(&str) -> f64| of("kinetic_energy") + of("potential_energy");
    let residual = energy(&last) + rebound + friction - energy(&first);
    let balance = ended.line("energy balance");
    let told: f64 = balance.split(" = ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // The sum in another order: rounding of some 10 J; and three digits are told.
    assert!((told - residual).abs() < 1e-13 + 5e-3 * residual.abs(), "{balance}, not {residual:e}");
}

#[test]
fn a_drawn_seed_is_recorded_and_the_recorded_scene_gives_the_same_bits() {
    let folder = folder();
    let path = folder.path();
    let sets =
        ["--set", "output.interval=0.05", "--set", "friction.rotation=false", "--set", "particles.mass=2"];
    let run = |arguments: &[&str]| Job::alone(path, arguments).and(&["-q"]).run().with_code(0);
    run(&[&["heap.toml", "-o", "first.vtkhdf"][..], &sets].concat());
    run(&[&["heap.toml", "--output", "second.vtkhdf"][..], &sets].concat());
    let [first, second] = ["first", "second"].map(|name| Results::open(&path.join(format!("{name}.vtkhdf"))));
    let scene = first.scene();
    let seed =
        |scene: &toml::Table| scene["particles"]["grid"]["seed"].as_integer().expect("a seed is recorded");
    assert_ne!(seed(&scene), seed(&second.scene()), "every run draws its own");
    assert_ne!(first.vectors("Points", 0), second.vectors("Points", 0));
    assert_eq!(scene["output"]["interval"].as_float(), Some(0.05));
    assert_eq!(scene["friction"]["rotation"].as_bool(), Some(false));
    assert_eq!(scene["particles"]["mass"].as_float(), Some(2.0));
    assert_eq!(scene["output"]["file"].as_str(), Some("first.vtkhdf"));
    assert_eq!(scene["solver"]["method"].as_str(), Some("auto"), "defaults are written out");
    // Into another folder, under the recorded name.
    let again = TempDir::new().unwrap();
    fs::write(again.path().join("recorded.toml"), first.text("scene")).unwrap();
    Job::alone(again.path(), &["recorded.toml", "-q"]).run().with_code(0);
    let again = Results::open(&again.path().join("first.vtkhdf"));
    assert_same_bits(&first, &again, "the recorded scene, run again");
}

#[test]
fn a_cut_force_is_warned_of_even_if_quiet() {
    let folder = folder();
    let sets = ["--set", "contact.stiffness_exponent=30", "--set", "output.interval=0.025"];
    let stderr = Job::alone(folder.path(), &["heap.toml", "-q"]).and(&sets).run().with_code(0).stderr;
    assert_eq!(progress_lines(&stderr), 0, "{stderr}");
    let warnings: Vec<_> = stderr.lines().filter(|line| line.contains("interaction_distance")).collect();
    assert_eq!(warnings.len(), 1, "{stderr}");
    // 10 N exp(-30 l) = 1e-3 m g at l = 0.230897 m. Rounded up.
    assert!(warnings[0].starts_with("warning: ") && warnings[0].contains("0.231 m"), "{}", warnings[0]);
}

#[test]
fn an_existing_file_is_replaced_if_forced() {
    let folder = folder();
    let file = folder.path().join("heap.vtkhdf");
    fs::write(&file, b"precious").unwrap();
    let sets = ["--set", "t_end=0.01", "--set", "output.interval=0.0025"];
    let ended = Job::alone(folder.path(), &["heap.toml", "--force"]).and(&sets).run().with_code(0);
    assert_eq!(Results::open(&file).count("completed"), 1);
    assert_eq!(progress_lines(&ended.stderr), 5, "a line a frame:\n{}", ended.stderr);
}

#[test]
fn what_is_wrong_before_the_first_step_is_one_message_and_code_2() {
    let folder = folder();
    for (arguments, parts) in [
        (&["absent.toml"][..], &["demhybrid: error: absent.toml"][..]),
        (&["heap.toml", "--set", "particles.grid.count=1000000000000"], &["particles.grid.count"]),
        (&[], &["error:", "SCENE"]),
        (&["heap.toml", "-q", "-v"], &["error:", "cannot be used with"]),
    ] {
        let ended = Job::alone(folder.path(), arguments).run().with_code(2);
        ended.only_error(parts);
        assert_eq!(ended.stdout, "");
    }
    assert_eq!(names(folder.path()), ["heap.toml"]);
}

#[test]
fn instruction_sets_can_be_named_and_give_the_same_bits_where_products_are_fused() {
    let run = |set: &str| {
        let folder = folder();
        let job = Job::alone(folder.path(), &["heap.toml", "--set", "particles.grid.seed=1"]);
        job.with_variable("DEMHYBRID_INSTRUCTIONS", set).run().with_code(0);
        Results::open(&folder.path().join("heap.vtkhdf"))
    };
    let all: Vec<Results> = InstructionSet::available()
        .iter()
        .map(|set| {
            let results = run(set.name());
            assert!(results.text("instruction_set").ends_with(set.name()));
            results
        })
        .collect();
    // The baseline rounds products before it adds them.
    for results in all.iter().skip(2) {
        assert_same_bits(&all[1], results, "sets with fused operations");
    }
    let folder = folder();
    let job = Job::alone(folder.path(), &["heap.toml"]).with_variable("DEMHYBRID_INSTRUCTIONS", "mmx");
    job.run().with_code(2).only_error(&["DEMHYBRID_INSTRUCTIONS", "mmx", "baseline"]);
}

#[test]
#[cfg_attr(not(feature = "mpi"), ignore = "a build without MPI has one rank")]
fn ranks_with_different_instructions_all_use_the_narrowest_and_say_so() {
    let folder = folder();
    let widest = *InstructionSet::available().last().unwrap();
    let job = Job::on(2, folder.path(), &["heap.toml", "--set", "particles.grid.seed=1", "-q"]);
    let ended = job.with_variable_of(1, "DEMHYBRID_INSTRUCTIONS", "baseline").run().with_code(0);
    let mixed = Results::open(&folder.path().join("heap.vtkhdf"));
    assert!(mixed.text("instruction_set").ends_with(" baseline"), "{}", mixed.text("instruction_set"));
    let warnings: Vec<_> = ended.stderr.lines().filter(|line| line.contains("instructions")).collect();
    // A processor that has but one set has nothing to warn of.
    assert_eq!(warnings.len(), usize::from(widest != InstructionSet::Baseline), "{}", ended.stderr);
    for warning in warnings {
        let said = format!("warning: some ranks run {} instructions, others only baseline", widest.name());
        assert!(warning.starts_with(&said), "{warning}");
    }
    let alike = |set: &str| {
        let folder = self::folder();
        let job = Job::on(2, folder.path(), &["heap.toml", "--set", "particles.grid.seed=1", "-q"]);
        let ended = job.with_variable("DEMHYBRID_INSTRUCTIONS", set).run().with_code(0);
        assert!(!ended.stderr.contains("instructions"), "{}", ended.stderr);
        let results = Results::open(&folder.path().join("heap.vtkhdf"));
        assert!(results.text("instruction_set").ends_with(set));
        results
    };
    alike(widest.name());
    assert_same_bits(&mixed, &alike("baseline"), "ranks with different instructions");
}

#[test]
fn bad_inputs_are_one_message_on_two_ranks() {
    let folder = TempDir::new().unwrap();
    let bad = |name: &str| format!("{PACKAGE}/tests/scenes/bad/{name}.toml");
    let quick = format!("{PACKAGE}/configs/quick.toml");
    for (arguments, parts) in [
        (
            &[&bad("restitution-above-one")[..]][..],
            ["one.toml:25: contact.restitution = 1.4", "is outside 0..1"],
        ),
        (&[&bad("key-misspelt")], ["key-misspelt.toml:22: unknown key contact.resitution", "did you mean"]),
        (&[&bad("syntax-open-string")], ["syntax-open-string.toml:32: not valid TOML", "expected"]),
        (
            &[&bad("count-huge")],
            ["count-huge.toml:11: particles.grid.count = 1000000000000000000", "1..1000000000"],
        ),
        (
            &[&bad("csv-not-a-number")],
            ["not-a-number.csv:4: y = \"half\" is not a number", "a finite number"],
        ),
        (
            &[&bad("csv-outside-the-box")],
            ["particle 1 (row 2 below the first line) at (1.25", "inside all walls"],
        ),
        // So many are allowed, where there is memory for them.
        (
            &[&quick, "--set", "particles.grid.count=1000000000"],
            ["1000000000 particles need about", "a smaller particles.grid.count"],
        ),
    ] {
        let ended = Job::on(2, folder.path(), arguments).run().with_code(2);
        ended.only_error(&parts);
        assert!(ended.stdout.is_empty() && names(folder.path()).is_empty(), "{}", ended.stdout);
    }
}

/// Memory that process `id` holds, bytes.
fn resident(id: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it runs");
    1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
}

#[test]
fn memory_stays_flat_over_1e5_steps() {
    // Elastic spheres bounce for ever, lists are built again and again, and a frame comes every thousand
    // steps.
    let sets = [
        "t_end=1e4",
        "output.interval=0.01",
        "solver={method='velocity-verlet', step=1e-5}",
        "contact.restitution=1",
        "friction.coefficient=0",
        "particles.grid.count=20",
    ];
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    for ranks in [0, 2] {
        let folder = folder();
        let arguments = ["heap.toml", "--threads", "1"];
        let job = if ranks == 0 {
            Job::alone(folder.path(), &arguments)
        } else {
            Job::on(ranks, folder.path(), &arguments)
        };
        let mut job = job.and(&sets).start();
        // Not a question of time: a busy machine may take it.
        job.must_end_within(600);
        job.wait_for_frames(20);
        let processes: Vec<u32> = match ranks {
            0 => vec![job.process()],
            _ => (0..ranks).map(|rank| job.process_of(rank)).collect(),
        };
        let before: Vec<u64> = processes.iter().map(|&id| resident(id)).collect();
        job.wait_for_frames(120);
        for (id, before) in processes.iter().zip(before) {
            let grown = resident(*id).saturating_sub(before);
            // Less than ten bytes a step: one number kept of each would show.
            println!("{before} bytes after 2e4 steps, {grown} more 1e5 steps later, on {ranks} ranks");
            assert!(grown < 800_000, "{grown} bytes more than {before} after 1e5 steps");
        }
    }
}
