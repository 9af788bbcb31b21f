//! A run that is stopped, saved and resumed on other ranks ends with the same bits. A broken file is refused.

use super::{FORMAT, Header, bytes, clear_unfinished, look, read, slot, slots, unfinished, verify, write};
use crate::domain::comm::team::team;
use crate::domain::{Comm, Solo, rows};
use crate::engine::simulation::{Counts, Frame, FrameSummary, Observer, Simulation, Snapshot};
use crate::error::{Error, StopRequest};
use crate::files::beside;
use crate::model::columns::{Changes, Column, Columns};
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use std::cell::Cell;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::TempDir;

/// 60 spheres that fall onto the floor and each other within 0.7 s.
const SCENE: &str = "
    t_end = 0.7
    gravity = [0, 0, -9.81]
    particles = { radius = 0.1, mass = 1, grid = { count = 60, bottom = 0.3, seed = 3 } }
    container.box = { min = [0, 0, 0], max = [1, 1, inf] }
    contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                dissipation_focusing = 10, interaction_distance = 0.1 }
    output.interval = 0.07
";
const MEMORY: &str = "friction = { law = 'history', coefficient = 0.3, rolling = { coefficient = 0.05 }, \
                      twisting = { coefficient = 0.02 } }";
const FRICTION: &str = "friction = { coefficient = 0.2, regularization_velocity = 0.01 }";

fn scene(sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    Scene::parse("a.toml", SCENE, &sets).unwrap()
}

/// A column that travels with the particles and does not act on them.
fn tag() -> Column {
    let (name, unit) = ("tag".to_owned(), "1".to_owned());
    Column { name, width: 2, unit, changes: Changes::WithLists, in_file: true, names: Vec::new() }
}

/// The tags of the particles with these ids.
fn tags(ids: Range<u64>) -> Vec<f64> {
    ids.flat_map(|id| [id as f64, 0.5 - id as f64]).collect()
}

fn start(scene: &Scene) -> InitialCondition {
    let mut start = initial_condition::grid(scene, scene.particles.grid.as_ref().unwrap());
    start.columns.push((tag(), tags(0..start.x.len() as u64)));
    start
}

/// The frames of a run: bits of the time, bits of states by id, counts, and bits of further measures.
#[derive(Debug, Clone, Default, PartialEq)]
struct Film(Vec<(u64, Vec<u64>, Counts, [u64; 5])>);

/// Observer that collects frames and writes checkpoints.
struct Camera<'a> {
    film: Film,
    comm: &'a dyn Comm,
    scene: &'a Scene,
    scale: f64,
    path: &'a Path,
}

impl Observer for Camera<'_> {
    fn frame(&mut self, frame: &Frame) -> Result<(), Error> {
        let bits = |row: &[f64]| row.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
        let tags = tags(rows::block(60, self.comm.rank(), self.comm.size()));
        assert_eq!(frame.numbers(&tag()), tags, "tags stay with their particles");
        // Every rank has another block. So only the first 15 particles are compared. On up to 4 ranks, rank 0
        // has them.
        let bits = frame.rows.map(bits).into_iter().take(15).flatten().collect();
        let measures = [
            frame.step,
            frame.kinetic_energy,
            frame.potential_energy,
            frame.largest_overlap,
            frame.dissipated[1],
        ];
        self.film.0.push((frame.time.to_bits(), bits, frame.counts, measures.map(f64::to_bits)));
        Ok(())
    }

    fn checkpoint(&mut self, snapshot: &Snapshot) -> Result<(), Error> {
        let header = Header {
            serial: 1,
            version: "of the test".into(),
            instruction_set: "any".into(),
            scene: self.scene.resolved(),
            count: snapshot.count,
            columns: snapshot.columns.clone(),
            contact_slots: snapshot.contact_slots,
            velocity_scale: self.scale,
            wall_seconds: 1.5,
            course: FrameSummary::default(),
            memory: snapshot.memory,
        };
        write(self.comm, self.path, &header, snapshot)
    }
}

