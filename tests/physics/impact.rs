//! Head-on impacts: elastic ones in closed form, restitution, and the rebound times of Tab. 4.1.

use crate::common::{Case, Run, Snapshot, assert_near};
use demhybrid::math::vector::Vec3;

const R: f64 = 0.1;
const F_0: f64 = 10.0;
const KAPPA: f64 = 150.0;
const PSI: f64 = 10.0;
const G: f64 = 9.81;

/// Gap (m) at which a body starts: beyond the range of the contact.
const FAR: f64 = 0.21;

/// A sphere of `mass` (kg) hits the floor with `v` (m/s); frames every `interval` (s).
fn on_floor(mass: f64, e: f64, v: f64, interval: f64) -> Run {
    Case::tight()
        .floor()
        .set("particles.mass", mass)
        .set("contact.restitution", e)
        // There and back at no less than the worst e_eff = 0.4.
        .set("t_end", FAR / v * if e < 1.0 { 4.0 } else { 2.2 })
        .set("output.interval", interval)
        .sphere(Vec3::z() * (R + FAR), Vec3::z() * -v)
        .run()
}

/// Two unit spheres meet head-on along a slanted line with closing speed `v` (m/s).
fn of_pair(v: f64, interval: f64) -> Run {
    let along = Vec3::new(1.0, -2.0, 2.0) / 3.0;
    let half = along * (R + 0.5 * FAR);
    Case::tight()
        .set("contact.restitution", 1.0)
        .set("t_end", FAR / v * 2.2)
        .set("output.interval", interval)
        .sphere(half, along * (-0.5 * v))
        .sphere(-half, along * (0.5 * v))
        .run()
}

/// Gap (m) and its rate (m/s) in every frame, with the time (s).
fn gaps(run: &Run) -> Vec<[f64; 3]> {
    let gap = |x: &[Vec3], v: &[Vec3]| match x {
        [x] => [x.z - R, v[0].z],
        _ => {
            let apart = x[0] - x[1];
            [apart.norm() - 2.0 * R, apart.normalize().dot(&(v[0] - v[1]))]
        }
    };
    let row = |time: f64, [l, rate]: [f64; 2]| [time, l, rate];
    run.frames.iter().map(|frame| row(frame.time, gap(&frame.x, &frame.v))).collect()
}

struct Measured {
    /// Time of the smallest gap, s.
    t_min: f64,
    /// Smallest gap, m.
    l_min: f64,
    /// Time with more than 1 % of the largest force, s.
    above: f64,
    /// Speed of separation, m/s.
    v_out: f64,
}

/// Reads an impact of `m_eff` (kg) off its frames.
fn measure(gaps: &[[f64; 3]], m_eff: f64) -> Measured {
    let force = |l: f64| F_0 * (-KAPPA * l).exp();
    let &[t, l, rate] = gaps.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
    // From the lowest frame to the lowest point at constant force: what is left out is of fourth order, 1e-9
    // here.
    let t_min = t - rate * m_eff / force(l);
    let l_min = l - 0.5 * rate * rate * m_eff / force(l);
    let edge = -(0.01 * force(l_min) / F_0).ln() / KAPPA;
    let crossings: Vec<f64> = gaps
        .windows(2)
        .filter(|pair| (pair[0][1] > edge) != (pair[1][1] > edge))
        // At constant speed: with one hundredth of the force the speed changes little between frames.
        .map(|pair| pair[0][0] + (edge - pair[0][1]) / pair[0][2])
        .collect();
    let [begin, end] = crossings[..] else { panic!("{} crossings", crossings.len()) };
    Measured { t_min, l_min, above: end - begin, v_out: gaps.last().unwrap()[2] }
}

