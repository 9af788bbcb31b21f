//! What a comparison of solvers is asked for.

use super::records::Study;
use super::sweep::Sweep;
use crate::ode::MethodName;
use std::path::PathBuf;

/// The question: a scene, and what is compared on it. An empty list leaves the choice to the study.
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
    /// Initial states of a scene with a grid: seeds 1 to this.
    pub seeds: u64,
    /// Time at which states are compared, s; none: the last one before trajectories part.
    pub time: Option<f64>,
    /// End of the runs of the ensemble, s; none: `t_end` of the scene.
    pub until: Option<f64>,
    /// A scene key that takes several values.
    pub sweep: Option<Sweep>,
    /// Whether the published solver is compared too.
    pub paper: bool,
    /// What is studied.
    pub studies: Vec<Study>,
}

impl Request {
    /// All studies of the scene file `scene`, with five starts.
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

    /// Whether `study` is asked for.
    pub fn asks(&self, study: Study) -> bool {
        self.studies.is_empty() || self.studies.contains(&study)
    }
}
