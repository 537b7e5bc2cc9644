//! The search for a law, with the whole search inside each leave-one-out fold, and a permutation test.
//!
//! For every case in turn the search sees the others only: among all laws it takes the one with the least PRESS on them, fits it, and
//! predicts the case. What chance gives is seen by permuting the energies among the cases and repeating all of it.

use crate::parallel;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::laws::Ready;
use super::{Cases, Law, Laws, ToleranceError};

/// Cases at least.
const LEAST: usize = 5;
/// Cases at most: the search is for small tables.
const MOST: usize = 64;
/// Probability under permutation beyond which nothing is claimed.
pub const LEVEL: f64 = 0.05;

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

/// Result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// Laws searched.
    pub laws: usize,
    /// Terms at most.
    pub terms: usize,
    /// ln(predicted / printed) of each case left out.
    pub errors: Vec<f64>,
    /// The law chosen without each case, in words.
    pub chosen: Vec<String>,
    /// Root mean square of predicted / printed - 1 over the cases left out.
    pub relative: f64,
    /// Root mean square of ln(predicted / printed), as a factor minus one.
    pub factor: f64,
    /// `relative` of the mean of the other cases: no law at all.
    pub no_law: f64,
    /// Permutations, and the part of them that is predicted as well or better.
    pub permutations: usize,
    /// p-value: (1 + those) / (1 + permutations).
    pub p_value: f64,
    /// The law that the search takes on all cases.
    pub law: Law,
    /// The same in words.
    pub words: String,
    /// Verdict.
    pub verdict: Verdict,
}

/// Searches laws of one to `terms` terms.
pub fn search(cases: &Cases, quantities: &[String], terms: usize, permutations: usize, seed: u64) -> Result<(Laws, Found), ToleranceError> {
    let n = cases.cases.len();
    if !(LEAST..=MOST).contains(&n) {
        return Err(ToleranceError::TooFew { what: "a law".into(), found: n, needed: LEAST });
    }
    let laws = Laws::new(cases, quantities, terms);
    let logs: Vec<f64> = cases.energies().iter().map(|w| w.ln()).collect();
    let others = |k: usize| (0..n).filter(|j| *j != k).collect::<Vec<usize>>();
    let folds: Vec<Vec<Ready>> = parallel::over(n, |k| laws.ready(&others(k), k));
    if let Some(k) = folds.iter().position(Vec::is_empty) {
        return Err(ToleranceError::TooFew { what: format!("a law without case {}", cases.cases[k].name), found: n, needed: n + 1 });
    }
    let whole = left_out(&folds, &logs);
    let errors: Vec<f64> = whole.iter().map(|w| w.1).collect();
    let observed = relative(&errors);
    let at_chance = parallel::over(permutations, |stream| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream as u64);
        let mut permuted = logs.clone();
        permuted.shuffle(&mut rng);
        let errors: Vec<f64> = left_out(&folds, &permuted).iter().map(|w| w.1).collect();
        relative(&errors)
    });
    let as_well = at_chance.iter().filter(|error| **error <= observed).count();
    let p_value = (1 + as_well) as f64 / (1 + permutations) as f64;
    let chosen: Vec<String> = whole.iter().map(|w| laws.words(&laws.terms(w.0))).collect();
    let all: Vec<usize> = (0..n).collect();
    let best = laws.ready(&all, 0).iter().map(|r| (r.press(&logs), r.law)).fold((f64::INFINITY, 0), |m, c| if c.0 < m.0 { c } else { m });
    let law = laws.fitted(best.1, &logs);
    let law = law.ok_or(ToleranceError::TooFew { what: "a law".into(), found: n, needed: n + 1 })?;
    let verdict = match p_value > LEVEL {
        true => Verdict::CannotTell,
        false if chosen.iter().all(|c| *c == chosen[0]) => Verdict::Law,
        false => Verdict::SomeLaw,
    };
    let mean = |k: usize| others(k).iter().map(|j| logs[*j]).sum::<f64>() / (n - 1) as f64;
    let without: Vec<f64> = (0..n).map(|k| mean(k) - logs[k]).collect();
    let found = Found {
        laws: laws.len(),
        terms,
        relative: observed,
        factor: (errors.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt().exp_m1(),
        no_law: relative(&without),
        errors,
        chosen,
        permutations,
        p_value,
        words: laws.words(&law.terms),
        law,
        verdict,
    };
    Ok((laws, found))
}

