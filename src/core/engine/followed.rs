//! Slopes of very many candidates along a steady cycle, by what the structure answers to a force at each place.
//!
//! A candidate of the score test does not act: its force `f(t)` per unit strength follows from the motion of its place alone, and what it would change is the
//! answer of the structure, linear about the cycle, to that force. The march answers for every candidate by itself, in a column of all degrees of freedom. Here the
//! structure is linearised about the mean of its cycle, and answers once for every place: with the receptances `G(i w)` from the place to the probes,
//!
//! ```text
//! dy/dtheta(t) = sum_k G(i k w) F_k e^{i k w t},   F_k the harmonics of f(t)
//! ```
//!
//! This is exact where the structure is linear and turns by little along the cycle. A place whose law is not linear stands in it with the stiffness and the
//! damping that meet its force along the cycle best (equivalent linearisation). Slopes of parameters of the model itself are the march's.

use std::collections::BTreeMap;
use std::sync::Arc;

use num_complex::Complex64;
use realfft::RealFftPlanner;

use crate::effect::Inputs;
use crate::model::{Bound, Element, ElementScratch, Model};
use crate::parallel;

use super::EngineError;
use super::blocktri::{BlockTri, Layout, Levels};
use super::march::{Loads, Probe};
use super::periodic::{Cycle, periodic};
use super::small::Small;

/// Candidates from which on the march of each costs more than the receptances of all places.
const MANY: usize = 64;
/// Cycles in which the states of a candidate may settle...
const SETTLES: usize = 12;
/// ...and the change of its force from one to the next, in parts of its largest, at which they have.
const SETTLED: f64 = 1e-3;
/// Stiffness that holds a driven degree of freedom, in parts of the largest of the structure.
const HELD: f64 = 1e9;

/// The steady cycle with slopes; `None` where the march answers for every candidate itself: where these are few, of a model that is not spatial, for probes
/// of places, and where the linearised structure has no answer.
pub(super) fn cycle(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe]) -> Option<Result<Cycle, EngineError>> {
    let many = bound.elements.iter().map(Element::n_followers).sum::<usize>() >= MANY;
    let answers = |p: &Probe| matches!(p, Probe::Dof(_) | Probe::Velocity(_) | Probe::Acceleration(_) | Probe::Reaction(_));
    if model.space.is_none() || !many || !probes.iter().all(answers) {
        return None;
    }
    match slopes(model, bound, loads, probes) {
        // What moves freely has no static answer, and some laws have no stiffness at rest: the march needs neither.
        Err(EngineError::Linear(_) | EngineError::Effect(_)) => None,
        found => Some(found),
    }
}

fn slopes(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe]) -> Result<Cycle, EngineError> {
    let (plain, columns) = bound.without_followers();
    let n = model.dofs.len();
    let places = plain.elements.iter().map(|e| e.place);
    let seen = places.clone().map(Probe::Relative).chain(places.map(Probe::Force)).chain((0..n).map(Probe::Dof));
    let all: Vec<Probe> = probes.iter().copied().chain(seen).collect();
    let marched = periodic(model, &plain, loads, &all, true)?;
    let count = plain.elements.len();
    let read = |first: usize, k: usize| marched.values[probes.len() + first + k].as_slice();
    let mean = |u: &[f64]| u.iter().sum::<f64>() / u.len() as f64;
    let q: Vec<f64> = (0..n).map(|d| mean(read(2 * count, d))).collect();
    let forces: Vec<f64> = (0..count).map(|e| mean(read(count, e))).collect();
    let motions: Vec<Motion> = (0..count).map(|e| Motion::new(read(0, e), read(count, e), loads.dt)).collect();
    let structure = Structure::new(model, &plain, &q, &forces, &motions, loads)?;
    let answers = structure.answers(probes)?;

    let mut out = Cycle { columns: bound.n_free, slopes: vec![vec![0.0; marched.steps * bound.n_free]; probes.len()], ..marched };
    out.values.truncate(probes.len());
    let own = columns.len();
    for (to, from) in out.slopes.iter_mut().zip(&marched.slopes) {
        for k in 0..out.steps {
            columns.iter().enumerate().for_each(|(c, column)| to[k * bound.n_free + column] = from[k * own + c]);
        }
    }
    let mut transform = Transform::new(out.steps);
    for (e, element) in bound.elements.iter().enumerate() {
        if parallel::given_up() {
            return Err(EngineError::GivenUp);
        }
        let stiffness = structure.stiffness(e)?;
        for (theta, slope, force) in motions[e].followers(element, loads.dt, &stiffness, &mut transform) {
            for (p, answer) in answers.iter().enumerate() {
                let column = transform.back(force.iter().zip(&answer[e]).map(|(f, g)| f * g * slope));
                column.iter().enumerate().for_each(|(k, v)| out.slopes[p][k * bound.n_free + theta] += v);
            }
        }
    }
    Ok(out)
}

