//! The driver: takes steps until the end of the scene, and frames on the way.

use crate::contact::{Law, Rebound, Tangential};
use crate::domain::{Comm, rows};
use crate::dynamics::{Clocks, Dynamics};
use crate::effects::{self, Effects, Variant};
use crate::error::Error;
use crate::forces::Setting;
use crate::ode::{Linear, MERSON, StepRule, Stepper, Verdict, larger};
use crate::particle::{Locked, Motion, Spin, Spinning, Vec3};
use crate::scene::Scene;
use crate::start::Start;
use std::time::Instant;

/// Forced accepts in a row that end a run.
const FORCED_IN_A_ROW: u64 = 1000;
/// Accepted steps after which forced accepts may not exceed one in a hundred.
const FORCED_GRACE: u64 = 100_000;

/// Work done so far, the same on every rank and for every number of ranks.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Counts {
    /// Steps that stand.
    pub accepted: u64,
    /// Steps whose error was too large.
    pub rejected: u64,
    /// Trials that left the neighbour lists or moved a particle too far.
    pub outrun: u64,
    /// Steps accepted at the minimum although their error was too large.
    pub forced: u64,
    /// Collective right-hand sides, those of rejected trials and of frames included.
    pub rhs: u64,
    /// Pairs within l_max whose force was evaluated.
    pub pairs: u64,
    /// Times the neighbour lists were built.
    pub rebuilds: u64,
}

/// The state of the system at one time, as the output and the progress line want it.
#[derive(Debug)]
pub struct Frame<'a, W> {
    /// Time, s.
    pub time: f64,
    /// Size of the last accepted step, s.
    pub step: f64,
    /// Work so far.
    pub counts: Counts,
    /// Kinetic energy, J.
    pub kinetic_energy: f64,
    /// Potential energy of contacts and height, J.
    pub potential_energy: f64,
    /// Largest overlap, m.
    pub largest_overlap: f64,
    /// Highest point of any sphere, m.
    pub bed_height: f64,
    /// First id of `rows`.
    pub first: u64,
    /// This rank's block of the particles, by id.
    pub rows: &'a [Motion<W>],
}

/// Receives the frames of a run.
pub trait Observer<W> {
    /// A frame is due. Collective.
    fn frame(&mut self, frame: &Frame<W>) -> Result<(), Error>;
}

impl<W, F: FnMut(&Frame<W>) -> Result<(), Error>> Observer<W> for F {
    fn frame(&mut self, frame: &Frame<W>) -> Result<(), Error> {
        self(frame)
    }
}

/// How a run went.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    /// Work done.
    pub counts: Counts,
    /// Time in the parts of the work on this rank.
    pub clocks: Clocks,
    /// Wall time in frames on this rank: measures and output, s.
    pub output_seconds: f64,
    /// Wall time of the run, s.
    pub seconds: f64,
    /// Largest overlap of any frame, m.
    pub largest_overlap: f64,
    /// Memory of the solver on this rank, bytes.
    pub bytes: usize,
    /// Ghosts of this rank at the end.
    pub ghosts: usize,
}

/// Work that can be done with the kernel of any scene's effects.
pub trait Task {
    /// What it gives.
    type Output;
    /// Does it with the scene's contact law and the state `Motion<W>`.
    fn with<R: Rebound, T: Tangential, W: Spin>(self, law: Law<R, T>) -> Self::Output;
}

/// The one place where effects become types: the paper's three variants, with or without loss on rebound.
pub fn dispatch<K: Task>(scene: &Scene, task: K) -> K::Output {
    let effects = Effects::of(scene);
    if effects.dissipative {
        with_rebound(scene, effects.variant, effects::dissipative(scene), task)
    } else {
        with_rebound(scene, effects.variant, effects::elastic(scene), task)
    }
}

fn with_rebound<R: Rebound, K: Task>(scene: &Scene, variant: Variant, rebound: R, task: K) -> K::Output {
    let (coulomb, frictionless) = (effects::coulomb(scene), effects::frictionless(scene));
    match variant {
        Variant::Basic => task.with::<_, _, Locked>(effects::law(scene, rebound, frictionless)),
        Variant::Friction => task.with::<_, _, Locked>(effects::law(scene, rebound, coulomb)),
        Variant::FrictionRotation => task.with::<_, _, Spinning>(effects::law(scene, rebound, coulomb)),
    }
}

