//! The memories of contacts as a whole: how they follow their particles, and how they are saved.
//!
//! In the state a memory belongs to a row of `engine::forces`. Between lists, ranks and processes it belongs
//! to two ids: a record holds it for the contact as the particle with the lower id sees it.

use super::Dynamics;
use crate::domain::{Comm, Parcels};
use crate::engine::forces::{FREE, RowContact};
use crate::math::larger;
use crate::ode::{Segment, StepStart};
use rustc_hash::FxHashMap;

/// The contacts of the rows.
#[derive(Debug, Default)]
pub(super) struct Contacts {
    /// Ids of the first and the second body of every row, see [`RowContact`].
    pub(super) keys: Vec<[u64; 2]>,
    /// Whether the row is counted here. Over all ranks every contact counts once.
    pub(super) counted: Vec<bool>,
    /// The class of the contact of every row.
    pub(super) classes: Vec<u32>,
}

impl Contacts {
    fn of(rows: &[RowContact]) -> Self {
        let mut contacts = Contacts::default();
        contacts.resize(rows.len());
        rows.iter().enumerate().for_each(|(row, contact)| contacts.set(row, contact));
        contacts
    }

    fn resize(&mut self, rows: usize) {
        let RowContact { key, counted, class } = RowContact::NONE;
        self.keys.resize(rows, key);
        self.counted.resize(rows, counted);
        self.classes.resize(rows, class);
    }

    fn set(&mut self, row: usize, &RowContact { key, counted, class }: &RowContact) {
        (self.keys[row], self.counted[row], self.classes[row]) = (key, counted, class);
    }

    /// The class of the contact of a row.
    pub(super) fn class(&self, row: usize) -> usize {
        self.classes[row] as usize
    }
}

/// Memories of contacts in some vectors, by ids.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ContactRecords {
    /// Number of vectors.
    vectors: usize,
    /// Numbers of the memory of a contact in a vector.
    memory: usize,
    /// The lower and the higher id of each; a wall counts from `FIRST_WALL` on.
    keys: Vec<[u64; 2]>,
    /// For each the memory in every vector.
    numbers: Vec<f64>,
}

/// The `memory` of a contact as the particle with the lower id sees it, or back: the same seen from the other
/// body if the first body of `key` has the higher id.
///
/// Threes of its numbers are vectors, which change sign; what is left over does not.
pub(super) fn seen_by_lower(key: [u64; 2], memory: &[f64]) -> impl Iterator<Item = f64> {
    let vectors = if key[0] > key[1] { memory.len() / 3 * 3 } else { 0 };
    memory.iter().enumerate().map(move |(k, &number)| if k < vectors { -number } else { number })
}

fn sorted(key: [u64; 2]) -> [u64; 2] {
    [key[0].min(key[1]), key[0].max(key[1])]
}

impl ContactRecords {
    /// The given `rows` of the `tails` of some vectors. `keys` are those of all rows.
    fn of(rows: impl Iterator<Item = usize>, keys: &[[u64; 2]], tails: &[&[f64]], memory: usize) -> Self {
        let mut records = ContactRecords { vectors: tails.len(), memory, ..Self::default() };
        records.keys.reserve(keys.len());
        records.numbers.reserve(keys.len() * records.width());
        for row in rows {
            records.keys.push(sorted(keys[row]));
            for tail in tails {
                let own = &tail[row * memory..(row + 1) * memory];
                records.numbers.extend(seen_by_lower(keys[row], own));
            }
        }
        records
    }

