//! Where the structure is when a record begins in motion.
//!
//! A record that is cut from a longer one, or a decay, does not begin at rest: displacements and velocities at its first sample are as unknown as any parameter, and what
//! they leave rings on for `2 m / c`. They belong to the record and not to the model, so they are no parameters of a study: for every model they are those with
//! which it comes nearest to the first samples of the record (least squares in its sigma, by Gauss-Newton), and their derivatives with respect to the
//! parameters follow from the same equations. So does the `compare` of MATLAB's System Identification Toolbox, for the tests that a model is fitted to and for others alike.

use nalgebra::{DMatrix, DVector};

use crate::data::{Control, Role, TimeRecord};
use crate::engine::EngineError;
use crate::engine::march::State;
use crate::model::Model;

use super::site::{Seat, seat};

/// Part of its largest value that a channel, or its rate, has at the first sample of a record that begins in motion, and the standard deviations
/// of noise that it then has at least.
const MOVING: f64 = 0.05;
const CLEAR: f64 = 3.0;
/// Cycles from which the beginning is estimated at least, the part of the record, and samples for each unknown. What is not known of the beginning
/// after a sixteenth of the record is worth less than `16 / 2` nats along all of it.
const CYCLES: f64 = 12.0;
const PART: usize = 16;
const EACH: usize = 20;
/// Steps of Gauss-Newton, and the halvings of one, at most.
const STEPS: usize = 8;
const HALVINGS: usize = 5;
/// Change of the whitened residual, in parts of it, after which no step follows.
const STILL: f64 = 1e-5;
/// Part of what an unknown moves the channels by, by which it is moved for second derivatives.
const APART: f64 = 1e-4;
/// Unknowns at most: each is a column of a march.
const MOST: usize = 64;

/// What is unknown of a beginning.
#[derive(Clone, Debug)]
pub(super) struct Beginning {
    /// Degrees of freedom that are not driven.
    dofs: Vec<usize>,
    /// Samples that it is estimated from.
    samples: usize,
    /// What the channels themselves read of the unknowns at the first sample: a friction that sticks at rest hides the way from there.
    read: Vec<f64>,
}

/// A start of a march: displacements, then velocities of these degrees of freedom beyond those of rest, and their derivatives.
#[derive(Clone, Debug, Default)]
pub(super) struct Start {
    dofs: Vec<usize>,
    z: Vec<f64>,
    /// A row for every unknown, in it one entry per column of the march.
    dz: Vec<f64>,
}

impl Start {
    /// How many unknowns it has.
    pub fn unknowns(&self) -> usize {
        self.z.len()
    }

    /// Moves a state of rest there.
    pub fn apply(&self, state: &mut State, columns: usize) {
        let m = self.dofs.len();
        for (i, &d) in self.dofs.iter().enumerate() {
            state.q[d] += self.z[i];
            state.v[d] += self.z[m + i];
            for c in 0..self.dz.len().checked_div(2 * m).unwrap_or(0) {
                state.dq[d * columns + c] += self.dz[i * columns + c];
                state.dv[d * columns + c] += self.dz[(m + i) * columns + c];
            }
        }
    }
}

/// Whitened residuals of the first samples, and their slopes: those of the free parameters, then those of the unknowns.
pub(super) struct Opening {
    pub r: DVector<f64>,
    pub slopes: DMatrix<f64>,
}

impl Beginning {
    /// Of a record; `None` where it begins at rest, or nothing in it can move by itself.
    pub fn of(record: &TimeRecord, control: Control, driven: usize, model: &Model) -> Option<Beginning> {
        let dofs: Vec<usize> = (0..model.dofs.len()).filter(|d| control == Control::Force || *d != driven).collect();
        if dofs.is_empty() || 2 * dofs.len() > MOST || !in_motion(record, control) {
            return None;
        }
        let n = record.time.len();
        let cycle = record.channels.iter().filter(|c| record.answers(c)).map(|c| samples_a_cycle(&c.values)).fold(0.0, f64::max);
        let least = (n / PART).max(2 * EACH * dofs.len());
        let samples = least.max((CYCLES * cycle).ceil() as usize).min(n);
        let read = read_off(record, &dofs, cycle, model);
        Some(Beginning { dofs, samples, read })
    }

