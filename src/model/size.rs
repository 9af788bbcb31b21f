//! Radius and mass of spheres, and what they mean for a contact.
//!
//! With radii r_i and r_j the paper's equations for equal spheres become:
//!
//! - the gap is l = d - (r_i + r_j), with the distance d of the centres;
//! - the slip is that of s_i + s_j, with the spins s = r w, and the torque over the radius is the same on
//!   both;
//! - with friction that remembers, the levers are a_i = r_i d/(r_i + r_j) and a_j = r_j d/(r_i + r_j), which
//!   together are d: angular momentum is kept, and a pair that turns as a whole is not sheared;
//! - a slip moves m_e/3.5, or m_e without rotation, with 1/m_e = 1/m_i + 1/m_j;
//! - rolling and twisting have the reduced radius R = r_i r_j/(r_i + r_j). They move the mass m_t with
//!   1/m_t = 2.5 (c_i^2/m_i + c_j^2/m_j), c_i = R/r_i and c_j = R/r_j.
//!
//! A wall is a partner with an infinite radius that does not turn: l = depth - r_i, a = r_i + l and R = r_i.

/// Radius and mass of a sphere, with their inverses.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::size::Size;
///
/// let bead = Size::new(2e-3, 1e-4);
/// assert_eq!((bead.r, bead.mass), (2e-3, 1e-4)); // m, kg
/// assert_eq!(bead.per_r, 500.0); // 1/m
/// let dust = Size::new(1e-3, 1.25e-5);
/// assert_eq!(bead.lightest_of([bead, dust].into_iter()), 0.5); // m/r is a quarter
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Radius, m.
    pub r: f64,
    /// 1/r, 1/m.
    pub per_r: f64,
    /// Mass, kg.
    pub mass: f64,
    /// 1/m, 1/kg.
    pub per_mass: f64,
}

impl Size {
    /// A sphere with the radius `r` (m) and this `mass` (kg).
    pub fn new(r: f64, mass: f64) -> Self {
        Size { r, per_r: 1.0 / r, mass, per_mass: 1.0 / mass }
    }

    /// Root of m/r of the one of `others` for which it is least, over that of this typical sphere; at most 1.
    ///
    /// Forces of contacts go with m v^2/r: a force that such a sphere does not feel is smaller by its square.
    pub fn lightest_of(&self, others: impl Iterator<Item = Size>) -> f64 {
        let share = |size: Size| (size.mass * size.per_r / (self.mass * self.per_r)).sqrt();
        others.map(share).fold(1.0, f64::min)
    }
}

/// What the squared distance that sphere `k` moves is multiplied by, so that it compares with those of
/// spheres with the typical radius `r` (m). Without `sizes` all are typical.
#[inline(always)]
pub fn squared_scale(sizes: &[Size], k: usize, r: f64) -> f64 {
    match sizes.get(k) {
        None => 1.0,
        Some(size) => (r * size.per_r) * (r * size.per_r),
    }
}

/// The sizes of some spheres.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::size::{Size, Sizes};
///
/// let [small, large] = [Size::new(0.1, 1.0), Size::new(0.2, 8.0)];
/// assert_eq!(Sizes::Equal(small).of(17), small);
/// assert_eq!(Sizes::Each(&[small, large]).of(1), large);
/// assert_eq!(Sizes::Each(&[small, large, small]).from(1).of(0), large);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sizes<'a> {
    /// All have this size.
    Equal(Size),
    /// The size of each.
    Each(&'a [Size]),
}

impl<'a> Sizes<'a> {
    /// The size of sphere `k`.
    #[inline(always)]
    pub fn of(&self, k: usize) -> Size {
        match self {
            Sizes::Equal(size) => *size,
            Sizes::Each(sizes) => sizes[k],
        }
    }

    /// The sizes of the spheres from `first` on.
    #[inline(always)]
    pub fn from(self, first: usize) -> Sizes<'a> {
        match self {
            Sizes::Equal(size) => Sizes::Equal(size),
            Sizes::Each(sizes) => Sizes::Each(&sizes[first..]),
        }
    }
}

/// What the sizes of both partners mean for their contact.
///
/// # Examples
///
/// ```rust
/// use demhybrid::model::size::{Partners, Size};
///
/// let [small, large] = [Size::new(0.1, 1.0), Size::new(0.3, 27.0)];
/// let alike = Partners::of_pair(&small, &small, 1.0);
/// assert_eq!((alike.surfaces, alike.slipped, alike.turned, alike.arms), (0.2, 1.0, 1.0, [1.0; 2]));
/// let differ = Partners::of_pair(&small, &large, 1.0);
/// assert_eq!(differ.surfaces, 0.4); // r_i + r_j, m
/// assert!((differ.arms[0] - 1.5).abs() < 1e-15); // 2 r_j/(r_i + r_j)
/// assert_eq!(Partners::of_wall(&large, 27.0).surfaces, 0.3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Partners {
    /// r_i + r_j, m; r_i for a wall.
    pub surfaces: f64,
    /// Its inverse, 1/m.
    pub per_surfaces: f64,
    /// Factor of the damping of slip: the root of the mass that it moves, over that of two typical spheres,
    /// or of one at a wall.
    pub slipped: f64,
    /// The same factor for rolling and twisting.
    pub turned: f64,
    /// 2 R/r_i and 2 R/r_j; 1 for a wall.
    pub arms: [f64; 2],
}

impl Partners {
    /// Two spheres, where a typical sphere has the mass `typical` (kg).
    #[inline(always)]
    pub fn of_pair(i: &Size, j: &Size, typical: f64) -> Self {
        Self::between([i.r, j.r], [i.per_mass, j.per_mass], typical, true)
    }

    /// `of_pair` for spheres with the radii `r` (m) and these inverses of masses (1/kg). Without `resists`,
    /// where nothing resists rolling or twisting, `turned` is not computed.
    #[inline(always)]
    pub fn between(r: [f64; 2], per_mass: [f64; 2], typical: f64, resists: bool) -> Self {
        let surfaces = r[0] + r[1];
        let per_surfaces = 1.0 / surfaces;
        let arms = [2.0 * r[1] * per_surfaces, 2.0 * r[0] * per_surfaces];
        let turned = || {
            let per_mass = arms[0] * arms[0] * per_mass[0] + arms[1] * arms[1] * per_mass[1];
            (2.0 / (typical * per_mass)).sqrt()
        };
        Partners {
            surfaces,
            per_surfaces,
            slipped: (2.0 / (typical * (per_mass[0] + per_mass[1]))).sqrt(),
            turned: if resists { turned() } else { 1.0 },
            arms,
        }
    }

    /// A sphere and a wall.
    #[inline(always)]
    pub fn of_wall(i: &Size, typical: f64) -> Self {
        let factor = (i.mass / typical).sqrt();
        Partners { surfaces: i.r, per_surfaces: i.per_r, slipped: factor, turned: factor, arms: [1.0; 2] }
    }

    /// Spheres that are all typical: a pair, or one at a wall.
    pub fn alike(r: f64, wall: bool) -> Self {
        let surfaces = if wall { r } else { 2.0 * r };
        Partners { surfaces, per_surfaces: 1.0 / surfaces, slipped: 1.0, turned: 1.0, arms: [1.0; 2] }
    }
}
