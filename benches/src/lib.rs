//! The work that the benches and the peers' scripts share: a chain of flexible bodies along a helix.

pub mod chain;
pub mod fit;
pub mod march;
