//! Work spread over rayon's threads, results in order. One compiled loop serves them all: rayon's own adapters would be compiled anew for
//! every closure. Unlike theirs, nothing is left out after an error: what can fail returns it with the rest.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rayon::Yield;
use rayon::prelude::*;

/// When work under way is to be given up: a flag (Ctrl-C), a moment (`--max-seconds`). The default never ends.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    pub cancel: Option<Arc<AtomicBool>>,
    pub deadline: Option<Instant>,
}

impl Watch {
    pub fn ended(&self) -> bool {
        self.cancel.as_ref().is_some_and(|c| c.load(Ordering::Relaxed)) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}

thread_local! {
    static WATCH: RefCell<Watch> = RefCell::default();
}

/// Puts the earlier watch back, also when the work panics.
struct Kept(Watch);

impl Drop for Kept {
    fn drop(&mut self) {
        WATCH.with_borrow_mut(|w| std::mem::swap(w, &mut self.0));
    }
}

/// `work` under a watch: what it does in this module, on whatever thread, sees [`given_up`] when the watch has ended.
pub fn watched<T>(watch: &Watch, work: impl FnOnce() -> T) -> T {
    let _kept = Kept(WATCH.with_borrow_mut(|w| std::mem::replace(w, watch.clone())));
    work()
}

/// Whether the watch that this work stands under has ended. Long loops ask it at every step and return an error.
pub fn given_up() -> bool {
    WATCH.with_borrow(Watch::ended)
}

/// `work` at every index below `n`.
pub fn over<T: Send>(n: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let cells: Vec<Mutex<Option<T>>> = (0..n).map(|_| Mutex::new(None)).collect();
    let watch = WATCH.with_borrow(Watch::clone);
    each(n, &|k| {
        let value = watched(&watch, || work(k));
        if let Ok(mut cell) = cells[k].lock() {
            *cell = Some(value);
        }
    });
    // A cell stays empty, or is poisoned, only by a panic, which rayon has passed on.
    cells.into_iter().filter_map(|cell| cell.into_inner().ok().flatten()).collect()
}

/// `work` on every item.
pub fn map<I: Sync, T: Send>(items: &[I], work: impl Fn(&I) -> T + Sync) -> Vec<T> {
    over(items.len(), |k| work(&items[k]))
}

/// `work` on every item and its index, which are used up.
pub fn map_into<I: Send, T: Send>(items: Vec<I>, work: impl Fn(usize, I) -> T + Sync) -> Vec<T> {
    let cells: Vec<Mutex<Option<I>>> = items.into_iter().map(|i| Mutex::new(Some(i))).collect();
    let taken = |k: usize| cells[k].lock().ok().and_then(|mut cell| cell.take());
    over(cells.len(), |k| taken(k).map(|item| work(k, item))).into_iter().flatten().collect()
}

/// `work` on every item, in place.
pub fn for_each<I: Send>(items: &mut [I], work: impl Fn(&mut I) + Sync) {
    map_into(items.iter_mut().collect(), |_, item| work(item));
}

/// A caller that is no thread of the pool does its share: to wait until one that sleeps has woken costs as much as a short evaluation.
fn each(n: usize, work: &(dyn Fn(usize) + Sync)) {
    if rayon::current_thread_index().is_some() {
        return (0..n).into_par_iter().for_each(work);
    }
    let next = AtomicUsize::new(0);
    let take = || {
        let mut k = next.fetch_add(1, Ordering::Relaxed);
        while k < n {
            work(k);
            k = next.fetch_add(1, Ordering::Relaxed);
        }
    };
    rayon::in_place_scope(|scope| {
        (1..rayon::current_num_threads().min(n)).for_each(|_| scope.spawn(|_| take()));
        take();
    });
    (1..rayon::current_num_threads().min(n)).for_each(|_| stay_awake());
}

/// How long a thread of the pool stays awake for the next call from outside [s]. A program that drives the model, SciPy say, soon comes back, and a thread
/// that has been put to sleep meanwhile wakes too late for its share of a short evaluation. OpenMP's threads wait so, for longer.
const LINGER: Duration = Duration::from_micros(500);

/// Threads that stay awake.
static AWAKE: AtomicUsize = AtomicUsize::new(0);

/// One thread more looks for work until it finds some, unless all but the caller's do. The time is lent: whoever else can run on the core does.
fn stay_awake() {
    let others = rayon::current_num_threads() - 1;
    let one_more = |n: usize| (n < others).then_some(n + 1);
    if AWAKE.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).is_err() {
        return;
    }
    let until = Instant::now() + LINGER;
    rayon::spawn(move || {
        while Instant::now() < until && rayon::yield_now() != Some(Yield::Executed) {
            std::thread::yield_now();
        }
        AWAKE.fetch_sub(1, Ordering::Relaxed);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watch_is_seen_on_every_thread_and_only_inside() {
        let cancel = Arc::new(AtomicBool::new(false));
        let watch = Watch { cancel: Some(cancel.clone()), deadline: None };
        assert_eq!(watched(&watch, || over(50, |_| given_up())), vec![false; 50]);
        cancel.store(true, Ordering::Relaxed);
        assert_eq!(watched(&watch, || over(50, |_| over(2, |_| given_up())[1])), vec![true; 50]);
        assert!(!given_up() && Watch { cancel: None, deadline: Some(Instant::now()) }.ended());
    }

    #[test]
    fn a_panic_is_passed_on_from_whatever_thread() {
        for at in [0, 7] {
            let run = std::panic::catch_unwind(|| over(8, |k| assert_ne!(k, at, "it fell")));
            assert!(run.is_err());
        }
    }

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let squares: Vec<usize> = (0..1000).map(|k| k * k).collect();
        let items: Vec<usize> = (0..1000).collect();
        assert_eq!(over(1000, |k| k * k), squares);
        assert_eq!(map(&items, |i| i * i), squares);
        assert_eq!(map_into(items.clone(), |k, i| k * i), squares);
        let mut in_place = items;
        for_each(&mut in_place, |i| *i *= *i);
        assert_eq!(in_place, squares);
        assert!(over(0, |k| k).is_empty());
    }
}
