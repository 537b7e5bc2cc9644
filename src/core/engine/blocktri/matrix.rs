//! A block-tridiagonal matrix: assembly and factorisation.

use std::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use std::sync::Arc;

use num_complex::Complex;

use super::lanes::widest;
use super::{Block, BlockTriError, Layout};

/// Number type of a matrix entry: `f64` or `Complex<f64>`.
pub trait Entry:
    Copy
    + Send
    + Sync
    + std::fmt::Debug
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// |x|, up to a factor of sqrt(2) (|re| + |im| for complex numbers), as pivot searches need it.
    fn magnitude(self) -> f64;
    /// 1/x.
    fn reciprocal(self) -> Self;
}

impl Entry for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn magnitude(self) -> f64 {
        self.abs()
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        1.0 / self
    }
}

impl Entry for Complex<f64> {
    const ZERO: Self = Complex { re: 0.0, im: 0.0 };
    const ONE: Self = Complex { re: 1.0, im: 0.0 };
    #[inline(always)]
    fn magnitude(self) -> f64 {
        self.re.abs() + self.im.abs()
    }
    #[inline(always)]
    fn reciprocal(self) -> Self {
        self.inv()
    }
}

/// The pivot that was smallest against the largest entry its row had: how near to singular, and at which dof.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeakestPivot {
    /// Dof in the caller's numbering.
    pub dof: usize,
    /// |pivot| / largest |entry| of its row before elimination.
    pub ratio: f64,
}

/// A pivot in its own level is kept while it is at least this fraction of the best one in the column, both scaled by their rows.
const KEEP_LEVEL: f64 = 0.1;
/// Scaled pivots at or below this are rounding of zero. A chain of N beams has honest pivots near N^-4, so it stands close to the
/// unit roundoff.
const SINGULAR: f64 = 16.0 * f64::EPSILON;

/// Block-tridiagonal matrix with its LU factors in place; nothing is allocated after construction.
///
/// Symmetry is not assumed. Elimination goes level by level with row-scaled partial pivoting inside the diagonal block; only where
/// that block offers no pivot within a factor 10 of the column's best (a constraint's zero diagonal, a sub-chain at its own
/// resonance) is a row of the next level exchanged in, for which the storage keeps room. Element growth is thus bounded as in a
/// banded LU, at the cost of a block one: about sum n_i^3 for level sizes n_i.
#[derive(Debug, Clone)]
pub struct BlockTri<T> {
    pub(super) layout: Arc<Layout>,
    pub(super) values: Vec<T>,
    /// Position exchanged with each position at its elimination.
    pub(super) exchange: Vec<usize>,
    pub(super) inverse: Vec<T>,
    /// One past the last column of the factor's rows, per level.
    pub(super) width: Vec<usize>,
    pub(super) work: Vec<T>,
    pub(super) factored: bool,
    scale: Vec<f64>,
}

impl<T: Entry> BlockTri<T> {
    /// A zero matrix.
    pub fn new(layout: Arc<Layout>) -> Self {
        let (n, len, levels) = (layout.n(), layout.len, layout.levels().count());
        Self {
            layout,
            values: vec![T::ZERO; len],
            exchange: vec![0; n],
            inverse: vec![T::ZERO; n],
            width: vec![0; levels],
            work: vec![T::ZERO; n * super::solve::COLUMNS],
            scale: vec![0.0; n],
            factored: false,
        }
    }

