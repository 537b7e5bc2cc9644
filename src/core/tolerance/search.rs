//! The search for a law, with the whole search inside each leave-one-out fold, and a permutation test.
//!
//! For every case in turn the search sees the others only: among all laws of a library, or of all libraries together, it takes the one with the
//! least PRESS on them, fits it, and predicts the case. A law gives u, the logarithm of the strengths that carry the loss; the energy follows
//! through the model ([`Link`]). What chance gives is seen by permuting the energies among the cases and repeating all of it.

use crate::parallel;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::laws::{MOST, Ready};
use super::{Cases, Law, Laws, Library, Link, ToleranceError};

/// Cases at least.
const LEAST: usize = 5;
/// Probability under permutation beyond which nothing is claimed.
pub const LEVEL: f64 = 0.05;
/// Two-sided probability of the intervals.
const INSIDE: f64 = 0.95;

/// What the search says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Permuted energies are predicted as well.
    CannotTell,
    /// The energies depend on these quantities, but the folds do not agree on the law.
    SomeLaw,
    /// The same law in every fold.
    Law,
}

/// A case as predicted from the others.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// ln(predicted / given).
    pub error: f64,
    /// Standard deviation of ln(predicted): root mean square of PRESS times sqrt(1 + leverage).
    pub deviation: f64,
    /// Half the width of its 95 % interval: the deviation times Student's t at the degrees of freedom that the law leaves.
    pub half: f64,
    /// The law that the search took without the case, in words.
    pub law: String,
    /// Index of its library.
    pub library: usize,
}

/// Result of a search in one library, or in several together.
#[derive(Clone, Debug)]
pub struct Found {
    /// Name of the library, or of all together.
    pub library: String,
    /// Laws searched.
    pub laws: usize,
    /// Terms at most.
    pub terms: usize,
    /// Case by case.
    pub cases: Vec<LeftOut>,
    /// Root mean square of predicted / given - 1 over the cases left out.
    pub relative: f64,
    /// Permutations.
    pub permutations: usize,
    /// p-value: (1 + those predicted as well or better) / (1 + permutations).
    pub p_value: f64,
    /// The law that the search takes on all cases, with its library.
    pub law: (usize, Law),
    /// The same in words.
    pub words: String,
    /// Verdict.
    pub verdict: Verdict,
}

/// What is searched: ln W of each case less a part of it that no law explains (`offset`, 0 without a model), and the model between strengths
/// and energies.
pub struct Problem<'a> {
    /// The cases.
    pub cases: &'a Cases,
    /// ln of the energy, in the model's scale, less what the model gives the case at unchanged strengths over the reference.
    pub logs: Vec<f64>,
    /// From u to ln W.
    pub link: &'a Link,
    /// Permutations, and their seed.
    pub permutations: usize,
    /// Seed.
    pub seed: u64,
}

/// Everything made ready: the laws of each library, and for every fold those that its cases can tell from shorter ones.
pub struct Searcher<'a> {
    problem: &'a Problem<'a>,
    libraries: &'a [Library],
    /// Laws of each library.
    pub laws: Vec<Laws>,
    /// `folds[case][library]`.
    folds: Vec<Vec<Vec<Ready>>>,
}

/// The best law of a fold: PRESS, library and law, prediction.
struct Best<'r> {
    press: f64,
    library: usize,
    ready: &'r Ready,
}

impl<'a> Searcher<'a> {
    /// Makes the laws of all libraries ready.
    pub fn new(problem: &'a Problem<'a>, libraries: &'a [Library]) -> Result<Self, ToleranceError> {
        let n = problem.cases.cases.len();
        if !(LEAST..=MOST).contains(&n) {
            return Err(ToleranceError::TooFew { what: "a law".into(), found: n, needed: LEAST });
        }
        let laws: Vec<Laws> = libraries.iter().map(|l| Laws::new(problem.cases, l)).collect();
        let ready = |k: usize| laws.iter().map(|l| l.ready(&others(n, k), k)).collect::<Vec<_>>();
        let folds: Vec<Vec<Vec<Ready>>> = parallel::over(n, ready);
        let empty = |k: usize| (0..laws.len()).find(|l| folds[k][*l].is_empty());
        if let Some((k, l)) = (0..n).find_map(|k| Some((k, empty(k)?))) {
            let what = format!("a law of the library {} without case {}", libraries[l].name, problem.cases.cases[k].name);
            return Err(ToleranceError::TooFew { what, found: n, needed: n + 1 });
        }
        Ok(Searcher { problem, libraries, laws, folds })
    }

