//! The camera: its position, from which all spheres are visible, and the ray through a point of the picture.

use crate::error::Error;
use crate::math::vector::Vec3;

use super::options::{Projection, Size};

/// Half the angle of view of the shorter side of the picture, if the camera chooses its distance.
///
/// 14 degrees show perspective without distortion.
const HALF_ANGLE: f64 = 14.0 / 180.0 * std::f64::consts::PI;

/// Widest half angle of view, if the user gives the position.
const WIDEST: f64 = 60.0 / 180.0 * std::f64::consts::PI;

/// The user's options for the camera.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Direction from the spheres to the camera, any length.
    pub direction: Vec3,
    /// Position of the camera, m; replaces the direction.
    pub from: Option<Vec3>,
    /// Point in the middle of the picture, m; `None`: the camera chooses it.
    pub target: Option<Vec3>,
    /// Direction that points up in the picture, any length.
    pub up: Vec3,
    /// How depth is drawn.
    pub projection: Projection,
    /// Magnification.
    pub zoom: f64,
}

/// A ball that must be visible: centre and radius, m.
pub type Ball = (Vec3, f64);

/// Part of the picture that holds the spheres, pixels: left, top, right, bottom.
pub type Frame = [f64; 4];

/// A camera. Its coordinates (m) are x to the right, y upwards, and z, the depth, away from the camera.
#[derive(Debug, Clone)]
pub struct Camera {
    position: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    projection: Projection,
    /// Pixels per metre (orthographic), or per unit of the slope of a ray (perspective).
    scale: f64,
    /// Pixel at which the optical axis meets the picture.
    centre: [f64; 2],
}

/// A ray in camera coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start of the ray, m.
    pub origin: Vec3,
    /// Direction, a unit vector.
    pub along: Vec3,
}

impl Camera {
    /// Creates a camera from the options `wanted` that shows all `balls` within `frame`.
    pub fn new(wanted: &Wanted, balls: &[Ball], size: Size, frame: Frame) -> Result<Self, Error> {
        let centre = [(frame[0] + frame[2]) / 2.0, (frame[1] + frame[3]) / 2.0];
        let half = [(frame[2] - frame[0]) / 2.0, (frame[3] - frame[1]) / 2.0];
        debug_assert!(half[0] > 0.0 && half[1] > 0.0 && frame[2] <= size.width as f64);
        let middle = wanted.target.unwrap_or_else(|| middle(balls));
        let back = match wanted.from {
            Some(from) => from - middle,
            None => wanted.direction,
        };
        let back = unit(&back).ok_or_else(|| {
            Error::Input(match wanted.from {
                Some(from) => format!(
                    "--from {}: the camera would stand in the point that it looks at; \
                     choose another position or --target",
                    listed(&from)
                ),
                None => "--direction 0,0,0: it must not be zero".into(),
            })
        })?;
        let up = unit(&wanted.up).ok_or_else(|| Error::Input("--up 0,0,0: it must not be zero".into()))?;
        // If the camera looks along `up`, another axis must be up.
        let sideways = |up: &Vec3| unit(&up.cross(&back)).filter(|_| up.cross(&back).norm() > 1e-6);
        let right = [up, Vec3::y(), Vec3::x()].iter().find_map(sideways).expect("x and y are not parallel");
        let up = back.cross(&right);
        let mut camera = Camera {
            position: middle,
            right,
            up,
            forward: -back,
            projection: wanted.projection,
            scale: 1.0,
            centre,
        };
        let in_view: Vec<Ball> = balls.iter().map(|&(x, r)| (camera.coordinates(&x), r)).collect();
        match (wanted.projection, wanted.from) {
            (Projection::Orthographic, _) => camera.fit_parallel(&in_view, half, wanted.target.is_none()),
            (Projection::Perspective, None) => camera.fit_distance(&in_view, half, wanted.target.is_none()),
            (Projection::Perspective, Some(from)) => {
                camera.position = from;
                let in_view: Vec<Ball> = balls.iter().map(|&(x, r)| (camera.coordinates(&x), r)).collect();
                camera.fit_angle(&in_view, half);
            }
        }
        camera.scale *= wanted.zoom;
        Ok(camera)
    }

