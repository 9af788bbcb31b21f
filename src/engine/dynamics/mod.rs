//! The right-hand side, eqs. (2.13)-(2.15), of a system of particles that is spread over ranks.

use crate::domain::slabs::Slabs;
use crate::domain::{Comm, Table};
use crate::engine::forces::{BodyParameters, Forces};
use crate::engine::kernel::MakeLaws;
use crate::error::{Error, StopRequest};
use crate::math::instructions::InstructionSet;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::{Changes, Columns, MATERIAL, POSITION, velocity};
use crate::model::contact::LawParameters;
use crate::model::size::Size;
use crate::ode::{Dissipation, Layout, Segment, StepStart};
use crate::scene::walls::{ground, upwards};
pub use contacts::ContactRecords;
use contacts::Contacts;
use decomposition::{Decomposition, PairReach};
pub use energy::Overlap;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

mod contacts;
mod decomposition;
mod energy;
mod faults;
mod rhs;

/// The furthest that a step may move a particle, as a share of its radius.
///
/// Both particles of a contact may move that far. Together that is far less than the way through a sphere, so
/// no step misses a collision at any tolerance.
pub const TRAVEL: f64 = 0.1;

/// How far particles may move before the lists must be rebuilt, as a share of the radius.
const FREE_PATH: f64 = 0.2;

/// How far the cutoff of lists and ghosts exceeds `l_max`, as a share of the radius.
///
/// Two particles may approach each other. So lists always have all pairs up to a gap of `l_max` and two
/// travels, however far particles have moved since the lists were built. Where contacts are evaluated up to a
/// smaller gap only, lists may serve longer and have all pairs up to that gap and two travels; see
/// `Dynamics::listed_gap`.
pub const SKIN: f64 = 2.0 * (FREE_PATH + TRAVEL);

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
///
/// Where sizes differ, speeds and distances are scaled by a typical radius over that of the particle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Largest speed, m/s.
    pub speed: f64,
    /// Largest distance from where the lists were built, m.
    pub drift: f64,
    /// Inverse of the largest step that no impact forbids, 1/s; 0 if that is beyond the largest next step.
    pub approach: f64,
}

/// A right-hand side that is not finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Time, s.
    pub t: f64,
    /// The state.
    pub state: Vec<f64>,
    /// The slope.
    pub slope: Vec<f64>,
}

/// A search for the first right-hand side that is not finite.
enum FaultSearch {
    Off,
    Searching,
    Found(Fault),
}

/// What may interrupt a run.
#[derive(Default)]
struct Requests<'c> {
    /// Returns what this rank is requested to do, if anything can interrupt the run.
    interrupts: Option<&'c dyn Fn() -> StopRequest>,
    /// The stop request on which all ranks agreed last.
    agreed: StopRequest,
}

/// Counts of pairs and lists.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    /// Pairs that this rank has evaluated in this process and whose earlier particle it owns.
    own_pairs: u64,
    /// Pairs that all ranks evaluated in earlier processes of the run.
    earlier_pairs: u64,
    /// How often lists were built.
    rebuilds: u64,
}

/// How far the particles have moved.
#[derive(Debug, Default)]
struct Motion {
    /// Where the owned particles were when the lists were built, m.
    origin: Vec<Vec3>,
    /// Largest squared distances over all stages of this trial step, m^2: from `origin`, and from the start
    /// of the step.
    ///
    /// The first may be 0 in place of a distance that is certainly within the free path.
    moved: [f64; 2],
    /// The largest step that may follow the current one, s.
    largest_next: f64,
    /// Extremes of the accepted state.
    accepted: Extremes,
    /// Extremes of the result of the last trial.
    candidate: Extremes,
    /// Whether trials are those of frames, after which no step is accepted.
    of_frame: bool,
}

/// Power that contacts dissipate.
#[derive(Debug, Default)]
struct Audit {
    /// Whether every right-hand side also computes that power.
    is_on: bool,
    /// Power in the last right-hand side, W.
    power: Dissipation,
}

