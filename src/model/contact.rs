//! The contact law, eqs. (2.1)-(2.12), as pure functions of one contact.
//!
//! Pairs and walls share one law: a wall is a partner that does not move. `n` is the unit normal from the
//! partner to particle i: n = (x_i - x_j)/d for a pair, n = -n_k for wall k.
//!
//! `gap` is the distance between the surfaces, negative where they overlap. `v_rel` is the velocity of
//! particle i relative to its partner.

use crate::math::elementary::{
    Arithmetic, Separate, at_least, at_most, exp, exp_within, inverse, inverse_root,
};
use crate::math::vector::{Vec3, add_cross, add_scaled, cross, dot, scaled};
use crate::model::dahl::Dahl;
use crate::model::history::{History, MemoryParameters, Partner, Response, SHEAR, Touch};
use crate::model::rolling::Resistance;

/// Force and torque of a contact on particle i.
///
/// The force on the partner j is the opposite. The torque over the radius is the *same*, since both n and
/// F_fr change sign in eq. (2.11).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Action {
    /// Repulsion and friction, N.
    pub force: Vec3,
    /// Torque of friction over the radius, N; zero without rotation.
    pub turning: Vec3,
}

impl Action {
    /// No force and no torque.
    #[inline(always)]
    pub fn none() -> Self {
        Action { force: Vec3::zeros(), turning: Vec3::zeros() }
    }
}

/// The rebound function rho, eq. (2.4).
pub trait Rebound: Copy + Send + Sync + 'static {
    /// rho(v): share of the repulsion kept at closing speed `v` (m/s, positive when approaching), eq. (2.4).
    fn share<A: Arithmetic>(&self, v: f64) -> f64;
}

/// e = 1: rho is 1, and contacts dissipate no energy on rebound.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::model::contact::{Elastic, Rebound};
///
/// assert_eq!(Elastic.share::<Separate>(-0.3), 1.0);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Elastic;

/// e < 1: the repulsion is weaker when separating than when approaching.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::model::contact::{Dissipative, Rebound};
///
/// let rho = Dissipative::new(0.4, 10.0);
/// assert_eq!(rho.share::<Separate>(20.0), 1.0); // approaching: the full repulsion
/// assert!((rho.share::<Separate>(-20.0) - 0.16).abs() < 1e-15); // separating: e^2
/// assert!((rho.share::<Separate>(0.0) - 0.58).abs() < 1e-15); // at rest: the mean of both
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Dissipative {
    e2: f64,
    one_less_e2: f64,
    two_psi: f64,
}

impl Dissipative {
    /// The rebound function for the coefficient of restitution `e` (0..1) and the focusing coefficient `psi`
    /// (s/m).
    pub fn new(e: f64, psi: f64) -> Self {
        Dissipative { e2: e * e, one_less_e2: 1.0 - e * e, two_psi: 2.0 * psi }
    }
}

impl Rebound for Elastic {
    #[inline(always)]
    fn share<A: Arithmetic>(&self, _v: f64) -> f64 {
        1.0
    }
}

impl Rebound for Dissipative {
    /// e^2 when separating, 1 when approaching, and smooth in between, which the step control needs.
    ///
    /// Computes (1 + tanh z)/2 as 1/(1 + exp(-2z)): tanh by exponentials would lose digits near 0. The
    /// exponent is limited to 80, where rho is e^2 to within 2e-35.
    #[inline(always)]
    fn share<A: Arithmetic>(&self, v: f64) -> f64 {
        let exponential = exp_within::<A>(at_least(-80.0, at_most(80.0, -self.two_psi * v)));
        A::add_product(self.one_less_e2, inverse::<A>(1.0 + exponential), self.e2)
    }
}

