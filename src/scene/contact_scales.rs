//! Numbers of contacts that follow from what a user knows: how far a load may press into a sphere.
//!
//! The law is that of any size of sphere if lengths are counted in radii and forces in weights. So one share
//! of the radius gives all numbers of the repulsion, F(l) = F_0 exp(-kappa l), eq. (2.1):
//!
//! - F_0 is the weight of the lightest sphere, which then rests near the gap 0;
//! - kappa = ln(2 load/(1 + e^2))/(overlap r), with the load in units of F_0, so that the load presses in by
//!   that share of r; (1 + e^2)/2 is what rebound leaves of the repulsion of contacts at rest, eq. (2.4);
//! - l_max = ln(1000)/kappa, where a thousandth of F_0 is left.
//!
//! Of spheres of different sizes the one that needs the hardest contacts decides.

use super::initial_condition::InitialCondition;
use super::{Contact, Scene};
use crate::error::Error;
use crate::math::digits::{rough, short};
use crate::math::vector::{Vec3, vector};
use crate::model::effects::FrictionLaw;
use crate::model::size::{Size, Sizes};

/// The force at l_max is this share of F_0.
const LEFT_AT_CUTOFF: f64 = 1e-3;

/// The largest contact force in a bed at rest is this times its pressure times r^2, less [`LIGHTER`] weights
/// of a sphere.
///
/// Beds of 1 to 20 layers gave 3.9 to 475 weights where this gives 4 to 472: docs/decisions/053 has the
/// table. The mean force on the floor is 7 p r^2 at most, and a few contacts carry three to four times the
/// mean.
const LARGEST_IN_BED: f64 = 24.0;

/// What a sphere of the topmost layers carries less than one within a bed, in weights.
const LIGHTER: f64 = 8.0;

/// What the load is that presses contacts most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Load {
    /// The weight of the bed. The field is the weight (N) of all spheres over the area (m^2) that they cover,
    /// Pa.
    Bed(f64),
    /// A sphere that hits a wall with this speed, m/s.
    Drop(f64),
}

/// The numbers of a contact law that follow from `contact.overlap`, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactScales {
    /// Largest share of its radius by which a sphere is pressed in.
    pub overlap: f64,
    /// The load.
    pub load: Load,
    /// The force of that load on the sphere that decides, N.
    pub force: f64,
    /// That sphere.
    pub size: Size,
    /// F_0, N.
    pub repulsion_at_contact: f64,
    /// kappa, 1/m.
    pub stiffness_exponent: f64,
    /// l_max, m.
    pub interaction_distance: f64,
}

impl ContactScales {
    /// The numbers of contacts of spheres of these `sizes` that are pressed in by `overlap` at most, with the
    /// restitution `e`. `g` (m/s^2) is gravity, `pressure` (Pa) the weight of the bed over the area that it
    /// covers, `drop` (m/s) the speed of the hardest impact; either may be 0, but not both.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::model::size::Size;
    /// use demhybrid::scene::contact_scales::ContactScales;
    ///
    /// // One sphere of 1 kg: its weight is its load.
    /// let alone = |r: f64| ContactScales::new(0.01, 1.0, 9.81, [0.0, 0.0], &[Size::new(r, 1.0)]);
    /// assert_eq!(alone(0.1).repulsion_at_contact, 9.81); // N
    /// // A sphere that hits a floor with 1 m/s has 0.5 J, which the contact stores: F/kappa.
    /// let hit = ContactScales::new(0.01, 1.0, 0.0, [0.0, 1.0], &[Size::new(0.1, 1.0)]);
    /// assert!((hit.force / hit.stiffness_exponent - 0.5).abs() < 1e-9);
    /// // At that force the contact is pressed in by 0.01 r.
    /// let pressed = (hit.force / hit.repulsion_at_contact).ln() / hit.stiffness_exponent;
    /// assert!((pressed - 0.01 * 0.1).abs() < 1e-12); // m
    /// ```
    pub fn new(overlap: f64, e: f64, g: f64, [pressure, drop]: [f64; 2], sizes: &[Size]) -> Self {
        let at_rest = 0.5 * (1.0 + e * e);
        let weight = |size: &Size| if g > 0.0 { size.mass * g } else { size.mass * drop * drop * size.per_r };
        let f_0 = sizes.iter().map(weight).fold(f64::INFINITY, f64::min);
        let bed = |size: &Size| {
            let weight = size.mass * g;
            let force = LARGEST_IN_BED * pressure * size.r * size.r - LIGHTER * weight;
            let force = force.max(weight);
            let kappa = (force / (at_rest * f_0)).ln() / (overlap * size.r);
            (Load::Bed(pressure), force, kappa)
        };
        let impact = |size: &Size| {
            // m v^2/2 = F/kappa: the repulsion at the turning point has all of the energy.
            let energy = 0.5 * size.mass * drop * drop;
            let kappa = |force: f64| (force / f_0).ln() / (overlap * size.r);
            let mut force = 10.0 * f_0;
            // F = energy kappa(F) has one solution above e F_0, and this map contracts there.
            for _ in 0..200 {
                force = (energy * kappa(force)).max(std::f64::consts::E * f_0);
            }
            (Load::Drop(drop), force, kappa(force))
        };
        let loads = sizes.iter().flat_map(|size| {
            let both = [(g > 0.0).then(|| bed(size)), (drop > 0.0).then(|| impact(size))];
            both.into_iter().flatten().map(|(load, force, kappa)| (load, force, kappa, *size))
        });
        let worst = loads.max_by(|a, b| a.2.total_cmp(&b.2));
        let (load, force, kappa, size) = worst.expect("there are spheres and a load");
        ContactScales {
            overlap,
            load,
            force,
            size,
            repulsion_at_contact: f_0,
            stiffness_exponent: kappa,
            interaction_distance: -LEFT_AT_CUTOFF.ln() / kappa,
        }
    }