/// Compares an elastic impact of `m_eff` (kg) at `v` (m/s) with the closed form and with its values as
/// published: largest force (N), smallest gap (mm), time above 1 % of the force (ms), each with half a unit
/// of its last digit.
fn check_elastic(name: &str, run: &Run, m_eff: f64, v: f64, published: [[f64; 2]; 3]) {
    let gaps = gaps(run);
    let found = measure(&gaps, m_eff);
    let f_max = F_0 * (-KAPPA * found.l_min).exp();
    let exact = KAPPA * m_eff * v * v / 2.0;
    // 1e-7: the crossings and the minimum are extrapolated from frames 1/80 of a contact time away.
    assert_near(&format!("{name}: F_max, N"), f_max, exact, 1e-7 * exact);
    let l_min = -(exact / F_0).ln() / KAPPA;
    assert_near(&format!("{name}: l_min, m"), found.l_min, l_min, 1e-9);
    let above = 4.0 * 10f64.acosh() / (KAPPA * v);
    assert_near(&format!("{name}: time above 1 %, s"), found.above, above, 1e-6 * above);
    assert_near(&format!("{name}: v_out, m/s"), found.v_out, v, 1e-9 * v);
    for ([value, half], found) in published.into_iter().zip([f_max, found.l_min * 1e3, found.above * 1e3]) {
        assert_near(&format!("{name}: published"), found, value, half);
    }
    // The whole course: e^{-kappa l} = (kappa m v^2 / 2 F_0) sech^2(kappa v t/2).
    for &[t, l, _] in &gaps {
        let course = l_min + 2.0 / KAPPA * (0.5 * KAPPA * v * (t - found.t_min)).cosh().ln();
        // 1e-8 m: 1e-9 s of error in t_min at 17.7 m/s is as much.
        assert!((l - course).abs() < 1e-8 * v.max(1.0), "{name}: l = {l} at t = {t}, not {course}");
    }
}

#[test]
fn an_elastic_impact_follows_the_closed_form() {
    let interval = |v: f64| 1.0 / (KAPPA * v) / 40.0;
    let case = |v| on_floor(1.0, 1.0, v, interval(v));
    check_elastic("wall, 1 m/s", &case(1.0), 1.0, 1.0, [[75.0, 1e-4], [-13.433, 5e-4], [79.8, 0.05]]);
    check_elastic("wall, 8 m/s", &case(8.0), 1.0, 8.0, [[4800.0, 1e-2], [-41.159, 5e-4], [9.98, 5e-3]]);
    let fast = [[23545.0, 0.5], [-51.760, 5e-4], [4.5, 0.05]];
    check_elastic("wall, 17.718 m/s", &case(17.718), 1.0, 17.718, fast);
    let pair = of_pair(1.0, interval(1.0));
    check_elastic("pair, 1 m/s", &pair, 0.5, 1.0, [[37.5, 1e-4], [-8.812, 5e-4], [79.8, 0.05]]);
}

#[test]
fn a_heavier_sphere_sinks_deeper_in_an_elastic_impact() {
    let run = on_floor(2.5, 1.0, 1.0, 1.0 / (KAPPA * 40.0));
    // F_max = kappa m v^2/2 = 187.5 N; F_0 does not grow with the mass.
    check_elastic("wall, 2.5 kg", &run, 2.5, 1.0, [[187.5, 1e-4], [-19.5416, 5e-4], [79.8, 0.05]]);
}

/// Share of the repulsion at closing speed `v` (m/s), eq. (2.4) as printed.
fn rho(e: f64, v: f64) -> f64 {
    e * e + 0.5 * (1.0 - e * e) * (1.0 + (PSI * v).tanh())
}

/// Integral of u/rho(sign u) du from 0 to `v`, by Simpson's rule: error below 1e-12 for v <= 20 m/s.
fn impulse(e: f64, v: f64, sign: f64) -> f64 {
    let n = 20_000;
    let h = v / f64::from(n);
    let value = |k: i32| f64::from(k) * h / rho(e, sign * f64::from(k) * h);
    let odd: f64 = (1..n).step_by(2).map(value).sum();
    let even: f64 = (2..n).step_by(2).map(value).sum();
    h / 3.0 * (value(0) + 4.0 * odd + 2.0 * even + value(n))
}

