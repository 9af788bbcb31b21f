//! The names of methods and norms: the one place that knows them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A choice among a few, each with one name that scenes, options, files and tables use.
macro_rules! named {
    ($(#[$doc:meta])* $type:ident, $what:literal { $($(#[$variant_doc:meta])* $variant:ident = $name:literal,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum $type {
            $($(#[$variant_doc])* #[serde(rename = $name)] $variant,)*
        }

        impl $type {
            /// All of them.
            pub const ALL: &[$type] = &[$($type::$variant),*];
            /// Their names, in the same order.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Its name.
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
    /// A method that takes the steps, as `solver.method` names it.
    MethodName, "the name of a method" {
        /// The cheaper of an explicit and a stabilised method, step by step.
        Auto = "auto",
        /// Merson's method of order 4 with an error estimate, the published one.
        Merson = "merson",
        /// The method of Dormand and Prince, order 5 with an estimate of order 4.
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
        /// Positions over the radius, velocities over a velocity scale.
        Scaled = "scaled",
        /// The published error rate, in mixed units.
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
