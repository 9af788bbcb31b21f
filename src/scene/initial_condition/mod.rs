//! The initial condition: from a file, or as keys of the scene describe it; the sizes that species draw; and
//! whether it is valid.

mod check;
mod draw;
mod file;
mod header;
mod lattice;
mod materials;
mod near;
pub mod overlaps;
pub mod push_apart;
pub mod random;
pub mod room;
mod sizes;
#[cfg(test)]
mod starts_tests;

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::Error;
use crate::model::columns::{Changes, Column, Columns};
use crate::scene::{Grid, Particles, Scene, cells_along};
pub use check::check;
use check::{check_all_but_twins, origin};
pub use file::read_csv;
pub(crate) use file::{read_bytes, read_table, text_of};
use push_apart::Pushed;
pub use sizes::{OwnSizes, column, mass_of};

/// Initial state of all particles. Row `k` is the particle with id `k`. All three lists have the same length.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::initial_condition::InitialCondition;
///
/// let two = InitialCondition {
///     x: vec![[0.0, 0.0, 0.2], [0.0, 0.0, 0.5]],
///     v: vec![[0.0; 3]; 2],
///     omega: vec![[0.0; 3]; 2],
///     ..InitialCondition::default()
/// };
/// let (_, state, _) = two.rows(1..2, false);
/// assert_eq!(state, [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]); // position and velocity of particle 1
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InitialCondition {
    /// Centres, m.
    pub x: Vec<[f64; 3]>,
    /// Velocities, m/s.
    pub v: Vec<[f64; 3]>,
    /// Angular velocities, rad/s.
    pub omega: Vec<[f64; 3]>,
    /// Further columns, such as a tag of every particle: row `k` of each belongs to particle `k`.
    pub columns: Vec<(Column, Vec<f64>)>,
    /// Columns of the particle file that nobody reads: their names, as text for a warning.
    pub unread: Vec<String>,
    /// What `particles.push_apart` moved; `None` where the scene does not ask for it.
    pub pushed: Option<Pushed>,
}

impl InitialCondition {
    /// The particles with the given `ids`: their columns, rows of what moves, and rows of the columns that
    /// change only when lists are built. `rotation` tells whether rows have an angular velocity.
    pub fn rows(&self, ids: Range<u64>, rotation: bool) -> (Columns, Vec<f64>, Vec<f64>) {
        let mut columns = Columns::new(rotation);
        self.columns.iter().for_each(|(column, _)| columns.push(column.clone()));
        let (mut state, mut constants) = (Vec::new(), Vec::new());
        for i in ids.map(|id| id as usize) {
            state.extend(self.x[i]);
            state.extend(self.v[i]);
            if rotation {
                state.extend(self.omega[i]);
            }
            for (Column { width, .. }, numbers) in &self.columns {
                constants.extend(&numbers[i * width..(i + 1) * width]);
            }
        }
        (columns, state, constants)
    }

    /// Checks the further columns; an error says what is wrong and what would be right.
    pub fn check_columns(&self) -> Result<(), Error> {
        let taken = ["position", "velocity", "angular_velocity", "id"];
        for (k, (column, numbers)) in self.columns.iter().enumerate() {
            let name = &column.name;
            let refuse =
                |why: String| Err(Error::Input(format!("the column {name} of the particles: {why}")));
            let earlier = &self.columns[..k];
            if taken.contains(&&name[..]) || earlier.iter().any(|(other, _)| other.name == *name) {
                return refuse("there is one of this name; another name would do".into());
            }
            if column.changes != Changes::WithLists || column.width == 0 {
                return refuse("it must change with lists only, and have a width of 1 or more".into());
            }
            let (found, expected) = (numbers.len(), self.x.len() * column.width);
            if found != expected {
                return refuse(format!("it has {found} numbers, and {expected} would be right"));
            }
        }
        Ok(())
    }

    /// The numbers of one of the further columns for the particles with the given `ids`, row after row.
    ///
    /// # Panics
    ///
    /// Panics if there is no such column.
    pub fn numbers(&self, column: &Column, ids: Range<u64>) -> Vec<f64> {
        let found = self.columns.iter().find(|(other, _)| other.name == column.name);
        let (_, numbers) = found.expect("the particles have this column");
        numbers[ids.start as usize * column.width..ids.end as usize * column.width].to_vec()
    }
}

