//! What the world outside may ask of a run that is under way: to save itself, or to stop.

use std::fmt;

/// A request, of which the largest that any rank has seen counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wish {
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

impl Wish {
    /// A number that is larger for what counts more.
    pub fn weight(self) -> f64 {
        match self {
            Wish::Nothing => 0.0,
            Wish::Checkpoint => 1.0,
            Wish::StopFile => 2.0,
            Wish::WallLimit => 3.0,
            Wish::Signal(number) => 4.0 + f64::from(number),
        }
    }

    /// The inverse of `weight`.
    pub fn of_weight(weight: f64) -> Self {
        match weight as u32 {
            0 => Wish::Nothing,
            1 => Wish::Checkpoint,
            2 => Wish::StopFile,
            3 => Wish::WallLimit,
            more => Wish::Signal(u8::try_from(more - 4).unwrap_or(u8::MAX)),
        }
    }

    /// Whether the run is to end.
    pub fn stops(self) -> bool {
        !matches!(self, Wish::Nothing | Wish::Checkpoint)
    }
}

impl fmt::Display for Wish {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Wish::Nothing => f.write_str("nothing"),
            Wish::Checkpoint => f.write_str("checkpoint.wall"),
            Wish::StopFile => f.write_str("the stop file"),
            Wish::WallLimit => f.write_str("limits.wall"),
            Wish::Signal(number) => match signal_hook::low_level::signal_name(i32::from(number)) {
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
            Wish::Nothing,
            Wish::Checkpoint,
            Wish::StopFile,
            Wish::WallLimit,
            Wish::Signal(1),
            Wish::Signal(64),
        ];
        for pair in wishes.windows(2) {
            assert!(pair[0].weight() < pair[1].weight(), "{pair:?}");
        }
        for wish in wishes {
            assert_eq!(Wish::of_weight(wish.weight()), wish);
            assert_eq!(wish.stops(), wish.weight() >= 2.0);
        }
        assert_eq!(Wish::Signal(15).to_string(), "SIGTERM");
    }
}
