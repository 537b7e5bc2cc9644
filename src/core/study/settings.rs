//! `split`, `[fit]`, `[search]`: which tests serve what, and the options of fit and search.

use std::collections::BTreeMap;

use crate::data::toml_strict::{TableView, TomlError, TomlProblem, ValueView, nearest};
use crate::data::{Dataset, ModalTable, Record};
use crate::diagnose::{STATED, Settings};
use crate::effect::{self, Effect};
use crate::identify::Loss;
use crate::model::Model;
use crate::units::Dimension;

use super::error::at;
use super::site;

/// Ids of the tests that are not fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// Tests that decide whether an effect is accepted.
    pub select: Vec<String>,
    /// Tests read once, at the end.
    pub held_out: Vec<String>,
}

impl Split {
    /// The word of the split a test is in: `fit`, `select` or `held_out`.
    pub fn word(&self, test: &str) -> &'static str {
        if self.select.iter().any(|t| t == test) {
            "select"
        } else if self.held_out.iter().any(|t| t == test) {
            "held_out"
        } else {
            "fit"
        }
    }
}

/// Options of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// Loss of every whitened residual.
    pub loss: Loss,
    /// Iterations at most; none: as many as the fit has by default.
    pub max_iterations: Option<usize>,
    /// Starts: 1 is the study's own.
    pub starts: usize,
    /// Points of a loop that are compared, at most; none: all.
    pub points: Option<usize>,
    /// What the model may be off by in an FRF by itself, beside the noise: a part of |H|, root mean square.
    pub frf_tolerance: Option<f64>,
}

impl Default for FitSettings {
    fn default() -> Self {
        FitSettings { loss: Loss::Squares, max_iterations: None, starts: 1, points: None, frf_tolerance: None }
    }
}

/// What the search for missing effects may try.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchSettings {
    /// Names of effects; none: the whole library.
    pub effects: Option<Vec<String>>,
    /// Places and channels as written in `at`; none: all.
    pub places: Option<Vec<String>>,
    /// Effects added at most; none: as many as by default.
    pub max_added: Option<usize>,
    /// Whether what the study ties or fixes may deviate a little beside what it states of it.
    pub slack: Option<bool>,
    /// Constants of the search, those that are not stated as by default.
    pub constants: Settings,
}

/// Rows of modal tables that are computed and compared with nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct LeaveOut {
    /// Test id.
    pub test: String,
    /// `natural_frequency` or `modal_damping`.
    pub quantity: &'static str,
    /// Number of the mode.
    pub mode: u32,
    /// Why.
    pub why: String,
}

/// A modal test whose natural frequencies are compared as shifts against those of another.
#[derive(Clone, Debug, PartialEq)]
pub struct ShiftOf {
    /// Test id.
    pub test: String,
    /// The other one.
    pub against: String,
    /// Relative deviation of a shift.
    pub sigma: f64,
}

/// The rows of a modal test that a table names.
fn modal<'a>(value: &ValueView<'_>, dataset: &'a Dataset) -> Result<(&'a str, &'a ModalTable), TomlError> {
    let name = value.string()?;
    let found = dataset.test(name).and_then(|t| if let Record::Modal(m) = &t.record { Some((t.id.as_str(), m)) } else { None });
    found.ok_or_else(|| {
        let modal = dataset.tests.iter().filter(|t| matches!(t.record, Record::Modal(_)));
        unknown(value, "modal test", name, modal.map(|t| t.id.as_str()))
    })
}

/// Reads every `[[shift]]`.
pub(super) fn shifts(root: &TableView<'_>, dataset: &Dataset) -> Result<Vec<ShiftOf>, TomlError> {
    let mut list: Vec<ShiftOf> = Vec::new();
    for table in root.tables("shift")? {
        table.only(&["test", "against", "sigma"])?;
        let value = table.require("test", "the id of a modal test")?;
        let (test, own) = modal(&value, dataset)?;
        let other = table.require("against", "the id of another modal test")?;
        let (against, rows) = modal(&other, dataset)?;
        if test == against {
            return Err(other.refuse(format!("test `{test}` does not shift against itself"), "another modal test"));
        }
        if list.iter().any(|s| s.test == test) {
            return Err(value.refuse(format!("the shifts of `{test}` stand twice"), "one [[shift]] for each test"));
        }
        if list.iter().any(|s| s.test == against || s.against == test) {
            return Err(
                other.refuse("shifts against a test that is itself compared by its shifts", "all against one test, compared as it is")
            );
        }
        if !own.rows.iter().any(|r| rows.rows.iter().any(|o| o.mode == r.mode)) {
            return Err(other.refuse(format!("`{test}` and `{against}` have no mode in common"), "tables with modes of the same numbers"));
        }
        let value = table.require("sigma", "\"0.15 %\", how well a shift is known")?;
        let sigma = value.quantity(Dimension::DIMENSIONLESS)?.value;
        if !(sigma > 0.0 && sigma < 1.0) {
            return Err(value.refuse(format!("a deviation of {sigma}"), "above 0 and below 100 %"));
        }
        list.push(ShiftOf { test: test.into(), against: against.into(), sigma });
    }
    Ok(list)
}