/// Runs a scene on this rank, from the start or, if `resumes`, from the checkpoint; returns its frames.
///
/// A stop is requested from trial step number `stop` on.
struct Part<'a> {
    scene: &'a Scene,
    comm: &'a dyn Comm,
    path: &'a Path,
    resumes: bool,
    stop: u64,
}

impl Part<'_> {
    fn run(self) -> Film {
        let Part { scene, comm, path, resumes, stop } = self;
        let trials = Cell::new(0);
        let interrupts = || {
            trials.set(trials.get() + 1);
            if trials.get() >= stop { StopRequest::StopFile } else { StopRequest::Nothing }
        };
        let start = start(scene);
        let scale = initial_condition::velocity_scale(scene, &start);
        let mut simulation = if resumes {
            verify(comm, path).unwrap();
            let (Header { count, columns, velocity_scale, .. }, remembered) = read(comm, path).unwrap();
            Simulation::resume(scene, comm, (count, columns), velocity_scale, remembered).unwrap()
        } else {
            Simulation::new(scene, &start, comm).unwrap()
        };
        simulation.listen_to(&interrupts);
        let mut camera = Camera { film: Film::default(), comm, scene, scale, path };
        let outcome = simulation.run(&mut camera).unwrap();
        assert!(outcome.stopped.is_none() || stop < u64::MAX);
        camera.film
    }
}

/// Does a part of a run on `ranks` ranks; returns the frames of rank 0.
fn part(scene: &Scene, ranks: usize, path: &Path, resumes: bool, stop: u64) -> Film {
    let film = Mutex::new(Film::default());
    let run = |comm: &dyn Comm| {
        let own = Part { scene, comm, path, resumes, stop }.run();
        if comm.rank() == 0 {
            *film.lock().unwrap() = own;
        }
    };
    match ranks {
        1 => run(&Solo),
        _ => team(ranks, run),
    }
    film.into_inner().unwrap()
}

#[test]
fn a_run_that_was_stopped_goes_on_to_the_same_bits_with_every_method_on_any_ranks() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a");
    let cases: [&[&str]; 10] = [
        &[FRICTION],
        &[FRICTION, "solver.method=merson", "output.energy=true"],
        &[FRICTION, "solver.method=chebyshev", "output.energy=true"],
        &[FRICTION, "solver.method=dormand-prince", "solver.norm=paper"],
        &[FRICTION, "solver.method=velocity-verlet", "solver.step=1e-4"],
        &["friction={ coefficient = 0.3, regularization_velocity = 0.1, rotation = false }"],
        &["solver.tolerance=1e-3"],
        &["friction = { law = 'history', coefficient = 0.3 }"],
        &[MEMORY, "solver.method=chebyshev", "output.energy=true"],
        &[MEMORY, "solver.method=merson", "solver.norm=scaled"],
    ];
    let mut matrix = 0;
    for sets in cases {
        let scene = scene(sets);
        let whole = part(&scene, 1, &path, false, u64::MAX);
        let last = whole.0.last().unwrap().2;
        let trials = last.accepted + last.rejected + last.outrun;
        // A stop in free flight, a stop during the impacts, and a stop near the end.
        for (stop, ranks) in [(2, 1), (trials / 3, 2), (trials - 3, 3)] {
            let mut film = part(&scene, ranks, &path, false, stop.max(1));
            for ranks in [1, 2, 3] {
                let rest = part(&scene, ranks, &path, true, u64::MAX);
                let mut both = film.clone();
                both.0.extend(rest.0);
                assert_eq!(both.0.len(), whole.0.len(), "{sets:?}: frames");
                for (found, expected) in both.0.iter().zip(&whole.0) {
                    assert_eq!(
                        found, expected,
                        "{sets:?}, stopped at trial {stop}, resumed on {ranks} ranks"
                    );
                }
                matrix += 1;
            }
            film.0.clear();
        }
    }
    println!("{matrix} runs were stopped and taken up again");
    assert_eq!(matrix, 90);
}

