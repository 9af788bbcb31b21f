//! Every method is tested on problems with known solutions: order, stability, dense output, and counts of
//! right-hand sides.

use super::*;
use nalgebra::Vector2;

/// Position and velocity of one oscillator: a row.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    x: f64,
    v: f64,
}

/// The point in a vector of one row.
fn point(y: &[f64]) -> Point {
    Point { x: y[0], v: y[1] }
}

/// A norm in which position and velocity count alike.
fn plain(rate: bool) -> Norm {
    Norm { weights: vec![vec![1.0, 1.0]], rate, mean: None, rows: Vec::new() }
}

/// x'' = force(t, x, v) for one point.
struct Points<F> {
    force: F,
    evaluations: u64,
    layout: Layout,
}

impl<F> Points<F> {
    fn new(force: F) -> Self {
        let layout = Layout(vec![Segment { rows: 1, width: 2, positions: 1 }]);
        Points { force, evaluations: 0, layout }
    }
}

impl<F: Fn(f64, &Point) -> f64> Ivp for Points<F> {
    fn layout(&self) -> &Layout {
        &self.layout
    }
    fn begin(&mut self) {}
    fn rhs(&mut self, t: f64, y: &[f64], dydt: &mut [f64]) {
        self.evaluations += 1;
        dydt.copy_from_slice(&[y[1], (self.force)(t, &point(y))]);
    }
    fn agree(&mut self, _y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
        TrialOutcome { error: finish(self.layout.whole(0), next).error(), covered: true, within_travel: true }
    }
    fn length(&mut self, v: &[f64]) -> f64 {
        v.iter().map(|number| number * number).sum::<f64>().sqrt()
    }
    fn add_direction(&mut self, round: u64, share: f64, v: &mut [f64]) {
        v[1] += share * (1.0 + 0.1 * (round % 3) as f64);
    }
    fn small_length(&self) -> f64 {
        1.5e-8
    }
}

/// A damped pendulum with a periodic force. Nothing about it is linear.
fn pendulum(t: f64, p: &Point) -> f64 {
    -p.x.sin() - 0.3 * p.v * p.v.abs() + 0.5 * t.cos()
}

/// A pendulum without damping: the force depends on the position alone.
fn free_pendulum(_t: f64, p: &Point) -> f64 {
    -p.x.sin()
}

type Solve = fn(f64, &Point) -> f64;
type Any = Box<dyn Method>;
/// Makes a method.
type Make = fn() -> Any;

/// The state at t = 2 after `steps` steps, and the number of right-hand sides.
fn integrate(method: &mut dyn Method, force: Solve, steps: u32) -> (Point, u64) {
    let mut ivp = Points::new(force);
    let mut step_start = StepStart::new(0.0, vec![1.0, 0.2]);
    let (mut trial, h) = (TrialStep::default(), 2.0 / f64::from(steps));
    let norm = plain(false);
    for k in 0..steps {
        method.stable_step(&mut ivp, &mut step_start, &mut trial);
        method.attempt(&mut ivp, &mut step_start, h, &norm, &mut trial);
        step_start.y.copy_from_slice(&trial.next);
        std::mem::swap(&mut step_start.slope, &mut trial.slope);
        (step_start.t, step_start.slope_known) = (f64::from(k + 1) * h, trial.slope_known);
    }
    (point(&step_start.y), ivp.evaluations)
}

fn distance(a: Point, b: Point) -> f64 {
    (a.x - b.x).hypot(a.v - b.v)
}

/// Observed order, from three runs with smaller and smaller steps. No exact solution is needed.
fn observed_order(mut method: impl FnMut() -> Any, force: Solve, steps: u32) -> f64 {
    let mut run = |factor: u32| integrate(method().as_mut(), force, factor * steps).0;
    let (coarse, middle, fine) = (run(1), run(2), run(4));
    (distance(coarse, middle) / distance(middle, fine)).log2()
}

fn assert_order(name: &str, found: f64, order: f64) {
    println!("{name}: order {found:.3}");
    assert!((found - order).abs() < 0.15, "{name}: order {found}, not {order}");
}

#[test]
fn every_method_has_its_order() {
    let smooth: Solve = |t, p| -p.x.sin() - 0.3 * p.v + 0.5 * t.cos();
    assert_order("merson", observed_order(|| Box::new(RungeKutta::new(&MERSON)), smooth, 20), 4.0);
    assert_order(
        "dormand-prince",
        observed_order(|| Box::new(RungeKutta::new(&DORMAND_PRINCE)), smooth, 20),
        5.0,
    );
    assert_order("chebyshev", observed_order(|| Box::new(Chebyshev::new(f64::INFINITY)), smooth, 50), 2.0);
}

