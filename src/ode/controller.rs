//! The step rule of the paper's solver: a pure function of error and step.

/// What to do with a trial step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// The step stands.
    pub accept: bool,
    /// It stands only because it could not be smaller.
    pub forced: bool,
    /// Proposal for the next trial, s; within the limits of the rule.
    pub next: f64,
}

/// Accepts and sizes steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepRule {
    /// Tolerance delta: a bound on the error rate of the method.
    pub tolerance: f64,
    /// Power of (tolerance/error), from the method.
    pub exponent: f64,
    /// Smallest step, s: a finite error is accepted there.
    pub min_step: f64,
    /// Largest step, s.
    pub max_step: f64,
}

impl StepRule {
    /// Judges a step `h` (s) with the given error (not NaN; +infinity: something was not finite).
    /// The factor is 0.8 (tolerance/error)^exponent within 0.1..5, and 2 without any error.
    pub fn judge(&self, h: f64, error: f64) -> Decision {
        if error == f64::INFINITY {
            return Decision { accept: false, forced: false, next: self.clamp(0.25 * h) };
        }
        let met = error < self.tolerance;
        let factor = if error == 0.0 {
            2.0
        } else {
            (0.8 * (self.tolerance / error).powf(self.exponent)).clamp(0.1, 5.0)
        };
        let forced = !met && h <= self.min_step;
        Decision { accept: met || forced, forced, next: self.clamp(factor * h) }
    }

    /// The step within its limits, s.
    pub fn clamp(&self, h: f64) -> f64 {
        h.clamp(self.min_step, self.max_step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: StepRule = StepRule { tolerance: 0.1, exponent: 0.2, min_step: 1e-9, max_step: 0.5 };

    #[test]
    fn a_step_is_accepted_below_the_tolerance_only() {
        assert!(RULE.judge(1e-3, 0.099).accept);
        assert!(!RULE.judge(1e-3, 0.1).accept);
        assert!(!RULE.judge(1e-3, f64::INFINITY).accept);
    }

    #[test]
    fn the_factor_follows_the_published_rule_within_limits() {
        let factor = |error| RULE.judge(1e-3, error).next / 1e-3;
        assert_eq!(factor(0.0), 2.0);
        assert!((factor(0.1) - 0.8).abs() < 1e-15);
        assert!((factor(0.1 / 32.0) - 1.6).abs() < 1e-12);
        assert!((factor(1e-30) - 5.0).abs() < 1e-12);
        assert!((factor(1e30) - 0.1).abs() < 1e-12);
        assert!((factor(f64::INFINITY) - 0.25).abs() < 1e-15);
    }

    #[test]
    fn steps_stay_within_their_limits() {
        assert_eq!(RULE.judge(0.4, 0.0).next, 0.5);
        let smallest = RULE.judge(1e-9, 5.0);
        assert!(smallest.accept && smallest.forced);
        assert_eq!(smallest.next, 1e-9);
        assert!(!RULE.judge(1e-9, f64::INFINITY).accept);
        assert!(!RULE.judge(1e-9, 0.01).forced);
    }
}
