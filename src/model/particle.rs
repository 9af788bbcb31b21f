//! The state of a particle: position, velocity and, if the scene has rotation, angular velocity.
//!
//! Rotation is a type parameter. Without rotation it is `Locked`, which occupies no memory, so states and
//! messages hold no angular velocity.

use crate::math::elementary::Arithmetic;
use crate::math::larger;
use crate::math::vector::{Vec3, add_cross, cross, plus, scaled};
use crate::ode::{Linear, Weights};

/// The rotation of a particle: none (`Locked`) or an angular velocity (`Spinning`).
///
/// The same type holds an angular velocity (rad/s), an angular acceleration (rad/s^2) or a torque (N m).
pub trait Spin: Copy + Send + Sync + PartialEq + std::fmt::Debug + 'static {
    /// Number of components per particle: 0 or 3.
    const COMPONENTS: usize;
    /// No rotation.
    fn zero() -> Self;
    /// The rotation with the angular velocity `w`, rad/s; `Locked` ignores it.
    fn from_vector(w: Vec3) -> Self;
    /// The rotation as a vector; zero for `Locked`.
    fn vector(&self) -> Vec3;
    /// The sum of both.
    fn plus(&self, other: &Self) -> Self;
    /// The rotation times `s`.
    fn scaled(&self, s: f64) -> Self;
    /// v - r w x n, as in eqs. (2.7) and (2.10): `v` (m/s) minus the velocity that the rotation gives the
    /// point at distance `r` (m) from the centre along the unit vector `n`.
    fn less_surface_velocity<A: Arithmetic>(&self, r: f64, n: &Vec3, v: &Vec3) -> Vec3;
    /// Torque -r n x F on a sphere of radius `r` (m), by the force `f` (N) at the point -r n, eqs. (2.11) and
    /// (2.12).
    fn torque<A: Arithmetic>(r: f64, n: &Vec3, f: &Vec3) -> Self;
    /// Largest magnitude of a component; NaN counts as +infinity.
    fn max_abs(&self) -> f64;
}

/// No rotation: the basic and friction variants. Occupies no memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Locked;

/// Rotation with this angular velocity, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(transparent)]
pub struct Spinning(pub Vec3);

impl Spin for Locked {
    const COMPONENTS: usize = 0;
    #[inline(always)]
    fn zero() -> Self {
        Locked
    }
    #[inline(always)]
    fn from_vector(_w: Vec3) -> Self {
        Locked
    }
    #[inline(always)]
    fn vector(&self) -> Vec3 {
        Vec3::zeros()
    }
    #[inline(always)]
    fn plus(&self, _other: &Self) -> Self {
        Locked
    }
    #[inline(always)]
    fn scaled(&self, _s: f64) -> Self {
        Locked
    }
    #[inline(always)]
    fn less_surface_velocity<A: Arithmetic>(&self, _r: f64, _n: &Vec3, v: &Vec3) -> Vec3 {
        *v
    }
    #[inline(always)]
    fn torque<A: Arithmetic>(_r: f64, _n: &Vec3, _f: &Vec3) -> Self {
        Locked
    }
    fn max_abs(&self) -> f64 {
        0.0
    }
}

impl Spin for Spinning {
    const COMPONENTS: usize = 3;
    #[inline(always)]
    fn zero() -> Self {
        Spinning(Vec3::zeros())
    }
    #[inline(always)]
    fn from_vector(w: Vec3) -> Self {
        Spinning(w)
    }
    #[inline(always)]
    fn vector(&self) -> Vec3 {
        self.0
    }
    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        Spinning(plus(&self.0, &other.0))
    }
    #[inline(always)]
    fn scaled(&self, s: f64) -> Self {
        Spinning(scaled(s, &self.0))
    }
    #[inline(always)]
    fn less_surface_velocity<A: Arithmetic>(&self, r: f64, n: &Vec3, v: &Vec3) -> Vec3 {
        add_cross::<A>(n, &scaled(r, &self.0), v)
    }
    #[inline(always)]
    fn torque<A: Arithmetic>(r: f64, n: &Vec3, f: &Vec3) -> Self {
        Spinning(cross::<A>(f, &scaled(r, n)))
    }
    #[inline(always)]
    fn max_abs(&self) -> f64 {
        max_abs(&self.0)
    }
}