#[test]
fn a_run_that_looks_out_for_rest_is_the_same_until_it_ends_and_so_is_its_second_part() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a");
    let plain = part(&scene(&[FRICTION]), 1, &path, false, u64::MAX);
    let watchful = scene(&[
        FRICTION,
        "stop={ unbalanced_force = 1e-12, kinetic_energy = 1e-30, height_change = 1e-12 }",
    ]);
    let watched = part(&watchful, 2, &path, false, u64::MAX);
    let seen = |film: &Film| film.0.iter().map(|frame| (frame.0, frame.1.clone())).collect::<Vec<_>>();
    assert_eq!(seen(&watched), seen(&plain));
    // The run may end early, at rest. If it is stopped before that and resumed, it ends at the same time.
    // Forces balance from 0.35 s on, and the fastest sphere of all ranks decides until 0.46 s.
    let stops = scene(&[FRICTION, "stop={ unbalanced_force = 0.5, speed = 1, window = 0.02 }"]);
    let whole = part(&stops, 1, &path, false, u64::MAX);
    let end = f64::from_bits(whole.0.last().unwrap().0);
    assert!(end > 0.2 && end < 0.7, "{end} s");
    let mut film = part(&stops, 3, &path, false, 40);
    assert!(film.0.len() < whole.0.len());
    film.0.extend(part(&stops, 2, &path, true, u64::MAX).0);
    assert_eq!(film, whole);
    // A run that is resumed from the checkpoint at its end comes to the same end again.
    let saves = scene(&[
        FRICTION,
        "stop={ unbalanced_force = 0.5, speed = 1, window = 0.02 }",
        "checkpoint.interval=100",
    ]);
    assert_eq!(part(&saves, 2, &path, false, u64::MAX), whole);
    let again = part(&saves, 1, &path, true, u64::MAX);
    assert!(!again.0.is_empty());
    assert_eq!(again.0, whole.0[whole.0.len() - again.0.len()..]);
}

#[test]
fn a_run_may_be_stopped_again_and_again() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a");
    let scene = scene(&[FRICTION]);
    let whole = part(&scene, 1, &path, false, u64::MAX);
    let mut film = part(&scene, 1, &path, false, 5);
    let mut stops = 0;
    while film.0.len() < whole.0.len() {
        // One trial step repeats the last step before the stop. The others are new.
        film.0.extend(part(&scene, 1 + stops % 3, &path, true, 40 + stops as u64).0);
        stops += 1;
        if stops > 20 && film.0.len() < whole.0.len() {
            film.0.extend(part(&scene, 2, &path, true, u64::MAX).0);
        }
    }
    assert_eq!(film, whole);
}

/// An intact checkpoint in a temporary folder, written by two ranks.
fn sound() -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a");
    part(&scene(&[FRICTION]), 2, &path, false, 30);
    (folder, path)
}

/// Why a file cannot be used; none if it can.
fn refusal(path: &Path) -> Option<String> {
    match look(path) {
        None => Some("nothing".into()),
        Some(Err(why)) => Some(why),
        Some(Ok(_)) => verify(&Solo, path).err(),
    }
}

#[test]
fn a_byte_that_is_wrong_anywhere_is_found() {
    let (_folder, path) = sound();
    assert_eq!(refusal(&path), None);
    let whole = fs::read(&path).unwrap();
    let mut columns = Columns::new(true);
    columns.push(tag());
    assert!(whole.len() as u64 <= bytes(60, &columns, 0));
    // Every byte of the header and the table, and some bytes between.
    let near_an_end = |at: &usize| *at < 2000 || at + 100 > whole.len() || at.is_multiple_of(97);
    let mut tried = 0;
    for at in (0..whole.len()).filter(near_an_end) {
        let mut wrong = whole.clone();
        wrong[at] ^= 1 << (at % 8);
        fs::write(&path, &wrong).unwrap();
        let why = refusal(&path).unwrap_or_else(|| panic!("byte {at} of {} does not matter", whole.len()));
        assert!(why.contains("is not a checkpoint that can be used: "), "{why}");
        tried += 1;
    }
    println!("{tried} bytes changed");
    assert!(tried > 2000);
}

