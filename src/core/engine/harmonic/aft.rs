//! Alternating frequency/time evaluation of one element: Fourier coefficients of the displacement across it to those of its force, with
//! the exact derivatives of the sampled law.
//!
//! The law is marched over equal samples of the cycle after one cycle from rest: its states start at 0, one step leads to the first
//! sample (the declared loading path of laws that remember). States that have not settled after that cycle are brought to their
//! periodic value by Newton's method with the monodromy matrix `M` of the cycle; directions that never decay (an element that stays
//! stuck) keep what the path left there. A law that forgets begins where its last motion ended instead.

use std::f64::consts::TAU;

use nalgebra::{DMatrixView, DMatrixViewMut, DVectorView, DVectorViewMut};

use crate::effect::Inputs;
use crate::model::{Depth, Element, ElementScratch, Sensed};

use super::super::EngineError;
use super::basis::Basis;
use super::fixed_point::{FixedPoint, extrapolate};

/// What of the derivatives belongs to the present motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Known {
    #[default]
    Force,
    Jacobian,
    Parameters,
}

/// Force coefficients of one element and their derivatives; kept from call to call, so that nothing is allocated in the loops.
#[derive(Default)]
pub(super) struct Aft {
    /// Coefficients of the force.
    pub f: Vec<f64>,
    /// `jacobian[r * width + c]`: coefficient `r` of the force by coefficient `c` of the displacement.
    pub jacobian: Vec<f64>,
    /// `by_param[r * n_params + p]`; filled by [`Aft::parameters`].
    pub by_param: Vec<f64>,
    known: Known,
    x: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    weighted: Vec<f64>,
    force_at: Vec<f64>,
    s: Vec<f64>,
    start: Vec<f64>,
    /// Series of the last motion, and whether its periodic start is one to begin the next from.
    at: Vec<f64>,
    warm: bool,
    state_scale: Vec<f64>,
    fs: Vec<f64>,
    /// Columns: displacement coefficients, states at the start, parameters. Rows: states.
    slopes: Vec<f64>,
    next: Vec<f64>,
    /// The same columns of the force, sample after sample.
    rows: Vec<f64>,
    /// The same columns, rows: force coefficients.
    sums: Vec<f64>,
    path: Vec<f64>,
    start_slopes: Vec<f64>,
    /// Columns of these.
    kept: usize,
    monodromy: Vec<f64>,
    fixed: FixedPoint,
    sensed: Sensed,
    scratch: ElementScratch,
    /// Opening of an effect in series at each sample.
    openings: Vec<f64>,
}

/// Change of the states over a cycle, relative to their largest value, at which they count as periodic.
pub(super) const PERIODIC: f64 = 1e-12;
/// Part of a difference between states that a cycle must take away for the next motion to begin where this one ends: what sticks remembers the path from
/// rest.
const FORGETS: f64 = 0.1;
const CYCLES: usize = 40;
/// Factor by which a cycle must bring that change down for its derivatives to serve once more.
const FAST: f64 = 0.1;

/// Cycles of candidates after the first, and the change from one to the next below which there are no more: far below what a score tells apart.
const FOLLOWED: usize = 3;
const ALIKE: f64 = 1e-7;

fn sized(v: &mut Vec<f64>, len: usize) {
    v.clear();
    v.resize(len, 0.0);
}

/// Sum of three rows; a law reads one of them, mostly.
fn combine(out: &mut [f64], weights: [f64; 3], rows: [&[f64]; 3]) {
    out.fill(0.0);
    for (weight, row) in weights.into_iter().zip(rows).filter(|(weight, _)| *weight != 0.0) {
        out.iter_mut().zip(row).for_each(|(o, r)| *o += weight * r);
    }
}

