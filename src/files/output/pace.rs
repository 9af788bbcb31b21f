//! The pace at which frames go to the disk.

use crate::scene::SyncEvery;

/// Decides after which frames all that are held are forced to the disk. The same on every rank.
pub struct Pace {
    sync: SyncEvery,
    /// Wall time of the last frame that was forced to the disk, s.
    synced: Option<f64>,
    /// Wall time of the last frame, s.
    last: f64,
}

impl Pace {
    /// The pace before the first frame.
    pub fn new(sync: SyncEvery) -> Self {
        Pace { sync, synced: None, last: 0.0 }
    }

    /// Whether the frame at wall time `now` (s) is forced to the disk, with all before it.
    ///
    /// In a pace by the clock it is the last one for which this is not too late, if the next frame takes as
    /// long as this one took. So slow frames never wait.
    pub fn is_due(&mut self, now: f64) -> bool {
        let next = now + (now - self.last);
        let due = match (self.sync, self.synced) {
            (SyncEvery::Frame, _) | (SyncEvery::Seconds(_), None) => true,
            (SyncEvery::Seconds(seconds), Some(synced)) => next >= synced + seconds,
            (SyncEvery::End, _) => false,
        };
        self.last = now;
        if due {
            self.synced = Some(now);
        }
        due
    }
}
