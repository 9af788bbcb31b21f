//! `demhybrid analyze`: how densely a bed is packed, how its spheres touch, and how the run went.

mod figures;
mod measures;
mod picture;
mod report;
mod tables;

use std::path::Path;

use crate::accuracy::command::prepare;
use crate::accuracy::text::significant;
use crate::analysis::{bed, region, structure, union};
use crate::cli::AnalyzeArgs;
use crate::error::Error;
use crate::launch;
use crate::particle::Vec3;
use crate::record::{Record, State};
use measures::{Measured, Row};
use union::{Region, Spheres};

/// Measures what the command line asks for, writes the folder and prints a table.
pub fn run(args: &AnalyzeArgs) -> Result<(), Error> {
    let record = Record::open(&args.run)?;
    let frames = record.numbers(args.frame)?;
    let last = record.state(frames[frames.len() - 1])?;
    let (region, words) = region_of(args, &record, &last);
    let folder = args.output.clone().unwrap_or_else(|| format!("{}-analysis", stem(&args.run)).into());
    prepare(&folder, args.force)?;

    let mut rows = Vec::new();
    for &k in &frames[..frames.len() - 1] {
        rows.push(Row::of(&record, &record.state(k)?, &region)?);
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

/// The region to measure, and what it is in words.
fn region_of(args: &AnalyzeArgs, record: &Record, state: &State) -> (Region, &'static str) {
    let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
    if let Some([a, b, c, d, e, f]) = args.r#box {
        return (Region::Box { low: Vec3::new(a, b, c), high: Vec3::new(d, e, f) }, "the box of --box");
    }
    if let Some([x, y, radius, from, to]) = args.cylinder {
        let region = Region::Cylinder { axis: [x, y], radius, ends: [from, to] };
        return (region, "the cylinder of --cylinder");
    }
    let inner = bed::bed_region(&record.scene, &x).filter(|_| !args.whole);
    let words = match inner {
        Some(_) => "the bed, without its top",
        None => "the whole bed",
    };
    let (low, high) = inner.unwrap_or_else(|| region::container_box(&record.scene, &x));
    (Region::Box { low, high }, words)
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

/// The spheres of a state.
fn centres(state: &State) -> Vec<Vec3> {
    state.x.iter().map(|&x| x.into()).collect()
}

/// The unit cube, in which the paper counts.
fn unit_cube() -> Region {
    Region::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) }
}

/// Volumes in the unit cube: the paper's count, and the exact share of the union; none where it holds no sphere.
fn in_unit_cube(x: &[Vec3], r: f64, spheres: &Spheres) -> Option<[f64; 2]> {
    let union = spheres.volumes(&unit_cube()).union;
    (union > 0.0).then(|| [crate::analysis::paper_volume_fraction(x, r), union])
}
