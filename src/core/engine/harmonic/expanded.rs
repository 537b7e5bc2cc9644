//! The steady cycle of parts that turn far, by the balance about the mean of a cycle that was marched: for looks at many candidates beside one base.
//!
//! A march of such a chain costs hundreds of steps of all its parts for every cycle until it repeats. About the mean of its cycle the structure is nearly linear but for
//! its elements, and the balance finds the cycle at the places of the nonlinear ones alone. What that leaves out, the turning of the parts within the
//! cycle, is much the same with a candidate and without: it is added as it is in the cycle that was marched,
//!
//! ```text
//! y(theta) = y_balanced(theta) + [y_marched(theta_0) - y_balanced(theta_0)]
//! ```
//!
//! which is exact at `theta_0` and elsewhere off by the part by which the linear structure errs of what has changed (output space mapping: Bandler et al., IEEE Trans.
//! Microwave Theory Tech. 52, 2004).

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::blocktri::Sweep;
use super::super::equilibrium::equilibrium;
use super::super::frf::{Receptance, receptance, swept};
use super::super::march::{Loads, Probe};
use super::super::periodic::{Cycle, periodic};
use super::cycle::{Limits, Wanted, found};
use super::structure::About;

/// Coarser than the balance that stands for a march: a look ranks candidates and brings them near to where a march goes on.
const LIMITS: Limits = Limits { harmonics: 10, tail: 3e-2, samples: 12, tolerance: 1e-6, places: 32, states: 8, drive: 24, nothing: 1e-4 };

/// A cycle about whose mean others are balanced.
#[derive(Clone, Debug)]
pub struct Expanded {
    about: About,
    /// What the march has beyond the balance, reading by reading.
    beyond: Vec<Vec<f64>>,
}

impl Expanded {
    /// About the steady cycle of this system; `None` where there is nothing to gain: of models along one axis, and where no balance is found.
    ///
    /// # Errors
    /// Those of the march.
    pub fn about(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe]) -> Result<Option<Expanded>, EngineError> {
        if model.space.is_none() {
            return Ok(None);
        }
        let (n, places) = (model.dofs.len(), model.places.len());
        let all: Vec<Probe> = probes.iter().copied().chain((0..n).map(Probe::Dof)).chain((0..places).map(Probe::Force)).collect();
        let mut marched = periodic(model, bound, loads, &all, false)?;
        let mut means = marched.values.split_off(probes.len()).into_iter().map(|u| u.iter().sum::<f64>() / u.len().max(1) as f64);
        let about = About { q: means.by_ref().take(n).collect(), forces: means.collect() };
        let wanted = Wanted { probes, sensitivities: false };
        let Some(balanced) = found(model, bound, loads, &wanted, Some(&about), &LIMITS) else { return Ok(None) };
        let less = |(marched, own): (&Vec<f64>, &Vec<f64>)| marched.iter().zip(own).map(|(m, o)| m - o).collect();
        let beyond = marched.values.iter().zip(&balanced.values).map(less).collect();
        Ok(Some(Expanded { about, beyond }))
    }

    /// The steady cycle of another system of these parts under the same loads; marched where no balance is found.
    ///
    /// # Errors
    /// Those of the march.
    pub fn steady(&self, model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Result<Cycle, EngineError> {
        let same = model.dofs.len() == self.about.q.len() && model.places.len() == self.about.forces.len();
        let wanted = Wanted { probes, sensitivities };
        let balanced = same.then(|| found(model, bound, loads, &wanted, Some(&self.about), &LIMITS)).flatten();
        let Some(mut cycle) = balanced else { return periodic(model, bound, loads, probes, sensitivities) };
        for (values, beyond) in cycle.values.iter_mut().zip(&self.beyond) {
            values.iter_mut().zip(beyond).for_each(|(v, b)| *v += b);
        }
        Ok(cycle)
    }
}

/// Of a structure that stands: the mean alone.
const STANDING: Limits = Limits { harmonics: 0, ..LIMITS };
/// Steps and length [s] of a cycle in which nothing moves.
const STEPS: usize = 4;
const LONG: f64 = 1e4;

/// Where the parts stand under the loads that stay, for frequency responses beside it: under other parameters only what strains the elements is
/// computed anew, by the balance without a harmonic. It is exact for the system that it was made of.
#[derive(Clone, Debug)]
pub struct Standing(About);