#[test]
fn velocity_verlet_has_order_2_where_forces_are_conservative_and_1_otherwise() {
    assert_order("conservative", observed_order(|| Box::new(Verlet), free_pendulum, 50), 2.0);
    assert_order("damped", observed_order(|| Box::new(Verlet), pendulum, 200), 1.0);
}

#[test]
fn chebyshev_keeps_its_order_with_many_stages() {
    // The number of stages follows from a stiffness of 2000, in a direction that decays at once.
    let stiff: Solve = |t, p| -2000.0 * (p.v - t.cos()) - t.sin();
    let exact = |steps: u32| {
        let (end, evaluations) = integrate(&mut Chebyshev::new(f64::INFINITY), stiff, steps);
        (end, evaluations)
    };
    let ((coarse, few), (middle, _), (fine, _)) = (exact(100), exact(200), exact(400));
    assert!(few > 100 * 7, "{few} right-hand sides are no many stages");
    // The velocity follows the forcing at any step size, so the order is measured on the position.
    let order = ((coarse.x - middle.x) / (middle.x - fine.x)).log2();
    assert!((order - 2.0).abs() < 0.3, "order {order}");
}

/// Growth factor of a step of `s` stages for y' = lambda y with h lambda = z, a complex number.
fn chebyshev_growth(s: usize, damping: f64, z: Vector2<f64>) -> f64 {
    let times = |a: Vector2<f64>, b: Vector2<f64>| Vector2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
    let (one, mut older, mut last) = (Vector2::new(1.0, 0.0), Vector2::zeros(), Vector2::zeros());
    let mut table = Vec::new();
    chebyshev::tabulate(s, damping, &mut table);
    for (j, row) in table.into_iter().enumerate() {
        let change = if j == 0 {
            times(z, one) * row.mu_slope
        } else {
            last * row.mu + older * row.nu + times(z, one + last) * row.mu_slope + times(z, one) * row.gamma
        };
        (older, last) = (last, change);
    }
    (one + last).norm()
}

#[test]
fn strong_damping_holds_oscillations() {
    use chebyshev::{STRONG_DAMPING, STRONG_INTERVAL};
    let grows = |s: usize, r: f64, degrees: f64| {
        let angle = degrees.to_radians();
        chebyshev_growth(s, STRONG_DAMPING, Vector2::new(-r * angle.cos(), r * angle.sin())) > 1.0 + 1e-12
    };
    for s in [9, 20, 100, 1000] {
        let end = STRONG_INTERVAL * ((s * s) as f64 - 1.0);
        assert!((1..=1000).all(|k| !grows(s, end * f64::from(k) / 1000.0, 0.0)), "{s} stages");
    }
    // Larger than with the usual damping, where 3.2 and 2.4 are the ends.
    for (degrees, end) in [(60.0, 4.3), (66.0, 3.75), (75.0, 2.95)] {
        for s in [10, 20, 100] {
            let first = (1..1000).map(|k| 0.01 * f64::from(k)).find(|&r| grows(s, r, degrees)).unwrap();
            assert!((end - 0.15..end + 0.8).contains(&first), "{s} stages at {degrees} degrees: {first}");
        }
    }
}

#[test]
fn the_stabilised_method_is_stable_along_the_real_axis_as_far_as_it_says() {
    for s in [2, 3, 5, 10, 50, 200, chebyshev::MOST_STAGES] {
        let edge = chebyshev::real_stability(s);
        let inside = (1..=2000).map(|k| {
            chebyshev_growth(s, chebyshev::DAMPING, Vector2::new(-edge * f64::from(k) / 2000.0, 0.0))
        });
        let worst = inside.fold(0.0, f64::max);
        assert!(worst <= 1.0, "{s} stages: {worst} inside {edge}");
        // With few stages, or an odd number of them, the stable interval is a little longer.
        let margin = if s < 10 { 1.3 } else { 1.06 };
        let beyond = chebyshev_growth(s, chebyshev::DAMPING, Vector2::new(-margin * edge, 0.0));
        assert!(beyond > 1.0, "{s} stages: {beyond} beyond the edge");
        // In the middle the factor is at most 1 - epsilon/3, or slightly more with few stages.
        if s >= 5 {
            let middle = chebyshev_growth(s, chebyshev::DAMPING, Vector2::new(-0.5 * edge, 0.0));
            assert!(middle < 1.0 - chebyshev::DAMPING / 4.0, "{s} stages: {middle}");
        }
    }
}

