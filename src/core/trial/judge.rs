//! Whether a ladder said what was true.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::diagnose::DiagnoseError;
use crate::diagnose::results::{Candidate, LadderResult, NextTest, Verdict};
use crate::effect::{Role, find};

use super::Kind;
use super::bench::{Drive, Flaw};
use super::curve::{Realistic, realistic};
use super::generate::Generated;
use super::lived::{Lived, quirks};

/// Root mean square of whitened residuals up to which a model is at the floor.
const AT_FLOOR: f64 = 1.1;

/// One finished case.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema, Deserialize)]
pub struct CaseResult {
    /// Its index.
    pub index: usize,
    /// What was hidden.
    pub kind: Kind,
    /// Bodies; 0: one connector.
    pub bodies: usize,
    /// Tests, by kind: loops, records of a hit, and frequency responses.
    pub tests: (usize, usize, usize),
    /// `effect at place` of what was hidden.
    pub truth: Vec<String>,
    /// Least noncentrality of it.
    pub noncentrality: f64,
    /// Errors of instruments within tolerance, `effect at channel`.
    pub nuisances: Vec<String>,
    /// `effect at place` of what the ladder names, without the nuisances that are there.
    pub said: Vec<String>,
    /// What each is said to be tied with.
    pub tied: Vec<Vec<String>>,
    /// Verdict of the ladder, or `failed`.
    pub verdict: String,
    /// Why the ladder ended, or why it failed.
    pub ended: String,
    /// Right effect and place first (two hidden: both; none: none; outside: said to be unexplained, or matched at the floor).
    pub strict: bool,
    /// The same, declared ties counted.
    pub with_ties: bool,
    /// Something was hidden, and nothing is said to be missing.
    pub missed: bool,
    /// Nothing was hidden in the structure, and physics is said to be missing.
    pub false_alarm: bool,
    /// Effects named beyond the truth.
    pub extra: usize,
    /// Root mean square of the whitened residuals of the fit and select tests at the end, instruments within tolerance granted.
    pub whitened_rms: Option<f64>,
    /// Held-out error over floor at the end.
    pub held_out: Option<f64>,
    /// Whether each step refitted what was hidden and not yet found: the score test can lose it only where it did not.
    pub weighed: bool,
    /// Where the truth was tied and a test is proposed that the bench can run: what came of it.
    pub next_test: Option<Followed>,
    /// What the first step said of the truth and of the best: for the reader of a failure.
    pub evidence: Vec<String>,
    /// Wall time [s].
    pub wall_s: f64,
    /// What is judged of a realistic case beside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lived: Option<Lived>,
}

/// A proposed next test, run on the bench.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema, Deserialize)]
pub struct Followed {
    /// The proposal.
    pub test: NextTest,
    /// What was tied, the effect that was named last.
    pub among: Vec<String>,
    /// What is named after it.
    pub said: Vec<String>,
    /// What each of these is then tied with.
    pub tied: Vec<Vec<String>>,
    /// Whether the truth comes first, tied with nothing that the test was to tell it from.
    pub broken: bool,
}

impl CaseResult {
    /// Whether it is worth a look.
    pub fn failed(&self) -> bool {
        !self.with_ties || self.next_test.as_ref().is_some_and(|n| !n.broken)
    }
}

fn is_instrument(effect: &str) -> bool {
    find(effect).is_ok_and(|e| e.info().role == Role::Channel)
}

/// Whether a named channel effect is an instrument error that was put there: at its test or at all of them; offset and drift of one
/// record are one matter once its cycles are averaged.
fn is_there(flaw: &Flaw, effect: &str, at: &str) -> bool {
    let alike = |a: &str, b: &str| a == b || (["offset", "drift"].contains(&a) && ["offset", "drift"].contains(&b));
    let channel = at.rsplit_once('.');
    alike(flaw.effect, effect)
        && channel.is_some_and(|(test, role)| role == flaw.role && (test == "*" || flaw.test == "*" || test == flaw.test))
}

