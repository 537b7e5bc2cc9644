//! The steady cycle under any periodic drive, forces and moved ends alike, by the same balance.
//!
//! The drive is taken apart into harmonics, `u(t) = sum_k Re(U_k e^{ikwt})`, by the discrete Fourier transform of its samples. A structure whose
//! elements are linear at every amplitude moves in these harmonics alone, each by one solution of `Z(ikw) q_k = F_k`: no step has an error there,
//! and a parameter costs one right-hand side, `Z(ikw) dq_k = -df_k`.

use nalgebra::DMatrix;
use num_complex::Complex64;
use rustfft::FftPlanner;

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::march::{Loads, Probe};
use super::super::periodic::Cycle;
use super::Settings;
use super::balance::Balance;
use super::basis::Basis;
use super::sensitivity::Source;
use super::structure::{About, Drive, Part, Structure};

/// How finely a cycle is balanced, and from where on it is not.
pub(super) struct Limits {
    /// Harmonics of a nonlinear structure under a harmonic drive; as many more as a drive has beside its first.
    pub harmonics: usize,
    /// Part of the largest harmonic of a place that the last quarter of them may be: of a motion that has more of them the series leaves out too much (a
    /// tenth of it, where a kink makes them fall by the third power).
    pub tail: f64,
    /// Samples of the cycle per harmonic.
    pub samples: usize,
    /// Change of the displacements at which the balance holds.
    pub tolerance: f64,
    /// Nonlinear places at most: the balance is one dense system of all their coefficients.
    pub places: usize,
    /// States of a nonlinear place at most: its law is sampled with the derivatives of all of them, which soon costs more than the march.
    pub states: usize,
    /// Highest harmonic of a drive at most.
    pub drive: usize,
    /// Part of the largest harmonic of a drive below which one is left out.
    pub nothing: f64,
}

/// Those of a cycle that stands for the marched one beside noise: what is left out of a drive is rounding.
const LIMITS: Limits = Limits { harmonics: 16, tail: 1e-4, samples: 16, tolerance: 1e-9, places: 8, states: 8, drive: 64, nothing: 1e-11 };

/// The steady cycle by harmonic balance; `None` where the march has to find it: parts that turn far, every degree of freedom moved, a drive with
/// steps, more nonlinear places or states of one than are worth it, a motion with more harmonics than are balanced,
/// or no balance that is found from the linear response. `loads` holds one cycle.
pub fn balanced(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Option<Cycle> {
    if model.space.is_some() { None } else { found(model, bound, loads, &Wanted { probes, sensitivities }, None, &LIMITS) }
}

/// The same within limits, `about` a position where the model is spatial.
pub(super) fn found(
    model: &Model,
    bound: &Bound,
    loads: &Loads,
    wanted: &Wanted<'_>,
    about: Option<&About>,
    limits: &Limits,
) -> Option<Cycle> {
    let steps = loads.prescribed.iter().map(|p| p.1.len()).chain(loads.forces.iter().map(|f| f.1.len())).min()?.checked_sub(1)?;
    if loads.prescribed.len() >= model.dofs.len() || steps < 4 || (model.space.is_none() && !model.attached.is_empty()) {
        return None;
    }
    let drive = drive(bound, loads, steps, limits)?;
    let mut bound = bound.apart();
    // What is attached under load is there for small motion about it alone.
    bound.elements.retain(|e| !model.attached.contains(&model.places[e.place].connector));
    let bound = &bound;
    let states: Vec<usize> = bound.elements.iter().filter(|e| !e.is_linear_at_every_amplitude()).map(|e| e.n_states()).collect();
    let nonlinear = states.len();
    if nonlinear > limits.places || states.iter().any(|n| *n > limits.states) {
        return None;
    }
    let sampled = nonlinear > 0 || (wanted.sensitivities && bound.elements.iter().any(|e| !e.followers_are_linear()));
    let omega = std::f64::consts::TAU / (loads.dt * steps as f64);
    let beside = drive.highest();
    let settings = if sampled {
        let harmonics = limits.harmonics + beside.saturating_sub(1);
        Settings { harmonics, samples: (limits.samples * harmonics).next_power_of_two(), tolerance: limits.tolerance }
    } else {
        Settings { harmonics: beside, samples: 1, tolerance: limits.tolerance }
    };
    let structure = Structure::new(model, bound, &drive, about).ok()?;
    let mut balance = Balance::of(structure, drive, &[], settings).ok()?;
    balance.settle(omega).ok()?;
    if balance.tail() > limits.tail {
        return None;
    }
    let found = read(balance, wanted, steps);
    found.ok().filter(|c| c.values.iter().chain(&c.slopes).flatten().all(|v| v.is_finite()))
}

/// What is read of the cycle.
pub(super) struct Wanted<'a> {
    pub probes: &'a [Probe],
    pub sensitivities: bool,
}

