//! The dataset: `dataset.toml` and the files it names, read and checked.

use super::backbone::BackboneTable;
use super::bench::{self, Instruments, Rig};
use super::condition::{Conditions, conditions};
use super::frf::Frf;
use super::record::TimeRecord;
use super::tables::{EnergyTable, ModalTable};
use super::toml_strict::{TableView, TomlError, TomlFile, TomlProblem, ValueView, unique};
use super::{DataError, readers};
use std::path::{Path, PathBuf};

/// The measurements of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The dataset.toml that was read.
    pub file: PathBuf,
    /// Where the files were taken from.
    pub folder: PathBuf,
    pub title: Option<String>,
    pub source: Option<String>,
    pub licence: Option<String>,
    /// Assumptions the dataset declares, for the report.
    pub assumptions: Vec<String>,
    /// Limits of the test bench.
    pub rig: Rig,
    /// What its instruments may err by.
    pub instruments: Instruments,
    pub tests: Vec<Test>,
}

/// One test.
#[derive(Debug, Clone, PartialEq)]
pub struct Test {
    pub id: String,
    pub description: Option<String>,
    pub conditions: Conditions,
    /// The supports that hold the structure in this test, of those the study joins to the ground; all of them where nothing is said.
    pub supports: Option<Vec<String>>,
    pub record: Record,
    /// Line in dataset.toml.
    pub line: usize,
}

/// The kinds of test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TestKind {
    Cycle,
    Frf,
    Transient,
    Modal,
    Energy,
    Backbone,
}

impl TestKind {
    /// Every kind by its word in dataset.toml.
    pub const WORDS: [(&'static str, TestKind); 6] = [
        ("cycle", TestKind::Cycle),
        ("frf", TestKind::Frf),
        ("transient", TestKind::Transient),
        ("modal", TestKind::Modal),
        ("energy", TestKind::Energy),
        ("backbone", TestKind::Backbone),
    ];

    /// The word in dataset.toml and in the JSON output.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|w| w.1 == self).map_or("", |w| w.0)
    }
}

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// Periodic test, as recorded; [`TimeRecord::settled`] gives the loop.
    Cycle(TimeRecord),
    /// Boxed: an FRF holds many columns.
    Frf(Box<Frf>),
    /// Whole history.
    Transient(TimeRecord),
    Modal(ModalTable),
    Energy(EnergyTable),
    Backbone(BackboneTable),
}

impl Test {
    pub fn kind(&self) -> TestKind {
        match self.record {
            Record::Cycle(_) => TestKind::Cycle,
            Record::Frf(_) => TestKind::Frf,
            Record::Transient(_) => TestKind::Transient,
            Record::Modal(_) => TestKind::Modal,
            Record::Energy(_) => TestKind::Energy,
            Record::Backbone(_) => TestKind::Backbone,
        }
    }
}

impl Dataset {
    /// Reads `path` (a folder with dataset.toml, or that file) and every file it names.
    ///
    /// Files are looked for in `data` where it is given (`--data`), else in the `folder` that dataset.toml names, else beside it.
    pub fn load(path: &Path, data: Option<&Path>) -> Result<Self, DataError> {
        let toml = TomlFile::read(&Self::file_of(path), "data")?;
        Self::from_toml(&toml, data)
    }

    /// The dataset.toml that a path stands for: the one in that folder, or the file itself.
    pub fn file_of(path: &Path) -> PathBuf {
        if path.is_dir() { path.join("dataset.toml") } else { path.to_path_buf() }
    }

    /// As [`Dataset::load`], from a dataset.toml already parsed.
    pub fn from_toml(toml: &TomlFile, data: Option<&Path>) -> Result<Self, DataError> {
        let root = toml.root();
        root.only(&["schema", "folder", "title", "source", "licence", "license", "assumptions", "rig", "instruments", "test"])?;
        schema(&root)?;
        let beside = toml.path().parent().unwrap_or(Path::new("")).to_path_buf();
        let folder = match (data, root.optional("folder", |v| v.string())?) {
            (Some(data), _) => data.to_path_buf(),
            (None, Some(folder)) => beside.join(folder),
            (None, None) => beside,
        };
        let text = |key: &str| root.optional(key, |v| v.string()).map(|s| s.map(str::to_string));
        let assumptions = root.optional("assumptions", |v| v.strings())?.unwrap_or_default();
        let tables = root.require("test", "[[test]] with id, kind, ...")?;
        let tables = tables.list().map(|_| ()).and_then(|()| root.tables("test"))?;
        if tables.is_empty() {
            return Err(root.refuse("the dataset has no test", "[[test]] with id, kind, ...").into());
        }
        let source = Source { toml: toml.path(), folder: &folder, overridden: data.is_some() };
        let (mut seen, mut tests) = (Vec::new(), Vec::new());
        for table in &tables {
            let id = table.require("id", "a name for the test")?;
            unique(&mut seen, "test", id.name()?, &id)?;
            tests.push(test(table, id.name()?, &source)?);
        }
        Ok(Self {
            file: toml.path().to_path_buf(),
            folder,
            title: text("title")?,
            source: text("source")?,
            licence: text("licence")?.or(text("license")?),
            assumptions: assumptions.into_iter().map(str::to_string).collect(),
            rig: bench::rig(&root)?,
            instruments: bench::instruments(&root)?,
            tests,
        })
    }

