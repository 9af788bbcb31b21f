//! Numbers of every contact, such as energies, whose maxima or sums over all contacts are wanted.

use super::{BATCH, Batch, Block, alike, distance, rows, spin, spins, typical};
use crate::math::elementary::Arithmetic;
use crate::math::instructions::{InstructionSet, Lanes, Vectorised, run};
use crate::math::vector::{Vec3, scaled, vector};
use crate::model::columns::{POSITION, VELOCITY, position};
use crate::model::contact::{AtRest, Energies, Law, Rebound, Tangential};
use crate::model::history::{Partner, SHEAR};
use crate::model::rolling::Resistance;
use crate::model::size::Sizes;
use crate::model::wall::Wall;

/// The contacts of one block to be measured. Over all blocks of all ranks, each contact is measured once.
pub struct Survey<'a> {
    /// The walls.
    pub walls: &'a [Wall],
    /// Bodies of the block by slot, as rows of the state.
    pub bodies: &'a [f64],
    /// Their sizes.
    pub sizes: Sizes<'a>,
    /// Numbers in a row of the state.
    pub width: usize,
    /// The block with its lists: near pairs and all listed walls are measured.
    pub block: &'a Block,
    /// Only contacts of this class are measured.
    pub class: usize,
    /// Scratch memory.
    pub batch: &'a mut Batch,
    /// Memories of the contacts of the block, row after row; empty where the law has none.
    pub memories: &'a [f64],
}

/// Two numbers of a contact that depend on its gap alone.
#[derive(Debug, Clone, Copy)]
pub enum GapMeasure {
    /// How deep a contact is: how far its gap is below the largest gap at which surfaces interact, and its
    /// overlap, m. The field is that largest gap, m. A number that would be negative is 0.
    Depth(f64),
    /// The overlap as a share of the radius, of two spheres that of the smaller one. The second number is 0.
    Share,
    /// The energy that a contact stores, J. The second number is 0.
    Stored(AtRest),
}

impl GapMeasure {
    #[inline(always)]
    fn of<A: Arithmetic>(&self, gap: f64) -> [f64; 2] {
        let above = |x: f64| if x > 0.0 { x } else { 0.0 };
        match self {
            GapMeasure::Depth(l_max) => [above(l_max - gap), above(-gap)],
            // Over the radius where sizes are known.
            GapMeasure::Share => [above(-gap), 0.0],
            GapMeasure::Stored(at_rest) => [at_rest.stored::<A>(gap), 0.0],
        }
    }
}

/// Receives the two numbers of up to 128 contacts, as two columns. Their order must not matter to it.
pub type Take<'f> = dyn FnMut([&[f64]; 2]) + 'f;

/// Passes the numbers of every contact of the survey to `take`.
pub fn measure_gaps(set: InstructionSet, survey: Survey, measure: &GapMeasure, take: &mut Take) {
    run(set, Gaps(survey, measure, take));
}

struct Gaps<'a>(Survey<'a>, &'a GapMeasure, &'a mut Take<'a>);

impl Vectorised for Gaps<'_> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Gaps(Survey { walls, bodies, sizes, width, block, class, batch, .. }, measure, take) = self;
        let r = |slot: u32| sizes.of(slot as usize).r;
        let share = matches!(measure, GapMeasure::Share);
        let x = |slot: u32| position(&bodies[slot as usize * width..]);
        for pairs in block.near[block.near_of(class)].chunks(BATCH) {
            for (k, &[i, j]) in pairs.iter().enumerate() {
                batch.put_normal(k, &(x(i) - x(j)));
                batch.surfaces[k] = r(i) + r(j);
            }
            for k in 0..Batch::rows(pairs.len()) {
                let (d2, inverse_d) = distance::<L>(&batch.normal(k));
                batch.put_numbers(k, measure.of::<L>(L::add_product(d2, inverse_d, -batch.surfaces[k])));
            }
            if share {
                batch.divide_numbers(pairs.iter().map(|&[i, j]| r(i).min(r(j))));
            }
            take_owned(block, pairs, batch, take);
        }
        for contacts in block.walls[block.walls_of(class)].chunks(BATCH) {
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                batch.gap[k] = walls[wall as usize].depth(&x(i)) - r(i);
            }
            for k in 0..Batch::rows(contacts.len()) {
                batch.put_numbers(k, measure.of::<L>(batch.gap[k]));
            }
            if share {
                batch.divide_numbers(contacts.iter().map(|&[i, _]| r(i)));
            }
            take(batch.number_columns(contacts.len()));
        }
    }
}

/// Power that every contact dissipates.
pub(super) struct Power<'a, R, T, const N: usize>(pub &'a Law<R, T>, pub Survey<'a>, pub &'a mut Take<'a>);

