//! The right-hand side, eqs. (2.13)-(2.15), of a system of particles that is spread over ranks.

use crate::domain::halo::{Extent, Halo};
use crate::domain::migration::{self, Census};
use crate::domain::slabs::Slabs;
use crate::domain::{Comm, exact};
use crate::engine::forces::{BodyParameters, CHUNK, Forces, StageMaker};
use crate::engine::neighbors::Order;
use crate::error::{Error, StopRequest};
use crate::math::instructions::InstructionSet;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::contact::{Law, Rebound, Tangential};
use crate::model::particle::{Motion, Spin};
use crate::ode::{Dissipation, Ivp, Linear, StepStart, TrialOutcome};
use crate::threads;
use fail::fail_point;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

mod energy;
mod faults;

/// The furthest that a step may move a particle, as a share of its radius.
///
/// Both particles of a contact may move that far. Together that is far less than the way through a sphere, so
/// no step misses a collision at any tolerance.
pub const TRAVEL: f64 = 0.3;

/// How far the cutoff of lists and ghosts exceeds `l_max`, as a share of the radius.
///
/// It must be at least twice the travel: two particles may approach each other.
pub const SKIN: f64 = 2.0 * TRAVEL;

/// Time spent in the parts of the work on this rank.
#[derive(Debug, Clone, Copy, Default)]
pub struct Clocks {
    /// Waiting for and copying ghosts.
    pub ghosts: Duration,
    /// Contacts and their sums.
    pub forces: Duration,
    /// Neighbour lists, migration, slab bounds.
    pub lists: Duration,
    /// Agreement on errors, and lengths of states, over all ranks.
    pub reduction: Duration,
}

/// Extremes over all particles of one state, the same on all ranks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Largest speed, m/s.
    pub speed: f64,
    /// Largest distance from where the lists were built, m.
    pub drift: f64,
}

/// The first right-hand side found that is not finite: its time (s), state and slope. None while there is
/// none.
type FaultSearch<W> = Option<(f64, Vec<Motion<W>>, Vec<Motion<W>>)>;

/// Equations of motion of all particles. This rank owns some of them.
pub struct Dynamics<'c, R, T, W> {
    comm: &'c dyn Comm,
    forces: Forces<R, T, W>,
    census: Census,
    slabs: Slabs,
    halo: Halo,
    /// Ids of the owned particles in summation order, then of the ghosts.
    ids: Vec<u64>,
    /// Where the owned particles were when the lists were built, m.
    origin: Vec<Vec3>,
    /// Largest squared distances over all stages of this trial step, m^2: from `origin`, and from the start
    /// of the step.
    ///
    /// The first may be 0 in place of a distance that is certainly within the free path.
    moved: [f64; 2],
    /// Extremes of the accepted state.
    extremes: Extremes,
    /// Extremes of the result of the last trial.
    candidate: Extremes,
    /// Whether the last evaluation has already begun the next stage: the exported bodies are there.
    is_open: bool,
    pair_evaluations: u64,
    /// Pairs that all ranks evaluated in earlier processes of the run.
    earlier_pairs: u64,
    rebuilds: u64,
    /// Whether every right-hand side also computes the power that it dissipates.
    audits: bool,
    dissipation: Dissipation,
    fault_search: Option<FaultSearch<W>>,
    /// Returns what this rank is requested to do, if anything can interrupt the run.
    interrupts: Option<&'c dyn Fn() -> StopRequest>,
    /// The stop request on which all ranks agreed last.
    request: StopRequest,
    /// A typical speed of the scene, m/s.
    velocity_scale: f64,
    /// Largest gap at which surfaces interact, m. Lists and ghosts always cover it.
    l_max: f64,
    /// Time spent in the parts of the work.
    pub clocks: Clocks,
}

