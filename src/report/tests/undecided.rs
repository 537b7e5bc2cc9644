//! A verdict that the held-out tests do not bear out.

use super::*;

/// Where nothing is left that a law would be missing for, the reader is not sent to look for one.
#[test]
fn what_the_held_out_tests_do_not_bear_out_is_told_apart_from_what_leaves_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let page = |unexplained_remainder: bool| {
        let ladder = LadderResult { verdict: Verdict::Unexplained, proven: false, unexplained_remainder, next_test: None, ..ladder(100) };
        html(&ReportInput { study: &study, system: None, fit: None, diagnosis: None, ladder: Some(&ladder) }).unwrap()
    };
    let (undecided, left) = (page(false), page(true));
    assert!(
        undecided.contains("measure one more test like those that are held out")
            && !undecided.contains("a part that no candidate explains")
    );
    assert!(left.contains("needs a law that is not in the library") && left.contains("a part that no candidate explains"));
}
