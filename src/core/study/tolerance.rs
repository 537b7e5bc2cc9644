//! `[tolerance]`: the tolerance cases of another dataset, and how the model and the laws are held against them.

use std::path::Path;

use crate::data::toml_strict::{TableView, TomlError, ValueView};
use crate::data::{Conditions, Control, Dataset, EnergyTable, Record};
use crate::explain::Explain;
use crate::model::System;
use crate::tolerance::{Cases, Forms, Housing, Library, Pair};
use crate::units::Dimension;

use super::parts::{self, Parts};
use super::prediction::{self, CycleQuantity, Predicted, PredictionSpec};
use super::settings::unknown;
use super::{StudyError, engineering};

/// One energy test with tolerance cases.
#[derive(Clone, Debug, PartialEq)]
pub struct ToleranceTable {
    /// Id of the test.
    pub test: String,
    /// The cases.
    pub cases: Cases,
    /// Whether W_s stands in it, and how it was read.
    pub stored: Option<crate::data::StoredEnergy>,
    /// The cycle whose energies are computed, without the conditions of a case.
    pub cycle: PredictionSpec,
}

/// A condition of the model, and the quantities of a case whose mean it is.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseCondition {
    /// Name of the condition.
    pub name: String,
    /// Quantities of the table.
    pub of: Vec<String>,
    /// Values within which a law over the condition is known beyond the tests [SI].
    pub range: Option<(f64, f64)>,
}

/// `[tolerance]` with its cases.
#[derive(Clone, Debug, PartialEq)]
pub struct ToleranceSpec {
    /// The tests: laws are searched in the first.
    pub tables: Vec<ToleranceTable>,
    /// Name of the case that ratios refer to.
    pub reference: String,
    /// Conditions that a case sets.
    pub conditions: Vec<CaseCondition>,
    /// Interferences with their areas, for eq. 6.
    pub pairs: Vec<Pair>,
    /// Leaf and housing of eqs. 4 to 6.
    pub housing: Option<Housing>,
    /// Names of free parameters, strengths that a law of the cases scales together.
    pub strengths: Vec<String>,
    /// Declared factor from the model's energies to the table's.
    pub scale: f64,
    /// Other factors that the result is held against.
    pub scales: Vec<f64>,
    /// Libraries of terms of that law.
    pub libraries: Vec<Library>,
    /// Permutations of its test.
    pub permutations: usize,
    /// Tolerances that span the surface.
    pub surface: Option<[String; 2]>,
    /// Tolerances of parts as distributions.
    pub parts: Option<Parts>,
    /// Line in study.toml.
    pub line: usize,
    /// dataset.toml of the cases.
    pub file: std::path::PathBuf,
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
/// Greatest degree of a polynomial, and most terms of a law.
const MOST_DEGREE: i64 = 6;
const MOST_TERMS: i64 = 3;

const KEYS: [&str; 15] = [
    "dataset",
    "test",
    "tests",
    "reference",
    "conditions",
    "range",
    "interference",
    "housing",
    "cycle",
    "strengths",
    "scale",
    "scales",
    "libraries",
    "permutations",
    "surface",
];

/// Reads `[tolerance]`, and the dataset it names relative to `folder`.
pub(super) fn read(root: &TableView<'_>, system: &System, dataset: &Dataset, folder: &Path) -> Result<Option<ToleranceSpec>, StudyError> {
    let Some(value) = root.get("tolerance") else { return Ok(None) };
    let table = value.table()?;
    table.only(&[&KEYS[..], &parts::KEYS].concat())?;
    let conditions = conditions(&table, dataset)?;
    laws_have_conditions(&table, system, &conditions)?;
    let pairs = match table.get("interference") {
        Some(_) => table.tables("interference")?.iter().map(pair).collect::<Result<Vec<Pair>, _>>()?,
        None => vec![],
    };
    let surface = surface(&table)?;
    let of_parts = parts::read(&table)?;
    let libraries = table.tables("libraries")?.iter().map(library).collect::<Result<Vec<Library>, _>>()?;
    let mut needed = needed(&pairs, &conditions, &libraries, surface.as_ref(), dataset);
    of_the_parts(&mut needed, of_parts.as_ref());
    let other = dataset_of_cases(&table, folder)?;
    let tables = tables(&table, &other, &needed, system)?;
    let value = table.require("reference", "the case that ratios refer to")?;
    let reference = value.string()?;
    for t in &tables {
        if !t.cases.cases.iter().any(|c| c.name == reference) {
            return Err(unknown(&value, "case", reference, t.cases.cases.iter().map(|c| c.name.as_str())).into());
        }
    }
    if let Some(p) = &of_parts {
        names_of_parts(&table, p, &conditions, &tables[0].cases)?;
    }
    let strengths = strengths(&table, system)?;
    if strengths.is_empty() != libraries.is_empty() {
        let message = "a law of the cases needs both the strengths it scales and the libraries of its terms";
        return Err(table.refuse(message, "strengths = [\"shelf.y.film.f\"] and libraries = [{ name, quantities, terms }]").into());
    }
    let factor = |v: ValueView<'_>| {
        let f = v.number()?;
        if f > 0.0 && f.is_finite() { Ok(f) } else { Err(v.refuse(format!("a scale of {f}"), "a number above 0")) }
    };
    let scales = table.optional("scales", |v| v.list())?.unwrap_or_default().into_iter().map(factor).collect::<Result<Vec<f64>, _>>()?;
    let lines = table.to_toml("tolerance");
    let text: String = lines.lines().skip(1).filter(|l| !l.starts_with("dataset = ")).map(|l| format!("{l}\n")).collect();
    let housing = match table.get("housing") {
        Some(v) => Some(housing(&v.table()?)?),
        None => None,
    };
    Ok(Some(ToleranceSpec {
        reference: reference.to_string(),
        tables,
        conditions,
        pairs,
        housing,
        strengths,
        scale: table.optional("scale", factor)?.unwrap_or(1.0),
        scales,
        libraries,
        permutations: table.optional("permutations", |v| v.integer(19, 100_000))?.map_or(PERMUTATIONS, |n| n as usize),
        surface,
        parts: of_parts,
        line: table.line(),
        file: other.file.clone(),
        text,
    }))
}