/// The drive in harmonics, with the loads that stay; `None` where it has higher ones than are worth it.
fn drive(bound: &Bound, loads: &Loads, steps: usize, limits: &Limits) -> Option<Drive> {
    let mut drive = Drive::default();
    for (dof, path) in &loads.prescribed {
        drive.held.push((*dof, series(path[..steps].iter().map(|s| s[0]), limits)?));
    }
    let mut act = |dof: usize, series: Vec<Complex64>| {
        if drive.forces.len() < series.len() {
            drive.forces.resize(series.len(), vec![]);
        }
        series.into_iter().enumerate().filter(|(_, f)| *f != Complex64::ZERO).for_each(|(k, f)| drive.forces[k].push((dof, f)));
    };
    for (dof, path) in &loads.forces {
        act(*dof, series(path[..steps].iter().copied(), limits)?);
    }
    for load in &bound.loads {
        act(load.dof, vec![Complex64::new(load.path.last().copied()?, 0.0)]);
    }
    Some(drive)
}

/// Complex amplitudes of a sampled cycle; those below a part ([`Limits::nothing`]) of the largest are left out.
fn series(samples: impl Iterator<Item = f64>, limits: &Limits) -> Option<Vec<Complex64>> {
    let mut x: Vec<Complex64> = samples.map(|v| Complex64::new(v, 0.0)).collect();
    let n = x.len();
    FftPlanner::new().plan_fft_forward(n).process(&mut x);
    let mut series: Vec<Complex64> = x[..n.div_ceil(2)].iter().map(|c| c * (2.0 / n as f64)).collect();
    series[0] *= 0.5;
    let largest = series.iter().map(|c| c.norm()).fold(0.0, f64::max);
    series.iter_mut().filter(|c| c.norm() <= limits.nothing * largest).for_each(|c| *c = Complex64::ZERO);
    let highest = series.iter().rposition(|c| *c != Complex64::ZERO).unwrap_or(0);
    series.truncate(highest + 1);
    (highest <= limits.drive).then_some(series)
}

fn read(mut balance: Balance, wanted: &Wanted<'_>, steps: usize) -> Result<Cycle, EngineError> {
    let bound = balance.structure.bound;
    let columns = if wanted.sensitivities { bound.n_free } else { 0 };
    let sources = if columns > 0 { balance.sources()? } else { vec![] };
    let answers = if columns > 0 { balance.answers(&sources) } else { DMatrix::zeros(0, 0) };
    let mut by_harmonic: Vec<Vec<&Source>> = vec![vec![]; balance.harmonics + 1];
    sources.iter().for_each(|s| by_harmonic[s.harmonic].push(s));
    let moving = balance.moving();
    let width = 1 + 2 * balance.harmonics;
    // A row for the value, and one for every derivative; a column for every coefficient.
    let mut read = vec![DMatrix::zeros(1 + columns, width); wanted.probes.len()];
    for k in (0..=balance.harmonics).filter(|k| moving.contains(k) || !by_harmonic[*k].is_empty()) {
        let line = Line::new(&mut balance, k, &by_harmonic[k], &answers, columns)?;
        for (probe, read) in wanted.probes.iter().zip(&mut read) {
            line.read(&balance, *probe, read);
        }
    }
    Ok(sampled(&read, steps, columns))
}

/// Readings over the steps from their coefficients.
fn sampled(read: &[DMatrix<f64>], steps: usize, columns: usize) -> Cycle {
    let width = read.first().map_or(1, |r| r.ncols());
    let basis = Basis::waves((width - 1) / 2, steps);
    let (mut values, mut slopes) = (Vec::new(), Vec::new());
    for coefficients in read {
        let over = coefficients * &*basis;
        // Entry k is the end of step k + 1; the start of the cycle is that of its last step.
        let from = |k: usize| (k + 1) % steps;
        values.push((0..steps).map(|k| over[(0, from(k))]).collect());
        let mut by = Vec::with_capacity(steps * columns);
        (0..steps).for_each(|k| by.extend(over.column(from(k)).iter().skip(1)));
        slopes.push(by);
    }
    Cycle { steps, columns, values, slopes, cycles: 0 }
}

