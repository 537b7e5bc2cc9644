//! How the balance answers to a parameter.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::super::EngineError;
use super::aft::{Aft, PERIODIC};
use super::balance::{Balance, put};
use super::structure::Part;
use crate::model::Element;

impl Balance<'_> {
    /// Derivatives of the elements' forces with respect to the free parameters at the motion held where it is.
    pub(super) fn sources(&mut self) -> Result<Vec<Source>, EngineError> {
        let (bound, omega, w) = (self.structure.bound, self.omega, self.basis.width);
        let harmonics = self.moving();
        let motion: Vec<Vec<Complex64>> = harmonics.iter().map(|k| self.motion(*k)).collect();
        let (mut dp, mut inertial, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut marched = [(); 2].map(|()| Aft::default());
        for (e, element) in bound.elements.iter().enumerate().filter(|(_, e)| e.chains.iter().any(|c| !c.is_empty())) {
            let (said, candidates) = &self.structure.candidates[e];
            for (candidate, aft) in candidates.iter().zip(&mut marched) {
                let mut x = vec![0.0; w];
                harmonics.iter().zip(&motion).for_each(|(k, q)| put(&mut x, *k, self.structure.seen(e, *k, q)));
                aft.evaluate(candidate, &self.basis, omega, &x, PERIODIC)?;
                aft.parameters(candidate, &self.basis, omega);
                // A candidate that is not linear answers in harmonics in which the structure does not move.
                for k in 0..=self.harmonics {
                    let force = |p: usize| column(&aft.by_param, candidate.n_params(), p, k);
                    sources.extend(Source::of(e, k, candidate, &force));
                }
            }
            if let Part::Nonlinear(a) = self.structure.parts[e] {
                self.aft[a].parameters(element, &self.basis, omega);
            }
            for (k, motion) in harmonics.iter().zip(&motion) {
                let by_param = match self.structure.parts[e] {
                    Part::Nonlinear(a) => Some(&self.aft[a].by_param),
                    _ => {
                        let s = Complex64::new(0.0, *k as f64 * omega);
                        element.stiffness(s, &mut dp)?;
                        let fed = s * s * (self.structure.feed(*k) - 1.0);
                        if fed != Complex64::ZERO {
                            element.inertia_slopes(&mut inertial);
                            dp.iter_mut().zip(&inertial).for_each(|(d, m)| *d += fed * m);
                        }
                        None
                    }
                };
                let moved = self.structure.seen(e, *k, motion);
                let force = |p: usize| match by_param {
                    Some(by_param) => column(by_param, element.n_params(), p, *k),
                    None if said.get(p) == Some(&false) => Complex64::ZERO,
                    None => dp[p] * moved,
                };
                sources.extend(Source::of(e, *k, element, &force));
            }
        }
        Ok(sources)
    }

    /// Derivatives of the nonlinear elements' displacement coefficients with respect to the free parameters, `m w` rows.
    pub(super) fn answers(&mut self, sources: &[Source]) -> DMatrix<f64> {
        let (n, w, m) = (self.structure.n, self.basis.width, self.m());
        let mut loads = DMatrix::<f64>::zeros(m * w, self.structure.bound.n_free);
        if m == 0 {
            return loads;
        }
        for s in sources {
            for a in 0..m {
                let u = self.structure.relative(s.element, &self.flex[s.harmonic].places[a * n..(a + 1) * n]);
                let from = s.parameter * m * w + a * w;
                put(&mut loads.as_mut_slice()[from..from + w], s.harmonic, -u * s.force);
            }
        }
        self.linearize().columns(&loads)
    }

    /// Derivative of the force of a nonlinear element at a harmonic beyond its stand-in, as its own displacement answers to a parameter.
    pub(super) fn answered(&self, a: usize, k: usize, answers: &DMatrix<f64>, theta: usize) -> Complex64 {
        let w = self.basis.width;
        (0..w).map(|c| self.force_slope(a, k, c) * answers[(a * w + c, theta)]).sum()
    }

    /// Appends `dH` at the outputs, `n_free` numbers each.
    ///
    /// A parameter changes the force of its element at a held motion by `df_k`; that acts on the structure as the external force
    /// `-df_k` across the place. The structure answers with the Jacobian of the balance.
    pub fn sensitivities(&mut self, dh: &mut Vec<Complex64>) -> Result<(), EngineError> {
        let (n, n_free, outputs) = (self.structure.n, self.structure.bound.n_free, self.outputs.len());
        let sources = self.sources()?;
        let answers = self.answers(&sources);
        let mut d = vec![Complex64::ZERO; outputs * n_free];
        for o in 0..outputs {
            let by_load = &self.flex[1].outputs[o * n..(o + 1) * n];
            for s in sources.iter().filter(|s| s.harmonic == 1) {
                d[o * n_free + s.parameter] -= self.structure.relative(s.element, by_load) * s.force;
            }
            for a in 0..self.m() {
                let u = self.structure.relative(self.structure.nonlinear[a], by_load);
                (0..n_free).for_each(|theta| d[o * n_free + theta] -= u * self.answered(a, 1, &answers, theta));
            }
        }
        let force = self.amplitude();
        dh.extend(d.into_iter().map(|d| d / force));
        Ok(())
    }
}

/// By how much a free parameter changes the force of an element at a harmonic, its motion held.
pub(super) struct Source {
    pub element: usize,
    pub harmonic: usize,
    pub parameter: usize,
    pub force: Complex64,
}

impl Source {
    /// Those of an element at a harmonic, from the derivatives of its force with respect to its own parameters.
    fn of<'a>(
        element: usize,
        harmonic: usize,
        law: &'a Element,
        force: &'a dyn Fn(usize) -> Complex64,
    ) -> impl Iterator<Item = Source> + 'a {
        let acts = law.chains.iter().enumerate().filter(|(_, c)| !c.is_empty());
        acts.flat_map(move |(p, chain)| {
            let force = force(p);
            chain.iter().map(move |(theta, slope)| Source { element, harmonic, parameter: *theta, force: force * *slope })
        })
    }
}

/// Derivative of coefficient `k` with respect to parameter `p`.
fn column(by_param: &[f64], np: usize, p: usize, k: usize) -> Complex64 {
    if k == 0 { Complex64::new(by_param[p], 0.0) } else { Complex64::new(by_param[(2 * k - 1) * np + p], -by_param[2 * k * np + p]) }
}
