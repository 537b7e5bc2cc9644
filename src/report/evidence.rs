//! Rungs, candidates and findings: why the program says what it says.

use crate::diagnose::results::{Candidate, EffectAt, Finding, SecondOpinion, SplitName};

use super::ReportInput;
use super::chart::Charts;
use super::stage::{Stage, effect_at, of_split, over_floor, pooled};
use super::text::{digits, esc, list, percent, probability, ratio, table};

/// Candidates shown at once; the rest can be unfolded.
const SHOWN: usize = 12;

/// The table of rungs, with why the ladder ended.
pub fn rungs(input: &ReportInput, stages: &[Stage], _charts: &mut Charts) -> String {
    let Some(ladder) = input.ladder.filter(|l| !l.rungs.is_empty()) else { return String::new() };
    let all: Vec<String> = ladder.rungs[0].effects.iter().map(|e| effect_at(&e.effect, &e.at)).collect();
    let row = |(k, stage): (usize, &Stage)| {
        let rung = &ladder.rungs[k];
        let same = |c: &&Candidate, e: &EffectAt| c.effect == e.effect && c.at == e.at;
        // What was weighed for a rung stands with the rung below it.
        let below = k.checked_sub(1).map(|b| &ladder.rungs[b]);
        let weighed = rung.added.as_ref().and_then(|e| below?.candidates.iter().find(|c| same(c, e)));
        let removed: Vec<String> = rung.removed.iter().map(|e| effect_at(&e.effect, &e.at)).collect();
        let removed = if removed.is_empty() { String::new() } else { format!("<br>removed: {}", list(&removed)) };
        let split = |split: SplitName| match pooled(of_split(stage, split)) {
            Some((e, f)) => format!("{} <span class=\"soft\">({} ×)</span>", percent(e), ratio(over_floor(e, f))),
            None => "-".into(),
        };
        vec![
            k.to_string(),
            format!("{}{removed}", esc(&stage.name)),
            weighed.map_or("-".into(), |c| percent(c.predicted_drop)),
            weighed.map_or("-".into(), |c| probability(c.p_value)),
            split(SplitName::Fit),
            split(SplitName::Select),
            split(SplitName::HeldOut),
            rung.nats.map_or("-".into(), |nats| digits(nats, 3)),
            rung.parameters.len().to_string(),
            esc(&rung.termination),
        ]
    };
    let rows: Vec<Vec<String>> = stages.iter().enumerate().take(ladder.rungs.len()).map(row).collect();
    let header = [
        "Rung",
        "Model",
        "Predicted drop of cost",
        "p-value",
        "Error, fit",
        "Error, select",
        "Error, held out",
        "Nats",
        "Parameters",
        "Fit ended",
    ];
    let ended = if ladder.ended.is_empty() {
        String::new()
    } else {
        format!("<p>The ladder ended: {}.</p>", esc(ladder.ended.trim_end_matches('.')))
    };
    format!(
        "<p>The model as given: {}. In brackets the error over the noise floor; held-out tests are read only at the start and the end.</p>{}{ended}\
         <p class=\"soft\">Climbed in {} s.</p>",
        list(&all),
        table("", &header, &[2, 3, 4, 5, 6, 7, 8], &rows),
        digits(ladder.wall_s, 3)
    )
}