    /// The numbers with their reasons, as lines of text.
    pub fn explain(&self) -> Vec<String> {
        let Self { overlap, load, force, size, repulsion_at_contact: f_0, .. } = *self;
        let load = match load {
            Load::Bed(pressure) => format!("the bed, {} Pa on its floor,", rough(pressure)),
            Load::Drop(speed) => format!("an impact at {} m/s", short(speed)),
        };
        let [glass, steel] = [GLASS, STEEL].map(|modulus| rough(hertz(force, &size, modulus)));
        vec![
            format!(
                "contact.overlap = {}: {load} presses a sphere of {} m with up to {} N, {} times F_0",
                short(overlap),
                rough(size.r),
                rough(force),
                rough(force / f_0)
            ),
            format!("repulsion_at_contact = {} N, the weight of the lightest sphere", rough(f_0)),
            format!(
                "stiffness_exponent = {} 1/m, so that this force presses it in by {} of its radius",
                rough(self.stiffness_exponent),
                short(overlap)
            ),
            format!(
                "interaction_distance = {} m, where a thousandth of F_0 is left",
                rough(self.interaction_distance)
            ),
            format!(
                "a glass sphere of that size would be pressed in by {glass} of its radius, one of steel by \
                 {steel}"
            ),
            "half the overlap takes about 1.5 times as many right-hand sides".to_owned(),
        ]
    }
}

/// Young's modulus over 1 - nu^2 of window glass, Pa.
const GLASS: f64 = 70e9 / (1.0 - 0.22 * 0.22);

/// The same of steel, Pa.
const STEEL: f64 = 210e9 / (1.0 - 0.3 * 0.3);

/// The share of the radius by which a force (N) presses two spheres of this size into each other, by Hertz: F
/// = 4/3 E* sqrt(R) d^(3/2), with R = r/2 and E* = `modulus`/2 (Pa).
fn hertz(force: f64, size: &Size, modulus: f64) -> f64 {
    let stiffness = 4.0 / 3.0 * 0.5 * modulus * (0.5 * size.r).sqrt();
    (force / stiffness).powf(2.0 / 3.0) / size.r
}

/// The area (m^2) that spheres cover, seen along `gravity`: that of the smallest box around them with sides
/// along two directions across it.
fn covered(start: &InitialCondition, radius: impl Fn(usize) -> f64, gravity: Vec3) -> f64 {
    let down = gravity.normalize();
    // The axis that gravity is least along, made perpendicular to it.
    let axis = (0..3).min_by(|&a, &b| down[a].abs().total_cmp(&down[b].abs())).unwrap_or(0);
    let across = Vec3::from_fn(|k, _| f64::from(u8::from(k == axis)));
    let first = (across - down * down.dot(&across)).normalize();
    let length = |direction: &Vec3| {
        let ends = start.x.iter().enumerate().map(|(i, x)| (direction.dot(&vector(x)), radius(i)));
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (x, r)| {
            [low.min(x - r), high.max(x + r)]
        });
        high - low
    };
    length(&first) * length(&down.cross(&first))
}

