//! The first screen: one sentence, four cards, what to do next, the error of every test against the rungs.

use crate::diagnose::results::{EffectAt, Missing, Reading, SplitName, TestResult, Verdict};
use crate::effect;

use super::chart::{self, Attributes, Chart, Charts};
use super::stage::{FITS, Stage, of_split, over_floor, pooled, split_words};
use super::text::{digits, esc, label, list, percent, probability, ratio, words};
use super::{ReportInput, page};

/// The whole first screen.
pub fn section(input: &ReportInput, stages: &[Stage], charts: &mut Charts) -> String {
    let cards: String = [fits(stages), fails(stages), missing(input), fell(input, stages)].concat();
    format!(
        "<header><b>{}</b> &middot; {} &middot; misfit report</header>\n<h1>{}</h1>\n<dl class=\"cards\">\n{cards}</dl>\n\
         <p class=\"next\"><b>Next:</b> {}</p>\n{}<noscript><p>The charts need JavaScript; the tables do not.</p></noscript>\n{}{}\n",
        esc(&input.study.title),
        about(input),
        verdict(input, stages),
        next(input, stages),
        page::SCRIPT,
        overall_chart(stages, charts),
        page::CONTENTS,
    )
}

/// Dataset, tests and model in a line.
fn about(input: &ReportInput) -> String {
    let data = &input.study.dataset;
    let tests = format!("{} test{}", data.tests.len(), if data.tests.len() == 1 { "" } else { "s" });
    let held = input.study.split.held_out.len();
    let held = if held > 0 { format!(", {held} held out") } else { String::new() };
    let title = data.title.as_deref().map(|t| format!("{}, ", esc(t))).unwrap_or_default();
    format!("{title}{tests}{held}")
}

/// An effect that is missing.
struct Named<'a> {
    effect: &'a str,
    at: &'a str,
    /// Of a law over a condition, what it acts on: `elastic_slip.f over A`.
    of: Option<&'a str>,
    tied: Vec<String>,
}

impl Named<'_> {
    /// `linear law of elastic_slip.f over A at c1.x`, escaped.
    fn words(&self) -> String {
        let of = self.of.map(|of| format!(" of {}", esc(of))).unwrap_or_default();
        format!("{}{of} at {}", esc(&words(self.effect)), esc(self.at))
    }

    /// What it cannot be told from, escaped.
    fn tied(&self) -> Option<String> {
        let tied: Vec<String> = self.tied.iter().map(|t| esc(&words(t))).collect();
        (!tied.is_empty()).then(|| list(&tied))
    }
}

/// What is missing; none where nothing was looked for.
fn named<'a>(input: &ReportInput<'a>) -> Option<Vec<Named<'a>>> {
    match (input.ladder, input.diagnosis) {
        (Some(l), _) => {
            let of = |m: &'a Missing| Named { effect: &m.effect, at: &m.at, of: m.of.as_deref(), tied: m.tied_with.clone() };
            Some(l.missing.iter().map(of).collect())
        }
        (None, Some(d)) => {
            let of = |m: &'a EffectAt| Named { effect: &m.effect, at: &m.at, of: m.of.as_deref(), tied: tied(input, &m.effect, &m.at) };
            Some(d.missing.iter().map(of).collect())
        }
        (None, None) => None,
    }
}

/// Names of the missing effects, each with what it cannot be told from.
fn missing_names(input: &ReportInput) -> Vec<String> {
    let one = |n: &Named| n.words() + &n.tied().map(|t| format!(" (these data cannot tell it from {t})")).unwrap_or_default();
    named(input).unwrap_or_default().iter().map(one).collect()
}

/// What a diagnosed effect is tied with.
fn tied(input: &ReportInput, effect: &str, at: &str) -> Vec<String> {
    let candidates = input.diagnosis.map_or(&[][..], |d| &d.candidates);
    candidates.iter().find(|c| c.effect == effect && c.at == at).map(|c| c.tied_with.clone()).unwrap_or_default()
}

/// How far an error fell, on which tests.
struct Fall {
    before: f64,
    after: f64,
    floor: Option<f64>,
    on: &'static str,
}

