//! JSON Schema of dataset.toml, for editors and scripts.
//!
//! The types below state every key of the file with its form; [`dataset`] turns them into the schema. The reader ([`super::Dataset::load`]) checks more: units,
//! places, numbers of columns. A test holds both to the same keys (`tests/behaviour/schema.rs`).

// The fields are read by the derive alone.
#![allow(dead_code)]

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema, schema_for};

use super::{Control, FrfQuantity, channel::Role};

/// Schema of dataset.toml.
pub fn dataset() -> Schema {
    schema_for!(DatasetFile)
}

/// A quantity as the files state it: text with a unit, or a plain number where it has none.
pub struct Quantity;

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        "Quantity".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number with its unit in a string, such as \"20 N/mm\"; without a unit a plain number. A standard deviation may follow: \"0.4 mm +- 0.02 mm\".",
            "type": ["string", "number"]
        })
    }
}

/// A quantity, or a table with its standard deviation.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Spread {
    /// `"0.3 mm"` or `"0.3 mm +- 0.01 mm"`.
    Plain(Quantity),
    /// `{ value = "0.3 mm", sigma = "0.01 mm" }`.
    Table(SpreadTable),
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct SpreadTable {
    /// The quantity.
    value: Quantity,
    /// Its standard deviation.
    sigma: Option<Quantity>,
}

/// Conditions by name: frequency, load, i, A, temperature and others.
#[derive(JsonSchema)]
pub struct Conditions(BTreeMap<String, Spread>);

/// One of a list of words.
macro_rules! words {
    ($name:ident, $words:expr, $doc:literal) => {
        struct $name;
        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                let words: Vec<&str> = $words.iter().map(|w| w.0).collect();
                json_schema!({ "description": $doc, "type": "string", "enum": words })
            }
        }
    };
}

words!(ControlWord, Control::WORDS, "What the rig holds: force or displacement.");
words!(RecordControlWord, Control::OF_RECORDS, "What the rig holds: force or displacement; free: nothing, as in a decay.");
words!(FrfWord, FrfQuantity::WORDS, "Response over force.");
words!(RoleWord, Role::WORDS, "What a channel measures.");

