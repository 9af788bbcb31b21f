//! `demhybrid export`: frames of a run in the formats of other programs.

mod files;
mod raw;
mod stl;
mod text;
mod vtp;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::analysis::region;
use crate::cli::{ExportArgs, Format, Phase};
use crate::error::Error;
use crate::launch;
use crate::particle::Vec3;
use crate::record::{Record, State, Which};
use crate::scene::Scene;
use files::{File, header_of, numbered};

/// Voxels per radius where the command line says nothing.
const RESOLUTION: f64 = 10.0;
/// Divisions of the triangles of a sphere where the command line says nothing.
const SUBDIVISIONS: u32 = 2;
/// Most divisions: 20 * 4^7 triangles a sphere.
const MOST_SUBDIVISIONS: u32 = 7;

/// A frame, and what does not change from frame to frame.
pub struct Shot<'a> {
    /// The scene as resolved.
    pub scene: &'a Scene,
    /// All particles, by id.
    pub state: &'a State,
}

impl Shot<'_> {
    /// Radius of all spheres, m.
    fn radius(&self) -> f64 {
        self.scene.particles.radius
    }

    /// Centres, m.
    fn centres(&self) -> Vec<Vec3> {
        self.state.x.iter().map(|&x| x.into()).collect()
    }

    /// A box that holds all centres, as its lower and upper corner, m: the container's where it does.
    fn cell(&self) -> (Vec3, Vec3) {
        let x = self.centres();
        let r = self.radius();
        let (low, high) = region::container_box(self.scene, &x);
        x.iter().fold((low, high), |(low, high), x| {
            let outside = |k: usize| x[k] <= low[k] || x[k] >= high[k];
            let reach = Vec3::from_fn(|k, _| if outside(k) { r } else { 0.0 });
            (low.inf(&(x - reach)), high.sup(&(x + reach)))
        })
    }
}

/// Writes what the command line asks for.
pub fn write(args: &ExportArgs) -> Result<(), Error> {
    check_options(args)?;
    let record = Record::open(&args.run)?;
    let frames = record.numbers(args.frame)?;
    let one_file = args.frame != Which::All || args.to == Format::Xyz;
    let targets: Vec<PathBuf> = match one_file {
        true => vec![args.output.clone()],
        false => frames.iter().map(|&k| numbered(&args.output, k)).collect(),
    };
    for target in &targets {
        files::check(target, &args.run, args.force)?;
        if args.to == Format::Raw {
            files::check(&header_of(target), &args.run, args.force)?;
        }
    }
    if args.to == Format::Raw {
        // Before any file: all frames must fit.
        for &k in &frames {
            let state = record.state(k)?;
            image(args, &Shot { scene: &record.scene, state: &state })?;
        }
    }
    let mut written = Vec::new();
    let mut file = None;
    for (number, &k) in frames.iter().enumerate() {
        let state = record.state(k)?;
        let shot = Shot { scene: &record.scene, state: &state };
        if number < targets.len() {
            finish(file.take())?;
            let target = &targets[number];
            file = Some(File::create(target, args.force)?);
            written.push(target.clone());
        }
        let out = file.as_mut().expect("the first frame has a file");
        match args.to {
            Format::Csv => out.write(|out| text::csv(&shot, out))?,
            Format::Xyz => out.write(|out| text::xyz(&shot, out))?,
            Format::Lammps => out.write(|out| text::lammps(&shot, out))?,
            Format::Vtp => out.write(|out| vtp::write(&shot, out))?,
            Format::Stl => {
                let subdivisions = args.subdivisions.unwrap_or(SUBDIVISIONS);
                stl::check(&shot, subdivisions)?;
                out.write(|out| stl::write(&shot, subdivisions, out))?;
            }
            Format::Raw => {
                let image = image(args, &shot)?;
                let mut ones = 0;
                out.write(|out| {
                    ones = image.write(&shot, out)?;
                    Ok(())
                })?;
                let header = header_of(&targets[number]);
                let text = image.header(&shot, &targets[number], ones);
                let mut file = File::create(&header, args.force)?;
                file.write(|out| out.write_all(text.as_bytes()))?;
                file.finish()?;
                written.push(header);
            }
        }
    }
    finish(file)?;
    launch::say(&format!("demhybrid: {}", told(&written, &frames, &record)));
    Ok(())
}

fn finish(file: Option<File>) -> Result<(), Error> {
    file.map_or(Ok(()), File::finish)
}

/// What was written, in a line.
fn told(written: &[PathBuf], frames: &[u64], record: &Record) -> String {
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
    format!("{files}: {which} of {}, {} spheres", record.path().display(), record.count)
}

/// The voxel image that the command line asks for.
fn image(args: &ExportArgs, shot: &Shot) -> Result<raw::Image, Error> {
    raw::Image::of(shot, args.resolution.unwrap_or(RESOLUTION), args.ones.unwrap_or(Phase::Solid))
}

/// Options that belong to another format would be ignored, and values out of range misunderstood.
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
            "--resolution {resolution}: it must be a finite number of voxels per radius greater than 0, e.g. 10"
        )));
    }
    if let Some(subdivisions) = args.subdivisions.filter(|&n| n > MOST_SUBDIVISIONS) {
        return Err(Error::Input(format!(
            "--subdivisions {subdivisions}: it must be 0 (20 triangles a sphere) to {MOST_SUBDIVISIONS}; 3 gives 1280"
        )));
    }
    Ok(())
}

/// A vector with the fewest digits that read back as the same doubles, its components after `separator` each.
fn vector(out: &mut dyn Write, vector: &[f64; 3], separator: &str) -> io::Result<()> {
    vector.iter().try_for_each(|number| write!(out, "{separator}{number:?}"))
}

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