fn fall(input: &ReportInput, stages: &[Stage]) -> Option<Fall> {
    if let Some(h) = input.ladder.map(|l| l.held_out) {
        if let (Some(before), Some(after)) = (h.before, h.after) {
            return Some(Fall { before, after, floor: h.floor, on: "held-out" });
        }
        let (first, last) = (stages.first()?, stages.last()?);
        return [SplitName::Select, SplitName::Fit].into_iter().find_map(|split| {
            let (before, _) = pooled(of_split(first, split))?;
            let (after, floor) = pooled(of_split(last, split))?;
            Some(Fall { before, after, floor: Some(floor), on: split_words(split) })
        });
    }
    let d = input.diagnosis?;
    let named = d.missing.first()?;
    let c = d.candidates.iter().find(|c| c.effect == named.effect && c.at == named.at)?;
    let on = if input.study.split.select.is_empty() { "fit" } else { "select" };
    Some(Fall { before: c.error_before, after: c.error_after?, floor: None, on })
}

/// Whether the ladder was stopped with something found.
fn interrupted(input: &ReportInput) -> bool {
    input.ladder.is_some_and(|l| l.interrupted)
}

/// Pooled error and floor of all tests of a stage, with their number.
fn overall(stage: &Stage) -> Option<(f64, f64, usize)> {
    pooled(stage.tests).map(|(e, f)| (e, f, stage.tests.len()))
}

fn stage_fits(stage: &Stage) -> Option<bool> {
    overall(stage).map(|(e, f, _)| f > 0.0 && e <= FITS * f)
}

/// The verdict in one sentence.
fn verdict(input: &ReportInput, stages: &[Stage]) -> String {
    let names = missing_names(input);
    let said = input.ladder.map(|l| l.verdict).or(input.diagnosis.map(|d| d.verdict));
    let last = stages.last().and_then(overall);
    let multiple = last.map(|(e, f, _)| ratio(over_floor(e, f))).unwrap_or_else(|| "-".into());
    let fits = stages.last().and_then(stage_fits).unwrap_or(false);
    match said {
        Some(verdict) if !names.is_empty() => {
            let fell = match fall(input, stages) {
                Some(f) => {
                    let multiple = f.floor.filter(|v| *v > 0.0).map(|v| format!(", {} × the noise floor", ratio(f.after / v)));
                    let on = if f.on == "held-out" { "held-out error".into() } else { format!("the error on the {} tests", f.on) };
                    let verb = match input.ladder {
                        Some(_) if f.after > f.before => "rose",
                        Some(_) => "fell",
                        None => "falls",
                    };
                    format!(": {} {verb} from {} to {}{}", on, percent(f.before), percent(f.after), multiple.unwrap_or_default())
                }
                None => String::new(),
            };
            let rest = match verdict {
                Verdict::Unexplained if input.ladder.is_some_and(|l| !l.proven) => "; the held-out tests do not bear it out",
                Verdict::Unexplained => "; what remains, no candidate explains",
                _ if interrupted(input) => "; the search was interrupted, and more may be missing",
                _ => "",
            };
            let misses = if verdict == Verdict::Unexplained {
                "Unexplained. In the fitted tests the model seems to miss"
            } else {
                "The model misses"
            };
            format!("{misses} {}{fell}{rest}.", list(&names))
        }
        Some(Verdict::Unexplained) => {
            format!("Something is missing that no candidate explains: the error is {multiple} × the noise floor.")
        }
        Some(Verdict::Interrupted) => {
            format!("The search was interrupted before it had found anything: the error is {multiple} × the noise floor.")
        }
        Some(_) if fits => "The model fits to the noise; nothing is missing.".into(),
        Some(_) => format!("No missing effect was found, although the error is {multiple} × the noise floor."),
        None if fits => "The model fits to the noise.".into(),
        None if last.is_some() => format!("The model does not fit: its error is {multiple} × the noise floor."),
        None => "The model has not been held against its measurements yet.".into(),
    }
}

fn card(class: &str, title: &str, big: &str, small: &[String]) -> String {
    let small: String = small.iter().filter(|s| !s.is_empty()).map(|s| format!("<dd class=\"small\">{s}</dd>")).collect();
    format!("<div class=\"card {class}\"><dt>{title}</dt><dd class=\"big\">{big}</dd>{small}</div>\n")
}

fn tests_words(n: usize) -> String {
    if n == 1 { "1 test".into() } else { format!("{n} tests") }
}