impl Aft {
    /// Force at the displacement series `x` and the circular frequency `omega`, the states periodic to `within` of their largest value. Derivatives
    /// stay those of the motion before until [`Aft::differentiate`] or [`Aft::parameters`].
    pub fn evaluate(&mut self, element: &Element, basis: &Basis, omega: f64, x: &[f64], within: f64) -> Result<(), EngineError> {
        let (n, ns) = (basis.samples, element.n_states());
        let dt = TAU / omega / n as f64;
        self.known = Known::Force;
        self.sample(element, basis, omega, x);
        if ns == 0 || !self.follow(ns, x) || !self.settle(element, n, dt, within, true).unwrap_or(false) {
            self.rest(element);
            if ns > 0 {
                for k in 0..=n {
                    self.value(element, k, n, dt);
                }
            }
            self.start.clone_from(&self.s);
            self.settle(element, n, dt, within, false)?;
        }
        self.at.clear();
        self.at.extend_from_slice(x);
        self.warm = ns > 0 && self.monodromy.len() == ns * ns && self.fixed.decays_by(&self.monodromy, &self.state_scale, FORGETS);
        sized(&mut self.f, basis.width);
        let force = DVectorView::from_slice(&self.force_at, n);
        DVectorViewMut::from_slice(&mut self.f, basis.width).gemv_tr(1.0, &basis.back, &force, 0.0);
        Ok(())
    }

    /// Moves the start of the last motion as its derivatives say; whether there is one to begin from, of laws with as many states.
    fn follow(&mut self, ns: usize, x: &[f64]) -> bool {
        if !std::mem::take(&mut self.warm) || self.at.len() != x.len() || self.start.len() != ns || self.state_scale.len() != ns {
            return false;
        }
        if self.kept >= x.len() && self.start_slopes.len() == self.start.len() * self.kept {
            for (i, start) in self.start.iter_mut().enumerate() {
                let slopes = &self.start_slopes[i * self.kept..];
                *start += x.iter().zip(&self.at).zip(slopes).map(|((x, at), slope)| slope * (x - at)).sum::<f64>();
            }
        }
        self.s.resize(self.start.len(), 0.0);
        self.state_scale.iter_mut().for_each(|s| *s = 0.0);
        true
    }

    /// Cycles from `start` until the states return; false where they do so at once, though begun where another motion left them (`followed`): what
    /// sticks keeps what the path from rest leaves, which this is not.
    fn settle(&mut self, element: &Element, n: usize, dt: f64, within: f64, followed: bool) -> Result<bool, EngineError> {
        let ns = element.n_states();
        // Derivatives of a cycle, of this motion or of the one before, serve as long as they bring the change down fast.
        let mut derived = self.monodromy.len() == ns * ns;
        let mut change = f64::INFINITY;
        for round in 0..CYCLES {
            // A plain cycle is enough for what is periodic after the first. Newton's method may hover between the branches of a law with
            // kinks; a plain cycle now and then leads out of it.
            let plain = round % 4 == 0 && (round > 0 || !derived);
            let derive = !plain && !derived;
            self.cycle(element, n, dt, derive);
            if !self.force_at.iter().all(|f| f.is_finite()) {
                return Err(EngineError::NotFinite { step: 0 });
            }
            // A state that never leaves 0 has no scale of its own.
            self.state_scale.iter_mut().filter(|s| **s == 0.0).for_each(|s| *s = 1.0);
            let before = change;
            change = (0..ns).map(|i| (self.s[i] - self.start[i]).abs() / self.state_scale[i]).fold(0.0, f64::max);
            if followed && round == 0 && change == 0.0 {
                return Ok(false);
            }
            if change <= PERIODIC {
                return Ok(true);
            }
            if plain {
                self.start.clone_from(&self.s);
                continue;
            }
            self.next.clear();
            self.next.extend(self.s.iter().zip(&self.start).map(|(end, start)| end - start));
            if derive {
                self.take_monodromy(ns, ns, 0);
            }
            self.fixed.solve(&self.monodromy, &self.state_scale, &mut self.next, 1);
            let step = self.next.iter().zip(&self.state_scale).map(|(d, scale)| d.abs() / scale).fold(0.0, f64::max);
            // Those of another motion may ask for more than a state can be.
            let far = !derive && step > 1.0;
            derived = derive || (change < FAST * before && !far);
            if far {
                self.start.clone_from(&self.s);
                continue;
            }
            self.start.iter_mut().zip(&self.next).for_each(|(s, d)| *s += d);
            if step.max(change) <= within && derived {
                return Ok(true);
            }
        }
        if change > 1e-7 {
            return Err(EngineError::NotPeriodic { change, cycles: CYCLES });
        }
        Ok(true)
    }

