//! The contact kernel: evaluates the contact law for batches of contacts with vector instructions.
//!
//! The effects of a scene are types here, and only here: rebound, friction, and whether spheres rotate. One
//! [`Kernel`] has all of them compiled in; whoever calls it sees rows of numbers.
//!
//! There are twelve kernels: with or without loss on rebound, times no friction, the paper's friction or the
//! one that remembers, each of the two with or without rotation, or the one that remembers with resistance to
//! rolling and twisting. Each is compiled for three instruction sets.
//!
//! Contacts are gathered into columns. One loop evaluates them, which the compiler turns into vector
//! instructions. The results are added to the particles one after the other.
//!
//! All instruction sets do the same operations in the same order. So all sets with fused multiply-add give
//! the same bits, whatever their width.

use crate::engine::neighbors::{BATCH, Block};
use crate::math::elementary::{Separate, inverse_root};
use crate::math::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::math::vector::{Vec3, dot, minus, scaled, vector};
use crate::model::columns::{POSITION, SPIN, VELOCITY};
use crate::model::contact::{
    Action, Coulomb, Dissipative, Elastic, Frictionless, Law, LawParameters, Rebound, Resisting, Tangential,
    Turning,
};
use crate::model::dahl::Dahl;
use crate::model::effects::{Effects, Variant};
use crate::model::history::{History, Partner, SHEAR, Touch};
use crate::model::rolling::Resistance;
use crate::model::size::{Size, Sizes, squared_scale};
use crate::model::wall::Wall;
pub use batch::{BEHIND_MEMORIES, Batch, MOST_MEMORY};
pub use closing::{Closing, for_closing_pairs};
pub use laws::{Laws, MakeLaws};
pub use measure::{GapMeasure, Survey, Take, measure_gaps};

mod batch;
mod closing;
mod laws;
mod measure;

/// What turns forces and torques into accelerations.
#[derive(Debug, Clone, Copy)]
pub struct Inertia {
    /// Mass of a typical particle, kg.
    pub mass: f64,
    /// r^2/I of a typical particle, 1/kg: the slope of a spin for every newton of torque over radius.
    pub spin_per_force: f64,
    /// Gravitational acceleration, m/s^2.
    pub gravity: Vec3,
}

/// The data of a sweep over contacts, which adds forces and torques to slopes.
pub struct Sweep<'a> {
    /// Bodies by slot, as rows of the state: the own particles of a block, then its ghosts.
    pub bodies: &'a [f64],
    /// Their sizes.
    pub sizes: Sizes<'a>,
    /// Scratch memory.
    pub batch: &'a mut Batch,
    /// Slopes of the first of these bodies, at most of the own particles. During a sweep they hold forces
    /// and torques over the radius (N), to which the sweep adds.
    pub slopes: &'a mut [f64],
    /// The memories of these contacts.
    pub memories: Memories<'a>,
}

/// A contact without a row for its memory: it counts as 0.
pub const NO_ROW: u32 = u32::MAX;

/// The memories of the contacts of a sweep. All of it is empty where the law has no memory.
pub struct Memories<'a> {
    /// For every contact the number of its row, or [`NO_ROW`].
    pub rows: &'a [u32],
    /// The memories of the contacts of the block, row after row, then [`BEHIND_MEMORIES`] zeros.
    pub states: &'a [f64],
    /// Their rates, 1/s, which the sweep sets.
    pub rates: &'a mut [f64],
}

impl Memories<'_> {
    /// No memories.
    pub fn none() -> Self {
        Memories { rows: &[], states: &[], rates: &mut [] }
    }
}

