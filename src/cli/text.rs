//! Results as an engineer reads them on the terminal.

use crate::diagnose::results::{
    FitResult, ModeEnergy, OwnError, ParameterResult, Reading, ScatterOf, SplitName, TestResult, Verdict, compared, words,
};

use super::table::{percent, significant, table};

pub(super) fn split(split: SplitName) -> &'static str {
    match split {
        SplitName::Fit => "fit",
        SplitName::Select => "select",
        SplitName::HeldOut => "held out",
    }
}

/// Whether the terminal shows the errors of held-out tests. A held-out test is one only as long as nobody decides by it: an engineer who sees its error after every
/// change of the model fits the model to it.
#[derive(clap::Args, Clone, Copy, Default)]
pub(super) struct Sealed {
    /// Show the errors of the held-out tests as well
    #[arg(long)]
    held_out: bool,
}

impl Sealed {
    /// What is predicted rests on all tests.
    pub const OPEN: Sealed = Sealed { held_out: true };

    fn shown<'a>(&self, tests: &'a [TestResult]) -> Vec<&'a TestResult> {
        tests.iter().filter(|t| self.held_out || t.split != SplitName::HeldOut).collect()
    }

    /// That held-out tests were not shown, and how they are.
    fn words(&self, tests: &[TestResult]) -> String {
        let sealed: Vec<&str> = tests.iter().filter(|t| !self.held_out && t.split == SplitName::HeldOut).map(|t| t.id.as_str()).collect();
        if sealed.is_empty() {
            return String::new();
        }
        format!("held out, not shown: {} (--held-out shows them; they are for the last word on a model)\n", sealed.join(", "))
    }
}

/// A table of tests, the held-out ones as they are asked for.
pub(super) fn tests(tests: &[TestResult], sealed: Sealed) -> String {
    let words = sealed.words(tests);
    let tests = sealed.shown(tests);
    let row = |t: &TestResult| {
        vec![
            t.id.clone(),
            t.kind.clone(),
            split(t.split).into(),
            percent(t.error),
            percent(t.floor),
            significant(t.error / t.floor, 3),
            t.largest_difference.iter().map(|d| percent(d.fraction)).collect::<Vec<_>>().join(", "),
            significant(t.whitened_rms, 3),
            t.worst.words(),
        ]
    };
    let mut text = table(
        &["test", "kind", "split", "error", "floor", "error/floor", "largest/range", "rms/sigma", "farthest point"],
        &tests.iter().map(|t| row(t)).collect::<Vec<_>>(),
    );
    text += &words;
    text += "largest/range: largest difference over the range of the measured, channel by channel (FRF: of the magnitude; tables: of the value)\n";
    for (t, f) in tests.iter().flat_map(|t| t.factors.iter().map(move |f| (t, f))) {
        text += &format!("{}, {}: off by a factor of {} at most", t.id, f.channel, significant(f.largest, 4));
        if let Some(s) = &f.strength {
            text += &format!("; {} at best over all values of {}, which carries the whole loss", significant(s.best, 4), s.parameter);
            text += &format!(" ({} where it is weak and the loss proportional to it)", significant(s.weak, 4));
        }
        text += "\n";
    }
    for (t, c) in tests.iter().filter_map(|t| Some((t, t.constant_damping.as_ref()?))) {
        text += &format!("{}, {}\n", t.id, c.words());
    }
    tests.iter().filter(|t| !t.modes.is_empty()).for_each(|t| text += &mode_energies(t));
    text
}

/// Where the energy of the modes of a test is.
fn mode_energies(t: &TestResult) -> String {
    let row = |m: &ModeEnergy| {
        let off = percent(m.computed / m.measured - 1.0);
        vec![m.mode.to_string(), significant(m.measured, 4), significant(m.computed, 4), off, words(&m.strain), words(&m.kinetic)]
    };
    let header = ["mode", "measured Hz", "computed Hz", "off", "strain energy", "kinetic energy"];
    let mut text =
        format!("\n{}, where the energy of its modes is\n{}", t.id, table(&header, &t.modes.iter().map(row).collect::<Vec<_>>()));
    t.modes.iter().filter_map(|m| m.finding.as_ref()).for_each(|f| text += &format!("finding: {f}\n"));
    text
}

pub(super) fn parameters(parameters: &[ParameterResult]) -> String {
    let row = |p: &ParameterResult| vec![p.name.clone(), p.printed.clone(), p.known().into(), p.note.clone().unwrap_or_default()];
    table(&["parameter", "value (95 %)", "identified", "remark"], &parameters.iter().map(row).collect::<Vec<_>>())
}

