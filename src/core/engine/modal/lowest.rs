//! Undamped modes of a large model without a matrix of all its degrees of freedom: `K x = w^2 M x` with `K` and `M` block tridiagonal.
//!
//! How many lie below a frequency is the number of negative eigenvalues of `K - w^2 M` (Sturm count), found block by block at a cost that is linear in
//! the number of parts. Shapes come from subspace iteration on `(K - s M)^-1 M` (Bathe and Wilson), which stops when as many have converged as the counts say
//! there are: none is missed, and multiple ones are found as often as they are there.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::parallel;

use super::super::EngineError;
use super::super::blocktri::{BlockTri, BlockTriError, Layout};
use super::Start;

/// An entry of a symmetric matrix; both triangles are listed.
pub(super) type Entry = (usize, usize, f64);

/// Modes that are looked for about one shift.
const SLICE: usize = 40;
/// Relative change of an eigenvalue at which it has converged. The damped iteration makes it exact.
const CONVERGED: f64 = 1e-9;
/// Iterations of a subspace at most; it takes 10 to 40.
const ITERATIONS: usize = 300;
/// Directions of a subspace that are told apart, by the part of the largest.
const APART: f64 = 1e-13;
/// Part of the highest eigenvalue below which one is that of a rigid body, zero but for rounding.
pub(super) const NOTHING: f64 = 1e-12;
/// Halvings of an interval of eigenvalues at most: beyond them its ends are the same number.
const HALVINGS: usize = 60;

/// Stiffness and mass of the undamped structure.
pub(super) struct Pencil {
    stiffness: Vec<Entry>,
    mass: Vec<Entry>,
    layout: Arc<Layout>,
    /// Level of each degree of freedom, and its number there.
    place: Vec<(usize, usize)>,
}

/// Eigenvalues and shapes of a subspace.
struct Ritz {
    values: Vec<f64>,
    shapes: DMatrix<f64>,
}

impl Pencil {
    pub fn new(stiffness: Vec<Entry>, mass: Vec<Entry>, layout: Arc<Layout>) -> Pencil {
        let mut place = vec![(0, 0); layout.n()];
        for level in 0..layout.levels().count() {
            layout.levels().dofs(level).iter().enumerate().for_each(|(k, dof)| place[*dof] = (level, k));
        }
        Pencil { stiffness: summed(stiffness), mass: summed(mass), layout, place }
    }

    /// Number of eigenvalues below `shift`.
    pub fn below(&self, shift: f64) -> Result<usize, EngineError> {
        let shifted = self.mass.iter().map(|(i, j, m)| (*i, *j, -shift * m));
        self.negative(self.stiffness.iter().copied().chain(shifted)).map(|(negative, _)| negative)
    }

    fn has_mass(&self) -> Vec<bool> {
        let mut has = vec![false; self.layout.n()];
        self.mass.iter().filter(|e| e.0 == e.1 && e.2 > 0.0).for_each(|e| has[e.0] = true);
        has
    }

    /// Number of degrees of freedom with mass.
    pub fn heavy(&self) -> usize {
        self.has_mass().into_iter().filter(|h| *h).count()
    }

    /// The first degree of freedom without mass.
    pub fn light(&self) -> Option<usize> {
        self.has_mass().iter().position(|h| !h)
    }

    /// Whether what has no mass is held by springs, and what has some has it in every direction.
    pub fn follows(&self) -> Result<bool, EngineError> {
        let has = self.has_mass();
        let alone = |d: usize| (d, d, 1.0);
        let light = self.stiffness.iter().copied().filter(|e| !has[e.0] && !has[e.1]);
        let (a, b) = self.negative(light.chain((0..has.len()).filter(|d| has[*d]).map(alone)))?;
        let heavy = self.mass.iter().copied().filter(|e| has[e.0] && has[e.1]);
        let (c, d) = self.negative(heavy.chain((0..has.len()).filter(|d| !has[*d]).map(alone)))?;
        Ok(a + b + c + d == 0)
    }

    /// Numbers of negative eigenvalues and of those that are zero, by block elimination (Sylvester's law of inertia).
    fn negative(&self, entries: impl Iterator<Item = Entry>) -> Result<(usize, usize), EngineError> {
        let levels = self.layout.levels();
        let size = |l: usize| levels.size(l);
        let mut own: Vec<DMatrix<f64>> = (0..levels.count()).map(|l| DMatrix::zeros(size(l), size(l))).collect();
        let next = |l: usize| if levels.linked(l) { size(l + 1) } else { 0 };
        let mut below: Vec<DMatrix<f64>> = (0..levels.count()).map(|l| DMatrix::zeros(next(l), size(l))).collect();
        for (i, j, x) in entries {
            let ((of_row, r), (of_column, c)) = (self.place[i], self.place[j]);
            if of_row == of_column {
                own[of_row][(r, c)] += x;
            } else if of_row == of_column + 1 {
                below[of_column][(r, c)] += x;
            }
        }
        let (mut negative, mut zero) = (0, 0);
        for l in 0..levels.count() {
            if l % 64 == 0 && parallel::given_up() {
                return Err(EngineError::GivenUp);
            }
            let eigen = std::mem::take(&mut own[l]).symmetric_eigen();
            negative += eigen.eigenvalues.iter().filter(|e| **e < 0.0).count();
            zero += eigen.eigenvalues.iter().filter(|e| **e == 0.0).count();
            if levels.linked(l) {
                let turned = &below[l] * &eigen.eigenvectors;
                // A pivot of zero stands for the smallest positive one.
                let scaled = DMatrix::from_fn(turned.nrows(), turned.ncols(), |r, c| {
                    let e = eigen.eigenvalues[c];
                    turned[(r, c)] / if e == 0.0 { f64::MIN_POSITIVE.sqrt() } else { e }
                });
                own[l + 1] -= scaled * turned.transpose();
            }
        }
        Ok((negative, zero))
    }