/// The motion in one harmonic with its derivatives.
struct Line<'a> {
    k: usize,
    sources: &'a [&'a Source],
    answers: &'a DMatrix<f64>,
    columns: usize,
    q: Vec<Complex64>,
    /// Column after column.
    dq: Vec<Complex64>,
}

impl<'a> Line<'a> {
    fn new(
        balance: &mut Balance,
        k: usize,
        sources: &'a [&'a Source],
        answers: &'a DMatrix<f64>,
        columns: usize,
    ) -> Result<Line<'a>, EngineError> {
        let (n, omega) = (balance.structure.n, balance.omega);
        let q = balance.motion(k);
        balance.structure.factor(k, omega)?;
        let mut dq = vec![Complex64::ZERO; n * columns];
        for s in sources {
            balance.structure.load(s.element, -s.force, &mut dq[s.parameter * n..(s.parameter + 1) * n]);
        }
        for a in 0..balance.m() {
            for theta in 0..columns {
                let force = balance.answered(a, k, answers, theta);
                balance.structure.load(balance.structure.nonlinear[a], -force, &mut dq[theta * n..(theta + 1) * n]);
            }
        }
        if columns > 0 {
            balance.structure.answer(&mut dq)?;
        }
        Ok(Line { k, sources, answers, columns, q, dq })
    }

    fn column(&self, theta: usize) -> &[Complex64] {
        let n = self.q.len();
        &self.dq[theta * n..(theta + 1) * n]
    }

    /// Adds what a probe reads in this harmonic.
    fn read(&self, balance: &Balance, probe: Probe, out: &mut DMatrix<f64>) {
        let (structure, bound) = (&balance.structure, balance.structure.bound);
        let s = Complex64::new(0.0, self.k as f64 * balance.omega);
        let at = |place: usize| (0..bound.elements.len()).filter(move |e| bound.elements[*e].place == place);
        let mut add = |row: usize, x: Complex64| {
            if self.k == 0 {
                out[(row, 0)] += x.re;
            } else {
                out[(row, 2 * self.k - 1)] += x.re;
                out[(row, 2 * self.k)] -= x.im;
            }
        };
        // What is read of the motion beside where it stands, and of what it changes by.
        let mut moved = |of: &dyn Fn(&[Complex64]) -> Complex64, stands: f64, factor: Complex64| {
            add(0, factor * (of(&self.q) + stands));
            (0..self.columns).for_each(|c| add(1 + c, factor * of(self.column(c))));
        };
        let one = Complex64::ONE;
        match probe {
            Probe::Dof(d) => moved(&|q| q[d], structure.position(d, self.k), one),
            Probe::Velocity(d) => moved(&|q| q[d], 0.0, s),
            Probe::Acceleration(d) => moved(&|q| q[d], 0.0, s * s),
            Probe::Relative(p) | Probe::RelativeVelocity(p) | Probe::RelativeAcceleration(p) => {
                let factor = match probe {
                    Probe::Relative(_) => one,
                    Probe::RelativeVelocity(_) => s,
                    _ => s * s,
                };
                if let Some(e) = at(p).next() {
                    moved(&|q| structure.relative(e, q), structure.strain(e, self.k), factor);
                }
            }
            Probe::Force(p) => {
                at(p).for_each(|e| self.force(balance, e, 1.0, &mut add));
            }
            Probe::Reaction(d) => {
                moved(&|q| structure.carried(d, s, q), 0.0, one);
                for e in 0..bound.elements.len() {
                    let sign = structure.acting(e, d);
                    if sign != 0.0 {
                        self.force(balance, e, sign, &mut add);
                    }
                }
                let external = balance.drive.forces.get(self.k).into_iter().flatten().filter(|(dof, _)| *dof == d);
                external.for_each(|(_, force)| add(0, -force));
            }
        }
    }

    /// Adds the force of an element: its stiffness, what a nonlinear one has beyond it, and what a parameter changes by itself.
    fn force(&self, balance: &Balance, e: usize, sign: f64, add: &mut impl FnMut(usize, Complex64)) {
        let structure = &balance.structure;
        let z = structure.stiffness(e) * sign;
        add(0, z * structure.seen(e, self.k, &self.q));
        (0..self.columns).for_each(|c| add(1 + c, z * structure.relative(e, self.column(c))));
        if let Part::Nonlinear(a) = structure.parts[e] {
            add(0, balance.out_of_line(a, self.k) * sign);
            (0..self.columns).for_each(|c| add(1 + c, balance.answered(a, self.k, self.answers, c) * sign));
        }
        self.sources.iter().filter(|s| s.element == e).for_each(|s| add(1 + s.parameter, s.force * sign));
    }
}
