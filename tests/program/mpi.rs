//! The program under mpirun: the same bits on any number of ranks and threads, and no job that hangs or
//! vanishes.

use crate::mpirun::{Job, PACKAGE, kill, progress_lines};
use crate::results::{Results, assert_same_bits};
use std::fmt::Write;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Seconds that a job may live on after a fault.
const FAULT_DEADLINE: u64 = 10;
/// A rank that owns this many times its share makes the slab bounds move (src/domain/slabs.rs).
const TOLERATED_IMBALANCE: f64 = 1.04;
/// Loops of fewer items are not shared by threads (src/parallel.rs).
const GRAIN: i64 = demhybrid::threads::GRAIN as i64;

const BASIC: &str = "";
const FRICTION: &str = "[friction]\ncoefficient = 0.2\nregularization_velocity = 0.1\nrotation = false\n";
const MEMORY: &str = "[friction]\nlaw = \"history\"\ncoefficient = 0.3\n\
    rolling = { coefficient = 0.05 }\ntwisting = { coefficient = 0.02 }\n";
const ROTATION: &str = "[friction]\ncoefficient = 0.2\nregularization_velocity = 0.1\nrotation = true\n";

/// A scene with the contacts of settle.toml and the particles of start.csv beside it.
fn scene(t_end: f64, interval: f64, container: &str, friction: &str) -> String {
    format!(
        "t_end = {t_end}\ngravity = [0.0, 0.0, -9.81]\n\
         particles = {{ radius = 0.1, mass = 1, file = \"start.csv\" }}\n\
         container = {container}\noutput.interval = {interval}\n{CONTACT}{friction}"
    )
}

const CONTACT: &str = "
[contact]
repulsion_at_contact = 10.0
stiffness_exponent = 150.0
restitution = 0.4
dissipation_focusing = 10.0
interaction_distance = 0.1
";

/// Uniform numbers in [-1, 1), always the same ones: the splitmix64 generator.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / 2f64.powi(63) - 1.0
    }
}

/// The text of a start file; spins only where they are wanted.
fn csv(bodies: &[[f64; 9]], spins: bool) -> String {
    let columns = if spins { 9 } else { 6 };
    let names = ["x", "y", "z", "vx", "vy", "vz", "avx", "avy", "avz"];
    let mut text = names[..columns].join(",") + "\n";
    for body in bodies {
        let row: Vec<String> = body[..columns].iter().map(|number| format!("{number:?}")).collect();
        writeln!(text, "{}", row.join(",")).unwrap();
    }
    text
}

/// 2000 spheres in a column of 2.5 m x 2.5 m that rushes together: the higher, the faster it falls. Heights
/// are spread evenly, and every sphere has some speed of its own, so that slab bounds move and spheres cross
/// them.
fn rushing_column() -> Vec<[f64; 9]> {
    let mut uniform = Uniform(7);
    let body = |k: usize| {
        let cell = [k % 10, (k / 10) % 10, k / 100];
        let [x, y, z] = cell.map(|c| 0.25 * (c as f64 + 0.5) + 0.02 * uniform.next());
        let z = z + 0.025 * ((7 * cell[0] + 3 * cell[1]) % 10) as f64;
        let [u, v, w] = [0.5, 0.5, 1.0].map(|speed| speed * uniform.next());
        let [a, b, c] = [(); 3].map(|()| 5.0 * uniform.next());
        [x, y, z, u, v, w - 2.0 * z, a, b, c]
    };
    (0..2000).map(body).collect()
}

const WIDE_BOX: &str = "{ box = { min = [0.0, 0.0, 0.0], max = [2.5, 2.5, inf] } }";

/// A folder with scene.toml and start.csv.
fn folder(scene: &str, start: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    fs::write(folder.path().join("start.csv"), start).unwrap();
    folder
}

/// A folder with the column in all its physics, a frame every millisecond, for faults in the middle of a run.
fn long_run() -> TempDir {
    folder(&scene(0.2, 0.001, WIDE_BOX, ROTATION), &csv(&rushing_column(), true))
}

