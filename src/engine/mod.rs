//! Engines: what a model does, computed at a cost linear in its parts.

pub mod blocktri;
