//! Contacts of a bed: coordination, rattlers, overlaps and forces.

use super::union::for_each_pair;
use crate::files::run_file::State;
use crate::math::elementary::Separate;
use crate::math::vector::Vec3;
use crate::model::contact::Rebound;
use crate::scene::{Scene, effects};

/// The body that a sphere touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partner {
    /// The sphere of this id.
    Sphere(usize),
    /// The wall of this index in the list of [`crate::scene::walls::walls`].
    Wall(usize),
}

/// Two surfaces that touch, because their gap is not positive.
///
/// This is a convention: the soft contact law also repels across a gap. At a gap of 0 the repulsion is F_0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Id of the sphere.
    pub i: usize,
    /// The other body. If it is a sphere, its id is the higher one.
    pub partner: Partner,
    /// Overlap of the surfaces, m.
    pub overlap: f64,
    /// Normal force, eqs. (2.1) and (2.4), N.
    pub force: f64,
}

/// All contacts of a state: first pairs, then walls, each by ascending ids.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::contacts::{Partner, contacts};
/// use demhybrid::files::run_file::State;
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let state = State {
///     frame: 0,
///     time: 0.0,
///     x: vec![[0.3, 0.3, 0.099], [0.3, 0.3, 0.297]],
///     v: vec![[0.0; 3]; 2],
///     omega: None,
/// };
/// let found = contacts(&scene, &state); // one sphere on another one on the floor
/// assert_eq!((found[0].i, found[0].partner), (0, Partner::Sphere(1)));
/// assert_eq!((found[1].i, found[1].partner), (0, Partner::Wall(4)));
/// assert!((found[0].overlap - 2e-3).abs() < 1e-12); // m
/// assert!((found[0].force - 5.8 * 0.3f64.exp()).abs() < 1e-9); // N
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn contacts(scene: &Scene, state: &State) -> Vec<Contact> {
    let r = scene.particles.radius;
    let law = effects::normal_law(scene);
    let x: Vec<Vec3> = state.x.iter().map(|&x| x.into()).collect();
    let v: Vec<Vec3> = state.v.iter().map(|&v| v.into()).collect();
    let contact = |i, partner, gap: f64, opening: f64| Contact {
        i,
        partner,
        overlap: -gap,
        force: law.repulsion::<Separate>(gap) * law.rebound.share::<Separate>(-opening),
    };
    let mut pairs = Vec::new();
    for_each_pair(&x, 2.0 * r, |[i, j]| pairs.push([i.min(j), i.max(j)]));
    pairs.sort_unstable();
    let mut found: Vec<Contact> = pairs
        .into_iter()
        .map(|[i, j]| {
            let apart = x[i] - x[j];
            let d = apart.norm();
            let opening = if d > 0.0 { apart.dot(&(v[i] - v[j])) / d } else { 0.0 };
            contact(i, Partner::Sphere(j), d - 2.0 * r, opening)
        })
        .collect();
    for (k, wall) in crate::scene::walls::walls(&scene.container).iter().enumerate() {
        for (i, x) in x.iter().enumerate() {
            let gap = wall.depth(x) - r;
            if gap <= 0.0 {
                found.push(contact(i, Partner::Wall(k), gap, -wall.normal.dot(&v[i])));
            }
        }
    }
    found
}

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

/// Smallest number of contacts, walls included, that can hold a sphere.
///
/// Repulsion alone needs 4. Gravity and friction reduce the number by one each.
pub fn fewest_that_hold(scene: &Scene) -> usize {
    let gravity = usize::from(scene.gravity != [0.0; 3]);
    let rubs = usize::from(scene.friction.as_ref().is_some_and(|friction| friction.coefficient > 0.0));
    4 - gravity - rubs
}

/// Whether each sphere is a rattler: it has fewer than `fewest` contacts, not counting those with rattlers.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::contacts::{Contact, Partner, coordination, rattlers};
///
/// let touch = |i, j| Contact { i, partner: Partner::Sphere(j), overlap: 1e-3, force: 1.0 };
/// // A ring of three, and a fourth sphere that touches one of them.
/// let contacts = [touch(0, 1), touch(0, 2), touch(1, 2), touch(0, 3)];
/// assert_eq!(coordination(4, &contacts), [3, 2, 2, 1]);
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

    fn at_rest(x: Vec<[f64; 3]>) -> State {
        State { frame: 0, time: 0.0, v: vec![[0.0; 3]; x.len()], x, omega: None }
    }

    #[test]
    fn a_stack_at_rest_carries_its_weight() {
        let scene = scene("gravity = [0, 0, -9.81]\ncontainer.box = { min = [0, 0, 0], max = [1, 1, inf] }");
        // From the documentation: two spheres at rest on each other overlap by 3.50363 mm, the lower one and
        // the floor by 8.12461 mm.
        let state = at_rest(vec![[0.5, 0.5, 0.1 - 8.12461e-3], [0.5, 0.5, 0.3 - 8.12461e-3 - 3.50363e-3]]);
        let found = contacts(&scene, &state);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].i, found[0].partner), (0, Partner::Sphere(1)));
        assert_eq!((found[1].i, found[1].partner), (0, Partner::Wall(4)));
        assert!((found[0].overlap - 3.50363e-3).abs() < 1e-12);
        assert!((found[0].force - 9.81).abs() < 1e-4, "{}", found[0].force);
        assert!((found[1].force - 2.0 * 9.81).abs() < 1e-4, "{}", found[1].force);
        // The force has the factor e^2 on separation, 1 on approach, and rho(0) = (1 + e^2)/2 at rest.
        for (speed, share) in [(20.0, 0.16), (-20.0, 1.0)] {
            let mut moving = state.clone();
            moving.v[1][2] = speed;
            let ratio = contacts(&scene, &moving)[0].force / found[0].force;
            assert!((ratio - share / 0.58).abs() < 1e-9, "{ratio}");
        }
    }

    #[test]
    fn lattices_have_six_and_twelve_contacts() {
        let n = 6;
        let cubic: Vec<[f64; 3]> =
            (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|c: usize| 0.1999 * c as f64)).collect();
        // The even points of a cubic lattice form a face-centred one.
        let step = 0.1999 / 2f64.sqrt();
        let face: Vec<[f64; 3]> = (0..8 * 8 * 8)
            .map(|k| [k % 8, k / 8 % 8, k / 64])
            .filter(|c| c.iter().sum::<usize>() % 2 == 0)
            .map(|c| c.map(|c| step * c as f64))
            .collect();
        for (x, expected) in [(cubic, 6), (face, 12)] {
            let (low, high) = (0.5 * step, x.iter().map(|x| x[0]).fold(0.0, f64::max) - 0.5 * step);
            let inner: Vec<usize> =
                (0..x.len()).filter(|&i| x[i].iter().all(|c| (low..=high).contains(c))).collect();
            let state = at_rest(x);
            let found = contacts(&scene(""), &state);
            let numbers = coordination(state.x.len(), &found);
            assert!(inner.len() > 20);
            assert!(inner.iter().all(|&i| numbers[i] == expected), "{expected}");
            assert!(found.iter().all(|contact| (contact.overlap - 1e-4).abs() < 1e-12));
        }
    }

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
