//! Exact solutions for one sphere that hits a plane: m l'' = F(l) rho(-l') - m g.
//!
//! F is the repulsion of the paper, eq. (2.1), and rho the rebound function, eq. (2.4).
//!
//! Nothing here uses the contact law or the integrators of the simulation. The comparison is independent.

use std::f64::consts::PI;
use std::num::NonZeroUsize;

use gauss_quad::GaussLegendre;

/// A sphere and its contact law with a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// Mass m, kg; > 0. For a head-on impact of two equal spheres, half the mass of one.
    pub mass: f64,
    /// Repulsion at contact F_0, N; > 0.
    pub f_0: f64,
    /// Stiffness exponent kappa, 1/m; > 0.
    pub kappa: f64,
    /// Coefficient of restitution, 0..=1.
    pub e: f64,
    /// Dissipation focusing coefficient psi, s/m; > 0.
    pub psi: f64,
    /// Largest gap at which the plane repels, m.
    pub l_max: f64,
}

/// Time from the release of a ball to its highest point after one rebound from a hard floor, s (Table 4.1).
///
/// The ball starts at rest at `height` (m) above the floor, under the gravity `g` (m/s^2). It keeps the share
/// `e` of its speed.
///
/// # Examples
///
/// ```rust
/// use demhybrid::studies::accuracy::exact::hard_rebound_time;
///
/// let time = hard_rebound_time(16.0, 9.81, 1.0); // two falls from 16 m
/// assert!((time - 2.0 * (32.0f64 / 9.81).sqrt()).abs() < 1e-15); // s
/// ```
pub fn hard_rebound_time(height: f64, g: f64, e: f64) -> f64 {
    (1.0 + e) * (2.0 * height / g).sqrt()
}

impl Impact {
    /// Speed of separation divided by the speed of approach `v_in` (m/s; > 0), without gravity.
    ///
    /// Both speeds are taken at the same gap; the result holds for any gap. From m v dv = F rho dl follows
    /// int_0^{v_in} u/rho(u) du = int_0^{v_out} u/rho(-u) du. It does not depend on F_0, kappa and mass.
    pub fn restitution(&self, v_in: f64) -> f64 {
        // In z = 2 psi u, the rebound function varies over a width of 1. Its nearest pole is at distance pi.
        let nodes = GaussLegendre::new(const { NonZeroUsize::new(12).expect("12 is not 0") });
        let integral =
            |sign: f64, from: f64, to: f64| nodes.integrate(from, to, |z| z / rebound(self.e, sign * z));
        let z_in = 2.0 * self.psi * v_in;
        // Beyond these values rho is constant to the last bit: 1 on approach, e^2 on separation.
        let bend_in = 40.0f64;
        let bend_out = (40.0 - 2.0 * self.e.ln()).min(700.0);
        let mut left = panels(z_in.min(bend_in)).map(|[from, to]| integral(1.0, from, to)).sum::<f64>()
            + (z_in * z_in - bend_in * bend_in).max(0.0) / 2.0;
        for [from, to] in panels(bend_out) {
            let panel = integral(-1.0, from, to);
            if panel >= left {
                let excess = |z: f64| (integral(-1.0, from, z) - left, z / rebound(self.e, -z));
                return root(from, to, excess) / z_in;
            }
            left -= panel;
        }
        (bend_out * bend_out + 2.0 * rebound(self.e, -bend_out) * left).sqrt() / z_in
    }

    /// Time (s) of an impact without gravity, and the speed at its end (m/s).
    ///
    /// The impact begins at the gap `gap` (m; up to `l_max`) with the speed `v_in` (m/s; >= 0). It ends when
    /// the surface is back at that gap. NaN if the numbers overflow.
    pub fn contact_time(&self, v_in: f64, gap: f64) -> (f64, f64) {
        if v_in == 0.0 {
            return (0.0, 0.0);
        }
        let (mut t, mut l, mut v) = (0.0, gap, -v_in);
        while v.is_finite() {
            let piece = Piece::new(self, l, v, 0.0);
            if let Some(back) = piece.rises_through(gap) {
                return (t + back, piece.v(back));
            }
            t += piece.h;
            (l, v) = (piece.l(piece.h), piece.v(piece.h));
        }
        (f64::NAN, f64::NAN)
    }