impl Scene {
    /// Turns `contact.overlap` into the numbers of the contact law, for the spheres of `start`. Without that
    /// key it changes nothing.
    ///
    /// Whoever makes a start without [`crate::engine::load::load`] calls it before a run.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::{Scene, initial_condition};
    ///
    /// let text = "t_end = 1
    ///     gravity = [0, 0, -9.81]
    ///     particles = { radius = 1e-3, density = 2500, grid = { count = 100 } }
    ///     container.box = {}
    ///     contact = { overlap = 0.05, restitution = 0.5 }";
    /// let mut scene = Scene::parse("beads.toml", text, &[])?;
    /// let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().ok_or("no grid")?);
    /// scene.settle_contacts(&start)?;
    /// assert!((scene.contact.repulsion_at_contact / 1.027e-4 - 1.0).abs() < 1e-3); // N, the weight
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn settle_contacts(&mut self, start: &InitialCondition) -> Result<(), Error> {
        let Some(overlap) = self.contact.overlap else { return Ok(()) };
        let (gravity, drop) = (vector(&self.gravity), self.contact.drop.unwrap_or(0.0));
        let (g, sizes) = (gravity.norm(), start.sizes(self));
        let of = |i: usize| sizes.as_sizes().of(i);
        let count = start.x.len();
        let area = || self.filled().unwrap_or_else(|| covered(start, |i| of(i).r, gravity));
        let pressure = if g > 0.0 { (0..count).map(|i| of(i).mass).sum::<f64>() * g / area() } else { 0.0 };
        // One of each size is enough where all are alike.
        let different = if matches!(sizes.as_sizes(), Sizes::Each(_)) { count } else { 1 };
        let sizes: Vec<Size> = (0..different).map(of).collect();
        let e = self.least_restitution();
        let scales = ContactScales::new(overlap, e, g, [pressure, drop], &sizes);
        let found = [scales.repulsion_at_contact, scales.stiffness_exponent, scales.interaction_distance];
        if !found.iter().all(|number| number.is_normal() && *number > 0.0) {
            return Err(Error::Input(format!(
                "contact.overlap = {}: it would need F_0 = {:e} N, kappa = {:e} 1/m and l_max = {:e} m, \
                 which no arithmetic survives; give these numbers as contact.repulsion_at_contact, \
                 stiffness_exponent and interaction_distance",
                short(overlap),
                found[0],
                found[1],
                found[2]
            )));
        }
        let Contact { repulsion_at_contact, stiffness_exponent, interaction_distance, .. } =
            &mut self.contact;
        [*repulsion_at_contact, *stiffness_exponent, *interaction_distance] = found;
        // From now on the numbers say it: the recorded scene has them, whatever becomes of the start.
        (self.contact.overlap, self.contact.drop) = (None, None);
        self.scales = Some(scales);
        Ok(())
    }

    /// The area (m^2) across gravity of the box, or of the region in it, that a start which keys describe
    /// fills: the same with any seed. `None` for starts from files, for a box that is open there, and for
    /// gravity that is oblique to it.
    fn filled(&self) -> Option<f64> {
        self.particles.count()?;
        let sides = self.container.r#box.as_ref()?;
        let region = self.particles.random.as_ref().and_then(|random| random.region.as_ref());
        let across: Vec<usize> = (0..3).filter(|&axis| self.gravity[axis] == 0.0).collect();
        let [a, b] = across[..] else { return None };
        let length = |axis: usize| {
            let (low, high) = (sides.min[axis], sides.max[axis]);
            let within =
                region.map_or((low, high), |region| (low.max(region.min[axis]), high.min(region.max[axis])));
            within.1 - within.0
        };
        Some(length(a) * length(b)).filter(|area| area.is_finite())
    }

    /// The typical speed of the scene, m/s: sqrt(g r), or that of `contact.drop`; `None` without both.
    fn typical_speed(&self) -> Option<f64> {
        let fall = (vector(&self.gravity).norm() * self.particles.radius).sqrt();
        Some(fall).filter(|speed| *speed > 0.0 && speed.is_finite()).or(self.contact.drop)
    }

