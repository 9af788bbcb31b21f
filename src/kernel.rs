//! The contact law over batches of contacts, by the widest vector instructions that the processor has.
//!
//! Contacts are gathered into columns, evaluated with one loop that the compiler turns into vector instructions, and
//! added to their particles one after the other. All of it is compiled for every instruction set; each computes the
//! same additions, multiplications, divisions and roots in the same order (fused ones are not used), so each gives the
//! same bits.

use crate::contact::{Action, Law, Rebound, Tangential};
use crate::container::Wall;
use crate::error::Error;
use crate::forces::Setting;
use crate::neighbors::Block;
use crate::particle::{Motion, Spin, Vec3, dot, minus, plus, scaled};

/// Contacts in a batch: their columns stay in the first-level cache.
const BATCH: usize = 128;

type Column = [f64; BATCH];

/// Columns of a batch of contacts, seen from their first particle.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Batch {
    /// Gap, m; of walls only.
    gap: Column,
    /// Pairs: difference of the centres, m; walls: unit normal towards the particle. Then force, N.
    n: [Column; 3],
    /// Velocity relative to the partner, m/s.
    v: [Column; 3],
    /// Sum of the angular velocities, rad/s. Then torque, N m.
    spins: [Column; 3],
    /// 1 where the contact is within `l_max`, 0 elsewhere.
    near: [u64; BATCH],
}

impl Default for Batch {
    fn default() -> Self {
        let columns = [[0.0; BATCH]; 3];
        Batch { gap: [0.0; BATCH], n: columns, v: columns, spins: columns, near: [0; BATCH] }
    }
}

/// A vector instruction set that the kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every processor of this architecture has: on x86-64, SSE2 with two numbers at a time.
    Baseline,
    /// AVX2: four numbers at a time.
    Avx2,
    /// AVX-512 (F, DQ, VL): eight numbers at a time.
    Avx512,
}

impl InstructionSet {
    /// All there are, narrowest first.
    pub const ALL: [InstructionSet; 3] =
        [InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512];

    /// All that this processor can run, narrowest first.
    pub fn available() -> Vec<InstructionSet> {
        let mut sets = vec![InstructionSet::Baseline];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                sets.push(InstructionSet::Avx2);
            }
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                sets.push(InstructionSet::Avx512);
            }
        }
        sets
    }

    /// The widest that this processor can run, or the one that the environment variable `DEMHYBRID_INSTRUCTIONS` names.
    pub fn chosen() -> Result<Self, Error> {
        let sets = Self::available();
        let Some(wanted) = std::env::var_os("DEMHYBRID_INSTRUCTIONS") else {
            return Ok(*sets.last().expect("there is a baseline"));
        };
        let known = sets.iter().find(|set| wanted == set.name());
        known.copied().ok_or_else(|| {
            let names: Vec<&str> = sets.iter().map(|set| set.name()).collect();
            let wanted = wanted.to_string_lossy();

            Error::Input(format!(
                "DEMHYBRID_INSTRUCTIONS = \"{wanted}\": this processor runs {}",
                names.join(", ")
            ))
        })
    }

    /// Name, as in `DEMHYBRID_INSTRUCTIONS` and in the output.
    pub fn name(self) -> &'static str {
        match self {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        }
    }
}

/// What a sweep over the contacts of one block needs.
pub struct Sweep<'a, R, T, W> {
    /// Contact law.
    pub law: &'a Law<R, T>,
    /// Masses, gravity and walls.
    pub setting: &'a Setting,
    /// Owned particles, then ghosts; or those of the block.
    pub bodies: &'a [Motion<W>],
    /// The block's lists.
    pub block: &'a Block,
    /// Scratch.
    pub batch: &'a mut Batch,
    /// Slopes of the block's particles.
    pub slopes: &'a mut [Motion<W>],
}

/// Adds the forces (N) and torques (N m) of the walls to the slopes; `bodies` are those of the block.
pub fn add_walls<R: Rebound, T: Tangential, W: Spin>(set: InstructionSet, sweep: Sweep<R, T, W>) {
    run(set, Walls(sweep));
}

