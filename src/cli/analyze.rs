//! The command line of `demhybrid analyze`.

use std::path::PathBuf;

use super::RegionArgs;
use crate::record::Which;

/// Which bed to measure, and where to put what was found.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct AnalyzeArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// Folder for tables (CSV), figures (SVG), summary.json and report.html [default: RUN's name with -analysis]
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,

    /// Frame: last (the last complete one), a number from 0 on, or all; what is no row a frame is of the last of them
    #[arg(long, default_value = "last", value_name = "last|K|all")]
    pub frame: Which,

    #[command(flatten)]
    #[allow(missing_docs, reason = "its doc would take the place of the help of the command")]
    pub region: RegionArgs,

    /// Write to a folder that is not empty
    #[arg(long)]
    pub force: bool,
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid analyze settle.vtkhdf
  demhybrid analyze settle.vtkhdf --frame all -o settle-over-time
  demhybrid analyze settle.vtkhdf --cylinder 0.5,0.5,0.4,0.1,0.9 --force

Volumes are those of the union of all spheres inside the region, exact to 1e-9 of it; what spheres cover several times
is reported apart, and the paper's own count in [0, 1]^3, which counts it as often, beside it. Without --box, --cylinder
or --whole the region is the base of container.box up to the shorter side of the base, or, where less than a tenth of the
centres lie above that, up to the height below which three quarters of them lie.
Spheres touch where their gap is not positive. Rattlers have too few contacts to be held: fewer than 4, less 1 with
gravity, less 1 with friction, walls counted and other rattlers not.";