/// The start that keys of the scene describe, before it is checked. A pure function: it gives the same on
/// every rank.
///
/// The scene must have a seed ([`Scene::set_seed_if_missing`]). An error says what leaves no room.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::{Scene, initial_condition};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let start = initial_condition::ready(&scene, initial_condition::made(&scene)?)?;
/// assert_eq!(start.x.len(), 27);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn made(scene: &Scene) -> Result<InitialCondition, Error> {
    let Particles { grid: of_grid, random, lattice, .. } = &scene.particles;
    if let Some(of_grid) = of_grid {
        return Ok(grid(scene, of_grid));
    }
    if let Some(random) = random {
        return random::random(scene, random);
    }
    if let Some(lattice) = lattice {
        return lattice::lattice(scene, lattice);
    }
    Err(Error::Input(format!("{}: keys do not describe this start, a file holds it", origin(scene))))
}

/// The start of a scene with another seed, ready for a run. A pure function, as [`made`] is.
pub fn seeded(scene: &Scene, seed: u64) -> Result<InitialCondition, Error> {
    let mut scene = scene.clone();
    if let Some(own) = scene.particles.seed_mut() {
        *own = Some(seed);
    }
    ready(&scene, made(&scene)?)
}

/// Makes a start ready for a run: pushes spheres apart where the scene says so, and checks it. A pure
/// function, as [`made`] is.
pub fn ready(scene: &Scene, start: InitialCondition) -> Result<InitialCondition, Error> {
    let start = push_apart::pushed(scene, start)?;
    check(scene, &start)?;
    Ok(start)
}

/// The randomly perturbed grid of Fig. 4.2a, at rest. A pure function: it gives the same on every rank.
///
/// Cells are filled along x, then y, then z. The centre of a particle is that of its cell, plus a
/// random shift in `0..jitter` along each axis. Shifts are drawn in id order. Species give each its size.
///
/// The scene must have a seed ([`Scene::set_seed_if_missing`]), and a box that is finite in x and y with room
/// for a cell ([`Scene::parse`] checks that).
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::{Scene, initial_condition};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let grid = scene.particles.grid.as_ref().ok_or("there is no grid")?;
/// let start = initial_condition::grid(&scene, grid);
/// assert_eq!(start.x.len(), 27);
/// assert_eq!(start, initial_condition::grid(&scene, grid)); // the seed decides
/// initial_condition::check(&scene, &start)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn grid(scene: &Scene, grid: &Grid) -> InitialCondition {
    let sides = scene.container.r#box.as_ref();
    let corner = sides.map_or([0.0; 3], |sides| sides.min);
    let cells = |axis: usize| {
        let side = sides.map_or(f64::INFINITY, |sides| sides.max[axis] - sides.min[axis]);
        cells_along(side, grid.spacing).max(1)
    };
    let (nx, ny) = (cells(0), cells(1));
    let layer = nx.saturating_mul(ny);
    let corner = [corner[0], corner[1], grid.bottom];
    let mut random = ChaCha8Rng::seed_from_u64(grid.seed.unwrap_or(0));
    let x: Vec<_> = (0..grid.count)
        .map(|k| {
            let cell = [k % nx, (k / nx) % ny, k / layer];
            std::array::from_fn(|axis| {
                let centre = corner[axis] + (cell[axis] as f64 + 0.5) * grid.spacing;
                centre + random.random::<f64>() * grid.jitter
            })
        })
        .collect();
    let still = vec![[0.0; 3]; x.len()];
    let columns = draw::columns(scene, grid.count, grid.seed.unwrap_or(0));
    InitialCondition { x, v: still.clone(), omega: still, columns, ..InitialCondition::default() }
}