/// Judges what a ladder said about a generated case.
pub fn judge(kind: Kind, index: usize, made: &Generated, ladder: Result<&LadderResult, &DiagnoseError>, wall_s: f64) -> CaseResult {
    let flaw_name = |f: &Flaw| format!("{} at {}.{}", f.effect, f.test, f.role);
    let mut truth: Vec<String> = made.planted.iter().map(|p| format!("{} at {}", p.effect, made.place(p))).collect();
    truth.extend(made.instrument.as_ref().map(flaw_name));
    let count = |is: fn(&Drive) -> bool| made.tests.iter().filter(|t| is(&t.drive)).count();
    let (loops, hits) = (count(|d| matches!(d, Drive::Loop { .. })), count(|d| matches!(d, Drive::Hit { .. })));
    let mut r = CaseResult {
        index,
        kind,
        bodies: made.bench.bodies,
        tests: (loops, hits, made.tests.len() - loops - hits),
        truth,
        noncentrality: made.noncentrality,
        nuisances: made.nuisances.iter().map(flaw_name).collect(),
        said: vec![],
        tied: vec![],
        verdict: "failed".into(),
        ended: String::new(),
        strict: false,
        with_ties: false,
        missed: false,
        false_alarm: false,
        extra: 0,
        whitened_rms: None,
        held_out: None,
        weighed: false,
        next_test: None,
        evidence: vec![],
        wall_s,
        lived: None,
    };
    let ladder = match ladder {
        Ok(ladder) => ladder,
        Err(e) => {
            r.ended = e.to_string();
            return r;
        }
    };
    let verdict = ladder.verdict;
    r.verdict = serde_json::to_value(verdict).ok().and_then(|v| v.as_str().map(str::to_string)).unwrap_or_default();
    r.ended = ladder.ended.clone();
    // What is hidden counts as such, also where a nuisance of the same name lies on all tests or is named in a tie with it.
    let hidden = r.truth.clone();
    let all = said_by(ladder);
    let is_nuisance = |m: &Named| made.nuisances.iter().any(|f| is_there(f, m.effect, m.at));
    let is_hidden = |m: &Named| hidden.iter().any(|h| *h == format!("{} at {}", m.effect, m.at) || m.tied_with.contains(h));
    // Nor is a nonlinearity that the base has.
    let quirks = quirks(made);
    let is_quirk = |m: &Named| quirks.iter().any(|q| *q == format!("{} at {}", m.effect, m.at) || m.tied_with.contains(q));
    let named = all.iter().filter(|m| is_hidden(m) || !(is_nuisance(m) || is_quirk(m)));
    for m in named.clone() {
        r.said.push(format!("{} at {}", m.effect, m.at));
        r.tied.push(m.tied_with.to_vec());
    }
    let physics: Vec<bool> = named.map(|m| !is_instrument(m.effect)).collect();
    r.whitened_rms = ladder.whitened_rms;
    r.held_out = ladder.held_out.after.zip(ladder.held_out.floor).map(|(a, f)| a / f);
    let same = |k: usize, truth: &str| r.said.get(k).is_some_and(|s| s == truth);
    let tied = |k: usize, truth: &str| r.tied.get(k).is_some_and(|t| t.iter().any(|t| t == truth));
    let at_floor = r.whitened_rms.is_some_and(|rms| rms <= AT_FLOOR);
    let (strict, with_ties) = match kind {
        Kind::One | Kind::Instrument => {
            // A drift that the averaging of the cycles has taken out leaves nothing to name.
            let drift = made.instrument.as_ref().is_some_and(|f| f.effect == "drift");
            let harmless = drift && !physics.contains(&true) && at_floor;
            r.truth.first().map_or((false, false), |t| (same(0, t) || harmless, same(0, t) || tied(0, t) || harmless))
        }
        Kind::Two => {
            let found = |ties: bool| {
                let mut free: Vec<usize> = (0..r.said.len()).collect();
                r.truth.iter().all(|t| match free.iter().position(|k| same(*k, t) || (ties && tied(*k, t))) {
                    Some(at) => {
                        free.remove(at);
                        true
                    }
                    None => false,
                })
            };
            (found(false), found(true))
        }
        Kind::None => {
            let quiet = r.said.is_empty() && verdict != Verdict::Unexplained;
            (quiet, quiet)
        }
        Kind::Outside => {
            // The ladder says that something is left, or it has matched the data.
            let left = verdict == Verdict::Unexplained || ladder.unexplained_remainder;
            let ok = if r.said.is_empty() { left } else { left || at_floor };
            (ok, ok)
        }
    };
    (r.strict, r.with_ties) = (strict, with_ties);
    r.weighed = weighed(ladder, &r.truth);
    r.missed = kind != Kind::None && r.said.is_empty() && verdict == Verdict::NothingMissing && !with_ties;
    r.false_alarm = match kind {
        Kind::None => !with_ties,
        Kind::Instrument => !with_ties && physics.contains(&true),
        _ => false,
    };
    r.extra = r.said.len().saturating_sub(r.truth.len());
    if !strict || r.extra > 0 {
        r.evidence = evidence(ladder, &r.truth);
    }
    r
}

