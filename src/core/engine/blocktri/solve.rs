//! Substitution with the factors of [`BlockTri`].

use std::sync::Arc;

use super::{BlockTri, BlockTriError, Entry};

/// Right-hand sides carried through one pass over the factors.
pub(super) const COLUMNS: usize = 4;

impl<T: Entry> BlockTri<T> {
    /// Solves A X = B in place: `rhs` holds whole columns of length n one after the other, in the caller's dof order.
    ///
    /// # Errors
    /// [`BlockTriError::NotFactored`], [`BlockTriError::Length`].
    pub fn solve(&mut self, rhs: &mut [T]) -> Result<(), BlockTriError> {
        let n = self.layout.n();
        if !self.factored {
            return Err(BlockTriError::NotFactored);
        }
        if n == 0 || !rhs.len().is_multiple_of(n) {
            return if rhs.is_empty() { Ok(()) } else { Err(BlockTriError::Length { len: rhs.len(), n }) };
        }
        self.passes(rhs, rhs.len() / n, |row, column| column * n + row);
        Ok(())
    }

    /// Solves A X = B in place: `rhs` holds n rows of `columns` entries one after the other, in the caller's dof order.
    ///
    /// # Errors
    /// [`BlockTriError::NotFactored`], [`BlockTriError::Length`].
    pub fn solve_rows(&mut self, rhs: &mut [T], columns: usize) -> Result<(), BlockTriError> {
        let n = self.layout.n();
        if !self.factored {
            return Err(BlockTriError::NotFactored);
        }
        if rhs.len() != n * columns {
            return Err(BlockTriError::Length { len: rhs.len(), n });
        }
        self.passes(rhs, columns, |row, column| row * columns + column);
        Ok(())
    }

    /// Carries the columns through the factors, [`COLUMNS`] at a time; `at` tells where an entry stands.
    fn passes(&mut self, rhs: &mut [T], columns: usize, at: impl Fn(usize, usize) -> usize) {
        let mut first = 0;
        while first < columns {
            if columns - first >= COLUMNS {
                self.columns::<COLUMNS>(rhs, |row, c| at(row, first + c));
                first += COLUMNS;
            } else {
                self.columns::<1>(rhs, |row, c| at(row, first + c));
                first += 1;
            }
        }
    }

    #[inline(always)]
    fn columns<const C: usize>(&mut self, rhs: &mut [T], at: impl Fn(usize, usize) -> usize) {
        let layout = Arc::clone(&self.layout);
        let n = layout.n();
        let (work, _) = self.work.as_chunks_mut::<C>();
        let order = &layout.levels.order;
        for k in 0..n {
            (0..C).for_each(|c| work[k][c] = rhs[at(order[k], c)]);
        }
        self.forward::<C>(&layout);
        self.backward::<C>(&layout);
        let (work, _) = self.work.as_chunks::<C>();
        for k in 0..n {
            (0..C).for_each(|c| rhs[at(order[k], c)] = work[k][c]);
        }
    }

    #[inline(always)]
    fn forward<const C: usize>(&mut self, layout: &super::Layout) {
        let (levels, rows) = (&layout.levels, &layout.rows);
        let (work, _) = self.work.as_chunks_mut::<C>();
        for level in 0..levels.count() {
            let (begin, end, reach) = (levels.start[level], levels.start[level + 1], levels.reach(level));
            for k in begin..end {
                work.swap(k, self.exchange[k]);
            }
            for r in begin + 1..reach {
                let to = r.min(end);
                let factors = &self.values[rows[r].at(begin)..rows[r].at(to)];
                let mut sum = work[r];
                let known = &work[begin..to];
                for k in 0..known.len() {
                    (0..C).for_each(|c| sum[c] -= factors[k] * known[k][c]);
                }
                work[r] = sum;
            }
        }
    }

    #[inline(always)]
    fn backward<const C: usize>(&mut self, layout: &super::Layout) {
        let (levels, rows) = (&layout.levels, &layout.rows);
        let (work, _) = self.work.as_chunks_mut::<C>();
        for level in (0..levels.count()).rev() {
            let width = self.width[level];
            for r in (levels.start[level]..levels.start[level + 1]).rev() {
                let factors = &self.values[rows[r].at(r) + 1..rows[r].at(width)];
                let mut sum = work[r];
                let known = &work[r + 1..width];
                for k in 0..known.len() {
                    (0..C).for_each(|c| sum[c] -= factors[k] * known[k][c]);
                }
                (0..C).for_each(|c| sum[c] *= self.inverse[r]);
                work[r] = sum;
            }
        }
    }
}