/// Adds the forces and torques of the near pairs of all `bodies` to the slopes, and makes accelerations of them,
/// eqs. (2.13)-(2.15). Returns how many pairs are within `l_max` and have their first particle in the block.
pub fn add_pairs<R: Rebound, T: Tangential, W: Spin>(set: InstructionSet, sweep: Sweep<R, T, W>) -> u64 {
    run(set, Pairs(sweep))
}

impl<R: Rebound, T: Tangential, W: Spin> Sweep<'_, R, T, W> {
    #[inline(always)]
    fn sum_walls(self) {
        let Sweep { law, setting, bodies, block, batch, slopes } = self;
        let first = block.range.start;
        for contacts in block.walls.chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize - first], &setting.walls[wall as usize]);
                // A wall is a motionless partner with n = -n_k.
                batch.gap[k] = wall.depth(&body.x) - law.r;
                batch.put(k, &-wall.normal, &body.v, &body.omega);
            }
            for k in 0..BATCH {
                let gap = batch.gap[k];
                batch.evaluate::<R, T, W>(k, law, gap <= law.l_max, gap, batch.normal(k));
            }
            for (k, &[i, _]) in contacts.iter().enumerate() {
                let slope = &mut slopes[i as usize - first];
                slope.v += batch.force(k);
                slope.omega = slope.omega.plus(&batch.torque(k));
            }
        }
    }

    #[inline(always)]
    fn sum_pairs(self) -> u64 {
        let Sweep { law, setting, bodies, block, batch, slopes } = self;
        let first = block.range.start;
        let cutoff = 2.0 * law.r + law.l_max;
        let mut count = 0;
        for contacts in block.near.chunks(BATCH) {
            for (k, &[i, j]) in contacts.iter().enumerate() {
                let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
                batch.put(k, &minus(&a.x, &b.x), &minus(&a.v, &b.v), &a.omega.plus(&b.omega));
            }
            for k in 0..BATCH {
                let apart = batch.normal(k);
                let d2 = dot(&apart, &apart);
                let d = d2.sqrt();
                let far = d2 > cutoff * cutoff;
                // What is not a number is not far: it must show.
                batch.evaluate::<R, T, W>(k, law, !far, d - 2.0 * law.r, scaled(1.0 / d, &apart));
            }
            for (k, &[i, j]) in contacts.iter().enumerate() {
                let (force, torque) = (batch.force(k), batch.torque(k));
                // Partners outside the block are the matter of their own block or rank.
                if let Some(slope) = slopes.get_mut((i as usize).wrapping_sub(first)) {
                    slope.v = plus(&slope.v, &force);
                    slope.omega = slope.omega.plus(&torque);
                    count += batch.near[k];
                }
                if let Some(slope) = slopes.get_mut((j as usize).wrapping_sub(first)) {
                    slope.v = minus(&slope.v, &force);
                    slope.omega = slope.omega.plus(&torque);
                }
            }
        }
        let inverse_mass = 1.0 / setting.mass;
        for slope in slopes {
            slope.v = slope.v * inverse_mass + setting.gravity;
            slope.omega = slope.omega.scaled(setting.inverse_inertia);
        }
        count
    }
}

/// Two numbers that every contact has, of which whole systems have maxima or sums.
pub trait Measure<W>: Sync {
    /// Whether velocities and spins matter.
    const MOVES: bool;
    /// The numbers of one contact, at any gap; arguments as for [`Law::action`].
    fn of(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &W) -> [f64; 2];
}

/// The contacts of one block, each once over all blocks of all ranks.
pub struct Survey<'a, W> {
    /// Radius of every sphere, m.
    pub r: f64,
    /// The walls.
    pub walls: &'a [Wall],
    /// Owned particles, then ghosts.
    pub bodies: &'a [Motion<W>],
    /// The block's lists.
    pub block: &'a Block,
    /// Scratch.
    pub batch: &'a mut Batch,
}

