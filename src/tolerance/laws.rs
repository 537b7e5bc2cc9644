//! Laws of the energies in the quantities of a table: ln W = b0 + sum b_k phi_k, least squares on the logarithms.

use nalgebra::{DMatrix, DVector};

use super::Cases;

/// One term of a law, by index of its quantities; every quantity is over its mean in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// x
    Own(usize),
    /// ln x
    Log(usize),
    /// x^2
    Square(usize),
    /// x y: an interaction
    Product(usize, usize),
    /// x / y: an interaction
    Ratio(usize, usize),
}

/// Every law with one term up to `most`.
#[derive(Clone, Debug)]
pub struct Laws {
    names: Vec<String>,
    means: Vec<f64>,
    terms: Vec<Term>,
    /// Value of each term in each case.
    columns: Vec<Vec<f64>>,
    /// Terms of each law.
    sets: Vec<Vec<usize>>,
}

/// A law with its coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// Its terms.
    pub terms: Vec<Term>,
    /// b0, then one per term.
    pub coefficients: Vec<f64>,
}

/// A law on some of the cases, ready for any energies: what least squares does is linear in their logarithms.
pub(super) struct Ready {
    pub law: usize,
    /// Orthonormal basis of constant and terms, column by column.
    q: Vec<f64>,
    /// 1 / (1 - leverage) of each case.
    inflate: Vec<f64>,
    /// Weights of the cases in the prediction of the case left out.
    weights: Vec<f64>,
}

/// Part of a column that must be its own for a law to be told from a shorter one.
const INDEPENDENT: f64 = 1e-6;

impl Laws {
    /// All laws of one to `most` terms in these quantities.
    pub fn new(cases: &Cases, quantities: &[String], most: usize) -> Laws {
        let raw: Vec<Vec<f64>> = quantities.iter().map(|q| cases.of(q)).collect();
        let means: Vec<f64> = raw.iter().map(|v| v.iter().sum::<f64>() / v.len().max(1) as f64).collect();
        let n = quantities.len();
        let mut terms: Vec<Term> = (0..n).flat_map(|a| [Term::Own(a), Term::Log(a), Term::Square(a)]).collect();
        for a in 0..n {
            terms.extend((a + 1..n).map(|b| Term::Product(a, b)));
            terms.extend((0..n).filter(|b| *b != a).map(|b| Term::Ratio(a, b)));
        }
        let mut laws = Laws { names: quantities.to_vec(), means, terms, columns: vec![], sets: vec![] };
        let rows: Vec<Vec<f64>> = (0..cases.cases.len()).map(|k| raw.iter().map(|v| v[k]).collect()).collect();
        laws.columns = laws.terms.iter().map(|t| rows.iter().map(|r| laws.term(*t, r)).collect()).collect();
        let mut last: Vec<Vec<usize>> = (0..laws.terms.len()).map(|t| vec![t]).collect();
        for size in 1..=most {
            laws.sets.extend(last.iter().cloned());
            if size < most {
                let longer = |s: &Vec<usize>| {
                    let first = s.last().map_or(0, |t| t + 1);
                    (first..laws.terms.len()).map(|t| [s.as_slice(), &[t]].concat()).collect::<Vec<_>>()
                };
                last = last.iter().flat_map(longer).collect();
            }
        }
        laws
    }

