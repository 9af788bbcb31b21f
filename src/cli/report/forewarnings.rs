//! Warnings that can be given before a run, by the run and by the dry run alike. What they advise silences
//! them.

use crate::engine::simulation::{friction_tolerance, pressed, tightening};
use crate::error::Error;
use crate::math::digits::{at_least, at_most, rough, short};
use crate::math::vector::Vec3;
use crate::model::effects::FrictionLaw;
use crate::model::size::{Size, Sizes};
use crate::model::wall::Wall;
use crate::ode::NormName;
use crate::scene::initial_condition::overlaps::{DEEP, Overlaps, Partner, overlaps};
use crate::scene::initial_condition::{self, InitialCondition};
use crate::scene::stop::Rest;
use crate::scene::walls::described_walls;
use crate::scene::{DEFAULT_TOLERANCE, Grid, Scene, effects, shown};

/// Warnings about a scene and its particles that can be given before a run. The dry run gives the same.
pub fn forewarnings(scene: &Scene, start: &InitialCondition) -> Vec<String> {
    let mut warnings = double_wall_warnings(scene);
    warnings.extend(unused_key_warnings(scene));
    warnings.extend(unread_column_warning(scene, start));
    warnings.extend(cut_force_warning(scene, start));
    warnings.extend(soft_contact_warning(scene, start));
    warnings.extend(hovering_warning(scene, start));
    warnings.extend(overlap_warning(scene, start));
    warnings.extend(wall_barrier_warning(scene, start));
    warnings.extend(pair_barrier_warning(scene, start));
    warnings.extend(loose_tolerance_warning(scene, start).or_else(|| shivering_warning(scene, start)));
    warnings.extend(long_min_step_warning(scene, start));
    warnings.extend(long_window_warning(scene, start));
    warnings
}

/// Most names of columns in a warning.
const MOST_NAMES: usize = 8;

/// Tells which columns of the particle file nobody reads.
fn unread_column_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let (file, unread) = (scene.particles.file.as_ref()?, &start.unread);
    let more = match unread.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let names = unread.iter().take(MOST_NAMES).map(String::as_str).collect::<Vec<_>>().join(", ");
    let columns = if unread.len() == 1 { "column" } else { "columns" };
    (!unread.is_empty()).then(|| {
        format!(
            "warning: {}: nobody reads the {columns} {names}{more}: particles.file takes x,y,z, vx,vy,vz, \
             avx,avy,avz, radius, mass or density, and species",
            shown(file)
        )
    })
}

/// Tells which keys of [friction] the law of friction does not use.
fn unused_key_warnings(scene: &Scene) -> Vec<String> {
    let Some(friction) = &scene.friction else { return Vec::new() };
    let given = |unused: &[(&str, Option<f64>)], law: &str| {
        let given = unused.iter().filter_map(|&(key, value)| Some((key, value?)));
        let warning = |(key, value)| {
            let value = short(value);
            format!("warning: friction.{key} = {value} is not used by friction.law = \"{law}\": leave it out")
        };
        given.map(warning).collect()
    };
    match friction.law {
        FrictionLaw::History => {
            given(&[("regularization_velocity", friction.regularization_velocity)], "history")
        }
        FrictionLaw::Regularized => {
            let unused = [("stiffness_ratio", friction.stiffness_ratio), ("damping", friction.damping)];
            given(&unused, "regularized")
        }
    }
}

/// Size of the acceleration of gravity, m/s^2.
fn gravity(scene: &Scene) -> f64 {
    scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt()
}

