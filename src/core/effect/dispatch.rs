//! From a generic law to an object: values over `f64`, tangents over dual numbers of the size the law needs.

use std::marker::PhantomData;

use nalgebra::Const;
use num_complex::{Complex, Complex64};
use num_dual::{Derivative, Dual, DualSVec64};
use smallvec::SmallVec;

use super::{EffectError, Force, Formula, Info, Inputs, Num, Ports};

/// Derivatives of one constitutive update.
///
/// Row 0 is the force, row `1 + k` the new state `k`, as far as they were asked for. Columns: `x, v, a, dx`, the old states, the parameters.
#[derive(Clone, Debug, Default)]
pub struct Tangent {
    /// Force at the end of the step.
    pub f: f64,
    n_states: usize,
    n_params: usize,
    d: Vec<f64>,
}

/// Columns of the four motion inputs in a [`Tangent`].
pub const INPUTS: usize = 4;

impl Tangent {
    /// Sets the sizes and zeroes the first `rows` rows, all that there are then; allocates only when it grows.
    pub fn reset(&mut self, n_states: usize, n_params: usize, rows: usize) {
        (self.n_states, self.n_params) = (n_states, n_params);
        self.d.clear();
        self.d.resize(rows * (INPUTS + n_states + n_params), 0.0);
    }
    #[inline]
    fn stride(&self) -> usize {
        INPUTS + self.n_states + self.n_params
    }
    /// Derivatives of row `row` with respect to `x, v, a, dx`.
    #[inline]
    pub fn inputs(&self, row: usize) -> &[f64] {
        let at = row * self.stride();
        &self.d[at..at + INPUTS]
    }
    /// Derivatives of row `row` with respect to the old states.
    #[inline]
    pub fn states(&self, row: usize) -> &[f64] {
        let at = row * self.stride() + INPUTS;
        &self.d[at..at + self.n_states]
    }
    /// Derivatives of row `row` with respect to the parameters.
    #[inline]
    pub fn params(&self, row: usize) -> &[f64] {
        let at = row * self.stride() + INPUTS + self.n_states;
        &self.d[at..at + self.n_params]
    }
    /// Sets the derivative of row `row` in a column: `x, v, a, dx`, the old states, the parameters.
    #[inline]
    pub fn set(&mut self, row: usize, col: usize, value: f64) {
        let at = row * self.stride() + col;
        self.d[at] = value;
    }
}

/// Which derivatives of an update are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted<'a> {
    /// Of the force with respect to the inputs: there is row 0 alone.
    Inputs,
    /// Of the force and the new states with respect to the inputs and the old states.
    States,
    /// Also with respect to the parameters marked.
    Params(&'a [bool]),
}

/// A force law behind a pointer.
pub trait ForceLaw: Send + Sync {
    /// What the law says of itself.
    fn info(&self) -> &'static Info;
    /// [`Force::LINEAR`].
    fn linear(&self) -> bool;
    /// [`Force::SUPERPOSES`].
    fn superposes(&self) -> bool;
    /// [`Force::PRESSES`].
    fn presses(&self) -> bool {
        false
    }
    /// [`Force::AT_DRIVE`].
    fn at_drive(&self) -> Option<usize> {
        None
    }
    /// [`Force::LOOKS_BACK`].
    fn looks_back(&self) -> usize {
        0
    }
    /// The formula it is, if it comes from a study file.
    fn formula(&self) -> Option<&Formula> {
        None
    }
    /// [`Force::advance`] in plain numbers.
    fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64]) -> f64;
    /// [`Force::advance`] with its derivatives.
    fn tangent(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent);
    /// [`Force::stiffness`] in plain numbers.
    fn stiffness(&self, s: Complex64, p: &[f64]) -> Result<Complex64, EffectError>;
    /// The value of [`ForceLaw::stiffness_about`] alone.
    fn stiffness_at(&self, s: Complex64, x: f64, p: &[f64]) -> Result<Complex64, EffectError> {
        if self.linear() || self.info().states > 0 {
            return self.stiffness(s, p);
        }
        Ok(dynamic(s, held(self, x, p)))
    }
    /// Dynamic stiffness of small motion about a held displacement `x`, for a law without states; otherwise as
    /// [`ForceLaw::stiffness_tangent`]. Third: its derivative with respect to `x`.
    /// Here by differences of the exact tangent.
    fn stiffness_about(
        &self,
        s: Complex64,
        x: f64,
        p: &[f64],
        dp: &mut [Complex64],
    ) -> Result<(Complex64, Complex64, Complex64), EffectError> {
        if self.linear() || self.info().states > 0 {
            return self.stiffness_tangent(s, p, dp).map(|(z, dz)| (z, dz, Complex64::new(0.0, 0.0)));
        }
        let tangent = |x: f64, p: &[f64]| held(self, x, p);
        let slope = |value: f64, at: &dyn Fn(f64) -> [f64; 3]| {
            let h = 1e-5 * value.abs().max(1e-9);
            (dynamic(s, at(value + h)) - dynamic(s, at(value - h))) / (2.0 * h)
        };
        for (k, out) in dp.iter_mut().enumerate() {
            *out = slope(p[k], &|value| {
                let mut moved = p.to_vec();
                moved[k] = value;
                tangent(x, &moved)
            });
        }
        let [k, c, m] = tangent(x, p);
        Ok((dynamic(s, [k, c, m]), s * (2.0 * m) + c, slope(x, &|x| tangent(x, p))))
    }
    /// Dynamic stiffness with its derivatives with respect to the complex frequency and to every parameter (`dp`, one per parameter).
    fn stiffness_tangent(&self, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> Result<(Complex64, Complex64), EffectError>;
}

