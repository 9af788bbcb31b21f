//! The right-hand side at a stage, and what the methods of `ode` ask of this problem.

use super::contacts::seen_by_lower;
use super::decomposition::{Decomposition, gather};
use super::{Dynamics, Extremes, Fault, FaultSearch};
use crate::domain::{Comm, exact, migration};
use crate::engine::forces::{CHUNK, FREE, StageMaker};
use crate::engine::kernel::MOST_MEMORY;
use crate::error::StopRequest;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::{SPIN, VELOCITY, position, spin, velocity};
use crate::model::contact::LawParameters;
use crate::ode::{
    Dissipation, Errors, FinishRows, Ivp, Layout, MakeStage, Part, Rows, Stage, TrialOutcome, VECTORS,
    largest_magnitude, no_vectors,
};
use crate::threads;
use fail::fail_point;
use std::time::{Duration, Instant};

impl Dynamics<'_> {
    /// Moves owned bodies and ghosts to the state `y`. Collective.
    pub(super) fn put_bodies(&mut self, y: &[f64]) {
        self.domain.halo.refresh(self.domain.comm, y, self.forces.ghosts());
        self.forces.put(y);
    }

    /// The right-hand side at the stage that `make` computes for a step from `y`, as in `Ivp::rhs_of`.
    /// Collective.
    fn evaluate(
        &mut self,
        t: f64,
        y: &[f64],
        mut vectors: [&mut [f64]; VECTORS],
        dydt: &mut [f64],
        make: &MakeStage,
    ) {
        fail_point!("rhs");
        let begun = Instant::now();
        let free = self.free_path().powi(2);
        let (forces, width) = (&mut self.forces, self.layout.0[0].width);
        let Decomposition { comm, halo, .. } = &mut self.domain;
        let maker = StageMaker { make, origin: &self.motion.origin, free, start: y };
        let mut waited = Duration::ZERO;
        let particles = self.layout.whole(0).len;
        let (dydt, rates) = dydt.split_at_mut(particles);
        let mut own = vectors.each_mut().map(|vector| {
            let end = if vector.is_empty() { 0 } else { particles };
            vector.split_at_mut(end)
        });
        if !rates.is_empty() {
            let width = forces.memory_width();
            let vectors = own.each_mut().map(|(_, of_contacts)| Rows::new(of_contacts, width));
            forces.make_memories(maker, particles, vectors, rates);
        }
        let mut vectors = own.map(|(of_particles, _)| of_particles);
        forces.begin_stage(maker, again(&mut vectors, width), dydt, rates);
        if !halo.is_idle() {
            let clock = Instant::now();
            let mut inside = Duration::ZERO;
            halo.pack(|k, _| forces.export(k));
            halo.exchange_during(*comm, &mut || {
                fail_point!("underway");
                let clock = Instant::now();
                forces.advance_interior(maker, again(&mut vectors, width), dydt, rates);
                inside = clock.elapsed();
            });
            halo.deliver(forces.ghosts());
            waited = clock.elapsed().saturating_sub(inside);
        }
        let (pairs, moved) = forces.finish_stage(maker, again(&mut vectors, width), dydt, rates);
        self.tally.own_pairs += pairs;
        let before = self.motion.moved;
        self.motion.moved = [larger(before[0], moved[0]), larger(before[1], moved[1])];
        if self.audit.is_on {
            self.audit.power = self.dissipated_power();
        }
        self.clocks.ghosts += waited;
        self.clocks.forces += begun.elapsed().saturating_sub(waited);
        self.look_out(t, dydt);
    }

    /// Keeps the first right-hand side that is not finite, if a search is on. Collective.
    fn look_out(&mut self, t: f64, dydt: &[f64]) {
        if let FaultSearch::Searching = self.fault_search {
            let mut steepest = [largest_magnitude(dydt)];
            self.domain.comm.max(&mut steepest);
            if steepest[0] == f64::INFINITY {
                let (state, slope) = (self.forces.state(), dydt.to_vec());
                self.fault_search = FaultSearch::Found(Fault { t, state, slope });
            }
        }
    }
}

/// Brings the largest of the `shared` numbers of all ranks, and their errors together, to every rank, in one
/// collective call. The first shared number is the largest error.
fn share(comm: &dyn Comm, shared: &mut [f64; 7], errors: &mut Errors) {
    if errors.tolerance == 0.0 {
        comm.max(shared);
        errors.largest = shared[0];
        return;
    }
    // Halves of integers are exact as doubles.
    let halves = errors.sums.map(|sum| [(sum >> 32) as f64, (sum & 0xffff_ffff) as f64]);
    let own: [f64; 11] =
        std::array::from_fn(|k| if k < 7 { shared[k] } else { halves.as_flattened()[k - 7] });
    let all = gather(comm, own);
    let (tolerance, none) = (errors.tolerance, Errors::default());
    *errors = all.iter().fold(none, |errors, of_rank| {
        let sum = |k: usize| ((of_rank[k] as u64) << 32) | of_rank[k + 1] as u64;
        errors.merge(Errors { largest: of_rank[0], sums: [sum(7), sum(9)], tolerance })
    });
    for (k, shared) in shared.iter_mut().enumerate() {
        *shared = all.iter().fold(f64::NEG_INFINITY, |most, of_rank| larger(most, of_rank[k]));
    }
}