#[test]
fn the_stabilised_method_is_stable_for_damped_waves() {
    for s in [5, 10, 30, 100] {
        let edge = chebyshev::real_stability(s);
        // Half the width of the strip around the real axis in which waves decay, away from its ends.
        let stable = |width: f64| {
            let along = |k: i32| Vector2::new(-1.0 - 0.95 * (edge - 1.0) * f64::from(k) / 4000.0, width);
            (0..=4000).all(|k| chebyshev_growth(s, chebyshev::DAMPING, along(k)) <= 1.0)
        };
        let width = (1..400).map(|k| f64::from(k) / 100.0).take_while(|&width| stable(width)).last();
        println!("{s} stages: waves with |Im(h lambda)| up to {width:?} decay");
        assert!(width.is_some_and(|width| width >= if s < 10 { 0.45 } else { 1.0 }), "{s} stages: {width:?}");
        // Without damping a wave grows: the method is not meant for such a problem.
        assert!(chebyshev_growth(s, chebyshev::DAMPING, Vector2::new(0.0, 2.0)) > 1.0);
    }
}

#[test]
fn stages_are_enough_and_not_more_than_that() {
    for z in [0.1, 1.0, 10.0, 1e3, 1e5] {
        let s = chebyshev::stages_for(z);
        assert!(chebyshev::real_stability(s) >= z, "{s} stages for {z}");
        assert!(s == 2 || chebyshev::real_stability(s - 1) < z, "{s} stages for {z}");
    }
    assert_eq!(chebyshev::stages_for(f64::INFINITY), chebyshev::MOST_STAGES + 1);
}

#[test]
fn the_spectral_radius_of_damping_and_of_an_oscillation_is_found() {
    let cases: [(Solve, f64); 3] =
        [(|_, p| -500.0 * p.v, 500.0), (|_, p| -400.0 * p.x, 20.0), (|_, p| -1e4 * p.x - 1e3 * p.v, 989.9)];
    for (force, exact) in cases {
        let mut ivp = Points::new(force);
        let mut step_start = StepStart::new(0.0, vec![1.0, 0.2]);
        step_start.find_slope(&mut ivp);
        for steady in [false, true] {
            let mut radius = SpectralRadius::default();
            step_start.direction_known = false;
            step_start.direction.clear();
            radius.update(&mut ivp, &mut step_start, &mut TrialStep::default(), steady);
            let ratio = radius.bound() / exact;
            assert!((1.0..1.3).contains(&ratio), "{} is not {exact}", radius.bound());
        }
    }
}

#[test]
fn a_steady_stiffness_falls_slowly_in_the_estimate_and_rises_at_once() {
    // Damping is strong until t = 1.
    let force: Solve = |t, p| if t < 1.0 { -500.0 * p.v } else { -5.0 * p.v };
    let mut ivp = Points::new(force);
    let (mut trial, mut radius) = (TrialStep::default(), SpectralRadius::default());
    let mut bound = |t: f64, steady: bool| {
        let mut step_start = StepStart::new(t, vec![1.0, 0.2]);
        step_start.find_slope(&mut ivp);
        radius.doubt();
        radius.update(&mut ivp, &mut step_start, &mut trial, steady);
        radius.bound()
    };
    let stiff = bound(0.0, true);
    let fallen = bound(2.0, true);
    assert!((fallen / stiff - 0.95).abs() < 1e-3, "{fallen} after {stiff}");
    assert!(bound(2.0, false) < 10.0);
    assert!((bound(0.0, true) / stiff - 1.0).abs() < 1e-3);
}

#[test]
fn first_same_as_last_and_rejected_trials_save_right_hand_sides() {
    let counts = |method: &mut dyn Method| integrate(method, free_pendulum, 10).1;
    assert_eq!(counts(&mut RungeKutta::new(&MERSON)), 50);
    assert_eq!(counts(&mut RungeKutta::new(&DORMAND_PRINCE)), 61);
    assert_eq!(counts(&mut Verlet), 11);
    // A repeated trial knows the slope at its start and gives the same result.
    let mut ivp: Points<Solve> = Points::new(free_pendulum);
    let mut step_start = StepStart::new(0.0, vec![1.0, 0.0]);
    let norm = plain(true);
    let (mut method, mut trial) = (RungeKutta::new(&MERSON), TrialStep::default());
    method.attempt(&mut ivp, &mut step_start, 0.1, &norm, &mut trial);
    let once = trial.next.clone();
    method.attempt(&mut ivp, &mut step_start, 0.2, &norm, &mut trial);
    method.attempt(&mut ivp, &mut step_start, 0.1, &norm, &mut trial);
    assert_eq!((ivp.evaluations, trial.evaluations, &trial.next), (13, 4, &once));
}