/// Reads every `[[leave_out]]`.
pub(super) fn leave_out(root: &TableView<'_>, dataset: &Dataset) -> Result<Vec<LeaveOut>, TomlError> {
    let words = [("natural_frequency", "natural_frequency"), ("modal_damping", "modal_damping")];
    let one = |table: &TableView<'_>| {
        table.only(&["test", "quantity", "mode", "why"])?;
        let value = table.require("test", "the id of a modal test")?;
        let (test, modes) = modal(&value, dataset)?;
        let quantity = table.require("quantity", "natural_frequency or modal_damping")?.word("quantity", &words)?;
        let value = table.require("mode", "1, 2, ...")?;
        let mode = value.integer(1, 1_000_000)? as u32;
        let there = modes.rows.iter().any(|r| r.mode == mode && (quantity == "natural_frequency" || r.damping.is_some()));
        if !there {
            return Err(value.refuse(format!("test `{test}` has no {quantity} of mode {mode}"), "a mode of that test"));
        }
        Ok(LeaveOut { test: test.to_string(), quantity, mode, why: table.string("why")?.to_string() })
    };
    root.tables("leave_out")?.iter().map(one).collect()
}

/// Reads `split`.
pub(super) fn split(root: &TableView<'_>, dataset: &Dataset) -> Result<Split, TomlError> {
    let Some(value) = root.get("split") else { return Ok(Split::default()) };
    let table = value.table()?;
    table.only(&["select", "held_out"])?;
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    let mut ids = |key: &'static str| -> Result<Vec<String>, TomlError> {
        let Some(list) = table.get(key) else { return Ok(vec![]) };
        let mut ids = Vec::new();
        for v in list.list()? {
            let id = v.string()?;
            if dataset.test(id).is_none() {
                return Err(unknown(&v, "test", id, dataset.tests.iter().map(|t| t.id.as_str())));
            }
            if let Some(first) = seen.insert(id.to_string(), key) {
                let message = if first == key {
                    format!("test `{id}` stands twice in {key}")
                } else {
                    format!("test `{id}` stands in {first} and in {key}")
                };
                return Err(v.refuse(message, "each test in one of select and held_out, or in neither to be fitted"));
            }
            ids.push(id.to_string());
        }
        Ok(ids)
    };
    let split = Split { select: ids("select")?, held_out: ids("held_out")? };
    if dataset.tests.iter().all(|t| split.word(&t.id) != "fit") {
        return Err(table.refuse("every test is in select or held_out: nothing is left to fit", "at least one test in neither"));
    }
    Ok(split)
}

/// Reads `[fit]`.
pub(super) fn fit(root: &TableView<'_>) -> Result<FitSettings, TomlError> {
    let Some(value) = root.get("fit") else { return Ok(FitSettings::default()) };
    let table = value.table()?;
    table.only(&["loss", "width", "max_iterations", "starts", "points", "frf_tolerance"])?;
    #[derive(Clone, Copy)]
    enum Word {
        Squares,
        Huber,
        SoftL1,
        Cauchy,
    }
    let words = [("squares", Word::Squares), ("huber", Word::Huber), ("soft_l1", Word::SoftL1), ("cauchy", Word::Cauchy)];
    let word = table.optional("loss", |v| v.word("loss", &words))?.unwrap_or(Word::Squares);
    let width = table.optional("width", |v| {
        let width = v.number()?;
        if width > 0.0 { Ok(width) } else { Err(v.refuse(format!("a width of {width}"), "a width above 0, in units of the noise")) }
    })?;
    let loss = match (word, width) {
        (Word::Squares, None) => Loss::Squares,
        (Word::Squares, Some(_)) => {
            return Err(table.refuse("squares have no width", "loss = \"huber\", \"soft_l1\" or \"cauchy\" with a width"));
        }
        // Widths of 95 % efficiency on Gaussian noise (Huber 1964; Holland and Welsch 1977).
        (Word::Huber, w) => Loss::Huber(w.unwrap_or(1.345)),
        (Word::SoftL1, w) => Loss::SoftL1(w.unwrap_or(1.345)),
        (Word::Cauchy, w) => Loss::Cauchy(w.unwrap_or(2.385)),
    };
    let frf_tolerance = table.optional("frf_tolerance", |v| {
        let part = v.number()?;
        let accepted = "a part of |H| above 0 and below 1, such as 0.03";
        if part > 0.0 && part < 1.0 { Ok(part) } else { Err(v.refuse(format!("a tolerance of {part}"), accepted)) }
    })?;
    let default = FitSettings::default();
    Ok(FitSettings {
        loss,
        max_iterations: table.optional("max_iterations", |v| v.integer(1, 1_000_000))?.map(|n| n as usize),
        starts: table.optional("starts", |v| v.integer(1, 10_000))?.map_or(default.starts, |n| n as usize),
        points: table.optional("points", |v| v.integer(16, 400))?.map(|n| n as usize),
        frf_tolerance,
    })
}

