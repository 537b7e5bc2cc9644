//! Newton's method on the state at the start of a cycle.

use nalgebra::{DMatrix, DVector};

use super::super::march::{March, State};
use super::EngineError;

/// Solves `(I - M) S = b`. With `L'(I - M) = 0 = (I - M) R` the directions `R` never decay and `L'S` is what a cycle conserves: it is that
/// of `path`, which is asked for where there are such directions, or left out.
pub(super) fn solve_fixed_point(
    monodromy: &DMatrix<f64>,
    b: &DMatrix<f64>,
    path: Option<&mut dyn FnMut() -> Result<DMatrix<f64>, EngineError>>,
) -> Result<DMatrix<f64>, EngineError> {
    if monodromy.iter().chain(b.iter()).any(|v| !v.is_finite()) {
        return Err(EngineError::NotFinite { step: 0 });
    }
    let n = monodromy.nrows();
    let svd = (DMatrix::identity(n, n) - monodromy).svd(true, true);
    let cut = 1e-9 * svd.singular_values.max();
    let mut s = svd.solve(b, cut).unwrap_or_else(|_| DMatrix::zeros(n, b.ncols()));
    let lasting: Vec<usize> = (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] <= cut).collect();
    if let (Some(path), Some(u), Some(v_t), false) = (path, &svd.u, &svd.v_t, lasting.is_empty()) {
        let path = path()?;
        let (l, r) = (u.select_columns(&lasting), v_t.select_rows(&lasting).transpose());
        if let Some(share) = l.tr_mul(&r).lu().solve(&l.tr_mul(&(path - &s))) {
            s += r * share;
        }
    }
    Ok(s)
}

/// The state at the start of a cycle as one scaled vector: displacement, velocity, acceleration of the free degrees of freedom, states
/// of the elements.
pub(super) struct Shooting {
    dofs: Vec<usize>,
    pub ns: usize,
    scale: [f64; 4],
    state_scale: Vec<f64>,
}

