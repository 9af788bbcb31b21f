//! The request for a comparison of solvers.

use super::records::Study;
use super::sweep::Sweep;
use crate::ode::MethodName;
use std::path::PathBuf;

/// A scene, and what to compare on it. If a list is empty, the study chooses its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Scene file.
    pub scene: PathBuf,
    /// KEY=VALUE of every `--set`.
    pub set: Vec<String>,
    /// Methods to compare.
    pub methods: Vec<MethodName>,
    /// Tolerances of the methods with error control.
    pub tolerances: Vec<f64>,
    /// Steps of velocity Verlet, s.
    pub steps: Vec<f64>,
    /// Number of initial states of a scene with a grid. The seeds are 1 to this number.
    pub seeds: u64,
    /// Time at which states are compared, s; `None`: the last time before trajectories separate.
    pub time: Option<f64>,
    /// End of the runs of the ensemble, s; `None`: `t_end` of the scene.
    pub until: Option<f64>,
    /// A scene key that takes several values.
    pub sweep: Option<Sweep>,
    /// Whether the solver of the paper is compared too.
    pub paper: bool,
    /// Studies to do; empty: all of them.
    pub studies: Vec<Study>,
}

impl Request {
    /// All studies of the scene file `scene`, with five initial states.
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        Request {
            scene: scene.into(),
            set: Vec::new(),
            methods: Vec::new(),
            tolerances: Vec::new(),
            steps: Vec::new(),
            seeds: 5,
            time: None,
            until: None,
            sweep: None,
            paper: false,
            studies: Vec::new(),
        }
    }

    /// Whether the request includes `study`.
    pub fn asks(&self, study: Study) -> bool {
        self.studies.is_empty() || self.studies.contains(&study)
    }
}