    /// How many laws there are.
    pub fn len(&self) -> usize {
        self.sets.len()
    }
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.sets.is_empty()
    }
    /// Number of terms of a law.
    pub fn size(&self, law: usize) -> usize {
        self.sets[law].len()
    }
    /// Terms of a law.
    pub fn terms(&self, law: usize) -> Vec<Term> {
        self.sets[law].iter().map(|t| self.terms[*t]).collect()
    }

    fn term(&self, term: Term, values: &[f64]) -> f64 {
        let x = |k: usize| values[k] / self.means[k];
        match term {
            Term::Own(a) => x(a),
            Term::Log(a) => x(a).ln(),
            Term::Square(a) => x(a) * x(a),
            Term::Product(a, b) => x(a) * x(b),
            Term::Ratio(a, b) => x(a) / x(b),
        }
    }

    /// A term in words.
    pub fn word(&self, term: Term) -> String {
        let name = |k: usize| self.names[k].as_str();
        match term {
            Term::Own(a) => name(a).into(),
            Term::Log(a) => format!("ln {}", name(a)),
            Term::Square(a) => format!("{}^2", name(a)),
            Term::Product(a, b) => format!("{} {}", name(a), name(b)),
            Term::Ratio(a, b) => format!("{}/{}", name(a), name(b)),
        }
    }

    /// A set of terms in words.
    pub fn words(&self, terms: &[Term]) -> String {
        terms.iter().map(|t| self.word(*t)).collect::<Vec<_>>().join(" + ")
    }

    fn design(&self, law: usize, cases: &[usize]) -> DMatrix<f64> {
        let set = &self.sets[law];
        DMatrix::from_fn(cases.len(), 1 + set.len(), |r, c| if c == 0 { 1.0 } else { self.columns[set[c - 1]][cases[r]] })
    }

    /// The laws that some cases can tell from shorter ones, to predict the case `out`.
    pub(super) fn ready(&self, cases: &[usize], out: usize) -> Vec<Ready> {
        (0..self.sets.len()).filter_map(|law| self.one(law, cases, out)).collect()
    }

    fn one(&self, law: usize, cases: &[usize], out: usize) -> Option<Ready> {
        let x = self.design(law, cases);
        if x.nrows() <= x.ncols() {
            return None;
        }
        let norms: Vec<f64> = x.column_iter().map(|c| c.norm()).collect();
        let qr = x.qr();
        let (q, r) = (qr.q(), qr.r());
        if (0..r.ncols()).any(|k| r[(k, k)].abs() <= INDEPENDENT * norms[k]) {
            return None;
        }
        let inflate: Vec<f64> = q.row_iter().map(|row| 1.0 / (1.0 - row.norm_squared()).max(f64::EPSILON)).collect();
        // A case that alone decides a coefficient cannot be predicted from the others.
        if inflate.iter().any(|f| *f > 1e6) {
            return None;
        }
        let mut at = DVector::from_element(r.ncols(), 1.0);
        self.sets[law].iter().enumerate().for_each(|(k, t)| at[k + 1] = self.columns[*t][out]);
        let weights = &q * r.transpose().solve_lower_triangular(&at)?;
        Some(Ready { law, q: q.as_slice().to_vec(), inflate, weights: weights.as_slice().to_vec() })
    }

    /// A law fitted to the given energies of all cases.
    pub fn fitted(&self, law: usize, logs: &[f64]) -> Option<Law> {
        let all: Vec<usize> = (0..logs.len()).collect();
        let qr = self.design(law, &all).qr();
        let b = qr.r().solve_upper_triangular(&(qr.q().transpose() * DVector::from_column_slice(logs)))?;
        Some(Law { terms: self.terms(law), coefficients: b.as_slice().to_vec() })
    }

    /// The energy a law gives at values of the quantities, in their order.
    pub fn energy(&self, law: &Law, values: &[f64]) -> f64 {
        let sum: f64 = law.terms.iter().zip(&law.coefficients[1..]).map(|(t, b)| b * self.term(*t, values)).sum();
        (law.coefficients[0] + sum).exp()
    }
}

impl Ready {
    /// Sum of squares of the leave-one-out residuals on its own cases (Allen's PRESS, Technometrics 16, 1974).
    pub fn press(&self, logs: &[f64]) -> f64 {
        let n = logs.len();
        let mut left = [0.0; 64];
        let left = &mut left[..n.min(64)];
        left.copy_from_slice(&logs[..left.len()]);
        for column in self.q.chunks_exact(n) {
            let share: f64 = column.iter().zip(logs).map(|(q, y)| q * y).sum();
            left.iter_mut().zip(column).for_each(|(r, q)| *r -= share * q);
        }
        left.iter().zip(&self.inflate).map(|(r, f)| (r * f).powi(2)).sum()
    }

    /// Predicted logarithm of the energy of the case left out.
    pub fn predicted(&self, logs: &[f64]) -> f64 {
        self.weights.iter().zip(logs).map(|(w, y)| w * y).sum()
    }
}