impl<'c, R: Rebound, T: Tangential, W: Spin> Dynamics<'c, R, T, W> {
    /// Takes the particles `ids` with their states `y` and brings each to the rank that owns it. Collective.
    ///
    /// The particles may be spread over the ranks in any way. Over all ranks the ids must be 0..count. Each
    /// list of `companions` is as long as `y`, and its rows move along.
    ///
    /// `velocity_scale` is a typical speed, m/s. Fails where `InstructionSet::chosen` fails, which must be
    /// the same on all ranks.
    pub fn new(
        comm: &'c dyn Comm,
        law: Law<R, T>,
        parameters: BodyParameters,
        velocity_scale: f64,
        ids: Vec<u64>,
        y: &mut Vec<Motion<W>>,
        companions: &mut [&mut Vec<Motion<W>>],
    ) -> Result<Self, Error> {
        let [set, _] = common_instructions(comm, InstructionSet::chosen()?);
        let l_max = law.l_max;
        let mut slabs = Slabs::new(comm.size(), sizes(comm, y));
        let heights: Vec<_> = y.iter().map(|body| (slabs.height(&body.x), 1)).collect();
        slabs.balance(comm, heights.into_iter());
        let mut dynamics = Dynamics {
            census: Census::take(comm, &ids),
            comm,
            forces: Forces::new(law, parameters, set),
            slabs,
            halo: Halo::default(),
            ids,
            origin: Vec::new(),
            moved: [0.0; 2],
            extremes: Extremes::default(),
            candidate: Extremes::default(),
            is_open: false,
            pair_evaluations: 0,
            earlier_pairs: 0,
            rebuilds: 0,
            audits: false,
            dissipation: [0.0; 2],
            fault_search: None,
            interrupts: None,
            request: StopRequest::Nothing,
            velocity_scale,
            l_max,
            clocks: Clocks::default(),
        };
        dynamics.forces.owned = y.len();
        dynamics.relocate(0.0, y, companions)?;
        if comm.size() > 1 {
            // The pairs are known now, so the slabs can be given equal loads.
            dynamics.relocate(0.0, y, companions)?;
            dynamics.rebuilds = 1;
        }
        Ok(dynamics)
    }

    /// From now on evaluates contacts up to `gap` (m), or up to `l_max` if that is less.
    ///
    /// Returns whether this is a change. Slopes and energies found before are then out of date.
    pub fn evaluate_within(&mut self, gap: f64) -> bool {
        let gap = gap.min(self.l_max);
        let changed = gap != self.forces.law.l_max;
        if changed {
            self.forces.evaluate_within(gap);
        }
        changed
    }

    /// Distance of centres up to which pairs are listed, m.
    pub fn cutoff(&self) -> f64 {
        let r = self.forces.law.r;
        2.0 * r + self.l_max + SKIN * r
    }

    /// The furthest that a step may move a particle, m.
    pub fn travel(&self) -> f64 {
        TRAVEL * self.forces.law.r
    }

    /// Ids of the owned particles, in the order of the states at the start of the step.
    pub fn ids(&self) -> &[u64] {
        &self.ids[..self.forces.owned]
    }

    /// Number of particles on all ranks.
    pub fn count(&self) -> u64 {
        self.census.count()
    }

    /// The slabs.
    pub fn slabs(&self) -> &Slabs {
        &self.slabs
    }

    /// Number of ghosts of this rank.
    pub fn ghosts(&self) -> usize {
        self.halo.ghosts()
    }

    /// Number of pairs on the lists of this rank.
    pub fn listed_pairs(&self) -> usize {
        self.forces.lists.pairs()
    }

    /// Pairs within `l_max` evaluated so far in the whole run, each counted once over all ranks. Collective.
    pub fn pair_evaluations(&self) -> u64 {
        self.total_pairs(self.pair_evaluations)
    }

    /// The same total, computed from an earlier value of `own_pairs` of every rank. Collective.
    pub fn total_pairs(&self, own: u64) -> u64 {
        let mut sum = [own];
        self.comm.sum(&mut sum);
        self.earlier_pairs + sum[0]
    }

    /// Pairs that this rank has evaluated in this process and whose earlier particle it owns.
    pub fn own_pairs(&self) -> u64 {
        self.pair_evaluations
    }

    /// How often the lists were built.
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// Memory held for particles, ghosts and lists on this rank, bytes.
    pub fn bytes(&self) -> usize {
        self.forces.bytes()
            + self.origin.capacity() * size_of::<Vec3>()
            + self.ids.capacity() * size_of::<u64>()
    }