/// Warns if `l_max` cuts off a force that is not small, and names an `l_max` that is large enough.
///
/// Where sizes differ, the lightest particle says what is small.
fn cut_force_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let contact = &scene.contact;
    let (mass, whose) = match start.sizes(scene).as_sizes() {
        Sizes::Equal(size) => (size.mass, "the weight of a particle"),
        Sizes::Each(sizes) => {
            let least = sizes.iter().map(|size| size.mass).fold(f64::INFINITY, f64::min);
            (least, "the weight of the lightest particle")
        }
    };
    let weight = mass * gravity(scene);
    let (scale, name) = if weight > 0.0 { (weight, whose) } else { (contact.repulsion_at_contact, "F_0") };
    let cut =
        contact.repulsion_at_contact * (-contact.stiffness_exponent * contact.interaction_distance).exp();
    let enough = (contact.repulsion_at_contact / (1e-3 * scale)).ln() / contact.stiffness_exponent;
    (contact.interaction_distance < enough).then(|| {
        format!(
            "warning: contact.interaction_distance = {} m cuts off a force of {} N, which is {} of {name}: \
             step control and energy will suffer; {} m or more would do",
            short(contact.interaction_distance),
            rough(cut),
            rough(cut / scale),
            short(at_least(enough))
        )
    })
}

/// Warns if the weight of a single sphere presses it deep into a floor on which it rests.
///
/// There F(l) (1 + e^2)/2 = m g, by eqs. (2.1) and (2.4). Where sizes differ, it is about the sphere that
/// needs the hardest contacts.
fn soft_contact_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let contact = &scene.contact;
    let at_rest = 0.5 * (1.0 + scene.least_restitution().powi(2)) * contact.repulsion_at_contact;
    let e_folds = |size: &Size| (size.mass * gravity(scene) / at_rest).ln();
    let enough = |size: &Size| e_folds(size) / (DEEP * size.r);
    let (size, sphere, radius) = match start.sizes(scene).as_sizes() {
        Sizes::Equal(size) => {
            (size, format!("a sphere of particles.mass = {} kg", short(size.mass)), "the radius")
        }
        Sizes::Each(sizes) => {
            let worst = (0..sizes.len()).max_by(|&i, &j| enough(&sizes[i]).total_cmp(&enough(&sizes[j])))?;
            let mass = short(sizes[worst].mass);
            (sizes[worst], format!("particle {worst} of {mass} kg"), "its radius")
        }
    };
    let overlap = e_folds(&size) / contact.stiffness_exponent;
    (contact.stiffness_exponent < enough(&size)).then(|| {
        format!(
            "warning: contacts are soft: {sphere} at rest on a floor overlaps it by {} m, {} of {radius}; \
             contact.stiffness_exponent = {} 1/m or more would do",
            rough(overlap),
            rough(overlap / size.r),
            short(at_least(enough(&size)))
        )
    })
}

/// Warns if a sphere at rest keeps a floor far away, because F_0 is far above its weight.
///
/// It rests where F(l) (1 + e^2)/2 = m g. Where sizes differ, it is about the sphere that is furthest,
/// counted in its own radii.
fn hovering_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let contact = &scene.contact;
    let at_rest = 0.5 * (1.0 + contact.restitution.powi(2)) * contact.repulsion_at_contact;
    let gap = |size: &Size| (at_rest / (size.mass * gravity(scene))).ln() / contact.stiffness_exponent;
    let (size, sphere) = match start.sizes(scene).as_sizes() {
        Sizes::Equal(size) => (size, format!("a sphere of particles.mass = {} kg", short(size.mass))),
        Sizes::Each(sizes) => {
            let share = |i: usize| gap(&sizes[i]) / sizes[i].r;
            let worst = (0..sizes.len()).max_by(|&i, &j| share(i).total_cmp(&share(j)))?;
            (sizes[worst], format!("particle {worst} of {} kg", short(sizes[worst].mass)))
        }
    };
    // Beyond l_max nothing pushes.
    let gap = gap(&size).min(contact.interaction_distance);
    let weight = size.mass * gravity(scene);
    let enough =
        contact.repulsion_at_contact * weight / at_rest * (DEEP * size.r * contact.stiffness_exponent).exp();
    (gap > DEEP * size.r && weight > 0.0).then(|| {
        format!(
            "warning: light spheres hover: {sphere} at rest stays {} m above a floor, {} of its radius, \
             since F_0 is {} times its weight; contact.repulsion_at_contact = {} N or less would do, or \
             contact.overlap in place of F_0, kappa and l_max",
            rough(gap),
            rough(gap / size.r),
            rough(contact.repulsion_at_contact / weight),
            short(at_most(enough))
        )
    })
}

