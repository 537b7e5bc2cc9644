//! `[tolerance]`: the tolerance cases of another dataset, and how the model and the laws are held against them.

use std::path::Path;

use crate::data::toml_strict::{TableView, TomlError, ValueView};
use crate::data::{Conditions, Control, Dataset};
use crate::explain::Explain;
use crate::model::System;
use crate::tolerance::{Cases, Housing, Pair};
use crate::units::Dimension;

use super::prediction::{self, CycleQuantity, Predicted, PredictionSpec};
use super::settings::unknown;
use super::{StudyError, engineering};

/// `[tolerance]` with its cases.
#[derive(Clone, Debug, PartialEq)]
pub struct ToleranceSpec {
    /// The cases.
    pub cases: Cases,
    /// Index of the case that ratios refer to.
    pub reference: usize,
    /// Interferences with their areas.
    pub pairs: Vec<Pair>,
    /// Leaf and housing of eqs. 4 to 6.
    pub housing: Housing,
    /// The cycle whose energy is computed; its condition `condition` is set to the interferences.
    pub cycle: PredictionSpec,
    /// Name of the condition that stands for the interference in the model's laws.
    pub condition: String,
    /// Interferences within which the laws are known [m].
    pub range: (f64, f64),
    /// Quantities of the laws that are searched.
    pub quantities: Vec<String>,
    /// Terms of a law at most.
    pub terms: usize,
    /// Permutations of the test.
    pub permutations: usize,
    /// Tolerances that span the surface.
    pub surface: [String; 2],
    /// Line in study.toml.
    pub line: usize,
    /// dataset.toml of the cases.
    pub(crate) file: std::path::PathBuf,
    /// The table as it stands, without its dataset.
    pub(super) text: String,
}

impl ToleranceSpec {
    /// dataset.toml of the cases.
    pub fn file(&self) -> &Path {
        &self.file
    }
}

/// Permutations where the study does not say.
const PERMUTATIONS: usize = 1000;

/// Reads `[tolerance]`, and the dataset it names relative to `folder`.
pub(super) fn read(root: &TableView<'_>, system: &System, dataset: &Dataset, folder: &Path) -> Result<Option<ToleranceSpec>, StudyError> {
    let Some(value) = root.get("tolerance") else { return Ok(None) };
    let table = value.table()?;
    table.only(&[
        "dataset",
        "test",
        "reference",
        "interference",
        "housing",
        "cycle",
        "condition",
        "range",
        "quantities",
        "terms",
        "permutations",
        "surface",
    ])?;
    let length = |v: ValueView<'_>| positive(&v, Dimension::LENGTH);
    let pairs = table.tables("interference")?.iter().map(pair).collect::<Result<Vec<Pair>, _>>()?;
    if pairs.is_empty() {
        return Err(table.refuse("no interference stands there", "interference = [{ name, area, resolution }]").into());
    }
    let area = Dimension::LENGTH.power(2);
    let mut needed: Vec<(String, Dimension)> = Vec::new();
    for p in &pairs {
        needed.extend([(p.interference.clone(), Dimension::LENGTH), (p.area.clone(), area)]);
    }
    let named = |key: &str| -> Result<Vec<String>, TomlError> {
        Ok(table.require(key, "a list of conditions of the rows")?.strings()?.into_iter().map(str::to_string).collect())
    };
    let (quantities, axes) = (named("quantities")?, named("surface")?);
    for q in quantities.iter().chain(&axes) {
        if !needed.iter().any(|n| n.0 == *q) {
            needed.push((q.clone(), Dimension::LENGTH));
        }
    }
    let Ok(surface) = <[String; 2]>::try_from(axes.clone()) else {
        let value = table.require("surface", "two tolerances")?;
        return Err(value.refuse(format!("a surface over {} tolerances", axes.len()), "two").into());
    };
    if quantities.is_empty() {
        return Err(table.require("quantities", "quantities")?.refuse("no quantity for the laws", "at least one").into());
    }
    let at = table.require("dataset", "\"../data/table.toml\"")?;
    let path = folder.join(at.string()?);
    let there = if path.is_dir() { path.join("dataset.toml").is_file() } else { path.is_file() };
    if !there {
        return Err(at.refuse(format!("no dataset at {}", path.display()), "a folder with dataset.toml, or that file").into());
    }
    let other = Dataset::load(&path, None)?;
    let test = table.require("test", "the id of an energy test")?;
    let cases = Cases::read(&other, test.string()?, &needed).map_err(|e| test.refuse(format!("{}: {e}", e.place()), e.accepted()))?;
    let value = table.require("reference", "the case that ratios refer to")?;
    let reference = value.string()?;
    let Some(reference) = cases.cases.iter().position(|c| c.name == reference) else {
        return Err(unknown(&value, "case", reference, cases.cases.iter().map(|c| c.name.as_str())).into());
    };
    let condition = table.require("condition", "the condition of the model's laws")?;
    let name = condition.string()?;
    match engineering::condition(dataset, name) {
        Some(unit) if unit.dimension == Dimension::LENGTH => {}
        Some(unit) => return Err(condition.refuse(format!("`{name}` is a {}", unit.dimension.name()), "a length").into()),
        None => {
            let names: Vec<&str> = dataset.tests.iter().flat_map(|t| t.conditions.keys()).map(String::as_str).collect();
            return Err(unknown(&condition, "condition", name, names.into_iter()).into());
        }
    }
    let value = table.require("range", "[\"0.03 mm\", \"1.3 mm\"]")?;
    let ends = value.list()?.into_iter().map(length).collect::<Result<Vec<f64>, _>>()?;
    let &[low, high] = ends.as_slice() else {
        return Err(value.refuse(format!("a range of {} numbers", ends.len()), "its ends").into());
    };
    if low >= high {
        return Err(value.refuse("the range is empty", "the lower end first").into());
    }
    let count = |key: &str, low, high| table.optional(key, |v| v.integer(low, high).map(|n| n as usize));
    let lines = table.to_toml("tolerance");
    let text: String = lines.lines().skip(1).filter(|l| !l.starts_with("dataset = ")).map(|l| format!("{l}\n")).collect();
    Ok(Some(ToleranceSpec {
        reference,
        pairs,
        housing: housing(&table.require("housing", "{ leaf_modulus, ... }")?.table()?)?,
        cycle: cycle(&table.require("cycle", "{ at, control, force_min, force_max, frequency }")?.table()?, system)?,
        condition: name.to_string(),
        range: (low, high),
        quantities,
        terms: count("terms", 1, 3)?.unwrap_or(2),
        permutations: count("permutations", 19, 100_000)?.unwrap_or(PERMUTATIONS),
        surface,
        line: table.line(),
        file: other.file.clone(),
        text,
        cases,
    }))
}

