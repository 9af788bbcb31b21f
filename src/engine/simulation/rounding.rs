//! Refuses a tolerance that is finer than the numbers of the state can resolve.

use super::Simulation;
use crate::error::Error;
use crate::ode::{Ivp, Norm, Part};

/// Rounding errors of a step, in units in the last place: its result is a sum of a handful of changes.
const ROUNDINGS: f64 = 10.0;

impl Simulation<'_> {
    /// Refuses a tolerance that rounding alone exceeds. Collective.
    pub(super) fn check_rounding(&self, tightening: f64) -> Result<(), Error> {
        let (layout, y) = (self.dynamics.layout(), &self.step_start.y);
        let size = |part: Part| self.norm.largest(part, &y[part.range()]);
        let mut largest = [size(layout.whole(0))];
        self.comm.max(&mut largest);
        let i = self.dynamics.worst(|i| size(layout.row(0, i)));
        check(&self.norm, self.control.tolerance, tightening, largest[0], i)
    }
}

/// Refuses a tolerance that is smaller than the rounding error of the state.
///
/// The error estimate shrinks with the step, so it could only be met by steps so small that the run never
/// ends. An error rate contains the rounding of the slopes, so it needs no check.
fn check(norm: &Norm, tolerance: f64, tightening: f64, largest: f64, i: u64) -> Result<(), Error> {
    let rounding = ROUNDINGS * f64::EPSILON * largest;
    if norm.rate || tolerance >= rounding {
        return Ok(());
    }
    Err(Error::Rounding { tolerance: tolerance / tightening, rounding, i, enough: rounding / tightening })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_below_ten_roundings_is_refused_where_errors_are_no_rates() {
        let scaled = Norm { weights: vec![vec![1.0; 6]], rate: false, mean: None, rows: Vec::new() };
        // 4.2 m over a radius of 0.1 m: 10 * 2.2e-16 * 42.
        assert_eq!(check(&scaled, 1e-13, 1.0, 42.0, 7), Ok(()));
        let why = check(&scaled, 9e-14, 1.0, 42.0, 7).unwrap_err();
        assert_eq!(why.exit_code(), 3);
        assert!(why.to_string().contains("solver.tolerance = 9e-14 is below round-off"), "{why}");
        assert!(
            why.to_string().contains("particle 7") && why.to_string().contains("9.33e-14 or more"),
            "{why}"
        );
        // The tolerance is tightened to a hundredth.
        let why = check(&scaled, 9e-14, 0.01, 42.0, 7).unwrap_err().to_string();
        assert!(why.contains("9.33e-12 or more"), "{why}");
        let rate = Norm { weights: vec![vec![1.0; 6]], rate: true, mean: None, rows: Vec::new() };
        assert_eq!(check(&rate, 1e-20, 1.0, 42.0, 7), Ok(()));
    }
}
