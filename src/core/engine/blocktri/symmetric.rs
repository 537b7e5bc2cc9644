//! Four lines of Z(w) X = E at once: assembly, L D L' without pivoting, substitution, sensitivities.
//!
//! Assembly, elimination and forward substitution go together level by level, so that a level's panel is still in the first cache
//! when it is used. Where only a few responses are wanted the factors are not even kept: with Z = L D L', H_oi = y_o' D^-1 y_i for the
//! forward-substituted unit loads y = L^-1 e, accumulated on the way. Loops go by index: the crate is compiled in many units without
//! optimisation across them, where adapters of iterators over the lane types stay calls (half the speed).
//!
//! What the lack of pivoting costs is measured along the way, per line: with the scale s_k = sum |contributions to z_kk|, the factors satisfy |Z - L D L'|_kl <= c eps g sqrt(s_k s_l), g = max_k sum_j |l_kj|^2 |d_j| / s_k. Lines whose g
//! exceeds [`GROWTH`], or that meet a zero pivot, are reported for the pivoting factorisation.

use super::lanes::{C4, Cv, F4, Lanes, WIDTH, widest};
use super::levels::Levels;
use super::table::{Element, Table, row_start};

/// Largest admitted element growth: leaves about 12 digits of backward accuracy.
pub(super) const GROWTH: f64 = 1e3;

/// Storage for four lines, reused from batch to batch.
#[derive(Debug, Clone)]
pub(super) struct Batch {
    /// -w^2
    pub inertia: F4,
    /// z_g(w)
    pub coefficients: Vec<C4>,
    /// Factors in the table's order, the diagonal holds 1/d; those of one level where they are not kept.
    factors: Vec<C4>,
    /// L D of the current level's panel.
    panel: Vec<C4>,
    /// What the current level takes off the next one's diagonal block (packed lower triangle), and the growth sums of its rows.
    schur: Vec<C4>,
    growth: Vec<F4>,
    /// Largest excess of the growth over its limit, and NaN where a pivot was zero or not finite.
    excess: F4,
    finite: F4,
    /// Lines whose result must not be used.
    pub suspect: [bool; WIDTH],
    /// H at the plan's pairs.
    pub h: Vec<C4>,
    /// Solution columns, all columns of a position side by side; only a window of two levels where they are not kept.
    pub x: Vec<C4>,
    relative: Vec<C4>,
    /// dH/dz: (input, output, group).
    pub sensitivity: Vec<C4>,
    magnitude: Vec<F4>,
}

/// What a batch has to compute.
#[derive(Debug)]
pub(super) struct Plan<'a> {
    pub levels: &'a Levels,
    pub table: &'a Table,
    /// In the order of their levels.
    pub columns: &'a [Column],
    /// H at (column of the input, column of the output).
    pub pairs: &'a [(usize, usize)],
    /// Whether whole solution columns are wanted in `x`; if so H is left to the caller.
    pub keep: bool,
    /// Levels before this one are not needed in the kept solution.
    pub last_wanted: usize,
}

/// A unit load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Column {
    pub position: usize,
    pub level: usize,
    /// First level of the load's component, and one past its last.
    pub component: (usize, usize),
}

impl Column {
    pub fn new(levels: &Levels, dof: usize) -> Self {
        let position = levels.position[dof];
        let level = levels.start.partition_point(|&s| s <= position) - 1;
        let first = (0..level).rev().find(|&l| !levels.linked(l)).map_or(0, |l| l + 1);
        let last = (level..levels.count()).find(|&l| !levels.linked(l)).unwrap_or(level);
        Self { position, level, component: (first, last + 1) }
    }
}

impl Batch {
    pub fn new(levels: &Levels, table: &Table) -> Self {
        let widest = (0..levels.count()).map(|l| levels.reach(l) - levels.start[l]).max().unwrap_or(0);
        let zero = F4([0.0; WIDTH]);
        Self {
            inertia: zero,
            coefficients: vec![C4::ZERO; table.groups],
            factors: Vec::new(),
            panel: vec![C4::ZERO; widest * widest],
            schur: vec![C4::ZERO; widest * (widest + 1) / 2],
            growth: vec![zero; 2 * widest],
            excess: zero,
            finite: zero,
            suspect: [false; WIDTH],
            h: Vec::new(),
            x: Vec::new(),
            relative: Vec::new(),
            sensitivity: Vec::new(),
            magnitude: vec![zero; table.groups],
        }
    }

    /// Solves several batches for the plan's loads, level by level together, so that the table is read once for all of them; sets
    /// `suspect` where a line's result must not be used.
    pub fn solve(batches: &mut [Batch], plan: &Plan) {
        solve(batches, plan);
    }

