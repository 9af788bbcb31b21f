//! Contacts of a bed: what pushes, and what overlaps.

use serde::Serialize;

use super::reference_force::Reference;
use super::union::for_each_within;
use crate::engine::neighbors::Reach;
use crate::files::run_file::State;
use crate::math::elementary::Separate;
use crate::math::vector::Vec3;
use crate::model::contact::Rebound;
use crate::model::size::Sizes;
use crate::model::wall::Wall;
use crate::scene::Scene;
use crate::scene::materials::NormalLaws;
use crate::scene::walls::{wall_names, walls};

/// Share of the reference force above which a push is a contact, where nobody asks for another.
pub const SHARE: f64 = 0.1;

/// The body that a sphere touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partner {
    /// The sphere of this id.
    Sphere(usize),
    /// The wall of this index in the list of [`crate::scene::walls::walls`].
    Wall(usize),
}

impl Partner {
    /// The index of the wall, if it is one.
    pub fn wall(self) -> Option<usize> {
        match self {
            Partner::Wall(k) => Some(k),
            Partner::Sphere(_) => None,
        }
    }
}

/// Two bodies that push each other, or whose surfaces overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Id of the sphere.
    pub i: usize,
    /// The other body. If it is a sphere, its id is the higher one.
    pub partner: Partner,
    /// Overlap of the surfaces, m; negative across a gap.
    pub overlap: f64,
    /// Normal force at the positions and velocities of the state, eqs. (2.1) to (2.5), N. At rest it is
    /// (1 + e^2)/2 of the repulsion, with the e of its two materials.
    pub force: f64,
}

/// What a wall bears.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WallForce {
    /// Name of the wall, as [`wall_names`] gives it.
    pub wall: String,
    /// Sum of the normal forces of all spheres within the interaction distance, N: also of those whose push
    /// is too weak for a contact.
    pub normal_force: f64,
    /// Number of contacts with the wall.
    pub contacts: usize,
}

/// The contacts of a state.
///
/// A contact is what pushes with more than a share of a [`Reference`] force. The gap does not decide: the
/// repulsion is F(l) = F_0 exp(-kappa l), so the gap at which a contact bears its load depends on F_0.
///
/// # Examples
///
/// ```rust
/// use demhybrid::beds::measures::contacts::{Contacts, Partner, SHARE};
/// use demhybrid::files::run_file::State;
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let state = State {
///     frame: 0,
///     time: 0.0,
///     x: vec![[0.3, 0.3, 0.099], [0.3, 0.3, 0.301]],
///     v: vec![[0.0; 3]; 2],
///     omega: None,
///     sizes: Default::default(), // all have that of the scene
///     materials: Default::default(), // none has one
/// };
/// let found = Contacts::of(&scene, &state, SHARE); // one sphere above another one on the floor
/// assert_eq!((found.pushing[0].i, found.pushing[0].partner), (0, Partner::Sphere(1)));
/// assert!((found.pushing[0].overlap + 2e-3).abs() < 1e-12); // a gap of 2 mm
/// assert!((found.pushing[0].force - 5.8 * (-0.3f64).exp()).abs() < 1e-9); // N
/// assert_eq!((found.pushing[1].i, found.pushing[1].partner), (0, Partner::Wall(4)));
/// assert_eq!((found.pushing.len(), found.overlapping.len()), (2, 1));
/// assert_eq!(found.walls[4].wall, "z = 0 m");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Contacts {
    /// The contacts: first pairs, then walls, each by ascending ids.
    pub pushing: Vec<Contact>,
    /// What overlaps or just touches, because its gap is not positive, in the same order. This is the
    /// geometric count: it says nothing of forces.
    pub overlapping: Vec<Contact>,
    /// The force that pushes are compared with.
    pub reference: Reference,
    /// A contact pushes with more than this, N: the share of the reference force. Where every pair has a
    /// reference of its own, it is the share of the mean one.
    pub threshold: f64,
    /// What every wall bears, in the order of [`walls`].
    pub walls: Vec<WallForce>,
}

