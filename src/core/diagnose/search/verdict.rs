//! What a climb comes to: the verdict, and whether held-out tests bear it out.

use super::held_out::Word;
use crate::diagnose::results::Verdict;
use crate::diagnose::settings::Settings;

/// What a verdict rests on.
#[derive(Clone, Copy, Debug)]
pub struct Grounds {
    /// Whether effects were added, and whether any instrument was found at fault.
    pub added: bool,
    /// The same of instruments.
    pub faults: bool,
    /// Nats that the effects gained when they were added.
    pub gain: f64,
    /// Held-out tests: what they say, and their relative error before and after.
    pub held_out: Option<(Word, f64, f64)>,
    /// Whether they bear out an effect beside what else was changed, where any was added.
    pub borne_out: bool,
    /// Whether there are held-out tests at all.
    pub tests_held_out: bool,
    /// Noise of the tests that decide, relative.
    pub floor: f64,
    /// Model error of the last model on the fitted tests.
    pub model_error: f64,
    /// Whether the search was stopped.
    pub stopped: bool,
}

impl Grounds {
    /// Whether a model error is seen beside the noise, and more than what no model is free of.
    pub fn seen(&self, error: f64, s: &Settings) -> bool {
        error > (s.visible * self.floor).max(s.visible_least * s.evidence.model_error_least)
    }
}

/// The verdict with its reason.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Verdict.
    pub verdict: Verdict,
    /// Whether the held-out tests bear out what was added.
    pub proven: bool,
    /// Why, in words.
    pub why: String,
    /// Part of the first model error that is left.
    pub remainder: Option<f64>,
    /// Whether an error is seen beside the noise, on the fitted tests or the held-out ones.
    pub open: bool,
    /// Whether what was added is taken back: the held-out tests do not bear it out, what they and the fitted ones say for it is little, and the model without it
    /// shows no error there.
    pub withdrawn: bool,
}

fn percent(v: f64) -> String {
    format!("{:.3} %", 100.0 * v)
}