    /// An eigenvalue bound above which there is none, at most a tenth above the highest.
    pub fn highest(&self, count: usize) -> Result<f64, EngineError> {
        let size = |entries: &[Entry]| entries.iter().filter(|e| e.0 == e.1).map(|e| e.2.abs()).sum::<f64>();
        let (k, m) = (size(&self.stiffness), size(&self.mass));
        let mut high = if k > 0.0 && m > 0.0 { k / m } else { 1.0 };
        let mut low = 0.0;
        for _ in 0..HALVINGS {
            if self.below(high)? >= count {
                break;
            }
            (low, high) = (high, 4.0 * high);
        }
        while high > 1.1 * low {
            let middle = if low == 0.0 { high / 16.0 } else { (low * high).sqrt() };
            if self.below(middle)? >= count {
                high = middle
            } else {
                low = middle
            }
            if high < f64::MIN_POSITIVE.sqrt() {
                break;
            }
        }
        Ok(high)
    }

    /// The lowest modes, at least `wanted` of the `all` that there are, in the order of their frequencies. `highest`: a bound of the eigenvalues.
    pub fn lowest(&self, wanted: usize, all: usize, highest: f64) -> Result<Vec<Start>, EngineError> {
        let wanted = wanted.min(all);
        let (mut low, mut high) = (0.0, highest);
        for _ in 0..HALVINGS {
            let middle = if low == 0.0 { high / 16.0 } else { f64::sqrt(low * high) };
            let there = self.below(middle)?;
            if there < wanted {
                low = middle;
            } else {
                high = middle;
                if there <= wanted + wanted / 2 {
                    break;
                }
            }
        }
        self.between(-NOTHING * highest, high)
    }

    /// The modes with eigenvalues from `low` to `high`.
    pub fn between(&self, low: f64, high: f64) -> Result<Vec<Start>, EngineError> {
        let mut found = Vec::new();
        self.slices((low, self.below(low)?), (high, self.below(high)?), HALVINGS, &mut found)?;
        found.sort_by(|a: &Start, b: &Start| a.omega.total_cmp(&b.omega));
        Ok(found)
    }

    /// Cuts an interval until each part holds few eigenvalues; ends with the numbers below them.
    fn slices(&self, low: (f64, usize), high: (f64, usize), depth: usize, found: &mut Vec<Start>) -> Result<(), EngineError> {
        let count = high.1.saturating_sub(low.1);
        if count == 0 {
            return Ok(());
        }
        if count <= SLICE || depth == 0 {
            found.extend(self.slice(low.0, high.0, count)?);
            return Ok(());
        }
        // Beside the middle, where symmetric structures have none.
        let middle = low.0 + 0.49 * (high.0 - low.0);
        let there = self.below(middle)?;
        self.slices(low, (middle, there), depth - 1, found)?;
        self.slices((middle, there), high, depth - 1, found)
    }

    /// The `count` modes between two eigenvalues.
    fn slice(&self, low: f64, high: f64, count: usize) -> Result<Vec<Start>, EngineError> {
        let n = self.layout.n();
        // Below the lowest where that is in sight, so that what is solved is positive definite; else within, beside the middle.
        let shift = if low <= 0.0 { low.min(-1e-3 * high) } else { low + 0.497 * (high - low) };
        let mut matrix = BlockTri::<f64>::new(self.layout.clone());
        let shifted = self.mass.iter().map(|(i, j, m)| (*i, *j, -shift * m));
        for (i, j, x) in self.stiffness.iter().copied().chain(shifted) {
            matrix.add(i, j, x)?;
        }
        matrix.factor()?;
        let heavy = self.mass.iter().filter(|e| e.0 == e.1 && e.2 > 0.0).count();
        let columns = (count + count.div_ceil(2).max(8)).min(heavy);
        let mut random = ChaCha8Rng::seed_from_u64(count as u64);
        let mut x = DMatrix::from_fn(n, columns, |_, _| random.random_range(-1.0..1.0));
        let slack = CONVERGED * high.abs().max(low.abs());
        let mut last: Vec<f64> = vec![];
        for _ in 0..ITERATIONS {
            if parallel::given_up() {
                return Err(EngineError::GivenUp);
            }
            let ritz = self.iterate(&mut matrix, shift, x)?;
            let mut inside: Vec<usize> =
                (0..ritz.values.len()).filter(|k| ritz.values[*k] >= low - slack && ritz.values[*k] <= high + slack).collect();
            // One that lies at an end belongs to either side; those within come first.
            inside.sort_by(|a, b| (ritz.values[*a] - shift).abs().total_cmp(&(ritz.values[*b] - shift).abs()));
            inside.truncate(count);
            inside.sort_unstable_by(|a, b| ritz.values[*a].total_cmp(&ritz.values[*b]));
            let now: Vec<f64> = inside.iter().map(|k| ritz.values[*k]).collect();
            let stands = |(a, b): (&f64, &f64)| (a - b).abs() <= slack;
            if now.len() == count && last.len() == count && now.iter().zip(&last).all(stands) {
                let start =
                    |k: &usize| Start { omega: ritz.values[*k].max(0.0).sqrt(), shape: ritz.shapes.column(*k).iter().copied().collect() };
                return Ok(inside.iter().map(start).collect());
            }
            (last, x) = (now, ritz.shapes);
        }
        Err(EngineError::NoMode { frequency: shift.abs().sqrt() / std::f64::consts::TAU, residual: slack })
    }

