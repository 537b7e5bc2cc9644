//! What a study asks for: `[[prediction]]` and `[tolerance]`.

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::data::schema::{Conditions, Quantity, Reading};
use crate::study::parts;

#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum Control {
    Force,
    Displacement,
}

struct PredictionWord;

impl JsonSchema for PredictionWord {
    fn schema_name() -> Cow<'static, str> {
        "PredictionWord".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": crate::study::prediction::words() })
    }
}

/// One `[[prediction]]`; which keys belong together is said in the handbook.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Prediction {
    /// Name.
    case: String,
    /// What is computed.
    quantity: PredictionWord,
    /// Conditions.
    conditions: Option<Conditions>,
    /// A value it is held against.
    reference: Option<Quantity>,
    /// Of a shift: the test.
    test: Option<String>,
    /// Of a shift: the test it is counted from.
    against: Option<String>,
    /// Of a shift: the modes.
    modes: Option<Vec<u32>>,
    /// Number of the mode.
    mode: Option<u32>,
    /// Place that is driven.
    at: Option<String>,
    /// What the rig holds.
    control: Option<Control>,
    /// Least force.
    force_min: Option<Quantity>,
    /// Greatest force.
    force_max: Option<Quantity>,
    /// Least displacement.
    displacement_min: Option<Quantity>,
    /// Greatest displacement.
    displacement_max: Option<Quantity>,
    /// Amplitude, in place of the limits.
    amplitude: Option<Quantity>,
    /// Mean beside the amplitude.
    mean: Option<Quantity>,
    /// What W_s is evaluated as.
    #[schemars(rename = "W_s_reading")]
    reading: Option<Reading>,
    /// Place of the force.
    excite: Option<String>,
    /// Place of the response.
    respond: Option<String>,
    /// Frequency.
    frequency: Option<Quantity>,
    /// Peak force.
    excitation: Option<Quantity>,
    /// Of a sweep: first frequency.
    frequency_from: Option<Quantity>,
    /// Of a sweep: last frequency.
    frequency_to: Option<Quantity>,
    /// Of a sweep: duration.
    duration: Option<Quantity>,
}

/// `[tolerance]`.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct Tolerance {
    /// Dataset of the cases.
    dataset: String,
    /// Energy test with the cases.
    test: Option<String>,
    /// Several such tests.
    tests: Option<Vec<String>>,
    /// Case that ratios refer to.
    reference: String,
    /// Conditions, and the columns of a case whose mean they are.
    conditions: BTreeMap<String, Vec<String>>,
    /// Values within which a law over a condition is known.
    range: Option<BTreeMap<String, Vec<Quantity>>>,
    /// Interferences with their areas, for eq. 6.
    interference: Option<Vec<Interference>>,
    /// Leaf and housing.
    housing: Option<Housing>,
    /// The cycle, where the test does not state it.
    cycle: Option<Cycle>,
    /// Free parameters that a law of the cases scales together.
    strengths: Option<Vec<String>>,
    /// Factor from the model's energies to the table's.
    scale: Option<f64>,
    /// Other factors to hold it against.
    scales: Option<Vec<f64>>,
    /// Libraries of terms.
    libraries: Option<Vec<Library>>,
    /// Permutations of the test of that law.
    #[schemars(range(min = 19, max = 100_000))]
    permutations: Option<u32>,
    /// Two tolerances that span the surface.
    surface: Option<Vec<String>>,
    /// Tolerances of the parts as distributions.
    parts: Option<Vec<parts::PartTable>>,
    /// Correlations of the parts' deviations.
    correlations: Option<Vec<parts::CorrelationTable>>,
    /// Bands that the quantities are to keep.
    bands: Option<Vec<parts::BandTable>>,
    /// Modes whose natural frequencies are computed, from 1.
    modes: Option<Vec<u32>>,
    /// How deviations of parts act on the conditions.
    assembly: Option<parts::AssemblyTable>,
    /// The loosest tolerances that keep a yield.
    synthesis: Option<parts::SynthesisTable>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Interference {
    /// Column of the interference.
    name: String,
    /// Column of the area it stands at.
    area: String,
    /// Last printed digit of either.
    resolution: Vec<Quantity>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Housing {
    /// E_s.
    leaf_modulus: Quantity,
    /// L.
    leaf_length: Quantity,
    /// Width of the leaf.
    leaf_width: Quantity,
    /// delta.
    deflection: Quantity,
    /// E_p.
    housing_modulus: Quantity,
    /// h_r.
    thickness: Quantity,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Cycle {
    /// Place that is driven.
    at: String,
    /// What the rig holds.
    control: Control,
    /// Least force.
    force_min: Option<Quantity>,
    /// Greatest force.
    force_max: Option<Quantity>,
    /// Least displacement.
    displacement_min: Option<Quantity>,
    /// Greatest displacement.
    displacement_max: Option<Quantity>,
    /// Amplitude, in place of the limits.
    amplitude: Option<Quantity>,
    /// Mean beside the amplitude.
    mean: Option<Quantity>,
    /// Frequency.
    frequency: Quantity,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Library {
    /// Name.
    name: String,
    /// Columns of the cases.
    quantities: Vec<String>,
    /// Terms of a law at most.
    terms: Option<u32>,
    /// Degree of a polynomial.
    degree: Option<u32>,
}