/// Hands the numbers of all contacts of the survey to `take`, in no order that matters.
pub fn measure<W: Spin, M: Measure<W>>(
    set: InstructionSet,
    survey: Survey<W>,
    measure: &M,
    take: impl FnMut([f64; 2]),
) {
    run(set, Measuring(survey, measure, take));
}

struct Measuring<'a, W, M, F>(Survey<'a, W>, &'a M, F);

impl<W: Spin, M: Measure<W>, F: FnMut([f64; 2])> Vectorised for Measuring<'_, W, M, F> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        let Measuring(Survey { r, walls, bodies, block, batch, .. }, measure, mut take) = self;
        for contacts in block.near.chunks(BATCH) {
            for (k, &[i, j]) in contacts.iter().enumerate() {
                let (a, b) = (&bodies[i as usize], &bodies[j as usize]);
                batch.put_moving::<_, M>(k, &minus(&a.x, &b.x), || {
                    (minus(&a.v, &b.v), a.omega.plus(&b.omega))
                });
                // The others are counted where their first particle is.
                batch.near[k] = u64::from(block.range.contains(&(i as usize)));
            }
            for k in 0..BATCH {
                let apart = batch.normal(k);
                let d = dot(&apart, &apart).sqrt();
                batch.measure(k, measure, d - 2.0 * r, &scaled(1.0 / d, &apart));
            }
            for k in 0..contacts.len() {
                if batch.near[k] == 1 {
                    take([batch.n[0][k], batch.n[1][k]]);
                }
            }
        }
        for contacts in block.walls.chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize], &walls[wall as usize]);
                batch.gap[k] = wall.depth(&body.x) - r;
                batch.put_moving::<_, M>(k, &-wall.normal, || (body.v, body.omega));
            }
            for k in 0..BATCH {
                batch.measure(k, measure, batch.gap[k], &batch.normal(k));
            }
            for k in 0..contacts.len() {
                take([batch.n[0][k], batch.n[1][k]]);
            }
        }
    }
}

struct Walls<'a, R, T, W>(Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Walls<'_, R, T, W> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        self.0.sum_walls();
    }
}

struct Pairs<'a, R, T, W>(Sweep<'a, R, T, W>);

impl<R: Rebound, T: Tangential, W: Spin> Vectorised for Pairs<'_, R, T, W> {
    type Output = u64;
    #[inline(always)]
    fn work(self) -> u64 {
        self.0.sum_pairs()
    }
}

impl Batch {
    #[inline(always)]
    fn put<W: Spin>(&mut self, k: usize, n: &Vec3, v: &Vec3, spins: &W) {
        (self.n[0][k], self.n[1][k], self.n[2][k]) = (n.x, n.y, n.z);
        (self.v[0][k], self.v[1][k], self.v[2][k]) = (v.x, v.y, v.z);
        if W::COMPONENTS == 3 {
            let w = spins.vector();
            (self.spins[0][k], self.spins[1][k], self.spins[2][k]) = (w.x, w.y, w.z);
        }
    }

    #[inline(always)]
    fn normal(&self, k: usize) -> Vec3 {
        Vec3::new(self.n[0][k], self.n[1][k], self.n[2][k])
    }

    /// `put`, of velocities and spins only where the measure asks for them.
    #[inline(always)]
    fn put_moving<W: Spin, M: Measure<W>>(&mut self, k: usize, n: &Vec3, motion: impl FnOnce() -> (Vec3, W)) {
        if M::MOVES {
            let (v, spins) = motion();
            self.put(k, n, &v, &spins);
        } else {
            (self.n[0][k], self.n[1][k], self.n[2][k]) = (n.x, n.y, n.z);
        }
    }

    /// Replaces the first two components of the normal by the two numbers of the measure.
    #[inline(always)]
    fn measure<W: Spin, M: Measure<W>>(&mut self, k: usize, measure: &M, gap: f64, n: &Vec3) {
        let v = Vec3::new(self.v[0][k], self.v[1][k], self.v[2][k]);
        [self.n[0][k], self.n[1][k]] = measure.of(gap, n, &v, &self.torque::<W>(k));
    }