fn fits(stages: &[Stage]) -> String {
    let (Some(first), Some(last)) = (stages.first(), stages.last()) else {
        return card("", "Does the model fit?", "Not known", &["No fit has been run.".into()]);
    };
    let (Some((e0, f0, n)), Some((e1, f1, _))) = (overall(first), overall(last)) else {
        return card("", "Does the model fit?", "Not known", &["No test was compared.".into()]);
    };
    let (was, is) = (stage_fits(first) == Some(true), stage_fits(last) == Some(true));
    let big = match (was, is, stages.len() > 1) {
        (true, true, _) => "Yes",
        (false, true, true) => "Not as given; now it does",
        (false, true, false) => "Yes",
        (false, false, true) => {
            if e1 < 0.9 * e0 {
                "No, but better than as given"
            } else {
                "No"
            }
        }
        (_, false, _) => "No",
    };
    let before = format!("Error {}, {} × the noise floor", percent(e0), ratio(over_floor(e0, f0)));
    let after =
        if stages.len() > 1 { format!("With the effects added: {}, {} ×", percent(e1), ratio(over_floor(e1, f1))) } else { String::new() };
    let ended = if last.termination == "converged" { String::new() } else { format!("The last fit ended: {}", esc(last.termination)) };
    card(if is { "good" } else { "bad" }, "Does the model fit?", big, &[before, after, format!("over {}", tests_words(n)), ended])
}

/// The test with the largest error over floor.
fn worst<'a>(stage: &Stage<'a>) -> Option<&'a TestResult> {
    let over = |t: &TestResult| Some(over_floor(t.error, t.floor)).filter(|r| !r.is_nan()).unwrap_or(t.error);
    stage.tests.iter().max_by(|a, b| over(a).total_cmp(&over(b)))
}

/// Largest difference over the range of the measured, channel by channel.
pub fn difference_words(t: &TestResult) -> String {
    t.largest_difference.iter().map(|d| percent(d.fraction)).collect::<Vec<_>>().join(", ")
}

fn fails(stages: &[Stage]) -> String {
    let Some((first, t)) = stages.first().and_then(|s| Some((s, worst(s)?))) else {
        return card("", "Where does it fail?", "Not known", &[]);
    };
    let multiple = format!("{}, {} × its noise floor", percent(t.error), ratio(over_floor(t.error, t.floor)));
    let after = match stages.last().filter(|_| stages.len() > 1).and_then(worst) {
        Some(w) => format!("Worst now: {}, {} ×", esc(&w.id), ratio(over_floor(w.error, w.floor))),
        None => String::new(),
    };
    if stage_fits(first) == Some(true) && t.error <= 1.5 * t.floor {
        return card("good", "Where does it fail?", "Nowhere", &[format!("Worst: {}, {multiple}", esc(&t.id))]);
    }
    let class = if stages.last().and_then(stage_fits) == Some(true) { "good" } else { "bad" };
    card(class, "Where does it fail?", &format!("Most on {}", esc(&t.id)), &[multiple, esc(&t.worst.words()), after])
}

fn missing(input: &ReportInput) -> String {
    const TITLE: &str = "What is missing?";
    let Some(named) = named(input) else {
        return card("", TITLE, "Not searched yet", &["A diagnosis weighs every effect of the library.".into()]);
    };
    let verdict = input.ladder.map(|l| l.verdict).or(input.diagnosis.map(|d| d.verdict));
    if named.is_empty() {
        if verdict == Some(Verdict::Unexplained) {
            let said = "Something is, but no effect of the library explains it.".to_string();
            return card("bad", TITLE, "Unexplained", &[vec![said], not_physics(input)].concat());
        }
        if verdict == Some(Verdict::Interrupted) {
            return card("bad", TITLE, "Not known", &["The search was interrupted before it had found anything.".into()]);
        }
        let seen: Vec<String> = input.diagnosis.map_or(&[][..], |d| &d.would_have_been_seen).iter().take(3).map(|s| esc(s)).collect();
        let seen = if seen.is_empty() { String::new() } else { format!("These would have been seen: {}", list(&seen)) };
        return card("good", TITLE, "Nothing found", &[vec![seen], not_physics(input)].concat());
    }
    let big: Vec<String> = named.iter().map(Named::words).collect();
    let mut small = Vec::new();
    for n in &named {
        if let (1, Ok(law)) = (named.len(), effect::find(n.effect)) {
            small.push(format!("Its mark: {}", esc(law.info().claim)));
        }
        small.extend(n.tied().map(|tied| format!("{} cannot be told from {tied}", n.words())));
    }
    let unexplained = match verdict {
        Some(Verdict::Unexplained) if input.ladder.is_some_and(|l| l.undecided()) => "",
        Some(Verdict::Unexplained) => "And a part that no candidate explains.",
        _ if interrupted(input) => "The search was interrupted; more may be missing.",
        _ => "",
    };
    small.push(unexplained.into());
    small.push(evidence(input, named[0].effect, named[0].at));
    small.extend(not_physics(input));
    card("bad", TITLE, &list(&big), &small)
}