/// A scene in motion.
pub struct Simulation<'c, R, T, W: Spin> {
    comm: &'c dyn Comm,
    dynamics: Dynamics<'c, R, T, W>,
    stepper: Stepper<Motion<W>>,
    rule: StepRule,
    /// Time of the last accepted state, s.
    t: f64,
    /// Last accepted state of the owned particles.
    y: Vec<Motion<W>>,
    /// Result of the trial at hand, or the state at a frame.
    next: Vec<Motion<W>>,
    /// Proposal for the next step, s.
    h: f64,
    /// Size of the last accepted step, s.
    last: f64,
    counts: Counts,
    forced_in_a_row: u64,
    t_end: f64,
    interval: f64,
    started: Instant,
}

impl<'c, R: Rebound, T: Tangential, W: Spin> Simulation<'c, R, T, W> {
    /// Puts the particles of `start` (all of them, on every rank) in motion under `law`. Collective.
    pub fn new(scene: &Scene, start: &Start, law: Law<R, T>, comm: &'c dyn Comm) -> Result<Self, Error> {
        let r = scene.particles.radius;
        let setting = Setting {
            mass: scene.particles.mass,
            inverse_inertia: 1.0 / (0.4 * scene.particles.mass * r * r),
            gravity: scene.gravity.into(),
            walls: crate::container::walls(&scene.container),
        };
        Self::with_setting(scene, start, law, setting, comm)
    }

    /// `new` with a setting of one's own.
    pub fn with_setting(
        scene: &Scene,
        start: &Start,
        law: Law<R, T>,
        setting: Setting,
        comm: &'c dyn Comm,
    ) -> Result<Self, Error> {
        let own = rows::block(start.x.len() as u64, comm.rank(), comm.size());
        let body = |i: u64| {
            let i = i as usize;
            let omega = W::from_vector(Vec3::from(start.omega[i]));
            Motion { x: start.x[i].into(), v: start.v[i].into(), omega }
        };
        let mut y: Vec<Motion<W>> = own.clone().map(body).collect();
        let mut dynamics = Dynamics::new(comm, law, setting, own.collect(), &mut y)?;
        let mut stepper = Stepper::new(&MERSON);
        stepper.start(&mut dynamics, 0.0, &y);
        let rule = StepRule {
            tolerance: scene.solver.tolerance,
            exponent: MERSON.exponent,
            min_step: scene.solver.min_step,
            max_step: scene.solver.max_step,
        };
        let mut simulation = Simulation {
            comm,
            dynamics,
            stepper,
            t: 0.0,
            y,
            next: Vec::new(),
            h: rule.clamp(scene.solver.initial_step),
            rule,
            last: 0.0,
            counts: Counts { rhs: 1, ..Counts::default() },
            forced_in_a_row: 0,
            t_end: scene.t_end,
            interval: scene.output.interval.unwrap_or(scene.t_end / 100.0),
            started: Instant::now(),
        };
        // A start that cannot be continued is told before any output is created.
        match simulation.broken_stage() {
            Some(_) => Err(simulation.unbearable(0, 0.0)),
            None => Ok(simulation),
        }
    }

