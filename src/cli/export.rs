//! The command line of `demhybrid export`.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::record::Which;

/// Which frames of which run to write, and how.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct ExportArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// What to write
    #[arg(long, value_name = "FORMAT")]
    pub to: Format,

    /// File to write; with --frame all and any format but xyz, FILE-0000, FILE-0001 and so on before the extension
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,

    /// Frame: last (the last complete one), a number from 0 on, or all
    #[arg(long, default_value = "last", value_name = "last|K|all")]
    pub frame: Which,

    /// raw: voxels per radius, so that a voxel is a cube with the side radius/N [default: 10]
    #[arg(long, value_name = "N")]
    pub resolution: Option<f64>,

    /// raw: what is 1, the other being 0 [default: solid]
    #[arg(long, value_name = "PHASE")]
    pub ones: Option<Phase>,

    /// stl: how often each of the 20 triangles of a sphere is divided into 4 [default: 2]
    #[arg(long, value_name = "N")]
    pub subdivisions: Option<u32>,

    /// Replace existing files
    #[arg(long)]
    pub force: bool,
}

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Positions, velocities and spins by columns, with all digits; particles.file of a scene reads it
    Csv,
    /// Extended XYZ with radii and velocities, for OVITO; all frames in one file
    Xyz,
    /// VTK XML points, for ParaView of any age
    Vtp,
    /// Surfaces of all spheres as binary STL
    Stl,
    /// Voxels of pore and solid, a byte each, with a JSON header in FILE.json
    Raw,
    /// A LAMMPS data file, atom_style sphere
    Lammps,
}

impl Format {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Format::Csv => "csv",
            Format::Xyz => "xyz",
            Format::Vtp => "vtp",
            Format::Stl => "stl",
            Format::Raw => "raw",
            Format::Lammps => "lammps",
        }
    }
}

/// A phase of the voxel image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Phase {
    /// Inside a sphere or beyond a plane of container.wall
    Solid,
    /// Everything else
    Pore,
}

impl Phase {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Solid => "solid",
            Phase::Pore => "pore",
        }
    }
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid export settle.vtkhdf --to csv -o bed.csv      then particles.file = \"bed.csv\" in the next scene
  demhybrid export settle.vtkhdf --to xyz --frame all -o settle.xyz
  demhybrid export settle.vtkhdf --to raw --resolution 20 --ones pore -o pores.raw

raw: one byte a voxel, x fastest, then y, then z; a voxel belongs to the solid if its centre does. The image fills
container.box from its lower corner; an open top is cut at the bed height, other open sides where the spheres end.
Positions are in m, velocities in m/s, angular velocities in 1/s. Numbers in csv, xyz, vtp and lammps read back as the
same doubles.";
