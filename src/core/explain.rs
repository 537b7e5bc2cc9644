//! What every stage's error enum can say to a person and to a script.

/// An error that names the stage it came from, the place (file, line, channel, parameter) and what would have been accepted.
///
/// Each stage has its own error enum (`data::DataError`, `model::ModelError`, ...); the command line turns any of them into
/// the `{error: {stage, where, message, accepted}}` of the JSON output. `Display` is the message.
pub trait Explain: std::error::Error {
    /// The stage in lower case: `units`, `data`, `effect`, `model`, `engine`, `residual`, `identify`, `diagnose`, `study`, ...
    fn stage(&self) -> &'static str;
    /// File and line, channel, parameter or effect the error is about; empty where there is none.
    fn place(&self) -> String;
    /// What would have been accepted instead, in one sentence.
    fn accepted(&self) -> String;
}
