//! How many contacts each sphere has, and which spheres they cannot hold.

use super::contacts::{Contact, Partner, between_spheres};
use crate::scene::Scene;

/// Number of contacts that every sphere has with other spheres.
pub fn coordination(count: usize, contacts: &[Contact]) -> Vec<usize> {
    let mut numbers = vec![0; count];
    for contact in contacts {
        if let Partner::Sphere(j) = contact.partner {
            numbers[contact.i] += 1;
            numbers[j] += 1;
        }
    }
    numbers
}

/// Mean number of contacts that a sphere has with other spheres; 0 without spheres.
pub fn mean_coordination(count: usize, contacts: &[Contact]) -> f64 {
    2.0 * between_spheres(contacts).count() as f64 / count.max(1) as f64
}

/// Smallest number of contacts, walls included, that can hold a sphere.
///
/// Repulsion alone needs 4. Gravity and friction reduce the number by one each.
pub fn fewest_that_hold(scene: &Scene) -> usize {
    let gravity = usize::from(scene.gravity != [0.0; 3]);
    let rubs = usize::from(scene.rubs());
    4 - gravity - rubs
}

/// Whether each sphere is a rattler: it has fewer than `fewest` contacts, not counting those with rattlers.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::contacts::{Contact, Partner};
/// use demhybrid::beds::measures::rattlers::{coordination, mean_coordination, rattlers};
///
/// let touch = |i, j| Contact { i, partner: Partner::Sphere(j), overlap: 1e-3, force: 1.0 };
/// // A ring of three, and a fourth sphere that touches one of them.
/// let contacts = [touch(0, 1), touch(0, 2), touch(1, 2), touch(0, 3)];
/// assert_eq!(coordination(4, &contacts), [3, 2, 2, 1]);
/// assert_eq!(mean_coordination(4, &contacts), 2.0);
/// assert_eq!(rattlers(4, &contacts, 2), [false, false, false, true]);
/// ```
pub fn rattlers(count: usize, contacts: &[Contact], fewest: usize) -> Vec<bool> {
    let mut partners = vec![Vec::new(); count];
    let mut numbers = vec![0usize; count];
    for contact in contacts {
        numbers[contact.i] += 1;
        if let Partner::Sphere(j) = contact.partner {
            numbers[j] += 1;
            partners[contact.i].push(j);
            partners[j].push(contact.i);
        }
    }
    let mut loose: Vec<bool> = numbers.iter().map(|&number| number < fewest).collect();
    let mut waiting: Vec<usize> = (0..count).filter(|&i| loose[i]).collect();
    while let Some(i) = waiting.pop() {
        for &j in &partners[i] {
            numbers[j] -= 1;
            if !loose[j] && numbers[j] < fewest {
                loose[j] = true;
                waiting.push(j);
            }
        }
    }
    loose
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::testing::scene;

    #[test]
    fn rattlers_are_found_one_after_another() {
        let pair = |i, j| Contact { i, partner: Partner::Sphere(j), overlap: 0.0, force: 1.0 };
        let wall = |i| Contact { i, partner: Partner::Wall(0), overlap: 0.0, force: 1.0 };
        // Spheres 0 to 3 form a tetrahedron with a wall at each, 4-5-6 is a chain on it, and 7 is alone.
        let mut all: Vec<Contact> = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3), (3, 4), (4, 5), (5, 6)]
            .map(|(i, j)| pair(i, j))
            .to_vec();
        all.extend((0..4).map(wall));
        all.push(wall(5));
        let loose = |fewest| rattlers(8, &all, fewest);
        assert_eq!(loose(3), [false, false, false, false, true, true, true, true]);
        // Sphere 6 has one contact. Without it, 5 has a wall and 4, and 4 has 3 and 5.
        assert_eq!(loose(2), [false, false, false, false, false, false, true, true]);
        assert_eq!(loose(5), [true; 8]);
        assert_eq!(fewest_that_hold(&scene("")), 4);
        let rubs = "friction = { coefficient = 0.2, regularization_velocity = 0.01 }";
        assert_eq!(fewest_that_hold(&scene(rubs)), 3);
        assert_eq!(fewest_that_hold(&scene(&format!("gravity = [0, 0, -1]\n{rubs}"))), 2);
    }
}