impl Contacts {
    /// The contacts of `state`: what pushes with more than `share` of the reference force.
    pub fn of(scene: &Scene, state: &State, share: f64) -> Self {
        let bodies = Bodies::of(scene, state);
        let least = Reference::least(scene, state).smallest();
        // Beyond this gap nobody pushes hard enough to be a contact or to count in the mean.
        let reach = bodies.reach(share.min(SHARE) * least);
        let (mut found, borders) = (bodies.pairs(reach), bodies.borders());
        let name = |wall| WallForce { wall, normal_force: 0.0, contacts: 0 };
        let mut walls: Vec<WallForce> = wall_names(&scene.container).into_iter().map(name).collect();
        for (k, contact) in borders.iter().filter_map(|contact| Some((contact.partner.wall()?, contact))) {
            walls[k].normal_force += contact.force;
        }
        found.extend(borders);

        let reference = Reference::of(scene, state, found.iter().map(|contact| contact.force));
        let threshold = share * reference.newtons();
        let overlapping = found.iter().copied().filter(|contact| contact.overlap >= 0.0).collect();
        let sizes = state.sizes(scene);
        let least = |contact: &Contact| share * reference.between(scene, sizes, contact.i, contact.partner);
        found.retain(|contact| contact.force > least(contact));
        for k in found.iter().filter_map(|contact| contact.partner.wall()) {
            walls[k].contacts += 1;
        }
        Contacts { pushing: found, overlapping, reference, threshold, walls }
    }
}

/// The contacts between spheres, without those with walls.
pub fn between_spheres(contacts: &[Contact]) -> impl Iterator<Item = &Contact> {
    contacts.iter().filter(|contact| contact.partner.wall().is_none())
}

/// The spheres of a state with the laws of their normal forces.
struct Bodies<'a> {
    sizes: Sizes<'a>,
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    walls: Vec<Wall>,
    laws: NormalLaws<'a>,
}

impl<'a> Bodies<'a> {
    fn of(scene: &Scene, state: &'a State) -> Self {
        Bodies {
            sizes: state.sizes(scene),
            x: state.x.iter().map(|&x| x.into()).collect(),
            v: state.v.iter().map(|&v| v.into()).collect(),
            walls: walls(&scene.container),
            laws: NormalLaws::of(scene, &state.materials),
        }
    }

    /// Largest gap at which a repulsion can be more than `force` (N), from 0 to the interaction distance, m.
    fn reach(&self, force: f64) -> f64 {
        let law = self.laws.shared();
        ((law.f_0 / force).ln() / law.kappa).max(0.0).min(law.l_max)
    }

    /// A contact at `gap` (m) that opens at the speed `opening` (m/s).
    fn contact(&self, i: usize, partner: Partner, gap: f64, opening: f64) -> Contact {
        let law = match partner {
            Partner::Sphere(j) => self.laws.of_pair(i, j),
            Partner::Wall(k) => self.laws.of_wall(i, k),
        };
        let force = law.repulsion::<Separate>(gap) * law.rebound.share::<Separate>(-opening);
        Contact { i, partner, overlap: -gap, force }
    }

    /// All pairs of spheres with gaps up to `reach` (m), by ascending ids.
    fn pairs(&self, reach: f64) -> Vec<Contact> {
        let (x, v, sizes) = (&self.x, &self.v, self.sizes);
        let within = match sizes {
            Sizes::Equal(size) => Reach::of_centres(2.0 * size.r + reach, 0.0),
            Sizes::Each(_) => Reach { sizes, shares: [1.0; 2], gaps: [reach; 2] },
        };
        let mut pairs = Vec::new();
        for_each_within(x, within, |[i, j]| pairs.push([i.min(j), i.max(j)]));
        pairs.sort_unstable();
        let contact = |[i, j]: [usize; 2]| {
            let apart = x[i] - x[j];
            let d = apart.norm();
            let opening = if d > 0.0 { apart.dot(&(v[i] - v[j])) / d } else { 0.0 };
            self.contact(i, Partner::Sphere(j), d - (sizes.of(i).r + sizes.of(j).r), opening)
        };
        pairs.into_iter().map(contact).collect()
    }