    /// Speeds of the laws that are left out follow from the typical speed: psi = 10/v, v_min = 0.01 v.
    pub(super) fn fill_in_speeds(&mut self) {
        let Some(speed) = self.typical_speed() else { return };
        if self.contact.dissipation_focusing.is_nan() {
            self.contact.dissipation_focusing = 10.0 / speed;
        }
        if let Some(friction) =
            self.friction.as_mut().filter(|friction| friction.law == FrictionLaw::Regularized)
        {
            friction.regularization_velocity.get_or_insert(0.01 * speed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::contact::Law;
    use crate::scene::effects;
    use crate::scene::initial_condition;

    /// The law of spheres of 1 mm and 2.5 g/cm^3 with `contact.overlap = 0.03`, and the sphere's weight, N.
    fn settled(sets: &[&str]) -> (Scene, f64) {
        let text = "t_end = 1
            gravity = [0, 0, -9.81]
            particles = { radius = 1e-3, density = 2500, grid = { count = 100 } }
            container.box = { max = [0.01, 0.01, inf] }
            contact = { overlap = 0.03, restitution = 0.5 }";
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let mut scene = Scene::parse("beads.toml", text, &sets).unwrap();
        let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().unwrap());
        scene.settle_contacts(&start).unwrap();
        let weight = scene.particles.mass * vector(&scene.gravity).norm();
        (scene, weight)
    }

    /// The force of a contact at rest that is pressed in by a share of the radius, N.
    fn at_rest(scene: &Scene, share: f64) -> f64 {
        let Law { parameters, .. } = effects::normal_law(scene);
        let e = scene.contact.restitution;
        0.5 * (1.0 + e * e) * parameters.f_0 * (parameters.kappa * share * parameters.r).exp()
    }

    #[test]
    fn the_load_presses_in_by_what_was_asked() {
        let (scene, weight) = settled(&[]);
        let scales = scene.scales.unwrap();
        let Load::Bed(pressure) = scales.load else { panic!("{scales:?}") };
        // 100 spheres over the floor of the box, whatever the seed is.
        assert!((pressure * 1e-4 / (100.0 * weight) - 1.0).abs() < 1e-12, "{pressure}");
        assert_eq!(settled(&["particles.grid.seed=2"]).0.contact, scene.contact);
        let expected = 24.0 * pressure * 1e-6 - 8.0 * weight;
        assert!((scales.force / expected - 1.0).abs() < 1e-12);
        assert!((at_rest(&scene, 0.03) / expected - 1.0).abs() < 1e-9);
        // Gravity may point anywhere.
        let (turned, _) = settled(&["gravity=[0, 0, 9.81]"]);
        assert_eq!(turned.contact, scene.contact);
        // A single sphere is pressed by its own weight.
        let (alone, weight) = settled(&["particles.grid.count=1"]);
        assert!((at_rest(&alone, 0.03) / weight - 1.0).abs() < 1e-9);
    }

    #[test]
    fn spheres_of_a_file_cover_the_smallest_box_across_gravity() {
        // Four at the corners of a square in the plane x = y, which gravity is perpendicular to.
        let along = Vec3::new(1.0, -1.0, 0.0).normalize();
        let x =
            [[0.0, 0.0], [0.3, 0.0], [0.0, 0.4], [0.3, 0.4]].map(|[s, z]| (along * s + Vec3::z() * z).into());
        let start = InitialCondition { x: x.to_vec(), ..InitialCondition::default() };
        let area = covered(&start, |_| 0.1, Vec3::new(-2.0, -2.0, 0.0));
        assert!((area - 0.5 * 0.6).abs() < 1e-12, "{area}");
    }

    #[test]
    fn a_hard_impact_asks_for_more_than_the_bed_and_a_soft_one_does_not() {
        let (bed, _) = settled(&[]);
        let (soft, _) = settled(&["contact.drop=1e-3"]);
        assert_eq!(soft.contact, bed.contact);
        let (hard, _) = settled(&["contact.drop=1.0"]);
        assert!(hard.contact.stiffness_exponent > 1.5 * bed.contact.stiffness_exponent);
        assert_eq!(hard.scales.unwrap().load, Load::Drop(1.0));
        // Without gravity an impact alone decides, and the law is that of any speed.
        let weightless = |speed: &str| settled(&["gravity=[0, 0, 0]", speed]).0.contact;
        let [slow, fast] = [weightless("contact.drop=0.1"), weightless("contact.drop=10")];
        assert!((slow.stiffness_exponent / fast.stiffness_exponent - 1.0).abs() < 1e-12);
        assert!((fast.repulsion_at_contact / slow.repulsion_at_contact - 1e4).abs() < 1e-8);
        assert!((slow.dissipation_focusing - 100.0).abs() < 1e-9); // 10/v, s/m
    }

    #[test]
    fn of_unequal_spheres_each_is_pressed_in_by_no_more_than_was_asked() {
        let density = 2500.0;
        let size = |r: f64| Size::new(r, initial_condition::mass_of(r, density));
        let sizes = [size(1e-4), size(1e-3), size(2e-3)];
        let pressure = 500.0; // Pa
        let scales = ContactScales::new(0.05, 0.5, 9.81, [pressure, 0.0], &sizes);
        assert!((scales.repulsion_at_contact / (sizes[0].mass * 9.81) - 1.0).abs() < 1e-12);
        for size in sizes {
            let force = (24.0 * pressure * size.r * size.r - 8.0 * size.mass * 9.81).max(size.mass * 9.81);
            let pressed = (force / (0.625 * scales.repulsion_at_contact)).ln() / scales.stiffness_exponent;
            assert!(pressed <= 0.05 * size.r * (1.0 + 1e-12), "{}: {pressed}", size.r);
        }
    }

    #[test]
    fn glass_beads_are_pressed_in_by_what_hertz_says() {
        // 1 N on beads of 5 mm: d^3 = (3 F/(4 E*))^2/R, with E* = 36.8 GPa and R = 2.5 mm.
        let bead = Size::new(5e-3, 1.0);
        assert!((hertz(1.0, &bead, GLASS) * 5e-3 / 5.4994e-7 - 1.0).abs() < 1e-4);
    }
}