#[test]
fn the_inside_of_a_step_joins_its_ends_smoothly() {
    let methods: [(Any, f64); 3] = [
        (Box::new(RungeKutta::new(&DORMAND_PRINCE)), 1e-9),
        (Box::new(Chebyshev::new(f64::INFINITY)), 1e-4),
        (Box::new(Verlet), 1e-4),
    ];
    for (mut method, tolerance) in methods {
        let mut ivp: Points<Solve> = Points::new(free_pendulum);
        let mut step_start = StepStart::new(0.0, vec![1.0, 0.2]);
        let norm = plain(false);
        let mut trial = TrialStep::default();
        method.stable_step(&mut ivp, &mut step_start, &mut trial);
        method.attempt(&mut ivp, &mut step_start, 0.05, &norm, &mut trial);
        let layout = ivp.layout().clone();
        let inside = |share| {
            let inside = method.inside(share, 0.05, &step_start, &trial, &layout);
            point(&inside.expect("it has a dense output"))
        };
        assert!(
            distance(inside(0.0), point(&step_start.y)) < 1e-15
                && distance(inside(1.0), point(&trial.next)) < 1e-15
        );
        // The reference is many small steps of the most accurate method, up to the middle of the step.
        let mut fine = StepStart::new(0.0, vec![1.0, 0.2]);
        let (mut exact, mut step) = (RungeKutta::new(&DORMAND_PRINCE), TrialStep::default());
        for _ in 0..25 {
            exact.attempt(&mut ivp, &mut fine, 0.001, &norm, &mut step);
            fine.y.copy_from_slice(&step.next);
            fine.slope_known = false;
        }
        let error = distance(inside(0.5), point(&fine.y));
        assert!(error < tolerance, "{}: {error:e}", method.name());
    }
}

#[test]
fn what_is_lost_is_integrated_as_well_as_the_motion() {
    /// x'' = -c v, which loses the power c v^2. The energy lost from v = 1 up to t = 1 is (1 - e^(-2c))/2.
    struct Brake {
        points: Points<Solve>,
        power: f64,
    }
    impl Ivp for Brake {
        fn layout(&self) -> &Layout {
            self.points.layout()
        }
        fn begin(&mut self) {
            self.points.begin();
        }
        fn rhs(&mut self, t: f64, y: &[f64], dydt: &mut [f64]) {
            self.points.rhs(t, y, dydt);
            self.power = 3.0 * y[1] * y[1];
        }
        fn dissipation(&self) -> Dissipation {
            [self.power, 0.0]
        }
        fn agree(&mut self, y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
            self.points.agree(y, next, finish)
        }
        fn length(&mut self, v: &[f64]) -> f64 {
            self.points.length(v)
        }
        fn add_direction(&mut self, round: u64, share: f64, v: &mut [f64]) {
            self.points.add_direction(round, share, v);
        }
        fn small_length(&self) -> f64 {
            self.points.small_length()
        }
    }
    let methods: [(Any, f64); 4] = [
        (Box::new(RungeKutta::new(&MERSON)), 1e-7),
        (Box::new(RungeKutta::new(&DORMAND_PRINCE)), 1e-8),
        (Box::new(Chebyshev::new(f64::INFINITY)), 1e-3),
        (Box::new(Verlet), 5e-2),
    ];
    for (mut method, tolerance) in methods {
        let force: Solve = |_, p| -3.0 * p.v;
        let mut ivp = Brake { points: Points::new(force), power: 0.0 };
        let mut step_start = StepStart::new(0.0, vec![0.0, 1.0]);
        let norm = plain(false);
        let (mut trial, mut dissipated) = (TrialStep::default(), 0.0);
        for k in 0..50 {
            method.stable_step(&mut ivp, &mut step_start, &mut trial);
            method.attempt(&mut ivp, &mut step_start, 0.02, &norm, &mut trial);
            dissipated += trial.dissipated[0];
            step_start.y.copy_from_slice(&trial.next);
            std::mem::swap(&mut step_start.slope, &mut trial.slope);
            (step_start.slope_known, step_start.dissipation) = (trial.slope_known, trial.dissipation);
            step_start.t = 0.02 * f64::from(k + 1);
        }
        let exact = 0.5 * (1.0 - (-6.0f64).exp());
        assert!((dissipated - exact).abs() < tolerance, "{}: {dissipated} is not {exact}", method.name());
    }
}

