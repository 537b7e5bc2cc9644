//! Tables of sines that many balances share. A fit makes thousands of balances of the same number of harmonics and samples.

use std::sync::{Arc, Mutex, PoisonError};

/// Tables by two sizes. Of more than a few, the one that was made first is forgotten.
pub(super) struct Shelf<T>(Mutex<Vec<Kept<T>>>);

/// The sizes of a table, and the table.
type Kept<T> = ((usize, usize), Arc<T>);

/// Tables kept: the tests of a study ask for a handful of sizes.
const MOST: usize = 12;

impl<T> Shelf<T> {
    pub const fn new() -> Self {
        Shelf(Mutex::new(Vec::new()))
    }

    /// The table of these sizes, made where it is not there.
    pub fn of(&self, sizes: (usize, usize), make: impl FnOnce() -> T) -> Arc<T> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, table)) = kept().iter().find(|(own, _)| *own == sizes) {
            return table.clone();
        }
        // Made outside the lock: two threads may make the same, and either serves.
        let table = Arc::new(make());
        let mut kept = kept();
        if kept.len() >= MOST {
            kept.remove(0);
        }
        kept.push((sizes, table.clone()));
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_made_once_and_the_oldest_is_forgotten() {
        let shelf = Shelf::new();
        let made = |n: usize| *shelf.of((n, 0), || 10 * n);
        assert_eq!((made(1), *shelf.of((1, 0), || 7)), (10, 10));
        (2..2 + MOST).for_each(|n| assert_eq!(made(n), 10 * n));
        assert_eq!((*shelf.of((1, 0), || 7), *shelf.of((1 + MOST, 0), || 7)), (7, 10 * (1 + MOST)));
    }
}
