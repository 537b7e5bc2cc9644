//! The residual of a study as a function of its free parameters, for SciPy, emcee, PyMC.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use misfit::diagnose::Case;
use misfit::diagnose::results::SplitName;
use misfit::identify::{EvalError, LeastSquares};
use misfit::model::{FreeParam, System};
use misfit::parallel::{Watch, watched};
use misfit::residual::Problem;
use misfit::study::{Study, unit_of};
use misfit::work::Failure;
use nalgebra::{DMatrix, DVector};
use numpy::ndarray::{Array2, ShapeBuilder};
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike1};
use pyo3::prelude::*;

use crate::error::{raise, refuse};
use crate::watch::{self, Event};

/// A study made ready: residual and Jacobian in the physical values of its free parameters [SI].
#[pyclass(frozen, module = "misfit._native")]
pub struct Model {
    study: Study,
    case: Case,
    free: Vec<FreeParam>,
    /// A copy of both that an evaluation takes and gives back: to make one anew costs a hundredth of a short evaluation.
    spare: Mutex<Option<(System, Vec<FreeParam>)>>,
    /// Whether the last evaluation was short: a thread that listens for Ctrl-C meanwhile is then dearer than waiting for the end.
    quick: AtomicBool,
}

/// An evaluation is short up to this time.
const QUICK: Duration = Duration::from_millis(100);

type Values<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

/// Residuals and Jacobian as arrays.
type WithSlopes<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// Whole rows: residuals, and their derivatives where they are asked for.
type Rows = (DVector<f64>, Option<DMatrix<f64>>);

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (path, data=None, seed=1))]
    fn new(py: Python<'_>, path: std::path::PathBuf, data: Option<std::path::PathBuf>, seed: u64) -> PyResult<Self> {
        let load = || -> Result<Model, Failure> {
            let study = Study::load(&path, data.as_deref())?;
            let case = Case::from_study(&study, seed)?;
            Ok(Model::of(study, case))
        };
        let (loaded, ended) = Self::watched(py, load)?;
        ended.map_or_else(|| loaded.map_err(|e| raise(py, &crate::law::explained(e))), Err)
    }

    /// Names of the free parameters, `at.effect.parameter`.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.free.iter().map(|f| f.name.clone()).collect()
    }

    /// Their units in which the study prints them; the values here are in SI all the same.
    #[getter]
    fn units(&self) -> Vec<String> {
        let s = &self.study;
        self.free.iter().map(|f| unit_of(&s.system, &s.dataset, &s.system.instances[f.instance], f.param).symbol).collect()
    }

    /// Values in the study [SI].
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.free.iter().map(|f| self.param(f).value))
    }

    /// Lower and upper bounds [SI].
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let of = |bound: fn(&misfit::model::ParamValue) -> f64| PyArray1::from_iter(py, self.free.iter().map(|f| bound(self.param(f))));
        (of(|p| p.min), of(|p| p.max))
    }

    /// The same model in as many time steps as the noise asks for at the parameters `p` [SI], as a fit ends with.
    fn refined(&self, py: Python<'_>, p: Values<'_>) -> PyResult<Model> {
        let variables = self.variables(py, &p.as_array().iter().copied().collect::<Vec<_>>())?;
        let work = || {
            let at = Problem { free: self.free.clone(), ..Problem::new(vec![], self.system()) }.system_at(&variables);
            self.case.refined(&at).unwrap_or_else(|| self.case.clone())
        };
        let (case, ended) = Self::watched(py, work)?;
        ended.map_or_else(|| Ok(Model::of(self.study.clone(), case)), Err)
    }

    /// Whitened residuals (computed - measured) / sigma of the tests of `splits` at the parameters `p` [SI].
    #[pyo3(signature = (p, splits=vec!["fit".to_string()]))]
    fn residual<'py>(&self, py: Python<'py>, p: Values<'py>, splits: Vec<String>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (r, _) = self.rows(py, p.as_array().iter().copied().collect(), &splits, false)?;
        Ok(PyArray1::from_vec(py, Vec::from(r.data)))
    }

    /// Seconds of so many calls of the same without Python, for `python/bench`.
    fn seconds(&self, py: Python<'_>, p: Values<'_>, calls: usize) -> PyResult<Vec<f64>> {
        let variables = self.variables(py, &p.as_array().iter().copied().collect::<Vec<_>>())?;
        let problem = Problem { free: self.free.clone(), ..Problem::new(self.case.plans_of(SplitName::Fit), self.system()) };
        let call = |_| {
            let began = Instant::now();
            std::hint::black_box(problem.residuals(&variables)).map(|_| began.elapsed().as_secs_f64())
        };
        let seconds: Result<_, EvalError> = py.detach(|| (0..calls).map(call).collect());
        seconds.map_err(|e| raise(py, &crate::law::explained(Failure::from(misfit::identify::IdentifyError::StartFails(e)))))
    }

    /// Residuals with their derivatives with respect to `p`, one row a residual.
    #[pyo3(signature = (p, splits=vec!["fit".to_string()]))]
    fn jacobian<'py>(&self, py: Python<'py>, p: Values<'py>, splits: Vec<String>) -> PyResult<WithSlopes<'py>> {
        let (r, j) = self.rows(py, p.as_array().iter().copied().collect(), &splits, true)?;
        let j = j.unwrap_or_else(|| DMatrix::zeros(r.len(), 0));
        let shape = j.shape();
        let j = Array2::from_shape_vec(shape.f(), Vec::from(j.data))
            .map_err(|e| refuse(py, "identify", "jacobian", e.to_string(), "as many values as rows and columns"))?;
        Ok((PyArray1::from_vec(py, Vec::from(r.data)), PyArray2::from_owned_array(py, j)))
    }
}

