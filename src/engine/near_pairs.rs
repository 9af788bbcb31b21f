//! Near pairs and walls: those of the lists of a block that can soon touch. Only these are evaluated.

use crate::engine::contact_classes::part;
use crate::engine::neighbors::{BATCH, Block, Reach};
use crate::math::vector::Vec3;
use crate::model::size::Sizes;
use crate::model::wall::Wall;

impl Block {
    /// Picks the listed pairs for `near` whose centres are within `reach`, and for `near_walls` the walls
    /// that are. `x` (m) are the centres of the bodies of the block, and the sizes of `reach` those, by slot.
    pub fn pick_near(&mut self, x: &[Vec3], reach: Reach, walls: &[Wall]) {
        match reach.sizes {
            Sizes::Equal(_) => {
                let [pair, wall] = [reach.of_pair(0, 0), reach.of_wall(0)];
                self.pick_within(x, |_| pair, walls, |_| wall);
            }
            Sizes::Each(_) => {
                let pair = |[i, j]: [u32; 2]| reach.of_pair(i as usize, j as usize);
                self.pick_within(x, pair, walls, |i| reach.of_wall(i as usize));
            }
        }
    }

    #[inline(always)]
    fn pick_within(
        &mut self,
        x: &[Vec3],
        cutoff: impl Fn([u32; 2]) -> f64,
        walls: &[Wall],
        wall_cutoff: impl Fn(u32) -> f64,
    ) {
        self.near_walls.clear();
        self.ends.near.clear();
        self.ends.near_walls.clear();
        // Of one class there are no ends.
        let classes = self.ends.pairs.len();
        // A distance that is NaN must not count as far: the fault has to show in the forces.
        let far = |&[i, k]: &[u32; 2]| walls[k as usize].depth(&x[i as usize]) > wall_cutoff(i);
        for class in 0..classes.max(1) {
            let walls = &self.walls[part(&self.ends.walls, class, self.walls.len())];
            self.near_walls.extend(walls.iter().copied().filter(|contact| !far(contact)));
            self.ends.near_walls.extend((classes > 0).then_some(self.near_walls.len() as u32));
        }
        // Without a branch: every pair is written, and the next one overwrites it if it is far.
        self.near.resize(self.pairs.len(), [0; 2]);
        let mut kept = 0;
        for class in 0..classes.max(1) {
            for &pair in &self.pairs[part(&self.ends.pairs, class, self.pairs.len())] {
                let apart = x[pair[0] as usize] - x[pair[1] as usize];
                self.near[kept] = pair;
                // NaN must not count as far here either.
                let cutoff = cutoff(pair);
                let far = apart.norm_squared() > cutoff * cutoff;
                kept += usize::from(!far);
            }
            self.ends.near.extend((classes > 0).then_some(kept as u32));
        }
        self.near.truncate(kept);
        if self.remembers {
            find_places(&self.pairs, &self.near, &mut self.near_places);
            find_places(&self.walls, &self.near_walls, &mut self.near_wall_places);
            self.look_up_rows();
        }
        self.horizon.clear();
        // Enough for the case that all pairs are near. Near pairs are also picked within steps, where nothing
        // may be allocated.
        self.horizon.reserve(self.pairs.len().div_ceil(BATCH) + classes);
        let own = self.range.len() as u32;
        let horizon = |pairs: &[[u32; 2]]| {
            pairs.as_flattened().iter().filter(|&&slot| slot < own).fold(0, |most, slot| most.max(slot + 1))
        };
        for class in 0..classes.max(1) {
            let near = &self.near[part(&self.ends.near, class, self.near.len())];
            self.horizon.extend(near.chunks(BATCH).map(horizon));
        }
    }

    /// Looks up the rows of near contacts among those of listed ones.
    pub fn look_up_rows(&mut self) {
        let rows = |listed: &[u32], places: &[u32], near: &mut Vec<u32>| {
            near.clear();
            near.reserve(listed.len());
            near.extend(places.iter().map(|&place| listed[place as usize]));
        };
        rows(&self.pair_rows, &self.near_places, &mut self.near_rows);
        rows(&self.wall_rows, &self.near_wall_places, &mut self.near_wall_rows);
    }
}

/// Finds the indices of the `near` contacts among the `listed` ones, which are in the same order.
fn find_places(listed: &[[u32; 2]], near: &[[u32; 2]], places: &mut Vec<u32>) {
    places.clear();
    // Near contacts are also picked within steps, where nothing may be allocated.
    places.reserve(listed.len());
    let mut rest = (0..).zip(listed);
    places.extend(near.iter().filter_map(|contact| Some(rest.find(|(_, other)| *other == contact)?.0)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::neighbors::tests::{keyed, listed};

    #[test]
    fn near_pairs_are_those_within_their_reach_in_the_same_order() {
        let (x, keys) = keyed(150, 100, [1.0, 1.0, 0.5], 5);
        let (mut lists, _) = listed(&x, &keys, 100, 0.3, 2);
        for block in &mut lists.blocks {
            let slots = 0..(block.range.len() + block.ghosts.len()) as u32;
            let centres: Vec<_> = slots.map(|slot| x[block.index(slot)]).collect();
            block.pick_near(&centres, Reach::of_centres(0.25, 0.0), &[]);
            let at = |slot: &u32| centres[*slot as usize];
            let within = |[i, j]: &[u32; 2]| (at(i) - at(j)).norm() <= 0.25;
            let expected: Vec<_> = block.pairs.iter().copied().filter(within).collect();
            assert!(expected.len() > 10 && expected.len() < block.pairs.len());
            assert_eq!(block.near, expected);
        }
    }
}
