//! Vectors in space, and the vector arithmetic of the contact kernel.

use super::elementary::Arithmetic;
use nalgebra::Vector3;

/// A vector in space. Each use states its unit.
pub type Vec3 = Vector3<f64>;

// The functions below are written out by component and always inlined. nalgebra's operators may remain loops
// and calls, and then the compiler does not vectorise a loop over contacts.

/// The vector of three numbers.
#[inline(always)]
pub fn vector(numbers: &[f64]) -> Vec3 {
    Vec3::new(numbers[0], numbers[1], numbers[2])
}

/// a . b
#[inline(always)]
pub fn dot<A: Arithmetic>(a: &Vec3, b: &Vec3) -> f64 {
    A::add_product(a.z, b.z, A::add_product(a.y, b.y, a.x * b.x))
}

/// s a + b
#[inline(always)]
pub fn add_scaled<A: Arithmetic>(s: f64, a: &Vec3, b: &Vec3) -> Vec3 {
    let component = |a, b| A::add_product(s, a, b);
    Vec3::new(component(a.x, b.x), component(a.y, b.y), component(a.z, b.z))
}

/// a x b
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::elementary::Separate;
/// use demhybrid::math::vector::{Vec3, cross, dot};
///
/// let n = cross::<Separate>(&Vec3::x(), &Vec3::y());
/// assert_eq!(n, Vec3::z());
/// assert_eq!(dot::<Separate>(&n, &Vec3::new(1.0, 2.0, 3.0)), 3.0);
/// ```
#[inline(always)]
pub fn cross<A: Arithmetic>(a: &Vec3, b: &Vec3) -> Vec3 {
    let component = |[p, q]: [f64; 2], [r, s]: [f64; 2]| A::add_product(-r, s, p * q);
    Vec3::new(
        component([a.y, b.z], [a.z, b.y]),
        component([a.z, b.x], [a.x, b.z]),
        component([a.x, b.y], [a.y, b.x]),
    )
}

/// a x b + c
#[inline(always)]
pub fn add_cross<A: Arithmetic>(a: &Vec3, b: &Vec3, c: &Vec3) -> Vec3 {
    let component = |[p, q]: [f64; 2], [r, s]: [f64; 2], c| A::add_product(-r, s, A::add_product(p, q, c));
    Vec3::new(
        component([a.y, b.z], [a.z, b.y], c.x),
        component([a.z, b.x], [a.x, b.z], c.y),
        component([a.x, b.y], [a.y, b.x], c.z),
    )
}

/// a + b
#[inline(always)]
pub fn plus(a: &Vec3, b: &Vec3) -> Vec3 {
    Vec3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

/// a - b
#[inline(always)]
pub fn minus(a: &Vec3, b: &Vec3) -> Vec3 {
    Vec3::new(a.x - b.x, a.y - b.y, a.z - b.z)
}

/// s a
#[inline(always)]
pub fn scaled(s: f64, a: &Vec3) -> Vec3 {
    Vec3::new(s * a.x, s * a.y, s * a.z)
}
