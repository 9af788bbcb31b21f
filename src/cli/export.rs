//! `demhybrid export`: writes frames of a run in the formats of other programs.

use std::path::{Path, PathBuf};

use crate::beds::export::{self, Format, MOST_SUBDIVISIONS, Options, Phase};
use crate::domain::launch;
use crate::error::Error;
use crate::files::run_file::{RunFile, Which};

/// Which frames of which run to write, and how.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct ExportArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// Format to write
    #[arg(long, value_name = "FORMAT")]
    pub to: Format,

    /// File to write
    ///
    /// With --frame all and any format but xyz there are several files: FILE-0000, FILE-0001 and so on, with
    /// the number before the extension.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,

    /// Frame: last (the last complete one), a number from 0 on, or all
    #[arg(long, default_value = "last", value_name = "last|K|all")]
    pub frame: Which,

    /// raw: voxels per radius (the mean one), so that a voxel is a cube with the side radius/N [default: 10]
    #[arg(long, value_name = "N")]
    pub resolution: Option<f64>,

    /// raw: phase whose voxels are 1; those of the other are 0, and 2 is outside the walls [default: solid]
    #[arg(long, value_name = "PHASE")]
    pub ones: Option<Phase>,

    /// stl: how often each of the 20 triangles of a sphere is divided into 4 [default: 2]
    #[arg(long, value_name = "N")]
    pub subdivisions: Option<u32>,

    /// Replace existing files
    #[arg(long)]
    pub force: bool,
}

impl ExportArgs {
    fn options(&self) -> Options {
        Options {
            to: self.to,
            output: self.output.clone(),
            numbered: self.frame == Which::All,
            resolution: self.resolution,
            ones: self.ones,
            subdivisions: self.subdivisions,
            force: self.force,
        }
    }
}

/// Writes the frames that the command line asks for.
pub fn run(args: &ExportArgs) -> Result<(), Error> {
    check_options(args)?;
    let run = RunFile::open(&args.run)?;
    let frames = run.numbers(args.frame)?;
    let written = export::write(&run, &frames, &args.options())?;
    let volume = match args.to {
        Format::Stl => format!(
            "; the triangles of a sphere have its volume: their corners lie {:.4} radii from its centre",
            export::reach_of_triangles(args.subdivisions)
        ),
        _ => String::new(),
    };
    launch::say(&format!("demhybrid: {}{volume}", told(&written, &frames, &run)));
    Ok(())
}

/// One line that says what was written.
fn told(written: &[PathBuf], frames: &[u64], run: &RunFile) -> String {
    let name = |path: &Path| path.display().to_string();
    let files = match written {
        [one] => format!("{} is written", name(one)),
        [first, second] => format!("{} and {} are written", name(first), name(second)),
        many => format!(
            "{} files, {} to {}, are written",
            many.len(),
            name(&many[0]),
            name(&many[many.len() - 1])
        ),
    };
    let which = match frames {
        [one] => format!("frame {one}"),
        many => format!("{} frames", many.len()),
    };
    format!("{files}: {which} of {}, {} spheres", run.path().display(), run.count)
}

/// Refuses options of another format, which would be ignored, and values out of range.
fn check_options(args: &ExportArgs) -> Result<(), Error> {
    let foreign = [
        ("--resolution", args.resolution.is_some(), Format::Raw),
        ("--ones", args.ones.is_some(), Format::Raw),
        ("--subdivisions", args.subdivisions.is_some(), Format::Stl),
    ];
    if let Some((option, _, owner)) = foreign.into_iter().find(|&(_, given, owner)| given && owner != args.to)
    {
        return Err(Error::Input(format!(
            "{option} belongs to --to {}, and this is --to {}: leave it out",
            owner.name(),
            args.to.name()
        )));
    }
    if let Some(resolution) = args.resolution.filter(|&n| !(n.is_finite() && n > 0.0)) {
        return Err(Error::Input(format!(
            "--resolution {resolution}: it must be a finite number of voxels per radius greater than 0, \
             e.g. 10"
        )));
    }
    if let Some(subdivisions) = args.subdivisions.filter(|&n| n > MOST_SUBDIVISIONS) {
        return Err(Error::Input(format!(
            "--subdivisions {subdivisions}: it must be 0 (20 triangles a sphere) to {MOST_SUBDIVISIONS}; \
             3 gives 1280"
        )));
    }
    Ok(())
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid export settle.vtkhdf --to csv -o bed.csv      then particles.file = \"bed.csv\" in the next scene
  demhybrid export settle.vtkhdf --to xyz --frame all -o settle.xyz
  demhybrid export settle.vtkhdf --to raw --resolution 20 --ones pore -o pores.raw

raw: one byte a voxel, x fastest, then y, then z; a voxel belongs to the solid if its centre does. \
The image fills
the box along the axes around what all walls enclose, from its lower corner; an open top is cut at the bed
height, other open sides where the spheres end. A voxel outside the walls, or above the bed height where
gravity is oblique, is 2. Shares in the header are of the voxels that are not 2.
Spheres have their own radii, and csv, xyz, vtp and lammps have their masses and species, if they differ.
Positions are in m, velocities in m/s, angular velocities in 1/s, masses in kg. \
Numbers in csv, xyz, vtp and lammps read back as the
same doubles.";

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: ExportArgs,
    }

    fn args(line: &str) -> ExportArgs {
        Line::parse_from(format!("export run.vtkhdf -o a {line}").split_whitespace()).args
    }

    #[test]
    fn options_of_other_formats_and_values_out_of_range_are_refused() {
        for (line, parts) in [
            ("--to csv --resolution 3", ["--resolution belongs to --to raw", "--to csv"]),
            ("--to stl --ones pore", ["--ones belongs to --to raw", "--to stl"]),
            ("--to raw --subdivisions 3", ["--subdivisions belongs to --to stl", "--to raw"]),
            ("--to raw --resolution 0", ["--resolution 0:", "greater than 0"]),
            ("--to raw --resolution inf", ["--resolution inf:", "finite"]),
            ("--to raw --resolution=-1", ["--resolution -1:", "voxels per radius"]),
            ("--to stl --subdivisions 8", ["--subdivisions 8:", "0 (20 triangles a sphere) to 7"]),
        ] {
            let mistake = check_options(&args(line)).unwrap_err();
            assert_eq!(mistake.exit_code(), 2, "{line}");
            assert!(parts.iter().all(|part| mistake.to_string().contains(part)), "{line}: {mistake}");
        }
        for line in ["--to csv", "--to raw --resolution 2.5 --ones solid", "--to stl --subdivisions 0"] {
            check_options(&args(line)).unwrap();
        }
    }
}