/// What a ladder found that is not missing physics: instruments at fault or read beyond tolerance, corrections of what the study ties or fixes.
fn not_physics(input: &ReportInput) -> Vec<String> {
    let Some(l) = input.ladder else { return vec![] };
    let instruments = l.instruments.iter().map(|i| format!("Instrument: {}", esc(&i.why)));
    let readings = l.rungs.last().into_iter().flat_map(|r| Reading::describe(&r.readings)).map(|r| esc(&r));
    instruments.chain(l.corrections.iter().map(|c| format!("Correction: {}", esc(&c.describe())))).chain(readings).collect()
}

/// The p-value of a missing effect.
fn evidence(input: &ReportInput, effect: &str, at: &str) -> String {
    let rungs = input.ladder.map_or(&[][..], |l| &l.rungs);
    let diagnosed = input.diagnosis.map_or(&[][..], |d| &d.candidates);
    let found = rungs.iter().flat_map(|r| &r.candidates).chain(diagnosed).find(|c| c.effect == effect && c.at == at && c.accepted);
    found.map(|c| format!("Chance would show as much with probability {}", probability(c.p_value))).unwrap_or_default()
}

fn fell(input: &ReportInput, stages: &[Stage]) -> String {
    const TITLE: &str = "How far did the error fall?";
    match fall(input, stages) {
        Some(f) => {
            let floor = f.floor.map(|v| format!("; noise floor {}", percent(v))).unwrap_or_default();
            let once = if f.on == "held-out" { ", read once at the end" } else { "" };
            let class = if f.after < f.before { "good" } else { "bad" };
            let small = format!("{} tests{once}{floor}", f.on);
            card(class, TITLE, &format!("{} → {}", percent(f.before), percent(f.after)), &[small])
        }
        None if input.ladder.is_some() => card("", TITLE, "No test to tell by", &[]),
        None => card("", TITLE, "Not yet", &["No effect has been added.".into()]),
    }
}

/// What to do next, in one sentence.
fn next(input: &ReportInput, stages: &[Stage]) -> String {
    let folder = esc(&input.study.folder.display().to_string());
    let as_it_is = || match stages.last().and_then(stage_fits) {
        Some(false) => "look below at the residuals of the worst test before using the model: it stands above the noise.".into(),
        _ => format!("use the model as it is: <code>misfit export {folder} --to json</code>"),
    };
    if let Some(t) = input.ladder.and_then(|l| l.next_test.as_ref()).or(input.diagnosis.and_then(|d| d.next_test.as_ref())) {
        return format!(
            "measure the test that separates what is tied: {} (separation {} times the noise).",
            esc(t.describe.trim_end_matches('.')),
            digits(t.separation, 2)
        );
    }
    if let Some(l) = input.ladder {
        let stays = l.result_study.as_ref().map(|s| esc(s));
        return match (l.verdict, stays) {
            _ if l.interrupted => format!("let the search go to its end: <code>misfit ladder {folder}</code>"),
            (Verdict::Unexplained, _) if l.undecided() => {
                "measure one more test like those that are held out, with the effect at its strongest, and hold it out as well: what is named takes the misfit \
                 away, and the held-out tests do not bear it out."
                    .into()
            }
            (Verdict::Unexplained, _) => {
                "look below at the residuals of the worst test; what they show needs a law that is not in the library.".into()
            }
            (_, Some(s)) if !l.missing.is_empty() => {
                format!(
                    "the study with the effects added stands in <code>{s}</code>; export it with <code>misfit export {s} --to json</code>"
                )
            }
            _ => as_it_is(),
        };
    }
    if let Some(d) = input.diagnosis {
        return match (d.verdict, d.missing.first()) {
            (_, Some(m)) => format!("add it and refit: <code>misfit add {folder} {} --at {}</code>", esc(&m.effect), esc(&m.at)),
            (Verdict::Interrupted, None) => format!("let the search go to its end: <code>misfit diagnose {folder}</code>"),
            (Verdict::Unexplained, None) => {
                "look below at the residuals of the worst test; what they show needs a law that is not in the library.".into()
            }
            _ => as_it_is(),
        };
    }
    match stages.last().and_then(stage_fits) {
        Some(true) => format!("ask whether anything is hidden below the noise: <code>misfit diagnose {folder}</code>"),
        Some(false) => format!("find out what is missing: <code>misfit ladder {folder}</code>"),
        None => format!("fit the study: <code>misfit fit {folder}</code>"),
    }
}