/// What a place does along the cycle, at the ends of its steps.
struct Motion {
    inputs: Vec<Inputs<f64>>,
    force: Vec<f64>,
}

impl Motion {
    /// From the relative displacement and the force at the ends of the steps: rates by central differences.
    fn new(x: &[f64], force: &[f64], dt: f64) -> Motion {
        let n = x.len();
        let at = |k: usize, by: isize| x[(k as isize + by).rem_euclid(n as isize) as usize];
        let one = |k: usize| Inputs {
            x: x[k],
            v: (at(k, 1) - at(k, -1)) / (2.0 * dt),
            a: (at(k, 1) - 2.0 * x[k] + at(k, -1)) / (dt * dt),
            dx: x[k] - at(k, -1),
        };
        Motion { inputs: (0..n).map(one).collect(), force: force.to_vec() }
    }

    /// The way from rest to the start of the cycle.
    fn rise(&self, dt: f64) -> Vec<Inputs<f64>> {
        let (n, end) = ((self.inputs.len() / 4).max(16), self.inputs.last().map_or(0.0, |u| u.x));
        let step = end / n as f64;
        (1..=n).map(|k| Inputs { x: step * k as f64, v: step / dt, a: 0.0, dx: step }).collect()
    }

    /// Stiffness and damping that meet the force best: `f = k x + c v` about their means, by least squares.
    fn equivalent(&self) -> (f64, f64) {
        let n = self.inputs.len() as f64;
        let (x0, f0) = (self.inputs.iter().map(|u| u.x).sum::<f64>() / n, self.force.iter().sum::<f64>() / n);
        let (mut xx, mut vv, mut xf, mut vf) = (0.0, 0.0, 0.0, 0.0);
        for (u, f) in self.inputs.iter().zip(&self.force) {
            let (x, f) = (u.x - x0, f - f0);
            (xx, vv, xf, vf) = (xx + x * x, vv + u.v * u.v, xf + x * f, vf + u.v * f);
        }
        // Displacement and velocity of a periodic motion have no part in each other.
        let over = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        (over(xf, xx), over(vf, vv))
    }

    /// Harmonics of the force of every candidate of an element per unit strength, with its column and the derivative of the strength with respect to it.
    fn followers(
        &self,
        element: &Element,
        dt: f64,
        stiffness: &[Complex64],
        transform: &mut Transform,
    ) -> Vec<(usize, f64, Vec<Complex64>)> {
        let (rise, mut scratch) = (self.rise(dt), ElementScratch::default());
        let mut all = Vec::new();
        for k in 0..element.n_followers() {
            let Some((theta, slope)) = element.follower_column(k) else { continue };
            let harmonics = if let Some(open) = element.follower_opens(k, &self.force) {
                // An opening takes from the place the force that its stiffness would have had there.
                transform.harmonics(&open).iter().zip(stiffness).map(|(e, z)| -e * z).collect()
            } else {
                let mut force = vec![0.0; self.inputs.len()];
                let mut states = element.follower_states(k);
                rise.iter().for_each(|u| _ = element.follower_force(k, u, dt, &mut states, &mut scratch));
                for _ in 0..SETTLES {
                    let (mut change, mut most) = (0.0f64, 0.0f64);
                    for (f, u) in force.iter_mut().zip(&self.inputs) {
                        let now = element.follower_force(k, u, dt, &mut states, &mut scratch);
                        (change, most) = (change.max((now - *f).abs()), most.max(now.abs()));
                        *f = now;
                    }
                    if states.is_empty() || change <= SETTLED * most {
                        break;
                    }
                }
                transform.harmonics(&force)
            };
            all.push((theta, slope, harmonics));
        }
        all
    }
}