    /// One step of inverse iteration with all columns of `x`, and the best shapes in what it gives (`X' M X = 1`).
    fn iterate(&self, matrix: &mut BlockTri<f64>, shift: f64, x: DMatrix<f64>) -> Result<Ritz, EngineError> {
        let load = self.times_mass(&x);
        let mut y = load.clone();
        matrix.solve(y.as_mut_slice())?;
        // Columns of unit size: those next to the shift are larger by orders.
        for mut column in y.column_iter_mut() {
            let size = column.norm();
            if size > 0.0 {
                column /= size;
            }
        }
        let heavy = self.times_mass(&y);
        let (sizes, directions) = eigen(y.tr_mul(&heavy))?;
        let largest = sizes.last().copied().unwrap_or(0.0);
        let kept: Vec<usize> = (0..sizes.len()).filter(|k| sizes[*k] > APART * largest).collect();
        let scaled = |k: &usize| directions.column(*k) / sizes[*k].sqrt();
        let basis = DMatrix::from_columns(&kept.iter().map(scaled).collect::<Vec<DVector<f64>>>());
        let y = y * basis;
        let (values, turned) = eigen(y.tr_mul(&self.times(&y, shift)))?;
        Ok(Ritz { values: values.iter().map(|v| v + shift).collect(), shapes: y * turned })
    }

    fn times_mass(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        product(&self.mass, 1.0, x, DMatrix::zeros(x.nrows(), x.ncols()))
    }

    /// `(K - shift M) x`
    fn times(&self, x: &DMatrix<f64>, shift: f64) -> DMatrix<f64> {
        product(&self.mass, -shift, x, product(&self.stiffness, 1.0, x, DMatrix::zeros(x.nrows(), x.ncols())))
    }

    /// Where an eigenvalue below `shift` moves most: the shape of the lowest one.
    pub fn unstable(&self, shift: f64) -> Result<Option<Vec<f64>>, EngineError> {
        let count = self.below(shift)?;
        if count == 0 {
            return Ok(None);
        }
        let mut low = 4.0 * shift;
        for _ in 0..HALVINGS {
            if self.below(low)? == 0 {
                break;
            }
            low *= 4.0;
        }
        match self.slice(low, shift, count.min(SLICE)) {
            Ok(shapes) => Ok(shapes.into_iter().next().map(|s| s.shape)),
            Err(EngineError::Linear(BlockTriError::Singular { .. }) | EngineError::NoMode { .. }) => Ok(Some(vec![])),
            Err(e) => Err(e),
        }
    }
}

/// Entries of one place added up.
fn summed(mut entries: Vec<Entry>) -> Vec<Entry> {
    entries.sort_by_key(|e| (e.0, e.1));
    entries.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        kept.2 += if same { next.2 } else { 0.0 };
        same
    });
    entries
}

/// Eigenvalues of a symmetric matrix, the lowest first, and the columns of its eigenvectors.
pub(super) fn eigen(m: DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>), EngineError> {
    let n = m.nrows();
    let m = (&m + m.transpose()) * 0.5;
    if let Some(at) = m.iter().position(|x| !x.is_finite()) {
        return Err(BlockTriError::NotFinite { dof: at % n }.into());
    }
    let found = m.symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| found.eigenvalues[*a].total_cmp(&found.eigenvalues[*b]));
    let vectors = found.eigenvectors.select_columns(&order);
    Ok((order.iter().map(|k| found.eigenvalues[*k]).collect(), vectors))
}

/// `to + factor A x`
fn product(entries: &[Entry], factor: f64, x: &DMatrix<f64>, mut to: DMatrix<f64>) -> DMatrix<f64> {
    for c in 0..x.ncols() {
        let (from, mut to) = (x.column(c), to.column_mut(c));
        entries.iter().for_each(|(i, j, a)| to[*i] += factor * a * from[*j]);
    }
    to
}