/// For each case the law chosen without it, and ln(predicted / given).
fn left_out(folds: &[Vec<Ready>], logs: &[f64]) -> Vec<(usize, f64)> {
    let mut seen = Vec::with_capacity(logs.len());
    let one = |(k, fold): (usize, &Vec<Ready>)| {
        seen.clear();
        seen.extend(logs.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, y)| *y));
        let best = fold.iter().map(|r| (r.press(&seen), r)).reduce(|a, b| if b.0 < a.0 { b } else { a });
        best.map_or((0, f64::INFINITY), |(_, r)| (r.law, r.predicted(&seen) - logs[k]))
    };
    folds.iter().enumerate().map(one).collect()
}

fn relative(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e.exp_m1().powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::{Case, Term};
    use crate::units::{Dimension, Unit};

    fn cases(energy: impl Fn(usize, f64, f64) -> f64) -> Cases {
        let case = |k: usize| {
            let (x, y) = (0.2 + 0.1 * (k % 3) as f64, 1.0 + 0.7 * (k / 3) as f64);
            Case { name: (k + 1).to_string(), values: [("x".to_string(), x), ("y".to_string(), y)].into(), energy: energy(k, x, y) }
        };
        Cases { cases: (0..9).map(case).collect(), units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) }
    }
    const NAMES: [&str; 2] = ["x", "y"];

    #[test]
    fn a_law_that_is_there_is_found_in_every_fold() {
        let table = cases(|k, x, y| (0.5 + 1.3 * x * y).exp() * (1.0 + 0.002 * ((7 * k) % 5) as f64));
        let names = NAMES.map(String::from);
        let (laws, found) = search(&table, &names, 1, 200, 1).unwrap();
        assert_eq!(found.verdict, Verdict::Law, "{found:?}");
        assert_eq!(found.law.terms, [Term::Product(0, 1)]);
        assert!(found.relative < 0.01 && found.no_law > 0.2 && found.p_value < 0.01);
        let w = laws.energy(&found.law, &[0.25, 1.2]);
        assert!((w / (0.5f64 + 1.3 * 0.25 * 1.2).exp() - 1.0).abs() < 0.01, "{w}");
    }

    #[test]
    fn noise_is_told_from_no_law() {
        let noise = [1.0, 2.3, 0.8, 1.9, 1.2, 2.1, 0.9, 1.1, 1.7];
        let table = cases(|k, _, _| noise[k]);
        let (_, found) = search(&table, &NAMES.map(String::from), 2, 300, 3).unwrap();
        assert_eq!(found.verdict, Verdict::CannotTell, "{}", found.p_value);
        assert!(search(&cases(|_, x, _| x), &NAMES.map(String::from), 1, 10, 1).is_ok());
    }

    /// PRESS and the prediction by the weights are those of refitting without each case.
    #[test]
    fn closed_forms_are_those_of_refitting() {
        let table = cases(|k, x, y| (x + 0.3 * y + 0.1 * (k as f64).sin()).exp());
        let laws = Laws::new(&table, &NAMES.map(String::from), 2);
        let logs: Vec<f64> = table.energies().iter().map(|w| w.ln()).collect();
        let law = (0..laws.len()).find(|l| laws.terms(*l) == [Term::Own(0), Term::Own(1)]).unwrap();
        let kept: Vec<usize> = (0..8).collect();
        let ready = laws.ready(&kept, 8).into_iter().find(|r| r.law == law).unwrap();
        let refit = |cases: &[usize], at: usize| {
            let x = nalgebra::DMatrix::from_fn(cases.len(), 3, |r, c| match c {
                0 => 1.0,
                c => table.of(NAMES[c - 1])[cases[r]],
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
        assert!((ready.press(&logs[..8]) / by_hand - 1.0).abs() < 1e-9);
    }
}
