//! A law of the strengths in the quantities of the table, identified through the calibrated model, with the whole search inside every leave-one-out fold.
//!
//! ln W_k = ln c + g(u_k) + delta_k: g is the model's energy over the strengths that carry its loss ([`Link`]), delta_k what the model gives case k over
//! the reference at unchanged strengths (its laws in the interference, eqs. 7 and 8), u_k = b0 + sum b phi_k(case) the law, c the one declared scale.
//! Three baselines stand beside it: no law (the geometric mean of the other cases), eqs. 7 and 8 alone (u_k = b0), and the same search for ln W itself,
//! without a model.

use super::search::{Problem, Searcher, relative, without_law};
use super::{Cases, Finding, Found, Law, Laws, Library, Link, Prediction, Quantity, ToleranceError, Verdict};

/// What is asked.
pub struct LawQuestion<'a> {
    /// The cases.
    pub cases: &'a Cases,
    /// Index of the case that ratios refer to.
    pub reference: usize,
    /// Declared libraries.
    pub libraries: &'a [Library],
    /// Declared scale on the model's energies, with the others that the result is held against.
    pub scale: f64,
    /// Other scales.
    pub others: &'a [f64],
    /// Energies of the model over the factor on the strengths.
    pub link: &'a Link,
    /// Energy of every case at unchanged strengths [J].
    pub base: &'a [f64],
    /// Energy at unchanged strengths at the conditions of the link [J].
    pub at_link: f64,
    /// Permutations, seed.
    pub permutations: usize,
    /// Seed of the permutations.
    pub seed: u64,
}

/// The left-out error of a library, through the model and without it.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Library, or all together.
    pub library: String,
    /// Laws searched.
    pub laws: usize,
    /// Root mean square of the left-out errors through the model.
    pub through: f64,
    /// The same of ln W in the quantities, without a model.
    pub regression: f64,
    /// Part of permuted tables that do as well, through the model.
    pub p_value: f64,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct LawOutcome {
    /// The declared scale.
    pub scale: f64,
    /// All libraries together: the search that counts.
    pub found: Found,
    /// Library by library, and all together last.
    pub compared: Vec<Compared>,
    /// Other scales, with the left-out error of all libraries together.
    pub scales: Vec<(f64, f64)>,
    /// Left-out errors of the baselines: no law, eqs. 7 and 8 alone.
    pub no_law: f64,
    /// The model's own laws in the interference alone.
    pub own_laws: f64,
    /// ln of the factor on the strengths of each case, by the law on all cases.
    pub strengths: Vec<f64>,
    /// The law, with everything to evaluate it.
    pub laws: Laws,
    /// Quantities of its library.
    pub quantities: Vec<String>,
    /// Predictions: ratios, then W_D.
    pub predictions: Vec<Prediction>,
    /// 95 % interval of each ratio predicted without its case.
    pub left_out: Vec<(f64, f64)>,
    /// Cases the model cannot reach at this scale, with the scale that would.
    pub unreached: Vec<(String, f64)>,
    /// Findings.
    pub findings: Vec<Finding>,
}

impl LawOutcome {
    /// The law taken on all cases.
    pub fn law(&self) -> &Law {
        &self.found.law.1
    }
}

/// ln W of each case in the model's scale, less what the model gives it over the reference.
fn logs(ask: &LawQuestion, scale: f64) -> Vec<f64> {
    let base = ask.base.iter().zip(&ask.cases.cases);
    base.map(|(b, c)| c.energy.ln() - scale.ln() - (b / ask.at_link).ln()).collect()
}

/// Left-out error of all libraries together at one scale.
fn at_scale(ask: &LawQuestion, scale: f64) -> Result<f64, ToleranceError> {
    let problem = Problem { cases: ask.cases, logs: logs(ask, scale), link: ask.link, permutations: 0, seed: ask.seed };
    let every: Vec<usize> = (0..ask.libraries.len()).collect();
    Ok(Searcher::new(&problem, ask.libraries)?.search(&every)?.relative)
}

/// Answers a question.
pub fn answer(ask: &LawQuestion) -> Result<LawOutcome, ToleranceError> {
    let n = ask.cases.cases.len();
    if ask.base.len() != n {
        return Err(ToleranceError::TooFew { what: "energies".into(), found: ask.base.len(), needed: n });
    }
    let problem = Problem { cases: ask.cases, logs: logs(ask, ask.scale), link: ask.link, permutations: ask.permutations, seed: ask.seed };
    let identity = Link::identity();
    let printed: Vec<f64> = ask.cases.cases.iter().map(|c| c.energy.ln()).collect();
    let plain = Problem { cases: ask.cases, logs: printed.clone(), link: &identity, permutations: 0, seed: ask.seed };
    let (through, regression) = (Searcher::new(&problem, ask.libraries)?, Searcher::new(&plain, ask.libraries)?);
    let every: Vec<usize> = (0..ask.libraries.len()).collect();
    let mut sets: Vec<Vec<usize>> = every.iter().map(|l| vec![*l]).collect();
    if sets.len() > 1 {
        sets.push(every);
    }
    let (mut compared, mut last) = (Vec::new(), None);
    for set in &sets {
        let (found, without) = (through.search(set)?, regression.search(set)?);
        compared.push(Compared {
            library: found.library.clone(),
            laws: found.laws,
            through: found.relative,
            regression: without.relative,
            p_value: found.p_value,
        });
        last = Some(found);
    }
    let found = last.ok_or(ToleranceError::TooFew { what: "libraries of terms".into(), found: 0, needed: 1 })?;
    let scales = ask.others.iter().map(|s| Ok((*s, at_scale(ask, *s)?))).collect::<Result<Vec<_>, ToleranceError>>()?;
    let (library, law) = (&ask.libraries[found.law.0], found.law.1.clone());
    let laws = through.laws[found.law.0].clone();
    let values: Vec<Vec<f64>> = library.quantities.iter().map(|q| ask.cases.of(q)).collect();
    let strengths: Vec<f64> = (0..n).map(|k| laws.value(&law, &values.iter().map(|v| v[k]).collect::<Vec<f64>>())).collect();
    let greatest = ask.link.greatest().unwrap_or(f64::INFINITY);
    let beyond = |(w, c): (&f64, &super::Case)| (*w > greatest).then(|| (c.name.clone(), ask.scale * (w - greatest).exp()));
    let unreached = problem.logs.iter().zip(&ask.cases.cases).filter_map(beyond).collect();
    let mut out = LawOutcome {
        scale: ask.scale,
        no_law: relative(without_law(&printed).into_iter()),
        own_laws: relative(without_law(&problem.logs).into_iter()),
        predictions: vec![],
        left_out: vec![],
        strengths,
        compared,
        scales,
        quantities: library.quantities.clone(),
        laws,
        found,
        unreached,
        findings: vec![],
    };
    predict(ask, &mut out);
    out.findings = findings(ask, &out);
    Ok(out)
}