/// Warns of every two walls in the same plane: each of them pushes and rubs.
fn double_wall_warnings(scene: &Scene) -> Vec<String> {
    let walls = described_walls(&scene.container);
    let mut warnings = Vec::new();
    for (k, (b, second)) in walls.iter().enumerate() {
        // Equal except for rounding. The limit is far below any length that matters.
        let same = walls[..k].iter().find(|(a, _)| (a.normal - b.normal).norm() < 1e-12 && a.coincides(b));
        warnings.extend(same.map(|(_, first)| {
            format!("warning: {second} is the same plane as {first}: its force counts twice; leave one out")
        }));
    }
    warnings
}

/// Warns if spheres overlap so deeply at the start that they fly apart.
fn overlap_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let Overlaps { deepest, between: (i, partner), r, deep } = overlaps(scene, start)?;
    let (sizes, min_step) = (start.sizes(scene), scene.solver.min_step);
    let mass = match partner {
        Partner::Sphere(j) => sizes.as_sizes().of(i).mass.min(sizes.as_sizes().of(j).mass),
        Partner::Wall(_) => sizes.as_sizes().of(i).mass,
    };
    let pressed = pressed(effects::law(scene), mass, deepest, min_step, 0.0);
    let (mut enough, mut why) = (DEEP * r, "they will fly apart".to_owned());
    if let (Some(Error::Pressed { enough: less, .. }), None) = (pressed, scene.solver.step) {
        enough = enough.min(less);
        why = format!("no step from solver.min_step = {} s on can follow that", short(min_step));
    } else if deep == 0 {
        return None;
    }
    let walls = described_walls(&scene.container);
    let (between, wall) = match partner {
        Partner::Sphere(j) => (format!("particles {i} and {j}"), None),
        Partner::Wall(k) => (format!("particle {i} and {}", walls[k].1), Some(&walls[k].0)),
    };
    let others =
        if deep > 1 { format!(", {deep} overlaps are deeper than {DEEP} of it") } else { String::new() };
    let source = scene.particles.source();
    let advice = match &scene.particles.grid {
        Some(grid) => grid_advice(grid, sizes.largest(), deepest, wall),
        None => format!("overlaps of {} m or less in {source} would do", short(at_most(enough))),
    };
    Some(format!(
        "warning: at the start spheres overlap each other or a wall by up to {} m, {} of the radius \
         ({between}{others}): {why}; {advice}, and particles.push_apart = \
         true parts them",
        rough(deepest),
        rough(deepest / r)
    ))
}

/// What would keep the spheres of a grid, of radius `r` (m) at most, apart, and away from `wall` where that
/// is overlapped most, by `deepest` (m).
fn grid_advice(grid: &Grid, r: f64, deepest: f64, wall: Option<&Wall>) -> String {
    let mut advice = Vec::new();
    let spacing = 2.0 * r + grid.jitter;
    if grid.spacing < spacing {
        advice.push(format!("particles.grid.spacing = {} m or more", short(at_least(spacing))));
    }
    match wall.map(|wall| wall.normal.z) {
        // Cells that are raised leave the wall.
        Some(down) if down < -1e-3 => {
            let bottom = at_least(grid.bottom + deepest / -down);
            advice.push(format!("particles.grid.bottom = {} m or more", short(bottom)));
        }
        Some(_) if advice.is_empty() => {
            advice.push("a container with more room for particles.grid".to_owned())
        }
        _ => {}
    }
    format!("{} would do", advice.join(" and "))
}

/// Energy (J) that it takes to push two bodies `depth` (m) closer together than touching.
///
/// With `depth` = r the centre of a sphere is in the plane of a wall. With `depth` = 2 r the centres of a
/// pair coincide. The cut at l_max is neglected.
fn barrier(scene: &Scene, kappa: f64, depth: f64) -> f64 {
    scene.contact.repulsion_at_contact / kappa * (kappa * depth).exp()
}

/// A kappa (1/m) above the scene's for which the barrier is `energy` (J) or more, in three digits.
fn kappa_that_would_do(scene: &Scene, depth: f64, energy: f64) -> f64 {
    // From kappa = 1/depth on, the barrier grows with kappa.
    let mut low = scene.contact.stiffness_exponent.max(1.0 / depth);
    let mut high = low;
    while barrier(scene, high, depth) < energy {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if barrier(scene, middle, depth) < energy { low = middle } else { high = middle }
    }
    at_least(high)
}

