//! How many spheres a sphere of a bed touches.

use crate::engine::neighbors::{Key, Lists};
use crate::math::vector::Vec3;

/// Mean number of other spheres of radius `r` (m) that a sphere touches; 0 without spheres.
///
/// `x` are the centres (m).
///
/// Surfaces touch if their gap is not positive. This is a convention: the soft contact law also repels across
/// a gap, and the repulsion at a gap of 0 is F_0.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::bed::mean_coordination_number;
/// use demhybrid::math::vector::Vec3;
///
/// let chain = [0.0, 0.19, 0.38].map(|x| Vec3::new(x, 0.0, 0.0));
/// assert_eq!(mean_coordination_number(&chain, 0.1), 4.0 / 3.0); // 1, 2 and 1
/// ```
pub fn mean_coordination_number(x: &[Vec3], r: f64) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let keys: Vec<Key> = (0..x.len() as u64).map(|id| ([0; 3], id)).collect();
    let mut lists = Lists::default();
    lists.rebuild(x, &keys, x.len(), 2.0 * r, (&[], r), 1);
    2.0 * lists.pairs() as f64 / x.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const R: f64 = 0.1;

    /// Points of the cubic lattice of the given spacing, `per_side` along each axis, the first at `start`.
    fn cubic(per_side: usize, spacing: f64, start: Vec3) -> Vec<Vec3> {
        let along = |k: usize, step: usize| (k / step % per_side) as f64;
        (0..per_side.pow(3))
            .map(|k| start + Vec3::new(along(k, 1), along(k, per_side), along(k, per_side.pow(2))) * spacing)
            .collect()
    }

    #[test]
    fn a_chain_of_touching_spheres_has_two_contacts_each_but_its_ends() {
        // The spacing is exactly 2 r, so the gap is 0.
        let chain: Vec<Vec3> = (0..10).map(|k| Vec3::new(0.0, 0.5 * k as f64, 3.0)).collect();
        assert_eq!(mean_coordination_number(&chain, 0.25), 18.0 / 10.0);
        assert_eq!(mean_coordination_number(&chain, 0.2499), 0.0);
        assert_eq!(mean_coordination_number(&chain[..1], 0.25), 0.0);
        assert_eq!(mean_coordination_number(&[], 0.25), 0.0);
    }

    #[test]
    fn a_cubic_block_has_six_contacts_inside_and_fewer_at_its_faces() {
        let x = cubic(5, 1.999 * R, Vec3::repeat(-0.3));
        // Three directions, each with 4 contacts on each of 25 lines.
        assert_eq!(mean_coordination_number(&x, R), 2.0 * 300.0 / 125.0);
        let x = cubic(20, 1.999 * R, Vec3::zeros());
        assert_eq!(mean_coordination_number(&x, R), 6.0 * 19.0 / 20.0);
    }
}
