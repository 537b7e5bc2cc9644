//! What a realistic trial amounts to: recovery over strength, what it claims without ground, and the rows in which nothing is hidden.

use serde::Serialize;

use super::judge::CaseResult;
use super::{Imperfection, Kind};

/// Ends of the bins of strength [standard deviations].
const BINS: [f64; 6] = [2.0, 4.0, 7.0, 12.0, 20.0, f64::INFINITY];
/// Normal quantile of a two-sided interval of 95 %.
const QUANTILE: f64 = 1.959964;

/// A count of some with Wilson's interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Share {
    /// How many.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// Wilson's interval; 0 to 1 where there are none.
    pub interval: (f64, f64),
}

impl Share {
    /// `count` of `of`.
    pub fn new(count: usize, of: usize) -> Share {
        let (n, z2) = (of as f64, QUANTILE * QUANTILE);
        if of == 0 {
            return Share { count, of, interval: (0.0, 1.0) };
        }
        let p = count as f64 / n;
        let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = QUANTILE * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / (1.0 + z2 / n);
        Share { count, of, interval: ((middle - half).max(0.0), (middle + half).min(1.0)) }
    }

    fn of<'a>(cases: impl Iterator<Item = &'a CaseResult>, is: impl Fn(&CaseResult) -> bool) -> Share {
        let (mut count, mut all) = (0, 0);
        for c in cases {
            all += 1;
            count += usize::from(is(c));
        }
        Share::new(count, all)
    }
}

/// A bin of strength.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Bin {
    /// connector or chain.
    pub structure: &'static str,
    /// Least strength [standard deviations].
    pub from: f64,
    /// Largest; none: no end.
    pub to: Option<f64>,
    /// Effect and place first, strictly.
    pub strict: Share,
    /// The same with declared ties.
    pub with_ties: Share,
}

/// What is said of the cases of one structure.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct OfStructure {
    /// connector or chain.
    pub structure: &'static str,
    /// Cases.
    pub cases: usize,
    /// Of those that hide one or two effects of the library: effect and place first, strictly.
    pub first_strict: Share,
    /// The same with declared ties.
    pub first_with_ties: Share,
    /// Of those that hide two: both named, with declared ties.
    pub both: Share,
    /// Of those that hide nothing: nothing named and not unexplained.
    pub quiet: Share,
    /// Wrong effects per case.
    pub wrong_per_case: f64,
    /// Wrong instruments per case.
    pub wrong_instruments_per_case: f64,
    /// Of those with an instrument at fault: blamed on physics.
    pub blamed: Share,
    /// Of those in which something is claimed: the held-out error did not fall by its standard error.
    pub unfounded: Share,
    /// Median of the held-out error over that of the true law.
    pub held_out_over_truth: Option<f64>,
    /// Median wall time of a case [s].
    pub wall_s: Option<f64>,
}

/// Cases that hide nothing, of one imperfection.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct NullRow {
    /// The imperfection, or `all`.
    pub imperfection: &'static str,
    /// connector or chain.
    pub structure: &'static str,
    /// A false effect is named.
    pub false_effect: Share,
    /// A fault of an instrument is named.
    pub false_instrument: Share,
    /// No effect is named, and the verdict is `unexplained`.
    pub unexplained: Share,
    /// Effects and instruments named, with their count.
    pub named: Vec<(String, usize)>,
}

/// A realistic trial.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Realistic {
    /// Recovery of hidden effects of the library over strength.
    pub curve: Vec<Bin>,
    /// By structure.
    pub structures: Vec<OfStructure>,
    /// Cases that hide nothing, by imperfection.
    pub null_rows: Vec<NullRow>,
}

fn structure(r: &CaseResult) -> &'static str {
    if r.bodies == 0 { "connector" } else { "chain" }
}

fn hides(r: &CaseResult) -> bool {
    matches!(r.kind, Kind::One | Kind::Two)
}

/// The middle of some values.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut all: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let n = all.len();
    (n > 0).then(|| 0.5 * (all[(n - 1) / 2] + all[n / 2]))
}

/// Sums up realistic cases; none where there are none.
pub fn realistic(results: &[CaseResult]) -> Option<Realistic> {
    let all: Vec<&CaseResult> = results.iter().filter(|r| r.lived.is_some()).collect();
    if all.is_empty() {
        return None;
    }
    let (mut curve, mut structures, mut null_rows) = (vec![], vec![], vec![]);
    for name in ["connector", "chain"] {
        let own: Vec<&CaseResult> = all.iter().filter(|r| structure(r) == name).copied().collect();
        if own.is_empty() {
            continue;
        }
        curve.extend(BINS.windows(2).filter_map(|ends| bin(name, &own, (ends[0], ends[1]))));
        structures.push(of_structure(name, &own));
        let rows = std::iter::once(None).chain(Imperfection::WORDS.iter().map(|w| Some(w.1)));
        null_rows.extend(rows.filter_map(|only| null_row(name, &own, only)));
    }
    Some(Realistic { curve, structures, null_rows })
}