/// An effect or an instrument that a ladder names.
struct Named<'a> {
    effect: &'a str,
    at: &'a str,
    tied_with: &'a [String],
}

/// What a ladder names, physics first.
fn said_by(ladder: &LadderResult) -> Vec<Named<'_>> {
    let physics = ladder.missing.iter().map(|m| Named { effect: &m.effect, at: &m.at, tied_with: &m.tied_with });
    physics.chain(ladder.instruments.iter().map(|i| Named { effect: &i.effect, at: &i.at, tied_with: &i.tied_with })).collect()
}

/// Whether everything hidden was refitted on some rung.
fn weighed(ladder: &LadderResult, truth: &[String]) -> bool {
    let refitted = |t: &String| {
        ladder.rungs.iter().flat_map(|r| &r.candidates).any(|c| c.error_after.is_some() && format!("{} at {}", c.effect, c.at) == *t)
    };
    truth.iter().all(refitted)
}

/// What each step said of the truth and of the one it took.
fn evidence(ladder: &LadderResult, truth: &[String]) -> Vec<String> {
    let name = |c: &Candidate| format!("{} at {}", c.effect, c.at);
    let mut lines = Vec::new();
    for (k, rung) in ladder.rungs.iter().enumerate() {
        for (rank, c) in rung.candidates.iter().enumerate() {
            if rank == 0 || c.accepted || truth.contains(&name(c)) {
                lines.push(format!(
                    "rung {k}, rank {}: {}, predicted drop {:.4}, p {:.1e}: {}",
                    rank + 1,
                    name(c),
                    c.predicted_drop,
                    c.p_value,
                    c.remark
                ));
            }
        }
    }
    lines
}

/// Counts of some cases.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Counts {
    /// Cases.
    pub cases: usize,
    /// Right, strictly.
    pub strict: usize,
    /// Right, declared ties counted.
    pub with_ties: usize,
    /// Missed.
    pub missed: usize,
    /// False alarms.
    pub false_alarms: usize,
    /// Cases in which more is named than is hidden.
    pub with_extra: usize,
    /// Cases in which the ladder ended in an error.
    pub failed: usize,
    /// Cases in which everything hidden was refitted at some step.
    pub weighed: usize,
    /// Cases with a tie of the truth and a proposed test that could be run; those in which it broke the tie for the truth.
    pub next_tests: usize,
    /// The ties that it broke.
    pub ties_broken: usize,
}

/// How often one truth was said to be what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Confusion {
    /// Effects hidden.
    pub truth: String,
    /// Effects said, or the verdict.
    pub said: String,
    /// Cases.
    pub count: usize,
}