    /// All spheres within the interaction distance of each wall.
    fn borders(&self) -> Vec<Contact> {
        let mut found = Vec::new();
        for (k, wall) in self.walls.iter().enumerate() {
            for (i, (x, v)) in self.x.iter().zip(&self.v).enumerate() {
                let gap = wall.depth(x) - self.sizes.of(i).r;
                if gap <= self.laws.shared().l_max {
                    found.push(self.contact(i, Partner::Wall(k), gap, -wall.normal.dot(v)));
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::measures::rattlers::coordination;
    use crate::beds::measures::testing::{at_rest, scene, sized};

    const GRAVITY: &str = "gravity = [0, 0, -9.81]";

    /// Two spheres with this gap (m) along x, at rest.
    fn two(gap: f64) -> State {
        at_rest(vec![[0.0; 3], [0.2 + gap, 0.0, 0.0]])
    }

    #[test]
    fn a_stack_at_rest_carries_its_weight() {
        let scene = scene(&format!("{GRAVITY}\ncontainer.box = {{ min = [0, 0, 0], max = [1, 1, inf] }}"));
        // From the documentation: two spheres at rest on each other overlap by 3.50363 mm, the lower one and
        // the floor by 8.12461 mm.
        let state = at_rest(vec![[0.5, 0.5, 0.1 - 8.12461e-3], [0.5, 0.5, 0.3 - 8.12461e-3 - 3.50363e-3]]);
        let found = Contacts::of(&scene, &state, SHARE).pushing;
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
            let ratio = Contacts::of(&scene, &moving, SHARE).pushing[0].force / found[0].force;
            assert!((ratio - share / 0.58).abs() < 1e-9, "{ratio}");
        }
    }

    #[test]
    fn two_spheres_are_in_contact_up_to_the_gap_at_which_they_push_with_the_share_of_a_weight() {
        let scene = scene(GRAVITY);
        for share in [0.1, 0.01, 0.5, 1.0] {
            // rho(0) F_0 exp(-kappa l) = share m g.
            let gap = (5.8f64 / (share * 9.81)).ln() / 150.0;
            let count = |gap| Contacts::of(&scene, &two(gap), share).pushing.len();
            assert_eq!((count(gap - 1e-9), count(gap + 1e-9)), (1, 0), "{share}");
        }
        // Of a sphere that closes in fast, F_0 exp(-kappa l) is the whole force; of one that leaves, e^2.
        for (speed, rebound) in [(-20.0, 1.0), (20.0, 0.16)] {
            let gap = (rebound * 10.0f64 / 0.981).ln() / 150.0;
            let count = |gap| {
                let mut state = two(gap);
                state.v[1][0] = speed;
                Contacts::of(&scene, &state, SHARE).pushing.len()
            };
            assert_eq!((count(gap - 1e-9), count(gap + 1e-9)), (1, 0), "{speed}");
        }
        // With a share of 0, whatever pushes at all is a contact, up to l_max.
        let count = |gap| Contacts::of(&scene, &two(gap), 0.0).pushing.len();
        assert_eq!((count(0.1 - 1e-9), count(0.1 + 1e-9)), (1, 0));
    }

    #[test]
    fn what_overlaps_is_counted_apart_from_what_pushes() {
        let counts = |scene: &Scene, gap| {
            let found = Contacts::of(scene, &two(gap), SHARE);
            (found.pushing.len(), found.overlapping.len())
        };
        let paper = scene(GRAVITY);
        assert_eq!(
            (counts(&paper, -1e-3), counts(&paper, 1e-3), counts(&paper, 0.02)),
            ((1, 1), (1, 0), (0, 0))
        );
        // At 0.1 N a sphere must sink in before it pushes: ln(0.981/0.058)/150 = 18.9 mm.
        let mut soft = scene(GRAVITY);
        soft.contact.repulsion_at_contact = 0.1;
        assert_eq!((counts(&soft, -0.018), counts(&soft, -0.020)), ((0, 1), (1, 1)));
    }

    #[test]
    fn without_gravity_the_mean_push_is_the_measure() {
        let scene = scene("");
        // A chain whose pushes fall e-fold from pair to pair: 5.8 N, 2.13 N, 0.785 N, 0.289 N.
        let distance = |k: usize| 0.2 * k as f64 + (k * k.saturating_sub(1) / 2) as f64 / 150.0;
        let chain = at_rest((0..5).map(|k| [distance(k), 0.0, 0.0]).collect());
        let found = Contacts::of(&scene, &chain, SHARE);
        let push = |k: i32| 5.8 * (-f64::from(k)).exp();
        // A tenth of the mean of all four is 0.225 N, so all of them count.
        let mean = (0..4).map(push).sum::<f64>() / 4.0;
        assert_eq!(found.pushing.len(), 4);
        assert!(
            (found.reference.newtons() - mean).abs() < 1e-9 && (found.threshold - 0.1 * mean).abs() < 1e-9
        );
        // Three, with a larger share. It does not move the reference.
        let fewer = Contacts::of(&scene, &chain, 0.2);
        assert_eq!((fewer.pushing.len(), fewer.reference), (3, found.reference));

        // One pair is always a contact, but across a gap where they push with 1e-3 F_0 or less.
        let count = |gap| Contacts::of(&scene, &two(gap), SHARE).pushing.len();
        let widest = 580f64.ln() / 150.0;
        assert_eq!((count(-0.01), count(widest - 1e-9), count(widest + 1e-9)), (1, 1, 0));
    }

    #[test]
    fn walls_bear_what_all_spheres_near_them_push_with() {
        let mut scene =
            scene(&format!("{GRAVITY}\ncontainer.box = {{ min = [0, 0, 0], max = [1, 1, inf] }}"));
        let tilted = crate::scene::WallPlane { point: [0.0; 3], normal: [-1.0, 0.0, -1.0], material: None };
        scene.container.wall.push(tilted);
        // Gaps of -2 mm to the floor, and of 5 and 40 mm to the side x = 0.
        let state = at_rest(vec![[0.105, 0.5, 0.098], [0.14, 0.5, 0.5]]);
        for share in [SHARE, 0.0, 10.0] {
            let found = Contacts::of(&scene, &state, share);
            let at = |name: &str| found.walls.iter().find(|wall| wall.wall == name).unwrap();
            let exact = |gaps: &[f64]| gaps.iter().map(|gap| 5.8 * (-150.0 * gap).exp()).sum::<f64>();
            for (name, gaps) in [
                ("z = 0 m", &[-0.002][..]),
                ("x = 0 m", &[0.005, 0.040]),
                ("x = 1 m", &[]),
                ("container.wall[0]", &[0.203 / 2f64.sqrt() - 0.1]),
            ] {
                let force = at(name).normal_force;
                assert!((force - exact(gaps)).abs() < 1e-9, "{name}: {force}");
            }
            let counts = ["z = 0 m", "x = 0 m", "x = 1 m"].map(|name| at(name).contacts);
            let expected = if share == SHARE {
                [1, 1, 0]
            } else if share == 0.0 {
                [1, 2, 0]
            } else {
                [0; 3]
            };
            assert_eq!(counts, expected, "{share}");
            let listed =
                |k| found.pushing.iter().filter(|contact| contact.partner == Partner::Wall(k)).count();
            assert!(found.walls.iter().enumerate().all(|(k, wall)| listed(k) == wall.contacts));
        }
    }

    #[test]
    fn unequal_spheres_push_across_the_gap_of_their_own_surfaces() {
        let mut scene = scene(GRAVITY);
        scene.container.wall.push(crate::scene::WallPlane::default());
        // A large sphere of 8 kg on the floor, and a small one of 1 g on top of it, both across 1 mm.
        let bed = |gap: f64| {
            let top = 0.401 + 0.01 + gap;
            sized(&[([0.0, 0.0, 0.201], 0.2, 8.0), ([0.0, 0.0, top], 0.01, 1e-3)])
        };
        let found = Contacts::of(&scene, &bed(1e-3), SHARE);
        let push = 5.8 * (-0.15f64).exp();
        assert_eq!(found.pushing[0].partner, Partner::Sphere(1));
        assert!((found.pushing[0].overlap + 1e-3).abs() < 1e-12);
        assert!((found.pushing[0].force - push).abs() < 1e-9, "{:?}", found.pushing);
        // On the floor the large sphere pushes with less than a tenth of its own weight. On the small one
        // this is far more than a tenth of the weight that matters there.
        assert_eq!((found.pushing.len(), found.overlapping.len()), (1, 0));
        assert!((found.walls[0].normal_force - push).abs() < 1e-9);
        let half = Contacts::of(&scene, &bed(1e-3), 0.05);
        assert_eq!((half.pushing.len(), half.walls[0].contacts), (2, 1));
        // rho(0) F_0 exp(-kappa l) = 0.1 m g with the mass of the small one.
        let gap = (5.8f64 / (0.1 * 9.81e-3)).ln() / 150.0;
        let count = |gap| Contacts::of(&scene, &bed(gap), SHARE).pushing.len();
        assert_eq!((count(gap - 1e-9), count(gap + 1e-9)), (1, 0));
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
            // With a weight to compare with, and with the mean push.
            for gravity in [GRAVITY, ""] {
                let found = Contacts::of(&scene(gravity), &state, SHARE);
                let numbers = coordination(state.x.len(), &found.pushing);
                assert!(inner.len() > 20);
                assert!(inner.iter().all(|&i| numbers[i] == expected), "{expected}");
                assert!(found.pushing.iter().all(|contact| (contact.overlap - 1e-4).abs() < 1e-12));
                assert_eq!(found.pushing, found.overlapping);
            }
        }
    }
}
