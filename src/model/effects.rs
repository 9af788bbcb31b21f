//! Which effects are computed: the paper's variants, with or without loss on rebound.

/// Friction and rotation of a scene: the paper's three variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// Repulsion only.
    Basic,
    /// Friction without rotation.
    Friction,
    /// The complete model.
    FrictionRotation,
}

impl Variant {
    /// The paper's name.
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
    /// Friction and rotation.
    pub variant: Variant,
    /// Contacts lose energy on rebound (e < 1).
    pub dissipative: bool,
}
