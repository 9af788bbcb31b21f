//! Friction with memory: every contact knows how far its surfaces have been sheared elastically.
//!
//! It is the element of [`crate::model::dahl`] in three dimensions.
//!
//! # State
//!
//! The memory of a contact is a vector p without unit in the contact plane. With
//!
//! - s = exp(-kappa l/2), so that the repulsion is F = F_0 s^2,
//! - x_m = mu rho(0)/(c kappa), the shear at full friction (m),
//!
//! the elastic shear is x_m p/s. Surfaces stick while |p| is below s, and |p| never exceeds s.
//!
//! The tangential stiffness is c times the normal one: k_t = c kappa F. So the elastic force is L_0 s p with
//! L_0 = mu rho(0) F_0, and the stored energy is L_0 x_m |p|^2/2 at any gap. That is why p, and not the
//! shear, is the state: no coefficient of the energy changes while the spheres move.
//!
//! # Equations
//!
//! t is the slip with the lever a: a = r + l/2 for a pair, r + l for a wall. l' is the rate of the gap.
//! [`crate::model::size`] has the levers and masses of unequal spheres.
//!
//! p' = s t/x_m - g max(0, s t.p/x_m + kappa l'/2 |p|^2) p/|p|^2 - (p.n') n + (w_n.n) n x p
//!
//! F_fr = -L_0 s w (p + tau t), w = s/(s + tau |t|)
//!
//! torque = -a n x F_fr
//!
//! - g = max(0, 2 |p|/s - 1)^2 is the wear: nothing wears below half of the limit, and nothing is left at it.
//! - n' is the rate of the normal, and w_n the mean spin of the two bodies: the contact turns with them.
//! - tau = D_0/L_0 with D_0 = 2 zeta sqrt(m_t L_0/x_m) is the damping, a share zeta of critical. m_t is the
//!   mass that a tangential force moves: m/7 for a pair, 2/7 m for a wall; m/2 and m without rotation.
//!
//! So |F_fr| never exceeds L_0 s^2 = mu rho(0) F: mu is the tangent of the angle at which a body that cannot
//! roll starts to slide.
//!
//! # Energy
//!
//! The power that friction takes from the motion, less what the contact stores, is
//!
//! L_0 s^2 tau |t| (w/s) (|t| - p.t/s) + L_0 x_m g max(0, ...)
//!
//! Neither term is negative while |p| is at most s. So the law never creates energy.

use crate::math::elementary::{Arithmetic, at_least, inverse, inverse_root};
use crate::math::vector::{Vec3, add_cross, add_scaled, cross, dot, scaled};
use crate::model::contact::{LawParameters, Rebound};
use crate::model::dahl::{Dahl, LEAST, Resisted, load_root};
use crate::model::size::Partners;

/// Numbers of the shear in the memory of a contact. They come first.
pub const SHEAR: usize = 3;

/// What friction with memory needs besides `LawParameters`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemoryParameters {
    /// Ratio c of the tangential to the normal stiffness.
    pub stiffness_ratio: f64,
    /// Damping zeta, a share of critical.
    pub damping: f64,
    /// Mass of a typical particle, kg.
    pub mass: f64,
    /// Coefficients of rolling and of twisting resistance; none where no contact of the scene has it.
    pub resistance: [Option<f64>; 2],
}

impl MemoryParameters {
    /// Numbers in the memory of a contact.
    pub fn numbers(&self) -> usize {
        let [rolling, twisting] = self.resistance.map(|coefficient| coefficient.is_some());
        SHEAR + if rolling { 3 } else { 0 } + if twisting { 1 } else { 0 }
    }
}

/// What a contact touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partner {
    /// Another sphere.
    Sphere,
    /// A resting plane.
    Wall,
}

/// What differs between pairs and walls.
#[derive(Debug, Clone, Copy)]
struct Side {
    /// 1 where the normal turns as the bodies move past each other, 0 for a plane.
    turns: f64,
    /// Damping tau of typical spheres, s/m.
    tau: f64,
}

