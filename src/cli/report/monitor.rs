//! Checks every frame for particles beyond a wall, and for particles that have left an open container.

use crate::domain::Comm;
use crate::engine::simulation::Frame;
use crate::math::digits::rough;
use crate::math::vector::Vec3;
use crate::model::columns::{position, velocity};
use crate::model::wall::Wall;
use crate::scene::Scene;
use crate::scene::initial_condition::InitialCondition;
use crate::scene::walls::described_walls;
use std::cmp::Ordering;

/// A direction in which particles can leave the container.
#[derive(Debug, Clone)]
struct Exit {
    /// Unit vector that points outwards.
    along: Vec3,
    /// Largest coordinate of a centre in this direction at the start, m.
    started: f64,
}

/// Checks the positions of this rank's rows in every frame, and warns at the end of the run.
#[derive(Debug, Clone)]
pub struct Monitor {
    walls: Vec<Wall>,
    /// Names of the walls.
    names: Vec<String>,
    exits: Vec<Exit>,
    /// Radius of the particles, m, where all are alike.
    r: f64,
    /// The largest radius, m.
    largest: f64,
    /// Interaction distance, m.
    l_max: f64,
    /// Largest distance of a centre beyond a wall so far, m, the id of the particle and the index of the
    /// wall. Negative: inside.
    furthest: (f64, u64, usize),
    /// Ids of the particles that had left the container in the last frame.
    left: Vec<u64>,
}

impl Monitor {
    /// A monitor for a scene with the particles `start`.
    ///
    /// Particles can leave along an axis that no wall blocks and along which gravity does not pull them back.
    /// If there is no wall at all, there is no container to leave. Where gravity pulls towards a wall, such
    /// as a floor, everything comes back to it: what rolls away over an open floor, or rides on others, is
    /// still there.
    pub fn new(scene: &Scene, start: &InitialCondition) -> Self {
        let (walls, names): (Vec<Wall>, Vec<String>) = described_walls(&scene.container).into_iter().unzip();
        let gravity = Vec3::from(scene.gravity);
        // What only rounding makes different from 0 pulls nowhere.
        let pulls_to = |wall: &Wall| wall.normal.dot(&gravity) > 1e-12 * gravity.norm();
        let open = !walls.is_empty() && !walls.iter().any(pulls_to);
        let axes = [Vec3::x(), Vec3::y(), Vec3::z()];
        let exits = axes
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .filter(|u| open && gravity.dot(u) >= 0.0)
            .filter(|u| walls.iter().all(|wall| wall.normal.dot(u) <= 1e-12))
            .map(|along| {
                let places = start.x.iter().map(|x| along.dot(&Vec3::from(*x)));
                Exit { along, started: places.fold(f64::NEG_INFINITY, f64::max) }
            })
            .collect();
        let (r, l_max) = (scene.particles.radius, scene.contact.interaction_distance);
        let largest = start.sizes(scene).largest();
        let furthest = (f64::NEG_INFINITY, 0, 0);
        Monitor { walls, names, exits, r, largest, l_max, furthest, left: Vec::new() }
    }

