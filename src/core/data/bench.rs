//! `[rig]` and `[instruments]` of dataset.toml: what the test bench can do, and what its instruments may err by.

use super::toml_strict::{TableView, TomlError, ValueView};
use crate::units::Dimension;

/// Limits of the test bench [SI]; infinite where none is stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Largest force.
    pub force_max: f64,
    /// Largest displacement from the zero of its channel.
    pub displacement_max: f64,
    /// Largest velocity.
    pub velocity_max: f64,
    /// Largest acceleration.
    pub acceleration_max: f64,
    /// Least and greatest frequency.
    pub frequency: (f64, f64),
}

impl Default for Rig {
    fn default() -> Self {
        let most = f64::INFINITY;
        Rig { force_max: most, displacement_max: most, velocity_max: most, acceleration_max: most, frequency: (0.0, most) }
    }
}

/// Standard deviations of what instruments err by, as a dataset states them; what it does not state is that of good ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Instruments {
    /// Gain about 1.
    pub gain: Option<f64>,
    /// Offset, in parts of the amplitude: that of the sine of the same rms, its mean with it.
    pub offset: Option<f64>,
    /// Delay [s].
    pub delay: Option<f64>,
    /// Quadratic and cubic part of a sensor's characteristic at its largest reading.
    pub linearity: Option<f64>,
}

/// Reads `[rig]`.
pub(super) fn rig(root: &TableView<'_>) -> Result<Rig, TomlError> {
    let Some(value) = root.get("rig") else { return Ok(Rig::default()) };
    let table = value.table()?;
    table.only(&["force_max", "displacement_max", "velocity_max", "acceleration_max", "frequency_min", "frequency_max"])?;
    let limit = |key: &str, dimension: Dimension, none: f64| {
        let above = |v: ValueView<'_>| {
            let q = v.quantity(dimension)?;
            if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("{key} is {q}"), "a limit above 0, or no key for none")) }
        };
        table.optional(key, above).map(|v| v.unwrap_or(none))
    };
    let frequency = (limit("frequency_min", Dimension::FREQUENCY, 0.0)?, limit("frequency_max", Dimension::FREQUENCY, f64::INFINITY)?);
    if frequency.0 >= frequency.1 {
        return Err(value.refuse(format!("the bench runs from {} to {} Hz", frequency.0, frequency.1), "frequency_min below frequency_max"));
    }
    Ok(Rig {
        force_max: limit("force_max", Dimension::FORCE, f64::INFINITY)?,
        displacement_max: limit("displacement_max", Dimension::LENGTH, f64::INFINITY)?,
        velocity_max: limit("velocity_max", Dimension::VELOCITY, f64::INFINITY)?,
        acceleration_max: limit("acceleration_max", Dimension::ACCELERATION, f64::INFINITY)?,
        frequency,
    })
}

/// Reads `[instruments]`.
pub(super) fn instruments(root: &TableView<'_>) -> Result<Instruments, TomlError> {
    let Some(value) = root.get("instruments") else { return Ok(Instruments::default()) };
    let table = value.table()?;
    table.only(&["gain", "offset", "delay", "linearity"])?;
    let part = |key: &str| {
        table.optional(key, |v| {
            let q = v.quantity(Dimension::DIMENSIONLESS)?;
            let fine = q.value > 0.0 && q.value < 1.0;
            if fine { Ok(q.value) } else { Err(v.refuse(format!("{key} is {q}"), "a part above 0 and below 100 %")) }
        })
    };
    let delay = table.optional("delay", |v| {
        let q = v.quantity(Dimension::TIME)?;
        if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("delay is {q}"), "a time above 0")) }
    })?;
    Ok(Instruments { gain: part("gain")?, offset: part("offset")?, delay, linearity: part("linearity")? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::toml_strict::TomlFile;

    fn read(text: &str) -> Result<(Rig, Instruments), TomlError> {
        let file = TomlFile::parse("dataset.toml".as_ref(), text.to_string(), "data")?;
        Ok((rig(&file.root())?, instruments(&file.root())?))
    }

    #[test]
    fn limits_and_tolerances_are_read_in_their_units() {
        let text = "[rig]\nforce_max = \"2 kN\"\ndisplacement_max = \"25 mm\"\nvelocity_max = \"1 m/s\"\nfrequency_max = \"50 Hz\"\n\
                    [instruments]\ngain = \"1 %\"\noffset = 0.002\ndelay = \"0.1 ms\"\nlinearity = \"0.1 %\"\n";
        let (rig, instruments) = read(text).unwrap();
        assert_eq!((rig.force_max, rig.displacement_max, rig.velocity_max, rig.frequency), (2000.0, 0.025, 1.0, (0.0, 50.0)));
        assert_eq!(rig.acceleration_max, f64::INFINITY);
        assert_eq!(instruments, Instruments { gain: Some(0.01), offset: Some(0.002), delay: Some(1e-4), linearity: Some(0.001) });
        assert_eq!(read("").unwrap(), (Rig::default(), Instruments::default()));
    }

    #[test]
    fn what_no_bench_has_is_refused_with_its_key() {
        for (text, said) in [
            ("[rig]\nforce_max = \"0 N\"", "force_max is 0 N"),
            ("[rig]\nforce_max = \"2 mm\"", "mm"),
            ("[rig]\nfrequency_min = \"9 Hz\"\nfrequency_max = \"2 Hz\"", "from 9 to 2 Hz"),
            ("[rig]\nforce = \"2 N\"", "unknown key `force`"),
            ("[instruments]\ngain = \"150 %\"", "gain is 150 %"),
            ("[instruments]\ndelay = \"0 s\"", "delay is 0 s"),
            ("[instruments]\nlinearity = -0.1", "linearity is -0.1"),
        ] {
            let e = read(text).unwrap_err();
            assert!(e.to_string().contains(said), "{text}: {e}");
        }
    }
}
