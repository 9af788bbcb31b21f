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
mod tests;
