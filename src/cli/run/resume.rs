//! `--resume FILE`: goes on with a run from the files that it left on the disk.

use super::Ground;
use super::execute::{Beginning, Execution};
use crate::cli::report;
use crate::domain::agreement::{agree, share};
use crate::domain::{Comm, launch};
use crate::engine::load::{check_memory, share_start};
use crate::error::Error;
use crate::files::checkpoint::{self, Header};
use crate::files::output::{self, Claim, Found};
use crate::math::digits::short;
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};
use serde::{Deserialize, Serialize};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// What to do with the file. Rank 0 decides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Plan {
    /// Nothing: the run is complete, to t = `t` (s).
    Nothing { t: f64 },
    /// Begin again: there is no checkpoint. The first `frames` frames in the file stay.
    Again { scene: String, frames: u64, count: u64 },
    /// Go on from the first of these checkpoints that is intact. The newest one comes first.
    Continue { scene: String, slots: Vec<Slot> },
}

/// A checkpoint with an intact header.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Slot {
    path: PathBuf,
    serial: u64,
    /// Time of the checkpoint, s.
    t: f64,
    steps: u64,
    count: u64,
    instruction_set: String,
    version: String,
}

/// Resumes the run that wrote `file`. Collective.
pub(super) fn run(ground: &Ground, file: &Path) -> Result<(), Error> {
    let Ground { args, comm, .. } = *ground;
    let unusable = |why: String| Error::Input(format!("--resume {}: {why}", file.display()));
    let claim = Claim::stake(comm, file, true, 0)?;
    let path = claim.path();
    let mut warnings = Vec::new();
    let plan = share(comm, || {
        let plan = plan(path, &args.set, &mut warnings).map_err(unusable)?;
        Ok(serde_json::to_string(&plan).expect("a plan holds texts and finite numbers"))
    })?;
    let tell = |text: &str| {
        if comm.rank() == 0 {
            launch::say(text);
        }
    };
    warnings.iter().for_each(|warning| tell(warning));
    let execute = |scene: &Scene, start: &InitialCondition, beginning: Beginning| {
        Execution { ground, name: file, file, claim: &claim, scene, start, beginning }.run()
    };
    match serde_json::from_str(&plan).expect("rank 0 made it") {
        Plan::Nothing { t } => {
            tell(&format!(
                "demhybrid: the run in {} is complete, to t = {} s: nothing to do. --set t_end=LARGER would \
                 go on",
                file.display(),
                short(t)
            ));
            Ok(())
        }
        Plan::Again { scene, frames, count } => {
            let scene = scene_of(file, &scene, &args.set).map_err(unusable)?;
            let start = start_of(comm, &scene, path, frames, count)?;
            tell(&format!(
                "demhybrid: there is no checkpoint of {} yet: the run begins again at t = 0 s; the {frames} \
                 frames that it holds stay",
                file.display()
            ));
            let beginning = if frames > 0 { Beginning::Again { frames } } else { Beginning::Start };
            execute(&scene, &start, beginning)
        }
        Plan::Continue { scene, slots } => {
            let scene = scene_of(file, &scene, &args.set).map_err(unusable)?;
            let slot = first_sound(comm, &slots, &tell).map_err(unusable)?;
            // The warnings at the end of the run need the initial condition, which is the first frame.
            let start = start_of(comm, &scene, path, 1, slot.count)?;
            claim.check_room(comm, file, report::output_bytes(&scene, slot.count))?;
            tell(&format!(
                "demhybrid: {} goes on from t = {} s, after {} steps (checkpoint {})",
                file.display(),
                short(slot.t),
                slot.steps,
                slot.path.display()
            ));
            let now = format!("{} {}", std::env::consts::ARCH, ground.set.name());
            if slot.instruction_set != now {
                tell(&format!(
                    "warning: the checkpoint was made with the instruction set {}, and this machine works \
                     with {now}: the last digits may differ from those of a run that was never stopped",
                    slot.instruction_set
                ));
            }
            if slot.version != env!("CARGO_PKG_VERSION") {
                tell(&format!(
                    "warning: the checkpoint was made by version {} of the program, and this is {}: the last \
                     digits may differ from those of a run that was never stopped",
                    slot.version,
                    env!("CARGO_PKG_VERSION")
                ));
            }
            let beginning = Beginning::Checkpoint(&slot.path);
            execute(&scene, &start, beginning)
        }
    }
}

