//! What the frames of a run told so far, for its summary and its warnings.

use super::Frame;
use crate::ode::Dissipation;
use serde::{Deserialize, Serialize};

/// What the frames told, for the summary: of the last one, unless said otherwise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameSummary {
    /// Number of particles.
    pub count: u64,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Potential energy, J.
    pub potential_energy: f64,
    /// Highest point, m.
    pub bed_height: f64,
    /// Energy dissipated by rebound and by friction since the start, J; zero unless `output.energy` asks for it.
    pub dissipated: Dissipation,
    /// Kinetic and potential energy at t = 0, J.
    pub start_energy: f64,
    /// Largest kinetic energy of any frame, J.
    pub largest_kinetic_energy: f64,
    /// Least kinetic and potential energy of any frame so far, J.
    pub lowest_energy: Option<f64>,
    /// By how much the energy of a frame was above that of an earlier one at most, J: no contact creates energy.
    pub largest_rise: f64,
}

impl FrameSummary {
    /// A frame was made; the first one is that of t = 0.
    pub fn follow<W>(&mut self, frame: &Frame<W>) {
        if frame.time == 0.0 {
            self.start_energy = frame.kinetic_energy + frame.potential_energy;
        }
        self.kinetic_energy = frame.kinetic_energy;
        self.potential_energy = frame.potential_energy;
        self.bed_height = frame.bed_height;
        self.dissipated = frame.dissipated;
        self.largest_kinetic_energy = self.largest_kinetic_energy.max(frame.kinetic_energy);
        let energy = frame.kinetic_energy + frame.potential_energy;
        let lowest = self.lowest_energy.map_or(energy, |lowest| lowest.min(energy));
        self.lowest_energy = Some(lowest);
        self.largest_rise = self.largest_rise.max(energy - lowest);
    }

    /// Energy that came from nowhere, J: what there is and what was dissipated, less what there was at the start.
    pub fn residual(&self) -> f64 {
        let [rebound, friction] = self.dissipated;
        self.kinetic_energy + self.potential_energy + rebound + friction - self.start_energy
    }
}
