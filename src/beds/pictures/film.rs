//! Writes pictures to files: PNG, numbered PNG, GIF and APNG.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::options::Size;
use super::picture::Picture;
use crate::error::Error;

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// One picture.
    Png,
    /// An animation with 256 colours.
    Gif,
    /// An animation with all colours.
    Apng,
}

impl Format {
    /// The format that belongs to the extension of `path`.
    pub fn of(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        match extension.to_str() {
            Some("png") => Ok(Format::Png),
            Some("gif") => Ok(Format::Gif),
            Some("apng") => Ok(Format::Apng),
            _ => Err(Error::Input(format!(
                "--output {}: the name must end in .png, or for an animation in .gif or .apng",
                path.display()
            ))),
        }
    }
}

/// Name of a numbered picture: NAME-0007.png for frame 7 and NAME.png.
pub fn numbered(path: &Path, frame: u64) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{frame:04}.{extension}"))
}

/// Checks, before anything is drawn, that `path` can be written.
pub fn look(path: &Path, run: &Path, force: bool) -> Result<(), Error> {
    let refuse = |why: &str| Err(Error::Input(format!("--output {}: {why}", path.display())));
    let same = |a: &Path, b: &Path| Some(a.canonicalize().ok()? == b.canonicalize().ok()?);
    if path.is_dir() {
        return refuse("is a folder; name a file in it");
    }
    if same(path, run) == Some(true) {
        return refuse("is the run that is drawn; choose another name");
    }
    if path.exists() && !force {
        return refuse("the file exists; use --force to replace it, or choose another name");
    }
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            refuse(&format!("there is no folder {}; create it first", folder.display()))
        }
        _ => Ok(()),
    }
}

fn create(path: &Path, force: bool) -> Result<BufWriter<File>, Error> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    if !force {
        options.create_new(true);
    }
    options.open(path).map(BufWriter::new).map_err(|why| {
        Error::Input(match why.kind() {
            ErrorKind::AlreadyExists => {
                format!("--output {}: the file exists; use --force to replace it", path.display())
            }
            _ => format!("--output {}: cannot be written: {why}", path.display()),
        })
    })
}

fn failed(path: &Path, why: impl ToString) -> Error {
    Error::Output { file: path.display().to_string(), why: why.to_string() }
}

fn encoder(file: BufWriter<File>, size: Size) -> png::Encoder<'static, BufWriter<File>> {
    let mut encoder = png::Encoder::new(file, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
}

/// Writes one picture.
pub fn write_png(path: &Path, picture: &Picture, force: bool) -> Result<(), Error> {
    let mut writer =
        encoder(create(path, force)?, picture.size).write_header().map_err(|why| failed(path, why))?;
    writer.write_image_data(picture.bytes()).and_then(|()| writer.finish()).map_err(|why| failed(path, why))
}

/// An animation that is being written.
pub struct Film {
    path: PathBuf,
    writer: Writer,
}

enum Writer {
    Gif { encoder: gif::Encoder<BufWriter<File>>, palette: Palette, delay: u16 },
    Apng(png::Writer<BufWriter<File>>),
}

impl Film {
    /// An APNG of `frames` pictures.
    pub fn apng(path: &Path, size: Size, frames: u32, fps: u16, force: bool) -> Result<Self, Error> {
        let mut encoder = encoder(create(path, force)?, size);
        let begun = encoder
            .set_animated(frames, 0)
            .and_then(|()| encoder.set_frame_delay(1, fps))
            .and_then(|()| encoder.write_header());
        let writer = begun.map_err(|why| failed(path, why))?;
        Ok(Film { path: path.to_path_buf(), writer: Writer::Apng(writer) })
    }

    /// A GIF whose colours are chosen from the pictures `samples`.
    pub fn gif(
        path: &Path,
        samples: &[Picture],
        background: [u8; 3],
        fps: u16,
        force: bool,
    ) -> Result<Self, Error> {
        let palette = Palette::new(samples, background);
        let Size { width, height } = samples[0].size;
        let file = create(path, force)?;
        let begun = gif::Encoder::new(file, width as u16, height as u16, palette.colours.as_flattened());
        let encoder = begun.and_then(|mut encoder| {
            encoder.set_repeat(gif::Repeat::Infinite)?;
            Ok(encoder)
        });
        let encoder = encoder.map_err(|why| failed(path, why))?;
        let delay = (100.0 / f64::from(fps)).round() as u16;
        Ok(Film { path: path.to_path_buf(), writer: Writer::Gif { encoder, palette, delay } })
    }

    /// Adds a picture.
    pub fn add(&mut self, picture: &Picture) -> Result<(), Error> {
        let path = &self.path;
        match &mut self.writer {
            Writer::Apng(writer) => writer.write_image_data(picture.bytes()).map_err(|why| failed(path, why)),
            Writer::Gif { encoder, palette, delay } => {
                let indices: Vec<u8> = picture.pixels.par_iter().map(|&pixel| palette.index(pixel)).collect();
                let Size { width, height } = picture.size;
                let mut frame = gif::Frame::from_indexed_pixels(width as u16, height as u16, indices, None);
                frame.delay = *delay;
                encoder.write_frame(&frame).map_err(|why| failed(path, why))
            }
        }
    }

    /// Completes the file.
    pub fn finish(self) -> Result<(), Error> {
        let path = &self.path;
        match self.writer {
            Writer::Apng(writer) => writer.finish().map_err(|why| failed(path, why)),
            Writer::Gif { encoder, .. } => {
                let mut file = encoder.into_inner().map_err(|why| failed(path, why))?;
                file.flush().map_err(|why| failed(path, why))
            }
        }
    }
}

/// The 256 colours of a GIF. All frames have the same ones, so that nothing flickers.
struct Palette {
    colours: Vec<[u8; 3]>,
    background: [u8; 3],
    /// Index of the nearest colour, for every combination of upper bits.
    nearest: Vec<u8>,
}

/// Number of upper bits of red, green and blue that select the nearest colour.
const BITS: usize = 6;

impl Palette {
    /// Chooses colours for `samples`. The first colour is exactly the background.
    fn new(samples: &[Picture], background: [u8; 3]) -> Self {
        let mut pixels = Vec::new();
        for [r, g, b] in samples.iter().flat_map(|picture| &picture.pixels).copied() {
            if [r, g, b] != background {
                pixels.extend([r, g, b, 255]);
            }
        }
        let mut colours = vec![background];
        if !pixels.is_empty() {
            let network = color_quant::NeuQuant::new(10, 255, &pixels);
            colours.extend(network.color_map_rgb().as_chunks::<3>().0);
        }
        colours.resize(256, background);
        let nearest = (0..1usize << (3 * BITS)).into_par_iter().map(|key| {
            let pixel = [2, 1, 0].map(|k| {
                let upper = (key >> (k * BITS)) & ((1 << BITS) - 1);
                ((upper << (8 - BITS)) + (1 << (7 - BITS))) as u8
            });
            let distance = |colour: &[u8; 3]| -> u32 {
                colour.iter().zip(pixel).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
            };
            let best = colours.iter().enumerate().min_by_key(|(_, colour)| distance(colour));
            best.map_or(0, |(index, _)| index as u8)
        });
        let nearest = nearest.collect();
        Palette { colours, background, nearest }
    }

    fn index(&self, pixel: [u8; 3]) -> u8 {
        if pixel == self.background {
            return 0;
        }
        self.nearest[pixel.iter().fold(0, |key, c| (key << BITS) | (usize::from(*c) >> (8 - BITS)))]
    }
}
