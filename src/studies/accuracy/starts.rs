//! Loads the scene and the initial states of a comparison.

use super::request::Request;
use crate::domain::Comm;
use crate::engine::load::load as load_scene;
use crate::error::Error;
use crate::scene::Scene;
use crate::scene::initial_condition::{self, InitialCondition};

/// Initial states, each with its seed if it has one. There is at least one.
pub type Starts = Vec<(Option<u64>, InitialCondition)>;

/// Reads and checks the scene with the `--set` options `sets`. Collective.
///
/// A scene with a grid has one initial state for each seed from 1 on. Any other scene has a single one.
pub fn load(request: &Request, sets: &[String], comm: &dyn Comm) -> Result<(Scene, Starts), Error> {
    let (scene, start) = load_scene(&request.scene, sets, comm)?;
    let Some(grid) = &scene.particles.grid else { return Ok((scene, vec![(None, start)])) };
    let seeded = |seed| {
        let mut grid = grid.clone();
        grid.seed = Some(seed);
        let start = initial_condition::grid(&scene, &grid);
        initial_condition::check(&scene, &start)?;
        Ok((Some(seed), start))
    };
    let starts = (1..=request.seeds).map(seeded).collect::<Result<Starts, Error>>()?;
    let mut scene = scene;
    // The scene is written into the results. Give it the seed of the first run instead of a random one.
    if let Some(grid) = &mut scene.particles.grid {
        grid.seed = Some(1);
    }
    Ok((scene, starts))
}
