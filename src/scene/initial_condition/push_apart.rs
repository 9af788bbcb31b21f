//! Pushes spheres apart that overlap, by geometry alone: no forces, no speeds.
//!
//! In each sweep every pair that is too close moves apart along its line of centres, a large sphere less than
//! a small one, and walls push inwards. All spheres move at once, by sums in an order that is always the
//! same, so the result has the same bits on any number of ranks and threads. At first spheres move no further
//! than they are pushed. What is not parted then takes many sweeps more, of which a tenth is enough if the
//! last move of a sphere goes on with a loss (decision 055).

use super::near::Near;
use super::{InitialCondition, check_all_but_twins, origin};
use crate::error::Error;
use crate::math::cells::coordinate;
use crate::math::digits::{rough, short};
use crate::math::vector::Vec3;
use crate::model::wall::Wall;
use crate::scene::Scene;
use crate::scene::walls::walls;
use crate::threads::{self, GRAIN};

/// Overlap over the smaller radius that `particles.push_apart` leaves at most.
pub const REMAINS: f64 = 1e-3;

/// Sweeps after which `particles.push_apart` gives up.
pub const MOST_SWEEPS: u32 = 10_000;

/// Number of the first sweeps, in which nothing goes on.
const FIRST: u32 = 60;

/// Part of an overlap by which a sweep moves a pair, and what stays of the last move: of those that were
/// tried these take the fewest sweeps.
fn pace(sweep: u32) -> (f64, f64) {
    if sweep < FIRST { (0.5, 0.0) } else { (0.3, 0.9) }
}

/// A sphere moves by this share of its radius in a sweep at most: spheres in one heap do not fly.
const LONGEST: f64 = 0.5;

/// Slack of the lists of partners, over the sum of radii.
const SLACK: f64 = 0.3;

/// Centres closer than this share of the sum of radii have no line that arithmetic resolves.
const ONE_PLACE: f64 = 1e-12;

/// What pushing apart is to reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Distance that pairs are moved to, over the sum of their radii; that from walls, over the radius; >= 1.
    pub apart: f64,
    /// Overlap of true radii that may remain, over the smaller radius; >= 0.
    pub remains: f64,
    /// Number of sweeps at most.
    pub sweeps: u32,
}

/// What was moved to push the spheres of a start apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pushed {
    /// Number of spheres that overlapped another one or a wall.
    pub overlapping: u64,
    /// The largest overlap before, m.
    pub deepest: f64,
    /// How far the furthest sphere moved, m.
    pub furthest: f64,
    /// Number of sweeps that it took.
    pub sweeps: u32,
}

/// Moves the centres `x` (m) of spheres with these `radii` (m) until none overlaps another one or a wall.
///
/// Returns the number of sweeps, or the largest overlap over the smaller radius that the last sweep left.
/// Then `x` is where the last sweep left it.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::wall::Wall;
/// use demhybrid::scene::initial_condition::push_apart::{Aim, spread};
///
/// let floor = Wall::new(Vec3::zeros(), -Vec3::z());
/// let mut x = [Vec3::new(0.0, 0.0, 0.5), Vec3::new(0.0, 0.0, 1.0)];
/// let aim = Aim { apart: 1.01, remains: 0.0, sweeps: 1000 };
/// assert!(spread(&mut x, &[1.0, 0.5], &[floor], &aim).is_ok());
/// assert!(x[0].z >= 1.0 && x[1].z - x[0].z >= 1.5); // m
/// ```
pub fn spread(x: &mut [Vec3], radii: &[f64], walls: &[Wall], aim: &Aim) -> Result<u32, f64> {
    let order = in_space(x, radii);
    let mut sorted: Vec<Vec3> = order.iter().map(|&i| x[i as usize]).collect();
    let own: Vec<f64> = order.iter().map(|&i| radii[i as usize]).collect();
    let spheres = Spheres { radii: &own, ids: &order, walls, apart: aim.apart };
    let outcome = spheres.sweep_until_apart(&mut sorted, aim);
    for (&i, place) in order.iter().zip(&sorted) {
        x[i as usize] = *place;
    }
    outcome
}

/// The spheres in an order in which near ones are mostly near in memory too.
fn in_space(x: &[Vec3], radii: &[f64]) -> Vec<u32> {
    let width = 2.0 * radii.iter().sum::<f64>() / radii.len().max(1) as f64;
    let cell = |i: u32| {
        let x = &x[i as usize];
        [2, 1, 0].map(|axis| coordinate(x[axis], width))
    };
    let mut order: Vec<u32> = (0..x.len() as u32).collect();
    order.sort_by_cached_key(|&i| cell(i));
    order
}

