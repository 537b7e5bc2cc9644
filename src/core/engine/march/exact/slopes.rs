//! Direct differentiation of exact steps.

use crate::effect::Inputs;
use crate::model::{Depth, Element, ElementScratch, Sensed};

use super::super::super::EngineError;
use super::super::super::blocktri::widest;
use super::super::sensitivities::add_row;
use super::super::{March, State};
use super::hold::{Hold, ORDERS};
use super::{Exact, Level, beyond};

/// The linear laws of an element with free parameters: each of these changes the force by `k x + c v + m a`.
pub(super) struct Source {
    /// The element.
    pub element: usize,
    /// Column, and what its force is per displacement, velocity and acceleration.
    columns: Vec<(usize, [f64; 3])>,
}

impl Source {
    /// None where nothing of them is free.
    pub fn of(e: usize, element: &Element) -> Option<Source> {
        let free = |p: &usize| element.is_of_linear_part(*p) && !element.chains[*p].is_empty();
        let free: Vec<usize> = (0..element.n_params()).filter(free).collect();
        if free.is_empty() {
            return None;
        }
        let (mut s, mut fs) = (vec![0.0; element.n_states()], vec![0.0; element.n_follower_states()]);
        let units = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (mut out, mut scratch) = (Sensed::default(), ElementScratch::default());
        let mut columns: Vec<(usize, [f64; 3])> = vec![];
        for (input, [x, v, a]) in units.into_iter().enumerate() {
            element.tangent(&Inputs { x, v, a, dx: 0.0 }, 1.0, &mut s, &mut fs, Depth::Params, &mut out, &mut scratch);
            for p in &free {
                for (theta, slope) in &element.chains[*p] {
                    let at = columns.iter().position(|c| c.0 == *theta).unwrap_or(columns.len());
                    if at == columns.len() {
                        columns.push((*theta, [0.0; 3]));
                    }
                    columns[at].1[input] += out.params(0)[*p] * slope;
                }
            }
        }
        Some(Source { element: e, columns })
    }

    /// Adds its forces to its columns of rows: `N` of them, each times its own of `by`, in every row another one.
    #[inline(always)]
    fn add<const N: usize>(&self, by: [&[f64]; N], u: &[Inputs<f64>; N], rows: &mut [f64], columns: usize) {
        for (c, law) in &self.columns {
            for n in 0..N {
                let (u, by) = (&u[n], &by[n][..rows.len() / columns]);
                let force = law[0] * u.x + law[1] * u.v + law[2] * u.a;
                for i in 0..by.len() {
                    rows[i * columns + c] += by[i] * force;
                }
            }
        }
    }
}

/// `out = K d`; `K` has as many columns as `d` rows, a row of `d` and of `out` so many entries. Four rows of `d` at a time, so that `out` is written seldom.
#[inline(always)]
fn multiply(k: &[f64], d: &[f64], columns: usize, out: &mut [f64]) {
    for (k, out) in k.chunks_exact(d.len() / columns).zip(out.chunks_exact_mut(columns)) {
        out.fill(0.0);
        for (by, d) in k.chunks_exact(4).zip(d.chunks_exact(4 * columns)) {
            let (d0, d) = d.split_at(columns);
            let (d1, d) = d.split_at(columns);
            let (d2, d3) = d.split_at(columns);
            for c in 0..columns {
                out[c] += by[0] * d0[c] + by[1] * d1[c] + by[2] * d2[c] + by[3] * d3[c];
            }
        }
        for j in k.len() / 4 * 4..k.len() {
            add_row(out, k[j], d, j);
        }
    }
}

/// What sources do to the end of a step, as cubics through their values and rates at both ends (Hermite); `by`: what a matrix makes of the force of an element.
pub(super) fn bent(sources: &[Source], hold: &Hold, by: impl Fn(&[f64], usize, f64) -> Vec<f64>) -> Vec<[Vec<f64>; 4]> {
    let cubics: [[f64; ORDERS]; 4] = [[1.0, 0.0, -3.0, 2.0], [0.0, 0.0, 3.0, -2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, -1.0, 1.0]];
    let under =
        |c: [f64; ORDERS]| -> Vec<f64> { (0..hold.forced[0].len()).map(|i| (0..ORDERS).map(|j| c[j] * hold.forced[j][i]).sum()).collect() };
    let matrices = cubics.map(under);
    sources.iter().map(|s| std::array::from_fn(|b| by(&matrices[b], s.element, 1.0))).collect()
}

widest! {
    fn differentiate_widely(exact: &mut Exact, march: &mut March, level: &Level, state: &mut State, columns: usize) -> Result<(), EngineError> {
        exact.differentiated(march, level, state, columns)
    }
}

impl Exact {
    /// The whole of a step.
    pub(super) fn differentiate(&mut self, march: &mut March, level: &Level, state: &mut State, columns: usize) -> Result<(), EngineError> {
        differentiate_widely(self, march, level, state, columns)
    }