    /// Samples that it is estimated from.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Of the first `n` samples of the record.
    pub fn begun(&self, n: usize) -> Beginning {
        Beginning { samples: self.samples.min(n), ..self.clone() }
    }

    /// Rest.
    fn rest(&self) -> Vec<f64> {
        vec![0.0; 2 * self.dofs.len()]
    }

    /// A start with a unit column for every unknown, from column `first` on.
    fn seeded(&self, z: &[f64], first: usize) -> Start {
        let (count, columns) = (z.len(), first + z.len());
        let mut dz = vec![0.0; count * columns];
        (0..count).for_each(|i| dz[i * columns + first + i] = 1.0);
        Start { dofs: self.dofs.clone(), z: z.to_vec(), dz }
    }

    /// Where the record begins. `open`: its first samples from a start; with `true` also the slopes with respect to the `n_free` parameters.
    ///
    /// The unknowns are bounded by what is seen: a normal prior by which each alone moves the channels as much as they miss from rest.
    pub fn estimated(
        &self,
        n_free: usize,
        mut open: impl FnMut(&Start, bool) -> Result<Opening, EngineError>,
    ) -> Result<Start, EngineError> {
        let mut z = DVector::from_vec(self.rest());
        let mut now = open(&self.seeded(z.as_slice(), 0), false)?;
        let size = now.r.norm();
        let prior = DVector::from_iterator(z.len(), now.slopes.column_iter().map(|c| if size > 0.0 { c.norm() / size } else { 0.0 }));
        // What moves nothing stays at rest.
        let ridge = prior.map(|p| if p > 0.0 { p * p } else { 1.0 });
        let cost = |o: &Opening, z: &DVector<f64>| o.r.norm_squared() + z.component_mul(&prior).norm_squared();
        if self.read.iter().any(|v| *v != 0.0) {
            let read = DVector::from_vec(self.read.clone());
            match open(&self.seeded(read.as_slice(), 0), false) {
                Ok(there) if cost(&there, &read) < cost(&now, &z) => (z, now) = (read, there),
                _ => {}
            }
        }
        let normal = |j: &DMatrix<f64>| (j.tr_mul(j) + DMatrix::from_diagonal(&ridge)).cholesky();
        for _ in 0..STEPS {
            let Some(factors) = normal(&now.slopes) else { break };
            let step = -factors.solve(&(now.slopes.tr_mul(&now.r) + prior.component_mul(&prior).component_mul(&z)));
            let moves = (&now.slopes * &step).norm();
            if !moves.is_finite() || moves <= STILL * now.r.norm() {
                break;
            }
            let before = cost(&now, &z);
            let shorter = (0..=HALVINGS).find_map(|h| {
                let trial = &z + &step * 0.5f64.powi(h as i32);
                let there = open(&self.seeded(trial.as_slice(), 0), false).ok()?;
                (cost(&there, &trial) < before).then_some((trial, there))
            });
            let Some(found) = shorter else { break };
            (z, now) = found;
        }
        if n_free == 0 {
            return Ok(Start { dofs: self.dofs.clone(), z: z.as_slice().to_vec(), dz: vec![] });
        }
        let with = open(&self.seeded(z.as_slice(), n_free), true)?;
        let curved = self.curved(&z, &prior, n_free, &with, &mut open)?;
        let dz = curved.or_else(|| {
            let (by_parameter, by_start) = (with.slopes.columns(0, n_free), with.slopes.columns(n_free, z.len()).into_owned());
            normal(&by_start).map(|f| -f.solve(&by_start.tr_mul(&by_parameter)))
        });
        let dz = dz.unwrap_or_else(|| DMatrix::zeros(z.len(), n_free));
        // Row by row, as a march holds its columns.
        Ok(Start { dofs: self.dofs.clone(), z: z.as_slice().to_vec(), dz: dz.transpose().as_slice().to_vec() })
    }
}

