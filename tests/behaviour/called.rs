//! Verbs called from a program: the results of the command line, told and stopped through a watcher.

use std::ffi::OsString;
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
    fn program(&self) -> Option<Vec<OsString>> {
        Some(vec![env!("CARGO_BIN_EXE_misfit").into()])
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
fn a_trial_and_a_campaign_are_called_and_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let out = |name: &str| dir.path().join(name).display().to_string();
    let trial = ["trial", "--cases", "2", "--models", "connector", "--kinds", "none", "--threads", "1", "--out", &out("trial")];
    let heard = Arc::new(Heard::default());
    let done = call(&trial, heard.clone()).unwrap();
    assert!(done.code == 0 && done.json["cases"] == 2 && !heard.words.lock().unwrap().is_empty(), "{}", done.json);
    let rig = Rig::new();
    let file = rig.path("many.toml");
    let text = |verb: &str| format!("schema = 1\nverb = \"{verb}\"\nstudies = [\".\"]\n[grid]\nseed = [1, 2, 3]\n");
    std::fs::write(&file, text("fit")).unwrap();
    let words = ["campaign".to_string(), file.display().to_string(), "--out".into(), out("fits")];
    let done = call(&words, Arc::new(Heard::default())).unwrap();
    assert!(done.code == 0 && done.json["done"] == 3 && done.json["failed"].as_array().unwrap().is_empty(), "{}", done.json);
    std::fs::write(&file, text("ladder")).unwrap();
    let heard = Arc::new(Heard::default());
    let (flag, folder) = (heard.flag.clone(), out("ladders"));
    // The first ladder is under way where it has a folder of its run; it would be done if it were waited for.
    let under_way = move || {
        let works = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        works.map(|e| e.path().join("run")).any(|run| run.is_dir())
    };
    let stop = std::thread::spawn(move || {
        while !under_way() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        flag.store(true, Ordering::Relaxed);
    });
    let words = ["campaign".to_string(), file.display().to_string(), "--out".into(), out("ladders"), "--threads".into(), "1".into()];
    let done = call(&words, heard.clone()).unwrap();
    stop.join().unwrap();
    assert_eq!(heard.words.lock().unwrap().iter().filter(|w| w.contains("of 3 tasks")).collect::<Vec<_>>(), ["0 of 3 tasks"]);
    assert!(done.code == 130 && done.json["interrupted"] == true && done.json["failed"].as_array().unwrap().is_empty(), "{}", done.json);
    assert_eq!(done.json["done"], 0, "{}", done.json);
}

#[test]
fn wrong_words_and_verbs_of_the_command_line_are_refused() {
    let rig = Rig::new();
    let study = rig.folder().display().to_string();
    for (words, said) in [
        (vec!["fitt", &study], "fitt"),
        (vec!["fit", &study, "--sed", "1"], "--sed"),
        (vec!["serve", &study], "command line"),
        (vec!["trial", "--kinds", "three"], "three"),
        (vec!["campaign", "/no/such/campaign.toml"], "No such file"),
        (vec!["fit", "/no/such/study"], "No such file"),
    ] {
        let failure = call(&words, Arc::new(Heard::default())).unwrap_err();
        assert!(failure.message().contains(said), "{words:?}: {}", failure.message());
    }
}
