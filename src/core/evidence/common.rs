//! What instruments misread in all tests alike. One sensor with its amplifier reads every test of a channel: its calibration, its zero and its
//! characteristic are the same in all of them, and what changes from test to test (mounting, temperature, zeroing) is another part of what it may be off by.
//!
//! A misreading of variance 1 in its tolerance is `sqrt(q) x + sqrt(1 - q) x_t`, `x` the same in all tests of the channel, `x_t` each test's own, both N(0, 1), q
//! [`super::Settings::instruments_common`]. Were all of it each test's own, a shift of a fraction of the tolerance that all tests show would be as many facts as there
//! are tests: a chain of rigid parts was given a spring that is not there, since it moves the means of fifteen loops by a few hundredths of a per cent, all alike.

use nalgebra::DMatrix;

use crate::response::Misreading;

use super::{Evidence, Record};

/// Misreadings that tests have in common.
pub(super) struct Common {
    /// Of each test the columns of its instruments that are common, and which of all of them each is.
    of: Vec<Vec<(usize, usize)>>,
    /// How many there are.
    pub count: usize,
    part: f64,
}

impl Common {
    /// Those of these tests. What one test alone reads is its own.
    pub fn of(e: &Evidence) -> Common {
        let part = e.settings.instruments_common;
        let mut names: Vec<(Name, usize)> = Vec::new();
        let all: Vec<Vec<(usize, usize)>> = e.records.iter().map(|r| named(r, &mut names)).collect();
        let mut kept = 0;
        let places: Vec<Option<usize>> = names
            .iter()
            .map(|(_, tests)| {
                let place = (*tests > 1 && part > 0.0).then_some(kept);
                kept += usize::from(place.is_some());
                place
            })
            .collect();
        let of = all.into_iter().map(|of| of.into_iter().filter_map(|(column, k)| Some((column, places[k]?))).collect()).collect();
        Common { of, count: kept, part }
    }

    /// The columns that the coefficients of a test share, of what is common the part that is its own.
    pub fn own(&self, test: usize, mut shared: DMatrix<f64>) -> DMatrix<f64> {
        self.of[test].iter().for_each(|(column, _)| shared.column_mut(*column).scale_mut((1.0 - self.part).sqrt()));
        shared
    }

    /// The part of a test's columns that is common, one column for each of all tests.
    pub fn columns(&self, test: usize, record: &Record) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(record.noise.len(), self.count);
        for (from, to) in &self.of[test] {
            columns.set_column(*to, &(record.instruments.columns.column(*from) * self.part.sqrt()));
        }
        columns
    }

    /// The squares `A'WA` of a test's columns `A = [X, B]`, X of `n`, as those of `[X, C, B]`: a column of C is one of B.
    pub fn squares(&self, test: usize, squares: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
        if self.count == 0 {
            return squares.clone();
        }
        let mut from: Vec<(Option<usize>, f64)> = (0..n).map(|k| (Some(k), 1.0)).collect();
        from.resize(n + self.count, (None, 0.0));
        from.extend((n..squares.ncols()).map(|k| (Some(k), 1.0)));
        for (column, to) in &self.of[test] {
            from[n + to] = (Some(n + column), self.part.sqrt());
            from[n + self.count + column].1 = (1.0 - self.part).sqrt();
        }
        let lower = |i: usize, k: usize| squares[(i.max(k), i.min(k))];
        DMatrix::from_fn(from.len(), from.len(), |i, k| match (from[i], from[k]) {
            ((Some(a), f), (Some(b), g)) if i >= k => f * g * lower(a, b),
            _ => 0.0,
        })
    }
}

/// Channel, misreading, and which of several of that kind.
type Name = (String, Misreading, usize);

/// Columns of a test's instruments that other tests may have as well, with their place among the names. Counts the tests of each.
fn named(record: &Record, names: &mut Vec<(Name, usize)>) -> Vec<(usize, usize)> {
    let of = &record.instruments.of;
    let alike = |column: usize| of[..column].iter().filter(|(block, what, _)| (*block, *what) == (of[column].0, of[column].1)).count();
    let common = (0..of.len()).filter(|k| matches!(of[*k].1, Misreading::Gain | Misreading::Offset | Misreading::Bend));
    let mut places = Vec::new();
    for column in common {
        let name = (record.channels[of[column].0].label.clone(), of[column].1, alike(column));
        let place = names.iter().position(|(n, _)| *n == name).unwrap_or(names.len());
        if place == names.len() {
            names.push((name, 0));
        }
        names[place].1 += 1;
        places.push((column, place));
    }
    places
}