    /// Checks the particles of a frame.
    pub fn follow(&mut self, frame: &Frame) {
        let sizes = frame.sizes();
        let looks = frame.rows.map(|row| {
            let (x, v) = (position(row), velocity(row));
            let depths = self.walls.iter().enumerate().map(|(wall, plane)| (plane.depth(&x), wall));
            let nearest = depths.fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a });
            (nearest, x, v)
        });
        let radius = |k: usize| sizes.get(k).map_or(self.r, |size| size.r);
        let left = |(k, (nearest, x, v)): &(usize, &((f64, usize), Vec3, Vec3))| {
            self.has_left(x, v, radius(*k), nearest.0)
        };
        self.left = looks.iter().enumerate().filter(left).map(|(k, _)| frame.first + k as u64).collect();
        for (id, ((depth, wall), ..)) in (frame.first..).zip(&looks) {
            if -depth > self.furthest.0 {
                self.furthest = (-depth, id, *wall);
            }
        }
    }

    /// Whether a body of radius `r` (m) at `x` with velocity `v` has left; `depth` is its distance to the
    /// nearest wall, m.
    ///
    /// Such a body is so far out that it would touch no body of any size at the start. It touches no wall,
    /// and moves outwards.
    fn has_left(&self, x: &Vec3, v: &Vec3, r: f64, depth: f64) -> bool {
        let free = depth - r > self.l_max;
        let out = |exit: &Exit| {
            exit.along.dot(x) > exit.started + (r + self.largest) + self.l_max && exit.along.dot(v) > 0.0
        };
        free && self.exits.iter().any(out)
    }

    /// Warnings of what the frames showed. Collective; the same on every rank.
    pub fn warnings(&self, comm: &dyn Comm) -> Vec<String> {
        let mut furthest = [self.furthest.0];
        comm.max(&mut furthest);
        let own = |mine: bool, id: u64| if mine { -(id as f64) } else { f64::NEG_INFINITY };
        let is_mine = self.furthest.0.total_cmp(&furthest[0]) == Ordering::Equal;
        let first = self.left.first().copied();
        let mut lowest = [own(is_mine, self.furthest.1), own(first.is_some(), first.unwrap_or(0))];
        comm.max(&mut lowest);
        // The rank of that particle knows the wall.
        let is_its_rank = is_mine && -(self.furthest.1 as f64) == lowest[0];
        let mut wall = [own(is_its_rank, self.furthest.2 as u64)];
        comm.max(&mut wall);
        let mut count = [self.left.len() as u64];
        comm.sum(&mut count);
        let mut warnings = Vec::new();
        if furthest[0] > 0.0 {
            warnings.push(format!(
                "warning: the centre of particle {} was {} m beyond {} at a frame: contacts are too soft for \
                 this motion; a larger contact.stiffness_exponent makes them harder",
                -lowest[0],
                rough(furthest[0]),
                self.names[-wall[0] as usize]
            ));
        }
        if count[0] > 0 {
            warnings.push(format!(
                "warning: {} particles left the open container, the first of them particle {}: they move on \
                 where no wall stands and gravity does not bring them back; a side of container.box or a \
                 container.wall there would hold them",
                count[0], -lowest[1]
            ));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    fn monitor(container: &str, gravity: &str) -> Monitor {
        let text = "t_end = 1
            particles = { radius = 0.1, mass = 1, file = 'a.csv' }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }";
        let sets = [format!("container.box={container}"), format!("gravity={gravity}")];
        let scene = Scene::parse("a.toml", text, &sets).unwrap();
        Monitor::new(
            &scene,
            &InitialCondition { x: vec![[0.5; 3], [0.5, 0.5, 0.8]], ..InitialCondition::default() },
        )
    }

    fn left(monitor: &Monitor, x: [f64; 3], v: [f64; 3]) -> bool {
        let x = Vec3::from(x);
        let depth = monitor.walls.iter().map(|wall| wall.depth(&x)).fold(f64::INFINITY, f64::min);
        monitor.has_left(&x, &v.into(), monitor.r, depth)
    }

    #[test]
    fn a_way_out_is_where_no_wall_stands_and_gravity_does_not_pull_back() {
        let exits = |container, gravity| monitor(container, gravity).exits.len();
        let chimney = "{ min = [0, 0, 0], max = [1, 1, inf] }";
        assert_eq!(exits(chimney, "[0, 0, -9.81]"), 0);
        assert_eq!(exits(chimney, "[0, 0, 0]"), 1);
        assert_eq!(exits("{ min = [0, 0, -inf], max = [1, 1, inf] }", "[0, 0, -9.81]"), 1);
        // A floor without sides: everything comes back to the floor.
        assert_eq!(exits("{ min = [-inf, -inf, 0], max = [inf, inf, inf] }", "[0, 0, -9.81]"), 0);
        let none = "{ min = [-inf, -inf, -inf], max = [inf, inf, inf] }";
        assert_eq!(exits(none, "[0, 0, -9.81]"), 0);
    }

    #[test]
    fn a_particle_has_left_when_it_is_further_out_than_anything_started_and_moves_on() {
        // The furthest start is at 0.8 m. A diameter and l_max more make 1.1 m.
        let chimney = monitor("{ min = [0, 0, 0], max = [1, 1, inf] }", "[0, 0, 0]");
        assert!(left(&chimney, [0.5, 0.5, 1.11], [0.0, 0.0, 1.0]));
        assert!(!left(&chimney, [0.5, 0.5, 1.09], [0.0, 0.0, 1.0]));
        assert!(!left(&chimney, [0.5, 0.5, 1.11], [0.0, 0.0, -1.0]));
        assert!(!left(&chimney, [0.1, 0.5, 1.11], [0.0, 0.0, 1.0]), "it touches a wall");
    }

    #[test]
    fn a_particle_of_another_size_has_left_beyond_its_own_radius_and_the_largest_one() {
        let mut chimney = monitor("{ min = [0, 0, 0], max = [1, 1, inf] }", "[0, 0, 0]");
        chimney.largest = 0.3;
        // 0.8 m at the start, 0.3 m of the largest, l_max = 0.1 m and its own radius.
        let left = |r: f64, z: f64| chimney.has_left(&Vec3::new(0.5, 0.5, z), &Vec3::z(), r, 0.5);
        assert!(left(0.02, 1.23) && !left(0.02, 1.21));
        assert!(left(0.3, 1.51) && !left(0.3, 1.49));
        // With 0.45 m it touches a wall at 0.5 m.
        assert!(!left(0.45, 9.0));
    }

    #[test]
    fn all_ranks_say_the_same_and_name_the_particle_that_was_furthest() {
        let chimney = monitor("{ min = [0, 0, 0], max = [1, 1, inf] }", "[0, 0, 0]");
        team(3, |comm| {
            let mut own = chimney.clone();
            own.furthest = [(-0.5, 3, 0), (0.02, 17, 4), (0.01, 21, 1)][comm.rank()];
            own.left = [vec![], vec![12, 13], vec![20]][comm.rank()].clone();
            let warnings = own.warnings(comm);
            assert_eq!(warnings.len(), 2, "{warnings:?}");
            assert!(warnings[0].contains("particle 17 was 0.02 m beyond the side z = 0 m"), "{warnings:?}");
            assert!(
                warnings[1].contains("3 particles left the open container, the first of them particle 12")
            );
            assert!(chimney.warnings(comm).is_empty());
        });
    }
}