/// `conditions = { i = ["i_min", "i_max"] }`, with `range = { i = ["0.03 mm", "1.3 mm"] }`.
fn conditions(table: &TableView<'_>, dataset: &Dataset) -> Result<Vec<CaseCondition>, StudyError> {
    let value = table
        .require("conditions", "{ i = [\"i_min\", \"i_max\"] }: a condition of the tests, and the quantities of a case whose mean it is")?;
    let ranges = table.optional("range", |v| v.table())?;
    let mut all = Vec::new();
    for (name, v) in value.table()?.entries() {
        let Some(unit) = engineering::condition(dataset, name) else {
            let names: Vec<&str> = dataset.tests.iter().flat_map(|t| t.conditions.keys()).map(String::as_str).collect();
            return Err(unknown(&v, "condition", name, names.into_iter()).into());
        };
        let of: Vec<String> = v.strings()?.into_iter().map(str::to_string).collect();
        if of.is_empty() {
            return Err(v.refuse("no quantity", "at least one quantity of the rows").into());
        }
        let range = ranges.as_ref().and_then(|r| r.get(name));
        let range = range.map(|r| range_of(&r, unit.dimension)).transpose()?;
        all.push(CaseCondition { name: name.to_string(), of, range });
    }
    if let Some((name, v)) = ranges.iter().flat_map(|r| r.entries()).find(|(name, _)| !all.iter().any(|c| c.name == *name)) {
        return Err(unknown(&v, "condition", name, all.iter().map(|c| c.name.as_str())).into());
    }
    Ok(all)
}

fn range_of(value: &ValueView<'_>, dimension: Dimension) -> Result<(f64, f64), TomlError> {
    let ends = value.list()?.into_iter().map(|v| positive(&v, dimension)).collect::<Result<Vec<f64>, _>>()?;
    let &[low, high] = ends.as_slice() else {
        return Err(value.refuse(format!("a range of {} numbers", ends.len()), "its ends"));
    };
    if low < high { Ok((low, high)) } else { Err(value.refuse("the range is empty", "the lower end first")) }
}

