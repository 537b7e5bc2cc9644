//! Implicit time steps of the chain with a cubic spring in every axis of every connector: the cost of a march on the real tangent.

use std::sync::Arc;

use misfit::engine::blocktri::{Block, BlockTri, BlockTriError, Layout, Levels};

use crate::chain::{Chain, DOFS, LAWS};

/// Relative displacement of an axis at which its cubic spring carries as much as the linear one.
const SOFT: [f64; DOFS] = [1e-5, 1e-5, 1e-5, 1e-3, 1e-3, 1e-3];

/// Average acceleration (Newmark, beta 1/4, gamma 1/2) with a fixed number of Newton iterations; nothing is allocated in a step.
#[derive(Debug)]
pub struct March {
    chain: Chain,
    matrix: BlockTri<f64>,
    /// Storage slot of each mass entry.
    mass_slots: Vec<usize>,
    connectors: Vec<Connector>,
    h: f64,
    load: usize,
    time: f64,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    next: Vec<f64>,
    residual: Vec<f64>,
}

/// One connector: its degrees of freedom, its rows over them, and where its tangent lies.
#[derive(Debug, Clone)]
struct Connector {
    dofs: Vec<usize>,
    rows: [[f64; 2 * DOFS]; DOFS],
    block: Block,
}

impl Connector {
    fn new(rows: &[Vec<(usize, f64)>], layout: &Layout) -> Result<Self, BlockTriError> {
        let mut dofs: Vec<usize> = rows.iter().flatten().map(|entry| entry.0).collect();
        dofs.sort_unstable();
        dofs.dedup();
        let mut dense = [[0.0; 2 * DOFS]; DOFS];
        for (dense, row) in dense.iter_mut().zip(rows) {
            for (column, dof) in dense.iter_mut().zip(&dofs) {
                *column = row.iter().find(|entry| entry.0 == *dof).map_or(0.0, |entry| entry.1);
            }
        }
        let block = layout.block(dofs.iter().copied().map(Some))?;
        Ok(Self { dofs, rows: dense, block })
    }
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
        let connectors = chain.rows.chunks(DOFS).map(|rows| Connector::new(rows, &layout)).collect::<Result<_, _>>()?;
        let (load, zero) = (chain.input(), vec![0.0; n]);
        let (q, v, a, next, residual) = (zero.clone(), zero.clone(), zero.clone(), zero.clone(), zero);
        Ok(Self { chain, matrix: BlockTri::new(layout), mass_slots, connectors, h, load, time: 0.0, q, v, a, next, residual })
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
        for connector in &self.connectors {
            let n = connector.dofs.len();
            // What the six axes share is gathered here, so that the matrix is visited once a connector.
            let (mut forces, mut stiffness) = ([0.0; 2 * DOFS], [[0.0; 2 * DOFS]; 2 * DOFS]);
            for ((row, law), soft) in connector.rows.iter().zip(&LAWS).zip(SOFT) {
                let (mut x, mut u) = (0.0, 0.0);
                for (&i, b) in connector.dofs.iter().zip(row) {
                    x += b * self.next[i];
                    u += b * (2.0 / h * (self.next[i] - self.q[i]) - self.v[i]);
                }
                let force = law.k * (x + x * (x / soft).powi(2) + DAMPING * u);
                let tangent = law.k * (1.0 + 3.0 * (x / soft).powi(2) + 2.0 / h * DAMPING);
                for i in 0..n {
                    forces[i] += row[i] * force;
                    let scaled = tangent * row[i];
                    for j in 0..n {
                        stiffness[i][j] += scaled * row[j];
                    }
                }
            }
            connector.dofs.iter().zip(forces).for_each(|(&i, f)| self.residual[i] += f);
            self.matrix.add_block(&connector.block, |i, j| stiffness[i][j]);
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