/// Squared speed (m^2/s^2) with which a body arrives at a plane under gravity alone; none if it never does.
///
/// `v` is the velocity of the body (m/s), `n` the normal of the plane, away from the body. `depth` is the
/// distance of the body from the plane (m).
fn arrival(scene: &Scene, v: &[f64; 3], n: &[f64; 3], depth: f64) -> Option<f64> {
    let along = |a: &[f64; 3]| a.iter().zip(n).map(|(a, n)| a * n).sum::<f64>();
    let (v_n, g_n) = (along(v), along(&scene.gravity));
    let squared = v_n * v_n + 2.0 * g_n * depth;
    ((v_n > 0.0 || g_n > 0.0) && squared > 0.0).then_some(squared)
}

/// Warns if a single sphere can arrive at a wall with more energy than the barrier of the wall.
///
/// Its centre then goes beyond the plane. The force keeps growing there, so that the sphere comes back.
fn wall_barrier_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let walls = described_walls(&scene.container);
    let sizes = start.sizes(scene);
    let kappa = scene.contact.stiffness_exponent;
    // The energy over the barrier, of which the largest is the worst.
    let mut worst = (0.0, 0.0, 0, "");
    for (i, (x, v)) in start.x.iter().zip(&start.v).enumerate() {
        let size = sizes.as_sizes().of(i);
        for (wall, name) in &walls {
            let depth = wall.depth(&Vec3::from(*x));
            if let Some(squared) = arrival(scene, v, &wall.normal.into(), depth) {
                let energy = 0.5 * size.mass * squared;
                let share = energy / barrier(scene, kappa, size.r);
                if share > worst.0 {
                    worst = (share, energy, i, name);
                }
            }
        }
    }
    let (_, energy, i, name) = worst;
    let r = if start.x.is_empty() { scene.particles.radius } else { sizes.as_sizes().of(i).r };
    let barrier = barrier(scene, kappa, r);
    (barrier < energy).then(|| {
        format!(
            "warning: particle {i} can meet {name} with {} J, and the barrier (F_0/kappa) e^(kappa r) of a \
             wall is {} J: centres will go beyond it and come back; contact.stiffness_exponent = {} 1/m or \
             more would do",
            rough(energy),
            rough(barrier),
            short(kappa_that_would_do(scene, r, energy))
        )
    })
}

/// Warns if two spheres can meet with more energy than their barrier. They then pass through each other.
///
/// The closing speed is the largest difference between velocities at the start, or the largest speed of a
/// fall onto a sphere at rest, whichever is larger.
fn pair_barrier_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    if start.x.len() < 2 {
        return None;
    }
    let walls = described_walls(&scene.container);
    let square = |v: &[f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
    let falls = start.x.iter().zip(&start.v).map(|(x, v)| {
        let gains = walls.iter().map(|(wall, _)| {
            let g_n = wall.normal.dot(&Vec3::from(scene.gravity));
            2.0 * g_n * wall.depth(&Vec3::from(*x))
        });
        square(v) + gains.fold(0.0, f64::max)
    });
    let range = |axis: usize| {
        let (low, high) = start
            .v
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v[axis]), high.max(v[axis])));
        high - low
    };
    let squared = falls.fold(square(&[range(0), range(1), range(2)]), f64::max);
    // The reduced mass of equal spheres is half the mass of one. Where sizes differ, it is about two of the
    // size whose energy is the largest share of its barrier.
    let sizes = start.sizes(scene);
    let share = |size: &Size| {
        size.mass / barrier(scene, scene.contact.stiffness_exponent, 2.0 * size.r).max(f64::MIN_POSITIVE)
    };
    let worst = (0..start.x.len()).map(|i| sizes.as_sizes().of(i));
    let worst = worst.max_by(|a, b| share(a).total_cmp(&share(b))).expect("there are two particles");
    let energy = 0.25 * worst.mass * squared;
    let depth = 2.0 * worst.r;
    let barrier = barrier(scene, scene.contact.stiffness_exponent, depth);
    (barrier < energy).then(|| {
        format!(
            "warning: two particles can meet at {} m/s, with {} J, and the barrier (F_0/kappa) e^(2 kappa r) \
             of a pair is {} J: they will pass through each other; contact.stiffness_exponent = {} 1/m or \
             more would do",
            rough(squared.sqrt()),
            rough(energy),
            rough(barrier),
            short(kappa_that_would_do(scene, depth, energy))
        )
    })
}

