//! Pictures and animations of a run, by ray casting.
//!
//! A first pass reads all frames and finds what all pictures share: the camera, the range of the colours and
//! the edges of the container. A second pass draws the frames one by one.
//!
//! `camera` places the camera and makes rays, `caster` finds what they hit, and `light` computes colours.
//! `shadows` finds the spheres around a point. `quantity` defines what colours mean, `species` has those of
//! species, `legend` draws the legend, and `film` writes files.

mod camera;
mod caster;
mod edges;
mod film;
mod legend;
mod light;
mod options;
mod picture;
mod quantity;
mod shadows;
mod species;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use options::{Background, Limits, Projection, Size};
pub use picture::Picture;
pub use quantity::Quantity;

use crate::beds::measures::region::Upright;
use crate::error::Error;
use crate::files::output::Species;
use crate::files::run_file::{RunFile, State};
use crate::math::digits::short;
use crate::math::polyhedron::across;
use crate::math::vector::Vec3;
use crate::scene;
use camera::{Ball, Camera, Wanted};
use caster::Subject;
use edges::Edge;
use film::{Film, Format};
use legend::{Layout, time_label};

/// Colour of the spheres if colours have no meaning.
const ALIKE: [u8; 3] = [122, 154, 190];

/// The options of pictures and animations.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Picture or animation to write.
    pub output: PathBuf,
    /// Whether to write one picture for each frame, unless the file is an animation.
    pub numbered: bool,
    /// Width and height.
    pub size: Size,
    /// The quantity that the colours show.
    pub colour: Quantity,
    /// Values at the two ends of the colour scale; `None`: their range in the frames that are drawn.
    pub range: Option<Limits>,
    /// Direction from the spheres to the camera.
    pub direction: Option<[f64; 3]>,
    /// Position of the camera, m.
    pub from: Option<[f64; 3]>,
    /// Point that the camera looks at, m.
    pub target: Option<[f64; 3]>,
    /// Direction that points up in the picture.
    pub up: Option<[f64; 3]>,
    /// How depth is drawn.
    pub projection: Projection,
    /// Magnification about the middle.
    pub zoom: f64,
    /// Colour of the background.
    pub background: Background,
    /// Whether to leave out legend and time.
    pub plain: bool,
    /// Whether to leave out the edges of the container.
    pub no_container: bool,
    /// Frames per second of an animation.
    pub fps: u16,
    /// Number of threads; `None`: one for each core.
    pub threads: Option<usize>,
    /// Whether to replace existing files.
    pub force: bool,
}

/// Checks that `output` has the extension of a picture or an animation.
pub fn check_format(output: &Path) -> Result<(), Error> {
    Format::of(output).map(|_| ())
}

/// Draws the `frames` of the run file `run_file`; returns the files that were written.
pub fn draw(run_file: &RunFile, frames: &[u64], options: &Options) -> Result<Vec<PathBuf>, Error> {
    let format = Format::of(&options.output)?;
    let paths: Vec<PathBuf> = match (format, options.numbered) {
        (Format::Png, true) => frames.iter().map(|&k| film::numbered(&options.output, k)).collect(),
        _ => vec![options.output.clone()],
    };
    for path in &paths {
        film::look(path, run_file.path(), options.force)?;
    }
    let threads = rayon::ThreadPoolBuilder::new().num_threads(options.threads.unwrap_or(0)).build();
    let threads = threads.map_err(|why| Error::Input(format!("--threads: they cannot be started: {why}")))?;
    threads.install(|| {
        let studio = Studio::new(options, run_file, frames)?;
        match format {
            Format::Png => {
                for (&frame, path) in frames.iter().zip(&paths) {
                    film::write_png(path, &studio.picture(&run_file.state(frame)?), options.force)?;
                }
                Ok(())
            }
            Format::Gif | Format::Apng => studio.film(options, run_file, frames, format),
        }
    })?;
    Ok(paths)
}

/// Everything that is the same in all pictures.
struct Studio<'a> {
    scene: &'a scene::Scene,
    species: Option<&'a Species>,
    quantity: Quantity,
    limits: Limits,
    size: Size,
    layout: Layout,
    camera: Camera,
    edges: Vec<Edge>,
    upright: Upright,
    /// Direction that points up in the picture.
    up: Vec3,
    background: [u8; 3],
    plain: bool,
    interval: f64,
}