/// The contact law with all effects of a scene compiled in. Bodies and slopes are rows of the state.
pub trait Kernel: Send + Sync {
    /// Numbers in a row of the state.
    fn width(&self) -> usize;
    /// The elements of a contact, with how many numbers each has in its memory, in their order; none for a
    /// law without memory.
    fn elements(&self) -> &[(usize, Dahl)];
    /// Numbers in the memory of a contact. Threes of them are vectors, which change sign when its bodies
    /// change places; what is left over are numbers that do not.
    fn memory(&self) -> usize {
        self.elements().iter().map(|(numbers, _)| numbers).sum()
    }
    /// Adds the rate of the memory of a contact whose memory is 0 to `rates`, 1/s. `difference` is s_i - s_j
    /// (m/s).
    fn add_first_rate(&self, partner: Partner, touch: Touch, difference: &Vec3, rates: &mut Vec<f64>);
    /// The parameters of the law.
    fn law(&self) -> LawParameters;
    /// From now on contacts are evaluated up to `gap` (m).
    fn set_cutoff(&mut self, gap: f64);
    /// Energy that a contact at rest stores at `gap` (m), J.
    fn stored(&self, gap: f64) -> f64;
    /// Measures the energy that contacts store.
    fn stored_energy(&self) -> GapMeasure;
    /// Starts the slopes of `bodies`: their velocities, no force, no torque.
    fn start_slopes(&self, bodies: &[f64], slopes: &mut [f64]);
    /// `start_slopes`. Also returns the largest squared distance of the bodies from their positions in
    /// `starts`, m^2; infinite where a position is NaN. The distances are scaled as their `sizes` say, which
    /// are empty where all are alike, see [`squared_scale`].
    fn start_stage(&self, bodies: &[f64], starts: &[f64], sizes: &[Size], slopes: &mut [f64]) -> f64;
    /// Adds forces and torques of `walls` to the slopes of the sweep.
    ///
    /// A contact is a slot and the number of a wall. The bodies and the slopes of the sweep begin with slot
    /// `first`.
    fn add_walls(&self, first: usize, contacts: &[[u32; 2]], walls: &[Wall], sweep: Sweep);
    /// Adds forces and torques of `pairs`, given by their slots, to the slopes of the sweep.
    ///
    /// A body without a slope is a ghost; nothing is added for it. Returns the number of pairs within the
    /// cutoff whose first particle has a slope.
    fn add_pairs(&self, pairs: &[[u32; 2]], sweep: Sweep) -> u64;
    /// Turns forces and torques in `slopes` into accelerations, eqs. (2.13)-(2.15), of spheres with these
    /// `sizes`.
    fn finish(&self, inertia: &Inertia, sizes: Sizes, slopes: &mut [f64]);
    /// Passes the power (W) that every contact of the survey dissipates by rebound and by friction to `take`.
    fn measure_dissipation<'a>(&self, survey: Survey<'a>, take: &'a mut Take<'a>);
    /// Force and torque of one contact, without vector instructions; arguments as for [`Law::action`].
    fn action(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &Vec3) -> Action;
}

/// The kernel for these effects. The processor must have the instructions of `set`.
///
/// This is the one place where effects become types.
///
/// # Examples
///
/// ```rust
/// use demhybrid::engine::kernel::kernel;
/// use demhybrid::math::instructions::InstructionSet;
/// use demhybrid::math::vector::Vec3;
/// use demhybrid::model::effects::Effects;
/// use demhybrid::scene::{Scene, effects};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let kernel = kernel(Effects::of(&scene), effects::law(&scene), InstructionSet::Baseline);
/// assert_eq!(kernel.width(), 9); // with rotation
/// let at_rest = kernel.action(0.0, &Vec3::z(), &Vec3::zeros(), &Vec3::zeros());
/// assert!((at_rest.force.z - 5.8).abs() < 1e-12); // rho(0) F_0 = (1 + e^2)/2 F_0, N
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn kernel(effects: Effects, law: LawParameters, set: InstructionSet) -> Box<dyn Kernel> {
    if effects.dissipative {
        with_rebound(effects.variant, Dissipative::new(law.e, law.psi), law, set)
    } else {
        with_rebound(effects.variant, Elastic, law, set)
    }
}

fn with_rebound<R: Rebound>(
    variant: Variant,
    rebound: R,
    law: LawParameters,
    set: InstructionSet,
) -> Box<dyn Kernel> {
    let friction = Coulomb::new(law.phi, law.v_min);
    match (variant, law.memory) {
        (Variant::Basic, _) => compiled(law, rebound, Frictionless, set),
        (Variant::Friction, None) => compiled(law, rebound, friction, set),
        (Variant::FrictionRotation, None) => compiled(law, rebound, Turning(friction), set),
        (Variant::Friction, Some(memory)) => compiled(law, rebound, History::new(&law, memory, false), set),
        (Variant::FrictionRotation, Some(memory)) => {
            let friction = History::new(&law, memory, true);
            match Resistance::new(&law, &memory) {
                None => compiled(law, rebound, Turning(friction), set),
                Some(resistance) => compiled(law, rebound, Resisting { friction, resistance }, set),
            }
        }
    }
}