/// Damped oscillators, and in a second segment the rate at which each pair of neighbours wears: rows that
/// belong to contacts of the oscillators and change with them.
struct Chain {
    layout: Layout,
}

impl Chain {
    const POINTS: usize = 5;

    fn new() -> Self {
        let points = Segment { rows: Self::POINTS, width: 2, positions: 1 };
        let contacts = Segment { rows: Self::POINTS - 1, width: 1, positions: 0 };
        Chain { layout: Layout(vec![points, contacts]) }
    }

    fn start() -> Vec<f64> {
        let points = (0..Self::POINTS).flat_map(|k| [0.1 * k as f64, (k as f64).sin()]);
        points.chain(std::iter::repeat_n(0.0, Self::POINTS - 1)).collect()
    }
}

impl Ivp for Chain {
    fn layout(&self) -> &Layout {
        &self.layout
    }
    fn begin(&mut self) {}
    fn rhs(&mut self, _t: f64, y: &[f64], dydt: &mut [f64]) {
        let n = Self::POINTS;
        let (points, memory) = y.split_at(2 * n);
        let (slopes, rates) = dydt.split_at_mut(2 * n);
        for k in 0..n {
            slopes[2 * k] = points[2 * k + 1];
            slopes[2 * k + 1] = -4.0 * points[2 * k] - 0.2 * points[2 * k + 1];
        }
        for k in 0..n - 1 {
            // The contact remembers its shear, which fades, and pulls at both of its points.
            let shear = points[2 * k + 3] - points[2 * k + 1];
            rates[k] = shear - 0.5 * memory[k];
            slopes[2 * k + 1] += memory[k];
            slopes[2 * k + 3] -= memory[k];
        }
    }
    fn agree(&mut self, _y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
        let parts = self.layout.clone();
        let errors = parts.parts().map(|part| finish(part, &mut next[part.range()]));
        let error = errors.map(|errors| errors.error()).fold(0.0, f64::max);
        TrialOutcome { error, covered: true, within_travel: true }
    }
    fn length(&mut self, v: &[f64]) -> f64 {
        v.iter().map(|number| number * number).sum::<f64>().sqrt()
    }
    fn add_direction(&mut self, round: u64, share: f64, v: &mut [f64]) {
        v.iter_mut().enumerate().for_each(|(k, v)| *v += share * ((k as u64 * 7 + round) % 5) as f64);
    }
    fn small_length(&self) -> f64 {
        1.5e-8
    }
}

#[test]
fn a_second_segment_is_integrated_with_the_order_of_the_method() {
    let run = |method: &mut dyn Method, steps: u32| {
        let mut ivp = Chain::new();
        let mut step_start = StepStart::new(0.0, Chain::start());
        let norm = Norm { weights: vec![vec![1.0; 2], vec![1.0]], rate: false, mean: None, rows: Vec::new() };
        let (mut trial, h) = (TrialStep::default(), 1.0 / f64::from(steps));
        for k in 0..steps {
            method.stable_step(&mut ivp, &mut step_start, &mut trial);
            method.attempt(&mut ivp, &mut step_start, h, &norm, &mut trial);
            step_start.y.copy_from_slice(&trial.next);
            std::mem::swap(&mut step_start.slope, &mut trial.slope);
            (step_start.t, step_start.slope_known) = (f64::from(k + 1) * h, trial.slope_known);
        }
        let error = method.error_of(ivp.layout().row(1, 2), h, &norm, &step_start, &trial);
        assert!(error.is_finite());
        step_start.y
    };
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let methods: [(Make, u32, f64); 4] = [
        (|| Box::new(RungeKutta::new(&MERSON)), 10, 4.0),
        (|| Box::new(RungeKutta::new(&DORMAND_PRINCE)), 10, 5.0),
        (|| Box::new(Chebyshev::new(f64::INFINITY)), 20, 2.0),
        (|| Box::new(Verlet), 100, 1.0),
    ];
    let mut ends = Vec::new();
    for (method, steps, order) in methods {
        let [coarse, middle, fine] = [1, 2, 4].map(|factor| run(method().as_mut(), factor * steps));
        let found = (apart(&coarse, &middle) / apart(&middle, &fine)).log2();
        let name = method().name();
        assert!((found - order).abs() < 0.35, "{name}: order {found}, not {order}");
        ends.push(fine);
    }
    // All agree on the memory of the contacts.
    assert!(ends.iter().all(|end| apart(end, &ends[1]) < 5e-3), "{ends:?}");
}
