//! Step control: accepts or rejects steps and chooses their sizes.
//!
//! Decisions depend only on the errors and steps so far, which are the same on every process.

use serde::{Deserialize, Serialize};

/// What decided the size of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Limit {
    /// The tolerance on the error.
    Error,
    /// A step may not grow faster than by a fixed factor, and not at all right after a rejection.
    Growth,
    /// The method would be unstable.
    Stability,
    /// The problem allows rows to move only so far in one step.
    Travel,
    /// The problem forbids to step into a change that it sees coming.
    Contact,
    /// The largest step: `solver.max_step`, or `solver.step`.
    Maximum,
    /// The smallest step: `solver.min_step`.
    Minimum,
    /// None: it is the first step of the run.
    First,
    /// The end of the run.
    End,
}

impl Limit {
    /// All limits, in the order in which they are reported.
    pub const ALL: [Limit; 9] = [
        Limit::Error,
        Limit::Growth,
        Limit::Stability,
        Limit::Travel,
        Limit::Contact,
        Limit::Maximum,
        Limit::Minimum,
        Limit::First,
        Limit::End,
    ];

    /// Name in the summary of a run.
    pub fn name(self) -> &'static str {
        match self {
            Limit::Error => "error",
            Limit::Growth => "growth",
            Limit::Stability => "stability",
            Limit::Travel => "travel",
            Limit::Contact => "contact",
            Limit::Maximum => "maximum",
            Limit::Minimum => "minimum",
            Limit::First => "first",
            Limit::End => "end",
        }
    }
}

/// Decision on a trial step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Whether the step is accepted.
    pub accept: bool,
    /// Whether it was accepted only because steps cannot be smaller.
    pub forced: bool,
    /// Proposed size of the next trial, s; within the limits of the step control.
    pub next: f64,
    /// What decided the proposed size.
    pub limit: Limit,
}

/// Rule for the factor by which the step size changes, as a function of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepRule {
    /// The paper's rule: the factor is 0.8 (tolerance/error)^(1/order), within 0.1..5; 2 for an error of 0.
    Published,
    /// A proportional-integral rule.
    ///
    /// The factor is safety (tolerance/error)^(0.7/order) (error before/tolerance)^(0.4/order), within
    /// 0.1..5. Steps settle where the error is a share safety^(order/0.3) of the tolerance: about a tenth for
    /// the usual 0.8 and order 3. They do not alternate between growth and rejection.
    ///
    /// K. Gustafsson, ACM TOMS 17 (1991) 533; E. Hairer, G. Wanner, Solving ODEs II, IV.2.
    ProportionalIntegral,
    /// No error estimate: the step size is constant.
    Fixed,
}

/// Accepts or rejects steps and proposes their sizes.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{StepControl, StepRule};
///
/// let mut control = StepControl::new(StepRule::ProportionalIntegral, 1e-6, 1e-9, 1.0);
/// let good = control.judge(0.1, 1e-8, 5.0);
/// assert!(good.accept && good.next > 0.1);
/// let bad = control.judge(good.next, 1e-4, 5.0);
/// assert!(!bad.accept && bad.next < good.next);
/// assert!(control.judge(1e-9, 1e-4, 5.0).forced); // the smallest step is taken all the same
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepControl {
    /// The rule.
    pub rule: StepRule,
    /// A step is accepted if its error is smaller than this.
    pub tolerance: f64,
    /// Smallest step, s. At this size a step is accepted whatever its error, if that is finite.
    pub min_step: f64,
    /// Largest step, s.
    pub max_step: f64,
    /// Safety of the proportional-integral rule: [`SAFETY`], or [`SAFETY_OF_MEANS`] for a mean of errors.
    pub safety: f64,
    /// Error over tolerance of the last accepted step, at least 1e-6; none before the first.
    pub before: Option<f64>,
    /// Whether the error of the last trial was too large.
    pub rejected: bool,
    /// Steps longer than this do not follow the fastest oscillations of the problem, s; infinite if there are
    /// none.
    pub long: f64,
    /// What long steps have seen; none outside of a sequence of them.
    pub seen: Option<Seen>,
}

/// Errors over tolerance in a sequence of long steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// The lowest.
    lowest: f64,
    /// The lowest since they grew last.
    low: f64,
    /// Whether the last step grew them.
    grew: bool,
}

/// Errors over tolerance of long steps are not told apart below this: rounding is no sign of instability.
const LEAST_LOW: f64 = 1e-10;

