//! Laws written in Python: registered beside the library, called back by the engines, differentiated by [`Dual`].

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

use misfit::effect::dispatch::{INPUTS, Wanted};
use misfit::effect::{Dim, EffectError, ForceLaw, Grid, Info, Inputs, Kind, Param, Ports, Role, Sign, Tangent};
use misfit::units::{Dimension, parse_unit_any};
use misfit::work::Failure;
use num_complex::Complex64;
use num_dual::DualDVec64;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::dual::Dual;
use crate::error::{raise, refuse};
use crate::stiffness;

/// Whether there is any law of Python. Calls take turns then, so that what a law met with belongs to one call.
static ANY: AtomicBool = AtomicBool::new(false);
static CALL: Mutex<()> = Mutex::new(());
/// The first exception that a law raised in the call under way, which is raised from the call.
static FAULT: Mutex<Option<PyErr>> = Mutex::new(None);
static RAISED: AtomicBool = AtomicBool::new(false);
/// The first value that was no number. A step of a fit may try such a point and turn back, so it is told only where the call comes to nothing.
static ODD: Mutex<Option<String>> = Mutex::new(None);

/// Forgets what earlier calls met with.
pub fn clear() {
    RAISED.store(false, Ordering::Relaxed);
    *FAULT.lock().unwrap_or_else(PoisonError::into_inner) = None;
    *ODD.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// The turn of a call.
pub struct Turn {
    lock: Option<MutexGuard<'static, ()>>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        if self.lock.is_some() {
            HOLDS.set(false);
        }
    }
}

/// Waits for the turn of a call; a call out of the progress of another one is part of it.
///
/// # Errors
/// Ctrl-C; a call out of a law, which would wait for itself.
pub fn turn(py: Python<'_>) -> PyResult<Turn> {
    if INSIDE.get() {
        return Err(refuse(py, "effect", "", "a law of Python asked for a computation", "numbers, and functions of NumPy"));
    }
    if !ANY.load(Ordering::Relaxed) || HOLDS.get() {
        return Ok(Turn { lock: None });
    }
    loop {
        match CALL.try_lock() {
            Err(TryLockError::WouldBlock) => {
                py.detach(|| std::thread::sleep(Duration::from_millis(5)));
                py.check_signals()?;
            }
            Ok(lock) => {
                HOLDS.set(true);
                return Ok(Turn { lock: Some(lock) });
            }
            Err(TryLockError::Poisoned(lock)) => {
                HOLDS.set(true);
                return Ok(Turn { lock: Some(lock.into_inner()) });
            }
        }
    }
}

/// Whether a law has raised an exception.
pub fn raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}

