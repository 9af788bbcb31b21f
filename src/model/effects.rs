//! The effects of a scene: which of the paper's variants, with or without dissipation on rebound.

use serde::{Deserialize, Serialize};

/// The laws of friction, as `friction.law` names them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FrictionLaw {
    /// The paper's, eqs. (2.6) and (2.8): regularised, without memory.
    #[default]
    Regularized,
    /// With memory of the shear, see [`crate::model::history`].
    History,
}

impl FrictionLaw {
    /// The names of all laws.
    pub const NAMES: &[&str] = &["regularized", "history"];
}

/// The paper's three variants: with or without friction, with or without rotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// Repulsion only.
    Basic,
    /// Repulsion and friction, without rotation.
    Friction,
    /// The complete model: repulsion, friction and rotation.
    FrictionRotation,
}

impl Variant {
    /// The paper's name of the variant.
    pub fn name(self) -> &'static str {
        match self {
            Variant::Basic => "basic",
            Variant::Friction => "friction",
            Variant::FrictionRotation => "friction+rotation",
        }
    }
}

/// The effects that are computed.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::effects::{Effects, Variant};
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let effects = Effects::of(&scene);
/// assert_eq!(effects, Effects { variant: Variant::FrictionRotation, dissipative: true });
/// assert_eq!(effects.variant.name(), "friction+rotation");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effects {
    /// Which of the three variants.
    pub variant: Variant,
    /// Whether contacts dissipate energy on rebound (e < 1).
    pub dissipative: bool,
}