    /// Acceleration away from the plane, m/s^2.
    ///
    /// The gap is `l` (m) and grows at the rate `v` (m/s). The gravity is `g` (m/s^2).
    pub fn acceleration(&self, l: f64, v: f64, g: f64) -> f64 {
        let repulsion = if l <= self.l_max { self.f_0 * (-self.kappa * l).exp() } else { 0.0 };
        repulsion * rebound(self.e, -2.0 * self.psi * v) / self.mass - g
    }

    /// Time (s) until the next highest point after a release at rest, under the gravity `g` (m/s^2; > 0).
    ///
    /// `height` (m) is the gap at the release. Infinite if the sphere creeps to its position of rest without
    /// turning. NaN if the numbers overflow.
    pub fn rebound_time(&self, height: f64, g: f64) -> f64 {
        let fall = (2.0 * (height - self.l_max).max(0.0) / g).sqrt();
        let (mut t, mut l, mut v) = (fall, height.min(self.l_max), -g * fall);
        // Time in which a sphere at rest on the floor swings by one radian, and time of slow motion, s.
        let (natural, mut slow) = ((g * self.kappa).sqrt().recip(), 0.0);
        while v.is_finite() {
            let piece = Piece::new(self, l, v, g);
            // Test this first: a sphere that leaves the range of the repulsion turns under gravity alone.
            if let Some(leave) = piece.rises_through(self.l_max) {
                return t + leave + piece.v(leave) / g;
            }
            if let Some(top) = piece.highest_point() {
                return t + top;
            }
            slow = if v.abs() < g * natural { slow + piece.h } else { 0.0 };
            if slow > CREEP * natural {
                return f64::INFINITY;
            }
            t += piece.h;
            (l, v) = (piece.l(piece.h), piece.v(piece.h));
        }
        f64::NAN
    }
}

/// Order of the Taylor series.
const ORDER: usize = 20;
/// Size of the last terms of a series, relative to the speeds of the impact.
const TRUNCATION: f64 = 1e-17;
/// A sphere that has moved slowly for this many natural times no longer turns.
///
/// Any swing has decayed to 1e-12 after 28 natural times.
const CREEP: f64 = 60.0;

/// A short piece of the motion, as Taylor series of the gap l and its rate v.
///
/// With w = F/m and the logistic part s of rho, the equation is
///
/// - l' = v,
/// - v' = w (e^2 + (1 - e^2) s) - g,
/// - w' = -kappa v w,
/// - s' = -2 psi v' s (1 - s).
///
/// These have products only, so each coefficient of a series follows from those before it. The times of
/// l = l_max and of v = 0 are roots of polynomials.
///
/// A Runge-Kutta method would not be an independent check, because the simulation itself uses one.
struct Piece {
    l: [f64; ORDER + 1],
    v: [f64; ORDER + 1],
    /// Time up to which the series are accurate to the last digits, s.
    h: f64,
}

impl Piece {
    /// The motion from the gap `l` (m) with the rate `v` (m/s), under the gravity `g` (m/s^2).
    fn new(impact: &Impact, l: f64, v: f64, g: f64) -> Self {
        let Impact { mass, f_0, kappa, e, psi, .. } = *impact;
        let mut piece = Piece { l: [0.0; ORDER + 1], v: [0.0; ORDER + 1], h: 0.0 };
        let (mut w, mut rho, mut s, mut s_rest, mut v_rate) =
            ([0.0; ORDER + 1], [0.0; ORDER], [0.0; ORDER + 1], [0.0; ORDER], [0.0; ORDER]);
        (piece.l[0], piece.v[0]) = (l, v);
        w[0] = f_0 / mass * (-kappa * l).exp();
        s[0] = logistic(-2.0 * psi * v);
        for k in 0..ORDER {
            let constant = |c: f64| if k == 0 { c } else { 0.0 };
            let next = (k + 1) as f64;
            rho[k] = constant(e * e) + (1.0 - e * e) * s[k];
            v_rate[k] = product(&w, &rho, k) - constant(g);
            s_rest[k] = s[k] - product(&s, &s, k);
            piece.l[k + 1] = piece.v[k] / next;
            piece.v[k + 1] = v_rate[k] / next;
            w[k + 1] = -kappa * product(&piece.v, &w, k) / next;
            s[k + 1] = -2.0 * psi * product(&v_rate, &s_rest, k) / next;
        }
        // If v is 0, the scale of speed is the one that force or gravity gives over the length 1/kappa.
        let speed = v.abs() + ((w[0] + g) / kappa).sqrt();
        // A piece must not be longer than the time in which the impact changes, or it could miss a crossing.
        // Near the pole of rho at 2 psi v = i pi it must be short: far from the pole the series does not show
        // the bend ahead.
        let pole = (2.0 * psi * v).hypot(PI) / (2.0 * psi * piece.v[1].abs());
        let widest = (1.0 / (kappa * speed)).min(TRUNCATION.powf(1.0 / ORDER as f64) * pole);
        piece.h = [ORDER - 1, ORDER]
            .into_iter()
            .fold(widest, |h, k| h.min((TRUNCATION * speed / piece.v[k].abs()).powf(1.0 / k as f64)));
        piece
    }