/// That exception.
pub fn take() -> Option<PyErr> {
    FAULT.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// A failure with what a law returned, where that was no number.
pub fn explained(failure: Failure) -> Failure {
    let Some(odd) = ODD.lock().unwrap_or_else(PoisonError::into_inner).take() else { return failure };
    let stage = failure.json()["error"]["stage"].as_str().unwrap_or_default().to_string();
    Failure::new(&stage, failure.place(), format!("{} ({odd})", failure.message()), failure.accepted())
}

/// One thread at a time: they would only contend for the interpreter lock, which is dearer than a mutex.
static TURN: Mutex<()> = Mutex::new(());

thread_local! {
    /// Whether Python knows this thread.
    static KNOWN: Cell<bool> = const { Cell::new(false) };
    /// Whether this thread has the turn.
    static HOLDS: Cell<bool> = const { Cell::new(false) };
    /// Whether this thread is inside of a law.
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// `work` with the interpreter lock. A thread of rayon's pool is made known to Python once and for good: Python makes and destroys its state of a
/// thread at every attachment otherwise, which takes longer than most laws.
fn attached<T>(work: impl FnOnce(Python<'_>) -> T) -> T {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    if rayon::current_thread_index().is_some() && !KNOWN.replace(true) {
        // SAFETY: the interpreter runs, since it called what is computed here. The lock that is taken is given back at once; the state of the
        // thread stays, and later attachments find it.
        unsafe {
            pyo3::ffi::PyGILState_Ensure();
            pyo3::ffi::PyEval_SaveThread();
        }
    }
    INSIDE.set(true);
    let done = Python::attach(work);
    INSIDE.set(false);
    done
}

/// What an argument of the function is.
#[derive(Clone, Copy)]
enum Argument {
    /// x, v, a, dx.
    Motion(usize),
    Dt,
    State(usize),
    Parameter(usize),
}

/// A force law whose update is a function of Python.
struct PyLaw {
    info: &'static Info,
    arguments: Vec<Argument>,
    function: Py<PyAny>,
    presses: bool,
}

impl PyLaw {
    /// Force and new states at the given numbers.
    fn call<'py>(
        &self,
        py: Python<'py>,
        dt: f64,
        number: &dyn Fn(Argument) -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let one = |a: &Argument| match a {
            Argument::Dt => Ok(dt.into_pyobject(py)?.into_any()),
            other => number(*other),
        };
        let arguments = self.arguments.iter().map(one).collect::<PyResult<Vec<_>>>()?;
        let result = self.function.bind(py).call1(PyTuple::new(py, arguments)?)?;
        let all: Vec<Bound<'py, PyAny>> = match (result.cast::<PyTuple>(), result.cast::<PyList>()) {
            (Ok(t), _) => t.iter().collect(),
            (_, Ok(l)) => l.iter().collect(),
            _ => vec![result],
        };
        if all.len() != 1 + self.info.states {
            let message = format!("the law returns {} numbers", all.len());
            let accepted =
                if self.info.states == 0 { "the force".into() } else { format!("the force and {} new states", self.info.states) };
            return Err(refuse(py, "effect", self.info.name, message, &accepted));
        }
        Ok(all)
    }

    fn evaluate(&self, py: Python<'_>, u: &Inputs<f64>, dt: f64, s: &[f64], p: &[f64]) -> PyResult<Vec<f64>> {
        let motion = [u.x, u.v, u.a, u.dx];
        let number = |a: Argument| {
            let value = match a {
                Argument::Motion(k) => motion[k],
                Argument::State(k) => s[k],
                Argument::Parameter(k) => p[k],
                Argument::Dt => dt,
            };
            Ok(value.into_pyobject(py)?.into_any())
        };
        self.call(py, dt, &number)?.iter().map(|v| v.extract::<f64>()).collect()
    }

    /// Force and states over dual numbers, with the columns of a [`Tangent`] that were differentiated.
    fn differentiate(
        &self,
        py: Python<'_>,
        u: &Inputs<f64>,
        dt: f64,
        (s, p): (&[f64], &[f64]),
        wanted: Wanted,
    ) -> PyResult<(Vec<Dual>, Vec<usize>)> {
        let (motion, ports) = ([u.x, u.v, u.a, u.dx], self.info.ports);
        let mut columns: Vec<usize> = (0..INPUTS).filter(|k| [ports.x, ports.v, ports.a, ports.dx][*k]).collect();
        if wanted != Wanted::Inputs {
            columns.extend((0..s.len()).map(|k| INPUTS + k));
        }
        if let Wanted::Params(active) = wanted {
            columns.extend((0..p.len()).filter(|k| active[*k]).map(|k| INPUTS + s.len() + k));
        }
        let number = |a: Argument| {
            let (value, column) = match a {
                Argument::Motion(k) => (motion[k], k),
                Argument::State(k) => (s[k], INPUTS + k),
                Argument::Parameter(k) => (p[k], INPUTS + s.len() + k),
                Argument::Dt => (dt, usize::MAX),
            };
            let dual = DualDVec64::from_re(value);
            let dual = match columns.iter().position(|c| *c == column) {
                Some(index) => dual.derivative(columns.len(), index),
                None => dual,
            };
            Ok(Bound::new(py, Dual(dual))?.into_any())
        };
        let all = self.call(py, dt, &number)?;
        let dual = |v: &Bound<'_, PyAny>| match v.cast::<Dual>() {
            Ok(d) => Ok(d.get().clone()),
            Err(_) => v.extract::<f64>().map(|v| Dual(DualDVec64::from_re(v))),
        };
        Ok((all.iter().map(dual).collect::<PyResult<_>>()?, columns))
    }

    /// Keeps the first exception, and the first value that is no number.
    fn met<T>(&self, result: PyResult<T>, finite: impl Fn(&T) -> bool, u: &Inputs<f64>, s: &[f64], p: &[f64]) -> Option<T> {
        match result {
            Ok(value) if finite(&value) => Some(value),
            Ok(value) => {
                let mut odd = ODD.lock().unwrap_or_else(PoisonError::into_inner);
                odd.get_or_insert_with(|| {
                    let named: Vec<String> = self.info.params.iter().zip(p).map(|(n, v)| format!("{} = {v:.4e}", n.name)).collect();
                    let motion = format!("x = {:.4e}, v = {:.4e}, a = {:.4e}, dx = {:.4e}", u.x, u.v, u.a, u.dx);
                    format!("the law `{}` returned no finite number at {motion}, states {s:?}, {}", self.info.name, named.join(", "))
                });
                Some(value)
            }
            Err(e) => {
                FAULT.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(e);
                RAISED.store(true, Ordering::Relaxed);
                None
            }
        }
    }
}

