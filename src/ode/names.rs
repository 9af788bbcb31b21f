//! The names of methods and norms. They are defined nowhere else.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Defines an enum whose variants each have one name, which scenes, options, files and tables use.
macro_rules! named {
    (
        $(#[$doc:meta])* $type:ident, $what:literal
        { $($(#[$variant_doc:meta])* $variant:ident = $name:literal,)* }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum $type {
            $($(#[$variant_doc])* #[serde(rename = $name)] $variant,)*
        }

        impl $type {
            /// All variants.
            pub const ALL: &[$type] = &[$($type::$variant),*];
            /// The names of all variants, in the same order.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Name of this variant.
            pub const fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.pad(self.name())
            }
        }

        impl FromStr for $type {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let found = Self::ALL.iter().copied().find(|one| one.name() == text);
                found.ok_or_else(|| format!(concat!("it must be ", $what, ": {}"), Self::NAMES.join(", ")))
            }
        }
    };
}

named! {
    /// A method, as `solver.method` names it.
    MethodName, "the name of a method" {
        /// Switches between an explicit and the stabilised method, to the one that needs less work.
        Auto = "auto",
        /// Merson's method of order 4 with an error estimate, as published.
        Merson = "merson",
        /// The method of Dormand and Prince of order 5, with an error estimate of order 4.
        DormandPrince = "dormand-prince",
        /// The stabilised method, a Runge-Kutta-Chebyshev method of order 2.
        Chebyshev = "chebyshev",
        /// Velocity Verlet with a fixed step.
        VelocityVerlet = "velocity-verlet",
    }
}

named! {
    /// How the error of a step is measured, as `solver.norm` names it.
    NormName, "the name of a norm" {
        /// Positions over sqrt(r/kappa), velocities over a velocity scale.
        Scaled = "scaled",
        /// As scaled, and of the errors of all rows their contraharmonic mean.
        Mean = "mean",
        /// The published error rate, with components in different units.
        Paper = "paper",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_others_are_told_with_those_there_are() {
        for method in MethodName::ALL {
            assert_eq!(method.name().parse(), Ok(*method));
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
        }
        assert_eq!("paper".parse(), Ok(NormName::Paper));
        assert!("euler".parse::<MethodName>().unwrap_err().contains("dormand-prince"));
    }
}