impl Model {
    fn of(study: Study, case: Case) -> Model {
        Model { free: case.system.free(), study, case, spare: Mutex::default(), quick: AtomicBool::new(false) }
    }

    fn param(&self, f: &FreeParam) -> &misfit::model::ParamValue {
        &self.case.system.instances[f.instance].params[f.param]
    }

    /// Work under the watch of Ctrl-C.
    fn watched<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<(T, Option<PyErr>)> {
        let flag = Arc::new(AtomicBool::new(false));
        let watch = Watch { cancel: Some(flag.clone()), deadline: None };
        let (events, heard) = channel::<Event>();
        let work = move || {
            // The waiting side sees the end of the work in the end of the channel.
            let _events = events;
            watched(&watch, work)
        };
        watch::run(py, &flag, heard, None, work)
    }

    /// The variables of the fit at physical values: logarithms where the parameter is positive over decades.
    fn variables(&self, py: Python<'_>, p: &[f64]) -> PyResult<Vec<f64>> {
        if p.len() != self.free.len() {
            let message = format!("{} values for {} free parameters", p.len(), self.free.len());
            return Err(refuse(py, "identify", "p", message, &format!("one value each of {}", self.names().join(", "))));
        }
        let one = |(f, v): (&FreeParam, &f64)| match (f.log, *v) {
            (_, v) if !v.is_finite() => Err(refuse(py, "identify", &f.name, format!("the value is {v}"), "a finite number [SI]")),
            (true, v) if v <= 0.0 => Err(refuse(py, "identify", &f.name, format!("the value is {v}"), "a number above 0 [SI]")),
            (true, v) => Ok(v.ln()),
            (false, v) => Ok(v),
        };
        self.free.iter().zip(p).map(one).collect()
    }

    fn splits(py: Python<'_>, names: &[String]) -> PyResult<Vec<SplitName>> {
        let one = |name: &String| match name.as_str() {
            "fit" => Ok(SplitName::Fit),
            "select" => Ok(SplitName::Select),
            "held_out" => Ok(SplitName::HeldOut),
            other => Err(refuse(py, "study", "splits", format!("there is no split `{other}`"), "fit, select, held_out")),
        };
        names.iter().map(one).collect()
    }

    fn rows(&self, py: Python<'_>, p: Vec<f64>, splits: &[String], slopes: bool) -> PyResult<Rows> {
        let variables = self.variables(py, &p)?;
        let splits = Self::splits(py, splits)?;
        let work = || -> Result<Rows, EvalError> {
            let plans = splits.iter().flat_map(|s| self.case.plans_of(*s)).collect();
            let spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner).take();
            let (system, free) = spare.unwrap_or_else(|| (self.system(), self.free.clone()));
            let problem = Problem { free, ..Problem::new(plans, system) };
            let rows = match slopes {
                false => problem.residuals(&variables).map(|r| (r, None)),
                true => problem.jacobian(&variables).map(|(r, j)| (r, Some(j))),
            };
            *self.spare.lock().unwrap_or_else(PoisonError::into_inner) = Some((problem.system, problem.free));
            rows
        };
        let began = Instant::now();
        let (done, ended) = if self.quick.load(Ordering::Relaxed) { watch::short(py, work) } else { Self::watched(py, work) }?;
        self.quick.store(began.elapsed() < QUICK, Ordering::Relaxed);
        if let Some(e) = ended {
            return Err(e);
        }
        let (r, mut j) =
            done.map_err(|e| raise(py, &crate::law::explained(Failure::from(misfit::identify::IdentifyError::StartFails(e)))))?;
        // The fit's variable of such a parameter is its logarithm: dr/dp = (dr/d ln p) / p.
        for k in (0..p.len()).filter(|k| self.free[*k].log) {
            if let Some(j) = &mut j {
                j.column_mut(k).scale_mut(p[k].recip());
            }
        }
        Ok((r, j))
    }

    fn system(&self) -> System {
        self.case.system.clone()
    }
}