/// Harmonics of signals over one cycle and back.
struct Transform {
    steps: usize,
    forward: Arc<dyn realfft::RealToComplex<f64>>,
    inverse: Arc<dyn realfft::ComplexToReal<f64>>,
    signal: Vec<f64>,
    series: Vec<Complex64>,
}

impl Transform {
    fn new(steps: usize) -> Transform {
        let mut planner = RealFftPlanner::<f64>::new();
        let (forward, inverse) = (planner.plan_fft_forward(steps), planner.plan_fft_inverse(steps));
        Transform { steps, signal: vec![0.0; steps], series: forward.make_output_vec(), forward, inverse }
    }

    fn harmonics(&mut self, signal: &[f64]) -> Vec<Complex64> {
        self.signal.copy_from_slice(signal);
        // The lengths are those the plan was made for.
        let done = self.forward.process(&mut self.signal, &mut self.series);
        debug_assert!(done.is_ok());
        self.series.clone()
    }

    fn back(&mut self, series: impl Iterator<Item = Complex64>) -> &[f64] {
        self.series.iter_mut().zip(series).for_each(|(s, v)| *s = v);
        // Those of the mean and of the highest harmonic of an even number of steps are real.
        self.series[0].im = 0.0;
        if self.steps.is_multiple_of(2)
            && let Some(last) = self.series.last_mut()
        {
            last.im = 0.0;
        }
        let done = self.inverse.process(&mut self.series, &mut self.signal);
        debug_assert!(done.is_ok());
        self.signal.iter_mut().for_each(|v| *v /= self.steps as f64);
        &self.signal
    }
}

/// The structure about the mean of its cycle.
struct Structure<'a> {
    small: Small<'a>,
    layout: Arc<Layout>,
    /// Stiffness and damping of the elements that are not linear.
    equivalent: BTreeMap<usize, (f64, f64)>,
    held: Vec<usize>,
    /// Frequency of the cycle [rad/s], and its harmonics, the mean among them.
    omega: f64,
    harmonics: usize,
}

impl<'a> Structure<'a> {
    fn new(model: &Model, plain: &'a Bound, q: &[f64], forces: &[f64], motions: &[Motion], loads: &Loads) -> Result<Self, EngineError> {
        let small = Small::about(model, plain, q, forces);
        let layout = Arc::new(Layout::new(Levels::new(small.n, &small.pairs())?));
        let bent = |e: &usize| !plain.elements[*e].is_linear_at_every_amplitude();
        let equivalent = (0..plain.elements.len()).filter(bent).map(|e| (e, motions[e].equivalent())).collect();
        let steps = motions.first().map_or(0, |m| m.inputs.len());
        Ok(Structure {
            small,
            layout,
            equivalent,
            held: loads.prescribed.iter().map(|p| p.0).collect(),
            omega: std::f64::consts::TAU / (loads.dt * steps.max(1) as f64),
            harmonics: steps / 2 + 1,
        })
    }

    fn at(&self, e: usize, k: usize) -> Result<Complex64, EngineError> {
        let s = Complex64::new(0.0, self.omega * k as f64);
        match self.equivalent.get(&e) {
            Some((stiffness, damping)) => Ok(stiffness + s * damping),
            None => self.small.value(e, s),
        }
    }