/// Equations of motion of all particles. This rank owns some of them.
pub struct Dynamics<'c> {
    domain: Decomposition<'c>,
    forces: Forces,
    /// The rows of the owned particles; with friction that remembers, also those of contacts.
    layout: Layout,
    contacts: Contacts,
    motion: Motion,
    tally: Tally,
    audit: Audit,
    requests: Requests<'c>,
    fault_search: FaultSearch,
    /// A typical speed of the scene, m/s.
    velocity_scale: f64,
    /// Largest gap at which surfaces interact, m. Lists and ghosts always cover it.
    l_max: f64,
    /// The height from which the bed height is measured, m.
    ground: f64,
    /// Time spent in the parts of the work.
    pub clocks: Clocks,
}

/// Particles on any ranks, with which a run starts.
pub struct Particles<'a> {
    /// Their ids. Over all ranks these must be 0..count.
    pub ids: Vec<u64>,
    /// Their columns.
    pub columns: Columns,
    /// Columns that change only when lists are built.
    pub constants: Vec<f64>,
    /// Rows of the state. Their positions decide which rank owns a particle.
    pub y: &'a mut Vec<f64>,
}

impl<'c> Dynamics<'c> {
    /// Takes particles and brings each to the rank that owns it. Collective.
    ///
    /// The rows of `companions` move along. `velocity_scale` is a typical speed, m/s. `laws` makes the
    /// contact laws for the instruction set on which all ranks agree.
    ///
    /// Fails where `InstructionSet::chosen` fails, which must be the same on all ranks.
    pub fn new(
        comm: &'c dyn Comm,
        laws: &MakeLaws,
        parameters: BodyParameters,
        velocity_scale: f64,
        particles: Particles,
        companions: &mut [&mut Vec<f64>],
    ) -> Result<Self, Error> {
        let [set, _] = common_instructions(comm, InstructionSet::chosen().map_err(Error::Input)?);
        let laws = laws(set);
        let kernel = laws.first();
        let l_max = kernel.law().l_max;
        let Particles { ids, columns, constants, y } = particles;
        if kernel.width() != columns.width(Changes::EveryStage) {
            return Err(Error::Input(format!(
                "the contact law needs {} numbers for the state of a particle, and the particles have {}: \
                 the law must be the one with which the run began",
                kernel.width(),
                columns.width(Changes::EveryStage)
            )));
        }
        let segment = Segment { rows: ids.len(), width: kernel.width(), positions: POSITION.end };
        let ground = ground(&parameters.walls, &upwards(&parameters.gravity));
        let mut dynamics = Dynamics {
            domain: Decomposition::new(comm, ids, columns, constants, y),
            forces: Forces::new(laws, parameters, set),
            layout: Layout(vec![segment]),
            contacts: Contacts::default(),
            motion: Motion::default(),
            tally: Tally::default(),
            audit: Audit::default(),
            requests: Requests::default(),
            fault_search: FaultSearch::Off,
            velocity_scale,
            l_max,
            ground,
            clocks: Clocks::default(),
        };
        dynamics.forces.owned = dynamics.domain.owned;
        dynamics.relocate(0.0, y, companions)?;
        if comm.size() > 1 {
            // The pairs are known now, so the slabs can be given equal loads.
            dynamics.relocate(0.0, y, companions)?;
            dynamics.tally.rebuilds = 1;
        }
        let mut approach = [dynamics.fastest_approach(0.0)];
        comm.max(&mut approach);
        dynamics.motion.accepted.approach = approach[0];
        Ok(dynamics)
    }

    /// From now on evaluates contacts up to `gap` (m), or up to `l_max` if that is less.
    ///
    /// Returns whether this is a change. Slopes and energies found before are then out of date.
    pub fn evaluate_within(&mut self, gap: f64) -> bool {
        let gap = gap.min(self.l_max);
        let changed = gap != self.law().l_max;
        if changed {
            self.forces.evaluate_within(gap);
        }
        changed
    }

    /// Mass of a typical particle, kg; where all are alike, of every particle.
    pub fn mass(&self) -> f64 {
        self.forces.parameters.mass
    }