impl<R: Rebound, T: Tangential, const N: usize> Vectorised for Power<'_, R, T, N> {
    type Output = ();
    #[inline(always)]
    fn work<L: Lanes>(self) {
        let Power(law, Survey { walls, bodies, sizes, block, class, batch, memories, .. }, take) = self;
        let (bodies, energies) = (rows::<N>(bodies), law.energies());
        let resistance = law.tangential.resistance();
        let memory = resistance.map_or(SHEAR, Resistance::memory);
        let part = block.near_of(class);
        let is_alike = alike::<T>(sizes, Partner::Sphere, part.len(), batch);
        for (chunk, pairs) in block.near[part.clone()].chunks(BATCH).enumerate() {
            if T::REMEMBERS {
                let rows = &block.near_rows[part.start + chunk * BATCH..][..pairs.len()];
                batch.put_memories::<L>(rows, memories, memory);
            }
            batch.gather::<L, N>(bodies, pairs);
            if let Sizes::Each(sizes) = sizes {
                let resists = law.tangential.resistance().is_some();
                batch.put_pairs((bodies, sizes), pairs, (typical::<T>(&law.parameters), resists));
            }
            if resistance.is_some() {
                batch.put_turns(spins(bodies, pairs));
            }
            for k in 0..Batch::rows(pairs.len()) {
                let apart = batch.normal(k);
                let (d2, inverse_d) = distance::<L>(&apart);
                batch.gap[k] = L::add_product(d2, inverse_d, -batch.surfaces[k]);
                batch.put_normal(k, &scaled(inverse_d, &apart));
            }
            if T::REMEMBERS {
                batch.find_spins::<L, N>(pairs.len(), Partner::Sphere, is_alike);
            }
            for k in 0..Batch::rows(pairs.len()) {
                let n = batch.normal(k);
                put_power::<L, R, T, N>(&energies, batch, k, Partner::Sphere, &n);
            }
            take_owned(block, pairs, batch, take);
        }
        let part = block.walls_of(class);
        let is_alike = alike::<T>(sizes, Partner::Wall, part.len(), batch);
        for (chunk, contacts) in block.walls[part.clone()].chunks(BATCH).enumerate() {
            if T::REMEMBERS {
                let rows = &block.wall_rows[part.start + chunk * BATCH..][..contacts.len()];
                batch.put_memories::<L>(rows, memories, memory);
            }
            for (k, &[i, wall]) in contacts.iter().enumerate() {
                let (body, wall) = (&bodies[i as usize], &walls[wall as usize]);
                if let Sizes::Each(sizes) = sizes {
                    batch.put_wall(k, (body, &sizes[i as usize]), typical::<T>(&law.parameters));
                }
                batch.gap[k] = wall.depth(&vector(&body[POSITION])) - batch.surfaces[k];
                batch.put::<N>(k, &-wall.normal, &vector(&body[VELOCITY]), &spin(body));
            }
            if T::REMEMBERS {
                batch.find_spins::<L, N>(contacts.len(), Partner::Wall, is_alike);
            }
            if resistance.is_some() {
                batch.put_turns(contacts.iter().map(|&[i, _]| [spin(&bodies[i as usize]), Vec3::zeros()]));
            }
            for k in 0..Batch::rows(contacts.len()) {
                let n = batch.normal(k);
                put_power::<L, R, T, N>(&energies, batch, k, Partner::Wall, &n);
            }
            take(batch.number_columns(contacts.len()));
        }
    }
}

/// Computes the power of the contact in row `k`. A closure would be compiled without vector instructions.
#[inline(always)]
fn put_power<L: Lanes, R: Rebound, T: Tangential, const N: usize>(
    energies: &Energies<R, T>,
    batch: &mut Batch,
    k: usize,
    partner: Partner,
    n: &Vec3,
) {
    let gap = batch.gap[k];
    if T::REMEMBERS {
        let mut power = batch.respond::<L, R, T, N>(k, energies.law, partner, n).dissipation;
        if let Some(resistance) = energies.law.tangential.resistance() {
            power[1] += batch.resisted_power::<L>(k, resistance, partner, n);
        }
        let far = gap > energies.law.parameters.l_max;
        return batch.put_numbers(k, power.map(|power| if far { 0.0 } else { power }));
    }
    let numbers = energies.dissipation::<L>(gap, n, &batch.velocity(k), &batch.spins::<N>(k));
    batch.put_numbers(k, numbers);
}

/// Calls `take` with the pairs whose first particle is an own one. The others are counted in its block.
fn take_owned(block: &Block, pairs: &[[u32; 2]], batch: &mut Batch, take: &mut Take) {
    let mut owned = 0;
    for (k, [i, _]) in pairs.iter().enumerate() {
        if block.owns(*i) {
            batch.put_numbers(owned, batch.numbers(k));
            owned += 1;
        }
    }
    take(batch.number_columns(owned));
}