    /// The equations of motion.
    pub fn dynamics(&self) -> &Dynamics<'c, R, T, W> {
        &self.dynamics
    }

    /// The equations of motion, to evaluate them at will.
    pub fn dynamics_mut(&mut self) -> &mut Dynamics<'c, R, T, W> {
        &mut self.dynamics
    }

    /// Last accepted state of the owned particles, by id.
    pub fn state(&self) -> &[Motion<W>] {
        &self.y
    }

    /// Runs to the end of the scene and hands every frame to `observer`. Collective.
    pub fn run(mut self, observer: &mut dyn Observer<W>) -> Result<Outcome, Error> {
        let mut output_seconds = 0.0;
        let mut largest_overlap = 0.0f64;
        let mut show = |this: &mut Self, t: f64, state: &[Motion<W>]| -> Result<(), Error> {
            let clock = Instant::now();
            largest_overlap = largest_overlap.max(this.show(t, state, observer)?);
            output_seconds += clock.elapsed().as_secs_f64();
            Ok(())
        };
        let first = self.y.clone();
        show(&mut self, 0.0, &first)?;
        let mut frame = 1;
        'steps: loop {
            let (h, forced) = self.find_step()?;
            let reached = self.t + h;
            let extremes = self.dynamics.candidate();
            while self.frame_time(frame) < reached {
                let due = self.frame_time(frame);
                let result = std::mem::take(&mut self.next);
                let share = (due - self.t) / h;
                if !self.step_aside(share, h, &result) {
                    // Rare: the same step again, with fresh lists.
                    self.rebuild()?;
                    self.h = h;
                    continue 'steps;
                }
                if due >= self.t_end {
                    self.count(share * h, forced)?;
                }
                let state = std::mem::replace(&mut self.next, result);
                show(&mut self, due, &state)?;
                if due >= self.t_end {
                    return Ok(self.outcome(output_seconds, largest_overlap));
                }
                frame += 1;
            }
            self.count(h, forced)?;
            self.accept(h);
            self.dynamics.commit(extremes);
            if self.frame_time(frame) <= self.t {
                let state = std::mem::take(&mut self.y);
                show(&mut self, reached, &state)?;
                self.y = state;
                if reached >= self.t_end {
                    return Ok(self.outcome(output_seconds, largest_overlap));
                }
                frame += 1;
            }
        }
    }

    /// Time of frame `k`: k times the interval, and the end of the scene, s.
    fn frame_time(&self, k: u64) -> f64 {
        let t = k as f64 * self.interval;
        if t < self.t_end - 1e-9 * self.interval { t } else { self.t_end }
    }

    /// Tries steps from the last accepted state until one can stand; its result is in `next`. Returns its size (s) and
    /// whether it stands only because it could not be smaller. Collective.
    fn find_step(&mut self) -> Result<(f64, bool), Error> {
        loop {
            if self.dynamics.will_outrun(self.h.min(self.dynamics.step_limit())) {
                self.rebuild()?;
            }
            let h = self.rule.clamp(self.h.min(self.dynamics.step_limit()));
            let verdict = self.attempt(h);
            if !verdict.covered && !self.dynamics.lists_are_fresh() {
                // Stale lists say nothing about the step: the same again with fresh ones.
                self.counts.outrun += 1;
                self.rebuild()?;
                self.h = h;
                continue;
            }
            if !verdict.within_travel || !verdict.covered {
                self.counts.outrun += 1;
                self.fail_if_impossible(h, verdict)?;
                self.h = self.rule.clamp(0.5 * h);
                continue;
            }
            let decision = self.rule.judge(h, verdict.error);
            self.h = decision.next;
            if decision.accept {
                if self.t + h == self.t {
                    return Err(self.no_step(h));
                }
                return Ok((h, decision.forced));
            }
            self.counts.rejected += 1;
            if verdict.error == f64::INFINITY {
                self.fail_if_impossible(h, verdict)?;
            }
        }
    }

    /// One trial step from the last accepted state. Collective.
    fn attempt(&mut self, h: f64) -> Verdict {
        self.counts.rhs += self.stepper.cost();
        self.stepper.attempt(&mut self.dynamics, self.t, h, &self.y, &mut self.next)
    }

    /// Takes a step of its own, a `share` of the accepted step `h` (s) with the given `result`, from the last accepted
    /// state to a frame; its result is in `next`. Returns false, and nothing else, if the lists are too old for it.
    /// Collective.
    fn step_aside(&mut self, share: f64, h: f64, result: &[Motion<W>]) -> bool {
        let verdict = self.attempt(share * h);
        if !verdict.covered && !self.dynamics.lists_are_fresh() {
            return false;
        }
        if verdict.covered && verdict.error < f64::INFINITY {
            return true;
        }
        // The frame's stages meet something that those of the step did not, such as two centres that pass through each
        // other at this very moment: the parabola through the start, its slope and the result of the step is finite.
        let (y, slopes) = (&self.y, self.stepper.slope(0));
        self.next.clear();
        self.next.extend(y.iter().zip(slopes).zip(result).map(|((y, slope), result)| {
            let mut bend = *result;
            bend.add_scaled(-1.0, y);
            bend.add_scaled(-h, slope);
            let mut state = *y;
            state.add_scaled(share * h, slope);
            state.add_scaled(share * share, &bend);
            state
        }));
        true
    }

    /// The step `h` (s) stands.
    fn accept(&mut self, h: f64) {
        std::mem::swap(&mut self.y, &mut self.next);
        self.t += h;
        self.stepper.forget();
    }

    fn rebuild(&mut self) -> Result<(), Error> {
        self.stepper.forget();
        self.dynamics.rebuild(&mut self.y, self.t)
    }

    /// A trial with step `h` (s) led nowhere: that is final if the state itself has no finite right-hand side or the
    /// step cannot be smaller. Collective.
    fn fail_if_impossible(&mut self, h: f64, verdict: Verdict) -> Result<(), Error> {
        let broken = self.broken_stage();
        if broken != Some(0) && h > self.rule.min_step {
            return Ok(());
        }
        if let Some(s) = broken {
            return Err(self.unbearable(s, h));
        }
        if verdict.within_travel {
            return Err(self.no_step(h));
        }
        let start = self.stepper.slope(0);
        let i = self.dynamics.worst(|i| start[i].x.norm() + h * start[i].v.norm());
        Err(Error::TooFast { t: self.t, h, i, travel: self.dynamics.travel() })
    }

    /// Why the right-hand side in stage `s` of the last trial, with step `h` (s), is not finite. Collective.
    fn unbearable(&mut self, s: usize, h: f64) -> Error {
        let state = self.stepper.stage(s, h, &self.y);
        let t = self.t + self.stepper.tableau().c[s] * h;
        self.dynamics.explain(&state, t).unwrap_or_else(|| {
            let i = self.dynamics.worst(|i| self.stepper.slope(s)[i].max_abs());
            Error::Acceleration { i, t }
        })
    }

    /// The first stage of the last trial whose right-hand side is not finite, if any. Collective.
    fn broken_stage(&self) -> Option<usize> {
        let steepest = |s: usize| self.stepper.slope(s).iter().map(Linear::max_abs).fold(0.0, larger);
        let mut steepest: Vec<f64> = (0..self.stepper.tableau().stages()).map(steepest).collect();
        self.comm.max(&mut steepest);
        steepest.iter().position(|&slope| slope == f64::INFINITY)
    }

    fn no_step(&self, h: f64) -> Error {
        let i = self.limiting_particle();
        Error::NoStep { t: self.t, h, min_step: self.rule.min_step, i }
    }

    /// The particle with the largest error in the last trial. Collective.
    fn limiting_particle(&self) -> u64 {
        self.dynamics.worst(|i| self.stepper.error_of(i))
    }

    /// Counts a step `h` (s) that stands, and ends the run when those that stand only because they are the smallest
    /// prevail. Collective.
    fn count(&mut self, h: f64, forced: bool) -> Result<(), Error> {
        self.last = h;
        self.counts.accepted += 1;
        self.counts.forced += u64::from(forced);
        self.forced_in_a_row = if forced { self.forced_in_a_row + 1 } else { 0 };
        let accepted = self.counts.accepted;
        let prevail = accepted > FORCED_GRACE && self.counts.forced * 100 > accepted;
        if forced && (self.forced_in_a_row >= FORCED_IN_A_ROW || prevail) {
            return Err(Error::BelowRoundOff {
                tolerance: self.rule.tolerance,
                forced: self.counts.forced,
                accepted,
                t: self.t,
                h,
                min_step: self.rule.min_step,
                i: self.limiting_particle(),
            });
        }
        Ok(())
    }

    /// Hands the state at time `t` (s) to the observer. Returns the largest overlap, m. Collective.
    fn show(&mut self, t: f64, state: &[Motion<W>], observer: &mut dyn Observer<W>) -> Result<f64, Error> {
        let dynamics = &mut self.dynamics;
        self.counts.pairs = dynamics.pair_evaluations();
        self.counts.rebuilds = dynamics.rebuilds();
        let (potential_energy, largest_overlap) = dynamics.potential_energy(state);
        let rows = rows::by_id(self.comm, dynamics.count(), dynamics.ids(), state);
        observer.frame(&Frame {
            time: t,
            step: self.last,
            counts: self.counts,
            kinetic_energy: dynamics.kinetic_energy(state),
            potential_energy,
            largest_overlap,
            bed_height: dynamics.bed_height(state),
            first: rows::block(dynamics.count(), self.comm.rank(), self.comm.size()).start,
            rows: &rows,
        })?;
        Ok(largest_overlap)
    }

    fn outcome(&self, output_seconds: f64, largest_overlap: f64) -> Outcome {
        let states = self.y.capacity() * (self.stepper.tableau().stages() + 3);
        Outcome {
            counts: self.counts,
            clocks: self.dynamics.clocks,
            output_seconds,
            seconds: self.started.elapsed().as_secs_f64(),
            largest_overlap,
            bytes: self.dynamics.bytes() + states * size_of::<Motion<W>>(),
            ghosts: self.dynamics.ghosts(),
        }
    }
}