    /// Sensitivities from the solution columns: dH_oi/dz_g = - sum over the group's elements of (b'X_o)(b'X_i).
    pub fn differentiate(&mut self, plan: &Plan) {
        differentiate(self, plan);
    }

    #[inline(always)]
    pub(super) fn solve_with<V: Lanes>(batches: &mut [Batch], plan: &Plan) {
        let levels = plan.levels;
        for batch in batches.iter_mut() {
            batch.begin::<V>(plan);
        }
        for level in 0..levels.count() {
            let n = levels.size(level);
            let below = levels.reach(level) - levels.start[level + 1];
            for batch in batches.iter_mut() {
                match (n, below) {
                    (6, 6) => batch.level::<V, 6, 6>(plan, level, 6, 6),
                    (3, 3) => batch.level::<V, 3, 3>(plan, level, 3, 3),
                    (1, 1) => batch.level::<V, 1, 1>(plan, level, 1, 1),
                    _ => batch.level::<V, 0, 0>(plan, level, n, below),
                }
            }
        }
        for batch in batches.iter_mut() {
            if plan.keep {
                for level in (plan.last_wanted..levels.count()).rev() {
                    batch.backward::<V>(plan, level);
                }
            }
            batch.suspect = std::array::from_fn(|i| batch.excess.0[i] > 0.0 || batch.finite.0[i].is_nan());
        }
    }

    #[inline(always)]
    fn begin<V: Lanes>(&mut self, plan: &Plan) {
        let columns = plan.columns.len();
        self.x.clear();
        self.x.resize(if plan.keep { plan.levels.n() } else { self.growth.len() } * columns, C4::ZERO);
        self.h.clear();
        self.h.resize(plan.pairs.len(), C4::ZERO);
        let factors = if plan.keep { plan.table.slots.len() } else { self.panel.len() };
        if self.factors.len() < factors {
            self.factors.resize(factors, C4::ZERO);
        }
        for group in 0..self.magnitude.len() {
            Cv::<V>::load(&self.coefficients[group]).magnitude().store(&mut self.magnitude[group]);
        }
        self.schur.fill(C4::ZERO);
        self.growth.fill(F4([0.0; WIDTH]));
        (self.excess, self.finite) = (F4([-1.0; WIDTH]), F4([0.0; WIDTH]));
    }

    /// One level; `N` and `M` repeat `n` and `m` where they are known when compiling, 0 otherwise.
    #[inline(always)]
    fn level<V: Lanes, const N: usize, const M: usize>(&mut self, plan: &Plan, level: usize, n: usize, m: usize) {
        let (n, m) = if N > 0 { (N, M) } else { (n, m) };
        let base = plan.table.base[level];
        let count = row_start(n + m, n);
        self.assemble::<V>(plan.table, base, count);
        let panel = &mut self.panel[..count];
        for at in 0..row_start(n, n) {
            let one = Cv { re: V::splat(1.0), im: V::splat(0.0) };
            Cv::<V>::load(&panel[at]).sub_mul(one, Cv::load(&self.schur[at])).store(&mut panel[at]);
        }
        let kept = if plan.keep { base } else { 0 };
        let factors = &mut self.factors[kept..kept + count];
        let growth = &mut self.growth[..n + m];
        for k in 0..n {
            let row_k = row_start(k, n);
            let mut d = Cv::<V>::load(&panel[row_k + k]);
            for j in 0..k {
                d = d.sub_mul(Cv::load(&panel[row_k + j]), Cv::load(&factors[row_k + j]));
            }
            let inverse = d.reciprocal();
            inverse.store(&mut factors[row_k + k]);
            let size = inverse.magnitude();
            let grown = V::load(&growth[k]).add(d.magnitude());
            let scale = diagonal_scale::<V>(plan.table, base + row_k + k, self.inertia, &self.magnitude);
            V::load(&self.excess).max(grown.sub_mul(V::splat(GROWTH), scale)).store(&mut self.excess);
            V::load(&self.finite).add_mul(size, V::splat(0.0)).store(&mut self.finite);
            for r in k + 1..n + m {
                let row = row_start(r, n);
                let mut w = Cv::<V>::load(&panel[row + k]);
                for j in 0..k {
                    w = w.sub_mul(Cv::load(&panel[row + j]), Cv::load(&factors[row_k + j]));
                }
                w.store(&mut panel[row + k]);
                w.mul(inverse).store(&mut factors[row + k]);
                V::load(&growth[r]).add_mul(w.square(), size).store(&mut growth[r]);
            }
        }
        for r in 0..m {
            let (row, target) = (row_start(n + r, n), row_start(r, m));
            for c in 0..=r {
                let other = row_start(n + c, n);
                let mut s = Cv::<V>::zero();
                for k in 0..n {
                    s = s.add_mul(Cv::load(&panel[row + k]), Cv::load(&factors[other + k]));
                }
                s.store(&mut self.schur[target + c]);
            }
        }
        // The next level's growth starts from what this one added to its rows; a component's end leaves zeros.
        growth.copy_within(n.., 0);
        let widest = self.growth.len();
        self.growth[m..widest.min(m + 2 * n)].fill(F4([0.0; WIDTH]));
        if m == 0 {
            self.schur.fill(C4::ZERO);
        }
        self.forward::<V>(plan, level, n, m);
    }

