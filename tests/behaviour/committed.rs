//! Every dataset and study of the repository loads, and what it holds can be computed with.

use std::path::{Path, PathBuf};

use misfit::data::Dataset;
use misfit::diagnose::Case;
use misfit::study::Study;

fn root(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)
}

/// TOML files below a folder with a line of this text, runs left out.
fn files(folder: &Path, mark: &str, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if path.file_name().is_some_and(|n| n != "runs") {
                files(&path, mark, all);
            }
        } else if path.extension().is_some_and(|e| e == "toml") {
            let text = std::fs::read_to_string(&path).unwrap();
            if text.lines().any(|l| l.starts_with(mark)) {
                all.push(path);
            }
        }
    }
}

/// Whether a study's raw files are public and not in the repository; its README says where they are.
fn elsewhere(path: &Path) -> bool {
    path.components().any(|c| ["03-friction-damper", "measured"].iter().any(|name| c.as_os_str() == *name))
}

#[test]
fn every_dataset_loads() {
    let mut all = vec![];
    files(&root("datasets"), "[[test]]", &mut all);
    files(&root("studies"), "[[test]]", &mut all);
    assert!(all.len() >= 8, "{all:?}");
    let mut tests = 0;
    for path in all.iter().filter(|p| !elsewhere(p)) {
        let dataset = Dataset::load(path, None).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert!(!dataset.tests.is_empty(), "{}", path.display());
        tests += dataset.tests.len();
    }
    println!("{} datasets, {tests} tests", all.len());
}

/// The parts of `misfit check` before its gate: every test is planned on the model, effects and formulas are examined. (The gate is run on
/// the small studies by the tests of the program; on the large ones it takes minutes.)
#[test]
fn every_study_can_be_computed_with() {
    let mut all = vec![];
    files(&root("studies"), "dataset = ", &mut all);
    assert!(all.len() >= 5, "{all:?}");
    for path in all.iter().filter(|p| !elsewhere(p)) {
        let study = Study::load(path, None).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let case = Case::from_study(&study, 1).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(case.plans.len(), study.dataset.tests.len(), "{}", path.display());
        assert!(case.plans.iter().all(|(p, _)| !p.is_empty()), "{}", path.display());
        assert!(!case.system.free().is_empty(), "{}", path.display());
    }
}