/// The tangential part of the law: friction, eqs. (2.6), (2.8) and (2.9).
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::{Arithmetic, Separate};
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::Tangential;
///
/// /// Friction of this strength (N). It fades where there is no slip.
/// #[derive(Clone, Copy)]
/// struct Constant(f64);
///
/// impl Tangential for Constant {
///     const RUBS: bool = true;
///     const TURNS: bool = false;
///     fn friction<A: Arithmetic>(&self, _repulsion: f64, slip: &Vec3) -> Vec3 {
///         slip * (-self.0 / (slip.norm() + 1e-3))
///     }
/// }
/// assert_eq!(Constant(2.0).friction::<Separate>(10.0, &Vec3::zeros()), Vec3::zeros());
/// ```
pub trait Tangential: Copy + Send + Sync + 'static {
    /// Whether there is friction. Without it neither slip nor torque is computed.
    const RUBS: bool;
    /// Whether friction turns the spheres; if not, spins do not count.
    const TURNS: bool;
    /// Whether contacts have a memory. Then `respond` is the law, and `friction` that of a memory of 0.
    const REMEMBERS: bool = false;

    /// Friction (N) at the given `slip` (m/s), eqs. (2.6) and (2.9).
    ///
    /// `repulsion` (N) is the full F of eq. (2.1), not reduced by the rebound function.
    fn friction<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3;

    /// Friction with memory of one contact. It is called only where contacts have a memory.
    fn respond<A: Arithmetic, R: Rebound>(
        &self,
        _law: &LawParameters,
        _rebound: &R,
        _partner: Partner,
        _touch: Touch,
    ) -> Response {
        Response::none()
    }

    /// Resistance to rolling and twisting, if contacts have any.
    #[inline(always)]
    fn resistance(&self) -> Option<&Resistance> {
        None
    }

    /// The elements of a contact, with how many numbers each has in its memory, in their order.
    fn elements(&self) -> Vec<(usize, Dahl)> {
        Vec::new()
    }
}

/// No friction: the basic variant.
#[derive(Debug, Clone, Copy)]
pub struct Frictionless;

/// Regularised Coulomb friction: the friction and friction+rotation variants.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::{Coulomb, Tangential};
///
/// let friction = Coulomb::new(0.2, 0.01); // phi, and v_min in m/s
/// let at_full_strength = friction.friction::<Separate>(10.0, &Vec3::new(0.5, 0.0, 0.0));
/// assert!((at_full_strength.x + 2.0).abs() < 1e-14); // phi times the repulsion, against the slip, N
/// let at_half_of_v_min = friction.friction::<Separate>(10.0, &Vec3::new(0.005, 0.0, 0.0));
/// assert!((at_half_of_v_min.x + 1.0).abs() < 1e-14);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Coulomb {
    phi: f64,
    /// 1/v_min, s/m, kept because a division is much slower than a multiplication.
    inverse_v_min: f64,
    /// Square of the smallest slip (m^2/s^2) that the formula distinguishes. Friction at a smaller slip is
    /// below the rounding error of its full strength.
    least: f64,
}

impl Coulomb {
    /// Friction with the coefficient `phi`, at full strength from the slip `v_min` (m/s) on.
    pub fn new(phi: f64, v_min: f64) -> Self {
        let least = (1e-8 * v_min).powi(2).max(1e-36);
        Coulomb { phi, inverse_v_min: (1.0 / v_min).min(f64::MAX), least }
    }

    /// Sigma(s)/s of eq. (2.8) in s/m, from the square `s2` of the slip s (m^2/s^2).
    ///
    /// In this form friction needs no direction t/|t| and is finite at s = 0. (v_0 of eq. (2.8) is v_min.)
    #[inline(always)]
    pub fn limiter_over_slip<A: Arithmetic>(&self, s2: f64) -> f64 {
        let inverse = inverse_root::<A>(at_least(self.least, s2));
        let q = s2 * inverse * self.inverse_v_min;
        if q < 1.0 { A::add_product(-2.0, q, 3.0) * (q * self.inverse_v_min) } else { inverse }
    }
}

impl Tangential for Frictionless {
    const RUBS: bool = false;
    const TURNS: bool = false;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, _repulsion: f64, _slip: &Vec3) -> Vec3 {
        Vec3::zeros()
    }
}

impl Tangential for Coulomb {
    const RUBS: bool = true;
    const TURNS: bool = false;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3 {
        scaled(-self.phi * repulsion * self.limiter_over_slip::<A>(dot::<A>(slip, slip)), slip)
    }
}

/// Friction that turns the spheres: the friction+rotation variant.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::contact::{Coulomb, Tangential, Turning};
///
/// assert!(!Coulomb::TURNS);
/// assert!(Turning::<Coulomb>::TURNS);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Turning<T>(pub T);

impl Tangential for History {
    const RUBS: bool = true;
    const TURNS: bool = false;
    const REMEMBERS: bool = true;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3 {
        self.without_memory::<A>(repulsion, slip)
    }

    #[inline(always)]
    fn respond<A: Arithmetic, R: Rebound>(
        &self,
        law: &LawParameters,
        rebound: &R,
        partner: Partner,
        touch: Touch,
    ) -> Response {
        self.action::<A, R>(law, rebound, partner, touch)
    }