    /// The Jacobian at the motion of the last [`Aft::evaluate`].
    pub fn differentiate(&mut self, element: &Element, basis: &Basis, omega: f64) {
        self.derive(element, basis, omega, Known::Jacobian);
    }

    /// The same with the derivatives with respect to the parameters, followers included.
    pub fn parameters(&mut self, element: &Element, basis: &Basis, omega: f64) {
        self.derive(element, basis, omega, Known::Parameters);
    }

    fn sample(&mut self, element: &Element, basis: &Basis, omega: f64, x: &[f64]) {
        let n = basis.samples;
        for v in [&mut self.x, &mut self.v, &mut self.a] {
            sized(v, n);
        }
        let coefficients = DVectorView::from_slice(x, x.len());
        DVectorViewMut::from_slice(&mut self.x, n).gemv(1.0, &basis.values, &coefficients, 0.0);
        let (reads_v, reads_a) = element.reads_rates();
        if reads_v {
            DVectorViewMut::from_slice(&mut self.v, n).gemv(omega, &basis.rates, &coefficients, 0.0);
        }
        if reads_a {
            self.weighted.clear();
            self.weighted.extend(x.iter().enumerate().map(|(c, x)| (c.div_ceil(2) * c.div_ceil(2)) as f64 * x));
            let weighted = DVectorView::from_slice(&self.weighted, x.len());
            DVectorViewMut::from_slice(&mut self.a, n).gemv(-omega * omega, &basis.values, &weighted, 0.0);
        }
    }

    fn rest(&mut self, element: &Element) {
        sized(&mut self.s, element.n_states());
        self.state_scale.clear();
        self.state_scale.resize(element.n_states(), 0.0);
    }

    /// Motion at step `k`; step 0 leads from rest to the first sample.
    fn inputs(&self, k: usize, n: usize) -> Inputs<f64> {
        let i = k % n;
        let before = if k == 0 { 0.0 } else { self.x[k - 1] };
        Inputs { x: self.x[i], v: self.v[i], a: self.a[i], dx: self.x[i] - before }
    }

    /// One cycle of the force from `start`; with the monodromy, `slopes` becomes that of the states.
    fn cycle(&mut self, element: &Element, n: usize, dt: f64, monodromy: bool) {
        let ns = element.n_states();
        self.s.clone_from(&self.start);
        self.force_at.resize(n, 0.0);
        if monodromy {
            sized(&mut self.slopes, ns * ns);
            (0..ns).for_each(|i| self.slopes[i * ns + i] = 1.0);
        }
        for k in 1..=n {
            self.force_at[k % n] = if monodromy {
                self.tangent(element, k, n, dt, Depth::States);
                sized(&mut self.next, ns * ns);
                for r in 0..ns {
                    let out = &mut self.next[r * ns..(r + 1) * ns];
                    for (j, by_state) in self.sensed.states(1 + r).iter().enumerate().filter(|(_, b)| **b != 0.0) {
                        out.iter_mut().zip(&self.slopes[j * ns..(j + 1) * ns]).for_each(|(o, s)| *o += by_state * s);
                    }
                }
                std::mem::swap(&mut self.slopes, &mut self.next);
                self.sensed.f
            } else {
                self.value(element, k, n, dt)
            };
            for (scale, s) in self.state_scale.iter_mut().zip(&self.s) {
                *scale = scale.max(s.abs());
            }
        }
    }

    /// One step of the law.
    fn value(&mut self, element: &Element, k: usize, n: usize, dt: f64) -> f64 {
        let u = self.inputs(k, n);
        self.begin(element, k, n);
        let force = element.value(&u, dt, &mut self.s, &mut self.scratch);
        self.end(element, k, n);
        force
    }

    /// The same with the derivatives asked for, in `sensed`.
    fn tangent(&mut self, element: &Element, k: usize, n: usize, dt: f64, depth: Depth) {
        let u = self.inputs(k, n);
        self.begin(element, k, n);
        element.tangent(&u, dt, &mut self.s, &mut self.fs, depth, &mut self.sensed, &mut self.scratch);
        self.end(element, k, n);
    }

    /// An opening is looked for where it was at this sample the last time: from cycle to cycle and in Newton's method on the balance it moves little.
    fn begin(&mut self, element: &Element, k: usize, n: usize) {
        if element.opens() {
            self.openings.resize(n, f64::NAN);
            self.scratch.opening = Some(self.openings[k % n]).filter(|e| e.is_finite());
        }
    }