/// Energies by the law on all cases, and what each is predicted as without it.
fn predict(ask: &LawQuestion, out: &mut LawOutcome) {
    let energy = |k: usize| ask.scale * (ask.link.energy(out.strengths[k])).exp() * ask.base[k] / ask.at_link;
    let printed = |k: usize| ask.cases.cases[k].energy;
    let n = ask.cases.cases.len();
    let one = |quantity: Quantity, k: usize| {
        let left = &out.found.cases[k];
        let (value, reference, unit) = match quantity {
            Quantity::Ratio => (energy(k) / energy(ask.reference), printed(k) / printed(ask.reference), printed(ask.reference)),
            _ => (energy(k), printed(k), 1.0),
        };
        let alone = left.error.exp() * printed(k) / unit;
        Prediction {
            case: ask.cases.cases[k].name.clone(),
            quantity,
            value,
            std: Some(value * left.deviation),
            interval: Some((alone * (-left.half).exp(), alone * left.half.exp())),
            reference: Some(reference),
            left_out: Some(left.error.exp() * printed(k) / printed(ask.reference)),
            outside: None,
        }
    };
    let ratios: Vec<Prediction> = (0..n).map(|k| one(Quantity::Ratio, k)).collect();
    let energies: Vec<Prediction> = (0..n).map(|k| one(Quantity::Dissipated, k)).collect();
    out.left_out = ratios.iter().map(|p| p.interval.unwrap_or((f64::NAN, f64::NAN))).collect();
    out.predictions = ratios.into_iter().chain(energies).collect();
}

fn findings(ask: &LawQuestion, out: &LawOutcome) -> Vec<Finding> {
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    let mut list = Vec::new();
    let own = super::energies::span(ask.base);
    let inside = out.predictions.iter().filter(|p| p.quantity == Quantity::Ratio && p.holds() == Some(true)).count();
    let agreed = match out.found.verdict {
        Verdict::Law => format!("every fold takes {}", out.found.words),
        Verdict::SomeLaw => format!("the folds do not agree on the law; on all cases it is {}", out.found.words),
        Verdict::CannotTell => "permuted energies are predicted as well: the table tells no law".into(),
    };
    let claim = format!(
        "ratios to case {} can be predicted {} off for a case that was left out (no law {}, the model's own laws in the interference {}): {agreed}; \
         {inside} of {} printed ratios lie in the 95 % intervals of the folds. Absolute energies rest on the declared scale of {:.3}, which no test tells; \
         the model's laws in the interference span {} where the energies span {}",
        ask.cases.cases[ask.reference].name,
        percent(out.found.relative),
        percent(out.no_law),
        percent(out.own_laws),
        ask.cases.cases.len(),
        ask.scale,
        percent(own),
        percent(ask.cases.span()),
    );
    list.push(Finding { claim, number: out.found.relative, threshold: out.no_law });
    list.extend(largest(ask));
    for (case, scale) in &out.unreached {
        let claim = format!(
            "case {case} exceeds any loop between these limits of the cycle, whatever the strengths: at the declared scale of {:.3} the model reaches {:.1} mJ; \
             a scale of {scale:.3} would reach it",
            ask.scale,
            1e3 * ask.scale * ask.link.greatest().unwrap_or(f64::INFINITY).exp()
        );
        list.push(Finding { claim, number: scale / ask.scale, threshold: 1.0 });
    }
    let all = out.compared.iter().map(|c| c.through).chain(out.scales.iter().map(|s| s.1));
    let (low, high) = all.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let claim = format!(
        "over the declared libraries and scales the left-out error runs from {} to {}: libraries and scale were declared with this table in sight, \
         so the best of them is a choice, no prediction",
        percent(low),
        percent(high)
    );
    list.push(Finding { claim, number: high, threshold: low });
    list
}

/// That the largest energy of the table exceeds any loop of the model between the limits of its cycle, so that the table needs a scale.
fn largest(ask: &LawQuestion) -> Option<Finding> {
    let reach = ask.link.greatest()?.exp();
    let worst = ask.cases.cases.iter().max_by(|a, b| a.energy.total_cmp(&b.energy))?;
    let needed = worst.energy / reach;
    let claim = format!(
        "case {} ({:.1} mJ) exceeds any loop of the model between the limits of its cycle: {:.1} mJ, at the strengths where what slides begins to stick; \
         a scale below {needed:.2} cannot reach it, so the table is of another cycle, or of another device",
        worst.name,
        1e3 * worst.energy,
        1e3 * reach
    );
    (needed > 1.0).then_some(Finding { claim, number: needed, threshold: 1.0 })
}