    fn elements(&self) -> Vec<(usize, Dahl)> {
        vec![(SHEAR, *self.element())]
    }
}

/// Friction with memory of spheres that also resist rolling or twisting.
#[derive(Debug, Clone, Copy)]
pub struct Resisting {
    /// Friction.
    pub friction: History,
    /// Resistance to rolling and to twisting.
    pub resistance: Resistance,
}

impl Tangential for Resisting {
    const RUBS: bool = true;
    const TURNS: bool = true;
    const REMEMBERS: bool = true;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3 {
        self.friction.without_memory::<A>(repulsion, slip)
    }

    #[inline(always)]
    fn respond<A: Arithmetic, R: Rebound>(
        &self,
        law: &LawParameters,
        rebound: &R,
        partner: Partner,
        touch: Touch,
    ) -> Response {
        self.friction.action::<A, R>(law, rebound, partner, touch)
    }

    #[inline(always)]
    fn resistance(&self) -> Option<&Resistance> {
        Some(&self.resistance)
    }

    fn elements(&self) -> Vec<(usize, Dahl)> {
        let Resistance { rolling, twisting, .. } = self.resistance;
        let of = |numbers: usize| move |turned: crate::model::rolling::Turned| (numbers, turned.element);
        let mut elements = self.friction.elements();
        elements.extend(rolling.map(of(3)));
        elements.extend(twisting.map(of(1)));
        elements
    }
}

impl<T: Tangential> Tangential for Turning<T> {
    const RUBS: bool = T::RUBS;
    const TURNS: bool = true;
    const REMEMBERS: bool = T::REMEMBERS;

    #[inline(always)]
    fn friction<A: Arithmetic>(&self, repulsion: f64, slip: &Vec3) -> Vec3 {
        self.0.friction::<A>(repulsion, slip)
    }

    #[inline(always)]
    fn respond<A: Arithmetic, R: Rebound>(
        &self,
        law: &LawParameters,
        rebound: &R,
        partner: Partner,
        touch: Touch,
    ) -> Response {
        self.0.respond::<A, R>(law, rebound, partner, touch)
    }

    fn elements(&self) -> Vec<(usize, Dahl)> {
        self.0.elements()
    }
}

/// The numbers of the contact law of a scene.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::model::contact::LawParameters;
///
/// let parameters = LawParameters {
///     r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, e: 0.4, psi: 10.0, phi: 0.2, v_min: 0.01, memory: None,
/// };
/// assert_eq!(parameters.repulsion::<Separate>(0.0), 10.0); // N, where surfaces just touch
/// let one_e_fold_away = parameters.repulsion::<Separate>(1.0 / 150.0);
/// assert!((one_e_fold_away - 10.0 / std::f64::consts::E).abs() < 1e-14);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawParameters {
    /// Radius of every sphere, m.
    pub r: f64,
    /// Repulsion at contact F_0, N.
    pub f_0: f64,
    /// Stiffness exponent kappa, 1/m.
    pub kappa: f64,
    /// Largest gap at which surfaces interact, m. Contacts beyond it are skipped.
    pub l_max: f64,
    /// Coefficient of restitution e, 0..1.
    pub e: f64,
    /// Focusing coefficient of the dissipation psi, s/m.
    pub psi: f64,
    /// Friction coefficient: phi of the paper, or mu of friction with memory; 0 without friction.
    pub phi: f64,
    /// Speed from which friction has its full strength v_min, m/s. Friction with memory does not use it.
    pub v_min: f64,
    /// What friction with memory needs; none for the paper's friction.
    pub memory: Option<MemoryParameters>,
}

impl LawParameters {
    /// The spheres of the paper's bed, for tests.
    #[cfg(test)]
    pub(crate) const PAPER: LawParameters = LawParameters {
        r: 0.1,
        f_0: 10.0,
        kappa: 150.0,
        l_max: 0.1,
        e: 0.4,
        psi: 10.0,
        phi: 0.2,
        v_min: 0.01,
        memory: None,
    };

    /// The same spheres of 1 kg with friction that remembers, and with this `resistance`, for tests.
    #[cfg(test)]
    pub(crate) const fn remembering(resistance: [Option<f64>; 2]) -> (LawParameters, MemoryParameters) {
        let memory = MemoryParameters { stiffness_ratio: 0.5, damping: 1.0, mass: 1.0, resistance };
        (LawParameters { phi: 0.345, memory: Some(memory), ..LawParameters::PAPER }, memory)
    }

