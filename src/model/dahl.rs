//! Dahl's element: a spring that wears at its limit.
//!
//! Friction, rolling resistance and twisting resistance of a contact are such elements. Each resists a motion
//! t (m/s): slip, rolling or twisting of the two surfaces. P. R. Dahl (1968) and C. Canudas de Wit et al.,
//! IEEE Trans. Autom. Control 40 (1995) 419, have the idea for a constant load. Here the load of the contact
//! is the repulsion F = F_0 s^2 of eq. (2.1), with s = exp(-kappa l/2) and the gap l.
//!
//! The memory of the element is p, without unit. The limit of its force is L_0 s^2, its stiffness c kappa F.
//! So its elastic force is L_0 s p, and it stores L_0 x_m |p|^2/2 at any gap, where x_m is the way at its
//! limit:
//!
//! L_0 = mu rho(0) F_0,  x_m = mu rho(0)/(c kappa)
//!
//! p' = s t/x_m - g max(0, s t.p/x_m + kappa l'/2 |p|^2) p/|p|^2,  g = max(0, 2 |p|/s - 1)^2
//!
//! force = -L_0 s w (p + tau t),  w = s/(s + tau |t|)
//!
//! What turns p with the contact plane comes on top, and does no work. The damping is tau = D_0/L_0 with
//! D_0 = 2 zeta sqrt(m L_0/x_m), a share zeta of critical damping of the mass m that the element moves.

use crate::math::elementary::{Arithmetic, at_least, at_most, exp, inverse, inverse_root};
use crate::math::vector::{Vec3, add_scaled, dot, scaled};
use crate::model::contact::LawParameters;
use crate::model::history::MemoryParameters;

/// Squares of numbers without unit below this count as this: no difference of forces would show.
pub(super) const LEAST: f64 = 1e-30;

/// The smallest s is exp(-40): a repulsion of 2e-35 F_0.
const LEAST_EXPONENT: f64 = -40.0;

/// The element of one kind of motion, of one scene.
#[derive(Debug, Clone, Copy)]
pub struct Dahl {
    /// L_0, N.
    pub limit: f64,
    /// x_m, m.
    pub full: f64,
    inverse_full: f64,
    half_kappa: f64,
}

/// What an element gives.
#[derive(Debug, Clone, Copy)]
pub struct Resisted {
    /// Force against the motion, N.
    pub force: Vec3,
    /// Rate of the memory before anything turns it, 1/s.
    pub rate: Vec3,
}

/// s = exp(-kappa l/2) at the gap l (m), from `half_kappa` = kappa/2 (1/m).
#[inline(always)]
pub(super) fn load_root<A: Arithmetic>(half_kappa: f64, gap: f64) -> f64 {
    exp::<A>(at_least(LEAST_EXPONENT, -half_kappa * gap))
}

impl Dahl {
    /// The element whose limit is `coefficient` times the normal force of a contact at rest. One of 0 resists
    /// nothing.
    pub fn new(coefficient: f64, law: &LawParameters, memory: &MemoryParameters) -> Self {
        let LawParameters { f_0, kappa, e, .. } = *law;
        let at_rest = 0.5 * (1.0 + e * e);
        let (limit, full) =
            (coefficient * at_rest * f_0, coefficient * at_rest / (memory.stiffness_ratio * kappa));
        // Without a limit nothing is stored either: the memory stays 0, and so does the force, exactly.
        let inverse_full = if full > 0.0 { 1.0 / full } else { 0.0 };
        Dahl { limit, full, inverse_full, half_kappa: 0.5 * kappa }
    }

    /// Damping tau (s/m), as a share `zeta` of critical, where the element moves `mass` (kg).
    /// It is 0 for an element that resists nothing.
    pub fn damping(&self, zeta: f64, mass: f64) -> f64 {
        if self.limit > 0.0 && self.full > 0.0 {
            2.0 * zeta * (mass * self.limit / self.full).sqrt() / self.limit
        } else {
            0.0
        }
    }

    /// L_0 x_m: twice the energy that a memory of length 1 stores, J.
    pub fn stiffness(&self) -> f64 {
        self.limit * self.full
    }

    /// Force and rate at the motion `t` (m/s) and the memory `p`, in a contact that opens with `opening`
    /// (m/s). `s` is the square root of the load over F_0, `tau` (s/m) the damping.
    #[inline(always)]
    pub fn resist<A: Arithmetic>(&self, [s, opening, tau]: [f64; 3], t: &Vec3, p: &Vec3) -> Resisted {
        let p2 = at_least(LEAST, dot::<A>(p, p));
        let inverse_p = inverse_root::<A>(p2);
        let q = p2 * inverse_p * inverse::<A>(s);
        // tau |t|
        let drag = scaled(tau, t);
        let drag2 = at_least(LEAST, dot::<A>(&drag, &drag));
        let drag_size = drag2 * inverse_root::<A>(drag2);
        let w = s * inverse::<A>(s + drag_size);
        // A step may leave p slightly beyond its limit: the force stays within.
        let held = at_most(1.0, s * inverse_p);
        let strength = -self.limit * (s * w);
        let force = scaled(strength, &add_scaled::<A>(held, p, &drag));
        // Beyond the limit, where no exact solution is, the wear goes on with the same slope, up to 2: where
        // surfaces part, s falls below what the error of a step leaves in p, and rates must not grow with it.
        let above = at_least(0.0, A::add_product(2.0, q, -1.0));
        let g = if q < 1.0 { above * above } else { at_most(2.0, A::add_product(4.0, q, -3.0)) };
        let per_way = s * self.inverse_full;
        let slip = dot::<A>(t, p);
        let growth = A::add_product(per_way, slip, self.half_kappa * opening * p2);
        // The force stays within the limit. A memory beyond it stores no more than that force takes from the
        // motion, or contacts would create energy. The rest wears off.
        let beyond = (1.0 - held) * (per_way * slip);
        let wear = at_least(beyond, g * at_least(0.0, growth)) * (inverse_p * inverse_p);
        Resisted { force, rate: add_scaled::<A>(-wear, p, &scaled(per_way, t)) }
    }

    /// Power (W) that the element takes from the motion `t` (m/s), less what its memory `p` stores.
    #[inline(always)]
    pub fn dissipation<A: Arithmetic>(&self, found: &Resisted, t: &Vec3, p: &Vec3) -> f64 {
        -dot::<A>(&found.force, t) - self.stiffness() * dot::<A>(p, &found.rate)
    }
}