    fn l(&self, t: f64) -> f64 {
        polynomial(&self.l, t)
    }

    fn v(&self, t: f64) -> f64 {
        polynomial(&self.v, t)
    }

    /// Time at which the sphere stops rising and begins to fall, s; `None` if this piece has no such time.
    fn highest_point(&self) -> Option<f64> {
        (self.v[0] > 0.0 && self.v(self.h) <= 0.0)
            .then(|| root(0.0, self.h, |t| (-self.v(t), -slope(&self.v, t))))
    }

    /// Time at which the gap grows beyond `gap` (m), s; `None` if this piece has no such time.
    fn rises_through(&self, gap: f64) -> Option<f64> {
        // Leave out the constant term, so that rounding does not hide a shallow dip.
        let beyond = |t: f64| t * polynomial(&self.l[1..], t) - (gap - self.l[0]);
        let end = self.highest_point().unwrap_or(self.h);
        (self.v(end) >= 0.0 && beyond(end) >= 0.0).then(|| {
            let lowest =
                if self.v[0] < 0.0 { root(0.0, end, |t| (self.v(t), slope(&self.v, t))) } else { 0.0 };
            root(lowest, end, |t| (beyond(t), self.v(t)))
        })
    }
}

/// Divides the range from 0 to `end` into panels of length 1. The last panel may be shorter.
fn panels(end: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..end.ceil() as u32).map(move |k| [f64::from(k), f64::from(k + 1).min(end)])
}

/// The rebound function, eq. (2.4), at z = 2 psi v.
fn rebound(e: f64, z: f64) -> f64 {
    e * e + (1.0 - e * e) * logistic(z)
}

/// (1 + tanh(z/2))/2, accurate to all digits even if it is small.
fn logistic(z: f64) -> f64 {
    1.0 / (1.0 + (-z).exp())
}

/// Coefficient `k` of the product of two series.
fn product(a: &[f64], b: &[f64], k: usize) -> f64 {
    (0..=k).map(|j| a[j] * b[k - j]).sum()
}

