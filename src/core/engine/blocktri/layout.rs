//! Where each entry of a block-tridiagonal matrix lies in memory.

use super::{BlockTriError, Levels};

/// Storage map of a block-tridiagonal matrix.
///
/// Row-major band of variable width: the row at a position of level i holds the columns of levels i-1, i, i+1 and, as room for the
/// fill of a row exchange, i+2. Rows of adjacent levels are thereby aligned column by column.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    pub(super) levels: Levels,
    /// Per position: first stored column, one past the last column of the pattern, offset of the first stored column.
    pub(super) rows: Vec<Row>,
    pub(super) len: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub first: usize,
    pub end: usize,
    pub offset: usize,
}

impl Row {
    /// Offset of column position `column`, which must be at or after `first`.
    #[inline(always)]
    pub fn at(self, column: usize) -> usize {
        self.offset + (column - self.first)
    }
}

/// Where a dense block over a few degrees of freedom lies (one connector's, one part's), for [`super::BlockTri::add_block`]: a few bytes
/// where a list of slots would be longer than the block and, in a long chain, would be read from far away at every assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Number of each free coordinate in the block, and its position in the matrix.
    pub(super) places: Vec<(u32, u32)>,
}

impl Layout {
    /// Storage map for an ordering.
    pub fn new(levels: Levels) -> Self {
        let (mut rows, mut offset) = (Vec::with_capacity(levels.n()), 0);
        for level in 0..levels.count() {
            let first = if level > 0 && levels.linked(level - 1) { levels.start[level - 1] } else { levels.start[level] };
            let end = levels.reach(level);
            let room = if levels.linked(level) { levels.reach(level + 1) } else { end };
            for _ in 0..levels.size(level) {
                rows.push(Row { first, end, offset });
                offset += room - first;
            }
        }
        Self { levels, rows, len: offset }
    }

    /// The ordering.
    pub fn levels(&self) -> &Levels {
        &self.levels
    }

    /// Number of dofs.
    pub fn n(&self) -> usize {
        self.rows.len()
    }

    /// Storage slot of entry (i, j), in the caller's dof numbers, for assembly in loops by [`super::BlockTri::add_at`].
    ///
    /// # Errors
    /// [`BlockTriError::NoSuchDof`], or [`BlockTriError::OutsidePattern`] where i and j lie more than one level apart.
    pub fn slot(&self, i: usize, j: usize) -> Result<usize, BlockTriError> {
        let n = self.n();
        if let Some(dof) = [i, j].into_iter().find(|&d| d >= n) {
            return Err(BlockTriError::NoSuchDof { dof, n });
        }
        let (row, column) = (self.rows[self.levels.position[i]], self.levels.position[j]);
        if column < row.first || column >= row.end {
            return Err(BlockTriError::OutsidePattern { row: i, column: j });
        }
        Ok(row.at(column))
    }

    /// The block over `dofs`, in the caller's dof numbers; `None` is a coordinate that does not move and has no row.
    ///
    /// # Errors
    /// As [`Layout::slot`], of every pair.
    pub fn block(&self, dofs: impl IntoIterator<Item = Option<usize>>) -> Result<Block, BlockTriError> {
        let free: Vec<(usize, usize)> = dofs.into_iter().enumerate().filter_map(|(k, dof)| Some((k, dof?))).collect();
        for (_, i) in &free {
            for (_, j) in &free {
                self.slot(*i, *j)?;
            }
        }
        Ok(Block { places: free.into_iter().map(|(k, dof)| (k as u32, self.levels.position[dof] as u32)).collect() })
    }
}
