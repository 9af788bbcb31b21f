//! Resistance to rolling and to twisting, with memory.
//!
//! Each is the element of [`crate::model::dahl`] with another motion t. With the reduced radius R of a
//! contact, r for a plane and r/2 for a pair of equal spheres, and with w = w_i - w_j:
//!
//! - rolling: t = R (w - (w.n) n), a vector, whose memory turns with the contact as that of friction does;
//! - twisting: t = R w.n, a number, whose memory has nothing to turn.
//!
//! R times the force is the moment on particle i, and its negative that on its partner. So the largest moment
//! is the coefficient times R times the normal force of a contact at rest. On a plane a sphere stands where
//! the slope is below the coefficient of rolling, and one that rolls stops after 0.7 v^2/(coefficient g).
//!
//! [`crate::model::size`] has the masses of unequal spheres.
//!
//! The element moves a sphere that rolls on a wall without slip, 7/5 m, or two that roll on each other like
//! gears, 4/5 m; a twist moves 2/5 m and 4/5 m. Its damping is a share of critical for that mass.

use crate::math::elementary::Arithmetic;
use crate::math::vector::{Vec3, add_scaled, dot, scaled};
use crate::model::contact::LawParameters;
use crate::model::dahl::{Dahl, Resisted, load_root};
use crate::model::history::{MemoryParameters, Partner, SHEAR, Touch, turned};

/// Resistance to rolling and to twisting, of one scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::LawParameters;
/// use demhybrid::model::history::{MemoryParameters, Partner, Touch};
/// use demhybrid::model::rolling::Resistance;
/// use demhybrid::model::size::Partners;
///
/// let memory =
///     MemoryParameters { stiffness_ratio: 0.5, damping: 1.0, mass: 2.0, resistance: [Some(0.05), None] };
/// let law = LawParameters {
///     r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, e: 1.0, psi: 10.0, phi: 0.3, v_min: 0.01,
///     memory: Some(memory),
/// };
/// let resistance = Resistance::new(&law, &memory).expect("rolling is above 0");
/// let rolling = resistance.rolling.expect("rolling is above 0");
/// assert!(resistance.twisting.is_none());
/// // A sphere that has rolled on: the moment over the radius is 0.05 times the normal force of 10 N.
/// let (n, zero, spin) = (Vec3::z(), Vec3::zeros(), 1e-9 * Vec3::x());
/// let size = Partners::alike(0.1, true);
/// let touch = Touch { gap: 0.0, n: &n, v_rel: &zero, spins: &spin, spin_n: 0.0, size, memory: &Vec3::x() };
/// let found = resistance.roll::<Separate>(&rolling, Partner::Wall, touch, &spin);
/// assert!((found.moment + Vec3::new(0.5, 0.0, 0.0)).norm() < 1e-7); // N
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Resistance {
    /// Against rolling, if there is any.
    pub rolling: Option<Turned>,
    /// Against twisting, if there is any.
    pub twisting: Option<Turned>,
    half_kappa: f64,
}

/// An element that resists a turning motion.
#[derive(Debug, Clone, Copy)]
pub struct Turned {
    /// The element.
    pub element: Dahl,
    /// Damping tau of pairs and of walls, s/m.
    tau: [f64; 2],
}

/// What an element does to a contact.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Moment over the radius on i, N; the negative on its partner. Of unequal spheres it is the moment over
    /// twice the reduced radius R.
    pub moment: Vec3,
    /// Rate of the memory, 1/s. That of twisting is its component along n.
    pub rate: Vec3,
    /// Power that it dissipates, W.
    pub dissipation: f64,
}

impl Turned {
    /// Damping (s/m), and the reduced radius over the radius.
    #[inline(always)]
    fn side(&self, partner: Partner) -> [f64; 2] {
        match partner {
            Partner::Sphere => [self.tau[0], 0.5],
            Partner::Wall => [self.tau[1], 1.0],
        }
    }

    #[inline(always)]
    fn moment<A: Arithmetic>(&self, found: &Resisted, share: f64, [t, p]: [&Vec3; 2]) -> Moment {
        let dissipation = self.element.dissipation::<A>(found, t, p);
        Moment { moment: scaled(share, &found.force), rate: found.rate, dissipation }
    }
}

impl Resistance {
    /// Numbers of the memory of a contact, that of its shear included.
    #[inline(always)]
    pub fn memory(&self) -> usize {
        SHEAR + self.rolling.map_or(0, |_| 3) + self.twisting.map_or(0, |_| 1)
    }