    /// The way with which errors of position of a sphere with the radius `r` (m) are compared, m:
    /// sqrt(r/kappa), at most r.
    ///
    /// A contact that carries the force m v^2/r, with the velocity scale v, has the stiffness kappa m v^2/r.
    /// There a position that is wrong by that way and a velocity that is wrong by v are worth the same
    /// energy.
    pub fn position_scale(&self, r: f64) -> f64 {
        (r / self.kappa).sqrt().min(r)
    }

    /// Repulsion F at `gap` (m), in N, eq. (2.1).
    #[inline(always)]
    pub fn repulsion<A: Arithmetic>(&self, gap: f64) -> f64 {
        self.f_0 * exp::<A>(-self.kappa * gap)
    }
}

/// The contact law of a scene. Its effects are type parameters.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::{Coulomb, Dissipative, Law, LawParameters, Turning};
///
/// let parameters = LawParameters {
///     r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, e: 0.4, psi: 10.0, phi: 0.2, v_min: 0.01, memory: None,
/// };
/// let tangential = Turning(Coulomb::new(parameters.phi, parameters.v_min));
/// let law = Law { parameters, rebound: Dissipative::new(parameters.e, parameters.psi), tangential };
/// // A sphere on a floor slides along x: the normal points up.
/// let on_sphere = law.action::<Separate>(0.0, &Vec3::z(), &Vec3::x(), &Vec3::zeros());
/// assert!((on_sphere.force.x + 2.0).abs() < 1e-12); // friction, N
/// assert!((on_sphere.force.z - 5.8).abs() < 1e-12); // repulsion at rest, N
/// assert!((on_sphere.turning.y - 2.0).abs() < 1e-12); // N, times r: it begins to roll
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Law<R, T> {
    /// Its numbers.
    pub parameters: LawParameters,
    /// The rebound function.
    pub rebound: R,
    /// The tangential law: friction or none.
    pub tangential: T,
}

impl<R: Rebound, T: Tangential> Law<R, T> {
    /// Repulsion F at `gap` (m), in N, eq. (2.1).
    #[inline(always)]
    pub fn repulsion<A: Arithmetic>(&self, gap: f64) -> f64 {
        self.parameters.repulsion::<A>(gap)
    }

    /// The energies of contacts under this law.
    pub fn energies(&self) -> Energies<'_, R, T> {
        let LawParameters { f_0, kappa, l_max, .. } = self.parameters;
        let (share, least) = (self.rebound.share::<Separate>(0.0), self.repulsion::<Separate>(l_max));
        Energies { law: self, at_rest: AtRest { share, least, f_0, kappa, l_max } }
    }

    /// Force and torque of one contact on particle i, eqs. (2.3), (2.5), (2.6), (2.9), (2.11), (2.12).
    ///
    /// `gap` (m) must not exceed `l_max`. `v_rel` (m/s) is the velocity of i relative to its partner's
    /// centre. `spins` (m/s) is s_i + s_j with s = r w, and s_j = 0 for a wall.
    #[inline(always)]
    pub fn action<A: Arithmetic>(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &Vec3) -> Action {
        let opening = dot::<A>(n, v_rel);
        let repulsion = self.repulsion::<A>(gap);
        let normal = repulsion * self.rebound.share::<A>(-opening);
        if !T::RUBS {
            return Action { force: scaled(normal, n), turning: Vec3::zeros() };
        }
        let friction = self.tangential.friction::<A>(repulsion, &self.slip::<A>(opening, n, v_rel, spins));
        // -n x F; times r, this is the torque of eqs. (2.11) and (2.12).
        let turning = if T::TURNS { cross::<A>(&friction, n) } else { Vec3::zeros() };
        Action { force: add_scaled::<A>(normal, n, &friction), turning }
    }

    /// Force, torque and rate of the memory of one contact, for friction with memory.
    #[inline(always)]
    pub fn respond<A: Arithmetic>(&self, partner: Partner, touch: Touch) -> Response {
        self.tangential.respond::<A, R>(&self.parameters, &self.rebound, partner, touch)
    }

    /// Slip: velocity of the surface of i at the contact relative to its partner's surface, m/s, eqs. (2.7)
    /// and (2.10).
    ///
    /// `opening` (m/s) is n . v_rel.
    #[inline(always)]
    fn slip<A: Arithmetic>(&self, opening: f64, n: &Vec3, v_rel: &Vec3, spins: &Vec3) -> Vec3 {
        let along = add_scaled::<A>(-opening, n, v_rel);
        // Less s x n, the velocity of the surface by rotation.
        if T::TURNS { add_cross::<A>(n, spins, &along) } else { along }
    }
}