fn bin(structure: &'static str, own: &[&CaseResult], (from, to): (f64, f64)) -> Option<Bin> {
    let inside = |r: &&&CaseResult| hides(r) && r.lived.as_ref().is_some_and(|l| l.strength >= from && l.strength < to);
    let cases = || own.iter().filter(inside).copied();
    let strict = Share::of(cases(), |r| r.lived.as_ref().is_some_and(|l| l.first_strict));
    let with_ties = Share::of(cases(), |r| r.lived.as_ref().is_some_and(|l| l.first_with_ties));
    (strict.of > 0).then_some(Bin { structure, from, to: to.is_finite().then_some(to), strict, with_ties })
}

fn of_structure(structure: &'static str, own: &[&CaseResult]) -> OfStructure {
    let lived = |r: &CaseResult| r.lived.clone().unwrap_or_default();
    let of = |is: fn(&CaseResult) -> bool| own.iter().filter(move |r| is(r)).copied();
    let mean = |count: usize| count as f64 / own.len().max(1) as f64;
    OfStructure {
        structure,
        cases: own.len(),
        first_strict: Share::of(of(hides), |r| lived(r).first_strict),
        first_with_ties: Share::of(of(hides), |r| lived(r).first_with_ties),
        both: Share::of(of(|r| r.kind == Kind::Two), |r| lived(r).found == 2),
        quiet: Share::of(of(|r| r.kind == Kind::None), quiet),
        wrong_per_case: mean(own.iter().map(|r| lived(r).wrong.len()).sum()),
        wrong_instruments_per_case: mean(own.iter().map(|r| lived(r).wrong_instruments.len()).sum()),
        blamed: Share::of(of(|r| r.kind == Kind::Instrument), |r| !lived(r).wrong.is_empty()),
        unfounded: Share::of(of(|r| r.lived.as_ref().is_some_and(|l| l.claimed && l.fall.is_some())), |r| lived(r).unfounded()),
        held_out_over_truth: median(own.iter().filter_map(|r| lived(r).held_out_over_truth)),
        wall_s: median(own.iter().map(|r| r.wall_s)),
    }
}

fn quiet(r: &CaseResult) -> bool {
    r.lived.as_ref().is_some_and(|l| l.wrong.is_empty() && l.wrong_instruments.is_empty()) && r.verdict == "nothing_missing"
}

fn null_row(structure: &'static str, own: &[&CaseResult], only: Option<Imperfection>) -> Option<NullRow> {
    let inside = |r: &&&CaseResult| r.kind == Kind::None && r.lived.as_ref().is_some_and(|l| l.only == only);
    let cases = || own.iter().filter(inside).copied();
    let wrong = |r: &CaseResult| r.lived.as_ref().map_or(0, |l| l.wrong.len());
    let mut names: Vec<String> =
        cases().flat_map(|r| r.lived.iter().flat_map(|l| l.wrong.iter().chain(&l.wrong_instruments))).cloned().collect();
    // Without places: they differ from case to case.
    names.iter_mut().for_each(|n| n.truncate(n.find(" at ").unwrap_or(n.len())));
    names.sort();
    let mut named: Vec<(String, usize)> = Vec::new();
    for n in names {
        match named.last_mut() {
            Some((last, count)) if *last == n => *count += 1,
            _ => named.push((n, 1)),
        }
    }
    let row = NullRow {
        imperfection: only.map_or("all", Imperfection::word),
        structure,
        false_effect: Share::of(cases(), |r| wrong(r) > 0),
        false_instrument: Share::of(cases(), |r| r.lived.as_ref().is_some_and(|l| !l.wrong_instruments.is_empty())),
        unexplained: Share::of(cases(), |r| wrong(r) == 0 && r.verdict == "unexplained"),
        named,
    };
    (row.false_effect.of > 0).then_some(row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_is_that_of_the_tables() {
        // Wilson (1927), 15 of 148 as in Newcombe, Statistics in Medicine 17 (1998), table I: 0.0624 to 0.1605.
        let (low, high) = Share::new(15, 148).interval;
        assert!((low - 0.0624).abs() < 5e-5 && (high - 0.1605).abs() < 5e-5, "{low} {high}");
        let (low, high) = Share::new(0, 20).interval;
        assert!(low == 0.0 && (high - 0.1611).abs() < 5e-5, "{high}");
        assert_eq!(Share::new(0, 0).interval, (0.0, 1.0));
    }
}
