//! Reads the output file of a run, whether that run is finished, stopped or killed.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use hdf5::types::{TypeDescriptor, VarLenUnicode};

use crate::error::Error;
use crate::files::names::Series;
use crate::files::output::{self, Found, Species};
use crate::model::size::{Size, Sizes};
use crate::scene::Scene;

/// The output file of a run, open for reading.
#[derive(Debug)]
pub struct RunFile {
    path: PathBuf,
    file: hdf5::File,
    /// The scene, with every default filled in.
    pub scene: Scene,
    /// Number of complete frames, at least one.
    pub frames: u64,
    /// Number of particles.
    pub count: u64,
    /// Whether the run is complete.
    pub completed: bool,
    /// The size of each particle; none where all have that of the scene.
    pub sizes: Arc<[Size]>,
    /// The species of the particles, if they have any.
    pub species: Option<Species>,
    /// The number of the material of each particle in the scene; none where nobody has a material.
    pub materials: Arc<[u32]>,
}

/// The state of all particles in one frame, in the order of their ids.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Number of the frame.
    pub frame: u64,
    /// Time, s.
    pub time: f64,
    /// Centres, m.
    pub x: Vec<[f64; 3]>,
    /// Velocities, m/s.
    pub v: Vec<[f64; 3]>,
    /// Angular velocities, 1/s; none if the scene has no rotation.
    pub omega: Option<Vec<[f64; 3]>>,
    /// The size of each particle; none where all have that of the scene.
    pub sizes: Arc<[Size]>,
    /// The number of the material of each particle in the scene; none where nobody has a material.
    pub materials: Arc<[u32]>,
}

impl State {
    /// The sizes of the particles, in a run of `scene`.
    pub fn sizes(&self, scene: &Scene) -> Sizes<'_> {
        match &self.sizes[..] {
            [] => Sizes::Equal(Size::new(scene.particles.radius, scene.particles.mass)),
            sizes => Sizes::Each(sizes),
        }
    }
}

/// The frames that a command reads.
///
/// # Examples
///
/// ```rust
/// use demhybrid::files::run_file::Which;
///
/// assert_eq!("last".parse(), Ok(Which::Last));
/// assert_eq!("17".parse(), Ok(Which::Number(17)));
/// assert!("first".parse::<Which>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Which {
    /// The last complete frame.
    #[default]
    Last,
    /// All complete frames.
    All,
    /// The frame with this number, from 0 on.
    Number(u64),
}

impl FromStr for Which {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "last" => Ok(Which::Last),
            "all" => Ok(Which::All),
            number => number
                .parse()
                .map(Which::Number)
                .map_err(|_| "it must be last, all or the number of a frame".into()),
        }
    }
}

