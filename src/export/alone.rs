//! A study that stands alone: its values, and copies of the data it reads, in one folder that may be moved or sent.

use std::path::{Component, Path, PathBuf};

use crate::limits;
use crate::model::System;
use crate::study::{Study, StudyError};

/// Writes `<folder>/study.toml` with the values and effects of `system` and `<folder>/data` with dataset.toml and the files of the tests;
/// the cases of a tolerance prediction as `<folder>/tolerance`. Returns what was written.
pub fn stand_alone(study: &Study, system: &System, folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    let mut files = Vec::new();
    let mut alone = study.clone();
    alone.dataset.file = dataset(&study.dataset.file, &study.dataset.folder, &folder.join("data"), &mut files)?;
    alone.data = None;
    if let Some(tolerance) = &mut alone.tolerance {
        let beside = tolerance.file.parent().unwrap_or(Path::new(".")).to_path_buf();
        tolerance.file = dataset(&tolerance.file, &beside, &folder.join("tolerance"), &mut files)?;
    }
    files.push(alone.save(system, folder)?);
    Ok(files)
}

fn fail(file: &Path, reason: impl ToString, accepted: &str) -> StudyError {
    StudyError::Write { file: file.to_path_buf(), reason: reason.to_string(), accepted: accepted.into() }
}

const WRITABLE: &str = "a folder that can be written";

/// Copies a dataset file (as dataset.toml, without its `folder`: the raw files lie beside it now) and every raw file its tests name.
fn dataset(file: &Path, raw: &Path, target: &Path, files: &mut Vec<PathBuf>) -> Result<PathBuf, StudyError> {
    let text = limits::text(file).map_err(|e| fail(file, e, "a dataset that can be read"))?;
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| fail(file, e.message(), "a dataset that can be read"))?;
    std::fs::create_dir_all(target).map_err(|e| fail(target, e, WRITABLE))?;
    let tests = table.get("test").and_then(|t| t.as_array()).into_iter().flatten();
    for name in tests.filter_map(|t| t.get("file")?.as_str()) {
        let inside = Path::new(name).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if !inside {
            let accepted = "files named from their own folder; `folder` or --data says where that is";
            return Err(fail(file, format!("a test names `{name}`, which lies outside of the folder of the raw files"), accepted));
        }
        let (from, to) = (raw.join(name), target.join(name));
        if files.contains(&to) {
            continue;
        }
        let parent = to.parent().unwrap_or(target);
        std::fs::create_dir_all(parent).map_err(|e| fail(parent, e, WRITABLE))?;
        let mut source = limits::open(&from).map_err(|e| fail(&from, e, "a file that can be read"))?;
        let mut copy = std::fs::File::create(&to).map_err(|e| fail(&to, e, WRITABLE))?;
        std::io::copy(&mut source, &mut copy).map_err(|e| fail(&to, e, WRITABLE))?;
        files.push(to);
    }
    let to = target.join("dataset.toml");
    limits::replace(&to, without_folder(&text).as_bytes()).map_err(|e| fail(&to, e, WRITABLE))?;
    files.push(to.clone());
    Ok(to)
}

/// The text without the key `folder` before the first table.
fn without_folder(text: &str) -> String {
    let mut head = true;
    let keep = |line: &&str| {
        head &= !line.trim_start().starts_with('[');
        let key = line.split('=').next().unwrap_or("").trim().trim_matches('"');
        !(head && key == "folder")
    };
    text.split_inclusive('\n').filter(keep).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_the_folder_of_the_head_is_left_out() {
        let text = "schema = 1\nfolder = \"../raw\"\n[[test]]\nfolder = 1\n";
        assert_eq!(super::without_folder(text), "schema = 1\n[[test]]\nfolder = 1\n");
    }
}