/// What was weighed, rung by rung, or in the diagnosis.
pub fn candidates(input: &ReportInput) -> String {
    let mut out = String::new();
    if let Some(ladder) = input.ladder {
        for (k, rung) in ladder.rungs.iter().enumerate().filter(|(_, r)| !r.candidates.is_empty()) {
            let added = rung.added.as_ref().map(|e| format!(": {} was added", effect_at(&e.effect, &e.at))).unwrap_or_default();
            out += &candidate_table(&format!("For rung {k}{added}"), &rung.candidates);
            out += &second(&rung.second_opinion);
        }
    }
    if let Some(d) = input.diagnosis.filter(|d| !d.candidates.is_empty()) {
        out += &candidate_table(if input.ladder.is_some() { "In the diagnosis of the study as it stands" } else { "" }, &d.candidates);
        out += &second(&d.second_opinion);
    }
    let none = input.ladder.and_then(|l| l.no_next_test.as_ref()).or(input.diagnosis.and_then(|d| d.no_next_test.as_ref()));
    if let Some(why) = none {
        out += &format!("<p>No next test is proposed: {}.</p>", esc(why));
    }
    if let Some(d) = input.diagnosis.filter(|d| !d.would_have_been_seen.is_empty()) {
        let items: String = d.would_have_been_seen.iter().map(|s| format!("<li>{}</li>", esc(s))).collect();
        out += &format!("<h3>Strengths that would have been seen</h3><ul>{items}</ul>");
    }
    if out.is_empty() {
        return out;
    }
    let reading = String::from(
        "<p class=\"soft\">Predicted drop: the part of the cost that the score test expects to fall. p-value: how often the best of all \
         candidates shows as much where nothing is missing. Part of all at once: its part in a sparse nonnegative combination of all. Only the best few are refitted; the one that gains most nats beyond the price of its parameters and of the search is taken.</p>",
    );
    format!("{reading}{out}")
}

/// A word where a sparse combination of all candidates says otherwise.
fn second(opinion: &SecondOpinion) -> String {
    opinion.remark.as_ref().map_or(String::new(), |r| format!("<p>Second opinion: {}.</p>", esc(r)))
}

fn candidate_table(caption: &str, all: &[Candidate]) -> String {
    let header = [
        "Effect and place",
        "Predicted drop",
        "Error before",
        "Error after refit",
        "p-value",
        "Part of all at once",
        "Accepted",
        "Cannot be told from",
        "Remark",
    ];
    let row = |c: &Candidate| {
        let tied: Vec<String> = c.tied_with.iter().map(|t| esc(t)).collect();
        let of = c.of.as_ref().map(|p| format!(" (of {})", esc(p))).unwrap_or_default();
        vec![
            format!("{}{of}", effect_at(&c.effect, &c.at)),
            percent(c.predicted_drop),
            percent(c.error_before),
            c.error_after.map_or("not refitted".into(), percent),
            probability(c.p_value),
            c.selected.map_or("-".into(), percent),
            if c.accepted { "<span class=\"yes\">yes</span>" } else { "no" }.into(),
            list(&tied),
            esc(&c.remark),
        ]
    };
    let rows: Vec<Vec<String>> = all.iter().map(row).collect();
    let (shown, rest) = rows.split_at(rows.len().min(SHOWN));
    let right = [1, 2, 3, 4, 5];
    let more = if rest.is_empty() {
        String::new()
    } else {
        format!("<details><summary>{} more</summary>{}</details>", rest.len(), table("", &header, &right, rest))
    };
    format!("{}{more}", table(caption, &header, &right, shown))
}

/// The findings, of the diagnosis and of the last rung.
pub fn findings(input: &ReportInput) -> String {
    let header = ["Test", "Claim", "Number", "Claimed beyond", "Power"];
    let show = |caption: &str, findings: &[Finding]| {
        if findings.is_empty() {
            return String::new();
        }
        let row = |f: &Finding| vec![esc(&f.test), esc(&f.claim), digits(f.number, 3), digits(f.threshold, 3), percent(f.power)];
        table(caption, &header, &[2, 3, 4], &findings.iter().map(row).collect::<Vec<_>>())
    };
    let last = input.ladder.map_or(String::new(), |l| show("After the last rung", &l.findings));
    let given =
        input.diagnosis.map_or(String::new(), |d| show(if last.is_empty() { "" } else { "In the model as it stands" }, &d.findings));
    if last.is_empty() && given.is_empty() {
        return String::new();
    }
    let reading =
        "<p class=\"soft\">Power: the probability of seeing an effect of 10 % of the signal. Where it is small, silence means little.</p>";
    format!("{reading}{given}{last}")
}
