//! Where the energy of modes is.

use serde::Serialize;

/// Shares in one line: `device.x 84 %; GF1-21.psi 9 %`.
pub fn words(shares: &[EnergyShare]) -> String {
    shares.iter().map(|s| format!("{} {:.0} %", s.at, 100.0 * s.share)).collect::<Vec<_>>().join("; ")
}

/// A part of a mode's energy.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct EnergyShare {
    /// General forces or bodies that share it.
    pub at: String,
    /// Share of the whole; that of the forces present (geometric stiffness) may be below 0.
    pub share: f64,
}

/// One mode of a modal table in the model.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ModeEnergy {
    /// Its number in the table.
    pub mode: u32,
    /// Natural frequency as measured [Hz].
    pub measured: f64,
    /// As computed [Hz].
    pub computed: f64,
    /// Strain energy by general force, the largest shares.
    pub strain: Vec<EnergyShare>,
    /// Kinetic energy by body, the largest shares.
    pub kinetic: Vec<EnergyShare>,
    /// Where a fixture holds more than half of the strain energy, what to think of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub finding: Option<String>,
}
