//! Where the strengths of each test stand.
//!
//! A strength that differs from test to test is integrated out, the response taken as linear in its deviation. About no deviation that holds for what
//! hardly shows; the resonance of a lightly damped structure that is half a percent stiffer in one test lies beside the other one, and no column of
//! derivatives leads there. So the response is linear about where the deviations of each test are likeliest instead (Lindstrom and Bates,
//! Biometrics 46, 1990): the least of
//!
//! ```text
//! (f(theta, b) - y)' (D + B B')^-1 (f(theta, b) - y) + b'b / omega^2      B: the columns of instruments alone
//! ```
//!
//! and the residual that all else goes by is `f(theta, b) - S b - y` with `S = df/db` there.

use nalgebra::{DMatrix, DVector};

use crate::parallel;

use super::likelihood::{Gram, information};
use super::{Counts, Evidence, Seen, Variances, beside};

/// Deviations of strengths by name, as logarithms.
pub type Deviations = Vec<(String, f64)>;

/// What a test says of its strengths, to second order about where they stand.
struct Wish {
    /// `[r, S]' V^-1 [r, S]`, the prior with it.
    gram: DMatrix<f64>,
}

impl Wish {
    fn at(&self, b: &DVector<f64>) -> f64 {
        let n = b.len();
        let (along, square) = (self.gram.view((1, 0), (n, 1)), self.gram.view((1, 1), (n, n)));
        self.gram[(0, 0)] + 2.0 * along.column(0).dot(b) + (square * b).dot(b)
    }

    fn least(&self) -> Option<DVector<f64>> {
        let n = self.gram.ncols() - 1;
        let (along, square) = (self.gram.view((1, 0), (n, 1)).into_owned(), self.gram.view((1, 1), (n, n)).into_owned());
        let least = -square.cholesky()?.solve(&along);
        Some(least.column(0).into_owned())
    }
}

impl Evidence {
    fn wish(&self, t: usize, seen: &Seen, counts: &Counts, v: &Variances) -> Option<Wish> {
        let record = &self.records[t];
        let parts = record.parts(v.kappa, &v.own_errors(t, record));
        let r = DMatrix::from_column_slice(seen.r.len(), 1, seen.r.as_slice());
        let x = Gram { x: beside(&r, &seen.strengths), b: DMatrix::zeros(0, 0) };
        let mut gram = information(&x, &record.instruments, &parts, &counts.z[t])?.0;
        (1..gram.ncols()).for_each(|k| gram[(k, k)] += (-2.0 * v.omega).exp());
        Some(Wish { gram })
    }

    /// The tests seen about where their own strengths are likeliest, from where they stand. `see`: a test with these deviations, and what was computed for
    /// it; none where it cannot be. A step that promises less than [`super::Settings::strengths_from`] is none, and one that the response does not follow
    /// is halved. With each test what was computed, where it is not as it was.
    pub fn settled<C: Send>(
        &self,
        seen: Vec<Seen>,
        counts: &Counts,
        v: &Variances,
        see: &(dyn Fn(usize, &Deviations) -> Option<(Seen, C)> + Sync),
    ) -> Vec<(Seen, Option<C>)> {
        let s = &self.settings;
        parallel::map_into(seen, |t, mut seen| {
            let mut last = None;
            for _ in 0..s.strengths_steps {
                let Some(wish) = self.wish(t, &seen, counts, v).filter(|w| w.gram.ncols() > 1) else { break };
                let Some(wanted) = wish.least() else { break };
                let (stands, here) = (seen.standing(), wish.at(&seen.standing()));
                if 0.5 * (here - wish.at(&wanted)) <= s.strengths_from {
                    break;
                }
                let part = |part: f64| {
                    let by = &stands + (&wanted - &stands) * part;
                    let named: Deviations = seen.names.iter().cloned().zip(by.iter().copied()).collect();
                    let there = see(t, &named)?;
                    let nearer = self.wish(t, &there.0, counts, v)?.at(&by) < here;
                    nearer.then_some(there)
                };
                let Some((there, computed)) = [1.0, 0.5, 0.25].into_iter().find_map(part) else { break };
                (seen, last) = (there, Some(computed));
            }
            (seen, last)
        })
    }
}

/// Where the strengths of tests stand, as their variances carry it.
pub fn standing(seen: &[Seen]) -> Vec<Deviations> {
    seen.iter().map(|s| s.own.by.clone()).collect()
}
