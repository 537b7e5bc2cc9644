//! Laws of a strength in the quantities of a table: u = b0 + sum b_k phi_k, by least squares. u is the logarithm of the strengths that carry the
//! loss of a model ([`super::Link`]), or that of the energy itself where there is no model.

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
    /// x^m y^n, both exponents at least 1 or n = 0: a monomial of a polynomial
    Monomial(usize, u8, usize, u8),
}

/// Which terms a library holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forms {
    /// x, ln x, x^2, x y and x / y of every quantity and pair of quantities.
    Elementary,
    /// Every monomial x^m y^n up to this degree m + n, in one quantity or two.
    Polynomial(u8),
}

/// A declared library of terms: laws of one to `most` terms are searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    /// Name.
    pub name: String,
    /// Quantities, by their names in the table.
    pub quantities: Vec<String>,
    /// Terms.
    pub forms: Forms,
    /// Terms of a law at most.
    pub most: usize,
}

impl Library {
    /// All terms of the library.
    fn terms(&self) -> Vec<Term> {
        let n = self.quantities.len();
        match self.forms {
            Forms::Elementary => {
                let mut terms: Vec<Term> = (0..n).flat_map(|a| [Term::Own(a), Term::Log(a), Term::Square(a)]).collect();
                for a in 0..n {
                    terms.extend((a + 1..n).map(|b| Term::Product(a, b)));
                    terms.extend((0..n).filter(|b| *b != a).map(|b| Term::Ratio(a, b)));
                }
                terms
            }
            Forms::Polynomial(degree) => {
                let mut terms: Vec<Term> = (0..n).flat_map(|a| (1..=degree).map(move |m| Term::Monomial(a, m, a, 0))).collect();
                for a in 0..n {
                    for b in a + 1..n {
                        terms.extend((1..degree).flat_map(|m| (1..=degree - m).map(move |k| Term::Monomial(a, m, b, k))));
                    }
                }
                terms
            }
        }
    }
}

/// Every law of a library, with the values of its terms in each case.
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

/// Cases at most: the search is for small tables.
pub(super) const MOST: usize = 64;
/// Part of a column that must be its own for a law to be told from a shorter one.
const INDEPENDENT: f64 = 1e-6;

impl Laws {
    /// All laws of a library.
    pub fn new(cases: &Cases, library: &Library) -> Laws {
        let raw: Vec<Vec<f64>> = library.quantities.iter().map(|q| cases.of(q)).collect();
        let means: Vec<f64> = raw.iter().map(|v| v.iter().sum::<f64>() / v.len().max(1) as f64).collect();
        let mut laws = Laws { names: library.quantities.clone(), means, terms: library.terms(), columns: vec![], sets: vec![] };
        let rows: Vec<Vec<f64>> = (0..cases.cases.len()).map(|k| raw.iter().map(|v| v[k]).collect()).collect();
        let most = library.most;
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
            Term::Monomial(a, m, b, n) => x(a).powi(m.into()) * x(b).powi(n.into()),
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
            Term::Monomial(a, m, b, n) => {
                let power = |k: usize, m: u8| if m == 1 { name(k).to_string() } else { format!("{}^{m}", name(k)) };
                if n == 0 { power(a, m) } else { format!("{} {}", power(a, m), power(b, n)) }
            }
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

    /// A law fitted to the given values of all cases.
    pub fn fitted(&self, law: usize, logs: &[f64]) -> Option<Law> {
        let all: Vec<usize> = (0..logs.len()).collect();
        let qr = self.design(law, &all).qr();
        let b = qr.r().solve_upper_triangular(&(qr.q().transpose() * DVector::from_column_slice(logs)))?;
        Some(Law { terms: self.terms(law), coefficients: b.as_slice().to_vec() })
    }

    /// What a law gives at values of the quantities, in their order: b0 + sum b_k phi_k.
    pub fn value(&self, law: &Law, values: &[f64]) -> f64 {
        law.coefficients[0] + law.terms.iter().zip(&law.coefficients[1..]).map(|(t, b)| b * self.term(*t, values)).sum::<f64>()
    }
}

impl Ready {
    /// Sum of squares of the leave-one-out residuals on its own cases (Allen's PRESS, Technometrics 16, 1974), each times its weight.
    pub fn press(&self, values: &[f64], weights: &[f64]) -> f64 {
        let n = values.len();
        let mut left = [0.0; MOST];
        let left = &mut left[..n.min(MOST)];
        left.copy_from_slice(&values[..left.len()]);
        for column in self.q.chunks_exact(n) {
            let share: f64 = column.iter().zip(values).map(|(q, y)| q * y).sum();
            left.iter_mut().zip(column).for_each(|(r, q)| *r -= share * q);
        }
        left.iter().zip(&self.inflate).zip(weights).map(|((r, f), w)| (r * f * w).powi(2)).sum()
    }

    /// Predicted value of the case left out.
    pub fn predicted(&self, values: &[f64]) -> f64 {
        self.weights.iter().zip(values).map(|(w, y)| w * y).sum()
    }

    /// Variance of that prediction's own parameters over the variance of a value.
    pub fn leverage(&self) -> f64 {
        self.weights.iter().map(|w| w * w).sum()
    }

    /// Parameters of the law, its constant among them.
    pub fn parameters(&self) -> usize {
        self.q.len() / self.inflate.len().max(1)
    }
}