/// Friction with memory, of one scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::{Elastic, LawParameters};
/// use demhybrid::model::history::{History, MemoryParameters, Partner, Touch};
/// use demhybrid::model::size::Partners;
///
/// let memory = MemoryParameters { stiffness_ratio: 0.5, damping: 1.0, mass: 2.0, resistance: [None; 2] };
/// let parameters = LawParameters {
///     r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, e: 1.0, psi: 10.0, phi: 0.3, v_min: 0.01,
///     memory: Some(memory),
/// };
/// let friction = History::new(&parameters, memory, true);
/// let (n, slip) = (Vec3::z(), Vec3::new(1e-9, 0.0, 0.0));
/// // Sheared to the full: friction is mu times the normal force, although nothing slides.
/// let size = Partners::alike(0.1, true);
/// let spins = &Vec3::zeros();
/// let touch = Touch { gap: 0.0, n: &n, v_rel: &slip, spins, spin_n: 0.0, size, memory: &Vec3::x() };
/// let found = friction.action::<Separate, _>(&parameters, &Elastic, Partner::Wall, touch);
/// assert!((found.force - Vec3::new(-3.0, 0.0, 10.0)).norm() < 1e-6); // N
/// assert!(found.rate.norm() < 1e-12); // what is at its limit is sheared no further
/// ```
#[derive(Debug, Clone, Copy)]
pub struct History {
    element: Dahl,
    /// 1/F_0, 1/N.
    inverse_f_0: f64,
    half_kappa: f64,
    pair: Side,
    wall: Side,
}

/// Adds -(p.n') n + (w_n.n) n x p to the `rate` (1/s) of the memory `p`: it turns with its contact.
///
/// n' = `turns` `along`/d, where `along` (m/s) is the velocity of the centre along the contact plane, and
/// `turns` is 0 for a plane.
#[inline(always)]
pub(super) fn turned<A: Arithmetic>(touch: Touch, turns: f64, along: &Vec3, p: &Vec3, rate: &Vec3) -> Vec3 {
    let Touch { gap, n, spin_n, size, .. } = touch;
    let apart = inverse::<A>(at_least(0.01 * size.surfaces, size.surfaces + gap));
    let tilt = turns * apart * dot::<A>(p, along);
    let turned = add_scaled::<A>(-tilt, n, rate);
    add_cross::<A>(&scaled(spin_n, n), p, &turned)
}

/// A contact as the law sees it. Signs are those for particle i.
#[derive(Debug, Clone, Copy)]
pub struct Touch<'a> {
    /// Gap l, m.
    pub gap: f64,
    /// Unit normal from the partner to i.
    pub n: &'a Vec3,
    /// Velocity of i relative to the centre of its partner, m/s.
    pub v_rel: &'a Vec3,
    /// s_i + s_j, m/s; s_j = 0 for a wall.
    pub spins: &'a Vec3,
    /// w_n.n, the spin about the normal with which the contact turns, rad/s: (w_i + w_j).n/2, or w_i.n/2 for
    /// a wall.
    pub spin_n: f64,
    /// What the sizes of the partners mean.
    pub size: Partners,
    /// The memory p.
    pub memory: &'a Vec3,
}

/// What the law gives for a contact.
#[derive(Debug, Clone, Copy)]
pub struct Response {
    /// Repulsion and friction on i, N.
    pub force: Vec3,
    /// Torque of friction on i over the radius, N; the same on the partner.
    pub turning: Vec3,
    /// Rate p' of the memory, 1/s.
    pub rate: Vec3,
    /// Power taken by rebound and by friction, W; by friction less what the memory stores.
    pub dissipation: [f64; 2],
}

impl Response {
    /// No force, no torque, no rate.
    pub fn none() -> Self {
        let zeros = Vec3::zeros();
        Response { force: zeros, turning: zeros, rate: zeros, dissipation: [0.0; 2] }
    }
}

impl History {
    /// Friction with memory of spheres that rotate, or that do not.
    ///
    /// `law.phi` is mu.
    pub fn new(law: &LawParameters, memory: MemoryParameters, rotation: bool) -> Self {
        let LawParameters { f_0, kappa, phi, .. } = *law;
        let MemoryParameters { damping, mass, .. } = memory;
        let element = Dahl::new(phi, law, &memory);
        let moved = if rotation { 3.5 } else { 1.0 };
        let tau = |mass: f64| element.damping(damping, mass);
        History {
            element,
            inverse_f_0: 1.0 / f_0,
            half_kappa: 0.5 * kappa,
            pair: Side { turns: 1.0, tau: tau(0.5 * mass / moved) },
            wall: Side { turns: 0.0, tau: tau(mass / moved) },
        }
    }

    /// The element that resists slip.
    pub fn element(&self) -> &Dahl {
        &self.element
    }

    /// Friction (N) of a pair whose memory is 0, at a given `repulsion` (N) and `slip` (m/s).
    #[inline(always)]
    pub fn without_memory<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3 {
        let s2 = repulsion * self.inverse_f_0;
        let s = s2 * inverse_root::<A>(at_least(LEAST, s2));
        let drag = scaled(self.pair.tau, slip);
        let drag2 = at_least(LEAST, dot::<A>(&drag, &drag));
        let w = s * inverse::<A>(s + drag2 * inverse_root::<A>(drag2));
        scaled(-self.element.limit * (s * w), &drag)
    }