/// Root mean square of error and floor over the tests of a split; none where it has no test.
pub(super) fn pooled(tests: &[TestResult], split: SplitName) -> Option<(f64, f64)> {
    let picked: Vec<&TestResult> = tests.iter().filter(|t| t.split == split).collect();
    let rms = |value: fn(&TestResult) -> f64| (picked.iter().map(|t| value(t).powi(2)).sum::<f64>() / picked.len() as f64).sqrt();
    (!picked.is_empty()).then(|| (rms(|t| t.error), rms(|t| t.floor)))
}

/// Error over floor beyond which a model is said to miss its data.
const MISSES: f64 = 1.2;

/// One sentence per split, and what to do next. `free`: parameters that were fitted.
pub(super) fn verdict(tests: &[TestResult], study: &str, free: usize, sealed: Sealed) -> String {
    let mut text = String::new();
    let mut misses = false;
    let fitted = compared(tests);
    for which in SplitName::ALL.into_iter().filter(|which| sealed.held_out || *which != SplitName::HeldOut) {
        let Some((error, floor)) = pooled(tests, which) else { continue };
        let ratio = error / floor;
        misses |= ratio > MISSES;
        let words = match ratio <= MISSES {
            true if which == SplitName::Fit && fitted <= free => "the model meets no more values than it has free parameters, as any would",
            true => "the model agrees to within the noise",
            false => "the model misses what was measured",
        };
        let (split, error, floor) = (split(which), percent(error), percent(floor));
        text += &format!("On the {split} tests {words}: error {error}, noise floor {floor}, ratio {}.\n", significant(ratio, 3));
    }
    text += &if misses {
        format!("Next: `misfit diagnose {study}` says what is missing, `misfit ladder {study}` climbs until nothing is.\n")
    } else {
        format!("Next: `misfit predict {study}`, `misfit export {study} --to json`.\n")
    };
    text
}

/// Notes `test: what`, those of several tests together.
/// What the likelihood makes of the residuals, in one line.
pub(super) fn errors(model: &[OwnError], scatter: &[ScatterOf], noise: f64) -> String {
    if model.is_empty() {
        return String::new();
    }
    let each: Vec<String> = model.iter().map(|m| format!("{} of {} ({})", percent(m.relative), m.channel, m.kind)).collect();
    let kinds: Vec<&ScatterOf> = scatter.iter().take_while(|s| s.parameter == scatter[0].parameter).collect();
    let scatter = match kinds.as_slice() {
        [] => String::new(),
        [one] => format!("; strengths scatter between tests by {} ({})", percent(one.relative), one.kind),
        kinds => {
            let each: Vec<String> = kinds.iter().map(|s| format!("{} ({})", percent(s.relative), s.kind)).collect();
            format!("; strengths scatter between tests by {}", each.join(", "))
        }
    };
    // A model errs more in some harmonics than in others, which the estimate takes from the noise: a factor below 1 says nothing.
    let noise = if noise > 1.0 { format!("; the noise is {} times what was seen or stated", significant(noise, 2)) } else { String::new() };
    format!("Model error: {}{scatter}{noise}.\n", each.join(", "))
}

/// What the held-out tests say of what was added; where most of the misfit is left, proven is but the part.
pub(super) fn proven(proven: bool, verdict: Verdict) -> &'static str {
    match (proven, verdict) {
        (true, Verdict::Unexplained) => "Proven, as a part of it",
        (true, _) => "Proven",
        (false, _) => "Not proven",
    }
}

pub(super) fn notes(all: &[String]) -> String {
    let mut grouped: Vec<(&str, Vec<&str>)> = Vec::new();
    for (test, what) in all.iter().map(|n| n.split_once(": ").unwrap_or(("", n))) {
        match grouped.iter_mut().find(|g| g.0 == what) {
            Some(group) => group.1.push(test),
            None => grouped.push((what, vec![test])),
        }
    }
    grouped.iter().map(|(what, tests)| format!("note: {}: {what}\n", tests.join(", "))).collect()
}

/// A whole fit.
pub(super) fn fit(fit: &FitResult, study: &str, sealed: Sealed) -> String {
    let mut text = format!(
        "{}: {} after {} iterations, {} s; cost {} over {} residuals, {} free parameters\n\n",
        fit.study,
        fit.termination,
        fit.iterations,
        significant(fit.wall_s, 3),
        significant(fit.cost, 5),
        fit.n_residuals,
        fit.n_free
    );
    text += &tests(&fit.tests, sealed);
    text += "\n";
    text += &parameters(&fit.parameters);
    for combination in &fit.unidentifiable {
        text += &format!("not determined by these data: {combination}\n");
    }
    text += &errors(&fit.model_error, &fit.scatter, fit.noise);
    text += &Reading::describe(&fit.readings).iter().map(|r| format!("{r}.\n")).collect::<String>();
    text += &notes(&fit.notes);
    text += "\n";
    text + &verdict(&fit.tests, study, fit.n_free, sealed)
}
