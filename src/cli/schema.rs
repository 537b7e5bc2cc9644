//! `misfit schema`: JSON Schema of the files and of what the verbs print, written from the program's own types.

mod results;

use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value, json};

use super::Outcome;
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    /// study, dataset, error, or a verb; without it, all
    name: Option<String>,
    /// One JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

/// Name, what it is of, the schema.
type Entry = (&'static str, &'static str, fn() -> Schema);

const ALL: [Entry; 20] = [
    ("study", "study.toml", crate::study::schema::study),
    ("dataset", "dataset.toml", crate::data::schema::dataset),
    ("error", "what any verb prints where it could not be done", result::<results::Error>),
    ("new", "result of `misfit new`", result::<results::New>),
    ("check", "result of `misfit check`", result::<results::Check>),
    ("simulate", "result of `misfit simulate`", result::<results::Simulate>),
    ("fit", "result of `misfit fit`", result::<results::Fit>),
    ("compare", "result of `misfit compare`", result::<results::Compare>),
    ("diagnose", "result of `misfit diagnose`", result::<results::Diagnose>),
    ("scores", "result of `misfit diagnose --scores`", result::<results::Scores>),
    ("add", "result of `misfit add`", result::<results::Add>),
    ("ladder", "result of `misfit ladder`", result::<results::Ladder>),
    ("predict", "result of `misfit predict`", result::<results::Predict>),
    ("tolerance", "result of `misfit tolerance`", result::<super::tolerance::Printed>),
    ("export", "result of `misfit export`", result::<results::Export>),
    ("report", "result of `misfit report`", result::<results::Report>),
    ("trial", "result of `misfit trial`", result::<results::Trial>),
    ("campaign", "result of `misfit campaign`", result::<results::Campaign>),
    ("effects", "result of `misfit effects`", result::<results::Effects>),
    ("schema", "result of `misfit schema`", result::<results::Schemas>),
];

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let value = match &args.name {
        Some(name) => {
            let Some((_, _, schema)) = ALL.iter().find(|e| e.0 == name) else {
                let known = ALL.map(|e| e.0);
                return Err(Failure::new("cli", "schema", format!("there is no schema `{name}`"), known.join(", ")));
            };
            schema().to_value()
        }
        None => {
            let all: Map<String, Value> = ALL.iter().map(|(name, _, schema)| (name.to_string(), schema().to_value())).collect();
            json!({ "schemas": all })
        }
    };
    // People and editors want the schema itself; a list says what there is.
    let text = match &args.name {
        Some(_) => format!("{value:#}\n"),
        None => {
            let rows: Vec<Vec<String>> = ALL.iter().map(|e| vec![e.0.to_string(), e.1.to_string()]).collect();
            super::table::table(&["schema", "of"], &rows) + "`misfit schema NAME` prints one, `misfit schema --json` all.\n"
        }
    };
    Ok(Outcome { json: value, text, code: 0 })
}

/// A number that is not finite is printed as null.
#[derive(Clone)]
struct Finite;

impl Transform for Finite {
    fn transform(&mut self, schema: &mut Schema) {
        if schema.get("type") == Some(&json!("number")) {
            schema.insert("type".into(), json!(["number", "null"]));
        }
        transform_subschemas(self, schema);
    }
}

/// Schema of what is printed of `T`.
fn result<T: JsonSchema>() -> Schema {
    let mut schema = SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>();
    Finite.transform(&mut schema);
    schema
}