    /// Force, torque and rate of the memory of one contact. `law` and `rebound` are those of the normal
    /// force.
    #[inline(always)]
    pub fn action<A: Arithmetic, R: Rebound>(
        &self,
        law: &LawParameters,
        rebound: &R,
        partner: Partner,
        touch: Touch,
    ) -> Response {
        let Touch { gap, n, v_rel, spins, size, memory, .. } = touch;
        let side = match partner {
            Partner::Sphere => self.pair,
            Partner::Wall => self.wall,
        };
        let opening = dot::<A>(n, v_rel);
        let share = rebound.share::<A>(-opening);
        let s = load_root::<A>(self.half_kappa, gap);
        let repulsion = law.f_0 * (s * s);
        // Slip with the lever a.
        let lever = A::add_product(size.per_surfaces, gap, 1.0);
        let along = add_scaled::<A>(-opening, n, v_rel);
        let slip = add_cross::<A>(n, &scaled(lever, spins), &along);
        // Rounding takes p out of the contact plane: what is left of it there counts.
        let p = add_scaled::<A>(-dot::<A>(memory, n), n, memory);
        let tau = side.tau * size.slipped;
        let Resisted { force: friction, rate } = self.element.resist::<A>([s, opening, tau], &slip, &p);
        let rate = turned::<A>(touch, side.turns, &along, &p, &rate);
        let at_rest = 0.5 * A::add_product(law.e, law.e, 1.0);
        let dissipated = self.element.dissipation::<A>(&Resisted { force: friction, rate }, &slip, &p);
        Response {
            force: add_scaled::<A>(repulsion * share, n, &friction),
            turning: scaled(lever, &cross::<A>(&friction, n)),
            rate,
            dissipation: [(at_rest - share) * repulsion * opening, dissipated],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::elementary::Separate;
    use crate::model::contact::Dissipative;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    const REMEMBERING: (LawParameters, MemoryParameters) = LawParameters::remembering([None; 2]);
    const LAW: LawParameters = REMEMBERING.0;

    const STILL: Vec3 = Vec3::new(0.0, 0.0, 0.0);

    fn friction() -> History {
        History::new(&LAW, REMEMBERING.1, true)
    }

    /// A contact of two equal spheres, or of one with a wall.
    fn contact<'a>(partner: Partner, gap: f64, [n, v_rel, spins, memory]: [&'a Vec3; 4]) -> Touch<'a> {
        let size = Partners::alike(LAW.r, partner == Partner::Wall);
        Touch { gap, n, v_rel, spins, spin_n: spins.dot(n) * 0.5 / LAW.r, size, memory }
    }

    fn respond(partner: Partner, touch: Touch) -> Response {
        friction().action::<Separate, _>(&LAW, &Dissipative::new(LAW.e, LAW.psi), partner, touch)
    }

    /// Friction on i, N.
    fn rubbing(response: &Response, n: &Vec3) -> Vec3 {
        response.force - n * response.force.dot(n)
    }

    fn limit(gap: f64) -> f64 {
        LAW.phi * 0.58 * LAW.f_0 * (-LAW.kappa * gap).exp()
    }

    fn vectors(size: f64) -> impl Strategy<Value = Vec3> {
        proptest::array::uniform3(-1.0..1.0f64).prop_map(move |v| size * Vec3::from(v))
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2000,
            failure_persistence: None,
            rng_seed: RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn no_contact_creates_energy_or_rubs_beyond_its_limit(
            gap in -0.03..0.05f64,
            n in vectors(1.0),
            v_rel in vectors(2.0),
            spins in vectors(2.0),
            direction in vectors(1.0),
            // A step may leave a memory beyond its limit.
            share in 0.0..3.0f64,
            speed in prop_oneof![Just(1.0), Just(1e-3), Just(1e-8)],
            wall in any::<bool>(),
        ) {
            prop_assume!(n.norm() > 0.1);
            let n = n.normalize();
            let across = direction - n * direction.dot(&n);
            prop_assume!(across.norm() > 0.1);
            let s = (-0.5 * LAW.kappa * gap).exp();
            let memory = across.normalize() * (share * s);
            let (v_rel, spins) = (speed * v_rel, speed * spins);
            let partner = if wall { Partner::Wall } else { Partner::Sphere };
            let touch = contact(partner, gap, [&n, &v_rel, &spins, &memory]);
            let found = respond(partner, touch);
            let most = limit(gap);
            prop_assert!(rubbing(&found, &n).norm() <= most * (1.0 + 1e-12));
            let [rebound, rubbed] = found.dissipation;
            let rounding = 1e-13 * (most + found.force.norm()) * (v_rel.norm() + spins.norm());
            prop_assert!(rebound >= -rounding && rubbed >= -rounding, "{rebound} {rubbed}");
            // The memory stays in the contact plane: (p.n)' = 0, where n turns with (v - l' n)/d.
            let turns = if wall { 0.0 } else { 1.0 / (2.0 * LAW.r + gap) };
            let n_rate = (v_rel - n * v_rel.dot(&n)) * turns;
            let leaves = found.rate.dot(&n) + memory.dot(&n_rate);
            prop_assert!(leaves.abs() <= 1e-12 * (1.0 + found.rate.norm()), "{leaves}");
            // Seen from the partner everything is reversed, to the last bit.
            let back = Touch { n: &-n, v_rel: &-v_rel, memory: &-memory, spin_n: -touch.spin_n, ..touch };
            let back = respond(partner, back);
            prop_assert_eq!(back.force, -found.force);
            prop_assert_eq!((back.rate, back.turning), (-found.rate, found.turning));
        }
    }

    #[test]
    fn a_contact_that_is_sheared_slowly_is_elastic_up_to_half_of_its_limit() {
        // Eq. of the module with t small: F = k_t x, k_t = c kappa F, and x_m is where that is the limit.
        let (n, gap) = (Vec3::z(), -0.01);
        let s = (-0.5 * LAW.kappa * gap).exp();
        let x_m = friction().element().full;
        assert!((x_m - 0.345 * 0.58 / 75.0).abs() < 1e-15);
        for share in [0.0, 0.1, 0.49] {
            let memory = Vec3::new(share * s, 0.0, 0.0);
            let slip = Vec3::new(1e-9, 0.0, 0.0);
            let touch = contact(Partner::Wall, gap, [&n, &slip, &STILL, &memory]);
            let found = respond(Partner::Wall, touch);
            let elastic = -0.5 * LAW.kappa * LAW.f_0 * s * s * (share * x_m);
            assert!((rubbing(&found, &n).x - elastic).abs() < 1e-6 * limit(gap), "{share}");
            // Nothing wears: x' = t.
            assert!((found.rate.x * x_m / s / 1e-9 - 1.0).abs() < 1e-9, "{share}");
        }
    }

    #[test]
    fn a_contact_that_slides_on_keeps_its_full_friction() {
        let (n, gap) = (Vec3::z(), 0.0);
        for speed in [1e-3, 0.1, 10.0] {
            let (slip, memory) = (Vec3::new(0.0, speed, 0.0), Vec3::new(0.0, 1.0, 0.0));
            let touch = contact(Partner::Wall, gap, [&n, &slip, &STILL, &memory]);
            let found = respond(Partner::Wall, touch);
            assert!((rubbing(&found, &n).y + limit(gap)).abs() < 1e-12 * limit(gap));
            assert!(found.rate.norm() < 1e-9 * speed / friction().element().full);
        }
    }

    #[test]
    fn a_pair_that_turns_as_a_whole_is_not_sheared() {
        let (n, gap) = (Vec3::new(0.6, 0.0, 0.8), -0.02);
        let omega = Vec3::new(1.0, -2.0, 0.5);
        let d = 2.0 * LAW.r + gap;
        let (v_rel, spins) = (omega.cross(&n) * d, omega * (2.0 * LAW.r));
        let memory = Vec3::new(-0.3, 1.0, 0.225);
        assert!(memory.dot(&n).abs() < 1e-15);
        let touch = contact(Partner::Sphere, gap, [&n, &v_rel, &spins, &memory]);
        let found = respond(Partner::Sphere, touch);
        // The memory turns with the pair and does nothing else.
        assert!((found.rate - omega.cross(&memory)).norm() < 1e-12);
    }

    #[test]
    fn a_memory_beyond_its_limit_returns_to_it_at_a_bounded_rate() {
        let n = Vec3::z();
        for size in [1.001, 2.0, 1e3, 1e18] {
            let memory = size * Vec3::x();
            for v_rel in [Vec3::x(), n] {
                let touch = contact(Partner::Wall, 0.0, [&n, &v_rel, &STILL, &memory]);
                let found = respond(Partner::Wall, touch);
                assert!(found.rate.x < 0.0, "{size}");
                assert!(rubbing(&found, &n).norm() <= limit(0.0) * (1.0 + 1e-12));
                // s falls at kappa v/2 where surfaces part, and shear grows at v/x_m.
                let most = 0.5 * LAW.kappa * v_rel.z * size + v_rel.x / friction().element().full;
                assert!(-found.rate.x <= 2.0 * most, "{size}: {} 1/s", found.rate.x);
            }
        }
    }
}