/// The energy that contacts at rest store.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRest {
    /// rho(0).
    share: f64,
    /// F(l_max), N.
    least: f64,
    f_0: f64,
    kappa: f64,
    l_max: f64,
}

impl AtRest {
    /// Energy stored in a contact at rest, J: the integral of rho(0) F from `gap` (m) to `l_max`. Any gap is
    /// allowed.
    ///
    /// With the share rho(0) the energy H never grows, whatever the speeds are.
    #[inline(always)]
    pub fn stored<A: Arithmetic>(&self, gap: f64) -> f64 {
        let repulsion = self.f_0 * exp::<A>(-self.kappa * gap);
        let energy = self.share * (repulsion - self.least) / self.kappa;
        if gap <= self.l_max { energy } else { 0.0 }
    }
}

/// The energies of contacts, with the values that all contacts share computed once.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::contact::{Coulomb, Elastic, Law, LawParameters};
///
/// let parameters = LawParameters {
///     r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, e: 0.4, psi: 10.0, phi: 0.2, v_min: 0.01, memory: None,
/// };
/// let law = Law { parameters, rebound: Elastic, tangential: Coulomb::new(0.2, 0.01) };
/// let energies = law.energies();
/// assert!((energies.stored::<Separate>(0.0) - 10.0 / 150.0).abs() < 1e-6); // F_0/kappa, J
/// let [rebound, friction] =
///     energies.dissipation::<Separate>(0.0, &Vec3::z(), &Vec3::new(0.5, 0.0, -0.1), &Vec3::zeros());
/// assert_eq!(rebound, 0.0);
/// assert!((friction - 1.0).abs() < 1e-12); // 2 N at 0.5 m/s, W
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Energies<'a, R, T> {
    /// The law.
    pub law: &'a Law<R, T>,
    /// What contacts at rest store.
    pub at_rest: AtRest,
}