/// Reads `[search]`.
pub(super) fn search(root: &TableView<'_>, model: &Model, dataset: &Dataset) -> Result<SearchSettings, TomlError> {
    let Some(value) = root.get("search") else { return Ok(SearchSettings::default()) };
    let table = value.table()?;
    let keys: Vec<&str> = ["effects", "places", "max_added", "slack"].into_iter().chain(STATED.iter().map(|s| s.key)).collect();
    table.only(&keys)?;
    let list = |key: &str, check: &dyn Fn(&ValueView<'_>) -> Result<(), TomlError>| {
        table.optional(key, |v| {
            v.list()?.iter().map(|v| check(v).and_then(|()| v.string().map(str::to_string))).collect::<Result<Vec<_>, _>>()
        })
    };
    let known = |v: &ValueView<'_>| effect(v).map(|_| ());
    // A place or a channel: what stands before the last dot tells which is meant.
    let finder = model.finder();
    let there = |v: &ValueView<'_>| {
        let text = v.string()?;
        // A group of places is written as effects have it, with commas.
        let force = text.split(',').try_for_each(|at| finder.places_at(at.trim()).map(|_| ()));
        let test = text.rsplit_once('.').map_or("", |(test, _)| test);
        if force.is_err() && (test == "*" || dataset.test(test).is_some()) {
            let delay = effect::LIBRARY.iter().find(|e| matches!(e, Effect::Channel(_)));
            return delay.map_or(Ok(()), |e| site::resolve(&finder, dataset, e, &[text]).map(|_| ()).map_err(|(_, e)| at(v, &e)));
        }
        force.map_err(|e| at(v, &e))
    };
    let max_added = table.optional("max_added", |v| v.integer(0, 1_000))?.map(|n| n as usize);
    Ok(SearchSettings {
        effects: list("effects", &known)?,
        places: list("places", &there)?,
        max_added,
        slack: table.optional("slack", |v| v.bool())?,
        constants: constants(&table, max_added)?,
    })
}

/// The constants that `[search]` states.
fn constants(table: &TableView<'_>, max_added: Option<usize>) -> Result<Settings, TomlError> {
    let mut settings = Settings::default();
    settings.max_added = max_added.unwrap_or(settings.max_added);
    for stated in &STATED {
        let (low, high) = stated.range;
        let value = table.optional(stated.key, |v| {
            let value = v.number()?;
            let accepted = format!("a number from {low} to {high}");
            if (low..=high).contains(&value) {
                Ok(value)
            } else {
                Err(v.refuse(format!("{} = {value} is out of range", stated.key), accepted))
            }
        })?;
        if let Some(value) = value {
            *(stated.field)(&mut settings) = value;
        }
    }
    settings.contradiction().map_or(Ok(settings), |(said, accepted)| Err(table.refuse(said, accepted)))
}

/// The effect a value names.
pub(super) fn effect(value: &ValueView<'_>) -> Result<&'static Effect, TomlError> {
    let name = value.string()?;
    effect::find(name).map_err(|_| unknown(value, "effect", name, effect::own::names().into_iter()))
}

/// An unknown word with the nearest of the known ones.
pub(super) fn unknown<'a>(value: &ValueView<'_>, what: &str, found: &str, known: impl Iterator<Item = &'a str>) -> TomlError {
    let accepted: Vec<String> = known.map(str::to_string).collect();
    let nearest = nearest(found, accepted.iter().map(String::as_str));
    value.error(TomlProblem::UnknownWord { what: what.into(), found: found.into(), nearest, accepted })
}