    /// The parameters that the laws of all contacts share, with the cutoff in use. Coefficients are those of
    /// the first class of contacts.
    pub fn law(&self) -> LawParameters {
        self.forces.law()
    }

    /// The columns of the particles.
    pub fn columns(&self) -> &Columns {
        &self.domain.columns
    }

    /// Constant columns of the owned particles.
    pub fn constants(&self) -> &[f64] {
        self.domain.own_constants()
    }

    /// Distance of centres up to which pairs of typical particles are listed, m.
    pub fn cutoff(&self) -> f64 {
        let reach = self.reach();
        reach.between(reach.typical, reach.typical)
    }

    /// Up to which distance of their centres pairs are listed.
    fn reach(&self) -> PairReach {
        PairReach { share: 1.0 + 0.5 * SKIN, gap: self.l_max, typical: self.law().r }
    }

    /// The size of the owned particle with the local index `i`.
    pub fn size(&self, i: usize) -> Size {
        self.forces.sizes().of(i)
    }

    /// Root of m/r of the particle for which it is least, over that of a typical one. It is 1 where all are
    /// alike. Collective.
    pub fn lightest(&self) -> f64 {
        let own = (0..self.domain.owned).map(|i| self.size(i));
        let typical = Size::new(self.law().r, self.mass());
        let mut lightest = [-typical.lightest_of(own)];
        self.domain.comm.max(&mut lightest);
        if self.columns().sized() { -lightest[0] } else { 1.0 }
    }

    /// Numbers of the materials that particles have, on any rank; `none` is that of those without one.
    /// Collective.
    pub fn materials(&self, none: usize) -> Vec<usize> {
        let mut present = vec![0.0; none + 1];
        if self.columns().find(MATERIAL).is_none() {
            present[none] = 1.0;
        }
        for material in self.columns().materials(self.constants()) {
            present[material as usize] = 1.0;
        }
        self.domain.comm.max(&mut present);
        (0..=none).filter(|&number| present[number] > 0.0).collect()
    }

    /// Weights of the positions of the owned particles in the norm, over those of typical ones; empty where
    /// all are alike.
    pub fn position_weights(&self) -> Vec<f64> {
        let law = self.law();
        let weight = |i: usize| law.position_scale(law.r) / law.position_scale(self.size(i).r);
        if self.columns().sized() { (0..self.domain.owned).map(weight).collect() } else { Vec::new() }
    }

    /// Weights of the spins of the owned particles over those of typical ones, where errors are those of
    /// angular velocities; empty where all are alike.
    pub fn spin_weights(&self) -> Vec<f64> {
        let r = self.law().r;
        let weight = |i: usize| r * self.size(i).per_r;
        if self.columns().sized() { (0..self.domain.owned).map(weight).collect() } else { Vec::new() }
    }

    /// The furthest that a step may move a typical particle, m. A particle of another size may be moved by
    /// the same share of its radius.
    pub fn travel(&self) -> f64 {
        TRAVEL * self.law().r
    }

    /// Ids of the owned particles, in the order of the states at the start of the step.
    pub fn ids(&self) -> &[u64] {
        self.domain.own_ids()
    }

    /// Number of particles on all ranks.
    pub fn count(&self) -> u64 {
        self.domain.count()
    }

    /// The slabs.
    pub fn slabs(&self) -> &Slabs {
        &self.domain.slabs
    }

    /// Number of ghosts of this rank.
    pub fn ghosts(&self) -> usize {
        self.domain.halo.ghosts()
    }

    /// Number of pairs on the lists of this rank.
    pub fn listed_pairs(&self) -> usize {
        self.forces.lists.pairs()
    }

    /// Pairs within `l_max` evaluated so far in the whole run, each counted once over all ranks. Collective.
    pub fn pair_evaluations(&self) -> u64 {
        self.total_pairs(self.tally.own_pairs)
    }

    /// The same total, computed from an earlier value of `own_pairs` of every rank. Collective.
    pub fn total_pairs(&self, own: u64) -> u64 {
        let mut sum = [own];
        self.domain.comm.sum(&mut sum);
        self.tally.earlier_pairs + sum[0]
    }