impl<'a> Studio<'a> {
    fn new(options: &Options, run_file: &'a RunFile, frames: &[u64]) -> Result<Self, Error> {
        let scene = &run_file.scene;
        let species = run_file.species.as_ref();
        check_colour(options, run_file)?;
        let upright = Upright::of(scene);
        let upwards = upright.up;
        let survey = Survey::new(run_file, frames, options.colour, &upright)?;
        let limits =
            options.range.unwrap_or_else(|| options.colour.limits(survey.values[0], survey.values[1]));
        let interval = scene.output.interval.unwrap_or(scene.t_end / 100.0);
        let time = time_label(survey.last_time, interval);
        let names = species.map_or(&[][..], |species| &species.names);
        let layout = Layout::new(options.size, options.colour, limits, names, options.plain, &time)?;
        let edges = match options.no_container {
            true => Vec::new(),
            false => edges::edges(&scene::walls::walls(&scene.container), &upright, &survey.ends),
        };
        let up = options.up.map_or(upwards, Vec3::from);
        let wanted = Wanted {
            direction: options.direction.map_or_else(|| from_the_front(&upwards), Vec3::from),
            from: options.from.map(Vec3::from),
            target: options.target.map(Vec3::from),
            up,
            projection: options.projection,
            zoom: options.zoom,
        };
        let mut balls = survey.balls;
        balls.extend(edges.iter().flat_map(|edge| edge.ends).map(|x| (x, 0.0)));
        let camera = Camera::new(&wanted, &balls, options.size, layout.frame)?;
        Ok(Studio {
            scene,
            species,
            quantity: options.colour,
            limits,
            size: options.size,
            layout,
            camera,
            edges,
            upright,
            up: up.try_normalize(0.0).unwrap_or(upwards),
            background: options.background.0,
            plain: options.plain,
            interval,
        })
    }

    /// The colour at the share `share` (0 to 1) of the colour scale.
    fn colour(&self, share: f64) -> [u8; 3] {
        match self.quantity {
            Quantity::None => ALIKE,
            _ => {
                let colorous::Color { r, g, b } = colorous::VIRIDIS.eval_continuous(share);
                [r, g, b]
            }
        }
    }

    fn picture(&self, state: &State) -> Picture {
        let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
        let values = self.quantity.values(self.scene, state, self.species, &self.upright);
        let of_value = |&value: &f64| match self.quantity {
            Quantity::Species => species::colour(value as usize),
            _ => self.colour(self.limits.share(value)),
        };
        let colours: Vec<[u8; 3]> = values.iter().map(of_value).collect();
        let [r, g, b] = light::linear(self.background);
        let is_bright = 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18;
        let (ink, edge) = if is_bright { ([24; 3], [96; 3]) } else { ([236; 3], [168; 3]) };
        let subject = Subject {
            x: &x,
            sizes: state.sizes(self.scene),
            colours: &colours,
            edges: &self.edges,
            up: self.up,
            background: self.background,
            ink: edge,
        };
        let mut picture = caster::draw(&subject, &self.camera, self.size);
        let time = (!self.plain).then(|| time_label(state.time, self.interval));
        self.layout.draw(&mut picture, time.as_deref(), [ink, self.background], |share| self.colour(share));
        picture
    }

    fn film(
        &self,
        options: &Options,
        run_file: &RunFile,
        frames: &[u64],
        format: Format,
    ) -> Result<(), Error> {
        let mut film = if format == Format::Gif {
            // Choose the colours from the first picture, the last one, and one between them.
            let sampled = [frames[0], frames[frames.len() / 2], frames[frames.len() - 1]];
            let samples = sampled.iter().map(|&k| Ok(self.picture(&run_file.state(k)?)));
            let samples = samples.collect::<Result<Vec<_>, Error>>()?;
            Film::gif(&options.output, &samples, self.background, options.fps, options.force)?
        } else {
            let count =
                u32::try_from(frames.len()).map_err(|_| run_file.unreadable("it holds too many frames"))?;
            Film::apng(&options.output, self.size, count, options.fps, options.force)?
        };
        for &frame in frames {
            film.add(&self.picture(&run_file.state(frame)?))?;
        }
        film.finish()
    }
}

/// Refuses colours for what the spheres of the run do not have.
fn check_colour(options: &Options, run_file: &RunFile) -> Result<(), Error> {
    let refuse = |why: String| Err(Error::Input(format!("--colour {why}")));
    let (run, choice) = (run_file.path().display(), "choose height, speed, force, overlap or none");
    match options.colour {
        Quantity::Spin if !run_file.scene.rotates() => {
            refuse(format!("spin: the spheres of {run} do not rotate; {choice}"))
        }
        Quantity::Radius if run_file.sizes.iter().all(|size| size.r == run_file.sizes[0].r) => {
            let r = short(run_file.scene.particles.radius);
            refuse(format!("radius: all spheres of {run} have the radius {r} m; {choice}"))
        }
        Quantity::Species if run_file.species.is_none() => refuse(format!(
            "species: the spheres of {run} have none; [[species]] or a column species in particles.file would \
             name them, or {choice}"
        )),
        Quantity::Species if options.range.is_some() => {
            refuse("species: its colours have no --range; leave that out".to_owned())
        }
        _ => Ok(()),
    }
}