    fn end(&mut self, element: &Element, k: usize, n: usize) {
        if element.opens() {
            self.openings[k % n] = self.s[0];
        }
    }

    /// One cycle from the periodic start with its derivatives, and their coefficients.
    fn derive(&mut self, element: &Element, basis: &Basis, omega: f64, wanted: Known) {
        if self.known >= wanted {
            return;
        }
        let full = wanted == Known::Parameters;
        let (n, w, ns) = (basis.samples, basis.width, element.n_states());
        let np = if full { element.n_params() } else { 0 };
        let columns = w + ns + np;
        sized(&mut self.slopes, ns * columns);
        (0..ns).for_each(|i| self.slopes[i * columns + w + i] = 1.0);
        if full {
            self.settle_followers(element, basis, omega);
        }
        self.s.clone_from(&self.start);
        self.rows.resize(n * columns, 0.0);
        for k in 1..=n {
            self.advance(element, basis, omega, k, columns, full);
        }
        self.sums.resize(columns * w, 0.0);
        let rows = DMatrixView::from_slice(&self.rows, columns, n);
        DMatrixViewMut::from_slice(&mut self.sums, columns, w).gemm(1.0, &rows, &basis.back, 0.0);
        self.condense(element, basis, omega, full);
        self.known = wanted;
    }

    /// One step: a row of `rows` becomes the derivative of the force, `slopes` those of the states.
    fn advance(&mut self, element: &Element, basis: &Basis, omega: f64, k: usize, columns: usize, full: bool) {
        let (n, w, ns) = (basis.samples, basis.width, element.n_states());
        self.tangent(element, k, n, TAU / omega / n as f64, if full { Depth::Params } else { Depth::States });
        let i = k % n;
        let (value, rate) = (basis.row(&basis.value, i), basis.row(&basis.rate, i));
        let step = if k == 0 { value } else { basis.row(&basis.step, i) };
        self.next.resize(ns * columns, 0.0);
        for r in 0..=ns {
            let d = self.sensed.inputs(r);
            let out = if r == 0 { &mut self.rows[i * columns..(i + 1) * columns] } else { &mut self.next[(r - 1) * columns..r * columns] };
            combine(&mut out[..w], [d[0], omega * d[1], d[3]], [value, rate, step]);
            if d[2] != 0.0 {
                (1..w).for_each(|c| out[c] -= d[2] * omega * omega * (c.div_ceil(2) * c.div_ceil(2)) as f64 * value[c]);
            }
            out[w..].fill(0.0);
            if full {
                out[w + ns..].copy_from_slice(self.sensed.params(r));
            }
            for (j, by_state) in self.sensed.states(r).iter().enumerate().filter(|(_, b)| **b != 0.0) {
                out.iter_mut().zip(&self.slopes[j * columns..(j + 1) * columns]).for_each(|(o, s)| *o += by_state * s);
            }
        }
        std::mem::swap(&mut self.slopes, &mut self.next);
    }

    fn take_monodromy(&mut self, ns: usize, columns: usize, first: usize) {
        self.monodromy.clear();
        for i in 0..ns {
            self.monodromy.extend_from_slice(&self.slopes[i * columns + first..i * columns + first + ns]);
        }
    }

