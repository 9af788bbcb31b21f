//! How do I solve an initial value problem of my own with the methods of demhybrid?
//!
//! A planet on an ellipse returns to its start after one period. The step size follows the error.

use demhybrid::ode::{
    DORMAND_PRINCE, FinishRows, Ivp, Layout, Method, Norm, RungeKutta, Segment, StepControl, StepRule,
    StepStart, TrialOutcome, TrialStep,
};

/// x'' = -x/|x|^3 in the plane. A row of the state is x, y and their velocities.
struct Planet {
    layout: Layout,
}

impl Ivp for Planet {
    fn layout(&self) -> &Layout {
        &self.layout
    }
    fn begin(&mut self) {}
    fn rhs(&mut self, _t: f64, y: &[f64], dydt: &mut [f64]) {
        let cube = y[0].hypot(y[1]).powi(3);
        dydt.copy_from_slice(&[y[2], y[3], -y[0] / cube, -y[1] / cube]);
    }
    fn agree(&mut self, _y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
        // One process, one segment: the error of all rows is that of its only part.
        TrialOutcome { error: finish(self.layout.whole(0), next).error(), covered: true, within_travel: true }
    }
    // The last three matter to methods that estimate the stiffness: `Chebyshev`, and `auto`.
    fn length(&mut self, v: &[f64]) -> f64 {
        v.iter().map(|number| number * number).sum::<f64>().sqrt()
    }
    fn add_direction(&mut self, _round: u64, share: f64, v: &mut [f64]) {
        v.iter_mut().for_each(|number| *number += 0.5 * share);
    }
    fn small_length(&self) -> f64 {
        1e-8
    }
}

fn main() {
    let mut ivp = Planet { layout: Layout(vec![Segment { rows: 1, width: 4, positions: 2 }]) };
    let (eccentricity, period) = (0.6f64, std::f64::consts::TAU);
    let nearest = [1.0 - eccentricity, 0.0, 0.0, ((1.0 + eccentricity) / (1.0 - eccentricity)).sqrt()];

    let mut method = RungeKutta::new(&DORMAND_PRINCE);
    let mut control = StepControl::new(StepRule::ProportionalIntegral, 1e-9, 1e-9, 0.5);
    let norm = Norm { weights: vec![vec![1.0; 4]], rate: false, mean: None, rows: Vec::new() };
    let (mut start, mut trial) = (StepStart::new(0.0, nearest.to_vec()), TrialStep::default());
    let (mut h, mut accepted, mut evaluations) = (1e-3, 0, 0);
    while start.t < period {
        let step = f64::min(h, period - start.t);
        let outcome = method.attempt(&mut ivp, &mut start, step, &norm, &mut trial);
        evaluations += trial.evaluations;
        let decision = control.judge(step, outcome.error, method.error_order());
        h = decision.next;
        if decision.accept {
            // The end of this step is the start of the next one; its slope may be known already.
            std::mem::swap(&mut start.y, &mut trial.next);
            std::mem::swap(&mut start.slope, &mut trial.slope);
            (start.t, start.slope_known) = (start.t + step, trial.slope_known);
            accepted += 1;
        }
    }
    let error = start.y.iter().zip(nearest).map(|(found, exact)| (found - exact).abs()).fold(0.0, f64::max);
    println!("{accepted} steps, {evaluations} right-hand sides");
    println!("after one period of {period:.4}: off by {error:.1e}");
    assert!(error < 1e-5);
}
