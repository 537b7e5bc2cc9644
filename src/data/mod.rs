//! Measurements: `dataset.toml` beside its files, read strictly, in SI.

pub mod toml_strict;