    /// Pairs that this rank has evaluated in this process and whose earlier particle it owns.
    pub fn own_pairs(&self) -> u64 {
        self.tally.own_pairs
    }

    /// How often the lists were built.
    pub fn rebuilds(&self) -> u64 {
        self.tally.rebuilds
    }

    /// Memory held for particles, ghosts and lists on this rank, bytes.
    pub fn bytes(&self) -> usize {
        self.forces.bytes()
            + self.motion.origin.capacity() * size_of::<Vec3>()
            + self.domain.ids.capacity() * size_of::<u64>()
            + self.domain.constants.capacity() * size_of::<f64>()
    }

    /// Extremes of the result of the last trial.
    pub fn candidate(&self) -> Extremes {
        self.motion.candidate
    }

    /// Tells whether the next trials are those of frames. They leave what the last step has found as it is.
    pub fn set_of_frame(&mut self, of_frame: bool) {
        self.motion.of_frame = of_frame;
    }

    /// Stores the extremes of a newly accepted state.
    pub fn commit(&mut self, extremes: Extremes) {
        self.motion.accepted = extremes;
    }

    /// Extremes of the accepted state.
    pub fn extremes(&self) -> Extremes {
        self.motion.accepted
    }

    /// Where the owned particles were when the lists were built, m.
    pub fn origin(&self) -> &[Vec3] {
        &self.motion.origin
    }

    /// Continues the counts of an earlier process, over all ranks: lists built and pairs evaluated.
    pub fn go_on_from(&mut self, rebuilds: u64, pairs: u64) {
        (self.tally.rebuilds, self.tally.earlier_pairs) = (rebuilds, pairs);
    }

    /// From now on calls `interrupts` once a trial step, on every rank, for stop requests.
    pub fn listen_to(&mut self, interrupts: &'c dyn Fn() -> StopRequest) {
        self.requests.interrupts = Some(interrupts);
    }

    /// The stop request of the last trial, the same on every rank.
    pub fn request(&self) -> StopRequest {
        self.requests.agreed
    }

    /// Whether the lists were built at the accepted state.
    pub fn lists_are_fresh(&self) -> bool {
        self.motion.accepted.drift == 0.0
    }

    /// The largest step from the accepted state that is expected to move no particle too far, s.
    pub fn travel_limit(&self) -> f64 {
        0.9 * self.travel() / self.motion.accepted.speed
    }

    /// The largest step from the accepted state that no impact forbids, s.
    pub fn contact_limit(&self) -> f64 {
        1.0 / self.motion.accepted.approach
    }

    /// Tells how large the step after the next trial may be, at most, s.
    pub fn set_largest_next(&mut self, h: f64) {
        self.motion.largest_next = h;
    }

    /// Whether a step `h` (s) from the accepted state is likely to move a particle out of range of the lists.
    pub fn will_outrun(&self, h: f64) -> bool {
        self.motion.accepted.drift + self.motion.accepted.speed * h > self.free_path()
    }

    /// How far a particle may move before the lists must be rebuilt, m.
    fn free_path(&self) -> f64 {
        FREE_PATH * self.law().r + 0.5 * (self.l_max - self.listed_gap())
    }

    /// The gap (m) up to which all pairs, and what they approach within two travels, stay on the lists.
    ///
    /// With memory it is the gap up to which contacts are evaluated, so that lists serve as long as they can.
    /// Without memory it is `l_max`: the steps of such scenes also look at pairs that are not evaluated.
    /// Particles of unequal sizes move by shares of their radii, for which a gap is no measure.
    fn listed_gap(&self) -> f64 {
        let follows = self.forces.memory_width() > 0 && !self.columns().sized();
        if follows { self.law().l_max } else { self.l_max }
    }

