//! `demhybrid analyze`: how densely a bed is packed, how its spheres touch, and how the run went.

use std::path::{Path, PathBuf};

use super::RegionArgs;
use crate::beds::folder::{prepare, stem};
use crate::beds::measures::classes::{Classes, MOST};
use crate::beds::measures::contacts::SHARE;
use crate::beds::measures::row::{Row, centres};
use crate::beds::report::{Measured, write};
use crate::domain::stdout;
use crate::error::Error;
use crate::files::run_file::{RunFile, Which};
use crate::math::digits::short;
use crate::scene::caveats::caveats;

/// Which bed to measure, and where to write the results.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct AnalyzeArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// Folder for tables (CSV), figures (SVG), summary.json and report.html [default: NAME-analysis for
    /// NAME.vtkhdf, in the working folder]
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,

    /// Frames to measure: last (the last complete one), a number from 0 on, or all
    ///
    /// With all, tables and figures over time cover every frame. All other results are those of the last one.
    #[arg(long, default_value = "last", value_name = "last|K|all")]
    pub frame: Which,

    /// Share of the reference force above which a push is a contact
    ///
    /// The reference is the weight of a particle. Without gravity it is the mean of all pushes that are more
    /// than a tenth of this mean, and at least a hundredth of F_0.
    #[arg(long, value_name = "SHARE", default_value_t = SHARE, value_parser = share)]
    #[arg(allow_negative_numbers = true)]
    pub share: f64,

    /// Number of classes of size by which spheres are measured, where their sizes differ [default: the
    /// species; without any, or with more than 20, each radius, or 3 classes where there are more than 4
    /// radii]
    ///
    /// Classes hold about equally many spheres. Where there are no more radii than classes, each radius is
    /// one.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=MOST as i64))]
    pub classes: Option<u8>,

    #[command(flatten)]
    #[allow(missing_docs, reason = "its doc would take the place of the help of the command")]
    pub region: RegionArgs,

    /// Write to a folder that is not empty
    #[arg(long)]
    pub force: bool,
}

/// Measures the bed, writes the folder and prints a table.
pub fn run(args: &AnalyzeArgs) -> Result<(), Error> {
    let run_file = RunFile::open(&args.run)?;
    let frames = run_file.numbers(args.frame)?;
    let last = run_file.state(frames[frames.len() - 1])?;
    let (region, words) = {
        let sizes = last.sizes(&run_file.scene);
        args.region.region().of(&run_file.scene, &centres(&last), sizes)
    };
    if region.is_empty() {
        return Err(run_file.unreadable(&format!("nothing of {words} is inside the walls")));
    }
    let asked = args.classes.map(usize::from);
    let classes = Classes::of(&last.sizes, run_file.species.as_ref(), asked);
    if asked.is_some() && classes.is_none() {
        return Err(run_file.unreadable("--classes: all spheres have one size; without --classes would do"));
    }
    let folder = args.output.clone().unwrap_or_else(|| format!("{}-analysis", stem(&args.run)).into());
    let _lock = prepare(&folder, args.force)?;

    let mut rows = Vec::new();
    for &k in &frames[..frames.len() - 1] {
        rows.push(Row::of(&run_file.scene, &run_file.state(k)?, &region, args.share));
    }
    let measured = Measured::of(&run_file, &last, (&region, words), args.share, classes.as_ref(), rows)?;
    let written = write(&folder, &stem(&args.run), &run_file, &measured, &last)?;
    let kept = format!("; the files in {} are complete", folder.display());
    stdout::print(&table(&run_file, &measured, &folder, written), &kept)
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        Ok(_) => Err("it must be 0 or more, and finite".into()),
        Err(_) => Err("it must be a number, such as 0.1".into()),
    }
}

/// The table on the terminal: what was measured, and where the files are.
fn table(run_file: &RunFile, measured: &Measured, folder: &Path, files: usize) -> String {
    let mut lines = vec![format!(
        "{}: frame {} of {}, t = {} s, {} spheres{}",
        run_file.path().display(),
        measured.last().frame,
        run_file.frames,
        short(measured.last().time),
        run_file.count,
        if run_file.completed { "" } else { ", the run is not complete" },
    )];
    lines.push(format!("measured in {}", measured.region_words));
    lines.extend(measured.findings().iter().map(|(name, value)| format!("  {name:<36}{value}")));
    lines.extend(caveats(&run_file.scene).iter().map(|caveat| format!("  note: {caveat}")));
    lines.push(format!("{files} files in {}; report.html shows all of it", folder.display()));
    lines.join("\n") + "\n"
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid analyze settle.vtkhdf
  demhybrid analyze settle.vtkhdf --frame all -o settle-over-time
  demhybrid analyze settle.vtkhdf --share 0.01 -o faint-contacts
  demhybrid analyze settle.vtkhdf --cylinder 0.5,0.5,0.4,0.1,0.9 --force

Volumes are those of the union of all spheres inside the region, exact to 1e-9 of it; \
what spheres cover several times
is reported apart, and the paper's own count in [0, 1]^3, which counts it as often, beside it. \
A region is what all walls enclose,
cut by --layer, --box or --cylinder. Where the walls are open it ends with the spheres, so --whole ends at the
bed height. Without these options it is the bed without its top: up to the least width of the bed, or, where
less than a tenth of the centres lie above that, up to the height below which three quarters of them lie.
Heights are above the lowest point inside all walls, against gravity.
A contact is what pushes with more than a tenth of the weight of a particle, or another --share of it, \
whatever the gap: the
normal force at the positions and velocities of the frame counts. \
Without gravity the mean push takes the place of the weight.
What overlaps is counted beside it. Forces on walls are of all spheres within the interaction distance.
Where sizes differ, the weight is that of the lighter partner, and classes of spheres are measured apart: the
species, or classes of size.
Rattlers have too few contacts to be held: fewer than 4, less 1 with gravity, less 1 with friction, \
walls counted and other
rattlers not.";