impl Standing {
    /// Of this system; `None` of models along one axis and of those without loads that stay, whose frequency responses cost nothing more.
    ///
    /// # Errors
    /// Those of the equilibrium.
    pub fn of(model: &Model, bound: &Bound) -> Result<Option<Standing>, EngineError> {
        if model.space.is_none() || bound.loads.is_empty() {
            return Ok(None);
        }
        let Some(there) = equilibrium(model, bound, &[], 0)? else { return Ok(None) };
        let mut forces = vec![0.0; model.places.len()];
        bound.elements.iter().zip(&there.elements).for_each(|(e, f)| forces[e.place] = *f);
        Ok(Some(Standing(About { q: there.state.q, forces })))
    }

    /// The receptance of another system of these parts, as [`receptance`] lays it out; that itself where no equilibrium is found by the balance.
    ///
    /// # Errors
    /// Those of [`receptance`].
    pub fn receptance(&self, model: &Model, bound: &Bound, sweep: &Sweep<'_>) -> Result<Receptance, EngineError> {
        let Some(stands) = self.stands(model, bound, sweep.sensitivities) else {
            return receptance(model, bound, sweep.omega, sweep.inputs, sweep.outputs, sweep.sensitivities);
        };
        let count = bound.elements.len();
        let points = (0..count).map(|e| (stands.values[e][0], stands.values[count + e][0]));
        let slopes: Vec<&[f64]> = stands.slopes[..count].iter().map(|s| &s[..stands.columns]).collect();
        let small = self.0.small(model, bound).strained(points, &slopes);
        swept(&small, sweep)
    }

