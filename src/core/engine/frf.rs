//! Frequency response of small motion about the operating point, with sensitivities.
//!
//! `Z(w) X = E` with the system of `engine::small`. Elements with the same laws and numbers share one coefficient.

use num_complex::Complex64;

use crate::model::{Bound, Model};
use crate::parallel;

use super::EngineError;
use super::blocktri::{Element as Row, FrfSystem, Response, Sweep};
use super::small::Small;

/// Receptances over frequency lines.
#[derive(Clone, Debug)]
pub struct Receptance {
    /// `h[(line * inputs + i) * outputs + o]` [m/N, rad/(N m), ...].
    pub h: Vec<Complex64>,
    /// `dh[((line * inputs + i) * outputs + o) * n_free + k]`; empty unless asked for.
    pub dh: Vec<Complex64>,
}

/// Computes `H = q_out / f_in` at the circular frequencies `omega` [rad/s], about the equilibrium under the loads that stay.
pub fn receptance(
    model: &Model,
    bound: &Bound,
    omega: &[f64],
    inputs: &[usize],
    outputs: &[usize],
    sensitivities: bool,
) -> Result<Receptance, EngineError> {
    swept(&Small::new(model, bound, sensitivities)?, &Sweep { omega, inputs, outputs, sensitivities })
}

/// The same of a system of small motion at hand.
pub(super) fn swept(small: &Small, sweep: &Sweep) -> Result<Receptance, EngineError> {
    let Sweep { omega, inputs, outputs, sensitivities } = *sweep;
    let bound = small.bound;
    let mut groups: Vec<usize> = small.same.clone();
    groups.sort_unstable();
    groups.dedup();
    let group = |e: usize| groups.binary_search(&small.same[e]).unwrap_or(0);
    let rows: Vec<Row> = small.rows.iter().enumerate().map(|(e, row)| Row { group: group(e), row: row.clone() }).collect();
    let system = FrfSystem::new(small.n, &small.stiffness, &small.mass, &rows)?;
    let mut dp = Vec::new();
    if let Some(w) = omega.first() {
        // A law that refuses does so at every frequency: ask before the sweep, whose coefficients cannot fail.
        for &g in &groups {
            small.law(g, Complex64::new(0.0, *w), &mut dp)?;
        }
    }
    let coefficients = |w: f64, z: &mut [Complex64]| {
        for (z, &g) in z.iter_mut().zip(&groups) {
            *z = small.value(g, Complex64::new(0.0, w)).unwrap_or(Complex64::new(f64::NAN, 0.0));
        }
    };
    let mut response = Response::default();
    system.sweep(sweep, coefficients, &mut response)?;
    let mut dh = Vec::new();
    if sensitivities {
        let (n, ng, pairs) = (bound.n_free, groups.len(), inputs.len() * outputs.len());
        dh.resize(omega.len() * pairs * n, Complex64::ZERO);
        // Stiffness of every group along the lines, and how it changes with its displacement.
        let mut laws = Vec::with_capacity(if small.moves() { omega.len() * ng } else { 0 });
        for (line, w) in omega.iter().enumerate() {
            if parallel::given_up() {
                return Err(EngineError::GivenUp);
            }
            for (gi, &g) in groups.iter().enumerate() {
                let element = &bound.elements[g];
                let (z, _, by_x) = small.law(g, Complex64::new(0.0, *w), &mut dp)?;
                if small.moves() {
                    laws.push((z, by_x));
                }
                for (p, chain) in element.chains.iter().enumerate() {
                    for (k, slope) in chain {
                        for pair in 0..pairs {
                            let at = line * pairs + pair;
                            dh[at * n + k] += response.dh[at * ng + gi] * dp[p] * *slope;
                        }
                    }
                }
            }
        }
        if small.moves() {
            let law = |line: usize, e: usize| laws[line * ng + group(e)];
            operating_point(small, &system, sweep, coefficients, law, &mut dh)?;
        }
    }
    Ok(Receptance { h: response.h, dh })
}

/// Adds what parameters do through the operating point: `dH = -X_o' dZ X_i` with whole solution columns. `law`: of an element at a line, as in
/// [`Small::laws`].
fn operating_point(
    small: &Small,
    system: &FrfSystem,
    sweep: &Sweep,
    coefficients: impl Fn(f64, &mut [Complex64]) + Sync,
    law: impl Fn(usize, usize) -> (Complex64, Complex64),
    dh: &mut [Complex64],
) -> Result<(), EngineError> {
    let Sweep { omega, inputs, outputs, .. } = *sweep;
    let mut loads: Vec<usize> = inputs.iter().chain(outputs).copied().collect();
    loads.sort_unstable();
    loads.dedup();
    let all: Vec<usize> = (0..small.n).collect();
    let mut columns = Response::default();
    system.sweep(&Sweep { omega, inputs: &loads, outputs: &all, sensitivities: false }, coefficients, &mut columns)?;
    let (n, n_free) = (small.n, small.bound.n_free);
    let mut by_parameter = vec![Complex64::ZERO; n_free];
    for (line, w) in omega.iter().enumerate() {
        let column = |dof: usize| {
            let at = (line * loads.len() + loads.binary_search(&dof).unwrap_or(0)) * n;
            &columns.h[at..at + n]
        };
        for (i, input) in inputs.iter().enumerate() {
            for (o, output) in outputs.iter().enumerate() {
                by_parameter.fill(Complex64::ZERO);
                small.add_moved(Complex64::new(0.0, *w), |e| law(line, e), column(*output), column(*input), &mut by_parameter);
                let at = ((line * inputs.len() + i) * outputs.len() + o) * n_free;
                dh[at..at + n_free].iter_mut().zip(&by_parameter).for_each(|(d, x)| *d -= x);
            }
        }
    }
    Ok(())
}
