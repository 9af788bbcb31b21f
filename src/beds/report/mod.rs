//! The report on a bed: its measures, tables and figures, and a page that shows all of them.

mod classes;
mod figures;
mod measured;
mod page;
mod picture;
mod tables;

use std::path::Path;

use crate::beds::measures::row::centres;
use crate::error::Error;
use crate::files::run_file::{RunFile, State};
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
