//! Convex polyhedra: what half-spaces have in common.

use super::vector::Vec3;

/// A half-space: the points x with n . x <= b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Half {
    /// Outward unit normal.
    pub n: Vec3,
    /// Distance of the plane from the origin along `n`, m.
    pub b: f64,
}

impl Half {
    /// The half-space moved by `d` (m).
    pub fn moved(&self, d: &Vec3) -> Half {
        Half { n: self.n, b: self.b + self.n.dot(d) }
    }

    /// Distance of `x` (m) from the plane, m; positive outside.
    pub fn beyond(&self, x: &Vec3) -> f64 {
        self.n.dot(x) - self.b
    }
}

/// A face of a polyhedron.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// The half-space that it bounds.
    pub half: Half,
    /// Index of that half-space among those given; `None`: it belongs to the box that was cut.
    pub source: Option<usize>,
    /// Its corners in order, m.
    pub corners: Vec<Vec3>,
}

impl Face {
    /// Area, m^2.
    pub fn area(&self) -> f64 {
        let first = self.corners[0];
        let twice: Vec3 =
            self.corners.windows(2).map(|ends| (ends[0] - first).cross(&(ends[1] - first))).sum();
        0.5 * twice.norm()
    }
}

/// A convex polyhedron, as its faces. Without faces it is empty.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::polyhedron::{Half, Polyhedron};
/// use demhybrid::math::vector::Vec3;
///
/// // The octahedron |x| + |y| + |z| <= 1 has the volume 4/3.
/// let signs = (0..8).map(|k| Vec3::from_fn(|axis, _| if k >> axis & 1 == 0 { 1.0 } else { -1.0 }));
/// let halves: Vec<Half> =
///     signs.map(|n| Half { n: n / 3f64.sqrt(), b: 1.0 / 3f64.sqrt() }).collect();
/// let octahedron = Polyhedron::of(&halves);
/// assert_eq!(octahedron.faces.len(), 8);
/// assert!((octahedron.volume() - 4.0 / 3.0).abs() < 1e-14);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Polyhedron {
    /// Its faces, in no particular order.
    pub faces: Vec<Face>,
}

/// Half the side of the box from which the cutting begins, over the largest distance of a plane from the
/// origin. Only what planes enclose at angles below a millionth reaches further.
const FAR: f64 = 1e6;
/// Points closer to a plane than this share of the size of a polyhedron are on it. It is far above rounding.
const ON_PLANE: f64 = 1e-12;

