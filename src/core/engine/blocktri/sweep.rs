//! Frequency response of a symmetric block-tridiagonal system over many lines, with sensitivities.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

use num_complex::Complex;

use super::lanes::{C4, F4, WIDTH};
use super::symmetric::{Batch, Column, Plan};
use super::table::{Element, Table, row_start};
use super::{BlockTri, BlockTriError, Layout};
use crate::parallel;

type C64 = Complex<f64>;

/// Batches that pass a level together, so that the table of a long chain is read from memory once for all of them.
const TOGETHER: usize = 4;

/// Z(w) = K - w^2 M + sum_g z_g(w) sum_(e in g) b_e b_e', symmetric and sparse; e^{+i w t}, receptance H = Z^-1.
///
/// Lines are taken four at a time through a vectorised L D L' without pivoting whose accuracy is checked line by line; a line that
/// fails the check is done again by [`BlockTri`]. Cost per line: about 300 complex multiplications per level of six dofs.
#[derive(Debug)]
pub struct FrfSystem {
    layout: Arc<Layout>,
    table: Table,
    pool: Mutex<Vec<Workspace>>,
}

/// What to compute: lines, unit loads, responses.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    /// Angular frequencies in rad/s.
    pub omega: &'a [f64],
    /// Dofs of the unit loads.
    pub inputs: &'a [usize],
    /// Dofs of the responses.
    pub outputs: &'a [usize],
    /// Whether to compute dH/dz as well.
    pub sensitivities: bool,
}

/// Result of a sweep; kept and passed again, it is filled without allocation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Response {
    /// H, receptance in m/N (or rad/N, ...), as (line, input, output), the last fastest.
    pub h: Vec<C64>,
    /// dH/dz_g as (line, input, output, group), the last fastest; empty unless asked for.
    pub dh: Vec<C64>,
}

#[derive(Debug)]
struct Workspace {
    batches: Vec<Batch>,
    coefficients: Vec<C64>,
    /// For lines that need pivoting; made at the first one.
    pivoting: Option<BlockTri<C64>>,
    column: Vec<C64>,
}

impl FrfSystem {
    /// Orders and tabulates the constant matrices. `stiffness` and `mass` hold both triangles, repetitions add up.
    ///
    /// # Errors
    /// [`BlockTriError::NoSuchDof`], [`BlockTriError::Unsymmetric`], [`BlockTriError::NotFinite`].
    pub fn new(
        n: usize,
        stiffness: &[(usize, usize, f64)],
        mass: &[(usize, usize, f64)],
        elements: &[Element],
    ) -> Result<Self, BlockTriError> {
        let (layout, table) = Table::new(n, stiffness, mass, elements)?;
        Ok(Self { layout: Arc::new(layout), table, pool: Mutex::default() })
    }

    /// Storage map of the ordered system.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// Number of element groups, one more than the largest group index.
    pub fn groups(&self) -> usize {
        self.table.groups
    }

    /// Computes H at every line, and dH_oi/dz_g = -sum_(e in g) (b_e'X_o)(b_e'X_i) with Z X = E where asked for.
    ///
    /// `coefficients(w, z)` fills z_g(w) for all groups. With `outputs` = all dofs, H holds whole solution columns.
    ///
    /// # Errors
    /// [`BlockTriError::SingularLine`] at an undamped resonance or free mechanism, [`BlockTriError::CoefficientNotFinite`],
    /// [`BlockTriError::FrequencyNotFinite`], [`BlockTriError::NoSuchDof`]; the first line that fails is named.
    pub fn sweep<F>(&self, request: &Sweep, coefficients: F, response: &mut Response) -> Result<(), BlockTriError>
    where
        F: Fn(f64, &mut [C64]) + Sync,
    {
        let job = Job::new(self, request)?;
        let (per_line, per_line_dh) = (job.pairs.len(), if request.sensitivities { job.pairs.len() * self.table.groups } else { 0 });
        response.h.resize(request.omega.len() * per_line, C64::ZERO);
        response.dh.resize(request.omega.len() * per_line_dh, C64::ZERO);
        if per_line == 0 || request.omega.is_empty() {
            return Ok(());
        }
        // A few jobs per thread even out the load; each takes a workspace from the pool, so none is allocated per line.
        let share = request.omega.len().div_ceil(8 * rayon::current_num_threads());
        let lines = share.clamp(TOGETHER * WIDTH, 64).next_multiple_of(TOGETHER * WIDTH);
        let mut slopes = response.dh.chunks_mut((lines * per_line_dh).max(1));
        let chunks = request.omega.chunks(lines).zip(response.h.chunks_mut(lines * per_line));
        let chunks = chunks.map(|(omega, h)| (omega, h, slopes.next().unwrap_or_default())).collect();
        parallel::map_into(chunks, |_, (omega, h, dh)| job.run(omega, &coefficients, h, dh)).into_iter().collect()
    }

