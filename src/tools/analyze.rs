//! `demhybrid analyze`: how densely a bed is packed, how its spheres touch, and how the run went.

mod figures;
mod measures;
mod picture;
mod report;
mod tables;

use std::path::Path;

use crate::accuracy::command::prepare;
use crate::accuracy::text::significant;
use crate::analysis::row::{Row, centres};
use crate::analysis::structure;
use crate::analysis::union::Region;
use crate::cli::AnalyzeArgs;
use crate::error::Error;
use crate::launch;
use crate::particle::Vec3;
use crate::record::Record;
use measures::Measured;

/// Measures what the command line asks for, writes the folder and prints a table.
pub fn run(args: &AnalyzeArgs) -> Result<(), Error> {
    let record = Record::open(&args.run)?;
    let frames = record.numbers(args.frame)?;
    let last = record.state(frames[frames.len() - 1])?;
    let (region, words) = args.region.of(&record.scene, &centres(&last));
    let folder = args.output.clone().unwrap_or_else(|| format!("{}-analysis", stem(&args.run)).into());
    prepare(&folder, args.force)?;

    let mut rows = Vec::new();
    for &k in &frames[..frames.len() - 1] {
        rows.push(Row::of(&record.scene, &record.state(k)?, &region));
    }
    let measured = Measured::of(&record, &last, &region, words, rows)?;
    let mut written = tables::write(&folder, &measured)?;
    let figures = figures::draw(&folder, &stem(&args.run), &measured)?;
    written.extend(figures.iter().map(|figure| figure.file.clone()));
    written.push(report::write(&folder, &record, &measured, &last, &figures)?);
    launch::print(&table(&record, &measured, &folder, written.len()));
    Ok(())
}

/// Name of the run without folder and extension.
fn stem(run: &Path) -> String {
    run.file_stem().map_or("run".into(), |stem| stem.to_string_lossy().into_owned())
}

/// What a reader of the terminal wants to know.
fn table(record: &Record, measured: &Measured, folder: &Path, files: usize) -> String {
    let mut lines = vec![format!(
        "{}: frame {} of {}, t = {} s, {} spheres{}",
        record.path().display(),
        measured.last().frame,
        record.frames,
        measured.last().time,
        record.count,
        if record.completed { "" } else { ", the run is not complete" },
    )];
    lines.push(format!("measured in {}", measured.region_words));
    lines.extend(measured.findings().iter().map(|(name, value)| format!("  {name:<36}{value}")));
    lines.push(format!("{files} files in {}; report.html shows all of it", folder.display()));
    lines.join("\n") + "\n"
}

/// Six digits.
fn short(value: f64) -> String {
    significant(value, 6)
}

/// The box in which the radial distribution is measured: where centres can lie.
fn window(record: &Record, region: &Region) -> (Vec3, Vec3) {
    structure::room_of_centres(&record.scene, region)
}