    /// Strengths of the cases and the slopes of the energy there.
    fn strengths(&self, logs: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = logs.iter().map(|w| self.problem.link.strength(*w)).collect();
        // Where the model reaches no further the case still counts as much as one just below.
        let slopes = u.iter().map(|u| self.problem.link.slope(u - 1e-6)).collect();
        (u, slopes)
    }

    /// The best law of some libraries for the fold that leaves out case `k`.
    fn best(&self, k: usize, which: &[usize], u: &[f64], slopes: &[f64]) -> Option<Best<'_>> {
        let ready = which.iter().flat_map(|l| self.folds[k][*l].iter().map(move |r| (*l, r)));
        let priced = ready.map(|(library, ready)| Best { press: ready.press(u, slopes), library, ready });
        priced.reduce(|a, b| if b.press < a.press { b } else { a })
    }

    /// ln(predicted / given) of each case left out.
    fn errors(&self, which: &[usize], logs: &[f64]) -> Vec<f64> {
        let (u, slopes) = self.strengths(logs);
        let n = u.len();
        let (mut a, mut b) = (vec![0.0; n - 1], vec![0.0; n - 1]);
        let mut one = |k: usize| {
            without(&u, k, &mut a);
            without(&slopes, k, &mut b);
            let best = self.best(k, which, &a, &b);
            best.map_or(f64::INFINITY, |best| self.problem.link.energy(best.ready.predicted(&a)) - logs[k])
        };
        (0..n).map(&mut one).collect()
    }

    /// Searches some libraries together.
    pub fn search(&self, which: &[usize]) -> Result<Found, ToleranceError> {
        let (problem, logs) = (self.problem, &self.problem.logs);
        let n = logs.len();
        let too_few = || ToleranceError::TooFew { what: "a law".into(), found: n, needed: n + 1 };
        let (u, slopes) = self.strengths(logs);
        let cases = (0..n).map(|k| self.left_out(k, which, &u, &slopes)).collect::<Option<Vec<LeftOut>>>().ok_or_else(too_few)?;
        let observed = relative(cases.iter().map(|c| c.error));
        let at_chance = parallel::over(problem.permutations, |stream| {
            let mut rng = ChaCha8Rng::seed_from_u64(problem.seed);
            rng.set_stream(stream as u64);
            let mut permuted = logs.clone();
            permuted.shuffle(&mut rng);
            relative(self.errors(which, &permuted).into_iter())
        });
        let as_well = at_chance.iter().filter(|error| **error <= observed).count();
        let p_value = (1 + as_well) as f64 / (1 + problem.permutations) as f64;
        let all: Vec<usize> = (0..n).collect();
        let ready: Vec<(usize, Vec<Ready>)> = which.iter().map(|l| (*l, self.laws[*l].ready(&all, 0))).collect();
        let priced = ready.iter().flat_map(|(l, r)| r.iter().map(|r| (r.press(&u, &slopes), *l, r.law)));
        let best = priced.reduce(|a, b| if b.0 < a.0 { b } else { a }).ok_or_else(too_few)?;
        let law = self.laws[best.1].fitted(best.2, &u).ok_or_else(too_few)?;
        let verdict = match p_value > LEVEL {
            true => Verdict::CannotTell,
            false if cases.iter().all(|c| c.law == cases[0].law) => Verdict::Law,
            false => Verdict::SomeLaw,
        };
        let library = if let [one] = which { self.libraries[*one].name.clone() } else { "all libraries together".into() };
        Ok(Found {
            library,
            laws: which.iter().map(|l| self.laws[*l].len()).sum(),
            terms: which.iter().map(|l| self.libraries[*l].most).max().unwrap_or(0),
            relative: observed,
            cases,
            permutations: problem.permutations,
            p_value,
            words: self.laws[best.1].words(&law.terms),
            law: (best.1, law),
            verdict,
        })
    }

    fn left_out(&self, k: usize, which: &[usize], u: &[f64], slopes: &[f64]) -> Option<LeftOut> {
        let n = u.len();
        let (mut seen, mut weights) = (vec![0.0; n - 1], vec![0.0; n - 1]);
        without(u, k, &mut seen);
        without(slopes, k, &mut weights);
        let best = self.best(k, which, &seen, &weights)?;
        let predicted = best.ready.predicted(&seen);
        let freedom = (n - 1).saturating_sub(best.ready.parameters()).max(1) as f64;
        let t = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(0.5 * (1.0 + INSIDE));
        let laws = &self.laws[best.library];
        let deviation = (best.press / (n - 1) as f64).sqrt() * (1.0 + best.ready.leverage()).sqrt();
        Some(LeftOut {
            error: self.problem.link.energy(predicted) - self.problem.logs[k],
            deviation,
            half: t * deviation,
            law: laws.words(&laws.terms(best.ready.law)),
            library: best.library,
        })
    }
}