/// Lends the vectors as rows, so that they can be passed on more than once.
fn again<'v>(vectors: &'v mut [&mut [f64]; VECTORS], width: usize) -> [Rows<'v>; VECTORS] {
    vectors.each_mut().map(|vector| Rows::new(vector, width))
}

impl Ivp for Dynamics<'_> {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn begin(&mut self) {
        self.motion.moved = [0.0; 2];
        self.forces.begin_step();
    }

    fn rhs(&mut self, t: f64, y: &[f64], dydt: &mut [f64]) {
        let make = |stage: Stage| stage.state.copy_from_slice(&y[stage.part.range()]);
        // `y` may be any state: distances measured from the start of the step do not apply.
        self.forces.begin_step();
        self.evaluate(t, y, no_vectors(), dydt, &make);
    }

    fn rhs_of(
        &mut self,
        t: f64,
        y: &[f64],
        vectors: [&mut [f64]; VECTORS],
        dydt: &mut [f64],
        make: &MakeStage,
    ) {
        self.evaluate(t, y, vectors, dydt, make);
    }

    fn dissipation(&self) -> Dissipation {
        self.audit.power
    }

    /// Length of `v`, a vector of the state space, over all ranks.
    ///
    /// Its square is twice the kinetic energy of the velocities, plus `kappa f_0 x^2` for the positions: a
    /// spring with the stiffness of a contact at rest. Friction is symmetric in this norm.
    fn length(&mut self, v: &[f64]) -> f64 {
        let clock = Instant::now();
        let (turned, sizes) = (self.turned_mass(), self.forces.sizes());
        let LawParameters { kappa, f_0, .. } = self.law();
        let (stiffness, width) = (kappa * f_0, self.layout.0[0].width);
        let square = |i: usize| {
            let row = &v[i * width..(i + 1) * width];
            let mass = sizes.of(i).mass;
            let turned = turned(mass);
            mass * velocity(row).norm_squared()
                + turned * spin(row).norm_squared()
                + stiffness * position(row).norm_squared()
        };
        let (owned, rows) = (self.layout.0[0].rows, self.contacts.counted.len());
        let stored = self.stored_in_memories(v);
        // In units of energy the length of a memory is the energy that it stores.
        let square = move |i: usize| match i.checked_sub(owned) {
            None => square(i),
            Some(row) => 2.0 * stored(row),
        };
        let length = exact::exact_sum(self.domain.comm, owned + rows, square).sqrt();
        self.clocks.reduction += clock.elapsed();
        length
    }

    fn add_direction(&mut self, round: u64, share: f64, v: &mut [f64]) {
        let size = 1.0 / (self.forces.parameters.mass * self.count() as f64).sqrt();
        let (ids, width) = (self.domain.own_ids(), self.layout.0[0].width);
        let add = |first: usize, rows: Rows| {
            for (row, &id) in rows.numbers.chunks_exact_mut(width).zip(&ids[first..]) {
                let mut bits = migration::scramble(id ^ migration::scramble(round));
                let mut vector = || {
                    Vec3::from_fn(|_, _| {
                        bits = migration::scramble(bits);
                        // 53 bits as a fraction in -1..1.
                        size * ((bits >> 11) as f64 * 2f64.powi(-52) - 1.0)
                    })
                };
                let (v, spin) = (vector(), vector());
                let mut add = |columns: std::ops::Range<usize>, vector: Vec3| {
                    for (number, component) in row[columns].iter_mut().zip(&vector) {
                        *number += component * share;
                    }
                };
                add(VELOCITY, v);
                if width == SPIN.end {
                    add(SPIN, spin);
                }
            }
        };
        let (particles, memories) = v.split_at_mut(self.layout.whole(0).len);
        threads::parts(ids.len(), threads::GRAIN, Rows::new(particles, width), &add, &|(), ()| ());
        if memories.is_empty() {
            return;
        }
        let count = self.count() as f64;
        // Of an element that resists nothing the memory stays 0.
        let size = |stiffness: f64| if stiffness == 0.0 { 0.0 } else { 1.0 / (stiffness * count).sqrt() };
        let (width, round) = (self.forces.memory_width(), migration::scramble(round));
        let rows = memories.chunks_exact_mut(width).zip(&self.contacts.keys).enumerate();
        for (row, (memory, &key)) in rows.filter(|(_, (_, key))| **key != FREE) {
            let [lower, higher] = [key[0].min(key[1]), key[0].max(key[1])];
            let mut bits = migration::scramble(lower ^ round) ^ higher;
            let mut added = [0.0; MOST_MEMORY];
            let stiffness = self.forces.laws.stiffness(self.contacts.class(row));
            for (c, (added, stiffness)) in added.iter_mut().zip(stiffness).enumerate() {
                if c.is_multiple_of(3) {
                    bits = migration::scramble(bits);
                }
                // 21 bits as a fraction in -1..1.
                let fraction = (bits >> (21 * (c % 3))) & 0x1f_ffff;
                *added = share * size(*stiffness) * (fraction as f64 * 2f64.powi(-20) - 1.0);
            }
            for (number, added) in memory.iter_mut().zip(seen_by_lower(key, &added[..width])) {
                *number += added;
            }
        }
    }

    /// The length of the state of one particle at `velocity_scale`, times the square root of the machine
    /// epsilon (1.5e-8): half of the digits.
    fn small_length(&self) -> f64 {
        f64::EPSILON.sqrt() * self.forces.parameters.mass.sqrt() * self.velocity_scale
    }

    fn agree(&mut self, y: &[f64], next: &mut [f64], finish: &FinishRows) -> TrialOutcome {
        let clock = Instant::now();
        let whole = self.layout.whole(0);
        let (origin, width, forces) = (&self.motion.origin[..], whole.width, &self.forces);
        let largest = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| larger(a[k], b[k]));
        let both = |a: (Errors, [f64; 3]), b: (Errors, [f64; 3])| (a.0.merge(b.0), largest(a.1, b.1));
        let measure = |mut first: usize, rows: Rows| {
            // A rank without rows knows from this whether there is a mean.
            let (mut errors, mut most) = (finish(whole.rows(0..0), &mut []), [0.0; 3]);
            for chunk in rows.numbers.chunks_mut(CHUNK * width) {
                let part: Part = whole.rows(first..first + chunk.len() / width);
                errors = errors.merge(finish(part, chunk));
                let from = origin[first..].iter().zip(y[part.range()].chunks_exact(width));
                for (i, (row, (origin, start))) in (first..).zip(chunk.chunks_exact(width).zip(from)) {
                    let (x, scale) = (position(row), forces.squared_scale(i));
                    let ways = [x - origin, x - position(start), velocity(row)];
                    most = largest(most, ways.map(|way| way.norm_squared() * scale));
                }
                first += part.len / width;
            }
            (errors, most)
        };
        let (particles, memories) = next.split_at_mut(whole.len);
        let rows = Rows::new(particles, width);
        let (mut errors, [drift, way, speed]) =
            threads::parts(origin.len(), threads::GRAIN, rows, &measure, &both);
        if !memories.is_empty() {
            let all = self.layout.whole(1);
            let (rows, width) = (Rows::new(memories, all.width), all.width);
            let counted = &self.contacts.counted[..];
            let measure = |mut first: usize, rows: Rows| {
                let mut errors = Errors::default();
                let mut rest = rows.numbers;
                // A contact that another block or rank counts has the same error there.
                while !rest.is_empty() {
                    let alike = counted[first..first + rest.len() / width].chunk_by(|a, b| a == b);
                    let count = alike.map(<[bool]>::len).next().unwrap_or(0);
                    let (these, behind) = rest.split_at_mut(count * width);
                    let found = finish(all.rows(first..first + count), these);
                    errors =
                        errors.merge(if counted[first] { found } else { Errors { sums: [0; 2], ..found } });
                    (rest, first) = (behind, first + count);
                }
                errors
            };
            let count = all.len / width;
            errors = errors.merge(threads::parts(count, threads::GRAIN, rows, &measure, &Errors::merge));
        }
        let moved = [larger(self.motion.moved[0], drift), larger(self.motion.moved[1], way)];
        // The last stage of every method is at the end of the step, so close to its result that the bodies of
        // that stage tell which impacts come next.
        let approach = self.fastest_approach(1.0 / self.motion.largest_next);
        if !self.motion.of_frame {
            self.forces.find_contacts();
        }
        let interrupts = self.requests.interrupts;
        let request = interrupts.map_or(StopRequest::Nothing, |interrupts| interrupts()).weight();
        let mut shared = [errors.largest, moved[0], moved[1], speed.sqrt(), drift.sqrt(), request, approach];
        share(self.domain.comm, &mut shared, &mut errors);
        let [_, from_origin, from_start, speed, drift, request, approach] = shared;
        self.requests.agreed = StopRequest::of_weight(request);
        self.motion.candidate = Extremes { speed, drift, approach };
        self.clocks.reduction += clock.elapsed();
        TrialOutcome {
            error: errors.error(),
            covered: from_origin <= self.free_path().powi(2),
            within_travel: from_start <= self.travel().powi(2),
        }
    }
}