    /// Folds the derivatives with respect to the start into those with respect to displacement and parameters: the start moves with
    /// them so that the states stay periodic, `S = M S + b`.
    fn condense(&mut self, element: &Element, basis: &Basis, omega: f64, full: bool) {
        let (w, ns) = (basis.width, element.n_states());
        let np = if full { element.n_params() } else { 0 };
        let (columns, kept) = (w + ns + np, w + np);
        if ns > 0 {
            self.take_monodromy(ns, columns, w);
            let forced = |slopes: &[f64], out: &mut Vec<f64>| {
                out.clear();
                for i in 0..ns {
                    let row = &slopes[i * columns..(i + 1) * columns];
                    out.extend_from_slice(&row[..w]);
                    out.extend_from_slice(&row[w + ns..]);
                }
            };
            let (mut b, mut path) = (std::mem::take(&mut self.start_slopes), std::mem::take(&mut self.path));
            forced(&self.slopes, &mut b);
            if self.fixed.never_decays(&self.monodromy, &self.state_scale) {
                // What never decays moves as the loading path from rest moves it: S = P + (I - M)^+ (b - (I - M) P).
                self.loading_path(element, basis, omega, columns, full);
                forced(&self.slopes, &mut path);
                for i in 0..ns {
                    for c in 0..kept {
                        let by_start: f64 = (0..ns).map(|j| self.monodromy[i * ns + j] * path[j * kept + c]).sum();
                        b[i * kept + c] += by_start - path[i * kept + c];
                    }
                }
                self.fixed.solve(&self.monodromy, &self.state_scale, &mut b, kept);
                b.iter_mut().zip(&path).for_each(|(s, p)| *s += p);
            } else {
                self.fixed.solve(&self.monodromy, &self.state_scale, &mut b, kept);
            }
            (self.start_slopes, self.path, self.kept) = (b, path, kept);
        }
        self.jacobian.clear();
        self.by_param.clear();
        for r in 0..w {
            let sums = &self.sums[r * columns..(r + 1) * columns];
            let by_start = |c: usize| (0..ns).map(|i| sums[w + i] * self.start_slopes[i * kept + c]).sum::<f64>();
            self.jacobian.extend((0..w).map(|c| sums[c] + by_start(c)));
            self.by_param.extend((0..np).map(|p| sums[w + ns + p] + by_start(w + p)));
        }
    }

    /// Derivatives of the states along the path from rest through the first cycle, left in `slopes`.
    fn loading_path(&mut self, element: &Element, basis: &Basis, omega: f64, columns: usize, full: bool) {
        sized(&mut self.s, element.n_states());
        sized(&mut self.slopes, element.n_states() * columns);
        for k in 0..=basis.samples {
            self.advance(element, basis, omega, k, columns, full);
        }
    }

    /// Brings the followers' states to the start of their steady cycle: [`FOLLOWED`] cycles, then the limit of a geometric approach.
    fn settle_followers(&mut self, element: &Element, basis: &Basis, omega: f64) {
        let n = basis.samples;
        sized(&mut self.fs, element.n_follower_states());
        if self.fs.is_empty() {
            return;
        }
        let dt = TAU / omega / n as f64;
        if !element.has_openings() {
            return self.settle_forces(element, n, dt);
        }
        let mut seen = [self.fs.clone(), self.fs.clone()];
        for cycle in 0..=FOLLOWED {
            if cycle > 0 {
                self.s.clone_from(&self.start);
                seen.swap(0, 1);
                seen[1].clone_from(&self.fs);
            }
            // The first round also takes the step from rest to the first sample.
            let first = if cycle == 0 { 0 } else { 1 };
            if cycle == 0 {
                sized(&mut self.s, element.n_states());
            }
            for k in first..=n {
                let u = self.inputs(k, n);
                element.tangent(&u, dt, &mut self.s, &mut self.fs, Depth::Params, &mut self.sensed, &mut self.scratch);
            }
        }
        let [first, second] = &seen;
        extrapolate(&mut self.fs, first, second);
    }

    /// The same of candidates in parallel, each by itself for as many cycles as it needs: a friction is periodic after its first.
    fn settle_forces(&mut self, element: &Element, n: usize, dt: f64) {
        let mut from = 0;
        for k in 0..element.n_followers() {
            let mut s = element.follower_states(k);
            let to = from + s.len();
            let mut seen = [s.clone(), s.clone()];
            for cycle in 0..=FOLLOWED {
                if s.is_empty() {
                    break;
                }
                seen.swap(0, 1);
                seen[1].clone_from(&s);
                for step in usize::from(cycle > 0)..=n {
                    element.follower_force(k, &self.inputs(step, n), dt, &mut s, &mut self.scratch);
                }
                let same = |(a, b): (&f64, &f64)| (a - b).abs() <= ALIKE * a.abs();
                if cycle > 0 && s.iter().zip(&seen[1]).all(same) {
                    break;
                }
            }
            let [first, second] = &seen;
            extrapolate(&mut s, first, second);
            self.fs[from..to].copy_from_slice(&s);
            from = to;
        }
    }
}