/// A kernel with a law of one's own. The state has spins if friction turns the spheres
/// ([`Tangential::TURNS`]).
///
/// # Examples
///
/// ```rust
/// use demhybrid::engine::kernel::compiled;
/// use demhybrid::math::instructions::InstructionSet;
/// use demhybrid::model::contact::{Coulomb, Elastic, Turning};
/// use demhybrid::scene::{Scene, effects};
///
/// let text = std::fs::read_to_string("configs/quick.toml")?;
/// let scene = Scene::parse("configs/quick.toml", &text, &[])?;
/// let (law, set) = (effects::law(&scene), InstructionSet::Baseline);
/// assert_eq!(compiled(law, Elastic, Coulomb::new(0.3, 0.01), set).width(), 6);
/// assert_eq!(compiled(law, Elastic, Turning(Coulomb::new(0.3, 0.01)), set).width(), 9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compiled<R: Rebound, T: Tangential>(
    law: LawParameters,
    rebound: R,
    tangential: T,
    set: InstructionSet,
) -> Box<dyn Kernel> {
    let elements = tangential.elements();
    let law = Law { parameters: law, rebound, tangential };
    if T::TURNS {
        Box::new(Compiled::<R, T, { SPIN.end }> { law, elements, set })
    } else {
        Box::new(Compiled::<R, T, { VELOCITY.end }> { law, elements, set })
    }
}

/// A kernel for one combination of effects.
struct Compiled<R, T, const N: usize> {
    law: Law<R, T>,
    elements: Vec<(usize, Dahl)>,
    set: InstructionSet,
}

/// Numbers as rows of `N`.
#[inline(always)]
fn rows<const N: usize>(numbers: &[f64]) -> &[[f64; N]] {
    numbers.as_chunks().0
}

/// The spin of a body, m/s; zero without rotation.
#[inline(always)]
fn spin<const N: usize>(body: &[f64; N]) -> Vec3 {
    if N == SPIN.end { vector(&body[SPIN]) } else { Vec3::zeros() }
}

impl<R: Rebound, T: Tangential, const N: usize> Kernel for Compiled<R, T, N> {
    fn width(&self) -> usize {
        N
    }

    fn elements(&self) -> &[(usize, Dahl)] {
        &self.elements
    }

    fn add_first_rate(&self, partner: Partner, touch: Touch, difference: &Vec3, rates: &mut Vec<f64>) {
        rates.extend(&self.law.respond::<Separate>(partner, touch).rate);
        let Some(resistance) = self.law.tangential.resistance() else { return };
        if let Some(rolling) = &resistance.rolling {
            rates.extend(&resistance.roll::<Separate>(rolling, partner, touch, difference).rate);
        }
        if let Some(twisting) = &resistance.twisting {
            rates.push(resistance.twist::<Separate>(twisting, partner, touch, difference).rate.dot(touch.n));
        }
    }

    fn law(&self) -> LawParameters {
        self.law.parameters
    }

    fn set_cutoff(&mut self, gap: f64) {
        self.law.parameters.l_max = gap;
    }

    fn stored(&self, gap: f64) -> f64 {
        self.law.energies().stored::<Separate>(gap)
    }

    fn stored_energy(&self) -> GapMeasure {
        GapMeasure::Stored(self.law.energies().at_rest)
    }

    fn start_slopes(&self, bodies: &[f64], slopes: &mut [f64]) {
        for (slope, body) in slopes.as_chunks_mut::<N>().0.iter_mut().zip(rows::<N>(bodies)) {
            start(slope, body);
        }
    }

    fn start_stage(&self, bodies: &[f64], starts: &[f64], sizes: &[Size], slopes: &mut [f64]) -> f64 {
        let (mut way, mut sum) = (0.0, 0.0);
        let ends = rows::<N>(bodies).iter().zip(rows::<N>(starts)).enumerate();
        for (slope, (k, (body, from))) in slopes.as_chunks_mut::<N>().0.iter_mut().zip(ends) {
            let apart = minus(&vector(&body[POSITION]), &vector(&from[POSITION]));
            let scale = squared_scale(sizes, k, self.law.parameters.r);
            let apart = dot::<Separate>(&apart, &apart) * scale;
            way = if apart > way { apart } else { way };
            sum += apart;
            start(slope, body);
        }
        // A position that is NaN counts as infinitely far. The comparison misses it, the sum does not.
        if sum.is_nan() { f64::INFINITY } else { way }
    }

    fn add_walls(&self, first: usize, contacts: &[[u32; 2]], walls: &[Wall], sweep: Sweep) {
        run(self.set, Walls::<R, T, N>(&self.law, first, contacts, walls, sweep));
    }

    fn add_pairs(&self, pairs: &[[u32; 2]], sweep: Sweep) -> u64 {
        run(self.set, Pairs::<R, T, N>(&self.law, pairs, sweep))
    }

