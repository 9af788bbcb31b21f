//! Contacts of a block by classes: those of one class, which share a law, follow each other in every list.
//!
//! Within a class contacts are in the summation order. So a particle adds its walls by class and then in the
//! order of the scene, and its partners by class and then by [`crate::engine::neighbors::Order`]. No rank,
//! thread, block or list changes that order.

use crate::engine::neighbors::{Block, Lists};
use crate::model::materials::Classes;
use crate::threads;
use std::ops::Range;

/// Where the contacts of every class end in the lists of a block. All are empty where there is one class.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Ends {
    /// In `Block::pairs`.
    pub pairs: Vec<u32>,
    /// In `Block::near`.
    pub near: Vec<u32>,
    /// In `Block::walls`.
    pub walls: Vec<u32>,
    /// In `Block::near_walls`.
    pub near_walls: Vec<u32>,
}

/// Where class number `class` is in a list of `count` contacts.
pub fn part(ends: &[u32], class: usize, count: usize) -> Range<usize> {
    if ends.is_empty() {
        return 0..count;
    }
    let start = class.checked_sub(1).map_or(0, |before| ends[before] as usize);
    start..ends[class] as usize
}

/// The class of the contact at `place`.
fn class_at(ends: &[u32], place: usize) -> usize {
    ends.partition_point(|&end| end as usize <= place)
}

/// Sorts `contacts` by their classes; those of one class keep their order. Returns where each class ends.
fn sort(contacts: &mut Vec<[u32; 2]>, count: usize, class: impl Fn(&[u32; 2]) -> usize, ends: &mut Vec<u32>) {
    let mut next = vec![0u32; count + 1];
    for contact in contacts.iter() {
        next[class(contact) + 1] += 1;
    }
    for c in 0..count {
        next[c + 1] += next[c];
    }
    ends.clear();
    ends.extend(&next[1..]);
    let mut sorted = vec![[0; 2]; contacts.len()];
    for contact in contacts.iter() {
        let place = &mut next[class(contact)];
        sorted[*place as usize] = *contact;
        *place += 1;
    }
    *contacts = sorted;
}

impl Lists {
    /// Sorts the contacts of all blocks by `classes`. `materials` are those of the bodies of the rank by
    /// local index; where it is empty, no body has a material.
    ///
    /// The lists must be new: no contact has a row, and no near ones have been picked.
    pub fn sort_by_class(&mut self, classes: &Classes, materials: &[u32]) {
        if classes.count() == 1 {
            self.blocks.iter_mut().for_each(|block| block.ends = Ends::default());
            return;
        }
        threads::each(&mut self.blocks, &|block: &mut Block| block.sort_by_class(classes, materials));
    }
}

impl Block {
    fn sort_by_class(&mut self, classes: &Classes, materials: &[u32]) {
        let (count, none) = (classes.count(), classes.without_material());
        let (mut pairs, mut walls) = (std::mem::take(&mut self.pairs), std::mem::take(&mut self.walls));
        let mut ends = std::mem::take(&mut self.ends);
        let material = |slot: u32| materials.get(self.index(slot)).copied().unwrap_or(none);
        let of_pair = |&[i, j]: &[u32; 2]| classes.of_pair(material(i), material(j));
        sort(&mut pairs, count, of_pair, &mut ends.pairs);
        let of_wall = |&[i, wall]: &[u32; 2]| classes.of_wall(material(i), wall as usize);
        sort(&mut walls, count, of_wall, &mut ends.walls);
        (self.pairs, self.walls, self.ends) = (pairs, walls, ends);
    }

    /// The near pairs of a class, as a range of `near`.
    pub fn near_of(&self, class: usize) -> Range<usize> {
        part(&self.ends.near, class, self.near.len())
    }

    /// The listed walls of a class, as a range of `walls`.
    pub fn walls_of(&self, class: usize) -> Range<usize> {
        part(&self.ends.walls, class, self.walls.len())
    }

    /// The class of the listed pair with the index `place`, or of the listed wall that follows all pairs.
    pub fn class_of(&self, place: usize) -> usize {
        match place.checked_sub(self.pairs.len()) {
            None => class_at(&self.ends.pairs, place),
            Some(wall) => class_at(&self.ends.walls, wall),
        }
    }