/// Speed after an impact with `v_in` (m/s): both sides of int u/rho(u) du = int u/rho(-u) du are the integral
/// of F dl.
fn rebound_speed(e: f64, v_in: f64) -> f64 {
    let wanted = impulse(e, v_in, 1.0);
    let (mut low, mut high) = (0.0, v_in);
    for _ in 0..60 {
        let v = 0.5 * (low + high);
        if impulse(e, v, -1.0) < wanted { low = v } else { high = v }
    }
    low
}

/// Effective restitution by impact speed (m/s), and half a unit of its last digit.
const E_EFF: [[f64; 3]; 11] = [
    [0.001, 0.9952, 5e-5],
    [0.01, 0.9540, 5e-5],
    [0.05, 0.8109, 5e-5],
    [0.1, 0.6975, 5e-5],
    [0.2, 0.5772, 5e-5],
    [0.5, 0.4583, 5e-5],
    [1.0, 0.4170, 5e-5],
    [2.0, 0.4043, 5e-5],
    [5.0, 0.4007, 5e-5],
    [10.0, 0.40017, 5e-6],
    [17.718, 0.40006, 5e-6],
];

#[test]
fn slow_impacts_are_nearly_elastic_and_fast_ones_keep_the_nominal_restitution() {
    for [v, published, half] in E_EFF {
        let out = on_floor(1.0, 0.4, v, 1.0).end().v[0].z;
        // The error rate is 3e-10 m/s a second at most, and the slowest impact takes 400 s, most of it in
        // free flight.
        assert_near(&format!("v_out at {v} m/s"), out, rebound_speed(0.4, v), 3e-9);
        assert_near(&format!("e_eff at {v} m/s"), out / v, published, half);
    }
}

#[test]
fn restitution_depends_neither_on_stiffness_nor_on_mass() {
    for (key, value) in [
        ("contact.stiffness_exponent", 400.0),
        ("contact.repulsion_at_contact", 50.0),
        ("particles.mass", 3.0),
    ] {
        let case = Case::tight().floor().set("t_end", 2.0).set(key, value);
        let run = case.sphere(Vec3::z() * (R + FAR), Vec3::z() * -0.5).run();
        assert_near(key, run.end().v[0].z, rebound_speed(0.4, 0.5), 1e-8);
    }
}

#[test]
fn a_bouncing_sphere_returns_to_its_highest_point_when_table_4_1_says() {
    // Exact times by quadrature, and the paper's: kappa, e = 1, e = sqrt(1/2).
    let table = [
        [30.0, 3.64052, 3.10923, 3.6409, 3.108],
        [150.0, 3.61907, 3.08946, 3.6184, 3.0883],
        [500.0, 3.61453, 3.08532, 3.6134, 3.0858],
    ];
    for [kappa, elastic, lossy, printed_elastic, printed_lossy] in table {
        for (e, exact, printed) in [(1.0, elastic, printed_elastic), (0.5f64.sqrt(), lossy, printed_lossy)] {
            let run = Case::config("bounce.toml")
                .set("contact.stiffness_exponent", kappa)
                .set("contact.restitution", e)
                // Between the bounce, near 1.8 s, and the highest point: free flight.
                .set("t_end", 2.5)
                .run();
            let end = run.end();
            assert!(end.x[0].z > R + 0.1 && end.v[0].z > 0.0);
            let name = format!("rebound time, kappa = {kappa}, e = {e:.3}");
            let top = end.time + end.v[0].z / G;
            // 2e-5 s: half a unit of the last digit, and up to 5e-6 s for the cut of the force at 0.1 m.
            assert_near(&name, top, exact, 2e-5);
            // The paper prints times that no quadrature of its model gives better than this.
            assert_near(&format!("{name} in the paper"), top, printed, 1.3e-3);
        }
    }
}