    /// The storage map.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.values.fill(T::ZERO);
        self.factored = false;
    }

    /// Adds `value` to entry (i, j). In loops use [`Layout::slot`] once and [`BlockTri::add_at`].
    ///
    /// # Errors
    /// As [`Layout::slot`].
    pub fn add(&mut self, i: usize, j: usize, value: T) -> Result<(), BlockTriError> {
        let slot = self.layout.slot(i, j)?;
        self.add_at(slot, value);
        Ok(())
    }

    /// Adds `value` at a slot of this matrix's [`Layout::slot`]; a foreign slot is a programming error and may panic.
    #[inline]
    pub fn add_at(&mut self, slot: usize, value: T) {
        self.values[slot] += value;
        self.factored = false;
    }

    /// Adds `entry(i, j)` over a block of this matrix's [`Layout::block`]; a foreign block is a programming error and may panic.
    #[inline]
    pub fn add_block(&mut self, block: &Block, entry: impl Fn(usize, usize) -> T) {
        for &(i, row) in &block.places {
            let row = self.layout.rows[row as usize];
            let values = &mut self.values[row.offset..];
            for &(j, column) in &block.places {
                values[column as usize - row.first] += entry(i as usize, j as usize);
            }
        }
        self.factored = false;
    }

    /// Factors in place, P A = L U. The entries are lost: `clear` and assemble before the next one.
    ///
    /// # Errors
    /// [`BlockTriError::Singular`] naming the dof whose column offers no pivot; [`BlockTriError::NotFinite`].
    pub fn factor(&mut self) -> Result<WeakestPivot, BlockTriError> {
        self.factored = false;
        self.scale_rows()?;
        let weakest = eliminated(self)?;
        self.factored = true;
        Ok(weakest)
    }

    fn scale_rows(&mut self) -> Result<(), BlockTriError> {
        for (position, row) in self.layout.rows.iter().enumerate() {
            let (mut largest, mut sum) = (0.0f64, 0.0f64);
            for v in &self.values[row.offset..row.at(row.end)] {
                let size = v.magnitude();
                largest = largest.max(size);
                sum += size;
            }
            let dof = self.layout.levels.order[position];
            if !sum.is_finite() {
                return Err(BlockTriError::NotFinite { dof });
            }
            if largest == 0.0 {
                return Err(BlockTriError::Singular { dof, pivot: 0.0 });
            }
            self.scale[position] = 1.0 / largest;
        }
        Ok(())
    }

    #[inline(always)]
    fn eliminate(&mut self) -> Result<WeakestPivot, BlockTriError> {
        let layout = Arc::clone(&self.layout);
        let (levels, rows) = (&layout.levels, &layout.rows);
        let mut weakest = WeakestPivot { dof: 0, ratio: f64::INFINITY };
        for level in 0..levels.count() {
            let (begin, end, reach) = (levels.start[level], levels.start[level + 1], levels.reach(level));
            let far = if levels.linked(level) { levels.reach(level + 1) } else { reach };
            let mut width = reach;
            for k in begin..end {
                let (pivot, ratio) = self.find_pivot(rows, k, end, reach);
                let dof = levels.order[k];
                if ratio.is_nan() || ratio <= SINGULAR {
                    return Err(BlockTriError::Singular { dof, pivot: ratio });
                }
                if ratio < weakest.ratio {
                    weakest = WeakestPivot { dof, ratio };
                }
                self.exchange[k] = pivot;
                if pivot != k {
                    if pivot >= end {
                        width = far;
                    }
                    let (upper, lower) = self.values.split_at_mut(rows[pivot].offset);
                    let lower_first = rows[pivot].at(begin) - rows[pivot].offset;
                    let span = width - begin;
                    upper[rows[k].at(begin)..][..span].swap_with_slice(&mut lower[lower_first..][..span]);
                    self.scale.swap(k, pivot);
                }
                let inverse = self.values[rows[k].at(k)].reciprocal();
                self.inverse[k] = inverse;
                let span = width - k - 1;
                for r in k + 1..reach {
                    let (upper, lower) = self.values.split_at_mut(rows[r].offset);
                    let source = &upper[rows[k].at(k) + 1..][..span];
                    let target = &mut lower[rows[r].at(k) - rows[r].offset..][..span + 1];
                    if target[0] == T::ZERO {
                        continue;
                    }
                    let factor = target[0] * inverse;
                    target[0] = factor;
                    let target = &mut target[1..];
                    for c in 0..span {
                        target[c] -= factor * source[c];
                    }
                }
            }
            self.width[level] = width;
        }
        Ok(weakest)
    }

    /// Row of the pivot of column k and its size against its row's scale; the level's own rows are preferred.
    #[inline(always)]
    fn find_pivot(&self, rows: &[super::layout::Row], k: usize, end: usize, reach: usize) -> (usize, f64) {
        let (mut own, mut own_size) = (k, -1.0);
        for r in k..end {
            let size = self.values[rows[r].at(k)].magnitude() * self.scale[r];
            if size > own_size {
                (own, own_size) = (r, size);
            }
        }
        let (mut next, mut next_size) = (k, -1.0);
        for r in end..reach {
            let size = self.values[rows[r].at(k)].magnitude() * self.scale[r];
            if size > next_size {
                (next, next_size) = (r, size);
            }
        }
        if own_size >= KEEP_LEVEL * next_size { (own, own_size) } else { (next, next_size) }
    }
}

impl BlockTri<f64> {
    /// Sign of the determinant of a factored matrix, 0 of one that is not factored. A symmetric matrix whose determinant is negative has
    /// an odd number of negative eigenvalues.
    pub fn determinant_sign(&self) -> f64 {
        if !self.factored {
            return 0.0;
        }
        let swaps = self.exchange.iter().enumerate().filter(|(k, p)| k != *p).count();
        let negative = self.inverse.iter().filter(|d| **d < 0.0).count();
        if (swaps + negative).is_multiple_of(2) { 1.0 } else { -1.0 }
    }
}

widest! {
    fn eliminated[T: Entry](matrix: &mut BlockTri<T>) -> Result<WeakestPivot, BlockTriError> {
        matrix.eliminate()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Levels;
    use super::*;

    #[test]
    fn a_block_adds_what_its_entries_do() {
        // Two blocks that overlap in degrees of freedom out of order; coordinate 1 of each does not move.
        let dofs = [[Some(4), None, Some(0), Some(3)], [Some(1), None, Some(4), Some(2)]];
        let pairs: Vec<_> = dofs.iter().flat_map(|d| d.iter().flatten().flat_map(|i| d.iter().flatten().map(|j| (*i, *j)))).collect();
        let layout = Arc::new(Layout::new(Levels::new(5, &pairs).unwrap()));
        let entry = |i: usize, j: usize| if i == j { 9.0 } else { 0.3 * i as f64 - 0.7 * j as f64 };
        let (mut at_once, mut one_by_one) = (BlockTri::<f64>::new(layout.clone()), BlockTri::<f64>::new(layout.clone()));
        for d in &dofs {
            at_once.add_block(&layout.block(*d).unwrap(), entry);
            for (i, a) in d.iter().enumerate() {
                for (j, b) in d.iter().enumerate() {
                    if let (Some(a), Some(b)) = (a, b) {
                        one_by_one.add(*a, *b, entry(i, j)).unwrap();
                    }
                }
            }
        }
        let solved = |mut m: BlockTri<f64>| {
            let mut x = [1.0, -2.0, 3.0, 0.5, 4.0];
            m.factor().unwrap();
            m.solve(&mut x).unwrap();
            x
        };
        assert_eq!(solved(at_once), solved(one_by_one));
    }
}
