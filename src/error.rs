//! Every error that can end a run early, with its exit code; and requests to stop a run.

use crate::math::digits::{at_least, at_most, rough, short};
use std::fmt;
use thiserror::Error;

/// Why a run ended early. A message is lower case, has no full stop, and gives value, unit and time.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A mistake found before the first step: in the scene, the particles, the command line or the output
    /// path.
    ///
    /// The text is the whole message. It names the key or file, gives the value, and says what would be
    /// right.
    #[error("{0}")]
    Input(String),

    /// Two particles have the same centre, so their contact has no direction.
    #[error(
        "the centres of particles {i} and {j} coincide at t = {} s: a contact between them has no direction",
        short(*t)
    )]
    Coincident {
        /// Lower particle id.
        i: u64,
        /// Higher particle id.
        j: u64,
        /// Time, s.
        t: f64,
    },

    /// The force between two particles is not finite: it exceeds the range of a double.
    #[error(
        "the force between particles {i} and {j} is not finite at t = {} s: their overlap is {} m, \
         and the repulsion grows as exp(contact.stiffness_exponent * overlap), which overflows beyond \
         exp(709)",
        short(*t),
        rough(*overlap)
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

    /// The force between a particle and a wall is not finite: it exceeds the range of a double.
    #[error(
        "the force of {wall} on particle {i} is not finite at t = {} s: its overlap is {} m, \
         and the repulsion grows as exp(contact.stiffness_exponent * overlap), which overflows beyond \
         exp(709)",
        short(*t),
        rough(*overlap)
    )]
    WallForce {
        /// Particle id.
        i: u64,
        /// Name of the wall, such as `the side z = 0 m of the box (container.box.min)`.
        wall: String,
        /// Overlap, m.
        overlap: f64,
        /// Time, s.
        t: f64,
    },

    /// A particle is so far beyond a wall that no force can bring it back.
    #[error(
        "particle {i} is {} m beyond {wall} at t = {} s, where no force can bring it back: it \
         starts there, or a step was too long for the contact that it was in",
        rough(*beyond),
        short(*t)
    )]
    BeyondWall {
        /// Particle id.
        i: u64,
        /// Name of the wall, as in `WallForce`.
        wall: String,
        /// How far its centre is beyond the wall, m.
        beyond: f64,
        /// Time, s.
        t: f64,
    },

    /// A force is not finite although the overlap is small: a position or a speed is too large.
    #[error(
        "the forces on particle {i} are not finite at t = {} s: its coordinates reach {} m, its velocity {} \
         m/s and its angular velocity {} rad/s along an axis, which is beyond what arithmetic allows",
        short(*t),
        rough(*position),
        rough(*speed),
        rough(*spin)
    )]
    OutOfRange {
        /// Particle id.
        i: u64,
        /// Largest coordinate, m.
        position: f64,
        /// Largest component of the velocity, m/s.
        speed: f64,
        /// Largest component of the angular velocity, rad/s.
        spin: f64,
        /// Time, s.
        t: f64,
    },

    /// Contacts are pressed so hard that even the smallest allowed step is too long for what they do.
    #[error(
        "no step is short enough at t = {} s: spheres overlap each other or a wall by up to {} m ({} of the \
         radius), which pushes them apart with {} N within {} s (solver.min_step = {} s); a start with \
         overlaps of {} m or less, or solver.min_step = {} s or less, would do",
        short(*t),
        rough(*overlap),
        rough(*share),
        rough(*force),
        rough(*time),
        short(*min_step),
        short(at_most(*enough)),
        short(at_most(*min_step_enough))
    )]
    Pressed {
        /// Largest overlap, m.
        overlap: f64,
        /// The same over the radius.
        share: f64,
        /// Repulsion at that overlap, N.
        force: f64,
        /// Time in which that contact opens by 1/kappa, s.
        time: f64,
        /// `solver.min_step`, s.
        min_step: f64,
        /// Largest overlap that steps of `min_step` resolve, m.
        enough: f64,
        /// Smallest step that resolves the overlap, s.
        min_step_enough: f64,
        /// Time, s.
        t: f64,
    },

    /// An acceleration is not finite although every contact force is.
    #[error(
        "the acceleration of particle {i} is not finite at t = {} s: gravity, forces or 1/particles.mass are \
         too large",
        short(*t)
    )]
    Acceleration {
        /// Particle id.
        i: u64,
        /// Time, s.
        t: f64,
    },

    /// No allowed step leads to a finite state at a later time.
    #[error(
        "no step can be made from t = {} s: it fell to {} s (solver.min_step = {} s), limited by particle \
         {i}",
        short(*t),
        rough(*h),
        short(*min_step)
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

    /// A particle moves so fast that even the smallest allowed step could miss a collision.
    #[error(
        "particle {i} moves too far at t = {} s: within a step of {} s (solver.min_step) by more than {} m \
         (0.1 of its radius), and a collision could be missed",
        short(*t),
        rough(*h),
        rough(*travel)
    )]
    TooFast {
        /// Time, s.
        t: f64,
        /// Step that was tried last, s.
        h: f64,
        /// Particle id.
        i: u64,
        /// The furthest that a step may move a particle, m.
        travel: f64,
    },

    /// Too many steps were accepted at the minimum in spite of their error, which is rounding noise.
    #[error(
        "solver.tolerance = {} is below round-off: {forced} of {accepted} steps up to t = {} s were accepted \
         at solver.min_step = {} s with a larger error (step {} s, limited by particle {i}); a larger \
         tolerance, or smaller forces at the start, would do",
        short(*tolerance),
        short(*t),
        short(*min_step),
        rough(*h)
    )]
    BelowRoundOff {
        /// `solver.tolerance`.
        tolerance: f64,
        /// Number of steps accepted at the minimum in spite of their error.
        forced: u64,
        /// Number of all accepted steps.
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

    /// The tolerance is smaller than the rounding error of a single step.
    #[error(
        "solver.tolerance = {} is below round-off: a step is rounded by {} of the scales of the norm, as \
         particle {i} is so far from the origin or so fast; {} or more would do",
        short(*tolerance),
        rough(*rounding),
        short(at_least(*enough))
    )]
    Rounding {
        /// `solver.tolerance`.
        tolerance: f64,
        /// Rounding error of a step, in the norm of the tolerance.
        rounding: f64,
        /// Id of the particle with the largest rounding error.
        i: u64,
        /// The smallest tolerance that would do.
        enough: f64,
    },

    /// All runs of one case of an ensemble failed.
    #[error("no run of {case} came to its end; seed {seed}: {why}")]
    NoRun {
        /// Name of the case.
        case: String,
        /// Seed of its first run.
        seed: u64,
        /// Why the first run failed.
        why: String,
    },

    /// A run of a comparison needed more right-hand sides than it is allowed.
    #[error("stopped at t = {} s after {done} right-hand sides: a run may take {limit}", short(*t))]
    WorkLimit {
        /// Time, s.
        t: f64,
        /// Right-hand sides evaluated up to that time.
        done: u64,
        /// Right-hand sides allowed.
        limit: u64,
    },

    /// Another rank failed and has printed the reason.
    #[error("another rank failed")]
    Elsewhere {
        /// Exit code of that failure.
        code: i32,
    },

    /// A frame could not be written after the run had started.
    #[error("cannot write to {file}: {why}")]
    Output {
        /// The output file as the user named it.
        file: String,
        /// The error message of the system or of HDF5.
        why: String,
    },

    /// The output file was removed or replaced while the run was writing to it. The results are in a
    /// checkpoint.
    #[error("{file} was {what} while the run was writing to it")]
    Replaced {
        /// The output file as the user named it.
        file: String,
        /// `removed` or `replaced by another file`.
        what: &'static str,
    },

    /// A checkpoint could not be written. The previous one is still there.
    #[error("cannot write the checkpoint {file}: {why}")]
    Checkpoint {
        /// The checkpoint file.
        file: String,
        /// The error message of the system.
        why: String,
    },

    /// All is done, but what the program has to say could not be printed.
    #[error("cannot write to stdout: {why}{kept}")]
    Print {
        /// The error message of the system.
        why: String,
        /// What there is all the same, after a semicolon; or nothing.
        kept: String,
    },

    /// The run was stopped on request, after it had written a checkpoint.
    #[error("stopped by {request} at t = {} s; demhybrid --resume {file} goes on from there", short(*t))]
    Stopped {
        /// What requested the stop.
        request: StopRequest,
        /// Time reached, s.
        t: f64,
        /// The output file as the user named it.
        file: String,
    },

    /// A particle was lost or duplicated: a bug in the program, never a mistake of the user.
    #[error("particle {id} was {what} while particles migrated between ranks at t = {} s", short(*t))]
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
    /// Exit code of the program: 2 for a mistake found before the first step, 3 for a numerical failure, 4
    /// for output, 5 for a stop on request, 70 for an internal error.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::error::Error;
    ///
    /// let mistake = Error::Input("bed.toml: no such file".to_owned());
    /// assert_eq!(mistake.exit_code(), 2);
    /// assert_eq!(mistake.to_string(), "bed.toml: no such file");
    /// ```
    pub fn exit_code(&self) -> i32 {
        match self {
            Error::Input(_) => 2,
            Error::Coincident { .. }
            | Error::PairForce { .. }
            | Error::WallForce { .. }
            | Error::BeyondWall { .. }
            | Error::OutOfRange { .. }
            | Error::Pressed { .. }
            | Error::Acceleration { .. }
            | Error::NoStep { .. }
            | Error::TooFast { .. }
            | Error::BelowRoundOff { .. }
            | Error::Rounding { .. }
            | Error::NoRun { .. }
            | Error::WorkLimit { .. } => 3,
            Error::Elsewhere { code } => *code,
            Error::Output { .. }
            | Error::Replaced { .. }
            | Error::Checkpoint { .. }
            | Error::Print { .. } => 4,
            Error::Stopped { .. } => 5,
            Error::Migration { .. } => 70,
        }
    }
}

