//! What is known from the frames of a run so far, for its summary and its warnings.

use super::Frame;
use crate::ode::Dissipation;
use serde::{Deserialize, Serialize};

/// What is known from the frames so far: values of the last frame, unless stated otherwise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameSummary {
    /// Number of particles.
    pub count: u64,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Potential energy, J.
    pub potential_energy: f64,
    /// Highest point of any sphere, m.
    pub bed_height: f64,
    /// Energy dissipated by rebound and by friction since the start, J; zero unless `output.energy` is on.
    pub dissipated: Dissipation,
    /// Kinetic plus potential energy at t = 0, J.
    pub start_energy: f64,
    /// Largest kinetic energy of any frame, J.
    pub largest_kinetic_energy: f64,
    /// Smallest kinetic plus potential energy of any frame so far, J.
    pub lowest_energy: Option<f64>,
    /// Largest rise of the energy of a frame above that of an earlier one, J. No contact creates energy.
    pub largest_rise: f64,
    /// Largest kinetic plus potential energy of any frame so far, J.
    pub highest_energy: Option<f64>,
    /// Largest fall of the energy of a frame below that of an earlier one, J. Where no effect dissipates energy
    /// nothing explains it.
    pub largest_fall: f64,
}

impl FrameSummary {
    /// Takes a frame into account. The first frame is that of t = 0.
    pub fn follow(&mut self, frame: &Frame) {
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
        let highest = self.highest_energy.map_or(energy, |highest| highest.max(energy));
        self.highest_energy = Some(highest);
        self.largest_fall = self.largest_fall.max(highest - energy);
    }

    /// Energy that has no source, J: the energy now plus what was dissipated, minus the energy at the start.
    pub fn residual(&self) -> f64 {
        let [rebound, friction] = self.dissipated;
        self.kinetic_energy + self.potential_energy + rebound + friction - self.start_energy
    }
}