impl ForceLaw for PyLaw {
    fn info(&self) -> &'static Info {
        self.info
    }
    fn linear(&self) -> bool {
        false
    }
    fn superposes(&self) -> bool {
        false
    }
    fn presses(&self) -> bool {
        self.presses
    }
    fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64]) -> f64 {
        // After an exception the call ends: nothing more is asked of the law.
        if raised() {
            return f64::NAN;
        }
        let done = attached(|py| self.met(self.evaluate(py, u, dt, s, p), |v| v.iter().all(|v| v.is_finite()), u, s, p));
        let Some(all) = done else { return f64::NAN };
        s.copy_from_slice(&all[1..]);
        all[0]
    }
    fn tangent(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: Wanted, out: &mut Tangent) {
        out.reset(s.len(), p.len(), if wanted == Wanted::Inputs { 1 } else { 1 + s.len() });
        out.f = f64::NAN;
        if raised() {
            return;
        }
        let finite = |d: &(Vec<Dual>, Vec<usize>)| d.0.iter().all(|v| v.0.re.is_finite() && (0..d.1.len()).all(|k| v.slope(k).is_finite()));
        let done = attached(|py| self.met(self.differentiate(py, u, dt, (s, p), wanted), finite, u, s, p));
        let Some((all, columns)) = done else { return };
        out.f = all[0].0.re;
        s.iter_mut().zip(&all[1..]).for_each(|(s, v)| *s = v.0.re);
        let rows = if wanted == Wanted::Inputs { 1 } else { all.len() };
        for (row, value) in all.iter().enumerate().take(rows) {
            columns.iter().enumerate().for_each(|(k, column)| out.set(row, *column, value.slope(k)));
        }
    }
    fn stiffness(&self, s: Complex64, p: &[f64]) -> Result<Complex64, EffectError> {
        Ok(stiffness::stiffness(self, s, p))
    }
    fn stiffness_tangent(&self, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> Result<(Complex64, Complex64), EffectError> {
        Ok(stiffness::with_slopes(self, s, p, dp))
    }
}

/// A parameter as Python states it.
#[derive(FromPyObject)]
pub struct Stated {
    name: String,
    unit: String,
    kind: String,
    sign: String,
    default: f64,
    grid: Vec<f64>,
    of: String,
    doc: String,
}

fn leak(text: &str) -> &'static str {
    Box::leak(text.to_string().into_boxed_str())
}

/// The dimension in terms of force, displacement and time, so that it holds at a rotation too; as declared where it is none of these.
fn dim(d: Dimension) -> Dim {
    if d == Dimension::DIMENSIONLESS {
        return Dim::One;
    }
    // N = kg m/s2.
    let (f, x, t) = (d.mass, d.length - d.mass, d.time + 2 * d.mass);
    if Dimension::mechanical(d.length, d.mass, d.time, 0) == d { Dim::Place { f, x, t } } else { Dim::Declared(d) }
}

fn parameter(py: Python<'_>, law: &str, stated: &Stated) -> PyResult<Param> {
    let place = format!("{law}.{}", stated.name);
    let bad = |message: String, accepted: &str| refuse(py, "effect", &place, message, accepted);
    let unit = match stated.unit.as_str() {
        "" | "-" | "1" => Dimension::DIMENSIONLESS,
        text => parse_unit_any(text).map_err(|e| raise(py, &Failure::from(e)))?.dimension,
    };
    let sign = match stated.sign.as_str() {
        ">= 0" => Sign::NonNegative,
        "> 0" => Sign::Positive,
        "any" => Sign::Any,
        other => return Err(bad(format!("there is no sign `{other}`"), ">= 0, > 0, any")),
    };
    let kind = match stated.kind.as_str() {
        "strength" => Kind::Strength,
        "shape" => Kind::Shape,
        "setting" => Kind::Setting,
        other => return Err(bad(format!("there is no kind `{other}`"), "strength, shape, setting")),
    };
    let values: &'static [f64] = Box::leak(stated.grid.clone().into_boxed_slice());
    let grid = match (stated.of.as_str(), values.is_empty()) {
        (_, true) => Grid::None,
        ("x", _) => Grid::OfX(values),
        ("v", _) => Grid::OfV(values),
        ("", _) => Grid::Values(values),
        (other, _) => return Err(bad(format!("there is no scale `{other}`"), "x, v, or none")),
    };
    let (name, doc) = (leak(&stated.name), leak(&stated.doc));
    Ok(Param { name, dim: dim(unit), sign, kind, default: stated.default, min: sign.lowest(), max: f64::INFINITY, grid, doc })
}