fn polynomial(coefficients: &[f64], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

/// Derivative of the polynomial.
fn slope(coefficients: &[f64], t: f64) -> f64 {
    coefficients.iter().enumerate().skip(1).rev().fold(0.0, |sum, (k, c)| sum * t + k as f64 * c)
}

/// The root of an increasing function between `low` and `high`. `f` returns the function and its slope.
///
/// It uses Newton's method, and bisection if a step of Newton's would leave the bracket.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut t = high;
    // 100 bisections are enough for any two numbers of the same sign and size. Newton's method needs fewer.
    for _ in 0..100 {
        let (value, slope) = f(t);
        if value > 0.0 {
            high = t;
        } else {
            low = t;
        }
        let newton = t - value / slope;
        if (newton - t).abs() <= 2.0 * f64::EPSILON * t.abs() {
            return newton;
        }
        t = if low < newton && newton < high { newton } else { (low + high) / 2.0 };
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.81;

    fn impact(kappa: f64, e: f64) -> Impact {
        Impact { mass: 1.0, f_0: 10.0, kappa, e, psi: 10.0, l_max: 0.1 }
    }

    #[test]
    fn slow_impacts_are_nearly_elastic_and_fast_ones_lose_what_e_says() {
        // Speeds, and restitutions from an independent integration, exact to the last printed digit.
        for (v, printed, digit) in [
            (0.001, 0.9952, 1e-4),
            (0.01, 0.9540, 1e-4),
            (0.05, 0.8109, 1e-4),
            (0.1, 0.6975, 1e-4),
            (0.2, 0.5772, 1e-4),
            (0.5, 0.4583, 1e-4),
            (1.0, 0.4170, 1e-4),
            (2.0, 0.4043, 1e-4),
            (5.0, 0.4007, 1e-4),
            (10.0, 0.40017, 1e-5),
            (17.718, 0.40006, 1e-5),
        ] {
            let restitution = impact(150.0, 0.4).restitution(v);
            assert!((restitution - printed).abs() <= 0.5 * digit, "{v}: {restitution}, printed {printed}");
        }
        // For small v, the restitution is 1 - (2/3) (b psi/rho(0)) v, with b = (1 - e^2)/2. The next term is
        // of the order (psi v)^2.
        let v = 1e-6;
        let loss = 1.0 - impact(150.0, 0.4).restitution(v);
        assert!((loss / (2.0 / 3.0 * 0.42 * 10.0 / 0.58 * v) - 1.0).abs() < 1e-4, "{loss}");
    }

    #[test]
    fn restitution_has_the_limits_of_e() {
        assert_eq!(impact(150.0, 1.0).restitution(3.0), 1.0);
        // With e = 0 and z = 2 psi v: z_in^2/2 + 1 = z_out^2/2 + (z_out - 1) exp(z_out) + 1.
        // The term exp(-z_in) vanishes.
        let z_in = 2.0 * 10.0 * 20.0;
        let z_out = z_in * impact(150.0, 0.0).restitution(20.0);
        let out = z_out * z_out / 2.0 + (z_out - 1.0) * z_out.exp() + 1.0;
        assert!((out / (z_in * z_in / 2.0 + 1.0) - 1.0).abs() < 1e-14, "{out}: some roundings");
        // If the rebound function is very sharp, e remains; the rest is of the order 1/(psi v)^2.
        let sharp = Impact { psi: 1e7, ..impact(150.0, 0.3) };
        assert!((sharp.restitution(2.0) - 0.3).abs() < 1e-13);
        for e in [1e-200, 1e-3, 0.5, 0.999_999] {
            for v in [1e-9, 0.3, 40.0, 1e5] {
                let kept = impact(150.0, e).restitution(v);
                assert!(kept > e && kept < 1.0, "{e} {v}: {kept}");
            }
        }
    }

    #[test]
    fn time_to_the_next_highest_point_has_the_known_values() {
        // Times in s from the classical Runge-Kutta method, with 80-bit numbers, extrapolated over two steps.
        for (kappa, e2, height, exact) in [
            (30.0, 1.0, 16.0, 3.640_515_464_736_821),
            (150.0, 1.0, 16.0, 3.619_071_681_496_032_5),
            (500.0, 1.0, 16.0, 3.614_526_294_538_889),
            (30.0, 0.5, 16.0, 3.109_231_975_964_920_6),
            (150.0, 0.5, 16.0, 3.089_457_411_599_325_7),
            (500.0, 0.5, 16.0, 3.085_320_541_967_088),
            (30.0, 0.16, 16.0, 2.553_902_024_612_856_7),
            (150.0, 0.16, 16.0, 2.534_527_969_296_741_6),
            (500.0, 0.16, 16.0, 2.530_591_500_521_691_5),
            (150.0, 0.16, 0.5, 0.470_592_028_781_566_5),
            // The sphere starts within the interaction distance of the floor and never leaves it.
            (150.0, 0.16, 0.1, 0.252_454_801_644_515_3),
            (150.0, 0.16, 0.05, 0.318_887_533_329_558_8),
            (150.0, 0.16, 0.01, 0.351_683_577_187_478_4),
            // The sphere starts below its position of rest and first moves up.
            (150.0, 0.16, -0.01, 0.280_887_230_263_111_1),
        ] {
            let t = impact(kappa, f64::sqrt(e2)).rebound_time(height, G);
            // The tolerance is a few roundings, and more where a swing ends slowly.
            assert!((t / exact - 1.0).abs() < 5e-13, "{kappa} {e2} {height}: {t}");
        }
        // Unlimited interaction distance. Values from another integration, exact to the last printed digit.
        for (kappa, elastic, half) in
            [(30.0, 3.64052, 3.10923), (150.0, 3.61907, 3.08946), (500.0, 3.61453, 3.08532)]
        {
            let t = |e: f64| Impact { l_max: f64::INFINITY, ..impact(kappa, e) }.rebound_time(16.0, G);
            assert!((t(1.0) - elastic).abs() < 5e-6 && (t(0.5f64.sqrt()) - half).abs() < 5e-6);
        }
    }

    #[test]
    fn a_stiff_floor_is_a_hard_floor() {
        for e in [1.0, 0.7] {
            let hard = hard_rebound_time(16.0, G, e);
            let stiff = Impact { psi: 1e5, l_max: 1e-5, ..impact(1e7, e) }.rebound_time(16.0, G);
            // The contact lasts about 1/(kappa v) = 6e-9 s times a logarithm, and it acts from l_max on.
            assert!((stiff - hard).abs() < 5e-7, "{e}: {stiff}");
        }
    }

    #[test]
    fn an_overdamped_sphere_creeps_to_its_equilibrium() {
        // For e = 0 the damping ratio b psi g/(2 rho(0) sqrt(kappa g)) is 0.1279 psi, with b = (1 - e^2)/2.
        // The sphere turns if it is below 1.
        for (psi, turns) in [(7.5, true), (10.0, false), (100.0, false), (1e4, false)] {
            let t = Impact { psi, ..impact(150.0, 0.0) }.rebound_time(0.03, G);
            assert_eq!(t.is_finite(), turns, "{psi}: {t}");
        }
        assert_eq!(impact(150.0, 0.0).rebound_time(16.0, G), f64::INFINITY);
    }

    #[test]
    fn numbers_that_overflow_end_as_nan() {
        assert!(impact(150.0, 0.4).rebound_time(-10.0, G).is_nan());
        assert!(impact(150.0, 0.4).contact_time(1.0, -10.0).0.is_nan());
    }

    #[test]
    fn an_elastic_contact_lasts_as_its_energy_says() {
        // exp(-kappa l) = A sech^2(kappa u t/2) with A = kappa m u^2/(2 F_0), where u is the speed far away.
        // At the initial gap, sinh(kappa u t/2) = v sqrt(kappa m/(2 F)).
        for (v, gap, mass) in [(1.0, 0.02, 1.0), (17.718, 0.1, 1.0), (1e-3, 0.05, 0.5), (8.0, -0.01, 2.0)] {
            let impact = Impact { mass, ..impact(150.0, 1.0) };
            let repulsion = 10.0 * f64::exp(-150.0 * gap);
            let u = f64::sqrt(v * v + 2.0 * repulsion / (150.0 * mass));
            let exact = 4.0 / (150.0 * u) * f64::asinh(v * f64::sqrt(75.0 * mass / repulsion));
            let (t, v_out) = impact.contact_time(v, gap);
            assert!((t / exact - 1.0).abs() < 1e-13 && (v_out / v - 1.0).abs() < 1e-13, "{v}: {t} {v_out}");
        }
        // Time during which the force exceeds 1 % of its maximum: 79.8 ms at 1 m/s.
        let (t, _) = impact(150.0, 1.0).contact_time(f64::sqrt(0.99), -f64::ln(0.075) / 150.0);
        assert!((t - 4.0 * f64::acosh(10.0) / 150.0).abs() < 1e-14 && (t - 79.8e-3).abs() < 5e-5);
        assert_eq!(impact(150.0, 0.5).contact_time(0.0, 0.01), (0.0, 0.0));
    }

    #[test]
    fn a_sphere_leaves_with_the_speed_that_restitution_says() {
        for e in [0.0, 0.4, 0.7, 0.95, 1.0] {
            for (v, gap) in
                [(1e-6, 0.01), (0.01, 0.1), (0.3, -0.02), (2.0, 0.05), (17.718, 0.1), (100.0, 0.1)]
            {
                let impact = impact(150.0, e);
                let (_, v_out) = impact.contact_time(v, gap);
                // The tolerance allows for the roundings of a few hundred steps.
                assert!((v_out / v - impact.restitution(v)).abs() < 2e-14, "{e} {v}: {v_out}");
            }
        }
    }
}