    fn finish(&self, inertia: &Inertia, sizes: Sizes, slopes: &mut [f64]) {
        let gravity = inertia.gravity;
        let finish = |slope: &mut [f64; N], inverse_mass: f64, spin_per_force: f64| {
            for k in 0..3 {
                slope[VELOCITY.start + k] = slope[VELOCITY.start + k] * inverse_mass + gravity[k];
            }
            slope[VELOCITY.end..].iter_mut().for_each(|turning| *turning *= spin_per_force);
        };
        let slopes = slopes.as_chunks_mut::<N>().0;
        match sizes {
            Sizes::Equal(_) => {
                let inverse_mass = 1.0 / inertia.mass;
                slopes.iter_mut().for_each(|slope| finish(slope, inverse_mass, inertia.spin_per_force));
            }
            Sizes::Each(sizes) => {
                // m r^2/I is that of a typical sphere.
                let turned = inertia.spin_per_force * inertia.mass;
                for (slope, size) in slopes.iter_mut().zip(sizes) {
                    finish(slope, size.per_mass, turned * size.per_mass);
                }
            }
        }
    }

    fn measure_dissipation<'a>(&self, survey: Survey<'a>, take: &'a mut Take<'a>) {
        run(self.set, measure::Power::<R, T, N>(&self.law, survey, take));
    }

    fn action(&self, gap: f64, n: &Vec3, v_rel: &Vec3, spins: &Vec3) -> Action {
        self.law.action::<Separate>(gap, n, v_rel, spins)
    }
}

/// Starts the slope of a body: its velocity, no force, no torque.
#[inline(always)]
fn start<const N: usize>(slope: &mut [f64; N], body: &[f64; N]) {
    for k in 0..3 {
        slope[k] = body[VELOCITY.start + k];
    }
    slope[3..].fill(0.0);
}

struct Walls<'a, R, T, const N: usize>(&'a Law<R, T>, usize, &'a [[u32; 2]], &'a [Wall], Sweep<'a>);

impl<R: Rebound, T: Tangential, const N: usize> Vectorised for Walls<'_, R, T, N> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Walls(law, first, contacts, walls, Sweep { bodies, sizes, batch, slopes, memories }) = self;
        let (bodies, slopes) = (rows::<N>(bodies), slopes.as_chunks_mut::<N>().0);
        let (l_max, alike) = (law.parameters.l_max, alike::<T>(sizes, Partner::Wall, contacts.len(), batch));
        let memory = law.tangential.resistance().map_or(SHEAR, Resistance::memory);
        for (chunk, contacts) in contacts.chunks(BATCH).enumerate() {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize - first], &walls[wall as usize]);
                if let Sizes::Each(sizes) = sizes {
                    let size = &sizes[i as usize - first];
                    batch.put_wall::<N>(k, (body, size), typical::<T>(&law.parameters));
                }
                // A wall is a motionless partner with n = -n_k.
                batch.gap[k] = wall.depth(&vector(&body[POSITION])) - batch.surfaces[k];
                batch.put::<N>(k, &-wall.normal, &vector(&body[VELOCITY]), &spin(body));
            }
            let rows = own_rows(&memories, chunk * BATCH, contacts.len());
            if T::REMEMBERS {
                batch.put_memories::<L>(rows, memories.states, memory);
                batch.find_spins::<L, N>(contacts.len(), Partner::Wall, alike);
            }
            if let Some(resistance) = law.tangential.resistance() {
                let spins = |&[i, _]: &[u32; 2]| [spin(&bodies[i as usize - first]), Vec3::zeros()];
                batch.put_turns(contacts.iter().map(spins));
                batch.resist::<L>(contacts.len(), resistance, Partner::Wall, |gap, _| gap <= l_max);
            }
            for k in 0..Batch::rows(contacts.len()) {
                batch.evaluate::<L, R, T, N>(k, law, Partner::Wall, batch.gap[k] <= l_max);
            }
            if T::REMEMBERS {
                batch.take_rates::<L>(rows, memories.rates, memory);
            }
            if law.tangential.resistance().is_some() {
                batch.add_moments(contacts.len());
            }
            for (k, &[i, _]) in contacts.iter().enumerate() {
                let slope = &mut slopes[i as usize - first];
                let (force, turning) = (batch.force(k), batch.spins::<N>(k));
                for c in 0..3 {
                    slope[VELOCITY.start + c] += force[c];
                    if N == SPIN.end {
                        slope[SPIN.start + c] += turning[c];
                    }
                }
            }
        }
    }
}

