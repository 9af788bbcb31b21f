//! What may become of a case.

use demhybrid::cli::report;
use demhybrid::domain::comm::Parcels;
use demhybrid::domain::{Comm, Solo};
use demhybrid::engine::load;
use demhybrid::engine::simulation::{Frame, Simulation};
use demhybrid::error::Error;
use demhybrid::scene::initial_condition::{self, InitialCondition};
use demhybrid::scene::{Scene, effects};
use std::cell::Cell;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use tempfile::TempDir;

/// Bytes that a case may hold at a time, and how many more for every byte of it.
const ROOM: (u64, u64) = (16 << 20, 200);
/// Characters of a message, its line of the scene included.
const LONGEST_MESSAGE: usize = 3000;
/// A refused value takes one line; where and what it is takes three more.
const MOST_LINES: usize = 4;
/// Particles that a case may start with, and of which it takes steps.
const MOST: (u64, usize) = (5000, 200);
/// Agreements of ranks that a case has for its steps; there is one a trial step.
const FUEL: u32 = 40;

/// Counts of what became of cases.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    pub cases: u64,
    pub accepted: u64,
    pub refused: u64,
    /// Accepted, and a few steps were taken.
    pub advanced: u64,
    /// Of those, the ones whose contacts remember their shear.
    pub remembered: u64,
    /// Of those that took steps, the ones that ended by an error.
    pub failed: u64,
}

impl std::ops::Add for Tally {
    type Output = Tally;
    fn add(self, other: Tally) -> Tally {
        Tally {
            cases: self.cases + other.cases,
            accepted: self.accepted + other.accepted,
            refused: self.refused + other.refused,
            advanced: self.advanced + other.advanced,
            remembered: self.remembered + other.remembered,
            failed: self.failed + other.failed,
        }
    }
}

/// Reads cases and holds what comes of them against what may.
pub struct Judge {
    folder: TempDir,
    scene: Scene,
}

impl Judge {
    pub fn new() -> Self {
        let folder = TempDir::new().expect("there is room for a folder");
        fs::write(folder.path().join("start.csv"), "x,y,z\n0.5,0.5,0.5\n0.5,0.5,0.72\n").unwrap();
        let text = include_str!("../../scenes/good/required-keys-only.toml");
        let sets = ["particles.file=case.csv", "friction={coefficient=0.2,regularization_velocity=0.01}"];
        let scene = Scene::parse("case.toml", text, &sets.map(str::to_owned)).expect("the scene is good");
        Judge { folder, scene }
    }

    /// A scene with its `--set` options.
    pub fn scene(&self, bytes: &[u8], sets: &[String]) -> Result<Tally, String> {
        let text = String::from_utf8_lossy(bytes);
        let size = text.len() + sets.iter().map(String::len).sum::<usize>();
        self.within_bounds(size, || self.set_up(&text, sets))
    }

    /// A particle file of a good scene.
    pub fn particle_file(&self, bytes: &[u8]) -> Result<Tally, String> {
        fs::write(self.folder.path().join("case.csv"), bytes).map_err(|why| why.to_string())?;
        self.within_bounds(bytes.len(), || self.start(&self.scene))
    }

    /// Runs a case and tells what became of it, or what is wrong with that.
    fn within_bounds(
        &self,
        size: usize,
        work: impl FnOnce() -> Result<Option<(Scene, InitialCondition)>, Error>,
    ) -> Result<Tally, String> {
        let mut outcome = Ok(Tally::default());
        let memory = allocation_counter::measure(|| {
            outcome = match work() {
                Err(Error::Input(message)) => {
                    let refused = Tally { cases: 1, refused: 1, ..Tally::default() };
                    well_formed(&message).map(|()| refused)
                }
                Err(other) => Err(format!("a mistake before the first step is one of input, not {other:?}")),
                Ok(None) => Ok(Tally { cases: 1, accepted: 1, ..Tally::default() }),
                Ok(Some((scene, start))) => take_steps(&scene, &start),
            };
        });
        let room = ROOM.0 + ROOM.1 * size as u64;
        if memory.bytes_max > room {
            return Err(format!("{} bytes were held at a time, more than {room}", memory.bytes_max));
        }
        outcome
    }