    /// Sensitivities of the forces of the acting elements where the march begins.
    pub(super) fn slope_at_start(&mut self, march: &mut March, state: &State, columns: usize) {
        for row in 0..self.acting.len() {
            self.held(march, row, state, columns);
            let e = self.acting[row];
            let (d, [x, v, _]) = (&mut self.dphi[row * columns..(row + 1) * columns], beyond(&march.bound.elements[e], &march.sensed[e]));
            for (by, du) in [(x, &state.dq), (v, &state.dv)] {
                march.links[e].ends().for_each(|(dof, sign)| add_row(d, sign * by, du, dof));
            }
        }
    }

    /// The derivative of the force of an acting element at held motion, from what it was at the start of the step.
    #[inline(always)]
    fn held(&mut self, march: &mut March, row: usize, old: &State, columns: usize) {
        let e = self.acting[row];
        let (d, link, element) = (&mut self.dphi[row * columns..(row + 1) * columns], &march.links[e], &march.bound.elements[e]);
        march.sensed[e].find_spans();
        let sensed = &march.sensed[e];
        d.fill(0.0);
        let (by_step, by_state) = (sensed.inputs(0)[3], sensed.states(0));
        // By index throughout: what an iterator's adapter is given is compiled by itself, for any processor.
        for (end, sign) in link.both() {
            if let Some(dof) = end {
                add_row(d, -sign * by_step, &old.dq, dof);
            }
        }
        for s in sensed.span(0) {
            add_row(d, by_state[s], &old.ds, link.s0 + s);
        }
        // Those of linear laws are sources.
        if march.by_parameter {
            for p in 0..element.chains.len() {
                if !element.chains[p].is_empty() && !element.is_of_linear_part(p) {
                    let by = sensed.params(0)[p];
                    for (theta, slope) in &element.chains[p] {
                        d[*theta] += by * slope;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn differentiated(&mut self, march: &mut March, level: &Level, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let (n, local) = (self.structure.n, self.local);
        self.fly_rows(march, level, state, columns);
        let old = std::mem::take(&mut march.old);
        for row in 0..self.acting.len() {
            self.held(march, row, &old, columns);
        }
        march.old = old;
        // Of candidates that is all.
        self.reach_rows(level, columns, local..self.acting.len());
        if local > 0 {
            // The acting feel the motion, and the motion them.
            self.write(march, state, columns);
            let felt = self.acting[..local].iter().any(|e| beyond(&march.bound.elements[*e], &march.sensed[*e])[2] != 0.0);
            if felt {
                self.know(columns);
                self.known[2 * n * columns..(2 * n + local) * columns].fill(0.0);
                self.accelerate_rows(march, state, columns);
            }
            for row in 0..local {
                let (e, d) = (self.acting[row], &mut self.dphi[row * columns..(row + 1) * columns]);
                let by = beyond(&march.bound.elements[e], &march.sensed[e]);
                for (end, sign) in march.links[e].both() {
                    if let Some(dof) = end {
                        add_row(d, sign * by[0], &state.dq, dof);
                        add_row(d, sign * by[1], &state.dv, dof);
                        add_row(d, sign * by[2], &state.da, dof);
                    }
                }
            }
            self.tangent(march, level)?;
            self.matrix.solve_rows(&mut self.dphi[..local * columns], columns)?;
            self.reach_rows(level, columns, 0..local);
        }
        self.write(march, state, columns);
        self.know(columns);
        let reads = self.acting[..local].iter().any(|e| march.bound.elements[*e].reads_rates().1);
        if reads || march.reads_beyond_state {
            self.accelerate_rows(march, state, columns);
        }
        for row in 0..local {
            march.follow_states(self.acting[row], state, columns);
        }
        if !march.reads_beyond_state {
            return Ok(());
        }
        state.dg.fill(0.0);
        let mut d = std::mem::take(&mut march.h);
        d.resize(columns, 0.0);
        for e in &self.holding {
            self.force_slopes(march, *e, state, &mut d);
            let ends = march.links[*e].ends().filter(|(d, _)| march.prescribed_at[*d].is_some());
            ends.for_each(|(dof, sign)| add_row(&mut state.dg[dof * columns..(dof + 1) * columns], sign, &d, 0));
        }
        march.h = d;
        Ok(())
    }

    /// Where the structure comes to, and what its linear elements change of it, into `rows`: displacements, then velocities.
    #[inline(always)]
    fn fly_rows(&mut self, march: &March, level: &Level, state: &State, columns: usize) {
        let n = self.structure.n;
        self.rows.resize(2 * n * columns, 0.0);
        multiply(&level.across, &self.known, columns, &mut self.rows);
        if !self.sources.is_empty() {
            self.accelerations_within(march, state);
        }
        for (source, bent) in self.sources.iter().zip(&level.bent) {
            let of = |u: &State, a: &[f64]| [&u.q, &u.v, a].map(|u| march.relative(source.element, u));
            let (before, after) = (of(&march.old, &self.within[0]), of(state, &self.within[1]));
            let rate = |u: [f64; 3], jerk: &[f64]| [u[1] * march.dt, u[2] * march.dt, march.relative(source.element, jerk)];
            let rates = [rate(before, &self.jerks[0]), rate(after, &self.jerks[1])];
            let u = [before, after, rates[0], rates[1]].map(|[x, v, a]| Inputs { x, v, a, dx: 0.0 });
            source.add(bent.each_ref().map(|b| b.as_slice()), &u, &mut self.rows, columns);
        }
    }

    /// Accelerations just after the start of the step and just before its end, under the mean of the acting forces, and their rates times the step; those of
    /// what is prescribed change evenly.
    fn accelerations_within(&mut self, march: &March, state: &State) {
        let n = self.structure.n;
        for (end, (at, towards)) in [(&march.old, 0.5), (state, -0.5)].into_iter().enumerate() {
            self.within[end].copy_from_slice(&at.a);
            for ((lift, phi), old) in self.lifts[0][..self.local].iter().zip(&self.phi).zip(&self.old_phi) {
                march.free_dofs.iter().zip(lift).for_each(|(d, by)| self.within[end][*d] += by * towards * (phi - old));
            }
            for (d, _) in &march.loads.prescribed {
                self.jerks[end][*d] = state.a[*d] - march.old.a[*d];
            }
            for (i, d) in march.free_dofs.iter().enumerate() {
                let rates = &self.structure.rates[2 * n * i..2 * n * (i + 1)];
                let moved = |(j, dof): (usize, &usize)| march.dt * (rates[j] * at.v[*dof] + rates[n + j] * self.within[end][*dof]);
                let own: f64 = march.free_dofs.iter().enumerate().map(moved).sum();
                self.jerks[end][*d] = own + (0..n).map(|j| self.structure.flexible[(i, j)] * self.pulls[end][j]).sum::<f64>();
            }
        }
    }

    /// What the forces of these acting elements at the end of the step change of `rows`.
    #[inline(always)]
    fn reach_rows(&mut self, level: &Level, columns: usize, of: std::ops::Range<usize>) {
        for row in of {
            let reach = &level.reach[row];
            for i in 0..reach.len() {
                add_row(&mut self.rows[i * columns..(i + 1) * columns], reach[i], &self.dphi, row);
            }
        }
    }

    /// Sensitivities of the motion in `rows` into the state.
    #[inline(always)]
    fn write(&self, march: &March, state: &mut State, columns: usize) {
        let n = self.structure.n;
        for (i, d) in march.free_dofs.iter().enumerate() {
            let at = d * columns..(d + 1) * columns;
            state.dq[at.clone()].copy_from_slice(&self.rows[i * columns..(i + 1) * columns]);
            state.dv[at].copy_from_slice(&self.rows[(n + i) * columns..(n + i + 1) * columns]);
        }
    }

    /// What is known at the end of a step: the motion in `rows`, the forces of the acting elements.
    #[inline(always)]
    fn know(&mut self, columns: usize) {
        let n = self.structure.n;
        self.known[..2 * n * columns].copy_from_slice(&self.rows);
        self.known[2 * n * columns..].copy_from_slice(&self.dphi);
    }

    /// Sensitivities of the accelerations under what is known.
    #[inline(always)]
    fn accelerate_rows(&self, march: &March, state: &mut State, columns: usize) {
        let inner = 2 * self.structure.n + self.acting.len();
        for (d, by) in march.free_dofs.iter().zip(self.pushed.chunks_exact(inner)) {
            multiply(by, &self.known, columns, &mut state.da[d * columns..(d + 1) * columns]);
        }
        for (source, lift) in self.sources.iter().zip(&self.lifts[1]) {
            let u = [march.inputs(source.element, state)];
            for (d, by) in march.free_dofs.iter().zip(lift) {
                source.add([&[*by]], &u, &mut state.da[d * columns..(d + 1) * columns], columns);
            }
        }
    }

    /// Sensitivities of the whole force of an element after a step.
    pub(in super::super) fn force_slopes(&self, march: &March, e: usize, state: &State, d: &mut [f64]) {
        if d.is_empty() {
            return;
        }
        d.fill(0.0);
        for (by, du) in march.bound.elements[e].linear_part().into_iter().zip([&state.dq, &state.dv, &state.da]) {
            march.links[e].ends().for_each(|(dof, sign)| add_row(d, sign * by, du, dof));
        }
        if let Some(row) = self.acting.iter().position(|a| *a == e) {
            add_row(d, 1.0, &self.dphi, row);
        }
        self.sources.iter().filter(|s| s.element == e).for_each(|s| s.add([&[1.0]], &[march.inputs(e, state)], d, d.len()));
    }
}