    #[inline(always)]
    fn assemble<V: Lanes>(&mut self, table: &Table, base: usize, count: usize) {
        let inertia = V::load(&self.inertia);
        let slots = &table.slots[base..base + count + 1];
        for at in 0..count {
            let (own, next) = (&slots[at], &slots[at + 1]);
            let mut z = Cv { re: V::splat(own.stiffness).add_mul(inertia, V::splat(own.mass)), im: V::splat(0.0) };
            for term in &table.terms[own.first_term..next.first_term] {
                z = z.add_scaled(V::splat(term.value), Cv::load(&self.coefficients[term.group]));
            }
            z.store(&mut self.panel[at]);
        }
    }

    #[inline(always)]
    fn forward<V: Lanes>(&mut self, plan: &Plan, level: usize, n: usize, m: usize) {
        // Columns loaded at or before this level, in its component: they stand together.
        let begin = plan.columns.partition_point(|c| c.component.1 <= level);
        let end = plan.columns.partition_point(|c| c.level <= level);
        if begin == end {
            return;
        }
        let (stride, first) = (plan.columns.len(), plan.levels.start[level]);
        let (window, kept) = if plan.keep { (first * stride, plan.table.base[level]) } else { (0, 0) };
        let factors = &self.factors[kept..];
        let x = &mut self.x[window..window + (n + m) * stride];
        for (c, column) in plan.columns[begin..end].iter().enumerate().filter(|(_, c)| c.level == level) {
            x[(column.position - first) * stride + begin + c] = C4::ONE;
        }
        let mut c = begin;
        while c < end {
            c += match end - c {
                1 => forward_columns::<V, 1>(factors, x, stride, c, n, m),
                2 | 3 => forward_columns::<V, 2>(factors, x, stride, c, n, m),
                _ => forward_columns::<V, 4>(factors, x, stride, c, n, m),
            };
        }
        quench::<V>(&mut x[n * stride..], stride, begin..end, level);
        if plan.keep {
            return;
        }
        for at in 0..plan.pairs.len() {
            let (input, output) = plan.pairs[at];
            if !(begin..end).contains(&input) || !(begin..end).contains(&output) {
                continue;
            }
            let mut sum = Cv::<V>::load(&self.h[at]);
            for k in 0..n {
                let scaled = Cv::load(&x[k * stride + input]).mul(Cv::load(&factors[row_start(k, n) + k]));
                sum = sum.add_mul(scaled, Cv::load(&x[k * stride + output]));
            }
            sum.store(&mut self.h[at]);
        }
        // The next level's rows move to the front of the window.
        x.copy_within(n * stride.., 0);
        x[m * stride..].fill(C4::ZERO);
    }

    #[inline(always)]
    fn backward<V: Lanes>(&mut self, plan: &Plan, level: usize) {
        let begin = plan.columns.partition_point(|c| c.component.1 <= level);
        let end = plan.columns.partition_point(|c| c.component.0 <= level);
        let (stride, first) = (plan.columns.len(), plan.levels.start[level]);
        let (n, reach) = (plan.levels.size(level), plan.levels.reach(level));
        let factors = &self.factors[plan.table.base[level]..];
        let x = &mut self.x[first * stride..reach * stride];
        let mut c = begin;
        while c < end {
            c += match end - c {
                1 => backward_columns::<V, 1>(factors, x, stride, c, n, reach - first),
                2 | 3 => backward_columns::<V, 2>(factors, x, stride, c, n, reach - first),
                _ => backward_columns::<V, 4>(factors, x, stride, c, n, reach - first),
            };
        }
        quench::<V>(&mut x[..n * stride], stride, begin..end, level);
    }

