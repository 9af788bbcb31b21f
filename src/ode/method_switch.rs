//! How `auto` chooses between an explicit method and the stabilised one: by the work that both would take.

use crate::ode::{Limit, Tableau};
use serde::{Deserialize, Serialize};

/// Steps limited by their error over which work is compared.
const WINDOW: u64 = 1024;
/// The same where the stabilised method is only tried: few, because its errors are those of a method of order 2.
const TRIAL: u64 = 24;
/// Steps of the explicit method before stiffness is looked at; doubled whenever the stabilised method was no better.
const PATIENCE: u64 = 256;
/// The longest patience.
const MOST_PATIENCE: u64 = 65536;
/// The explicit method must be cheaper by this factor to take over from a stabilised one that has been good so far, which
/// copes with sudden stiffness; after a mere trial it needs no factor.
const CLEARLY: f64 = 3.0;
/// Share of the stable interval beyond which the explicit method is limited by stability.
const NEAR_THE_EDGE: f64 = 0.6;

/// The two kinds of methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// Dormand-Prince or Merson: a fixed number of right-hand sides a step, and a small stable step.
    Explicit,
    /// Chebyshev: right-hand sides as the square root of step times stiffness.
    Stabilised,
}

/// Compares work. Everything it looks at is the same on every rank.
#[derive(Debug, Clone)]
pub struct MethodSwitch {
    explicit: &'static Tableau,
    reason: &'static str,
    fixed: bool,
    tally: Tally,
}

/// What the choice remembers of the steps so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    active: Kind,
    /// Steps that the window at hand needs.
    window: u64,
    /// Steps in that window, time that they covered (s), right-hand sides that they took.
    steps: u64,
    time: f64,
    spent: u64,
    /// Right-hand sides that the explicit method would need for stability in the window.
    explicit_need: f64,
    patience: u64,
    /// Spectral radius just found for the explicit method, 1/s.
    bound: Option<f64>,
    last: f64,
    /// Steps by kind, and changes.
    taken: [u64; 2],
    changes: u64,
}

impl MethodSwitch {
    /// Starts with the method `explicit`, for `reason`.
    pub fn new(explicit: &'static Tableau, reason: &'static str) -> Self {
        let tally = Tally {
            active: Kind::Explicit,
            window: WINDOW,
            steps: 0,
            time: 0.0,
            spent: 0,
            explicit_need: 0.0,
            patience: PATIENCE,
            bound: None,
            last: 0.0,
            taken: [0; 2],
            changes: 0,
        };
        MethodSwitch { explicit, reason, fixed: false, tally }
    }

    /// The choice is made once and for all.
    pub fn forever(self) -> Self {
        MethodSwitch { fixed: true, ..self }
    }

    /// What it remembers.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// Takes up what it remembered, in this process or another. Returns whether the methods have changed places since the
    /// start.
    pub fn recall(&mut self, tally: Tally) -> bool {
        self.tally = tally;
        tally.active == Kind::Stabilised
    }

    /// Whether it will never change.
    pub fn is_final(&self) -> bool {
        self.fixed
    }

    /// Right-hand sides of a step of the explicit method.
    fn explicit_cost(&self) -> f64 {
        (self.explicit.stages() - usize::from(self.explicit.first_same_as_last)) as f64
    }

    /// A step `h` (s) stands that took `spent` right-hand sides; `limit` decided its size, and `bound` is the spectral
    /// radius (1/s) if it is known.
    pub fn step(&mut self, h: f64, limit: Limit, spent: u64, bound: Option<f64>) {
        self.tally.last = h;
        self.tally.taken[self.tally.active as usize] += 1;
        // In free flight both methods take the same steps.
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

    /// Whether the spectral radius should be found, because the explicit method has had its time.
    pub fn wants_stiffness(&self) -> bool {
        !self.fixed
            && self.tally.active == Kind::Explicit
            && self.tally.steps >= self.tally.patience
            && self.tally.bound.is_none()
    }

    /// The spectral radius is `bound`, 1/s.
    pub fn learn(&mut self, bound: f64) {
        self.tally.bound = Some(bound);
    }

    /// Whether the other method should take over; if so, the largest step (s) that it may start with.
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
                    // It is worth its while: look again soon when it rests.
                    self.tally.patience = PATIENCE;
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

    /// What was chosen and why; `active` and `resting` are the names of the methods.
    pub fn report(&self, active: &str, resting: &str) -> String {
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

    /// One for which the stabilised method has taken over and proved itself.
    fn stabilised() -> MethodSwitch {
        let switch = MethodSwitch::new(&MERSON, "of the test");
        let tally = Tally { active: Kind::Stabilised, changes: 1, ..switch.tally };
        MethodSwitch { tally, ..switch }
    }

    #[test]
    fn small_steps_of_the_stabilised_method_give_way_to_the_explicit_one() {
        // h rho = 0.1: five right-hand sides cover 35 of the steps that take three each.
        let mut switch = stabilised();
        for _ in 0..WINDOW {
            assert_eq!(switch.change(), None);
            switch.step(1e-6, Limit::Error, 3, Some(1e5));
        }
        let first = switch.change().expect("it changes");
        assert!(first <= 1e-6, "the step does not jump: {first}");
        assert!(switch.report("merson", "chebyshev").contains("merson for 0 steps and chebyshev for 1024"));
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
        // h rho = 100: the explicit method would take 141 right-hand sides.
        let mut switch = stabilised();
        for _ in 0..10 * WINDOW {
            switch.step(1e-3, Limit::Error, 14, Some(1e5));
            assert_eq!(switch.change(), None);
        }
        assert!(switch.report("chebyshev", "merson").starts_with("auto: chebyshev for 10240 steps"));
    }

    #[test]
    fn an_explicit_method_at_its_edge_gives_way() {
        for (bound, changes) in [(2e4, true), (5e3, false)] {
            let mut switch = MethodSwitch::new(&DORMAND_PRINCE, "of the test");
            for _ in 0..PATIENCE {
                assert!(!switch.wants_stiffness());
                switch.step(1.5e-4, Limit::Error, 6, None);
            }
            assert!(switch.wants_stiffness());
            switch.learn(bound);
            assert_eq!(switch.change().is_some(), changes);
        }
    }

    #[test]
    fn a_choice_for_ever_is_never_looked_at_again() {
        let mut switch = MethodSwitch::new(&DORMAND_PRINCE, "of the test").forever();
        for _ in 0..10 * PATIENCE {
            switch.step(1.0, Limit::Error, 6, None);
            assert!(!switch.wants_stiffness() && switch.change().is_none());
        }
    }
}