    /// Relative displacement and force of every element.
    fn stands(&self, model: &Model, bound: &Bound, sensitivities: bool) -> Option<Cycle> {
        let same = model.dofs.len() == self.0.q.len() && model.places.len() == self.0.forces.len();
        let load = bound.loads.first().filter(|_| same)?;
        let still = Loads { dt: LONG, prescribed: vec![], forces: vec![(load.dof, vec![0.0; STEPS + 1])] };
        let places = || bound.elements.iter().map(|e| e.place);
        let probes: Vec<Probe> = places().map(Probe::Relative).chain(places().map(Probe::Force)).collect();
        found(model, bound, &still, &Wanted { probes: &probes, sensitivities }, Some(&self.0), &STANDING)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::f64::consts::TAU;

    use num_complex::Complex64;

    use super::*;
    use crate::engine::space_peers::tensioner;
    use crate::engine::space_tests::instance;
    use crate::model::{Level, Load, System};

    fn bind(system: &System) -> Bound {
        Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
    }

    fn loop_under(system: &System, mean: f64, amplitude: f64, frequency: f64, steps: usize) -> Loads {
        let at = |k: usize| mean + amplitude * (TAU * (k % steps) as f64 / steps as f64).sin();
        let path = (0..=steps).map(at).collect();
        Loads { dt: 1.0 / (frequency * steps as f64), prescribed: vec![], forces: vec![(system.model.dof("b11.x").unwrap(), path)] }
    }

    fn rms(x: impl Iterator<Item = f64>) -> f64 {
        let (sum, n) = x.fold((0.0, 0), |(s, n), x| (s + x * x, n + 1));
        (sum / n.max(1) as f64).sqrt()
    }

    /// What is added changes the frequency response under a load by the balance as it does by the equilibrium itself, and nothing is off without it.
    #[test]
    fn what_is_added_changes_the_response_under_load_as_the_equilibrium_says() {
        let mut base = tensioner(2e-5);
        let push = base.model.dof("b11.x").unwrap();
        base.model.loads.push(Load { dof: push, path: vec![Level::Value(80.0)], steps: 10 });
        let standing = Standing::of(&base.model, &bind(&base)).unwrap().unwrap();
        let omega: Vec<f64> = (1..60).map(|k| TAU * 10.0 * f64::from(k)).collect();
        let exact = |system: &System| receptance(&system.model, &bind(system), &omega, &[push], &[push], true).unwrap();
        let sweep = Sweep { omega: &omega, inputs: &[push], outputs: &[push], sensitivities: true };
        let about = |system: &System| standing.receptance(&system.model, &bind(system), &sweep).unwrap();
        let size = |h: &[Complex64]| rms(h.iter().map(|h| h.norm()));
        let apart = |a: &[Complex64], b: &[Complex64]| rms(a.iter().zip(b).map(|(a, b)| (a - b).norm()));
        let without = exact(&base).h;
        assert!(apart(&without, &about(&base).h) < 1e-6 * size(&without), "{:e}", apart(&without, &about(&base).h) / size(&without));
        for (effect, at, values) in [
            ("cubic_stiffness", "GF4-18.psi", &[4e4][..]),
            ("bilinear_stiffness", "GF11.psi", &[40.0, 0.004]),
            ("linear_stiffness", "GF4-18.psi", &[6.0]),
            ("elastic_slip", "GF15.psi", &[0.3, 5e-3]),
        ] {
            let mut system = base.clone();
            system.instances.push(instance(&system.model, effect, at, values));
            let (a, b, n) = (exact(&system), about(&system), bind(&system).n_free);
            let change = apart(&a.h, &without);
            let column = |of: &Receptance| of.dh.iter().skip(n - values.len()).step_by(n).copied().collect::<Vec<_>>();
            let slope_off = apart(&column(&a), &column(&b)) / size(&column(&a));
            println!(
                "{effect} at {at}: the change of {:.2e} is {:.3} off, its slope {slope_off:.3}",
                change / size(&without),
                apart(&a.h, &b.h) / change
            );
            assert!(apart(&a.h, &b.h) < 0.1 * change && slope_off < 0.1);
        }
    }

    /// What is added to a chain of 22 parts changes its loop by the balance as it does by the march, values and slopes.
    #[test]
    fn what_is_added_changes_the_loop_as_the_march_says() {
        let base = tensioner(2e-5);
        let probes = [Probe::Dof(base.model.dof("b11.x").unwrap()), Probe::Dof(base.model.dof("b22.y").unwrap())];
        let loads = loop_under(&base, 75.0, 40.0, 5.0, 200);
        let expanded = Expanded::about(&base.model, &bind(&base), &loads, &probes).unwrap().unwrap();
        let there = expanded.steady(&base.model, &bind(&base), &loads, &probes, false).unwrap();
        let marched = periodic(&base.model, &bind(&base), &loads, &probes, false).unwrap();
        for (a, b) in there.values.iter().zip(&marched.values) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs()), "exact where it is expanded");
        }
        let cases: [(&str, &str, &[f64]); 6] = [
            ("linear_stiffness", "GF4-18.psi", &[6.0]),
            ("cubic_stiffness", "GF4-18.psi", &[4e4]),
            ("bilinear_stiffness", "GF11.psi", &[40.0, 0.01]),
            ("elastic_slip", "GF8-12.psi", &[0.2, 2e-3]),
            ("maxwell", "GF11.psi", &[40.0, 0.03]),
            ("elastic_slip", "GF15.psi", &[0.3, 5e-3]),
        ];
        for (effect, at, values) in cases {
            let mut system = base.clone();
            system.instances.push(instance(&system.model, effect, at, values));
            let bound = bind(&system);
            let balanced = expanded.steady(&system.model, &bound, &loads, &probes, true).unwrap();
            assert_eq!(balanced.cycles, 0, "{effect} was marched");
            let exact = periodic(&system.model, &bound, &loads, &probes, true).unwrap();
            let columns = bound.n_free;
            for p in 0..probes.len() {
                let change = rms(exact.values[p].iter().zip(&marched.values[p]).map(|(a, b)| a - b));
                let off = rms(exact.values[p].iter().zip(&balanced.values[p]).map(|(a, b)| a - b));
                let column = |of: &Cycle| of.slopes[p].iter().skip(columns - values.len()).step_by(columns).copied().collect::<Vec<f64>>();
                let (a, b) = (column(&exact), column(&balanced));
                let slope_off = rms(a.iter().zip(&b).map(|(a, b)| a - b)) / rms(a.iter().copied());
                println!("{effect} at {at}, probe {p}: the change of {change:.2e} m is {:.3} off, its slope {slope_off:.3}", off / change);
                assert!(off < 0.1 * change && slope_off < 0.1);
            }
        }
    }
}