/// Every index but one.
fn others(n: usize, k: usize) -> Vec<usize> {
    (0..n).filter(|j| *j != k).collect()
}

/// All values but one.
fn without(all: &[f64], k: usize, into: &mut [f64]) {
    into[..k].copy_from_slice(&all[..k]);
    into[k..].copy_from_slice(&all[k + 1..]);
}

/// Root mean square of e^x - 1.
pub(super) fn relative(errors: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = errors.len().max(1) as f64;
    (errors.map(|e| e.exp_m1().powi(2)).sum::<f64>() / n).sqrt()
}

/// `relative` of the geometric mean of the other cases: no law at all.
pub fn without_law(logs: &[f64]) -> Vec<f64> {
    let n = logs.len();
    let sum: f64 = logs.iter().sum();
    logs.iter().map(|w| (sum - w) / (n.max(2) - 1) as f64 - w).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::{Case, Forms, Term};
    use crate::units::{Dimension, Unit};

    fn cases(energy: impl Fn(usize, f64, f64) -> f64) -> Cases {
        let case = |k: usize| {
            let (x, y) = (0.2 + 0.1 * (k % 3) as f64, 1.0 + 0.7 * (k / 3) as f64);
            let values = [("x".to_string(), x), ("y".to_string(), y)].into();
            Case { name: (k + 1).to_string(), values, energy: energy(k, x, y), stored: None, place: String::new() }
        };
        Cases { cases: (0..9).map(case).collect(), units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) }
    }

    fn library(forms: Forms, most: usize) -> Vec<Library> {
        vec![Library { name: "l".into(), quantities: ["x", "y"].map(String::from).into(), forms, most }]
    }

    fn found(cases: &Cases, link: &Link, libraries: &[Library], permutations: usize) -> Found {
        let logs = cases.energies().iter().map(|w| w.ln()).collect();
        let problem = Problem { cases, logs, link, permutations, seed: 1 };
        let searcher = Searcher::new(&problem, libraries).unwrap();
        searcher.search(&(0..libraries.len()).collect::<Vec<usize>>()).unwrap()
    }

    #[test]
    fn a_law_that_is_there_is_found_in_every_fold() {
        let table = cases(|k, x, y| (0.5 + 1.3 * x * y).exp() * (1.0 + 0.002 * ((7 * k) % 5) as f64));
        let libraries = library(Forms::Elementary, 1);
        let f = found(&table, &Link::identity(), &libraries, 200);
        assert_eq!(f.verdict, Verdict::Law, "{f:?}");
        assert_eq!(f.law.1.terms, [Term::Product(0, 1)]);
        let none = relative(without_law(&table.energies().iter().map(|w| w.ln()).collect::<Vec<f64>>()).into_iter());
        assert!(f.relative < 0.01 && none > 0.2 && f.p_value < 0.01);
        // The intervals hold the values.
        assert!(f.cases.iter().all(|c| c.error.abs() < c.half), "{:?}", f.cases);
        let w = Laws::new(&table, &libraries[0]).value(&f.law.1, &[0.25, 1.2]).exp();
        assert!((w / (0.5f64 + 1.3 * 0.25 * 1.2).exp() - 1.0).abs() < 0.01, "{w}");
    }

    /// The strengths follow a law exactly; the energies saturate. The law is found through the model and not without it.
    #[test]
    fn a_law_of_the_strengths_is_found_through_the_model() {
        let factors: Vec<f64> = (0..14).map(|k| 0.05 * 1.4f64.powi(k)).collect();
        let w = |s: f64| s / (1.0 + s * s);
        let link = Link::new(&factors, &factors.iter().map(|s| w(*s)).collect::<Vec<f64>>()).unwrap();
        let table = cases(|_, x, y| w((-2.2 + 2.0 * x * y).exp()));
        let libraries = library(Forms::Elementary, 1);
        let (through, without) = (found(&table, &link, &libraries, 99), found(&table, &Link::identity(), &libraries, 99));
        assert_eq!((through.verdict, through.words.as_str()), (Verdict::Law, "x y"));
        assert!(through.relative < 0.01 && through.relative < 0.3 * without.relative, "{} {}", through.relative, without.relative);
    }

    #[test]
    fn polynomials_and_several_libraries_are_searched_together() {
        let table = cases(|k, x, y| (0.2 * y - 0.7 * x + 0.1 * y * y * y * x).exp() * (1.0 + 0.001 * ((5 * k) % 7) as f64));
        let mut libraries = library(Forms::Elementary, 2);
        libraries.extend(library(Forms::Polynomial(4), 3));
        let f = found(&table, &Link::identity(), &libraries, 99);
        assert_eq!(f.law.0, 1);
        assert_eq!(f.words, "x + y + x y^3");
        assert!(f.cases.iter().all(|c| c.library == 1) && f.relative < 0.01, "{f:?}");
    }

    #[test]
    fn noise_is_told_from_no_law() {
        let noise = [1.0, 2.3, 0.8, 1.9, 1.2, 2.1, 0.9, 1.1, 1.7];
        let f = found(&cases(|k, _, _| noise[k]), &Link::identity(), &library(Forms::Elementary, 2), 300);
        assert_eq!(f.verdict, Verdict::CannotTell, "{}", f.p_value);
    }

    /// PRESS and the prediction by the weights are those of refitting without each case.
    #[test]
    fn closed_forms_are_those_of_refitting() {
        let table = cases(|k, x, y| (x + 0.3 * y + 0.1 * (k as f64).sin()).exp());
        let laws = Laws::new(&table, &library(Forms::Elementary, 2)[0]);
        let logs: Vec<f64> = table.energies().iter().map(|w| w.ln()).collect();
        let law = (0..laws.len()).find(|l| laws.terms(*l) == [Term::Own(0), Term::Own(1)]).unwrap();
        let kept: Vec<usize> = (0..8).collect();
        let ready = laws.ready(&kept, 8).into_iter().find(|r| r.law == law).unwrap();
        let refit = |cases: &[usize], at: usize| {
            let x = nalgebra::DMatrix::from_fn(cases.len(), 3, |r, c| match c {
                0 => 1.0,
                c => table.of(["x", "y"][c - 1])[cases[r]],
            });
            let y = nalgebra::DVector::from_iterator(cases.len(), cases.iter().map(|k| logs[*k]));
            let b = x.svd(true, true).solve(&y, 1e-14).unwrap();
            b[0] + b[1] * table.of("x")[at] + b[2] * table.of("y")[at]
        };
        assert!((ready.predicted(&logs[..8]) - refit(&kept, 8)).abs() < 1e-10);
        let by_hand: f64 = (0..8)
            .map(|k| {
                let others: Vec<usize> = kept.iter().copied().filter(|j| *j != k).collect();
                (logs[k] - refit(&others, k)).powi(2)
            })
            .sum();
        assert!((ready.press(&logs[..8], &[1.0; 8]) / by_hand - 1.0).abs() < 1e-9);
    }
}
