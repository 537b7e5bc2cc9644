//! Six parameters of the chain from its noisy FRF: residuals and exact Jacobian.
//!
//! Connector stiffnesses come in three classes (axial, shear, rotation). Axis a of class g has k_a s_g (1 + i eta_g + beta i w tau / (1 + i w tau));
//! the parameters are p = (s_1, s_2, s_3, eta_1, eta_2, eta_3).

use misfit::engine::blocktri::{BlockTriError, FrfSystem, Response, Sweep};
use misfit::identify::{EvalError, LeastSquares};
use nalgebra::{DMatrix, DVector};

use crate::chain::{C64, Chain, DOFS, LAWS, Law};

pub const CLASSES: usize = 3;
pub const PARAMETERS: usize = 2 * CLASSES;
pub const TRUTH: [f64; PARAMETERS] = [1.0, 1.0, 1.0, 0.03, 0.05, 0.06];
pub const START: [f64; PARAMETERS] = [1.15, 0.9, 1.1, 0.04, 0.035, 0.08];
/// Maxwell branch common to all classes.
const BETA: f64 = 0.15;
const TAU: f64 = 4e-4;

/// Class of an axis of a connector.
pub fn class(axis: usize) -> usize {
    [0, 1, 1, 2, 2, 2][axis]
}

/// The chain with the stiffness of each axis taken into its rows, so that the coefficients are about 1.
pub fn chain(bodies: usize) -> Chain {
    let mut chain = Chain::new(bodies);
    for (at, row) in chain.rows.iter_mut().enumerate() {
        row.iter_mut().for_each(|(_, v)| *v *= LAWS[at % DOFS].k.sqrt());
    }
    chain
}

pub fn laws(p: &[f64]) -> [Law; CLASSES] {
    std::array::from_fn(|g| Law { k: p[g], eta: p[CLASSES + g], beta: BETA, tau: TAU })
}

/// Residuals (H - measured) / (sigma |measured|), real and imaginary parts one after the other.
#[derive(Debug)]
pub struct FrfFit {
    system: FrfSystem,
    omega: Vec<f64>,
    input: usize,
    outputs: Vec<usize>,
    measured: Vec<C64>,
    sigma: f64,
}

impl FrfFit {
    pub fn new(chain: &Chain, omega: Vec<f64>, measured: Vec<C64>, sigma: f64) -> Result<Self, BlockTriError> {
        let system = FrfSystem::new(chain.n(), &[], &chain.mass, &chain.elements(class))?;
        Ok(Self { system, omega, input: chain.input(), outputs: chain.outputs().to_vec(), measured, sigma })
    }

    fn evaluate(&self, p: &[f64], sensitivities: bool) -> Result<Response, BlockTriError> {
        let laws = laws(p);
        let sweep = Sweep { omega: &self.omega, inputs: &[self.input], outputs: &self.outputs, sensitivities };
        let mut response = Response::default();
        let coefficients = |w: f64, z: &mut [C64]| z.iter_mut().zip(&laws).for_each(|(z, law)| *z = law.stiffness(w));
        self.system.sweep(&sweep, coefficients, &mut response)?;
        Ok(response)
    }

    fn whiten(&self, h: &[C64]) -> DVector<f64> {
        let whitened = h.iter().zip(&self.measured).map(|(h, m)| (h - m) / (self.sigma * m.norm()));
        DVector::from_iterator(2 * self.measured.len(), whitened.flat_map(|r| [r.re, r.im]))
    }
}

/// What `misfit::identify` fits.
impl LeastSquares for FrfFit {
    fn n_params(&self) -> usize {
        PARAMETERS
    }

    fn n_residuals(&self) -> usize {
        2 * self.measured.len()
    }

    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        Ok(self.whiten(&self.evaluate(p, false).map_err(why)?.h))
    }

    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let (response, laws) = (self.evaluate(p, true).map_err(why)?, laws(p));
        let mut jacobian = DMatrix::zeros(self.n_residuals(), PARAMETERS);
        for (at, (measured, dh)) in self.measured.iter().zip(response.dh.chunks_exact(CLASSES)).enumerate() {
            let scale = 1.0 / (self.sigma * measured.norm());
            let w = self.omega[at / self.outputs.len()];
            for (g, law) in laws.iter().enumerate() {
                // z = s (1 + i eta + ...), so dz/ds = z/s and dz/deta = i s.
                let by = [(g, dh[g] * (law.stiffness(w) / law.k)), (CLASSES + g, dh[g] * C64::new(0.0, law.k))];
                for (parameter, d) in by {
                    jacobian[(2 * at, parameter)] = d.re * scale;
                    jacobian[(2 * at + 1, parameter)] = d.im * scale;
                }
            }
        }
        Ok((self.whiten(&response.h), jacobian))
    }
}

fn why(e: BlockTriError) -> EvalError {
    EvalError::new(e.to_string())
}