/// Warns if the tolerance allows a single step to be entirely wrong.
///
/// In the scaled norm this is an error of sqrt(r/kappa), at most r, or of the velocity scale v. In the
/// paper's norm it is kappa v^2, the acceleration of a contact at that speed.
pub(super) fn loose_tolerance_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let tolerance = scene.solver.tolerance.filter(|_| scene.solver.step.is_none())?;
    let v = initial_condition::velocity_scale(scene, start);
    let (most, wrong) = if scene.solver.norm == NormName::Paper {
        let most = scene.contact.stiffness_exponent * v * v;
        (most, format!("{} m/s^2, the acceleration of a contact", rough(most)))
    } else {
        let r = scene.particles.radius;
        let way = (r / scene.contact.stiffness_exponent).sqrt().min(r);
        (1.0, format!("{} m or {} m/s", rough(way), rough(v)))
    };
    (tolerance * tightening(scene) >= most).then(|| {
        format!(
            "warning: solver.tolerance = {} does not control the step: it accepts steps that are wrong by \
             {wrong}; only how far a particle may move in a step does, and contacts may create energy; {} or \
             less would do",
            short(tolerance),
            short(at_most(DEFAULT_TOLERANCE.min(0.1 * most / tightening(scene))))
        )
    })
}

/// Warns if the run is over before particles can have been at rest for long enough.
fn long_window_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let window = Rest::of(scene, initial_condition::velocity_scale(scene, start))?.window;
    (window >= scene.t_end).then(|| {
        format!(
            "warning: [stop] cannot end the run: its window of {} s (stop.window) is not shorter than \
             t_end = {} s; a window of a tenth of that would do",
            rough(window),
            short(scene.t_end)
        )
    })
}

/// Warns if the tolerance of the scene is too loose for the brake of its friction.
fn shivering_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let tolerance = scene.solver.tolerance.filter(|_| scene.solver.step.is_none())?;
    let v_min = scene.friction.as_ref()?.regularization_velocity?;
    let scale = initial_condition::velocity_scale(scene, start);
    let enough = friction_tolerance(scene, scale, start.x.len() as u64);
    (tolerance > enough).then(|| {
        format!(
            "warning: solver.tolerance = {} allows errors of {} m/s a step, {} times \
             friction.regularization_velocity: what should creep may shiver, and slide or sink many times \
             too fast; {} or less would do, or leave it out",
            short(tolerance),
            rough(tolerance * scale),
            rough(tolerance * scale / v_min),
            short(at_most(enough))
        )
    })
}

/// The smallest step must be shorter than this share of the time in which the force of a contact changes
/// e-fold.
const SHORT_STEP: f64 = 1e-3;

/// Warns if the smallest step is too long for contacts: those of small and hard spheres are over soon.
///
/// At the velocity scale v a contact opens or closes by 1/kappa within 1/(kappa v).
fn long_min_step_warning(scene: &Scene, start: &InitialCondition) -> Option<String> {
    let min_step = scene.solver.min_step;
    let v = initial_condition::velocity_scale(scene, start);
    let time = 1.0 / (scene.contact.stiffness_exponent * v);
    (scene.solver.step.is_none() && min_step > SHORT_STEP * time).then(|| {
        format!(
            "warning: solver.min_step = {} s is long for contacts whose force changes e-fold within {} s, \
             1/(kappa v) at v = {} m/s: steps will be accepted in spite of their error; {} s or less would \
             do",
            short(min_step),
            rough(time),
            rough(v),
            short(at_most(SHORT_STEP * time))
        )
    })
}

#[cfg(test)]
#[path = "forewarnings_tests.rs"]
mod tests;
