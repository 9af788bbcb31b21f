//! The method switch: how `auto` chooses between an explicit method and the stabilised one, by the work that
//! each needs.

use crate::ode::{Limit, MethodName, Tableau};
use serde::{Deserialize, Serialize};

/// Number of steps limited by their error over which the work is compared.
const WINDOW: u64 = 1024;
/// The same while the stabilised method is only tried. The number is small, because the errors of these steps
/// are those of a method of order 2.
const TRIAL: u64 = 24;
/// The usual number of steps of the explicit method before stiffness is checked. Doubled whenever the
/// stabilised method was no better.
pub const PATIENCE: u64 = 256;
/// The same where a method of order 2 follows the first impacts well.
pub const LITTLE_PATIENCE: u64 = 64;
/// Upper limit of that number.
const MOST_PATIENCE: u64 = 65536;
/// Factor by which the explicit method must be cheaper to replace a stabilised method that has proved itself.
///
/// The factor favours the stabilised method because it copes with sudden stiffness. While that method is only
/// tried, the factor is 1.
const CLEARLY: f64 = 3.0;
/// Share of the stable interval beyond which the explicit method counts as limited by stability.
const NEAR_THE_EDGE: f64 = 0.6;

/// The two kinds of methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// Dormand-Prince or Merson: a fixed number of right-hand sides a step, and a small largest stable step.
    Explicit,
    /// Chebyshev: the number of right-hand sides grows with the square root of step size times stiffness.
    Stabilised,
}

/// Compares the work of both methods. Its decisions use only numbers that are the same on every process.
#[derive(Debug, Clone)]
pub struct MethodSwitch {
    explicit: &'static Tableau,
    reason: &'static str,
    fixed: bool,
    /// Steps before stiffness is checked first.
    patience: u64,
    tally: Tally,
}

/// What the method switch knows of the steps so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    active: Kind,
    /// Number of steps in the current comparison.
    window: u64,
    /// Steps compared so far, the time that they covered (s), and the right-hand sides that they took.
    steps: u64,
    time: f64,
    spent: u64,
    /// Right-hand sides that the explicit method would have needed for stability over the same time.
    explicit_need: f64,
    patience: u64,
    /// Spectral radius found while the explicit method is active, 1/s; none until it has been found.
    bound: Option<f64>,
    last: f64,
    /// Accepted steps of each kind, and number of switches.
    taken: [u64; 2],
    changes: u64,
}

impl MethodSwitch {
    /// Starts with the explicit method `explicit`, for the given `reason`, and checks stiffness after
    /// `patience` steps of it.
    pub fn new(explicit: &'static Tableau, reason: &'static str, patience: u64) -> Self {
        let tally = Tally {
            active: Kind::Explicit,
            window: WINDOW,
            steps: 0,
            time: 0.0,
            spent: 0,
            explicit_need: 0.0,
            patience,
            bound: None,
            last: 0.0,
            taken: [0; 2],
            changes: 0,
        };
        MethodSwitch { explicit, reason, fixed: false, patience, tally }
    }

    /// A switch that always stays with the first method.
    pub fn forever(self) -> Self {
        MethodSwitch { fixed: true, ..self }
    }

    /// What another method switch needs to continue in the same way.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Restores a tally, from this process or another. Returns whether the stabilised method is active.
    pub fn recall(&mut self, tally: Tally) -> bool {
        self.tally = tally;
        tally.active == Kind::Stabilised
    }

    /// Whether the method never changes.
    pub fn is_final(&self) -> bool {
        self.fixed
    }

    /// Right-hand sides that a step of the explicit method takes.
    fn explicit_cost(&self) -> f64 {
        (self.explicit.stages() - usize::from(self.explicit.first_same_as_last)) as f64
    }

    /// Takes an accepted step into account.
    ///
    /// The step has the size `h` (s), decided by `limit`, and took `spent` right-hand sides. `bound` is the
    /// spectral radius (1/s), if it is known.
    pub fn step(&mut self, h: f64, limit: Limit, spent: u64, bound: Option<f64>) {
        self.tally.last = h;
        self.tally.taken[self.tally.active as usize] += 1;
        // A step that is not limited by its error is as long with either method, and says nothing.
        if self.tally.active == Kind::Stabilised && limit != Limit::Error {
            return;
        }
        self.tally.steps += 1;
        self.tally.time += h;
        self.tally.spent += spent;
        if let Some(bound) = bound {
            self.tally.explicit_need += self.explicit_cost() * h * bound / self.explicit.real_stability;
        }
    }

    /// Whether the spectral radius should be found: the explicit method has taken enough steps since the last
    /// check.
    pub fn wants_stiffness(&self) -> bool {
        !self.fixed
            && self.tally.active == Kind::Explicit
            && self.tally.steps >= self.tally.patience
            && self.tally.bound.is_none()
    }

    /// Takes the spectral radius `bound` (1/s) into account.
    pub fn learn(&mut self, bound: f64) {
        self.tally.bound = Some(bound);
    }

