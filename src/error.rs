//! Everything that can end a run early, each with the exit code that tells a script what happened.

use std::fmt;
use thiserror::Error;

/// A reason to stop. Messages are lower case, without a full stop, with value, unit and time.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// Something found before the first step: scene, particles, command line, output location.
    /// The text is complete: it names the key or file, the value and what would be right.
    #[error("{0}")]
    Input(String),

    /// Two particles share one centre: the direction of their contact is undefined.
    #[error(
        "the centres of particles {i} and {j} coincide at t = {t} s: a contact between them has no direction"
    )]
    Coincident {
        /// Lower particle id.
        i: u64,
        /// Higher particle id.
        j: u64,
        /// Time, s.
        t: f64,
    },

    /// The force between two particles is beyond the range of a double.
    #[error(
        "the force between particles {i} and {j} is not finite at t = {t} s: their overlap is {overlap} m, and the \
         repulsion grows as exp(contact.stiffness_exponent * overlap), which overflows beyond exp(709)"
    )]
    PairForce {
        /// Lower particle id.
        i: u64,
        /// Higher particle id.
        j: u64,
        /// Overlap, m.
        overlap: f64,
        /// Time, s.
        t: f64,
    },

    /// The force between a particle and a wall is beyond the range of a double.
    #[error(
        "the force of wall {wall} on particle {i} is not finite at t = {t} s: its overlap is {overlap} m, and the \
         repulsion grows as exp(contact.stiffness_exponent * overlap), which overflows beyond exp(709)"
    )]
    WallForce {
        /// Particle id.
        i: u64,
        /// Wall number: sides of the box first (min x, max x, min y, ...), then `container.wall` in order.
        wall: usize,
        /// Overlap, m.
        overlap: f64,
        /// Time, s.
        t: f64,
    },

    /// The right-hand side is beyond the range of a double although every contact force is finite.
    #[error(
        "the acceleration of particle {i} is not finite at t = {t} s: gravity, forces or 1/mass are too large"
    )]
    Acceleration {
        /// Particle id.
        i: u64,
        /// Time, s.
        t: f64,
    },

    /// No step at or above the smallest allowed one gives a finite state and a later time.
    #[error(
        "no step can be made from t = {t} s: it fell to {h:e} s (solver.min_step = {min_step:e} s), limited by particle {i}"
    )]
    NoStep {
        /// Time, s.
        t: f64,
        /// Step that was tried last, s.
        h: f64,
        /// `solver.min_step`, s.
        min_step: f64,
        /// Id of the particle that limits the step.
        i: u64,
    },

    /// A particle would outrun its neighbours within the smallest allowed step.
    #[error(
        "particle {i} moves too far at t = {t} s: within a step of {h:e} s (solver.min_step) by more than {travel} m \
         (0.3 particles.radius), and a collision could be missed"
    )]
    TooFast {
        /// Time, s.
        t: f64,
        /// Step that was tried last, s.
        h: f64,
        /// Particle id.
        i: u64,
        /// Furthest that a step may move a particle, m.
        travel: f64,
    },

    /// Steps at the minimum were accepted too often: the error estimate is rounding noise.
    #[error(
        "solver.tolerance = {tolerance:e} is below round-off: {forced} of {accepted} steps up to t = {t} s were accepted \
         at solver.min_step = {min_step:e} s with a larger error (step {h:e} s, limited by particle {i}); \
         a larger tolerance, or smaller forces at the start, would do"
    )]
    BelowRoundOff {
        /// `solver.tolerance`.
        tolerance: f64,
        /// Steps accepted at the minimum in spite of their error.
        forced: u64,
        /// All accepted steps.
        accepted: u64,
        /// Time, s.
        t: f64,
        /// Current step, s.
        h: f64,
        /// `solver.min_step`, s.
        min_step: f64,
        /// Id of the particle that limits the step.
        i: u64,
    },

    /// A tolerance that the rounding of a single step exceeds.
    #[error(
        "solver.tolerance = {tolerance:e} is below round-off: a step is rounded by {rounding:.1e} of the scales of the norm, \
         as particle {i} is so far from the origin or so fast; {enough:.1e} or more would do"
    )]
    Rounding {
        /// `solver.tolerance`.
        tolerance: f64,
        /// Rounding of a step in the norm.
        rounding: f64,
        /// Id of the particle with the largest numbers.
        i: u64,
        /// The smallest tolerance that would do.
        enough: f64,
    },

    /// All runs of a case of an ensemble failed.
    #[error("no run of {case} came to its end; seed {seed}: {why}")]
    NoRun {
        /// The case.
        case: String,
        /// Seed of its first run.
        seed: u64,
        /// Why that one failed.
        why: String,
    },

    /// A run of a comparison did more work than it may.
    #[error("stopped at t = {t} s after {done} right-hand sides: a run may take {limit}")]
    WorkLimit {
        /// Time, s.
        t: f64,
        /// Right-hand sides up to there.
        done: u64,
        /// Right-hand sides that were allowed.
        limit: u64,
    },

    /// Another rank failed, and has said why.
    #[error("another rank failed")]
    Elsewhere {
        /// Exit code of the failure.
        code: i32,
    },

    /// A frame could not be written after the run had started.
    #[error("cannot write to {file}: {why}")]
    Output {
        /// The output file as the user named it.
        file: String,
        /// What the system or HDF5 said.
        why: String,
    },

    /// The output file is not the one that this run writes to any more; what was computed is in a checkpoint.
    #[error("{file} was {what} while the run was writing to it")]
    Replaced {
        /// The output file as the user named it.
        file: String,
        /// `removed` or `replaced by another file`.
        what: &'static str,
    },

    /// A checkpoint could not be written; the one before is still there.
    #[error("cannot write the checkpoint {file}: {why}")]
    Checkpoint {
        /// The file.
        file: String,
        /// What the system said.
        why: String,
    },

    /// The run was stopped on request, and saved.
    #[error("stopped by {request} at t = {t} s; demhybrid --resume {file} goes on from there")]
    Stopped {
        /// What asked for it.
        request: StopRequest,
        /// Time that was reached, s.
        t: f64,
        /// The output file as the user named it.
        file: String,
    },

    /// Particle bookkeeping is broken: a bug, never a user's mistake.
    #[error("particle {id} was {what} while particles migrated between ranks at t = {t} s")]
    Migration {
        /// Particle id.
        id: u64,
        /// `lost` or `duplicated`.
        what: &'static str,
        /// Time, s.
        t: f64,
    },
}