/// Runs scene.toml of `folder` and returns what it wrote; without mpirun where `ranks` is 0.
fn results(folder: &Path, ranks: usize, threads: usize) -> Results {
    results_with(folder, ranks, threads, &[])
}

/// `results` with keys of the scene set.
fn results_with(folder: &Path, ranks: usize, threads: usize, sets: &[&str]) -> Results {
    let file = folder.join(format!("{ranks}-{threads}-{}", sets.concat().replace('/', "")));
    fs::create_dir(&file).unwrap();
    let arguments = ["../scene.toml", "--threads", &threads.to_string(), "-q"];
    let job = if ranks == 0 { Job::alone(&file, &arguments) } else { Job::on(ranks, &file, &arguments) };
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    job.and(&sets).run().with_code(0);
    let results = Results::open(&file.join("scene.vtkhdf"));
    assert_eq!((results.count("ranks"), results.count("threads")), (ranks.max(1) as i64, threads as i64));
    assert_eq!(results.count("completed"), 1);
    results
}

/// The number of the slab, of `ranks` slabs with equal counts, that every particle is in.
fn slabs(x: &[[f64; 3]], ranks: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&i, &j| x[i][2].total_cmp(&x[j][2]));
    let mut slabs = vec![0; x.len()];
    order.iter().enumerate().for_each(|(rank, &i)| slabs[i] = rank * ranks / x.len());
    slabs
}