    /// The contacts with these `keys`, each once, in the order of their keys.
    fn ascending(keys: &[[u64; 2]]) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..keys.len()).filter(|&row| keys[row] != FREE).collect();
        rows.sort_unstable_by_key(|&row| sorted(keys[row]));
        // A pair of two blocks has two rows with the same numbers.
        rows.dedup_by_key(|row| sorted(keys[*row]));
        rows
    }

    /// Numbers of a record.
    fn width(&self) -> usize {
        self.vectors * self.memory
    }

    /// Sends every record to the ranks that will own its particles. Collective.
    ///
    /// Particle `ids[i]` of this rank goes to rank `owners[i]`.
    pub fn follow(&mut self, comm: &dyn Comm, ids: &[u64], owners: &[usize]) {
        if comm.size() == 1 {
            return;
        }
        let owner: FxHashMap<u64, usize> = ids.iter().copied().zip(owners.iter().copied()).collect();
        let targets = |key: &[u64; 2]| {
            let [a, b] = key.map(|id| owner.get(&id).copied());
            [a, b.filter(|_| a != b)].into_iter().flatten()
        };
        self.exchange(comm, &targets);
    }

    /// Sends every record to all ranks. Collective.
    pub fn share(&mut self, comm: &dyn Comm) {
        self.exchange(comm, &|_| 0..comm.size());
    }

    /// Sends every record to its targets, and keeps those whose targets include this rank.
    fn exchange<T: Iterator<Item = usize>>(&mut self, comm: &dyn Comm, targets: &dyn Fn(&[u64; 2]) -> T) {
        let (own, parcel) = (comm.rank(), 2 + self.width());
        let mut to: Vec<Vec<f64>> = vec![Vec::new(); comm.size()];
        for (key, numbers) in self.keys.iter().zip(self.numbers.chunks_exact(self.width().max(1))) {
            for rank in targets(key) {
                // Ids are sent as doubles, which are exact below 2^53.
                to[rank].extend(key.map(|id| id as f64));
                to[rank].extend_from_slice(numbers);
            }
        }
        let mut all = std::mem::take(&mut to[own]);
        let counts: Vec<u64> = to.iter().map(|numbers| numbers.len() as u64).collect();
        let mut incoming = Parcels::with_counts(&comm.transpose(&counts));
        let mut outgoing = Parcels::with_counts(&counts);
        outgoing.data = to.concat();
        comm.exchange(&outgoing, &mut incoming);
        all.extend_from_slice(&incoming.data);
        let mut parcels: Vec<&[f64]> = all.chunks_exact(parcel).collect();
        let key = |parcel: &[f64]| [parcel[0] as u64, parcel[1] as u64];
        parcels.sort_by_key(|parcel| key(parcel));
        parcels.dedup_by_key(|parcel| key(parcel));
        self.keys = parcels.iter().map(|parcel| key(parcel)).collect();
        self.numbers = parcels.iter().flat_map(|parcel| &parcel[2..]).copied().collect();
    }

    /// The records as a table with one row for each of the particles `ids`: for every contact whose `host`
    /// the particle is, the other id plus 1 and the numbers; then zeros. Collective.
    ///
    /// The host is one of the two ids of a contact, a particle; the same on all ranks. Also returns the
    /// number of contacts for which a row has room.
    fn table(&self, comm: &dyn Comm, ids: &[u64], host: &dyn Fn([u64; 2]) -> u64) -> (usize, Vec<f64>) {
        let place: FxHashMap<u64, usize> = ids.iter().copied().zip(0..).collect();
        let mut counts = vec![0; ids.len()];
        let own = self.keys.iter().filter_map(|key| place.get(&host(*key)));
        own.for_each(|&i| counts[i] += 1);
        let mut most = [counts.iter().fold(0.0, |most, &count| larger(most, f64::from(count)))];
        comm.max(&mut most);
        let (slots, slot) = (most[0] as usize, 1 + self.width());
        let mut table = vec![0.0; ids.len() * slots * slot];
        let mut next: Vec<usize> = (0..ids.len()).map(|i| i * slots * slot).collect();
        for (key, numbers) in self.keys.iter().zip(self.numbers.chunks_exact(self.width().max(1))) {
            let host = host(*key);
            if let Some(&i) = place.get(&host) {
                let other = if host == key[0] { key[1] } else { key[0] };
                table[next[i]] = (other + 1) as f64;
                table[next[i] + 1..next[i] + slot].copy_from_slice(numbers);
                next[i] += slot;
            }
        }
        (slots, table)
    }

    /// The records in the rows of a table for the particles from `first` on, with `slots` contacts of some
    /// `vectors` in each row.
    pub fn from_table(first: u64, table: &[f64], slots: usize, [vectors, memory]: [usize; 2]) -> Self {
        let slot = 1 + vectors * memory;
        let mut records = ContactRecords { vectors, memory, ..Self::default() };
        for (id, row) in (first..).zip(table.chunks_exact((slots * slot).max(1))) {
            for numbers in row.chunks_exact(slot).filter(|numbers| numbers[0] > 0.0) {
                records.keys.push(sorted([id, numbers[0] as u64 - 1]));
                records.numbers.extend_from_slice(&numbers[1..]);
            }
        }
        records
    }
}