    /// Extremes of the result of the last trial.
    pub fn candidate(&self) -> Extremes {
        self.candidate
    }

    /// Stores the extremes of a newly accepted state.
    pub fn commit(&mut self, extremes: Extremes) {
        self.extremes = extremes;
    }

    /// Extremes of the accepted state.
    pub fn extremes(&self) -> Extremes {
        self.extremes
    }

    /// Where the owned particles were when the lists were built, m.
    pub fn origin(&self) -> &[Vec3] {
        &self.origin
    }

    /// Continues the counts of an earlier process, over all ranks: lists built and pairs evaluated.
    pub fn go_on_from(&mut self, rebuilds: u64, pairs: u64) {
        (self.rebuilds, self.earlier_pairs) = (rebuilds, pairs);
    }

    /// From now on calls `interrupts` once a trial step, on every rank, for stop requests.
    pub fn listen_to(&mut self, interrupts: &'c dyn Fn() -> StopRequest) {
        self.interrupts = Some(interrupts);
    }

    /// The stop request of the last trial, the same on every rank.
    pub fn request(&self) -> StopRequest {
        self.request
    }

    /// Whether the lists were built at the accepted state.
    pub fn lists_are_fresh(&self) -> bool {
        self.extremes.drift == 0.0
    }

    /// The largest step from the accepted state that is expected to move no particle too far, s.
    pub fn step_limit(&self) -> f64 {
        0.9 * self.travel() / self.extremes.speed
    }

    /// Whether a step `h` (s) from the accepted state is likely to move a particle out of range of the lists.
    pub fn will_outrun(&self, h: f64) -> bool {
        self.extremes.drift + self.extremes.speed * h > self.free_path()
    }

    /// How far a particle may move before the lists must be rebuilt, m.
    fn free_path(&self) -> f64 {
        0.5 * SKIN * self.forces.law.r
    }

    /// From now on computes the dissipated power with every right-hand side. This takes two more passes over
    /// the contacts.
    pub fn audit(&mut self) {
        self.audits = true;
    }

    /// From now on looks for a right-hand side that is not finite. This takes a reduction for every
    /// right-hand side.
    pub fn watch(&mut self) {
        self.fault_search = Some(None);
    }

    /// The first right-hand side since `watch` that was not finite: time (s), state and slope. Ends the
    /// search.
    pub fn broken(&mut self) -> FaultSearch<W> {
        self.fault_search.take().flatten()
    }

    /// Moves particles to their owners, adapts the slab bounds, and builds new neighbour lists. Collective.
    ///
    /// The vectors of `step_start` may change in length and order.
    pub fn rebuild(&mut self, step_start: &mut StepStart<Motion<W>>) -> Result<(), Error> {
        let StepStart { t, y, slope, slope_known, direction, direction_known, .. } = step_start;
        // Both flags are the same on all ranks, so all ranks send the same lists.
        let known = [*slope_known, *direction_known];
        let lists =
            [slope, direction].into_iter().zip(known).filter_map(|(list, known)| known.then_some(list));
        self.relocate(*t, y, &mut lists.collect::<Vec<_>>())
    }