/// Slopes of a law without states about a held displacement: by displacement, velocity and acceleration.
fn held<L: ForceLaw + ?Sized>(law: &L, x: f64, p: &[f64]) -> [f64; 3] {
    let mut t = Tangent::default();
    law.tangent(&Inputs { x, ..Inputs::default() }, 1.0, &mut [], p, Wanted::Inputs, &mut t);
    let d = t.inputs(0);
    [d[0], d[1], d[2]]
}

/// The dynamic stiffness that such slopes are at `s`.
fn dynamic(s: Complex64, [k, c, m]: [f64; 3]) -> Complex64 {
    s * s * m + s * c + k
}

/// The one implementation of [`ForceLaw`], for every law.
pub struct Dispatch<L>(PhantomData<L>);

impl<L> Dispatch<L> {
    /// The object.
    pub const NEW: Self = Self(PhantomData);
}

/// Largest number of states and of parameters a law may have, and as many as most have.
const MAX: usize = 32;
const FEW: usize = 4;

#[inline]
fn seed<const N: usize>(value: f64, next: &mut usize) -> DualSVec64<N> {
    let dual = DualSVec64::<N>::from_re(value).derivative(*next);
    *next += 1;
    dual
}

#[inline]
fn slope<const N: usize>(eps: &Derivative<f64, Const<N>, nalgebra::U1>, i: usize) -> f64 {
    eps.0.as_ref().map_or(0.0, |m| m[i])
}