    #[cfg(test)]
    pub(super) fn table(&self) -> &Table {
        &self.table
    }

    fn workspace(&self) -> Workspace {
        let kept = self.pool.lock().ok().and_then(|mut pool| pool.pop());
        kept.unwrap_or_else(|| Workspace {
            batches: vec![Batch::new(&self.layout.levels, &self.table); TOGETHER],
            coefficients: vec![C64::ZERO; self.table.groups],
            pivoting: None,
            column: vec![C64::ZERO; self.layout.n()],
        })
    }
}

/// A sweep with its dofs turned into positions and columns.
struct Job<'a> {
    system: &'a FrfSystem,
    columns: Vec<Column>,
    /// Column of the input and, where the output has a column too, of the output, for every entry of a line of H.
    pairs: Vec<(usize, usize)>,
    /// Position of the output and column of the input, for every entry of a line of H.
    entries: Vec<(usize, usize)>,
    sensitivities: bool,
    keep: bool,
    last_wanted: usize,
}

impl<'a> Job<'a> {
    fn new(system: &'a FrfSystem, request: &Sweep) -> Result<Self, BlockTriError> {
        let (levels, n) = (&system.layout.levels, system.layout.n());
        if let Some(&dof) = request.inputs.iter().chain(request.outputs).find(|&&d| d >= n) {
            return Err(BlockTriError::NoSuchDof { dof, n });
        }
        if let Some(line) = request.omega.iter().position(|w| !w.is_finite()) {
            return Err(BlockTriError::FrequencyNotFinite { line });
        }
        let distinct = |dofs: &mut dyn Iterator<Item = &usize>| {
            let mut columns: Vec<_> = dofs.map(|&dof| Column::new(levels, dof)).collect();
            columns.sort_by_key(|c| c.position);
            columns.dedup();
            columns
        };
        let loads = distinct(&mut request.inputs.iter());
        let all = distinct(&mut request.inputs.iter().chain(request.outputs));
        let wanted = distinct(&mut request.outputs.iter());
        let last_wanted = if request.sensitivities { 0 } else { wanted.first().map_or(0, |c| c.level) };
        // Level substitutions of the two ways to H: forward with every column, or forward and back with the loads.
        let forward = |columns: &[Column]| columns.iter().map(|c| c.component.1 - c.level).sum::<usize>();
        let back: usize = loads.iter().map(|c| c.component.1 - c.component.0.max(last_wanted).min(c.component.1)).sum();
        // Keeping the factors costs about two substitutions per level in the second cache, six and more beyond it.
        let traffic = if system.table.slots.len() * size_of::<C4>() < 1 << 18 { 2 } else { 6 };
        let keep = request.sensitivities || forward(&all) > forward(&loads) + back + traffic * levels.count();
        // Sensitivities need the solution under a unit load at the output as well (Z is symmetric).
        let columns = if keep && !request.sensitivities { loads } else { all };
        let column_of = |dof: &usize| columns.iter().position(|c| c.position == levels.position[*dof]).unwrap_or(0);
        let each = || request.inputs.iter().flat_map(|i| request.outputs.iter().map(move |o| (i, o)));
        let pairs = each().map(|(i, o)| (column_of(i), column_of(o))).collect();
        let entries = each().map(|(i, o)| (levels.position[*o], column_of(i))).collect();
        Ok(Self { system, columns, pairs, entries, sensitivities: request.sensitivities, keep, last_wanted })
    }

    fn run<F>(&self, omega: &[f64], coefficients: &F, h: &mut [C64], dh: &mut [C64]) -> Result<(), BlockTriError>
    where
        F: Fn(f64, &mut [C64]),
    {
        let mut space = self.system.workspace();
        let result = self.run_in(&mut space, omega, coefficients, h, dh);
        if let Ok(mut pool) = self.system.pool.lock() {
            pool.push(space);
        }
        result
    }