    fn relocate(
        &mut self,
        t: f64,
        y: &mut Vec<Motion<W>>,
        companions: &mut [&mut Vec<Motion<W>>],
    ) -> Result<(), Error> {
        let clock = Instant::now();
        self.ids.truncate(self.forces.owned);
        if self.comm.size() > 1 {
            let loads = self.forces.loads();
            let own = loads.iter().sum::<u64>() as f64;
            let all: Vec<u64> = self.gather([own]).into_iter().map(|[load]| load as u64).collect();
            let turned = self.slabs.turn(sizes(self.comm, y));
            let heights: Vec<f64> = y.iter().map(|body| self.slabs.height(&body.x)).collect();
            let particles = heights.into_iter().zip(loads);
            if turned {
                self.slabs.balance(self.comm, particles);
            } else {
                self.slabs.follow(self.comm, particles, &all);
            }
        }
        migration::migrate(self.comm, &self.slabs, &mut self.ids, y, companions);
        self.census.check(self.comm, &self.ids, t)?;
        let cutoff = self.cutoff();
        let own = [0, 1, 2].map(|axis| Extent::of(y.iter().map(|body| body.x[axis])));
        let [a, b, c] = own;
        let extents = self.gather([a.low, a.high, b.low, b.high, c.low, c.high]).into_iter();
        let extents: Vec<[Extent; 3]> =
            extents.map(|ends| [0, 2, 4].map(|k| Extent { low: ends[k], high: ends[k + 1] })).collect();
        let size = |axis: usize| Extent::around(extents.iter().map(|axes| axes[axis])).length();
        let order = Order::new([0, 1, 2].map(size), cutoff);
        migration::sort(|x, id| order.key(x, id), &mut self.ids, y, companions);
        let axis = self.slabs.axis();
        let heights: Vec<_> = extents.iter().map(|axes| axes[axis]).collect();
        let ghost_ids = self.halo.plan(self.comm, &self.ids, y, (axis, &heights), cutoff);
        self.ids.extend(ghost_ids);
        let mut bodies = Vec::with_capacity(y.len() + self.halo.ghosts());
        bodies.extend_from_slice(y);
        bodies.resize(y.len() + self.halo.ghosts(), Motion::zero());
        self.halo.refresh(self.comm, y, &mut bodies[y.len()..]);
        let keys = bodies.iter().zip(&self.ids).map(|(body, &id)| order.key(&body.x, id));
        let keys: Vec<_> = keys.collect();
        self.forces.list(&bodies, y.len(), &keys, [cutoff, cutoff - self.forces.law.r], self.halo.picks());
        self.origin.clear();
        self.origin.extend(y.iter().map(|body| body.x));
        let mut speed = [fastest(y)];
        self.comm.max(&mut speed);
        self.extremes = Extremes { speed: speed[0], drift: 0.0 };
        self.rebuilds += 1;
        self.clocks.lists += clock.elapsed();
        Ok(())
    }

    /// The numbers `own` of every rank, by rank. Collective.
    fn gather<const K: usize>(&self, own: [f64; K]) -> Vec<[f64; K]> {
        let mut all = vec![[0.0; K]; self.comm.size()];
        self.comm.all_gather(&own, all.as_flattened_mut());
        all
    }

    /// Moves owned bodies and ghosts to the state `y`. Collective.
    fn put_bodies(&mut self, y: &[Motion<W>]) {
        self.halo.refresh(self.comm, y, self.forces.ghosts());
        self.forces.put(y);
    }

    /// The right-hand side at the stage that `make` computes for a step from `y`, as in `Ivp::rhs_of`.
    /// Collective.
    fn evaluate<const K: usize>(
        &mut self,
        t: f64,
        y: &[Motion<W>],
        [stage, stages]: [usize; 2],
        mut vectors: [&mut [Motion<W>]; K],
        dydt: &mut [Motion<W>],
        make: &(impl Fn(usize, usize, [&mut [Motion<W>]; K], &mut [Motion<W>], &mut [Motion<W>]) + Sync),
    ) {
        fail_point!("rhs");
        let begun = Instant::now();
        let free = self.free_path().powi(2);
        let forces = &mut self.forces;
        let maker = StageMaker { make, stage, origin: &self.origin, free, start: y };
        let mut waited = Duration::ZERO;
        debug_assert!(!self.is_open || stage > 0, "stages of a turn come one after the other");
        if !std::mem::take(&mut self.is_open) {
            forces.begin_stage(maker, again(&mut vectors), dydt);
        }
        if !self.halo.is_idle() {
            let clock = Instant::now();
            let mut inside = Duration::ZERO;
            self.halo.pack(|k, _| forces.export(k));
            self.halo.exchange_during(self.comm, &mut || {
                fail_point!("underway");
                let clock = Instant::now();
                forces.advance_interior(maker, again(&mut vectors), dydt);
                inside = clock.elapsed();
            });
            self.halo.deliver(forces.ghosts());
            waited = clock.elapsed().saturating_sub(inside);
        }
        // Audits and the search for faults read all bodies after this stage: none may be at the next stage
        // then.
        self.is_open = stage + 1 < stages && !self.audits && self.fault_search.is_none();
        let (pairs, moved) = forces.finish_stage(maker, self.is_open, again(&mut vectors), dydt);
        self.pair_evaluations += pairs;
        self.moved = [larger(self.moved[0], moved[0]), larger(self.moved[1], moved[1])];
        if self.audits {
            self.dissipation = self.dissipated_power();
        }
        self.clocks.ghosts += waited;
        self.clocks.forces += begun.elapsed().saturating_sub(waited);
        self.look_out(t, dydt);
    }

