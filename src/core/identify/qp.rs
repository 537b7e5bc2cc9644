//! A convex quadratic program, handed to Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};

/// min 1/2 x'P x + q'x subject to equalities and inequalities, rows as (column, coefficient).
pub(crate) struct Program {
    n: usize,
    /// upper triangle of P
    pub quadratic: Vec<(usize, usize, f64)>,
    pub linear: Vec<f64>,
    equalities: Vec<(Vec<(usize, f64)>, f64)>,
    inequalities: Vec<(Vec<(usize, f64)>, f64)>,
}

/// Minimiser, multipliers and slacks of the inequalities in the order they were given.
pub(crate) struct Solution {
    pub x: Vec<f64>,
    pub z: Vec<f64>,
    pub s: Vec<f64>,
    /// false when the interior point stopped short of its tolerances: then the active rows are a good guess and x is not to be used
    pub trusted: bool,
}

impl Solution {
    /// Active inequalities by strict complementarity.
    pub fn active(&self) -> impl Iterator<Item = usize> {
        self.z.iter().zip(&self.s).enumerate().filter(|(_, (z, s))| z > s).map(|(i, _)| i)
    }
}

impl Program {
    pub fn new(n: usize) -> Self {
        Self { n, quadratic: vec![], linear: vec![0.0; n], equalities: vec![], inequalities: vec![] }
    }

    pub fn equal(&mut self, a: Vec<(usize, f64)>, b: f64) {
        self.equalities.push((a, b));
    }

    pub fn at_most(&mut self, a: Vec<(usize, f64)>, b: f64) {
        self.inequalities.push((a, b));
    }

    /// None when the interior point finds nothing at all.
    pub fn solve(&self) -> Option<Solution> {
        let triplets = |entries: &mut dyn Iterator<Item = (usize, usize, f64)>| {
            let mut t: (Vec<usize>, Vec<usize>, Vec<f64>) = Default::default();
            entries.filter(|e| e.2 != 0.0).for_each(|(i, j, v)| {
                t.0.push(i);
                t.1.push(j);
                t.2.push(v);
            });
            t
        };
        let p = triplets(&mut self.quadratic.iter().copied());
        let rows = self.equalities.iter().chain(&self.inequalities);
        let a = triplets(&mut rows.clone().enumerate().flat_map(|(i, (row, _))| row.iter().map(move |&(j, v)| (i, j, v))));
        let b: Vec<f64> = rows.map(|(_, b)| *b).collect();
        let (n_equal, n_most) = (self.equalities.len(), self.inequalities.len());
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .max_threads(1)
            .tol_gap_abs(1e-12)
            .tol_gap_rel(1e-12)
            .tol_feas(1e-12)
            .build()
            .ok()?;
        let mut solver = DefaultSolver::new(
            &CscMatrix::new_from_triplets(self.n, self.n, p.0, p.1, p.2),
            &self.linear,
            &CscMatrix::new_from_triplets(n_equal + n_most, self.n, a.0, a.1, a.2),
            &b,
            &[ZeroConeT(n_equal), NonnegativeConeT(n_most)],
            settings,
        )
        .ok()?;
        solver.solve();
        let found = &solver.solution;
        // close to the tightest tolerances the interior point may run out of digits: its answer is then good to the reduced ones
        use SolverStatus::{AlmostSolved, InsufficientProgress, MaxIterations, NumericalError, Solved};
        let trusted = matches!(found.status, Solved | AlmostSolved | InsufficientProgress);
        let usable = trusted || matches!(found.status, NumericalError | MaxIterations);
        let finite = found.x.iter().chain(&found.z).chain(&found.s).all(|v| v.is_finite());
        (usable && finite).then(|| Solution { x: found.x.clone(), z: found.z[n_equal..].to_vec(), s: found.s[n_equal..].to_vec(), trusted })
    }
}
