//! The constant part of Z(w): which real numbers multiply which coefficients at which entry.

use super::{BlockTriError, Layout, Levels};

/// A scalar element: the coefficient z_g(w) of its group multiplies the rank-one pattern b b'.
///
/// For the connector axis between two bodies `row` is the relative displacement b'q = q_to - q_from in that axis, so +1 at `to` and
/// -1 at `from` where the frames are aligned, with arms and rotations otherwise; z is then the axis's complex dynamic stiffness
/// in N/m (or N m/rad). Elements of equal coefficient share one group.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Index of the coefficient.
    pub group: usize,
    /// Sparse row b as (dof, value).
    pub row: Vec<(usize, f64)>,
}

/// One entry of Z: stiffness, mass and where its element terms start.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Slot {
    pub stiffness: f64,
    pub mass: f64,
    pub first_term: usize,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Term {
    pub group: usize,
    pub value: f64,
}

/// Entries of the lower triangle level by level: the packed triangle of the diagonal block by rows, then the rows of the next level
/// under it, see [`row_start`]. One closing slot ends the list of terms.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub slots: Vec<Slot>,
    pub terms: Vec<Term>,
    /// First slot of each level, and the end.
    pub base: Vec<usize>,
    /// Elements with positions in place of dofs.
    pub elements: Vec<Element>,
    pub groups: usize,
}

/// Offset of row `r` in the panel of a level of size `n`; rows from `n` on belong to the next level.
#[inline(always)]
pub(super) fn row_start(r: usize, n: usize) -> usize {
    if r < n { r * (r + 1) / 2 } else { n * (n + 1) / 2 + (r - n) * n }
}

/// Sparse symmetric matrix: both triangles, repetitions add up.
pub(super) type Triplets<'a> = &'a [(usize, usize, f64)];

impl Table {
    pub fn new(n: usize, stiffness: Triplets, mass: Triplets, elements: &[Element]) -> Result<(Layout, Self), BlockTriError> {
        let mut pairs: Vec<_> = stiffness.iter().chain(mass).map(|&(i, j, _)| (i, j)).collect();
        for element in elements {
            // A chain through the row's dofs would connect them, but only all pairs put them into adjacent levels.
            for (at, &(i, _)) in element.row.iter().enumerate() {
                pairs.extend(element.row[at..].iter().map(|&(j, _)| (i, j)));
            }
        }
        let layout = Layout::new(Levels::new(n, &pairs)?);
        let base = level_bases(&layout.levels);
        let end = base[base.len() - 1];
        let mut table = Self { slots: vec![Slot::default(); end + 1], terms: Vec::new(), base, elements: Vec::new(), groups: 0 };
        for (i, j, v) in lower("stiffness", stiffness)? {
            let slot = table.slot_of(&layout.levels, i, j);
            table.slots[slot].stiffness += v;
        }
        for (i, j, v) in lower("mass", mass)? {
            let slot = table.slot_of(&layout.levels, i, j);
            table.slots[slot].mass += v;
        }
        table.add_elements(&layout.levels, elements)?;
        Ok((layout, table))
    }

    fn slot_of(&self, levels: &Levels, i: usize, j: usize) -> usize {
        let (p, q) = (levels.position[i], levels.position[j]);
        let (row, column) = (p.max(q), p.min(q));
        let level = levels.start.partition_point(|&s| s <= column) - 1;
        let first = levels.start[level];
        self.base[level] + row_start(row - first, levels.size(level)) + column - first
    }

    fn add_elements(&mut self, levels: &Levels, elements: &[Element]) -> Result<(), BlockTriError> {
        let mut raw = Vec::new();
        for element in elements {
            self.groups = self.groups.max(element.group + 1);
            for (at, &(i, a)) in element.row.iter().enumerate() {
                if !a.is_finite() {
                    return Err(BlockTriError::NotFinite { dof: i });
                }
                for (later, &(j, b)) in element.row[at..].iter().enumerate() {
                    // A dof named twice in a row: both cross products fall on the same entry.
                    let twice = if i == j && later > 0 { 2.0 } else { 1.0 };
                    raw.push((self.slot_of(levels, i, j), element.group, twice * a * b));
                }
            }
            let row = element.row.iter().map(|&(dof, v)| (levels.position[dof], v)).collect();
            self.elements.push(Element { group: element.group, row });
        }
        raw.sort_by_key(|&(slot, group, _)| (slot, group));
        let mut at = 0;
        for slot in 0..self.slots.len() {
            self.slots[slot].first_term = self.terms.len();
            let first = self.terms.len();
            while let Some(&(_, group, value)) = raw.get(at).filter(|r| r.0 == slot) {
                at += 1;
                match self.terms[first..].last_mut() {
                    Some(last) if last.group == group => last.value += value,
                    _ if value != 0.0 => self.terms.push(Term { group, value }),
                    _ => {}
                }
            }
        }
        Ok(())
    }
}

fn level_bases(levels: &Levels) -> Vec<usize> {
    let mut base = vec![0];
    for level in 0..levels.count() {
        let n = levels.size(level);
        let below = levels.reach(level) - levels.start[level + 1];
        base.push(base[level] + row_start(n + below, n));
    }
    base
}

/// Entries on and below the diagonal of a matrix that must be symmetric to rounding.
fn lower(matrix: &'static str, entries: Triplets) -> Result<Vec<(usize, usize, f64)>, BlockTriError> {
    let mut sorted: Vec<_> = entries.iter().map(|&(i, j, v)| (i.max(j), i.min(j), i < j, v)).collect();
    sorted.sort_by_key(|&(i, j, upper, _)| (i, j, upper));
    let mut result = Vec::new();
    for same in sorted.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (i, j) = (same[0].0, same[0].1);
        let sum = |upper: bool| same.iter().filter(|e| e.2 == upper).map(|e| e.3).sum::<f64>();
        let (value, mirrored) = (sum(false), sum(true));
        let size: f64 = same.iter().map(|e| e.3.abs()).sum();
        if !size.is_finite() {
            return Err(BlockTriError::NotFinite { dof: i });
        }
        if i != j && (value - mirrored).abs() > 1e-12 * size {
            return Err(BlockTriError::Unsymmetric { matrix, row: i, column: j, value, mirrored });
        }
        result.push((i, j, value));
    }
    Ok(result)
}