/// dataset.toml.
#[derive(JsonSchema)]
#[schemars(title = "dataset.toml", deny_unknown_fields)]
struct DatasetFile {
    /// Version of the format: 1.
    #[schemars(range(min = 1, max = 1))]
    schema: u8,
    /// Folder of the raw files, relative to dataset.toml.
    folder: Option<String>,
    /// Title.
    title: Option<String>,
    /// Where the data come from.
    source: Option<String>,
    /// Licence of the data.
    licence: Option<String>,
    /// Second spelling of `licence`.
    license: Option<String>,
    /// What is assumed of the data.
    assumptions: Option<Vec<String>>,
    /// Limits of the bench.
    rig: Option<Rig>,
    /// Tolerances of the instruments.
    instruments: Option<Instruments>,
    /// The tests.
    #[schemars(length(min = 1))]
    test: Vec<Test>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Rig {
    /// Greatest force.
    force_max: Option<Quantity>,
    /// Greatest displacement.
    displacement_max: Option<Quantity>,
    /// Greatest velocity.
    velocity_max: Option<Quantity>,
    /// Greatest acceleration.
    acceleration_max: Option<Quantity>,
    /// Lowest frequency.
    frequency_min: Option<Quantity>,
    /// Highest frequency.
    frequency_max: Option<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Instruments {
    /// Standard deviation of a gain about 1.
    gain: Option<Quantity>,
    /// Offset, a part of the amplitude (that of a sine of the same rms, its mean with it).
    offset: Option<Quantity>,
    /// Delay of a channel.
    delay: Option<Quantity>,
    /// Quadratic and cubic part of a sensor's characteristic, a part of the largest reading.
    linearity: Option<Quantity>,
}

/// One test.
#[derive(JsonSchema)]
#[schemars(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Test {
    /// A periodic test.
    Cycle {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// CSV, Parquet, universal or MATLAB file.
        file: String,
        /// What the rig holds.
        control: ControlWord,
        /// Cycles at the start that are not used.
        discard_cycles: Option<u32>,
        /// Cycles that are used, such as "3-8".
        cycles: Option<String>,
        /// Noise of channels without a sigma, a part of their rms.
        noise: Option<Quantity>,
        /// Channels of the file.
        channels: Vec<Channel>,
    },
    /// A whole history.
    Transient {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// CSV, Parquet, universal or MATLAB file.
        file: String,
        /// What the rig holds.
        control: Option<RecordControlWord>,
        /// Noise of channels without a sigma, a part of their rms.
        noise: Option<Quantity>,
        /// Channels of the file.
        channels: Vec<Channel>,
    },
    /// A frequency response, or the histories it is estimated from.
    Frf {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// CSV, Parquet, universal or MATLAB file.
        file: String,
        /// Place of the force.
        excite: String,
        /// Place of the response.
        respond: String,
        /// Response over force.
        quantity: FrfWord,
        /// Peak force of every line; small signal where nothing is said of the excitation.
        excitation: Option<Quantity>,
        /// Peak response that every line was held at, in the unit of what answers.
        response_amplitude: Option<Quantity>,
        /// Noise, a part of |H|.
        noise: Option<Quantity>,
        /// Channels of the file.
        channels: Vec<Channel>,
        /// How the response is estimated from histories.
        estimate: Option<Estimate>,
        /// Mass between load cell and structure.
        load_cell_mass: Option<Quantity>,
    },
    /// Natural frequencies and damping ratios.
    Modal {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// File of the table; `rows` in its place.
        file: Option<String>,
        /// Columns of the file.
        channels: Option<Vec<Channel>>,
        /// The rows themselves.
        rows: Option<Vec<ModalRow>>,
        /// Noise of values without a sigma, a part of the value.
        noise: Option<Quantity>,
        /// The file holds responses to a broad excitation that was not measured; the modes are identified from them.
        output_only: Option<bool>,
        /// Lower and upper end of the band in which modes are identified.
        band: Option<[Quantity; 2]>,
        /// Number of each mode identified, in the order of their frequencies; 1, 2, ... where it is left out.
        modes: Option<Vec<u32>>,
    },
    /// Natural frequency and damping ratio of a mode over its amplitude.
    Backbone {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// File of the table; `rows` in its place.
        file: Option<String>,
        /// Columns of the file.
        channels: Option<Vec<Channel>>,
        /// The rows themselves.
        rows: Option<Vec<BackboneRow>>,
        /// Noise of values without a sigma, a part of the value.
        noise: Option<Quantity>,
        /// Place of the amplitude.
        at: String,
        /// Number of the mode at small amplitude; the one nearest to the first row's frequency where it is left out.
        #[schemars(range(min = 1))]
        mode: Option<u32>,
    },
    /// Energies per cycle.
    Energy {
        /// Name of the test.
        id: String,
        /// In words.
        description: Option<String>,
        /// Conditions.
        conditions: Option<Conditions>,
        /// Connectors to the ground that hold the structure in this test; all of them where it is left out, none of them in a free test: [].
        supports: Option<Vec<String>>,
        /// A function of a universal file.
        record: Option<String>,
        /// Whether units in the file are held against those declared.
        header_units: Option<HeaderUnits>,
        /// File of the table; `rows` in its place.
        file: Option<String>,
        /// Columns of the file.
        channels: Option<Vec<Channel>>,
        /// The rows themselves.
        rows: Option<Vec<EnergyRow>>,
        /// Noise of values without a sigma, a part of the value.
        noise: Option<Quantity>,
        /// Place that is driven.
        at: String,
        /// What the rig holds.
        control: ControlWord,
        /// What W_s was evaluated as.
        #[schemars(rename = "W_s_reading")]
        reading: Option<Reading>,
        /// Least force of the cycle.
        force_min: Option<Quantity>,
        /// Greatest force of the cycle.
        force_max: Option<Quantity>,
        /// Least displacement of the cycle.
        displacement_min: Option<Quantity>,
        /// Greatest displacement of the cycle.
        displacement_max: Option<Quantity>,
        /// Amplitude, in place of the limits.
        amplitude: Option<Quantity>,
        /// Mean beside the amplitude.
        mean: Option<Quantity>,
    },
}

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum HeaderUnits {
    Ignore,
    Check,
}

/// Readings of the equivalent elastic energy.
#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
pub enum Reading {
    Slope,
    Product,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Estimate {
    /// H1, H2 or Hv.
    method: Option<String>,
    /// hann, none, hammer.
    window: Option<String>,
    /// Length of a block, such as "2 s".
    block: Quantity,
    /// Overlap of blocks, 0 to 0.9.
    #[schemars(range(min = 0.0, max = 0.9))]
    overlap: Option<f64>,
    /// Force at which the channel overloads.
    overload_force: Option<Quantity>,
    /// Response at which the channel overloads.
    overload_response: Option<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Channel {
    /// What it measures.
    role: RoleWord,
    /// Column of the file.
    column: Option<String>,
    /// Unit of the column.
    unit: Option<String>,
    /// Place, such as "c1.x".
    at: Option<String>,
    /// Whether it drives the test.
    input: Option<bool>,
    /// Averages behind a coherence.
    averages: Option<u32>,
    /// Standard deviation of a sample, or a part of the rms.
    sigma: Option<Quantity>,
    /// Column with the standard deviation of each row.
    sigma_column: Option<String>,
    /// Factor; -1 turns the channel.
    scale: Option<f64>,
    /// Added after the scale.
    offset: Option<Quantity>,
    /// Whether the mean is taken off.
    centre: Option<bool>,
    /// Of the time: first instant that is used.
    from: Option<Quantity>,
    /// Of the time: last instant that is used.
    to: Option<Quantity>,
    /// Of the time: sampling rate, in place of a column.
    rate: Option<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ModalRow {
    /// Number of the mode, from 1.
    mode: u32,
    /// Natural frequency.
    frequency: Quantity,
    /// Its standard deviation.
    sigma_frequency: Option<Quantity>,
    /// Damping ratio.
    damping: Option<Quantity>,
    /// Its standard deviation.
    sigma_damping: Option<Quantity>,
    /// Family of shapes: bending, torsion.
    family: Option<String>,
    /// In words.
    description: Option<String>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct BackboneRow {
    /// First harmonic (peak) of the displacement at the place.
    amplitude: Quantity,
    /// Natural frequency.
    frequency: Option<Quantity>,
    /// Its standard deviation.
    sigma_frequency: Option<Quantity>,
    /// Damping ratio.
    damping: Option<Quantity>,
    /// Its standard deviation.
    sigma_damping: Option<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct EnergyRow {
    /// Name of the case.
    case: Option<String>,
    /// Frequency of the cycle.
    frequency: Option<Quantity>,
    /// Its standard deviation.
    sigma_frequency: Option<Quantity>,
    /// Dissipated energy per cycle.
    #[schemars(rename = "W_D")]
    dissipated: Option<Quantity>,
    /// Its standard deviation.
    #[schemars(rename = "sigma_W_D")]
    sigma_dissipated: Option<Quantity>,
    /// Equivalent elastic energy.
    #[schemars(rename = "W_s")]
    stored: Option<Quantity>,
    /// Its standard deviation.
    #[schemars(rename = "sigma_W_s")]
    sigma_stored: Option<Quantity>,
    /// Loss ratio W_D / W_s.
    #[schemars(rename = "D")]
    ratio: Option<Quantity>,
    /// Its standard deviation.
    #[schemars(rename = "sigma_D")]
    sigma_ratio: Option<Quantity>,
    /// Conditions of the row.
    conditions: Option<Conditions>,
}