impl Error {
    /// Exit code of the program: 2 before the first step, 3 numerical failure, 4 output, 5 stopped on request,
    /// 70 internal.
    pub fn exit_code(&self) -> i32 {
        match self {
            Error::Input(_) => 2,
            Error::Coincident { .. }
            | Error::PairForce { .. }
            | Error::WallForce { .. }
            | Error::Acceleration { .. }
            | Error::NoStep { .. }
            | Error::TooFast { .. }
            | Error::BelowRoundOff { .. }
            | Error::Rounding { .. }
            | Error::NoRun { .. }
            | Error::WorkLimit { .. } => 3,
            Error::Elsewhere { code } => *code,
            Error::Output { .. } | Error::Replaced { .. } | Error::Checkpoint { .. } => 4,
            Error::Stopped { .. } => 5,
            Error::Migration { .. } => 70,
        }
    }
}

/// A request, of which the largest that any rank has seen counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StopRequest {
    /// To go on.
    #[default]
    Nothing,
    /// To write a checkpoint and go on.
    Checkpoint,
    /// To stop, because somebody has made the stop file.
    StopFile,
    /// To stop, because `limits.wall` is over.
    WallLimit,
    /// To stop, by this signal.
    Signal(u8),
}

impl StopRequest {
    /// A number that is larger for what counts more.
    pub fn weight(self) -> f64 {
        match self {
            StopRequest::Nothing => 0.0,
            StopRequest::Checkpoint => 1.0,
            StopRequest::StopFile => 2.0,
            StopRequest::WallLimit => 3.0,
            StopRequest::Signal(number) => 4.0 + f64::from(number),
        }
    }

    /// The inverse of `weight`.
    pub fn of_weight(weight: f64) -> Self {
        match weight as u32 {
            0 => StopRequest::Nothing,
            1 => StopRequest::Checkpoint,
            2 => StopRequest::StopFile,
            3 => StopRequest::WallLimit,
            more => StopRequest::Signal(u8::try_from(more - 4).unwrap_or(u8::MAX)),
        }
    }

    /// Whether the run is to end.
    pub fn stops(self) -> bool {
        !matches!(self, StopRequest::Nothing | StopRequest::Checkpoint)
    }
}

impl fmt::Display for StopRequest {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            StopRequest::Nothing => f.write_str("nothing"),
            StopRequest::Checkpoint => f.write_str("checkpoint.wall"),
            StopRequest::StopFile => f.write_str("the stop file"),
            StopRequest::WallLimit => f.write_str("limits.wall"),
            StopRequest::Signal(number) => match signal_hook::low_level::signal_name(i32::from(number)) {
                Some(name) => f.write_str(name),
                None => write!(f, "signal {number}"),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wish_survives_as_a_number_and_those_that_stop_weigh_more() {
        let wishes = [
            StopRequest::Nothing,
            StopRequest::Checkpoint,
            StopRequest::StopFile,
            StopRequest::WallLimit,
            StopRequest::Signal(1),
            StopRequest::Signal(64),
        ];
        for pair in wishes.windows(2) {
            assert!(pair[0].weight() < pair[1].weight(), "{pair:?}");
        }
        for request in wishes {
            assert_eq!(StopRequest::of_weight(request.weight()), request);
            assert_eq!(request.stops(), request.weight() >= 2.0);
        }
        assert_eq!(StopRequest::Signal(15).to_string(), "SIGTERM");
    }
}