/// Whether a run on `ranks` ranks had to do all that could spoil its bits.
fn assert_particles_migrated_and_bounds_moved(results: &Results, ranks: usize) {
    let (first, last) = (results.vectors("Points", 0), results.vectors("Points", results.frames() - 1));
    let (before, after) = (slabs(&first, ranks), slabs(&last, ranks));
    let migrated = (0..first.len()).filter(|&i| before[i] != after[i]).count();
    assert!(migrated >= 8, "only {migrated} particles are in another of {ranks} slabs at the end");
    // Had the bounds stayed, some rank would own more than the program tolerates.
    let bounds: Vec<f64> = (1..ranks)
        .map(|q| {
            (0..first.len()).filter(|&i| before[i] >= q).map(|i| first[i][2]).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mut owned = vec![0; ranks];
    last.iter().for_each(|x| owned[bounds.partition_point(|&bound| bound <= x[2])] += 1);
    let largest = *owned.iter().max().unwrap() as f64 * ranks as f64 / last.len() as f64;
    assert!(largest > TOLERATED_IMBALANCE, "the bounds of {ranks} slabs need not move: {owned:?}");
}

#[track_caller]
fn assert_ranks_and_threads_do_not_matter(friction: &str) {
    let spins = friction == ROTATION || friction == MEMORY;
    let folder = folder(&scene(0.12, 0.02, WIDE_BOX, friction), &csv(&rushing_column(), spins));
    let published = ["solver.method=merson", "solver.norm=paper"];
    let alone = results_with(folder.path(), 1, 1, &published);
    assert_eq!((alone.frames(), alone.particles()), (7, 2000));
    assert_eq!(alone.vector_names().contains(&"PointData/angular_velocity"), spins);
    let ids: Vec<i64> = (0..2000).collect();
    assert_eq!(alone.counts("VTKHDF/PointData/id"), ids);
    for ranks in 2..=4 {
        assert_particles_migrated_and_bounds_moved(&alone, ranks);
    }
    // Pairs within l_max are a part of those listed.
    let series = |name| *alone.counts(&format!("run/series/{name}")).last().unwrap();
    let pairs = series("pair_evaluations") / series("rhs_evaluations");
    assert!(pairs / 3 > GRAIN, "{pairs} pairs are too few for threads to share on 3 ranks");
    assert!(series("steps_rejected") > 10, "rejected steps must be the same ones too");
    for (ranks, threads) in [(1, 2), (2, 1), (3, 2), (4, 1)] {
        let other = results_with(folder.path(), ranks, threads, &published);
        assert_same_bits(&alone, &other, &format!("{ranks} ranks of {threads} threads, against 1 of 1"));
    }
}

#[test]
fn ranks_and_threads_do_not_matter_to_any_method() {
    let folder = folder(&scene(0.12, 0.02, WIDE_BOX, ROTATION), &csv(&rushing_column(), true));
    for solver in [
        &["solver.method=auto"][..],
        &["solver.method=auto", "solver.tolerance=1e-4"],
        &["solver.method=dormand-prince", "solver.tolerance=1e-4"],
        &["solver.method=chebyshev", "solver.tolerance=1e-2"],
        &["solver.method=velocity-verlet", "solver.step=1e-4"],
    ] {
        let alone = results_with(folder.path(), 1, 1, solver);
        assert!(alone.count("lists_built") > 2, "{solver:?}: slopes and directions must migrate too");
        for (ranks, threads) in [(2, 1), (3, 2)] {
            let other = results_with(folder.path(), ranks, threads, solver);
            assert_same_bits(&alone, &other, &format!("{solver:?}: {ranks} ranks of {threads} threads"));
        }
    }
}

#[test]
fn ranks_and_threads_do_not_matter_to_smooth_spheres() {
    assert_ranks_and_threads_do_not_matter(BASIC);
}

#[test]
fn ranks_and_threads_do_not_matter_to_rough_spheres_that_cannot_turn() {
    assert_ranks_and_threads_do_not_matter(FRICTION);
}

#[test]
fn ranks_and_threads_do_not_matter_to_rough_spheres_that_turn() {
    assert_ranks_and_threads_do_not_matter(ROTATION);
}

#[test]
fn ranks_and_threads_do_not_matter_to_contacts_that_remember() {
    assert_ranks_and_threads_do_not_matter(MEMORY);
    // The stabilised method, at rest too: lists are built again, and steps are long.
    let text = scene(0.15, 0.05, WIDE_BOX, MEMORY);
    let folder = folder(&text, &csv(&rushing_column(), true));
    let solver = ["solver.method=chebyshev", "output.energy=true"];
    let alone = results_with(folder.path(), 1, 1, &solver);
    assert!(alone.count("lists_built") > 2, "memories must migrate too");
    for (ranks, threads) in [(1, 2), (2, 1), (3, 2), (4, 1)] {
        let other = results_with(folder.path(), ranks, threads, &solver);
        assert_same_bits(&alone, &other, &format!("{ranks} ranks of {threads} threads"));
    }
}

/// `ranks` ranks give the bits of the program alone, without mpirun.
#[track_caller]
fn assert_same_as_alone(bodies: &[[f64; 9]], container: &str, ranks: usize) -> Results {
    let folder = folder(&scene(0.15, 0.05, container, ROTATION), &csv(bodies, true));
    let alone = results(folder.path(), 0, 1);
    assert_same_bits(&alone, &results(folder.path(), ranks, 1), &format!("{ranks} ranks against none"));
    alone
}

#[test]
fn ranks_do_not_matter_to_the_energy_that_contacts_dissipate() {
    let text = format!("output.energy = true\n{}", scene(0.12, 0.02, WIDE_BOX, ROTATION));
    let folder = folder(&text, &csv(&rushing_column(), true));
    let alone = results(folder.path(), 1, 1);
    for name in ["dissipated_rebound", "dissipated_friction"] {
        let energy = alone.reals(&format!("run/series/{name}"));
        assert_eq!((energy.len(), energy[0]), (7, 0.0), "{name}");
        assert!(energy[6] > 1.0, "{name}: {} J is little to compare", energy[6]);
    }
    for ranks in [2, 3] {
        assert_same_bits(&alone, &results(folder.path(), ranks, 1), &format!("{ranks} ranks against 1"));
    }
}

/// Spheres of one layer with a square of `side` spheres; heights between `low` and `high` (m).
fn layer(side: usize, low: f64, high: f64) -> Vec<[f64; 9]> {
    let mut uniform = Uniform(3);
    let body = |k: usize| {
        let [x, y] = [k % side, k / side].map(|c| 0.19 * (c as f64 + 0.5) + 0.005 * uniform.next());
        let z = low + (high - low) * (0.5 + 0.5 * uniform.next());
        let [u, v, w] = [(); 3].map(|()| 0.5 * uniform.next());
        [x, y, z, u, v, w, 0.0, 1.0, 0.0]
    };
    (0..side * side).map(body).collect()
}

#[test]
fn slabs_thinner_than_the_extent_of_ghosts_give_the_same_bits() {
    // 64 spheres within 0.2 m, slabs of about 0.05 m; ghosts reach 2 r + l_max = 0.3 m and more.
    let results = assert_same_as_alone(&layer(8, 0.1, 0.3), WIDE_BOX, 4);
    let heights = results.vectors("Points", results.frames() - 1).into_iter().map(|x| x[2]);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
    assert!(high - low < 0.3, "all of them are still within one range of ghosts: {low} m to {high} m");
    assert!(results.counts("run/series/pair_evaluations").last() > Some(&1000), "they must touch");
}

#[test]
fn more_ranks_than_particles_give_the_same_bits() {
    let spins = [3.0, -2.0, 5.0];
    let at = |x, z, w| [x, 0.5, z, 0.2, 0.0, w, spins[0], spins[1], spins[2]];
    let results =
        assert_same_as_alone(&[at(0.5, 0.15, 0.0), at(0.6, 0.35, -1.0), at(0.5, 0.6, -3.0)], WIDE_BOX, 4);
    assert!(results.counts("run/series/pair_evaluations").last() > Some(&10), "they must touch");
}

#[test]
fn particles_at_one_height_give_the_same_bits() {
    // No bound can part them: one rank owns all, the others nothing.
    let results = assert_same_as_alone(&layer(5, 0.1, 0.1), WIDE_BOX, 3);
    assert!(results.counts("run/series/pair_evaluations").last() > Some(&100), "they must touch");
}

#[test]
fn one_particle_on_four_ranks_gives_the_same_bits() {
    let results = assert_same_as_alone(&[[0.5, 0.5, 0.2, 1.0, 0.0, -1.0, 0.0, 9.0, 0.0]], WIDE_BOX, 4);
    assert_ne!(
        results.vectors("PointData/angular_velocity", results.frames() - 1)[0][1],
        9.0,
        "the floor rubs"
    );
}

/// Numbers of a CSV file with the columns x,y,z,vx,vy,vz,avx,avy,avz.
fn read_csv(file: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(file).unwrap_or_else(|why| panic!("{}: {why}", file.display()));
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("x,y,z,vx,vy,vz,avx,avy,avz"));
    lines.map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect()
}

#[test]
fn reference_cases_end_where_they_should_on_two_and_three_ranks() {
    let reference = Path::new(PACKAGE).join("tests/data/reference");
    for name in ["oblique_pair", "six_basic", "six_in_box"] {
        let expected = read_csv(&reference.join(format!("{name}.end.csv")));
        for ranks in [2, 3] {
            let folder = TempDir::new().unwrap();
            let scene = reference.join(format!("{name}.toml"));
            Job::on(ranks, folder.path(), &[scene.to_str().unwrap(), "-q", "-o", "run.vtkhdf"])
                .run()
                .with_code(0);
            let results = Results::open(&folder.path().join("run.vtkhdf"));
            let columns: Vec<_> = results
                .vector_names()
                .into_iter()
                .map(|name| results.vectors(name, results.frames() - 1))
                .collect();
            assert!(columns.len() >= 2 && columns.iter().all(|rows| rows.len() == expected.len()));
            for (i, row) in expected.iter().enumerate() {
                for (c, wanted) in row.iter().enumerate() {
                    let found = columns.get(c / 3).map_or(0.0, |rows| rows[i][c % 3]);
                    // The reference is good to 1e-10 or so.
                    let off = (found - wanted).abs();
                    assert!(
                        off <= 1e-6,
                        "{name}, particle {i}, column {c}: {found} is {off:e} off, {ranks} ranks"
                    );
                }
            }
        }
    }
}

/// A fault on rank 1 ends the job in time, with one message, and the frames before it stay.
#[track_caller]
fn assert_fault_ends_the_job(points: &str, threads: &str, parts: &[&str]) {
    let folder = long_run();
    let arguments = ["scene.toml", "--threads", threads, "--set", "output.sync=frame"];
    let mut job = Job::on(2, folder.path(), &arguments).with_fault(1, points).start();
    job.wait_for("a message", |text| text.contains("demhybrid: internal error"));
    job.must_end_within(FAULT_DEADLINE);
    let ended = job.end().with_code(70);
    ended.only_error(parts);
    assert!(!ended.stdout.contains("done"), "{}", ended.stdout);
    let frames = Results::open(&folder.path().join("scene.vtkhdf")).frames();
    assert!(frames >= progress_lines(&ended.stderr).max(1), "{frames} frames");
}

#[test]
fn a_panic_in_the_right_hand_side_of_one_rank_ends_the_job() {
    assert_fault_ends_the_job("rhs=300*off->panic(no slope today)", "1", &["rank 1", "no slope today"]);
}

#[test]
fn a_panic_in_a_worker_thread_of_one_rank_ends_the_job() {
    // Every worker of the rank panics from then on; one of them tells.
    let parts = ["rank 1", "no pair today"];
    assert_fault_ends_the_job("worker=1000*off->panic(no pair today)", "2", &parts);
}

#[test]
fn a_panic_while_ghosts_are_under_way_ends_the_job() {
    let parts = ["rank 1", "no walls today"];
    assert_fault_ends_the_job("underway=300*off->panic(no walls today)", "1", &parts);
}

#[test]
fn a_panic_in_the_output_of_one_rank_ends_the_job() {
    assert_fault_ends_the_job("output=2*off->panic(no frame today)", "1", &["rank 1", "no frame today"]);
}

#[test]
fn a_killed_rank_ends_the_job_of_those_that_wait_for_it() {
    let folder = long_run();
    // Rank 1 falls asleep in mid-run; when frames stop, rank 0 waits for it.
    let faults = "rhs=300*off->sleep(100000)";
    let arguments = ["scene.toml", "--set", "output.sync=frame"];
    let mut job = Job::on(2, folder.path(), &arguments).with_fault(1, faults).start();
    job.wait_for_frames(1);
    let mut quiet = (job.stderr(), Instant::now());
    while quiet.1.elapsed() < Duration::from_secs(2) {
        sleep(Duration::from_millis(50));
        let said = job.stderr();
        if said != quiet.0 {
            quiet = (said, Instant::now());
        }
    }
    kill(job.process_of(1));
    job.must_end_within(FAULT_DEADLINE);
    let ended = job.end();
    assert_ne!(ended.code, 0, "{}", ended.stderr);
    assert!(!ended.stdout.contains("done"), "{}", ended.stdout);
    let frames = Results::open(&folder.path().join("scene.vtkhdf")).frames();
    assert!(frames >= progress_lines(&ended.stderr), "{frames} frames");
}

#[test]
fn the_file_of_a_killed_run_holds_every_frame_it_tells_of() {
    let grid = "{ box = { min = [0.0, 0.0, 0.0], max = [1.6, 1.6, inf] } }";
    let folder = folder(&scene(0.2, 0.001, grid, ROTATION), &csv(&layer(8, 0.15, 0.35), true));
    let whole = results(folder.path(), 2, 1);
    let times = whole.times();
    assert_eq!(times.len(), 201);
    for (round, frames) in [2, 40, 90, 150].into_iter().enumerate() {
        let own = folder.path().join(format!("killed-{round}"));
        fs::create_dir(&own).unwrap();
        let mut job =
            Job::on(2, &own, &["../scene.toml", "--threads", "1", "--set", "output.sync=frame"]).start();
        job.wait_for_frames(frames);
        // Another moment within a frame every time.
        sleep(Duration::from_micros(700 * round as u64));
        [1, 0].into_iter().for_each(|rank| kill(job.process_of(rank)));
        job.must_end_within(FAULT_DEADLINE);
        let ended = job.end();
        assert_ne!(ended.code, 0, "killed too late, after {frames} frames: {}", ended.stdout);
        let file = Results::open(&own.join("scene.vtkhdf"));
        let there = file.frames();
        assert!((frames..=times.len()).contains(&there), "{there} frames, {frames} were told of");
        assert_eq!((file.count("completed"), file.times().as_slice()), (0, &times[..there]));
        for name in whole.vector_names() {
            for k in 0..there {
                assert_eq!(file.vectors(name, k), whole.vectors(name, k), "{name} of frame {k} of {there}");
            }
        }
        let steps = |file: &Results| file.counts("run/series/steps_accepted")[..there].to_vec();
        assert_eq!(steps(&file), steps(&whole));
    }
}

#[test]
fn coincident_centres_are_one_message_that_names_them() {
    let at = |x: f64, z: f64| [x, 0.5, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let bodies = [at(0.5, 0.3), at(1.5, 0.6), at(1.0, 0.9), at(1.5, 0.6)];
    for ranks in [1, 2] {
        let folder = folder(&scene(0.1, 0.01, WIDE_BOX, ROTATION), &csv(&bodies, true));
        let ended = Job::on(ranks, folder.path(), &["scene.toml"]).run().with_code(2);
        ended.only_error(&["particles 1 and 3 (rows 2 and 4 below the first line) have the same centre"]);
        // Nothing was computed, and no file stands in the way of the corrected scene.
        assert!(!folder.path().join("scene.vtkhdf").exists());
    }
}

#[test]
fn centres_that_meet_in_mid_run_end_it_and_leave_the_frames_before() {
    // Forces too weak to matter, steps of 1/512 s that cannot be smaller: two spheres that are 0.5 m apart
    // and close at 8 m/s share one centre exactly at a step, 1/16 s.
    let sphere = |x, z, w| [x, 0.5, z, 0.0, 0.0, w, 0.0, 0.0, 0.0];
    let start = csv(&[sphere(2.0, 0.5, 0.0), sphere(1.0, 0.75, 4.0), sphere(1.0, 1.25, -4.0)], false);
    let folder = folder(&scene(0.2, 0.01, WIDE_BOX, BASIC), &start);
    let sets = ["gravity=[0,0,0]", "contact.repulsion_at_contact=1e-300", "solver.initial_step=0.001953125"];
    let steps = ["solver.min_step=0.001953125", "solver.max_step=0.001953125"];
    let sets: Vec<_> = sets.into_iter().chain(steps).flat_map(|set| ["--set", set]).collect();
    let ended = Job::on(2, folder.path(), &["scene.toml"]).and(&sets).run().with_code(3);
    ended.only_error(&["demhybrid: error: ", "centres of particles 1 and 2 coincide at t = 0.0625 s"]);
    let results = Results::open(&folder.path().join("scene.vtkhdf"));
    assert_eq!((results.frames(), results.count("completed")), (7, 0), "{}", ended.stderr);
    assert!((results.vectors("Points", 5)[1][2] - 0.95).abs() < 1e-12);
}

/// A folder in which this user cannot create a file: one without the permission, or, for root whom
/// permissions do not bind, one in a file system that is mounted read-only, if there is any.
fn unwritable_folder(below: &Path) -> Option<PathBuf> {
    let closed = below.join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    let read_only = |line: &str| {
        let mut fields = line.split(' ').skip(1);
        let (folder, options) = (fields.next()?, fields.nth(1)?);
        let usable = options.split(',').any(|option| option == "ro") && Path::new(folder).is_dir();
        usable.then(|| PathBuf::from(folder))
    };
    let mounts = fs::read_to_string("/proc/mounts").unwrap_or_default();
    let candidates = std::iter::once(closed).chain(mounts.lines().filter_map(read_only));
    candidates.into_iter().find(|folder| tempfile::tempfile_in(folder).is_err())
}

#[test]
fn a_path_that_cannot_be_written_to_is_refused_before_the_first_step() {
    let (folder, other) = (long_run(), TempDir::new().unwrap());
    let path = folder.path();
    fs::write(path.join("old.vtkhdf"), b"precious").unwrap();
    fs::create_dir(path.join("runs")).unwrap();
    let unwritable =
        unwritable_folder(other.path()).map(|folder| folder.join("run.vtkhdf").display().to_string());
    let paths = [
        ("missing/run.vtkhdf", "there is no folder"),
        ("start.csv/run.vtkhdf", "choose another path"),
        // Root may write to it, but nobody can.
        ("/proc/run.vtkhdf", "choose another path"),
        ("runs", "is a folder"),
        ("old.vtkhdf", "--force"),
    ];
    let unwritable = unwritable.as_deref().map(|file| (file, "choose another"));
    for (file, part) in paths.into_iter().chain(unwritable) {
        let ended = Job::on(2, path, &["scene.toml", "--output", file]).run().with_code(2);
        ended.only_error(&[&format!("\"{file}\""), part]);
        assert!(
            progress_lines(&ended.stderr) == 0 && ended.stdout.is_empty(),
            "{}{}",
            ended.stdout,
            ended.stderr
        );
    }
    assert_eq!(fs::read(path.join("old.vtkhdf")).unwrap(), b"precious");
    let mut left: Vec<_> = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["old.vtkhdf", "runs", "scene.toml", "start.csv"]);
}

#[test]
fn the_output_is_collective_and_threads_are_the_cores_divided_by_the_ranks_unless_told_otherwise() {
    let folder = folder(&scene(0.01, 0.005, WIDE_BOX, BASIC), &csv(&layer(3, 0.15, 0.35), false));
    let threads = |arguments: &[&str], variable: Option<&str>| {
        let mut job = Job::on(2, folder.path(), &["scene.toml", "-q", "--force"]).and(arguments);
        if let Some(number) = variable {
            job = job.with_variable("RAYON_NUM_THREADS", number);
        }
        let ended = job.run().with_code(0);
        let threads = Results::open(&folder.path().join("scene.vtkhdf")).count("threads");
        assert!(
            ended.line("wall time").contains(&format!("on 2 ranks with {threads} threads")),
            "{}",
            ended.stdout
        );
        // On the way: HDF5's own report of how the frames were written.
        let output = ended.line("output ");
        assert!(output.contains("3 frames") && output.contains("collective"), "{output}");
        assert!(!output.contains("independent"), "{output}");
        threads
    };
    let cores = std::thread::available_parallelism().unwrap().get();
    assert_eq!(threads(&[], None), (cores / 2).max(1) as i64);
    assert_eq!(threads(&[], Some("3")), 3);
    assert_eq!(threads(&["--threads", "5"], Some("3")), 5);
}

#[test]
fn a_mistake_is_told_once_whatever_the_number_of_ranks() {
    let folder = folder(
        &format!("{}tolerance = 1\n", scene(0.01, 0.01, WIDE_BOX, BASIC)),
        &csv(&layer(3, 0.15, 0.35), false),
    );
    let tell = |arguments: &[&str], parts: &[&str]| {
        let ended = Job::on(2, folder.path(), arguments).run().with_code(2);
        ended.only_error(parts);
        assert!(ended.stdout.is_empty(), "{}", ended.stdout);
        let mut lines: Vec<_> =
            ended.stderr.lines().filter(|line| !line.starts_with('-') && !line.is_empty()).collect();
        let all = lines.len();
        lines.sort_unstable();
        lines.dedup();
        assert_eq!(lines.len(), all, "lines come twice:\n{}", ended.stderr);
    };
    tell(&["scene.toml"], &["demhybrid: error: scene.toml:", "tolerance"]);
    let quick = format!("{PACKAGE}/configs/quick.toml");
    tell(
        &[&quick, "--set", "contact.restitution=1.4"],
        &["--set contact.restitution=1.4", "is outside 0..1"],
    );
    tell(&[&quick, "--bogus"], &["error: unexpected argument '--bogus'", "Usage"]);
}
