//! The report on a bed: its measures, tables and figures, and a page that shows all of them.

mod figures;
mod measured;
mod page;
mod picture;
mod tables;

use std::path::Path;

use crate::beds::measures::row::centres;
use crate::beds::measures::structure;
use crate::beds::measures::union::Region;
use crate::error::Error;
use crate::files::run_file::{RunFile, State};
use crate::math::vector::Vec3;
pub use measured::Measured;

/// Writes tables, figures and the page about `run` into `folder`; returns the number of files.
pub fn write(
    folder: &Path,
    run: &str,
    run_file: &RunFile,
    measured: &Measured,
    last: &State,
) -> Result<usize, Error> {
    let tables = tables::write(folder, measured)?;
    let figures = figures::draw(folder, run, measured)?;
    page::write(folder, run_file, measured, last, &figures)?;
    Ok(tables.len() + figures.len() + 1)
}

/// The box in which the radial distribution is measured. It holds all positions that centres can have.
fn box_of_centres(run_file: &RunFile, region: &Region) -> (Vec3, Vec3) {
    structure::room_of_centres(&run_file.scene, region)
}
