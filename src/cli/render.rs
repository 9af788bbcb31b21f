//! `demhybrid render`: draws pictures and animations of a run.

use std::path::PathBuf;

use clap::Args;
use clap::builder::RangedU64ValueParser;

use super::numbers::positive;
use crate::beds::pictures::{self, Background, Limits, Options, Projection, Quantity, Size};
use crate::domain::launch;
use crate::error::Error;
use crate::files::run_file::{RunFile, Which};

/// Draw the spheres of a run: a picture, numbered pictures, or an animation
///
/// Reads the output file of a run, finished or not, and draws its spheres by ray casting. By default
/// the camera takes in all spheres of all frames drawn. A colour means the same in every frame.
///
/// The edges of the container fade where it is open, or where its next side is far from all spheres.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(after_help = AFTER_HELP)]
pub struct RenderArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// Picture to write: NAME.png, or an animation: NAME.gif, NAME.apng
    ///
    /// With --frame all, NAME.png becomes NAME-0000.png, NAME-0001.png, ..., numbered as the frames are.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,

    /// Frames to draw: last, all, or a number from 0 on
    #[arg(long, value_name = "WHICH", default_value = "last", allow_negative_numbers = true)]
    pub frame: Which,

    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x960", allow_negative_numbers = true)]
    pub size: Size,

    /// What the colours show
    #[arg(long, value_name = "WHAT", value_enum, default_value = "height")]
    pub colour: Quantity,

    /// Values at the two ends of the colours, in the unit of the legend [default: those in the frames drawn]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub range: Option<Limits>,

    /// Direction from the spheres to the camera, of any length [default: from the front, right and above]
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        value_parser = triple,
        conflicts_with = "from"
    )]
    pub direction: Option<[f64; 3]>,

    /// Position of the camera, m [default: far enough to show everything]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
    pub from: Option<[f64; 3]>,

    /// Point that the camera looks at, m [default: the middle of everything]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
    pub target: Option<[f64; 3]>,

    /// Direction that points up in the picture [default: against gravity; without gravity 0,0,1]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
    pub up: Option<[f64; 3]>,

    /// How depth is drawn
    #[arg(long, value_name = "HOW", value_enum, default_value = "perspective")]
    pub projection: Projection,

    /// Magnify the picture about its middle
    #[arg(
        long,
        value_name = "FACTOR",
        default_value = "1",
        allow_negative_numbers = true,
        value_parser = positive
    )]
    pub zoom: f64,

    /// Colour of the background: white, black, grey or RRGGBB in hexadecimal digits
    #[arg(long, value_name = "COLOUR", default_value = "white")]
    pub background: Background,

    /// Draw neither legend nor time
    #[arg(long)]
    pub plain: bool,

    /// Draw no edges of the container
    #[arg(long)]
    pub no_container: bool,

    /// Frames per second of an animation
    #[arg(
        long,
        value_name = "N",
        default_value = "25",
        allow_negative_numbers = true,
        value_parser = RangedU64ValueParser::<u16>::new().range(1..=50)
    )]
    pub fps: u16,

    /// Threads [default: the cores, or RAYON_NUM_THREADS]
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = RangedU64ValueParser::<usize>::new().range(1..)
    )]
    pub threads: Option<usize>,

    /// Replace existing files
    #[arg(long)]
    pub force: bool,
}

impl RenderArgs {
    fn options(&self) -> Options {
        Options {
            output: self.output.clone(),
            numbered: self.frame == Which::All,
            size: self.size,
            colour: self.colour,
            range: self.range,
            direction: self.direction,
            from: self.from,
            target: self.target,
            up: self.up,
            projection: self.projection,
            zoom: self.zoom,
            background: self.background,
            plain: self.plain,
            no_container: self.no_container,
            fps: self.fps,
            threads: self.threads,
            force: self.force,
        }
    }
}

/// Draws the pictures that the command line asks for.
pub fn run(args: &RenderArgs) -> Result<(), Error> {
    // Refuse a file name that no picture can have before reading the run.
    pictures::check_format(&args.output)?;
    let run = RunFile::open(&args.run)?;
    let frames = run.numbers(args.frame)?;
    let paths = pictures::draw(&run, &frames, &args.options())?;
    let named = |path: &PathBuf| path.display().to_string();
    launch::say(&match (paths.as_slice(), frames.len()) {
        ([path], 1) => format!("demhybrid: {} is drawn", named(path)),
        ([path], count) => format!("demhybrid: {} is drawn, {count} frames", named(path)),
        ([first, .., last], count) => {
            format!("demhybrid: {} to {} are drawn, {count} files", named(first), named(last))
        }
        ([], _) => unreachable!("a run has a frame"),
    });
    Ok(())
}

const AFTER_HELP: &str = "\
Examples:
  demhybrid render settle.vtkhdf -o bed.png
  demhybrid render settle.vtkhdf -o bed.png --colour force --range 0,200 --size 1920x1080
  demhybrid render settle.vtkhdf -o bed.png --direction 0,-1,0 --projection orthographic
  demhybrid render settle.vtkhdf -o bed.gif --frame all --size 640x480 --colour speed
  demhybrid render mixture.vtkhdf -o mixture.png --colour species

A film from numbered pictures, for example with ffmpeg:
  demhybrid render settle.vtkhdf -o bed.png --frame all --size 1920x1080
  ffmpeg -framerate 25 -i bed-%04d.png -pix_fmt yuv420p bed.mp4

A GIF has 256 colours; APNG is exact, and browsers show it as they show GIF.";

fn triple(text: &str) -> Result<[f64; 3], String> {
    let wrong = || "it must be three numbers with commas between them, such as 1,-2,0.5".to_owned();
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().map_err(|_| wrong()))
        .collect::<Result<_, _>>()?;
    match <[f64; 3]>::try_from(numbers) {
        Ok(triple) if triple.iter().all(|c| c.is_finite()) => Ok(triple),
        Ok(_) => Err("its numbers must be finite".into()),
        Err(_) => Err(wrong()),
    }
}
