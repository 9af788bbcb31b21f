//! Whether a run can begin at an initial condition: numbers in range, distinct centres, inside all walls.

use super::file::{CENTRE, NO_ROTATION, SPIN, VELOCITY};
use super::{InitialCondition, overlaps};
use crate::error::Error;
use crate::math::digits::{short, triple};
use crate::scene::walls::described_walls;
use crate::scene::{Scene, shown};

/// Largest coordinate, in radii. A double resolves a ten-thousandth of the radius there.
const FURTHEST: f64 = 1e12;

/// Largest component of the velocity of a centre or a surface, m/s: that of light.
const FASTEST: f64 = 3e8;

/// Checks the initial condition of any source.
///
/// All numbers must be finite and within what arithmetic resolves. Angular velocities must be 0 without
/// rotation. Every centre must lie strictly inside all walls, and no two may be the same.
///
/// # Examples
///
/// ```rust
/// use demhybrid::scene::{Scene, initial_condition};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let grid = scene.particles.grid.as_ref().ok_or("there is no grid")?;
/// let mut start = initial_condition::grid(&scene, grid);
/// start.x[3][2] = -0.25;
/// let mistake = initial_condition::check(&scene, &start).unwrap_err().to_string();
/// assert!(mistake.contains("particle 3") && mistake.contains("0.25 m beyond"), "{mistake}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn check(scene: &Scene, start: &InitialCondition) -> Result<(), Error> {
    check_all_but_twins(scene, start)?;
    match overlaps::coincident(scene, &start.x) {
        None => Ok(()),
        Some([i, j]) => Err(Error::Input(format!(
            "{}: {} have the same centre, {} m, and a contact between them has no direction: all centres \
             must differ, or particles.push_apart = true parts them",
            origin(scene),
            named(scene, &[i, j]),
            triple(&start.x[i])
        ))),
    }
}

/// Checks all that [`check`] does, but for centres that are the same.
pub(super) fn check_all_but_twins(scene: &Scene, start: &InitialCondition) -> Result<(), Error> {
    let walls = described_walls(&scene.container);
    let rotates = scene.rotates();
    start.check_sizes(scene)?;
    let sizes = start.sizes(scene);
    for (id, ((x, v), omega)) in start.x.iter().zip(&start.v).zip(&start.omega).enumerate() {
        let r = sizes.as_sizes().of(id).r;
        let ranges = [
            (CENTRE, FURTHEST * r, "coordinates must be within 1e12 radii, or no contact is resolved"),
            (VELOCITY, FASTEST, "nothing is faster than light; it must be in m/s"),
            (SPIN, FASTEST / r, "no surface is faster than light; it must be in rad/s"),
        ];
        let wrong =
            |what: &str| Err(Error::Input(format!("{}: {} {what}", origin(scene), named(scene, &[id]))));
        for (vector, (columns, most, why)) in [x, v, omega].into_iter().zip(&ranges) {
            if !vector.iter().all(|number| number.is_finite()) {
                return wrong(&format!(
                    "has the {} {}: all numbers must be finite",
                    columns.name,
                    triple(vector)
                ));
            }
            if let Some(axis) = vector.iter().position(|number| number.abs() > *most) {
                let (column, value, unit) = (columns.names[axis], short(vector[axis]), columns.unit);
                return wrong(&format!(
                    "has {column} = {value} {unit}, and -{most} to {most} {unit} is possible: {why}",
                    most = short(*most)
                ));
            }
        }
        if !rotates && *omega != [0.0; 3] {
            return wrong(&format!("has the angular velocity {} rad/s, but {NO_ROTATION}", triple(omega)));
        }
        for (wall, name) in &walls {
            let beyond = -wall.depth(&(*x).into());
            if beyond >= 0.0 || beyond.is_nan() {
                let how_far = match beyond {
                    0.0 => "lies exactly on".to_owned(),
                    _ => format!("lies {} m beyond", short(beyond)),
                };
                let hint = "every centre must be strictly inside all walls";
                return wrong(&format!("at {} m {how_far} {}: {hint}", triple(x), name));
            }
        }
    }
    Ok(())
}

/// One or more particles by their ids, and by the rows of the file if they come from one.
fn named(scene: &Scene, ids: &[usize]) -> String {
    let list = |numbers: Vec<String>| numbers.join(" and ");
    let plural = if ids.len() > 1 { "s" } else { "" };
    let particles = list(ids.iter().map(ToString::to_string).collect());
    let rows = list(ids.iter().map(|id| (id + 1).to_string()).collect());
    match scene.particles.file {
        Some(_) => format!("particle{plural} {particles} (row{plural} {rows} below the first line)"),
        None => format!("particle{plural} {particles}"),
    }
}

