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
    /// cycle, frf, transient, energy, modal, backbone.
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
    /// Between tests of which kind: cycle, frf, transient, energy, modal, backbone.
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
    /// How it misreads.
    pub misreading: Misreading,
    /// How much, most likely: gain relative, offset in parts of the amplitude, delay in parts of the period (of the shortest one of an FRF), bend in parts of the
    /// largest reading, jump in parts of it. Above 0 it reads less, or late.
    pub part: f64,
    /// The same in standard deviations of what the instrument may err by.
    pub deviations: f64,
}

impl Reading {
    /// Sentences without their full stops: one for each channel, misreading and direction, whatever tests show it, and what to make of them.
    pub fn describe(all: &[Reading]) -> Vec<String> {
        let alike = |a: &Reading, b: &Reading| (&a.channel, a.misreading, a.part > 0.0) == (&b.channel, b.misreading, b.part > 0.0);
        let first = all.iter().enumerate().filter(|(k, r)| !all[..*k].iter().any(|before| alike(before, r)));
        let mut told: Vec<String> =
            first.map(|(_, r)| Reading::together(&all.iter().filter(|o| alike(o, r)).collect::<Vec<_>>())).collect();
        if !told.is_empty() {
            told.push(
                "What reads so far off is an instrument that is off, or physics that the model lacks: the errors of the tests hold it against the model, its \
                 model error does not"
                    .into(),
            );
        }
        told
    }

    /// What tests say alike of one channel, at least one.
    fn together(alike: &[&Reading]) -> String {
        let Reading { channel, misreading, part, .. } = alike[0];
        let digits = if *misreading == Misreading::Jump { 0 } else { 2 };
        let size = range(alike.iter().map(|r| 100.0 * r.part.abs()), digits);
        let which = |high: &'static str, low: &'static str| if *part > 0.0 { low } else { high };
        let how = match misreading {
            Misreading::Gain => format!("{size} % too {}", which("much", "little")),
            Misreading::Offset => format!("{size} % of its amplitude too {}", which("high", "low")),
            Misreading::Delay => format!("{size} % of a period too {}", which("early", "late")),
            Misreading::Bend => format!("{size} % of its largest reading off a straight line"),
            Misreading::Jump => format!("{size} % of a jump too {}", which("high", "low")),
            Misreading::Drift => format!("{size} % of its amplitude too {}, which is more than it drifts by", which("high", "low")),
        };
        let deviations = range(alike.iter().map(|r| r.deviations.abs()), 1);
        let tests: Vec<&str> = alike.iter().map(|r| r.test.as_str()).collect();
        format!(
            "{channel} of {} reads {how} by this model, {deviations} standard deviations of what its instrument may err by",
            tests.join(", ")
        )
    }
}

/// The least and the largest of these in so many decimals, or what they are alike.
fn range(values: impl Iterator<Item = f64>, decimals: usize) -> String {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let (low, high) = (format!("{low:.decimals$}"), format!("{high:.decimals$}"));
    if low == high { low } else { format!("{low} to {high}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tests_say_alike_of_a_channel_is_said_once() {
        let of = |test: &str, channel: &str, misreading, part, deviations| Reading {
            test: test.into(),
            channel: channel.into(),
            misreading,
            part,
            deviations,
        };
        let all = [
            of("a", "force at c1.x", Misreading::Delay, 0.001, 3.5),
            of("a", "displacement at c1.x", Misreading::Gain, -0.0176, -3.5),
            of("b", "force at c1.x", Misreading::Delay, 0.0012, 4.1),
            of("c", "force at c1.x", Misreading::Delay, -0.002, -3.2),
        ];
        let told = Reading::describe(&all);
        assert_eq!(told.len(), 4, "{told:#?}");
        assert_eq!(
            told[0],
            "force at c1.x of a, b reads 0.10 to 0.12 % of a period too late by this model, 3.5 to 4.1 standard deviations of what its instrument may err by"
        );
        assert!(told[1].starts_with("displacement at c1.x of a reads 1.76 % too much by"), "{}", told[1]);
        assert!(told[2].starts_with("force at c1.x of c reads 0.20 % of a period too early"), "{}", told[2]);
        assert!(Reading::describe(&[]).is_empty());
    }
}
