//! Engines: what a model does, computed at a cost linear in its parts.
//!
//! - [`blocktri`]: ordering, factorisation and frequency sweeps of block-tridiagonal systems;
//! - [`march`]: implicit time integration with exact sensitivities;
//! - [`periodic`]: the steady cycle under a periodic drive, marched;
//! - [`equilibrium`]: the operating point under loads that stay;
//! - [`frf`]: receptances and their sensitivities about rest;
//! - [`harmonic`]: receptances at a declared excitation amplitude and steady cycles, by harmonic balance;
//! - [`steady`]: the steady cycle by the engine that suits it;
//! - [`modal`]: damped modes and their sensitivities.

pub mod blocktri;
mod equilibrium;
mod error;
mod followed;
pub mod frf;
pub mod harmonic;
pub mod march;
pub mod modal;
pub mod periodic;
mod small;
mod spatial;
pub mod steady;

pub use equilibrium::{Equilibrium, equilibrium};
pub use error::EngineError;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod space_tests;
#[cfg(test)]
mod exact_tests;
#[cfg(test)]
mod space_peers;