/// The source of the initial condition, for messages.
pub(super) fn origin(scene: &Scene) -> String {
    scene.particles.read_from().map_or_else(|| scene.particles.source().to_owned(), shown)
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
        Scene::parse("a.toml", text, &sets).unwrap()
    }

    fn spheres() -> InitialCondition {
        let x = (0..4).map(|k| [0.5, 0.5, 0.2 + 0.2 * f64::from(k)]).collect();
        let still = vec![[0.0; 3]; 4];
        InitialCondition { x, v: still.clone(), omega: still, ..InitialCondition::default() }
    }

    #[test]
    fn walls_are_numbered_and_only_finite_sides_count() {
        let scene = scene(&["container.wall=[{ normal = [0, -3, -4] }]"]);
        let walls = described_walls(&scene.container);
        assert_eq!(walls.len(), 6);
        assert!(walls[3].1.contains("y = 1 m"), "{}", walls[3].1);
        assert!(walls[5].1.contains("container.wall[0]"));
        // The normal (0, -3, -4) has length 5.
        assert!((walls[5].0.depth(&[9.0, 1.0, 1.0].into()) - 1.4).abs() < 1e-15);
    }

    #[test]
    fn a_centre_outside_is_named_with_its_wall_and_distance() {
        let scene = scene(&["container.wall=[{ normal = [0, 0, 1e200], point = [0, 0, 9] }]"]);
        let mut start = spheres();
        assert_eq!(check(&scene, &start), Ok(()));
        let message = |start: &InitialCondition| check(&scene, start).unwrap_err().to_string();
        start.x[3] = [0.5, 1.25, 0.5];
        assert_eq!(
            message(&start),
            "particles.grid: particle 3 at (0.5, 1.25, 0.5) m lies 0.25 m beyond the side y = 1 m of the box \
             (container.box.max): every centre must be strictly inside all walls"
        );
        start.x[3] = [0.5, 0.5, 9.5];
        assert!(message(&start).contains("lies 0.5 m beyond container.wall[0]"), "{}", message(&start));
        start.x[3] = [0.5, 0.5, 0.0];
        assert!(message(&start).contains("lies exactly on the side z = 0 m"), "{}", message(&start));
        start.x[3] = [0.5, f64::NAN, 0.5];
        assert!(message(&start).contains("must be finite"), "{}", message(&start));
        start.x[3] = [0.4, 0.5, 0.5];
        start.omega[2] = [0.0, 0.0, 1.0];
        assert!(message(&start).contains("this scene has no rotation"), "{}", message(&start));
    }

    #[test]
    fn a_number_that_no_arithmetic_survives_is_named_with_what_is_possible() {
        let scene = scene(&["friction={ coefficient = 0.2, regularization_velocity = 0.01 }"]);
        let message = |change: &dyn Fn(&mut InitialCondition)| {
            let mut start = spheres();
            change(&mut start);
            check(&scene, &start).map_err(|why| why.to_string())
        };
        let far = message(&|start| start.x[2][2] = 1e308).unwrap_err();
        assert!(far.contains("particle 2 has z = 1e308 m, and -1e11 to 1e11 m is possible"), "{far}");
        let fast = message(&|start| start.v[1][0] = -1e9).unwrap_err();
        assert!(fast.contains("particle 1 has vx = -1e9 m/s, and -3e8 to 3e8 m/s is possible"), "{fast}");
        let spins = message(&|start| start.omega[3][1] = 1e308).unwrap_err();
        assert!(spins.contains("particle 3 has avy = 1e308 rad/s, and -3e9 to 3e9 rad/s is"), "{spins}");
        // What is told to be possible is.
        assert_eq!(message(&|start| start.x[2][2] = 1e11), Ok(()));
        assert_eq!(message(&|start| start.v[1][0] = -3e8), Ok(()));
        assert_eq!(message(&|start| start.omega[3][1] = 3e9), Ok(()));
    }

    #[test]
    fn two_spheres_in_one_place_are_named() {
        let (scene, file) = (scene(&[]), Some("start.csv".into()));
        let particles = crate::scene::Particles { grid: None, file, ..scene.particles };
        let scene = Scene { particles, ..scene };
        let mut start = spheres();
        start.x[3] = start.x[1];
        let message = check(&scene, &start).unwrap_err().to_string();
        assert!(
            message
                .contains("start.csv: particles 1 and 3 (rows 2 and 4 below the first line) have the same"),
            "{message}"
        );
    }
}