/// A constitutive update of an object, generic over the number type.
pub(super) trait Update {
    /// Fewest and most columns of its tangent.
    const COLUMNS: (usize, usize) = (0, MAX);
    /// [`Force::PARALLEL`].
    const PARALLEL: bool = false;
    /// Inputs it reads.
    fn ports(&self) -> Ports;
    /// [`Force::advance`].
    fn advance<T: Num>(&self, u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T;
}

impl<L: Force> Update for Dispatch<L> {
    const COLUMNS: (usize, usize) = {
        let least = L::INFO.ports.count() + if L::PARALLEL { 1 } else { L::INFO.states };
        (least, least + L::INFO.params.len())
    };
    const PARALLEL: bool = L::PARALLEL;
    fn ports(&self) -> Ports {
        L::INFO.ports
    }
    #[inline]
    fn advance<T: Num>(&self, u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        L::advance(u, dt, s, p)
    }
}

fn tangent_n<A: Update, const N: usize>(law: &A, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent) {
    let (ns, np) = (s.len(), p.len());
    let active = |k: usize| matches!(wanted, Wanted::Params(active) if active[k]);
    let ports = law.ports();
    let mut next = 0;
    let mut columns = [0usize; MAX];
    let constant = DualSVec64::<N>::from_re;
    let mut pick = |on: bool, value: f64, column: usize| {
        if !on {
            return constant(value);
        }
        columns[next] = column;
        seed::<N>(value, &mut next)
    };
    let inputs = Inputs { x: pick(ports.x, u.x, 0), v: pick(ports.v, u.v, 1), a: pick(ports.a, u.a, 2), dx: pick(ports.dx, u.dx, 3) };
    // A list that grows, or an array of the most there may be, costs more to fill than most laws to evaluate.
    let zero = constant(0.0);
    let (mut few, mut many) = ([zero; FEW], SmallVec::<[DualSVec64<N>; MAX]>::new());
    let params: &[DualSVec64<N>] = if np <= FEW {
        (0..np).for_each(|k| few[k] = pick(active(k), p[k], INPUTS + ns + k));
        &few[..np]
    } else {
        many.extend((0..np).map(|k| pick(active(k), p[k], INPUTS + ns + k)));
        &many
    };
    let (mut few_states, mut many_states) = ([zero; FEW], SmallVec::<[DualSVec64<N>; MAX]>::new());
    let states: &mut [DualSVec64<N>] = if ns <= FEW {
        &mut few_states[..ns]
    } else {
        many_states.resize(ns, zero);
        &mut many_states
    };
    if A::PARALLEL {
        let mut own = next;
        let shared = seed::<N>(0.0, &mut own);
        states.iter_mut().zip(s.iter()).for_each(|(state, s)| *state = shared + *s);
    } else {
        states.iter_mut().enumerate().for_each(|(k, state)| *state = pick(true, s[k], INPUTS + k));
    }
    let force = law.advance(&inputs, dt, states, params);
    out.reset(ns, np, if wanted == Wanted::Inputs { 1 } else { 1 + ns });
    out.f = force.re;
    for (s, state) in s.iter_mut().zip(states.iter()) {
        *s = state.re;
    }
    if wanted == Wanted::Inputs {
        let inputs = columns[..next].iter().enumerate().filter(|(_, column)| **column < INPUTS);
        inputs.for_each(|(i, &column)| out.set(0, column, slope(&force.eps, i)));
        return;
    }
    for (i, &column) in columns[..next].iter().enumerate() {
        out.set(0, column, slope(&force.eps, i));
        for (k, state) in states.iter().enumerate() {
            out.set(1 + k, column, slope(&state.eps, i));
        }
    }
    if A::PARALLEL {
        let sum: f64 = states.iter().map(|state| slope(&state.eps, next)).sum();
        let each = if sum == 0.0 { 0.0 } else { slope(&force.eps, next) / sum };
        for (k, state) in states.iter().enumerate() {
            let own = slope(&state.eps, next);
            out.set(1 + k, INPUTS + k, own);
            out.set(0, INPUTS + k, each * own);
        }
    }
}

/// [`ForceLaw::tangent`] with dual numbers of the size that is needed.
pub(super) fn tangent<A: Update>(law: &A, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent) {
    let states = if A::PARALLEL { 1 } else { s.len() };
    let active = if let Wanted::Params(active) = wanted { active.iter().filter(|b| **b).count() } else { 0 };
    let columns = law.ports().count() + states + active;
    // Only sizes that the law can need are compiled.
    macro_rules! sizes {
        ($above:literal $size:literal $($rest:literal)*) => {
            if const { A::COLUMNS.0 <= $size && A::COLUMNS.1 > $above } {
                if columns <= $size {
                    return tangent_n::<A, $size>(law, u, dt, s, p, wanted, out);
                }
            }
            sizes!($size $($rest)*);
        };
        ($above:literal) => {};
    }
    sizes!(0 2 4 8 16 32);
    unreachable!("a law has no more columns than it declares");
}

/// [`ForceLaw::stiffness_tangent`] of a stiffness written over dual numbers in the complex frequency and up to seven parameters.
pub(super) fn stiffness_tangent(
    name: &'static str,
    s: Complex64,
    p: &[f64],
    dp: &mut [Complex64],
    stiffness: impl Fn(Complex<DualSVec64<8>>, &[DualSVec64<8>]) -> Result<Complex<DualSVec64<8>>, &'static str>,
) -> Result<(Complex64, Complex64), EffectError> {
    let mut next = 0;
    // The stiffness is analytic in s, so its derivative along the real axis is the complex derivative.
    let s = Complex::new(seed::<8>(s.re, &mut next), DualSVec64::from_re(s.im));
    let mut params = [DualSVec64::<8>::from_re(0.0); 8];
    for (k, value) in p.iter().enumerate().take(7) {
        params[k] = seed::<8>(*value, &mut next);
    }
    let z = stiffness(s, &params[..p.len()]).map_err(|remedy| EffectError::NoSmallSignal { name, remedy })?;
    let d = |i: usize| Complex64::new(slope(&z.re.eps, i), slope(&z.im.eps, i));
    for (k, out) in dp.iter_mut().enumerate() {
        *out = d(1 + k);
    }
    Ok((Complex64::new(z.re.re, z.im.re), d(0)))
}

impl<L: Force> ForceLaw for Dispatch<L> {
    fn info(&self) -> &'static Info {
        &L::INFO
    }

