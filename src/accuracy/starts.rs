//! The scene and the initial states that a comparison is about.

use crate::cli::AccuracyArgs;
use crate::domain::Comm;
use crate::error::Error;
use crate::program;
use crate::scene::Scene;
use crate::start::{self, Start};

/// Initial states, each with its seed if it has one; at least one.
pub type Starts = Vec<(Option<u64>, Start)>;

/// Reads and checks the scene with the `--set` options `sets`: with a grid one start a seed from 1 on, else the only one.
/// Collective.
pub fn load(args: &AccuracyArgs, sets: &[String], comm: &dyn Comm) -> Result<(Scene, Starts), Error> {
    let (scene, start) = program::load(&args.scene, sets, comm)?;
    let Some(grid) = &scene.particles.grid else { return Ok((scene, vec![(None, start)])) };
    let seeded = |seed| {
        let mut grid = grid.clone();
        grid.seed = Some(seed);
        let start = start::grid(&scene, &grid);
        start::check(&scene, &start)?;
        Ok((Some(seed), start))
    };
    let starts = (1..=args.seeds).map(seeded).collect::<Result<Starts, Error>>()?;
    let mut scene = scene;
    // So that the recorded scene is that of the first run, whatever seed was drawn.
    if let Some(grid) = &mut scene.particles.grid {
        grid.seed = Some(1);
    }
    Ok((scene, starts))
}