/// Judges a climb.
pub fn judged(g: &Grounds, s: &Settings) -> Judged {
    // What is said of the model holds of the fitted tests as well.
    let left = g.held_out.map_or(g.model_error, |(word, ..)| word.left.1.max(g.model_error));
    let changed = g.added || g.faults;
    let remainder = g.held_out.filter(|_| changed).map(|(word, ..)| word.left.1 / word.left.0);
    let unexplained = g.seen(left, s);
    let (proven, mut why) = match g.held_out {
        _ if !changed => (false, "nothing was added".to_string()),
        Some((word, before, after)) => {
            let sure = word.fall.0 > word.fall.1;
            let closer = word.bears_out(s) && after < (1.0 - s.held_out_fall) * before;
            let proven = closer && g.borne_out;
            let moved = if after < before { "fell" } else { "rose" };
            let by = if after < before && !sure { ", by no more than its standard error" } else { "" };
            let nats = format!("{:.1} nats {}", word.nats.abs(), if word.nats >= 0.0 { "for it" } else { "against it" });
            let alone = if closer && !g.borne_out { ", and no effect is borne out beside what else was changed" } else { "" };
            (proven, format!("the error of the held-out tests {moved} from {} to {}{by}, {nats}{alone}", percent(before), percent(after)))
        }
        None if g.tests_held_out => (false, "the held-out tests cannot be computed".into()),
        None => (false, "no test is held out".into()),
    };
    if let Some(part) = remainder.filter(|part| unexplained && *part > s.remainder) {
        why += &format!("; {:.0} % of the model's error there is left", 100.0 * part);
    }
    let refuted = g.added && g.tests_held_out && !proven;
    // What fitted and held-out tests say is one sum of nats.
    let little = |(word, ..): (Word, f64, f64)| g.gain + word.nats <= s.unproven && !g.seen(word.left.0.max(word.left.1), s);
    let withdrawn = refuted && !g.faults && g.held_out.is_some_and(little);
    if withdrawn {
        why += &format!(
            ", and {:.1} from the fitted tests are not enough beside that; the model without it is right there to what is seen, and it is withdrawn",
            g.gain
        );
    }
    // A model whose error is as far below the noise as one must be above it to be seen is right to what the tests can say, whether all was searched or not.
    let at_noise = !withdrawn && s.visible * left <= g.floor;
    let verdict = if g.added && !withdrawn {
        let too_much_left = unexplained && remainder.is_some_and(|part| part > s.remainder);
        if too_much_left || refuted { Verdict::Unexplained } else { Verdict::Missing }
    } else if g.stopped && !at_noise {
        Verdict::Interrupted
    } else if unexplained && !withdrawn {
        Verdict::Unexplained
    } else {
        Verdict::NothingMissing
    };
    Judged { verdict, proven, why, remainder, open: unexplained, withdrawn }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grounds(nats: f64, left: (f64, f64), before: f64, after: f64) -> Grounds {
        Grounds {
            added: true,
            faults: false,
            gain: 2.0,
            held_out: Some((Word { nats, left, fall: (before * before - after * after, 1e-4) }, before, after)),
            borne_out: true,
            tests_held_out: true,
            floor: 0.01,
            model_error: left.1,
            stopped: false,
        }
    }

    fn of(g: &Grounds) -> Judged {
        judged(g, &Settings::default())
    }

    #[test]
    fn what_held_out_tests_bear_out_is_missing() {
        let j = of(&grounds(5.0, (0.3, 0.004), 0.3, 0.012));
        assert!(j.proven && j.verdict == Verdict::Missing, "{j:?}");
    }

    #[test]
    fn what_corrections_have_earned_proves_no_effect() {
        let j = of(&Grounds { borne_out: false, ..grounds(5.0, (0.3, 0.004), 0.3, 0.012) });
        assert!(
            !j.proven && j.verdict == Verdict::Unexplained && j.why.ends_with("no effect is borne out beside what else was changed"),
            "{j:?}"
        );
    }

    #[test]
    fn a_held_out_error_that_rises_is_never_missing() {
        for g in [grounds(-3.0, (0.3, 0.9), 1.11, 3.97), grounds(0.5, (0.3, 0.004), 0.3, 0.012), grounds(5.0, (0.1, 0.1), 0.1, 0.099)] {
            let j = of(&g);
            assert!(!j.proven && j.verdict == Verdict::Unexplained, "{j:?}");
        }
        assert!(of(&grounds(-3.0, (0.3, 0.9), 1.11, 3.97)).why.contains("rose from 111.000 % to 397.000 %"));
    }

    #[test]
    fn a_held_out_error_that_falls_by_less_than_its_standard_error_proves_nothing() {
        let mut g = grounds(5.0, (0.3, 0.004), 0.3, 0.012);
        if let Some((word, ..)) = &mut g.held_out {
            word.fall.1 = 2.0 * word.fall.0;
        }
        let j = of(&g);
        assert!(!j.proven && j.verdict == Verdict::Unexplained && j.why.contains("no more than its standard error"), "{j:?}");
        // Nothing is left of the error, on the held-out tests; or on the fitted ones.
        assert!(!j.open && of(&Grounds { model_error: 0.1, ..g }).open);
    }

    #[test]
    fn what_is_not_borne_out_and_for_which_all_tests_together_say_little_is_withdrawn() {
        // Without it the model errs by half a per cent there, beside 1 % of noise.
        let mut g = grounds(-2.5, (0.005, 0.004), 0.012, 0.0119);
        let j = of(&g);
        assert!(j.withdrawn && !j.proven && j.verdict == Verdict::NothingMissing, "{j:?}");
        assert!(j.why.contains("2.5 nats against it, and 2.0 from the fitted tests are not enough"), "{}", j.why);
        let stopped = of(&Grounds { stopped: true, ..g });
        assert!(stopped.withdrawn && stopped.verdict == Verdict::Interrupted, "{stopped:?}");
        assert!(of(&grounds(0.9, (0.005, 0.004), 0.012, 0.0119)).withdrawn);
        // At odds of twenty it stands, by what the fitted tests say or these, and is not proven.
        for (gain, nats) in [(2.0, 1.1), (5.6, -2.5), (20.0, -2.5)] {
            let j = of(&Grounds { gain, ..grounds(nats, (0.005, 0.004), 0.012, 0.0119) });
            assert!(!j.withdrawn && !j.proven && j.verdict == Verdict::Unexplained, "{j:?}");
        }
        // Not where an instrument is at fault as well, nor where an error is seen with it or without it.
        g.faults = true;
        assert!(!of(&g).withdrawn);
        for left in [(0.05, 0.004), (0.004, 0.05)] {
            let j = of(&grounds(-2.5, left, 0.05, 0.05));
            assert!(!j.withdrawn && j.verdict == Verdict::Unexplained, "{j:?}");
        }
        assert!(!of(&grounds(5.0, (0.005, 0.003), 0.012, 0.004)).withdrawn);
    }

    #[test]
    fn what_leaves_more_than_a_third_is_unexplained_and_proven() {
        let j = of(&grounds(3.0, (0.2, 0.12), 0.2, 0.15));
        assert!(j.proven && j.verdict == Verdict::Unexplained && j.why.contains("60 %"), "{j:?}");
        // Not where that is noise.
        assert_eq!(of(&grounds(3.0, (0.02, 0.009), 0.02, 0.012)).verdict, Verdict::Missing);
    }

    #[test]
    fn without_additions_the_error_decides() {
        let none = |error: f64| Grounds { added: false, held_out: None, tests_held_out: false, ..grounds(0.0, (error, error), 0.0, 0.0) };
        assert_eq!(of(&none(0.005)).verdict, Verdict::NothingMissing);
        assert_eq!(of(&none(0.05)).verdict, Verdict::Unexplained);
        assert_eq!(of(&Grounds { stopped: true, ..none(0.05) }).verdict, Verdict::Interrupted);
        // A model at the noise is not made unexplained by a search that was cut short.
        assert_eq!(of(&Grounds { stopped: true, ..none(0.004) }).verdict, Verdict::NothingMissing);
        assert_eq!(of(&Grounds { stopped: true, ..none(0.008) }).verdict, Verdict::Interrupted);
        // Without held-out tests nothing is proven, and what was added stands.
        let added = of(&Grounds { added: true, ..none(0.005) });
        assert!(!added.proven && added.verdict == Verdict::Missing && added.why == "no test is held out");
    }
}