    /// Keeps the first right-hand side that is not finite, if a search is on. Collective.
    fn look_out(&mut self, t: f64, dydt: &[Motion<W>]) {
        if matches!(self.fault_search, Some(None)) {
            let mut steepest = [dydt.iter().map(Linear::max_abs).fold(0.0, larger)];
            self.comm.max(&mut steepest);
            if steepest[0] == f64::INFINITY {
                self.fault_search = Some(Some((t, self.forces.state(), dydt.to_vec())));
            }
        }
    }
}

/// Extent of the particles of all ranks along each axis, m; negative if there are none. Collective.
fn sizes<W>(comm: &dyn Comm, y: &[Motion<W>]) -> [f64; 3] {
    let own = [0, 1, 2].map(|axis| Extent::of(y.iter().map(|body| body.x[axis])));
    let mut ends = own.map(|extent| [-extent.low, extent.high]);
    comm.max(ends.as_flattened_mut());
    ends.map(|[low, high]| high + low)
}

/// The narrowest and the widest of the instruction sets that the ranks offer. Collective.
///
/// `own` is the set of this rank. All ranks use the narrowest.
pub fn common_instructions(comm: &dyn Comm, own: InstructionSet) -> [InstructionSet; 2] {
    let number = InstructionSet::ALL.iter().position(|&set| set == own).unwrap_or(0) as f64;
    let mut ends = [-number, number];
    comm.max(&mut ends);
    ends.map(|end| InstructionSet::ALL[end.abs() as usize])
}

/// Reborrows the slices, so that they can be passed on more than once.
fn again<'v, S, const K: usize>(vectors: &'v mut [&mut [S]; K]) -> [&'v mut [S]; K] {
    vectors.each_mut().map(|vector| &mut **vector)
}

/// Largest speed, m/s.
fn fastest<W>(y: &[Motion<W>]) -> f64 {
    y.iter().fold(0.0, |speed, body| larger(speed, body.v.norm_squared())).sqrt()
}