impl Polyhedron {
    /// The box between two corners, m.
    pub fn cuboid(low: &Vec3, high: &Vec3) -> Self {
        let mut faces = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for (sign, at) in [(1.0, high[axis]), (-1.0, low[axis])] {
                let corner = |[along_u, along_v]: [&Vec3; 2]| {
                    let mut corner = Vec3::zeros();
                    (corner[axis], corner[u], corner[v]) = (at, along_u[u], along_v[v]);
                    corner
                };
                let mut n = Vec3::zeros();
                n[axis] = sign;
                faces.push(Face {
                    half: Half { n, b: sign * at },
                    source: None,
                    corners: [[low, low], [high, low], [high, high], [low, high]].map(corner).to_vec(),
                });
            }
        }
        Polyhedron { faces }
    }

    /// What all `halves` have in common, which must be bounded.
    ///
    /// It is cut out of a large box first, and then, for the last digits, out of one that just holds it.
    pub fn of(halves: &[Half]) -> Self {
        let far = Vec3::repeat(FAR * scale(halves));
        let rough = Self::cuboid(&-far, &far).cut_by(halves);
        match rough.faces.is_empty() {
            true => rough,
            false => {
                let (low, high) = rough.bounds();
                let margin = Vec3::repeat(0.05 * (high - low).norm());
                Self::cuboid(&(low - margin), &(high + margin)).cut_by(halves)
            }
        }
    }

    /// The part of it inside all `halves`.
    pub fn cut_by(mut self, halves: &[Half]) -> Self {
        for (k, half) in halves.iter().enumerate() {
            self.cut(half, k);
        }
        self
    }

    /// Takes away what is outside `half`, the half-space of index `source`.
    pub fn cut(&mut self, half: &Half, source: usize) {
        let (mut largest, mut furthest) = (0.0f64, f64::NEG_INFINITY);
        for corner in self.corners() {
            largest = largest.max(half.beyond(corner).abs());
            furthest = furthest.max(half.beyond(corner));
        }
        let tiny = ON_PLANE * largest;
        if furthest <= tiny {
            return;
        }
        let mut rim = Vec::new();
        self.faces.retain_mut(|face| {
            cut_polygon(&mut face.corners, half, tiny, &mut rim);
            face.corners.len() > 2
        });
        let corners = in_order(rim, &half.n, tiny);
        if self.faces.is_empty() || corners.len() < 3 {
            // Nothing is left, or all that is left is on the plane.
            self.faces.clear();
            return;
        }
        self.faces.push(Face { half: *half, source: Some(source), corners });
    }

    /// The corners of all faces, m. Each corner comes once for each face that has it.
    pub fn corners(&self) -> impl Iterator<Item = &Vec3> {
        self.faces.iter().flat_map(|face| &face.corners)
    }

    /// Lower and upper corner of the box around it, m; zero if it is empty.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let all = self.corners().map(|x| (*x, *x)).reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)));
        all.unwrap_or_default()
    }

    /// The largest distance of any of its points from the origin along the unit vector `along`, m.
    ///
    /// Where a face is across `along`, it is the distance of the plane that was given, to the last digit.
    pub fn reach(&self, along: &Vec3) -> f64 {
        let across = self.faces.iter().find(|face| (face.half.n - along).amax() < 1e-14);
        match across {
            Some(face) => face.half.b,
            None => self.corners().map(|x| along.dot(x)).fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Volume, m^3: the sum of the pyramids from one point to all faces.
    pub fn volume(&self) -> f64 {
        let Some(tip) = self.corners().next() else { return 0.0 };
        let pyramids = self.faces.iter().map(|face| -face.half.beyond(tip) * face.area() / 3.0);
        pyramids.sum::<f64>().max(0.0)
    }
}

/// Largest distance of any plane from the origin, m; 1 if all planes go through it.
fn scale(halves: &[Half]) -> f64 {
    let largest = halves.iter().map(|half| half.b.abs()).fold(0.0, f64::max);
    if largest > 0.0 { largest } else { 1.0 }
}

/// Keeps the part of a polygon inside `half`, and adds what is on its plane to `rim`.
fn cut_polygon(corners: &mut Vec<Vec3>, half: &Half, tiny: f64, rim: &mut Vec<Vec3>) {
    if corners.iter().all(|corner| half.beyond(corner) < -tiny) {
        return;
    }
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (k, p) in corners.iter().enumerate() {
        let q = &corners[(k + 1) % corners.len()];
        let (at_p, at_q) = (half.beyond(p), half.beyond(q));
        if at_p <= tiny {
            kept.push(*p);
            if at_p >= -tiny {
                rim.push(*p);
            }
        }
        if at_p.max(at_q) > tiny && at_p.min(at_q) < -tiny {
            // From the inner end, so that both faces at this edge find the same bits.
            let (inner, outer, from, to) = if at_p < at_q { (p, q, at_p, at_q) } else { (q, p, at_q, at_p) };
            let crossing = inner + (outer - inner) * (from / (from - to));
            kept.push(crossing);
            rim.push(crossing);
        }
    }
    *corners = kept;
}

/// The points of a convex polygon with the normal `n`, in order around their middle, each once.
fn in_order(mut points: Vec<Vec3>, n: &Vec3, tiny: f64) -> Vec<Vec3> {
    if points.is_empty() {
        return points;
    }
    let middle = points.iter().sum::<Vec3>() / points.len() as f64;
    let (u, v) = across(n);
    let angle = |x: &Vec3| (x - middle).dot(&v).atan2((x - middle).dot(&u));
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    points.dedup_by(|b, a| (*b - *a).amax() <= 4.0 * tiny);
    while points.len() > 1 && (points[0] - points[points.len() - 1]).amax() <= 4.0 * tiny {
        points.pop();
    }
    points
}

/// Two unit vectors across the unit vector `n` and across each other, so that u x v = n.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::polyhedron::across;
/// use demhybrid::math::vector::Vec3;
///
/// assert_eq!(across(&Vec3::z()), (Vec3::x(), Vec3::y()));
/// ```
pub fn across(n: &Vec3) -> (Vec3, Vec3) {
    let axis = if n.x.abs() < 0.9 { Vec3::x() } else { Vec3::y() };
    let u = (axis - n * n.dot(&axis)).normalize();
    (u, n.cross(&u))
}

/// Whether what all `halves` have in common has no end along the unit vector `d`.
///
/// That is so where some direction with a part along `d` leads out of no plane. The directions of each
/// quarter of the half-space around `d` form a cone with three edges, and every plane cuts it.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::polyhedron::{Half, is_open};
/// use demhybrid::math::vector::Vec3;
///
/// // A wedge that opens upwards also has no end on both sides, but it has a lowest line.
/// let wedge = [1.0, -1.0].map(|side| Half { n: Vec3::new(side, 0.0, -1.0).normalize(), b: 0.0 });
/// assert!(is_open(&wedge, &Vec3::z()) && is_open(&wedge, &Vec3::x()) && !is_open(&wedge, &-Vec3::z()));
/// ```
pub fn is_open(halves: &[Half], d: &Vec3) -> bool {
    let (u, v) = across(d);
    let quarters = [[u, v], [v, -u], [-u, -v], [-v, u]];
    quarters.iter().any(|[a, b]| {
        let mut edges = vec![*d, *a, *b];
        for half in halves {
            cut_polygon(&mut edges, &Half { n: half.n, b: 0.0 }, ON_PLANE, &mut Vec::new());
            edges.iter_mut().for_each(|edge| *edge = edge.normalize());
        }
        edges.iter().any(|edge| edge.dot(d) > 1e-9)
    })
}

/// The smallest distance along the unit vector `up` from the origin to what all `halves` have in common, m.
///
/// `None` if they leave it open below, or have nothing in common.
///
/// # Examples
///
/// ```rust
/// use demhybrid::math::polyhedron::{Half, lowest};
/// use demhybrid::math::vector::Vec3;
///
/// let floor = Half { n: -Vec3::z(), b: 3.0 };
/// assert_eq!(lowest(&[floor], &Vec3::z()), Some(-3.0)); // m
/// assert_eq!(lowest(&[floor], &Vec3::x()), None);
/// ```
pub fn lowest(halves: &[Half], up: &Vec3) -> Option<f64> {
    if is_open(halves, &-up) {
        return None;
    }
    let far = Vec3::repeat(FAR * scale(halves));
    let large = Polyhedron::cuboid(&-far, &far).cut_by(halves);
    let bottom = *large.corners().min_by(|a, b| up.dot(a).total_cmp(&up.dot(b)))?;
    // Once more in a box around the lowest corner, for the last digits.
    let around = far / FAR;
    let fine = Polyhedron::cuboid(&(bottom - around), &(bottom + around)).cut_by(halves);
    // A box that the planes cut down to a point leaves no faces.
    Some(if fine.faces.is_empty() { up.dot(&bottom) } else { -fine.reach(&-up) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn half(n: [f64; 3], b: f64) -> Half {
        let n = Vec3::from(n);
        Half { n: n.normalize(), b: b / n.norm() }
    }

    fn near(found: f64, exact: f64) {
        assert!((found - exact).abs() <= 1e-14 * exact.abs(), "{found} is not {exact}");
    }

    /// The sides of a tube of `sides` planes at the distance `radius` (m) from the z axis.
    fn tube(sides: usize, radius: f64) -> Vec<Half> {
        let angle = |k: usize| 2.0 * PI * (k as f64 + 0.5) / sides as f64;
        (0..sides).map(|k| half([angle(k).cos(), angle(k).sin(), 0.0], radius)).collect()
    }

    #[test]
    fn wedge_octahedron_and_tube_have_their_exact_volumes() {
        // A triangle with two equal sides of slope 1, 2 m high, is 4 m^2 large.
        let wedge = [
            half([1.0, 0.0, -1.0], 0.0),
            half([-1.0, 0.0, -1.0], 0.0),
            half([0.0, 0.0, 1.0], 2.0),
            half([0.0, 1.0, 0.0], 3.0),
            half([0.0, -1.0, 0.0], 0.0),
        ];
        near(Polyhedron::of(&wedge).volume(), 4.0 * 3.0);
        let sign = |k: usize, axis: usize| if k >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let eight: Vec<Half> = (0..8).map(|k| half([sign(k, 0), sign(k, 1), sign(k, 2)], 1.0)).collect();
        let octahedron = Polyhedron::of(&eight);
        near(octahedron.volume(), 4.0 / 3.0);
        near(octahedron.faces.iter().map(Face::area).sum(), 4.0 * 3f64.sqrt());
        // A regular polygon with 24 sides around a circle of radius R has the area 24 R^2 tan(pi/24).
        let mut prism = tube(24, 0.8);
        prism.extend([half([0.0, 0.0, -1.0], 0.0), half([0.0, 0.0, 1.0], 1.5)]);
        let found = Polyhedron::of(&prism);
        near(found.volume(), 24.0 * 0.64 * (PI / 24.0).tan() * 1.5);
        // Planes that are there twice, or touch in a corner only, change nothing.
        prism.extend(tube(24, 0.8));
        prism.push(half([0.0, 1.0, 1.0], 1.5 + 0.8 / (PI / 24.0).cos()));
        let again = Polyhedron::of(&prism);
        near(again.volume(), found.volume());
        assert_eq!(again.faces.len(), 26);
    }

    #[test]
    fn volumes_are_exact_far_from_the_origin_and_at_any_angle() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.1);
        for away in [0.0, 1e3] {
            let cube: Vec<Half> = (0..6)
                .map(|k| {
                    let mut n = Vec3::zeros();
                    n[k / 2] = if k % 2 == 0 { 1.0 } else { -1.0 };
                    Half { n: turn * n, b: 0.5 }.moved(&Vec3::new(away, -away, 0.5 * away))
                })
                .collect();
            let volume = Polyhedron::of(&cube).volume();
            // Positions of 1e3 m have 1e-13 m of rounding.
            assert!((volume - 1.0).abs() < 1e-14 + 2e-15 * away, "{volume}");
        }
    }

    #[test]
    fn planes_with_nothing_in_common_leave_nothing() {
        let apart = [half([1.0, 0.0, 0.0], -1.0), half([-1.0, 0.0, 0.0], -1.0)];
        let cut = Polyhedron::cuboid(&Vec3::repeat(-3.0), &Vec3::repeat(3.0)).cut_by(&apart);
        assert_eq!(cut.volume(), 0.0);
        // Two planes that coincide and face each other.
        let flat = [half([1.0, 0.0, 0.0], 1.0), half([-1.0, 0.0, 0.0], -1.0)];
        let cut = Polyhedron::cuboid(&Vec3::repeat(-3.0), &Vec3::repeat(3.0)).cut_by(&flat);
        assert_eq!(cut.volume(), 0.0);
    }

    #[test]
    fn open_directions_are_those_that_no_plane_ends() {
        let up = Vec3::z();
        let sides = tube(24, 1.0);
        assert!(is_open(&sides, &up) && is_open(&sides, &-up));
        assert!(!is_open(&sides, &Vec3::x()) && !is_open(&sides, &Vec3::new(0.6, 0.8, 0.0)));
        assert!(is_open(&sides, &Vec3::new(0.6, 0.0, 0.8)));
        // A floor that is tilted by ever so little has no lowest point.
        assert!(is_open(&[half([1e-6, 0.0, -1.0], 0.0)], &-up));
        assert!(!is_open(&[half([0.0, 0.0, -1.0], 0.0)], &-up));
        assert!(is_open(&[], &up));
        // A funnel narrows upwards and is closed there.
        let funnel: Vec<Half> =
            tube(5, 1.0).iter().map(|side| half((side.n + 0.1 * up).into(), 1.0)).collect();
        assert!(!is_open(&funnel, &up) && is_open(&funnel, &-up));
    }

    #[test]
    fn the_lowest_point_is_a_plane_or_a_corner() {
        let up = Vec3::new(0.6, 0.0, 0.8);
        let corner: Vec<Half> =
            [-Vec3::x(), -Vec3::y(), -Vec3::z()].map(|n| Half { n, b: 0.5 }.moved(&-Vec3::x())).to_vec();
        near(lowest(&corner, &up).unwrap(), -0.9 - 0.4);
        assert_eq!(lowest(&[Half { n: -up, b: 0.3 }], &up), Some(-0.3));
        assert_eq!(lowest(&[], &up), None);
    }
}
