//! Loads the scene and the initial states of a comparison.

use super::request::Request;
use crate::domain::Comm;
use crate::error::Error;
use crate::files::load::load as load_scene;
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};

/// Initial states, each with its seed if it has one. There is at least one.
pub type Starts = Vec<(Option<u64>, InitialCondition)>;

/// Reads and checks the scene with the `--set` options `sets`. Collective.
///
/// A scene whose start has a seed has one initial state for each seed from 1 on. Any other scene has a single
/// one.
pub fn load(request: &Request, sets: &[String], comm: &dyn Comm) -> Result<(Scene, Starts), Error> {
    let (mut scene, start) = load_scene(&request.scene, sets, comm)?;
    if scene.particles.seed_mut().is_none() {
        return Ok((scene, vec![(None, start)]));
    }
    let seeded = |seed| Ok((Some(seed), initial_condition::seeded(&scene, seed)?));
    let starts = (1..=request.seeds).map(seeded).collect::<Result<Starts, Error>>()?;
    // The scene is written into the results. Give it the seed of the first run instead of a random one.
    if let Some(seed) = scene.particles.seed_mut() {
        *seed = Some(1);
    }
    Ok((scene, starts))
}