/// The default direction to the camera. If z is up, it is in front (-y), to the right (x) and above.
fn from_the_front(up: &Vec3) -> Vec3 {
    let (right, away) = across(up);
    right * 0.5 - away + up * 0.42
}

/// Properties of all frames together.
struct Survey {
    /// Balls that cover all positions of spheres.
    balls: Vec<Ball>,
    /// Where the spheres end along the six ways of [`Upright::ways`], m from the origin.
    ends: [f64; 6],
    /// Smallest and largest value of the quantity.
    values: [f64; 2],
    last_time: f64,
}

impl Survey {
    fn new(run_file: &RunFile, frames: &[u64], quantity: Quantity, upright: &Upright) -> Result<Self, Error> {
        let ways = upright.ways();
        let mut survey = Survey {
            balls: Vec::new(),
            ends: [f64::NEG_INFINITY; 6],
            values: [f64::INFINITY, f64::NEG_INFINITY],
            last_time: 0.0,
        };
        let mut kept = Kept::default();
        for &frame in frames {
            let state = run_file.state(frame)?;
            let sizes = state.sizes(&run_file.scene);
            for (i, x) in state.x.iter().map(|&x| Vec3::from(x)).enumerate() {
                if !x.iter().all(|c| c.is_finite()) {
                    return Err(
                        run_file.unreadable(&format!("frame {frame} has a position that is no number"))
                    );
                }
                let r = sizes.of(i).r;
                for (end, way) in survey.ends.iter_mut().zip(&ways) {
                    *end = end.max(way.dot(&x) + r);
                }
                match frames.len() {
                    1 => survey.balls.push((x, r)),
                    _ => kept.add((x, r), &mut survey.balls),
                }
            }
            for value in quantity.values(&run_file.scene, &state, run_file.species.as_ref(), upright) {
                survey.values = [survey.values[0].min(value), survey.values[1].max(value)];
            }
            survey.last_time = state.time;
        }
        if survey.balls.is_empty() {
            return Err(run_file.unreadable("it holds no spheres"));
        }
        Ok(survey)
    }
}

/// Which of the balls of many frames are kept: one for each small cell and octave of radii.
#[derive(Default)]
struct Kept {
    /// The radius of the first ball, m, from which octaves are counted.
    first: f64,
    /// Index of the ball for an octave and a cell.
    places: HashMap<(i32, [i64; 3]), usize>,
}

impl Kept {
    /// Adds a ball to `balls`, unless there is one that is as large, a quarter of the radius away at most
    /// along each axis.
    fn add(&mut self, (x, r): Ball, balls: &mut Vec<Ball>) {
        if balls.is_empty() {
            self.first = r;
        }
        let octave = (r / self.first).log2().floor() as i32;
        let side = 0.25 * self.first * f64::from(octave).exp2();
        let cell = [0, 1, 2].map(|k| (x[k] / side).floor() as i64);
        let place = *self.places.entry((octave, cell)).or_insert(balls.len());
        if place == balls.len() {
            balls.push((x, r));
        } else if r > balls[place].1 {
            balls[place] = (x, r);
        }
    }
}

#[cfg(test)]
mod kept {
    use super::*;

    #[test]
    fn of_the_balls_of_many_frames_the_largest_in_a_cell_is_kept_in_each_octave() {
        let (mut kept, mut balls) = (Kept::default(), Vec::new());
        let at = |x: f64| Vec3::new(x, 0.0, 0.0);
        for ball in [(at(0.1), 1.0), (at(0.2), 1.0), (at(0.15), 1.5), (at(0.16), 1.2), (at(0.3), 1.0)] {
            kept.add(ball, &mut balls);
        }
        assert_eq!(balls, [(at(0.15), 1.5), (at(0.3), 1.0)]);
        // Small ones in the same place stay, and have smaller cells.
        for ball in [(at(0.1), 0.01), (at(0.1), 2.5), (at(0.11), 0.01)] {
            kept.add(ball, &mut balls);
        }
        assert_eq!(balls[2..], [(at(0.1), 0.01), (at(0.1), 2.5), (at(0.11), 0.01)]);
    }
}