fn positive(value: &ValueView<'_>, dimension: Dimension) -> Result<f64, TomlError> {
    let q = value.quantity(dimension)?;
    if q.value > 0.0 { Ok(q.value) } else { Err(value.refuse(format!("{q} is not above 0"), format!("a {} above 0", dimension.name()))) }
}

fn pair(table: &TableView<'_>) -> Result<Pair, TomlError> {
    table.only(&["name", "area", "resolution"])?;
    let value = table.require("resolution", "[\"0.01 mm\", \"0.1 mm2\"], the last printed digit of either")?;
    let list = value.list()?;
    let [i, a] = list.as_slice() else {
        return Err(value.refuse(format!("{} resolutions", list.len()), "that of the interference and that of the area"));
    };
    let resolution = (positive(i, Dimension::LENGTH)?, positive(a, Dimension::LENGTH.power(2))?);
    Ok(Pair { interference: table.string("name")?.to_string(), area: table.string("area")?.to_string(), resolution })
}

fn housing(table: &TableView<'_>) -> Result<Housing, TomlError> {
    table.only(&["leaf_modulus", "leaf_length", "leaf_width", "deflection", "housing_modulus", "thickness"])?;
    let of = |key: &str, dimension: Dimension| positive(&table.require(key, dimension.examples().as_str())?, dimension);
    Ok(Housing {
        leaf_modulus: of("leaf_modulus", Dimension::PRESSURE)?,
        leaf_length: of("leaf_length", Dimension::LENGTH)?,
        leaf_width: of("leaf_width", Dimension::LENGTH)?,
        deflection: of("deflection", Dimension::LENGTH)?,
        housing_modulus: of("housing_modulus", Dimension::PRESSURE)?,
        thickness: of("thickness", Dimension::LENGTH)?,
    })
}

fn cycle(table: &TableView<'_>, system: &System) -> Result<PredictionSpec, TomlError> {
    table.only(&["at", "control", "force_min", "force_max", "displacement_min", "displacement_max", "amplitude", "mean", "frequency"])?;
    let at = prediction::place(&table.require("at", "the place that is driven, such as \"P.x\"")?, system)?.to_string();
    let control = table.require("control", "\"force\" or \"displacement\"")?.word("control", &Control::WORDS)?;
    let limits = prediction::limits(table, control, &at)?;
    let frequency = positive(&table.require("frequency", "\"5 Hz\"")?, Dimension::FREQUENCY)?;
    let quantity = Predicted::Cycle { quantity: CycleQuantity::Dissipated, at, control, limits, frequency };
    Ok(PredictionSpec { case: "tolerance".into(), quantity, conditions: Conditions::new(), reference: None, line: table.line() })
}
