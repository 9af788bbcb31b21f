//! The search for pairs of particles within reach of each other, for [`crate::engine::neighbors`].

use crate::engine::neighbors::{Key, Reach};
use crate::math::sized_cells::SizedCells;
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use std::ops::Range;

/// The particles of a rank by local index, and the cells in which they are.
pub struct PairSearch<'a> {
    /// Centres, m.
    x: &'a [Vec3],
    reach: Reach<'a>,
    cells: SizedCells,
    /// The place of each particle in the summation order.
    pub places: Vec<u32>,
    /// The inverse: the local index of the particle at each place.
    pub order: Vec<u32>,
}

impl<'a> PairSearch<'a> {
    /// A search among particles with the centres `x` (m) and these `keys`. The owned ones come first, by
    /// ascending key.
    pub fn new(x: &'a [Vec3], keys: &[Key], reach: Reach<'a>) -> Self {
        let mut order: Vec<u32> = (0..x.len() as u32).collect();
        // A stable sort makes use of the owned particles being in order already.
        order.sort_by_key(|&i| keys[i as usize]);
        let mut places = vec![0; x.len()];
        for (place, &i) in order.iter().enumerate() {
            places[i as usize] = place as u32;
        }
        let radius = |i: usize| reach.sizes.of(i).r;
        let radii: Option<&dyn Fn(usize) -> f64> = match reach.sizes {
            Sizes::Equal(_) => None,
            Sizes::Each(_) => Some(&radius),
        };
        let cells = SizedCells::new(x, radii, &Self::between(reach));
        PairSearch { x, reach, cells, places, order }
    }

    /// Up to which distance (m) of their centres particles with two radii count, for cells.
    fn between(reach: Reach) -> impl Fn(f64, f64) -> f64 {
        // Of particles that are alike all pairs have one reach, whatever radii the cells name.
        let of_all = matches!(reach.sizes, Sizes::Equal(_)).then(|| reach.of_pair(0, 0));
        move |a, b| of_all.unwrap_or_else(|| reach.between(a, b))
    }

    /// Finds all particles within reach of particle `i` of the block with this `range`, but not those of the
    /// block up to `i`. They are the first ones in `found` afterwards, in any order; returns their number.
    pub fn find(&self, i: usize, range: &Range<usize>, found: &mut Vec<u32>) -> usize {
        match self.reach.sizes {
            Sizes::Equal(_) => {
                let cutoff = self.reach.of_pair(0, 0);
                self.find_within(i, range, |_| cutoff, found)
            }
            Sizes::Each(_) => self.find_within(i, range, |j| self.reach.of_pair(i, j), found),
        }
    }

    #[inline(always)]
    fn find_within(
        &self,
        i: usize,
        range: &Range<usize>,
        cutoff: impl Fn(usize) -> f64,
        found: &mut Vec<u32>,
    ) -> usize {
        let r = self.reach.sizes.of(i).r;
        let (first, own) = (range.start as u32, i as u32);
        // Not `||`: a branch could not be predicted.
        let is_sought = |j: u32| (j > own) | (j < first);
        // Those not sought are in one range, so a bucket with a sought one begins or ends with such a one.
        let ends = |bucket: &[u32]| Some([*bucket.first()?, *bucket.last()?]);
        let is_wanted = |bucket: &[u32]| ends(bucket).is_some_and(|[a, b]| is_sought(a) | is_sought(b));
        let mut count = 0;
        self.cells.for_each_run_near(&self.x[i], r, &Self::between(self.reach), is_wanted, |run| {
            if found.len() < count + run.len() {
                found.resize(count + run.len(), 0);
            }
            count += pick(run, (self.x, i), &cutoff, is_sought, &mut found[count..]);
        });
        count
    }
}

/// Of the particles in a `run` picks those for `found` that are sought and not beyond the `cutoff` (m) of
/// particle `i`. Returns their number. `x` (m) are the centres.
///
/// A function of its own keeps what this loop needs in registers.
#[inline(never)]
fn pick(
    run: &[u32],
    (x, i): (&[Vec3], usize),
    cutoff: impl Fn(usize) -> f64,
    is_sought: impl Fn(u32) -> bool,
    found: &mut [u32],
) -> usize {
    let own = x[i];
    let mut count = 0;
    // Without a branch: every index is written, and the next one overwrites it if it is not picked.
    for &j in run {
        let cutoff = cutoff(j as usize);
        let within = (own - x[j as usize]).norm_squared() <= cutoff * cutoff;
        found[count] = j;
        count += usize::from(within & is_sought(j));
    }
    count
}