    #[inline(always)]
    pub(super) fn differentiate_with<V: Lanes>(&mut self, plan: &Plan) {
        let (columns, groups) = (plan.columns.len(), plan.table.groups);
        self.sensitivity.clear();
        self.sensitivity.resize(plan.pairs.len() * groups, C4::ZERO);
        self.relative.resize(columns, C4::ZERO);
        for Element { group, row } in &plan.table.elements {
            for c in 0..columns {
                let mut sum = Cv::<V>::zero();
                for &(position, b) in row {
                    sum = sum.add_scaled(V::splat(b), Cv::load(&self.x[position * columns + c]));
                }
                sum.store(&mut self.relative[c]);
            }
            for at in 0..plan.pairs.len() {
                let (input, output) = plan.pairs[at];
                let target = &mut self.sensitivity[at * groups + group];
                let (a, b) = (Cv::<V>::load(&self.relative[input]), Cv::load(&self.relative[output]));
                Cv::<V>::load(target).sub_mul(a, b).store(target);
            }
        }
    }
}

widest! {
    fn solve(batches: &mut [Batch], plan: &Plan) {
        Batch::solve_with::<Register>(batches, plan);
    }
}

widest! {
    fn differentiate(batch: &mut Batch, plan: &Plan) {
        batch.differentiate_with::<Register>(plan);
    }
}

#[inline(always)]
fn diagonal_scale<V: Lanes>(table: &Table, slot: usize, inertia: F4, magnitude: &[F4]) -> V {
    let (own, next) = (table.slots[slot], table.slots[slot + 1]);
    let mut sum = V::splat(own.stiffness.abs()).add(V::load(&inertia).mul(V::splat(own.mass)).abs());
    for term in &table.terms[own.first_term..next.first_term] {
        sum = sum.add_mul(V::splat(term.value.abs()), V::load(&magnitude[term.group]));
    }
    sum
}

/// Sets what has decayed below 1e-150 of the unit load to zero, every fourth level: along a chain of thousands the response dies out
/// into subnormal numbers, on which the processor is a hundred times slower.
#[inline(always)]
fn quench<V: Lanes>(rows: &mut [C4], stride: usize, columns: std::ops::Range<usize>, level: usize) {
    if !level.is_multiple_of(4) {
        return;
    }
    let limit = V::splat(1e-150);
    for row in rows.chunks_exact_mut(stride) {
        for x in &mut row[columns.clone()] {
            let value = Cv::<V>::load(x);
            let size = value.magnitude();
            Cv { re: value.re.unless_below(size, limit), im: value.im.unless_below(size, limit) }.store(x);
        }
    }
}

#[inline(always)]
fn forward_columns<V: Lanes, const C: usize>(factors: &[C4], x: &mut [C4], stride: usize, c: usize, n: usize, m: usize) -> usize {
    for r in 1..n + m {
        let row = row_start(r, n);
        let mut sum: [Cv<V>; C] = load_columns(&x[r * stride + c..]);
        for k in 0..r.min(n) {
            let l = Cv::load(&factors[row + k]);
            let source = &x[k * stride + c..][..C];
            for i in 0..C {
                sum[i] = sum[i].sub_mul(l, Cv::load(&source[i]));
            }
        }
        store_columns(sum, &mut x[r * stride + c..]);
    }
    C
}

#[inline(always)]
fn backward_columns<V: Lanes, const C: usize>(factors: &[C4], x: &mut [C4], stride: usize, c: usize, n: usize, rows: usize) -> usize {
    for k in (0..n).rev() {
        let inverse = Cv::load(&factors[row_start(k, n) + k]);
        let mut sum: [Cv<V>; C] = load_columns(&x[k * stride + c..]);
        for i in 0..C {
            sum[i] = sum[i].mul(inverse);
        }
        for r in k + 1..rows {
            let l = Cv::load(&factors[row_start(r, n) + k]);
            let source = &x[r * stride + c..][..C];
            for i in 0..C {
                sum[i] = sum[i].sub_mul(l, Cv::load(&source[i]));
            }
        }
        store_columns(sum, &mut x[k * stride + c..]);
    }
    C
}

#[inline(always)]
fn load_columns<V: Lanes, const C: usize>(from: &[C4]) -> [Cv<V>; C] {
    let (mut all, from) = ([Cv::zero(); C], &from[..C]);
    for i in 0..C {
        all[i] = Cv::load(&from[i]);
    }
    all
}

#[inline(always)]
fn store_columns<V: Lanes, const C: usize>(all: [Cv<V>; C], to: &mut [C4]) {
    let to = &mut to[..C];
    for i in 0..C {
        all[i].store(&mut to[i]);
    }
}