/// Refuses a model with a law over a condition that no case sets: its factor at the case would be unknown.
fn laws_have_conditions(table: &TableView<'_>, system: &System, conditions: &[CaseCondition]) -> Result<(), TomlError> {
    let settings = ["frequency", "amplitude", "load"];
    let laws = system.instances.iter().filter_map(|i| Some((i, i.target.as_ref()?)));
    let missing =
        laws.filter(|(_, t)| !settings.contains(&t.condition.as_str())).find(|(_, t)| !conditions.iter().any(|c| c.name == t.condition));
    let Some((law, target)) = missing else { return Ok(()) };
    let message = format!("the cases do not set `{0}`, over which the model has `{1}` at {2}", target.condition, law.name(), law.at);
    let value = table.require("conditions", "{ i = [\"i_min\", \"i_max\"] }")?;
    Err(value.refuse(message, format!("{} = [the quantities of a row whose mean it is]", target.condition)))
}

/// Every quantity that a row must state, with its dimension.
fn needed(
    pairs: &[Pair],
    conditions: &[CaseCondition],
    libraries: &[Library],
    surface: Option<&[String; 2]>,
    dataset: &Dataset,
) -> Vec<(String, Dimension)> {
    let mut needed: Vec<(String, Dimension)> = Vec::new();
    let mut add = |name: &str, dimension: Dimension| {
        if !needed.iter().any(|n| n.0 == name) {
            needed.push((name.to_string(), dimension));
        }
    };
    for p in pairs {
        add(&p.interference, Dimension::LENGTH);
        add(&p.area, Dimension::LENGTH.power(2));
    }
    for c in conditions {
        let dimension = engineering::condition(dataset, &c.name).map_or(Dimension::LENGTH, |u| u.dimension);
        c.of.iter().for_each(|q| add(q, dimension));
    }
    libraries.iter().flat_map(|l| &l.quantities).chain(surface.into_iter().flatten()).for_each(|q| add(q, Dimension::LENGTH));
    needed
}

/// Refuses a synthesis at a case, or an interference that is a condition, that is not there; and deviations with no way to the conditions.
fn names_of_parts(table: &TableView<'_>, parts: &Parts, conditions: &[CaseCondition], cases: &Cases) -> Result<(), TomlError> {
    if let (Some(s), Some(v)) = (&parts.synthesis, table.get("synthesis"))
        && !cases.cases.iter().any(|c| c.name == s.case)
    {
        return Err(unknown(&v, "case", &s.case, cases.cases.iter().map(|c| c.name.as_str())));
    }
    let named = || conditions.iter().map(|c| c.name.as_str());
    if let (Some(name), Some(v)) = (parts.assembly.as_ref().and_then(|a| a.interference.as_ref()), table.get("assembly"))
        && !named().any(|c| c == name)
    {
        return Err(unknown(&v, "condition", name, named()));
    }
    let ends = conditions.iter().filter(|c| c.of.len() == 2).count();
    if let (None, Some(v)) = (&parts.assembly, table.get("parts"))
        && ends != 1
    {
        let message = format!("deviations of parts act on one condition with a least and a greatest value, and the cases have {ends}");
        return Err(v.refuse(message, "[tolerance.assembly] with area and interference, or one condition of two columns"));
    }
    Ok(())
}

/// Columns that tolerances of parts ask for.
fn of_the_parts(needed: &mut Vec<(String, Dimension)>, parts: Option<&Parts>) {
    let Some(parts) = parts else { return };
    let area = Dimension::LENGTH.power(2);
    let of_area = parts.assembly.iter().flat_map(|a| &a.area).map(|n| (n.clone(), area));
    for (name, dimension) in parts.parts.iter().map(|p| (p.name.clone(), Dimension::LENGTH)).chain(of_area) {
        if !needed.iter().any(|n| n.0 == name) {
            needed.push((name, dimension));
        }
    }
}

fn dataset_of_cases(table: &TableView<'_>, folder: &Path) -> Result<Dataset, StudyError> {
    let at = table.require("dataset", "\"../data/table.toml\"")?;
    let path = folder.join(at.string()?);
    if !Dataset::file_of(&path).exists() {
        return Err(at.refuse(format!("no dataset at {}", path.display()), "a folder with dataset.toml, or that file").into());
    }
    Ok(Dataset::load(&path, None)?)
}