/// The factor for the step after a long one, and what decided it. `wanted` is what its `error` over tolerance
/// alone would give.
///
/// A long step does not follow the fastest oscillations. Nothing shows that they are stable but that they
/// fade. So a long step grows only where its error is the lowest of all. It shrinks a little where it is not,
/// and more where errors have grown threefold. Where they have done so twice running, or are thirty times the
/// lowest of all, something is unstable: the next step is not long. So what comes to rest stays at rest, with
/// steps as long as the method allows; where the motion goes on, steps shrink until they are not long.
///
/// `share` is the longest step that is not long over this step.
fn long_step(seen: &mut Option<Seen>, error: f64, wanted: (f64, Limit), share: f64) -> (f64, Limit) {
    let error = error.max(LEAST_LOW);
    let before = seen.unwrap_or(Seen { lowest: error, low: error, grew: false });
    let growth = error / before.low;
    let (now, most) = if error <= before.lowest {
        (Seen { lowest: error, low: error, grew: false }, 1.3)
    } else if growth <= 3.0 {
        (Seen { low: before.low.min(error), grew: false, ..before }, 0.97)
    } else {
        let most = if before.grew || error > 30.0 * before.lowest { (0.9 * share).min(0.7) } else { 0.7 };
        (Seen { low: error, grew: true, ..before }, most)
    };
    *seen = Some(now);
    if wanted.0 > most { (most, Limit::Stability) } else { wanted }
}

/// Safety of a step where the largest error counts.
pub const SAFETY: f64 = 0.8;
/// Safety of a step where a mean of errors counts. A mean changes less from one step to the next than the
/// largest error, so steps may come closer to the tolerance: they settle at a third of it.
pub const SAFETY_OF_MEANS: f64 = 0.9;
/// Largest factor by which a step may grow.
pub const GROWTH: f64 = 5.0;
/// Smallest error that is distinguished from zero, as a share of the tolerance.
const LEAST_ERROR: f64 = 1e-6;
/// Smallest factor by which a step may shrink.
const SHRINKAGE: f64 = 0.1;

impl StepControl {
    /// A step control before the first step.
    pub fn new(rule: StepRule, tolerance: f64, min_step: f64, max_step: f64) -> Self {
        StepControl {
            rule,
            tolerance,
            min_step,
            max_step,
            safety: SAFETY,
            before: None,
            rejected: false,
            long: f64::INFINITY,
            seen: None,
        }
    }

    /// Decides on a step of size `h` (s) with the given error, and proposes the next size.
    ///
    /// `error` must not be NaN; +infinity means that something was not finite. `order` is the power of h with
    /// which the error of the method shrinks.
    pub fn judge(&mut self, h: f64, error: f64, order: f64) -> Decision {
        if error == f64::INFINITY {
            self.rejected = true;
            return self.decision(false, false, 0.25 * h, Limit::Error);
        }
        let met = error < self.tolerance;
        let forced = !met && h <= self.min_step;
        let (factor, limit) = match self.rule {
            StepRule::Fixed => (1.0, Limit::Maximum),
            StepRule::Published if error == 0.0 => (2.0, Limit::Growth),
            StepRule::Published => bounded(0.8 * (self.tolerance / error).powf(1.0 / order), GROWTH),
            StepRule::ProportionalIntegral => self.proportional_integral(error / self.tolerance, met, order),
        };
        let (factor, limit) = if h <= self.long {
            self.seen = None;
            (factor, limit)
        } else if met {
            long_step(&mut self.seen, error / self.tolerance, (factor, limit), self.long / h)
        } else {
            (factor, limit)
        };
        if met || forced {
            self.before = Some((error / self.tolerance).max(LEAST_ERROR));
        }
        self.rejected = !met;
        self.decision(met || forced, forced, factor * h, limit)
    }

    fn proportional_integral(&self, error: f64, met: bool, order: f64) -> (f64, Limit) {
        if !met {
            return bounded((SAFETY * error.powf(-1.0 / order)).min(0.9), 1.0);
        }
        // Errors far below the tolerance do not follow the order of the method.
        let error = error.max(LEAST_ERROR);
        let before = self.before.unwrap_or(1.0);
        let factor = self.safety * error.powf(-0.7 / order) * before.powf(0.4 / order);
        // No growth right after a rejection.
        bounded(factor, if self.rejected { 1.0 } else { GROWTH })
    }

    fn decision(&self, accept: bool, forced: bool, h: f64, limit: Limit) -> Decision {
        let next = self.clamp(h);
        let limit = match next {
            next if next < h => Limit::Maximum,
            next if next > h => Limit::Minimum,
            _ => limit,
        };
        Decision { accept, forced, next, limit }
    }

    /// The step size `h` within its limits, s.
    pub fn clamp(&self, h: f64) -> f64 {
        h.clamp(self.min_step, self.max_step)
    }
}

