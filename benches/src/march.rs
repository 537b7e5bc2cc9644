//! Implicit time steps of the chain with a cubic spring in every axis of every connector: the cost of a march on the real tangent.

use std::sync::Arc;

use misfit::engine::blocktri::{BlockTri, BlockTriError, Layout, Levels};

use crate::chain::{Chain, DOFS, LAWS};

/// Relative displacement of an axis at which its cubic spring carries as much as the linear one.
const SOFT: [f64; DOFS] = [1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3];

/// Average acceleration (Newmark, beta 1/4, gamma 1/2) with a fixed number of Newton iterations; nothing is allocated in a step.
#[derive(Debug)]
pub struct March {
    chain: Chain,
    matrix: BlockTri<f64>,
    /// Storage slot of each mass entry, and of each pair of entries of each row.
    mass_slots: Vec<usize>,
    row_slots: Vec<Vec<usize>>,
    h: f64,
    load: usize,
    time: f64,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    next: Vec<f64>,
    residual: Vec<f64>,
}

const NEWTON: usize = 2;
/// Viscous part: c = k DAMPING.
const DAMPING: f64 = 1e-5;

impl March {
    pub fn new(bodies: usize, h: f64) -> Result<Self, BlockTriError> {
        let chain = Chain::new(bodies);
        let n = chain.n();
        let pairs: Vec<_> = chain.rows.iter().flat_map(|r| r.iter().flat_map(|a| r.iter().map(|b| (a.0, b.0)))).collect();
        let layout = Arc::new(Layout::new(Levels::new(n, &pairs)?));
        let mass_slots = chain.mass.iter().map(|m| layout.slot(m.0, m.1)).collect::<Result<_, _>>()?;
        let slots_of = |row: &Vec<(usize, f64)>| row.iter().flat_map(|a| row.iter().map(|b| layout.slot(a.0, b.0))).collect();
        let row_slots = chain.rows.iter().map(slots_of).collect::<Result<_, _>>()?;
        let (load, zero) = (chain.input(), vec![0.0; n]);
        let (q, v, a, next, residual) = (zero.clone(), zero.clone(), zero.clone(), zero.clone(), zero);
        Ok(Self { chain, matrix: BlockTri::new(layout), mass_slots, row_slots, h, load, time: 0.0, q, v, a, next, residual })
    }

    /// Displacement of the loaded dof.
    pub fn end(&self) -> f64 {
        self.q[self.load]
    }

    /// Largest unbalanced force before the last Newton correction, against the load of 1 N.
    pub fn step(&mut self) -> Result<f64, BlockTriError> {
        let h = self.h;
        self.time += h;
        self.next.copy_from_slice(&self.q);
        let mut unbalanced = 0.0;
        for _ in 0..NEWTON {
            self.linearise();
            unbalanced = self.residual.iter().fold(0.0f64, |m, r| m.max(r.abs()));
            self.matrix.factor()?;
            self.matrix.solve(&mut self.residual)?;
            self.next.iter_mut().zip(&self.residual).for_each(|(q, d)| *q -= d);
        }
        for i in 0..self.q.len() {
            let velocity = 2.0 / h * (self.next[i] - self.q[i]) - self.v[i];
            self.a[i] = 2.0 / h * (velocity - self.v[i]) - self.a[i];
            self.v[i] = velocity;
            self.q[i] = self.next[i];
        }
        Ok(unbalanced)
    }

    /// Residual M a + sum b f(b'q, b'v) - load and its tangent at the trial displacement.
    fn linearise(&mut self) {
        let h = self.h;
        self.matrix.clear();
        for (&slot, &(i, _, m)) in self.mass_slots.iter().zip(&self.chain.mass) {
            self.matrix.add_at(slot, 4.0 / (h * h) * m);
            let acceleration = 4.0 / (h * h) * (self.next[i] - self.q[i]) - 4.0 / h * self.v[i] - self.a[i];
            self.residual[i] = m * acceleration;
        }
        self.residual[self.load] -= (2000.0 * self.time).sin();
        for (at, (row, slots)) in self.chain.rows.iter().zip(&self.row_slots).enumerate() {
            let (k, soft) = (LAWS[at % DOFS].k, SOFT[at % DOFS]);
            let (mut x, mut u) = (0.0, 0.0);
            for &(i, b) in row {
                x += b * self.next[i];
                u += b * (2.0 / h * (self.next[i] - self.q[i]) - self.v[i]);
            }
            let force = k * (x + x * (x / soft).powi(2) + DAMPING * u);
            let tangent = k * (1.0 + 3.0 * (x / soft).powi(2) + 2.0 / h * DAMPING);
            row.iter().for_each(|&(i, b)| self.residual[i] += b * force);
            let mut slots = slots.iter();
            for &(_, a) in row {
                for (&(_, b), &slot) in row.iter().zip(&mut slots) {
                    self.matrix.add_at(slot, tangent * a * b);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::March;

    #[test]
    fn newton_converges_in_every_step() {
        let mut march = March::new(22, 1e-5).unwrap();
        let mut largest: f64 = 0.0;
        for _ in 0..400 {
            let unbalanced = march.step().unwrap();
            assert!(unbalanced < 1e-2, "{unbalanced}");
            largest = largest.max(march.end().abs());
        }
        assert!(largest > 1e-6 && largest < 1e-2, "{largest}");
    }
}