    /// Dynamic stiffness of an element at every harmonic.
    fn stiffness(&self, e: usize) -> Result<Vec<Complex64>, EngineError> {
        (0..self.harmonics).map(|k| self.at(e, k)).collect()
    }

    /// What each probe reads per unit force at each element, at every harmonic: `answers[probe][element][k]`.
    fn answers(&self, probes: &[Probe]) -> Result<Vec<Vec<Vec<Complex64>>>, EngineError> {
        let (n, count) = (self.small.n, self.small.rows.len());
        let mut answers = vec![vec![vec![Complex64::ZERO; self.harmonics]; count]; probes.len()];
        let mut matrix = BlockTri::<Complex64>::new(self.layout.clone());
        let mut columns = vec![Complex64::ZERO; n * probes.len()];
        for k in 0..self.harmonics {
            let s = Complex64::new(0.0, self.omega * k as f64);
            let hold = self.assemble(k, s, &mut matrix)?;
            matrix.factor()?;
            columns.fill(Complex64::ZERO);
            for (p, probe) in probes.iter().enumerate() {
                // A force of the structure is in balance with the motion: Z dq + b f = 0. What holds a degree of freedom takes the rest.
                let (dof, load) = match *probe {
                    Probe::Dof(d) => (d, Complex64::from(-1.0)),
                    Probe::Velocity(d) => (d, -s),
                    Probe::Acceleration(d) => (d, -s * s),
                    Probe::Reaction(d) => (d, Complex64::from(hold)),
                    // Probes of places are not asked for here (`cycle`).
                    Probe::Relative(_) | Probe::RelativeVelocity(_) | Probe::RelativeAcceleration(_) | Probe::Force(_) => continue,
                };
                columns[p * n + dof] = load;
            }
            matrix.solve(&mut columns)?;
            for (p, answer) in answers.iter_mut().enumerate() {
                let lambda = &columns[p * n..(p + 1) * n];
                answer.iter_mut().enumerate().for_each(|(e, a)| a[k] = self.small.relative(e, lambda));
            }
        }
        Ok(answers)
    }