    fn linear(&self) -> bool {
        L::LINEAR
    }

    fn superposes(&self) -> bool {
        L::SUPERPOSES
    }

    fn presses(&self) -> bool {
        L::PRESSES
    }

    fn at_drive(&self) -> Option<usize> {
        L::AT_DRIVE
    }

    fn looks_back(&self) -> usize {
        L::LOOKS_BACK
    }

    fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64]) -> f64 {
        L::advance(u, dt, s, p)
    }

    fn tangent(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent) {
        tangent(self, u, dt, s, p, wanted, out);
    }

    fn stiffness(&self, s: Complex64, p: &[f64]) -> Result<Complex64, EffectError> {
        L::stiffness(s, p).map_err(|remedy| EffectError::NoSmallSignal { name: L::INFO.name, remedy })
    }

    fn stiffness_about(
        &self,
        s: Complex64,
        x: f64,
        p: &[f64],
        dp: &mut [Complex64],
    ) -> Result<(Complex64, Complex64, Complex64), EffectError> {
        if L::LINEAR || L::INFO.states > 0 {
            // What remembers is stuck where it is, and moves about there as about rest.
            return self.stiffness_tangent(s, p, dp).map(|(z, dz)| (z, dz, Complex64::new(0.0, 0.0)));
        }
        type Outer = Dual<DualSVec64<8>>;
        let mut params = [Outer::from_re(DualSVec64::from_re(0.0)); 8];
        for (k, value) in p.iter().enumerate().take(7) {
            params[k] = Outer::from_re(DualSVec64::<8>::from_re(*value).derivative(1 + k));
        }
        // Derivative with respect to one input as a dual number over x and the parameters.
        let along = |which: usize| -> DualSVec64<8> {
            let input = |k: usize, re: DualSVec64<8>| Outer::new(re, DualSVec64::from_re(f64::from(k == which)));
            let zero = DualSVec64::from_re(0.0);
            let u = Inputs {
                x: input(0, DualSVec64::from_re(x).derivative(0)),
                v: input(1, zero),
                a: input(2, zero),
                dx: Outer::from_re(zero),
            };
            L::advance(&u, 1.0, &mut [], &params[..p.len()]).eps
        };
        let zero = DualSVec64::from_re(0.0);
        let ports = L::INFO.ports;
        let k = if ports.x { along(0) } else { zero };
        let c = if ports.v { along(1) } else { zero };
        let m = if ports.a { along(2) } else { zero };
        let sum = |f: &dyn Fn(&DualSVec64<8>) -> f64| s * s * f(&m) + s * f(&c) + f(&k);
        for (j, out) in dp.iter_mut().enumerate() {
            *out = sum(&|d| slope(&d.eps, 1 + j));
        }
        Ok((sum(&|d| d.re), s * (2.0 * m.re) + c.re, sum(&|d| slope(&d.eps, 0))))
    }

    fn stiffness_tangent(&self, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> Result<(Complex64, Complex64), EffectError> {
        stiffness_tangent(L::INFO.name, s, p, dp, L::stiffness)
    }
}

/// `T` for plain numbers must be one of the generic ones as well; this keeps that promise at compile time.
const _: fn() = || {
    fn is_num<T: Num>() {}
    is_num::<f64>();
    is_num::<DualSVec64<8>>();
};
