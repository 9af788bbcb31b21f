//! The effects of a scene: which of the paper's variants, with or without dissipation on rebound.

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effects {
    /// Which of the three variants.
    pub variant: Variant,
    /// Whether contacts dissipate energy on rebound (e < 1).
    pub dissipative: bool,
}