impl Shooting {
    pub fn new(march: &March, state: &State) -> Self {
        let dofs = march.free_dofs().to_vec();
        Shooting { dofs, ns: state.s.len(), scale: [1e-300; 4], state_scale: vec![1e-300; state.s.len()] }
    }
    pub fn len(&self) -> usize {
        4 * self.dofs.len() + self.ns
    }
    /// Takes the largest values seen as scales.
    pub fn widen(&mut self, state: &State) {
        for (scale, u) in self.scale.iter_mut().zip([&state.q, &state.v, &state.a, &state.w]) {
            *scale = u.iter().fold(*scale, |m, x| m.max(x.abs()));
        }
        for (scale, s) in self.state_scale.iter_mut().zip(&state.s) {
            *scale = scale.max(s.abs());
        }
    }
    pub fn pack(&self, state: &State) -> DVector<f64> {
        let parts = [&state.q, &state.v, &state.a, &state.w];
        let motion = parts.iter().zip(self.scale).flat_map(|(u, scale)| self.dofs.iter().map(move |d| u[*d] / scale));
        DVector::from_iterator(self.len(), motion.chain(state.s.iter().zip(&self.state_scale).map(|(s, scale)| s / scale)))
    }
    pub fn unpack(&self, z: &DVector<f64>, state: &mut State) {
        let m = self.dofs.len();
        for (i, d) in self.dofs.iter().enumerate() {
            state.q[*d] = z[i] * self.scale[0];
            state.v[*d] = z[m + i] * self.scale[1];
            state.a[*d] = z[2 * m + i] * self.scale[2];
            state.w[*d] = z[3 * m + i] * self.scale[3];
        }
        for (i, s) in state.s.iter_mut().enumerate() {
            *s = z[4 * m + i] * self.state_scale[i];
        }
    }
    /// The state whose scaled vector is `z`, otherwise as `like`.
    pub fn unpacked(&self, z: &DVector<f64>, like: &State) -> State {
        let mut state = like.clone();
        self.unpack(z, &mut state);
        state
    }
    /// Change of displacements and states, which velocities and accelerations follow.
    pub fn slow_change(&self, before: &State, after: &State) -> f64 {
        let moved = self.dofs.iter().map(|d| (after.q[*d] - before.q[*d]).abs() / self.scale[0]);
        let states = after.s.iter().zip(&before.s).zip(&self.state_scale).map(|((a, b), scale)| (a - b).abs() / scale);
        moved.chain(states).fold(0.0, f64::max)
    }
    pub fn change(&self, before: &State, after: &State) -> f64 {
        if self.len() == 0 { 0.0 } else { (self.pack(before) - self.pack(after)).amax() }
    }
    /// Whether a change of an element's state at the start of the cycle lives on at its end: something stays stuck, or decays slowly.
    pub fn remembers(&self, march: &mut March, start: &State, steps: usize) -> Result<bool, EngineError> {
        if self.ns == 0 {
            return Ok(false);
        }
        let mut state = start.clone();
        march.set_columns(&mut state, self.ns);
        for (i, scale) in self.state_scale.iter().enumerate() {
            state.ds[i * self.ns + i] = *scale;
        }
        march.by_parameter = false;
        let marched = (1..=steps).try_for_each(|k| march.step(k, &mut state, self.ns));
        march.by_parameter = true;
        marched?;
        Ok(self.pack_columns(&state, self.ns).amax() > 1e-6)
    }
    /// Unit perturbations of the scaled start in the columns from `first` on, the last ones.
    pub fn seed(&self, state: &mut State, first: usize) {
        let (m, columns) = (self.dofs.len(), first + self.len());
        for (i, d) in self.dofs.iter().enumerate() {
            state.dq[d * columns + first + i] = self.scale[0];
            state.dv[d * columns + first + m + i] = self.scale[1];
            state.da[d * columns + first + 2 * m + i] = self.scale[2];
            state.dw[d * columns + first + 3 * m + i] = self.scale[3];
        }
        for i in 0..self.ns {
            state.ds[i * columns + first + 4 * m + i] = self.state_scale[i];
        }
    }
    /// Scaled sensitivities, one column each.
    pub fn pack_columns(&self, state: &State, columns: usize) -> DMatrix<f64> {
        let m = self.dofs.len();
        DMatrix::from_fn(self.len(), columns, |r, c| match (r / m.max(1), r) {
            (g @ 0..=3, r) if r < 4 * m => {
                [&state.dq, &state.dv, &state.da, &state.dw][g][self.dofs[r - g * m] * columns + c] / self.scale[g]
            }
            _ => state.ds[(r - 4 * m) * columns + c] / self.state_scale[r - 4 * m],
        })
    }
    /// The inverse of [`Shooting::pack_columns`].
    pub fn unpack_columns(&self, z: &DMatrix<f64>, state: &mut State) {
        let (m, columns) = (self.dofs.len(), z.ncols());
        for c in 0..columns {
            for (i, d) in self.dofs.iter().enumerate() {
                let at = d * columns + c;
                state.dq[at] = z[(i, c)] * self.scale[0];
                state.dv[at] = z[(m + i, c)] * self.scale[1];
                state.da[at] = z[(2 * m + i, c)] * self.scale[2];
                state.dw[at] = z[(3 * m + i, c)] * self.scale[3];
            }
            for (i, scale) in self.state_scale.iter().enumerate() {
                state.ds[i * columns + c] = z[(4 * m + i, c)] * scale;
            }
        }
    }
    /// The quasi-Newton step on the start of the cycle: `state` is where a cycle from `before` has ended, `inverse` that of `I - M`.
    pub fn correct(&self, state: &mut State, before: &State, inverse: &DMatrix<f64>) {
        let start = self.pack(before);
        let delta = inverse * (self.pack(state) - &start);
        self.unpack(&(start + delta), state);
    }

    /// One Newton step on the start of the cycle; returns the inverse of `I - M`.
    pub fn shoot(&self, march: &mut March, state: &mut State, steps: usize) -> Result<DMatrix<f64>, EngineError> {
        let before = self.pack(state);
        let start = state.clone();
        march.set_columns(state, self.len());
        self.seed(state, 0);
        march.by_parameter = false;
        let marched = (1..=steps).try_for_each(|k| march.step(k, state, self.len()));
        march.by_parameter = true;
        marched?;
        let gap = self.pack(state) - &before;
        let monodromy = self.pack_columns(state, self.len());
        let inverse = solve_fixed_point(&monodromy, &DMatrix::identity(gap.len(), gap.len()), None)?;
        *state = start;
        march.set_columns(state, 0);
        self.unpack(&(before + &inverse * gap), state);
        Ok(inverse)
    }
}