/// A request to a run in progress. If ranks receive different requests, the one of largest weight counts.
///
/// # Examples
///
/// ```rust
/// use demhybrid::error::StopRequest;
///
/// assert!(StopRequest::WallLimit.stops());
/// assert!(!StopRequest::Checkpoint.stops());
/// assert_eq!(StopRequest::Signal(15).to_string(), "SIGTERM");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StopRequest {
    /// No request: go on.
    #[default]
    Nothing,
    /// Write a checkpoint and go on.
    Checkpoint,
    /// Stop: the stop file exists.
    StopFile,
    /// Stop: the wall time of `limits.wall` is over.
    WallLimit,
    /// Stop: the process received the signal of this number.
    Signal(u8),
}

impl StopRequest {
    /// A number for reductions over ranks: the request of largest weight counts.
    pub fn weight(self) -> f64 {
        match self {
            StopRequest::Nothing => 0.0,
            StopRequest::Checkpoint => 1.0,
            StopRequest::StopFile => 2.0,
            StopRequest::WallLimit => 3.0,
            StopRequest::Signal(number) => 4.0 + f64::from(number),
        }
    }

    /// The request of this weight: the inverse of `weight`.
    pub fn of_weight(weight: f64) -> Self {
        match weight as u32 {
            0 => StopRequest::Nothing,
            1 => StopRequest::Checkpoint,
            2 => StopRequest::StopFile,
            3 => StopRequest::WallLimit,
            more => StopRequest::Signal(u8::try_from(more - 4).unwrap_or(u8::MAX)),
        }
    }

    /// Whether the request ends the run.
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
    fn a_stop_request_survives_as_a_number_and_those_that_stop_weigh_more() {
        let requests = [
            StopRequest::Nothing,
            StopRequest::Checkpoint,
            StopRequest::StopFile,
            StopRequest::WallLimit,
            StopRequest::Signal(1),
            StopRequest::Signal(64),
        ];
        for pair in requests.windows(2) {
            assert!(pair[0].weight() < pair[1].weight(), "{pair:?}");
        }
        for request in requests {
            assert_eq!(StopRequest::of_weight(request.weight()), request);
            assert_eq!(request.stops(), request.weight() >= 2.0);
        }
        assert_eq!(StopRequest::Signal(15).to_string(), "SIGTERM");
    }
}