struct Pairs<'a, R, T, const N: usize>(&'a Law<R, T>, &'a [[u32; 2]], Sweep<'a>);

impl<R: Rebound, T: Tangential, const N: usize> Vectorised for Pairs<'_, R, T, N> {
    type Output = u64;
    #[inline(always)]
    fn work<L: Lanes>(self) -> u64 {
        let Pairs(law, pairs, Sweep { bodies, sizes, batch, slopes, memories }) = self;
        let (bodies, slopes) = (rows::<N>(bodies), slopes.as_chunks_mut::<N>().0);
        let (l_max, alike) = (law.parameters.l_max, alike::<T>(sizes, Partner::Sphere, pairs.len(), batch));
        let memory = law.tangential.resistance().map_or(SHEAR, Resistance::memory);
        let mut count = 0;
        for (chunk, pairs) in pairs.chunks(BATCH).enumerate() {
            let rows = own_rows(&memories, chunk * BATCH, pairs.len());
            if T::REMEMBERS {
                batch.put_memories::<L>(rows, memories.states, memory);
            }
            batch.gather::<L, N>(bodies, pairs);
            if let Sizes::Each(sizes) = sizes {
                let resists = law.tangential.resistance().is_some();
                batch.put_pairs((bodies, sizes), pairs, (typical::<T>(&law.parameters), resists));
            }
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, inverse_d) = distance::<L>(&apart);
                let cutoff = batch.surfaces[k] + l_max;
                let far = d2 > cutoff * cutoff;
                batch.gap[k] = L::add_product(d2, inverse_d, -batch.surfaces[k]);
                // A distance that is NaN must not count as far: the fault has to show in the forces.
                batch.near[k] = u64::from(!far);
                batch.put_normal(k, &scaled(inverse_d, &apart));
            }
            if T::REMEMBERS {
                batch.find_spins::<L, N>(pairs.len(), Partner::Sphere, alike);
            }
            if let Some(resistance) = law.tangential.resistance() {
                batch.put_turns(spins(bodies, pairs));
                batch.resist::<L>(pairs.len(), resistance, Partner::Sphere, |_, near| near != 0);
            }
            // A separate loop. Together with the distances, more operations would wait for each other than
            // the processor can look ahead.
            for k in 0..Batch::rows(pairs.len()) {
                batch.evaluate::<L, R, T, N>(k, law, Partner::Sphere, batch.near[k] != 0);
            }
            if T::REMEMBERS {
                batch.take_rates::<L>(rows, memories.rates, memory);
            }
            let moments = law.tangential.resistance().is_some();
            if moments {
                batch.add_moments(pairs.len());
            }
            let near: u64 = batch.near[..pairs.len()].iter().sum();
            count += near - batch.scatter::<L, N>(pairs, slopes, moments);
        }
        count
    }
}

/// The spins of both partners of `pairs`, m/s.
#[inline(always)]
fn spins<const N: usize>(bodies: &[[f64; N]], pairs: &[[u32; 2]]) -> impl Iterator<Item = [Vec3; 2]> {
    pairs.iter().map(|pair| pair.map(|slot| spin(&bodies[slot as usize])))
}

/// Whether all spheres have the same size. Then fills the `batch` with what that means for this number of
/// `contacts` with these partners.
#[inline(always)]
fn alike<T: Tangential>(sizes: Sizes, partner: Partner, contacts: usize, batch: &mut Batch) -> bool {
    match sizes {
        Sizes::Equal(size) => batch.set_alike(size.r, partner, T::REMEMBERS, contacts),
        Sizes::Each(_) => return false,
    }
    true
}

/// The mass of a typical sphere, kg, where contacts have a memory.
#[inline(always)]
fn typical<T: Tangential>(law: &LawParameters) -> Option<f64> {
    law.memory.filter(|_| T::REMEMBERS).map(|memory| memory.mass)
}

/// The rows of `count` contacts from `first` on; none where the law has no memory.
#[inline(always)]
fn own_rows<'a>(memories: &Memories<'a>, first: usize, count: usize) -> &'a [u32] {
    if memories.rows.is_empty() { &[] } else { &memories.rows[first..first + count] }
}

/// Square of the length of a vector, and the inverse of its length.
#[inline(always)]
fn distance<L: Lanes>(apart: &Vec3) -> (f64, f64) {
    let d2 = dot::<L>(apart, apart);
    (d2, inverse_root::<L>(d2))
}

#[cfg(test)]
mod tests;