impl Beginning {
    /// Derivatives of the unknowns from the second derivatives of `1/2 |r|^2`, those with respect to the unknowns and those with respect to these and the
    /// parameters, by differences of the slopes from unknown to unknown. Gauss and Newton's are right only where the model fits: where it misses a quarter of a
    /// record they are off by some per cent, and a fit by them crawls. `None` where the unknowns are at no minimum.
    fn curved(
        &self,
        z: &DVector<f64>,
        prior: &DVector<f64>,
        n_free: usize,
        with: &Opening,
        open: &mut impl FnMut(&Start, bool) -> Result<Opening, EngineError>,
    ) -> Result<Option<DMatrix<f64>>, EngineError> {
        let count = z.len();
        // Gauss and Newton's part, and what the slopes change under the residual as it is.
        let mut second = with.slopes.columns(n_free, count).tr_mul(&with.slopes);
        for i in (0..count).filter(|i| prior[*i] > 0.0) {
            let (mut moved, h) = (z.clone(), APART / prior[i]);
            moved[i] += h;
            let bent = (open(&self.seeded(moved.as_slice(), n_free), true)?.slopes - &with.slopes).tr_mul(&with.r) / h;
            second.row_mut(i).iter_mut().zip(&bent).for_each(|(s, b)| *s += b);
        }
        let mut by_start = second.columns(n_free, count).into_owned();
        by_start = 0.5 * (&by_start + by_start.transpose());
        (0..count).for_each(|i| by_start[(i, i)] += if prior[i] > 0.0 { prior[i] * prior[i] } else { 1.0 });
        Ok(by_start.cholesky().map(|f| -f.solve(&second.columns(0, n_free))))
    }
}

/// Part of a cycle through whose samples a parabola is laid, and the fewest of them.
const PARABOLA: f64 = 0.125;
const PARABOLA_LEAST: usize = 4;

/// Displacements, then velocities of these degrees of freedom at the first sample, where a channel reads them against the ground; 0 elsewhere.
fn read_off(record: &TimeRecord, dofs: &[usize], cycle: f64, model: &Model) -> Vec<f64> {
    let mut read = vec![0.0; 2 * dofs.len()];
    let dt = (record.time[record.time.len() - 1] - record.time[0]) / (record.time.len() - 1) as f64;
    for c in record.channels.iter().filter(|c| record.answers(c)) {
        let of = match seat(model, &c.at) {
            Ok(Seat::Dof(d)) => Some((d, 1.0)),
            Ok(Seat::Place(p)) => match (model.places[p].from, model.places[p].to) {
                (None, Some(d)) => Some((d, 1.0)),
                (Some(d), None) => Some((d, -1.0)),
                _ => None,
            },
            Err(_) => None,
        };
        let Some((k, sign)) = of.and_then(|(d, sign)| Some((dofs.iter().position(|k| *k == d)?, sign))) else { continue };
        match c.role {
            Role::Displacement => {
                let (x, rate) = at_first(&c.values, ((PARABOLA * cycle) as usize).max(PARABOLA_LEAST));
                (read[k], read[dofs.len() + k]) = (sign * x, sign * rate / dt);
            }
            Role::Velocity => read[dofs.len() + k] = sign * c.values[0],
            _ => {}
        }
    }
    read
}

/// Value and rate for each sample, at the first one, of the parabola through the first `count` samples.
fn at_first(x: &[f64], count: usize) -> (f64, f64) {
    let n = count.min(x.len());
    let a = DMatrix::from_fn(n, 3, |i, p| (i as f64).powi(p as i32));
    let b = DVector::from_column_slice(&x[..n]);
    let fitted = (a.tr_mul(&a)).cholesky().map(|f| f.solve(&a.tr_mul(&b)));
    fitted.map_or((x[0], 0.0), |p| (p[0], p[1]))
}

