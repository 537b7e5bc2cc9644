//! Frequency response of small motion about rest, with sensitivities.
//!
//! `Z(w) = sum_e z_e(w) b_e b_e' - w^2 M`, `Z X = E`; `z_e` is the dynamic stiffness of a place's element (friction stuck), `b_e` its
//! relative-displacement row. Elements with the same laws and numbers share one coefficient.

use num_complex::Complex64;

use crate::model::{Bound, Model};

use super::EngineError;
use super::blocktri::{Element as Row, FrfSystem, Response, Sweep};

/// Receptances over frequency lines.
#[derive(Clone, Debug)]
pub struct Receptance {
    /// `h[(line * inputs + i) * outputs + o]` [m/N, rad/(N m), ...].
    pub h: Vec<Complex64>,
    /// `dh[((line * inputs + i) * outputs + o) * n_free + k]`; empty unless asked for.
    pub dh: Vec<Complex64>,
}

/// Computes `H = q_out / f_in` at the circular frequencies `omega` [rad/s].
pub fn receptance(
    model: &Model,
    bound: &Bound,
    omega: &[f64],
    inputs: &[usize],
    outputs: &[usize],
    sensitivities: bool,
) -> Result<Receptance, EngineError> {
    let mut groups: Vec<usize> = Vec::new();
    let rows: Vec<Row> = bound
        .elements
        .iter()
        .enumerate()
        .map(|(e, element)| {
            let group = groups.iter().position(|&g| bound.elements[g].same_law(element)).unwrap_or_else(|| {
                groups.push(e);
                groups.len() - 1
            });
            let ends = [(element.to, 1.0), (element.from, -1.0)];
            Row { group, row: ends.iter().filter_map(|(d, sign)| Some(((*d)?, *sign))).collect() }
        })
        .collect();
    let mass: Vec<_> = model.dofs.iter().enumerate().map(|(d, dof)| (d, d, dof.mass)).collect();
    let system = FrfSystem::new(model.dofs.len(), &[], &mass, &rows)?;
    let mut dp = Vec::new();
    if let Some(w) = omega.first() {
        // A law that refuses does so at every frequency: ask before the sweep, whose coefficients cannot fail.
        for &g in &groups {
            bound.elements[g].stiffness(Complex64::new(0.0, *w), &mut dp)?;
        }
    }
    let coefficients = |w: f64, z: &mut [Complex64]| {
        let mut dp = Vec::new();
        for (z, &g) in z.iter_mut().zip(&groups) {
            *z = bound.elements[g].stiffness(Complex64::new(0.0, w), &mut dp).map_or(Complex64::new(f64::NAN, 0.0), |s| s.0);
        }
    };
    let mut response = Response::default();
    system.sweep(&Sweep { omega, inputs, outputs, sensitivities }, coefficients, &mut response)?;
    let mut dh = Vec::new();
    if sensitivities {
        let (n, ng, pairs) = (bound.n_free, groups.len(), inputs.len() * outputs.len());
        dh.resize(omega.len() * pairs * n, Complex64::ZERO);
        for (line, w) in omega.iter().enumerate() {
            for (gi, &g) in groups.iter().enumerate() {
                let element = &bound.elements[g];
                element.stiffness(Complex64::new(0.0, *w), &mut dp)?;
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
    }
    Ok(Receptance { h: response.h, dh })
}