/// What a trial amounts to.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Table {
    /// All cases.
    #[serde(flatten)]
    pub all: Counts,
    /// By kind and structure, `one, connector`.
    pub by_kind: BTreeMap<String, Counts>,
    /// Truth against what was said.
    pub confusion: Vec<Confusion>,
    /// Median of held-out error over floor.
    pub held_out_over_floor: Option<f64>,
    /// Of realistic cases: recovery over strength, claims without ground, null rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub realistic: Option<Realistic>,
}

/// What the ladder after the next test says. The test separates the effect that was named, the last of `among`, from each of the others: the
/// tie is broken where the truth comes first and is no longer tied with what it was to be told from.
pub fn followed(next: &NextTest, among: Vec<String>, after: &LadderResult, truth: &str) -> Followed {
    let named = among.last().cloned().unwrap_or_default();
    let told_from = |t: &String| among.contains(t) && (named == truth || *t == named);
    let first = after.missing.iter().find(|m| !is_instrument(&m.effect));
    Followed {
        test: next.clone(),
        said: after.missing.iter().map(|m| format!("{} at {}", m.effect, m.at)).collect(),
        tied: after.missing.iter().map(|m| m.tied_with.clone()).collect(),
        broken: first.is_some_and(|m| format!("{} at {}", m.effect, m.at) == truth && !m.tied_with.iter().any(told_from)),
        among,
    }
}

/// Sums up.
pub fn table(results: &[CaseResult]) -> Table {
    let mut all = Counts::default();
    let mut by_kind: BTreeMap<String, Counts> = BTreeMap::new();
    let mut confusion: BTreeMap<(String, String), usize> = BTreeMap::new();
    let mut held: Vec<f64> = results.iter().filter_map(|r| r.held_out).filter(|h| h.is_finite()).collect();
    for r in results {
        let key = format!("{}, {}", r.kind.word(), if r.bodies == 0 { "connector" } else { "chain" });
        for c in [&mut all, by_kind.entry(key).or_default()] {
            c.cases += 1;
            c.strict += usize::from(r.strict);
            c.with_ties += usize::from(r.with_ties);
            c.missed += usize::from(r.missed);
            c.false_alarms += usize::from(r.false_alarm);
            c.with_extra += usize::from(r.extra > 0);
            c.failed += usize::from(r.verdict == "failed");
            c.weighed += usize::from(r.weighed);
            c.next_tests += usize::from(r.next_test.is_some());
            c.ties_broken += usize::from(r.next_test.as_ref().is_some_and(|n| n.broken));
        }
        *confusion.entry((told(&r.truth, &[]), said(r))).or_default() += 1;
    }
    held.sort_by(f64::total_cmp);
    Table {
        all,
        by_kind,
        confusion: confusion.into_iter().map(|((truth, said), count)| Confusion { truth, said, count }).collect(),
        held_out_over_floor: held.get(held.len() / 2).copied(),
        realistic: realistic(results),
    }
}

/// Effects without their places, those at another place than one of `truth` marked.
fn told(list: &[String], truth: &[String]) -> String {
    let effect = |s: &str| s.split(" at ").next().unwrap_or(s).to_string();
    let mut names: Vec<String> = list
        .iter()
        .map(|s| {
            let elsewhere = truth.iter().any(|t| effect(t) == effect(s)) && !truth.contains(s);
            effect(s) + if elsewhere { " (elsewhere)" } else { "" }
        })
        .collect();
    names.sort();
    if names.is_empty() { "nothing".into() } else { names.join(" + ") }
}

fn said(r: &CaseResult) -> String {
    match (r.said.is_empty(), r.verdict.as_str()) {
        (false, _) => told(&r.said, &r.truth),
        // Only nuisances were named.
        (true, "missing") => "nothing".into(),
        (true, "nothing_missing") => "nothing".into(),
        (true, verdict) => verdict.into(),
    }
}