/// What stays the same from sweep to sweep.
struct Spheres<'a> {
    radii: &'a [f64],
    /// The id of each.
    ids: &'a [u32],
    walls: &'a [Wall],
    apart: f64,
}

/// The largest overlap over the smaller radius, and the largest distance over the radius from where the lists
/// were built.
type Largest = (f64, f64);

impl Spheres<'_> {
    fn sweep_until_apart(&self, x: &mut Vec<Vec3>, aim: &Aim) -> Result<u32, f64> {
        let n = x.len();
        let (mut moves, mut next) = (vec![Vec3::zeros(); n], x.clone());
        let (mut listed, mut near) = (Vec::new(), None);
        let mut overlap = 0.0;
        for sweep in 0..=aim.sweeps {
            let lists = near.get_or_insert_with(|| {
                listed.clone_from(x);
                Near::new(x, self.radii, aim.apart * (1.0 + SLACK))
            });
            let (now, (step, stays)) = (&x[..], pace(sweep));
            let part = |first: usize, (moves, next): (&mut [Vec3], &mut [Vec3])| {
                let mut largest: Largest = (0.0, 0.0);
                for (i, (own, next)) in (first..).zip(moves.iter_mut().zip(next)) {
                    let (push, overlap) = self.push(i, now, lists.of(i));
                    let r = self.radii[i];
                    let whole = stays * *own + step * push;
                    *own = whole * (LONGEST * r / whole.norm()).min(1.0);
                    *next = now[i] + *own;
                    largest.0 = largest.0.max(overlap);
                    largest.1 = largest.1.max((*next - listed[i]).norm() / r);
                }
                largest
            };
            let larger = |a: Largest, b: Largest| (a.0.max(b.0), a.1.max(b.1));
            let slices = (&mut moves[..], &mut next[..]);
            let away;
            (overlap, away) = threads::parts(n, GRAIN, slices, &part, &larger);
            if overlap <= aim.remains {
                return Ok(sweep);
            }
            std::mem::swap(x, &mut next);
            if away > SLACK * aim.apart {
                near = None;
            }
        }
        Err(overlap)
    }

    /// The sum of what moves sphere `i` (m), and its largest overlap over the smaller radius.
    fn push(&self, i: usize, x: &[Vec3], partners: &[u32]) -> (Vec3, f64) {
        let (r, mut sum, mut largest) = (self.radii[i], Vec3::zeros(), 0.0f64);
        for &j in partners {
            let j = j as usize;
            let (other, line) = (self.radii[j], x[i] - x[j]);
            let (touch, squared) = (r + other, line.norm_squared());
            let wanted = self.apart * touch;
            if squared >= wanted * wanted {
                continue;
            }
            let d = squared.sqrt();
            let n = if d > ONE_PLACE * touch { line / d } else { way_out(self.ids[i], self.ids[j]) };
            // By cross sections: a large sphere has as many more contacts with small ones.
            let share = other * other / (r * r + other * other);
            sum += n * (share * (wanted - d));
            largest = largest.max((touch - d) / r.min(other));
        }
        for wall in self.walls {
            let depth = wall.depth(&x[i]);
            if depth < self.apart * r {
                sum -= wall.normal * (self.apart * r - depth);
                largest = largest.max((r - depth) / r);
            }
        }
        (sum, largest)
    }

    /// How many spheres overlap another one or a wall, and by how much at most, m.
    fn overlaps(&self, x: &[Vec3]) -> (u64, f64) {
        let near = Near::new(x, self.radii, 1.0);
        let of_one = |i: usize| {
            let r = self.radii[i];
            let pairs =
                near.of(i).iter().map(|&j| r + self.radii[j as usize] - (x[i] - x[j as usize]).norm());
            let walls = self.walls.iter().map(|wall| r - wall.depth(&x[i]));
            let deepest = pairs.chain(walls).fold(0.0, f64::max);
            (u64::from(deepest > 0.0), deepest)
        };
        threads::fold(x.len(), GRAIN, of_one, (0, 0.0), |a, b| (a.0 + b.0, a.1.max(b.1)))
    }
}