    /// Replaces what was put by force and torque; zero unless the contact is `near`.
    #[inline(always)]
    fn evaluate<R: Rebound, T: Tangential, W: Spin>(
        &mut self,
        k: usize,
        law: &Law<R, T>,
        near: bool,
        gap: f64,
        n: Vec3,
    ) {
        let v = Vec3::new(self.v[0][k], self.v[1][k], self.v[2][k]);
        let Action { force, torque } = law.action(gap, &n, &v, &self.torque::<W>(k));
        self.n[0][k] = if near { force.x } else { 0.0 };
        self.n[1][k] = if near { force.y } else { 0.0 };
        self.n[2][k] = if near { force.z } else { 0.0 };
        if W::COMPONENTS == 3 {
            let torque = torque.vector();
            self.spins[0][k] = if near { torque.x } else { 0.0 };
            self.spins[1][k] = if near { torque.y } else { 0.0 };
            self.spins[2][k] = if near { torque.z } else { 0.0 };
        }
        self.near[k] = u64::from(near);
    }

    #[inline(always)]
    fn force(&self, k: usize) -> Vec3 {
        self.normal(k)
    }

    #[inline(always)]
    fn torque<W: Spin>(&self, k: usize) -> W {
        if W::COMPONENTS == 3 {
            W::from_vector(Vec3::new(self.spins[0][k], self.spins[1][k], self.spins[2][k]))
        } else {
            W::zero()
        }
    }
}

/// Work that is compiled for every instruction set.
trait Vectorised {
    type Output;
    /// Must be inlined, into the function that has the instructions.
    fn work(self) -> Self::Output;
}

/// Does `job` with the instruction set, which must be available.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // Functions with instructions that not every processor has can be called no other way.
fn run<J: Vectorised>(set: InstructionSet, job: J) -> J::Output {
    #[target_feature(enable = "avx2")]
    fn avx2<J: Vectorised>(job: J) -> J::Output {
        job.work()
    }
    #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
    fn avx512<J: Vectorised>(job: J) -> J::Output {
        job.work()
    }
    match set {
        InstructionSet::Baseline => job.work(),
        // SAFETY: the caller takes a set that this processor runs: from `InstructionSet::available`, or a narrower one.
        InstructionSet::Avx2 => unsafe { avx2(job) },
        // SAFETY: the same.
        InstructionSet::Avx512 => unsafe { avx512(job) },
    }
}