    /// Switches to the other method if that needs less work. Returns the largest step (s) with which it may
    /// start, or none if the method stays.
    pub fn change(&mut self) -> Option<f64> {
        match self.tally.active {
            Kind::Stabilised if self.tally.steps >= self.tally.window => {
                let clearly = if self.tally.window == TRIAL { 1.0 } else { CLEARLY };
                self.tally.window = WINDOW;
                let cheaper = self.tally.spent as f64 > clearly * self.tally.explicit_need;
                let stable = self.explicit.real_stability * self.tally.time
                    / self.tally.explicit_need.max(1e-300)
                    * self.explicit_cost();
                self.restart();
                if !cheaper {
                    // The stabilised method has proved itself: try it again soon after the next switch.
                    self.tally.patience = self.patience;
                    return None;
                }
                self.tally.patience = (2 * self.tally.patience).min(MOST_PATIENCE);
                self.switch(Kind::Explicit);
                Some((0.9 * stable).min(self.tally.last))
            }
            Kind::Explicit => {
                let bound = self.tally.bound.take()?;
                let stiff = self.tally.last * bound > NEAR_THE_EDGE * self.explicit.real_stability;
                self.restart();
                if !stiff {
                    return None;
                }
                self.tally.window = TRIAL;
                self.switch(Kind::Stabilised);
                Some(f64::INFINITY)
            }
            Kind::Stabilised => None,
        }
    }

    fn restart(&mut self) {
        (self.tally.steps, self.tally.time, self.tally.spent, self.tally.explicit_need) = (0, 0.0, 0, 0.0);
    }

    fn switch(&mut self, to: Kind) {
        self.tally.active = to;
        self.tally.changes += 1;
    }

    /// Which method was chosen and why. `active` and `resting` are the names of the two methods.
    pub fn report(&self, active: MethodName, resting: MethodName) -> String {
        let [explicit, stabilised] = self.tally.taken;
        let (own, other) = match self.tally.active {
            Kind::Explicit => (explicit, stabilised),
            Kind::Stabilised => (stabilised, explicit),
        };
        if self.tally.changes == 0 {
            return format!("auto: {active}, because {}", self.reason);
        }
        format!(
            "auto: {active} for {own} steps and {resting} for {other}, whichever took less work ({} changes)",
            self.tally.changes
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ode::{DORMAND_PRINCE, MERSON};

    /// A switch whose stabilised method is active and has proved itself.
    fn stabilised() -> MethodSwitch {
        let switch = MethodSwitch::new(&MERSON, "of the test", PATIENCE);
        let tally = Tally { active: Kind::Stabilised, changes: 1, ..switch.tally };
        MethodSwitch { tally, ..switch }
    }

    #[test]
    fn small_steps_of_the_stabilised_method_give_way_to_the_explicit_one() {
        // h rho = 0.1: a step of the stabilised method costs three right-hand sides. A step of the explicit
        // method takes five and may be 35 times as long.
        let mut switch = stabilised();
        for _ in 0..WINDOW {
            assert_eq!(switch.change(), None);
            switch.step(1e-6, Limit::Error, 3, Some(1e5));
        }
        let first = switch.change().expect("it changes");
        assert!(first <= 1e-6, "the step does not jump: {first}");
        assert!(
            switch
                .report(MethodName::Merson, MethodName::Chebyshev)
                .contains("merson for 0 steps and chebyshev for 1024")
        );
    }

    #[test]
    fn free_flight_says_nothing() {
        let mut switch = stabilised();
        for _ in 0..10 * WINDOW {
            switch.step(1e-2, Limit::Travel, 2, Some(0.0));
            assert_eq!(switch.change(), None);
        }
    }

    #[test]
    fn large_steps_keep_the_stabilised_method() {
        // h rho = 100: the explicit method would need 141 right-hand sides.
        let mut switch = stabilised();
        for _ in 0..10 * WINDOW {
            switch.step(1e-3, Limit::Error, 14, Some(1e5));
            assert_eq!(switch.change(), None);
        }
        assert!(
            switch
                .report(MethodName::Chebyshev, MethodName::Merson)
                .starts_with("auto: chebyshev for 10240 steps")
        );
    }

    #[test]
    fn an_explicit_method_at_its_edge_gives_way() {
        for (bound, changes) in [(2e4, true), (5e3, false)] {
            for patience in [PATIENCE, LITTLE_PATIENCE] {
                let mut switch = MethodSwitch::new(&DORMAND_PRINCE, "of the test", patience);
                for _ in 0..patience {
                    assert!(!switch.wants_stiffness());
                    switch.step(1.5e-4, Limit::Error, 6, None);
                }
                assert!(switch.wants_stiffness());
                switch.learn(bound);
                assert_eq!(switch.change().is_some(), changes);
            }
        }
    }

    #[test]
    fn a_choice_for_ever_is_never_looked_at_again() {
        let mut switch = MethodSwitch::new(&DORMAND_PRINCE, "of the test", PATIENCE).forever();
        for _ in 0..10 * PATIENCE {
            switch.step(1.0, Limit::Error, 6, None);
            assert!(!switch.wants_stiffness() && switch.change().is_none());
        }
    }
}