#[test]
fn an_elastic_ball_returns_to_its_drop_height_again_and_again() {
    let run = Case::config("bounce.toml").set("output.interval", 0.01).run();
    let highest = |frame: &Snapshot| frame.x[0].z + frame.v[0].z.powi(2) / (2.0 * G);
    let free = run.frames.iter().filter(|frame| frame.x[0].z > R + 0.1);
    let worst = free.map(|frame| (highest(frame) - 16.1).abs()).fold(0.0, f64::max);
    // Three bounces of 157 J at a tolerance of 1e-6 m/s^2: each keeps its energy to 1e-8 of itself or better.
    assert_near("height of return over 10 s, largest deviation, m", worst, 0.0, 5e-7);
}

/// Largest errors of force and speed in frames through an elastic impact, as shares of the largest force and
/// of the speed of the impact. The solver is the default one.
fn errors_inside(kappa: f64, v: f64, case: Case) -> [f64; 2] {
    // The exact solution is e^{-kappa l} = (kappa m v^2/(2 F_0)) sech^2(kappa v t/2). It starts and ends where the
    // force is a ten thousandth of its largest.
    let steepness = kappa * v * v / (2.0 * F_0);
    let half = 2.0 * 100f64.acosh() / (kappa * v);
    let gap = |t: f64| -(steepness / (0.5 * kappa * v * t).cosh().powi(2)).ln() / kappa;
    let speed = |t: f64| v * (0.5 * kappa * v * t).tanh();
    let run = case
        .floor()
        .set("particles.mass", 1.0)
        .set("contact.restitution", 1.0)
        .set("contact.stiffness_exponent", kappa)
        .set("contact.interaction_distance", (30.0 / kappa).min(0.2))
        .set("t_end", 2.0 * half)
        .set("output.interval", 1e-6f64.min(half / 500.0))
        .sphere(Vec3::z() * (R + gap(-half)), Vec3::z() * speed(-half))
        .run();
    let mut most = [0.0f64; 2];
    for frame in &run.frames {
        let t = frame.time - half;
        let force = |gap: f64| F_0 * (-kappa * gap).exp() / (0.5 * kappa * v * v);
        let off = [force(frame.x[0].z - R) - force(gap(t)), (frame.v[0].z - speed(t)) / v];
        most = [0, 1].map(|k| most[k].max(off[k].abs()));
    }
    most
}

#[test]
fn frames_inside_an_impact_are_as_good_as_the_steps_around_them() {
    for (kappa, v) in [(150.0, 3.0), (1500.0, 3.0), (1e4, 3.0), (1e5, 3.0), (1e4, 0.3)] {
        let plain = errors_inside(kappa, v, Case::defaults());
        let rough = errors_inside(kappa, v, Case::defaults().rough(true));
        let remembering = Case::defaults().set("friction.law", "history").set("friction.coefficient", 0.3);
        let remembering = errors_inside(kappa, v, remembering);
        println!("kappa {kappa}/m, {v} m/s: {plain:?} {rough:?} {remembering:?}");
        for [force, speed] in [plain, rough, remembering] {
            assert!(force < 0.01 && speed < 0.01, "kappa {kappa}/m, {v} m/s: {force} {speed}");
        }
    }
}

#[test]
fn a_sphere_that_loses_nothing_keeps_its_energy_over_a_thousand_bounces() {
    for kappa in [150.0f64, 1500.0, 1e5] {
        let (height, bounces) = (0.1f64, 1000.0);
        let period = 2.0 * (2.0 * height / G).sqrt();
        let run = Case::defaults()
            .floor()
            .heavy()
            .set("particles.mass", 1.0)
            .set("contact.restitution", 1.0)
            .set("contact.stiffness_exponent", kappa)
            .set("contact.interaction_distance", (30.0 / kappa).min(0.2))
            .set("t_end", bounces * period)
            .sphere(Vec3::z() * (R + height), Vec3::zeros())
            .run();
        let energies: Vec<f64> = run.frames.iter().map(|frame| frame.energy()).collect();
        let worst = energies.iter().map(|energy| (energy / energies[0] - 1.0).abs()).fold(0.0, f64::max);
        println!(
            "kappa {kappa}/m: {worst:.1e} after {bounces} bounces, {} right-hand sides",
            run.end().counts.rhs
        );
        assert!(worst < 0.01, "kappa {kappa}/m: {worst}");
    }
}