/// The unit vector along which sphere `i` leaves sphere `j` of the same centre: a function of the two ids.
fn way_out(i: u32, j: u32) -> Vec3 {
    // Multiples of the first three square roots that are not whole spread evenly over a cube.
    let [low, high] = [i.min(j), i.max(j)].map(f64::from);
    let roots = [std::f64::consts::SQRT_2, 1.732_050_807_568_877_2, 2.236_067_977_499_79];
    let place = roots.map(|root| 2.0 * (root * (low + root * (high + 1.0))).fract() - 1.0);
    let way = Vec3::from(place).try_normalize(0.01).unwrap_or(Vec3::x());
    if i < j { way } else { -way }
}

/// The start with all spheres pushed apart, if the scene has `particles.push_apart`; else as it is.
///
/// Velocities stay. It is a pure function: it gives the same bits on every rank.
pub(super) fn pushed(scene: &Scene, mut start: InitialCondition) -> Result<InitialCondition, Error> {
    if !scene.particles.push_apart {
        return Ok(start);
    }
    check_all_but_twins(scene, &start)?;
    let sizes = start.sizes(scene);
    let radii: Vec<f64> = (0..start.x.len()).map(|i| sizes.as_sizes().of(i).r).collect();
    let walls = walls(&scene.container);
    let mut x: Vec<Vec3> = start.x.iter().map(|&x| x.into()).collect();
    let ids: Vec<u32> = (0..x.len() as u32).collect();
    let spheres = Spheres { radii: &radii, ids: &ids, walls: &walls, apart: 1.0 };
    let (overlapping, deepest) = spheres.overlaps(&x);
    let aim = Aim { apart: 1.0, remains: REMAINS, sweeps: MOST_SWEEPS };
    let sweeps = spread(&mut x, &radii, &walls, &aim).map_err(|overlap| {
        Error::Input(format!(
            "{}: particles.push_apart = true cannot part the spheres: after {MOST_SWEEPS} sweeps some \
             still overlap by {} of the smaller radius, and {} at most would be right; fewer or smaller \
             spheres, or a larger container would do",
            origin(scene),
            rough(overlap),
            short(REMAINS)
        ))
    })?;
    let moved = x.iter().zip(&start.x).map(|(x, before)| (x - Vec3::from(*before)).norm());
    let furthest = moved.fold(0.0, f64::max);
    start.x = x.into_iter().map(Into::into).collect();
    start.pushed = Some(Pushed { overlapping, deepest, furthest, sweeps });
    Ok(start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const AIM: Aim = Aim { apart: 1.0, remains: REMAINS, sweeps: MOST_SWEEPS };

    /// `n` places in a cube of `side` (m), without order.
    fn anywhere(n: usize, side: f64) -> Vec<Vec3> {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        (0..n).map(|_| Vec3::from_fn(|_, _| random.random_range(0.0..side))).collect()
    }

    fn scene(sets: &[&str]) -> Scene {
        let text = "t_end = 1
            particles = { radius = 0.1, mass = 1, file = 'start.csv', push_apart = true }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }
            container.box = { max = [1, 1, inf] }";
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        Scene::parse("a.toml", text, &sets).unwrap()
    }

    fn at(x: &[[f64; 3]]) -> InitialCondition {
        let v = vec![[0.5, -1.0, 2.0]; x.len()];
        let omega = vec![[0.0; 3]; x.len()];
        InitialCondition { x: x.to_vec(), v, omega, ..InitialCondition::default() }
    }

    #[test]
    fn two_spheres_move_along_their_line_and_the_smaller_one_further() {
        let mut x = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.44, 1.92, 0.0)];
        spread(&mut x, &[2.0, 1.0], &[], &AIM).unwrap();
        let line = (x[1] - x[0]) / 3.0;
        // What remains is less than a thousandth of the smaller radius, or it is passed by a moving sphere.
        assert!(line.norm() > 1.0 - 1e-3 / 3.0, "{line}");
        assert!((line.normalize() - Vec3::new(0.6, 0.8, 0.0)).norm() < 1e-12, "{line}");
        let moved = [x[0].norm(), (x[1] - Vec3::new(1.44, 1.92, 0.0)).norm()];
        assert!((moved[1] - 4.0 * moved[0]).abs() < 1e-9, "{moved:?}");
    }

    #[test]
    fn spheres_that_do_not_overlap_stay_to_the_last_bit() {
        let mut x = anywhere(200, 100.0);
        x.retain(|x| x.min() > 1.0);
        let mut kept: Vec<Vec3> = Vec::new();
        for place in x {
            if kept.iter().all(|other| (other - place).norm() >= 2.0) {
                kept.push(place);
            }
        }
        let (mut x, floor) = (kept.clone(), Wall::new(Vec3::zeros(), -Vec3::z()));
        assert!(x.len() > 150);
        assert_eq!(spread(&mut x, &vec![1.0; kept.len()], &[floor], &AIM), Ok(0));
        assert_eq!(x, kept);
    }

    #[test]
    fn a_heap_in_one_place_is_parted_in_a_way_that_the_ids_give() {
        let heap = |n: usize| {
            let mut x = vec![Vec3::new(0.5, 0.5, 0.5); n];
            spread(&mut x, &vec![0.1; n], &[], &AIM).unwrap();
            x
        };
        let x = heap(30);
        for i in 0..30 {
            for j in 0..i {
                assert!((x[i] - x[j]).norm() > 0.2 - 1e-4, "{i} {j}");
            }
        }
        assert_eq!(x, heap(30));
        assert_eq!(way_out(3, 7), -way_out(7, 3));
        assert_ne!(way_out(3, 7), way_out(3, 8));
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        // More than one thread takes part from 2048 spheres on.
        let (start, radii) = (anywhere(6000, 40.0), vec![1.0; 6000]);
        let of = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut x = start.clone();
            let sweeps = pool.install(|| spread(&mut x, &radii, &[], &AIM));
            (x, sweeps)
        };
        let alone = of(1);
        assert!(alone.1.is_ok_and(|sweeps| sweeps > 10));
        assert_eq!(of(2), alone);
        assert_eq!(of(3), alone);
    }

    #[test]
    fn spheres_without_room_are_refused_and_told_what_remains() {
        let walls = [-1.0, 1.0].map(|side| Wall::new(Vec3::new(0.0, 0.0, side), Vec3::new(0.0, 0.0, side)));
        let mut x = [Vec3::new(0.0, 0.0, 0.1)];
        // Between planes 2 m apart, a sphere of 1.5 m overlaps each by 0.5 m at least.
        let remains = spread(&mut x, &[1.5], &walls, &Aim { sweeps: 500, ..AIM }).unwrap_err();
        assert!((remains - 1.0 / 3.0).abs() < 1e-3, "{remains}");
        let full = scene(&["container.box.max=[0.3, 0.3, 0.3]"]);
        let start = at(&[[0.1, 0.1, 0.1], [0.2, 0.2, 0.2], [0.1, 0.2, 0.1], [0.2, 0.1, 0.2]]);
        let told = pushed(&full, start).unwrap_err().to_string();
        assert!(told.contains("start.csv: particles.push_apart = true cannot part the spheres"), "{told}");
        assert!(told.contains("a larger container would do"), "{told}");
    }

    #[test]
    fn a_scene_tells_what_was_moved_and_keeps_velocities() {
        // Two overlap by 0.05 m, one of them also the floor by 0.02 m, and a third nothing.
        let start = at(&[[0.5, 0.5, 0.08], [0.5, 0.5, 0.23], [0.2, 0.2, 0.9]]);
        let parted = pushed(&scene(&[]), start.clone()).unwrap();
        let Pushed { overlapping, deepest, furthest, sweeps } = parted.pushed.unwrap();
        assert_eq!(overlapping, 2);
        assert!((deepest - 0.05).abs() < 1e-12 && sweeps > 0, "{deepest}");
        let moved = |i: usize| (Vec3::from(parted.x[i]) - Vec3::from(start.x[i])).norm();
        assert!((furthest - moved(0).max(moved(1))).abs() < 1e-15 && furthest > 0.02, "{furthest}");
        assert_eq!((parted.x[2], &parted.v), (start.x[2], &start.v));
        assert!(parted.x[0][2] > 0.1 - 1e-4 && parted.x[1][2] - parted.x[0][2] > 0.2 - 1e-4);
        // A centre beyond a wall is a mistake, with or without the key.
        let beyond = pushed(&scene(&[]), at(&[[0.5, 0.5, -0.01]])).unwrap_err().to_string();
        assert!(beyond.contains("0.01 m beyond the side z = 0 m"), "{beyond}");
        let without = pushed(&scene(&["particles.push_apart=false"]), start.clone()).unwrap();
        assert_eq!(without, start);
    }
}