/// Does `job`; this architecture has one instruction set.
#[cfg(not(target_arch = "x86_64"))]
fn run<J: Vectorised>(_set: InstructionSet, job: J) -> J::Output {
    job.work()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Coulomb, Dissipative, Elastic, Frictionless};
    use crate::forces::{Dissipated, Stored};
    use crate::neighbors::{Lists, Order};
    use crate::ode::Linear;
    use crate::particle::{Locked, Spinning};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn setting() -> Setting {
        let walls = vec![
            Wall::new(Vec3::zeros(), -Vec3::z()),
            Wall::new(Vec3::new(1.0, 0.2, 0.0), Vec3::new(3.0, 0.1, 0.4)),
        ];
        Setting { mass: 2.5, inverse_inertia: 40.0, gravity: Vec3::new(0.1, 0.0, -9.81), walls }
    }

    fn law<R, T>(rebound: R, tangential: T) -> Law<R, T> {
        Law { r: 0.1, f_0: 10.0, kappa: 150.0, l_max: 0.1, rebound, tangential }
    }

    /// A dense cloud with its lists, of which all near pairs are picked.
    fn cloud<W: Spin>(n: usize, blocks: usize) -> (Vec<Motion<W>>, Lists) {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.random::<f64>());
        let order = Order::new([1.0; 3], 0.36);
        let mut bodies: Vec<_> = (0..n as u64)
            .map(|id| {
                let spin = W::from_vector(vector(3.0));
                let body = Motion { x: vector(1.1), v: vector(0.3) - Vec3::repeat(0.15), omega: spin };
                (order.key(&body.x, id), body)
            })
            .collect();
        bodies.sort_unstable_by_key(|(key, _)| *key);
        let (keys, bodies): (Vec<_>, Vec<_>) = bodies.into_iter().unzip();
        let x: Vec<Vec3> = bodies.iter().map(|body| body.x).collect();
        let mut lists = Lists::default();
        lists.rebuild(&x, &keys, n, 0.36, (&setting().walls, 0.26), blocks);
        lists.blocks.iter_mut().for_each(|block| block.pick_near(&bodies, 0.31));
        (bodies, lists)
    }

    fn slopes<R: Rebound, T: Tangential, W: Spin>(
        law: &Law<R, T>,
        bodies: &[Motion<W>],
        lists: &Lists,
        set: InstructionSet,
    ) -> (Vec<Motion<W>>, u64) {
        let setting = setting();
        let mut slopes = bodies.to_vec();
        let mut count = 0;
        for block in &lists.blocks {
            let (mut batch, mut other) = (Batch::default(), Batch::default());
            let (own, slopes) = (&bodies[block.range.clone()], &mut slopes[block.range.clone()]);
            for (slope, body) in slopes.iter_mut().zip(own) {
                *slope = Motion { x: body.v, ..Motion::zero() };
            }
            let setting = &setting;
            add_walls(
                set,
                Sweep { law, setting, bodies: own, block, batch: &mut batch, slopes: &mut *slopes },
            );
            count += add_pairs(set, Sweep { law, setting, bodies, block, batch: &mut other, slopes });
        }
        (slopes, count)
    }

    /// The sums of eqs. (2.13)-(2.15), contact by contact.
    fn expected<R: Rebound, T: Tangential, W: Spin>(
        law: &Law<R, T>,
        bodies: &[Motion<W>],
        i: usize,
    ) -> (Vec3, Vec3) {
        let setting = setting();
        let (mut force, mut torque) = (Vec3::zeros(), Vec3::zeros());
        let mut add = |gap: f64, n: Vec3, v: Vec3, spins: W| {
            if gap <= law.l_max {
                let action = law.action(gap, &n, &v, &spins);
                force += action.force;
                torque += action.torque.vector();
            }
        };
        let a = &bodies[i];
        for wall in &setting.walls {
            add(wall.depth(&a.x) - law.r, -wall.normal, a.v, a.omega);
        }
        for b in bodies.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| b) {
            let apart = a.x - b.x;
            add(apart.norm() - 2.0 * law.r, apart.normalize(), a.v - b.v, a.omega.plus(&b.omega));
        }
        (force / setting.mass + setting.gravity, torque * setting.inverse_inertia)
    }

    fn check<R: Rebound, T: Tangential, W: Spin>(law: Law<R, T>) {
        let (bodies, lists) = cloud::<W>(300, 1);
        let (reference, count) = slopes(&law, &bodies, &lists, InstructionSet::Baseline);
        for (i, slope) in reference.iter().enumerate() {
            let (v, omega) = expected(&law, &bodies, i);
            assert!((slope.v - v).norm() <= 1e-11 * v.norm());
            let spin = if W::COMPONENTS == 3 { omega } else { Vec3::zeros() };
            assert!((slope.omega.vector() - spin).norm() <= 1e-11 * spin.norm().max(v.norm()));
            assert_eq!(slope.x, bodies[i].v);
        }
        let near = |i: usize, j: usize| (bodies[i].x - bodies[j].x).norm() <= 0.3;
        let pairs = (0..300).flat_map(|i| (i + 1..300).map(move |j| (i, j)));
        assert_eq!(count, pairs.filter(|&(i, j)| near(i, j)).count() as u64);
        for set in InstructionSet::available() {
            for blocks in [1, 2, 7] {
                let (bodies, lists) = cloud::<W>(300, blocks);
                let found = slopes(&law, &bodies, &lists, set);
                assert!(found == (reference.clone(), count), "other bits: {}, {blocks} blocks", set.name());
            }
        }
    }

    #[test]
    fn every_instruction_set_and_any_blocks_give_the_bits_of_the_baseline() {
        check::<_, _, Locked>(law(Elastic, Frictionless));
        check::<_, _, Locked>(law(Dissipative::new(0.4, 10.0), Frictionless));
        check::<_, _, Locked>(law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01)));
        check::<_, _, Spinning>(law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01)));
    }

    /// Sums, in units of 2^-40, and maxima of a measure over all contacts.
    fn measured<W: Spin>(
        set: InstructionSet,
        blocks: usize,
        numbers: &impl Measure<W>,
    ) -> ([i128; 2], [f64; 2], Vec<Motion<W>>) {
        let (bodies, lists) = cloud::<W>(300, blocks);
        let walls = &setting().walls[..];
        let (mut sums, mut maxima) = ([0; 2], [0.0; 2]);
        for block in &lists.blocks {
            let batch = &mut Batch::default();
            let survey = Survey { r: 0.1, walls, bodies: &bodies, block, batch };
            measure(set, survey, numbers, |terms| {
                for k in 0..2 {
                    sums[k] += (terms[k] * 2f64.powi(40)).round() as i128;
                    maxima[k] = f64::max(maxima[k], terms[k]);
                }
            });
        }
        (sums, maxima, bodies)
    }

    /// The same numbers, contact by contact, over all pairs of bodies and all walls.
    fn check_measure<W: Spin>(numbers: &impl Measure<W>) {
        let (sums, maxima, bodies) = measured(InstructionSet::Baseline, 1, numbers);
        for set in InstructionSet::available() {
            for blocks in [1, 2, 7] {
                let found = measured(set, blocks, numbers);
                assert!((found.0, found.1) == (sums, maxima), "other bits: {}, {blocks} blocks", set.name());
            }
        }
        let (mut expected, mut largest) = ([0.0; 2], [0.0f64; 2]);
        let mut add = |terms: [f64; 2]| {
            for k in 0..2 {
                expected[k] += terms[k];
                largest[k] = largest[k].max(terms[k]);
            }
        };
        for (i, a) in bodies.iter().enumerate() {
            for wall in &setting().walls {
                add(numbers.of(wall.depth(&a.x) - 0.1, &-wall.normal, &a.v, &a.omega));
            }
            for b in &bodies[i + 1..] {
                let apart = a.x - b.x;
                let n = apart.normalize();
                add(numbers.of(apart.norm() - 0.2, &n, &(a.v - b.v), &a.omega.plus(&b.omega)));
            }
        }
        for k in 0..2 {
            let found = sums[k] as f64 * 2f64.powi(-40);
            assert!((found - expected[k]).abs() <= 1e-9 * expected[k].abs(), "{found} {}", expected[k]);
            assert!((maxima[k] - largest[k]).abs() <= 1e-12 * largest[k]);
        }
    }

    #[test]
    fn every_contact_is_measured_once_with_any_instructions_and_blocks() {
        let basic = law(Dissipative::new(0.4, 10.0), Frictionless);
        let full = law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01));
        check_measure::<Locked>(&Stored(basic.energies()));
        check_measure::<Spinning>(&Stored(full.energies()));
        check_measure::<Locked>(&Dissipated(basic.energies()));
        check_measure::<Spinning>(&Dissipated(full.energies()));
    }

    #[test]
    fn coincident_centres_and_bodies_that_are_not_numbers_show() {
        let law = law(Dissipative::new(0.4, 10.0), Coulomb::new(0.2, 0.01));
        for set in InstructionSet::available() {
            for broken in [0.0, f64::NAN] {
                let (mut bodies, lists) = cloud::<Spinning>(100, 1);
                let [i, j] = lists.blocks[0].near[17].map(|i| i as usize);
                bodies[j].x = bodies[i].x + Vec3::repeat(broken);
                let (slopes, _) = slopes(&law, &bodies, &lists, set);
                assert!(!slopes[i].v.x.is_finite() && !slopes[j].v.x.is_finite());
            }
        }
    }
}