    /// Puts the system at a harmonic together; returns the stiffness by which driven degrees of freedom are held.
    fn assemble(&self, k: usize, s: Complex64, matrix: &mut BlockTri<Complex64>) -> Result<f64, EngineError> {
        matrix.clear();
        for (i, j, m) in &self.small.mass {
            matrix.add(*i, *j, s * s * *m)?;
        }
        for (i, j, x) in &self.small.stiffness {
            matrix.add(*i, *j, Complex64::from(*x))?;
        }
        let mut largest = 0.0f64;
        for (e, row) in self.small.rows.iter().enumerate() {
            let z = self.at(e, k)?;
            for (i, bi) in row {
                for (j, bj) in row {
                    matrix.add(*i, *j, z * bi * bj)?;
                    largest = largest.max((z * bi * bj).norm());
                }
            }
        }
        let hold = HELD * largest;
        for &d in &self.held {
            matrix.add(d, d, Complex64::from(hold))?;
        }
        Ok(hold)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::f64::consts::TAU;

    use super::super::space_tests::{STEEL, chain, instance, springs, straight};
    use super::*;
    use crate::model::{Instance, System};

    /// A clamped chain with dampers and candidates of every kind at its root, its middle and its tip.
    fn system(film: bool) -> System {
        let mut system = springs(chain(&straight(0.12), 6, STEEL, true), 0, 5, [3e9, 3e9, 3e9, 1e6, 1e6, 6e3]);
        for i in &mut system.instances {
            i.params[0].free = i.at.ends_with("psi");
        }
        let model = system.model.clone();
        system.instances.push(instance(&model, "viscous", "c0-5.psi", &[4.0]));
        if film {
            system.instances.push(instance(&model, "film", "c2.psi", &[15.0, 0.05, 0.002]));
        }
        let laws: [(&str, &[f64]); 8] = [
            ("coulomb", &[0.0]),
            ("elastic_slip", &[0.0, 0.004]),
            ("film", &[0.0, 0.05, 0.002]),
            ("maxwell", &[0.0, 0.05]),
            ("cubic_stiffness", &[0.0]),
            ("bilinear_stiffness", &[0.0, 0.0]),
            ("bouc_wen", &[0.0, 0.004, 1.0, 0.5]),
            ("backlash", &[0.0]),
        ];
        for (law, values) in laws {
            for at in ["c0.psi", "c3.psi", "c5.psi"] {
                let mut follower = instance(&model, law, at, values);
                follower.params.iter_mut().skip(1).for_each(|p| p.free = false);
                system.instances.push(Instance { follower: true, ..follower });
            }
        }
        system
    }

    fn loads(model: &Model, moved: bool) -> Loads {
        let n = 256;
        let dt = 0.5 / n as f64;
        let at = |k: usize| (TAU * (k % n) as f64 / n as f64).sin_cos();
        let dof = model.dof("b6.x").unwrap();
        let w = TAU / (dt * n as f64);
        match moved {
            true => {
                let path = (0..=n).map(|k| {
                    let (s, c) = at(k);
                    [2e-3 + 4e-3 * s, 4e-3 * w * c, -4e-3 * w * w * s]
                });
                Loads { dt, prescribed: vec![(dof, path.collect())], forces: vec![] }
            }
            false => Loads { dt, prescribed: vec![], forces: vec![(dof, (0..=n).map(|k| 200.0 + 400.0 * at(k).0).collect())] },
        }
    }

    /// Columns of the candidates beside those of the march.
    fn off(film: bool, moved: bool) -> Vec<(String, f64)> {
        let system = system(film);
        let free = system.free();
        let bound = Bound::new(&system, &free, "t", &BTreeMap::new()).unwrap();
        let (loads, model) = (loads(&system.model, moved), &system.model);
        let probes = match moved {
            true => vec![Probe::Reaction(model.dof("b6.x").unwrap()), Probe::Dof(model.dof("b3.x").unwrap())],
            false => vec![Probe::Dof(model.dof("b6.x").unwrap()), Probe::Dof(model.dof("b4.psi").unwrap())],
        };
        let (fast, exact) = (slopes(model, &bound, &loads, &probes).unwrap(), periodic(model, &bound, &loads, &probes, true).unwrap());
        let size = |column: &[f64]| column.iter().map(|v| v * v).sum::<f64>().sqrt();
        let column =
            |c: &Cycle, k: usize| c.slopes.iter().flat_map(|s| s.iter().skip(k).step_by(free.len())).copied().collect::<Vec<f64>>();
        let each = |(k, f): (usize, &crate::model::FreeParam)| {
            let (a, b) = (column(&fast, k), column(&exact, k));
            let d: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            (f.name.clone(), if size(&d) > 0.0 { size(&d) / size(&b) } else { 0.0 })
        };
        assert_eq!(fast.values.len(), probes.len());
        free.iter().enumerate().map(each).collect()
    }

    /// A jump of a force falls between two steps, here on one side of it and there on the other; what is smooth agrees closely.
    fn all_within(off: Vec<(String, f64)>, smooth: f64, jumps: f64) {
        let most = |name: &str| if ["coulomb", "backlash"].iter().any(|law| name.contains(law)) { jumps } else { smooth };
        let far: Vec<String> = off.iter().filter(|(name, off)| *off > most(name)).map(|(name, off)| format!("{name} {off:.4}")).collect();
        assert!(far.is_empty(), "{far:?} of {off:?}");
    }

    #[test]
    fn candidates_of_a_linear_chain_are_those_of_the_march() {
        all_within(off(false, false), 0.05, 0.2);
        all_within(off(false, true), 0.05, 0.2);
    }

    /// About a film the structure is linear on average alone.
    #[test]
    fn candidates_beside_a_film_are_near_those_of_the_march() {
        all_within(off(true, false), 0.3, 0.5);
    }
}