    /// Memory held by the ends of classes, bytes.
    pub fn bytes_of_ends(&self) -> usize {
        let Ends { pairs, near, walls, near_walls } = &self.ends;
        [pairs, near, walls, near_walls].map(Vec::capacity).iter().sum::<usize>() * size_of::<u32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::neighbors::{Key, Order, Reach};
    use crate::math::vector::Vec3;
    use crate::model::wall::Wall;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::collections::BTreeMap;

    /// For every particle its partners in the order in which it adds them: class and id; walls likewise.
    type Sums = BTreeMap<u64, [Vec<(usize, u64)>; 2]>;

    fn sums(lists: &Lists, keys: &[Key]) -> Sums {
        let mut found = Sums::new();
        for block in &lists.blocks {
            let id = |slot: u32| keys[block.index(slot)].1;
            for (place, &[i, j]) in block.pairs.iter().enumerate() {
                let class = block.class_of(place);
                for (own, other) in [(i, j), (j, i)] {
                    if block.owns(own) {
                        found.entry(id(own)).or_default()[0].push((class, id(other)));
                    }
                }
            }
            for (place, &[i, wall]) in block.walls.iter().enumerate() {
                let class = block.class_of(block.pairs.len() + place);
                found.entry(id(i)).or_default()[1].push((class, u64::from(wall)));
            }
        }
        found
    }

    #[test]
    fn every_particle_meets_its_partners_by_class_in_one_order_from_any_blocks() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let order = Order::new([1.0; 3], 0.3);
        let mut all: Vec<(Key, Vec3)> = (0..200)
            .map(|k| {
                let x = Vec3::from_fn(|_, _| random.random::<f64>());
                (order.key(&x, (k * 7919) % 10_007), x)
            })
            .collect();
        all.sort_unstable_by_key(|(key, _)| *key);
        let (keys, x): (Vec<Key>, Vec<Vec3>) = all.into_iter().unzip();
        let walls = [Wall::new(Vec3::zeros(), -Vec3::z()), Wall::new(Vec3::zeros(), -Vec3::x())];
        // Three materials and four classes.
        let classes = Classes::new(3, vec![0, 2, 1, 2, 3, 2, 1, 2, 0], vec![1, 0]);
        let materials: Vec<u32> = keys.iter().map(|(_, id)| (id % 3) as u32).collect();
        let of = |blocks: usize| {
            let mut lists = Lists::default();
            lists.rebuild(&x, &keys, x.len(), Reach::of_centres(0.3, 0.3), &walls, blocks);
            let unsorted = sums(&lists, &keys);
            lists.sort_by_class(&classes, &materials);
            (unsorted, sums(&lists, &keys))
        };
        let (plain, one) = of(1);
        let material = |id: u64| (id % 3) as u32;
        let mut met = [0; 4];
        for (id, [pairs, near_walls]) in &one {
            assert!(pairs.is_sorted_by_key(|(class, _)| class));
            for &(class, other) in pairs {
                assert_eq!(class, classes.of_pair(material(*id), material(other)));
                met[class] += 1;
            }
            for &(class, wall) in near_walls {
                assert_eq!(class, classes.of_wall(material(*id), wall as usize));
            }
            // Within a class the order is that without classes.
            for (before, after) in plain[id].iter().zip([pairs, near_walls]) {
                for class in 0..4 {
                    let own = |(_, other): &&(usize, u64)| match std::ptr::eq(after, pairs) {
                        true => classes.of_pair(material(*id), material(*other)) == class,
                        false => classes.of_wall(material(*id), *other as usize) == class,
                    };
                    let expected: Vec<u64> = before.iter().filter(own).map(|(_, other)| *other).collect();
                    let found = after.iter().filter(|(c, _)| *c == class);
                    assert_eq!(found.map(|(_, other)| *other).collect::<Vec<_>>(), expected);
                }
            }
        }
        assert!(met.iter().all(|&met| met > 20), "{met:?}");
        for blocks in [2, 3, 7] {
            assert_eq!(of(blocks).1, one, "{blocks}");
        }
    }

    #[test]
    fn near_contacts_of_every_class_are_found_where_the_ends_say() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let order = Order::new([1.0; 3], 0.3);
        let mut all: Vec<(Key, Vec3)> = (0..300)
            .map(|id| {
                let x = Vec3::from_fn(|_, _| random.random::<f64>());
                (order.key(&x, id), x)
            })
            .collect();
        all.sort_unstable_by_key(|(key, _)| *key);
        let (keys, x): (Vec<Key>, Vec<Vec3>) = all.into_iter().unzip();
        let walls = [Wall::new(Vec3::zeros(), -Vec3::z())];
        let classes = Classes::new(2, vec![0, 1, 1, 2], vec![1]);
        let materials: Vec<u32> = keys.iter().map(|(_, id)| (id % 2) as u32).collect();
        let mut lists = Lists::default();
        lists.rebuild(&x, &keys, x.len(), Reach::of_centres(0.3, 0.3), &walls, 1);
        lists.sort_by_class(&classes, &materials);
        let block = &mut lists.blocks[0];
        block.pick_near(&x, Reach::of_centres(0.2, 0.1), &walls);
        let mut seen = 0;
        for class in 0..3 {
            for &[i, j] in &block.near[block.near_of(class)] {
                let [a, b] = [i, j].map(|slot| materials[block.index(slot)]);
                assert_eq!(classes.of_pair(a, b), class);
                seen += 1;
            }
        }
        assert_eq!((seen, seen < block.pairs.len()), (block.near.len(), true));
        // Every batch has one class, and its horizon.
        let batches: usize = (0..3).map(|c| block.near_of(c).len().div_ceil(128)).sum();
        assert_eq!(block.horizon.len(), batches);
        // No sphere of material 0 is of class 0 or 2 at the wall of material 1, and none of material 1 of 1.
        let ends = &block.ends.near_walls;
        assert_eq!((part(ends, 0, 0).len(), ends[2] as usize), (0, block.near_walls.len()));
        assert!(!part(ends, 1, 0).is_empty() && !part(ends, 2, 0).is_empty());
    }
}