/// State of one particle: position, velocity and rotation; or the time derivatives of these.
///
/// The order in memory is that of the fields, so that adjacent components can be loaded together.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Motion<W> {
    /// Position of the centre, m; as a derivative, m/s.
    pub x: Vec3,
    /// Velocity, m/s; as a derivative, m/s^2.
    pub v: Vec3,
    /// Angular velocity, rad/s; as a derivative, rad/s^2.
    pub omega: W,
}

impl<W: Spin> Motion<W> {
    /// Number of components of a state: 6 or 9.
    pub const COMPONENTS: usize = 6 + W::COMPONENTS;

    /// Writes the state as x, v, omega into `slots`, which holds `COMPONENTS` numbers.
    pub fn pack(&self, slots: &mut [f64]) {
        slots[..3].copy_from_slice(self.x.as_slice());
        slots[3..6].copy_from_slice(self.v.as_slice());
        slots[6..Self::COMPONENTS].copy_from_slice(&self.omega.vector().as_slice()[..W::COMPONENTS]);
    }

    /// Reads a state that `pack` wrote.
    pub fn unpack(slots: &[f64]) -> Self {
        let vector = |s: &[f64]| Vec3::new(s[0], s[1], s[2]);
        let omega = if W::COMPONENTS == 3 { W::from_vector(vector(&slots[6..9])) } else { W::zero() };
        Motion { x: vector(&slots[..3]), v: vector(&slots[3..6]), omega }
    }
}

impl<W: Spin> Linear for Motion<W> {
    fn zero() -> Self {
        Motion { x: Vec3::zeros(), v: Vec3::zeros(), omega: W::zero() }
    }
    #[inline(always)]
    fn add_scaled(&mut self, s: f64, other: &Self) {
        self.x += other.x * s;
        self.v += other.v * s;
        self.omega = self.omega.plus(&other.omega.scaled(s));
    }
    #[inline(always)]
    fn magnitude(&self, weights: &Weights) -> f64 {
        let (x, v) = (weights.x * max_abs(&self.x), weights.v * max_abs(&self.v));
        larger(larger(x, v), weights.omega * self.omega.max_abs())
    }
    #[inline(always)]
    fn kick(&mut self, h: f64, slope: &Self) {
        self.v += slope.v * h;
        self.omega = self.omega.plus(&slope.omega.scaled(h));
    }
    #[inline(always)]
    fn drift(&mut self, h: f64) {
        self.x += self.v * h;
    }
}

#[inline(always)]
fn max_abs(x: &Vec3) -> f64 {
    larger(larger(larger(0.0, x.x.abs()), x.y.abs()), x.z.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_particle_carries_no_spin() {
        assert_eq!(size_of::<Motion<Locked>>(), 48);
        assert_eq!(size_of::<Motion<Spinning>>(), 72);
    }

    #[test]
    fn a_state_survives_packing() {
        let v = |s: f64| Vec3::new(s, s + 0.5, -s);
        let spinning = Motion { x: v(1.0), v: v(2.0), omega: Spinning(v(3.0)) };
        let mut slots = [0.0; 9];
        spinning.pack(&mut slots);
        assert_eq!(Motion::<Spinning>::unpack(&slots), spinning);
        let locked = Motion { x: v(1.0), v: v(2.0), omega: Locked };
        locked.pack(&mut slots[..6]);
        assert_eq!(Motion::<Locked>::unpack(&slots[..6]), locked);
    }

    #[test]
    fn not_a_number_is_the_largest_magnitude() {
        for at in 0..3 {
            let mut m = Motion { x: Vec3::zeros(), v: Vec3::new(1.0, -9.0, 2.0), omega: Locked };
            assert_eq!(m.max_abs(), 9.0);
            m.v[at] = f64::NAN;
            assert_eq!(m.max_abs(), f64::INFINITY);
        }
    }
}