impl RunFile {
    /// Opens the output file `path`, which must hold at least one complete frame.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::files::run_file::RunFile;
    ///
    /// let mistake = RunFile::open("no-run.vtkhdf".as_ref()).unwrap_err();
    /// assert!(mistake.to_string().starts_with("no-run.vtkhdf: there is no such file"));
    /// assert_eq!(mistake.exit_code(), 2);
    /// ```
    pub fn open(path: &Path) -> Result<Self, Error> {
        let unusable = |why: String| Error::Input(format!("{}: {why}", path.display()));
        if !path.exists() {
            return Err(unusable("there is no such file; it must be the output file of a run".into()));
        }
        let Found { scene, completed, frames, count, .. } = output::inspect(path).map_err(unusable)?;
        if frames == 0 {
            return Err(unusable("it holds no complete frame yet".into()));
        }
        let scene =
            Scene::parse("", &scene, &[]).map_err(|why| unusable(format!("its scene is broken: {why}")))?;
        let file = hdf5::File::open(path).map_err(|why| unusable(why.to_string()))?;
        let output::Bodies { sizes, species, materials } = output::bodies(&file, count).map_err(unusable)?;
        let (path, sizes, materials) = (path.to_path_buf(), sizes.into(), materials.into());
        Ok(RunFile { path, file, scene, frames, count, completed, sizes, species, materials })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Numbers of the frames that `which` selects.
    pub fn numbers(&self, which: Which) -> Result<Vec<u64>, Error> {
        match which {
            Which::Last => Ok(vec![self.frames - 1]),
            Which::All => Ok((0..self.frames).collect()),
            Which::Number(k) if k < self.frames => Ok(vec![k]),
            Which::Number(k) => Err(self.unreadable(&format!(
                "--frame {k}: the file holds the frames 0 to {}; last is the newest",
                self.frames - 1
            ))),
        }
    }

    /// The state of all particles in frame `k`, which must be complete.
    pub fn state(&self, k: u64) -> Result<State, Error> {
        let state = output::frame(&self.file, k, self.count).map_err(|why| self.unreadable(&why))?;
        let time = self.series(Series::Time)?.get(k as usize).copied();
        let time = time.ok_or_else(|| self.unreadable(&format!("frame {k} has no time")))?;
        Ok(State {
            frame: k,
            time,
            x: state.x,
            v: state.v,
            omega: self.scene.rotates().then_some(state.omega),
            sizes: self.sizes.clone(),
            materials: self.materials.clone(),
        })
    }

    /// A column of `/run/series`: one row per complete frame. Counts become real numbers.
    pub fn series(&self, series: Series) -> Result<Vec<f64>, Error> {
        match series.is_count() {
            true => Ok(self.counts(series)?.into_iter().map(|count| count as f64).collect()),
            false => self.column(series),
        }
    }

    /// A column of `/run/series` that holds counts: one row per complete frame.
    pub fn counts(&self, series: Series) -> Result<Vec<i64>, Error> {
        self.column(series)
    }

    /// The attributes of `/run` except the scene, as names and values. Real numbers are in SI units.
    pub fn facts(&self) -> Result<Vec<(String, String)>, Error> {
        let read = || -> hdf5::Result<Vec<(String, String)>> {
            let run = self.file.group("run")?;
            let mut facts = Vec::new();
            for name in run.attr_names()?.into_iter().filter(|name| name != "scene") {
                let attribute = run.attr(&name)?;
                let value = match attribute.dtype()?.to_descriptor()? {
                    TypeDescriptor::Integer(_) => attribute.read_scalar::<i64>()?.to_string(),
                    TypeDescriptor::Float(_) => attribute.read_scalar::<f64>()?.to_string(),
                    _ => attribute.read_scalar::<VarLenUnicode>()?.to_string(),
                };
                facts.push((name, value));
            }
            Ok(facts)
        };
        read().map_err(|why| self.unreadable(&format!("what /run records cannot be read: {why}")))
    }

    fn column<T: hdf5::types::H5Type>(&self, series: Series) -> Result<Vec<T>, Error> {
        let column =
            self.file.dataset(&format!("run/series/{series}")).and_then(|column| column.read_raw::<T>());
        let mut column =
            column.map_err(|why| self.unreadable(&format!("its series {series} cannot be read: {why}")))?;
        // A run that was killed may have written one row too many.
        column.truncate(self.frames as usize);
        Ok(column)
    }

    /// An error that names this file and says what is wrong with it, or with what is asked of it.
    pub fn unreadable(&self, why: &str) -> Error {
        Error::Input(format!("{}: {why}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_named_by_number_or_as_the_last_or_all() {
        assert_eq!("last".parse(), Ok(Which::Last));
        assert_eq!("all".parse(), Ok(Which::All));
        assert_eq!("17".parse(), Ok(Which::Number(17)));
        for wrong in ["", "-1", "first", "1.5", "99999999999999999999"] {
            assert!(wrong.parse::<Which>().unwrap_err().contains("last, all or the number"), "{wrong}");
        }
    }

    #[test]
    fn what_is_no_output_file_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let missing = RunFile::open(&folder.path().join("a.vtkhdf")).unwrap_err();
        assert!(missing.to_string().contains("a.vtkhdf: there is no such file"), "{missing}");
        let text = folder.path().join("b.vtkhdf");
        std::fs::write(&text, "no HDF5").unwrap();
        let foreign = RunFile::open(&text).unwrap_err();
        assert!(foreign.to_string().contains("cannot be opened as an HDF5 file"), "{foreign}");
        assert_eq!(foreign.exit_code(), 2);
    }
}