/// `test = "table-6"` or `tests = ["cases-5Hz", "cases-1Hz"]`.
fn tables(
    table: &TableView<'_>,
    other: &Dataset,
    needed: &[(String, Dimension)],
    system: &System,
) -> Result<Vec<ToleranceTable>, StudyError> {
    let (value, ids) = match table.get("tests") {
        Some(v) => (v.clone(), v.strings()?),
        None => {
            let v = table.require("test", "the id of an energy test, or tests = [...]")?;
            let id = v.string()?;
            (v, vec![id])
        }
    };
    if ids.is_empty() {
        return Err(value.refuse("no test", "the ids of energy tests").into());
    }
    let declared = match table.get("cycle") {
        Some(v) => Some(cycle(&v.table()?, system)?),
        None => None,
    };
    let one = |id: &str| -> Result<ToleranceTable, StudyError> {
        let cases = Cases::read(other, id, needed).map_err(|e| value.refuse(format!("{}: {e}", e.place()), e.accepted()))?;
        let Some(Record::Energy(energies)) = other.test(id).map(|t| &t.record) else {
            return Err(value.refuse(format!("there is no energy test `{id}`"), "an energy test").into());
        };
        let cycle = match &declared {
            Some(cycle) => cycle.clone(),
            None => of_test(energies, id, &value, table.line())?,
        };
        let stored = energies.rows.iter().any(|r| r.stored.is_some());
        let stored = stored.then(|| energies.stored.unwrap_or(crate::data::StoredEnergy::Slope));
        Ok(ToleranceTable { test: id.to_string(), cases, stored, cycle })
    };
    ids.into_iter().map(one).collect()
}

/// The cycle of a test that states its limits and its frequency, which is one for all rows.
fn of_test(energies: &EnergyTable, id: &str, value: &ValueView<'_>, line: usize) -> Result<PredictionSpec, TomlError> {
    let refuse = |what: &str| {
        value.refuse(format!("test `{id}` does not state {what}"), "the limits and the frequency in the test, or [tolerance.cycle]")
    };
    let limits = energies.limits.ok_or_else(|| refuse("the limits of its cycle"))?;
    let first = energies.rows.first().and_then(|r| r.frequency).ok_or_else(|| refuse("its frequency"))?;
    if energies.rows.iter().any(|r| r.frequency != Some(first)) {
        return Err(refuse("one frequency for all its rows"));
    }
    let quantity = Predicted::Cycle {
        quantity: CycleQuantity::Dissipated,
        at: energies.at.clone(),
        control: energies.control,
        limits,
        frequency: first,
    };
    Ok(PredictionSpec { case: id.into(), quantity, conditions: Conditions::new(), reference: None, line })
}

fn surface(table: &TableView<'_>) -> Result<Option<[String; 2]>, TomlError> {
    let Some(value) = table.get("surface") else { return Ok(None) };
    let axes: Vec<String> = value.strings()?.into_iter().map(str::to_string).collect();
    let n = axes.len();
    <[String; 2]>::try_from(axes).map(Some).map_err(|_| value.refuse(format!("a surface over {n} tolerances"), "two"))
}

/// Names of free parameters.
fn strengths(table: &TableView<'_>, system: &System) -> Result<Vec<String>, TomlError> {
    let Some(value) = table.get("strengths") else { return Ok(vec![]) };
    let free = system.free();
    let names = value.strings()?;
    match names.iter().find(|n| !free.iter().any(|f| f.name == **n)) {
        Some(name) => Err(unknown(&value, "free parameter", name, free.iter().map(|f| f.name.as_str()))),
        None => Ok(names.into_iter().map(str::to_string).collect()),
    }
}

/// `{ name, quantities, terms }`, with `degree` for a polynomial.
fn library(table: &TableView<'_>) -> Result<Library, TomlError> {
    table.only(&["name", "quantities", "terms", "degree"])?;
    let value = table.require("quantities", "a list of quantities of the rows")?;
    let quantities: Vec<String> = value.strings()?.into_iter().map(str::to_string).collect();
    if quantities.is_empty() {
        return Err(value.refuse("no quantity for the laws", "at least one"));
    }
    let degree = table.optional("degree", |v| v.integer(1, MOST_DEGREE))?;
    let forms = degree.map_or(Forms::Elementary, |d| Forms::Polynomial(d as u8));
    let most = table.optional("terms", |v| v.integer(1, MOST_TERMS))?.map_or(2, |n| n as usize);
    Ok(Library { name: table.string("name")?.to_string(), quantities, forms, most })
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
