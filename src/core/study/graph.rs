//! `[[body]]` and `[[connector]]`: the graph as declared, and the [`Model`] it expands to.

use std::collections::HashMap;

use crate::data::toml_strict::{TableView, TomlError, TomlProblem, ValueView, nearest};
use crate::explain::Explain;
use crate::limits;
use crate::model::{Axis, Body, Connector, Level, Load, Model, ModelError};
use crate::units::{Dimension, Quantity};

use super::space;

/// The body that need not be declared.
pub(super) const GROUND: &str = "ground";

/// A `[[body]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct BodySpec {
    /// Name; with `count` the stem of `name1` ... `name<count>`.
    pub name: String,
    /// Held.
    pub fixed: bool,
    /// Free axes.
    pub free: Vec<Axis>,
    /// Mass; none is massless.
    pub mass: Option<Quantity>,
    /// Least and greatest mass [kg], where it is fitted.
    pub mass_range: Option<(f64, f64)>,
    /// Relative width within which it may deviate.
    pub mass_slack: Option<f64>,
    /// Moment of inertia; none is massless in rotation.
    pub inertia: Option<Quantity>,
    /// How many equal bodies it stands for.
    pub count: Option<usize>,
}

/// What a connector joins.
#[derive(Clone, Debug, PartialEq)]
pub enum Ends {
    /// Two bodies.
    Between {
        /// Name of the body it comes from.
        from: String,
        /// Name of the body it goes to.
        to: String,
    },
    /// Each of the bodies of a `count` to the next: `name1` ... `name<count - 1>`.
    Chain(String),
}

/// A `[[connector]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectorSpec {
    /// Name, or stem of a chain.
    pub name: String,
    /// What it joins.
    pub ends: Ends,
}

/// The graph as declared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GraphSpec {
    /// Bodies.
    pub bodies: Vec<BodySpec>,
    /// Connectors.
    pub connectors: Vec<ConnectorSpec>,
    /// Tables that are kept as they stand: arcs, parts, joints, points and connectors of a spatial model, and loads.
    pub tables: Vec<String>,
}

