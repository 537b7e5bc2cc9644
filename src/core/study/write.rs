//! Writing study.toml: whole or not at all.

use std::path::{Path, PathBuf};

use crate::data::toml_strict::{TomlFile, TomlProblem};
use crate::limits;
use crate::model::{Instance, System};

use super::{Study, StudyError, starts, text};

impl Study {
    /// Appends `instance` as an `[[effect]]` to the file of the study, leaving the rest as it is byte for byte, and returns the study
    /// with it. The new text is read as a study before it takes the place of the old; on any error the file is as it was.
    pub fn write_effect(&self, instance: &Instance) -> Result<Study, StudyError> {
        let file = self.file.canonicalize().map_err(|e| fail(&self.file, &e))?;
        let whole = limits::text(&file).map_err(|e| fail(&file, &e))?;
        let (whole, study) = self.appended(&file, whole, std::slice::from_ref(instance))?;
        replace(&file, &whole)?;
        Ok(study)
    }

    /// Writes the file of this study under another name beside it, its comments as they are: the starts of its effects at the values of `instances`, which begin
    /// with those of the study, and the others appended, as [`Study::write_effect`] appends one. Returns the file and the names of the
    /// parameters whose values stand nowhere in it. Never writes over a file.
    pub fn save_beside(&self, instances: &[Instance], name: &str) -> Result<(PathBuf, Vec<String>), StudyError> {
        let refuse = |reason: &str| StudyError::Write {
            file: self.folder.join(name),
            reason: reason.into(),
            accepted: "a new name of letters, digits, `-` and `_`, at most 64".into(),
        };
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > 64 || !name.chars().all(plain) {
            return Err(refuse(if name.is_empty() {
                "a name is needed, such as with-friction"
            } else {
                "it is no name of a file that is written here"
            }));
        }
        let own = self.file.canonicalize().map_err(|e| fail(&self.file, &e))?;
        let file = self.folder.join(format!("{name}.toml"));
        if std::fs::symlink_metadata(&file).is_ok() {
            return Err(refuse("a file of this name is there"));
        }
        // The file as it is now, not as it was loaded: the engineer may have edited it meanwhile.
        let whole = limits::text(&own).map_err(|e| fail(&own, &e))?;
        let (of_study, added) = instances.split_at(self.system.instances.len().min(instances.len()));
        let (whole, kept) = starts::moved(&whole, &self.system, &self.dataset, of_study);
        let (whole, _) = self.appended(&own, whole, added)?;
        replace(&file, &whole)?;
        Ok((file, kept))
    }

    /// The text of `file`, this study's, with the effects at its end, and the study that it then is.
    fn appended(&self, file: &Path, mut whole: String, instances: &[Instance]) -> Result<(String, Study), StudyError> {
        let before = whole.clone();
        let newline = if whole.contains("\r\n") { "\r\n" } else { "\n" };
        if !whole.ends_with('\n') && !whole.is_empty() {
            whole.push_str(newline);
        }
        // A coefficient may act on an effect that stands before it.
        let mut grown = self.system.clone();
        for instance in instances {
            let block = text::effect(&grown, &self.dataset, instance, false);
            whole.push_str(&format!("\n{block}").replace('\n', newline));
            grown.instances.push(instance.clone());
        }
        let study = self.reread(&self.file, whole.clone()).map_err(|e| not_appendable(file, &before, e))?;
        if study.system.instances.len() != grown.instances.len() {
            return Err(StudyError::Write {
                file: file.to_path_buf(),
                reason: "the effects in the file are no longer those that were read".into(),
                accepted: "the verb again, on the file as it is now".into(),
            });
        }
        Ok((whole, study))
    }

    /// Writes `<folder>/study.toml` with the values and effects of `system` ([`Study::with_values`]) and returns its path; makes the
    /// folder where it is missing. Never writes over the file of this study.
    pub fn save(&self, system: &System, folder: &Path) -> Result<PathBuf, StudyError> {
        std::fs::create_dir_all(folder).map_err(|e| fail(folder, &e))?;
        let file = folder.join("study.toml");
        if let (Ok(new), Ok(own)) = (file.canonicalize(), self.file.canonicalize())
            && new == own
        {
            let reason = "it is the study's own file".into();
            return Err(StudyError::Write { file, reason, accepted: "another folder".into() });
        }
        let whole = self.with_values(system, folder);
        self.reread(&file, whole.clone())?;
        replace(&file, &whole)?;
        Ok(file)
    }

    /// Reads a text as the study it would be in `file`, with the dataset at hand.
    pub(super) fn reread(&self, file: &Path, whole: String) -> Result<Study, StudyError> {
        let toml = TomlFile::parse(file, whole, "study")?;
        let mut study = Study::from_toml(&toml, self.dataset.clone())?;
        study.data = self.data.clone();
        Ok(study)
    }
}

/// TOML that was valid and is not any more with a block at its end: its effects stand in a list `effect = [...]`.
fn not_appendable(file: &Path, before: &str, e: StudyError) -> StudyError {
    let syntax = matches!(&e, StudyError::Toml(t) if matches!(*t.problem, TomlProblem::Syntax(_)));
    if !syntax || TomlFile::parse(file, before.to_string(), "study").is_err() {
        return e;
    }
    let reason = "its effects stand in a list, `effect = [...]`, to which no block can be appended".into();
    StudyError::Write { file: file.to_path_buf(), reason, accepted: "each effect as an [[effect]] of its own".into() }
}

fn fail(file: &Path, e: &std::io::Error) -> StudyError {
    StudyError::Write { file: file.to_path_buf(), reason: e.to_string(), accepted: "a file and a folder that can be written".into() }
}

fn replace(file: &Path, whole: &str) -> Result<(), StudyError> {
    limits::replace(file, whole.as_bytes()).map_err(|e| fail(file, &e))
}
