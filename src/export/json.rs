//! JSON: the whole set.

use super::{ExportError, Exported, Exporter, Source};

pub(super) struct Json;

impl Exporter for Json {
    fn name(&self) -> &'static str {
        "json"
    }
    fn files(&self, of: &Source) -> Result<Exported, ExportError> {
        let text = serde_json::to_string_pretty(of.set).map_err(|e| ExportError { format: "json", reason: e.to_string() })?;
        Ok(vec![("calibrated.json".into(), (text + "\n").into_bytes())].into())
    }
}