    /// Fits parallel rays: chooses the largest scale at which all balls are in the frame.
    ///
    /// If `may_shift`, the middle of the balls is moved to the middle of the frame. The camera stands in
    /// front of all balls.
    fn fit_parallel(&mut self, in_view: &[Ball], half: [f64; 2], may_shift: bool) {
        let mut need = [0.0; 2];
        let mut shift = [0.0; 2];
        for axis in 0..2 {
            let (low, high) = extent(in_view, |(x, r)| [x[axis] - r, x[axis] + r]);
            shift[axis] = if may_shift { (low + high) / 2.0 } else { 0.0 };
            need[axis] = (high - shift[axis]).max(shift[axis] - low);
        }
        self.scale = (half[0] / need[0]).min(half[1] / need[1]);
        let (nearest, _) = extent(in_view, |(x, r)| [x.z - r, x.z + r]);
        let size = need[0].max(need[1]);
        self.position +=
            self.right * shift[0] + self.up * shift[1] + self.forward * (nearest.min(0.0) - size);
    }

    /// Fits the distance: the shortest one at which all balls are in the frame at the usual angle.
    ///
    /// If `may_shift`, the camera may also move sideways. A ball is in the frame if it is inside the plane
    /// through the camera and each side of the frame, by at least its radius.
    fn fit_distance(&mut self, in_view: &[Ball], half: [f64; 2], may_shift: bool) {
        self.scale = half[0].min(half[1]) / HALF_ANGLE.tan();
        let mut depth = f64::NEG_INFINITY;
        let mut sides = [[0.0; 2]; 2];
        for axis in 0..2 {
            let slope = half[axis] / self.scale;
            let spare = (1.0 + slope * slope).sqrt();
            // Largest value of +-x - depth slope + r spare, for the two sides.
            let (_, high) = extent(in_view, |(x, r)| [x[axis] - x.z * slope + r * spare; 2]);
            let (_, low) = extent(in_view, |(x, r)| [-x[axis] - x.z * slope + r * spare; 2]);
            sides[axis] = [low, high];
            let needed = if may_shift { (low + high) / 2.0 } else { low.max(high) } / slope;
            depth = depth.max(needed);
        }
        // The camera must not be among the balls, even if they are small in the picture.
        let (nearest, _) = extent(in_view, |(x, r)| [x.z - 1.5 * r; 2]);
        depth = depth.max(-nearest);
        let shift = sides.map(|[low, high]| if may_shift { (high - low) / 2.0 } else { 0.0 });
        self.position += self.right * shift[0] + self.up * shift[1] - self.forward * depth;
    }

    /// Fits the angle of view: the smallest one that shows all balls in front of the camera.
    fn fit_angle(&mut self, in_view: &[Ball], half: [f64; 2]) {
        let shorter = half[0].min(half[1]);
        let mut slope = 0.0f64;
        for (x, r) in in_view {
            for axis in 0..2 {
                let across = x[axis].abs().atan2(x.z);
                let away = x.z.hypot(x[axis]);
                let needed = if *r < away { across + (r / away).asin() } else { f64::INFINITY };
                slope = slope.max(needed.clamp(0.0, WIDEST).tan() * shorter / half[axis]);
            }
        }
        self.scale = shorter / slope.clamp(1e-9, WIDEST.tan());
    }

    /// Camera coordinates of the point `x`, m.
    pub fn coordinates(&self, x: &Vec3) -> Vec3 {
        let away = x - self.position;
        Vec3::new(away.dot(&self.right), away.dot(&self.up), away.dot(&self.forward))
    }

