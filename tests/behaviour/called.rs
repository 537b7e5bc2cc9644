//! Verbs called from a program: the results of the command line, told and stopped through a watcher.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use misfit::cli::{Watcher, call};
use misfit::diagnose::results::TestResult;
use misfit::identify::Progress;

use super::rig::Rig;

#[derive(Default)]
struct Heard {
    flag: Arc<AtomicBool>,
    words: Mutex<Vec<String>>,
    iterations: AtomicUsize,
    channels: AtomicUsize,
}

impl Watcher for Heard {
    fn cancel(&self) -> Arc<AtomicBool> {
        self.flag.clone()
    }
    fn step(&self, words: &str) {
        self.words.lock().unwrap().push(words.into());
    }
    fn iteration(&self, _: &Progress) {
        self.iterations.fetch_add(1, Ordering::Relaxed);
    }
    fn tests(&self, tests: &[TestResult]) {
        self.channels.store(tests.iter().map(|t| t.curves.len()).sum(), Ordering::Relaxed);
    }
}

#[test]
fn a_call_is_the_verb_and_tells_what_it_does() {
    let rig = Rig::new();
    let study = rig.folder().display().to_string();
    let heard = Arc::new(Heard::default());
    // Twice in one program, with other numbers of threads.
    for threads in ["1", "2"] {
        let done = call(&["fit", &study, "--threads", threads], heard.clone()).unwrap();
        let printed = rig.json("fit", &[]);
        for key in ["cost", "termination", "tests", "parameters", "effects"] {
            assert_eq!(done.json[key], printed[key], "{key}");
        }
        assert!(done.code == 0 && done.text.contains("linear_stiffness"), "{}", done.text);
    }
    assert!(heard.words.lock().unwrap().iter().any(|w| w == "fit") && heard.iterations.load(Ordering::Relaxed) > 0);
    assert!(heard.channels.load(Ordering::Relaxed) > 0);
}

#[test]
fn a_flag_stops_a_call_with_the_best_state() {
    let rig = Rig::new();
    let heard = Arc::new(Heard::default());
    heard.flag.store(true, Ordering::Relaxed);
    let done = call(&["fit".to_string(), rig.folder().display().to_string()], heard).unwrap();
    assert_eq!((done.json["termination"].as_str(), done.code), (Some("interrupted"), 130));
}

#[test]
fn wrong_words_and_verbs_of_the_command_line_are_refused() {
    let rig = Rig::new();
    let study = rig.folder().display().to_string();
    for (words, said) in [
        (vec!["fitt", &study], "fitt"),
        (vec!["fit", &study, "--sed", "1"], "--sed"),
        (vec!["serve", &study], "command line"),
        (vec!["trial"], "command line"),
        (vec!["fit", "/no/such/study"], "No such file"),
    ] {
        let failure = call(&words, Arc::new(Heard::default())).unwrap_err();
        assert!(failure.message().contains(said), "{words:?}: {}", failure.message());
    }
}
