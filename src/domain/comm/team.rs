//! Ranks as threads of one process: unit tests run code for several ranks without MPI.

use super::{Comm, Parcels};
use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::Duration;

/// What all ranks of a team share.
struct Table {
    size: usize,
    state: Mutex<State>,
    bell: Condvar,
}

#[derive(Default)]
struct State {
    posts: Vec<Option<Vec<u64>>>,
    readers: usize,
    letters: HashMap<(usize, usize), Vec<Vec<f64>>>,
}

struct Member<'a> {
    rank: usize,
    table: &'a Table,
}

/// Runs `work` on each of `size` ranks, and waits for all of them.
pub fn team(size: usize, work: impl Fn(&dyn Comm) + Sync) {
    let state = State { posts: vec![None; size], ..State::default() };
    let table = Table { size, state: Mutex::new(state), bell: Condvar::new() };
    std::thread::scope(|scope| {
        for rank in 0..size {
            let (table, work) = (&table, &work);
            scope.spawn(move || work(&Member { rank, table }));
        }
    });
}

impl Member<'_> {
    /// Waits until `ready`. If a rank never arrives, the test fails instead of hanging.
    fn wait(&self, ready: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let mut state = self.table.state.lock().unwrap();
        while !ready(&state) {
            let (next, timeout) = self.table.bell.wait_timeout(state, Duration::from_secs(20)).unwrap();
            assert!(!timeout.timed_out(), "rank {} waits for a rank that does not come", self.rank);
            state = next;
        }
        state
    }

    /// The `own` of every rank, by rank.
    fn share(&self, own: Vec<u64>) -> Vec<Vec<u64>> {
        let mut state = self.wait(|state| state.posts[self.rank].is_none());
        state.posts[self.rank] = Some(own);
        drop(state);
        self.table.bell.notify_all();
        let mut state = self.wait(|state| state.posts.iter().all(Option::is_some));
        let all = state.posts.iter().flatten().cloned().collect();
        state.readers += 1;
        if state.readers == self.table.size {
            state.readers = 0;
            state.posts.fill(None);
        }
        drop(state);
        self.table.bell.notify_all();
        all
    }
}

fn words(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

impl Comm for Member<'_> {
    fn rank(&self) -> usize {
        self.rank
    }
    fn size(&self) -> usize {
        self.table.size
    }
    fn max(&self, values: &mut [f64]) {
        for own in self.share(words(values)) {
            values.iter_mut().zip(own).for_each(|(x, y)| *x = x.max(f64::from_bits(y)));
        }
    }
    fn sum(&self, counts: &mut [u64]) {
        let all = self.share(counts.to_vec());
        counts.fill(0);
        for own in all {
            counts.iter_mut().zip(own).for_each(|(x, y)| *x = x.wrapping_add(y));
        }
    }
    fn all_gather(&self, own: &[f64], all: &mut [f64]) {
        let flat = self.share(words(own)).concat();
        all.iter_mut().zip(flat).for_each(|(x, y)| *x = f64::from_bits(y));
    }
    fn transpose(&self, to: &[u64]) -> Vec<u64> {
        self.share(to.to_vec()).iter().map(|row| row[self.rank]).collect()
    }
    fn exchange_during(&self, outgoing: &Parcels, incoming: &mut Parcels, work: &mut dyn FnMut()) {
        let mut state = self.table.state.lock().unwrap();
        for (q, parcel) in outgoing.iter() {
            state.letters.entry((self.rank, q)).or_default().push(parcel.to_vec());
        }
        drop(state);
        self.table.bell.notify_all();
        work();
        for (k, &q) in incoming.ranks.iter().enumerate() {
            let key = (q, self.rank);
            let mut state = self.wait(|state| state.letters.get(&key).is_some_and(|box_| !box_.is_empty()));
            let parcel = state.letters.get_mut(&key).unwrap().remove(0);
            incoming.data[incoming.bounds[k]..incoming.bounds[k + 1]].copy_from_slice(&parcel);
        }
    }
    fn broadcast(&self, bytes: &mut Vec<u8>) {
        let own = bytes.iter().map(|&b| u64::from(b)).collect();
        *bytes = self.share(own)[0].iter().map(|&word| word as u8).collect();
    }
    fn ranks_on_node(&self) -> usize {
        self.table.size
    }
    fn abort(&self, code: i32) -> ! {
        panic!("rank {} aborts with {code}", self.rank)
    }
}
