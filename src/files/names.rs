//! Enums whose variants have one name each, which files and tables use.

/// Defines an enum whose variants each have a name. Their order is that of the names.
macro_rules! named {
    (
        $(#[$doc:meta])* $type:ident { $($(#[$variant_doc:meta])* $variant:ident = $name:literal,)* }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
        pub enum $type {
            $($(#[$variant_doc])* #[serde(rename = $name)] $variant,)*
        }

        impl $type {
            /// All variants, as they are declared.
            pub const ALL: [$type; [$($type::$variant),*].len()] = [$($type::$variant),*];

            /// Name of this variant.
            pub const fn name(self) -> &'static str {
                match self {
                    $($type::$variant => $name,)*
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl Ord for $type {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                self.name().cmp(other.name())
            }
        }

        impl PartialOrd for $type {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }
    };
}

pub(crate) use named;

named! {
    /// A column of `/run/series`, which has one row per frame. All are in SI units.
    Series {
        /// Time of the frame, s.
        Time = "time",
        /// Size of the last accepted step, s.
        Step = "step",
        /// Kinetic energy, J.
        KineticEnergy = "kinetic_energy",
        /// Potential energy of contacts and height, J.
        PotentialEnergy = "potential_energy",
        /// Largest overlap of two spheres or of a sphere and a wall, m.
        LargestOverlap = "largest_overlap",
        /// Highest point of any sphere, m.
        BedHeight = "bed_height",
        /// Wall time since the start, s.
        WallSeconds = "wall_seconds",
        /// Energy that rebound dissipated so far, J. Only with `output.energy`.
        DissipatedRebound = "dissipated_rebound",
        /// Energy that friction dissipated so far, J. Only with `output.energy`.
        DissipatedFriction = "dissipated_friction",
        /// Steps accepted so far.
        StepsAccepted = "steps_accepted",
        /// Steps rejected so far for their error.
        StepsRejected = "steps_rejected",
        /// Steps rejected so far because a particle left the neighbour lists or moved too far.
        StepsOutrun = "steps_outrun",
        /// Right-hand sides evaluated so far.
        RhsEvaluations = "rhs_evaluations",
        /// Pairs evaluated so far.
        PairEvaluations = "pair_evaluations",
        /// Times that the neighbour lists were built.
        ListsBuilt = "lists_built",
    }
}

impl Series {
    /// Whether the column holds counts. The others hold real numbers.
    pub const fn is_count(self) -> bool {
        use Series::*;
        matches!(
            self,
            StepsAccepted | StepsRejected | StepsOutrun | RhsEvaluations | PairEvaluations | ListsBuilt
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_has_its_own_name_and_is_serialised_as_it() {
        for (k, series) in Series::ALL.iter().enumerate() {
            assert!(Series::ALL[..k].iter().all(|other| other.name() != series.name()), "{series}");
            assert_eq!(serde_json::to_value(series).unwrap(), series.name());
        }
    }
}