    /// The test of that id.
    pub fn test(&self, id: &str) -> Option<&Test> {
        self.tests.iter().find(|t| t.id == id)
    }
}

/// Refuses any schema but 1. Shared by dataset.toml and study.toml.
pub fn schema(root: &TableView<'_>) -> Result<(), TomlError> {
    let value = root.require("schema", "1")?;
    match value.integer(i64::MIN, i64::MAX)? {
        1 => Ok(()),
        other => Err(value.refuse(format!("schema {other} is not known"), "schema = 1")),
    }
}

/// Where files are taken from.
pub(super) struct Source<'a> {
    toml: &'a Path,
    folder: &'a Path,
    overridden: bool,
}

impl Source<'_> {
    /// The path of a test's file, which must be there.
    pub fn file(&self, test: &TableView<'_>, id: &str) -> Result<PathBuf, DataError> {
        let value = test.require("file", "the name of a .csv, .parquet, .uff, .unv or .mat file")?;
        let name = value.string()?;
        let tried = self.folder.join(name);
        // What is there and is no file, a pipe or a folder, is refused with its reason where it is opened.
        if tried.exists() { Ok(tried) } else { Err(DataError::MissingFile { test: id.to_string(), tried, overridden: self.overridden }) }
    }

    pub fn toml(&self) -> &Path {
        self.toml
    }
}

/// Keys every test may have.
pub(super) const COMMON: [&str; 7] = ["id", "kind", "description", "conditions", "supports", "record", "header_units"];

/// Refuses keys that the kind of test does not know; names the kinds that do.
pub(super) fn only(table: &TableView<'_>, keys: &[&str]) -> Result<(), TomlError> {
    table.only(&[&COMMON, keys].concat())
}

fn test(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<Test, DataError> {
    let kind = table.require("kind", "one of cycle, frf, transient, modal, energy, backbone")?.word("kind", &TestKind::WORDS)?;
    let conditions = conditions(table)?;
    let record = match kind {
        TestKind::Cycle => Record::Cycle(super::record::cycle(table, id, &conditions, source)?),
        TestKind::Transient => Record::Transient(super::record::transient(table, id, source)?),
        TestKind::Frf => Record::Frf(Box::new(super::frf::read(table, id, source)?)),
        TestKind::Modal => Record::Modal(super::tables::modal(table, id, source)?),
        TestKind::Energy => Record::Energy(super::tables::energy(table, id, &conditions, source)?),
        TestKind::Backbone => Record::Backbone(super::backbone::backbone(table, id, source)?),
    };
    let description = table.optional("description", |v| v.string())?.map(str::to_string);
    let named = |v: ValueView<'_>| v.strings().map(|list| list.into_iter().map(str::to_string).collect());
    let supports = table.optional("supports", named)?;
    Ok(Test { id: id.to_string(), description, conditions, supports, record, line: table.line() })
}

/// An error about a required channel that is not declared.
pub(super) fn no_channel(table: &TableView<'_>, what: &str) -> TomlError {
    table.error(TomlProblem::Value { message: format!("no channel {what}"), accepted: format!("a channel with {what}") })
}

/// Reads the columns the channels name, and holds what the file says of their units against what is declared. `header_units = "ignore"` lets
/// the declaration win; `record` names a function of a universal file.
pub(super) fn columns(
    table: &TableView<'_>,
    id: &str,
    path: &Path,
    channels: &[super::ChannelSpec],
) -> Result<readers::Columns, DataError> {
    let record = table.optional("record", |v| v.string())?;
    let ignore = table.optional("header_units", |v| v.word("header_units", &[("ignore", true), ("check", false)]))?.unwrap_or(false);
    let wanted: Vec<_> = channels.iter().map(|c| readers::Wanted { name: c.column.clone(), text: c.role.is_text() }).collect();
    let mut rows = readers::read(path, &wanted, record)?;
    if ignore {
        rows.quantity = None;
        return Ok(rows);
    }
    for (spec, text) in channels.iter().zip(&rows.units) {
        let Some(text) = text else { continue };
        let message = match crate::units::parse_unit(text, spec.unit.dimension) {
            Ok(unit) if (unit.factor / spec.unit.factor - 1.0).abs() > 1e-9 => {
                format!("the file says `{text}`, and `{}` is declared", spec.unit.symbol)
            }
            Err(e @ crate::units::UnitError::WrongDimension { .. }) => format!("the file says `{text}`: {e}"),
            // What is no unit in the file says nothing.
            _ => continue,
        };
        let accepted = format!("unit = \"{text}\", or header_units = \"ignore\" where the file is wrong");
        return Err(super::record::content(path, None, id, spec, &message, &accepted));
    }
    Ok(rows)
}

#[cfg(test)]
pub(super) mod tests;
#[cfg(test)]
pub(super) mod files_tests;
#[cfg(test)]
mod reading_tests;