    fn run_in<F>(&self, space: &mut Workspace, omega: &[f64], coefficients: &F, h: &mut [C64], dh: &mut [C64]) -> Result<(), BlockTriError>
    where
        F: Fn(f64, &mut [C64]),
    {
        let (levels, table) = (&self.system.layout.levels, &self.system.table);
        let (columns, pairs) = (self.columns.as_slice(), self.pairs.as_slice());
        let plan = Plan { levels, table, columns, pairs, keep: self.keep, last_wanted: self.last_wanted };
        // Kept factors of several batches would crowd the cache, and they outweigh the table.
        let together = if self.keep { 1 } else { TOGETHER };
        let (per_line, per_line_dh) = (self.pairs.len(), self.pairs.len() * table.groups);
        for (at, group) in omega.chunks(together * WIDTH).enumerate() {
            let count = group.len().div_ceil(WIDTH);
            for (batch, lines) in space.batches.iter_mut().zip(group.chunks(WIDTH)) {
                fill(batch, lines, coefficients, &mut space.coefficients)?;
            }
            Batch::solve(&mut space.batches[..count], &plan);
            for (sub, lines) in group.chunks(WIDTH).enumerate() {
                let suspect = space.batches[sub].suspect;
                for lane in (0..lines.len()).filter(|&l| suspect[l]) {
                    self.solve_pivoting(space, sub, lane, lines[lane])?;
                }
                let (batch, from) = (&mut space.batches[sub], (at * together + sub) * WIDTH);
                self.scatter(batch, lines.len(), &mut h[from * per_line..]);
                if self.sensitivities && per_line_dh > 0 {
                    batch.differentiate(&plan);
                    for (lane, line) in dh[from * per_line_dh..].chunks_exact_mut(per_line_dh).take(lines.len()).enumerate() {
                        line.iter_mut().zip(&batch.sensitivity).for_each(|(to, s)| *to = lane_of(s, lane));
                    }
                }
            }
        }
        Ok(())
    }

    fn scatter(&self, batch: &Batch, lines: usize, h: &mut [C64]) {
        let columns = self.columns.len();
        for (lane, line) in h.chunks_exact_mut(self.pairs.len()).take(lines).enumerate() {
            for (at, (to, &(position, input))) in line.iter_mut().zip(&self.entries).enumerate() {
                *to = lane_of(if self.keep { &batch.x[position * columns + input] } else { &batch.h[at] }, lane);
            }
        }
    }

    /// Solves one line with pivoting and puts its solution in place of the batch's.
    fn solve_pivoting(&self, space: &mut Workspace, sub: usize, lane: usize, w: f64) -> Result<(), BlockTriError> {
        let (layout, table) = (&self.system.layout, &self.system.table);
        let batch = &mut space.batches[sub];
        let z = space.pivoting.get_or_insert_with(|| BlockTri::new(Arc::clone(layout)));
        z.clear();
        for level in 0..layout.levels.count() {
            let (first, n) = (layout.levels.start[level], layout.levels.size(level));
            for row in 0..layout.levels.reach(level) - first {
                for column in 0..n.min(row + 1) {
                    let at = table.base[level] + row_start(row, n) + column;
                    let (slot, next) = (table.slots[at], table.slots[at + 1]);
                    let mut value = C64::from(slot.stiffness + slot.mass * batch.inertia.0[lane]);
                    for term in &table.terms[slot.first_term..next.first_term] {
                        value += lane_of(&batch.coefficients[term.group], lane) * term.value;
                    }
                    z.add_at(layout.rows[first + row].at(first + column), value);
                    if row != column {
                        z.add_at(layout.rows[first + column].at(first + row), value);
                    }
                }
            }
        }
        z.factor().map_err(|error| match error {
            BlockTriError::Singular { dof, pivot } => BlockTriError::SingularLine { dof, pivot, frequency: w / TAU },
            other => other,
        })?;
        let columns = self.columns.len();
        for (c, load) in self.columns.iter().enumerate() {
            space.column.fill(C64::ZERO);
            space.column[layout.levels.order[load.position]] = C64::ONE;
            z.solve(&mut space.column)?;
            let put = |to: &mut C4, position: usize| {
                let x = space.column[layout.levels.order[position]];
                (to.re.0[lane], to.im.0[lane]) = (x.re, x.im);
            };
            if self.keep {
                (0..layout.n()).for_each(|p| put(&mut batch.x[p * columns + c], p));
            } else {
                let of_load = self.entries.iter().zip(&mut batch.h).filter(|((_, input), _)| *input == c);
                of_load.for_each(|((position, _), h)| put(h, *position));
            }
        }
        Ok(())
    }
}

/// Puts up to four lines into a batch; one that is not full repeats its last line.
fn fill<F>(batch: &mut Batch, lines: &[f64], coefficients: &F, z: &mut [C64]) -> Result<(), BlockTriError>
where
    F: Fn(f64, &mut [C64]),
{
    for lane in 0..WIDTH {
        let w = lines[lane.min(lines.len() - 1)];
        batch.inertia.0[lane] = -w * w;
        coefficients(w, z);
        for (group, (to, z)) in batch.coefficients.iter_mut().zip(z.iter()).enumerate() {
            if !z.is_finite() {
                return Err(BlockTriError::CoefficientNotFinite { group, frequency: w / TAU });
            }
            (to.re.0[lane], to.im.0[lane]) = (z.re, z.im);
        }
    }
    Ok(())
}

#[inline(always)]
fn lane_of(value: &C4, lane: usize) -> C64 {
    let (F4(re), F4(im)) = (&value.re, &value.im);
    C64::new(re[lane], im[lane])
}