impl<R: Rebound, T: Tangential> Energies<'_, R, T> {
    /// Energy stored in a contact at rest, as [`AtRest::stored`].
    #[inline(always)]
    pub fn stored<A: Arithmetic>(&self, gap: f64) -> f64 {
        self.at_rest.stored::<A>(gap)
    }

    /// Power (W) that one contact dissipates, taken from the kinetic and the stored energy: by rebound and by
    /// friction.
    ///
    /// By rebound it is (rho(v) - rho(0)) F v with the closing speed v, which is never negative. By friction
    /// it is -F_fr . t. The arguments are those of [`Law::action`], but any gap is allowed.
    #[inline(always)]
    pub fn dissipation<A: Arithmetic>(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &Vec3) -> [f64; 2] {
        let law = self.law;
        let opening = dot::<A>(n, v_rel);
        let repulsion = law.repulsion::<A>(gap);
        let rebound = (self.at_rest.share - law.rebound.share::<A>(-opening)) * repulsion * opening;
        let mut friction = 0.0;
        if T::RUBS {
            let slip = law.slip::<A>(opening, n, v_rel, spins);
            friction = -dot::<A>(&law.tangential.friction::<A>(repulsion, &slip), &slip);
        }
        // A NaN gap must not count as far: the NaN has to appear in the result.
        let far = gap > law.parameters.l_max;
        [if far { 0.0 } else { rebound }, if far { 0.0 } else { friction }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const R: f64 = LawParameters::PAPER.r;

    fn law<T: Tangential>(tangential: T) -> Law<Dissipative, T> {
        Law { parameters: LawParameters::PAPER, rebound: Dissipative::new(0.4, 10.0), tangential }
    }

    #[test]
    fn rebound_goes_from_one_to_e_squared_through_their_mean() {
        let rho = Dissipative::new(0.4, 10.0);
        assert!((rho.share::<Separate>(0.0) - 0.58).abs() < 1e-15);
        assert!((rho.share::<Separate>(10.0) - 1.0).abs() < 1e-15);
        assert!((rho.share::<Separate>(-10.0) - 0.16).abs() < 1e-15);
        assert_eq!(rho.share::<Separate>(-1e9), 0.4 * 0.4);
        // Compare with eq. (2.4) as printed.
        for v in [-0.3, -0.01, 1e-9, 0.02, 0.7] {
            let printed = 0.16 + 0.5 * (1.0 - 0.16) * (1.0 + f64::tanh(10.0 * v));
            assert!((rho.share::<Separate>(v) - printed).abs() < 1e-15);
        }
        assert_eq!(Dissipative::new(1.0, 10.0).share::<Separate>(-0.2), Elastic.share::<Separate>(-0.2));
    }

    #[test]
    fn limiter_is_smooth_at_its_threshold_and_finite_without_slip() {
        let c = Coulomb::new(0.2, 0.01);
        assert_eq!(c.limiter_over_slip::<Separate>(0.0), 0.0);
        let sigma = |s: f64| s * c.limiter_over_slip::<Separate>(s * s);
        assert!((sigma(0.01) - 1.0).abs() < 1e-14);
        assert!((sigma(0.005) - 0.5).abs() < 1e-14);
        // Just below v_min the slope vanishes, as it does above.
        let slope = (sigma(0.01) - sigma(0.01 - 1e-6)) / 1e-6;
        assert!(slope.abs() < 0.05, "{slope}: its largest value inside is 150");
        assert_eq!(sigma(3.0), 1.0);
        assert_eq!(Coulomb::new(0.2, 1e-200).limiter_over_slip::<Separate>(0.0), 0.0);
    }

    #[test]
    fn repulsion_at_contact_is_f_0_and_falls_by_e_over_one_over_kappa() {
        let law = law(Frictionless);
        assert_eq!(law.repulsion::<Separate>(0.0), 10.0);
        assert!((law.repulsion::<Separate>(1.0 / 150.0) - 10.0 / std::f64::consts::E).abs() < 1e-14);
    }

    #[test]
    fn torque_vanishes_without_slip() {
        // Two spheres roll on each other like gears: their surfaces have the same velocity.
        let n = Vec3::x();
        let w = Vec3::new(0.0, 0.0, 4.0);
        let spins = w * R;
        let v_rel = spins.cross(&n);
        let action = law(Turning(Coulomb::new(0.2, 0.01))).action::<Separate>(-0.001, &n, &v_rel, &spins);
        assert_eq!(action.turning, Vec3::zeros());
        assert_eq!(action.force.y, 0.0);
        assert!(action.force.x > 0.0);
    }

    #[test]
    fn friction_opposes_slip_with_phi_times_the_full_repulsion() {
        let v_rel = Vec3::new(0.3, 0.5, 0.0);
        let action = law(Coulomb::new(0.2, 0.01)).action::<Separate>(-0.002, &Vec3::x(), &v_rel, &Vec3::y());
        assert_eq!(action.turning, Vec3::zeros());
        let f = 10.0 * (0.3f64).exp();
        // Friction is not reduced by rho although the contact is opening; see docs/model.md on effective
        // friction.
        assert!((action.force.y + 0.2 * f).abs() < 1e-12);
        assert!((action.force.x - f * Dissipative::new(0.4, 10.0).share::<Separate>(-0.3)).abs() < 1e-12);
    }

    #[test]
    fn partners_feel_opposite_forces_and_equal_torques() {
        let law = law(Turning(Coulomb::new(0.2, 0.01)));
        let n = Vec3::new(0.6, -0.48, 0.64);
        let v = Vec3::new(0.1, 0.7, -0.2);
        let spins = Vec3::new(0.3, -0.1, 0.2);
        let on_i = law.action::<Separate>(-0.003, &n, &v, &spins);
        let on_j = law.action::<Separate>(-0.003, &-n, &-v, &spins);
        assert_eq!(on_i.force, -on_j.force);
        assert_eq!(on_i.turning, on_j.turning);
    }

    #[test]
    fn stored_energy_is_the_work_of_the_force_at_rest() {
        let law = law(Frictionless);
        let (a, b, steps) = (-0.01, 0.1, 200_000);
        let width = (b - a) / steps as f64;
        let work: f64 =
            (0..steps).map(|k| 0.58 * law.repulsion::<Separate>(a + (k as f64 + 0.5) * width) * width).sum();
        let stored = |gap: f64| law.energies().stored::<Separate>(gap);
        assert!((stored(a) - work).abs() < 1e-9 * work);
        assert_eq!(stored(0.1), 0.0);
        assert_eq!(stored(0.2), 0.0);
    }
}
