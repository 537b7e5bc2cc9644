//! What is not missing physics: instruments at fault, corrections of what a study fixes, the errors that are left.

use serde::Serialize;

use crate::response::Misreading;

/// An instrument at fault.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Instrument {
    /// gain, delay, offset, drift, moving_mass, accelerometer_mass, clipping.
    pub effect: String,
    /// Channel, `test.role`.
    pub at: String,
    /// What the record says, in words.
    pub why: String,
    /// `effect at place` of the tied.
    pub tied_with: Vec<String>,
}

/// Parameter of a correction: the part of a body's mass that lies between nodes.
pub const BETWEEN: &str = "mass between nodes";
/// That of the mass of a body that ends such a chain: what lies between was counted at one node or at two.
pub const END: &str = "mass of an end";

/// What a study ties or fixes and the data do not.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Correction {
    /// Parameter.
    pub parameter: String,
    /// Place.
    pub at: String,
    /// Deviation from what the study says, relative.
    pub relative: f64,
    /// Its standard deviation.
    pub std: f64,
}

impl Correction {
    /// In words.
    pub fn describe(&self) -> String {
        let sure = |value: f64| format!("{:.2} +- {:.2}", value, self.std);
        if self.parameter == BETWEEN {
            return format!(
                "{} of the mass lies between the nodes along {} (0.5 in a chain of twice as many bodies, 0.67 in a bar): more bodies would describe it",
                sure(self.relative),
                self.at
            );
        }
        let (more, than) = match self.parameter.as_str() {
            "mass" => (["heavier", "lighter"], "its nominal mass"),
            END => (["heavier", "lighter"], "its nominal mass, as the end of a chain whose mass lies between the nodes may be"),
            "viscous.c" => (["more damped", "less damped"], "its group or its nominal damping"),
            _ => (["stiffer", "softer"], "its group or its nominal stiffness"),
        };
        let which = more[usize::from(self.relative < 0.0)];
        format!("{} is {:.2} +- {:.2} % {which} than {than}", self.at, 100.0 * self.relative.abs(), 100.0 * self.std)
    }
}

/// The model's own error in a channel.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct OwnError {
    /// cycle, frf, transient, energy, modal.
    pub kind: String,
    /// `force at c1.x`.
    pub channel: String,
    /// Root mean square over tests, relative to the response.
    pub relative: f64,
}

/// How much a strength differs from test to test.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct ScatterOf {
    /// `at.effect.parameter`.
    pub parameter: String,
    /// Between tests of which kind: cycle, frf, transient, energy, modal.
    pub kind: String,
    /// Standard deviation, relative.
    pub relative: f64,
}

/// What an instrument reads wrong by a model, beyond what it may err by.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Reading {
    /// Test.
    pub test: String,
    /// `force at c1.x`.
    pub channel: String,
    /// gain, offset, delay, bend, jump.
    pub misreading: String,
    /// How much, most likely: gain relative, offset in parts of the amplitude, delay in parts of the period (of the shortest one of an FRF), bend in parts of the
    /// largest reading, jump in parts of it. Above 0 it reads less, or late.
    pub part: f64,
    /// The same in standard deviations of what the instrument may err by.
    pub deviations: f64,
}

impl Reading {
    /// One reading of a test's channel.
    pub fn new(test: &str, channel: &str, misreading: Misreading, part: f64, deviations: f64) -> Reading {
        let misreading = match misreading {
            Misreading::Gain => "gain",
            Misreading::Offset => "offset",
            Misreading::Delay => "delay",
            Misreading::Bend => "bend",
            Misreading::Jump => "jump",
        };
        Reading { test: test.into(), channel: channel.into(), misreading: misreading.into(), part, deviations }
    }

    /// In words.
    pub fn describe(&self) -> String {
        let (low, size) = (self.part > 0.0, 100.0 * self.part.abs());
        let how = match self.misreading.as_str() {
            "gain" => format!("{size:.2} % too {}", if low { "little" } else { "much" }),
            "offset" => format!("{size:.2} % of its amplitude too {}", if low { "low" } else { "high" }),
            "delay" => format!("{size:.2} % of a period too {}", if low { "late" } else { "early" }),
            "bend" => format!("{size:.2} % of its largest reading off a straight line"),
            _ => format!("{size:.0} % of a jump too {}", if low { "low" } else { "high" }),
        };
        format!(
            "{} of {} reads {how} by this model, {:.1} standard deviations of what its instrument may err by: the instrument is off, or physics that the \
             model lacks looks like that. The errors of the tests hold this reading against the model, its model error does not",
            self.channel,
            self.test,
            self.deviations.abs()
        )
    }
}