impl<R: Rebound, T: Tangential, W: Spin> Ivp for Dynamics<'_, R, T, W> {
    type State = Motion<W>;

    fn begin(&mut self) {
        debug_assert!(!self.is_open, "a turn ends with its last stage");
        self.moved = [0.0; 2];
        self.forces.begin_step();
    }

    fn rhs(&mut self, t: f64, y: &[Motion<W>], dydt: &mut [Motion<W>]) {
        let make = |_: usize,
                    first: usize,
                    []: [&mut [Motion<W>]; 0],
                    bodies: &mut [Motion<W>],
                    _: &mut [Motion<W>]| {
            bodies.copy_from_slice(&y[first..first + bodies.len()]);
        };
        // `y` may be any state: distances measured from the start of the step do not apply.
        self.forces.begin_step();
        self.evaluate(t, y, [0, 1], [], dydt, &make);
    }

    fn rhs_of<const K: usize>(
        &mut self,
        t: f64,
        y: &[Motion<W>],
        turn: [usize; 2],
        vectors: [&mut [Motion<W>]; K],
        dydt: &mut [Motion<W>],
        make: &(impl Fn(usize, usize, [&mut [Motion<W>]; K], &mut [Motion<W>], &mut [Motion<W>]) + Sync),
    ) {
        self.evaluate(t, y, turn, vectors, dydt, make);
    }

    fn dissipation(&self) -> Dissipation {
        self.dissipation
    }

    /// Length of `v`, a vector of the state space, over all ranks.
    ///
    /// Its square is twice the kinetic energy of the velocities, plus `kappa f_0 x^2` for the positions: a
    /// spring with the stiffness of a contact at rest. Friction is symmetric in this norm.
    fn length(&mut self, v: &[Motion<W>]) -> f64 {
        let clock = Instant::now();
        let BodyParameters { mass, inverse_inertia, .. } = self.forces.parameters;
        let inertia = if inverse_inertia > 0.0 { 1.0 / inverse_inertia } else { 0.0 };
        let stiffness = self.forces.law.kappa * self.forces.law.f_0;
        let square = |body: &Motion<W>| {
            mass * body.v.norm_squared()
                + inertia * body.omega.vector().norm_squared()
                + stiffness * body.x.norm_squared()
        };
        let length = exact::exact_sum(self.comm, v.len(), |i| square(&v[i])).sqrt();
        self.clocks.reduction += clock.elapsed();
        length
    }

    fn add_direction(&mut self, round: u64, share: f64, v: &mut [Motion<W>]) {
        let size = 1.0 / (self.forces.parameters.mass * self.count() as f64).sqrt();
        let (r, ids) = (self.forces.law.r, &self.ids[..self.forces.owned]);
        threads::for_chunks(v, threads::GRAIN, |first, chunk| {
            for (body, &id) in chunk.iter_mut().zip(&ids[first..]) {
                let mut bits = migration::scramble(id ^ migration::scramble(round));
                let mut vector = |size: f64| {
                    Vec3::from_fn(|_, _| {
                        bits = migration::scramble(bits);
                        // 53 bits as a fraction in -1..1.
                        size * ((bits >> 11) as f64 * 2f64.powi(-52) - 1.0)
                    })
                };
                let (v, spin) = (vector(size), W::from_vector(vector(size / r)));
                body.add_scaled(share, &Motion { x: Vec3::zeros(), v, omega: spin });
            }
        });
    }

    /// The length of the state of one particle at `velocity_scale`, times the square root of the machine
    /// epsilon (1.5e-8): half of the digits.
    fn small_length(&self) -> f64 {
        f64::EPSILON.sqrt() * self.forces.parameters.mass.sqrt() * self.velocity_scale
    }

    fn agree(
        &mut self,
        y: &[Motion<W>],
        next: &mut [Motion<W>],
        finish: &(impl Fn(usize, &mut [Motion<W>]) -> f64 + Sync),
    ) -> TrialOutcome {
        let clock = Instant::now();
        let origin = &self.origin[..];
        let largest = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|k| larger(a[k], b[k]));
        let measure = |mut first: usize, part: &mut [Motion<W>]| {
            let mut most = [0.0; 4];
            for chunk in part.chunks_mut(CHUNK) {
                most[0] = larger(most[0], finish(first, chunk));
                let from = origin[first..].iter().zip(&y[first..]);
                for (body, (origin, start)) in chunk.iter().zip(from) {
                    let ways = [body.x - origin, body.x - start.x, body.v].map(|way| way.norm_squared());
                    most = largest(most, [0.0, ways[0], ways[1], ways[2]]);
                }
                first += chunk.len();
            }
            most
        };
        let [error, drift, way, speed] = threads::chunks(next, threads::GRAIN, measure, largest);
        let moved = [larger(self.moved[0], drift), larger(self.moved[1], way)];
        let request = self.interrupts.map_or(StopRequest::Nothing, |interrupts| interrupts()).weight();
        let mut shared = [error, moved[0], moved[1], speed.sqrt(), drift.sqrt(), request];
        self.comm.max(&mut shared);
        let [error, from_origin, from_start, speed, drift, request] = shared;
        self.request = StopRequest::of_weight(request);
        self.candidate = Extremes { speed, drift };
        self.clocks.reduction += clock.elapsed();
        TrialOutcome {
            error,
            covered: from_origin <= self.free_path().powi(2),
            within_travel: from_start <= self.travel().powi(2),
        }
    }
}

#[cfg(test)]
mod tests;
