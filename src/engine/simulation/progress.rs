//! What a run has done so far, and when its frames and checkpoints are due.

use super::rest_detector;
use crate::engine::dynamics::Overlap;
use crate::ode::{Dissipation, Limit};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Work done so far, the same on every rank and for any number of ranks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Accepted steps.
    pub accepted: u64,
    /// Rejected steps: their error was too large.
    pub rejected: u64,
    /// Trials in which a particle left the range of the neighbour lists or moved too far.
    pub outrun: u64,
    /// Steps accepted at the smallest size although their error was too large.
    pub forced: u64,
    /// Right-hand sides, each counted once over all ranks, including those of rejected trials and of frames.
    pub rhs: u64,
    /// Pairs within l_max whose force was evaluated.
    pub pairs: u64,
    /// Number of times that the neighbour lists were built.
    pub rebuilds: u64,
    /// Accepted steps by what decided their size, in the order of `Limit::ALL`.
    pub limits: [u64; Limit::ALL.len()],
}

/// What a run has done so far: the same on every rank, and saved as it is in checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Number of the next frame: frames before it are complete.
    pub frame: u64,
    /// Work done. Of pairs, while the run goes on, those of this rank.
    pub counts: Counts,
    /// Proposed size of the next step, s, and what decided it.
    pub(super) h: f64,
    pub(super) limit: Limit,
    /// Size of the last accepted step, s.
    pub(super) last: f64,
    /// Energy dissipated up to the last accepted state, J.
    pub(super) dissipated: Dissipation,
    /// Consecutive steps that were forced.
    pub(super) forced_in_a_row: u64,
    /// State of the rest detector.
    pub(super) rest: rest_detector::RestState,
    /// Largest overlap of any frame.
    pub(super) largest_overlap: Overlap,
}

impl Progress {
    /// Of a run that has done nothing; `h` (s) is its first step.
    pub(super) fn new(h: f64) -> Self {
        Progress {
            frame: 0,
            counts: Counts::default(),
            h,
            limit: Limit::First,
            last: 0.0,
            dissipated: [0.0; 2],
            forced_in_a_row: 0,
            rest: rest_detector::RestState::default(),
            largest_overlap: Overlap::default(),
        }
    }
}

/// When frames and checkpoints are due.
#[derive(Debug, Clone, Copy)]
pub(super) struct Schedule {
    pub(super) t_end: f64,
    /// Time between frames, s.
    interval: f64,
    /// Simulated time between checkpoints, s; infinite if checkpoints are only written on request.
    checkpoint_interval: f64,
    /// Whether a checkpoint is written at the end too.
    pub(super) checkpoint_at_end: bool,
    /// Time of the last checkpoint, or of the start, s.
    pub(super) saved: f64,
}

impl Schedule {
    pub(super) fn new(scene: &Scene) -> Self {
        let checkpoint = scene.checkpoint.as_ref();
        Schedule {
            t_end: scene.t_end,
            interval: scene.output.interval.unwrap_or(scene.t_end / 100.0),
            checkpoint_interval: checkpoint.and_then(|keys| keys.interval).unwrap_or(f64::INFINITY),
            checkpoint_at_end: checkpoint.is_some(),
            saved: 0.0,
        }
    }

    /// Time of frame `k`: k times the interval, or the end of the scene, s.
    pub(super) fn frame_time(&self, k: u64) -> f64 {
        let t = k as f64 * self.interval;
        if t < self.t_end - 1e-9 * self.interval { t } else { self.t_end }
    }

    /// Whether a checkpoint is due at time `t` (s).
    pub(super) fn checkpoint_is_due(&self, t: f64) -> bool {
        let passed = |t: f64| (t / self.checkpoint_interval).floor();
        passed(t) > passed(self.saved)
    }
}

/// Wall times of this process.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallClock {
    pub(super) started: Instant,
    /// Time spent on frames and checkpoints, s.
    pub(super) output_seconds: f64,
}