/// Decides what to do with the output file `path` and its checkpoints. One rank calls it.
fn plan(path: &Path, sets: &[String], warnings: &mut Vec<String>) -> Result<Plan, String> {
    let heads: Vec<_> = checkpoint::slots(path)
        .into_iter()
        .filter_map(|slot| Some((checkpoint::look(&slot)?, slot)))
        .collect();
    // A run must know that nobody else writes its file, by whatever name.
    if let Some(names) = fs::metadata(path).ok().map(|found| found.nlink()).filter(|&names| names > 1) {
        return Err(format!(
            "the file has {names} names (hard links), and what is written to one changes them all; resume a \
             copy of it"
        ));
    }
    if !path.exists() {
        return Err(if heads.is_empty() {
            "there is no such file; it is the output file of the run to go on with".into()
        } else {
            "there is no such file, although its checkpoints are there; put it back, or start the scene anew"
                .into()
        });
    }
    let found = output::inspect(path)?;
    let recorded =
        Scene::parse("", &found.scene, &[]).map_err(|why| format!("its scene is broken: {why}"))?;
    let asked = scene_of(path, &found.scene, sets)?;
    if found.completed && asked.t_end == recorded.t_end {
        return Ok(Plan::Nothing { t: found.times.last().copied().unwrap_or(0.0) });
    }
    if heads.is_empty() {
        let frames = frames_to_keep(&found, &asked);
        return Ok(Plan::Again { scene: found.scene, frames, count: found.count });
    }
    let (mut sound, mut complaints): (Vec<(Header, PathBuf)>, _) = (Vec::new(), Vec::new());
    for (head, path) in heads {
        match head.and_then(|header| fits(&header, &found, &recorded, &path).map(|()| header)) {
            Ok(header) => sound.push((header, path)),
            Err(why) => complaints.push(why),
        }
    }
    if sound.is_empty() {
        return Err(format!(
            "{}; the version that wrote a checkpoint of another format can go on from it; without \
             checkpoints the run begins again with the scene that is recorded in the file",
            complaints.join("; ")
        ));
    }
    warnings.extend(complaints.iter().map(|why| format!("warning: {why}")));
    sound.sort_by_key(|(header, _)| std::cmp::Reverse(header.serial));
    let slot = |(header, path): &(Header, PathBuf)| Slot {
        path: path.clone(),
        serial: header.serial,
        t: header.memory.t,
        steps: header.memory.progress.counts.accepted,
        count: header.count,
        instruction_set: header.instruction_set.clone(),
        version: header.version.clone(),
    };
    Ok(Plan::Continue { scene: found.scene, slots: sound.iter().map(slot).collect() })
}

/// Number of leading frames that stay as they are, because the run will compute them again to the same bits.
///
/// The frame of an earlier `t_end` does not stay, unless it is due at its time anyway.
fn frames_to_keep(found: &Found, asked: &Scene) -> u64 {
    let interval = asked.output.interval.unwrap_or(asked.t_end / 100.0);
    let times = found.times.iter().enumerate();
    times.take_while(|&(k, &time)| time == k as f64 * interval || time == asked.t_end).count() as u64
}

/// Checks that a checkpoint belongs to the run in the file, whose scene is `recorded`. An error says why not.
fn fits(header: &Header, found: &Found, recorded: &Scene, path: &Path) -> Result<(), String> {
    let of = |what: String| Err(format!("{} {what}", path.display()));
    let scene = match Scene::parse("", &header.scene, &[]) {
        Ok(scene) => scene,
        Err(why) => return of(format!("holds a broken scene: {why}")),
    };
    let timeless = |scene: &Scene| Scene { t_end: 1.0, checkpoint: None, limits: None, ..scene.clone() };
    if timeless(&scene) != timeless(recorded) || header.count != found.count {
        return of("is a checkpoint of another run".into());
    }
    if header.memory.progress.frame > found.frames {
        return of(format!(
            "was made after {} frames, and the file holds {}: it is not the file that the checkpoint belongs \
             to",
            header.memory.progress.frame, found.frames
        ));
    }
    Ok(())
}

/// The first checkpoint whose particles are intact too. Collective.
fn first_sound(comm: &dyn Comm, slots: &[Slot], tell: &dyn Fn(&str)) -> Result<Slot, String> {
    let mut complaints = Vec::new();
    for slot in slots {
        match checkpoint::verify(comm, &slot.path) {
            Ok(()) => {
                complaints.iter().for_each(|why| tell(&format!("warning: {why}")));
                return Ok(slot.clone());
            }
            Err(why) => complaints.push(why),
        }
    }
    Err(complaints.join("; "))
}

/// Keys that may change in a resumed run: nothing computed so far depends on them.
const FREE: [&str; 3] = ["t_end", "checkpoint", "limits"];

/// The scene in the file with the options `sets` of the command line, which may only extend the run.
fn scene_of(file: &Path, recorded: &str, sets: &[String]) -> Result<Scene, String> {
    for set in sets {
        let key = set.split('=').next().unwrap_or_default().trim();
        if !FREE.contains(&key.split('.').next().unwrap_or_default().trim()) {
            return Err(format!(
                "--set {set}: {key} is part of what was computed so far; only t_end (larger), checkpoint.* \
                 and limits.* can change"
            ));
        }
    }
    let parse = |sets| Scene::parse(&file.to_string_lossy(), recorded, sets).map_err(|why| why.to_string());
    let (before, scene) = (parse(&[])?, parse(sets)?);
    if scene.t_end < before.t_end {
        return Err(format!(
            "--set t_end={}: the run goes to t_end = {} s already; only a larger one is possible",
            short(scene.t_end),
            short(before.t_end)
        ));
    }
    Ok(scene)
}

/// The initial condition of a run whose file holds `frames` frames. Collective.
///
/// It is the first frame. If there is none, it is made as the keys of the scene describe it.
fn start_of(
    comm: &dyn Comm,
    scene: &Scene,
    path: &Path,
    frames: u64,
    count: u64,
) -> Result<InitialCondition, Error> {
    if frames == 0 {
        let Some(count) = scene.particles.count() else {
            return Err(Error::Input(format!(
                "--resume {}: it holds neither a frame nor a checkpoint; start its scene anew, with --force",
                path.display()
            )));
        };
        agree(comm, check_memory(comm, scene, count))?;
        return initial_condition::ready(scene, initial_condition::made(scene)?);
    }
    agree(comm, check_memory(comm, scene, count))?;
    let mut read = InitialCondition::default();
    share(comm, || {
        let unreadable =
            |why| Error::Input(format!("--resume {}: its first frame cannot be read: {why}", path.display()));
        read = output::first_frame(path, count).map_err(unreadable)?;
        initial_condition::check(scene, &read).map(|()| String::new())
    })?;
    Ok(share_start(comm, read))
}