    /// The resistances of a scene; none if no contact of it has any. A coefficient of 0 resists nothing.
    pub fn new(law: &LawParameters, memory: &MemoryParameters) -> Option<Self> {
        let element = |coefficient: Option<f64>, masses: [f64; 2]| {
            coefficient.map(|coefficient| {
                let element = Dahl::new(coefficient, law, memory);
                let tau = masses.map(|share| element.damping(memory.damping, share * memory.mass));
                Turned { element, tau }
            })
        };
        let [rolling, twisting] = memory.resistance;
        let (rolling, twisting) = (element(rolling, [0.8, 1.4]), element(twisting, [0.8, 0.4]));
        let found = Resistance { rolling, twisting, half_kappa: 0.5 * law.kappa };
        (rolling.is_some() || twisting.is_some()).then_some(found)
    }

    /// Rolling resistance of a contact whose memory of rolling is `touch.memory`. `difference` is s_i - s_j
    /// (m/s), and s_j = 0 for a wall. Of unequal spheres it is 2 R (w_i - w_j).
    #[inline(always)]
    pub fn roll<A: Arithmetic>(
        &self,
        rolling: &Turned,
        partner: Partner,
        touch: Touch,
        difference: &Vec3,
    ) -> Moment {
        let Touch { gap, n, v_rel, memory, size, .. } = touch;
        let [tau, share] = rolling.side(partner);
        let tau = tau * size.turned;
        let opening = dot::<A>(n, v_rel);
        let along = add_scaled::<A>(-opening, n, v_rel);
        let t = scaled(share, &add_scaled::<A>(-dot::<A>(difference, n), n, difference));
        // Rounding takes p out of the contact plane: what is left of it there counts.
        let p = add_scaled::<A>(-dot::<A>(memory, n), n, memory);
        let s = load_root::<A>(self.half_kappa, gap);
        let Resisted { force, rate } = rolling.element.resist::<A>([s, opening, tau], &t, &p);
        let turns = if partner == Partner::Sphere { 1.0 } else { 0.0 };
        let rate = turned::<A>(touch, turns, &along, &p, &rate);
        rolling.moment::<A>(&Resisted { force, rate }, share, [&t, &p])
    }