/// The factor within its limits, and what set it.
fn bounded(factor: f64, most: f64) -> (f64, Limit) {
    if factor > most { (most, Limit::Growth) } else { (factor.max(SHRINKAGE), Limit::Error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(rule: StepRule) -> StepControl {
        StepControl::new(rule, 0.1, 1e-9, 0.5)
    }

    #[test]
    fn a_step_is_accepted_below_the_tolerance_only() {
        for rule in [StepRule::Published, StepRule::ProportionalIntegral] {
            assert!(control(rule).judge(1e-3, 0.099, 5.0).accept);
            assert!(!control(rule).judge(1e-3, 0.1, 5.0).accept);
            assert!(!control(rule).judge(1e-3, f64::INFINITY, 5.0).accept);
        }
    }

    #[test]
    fn the_factor_follows_the_published_rule_within_limits() {
        let factor = |error| control(StepRule::Published).judge(1e-3, error, 5.0).next / 1e-3;
        assert_eq!(factor(0.0), 2.0);
        assert!((factor(0.1) - 0.8).abs() < 1e-15);
        assert!((factor(0.1 / 32.0) - 1.6).abs() < 1e-12);
        assert!((factor(1e-30) - 5.0).abs() < 1e-12);
        assert!((factor(1e30) - 0.1).abs() < 1e-12);
        assert!((factor(f64::INFINITY) - 0.25).abs() < 1e-15);
    }

    #[test]
    fn steps_stay_within_their_limits_and_say_which() {
        let large = control(StepRule::Published).judge(0.4, 0.0, 5.0);
        assert_eq!((large.next, large.limit), (0.5, Limit::Maximum));
        let smallest = control(StepRule::Published).judge(1e-9, 5.0, 5.0);
        assert!(smallest.accept && smallest.forced);
        assert_eq!((smallest.next, smallest.limit), (1e-9, Limit::Minimum));
        assert!(!control(StepRule::Published).judge(1e-9, f64::INFINITY, 5.0).accept);
        assert!(!control(StepRule::Published).judge(1e-9, 0.01, 5.0).forced);
        let growing = control(StepRule::ProportionalIntegral).judge(1e-3, 1e-20, 5.0);
        assert_eq!((growing.next, growing.limit), (5e-3, Limit::Growth));
    }

    #[test]
    fn the_proportional_integral_rule_settles_at_a_share_of_the_tolerance() {
        // A problem whose error is 1e6 h^3: the step size should settle without a rejection.
        for safety in [SAFETY, SAFETY_OF_MEANS] {
            let mut control = StepControl { safety, ..control(StepRule::ProportionalIntegral) };
            let (mut h, mut rejected) = (1e-6, 0);
            let mut steps = Vec::new();
            for _ in 0..60 {
                let decision = control.judge(h, 1e6 * h.powi(3), 3.0);
                rejected += u32::from(!decision.accept);
                h = decision.next;
                steps.push(h);
            }
            assert_eq!(rejected, 0);
            let error = 1e6 * h.powi(3) / 0.1;
            assert!((error - safety.powi(10)).abs() < 1e-3, "{error} of the tolerance");
            assert!((steps[59] / steps[58] - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn a_step_does_not_grow_right_after_a_rejection() {
        let mut control = control(StepRule::ProportionalIntegral);
        let rejected = control.judge(1e-3, 0.5, 3.0);
        assert!(!rejected.accept && rejected.next < 1e-3);
        let next = control.judge(rejected.next, 1e-6, 3.0);
        assert_eq!((next.accept, next.next, next.limit), (true, rejected.next, Limit::Growth));
        assert!(control.judge(next.next, 1e-6, 3.0).next > next.next);
    }

    #[test]
    fn a_fixed_step_stays() {
        let mut control = StepControl::new(StepRule::Fixed, 1.0, 1e-5, 1e-5);
        let decision = control.judge(1e-5, 0.0, 2.0);
        assert_eq!((decision.accept, decision.next, decision.limit), (true, 1e-5, Limit::Maximum));
    }

    #[test]
    fn long_steps_grow_while_errors_fall_and_shrink_else() {
        let mut control = StepControl { long: 1e-2, ..control(StepRule::ProportionalIntegral) };
        let mut factor = |h: f64, error: f64| {
            let Decision { next, limit, .. } = control.judge(h, error, 3.0);
            (next / h, limit)
        };
        let is = |found: (f64, Limit), expected: f64| {
            assert!((found.0 - expected).abs() < 1e-12 && found.1 == Limit::Stability, "{found:?}");
        };
        is(factor(2e-2, 1e-4), 1.3);
        is(factor(2e-2, 0.5e-4), 1.3);
        is(factor(2e-2, 1e-4), 0.97);
        is(factor(2e-2, 2e-4), 0.7);
        // It does not grow before the error is as low as it was.
        is(factor(2e-2, 1.9e-4), 0.97);
        is(factor(2e-2, 0.5e-4), 1.3);
        // Where errors grow twice running, or to thirty times the lowest, the next step is not long.
        is(factor(2e-2, 2e-4), 0.7);
        is(factor(2e-2, 7e-4), 0.45);
        is(factor(2e-2, 0.4e-4), 1.3);
        is(factor(2e-2, 2e-4), 0.7);
        is(factor(2e-2, 5e-4), 0.97);
        is(factor(2e-2, 13e-4), 0.45);
        is(factor(2e-2, 0.3e-4), 1.3);
        // Rounding is no motion.
        is(factor(2e-2, 1e-14), 1.3);
        is(factor(2e-2, 9e-12), 1.3);
        // A short step follows its error, and forgets what was.
        assert_ne!(factor(1e-2, 1e-4).1, Limit::Stability);
        is(factor(2e-2, 1e-4), 1.3);
        // What the error forbids stays forbidden.
        assert_eq!(factor(2e-2, 0.09).1, Limit::Error);
    }
}