/// Names that have been given, with what they name and their line.
#[derive(Default)]
pub(super) struct Names(HashMap<String, (&'static str, usize)>);

impl Names {
    pub fn add(&mut self, what: &'static str, name: String, value: &ValueView<'_>) -> Result<(), TomlError> {
        if let Some((other, first_line)) = self.0.get(&name) {
            // A body and a connector of one name would make `name.x` mean two things.
            let what = if *other == what { what.to_string() } else { format!("{other} and {what}") };
            return Err(value.error(TomlProblem::Duplicate { what, id: name, first_line: *first_line }));
        }
        self.0.insert(name, (what, value.line()));
        Ok(())
    }
}

/// Reads the graph and expands it.
pub(super) fn read(root: &TableView<'_>) -> Result<(GraphSpec, Model), TomlError> {
    let mut spec = GraphSpec::default();
    let mut model = if space::TABLES.iter().any(|t| root.has(t)) {
        for key in space::TABLES.iter().chain(&["connector"]) {
            spec.tables.extend(root.tables(key)?.iter().map(|t| t.to_toml(key)));
        }
        space::read(root)?
    } else {
        bodies(root, &mut spec)?
    };
    spec.tables.extend(root.tables("load")?.iter().map(|t| t.to_toml("load")));
    model.loads = loads(root, &model)?;
    Ok((spec, model))
}

/// Reads every `[[load]]`.
fn loads(root: &TableView<'_>, model: &Model) -> Result<Vec<Load>, TomlError> {
    let mut loads = Vec::new();
    for table in root.tables("load")? {
        table.only(&["at", "force", "condition", "factor", "via", "steps"])?;
        let value = table.require("at", "a body or part and axis, such as \"P.x\"")?;
        let name = value.string()?;
        let dof = model.dof(name).ok_or_else(|| {
            let e = ModelError::no_such("degree of freedom", name, (0..model.dofs.len()).map(|d| model.dof_name(d)));
            value.refuse(e.to_string(), e.accepted())
        })?;
        let dimension = if model.dofs[dof].axis.rotational() { Dimension::MOMENT } else { Dimension::FORCE };
        let mut path = Vec::new();
        if let Some(via) = table.get("via") {
            for v in via.list()? {
                path.push(Level::Value(v.quantity(dimension)?.value));
            }
        }
        let factor = table.optional("factor", |v| v.number())?;
        path.push(match (table.get("force"), table.get("condition")) {
            (Some(v), None) => {
                if let Some(f) = table.get("factor") {
                    return Err(f.refuse("a factor belongs to a condition", "condition and factor, or force with its sign"));
                }
                Level::Value(v.quantity(dimension)?.value)
            }
            (None, Some(v)) => Level::Condition(v.string()?.to_string(), factor.unwrap_or(1.0)),
            _ => return Err(table.refuse("the load is not there, or given twice", "force = \"80 N\", or condition = \"load\"")),
        });
        let steps = table.optional("steps", |v| v.integer(1, 10_000))?.map_or(LOAD_STEPS, |n| n as usize);
        loads.push(Load { dof, path, steps });
    }
    Ok(loads)
}

/// Steps of a loading path from one value to the next.
const LOAD_STEPS: usize = 10;

fn bodies(root: &TableView<'_>, spec: &mut GraphSpec) -> Result<Model, TomlError> {
    let mut names = Names::default();
    let (mut bodies, mut tables) = (Vec::new(), HashMap::new());
    root.require("body", "[[body]] with name and free, or fixed = true")?.list()?;
    for table in root.tables("body")? {
        let body = body(&table)?;
        let value = table.require("name", "a name")?;
        if bodies.len() + body.count.unwrap_or(1) > limits::BODIES {
            let accepted = format!("{} bodies in all, or fewer", limits::BODIES);
            return Err(table.get("count").unwrap_or(value).refuse("the model has too many bodies", accepted));
        }
        for name in expand(&body.name, body.count) {
            names.add("body", name.clone(), &value)?;
            tables.insert(name.clone(), table.clone());
            let si = |q: &Option<Quantity>| q.as_ref().map_or(0.0, |q| q.value);
            bodies.push(Body { name, mass: si(&body.mass), inertia: si(&body.inertia), free: body.free.clone() });
        }
        spec.bodies.push(body);
    }
    let mut index = bodies.iter().enumerate().map(|(k, b): (usize, &Body)| (b.name.clone(), k)).collect();
    let mut connectors = Vec::new();
    root.require("connector", "[[connector]] with name, from and to, or name and chain")?.list()?;
    for table in root.tables("connector")? {
        let connector = connector(&table)?;
        let value = table.require("name", "a name")?;
        for (name, from, to) in joins(&table, &connector, spec, &mut bodies, &mut index)? {
            names.add("connector", name.clone(), &value)?;
            tables.insert(name.clone(), table.clone());
            connectors.push(Connector { name, from, to });
        }
        spec.connectors.push(connector);
    }
    Model::new(bodies, connectors).map_err(|e| {
        let place = e.place();
        let name = place.split('.').next().unwrap_or_default();
        tables.get(name).unwrap_or(root).refuse(e.to_string(), e.accepted())
    })
}

fn expand(name: &str, count: Option<usize>) -> Vec<String> {
    count.map_or_else(|| vec![name.to_string()], |n| (1..=n).map(|j| format!("{name}{j}")).collect())
}

/// A name without a dot, which separates name and axis.
pub(super) fn name(table: &TableView<'_>) -> Result<String, TomlError> {
    let value = table.require("name", "a name")?;
    let name = value.name()?;
    if name.contains(['.', ':']) {
        return Err(value.refuse(format!("`{name}` cannot be a name in the model"), "letters, digits, _ and -"));
    }
    Ok(name.to_string())
}

fn body(table: &TableView<'_>) -> Result<BodySpec, TomlError> {
    table.only(&["name", "fixed", "free", "mass", "inertia", "count"])?;
    let name = name(table)?;
    let fixed = table.optional("fixed", |v| v.bool())?.unwrap_or(false);
    let positive = |key: &str, dimension| {
        table.optional(key, |v| {
            let q = v.quantity(dimension)?;
            if q.value > 0.0 {
                Ok(q)
            } else {
                Err(v.refuse(format!("the {key} of body `{name}` is {q}"), "a value above 0, or no key for none"))
            }
        })
    };
    let inertia = positive("inertia", Dimension::INERTIA)?;
    let (mut mass_range, mut mass_slack) = (None, None);
    let mass = match table.get("mass") {
        Some(value) if value.is_table() => {
            let spec = value.parameter(Dimension::MASS, &[])?;
            let least = spec.min.unwrap_or(if spec.max.is_some() { 0.0 } else { spec.start.value });
            if spec.start.value <= 0.0 || least < 0.0 {
                return Err(value.refuse(format!("the mass of body `{name}` is {}", spec.start), "a start above 0 and a min of 0 or more"));
            }
            if spec.prior.is_some() || spec.fixed {
                return Err(value.refuse("a mass has neither prior nor fixed", "start, min, max, slack"));
            }
            if spec.min.is_some() || spec.max.is_some() {
                mass_range = Some((least, spec.max.unwrap_or(f64::INFINITY)));
            }
            mass_slack = spec.slack;
            Some(spec.start)
        }
        _ => positive("mass", Dimension::MASS)?,
    };
    let axes: Vec<(&str, Axis)> = Axis::ALL.into_iter().map(|a| (a.name(), a)).collect();
    let mut free = Vec::new();
    match table.get("free") {
        Some(value) if fixed => {
            return Err(value.refuse(format!("body `{name}` is fixed and has free axes"), "one of fixed = true and free"));
        }
        Some(value) => {
            for v in value.list()? {
                let axis = v.word("axis", &axes)?;
                if free.contains(&axis) {
                    return Err(v.refuse(format!("the axis `{}` stands twice", axis.name()), "each axis once"));
                }
                free.push(axis);
            }
            if free.is_empty() {
                return Err(value.refuse(format!("body `{name}` has no free axis"), "free = [\"x\"], or fixed = true"));
            }
        }
        None if !fixed => {
            return Err(table.error(TomlProblem::MissingKey { key: "free".into(), accepted: "free = [\"x\"], or fixed = true".into() }));
        }
        None => {}
    }
    let count = table.optional("count", |v| v.integer(1, limits::COUNT))?.map(|n| n as usize);
    Ok(BodySpec { name, fixed, free, mass, mass_range, mass_slack, inertia, count })
}

fn connector(table: &TableView<'_>) -> Result<ConnectorSpec, TomlError> {
    table.only(&["name", "from", "to", "chain"])?;
    let name = name(table)?;
    let ends = match table.get("chain") {
        Some(chain) => {
            if let Some(v) = table.get("from").or(table.get("to")) {
                return Err(v.refuse(format!("connector `{name}` is a chain and has an end"), "chain, or from and to"));
            }
            Ends::Chain(chain.name()?.to_string())
        }
        None => {
            let end = |key: &str| table.require(key, "the name of a body (or chain = \"...\")")?.name().map(str::to_string);
            Ends::Between { from: end("from")?, to: end("to")? }
        }
    };
    Ok(ConnectorSpec { name, ends })
}

/// A body that is not there, with the nearest that is.
pub(super) fn unknown_body(what: &str, name: &str, known: Vec<String>) -> TomlProblem {
    let nearest = nearest(name, known.iter().map(String::as_str));
    TomlProblem::UnknownWord { what: what.into(), found: name.into(), nearest, accepted: known }
}

/// The connectors one declaration stands for: name, index of `from`, index of `to`; `index` holds every body's by its name. Declares `ground` where it is named and missing.
fn joins(
    table: &TableView<'_>,
    connector: &ConnectorSpec,
    spec: &GraphSpec,
    bodies: &mut Vec<Body>,
    index: &mut HashMap<String, usize>,
) -> Result<Vec<(String, usize, usize)>, TomlError> {
    let unknown = |key: &str, name: &str, known: Vec<String>| -> TomlError {
        let problem = unknown_body("body", name, known);
        table.get(key).map_or_else(|| table.error(problem.clone()), |v| v.error(problem.clone()))
    };
    match &connector.ends {
        Ends::Between { from, to } => {
            let mut end = |key: &str, name: &str| {
                if let Some(b) = index.get(name) {
                    return Ok(*b);
                }
                if name == GROUND {
                    index.insert(GROUND.into(), bodies.len());
                    bodies.push(Body { name: GROUND.into(), mass: 0.0, inertia: 0.0, free: vec![] });
                    return Ok(bodies.len() - 1);
                }
                let known = bodies.iter().map(|b| b.name.clone()).chain([GROUND.to_string()]).collect();
                Err(unknown(key, name, known))
            };
            let (f, t) = (end("from", from)?, end("to", to)?);
            if f == t {
                let e = ModelError::invalid(
                    &connector.name,
                    format!("connector `{}` joins body `{to}` to itself", connector.name),
                    "two different bodies",
                );
                return Err(table.refuse(e.to_string(), e.accepted()));
            }
            Ok(vec![(connector.name.clone(), f, t)])
        }
        Ends::Chain(stem) => {
            let counted: Vec<String> = spec.bodies.iter().filter(|b| b.count.is_some()).map(|b| b.name.clone()).collect();
            let refuse = |message: String, accepted: &str| {
                table.get("chain").map_or_else(|| table.refuse(&message, accepted), |v| v.refuse(&message, accepted))
            };
            let Some(body) = spec.bodies.iter().find(|b| b.name == *stem) else { return Err(unknown("chain", stem, counted)) };
            let Some(count) = body.count else {
                return Err(refuse(format!("body `{stem}` has no count: there is nothing to chain"), "the name of a body with count"));
            };
            if count < 2 {
                return Err(refuse(
                    format!("body `{stem}` has count {count}: there is nothing to chain"),
                    "a body with a count of 2 or more",
                ));
            }
            let Some(&first) = index.get(&format!("{stem}1")) else {
                return Err(unknown("chain", stem, counted));
            };
            Ok((1..count).map(|j| (format!("{}{j}", connector.name), first + j - 1, first + j)).collect())
        }
    }
}

/// The `[[body]]` that declares a body of the expanded graph.
pub(super) fn table_of<'a>(root: &TableView<'a>, spec: &GraphSpec, body: &str) -> Option<TableView<'a>> {
    let is = |b: &BodySpec| match b.count {
        Some(count) => body.strip_prefix(&b.name).and_then(|n| n.parse().ok()).is_some_and(|n: usize| (1..=count).contains(&n)),
        None => b.name == body,
    };
    let index = spec.bodies.iter().position(is)?;
    root.tables("body").ok()?.into_iter().nth(index)
}

impl GraphSpec {
    /// Bodies whose mass a study states in full, with what it says of it.
    pub(super) fn weighed(&self) -> impl Iterator<Item = (String, &BodySpec)> {
        self.bodies.iter().filter(|b| b.mass.is_some()).flat_map(|b| expand(&b.name, b.count).into_iter().map(move |n| (n, b)))
    }

    /// Relative width within which the mass of each body may deviate, where the study states one.
    pub fn mass_slack(&self) -> Vec<(String, f64)> {
        self.weighed().filter_map(|(name, b)| Some((name, b.mass_slack?))).collect()
    }
}