    /// A direction in space, in camera coordinates.
    pub fn turned(&self, direction: &Vec3) -> Vec3 {
        Vec3::new(direction.dot(&self.right), direction.dot(&self.up), direction.dot(&self.forward))
    }

    /// The ray through the point `(column, row)` of the picture, pixels.
    #[inline]
    pub fn ray(&self, column: f64, row: f64) -> Ray {
        let x = (column - self.centre[0]) / self.scale;
        let y = (self.centre[1] - row) / self.scale;
        match self.projection {
            Projection::Orthographic => Ray { origin: Vec3::new(x, y, 0.0), along: Vec3::z() },
            Projection::Perspective => {
                Ray { origin: Vec3::zeros(), along: Vec3::new(x, y, 1.0) / (x * x + y * y + 1.0).sqrt() }
            }
        }
    }

    /// Pixel of a point in camera coordinates. The point must be in front of the camera.
    pub fn pixel(&self, x: &Vec3) -> [f64; 2] {
        let scale = match self.projection {
            Projection::Orthographic => self.scale,
            Projection::Perspective => self.scale / x.z,
        };
        [self.centre[0] + scale * x.x, self.centre[1] - scale * x.y]
    }

    /// Whether all rays start at the camera.
    pub fn is_perspective(&self) -> bool {
        self.projection == Projection::Perspective
    }

    /// The part of the picture that a ball can cover, pixels: left, top, right, bottom.
    ///
    /// The ball is in camera coordinates. `None` if it is behind the camera.
    pub fn bounds(&self, (x, r): &Ball) -> Option<Frame> {
        if x.z + r <= 0.0 {
            return None;
        }
        let sides = |axis: usize| match self.projection {
            Projection::Orthographic => [x[axis] - r, x[axis] + r].map(|side| side * self.scale),
            Projection::Perspective => {
                // In the plane of this axis and depth the ball is a disc. Find the rays that touch it.
                let away = x.z.hypot(x[axis]);
                if x.z <= *r || away <= *r {
                    return [f64::NEG_INFINITY, f64::INFINITY];
                }
                let (across, half) = (x[axis].atan2(x.z), (r / away).asin());
                [across - half, across + half].map(|angle| angle.tan() * self.scale)
            }
        };
        let ([left, right], [bottom, top]) = (sides(0), sides(1));
        let [column, row] = self.centre;
        Some([column + left, row - top, column + right, row - bottom])
    }
}

/// Middle of the box around all balls.
fn middle(balls: &[Ball]) -> Vec3 {
    Vec3::from_fn(|axis, _| {
        let (low, high) = extent(balls, |(x, r)| [x[axis] - r, x[axis] + r]);
        (low + high) / 2.0
    })
}

/// The smallest of the first values that `of` returns, and the largest of the second ones.
fn extent(balls: &[Ball], of: impl Fn(&Ball) -> [f64; 2]) -> (f64, f64) {
    balls.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), ball| {
        let [a, b] = of(ball);
        (low.min(a), high.max(b))
    })
}

/// The unit vector along `v`; `None` if `v` has no direction.
fn unit(v: &Vec3) -> Option<Vec3> {
    let largest = v.amax();
    (largest > 0.0 && largest.is_finite()).then(|| (v / largest).normalize())
}

