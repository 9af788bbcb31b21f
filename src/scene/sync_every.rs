//! The value of `output.sync`: a word or a number.

use serde::{Deserialize, Serialize};
use toml::Value;

/// How often frames are forced to the disk.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::{Scene, SyncEvery};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = |set: &str| Scene::parse("quick.toml", &text, &[set.to_owned()]);
/// let sync = |set: &str| scene(set).map(|scene| scene.output.sync);
/// assert_eq!(sync("output.sync=frame")?, SyncEvery::Frame);
/// assert_eq!(sync("output.sync=10")?, SyncEvery::Seconds(10.0));
/// let mistake = sync("output.sync=never").unwrap_err();
/// assert!(mistake.to_string().contains("must be one of: \"frame\", \"end\", or a finite number > 0"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Value", into = "Value")]
pub enum SyncEvery {
    /// Every frame, as soon as it is there.
    Frame,
    /// So often that no frame waits much longer than this wall time, s; > 0.
    Seconds(f64),
    /// At the end of the run.
    End,
}

impl SyncEvery {
    /// The words that a scene may give in place of a number.
    pub const WORDS: &[&str] = &["frame", "end"];
}

impl Default for SyncEvery {
    fn default() -> Self {
        SyncEvery::Seconds(1.0)
    }
}

/// The check of keys and values gives the message for a scene. It comes before this.
impl TryFrom<Value> for SyncEvery {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value {
            Value::String(word) if word == "frame" => Ok(SyncEvery::Frame),
            Value::String(word) if word == "end" => Ok(SyncEvery::End),
            Value::Integer(seconds) => Ok(SyncEvery::Seconds(seconds as f64)),
            Value::Float(seconds) => Ok(SyncEvery::Seconds(seconds)),
            other => Err(format!("{other} is not \"frame\", \"end\" or a number")),
        }
    }
}

impl From<SyncEvery> for Value {
    fn from(sync: SyncEvery) -> Value {
        match sync {
            SyncEvery::Frame => "frame".into(),
            SyncEvery::Seconds(seconds) => seconds.into(),
            SyncEvery::End => "end".into(),
        }
    }
}