/// Rice's mean period: samples in a cycle of `2 pi` times the rms of the value over that of its rate.
pub(super) fn samples_a_cycle(x: &[f64]) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let square: f64 = x.iter().map(|v| (v - mean).powi(2)).sum();
    let rate: f64 = x.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    if rate > 0.0 { std::f64::consts::TAU * (square / rate).sqrt() } else { 0.0 }
}

/// Whether a record begins in motion: a displacement that has a rate, or lies off its zero, a velocity, an acceleration without a force, a drive that moves.
fn in_motion(record: &TimeRecord, control: Control) -> bool {
    let largest = |x: &[f64]| x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let reads = |x: &[f64], sigma: f64| x[0].abs() > (MOVING * largest(x)).max(CLEAR * sigma);
    // The rate per sample by two formulas, of which the first sees none where a force begins smoothly and the second none where it begins at once; the
    // factors of their noise.
    let moves = |x: &[f64], sigma: f64| {
        let most = x.windows(3).fold(0.0f64, |m, w| m.max(0.5 * (w[2] - w[0]).abs()));
        let seen = |rate: f64, noise: f64| rate.abs() > (MOVING * most).max(CLEAR * noise * sigma);
        x.len() > 2 && seen(x[1] - x[0], 2f64.sqrt()) && seen(0.5 * (-3.0 * x[0] + 4.0 * x[1] - x[2]), 0.5 * 26f64.sqrt())
    };
    let drive = record.controlled();
    let pushed = control == Control::Force && drive.is_some_and(|d| reads(&d.values, 0.0));
    if control == Control::Displacement && drive.is_some_and(|d| moves(&d.values, d.sigma.unwrap_or(0.0))) {
        return true;
    }
    record.channels.iter().filter(|c| record.answers(c)).any(|c| {
        let sigma = c.sigma.unwrap_or_else(|| super::transient::sample_noise(&c.values));
        match c.role {
            Role::Displacement => reads(&c.values, sigma) || moves(&c.values, sigma),
            Role::Velocity => reads(&c.values, sigma),
            Role::Acceleration => reads(&c.values, sigma) && !pushed,
            _ => false,
        }
    })
}

#[cfg(test)]
mod tests {
    use crate::data::{Channel, Control, Role, Test};
    use crate::model::{Axis, Body, Model, System};
    use crate::response::Plan;

    const MASS: [f64; 2] = [0.5, 0.3];
    const SPRING: [f64; 2] = [2e3, 3e3];
    const DAMPER: [f64; 2] = [1.0, 0.8];
    const CUBIC: f64 = 4e7;
    /// Sampling interval [s]: twelve samples in the period of the first mode.
    const DT: f64 = 0.011;

    fn force(t: f64) -> f64 {
        6.0 * (9.0 * t).sin() + 4.0 * (31.0 * t + 1.0).sin() + 3.0 * (70.0 * t).cos()
    }