/// The vector as the command line has it.
fn listed(v: &Vec3) -> String {
    format!("{},{},{}", v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 400, height: 300 };
    const FRAME: Frame = [20.0, 10.0, 320.0, 290.0];

    fn wanted(projection: Projection) -> Wanted {
        let direction = Vec3::new(0.5, -1.0, 0.4);
        Wanted { direction, from: None, target: None, up: Vec3::z(), projection, zoom: 1.0 }
    }

    fn balls() -> Vec<Ball> {
        [[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.4, 2.0, 0.3], [0.6, 0.1, 1.5]].map(|x| (x.into(), 0.15)).into()
    }

    /// The part of the picture that all balls cover: left, top, right, bottom.
    fn covered(camera: &Camera, balls: &[Ball]) -> Frame {
        let mut all = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for &(x, r) in balls {
            let one = camera.bounds(&(camera.coordinates(&x), r)).unwrap();
            for side in 0..4 {
                all[side] = if side < 2 { all[side].min(one[side]) } else { all[side].max(one[side]) };
            }
        }
        all
    }

    #[test]
    fn everything_is_in_view_and_fills_the_frame() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let camera = Camera::new(&wanted(projection), &balls(), SIZE, FRAME).unwrap();
            let covered = covered(&camera, &balls());
            let margins: Vec<f64> = (0..4).map(|side| (covered[side] - FRAME[side]).abs()).collect();
            assert!((0..2).all(|side| covered[side] > FRAME[side] - 1e-6), "{covered:?}");
            assert!((2..4).all(|side| covered[side] < FRAME[side] + 1e-6), "{covered:?}");
            // The balls touch the left and right sides, or the top and bottom ones.
            let touched = |a: usize, b: usize| margins[a] < 1e-6 && margins[b] < 1e-6;
            assert!(touched(0, 2) || touched(1, 3), "{covered:?}");
        }
    }

    #[test]
    fn everything_is_in_view_from_a_position_and_the_target_is_in_the_middle() {
        let mut wanted = wanted(Projection::Perspective);
        wanted.from = Some(Vec3::new(3.0, -4.0, 2.0));
        wanted.target = Some(Vec3::new(0.5, 0.5, 0.5));
        let camera = Camera::new(&wanted, &balls(), SIZE, FRAME).unwrap();
        let middle = camera.pixel(&camera.coordinates(&wanted.target.unwrap()));
        assert!((middle[0] - 170.0).abs() < 1e-9 && (middle[1] - 150.0).abs() < 1e-9, "{middle:?}");
        let covered = covered(&camera, &balls());
        assert!((0..2).all(|side| covered[side] > FRAME[side] - 1e-6), "{covered:?}");
        assert!((2..4).all(|side| covered[side] < FRAME[side] + 1e-6), "{covered:?}");
        assert!(camera.coordinates(&wanted.from.unwrap()).norm() < 1e-12);
    }

    #[test]
    fn rays_go_through_the_points_that_their_pixels_show() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let camera = Camera::new(&wanted(projection), &balls(), SIZE, FRAME).unwrap();
            for (x, _) in balls() {
                let x = camera.coordinates(&x);
                let [column, row] = camera.pixel(&x);
                let ray = camera.ray(column, row);
                let away = (x - ray.origin).cross(&ray.along).norm();
                assert!(away < 1e-9, "{away}");
            }
        }
    }

    #[test]
    fn the_camera_looks_down_as_well_and_up_is_up() {
        let mut wanted = wanted(Projection::Orthographic);
        wanted.direction = Vec3::z();
        let camera = Camera::new(&wanted, &balls(), SIZE, FRAME).unwrap();
        let [a, b] = [Vec3::zeros(), Vec3::y()].map(|x| camera.pixel(&camera.coordinates(&x)));
        assert!(b[1] < a[1] && (b[0] - a[0]).abs() < 1e-9, "{a:?} {b:?}");
    }

    #[test]
    fn what_has_no_direction_is_refused() {
        let at = Some(Vec3::repeat(1.0));
        let right = wanted(Projection::Perspective);
        for (wrong, option) in [
            (Wanted { direction: Vec3::zeros(), ..right.clone() }, "--direction 0,0,0"),
            (Wanted { up: Vec3::zeros(), ..right.clone() }, "--up 0,0,0"),
            (Wanted { from: at, target: at, ..right }, "--from 1,1,1"),
        ] {
            let refused = Camera::new(&wrong, &balls(), SIZE, FRAME).unwrap_err();
            assert!(refused.to_string().contains(option) && refused.exit_code() == 2, "{refused}");
        }
    }
}