/// Error of every test against the rungs, coloured by split; with one stage a dot per test.
fn overall_chart(stages: &[Stage], charts: &mut Charts) -> String {
    let Some(last) = stages.last().filter(|s| !s.tests.is_empty()) else { return String::new() };
    let mut plot = Chart::new(&chart::linear(""), &chart::ratios("error [%]"));
    let colour = |split: SplitName| match split {
        SplitName::Fit => chart::GREY,
        SplitName::Select => chart::OTHERS[2],
        SplitName::HeldOut => chart::FIRST,
    };
    let positive = |v: f64| if v > 0.0 { 100.0 * v } else { f64::NAN };
    if stages.len() == 1 {
        let ids: Vec<String> = last.tests.iter().map(|t| label(&t.id)).collect();
        for split in SplitName::ALL {
            let of: Vec<&TestResult> = of_split(last, split);
            if of.is_empty() {
                continue;
            }
            let (x, y): (Vec<String>, Vec<f64>) = of.iter().map(|t| (label(&t.id), positive(t.error))).unzip();
            let marker = chart::marker(if split == SplitName::Fit { chart::LAST } else { colour(split) }, 11, "circle");
            plot.add(chart::scatter(x, y, split_words(split), "markers").set("marker", marker));
        }
        let floors: Vec<f64> = last.tests.iter().map(|t| positive(t.floor)).collect();
        let marker = chart::marker(chart::INK, 16, "line-ew").set("line", chart::stroke(chart::INK, 2.0));
        plot.add(chart::scatter(ids, floors, "noise floor", "markers").set("marker", marker));
        return charts.figure(plot, 230, "Error of every test <span>and the floor its noise sets</span>", "");
    }
    let mut named: Vec<SplitName> = vec![];
    for id in super::stage::ids(stages) {
        let found: Vec<(usize, &TestResult)> =
            stages.iter().enumerate().filter_map(|(k, s)| Some((k, super::stage::test(s, id)?))).collect();
        let Some(split) = found.first().map(|f| f.1.split) else { continue };
        let (x, y): (Vec<f64>, Vec<f64>) = found.iter().map(|(k, t)| (*k as f64, positive(t.error))).unzip();
        let first = !named.contains(&split);
        named.push(split);
        let trace = chart::scatter(x, y, split_words(split), "lines+markers")
            .set("line", chart::stroke(colour(split), if split == SplitName::HeldOut { 2.4 } else { 1.4 }))
            .set("marker", chart::marker(colour(split), 7, "circle"))
            .set("text", label(id))
            .set("legendgroup", split_words(split))
            .set("showlegend", first);
        plot.add(trace);
    }
    if let Some((_, floor, _)) = overall(last) {
        plot.add(chart::dashed(vec![0.0, (stages.len() - 1) as f64], vec![positive(floor); 2], "noise floor, pooled"));
    }
    let plot = plot.with("xaxis", rung_axis(stages));
    charts.figure(plot, 240, "Error of every test against the rungs of the ladder", "")
}

/// An axis with the stages as ticks.
pub fn rung_axis(stages: &[Stage]) -> Attributes {
    let at: Vec<f64> = (0..stages.len()).map(|k| k as f64).collect();
    let end = stages.len().saturating_sub(1) as f64;
    chart::axis(&chart::linear(""))
        .set("tickvals", at)
        .set("ticktext", stages.iter().map(|s| label(&s.name)).collect::<Vec<_>>())
        .set("range", [-0.15 * end.max(1.0), end + 0.15 * end.max(1.0)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_that_is_missing_says_what_it_acts_on() {
        let law = Named { effect: "linear_law", at: "c<1.x", of: Some("elastic_slip.f over A"), tied: vec![] };
        assert_eq!((law.words().as_str(), law.tied()), ("linear law of elastic_slip.f over A at c&lt;1.x", None));
        let tied = Named { effect: "elastic_slip", at: "c1.x", of: None, tied: vec!["bouc_wen at c1.x".into()] };
        assert_eq!((tied.words().as_str(), tied.tied().as_deref()), ("elastic slip at c1.x", Some("bouc wen at c1.x")));
    }
}