    /// Motion of the second of two masses in a row, the first spring hardening, by a Runge-Kutta method of its own.
    fn motion(begin: [f64; 4], push: impl Fn(f64) -> f64, samples: usize) -> Vec<f64> {
        let rates = |t: f64, s: [f64; 4]| {
            let (e, ed) = (s[1] - s[0], s[3] - s[2]);
            let first = SPRING[0] * s[0] + CUBIC * s[0].powi(3) + DAMPER[0] * s[2];
            let second = SPRING[1] * e + DAMPER[1] * ed;
            [s[2], s[3], (second - first) / MASS[0], (push(t) - second) / MASS[1]]
        };
        let (mut s, mut out) = (begin, vec![begin[1]]);
        let h = DT / 50.0;
        for k in 0..(samples - 1) * 50 {
            let t = k as f64 * h;
            let plus = |by: f64, d: [f64; 4]| std::array::from_fn(|i| s[i] + by * d[i]);
            let a = rates(t, s);
            let b = rates(t + 0.5 * h, plus(0.5 * h, a));
            let c = rates(t + 0.5 * h, plus(0.5 * h, b));
            let d = rates(t + h, plus(h, c));
            s = std::array::from_fn(|i| s[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
            if (k + 1) % 50 == 0 {
                out.push(s[1]);
            }
        }
        out
    }

    fn system() -> System {
        let bodies = vec![Body::fixed("ground"), Body::new("m1", MASS[0], &[Axis::X]), Body::new("m2", MASS[1], &[Axis::X])];
        let model = Model::joined(bodies, &[("base", "ground", "m1"), ("joint", "m1", "m2")]).unwrap();
        let each = |system: System, at: &str, k: usize| {
            let system = system.and("linear_stiffness", at, &[("k", SPRING[k])]).unwrap();
            system.and("viscous", at, &[("c", DAMPER[k])]).unwrap()
        };
        each(each(System::new(model), "base.x", 0), "joint.x", 1).and("cubic_stiffness", "base.x", &[("k3", CUBIC)]).unwrap()
    }

    fn plan(begin: [f64; 4], push: impl Fn(f64) -> f64) -> Plan {
        let time: Vec<f64> = (0..700).map(|k| k as f64 * DT).collect();
        let x = motion(begin, &push, time.len());
        let forces = time.iter().map(|t| push(*t)).collect();
        let channels = vec![Channel::new(Role::Force, "m2.x", forces), Channel::new(Role::Displacement, "m2.x", x).with_sigma(2e-6)];
        let test = Test::transient("cut", Control::Force, time, channels).unwrap();
        let plan = Plan::new(&test, &system().model).unwrap();
        plan.refined(&system()).unwrap_or(plan)
    }

    #[test]
    fn a_record_that_begins_in_motion_is_followed_from_there() {
        let (plan, system) = (plan([4e-3, -3e-3, 0.1, 0.3], force), system());
        assert!(plan.notes.iter().any(|n| n.contains("begins in motion")), "{:?}", plan.notes);
        let computed = plan.evaluate(&system, &[], false).unwrap().values;
        let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt();
        let off: Vec<f64> = computed.iter().zip(&plan.measured).map(|(c, m)| c - m).collect();
        assert!(rms(&off) < 2e-3 * rms(&plan.measured), "{} of {}", rms(&off), rms(&plan.measured));
        assert!(rms(&off[..60]) < 4e-3 * rms(&plan.measured), "{}", rms(&off[..60]));
    }

    #[test]
    fn its_slopes_are_those_of_what_it_computes() {
        let (plan, system) = (plan([4e-3, -3e-3, 0.1, 0.3], force), system());
        let free = system.free();
        let computed = plan.evaluate(&system, &free, true).unwrap();
        for (c, f) in free.iter().enumerate() {
            let at = |by: f64| {
                let mut moved = system.clone();
                moved.instances[f.instance].params[f.param].value *= 1.0 + by;
                plan.evaluate(&moved, &[], false).unwrap().values
            };
            let (h, value) = (1e-4, system.instances[f.instance].params[f.param].value);
            let scale = if f.log { 1.0 } else { value };
            let (more, less) = (at(h), at(-h));
            let slope = |i: usize| computed.slopes[i * free.len() + c] * scale;
            let differences: Vec<f64> = more.iter().zip(&less).map(|(a, b)| (a - b) / (2.0 * h)).collect();
            let largest = differences.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let off = differences.iter().enumerate().fold(0.0f64, |m, (i, v)| m.max((v - slope(i)).abs()));
            assert!(off < 0.01 * largest, "{}: {off} of {largest}", f.name);
        }
    }

    #[test]
    fn a_hit_at_rest_begins_at_rest_and_a_decay_does_not() {
        let hit = |t: f64| if t < 4.5 * DT { 40.0 * (std::f64::consts::PI * t / (4.5 * DT)).sin().powi(2) } else { 0.0 };
        assert!(plan([0.0; 4], hit).notes.iter().all(|n| !n.contains("begins in motion")));
        assert!(plan([3e-3, 5e-3, 0.0, 0.0], |_| 0.0).notes.iter().any(|n| n.contains("begins in motion")));
    }
}