#[test]
fn a_file_that_is_cut_off_or_foreign_is_refused() {
    let (_folder, path) = sound();
    let whole = fs::read(&path).unwrap();
    for length in (0..whole.len()).step_by(41) {
        fs::write(&path, &whole[..length]).unwrap();
        assert!(refusal(&path).is_some(), "{length} bytes of {}", whole.len());
    }
    fs::write(&path, [&whole[..], b"more"].concat()).unwrap();
    assert!(refusal(&path).unwrap().contains("bytes in place of"));
    fs::write(&path, "t_end = 1\n".repeat(100)).unwrap();
    assert!(refusal(&path).unwrap().contains("it does not begin like one"));
    let mut newer = whole.clone();
    newer[16] = FORMAT as u8 + 1;
    fs::write(&path, newer).unwrap();
    let expected = format!("it has the format {}, and this program reads {FORMAT}", FORMAT + 1);
    assert!(refusal(&path).unwrap().contains(&expected));
    fs::remove_file(&path).unwrap();
    assert!(look(&path).is_none());
    fs::create_dir(&path).unwrap();
    assert!(refusal(&path).is_some());
}

#[test]
fn every_rank_learns_of_the_part_that_is_wrong() {
    let (_folder, path) = sound();
    let mut wrong = fs::read(&path).unwrap();
    // A number of the last particle: it is in the second of two parts, which rank 1 checks.
    let at = wrong.len() - 2 * 20 - 4 - 8;
    wrong[at] ^= 1;
    fs::write(&path, wrong).unwrap();
    team(3, |comm| {
        let why = verify(comm, &path).unwrap_err();
        assert!(why.ends_with("particles from 30 on do not match their checksum"), "{why}");
    });
}

#[test]
fn the_two_files_take_turns_beside_the_output() {
    let output = Path::new("/somewhere/a.vtkhdf");
    let names = slots(output).map(|slot| slot.to_str().unwrap().to_owned());
    assert_eq!(names, ["/somewhere/a.vtkhdf.ckpt-a", "/somewhere/a.vtkhdf.ckpt-b"]);
    let order = [1, 2, 3, 4].map(|serial| slot(output, serial));
    assert_eq!(order, [0, 1, 0, 1].map(|k: usize| PathBuf::from(&names[k])));
}

#[test]
fn what_a_killed_run_could_not_finish_goes_and_nothing_else() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("a.vtkhdf");
    let stay = ["ckpt-a", "ckpt-b", "ckpt-a.x.tmp", "ckpt-c.12.tmp", "12.tmp", "stop"];
    let unfinished = |process: u32| slots(&output).map(|slot| unfinished(&slot, process));
    for path in stay.map(|ending| beside(&output, ending)).into_iter().chain(unfinished(12)) {
        fs::write(path, "").unwrap();
    }
    for path in unfinished(4_000_000_000) {
        assert!(!path.exists(), "two processes write to one file");
        fs::write(path, "").unwrap();
    }
    clear_unfinished(&output);
    let mut left: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    left.sort();
    let mut expected = stay.map(|ending| beside(&output, ending));
    expected.sort();
    assert_eq!(left, expected);
}

#[test]
fn a_checkpoint_of_particles_that_rotate_is_not_resumed_without_rotation() {
    let (_folder, path) = sound();
    let (Header { count, columns, velocity_scale, .. }, remembered) = read(&Solo, &path).unwrap();
    let smooth = scene(&[]);
    let refused = Simulation::resume(&smooth, &Solo, (count, columns), velocity_scale, remembered);
    let why = refused.err().unwrap().to_string();
    assert!(why.contains("needs 6 numbers for the state of a particle, and the particles have 9"), "{why}");
}