impl Dynamics<'_> {
    /// Numbers of a vector that belong to the particles.
    pub fn particle_numbers(&self) -> usize {
        self.layout.whole(0).len
    }

    /// From now on contacts have a memory while their gap is at most `gap` (m) at an accepted state.
    pub fn remember_within(&mut self, gap: f64) {
        self.forces.remember_within(gap);
    }

    /// Gives a memory of 0 to the contacts within reach at `y`, which gets their rows. Collective.
    pub fn start_contacts(&mut self, y: &mut Vec<f64>) {
        if self.forces.memory_width() == 0 {
            return;
        }
        self.put_bodies(y);
        self.forces.find_contacts();
        self.take_contacts(vec![(y, false)]);
    }

    /// Takes over the contacts of a newly accepted state, which the last trial has found.
    pub fn follow_contacts(&mut self, step_start: &mut StepStart) {
        let StepStart { y, slope, slope_known, direction, direction_known, .. } = step_start;
        let vectors = [(y, true, false), (slope, *slope_known, true), (direction, *direction_known, false)];
        let known = vectors.into_iter().filter(|(_, known, _)| *known);
        self.take_contacts(known.map(|(vector, _, is_slope)| (vector, is_slope)).collect());
    }

    /// Brings rows to the contacts that were found. Each of the `vectors` gets 0 for a new contact, or its
    /// rate if it is a slope.
    fn take_contacts(&mut self, vectors: Vec<(&mut Vec<f64>, bool)>) {
        let Some(turnover) = self.forces.take_contacts(&self.domain.ids) else { return };
        let (particles, width) = (self.particle_numbers(), self.forces.memory_width());
        for (vector, is_slope) in vectors {
            if let Some([before, after]) = &turnover.grown {
                let old = vector.split_off(particles);
                for (ends, end) in before.windows(2).zip(&after[1..]) {
                    vector.extend_from_slice(&old[ends[0] * width..ends[1] * width]);
                    vector.resize(particles + end * width, 0.0);
                }
            }
            let rows = &mut vector[particles..];
            turnover.freed.iter().for_each(|row| rows[row * width..][..width].fill(0.0));
            if is_slope {
                let rates = turnover.first_rates.chunks_exact(width);
                for ((row, _), rates) in turnover.taken.iter().zip(rates) {
                    rows[row * width..][..width].copy_from_slice(rates);
                }
            }
        }
        let contacts = &mut self.contacts;
        if let Some([before, after]) = &turnover.grown {
            let old = std::mem::take(contacts);
            for (ends, end) in before.windows(2).zip(&after[1..]) {
                contacts.keys.extend_from_slice(&old.keys[ends[0]..ends[1]]);
                contacts.counted.extend_from_slice(&old.counted[ends[0]..ends[1]]);
                contacts.classes.extend_from_slice(&old.classes[ends[0]..ends[1]]);
                contacts.resize(*end);
            }
        }
        turnover.freed.iter().for_each(|&row| contacts.set(row, &RowContact::NONE));
        turnover.taken.iter().for_each(|(row, contact)| contacts.set(*row, contact));
        self.note_rows();
    }

    /// Takes note of the number of rows.
    fn note_rows(&mut self) {
        let rows = self.contacts.keys.len();
        self.layout.0.truncate(1);
        self.layout.0.push(Segment { rows, width: self.forces.memory_width(), positions: 0 });
    }

    /// Takes the memories out of some vectors, which then hold particles only.
    pub(super) fn take_records(&self, vectors: &mut [&mut Vec<f64>]) -> ContactRecords {
        let particles = self.particle_numbers();
        let tails: Vec<&[f64]> = vectors.iter().map(|vector| &vector[particles..]).collect();
        let Contacts { keys, counted, .. } = &self.contacts;
        // Of two rows of a contact one rank takes the one that counts. Of several ranks each knows where one
        // of the particles goes, and `exchange` leaves one record of a contact.
        let several = self.domain.comm.size() > 1;
        let rows = (0..keys.len()).filter(|&row| keys[row] != FREE && (several || counted[row]));
        let records = ContactRecords::of(rows, keys, &tails, self.forces.memory_width());
        vectors.iter_mut().for_each(|vector| vector.truncate(particles));
        records
    }

    /// Puts the memories of `records` to the ends of the vectors, in place of what is there, for the contacts
    /// on new lists.
    pub(super) fn put_records(&mut self, records: &ContactRecords, vectors: &mut [&mut Vec<f64>]) {
        if self.forces.memory_width() == 0 {
            return;
        }
        let place: FxHashMap<[u64; 2], usize> = records.keys.iter().copied().zip(0..).collect();
        let mut records_of_rows: Vec<usize> = Vec::with_capacity(records.keys.len());
        // Almost surely all of these contacts are near. If not, look through all that are listed.
        for near in [true, false] {
            let (mut placed, mut left) = (vec![false; records.keys.len()], records.keys.len());
            records_of_rows.clear();
            let rows = self.forces.assign_rows(&self.domain.ids, near, &mut |key| {
                let Some(&record) = place.get(&sorted(key)) else { return false };
                left -= usize::from(!std::mem::replace(&mut placed[record], true));
                records_of_rows.push(record);
                true
            });
            self.contacts = Contacts::of(&rows);
            if left == 0 {
                break;
            }
        }
        self.note_rows();
        let width = records.width();
        for (k, vector) in vectors.iter_mut().enumerate() {
            vector.truncate(self.particle_numbers());
            let mut of_rows = records_of_rows.iter();
            for &key in &self.contacts.keys {
                if key == FREE {
                    vector.extend(std::iter::repeat_n(0.0, records.memory));
                } else if let Some(record) = of_rows.next() {
                    let start = record * width + k * records.memory;
                    vector.extend(seen_by_lower(key, &records.numbers[start..start + records.memory]));
                }
            }
        }
    }

    /// Puts back memories that were saved, to the ends of the vectors. Collective.
    pub fn restore_contacts(&mut self, mut records: ContactRecords, vectors: &mut [&mut Vec<f64>]) {
        records.share(self.domain.comm);
        self.put_records(&records, vectors);
    }

    /// The memories of contacts in some vectors as a table for a checkpoint; see `ContactRecords::table`.
    /// Collective.
    pub fn contact_table(&self, vectors: &[&[f64]]) -> ([usize; 2], Vec<f64>) {
        let memory = self.forces.memory_width();
        if memory == 0 {
            return ([0; 2], Vec::new());
        }
        let particles = self.particle_numbers();
        let tails: Vec<&[f64]> = vectors.iter().map(|vector| &vector[particles..]).collect();
        let keys = &self.contacts.keys;
        let rows = ContactRecords::ascending(keys);
        let records = ContactRecords::of(rows.into_iter(), keys, &tails, memory);
        // A small sphere has few contacts with larger ones, a large one may have hundreds with small ones.
        let sizes = self.forces.sizes();
        let place: FxHashMap<u64, usize> = match self.columns().sized() {
            true => self.domain.ids.iter().copied().zip(0..).collect(),
            false => FxHashMap::default(),
        };
        let r = |id: u64| place.get(&id).map_or(f64::INFINITY, |&i| sizes.of(i).r);
        let host = |[a, b]: [u64; 2]| if r(b) < r(a) { b } else { a };
        let (slots, table) = records.table(self.domain.comm, self.ids(), &host);
        ([slots, memory], table)
    }

    /// Energies that the memories at the end of `y` store, by row, J; 0 where another rank counts the
    /// contact.
    pub(super) fn stored_in_memories<'a>(&'a self, y: &'a [f64]) -> impl Fn(usize) -> f64 + Sync + use<'a> {
        let (contacts, laws) = (&self.contacts, &self.forces.laws);
        let (tail, width) = (&y[self.particle_numbers()..], self.forces.memory_width());
        move |row: usize| {
            if !contacts.counted[row] {
                return 0.0;
            }
            let stiffness = laws.stiffness(contacts.class(row));
            let numbers = tail[row * width..(row + 1) * width].iter().zip(stiffness);
            0.5 * numbers.fold(0.0, |sum, (number, stiffness)| sum + stiffness * (number * number))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;
    use crate::domain::rows;

    /// The contact of every particle with the next one but two, and of every fifth with a wall.
    fn contacts(count: u64) -> Vec<[u64; 2]> {
        let pairs = (0..count).filter(|id| id + 3 < count).map(|id| [id, id + 3]);
        pairs.chain((0..count).step_by(5).map(|id| [id, (1 << 52) + id % 2])).collect()
    }

    /// Shear and twisting.
    const MEMORY: usize = 4;

    /// The memory of a contact in vector `k`, as the lower id sees it.
    fn memory(key: [u64; 2], k: usize) -> [f64; MEMORY] {
        [key[0] as f64 + 0.5, (key[1] % 1000) as f64, k as f64 - 1.0, key[0] as f64 - 0.25]
    }

    /// Records of the contacts with a particle that `is_own`, from rows with the bodies in either order.
    fn records(count: u64, is_own: &dyn Fn(u64) -> bool) -> ContactRecords {
        let own = |key: &[u64; 2]| is_own(key[0]) || key[1] < count && is_own(key[1]);
        let keys = contacts(count).into_iter().filter(own);
        let flip = |key: [u64; 2]| if key[1] < count && key[0] % 2 == 1 { [key[1], key[0]] } else { key };
        // A pair of two blocks has two rows.
        let keys: Vec<[u64; 2]> = keys.flat_map(|key| [flip(key), flip(key)]).collect();
        let tail = |k: usize| -> Vec<f64> {
            // Seen from the other body a vector is reversed, and a twist is the same.
            let seen = |key: [u64; 2]| {
                let [x, y, z, twist] = memory(sorted(key), k);
                if key[0] > key[1] { [-x, -y, -z, twist] } else { [x, y, z, twist] }
            };
            keys.iter().flat_map(|&key| seen(key)).collect()
        };
        let rows = ContactRecords::ascending(&keys);
        ContactRecords::of(rows.into_iter(), &keys, &[&tail(0), &tail(1)], MEMORY)
    }

    #[test]
    fn records_follow_both_of_their_particles() {
        for ranks in 1..=4 {
            team(ranks, |comm| {
                let before = |id: u64| (id * 7 % ranks as u64) as usize;
                let after = |id: u64| (id * 5 % 11 % ranks as u64) as usize;
                let ids: Vec<u64> = (0..50).filter(|&id| before(id) == comm.rank()).collect();
                let owners: Vec<usize> = ids.iter().map(|&id| after(id)).collect();
                let mut found = records(50, &|id| before(id) == comm.rank());
                found.follow(comm, &ids, &owners);
                assert_eq!(found, records(50, &|id| after(id) == comm.rank()));
            });
        }
    }

    #[test]
    fn a_table_of_records_is_read_back_by_any_ranks() {
        for ranks in [1, 3] {
            team(ranks, |comm| {
                let own = |id: u64| (id % ranks as u64) as usize == comm.rank();
                let ids: Vec<u64> = (0..50).filter(|&id| own(id)).collect();
                // Whichever of the two particles holds a contact.
                let hosts: [&dyn Fn([u64; 2]) -> u64; 2] =
                    [&|[a, _]| a, &|[a, b]| if b < 50 && a % 3 == 0 { b } else { a }];
                for host in hosts {
                    let (slots, table) = records(50, &own).table(comm, &ids, host);
                    // A particle has the lower id in one pair and one wall at most, and the higher in one.
                    assert!((2..=3).contains(&slots), "{slots}");
                    let width = slots * (1 + 2 * MEMORY);
                    let by_id = rows::ById::new(comm, 50, &ids, &table, width);
                    let block: Vec<f64> = by_id.iter().flatten().copied().collect();
                    let first = rows::block(50, comm.rank(), ranks).start;
                    let mut found = ContactRecords::from_table(first, &block, slots, [2, MEMORY]);
                    found.share(comm);
                    assert_eq!(found, records(50, &|_| true));
                }
            });
        }
    }
}
