//! JSON Schema of study.toml, for editors and scripts.
//!
//! The types below state every key of the file with its form, the parameters of `[[effect]]` come from the library; [`study`] turns them into the schema. The
//! reader ([`super::Study::load`]) checks more: units, names, bounds, orders. A test holds both to the same keys (`tests/behaviour/schema.rs`).

// The fields are read by the derive alone.
#![allow(dead_code)]

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema, schema_for};
use serde_json::{Map, Value, json};

use crate::data::schema::Quantity;
use crate::diagnose::STATED;
use crate::effect::{Info, LIBRARY, Role};

mod asked;

use super::effects::is_formula;
use super::{formula, levels};
use asked::{Prediction, Tolerance};

/// Schema of study.toml.
pub fn study() -> Schema {
    schema_for!(StudyFile)
}

/// study.toml.
#[derive(JsonSchema)]
#[schemars(title = "study.toml", deny_unknown_fields)]
struct StudyFile {
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    schema: u8,
    /// Title.
    title: Option<String>,
    /// Folder with dataset.toml, or that file, relative to study.toml.
    dataset: String,
    /// Where the raw files lie, if not where dataset.toml says.
    folder: Option<String>,
    /// What the model assumes.
    assumptions: Option<Vec<String>>,
    /// Which tests are kept back; every other one is fitted.
    split: Option<Split>,
    /// Rows of modal tables that are compared with nothing.
    leave_out: Option<Vec<LeaveOut>>,
    /// Modal tests whose natural frequencies are compared as shifts against those of another.
    shift: Option<Vec<ShiftOf>>,
    /// How the model is fitted.
    fit: Option<Fit>,
    /// What the search for missing effects may try.
    search: Option<Search>,
    /// Bodies of a linear model.
    body: Option<Vec<Body>>,
    /// The curve of the parts' centres, arc after arc.
    arc: Option<Vec<Arc>>,
    /// Rigid parts that turn far.
    part: Option<Vec<Part>>,
    /// Joints to the ground.
    joint: Option<Vec<Joint>>,
    /// Points that are loaded and measured.
    point: Option<Vec<Point>>,
    /// Connectors between bodies or parts.
    connector: Option<Vec<Connector>>,
    /// Loads that stay.
    load: Option<Vec<Load>>,
    /// The laws of the model.
    effect: Option<Vec<Effect>>,
    /// Orders of free parameters.
    order: Option<Vec<Order>>,
    /// What `predict` computes.
    prediction: Option<Vec<Prediction>>,
    /// Tolerance cases and tolerances of parts.
    tolerance: Option<Tolerance>,
    /// Studies that the program wrote of this one; the last is the answer.
    rungs: Option<Vec<String>>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Split {
    /// Tests that are fitted by the ladder and not by `fit`.
    select: Option<Vec<String>>,
    /// Tests that are read once, at the end.
    held_out: Option<Vec<String>>,
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum ModalQuantity {
    NaturalFrequency,
    ModalDamping,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ShiftOf {
    /// Id of a modal test.
    test: String,
    /// Id of the test it shifts against.
    against: String,
    /// Relative deviation of a shift.
    sigma: Quantity,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct LeaveOut {
    /// Id of a modal test.
    test: String,
    /// Column.
    quantity: ModalQuantity,
    /// Number of the mode.
    mode: u32,
    /// Why.
    why: String,
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum Loss {
    Squares,
    Huber,
    SoftL1,
    Cauchy,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Fit {
    /// Loss.
    loss: Option<Loss>,
    /// Width of the loss in units of the noise.
    width: Option<f64>,
    /// Iterations at most.
    max_iterations: Option<u32>,
    /// Starting points.
    starts: Option<u32>,
    /// Points of a loop that are compared, at most.
    #[schemars(range(min = 16, max = 400))]
    points: Option<u32>,
    /// Part of |H| that the model may be off by itself.
    frf_tolerance: Option<f64>,
}

struct Search;

impl JsonSchema for Search {
    fn schema_name() -> Cow<'static, str> {
        "Search".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let strings = json!({ "type": "array", "items": { "type": "string" } });
        let mut keys = Map::new();
        keys.insert("effects".into(), strings.clone());
        keys.insert("places".into(), strings);
        keys.insert("max_added".into(), json!({ "type": "integer", "minimum": 0 }));
        keys.insert("slack".into(), json!({ "type": "boolean" }));
        for stated in &STATED {
            keys.insert(stated.key.into(), json!({ "type": "number", "minimum": stated.range.0, "maximum": stated.range.1 }));
        }
        json_schema!({ "type": "object", "properties": keys, "additionalProperties": false })
    }
}

/// A parameter: `"20 N/mm"`, or a table with start, bounds and prior.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Parameter {
    /// Start value; free unless the parameter is a setting.
    Start(Quantity),
    /// Start, bounds, prior.
    Table(Box<ParameterTable>),
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ParameterTable {
    /// Start value.
    start: Quantity,
    /// Lower bound.
    min: Option<Quantity>,
    /// Upper bound.
    max: Option<Quantity>,
    /// Normal prior.
    prior: Option<Prior>,
    /// Not identified.
    fixed: Option<bool>,
    /// A setting that is identified.
    free: Option<bool>,
    /// Relative width within which members of the group may deviate.
    slack: Option<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Prior {
    /// Mean.
    mean: Quantity,
    /// Standard deviation.
    sigma: Quantity,
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum Axis {
    X,
    Y,
    Z,
    Theta,
    Phi,
    Psi,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Body {
    /// Name.
    name: String,
    /// Does not move.
    fixed: Option<bool>,
    /// Axes it moves along.
    free: Option<Vec<Axis>>,
    /// Mass; with bounds it is fitted.
    mass: Option<Parameter>,
    /// Moment of inertia.
    inertia: Option<Quantity>,
    /// Number of bodies `name1`, `name2`, ...
    count: Option<u32>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Arc {
    /// Radius.
    radius: Option<Quantity>,
    /// Angle; positive to the left.
    angle: Option<Quantity>,
    /// Length of a straight piece.
    length: Option<Quantity>,
    /// Start of the curve.
    start: Option<Vec<Quantity>>,
    /// Direction at the start, from x towards y.
    heading: Option<Quantity>,
}

/// `"start"` or `"end"` of the arcs, or coordinates.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Place {
    End(End),
    Coordinates(Vec<Quantity>),
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum End {
    Start,
    End,
}

#[derive(JsonSchema)]
#[schemars(untagged)]
enum Count {
    /// Parts of equal length.
    Number(u32),
    /// `"modal basis"`: as many as the highest frequency asks for.
    Basis(String),
}

#[derive(JsonSchema)]
#[schemars(untagged)]
enum Inertia {
    /// The same about every axis.
    One(Quantity),
    /// About the three axes of the part.
    Three(Vec<Quantity>),
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Section {
    /// Width.
    width: Quantity,
    /// Thickness.
    thickness: Quantity,
    /// Density.
    density: Quantity,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Part {
    /// Name.
    name: String,
    /// Number of parts along the arcs.
    count: Option<Count>,
    /// Cross section, which gives mass and inertia.
    section: Option<Section>,
    /// Young's modulus, for a modal basis.
    modulus: Option<Quantity>,
    /// Highest frequency of interest, for a modal basis.
    highest: Option<Quantity>,
    /// Place of a part off the arcs.
    at: Option<Place>,
    /// Axes it moves along.
    free: Option<Vec<Axis>>,
    /// Does not move.
    fixed: Option<bool>,
    /// Mass.
    mass: Option<Quantity>,
    /// Moments of inertia.
    inertia: Option<Inertia>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Joint {
    /// Part that is held.
    part: String,
    /// Axes that stay free.
    free: Vec<Axis>,
    /// Where.
    at: Option<Place>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Point {
    /// Name, which the part takes.
    name: String,
    /// Part it lies on; the nearest where it is left out.
    part: Option<String>,
    /// Where.
    at: Place,
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum Attached {
    Loaded,
    Unloaded,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Connector {
    /// Name.
    name: String,
    /// Body or part it starts at.
    from: Option<String>,
    /// Body or part it ends at.
    to: Option<String>,
    /// Bodies or parts with a count, joined one to the next.
    chain: Option<String>,
    /// Where its components are measured.
    at: Option<Place>,
    /// Direction of its y axis.
    heading: Option<Quantity>,
    /// Tests in which it is not there.
    absent: Option<Vec<String>>,
    /// When it is attached.
    attached: Option<Attached>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Load {
    /// Body or part and axis.
    at: String,
    /// The load.
    force: Option<Quantity>,
    /// Condition of the tests that states it.
    condition: Option<String>,
    /// Factor on the condition.
    factor: Option<f64>,
    /// Values passed through before.
    via: Option<Vec<Quantity>>,
    /// Steps from one value to the next.
    steps: Option<u32>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Order {
    /// Names of free parameters, rising.
    order: Vec<String>,
    /// Least difference.
    gap: Option<Quantity>,
}

/// One `[[effect]]`: the keys of its law.
struct Effect;

impl JsonSchema for Effect {
    fn schema_name() -> Cow<'static, str> {
        "Effect".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let parameter = generator.subschema_for::<Parameter>().to_value();
        let names: Vec<&str> = LIBRARY.iter().map(|e| e.info().name).collect();
        let one = |e: &crate::effect::Effect| {
            let mut keys = keys(e.info(), &parameter);
            if is_formula(e) {
                keys.extend(formula::KEYS.iter().map(|k| (k.to_string(), json!(true))));
            }
            // The parameters of a formula have names of its author.
            let rest = if is_formula(e) { parameter.clone() } else { json!(false) };
            json!({
                "if": { "properties": { "effect": { "const": e.info().name } } },
                "then": { "description": e.info().claim, "properties": keys, "additionalProperties": rest }
            })
        };
        let laws: Vec<Value> = LIBRARY.iter().map(one).collect();
        json_schema!({
            "type": "object",
            "required": ["effect", "at"],
            "properties": { "effect": { "type": "string", "enum": names } },
            "allOf": laws
        })
    }
}

/// Keys of one law.
fn keys(info: &Info, parameter: &Value) -> Map<String, Value> {
    let places = json!({ "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" }, "minItems": 1 }] });
    let mut keys = Map::new();
    keys.insert("effect".into(), json!({ "const": info.name }));
    keys.insert("at".into(), places);
    keys.extend(
        levels::KEYS.iter().map(|k| (k.to_string(), if *k == "only" { json!({ "type": "object" }) } else { json!({ "type": "string" }) })),
    );
    if info.role == Role::Coefficient {
        keys.insert("of".into(), json!({ "type": "string", "description": "effect.parameter at the place" }));
        keys.insert("condition".into(), json!({ "type": "string", "description": "name of a condition of the tests" }));
        keys.insert(
            "reference".into(),
            json!({ "type": ["string", "number"], "description": "value of the condition at which the factor is 1" }),
        );
    }
    for p in info.params {
        let described = json!({ "description": format!("{} ({})", p.doc, p.sign.word()), "allOf": [parameter] });
        keys.insert(p.name.into(), described);
    }
    keys
}