    /// The fastest approach of this rank's contacts in the current bodies, 1/s; see
    /// [`Forces::fastest_approach`].
    ///
    /// It takes contacts up to the `listed_gap` and two travels. All lists have these, whenever they were
    /// built, so the result does not depend on lists. Contacts beyond cannot meet within one step.
    pub(super) fn fastest_approach(&mut self, least: f64) -> f64 {
        self.forces.fastest_approach(least, self.listed_gap(), TRAVEL)
    }

    /// From now on computes the dissipated power with every right-hand side. This takes two more passes over
    /// the contacts.
    pub fn audit(&mut self) {
        self.audit.is_on = true;
    }

    /// From now on looks for a right-hand side that is not finite. This takes a reduction for every
    /// right-hand side.
    pub fn search_fault(&mut self) {
        self.fault_search = FaultSearch::Searching;
    }

    /// The first right-hand side since `search_fault` that was not finite. Ends the search.
    pub fn fault(&mut self) -> Option<Fault> {
        match std::mem::replace(&mut self.fault_search, FaultSearch::Off) {
            FaultSearch::Found(fault) => Some(fault),
            _ => None,
        }
    }

    /// Moves particles to their owners, adapts the slab bounds, and builds new neighbour lists. Collective.
    ///
    /// The vectors of `step_start` may change in length and order.
    pub fn rebuild(&mut self, step_start: &mut StepStart) -> Result<(), Error> {
        let StepStart { t, y, slope, slope_known, direction, direction_known, .. } = step_start;
        // Both flags are the same on all ranks, so all ranks send the same lists.
        let known = [*slope_known, *direction_known];
        let lists =
            [slope, direction].into_iter().zip(known).filter_map(|(list, known)| known.then_some(list));
        self.relocate(*t, y, &mut lists.collect::<Vec<_>>())
    }

    /// `y` and `companions` are rows of the state; the positions in `y` decide.
    fn relocate(&mut self, t: f64, y: &mut Vec<f64>, companions: &mut [&mut Vec<f64>]) -> Result<(), Error> {
        let clock = Instant::now();
        let (reach, width) = (self.reach(), self.layout.0[0].width);
        let loads = if self.domain.comm.size() > 1 { self.forces.loads() } else { Vec::new() };
        let mut vectors = vec![&mut *y];
        vectors.extend(companions.iter_mut().map(|numbers| &mut **numbers));
        let mut records = self.take_records(&mut vectors);
        let tables = vectors.into_iter().map(|numbers| Table { numbers, width }).collect();
        let bodies = self.domain.relocate(t, &loads, tables, reach, &mut records)?;
        let owned = self.domain.owned;
        self.layout.0[0].rows = owned;
        let sizes = self.domain.columns.sizes(&self.domain.constants);
        let materials = self.domain.columns.materials(&self.domain.constants);
        let particles = (owned, sizes, materials);
        // Walls, which do not move, have the skin of two particles.
        let cutoffs = [[reach.share, 1.0 + SKIN], [reach.gap; 2]];
        self.forces.list(&bodies.rows, particles, &bodies.keys, cutoffs, self.domain.halo.picks());
        self.motion.origin.clear();
        self.motion.origin.extend(self.domain.centres(y));
        let mut speed = [self.fastest(y)];
        let mut vectors = vec![y];
        vectors.extend(companions.iter_mut().map(|numbers| &mut **numbers));
        self.put_records(&records, &mut vectors);
        self.domain.comm.max(&mut speed);
        // The approach does not depend on lists: it stays as the last stage found it.
        self.motion.accepted = Extremes { speed: speed[0], drift: 0.0, ..self.motion.accepted };
        self.tally.rebuilds += 1;
        self.clocks.lists += clock.elapsed();
        Ok(())
    }

    /// Largest speed of the owned particles, m/s, scaled as distances are where sizes differ.
    fn fastest(&self, y: &[f64]) -> f64 {
        let rows = y[..self.particle_numbers()].chunks_exact(self.layout.0[0].width).enumerate();
        let square = |(i, row): (usize, &[f64])| velocity(row).norm_squared() * self.forces.squared_scale(i);
        rows.fold(0.0, |speed, row| larger(speed, square(row))).sqrt()
    }
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

#[cfg(test)]
mod tests;