fn argument(py: Python<'_>, law: &str, name: &str, states: &[String], parameters: &[Stated]) -> PyResult<Argument> {
    if let Some(k) = ["x", "v", "a", "dx"].iter().position(|m| *m == name) {
        return Ok(Argument::Motion(k));
    }
    if name == "dt" {
        return Ok(Argument::Dt);
    }
    if let Some(k) = states.iter().position(|s| s == name) {
        return Ok(Argument::State(k));
    }
    parameters.iter().position(|p| p.name == name).map(Argument::Parameter).ok_or_else(|| {
        let accepted = "x, v, a, dx, dt, a state or a parameter of the law";
        refuse(py, "effect", law, format!("the argument `{name}` is none of the law"), accepted)
    })
}

/// Tries the law once over plain and once over dual numbers, so that what it cannot do is seen where it is defined; whether it presses at rest.
fn tried(py: Python<'_>, law: &PyLaw) -> PyResult<bool> {
    let (s, p) = (vec![0.0; law.info.states], vec![1.0; law.info.params.len()]);
    let moving = Inputs { x: 1e-3, v: 1e-2, a: 0.1, dx: 1e-5 };
    law.evaluate(py, &moving, 1e-3, &s, &p)?;
    law.differentiate(py, &moving, 1e-3, (&s, &p), Wanted::Params(&vec![true; p.len()]))?;
    let rest = law.evaluate(py, &Inputs::default(), 1e-3, &s, &p)?;
    Ok(rest[0].is_finite() && rest[0] != 0.0)
}

/// Whether the force doubles with the first parameter and the states do not see it, at one motion.
fn proportional(py: Python<'_>, law: &PyLaw) -> PyResult<bool> {
    let (s, mut p) = (vec![0.1; law.info.states], vec![1.0; law.info.params.len()]);
    let moving = Inputs { x: 0.7, v: 0.4, a: 0.3, dx: 0.05 };
    let one = law.evaluate(py, &moving, 1e-2, &s, &p)?;
    p[0] = 2.0;
    let two = law.evaluate(py, &moving, 1e-2, &s, &p)?;
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (a.abs() + b.abs());
    Ok(close(2.0 * one[0], two[0]) && one[1..].iter().zip(&two[1..]).all(|(a, b)| close(*a, *b)))
}

/// Registers a law. `arguments` names what the function is called with, in order; `states` what it returns after the force.
#[pyfunction]
#[pyo3(signature = (name, function, arguments, parameters, states, claim, equation, searched))]
pub fn register(
    py: Python<'_>,
    name: &str,
    function: Py<PyAny>,
    arguments: Vec<String>,
    parameters: Vec<Stated>,
    states: Vec<String>,
    claim: &str,
    equation: &str,
    searched: bool,
) -> PyResult<()> {
    let params = parameters.iter().map(|p| parameter(py, name, p)).collect::<PyResult<Vec<_>>>()?;
    let has = |motion: &str| arguments.iter().any(|a| a == motion);
    let info: &'static Info = Box::leak(Box::new(Info {
        name: leak(name),
        role: Role::Force,
        claim: leak(claim),
        equation: leak(equation),
        params: Box::leak(params.into_boxed_slice()),
        states: states.len(),
        ports: Ports { x: has("x"), v: has("v"), a: has("a"), dx: has("dx") },
        family: "own",
        source: "a function of Python",
        range: "for trying out: every step calls Python; `formula` says the same at full speed",
    }));
    let arguments = arguments.iter().map(|a| argument(py, name, a, &states, &parameters)).collect::<PyResult<_>>()?;
    let mut law = PyLaw { info, arguments, function, presses: false };
    law.presses = tried(py, &law)?;
    if searched && !proportional(py, &law)? {
        let first = info.params.first().map_or("", |p| p.name);
        let accepted = format!("a force proportional to `{first}`, and states that do not depend on it; or search=False");
        return Err(refuse(py, "effect", name, format!("the force is not proportional to its first parameter `{first}`"), &accepted));
    }
    ANY.store(true, Ordering::Relaxed);
    misfit::effect::register(Box::new(law), searched).map(drop).map_err(|e| raise(py, &Failure::from(e)))
}
