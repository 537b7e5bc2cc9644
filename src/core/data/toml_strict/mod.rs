//! Strict reading of TOML: every value is asked for by key and type, every error names file, line and key path.
//!
//! Both files a user writes (`dataset.toml`, `study.toml`) are read through it. A key that nobody asked for is an error with the
//! nearest right name; nothing has a silent default that a misspelt key could fall back to.

mod error;
mod parameter;
mod tree;
mod view;

pub use error::{TomlError, TomlProblem, nearest};
pub use parameter::{ParameterSpec, PriorSpec};
pub use tree::TomlFile;
pub use view::{TableView, ValueView, unique};

#[cfg(test)]
mod tests;