    /// What the program does before the first step; no start where a grid is too large for a quick look.
    fn set_up(&self, text: &str, sets: &[String]) -> Result<Option<(Scene, InitialCondition)>, Error> {
        let mut scene = Scene::parse("case.toml", text, sets)?;
        reads_back(&scene);
        scene.set_seed_if_missing(7);
        reads_back(&scene);
        assert!(load::bytes_per_particle(&scene) > 0);
        self.start(&scene)
    }

    fn start(&self, scene: &Scene) -> Result<Option<(Scene, InitialCondition)>, Error> {
        let start = match &scene.particles.grid {
            Some(grid) if grid.count > MOST.0 => return Ok(None),
            Some(grid) => initial_condition::grid(scene, grid),
            None => initial_condition::read_csv(scene, self.folder.path())?,
        };
        initial_condition::check(scene, &start)?;
        Ok(Some((scene.clone(), start)))
    }
}

/// The resolved text of a scene is a scene, the same one.
fn reads_back(scene: &Scene) {
    let resolved = scene.resolved();
    match Scene::parse("other.toml", &resolved, &[]) {
        Ok(again) => assert_eq!(&again, scene, "read back from\n{resolved}"),
        Err(why) => panic!("the resolved text is refused: {why}\n{resolved}"),
    }
}

/// A message for a user: something, of a bounded length, and nothing that upsets a terminal.
fn well_formed(message: &str) -> Result<(), String> {
    let wrong = |why: &str| {
        let shown: String = message.chars().take(2 * LONGEST_MESSAGE).collect();
        Err(format!("{why}: {shown:?}"))
    };
    let lines = message.lines().count();
    match message {
        _ if message.trim().is_empty() => wrong("the message is empty"),
        _ if message.chars().count() > LONGEST_MESSAGE => wrong("the message is too long"),
        _ if lines > MOST_LINES => wrong("the message has too many lines"),
        _ if message.chars().any(|c| c.is_control() && c != '\n') => wrong("there are control characters"),
        _ if lines == 1 || message.lines().nth(1).is_some_and(|line| line.trim() == "|") => Ok(()),
        _ => wrong("the second line is not the scene's"),
    }
}

/// What is told of an accepted scene, and its first steps, if it is small.
fn take_steps(scene: &Scene, start: &InitialCondition) -> Result<Tally, String> {
    let accepted = Tally { cases: 1, accepted: 1, ..Tally::default() };
    report::plan(&Solo, Path::new("case.toml"), scene, start, 1, "case.vtkhdf");
    if start.x.is_empty() || start.x.len() > MOST.1 {
        return Ok(accepted);
    }
    let fuel = Fuel(Cell::new(FUEL));
    let run = || Simulation::new(scene, start, &fuel)?.run(&mut |_: &Frame| Ok(()));
    let outcome = catch_unwind(AssertUnwindSafe(run));
    let failed = match outcome {
        Ok(Ok(_)) => 0,
        Ok(Err(why)) if why.exit_code() == 3 => {
            well_formed(&why.to_string())?;
            1
        }
        Ok(Err(why)) => return Err(format!("not an error of a right-hand side: {why:?}")),
        Err(payload) if payload.is::<Empty>() => 0,
        Err(payload) => resume_unwind(payload),
    };
    let remembers = effects::law(scene).memory.is_some();
    Ok(Tally { advanced: 1, remembered: u64::from(remembers), failed, ..accepted })
}

/// The tank is empty.
struct Empty;

/// One rank, which can agree with itself so many times: a run that would last for ever ends there.
struct Fuel(Cell<u32>);

impl Comm for Fuel {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn max(&self, values: &mut [f64]) {
        assert!(values.iter().all(|value| !value.is_nan()), "maxima are not NaN");
        match self.0.get().checked_sub(1) {
            Some(left) => self.0.set(left),
            // No panic: nothing is wrong.
            None => resume_unwind(Box::new(Empty)),
        }
    }
    fn sum(&self, _counts: &mut [u64]) {}
    fn all_gather(&self, own: &[f64], all: &mut [f64]) {
        Solo.all_gather(own, all);
    }
    fn transpose(&self, to: &[u64]) -> Vec<u64> {
        to.to_vec()
    }
    fn exchange_during(&self, outgoing: &Parcels, incoming: &mut Parcels, work: &mut dyn FnMut()) {
        Solo.exchange_during(outgoing, incoming, work);
    }
    fn broadcast(&self, _bytes: &mut Vec<u8>) {}
    fn ranks_on_node(&self) -> usize {
        1
    }
    fn abort(&self, code: i32) -> ! {
        panic!("aborted with {code}")
    }
}
