//! Exports frames of a run to the formats of other programs.

mod files;
mod raw;
mod stl;
#[cfg(test)]
mod testing;
mod text;
mod vtp;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::ValueEnum;

use crate::beds::measures::region::Region;
use crate::beds::measures::request::RegionRequest;
use crate::error::Error;
use crate::files::output::Species;
use crate::files::run_file::{RunFile, State};
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::scene::Scene;
use files::{File, header_of, numbered};

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Columns of positions, velocities and spins, with all digits, and of radii, masses and species where
    /// spheres have their own; particles.file of a scene reads it
    Csv,
    /// Extended XYZ with radii, velocities and species, for OVITO; all frames in one file
    Xyz,
    /// VTK XML points, for any version of ParaView
    Vtp,
    /// Surfaces of all spheres as binary STL
    Stl,
    /// Voxels of pore and solid, one byte each, with a JSON header in FILE.json
    Raw,
    /// A LAMMPS data file, atom_style sphere, with an atom type for each species
    Lammps,
}

impl Format {
    /// Name on the command line.
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
    /// Inside a sphere
    Solid,
    /// Everything else inside all walls, up to the bed height where they leave the top open
    Pore,
}

impl Phase {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Solid => "solid",
            Phase::Pore => "pore",
        }
    }
}

/// The options of an export.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Format.
    pub to: Format,
    /// File to write. With `numbered`, the number of the frame goes before its extension.
    pub output: PathBuf,
    /// Whether to write one file for each frame, unless the format holds all frames.
    pub numbered: bool,
    /// Voxels per radius, for a voxel image; per mean radius where radii differ.
    pub resolution: Option<f64>,
    /// The phase that is 1 in a voxel image.
    pub ones: Option<Phase>,
    /// How often each triangle of a sphere is divided into four.
    pub subdivisions: Option<u32>,
    /// Whether to replace existing files.
    pub force: bool,
}

/// Default number of voxels per radius.
const RESOLUTION: f64 = 10.0;
/// Default number of divisions of the triangles of a sphere.
const SUBDIVISIONS: u32 = 2;
/// Largest number of divisions. It gives 20 * 4^7 triangles for each sphere.
pub const MOST_SUBDIVISIONS: u32 = 7;

/// A frame, with the scene of its run.
pub struct FrameData<'a> {
    /// The resolved scene.
    pub scene: &'a Scene,
    /// All particles, by id.
    pub state: &'a State,
    /// Their species, if they have any.
    pub species: Option<&'a Species>,
}

impl<'a> FrameData<'a> {
    /// Frame `state` of `run`.
    fn of(run: &'a RunFile, state: &'a State) -> Self {
        FrameData { scene: &run.scene, state, species: run.species.as_ref() }
    }

    /// Sizes of the spheres.
    fn sizes(&self) -> Sizes<'a> {
        self.state.sizes(self.scene)
    }

    /// Whether the spheres have sizes of their own.
    fn is_sized(&self) -> bool {
        !self.state.sizes.is_empty()
    }

    /// Radius of all spheres, or the mean radius where they differ, m.
    fn typical_radius(&self) -> f64 {
        self.scene.particles.radius
    }

    /// Centres, m.
    fn centres(&self) -> Vec<Vec3> {
        self.state.x.iter().map(|&x| x.into()).collect()
    }

    /// All that the walls enclose, up to the bed height where they leave the top open.
    fn region(&self) -> Region {
        RegionRequest::Whole.of(self.scene, &self.centres(), self.state.sizes(self.scene)).0
    }

    /// A box that contains all centres, as its lower and upper corner, m.
    ///
    /// It is the smallest one around the region, if that contains all centres.
    fn cell(&self) -> (Vec3, Vec3) {
        let x = self.centres();
        let sizes = self.sizes();
        let (low, high) = self.region().bounds();
        x.iter().enumerate().fold((low, high), |(low, high), (i, x)| {
            let outside = |k: usize| x[k] <= low[k] || x[k] >= high[k];
            let margin = Vec3::from_fn(|k, _| if outside(k) { sizes.of(i).r } else { 0.0 });
            (low.inf(&(x - margin)), high.sup(&(x + margin)))
        })
    }
}

/// Distance of the corners of a sphere's triangles from its centre, in radii; `subdivisions` as in
/// [`Options`].
pub fn reach_of_triangles(subdivisions: Option<u32>) -> f64 {
    stl::reach(subdivisions.unwrap_or(SUBDIVISIONS))
}

/// Writes the `frames` of `run`; returns the files that were written.
pub fn write(run: &RunFile, frames: &[u64], options: &Options) -> Result<Vec<PathBuf>, Error> {
    let one_file = !options.numbered || options.to == Format::Xyz;
    let targets: Vec<PathBuf> = match one_file {
        true => vec![options.output.clone()],
        false => frames.iter().map(|&k| numbered(&options.output, k)).collect(),
    };
    for target in &targets {
        files::check(target, run.path(), options.force)?;
        if options.to == Format::Raw {
            files::check(&header_of(target), run.path(), options.force)?;
        }
    }
    if options.to == Format::Raw {
        // Check that the images of all frames fit, before any file is written.
        for &k in frames {
            let state = run.state(k)?;
            image(options, &FrameData::of(run, &state))?;
        }
    }
    let mut written = Vec::new();
    let mut file = None;
    for (number, &k) in frames.iter().enumerate() {
        let state = run.state(k)?;
        let frame = FrameData::of(run, &state);
        if number < targets.len() {
            finish(file.take())?;
            let target = &targets[number];
            file = Some(File::create(target, options.force)?);
            written.push(target.clone());
        }
        let out = file.as_mut().expect("the first frame has a file");
        match options.to {
            Format::Csv => out.write(|out| text::csv(&frame, out))?,
            Format::Xyz => out.write(|out| text::xyz(&frame, out))?,
            Format::Lammps => out.write(|out| text::lammps(&frame, out))?,
            Format::Vtp => out.write(|out| vtp::write(&frame, out))?,
            Format::Stl => {
                let subdivisions = options.subdivisions.unwrap_or(SUBDIVISIONS);
                stl::check(&frame, subdivisions)?;
                out.write(|out| stl::write(&frame, subdivisions, out))?;
            }
            Format::Raw => {
                let image = image(options, &frame)?;
                let mut counts = raw::Counts::default();
                out.write(|out| {
                    counts = image.write(&frame, out)?;
                    Ok(())
                })?;
                let header = header_of(&targets[number]);
                let text = image.header(&frame, &targets[number], &counts);
                let mut file = File::create(&header, options.force)?;
                file.write(|out| out.write_all(text.as_bytes()))?;
                file.finish()?;
                written.push(header);
            }
        }
    }
    finish(file)?;
    Ok(written)
}

fn finish(file: Option<File>) -> Result<(), Error> {
    file.map_or(Ok(()), File::finish)
}

/// The voxel image with the given options.
fn image(options: &Options, frame: &FrameData) -> Result<raw::Image, Error> {
    raw::Image::of(frame, options.resolution.unwrap_or(RESOLUTION), options.ones.unwrap_or(Phase::Solid))
}

/// Writes the components, each after `separator`, with the fewest digits that read back as the same doubles.
fn vector(out: &mut dyn Write, vector: &[f64; 3], separator: &str) -> io::Result<()> {
    vector.iter().try_for_each(|number| write!(out, "{separator}{number:?}"))
}