    /// Twisting resistance of a contact whose memory of twisting is the component of `touch.memory` along n.
    #[inline(always)]
    pub fn twist<A: Arithmetic>(
        &self,
        twisting: &Turned,
        partner: Partner,
        touch: Touch,
        difference: &Vec3,
    ) -> Moment {
        let Touch { gap, n, v_rel, memory, size, .. } = touch;
        let [tau, share] = twisting.side(partner);
        let tau = tau * size.turned;
        let t = scaled(share * dot::<A>(difference, n), n);
        let opening = dot::<A>(n, v_rel);
        let found =
            twisting.element.resist::<A>([load_root::<A>(self.half_kappa, gap), opening, tau], &t, memory);
        twisting.moment::<A>(&found, share, [&t, memory])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::elementary::Separate;
    use crate::model::size::Partners;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    const REMEMBERING: (LawParameters, MemoryParameters) =
        LawParameters::remembering([Some(0.05), Some(0.02)]);
    const LAW: LawParameters = REMEMBERING.0;
    const MEMORY: MemoryParameters = REMEMBERING.1;

    /// A contact of two equal spheres, or of one with a wall.
    fn contact<'a>(partner: Partner, gap: f64, [n, v_rel, spins, memory]: [&'a Vec3; 4]) -> Touch<'a> {
        let size = Partners::alike(LAW.r, partner == Partner::Wall);
        Touch { gap, n, v_rel, spins, spin_n: spins.dot(n) * 0.5 / LAW.r, size, memory }
    }

    fn resistance() -> Resistance {
        Resistance::new(&LAW, &MEMORY).unwrap()
    }

    fn vectors(size: f64) -> impl Strategy<Value = Vec3> {
        proptest::array::uniform3(-1.0..1.0f64).prop_map(move |v| size * Vec3::from(v))
    }

    /// Rolling, or twisting.
    fn found(rolling: bool, partner: Partner, touch: Touch, difference: &Vec3) -> Moment {
        let resistance = resistance();
        if rolling {
            resistance.roll::<Separate>(&resistance.rolling.unwrap(), partner, touch, difference)
        } else {
            resistance.twist::<Separate>(&resistance.twisting.unwrap(), partner, touch, difference)
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2000,
            failure_persistence: None,
            rng_seed: RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn no_resistance_creates_energy_or_exceeds_its_limit(
            gap in -0.03..0.05f64,
            n in vectors(1.0),
            v_rel in vectors(2.0),
            spins in vectors(2.0),
            difference in vectors(2.0),
            direction in vectors(1.0),
            share in 0.0..1.0f64,
            speed in prop_oneof![Just(1.0), Just(1e-3), Just(1e-8)],
            wall in any::<bool>(),
            rolling in any::<bool>(),
        ) {
            prop_assume!(n.norm() > 0.1);
            let n = n.normalize();
            let across = direction - n * direction.dot(&n);
            prop_assume!(across.norm() > 0.1);
            let s = (-0.5 * LAW.kappa * gap).exp();
            let along = if rolling { across.normalize() } else { n * direction.x.signum() };
            let memory = along * (share * s);
            let (v_rel, spins, difference) = (speed * v_rel, speed * spins, speed * difference);
            let (partner, reduced) = if wall { (Partner::Wall, 1.0) } else { (Partner::Sphere, 0.5) };
            let touch = contact(partner, gap, [&n, &v_rel, &spins, &memory]);
            let moment = found(rolling, partner, touch, &difference);
            let coefficient = MEMORY.resistance[usize::from(!rolling)].unwrap();
            let most = coefficient * reduced * 0.58 * LAW.f_0 * s * s;
            prop_assert!(moment.moment.norm() <= most * (1.0 + 1e-12));
            // Rolling turns about axes in the contact plane, twisting about the normal.
            let other = if rolling { moment.moment.dot(&n) } else { moment.moment.cross(&n).norm() };
            prop_assert!(other.abs() <= 1e-12 * most);
            // The power that it takes, less what the memory stores, by hand.
            let at_rest = coefficient * 0.58;
            let stored = at_rest * LAW.f_0 * (at_rest / 75.0) * memory.dot(&moment.rate);
            let power = -moment.moment.dot(&difference) - stored;
            let rounding = 1e-13 * most * (v_rel.norm() + spins.norm() + difference.norm());
            prop_assert!((power - moment.dissipation).abs() <= 1e3 * rounding, "{power}");
            prop_assert!(moment.dissipation >= -rounding, "{}", moment.dissipation);
            // Seen from the partner the moment is the opposite. So is the vector of twisting: its component
            // along n, which is the memory, stays.
            let (back_n, back_v, back) = (-n, -v_rel, -difference);
            let turned_round = -memory;
            let touch = contact(partner, gap, [&back_n, &back_v, &spins, &turned_round]);
            let back = found(rolling, partner, touch, &back);
            prop_assert_eq!((back.moment, back.rate), (-moment.moment, -moment.rate));
        }
    }

    #[test]
    fn a_contact_that_turns_as_a_whole_is_not_rolled_and_keeps_its_memory() {
        let (n, gap) = (Vec3::new(0.6, 0.0, 0.8), -0.02);
        let omega = Vec3::new(1.0, -2.0, 0.5);
        let d = 2.0 * LAW.r + gap;
        let (v_rel, spins) = (omega.cross(&n) * d, omega * (2.0 * LAW.r));
        let memory = Vec3::new(-0.3, 1.0, 0.225);
        let touch = contact(Partner::Sphere, gap, [&n, &v_rel, &spins, &memory]);
        let rolling = found(true, Partner::Sphere, touch, &Vec3::zeros());
        assert!((rolling.rate - omega.cross(&memory)).norm() < 1e-12);
        let twisting = found(false, Partner::Sphere, Touch { memory: &(0.3 * n), ..touch }, &Vec3::zeros());
        assert_eq!(twisting.rate, Vec3::zeros());
        assert!(twisting.moment.norm() > 0.01);
    }

    #[test]
    fn damping_is_critical_for_what_the_contact_moves() {
        // A small motion t without memory meets the force -D t, with D = 2 sqrt(k m) and k = c kappa F.
        let s2 = 9.81 / 5.8;
        let gap = -f64::ln(s2) / LAW.kappa;
        let (n, t) = (Vec3::z(), 1e-9);
        let stiffness = 0.5 * LAW.kappa * LAW.f_0 * s2;
        for (rolling, partner, mass, reduced) in [
            (true, Partner::Wall, 1.4, 1.0),
            (true, Partner::Sphere, 0.8, 0.5),
            (false, Partner::Wall, 0.4, 1.0),
            (false, Partner::Sphere, 0.8, 0.5),
        ] {
            let difference = if rolling { Vec3::x() } else { Vec3::z() } * (t / reduced);
            let zero = Vec3::zeros();
            let touch = contact(partner, gap, [&n, &zero, &zero, &zero]);
            let force = found(rolling, partner, touch, &difference).moment.norm() / reduced;
            let expected = 2.0 * (stiffness * mass).sqrt() * t;
            assert!((force / expected - 1.0).abs() < 1e-6, "{mass} {force} {expected}");
        }
    }
}
