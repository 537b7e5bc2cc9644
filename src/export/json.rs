//! JSON: the whole set.

use super::{CalibratedSet, ExportError, Exporter};

pub(super) struct Json;

impl Exporter for Json {
    fn name(&self) -> &'static str {
        "json"
    }
    fn files(&self, set: &CalibratedSet) -> Result<Vec<(String, Vec<u8>)>, ExportError> {
        let text = serde_json::to_string_pretty(set).map_err(|e| ExportError { format: "json", reason: e.to_string() })?;
        Ok(vec![("calibrated.json".into(), (text + "\n").into_bytes())])
    }
}
