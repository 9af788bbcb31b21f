//! Materials: the coefficients of a contact depend on what its two bodies are made of.
//!
//! All contacts of two materials have the same law. Pairs of materials with the same law are one class of
//! contacts, and [`Classes`] tells which class a contact belongs to.

/// The coefficients of a contact that depend on the materials of its bodies. All are without unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Coefficient of restitution e, 0..1.
    pub restitution: f64,
    /// Friction coefficient: phi of the paper's law, mu of the law with memory; >= 0.
    pub friction: f64,
    /// Coefficient of rolling resistance; >= 0.
    pub rolling: f64,
    /// Coefficient of twisting resistance; >= 0.
    pub twisting: f64,
}

/// The geometric mean of two coefficients, sqrt(a b). Equal ones give exactly their value, and 0 gives 0.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::materials::mixed;
///
/// assert_eq!(mixed(0.1, 0.4), mixed(0.4, 0.1));
/// assert!((mixed(0.1, 0.4) - 0.2).abs() < 1e-16);
/// assert_eq!(mixed(0.3, 0.3), 0.3);
/// assert_eq!(mixed(0.0, 0.5), 0.0);
/// ```
pub fn mixed(a: f64, b: f64) -> f64 {
    // Of each root by itself: no product overflows or underflows.
    if a == b { a } else { a.sqrt() * b.sqrt() }
}

impl Coefficients {
    /// The mixing rule: every coefficient is the geometric mean of those of both materials.
    pub fn mixed(&self, other: &Coefficients) -> Coefficients {
        Coefficients {
            restitution: mixed(self.restitution, other.restitution),
            friction: mixed(self.friction, other.friction),
            rolling: mixed(self.rolling, other.rolling),
            twisting: mixed(self.twisting, other.twisting),
        }
    }
}

/// Which class a contact belongs to. Materials are numbered from 0 on, and so are classes.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::materials::Classes;
///
/// // Two materials: like with like is class 0, and each with the other class 1. One wall, of material 1.
/// let classes = Classes::new(2, vec![0, 1, 1, 0], vec![1]);
/// assert_eq!(classes.count(), 2);
/// assert_eq!((classes.of_pair(0, 1), classes.of_pair(1, 1)), (1, 0));
/// assert_eq!((classes.of_wall(0, 0), classes.of_wall(1, 0)), (1, 0));
/// assert_eq!(Classes::default().count(), 1);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Classes {
    /// Number of materials; 0 where no contact asks for its materials.
    materials: usize,
    /// The class of every pair of materials, row after row.
    table: Vec<u32>,
    /// The material of every wall.
    walls: Vec<u32>,
}

impl Classes {
    /// The classes of the pairs of some `materials`, row after row in `table`, which is symmetric. `walls`
    /// are the materials of the walls. A particle without a material has the last one.
    pub fn new(materials: usize, table: Vec<u32>, walls: Vec<u32>) -> Self {
        debug_assert_eq!(table.len(), materials * materials);
        Classes { materials, table, walls }
    }

    /// Number of classes.
    pub fn count(&self) -> usize {
        self.table.iter().max().map_or(1, |&most| most as usize + 1)
    }

    /// The material of a particle that has none: the last one.
    pub fn without_material(&self) -> u32 {
        self.materials.saturating_sub(1) as u32
    }

    /// The class of contacts of two spheres of the materials `a` and `b`.
    pub fn of_pair(&self, a: u32, b: u32) -> usize {
        if self.materials == 0 { 0 } else { self.table[a as usize * self.materials + b as usize] as usize }
    }

    /// The class of contacts of a sphere of the material `a` with the wall of index `wall`.
    pub fn of_wall(&self, a: u32, wall: usize) -> usize {
        if self.materials == 0 { 0 } else { self.of_pair(a, self.walls[wall]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn mixing_is_symmetric_between_both_and_exact_for_equal_ones(a in 0.0..10.0f64, b in 0.0..10.0f64) {
            let found = mixed(a, b);
            prop_assert_eq!(found.to_bits(), mixed(b, a).to_bits());
            prop_assert!(found >= a.min(b) * (1.0 - 1e-15) && found <= a.max(b) * (1.0 + 1e-15));
            prop_assert!((found * found - a * b).abs() <= 1e-14 * a * b);
            prop_assert_eq!(mixed(a, a), a);
        }
    }

    #[test]
    fn what_is_very_small_or_large_is_mixed_without_losing_all_digits() {
        assert!((mixed(1e-200, 1e-160) / 1e-180 - 1.0).abs() < 1e-14);
        assert!((mixed(1e200, 1e160) / 1e180 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn each_coefficient_is_mixed_with_its_own() {
        let a = Coefficients { restitution: 0.4, friction: 0.1, rolling: 0.0, twisting: 0.02 };
        let b = Coefficients { restitution: 0.9, friction: 0.9, rolling: 0.5, twisting: 0.02 };
        let found = a.mixed(&b);
        assert!((found.restitution - 0.6).abs() < 1e-15 && (found.friction - 0.3).abs() < 1e-15);
        assert_eq!((found.rolling, found.twisting), (0.0, 0.02));
    }
}