/// The speed with which the scaled norm compares errors of velocity, m/s.
///
/// It is `solver.velocity_scale` if the scene gives it. Otherwise it is the first of these that is positive
/// and finite:
///
/// - the speed after a fall from half a radius, sqrt(g r);
/// - the largest speed of a surface in the initial condition;
/// - the speed that a contact at F_0 gives, sqrt(F_0/(kappa m));
/// - 1 m/s.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::initial_condition::{InitialCondition, velocity_scale};
/// use demhybrid::scene::Scene;
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let scale = velocity_scale(&scene, &InitialCondition::default());
/// assert!((scale - (9.81f64 * 0.1).sqrt()).abs() < 1e-12); // m/s
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn velocity_scale(scene: &Scene, start: &InitialCondition) -> f64 {
    let (r, sizes) = (scene.particles.radius, start.sizes(scene));
    let length = |vector: &[f64; 3]| vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    let speeds = start.v.iter().zip(&start.omega).enumerate();
    let speeds = speeds.map(|(i, (v, omega))| length(v) + sizes.as_sizes().of(i).r * length(omega));
    let contact = &scene.contact;
    let candidates = [
        (length(&scene.gravity) * r).sqrt(),
        speeds.fold(0.0, f64::max),
        (contact.repulsion_at_contact / (contact.stiffness_exponent * scene.particles.mass)).sqrt(),
    ];
    let found = candidates.into_iter().find(|&speed| speed > 0.0 && speed.is_finite());
    scene.solver.velocity_scale.or(found).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(sets: &[&str]) -> Scene {
        let text = "t_end = 1
            particles = { radius = 0.1, mass = 1, grid = {} }
            contact = { repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }
            container.box = {}";
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let mut scene = Scene::parse("a.toml", text, &sets).unwrap();
        scene.set_seed_if_missing(1);
        scene
    }

    fn start(sets: &[&str]) -> InitialCondition {
        let scene = scene(sets);
        grid(&scene, scene.particles.grid.as_ref().unwrap())
    }

    #[test]
    fn a_grid_without_jitter_fills_x_then_y_then_z() {
        let still = start(&["particles.grid.jitter=0", "container.box.max=[0.75, 0.5, inf]"]);
        assert_eq!(still.x.len(), 200);
        assert_eq!(still.x[0], [0.125, 0.125, 1.225]);
        assert_eq!(still.x[1], [0.375, 0.125, 1.225]);
        assert_eq!(still.x[3], [0.125, 0.375, 1.225]);
        assert_eq!(still.x[6], [0.125, 0.125, 1.475]);
        assert_eq!((still.v.len(), still.omega.len()), (200, 200));
    }

    #[test]
    fn shifts_depend_on_the_seed_and_stay_within_the_jitter() {
        let (still, shifted) = (start(&["particles.grid.jitter=0"]), start(&[]));
        assert_eq!(shifted, start(&["particles.grid.seed=1"]));
        assert_ne!(shifted, start(&["particles.grid.seed=2"]));
        let mut largest: f64 = 0.0;
        for (a, b) in shifted.x.iter().flatten().zip(still.x.iter().flatten()) {
            // 1e-14 allows for two roundings near 10 m.
            assert!(a - b > -1e-14 && a - b < 0.025 + 1e-14, "{a} {b}");
            largest = largest.max(a - b);
        }
        assert!(largest > 0.0245, "{largest}");
    }

    #[test]
    fn a_seed_gives_the_same_start_for_ever() {
        // Values of rand 0.10 and rand_chacha 0.10. Other values would make every seed another initial
        // condition.
        let x = start(&[]).x;
        assert_eq!([x[0], x[199]], PINNED);
    }

    const PINNED: [[f64; 3]; 2] = [
        [0.1350621415916212, 0.12700959272324455, 1.2399140045233714],
        [0.8968053362864743, 0.39265263194975125, 4.242303981082025],
    ];

    #[test]
    fn a_side_a_rounding_error_short_of_whole_cells_still_holds_them() {
        // 0.3 / 0.1 is 2.9999999999999996.
        let x = start(&["particles.grid.spacing=0.1", "container.box.max=[0.3, 0.3, inf]"]).x;
        assert!(x[2][1] < 0.2 && x[3][1] > 0.1, "{x:?}");
    }

    #[test]
    fn layers_of_any_size_are_counted_without_overflow() {
        let x = start(&["container.box.max=[1e300, 1e300, inf]"]).x;
        assert_eq!(x.len(), 200);
    }

    #[test]
    fn columns_that_could_not_be_written_or_found_again_are_refused() {
        let refusal = |name: &str, width, changes, numbers: usize| {
            let (name, unit) = (name.to_owned(), "1".to_owned());
            let column = Column { name, width, unit, changes, in_file: true, names: Vec::new() };
            let x = vec![[0.0; 3]; 2];
            let columns = vec![(column, vec![0.5; numbers])];
            let start = InitialCondition { x, columns, ..InitialCondition::default() };
            start.check_columns().err().map(|why| why.to_string())
        };
        assert_eq!(refusal("tag", 2, Changes::WithLists, 4), None);
        for (name, width, changes, numbers, why) in [
            ("velocity", 1, Changes::WithLists, 2, "there is one of this name"),
            ("tag", 0, Changes::WithLists, 0, "a width of 1 or more"),
            ("tag", 1, Changes::EveryStage, 2, "must change with lists only"),
            ("tag", 2, Changes::WithLists, 3, "it has 3 numbers, and 4 would be right"),
        ] {
            let found = refusal(name, width, changes, numbers).unwrap();
            assert!(found.contains(why), "{found}");
        }
    }
}
