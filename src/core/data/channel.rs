//! Channels of a measurement file: what a column holds.

use super::reading::{self, Reading};
use super::toml_strict::{TableView, TomlError, ValueView, unique};
use crate::units::{self, Dimension, Unit};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    Time,
    Displacement,
    Velocity,
    Acceleration,
    Force,
    Frequency,
    Real,
    Imag,
    Amplitude,
    Phase,
    Coherence,
    /// Peak force of every line of an FRF.
    Excitation,
    Mode,
    Damping,
    Family,
    Description,
    Case,
    DissipatedEnergy,
    StoredEnergy,
    LossRatio,
}

impl Role {
    /// Every role by its word in dataset.toml.
    pub const WORDS: [(&'static str, Role); 20] = [
        ("time", Role::Time),
        ("displacement", Role::Displacement),
        ("velocity", Role::Velocity),
        ("acceleration", Role::Acceleration),
        ("force", Role::Force),
        ("frequency", Role::Frequency),
        ("real", Role::Real),
        ("imag", Role::Imag),
        ("amplitude", Role::Amplitude),
        ("phase", Role::Phase),
        ("coherence", Role::Coherence),
        ("excitation", Role::Excitation),
        ("mode", Role::Mode),
        ("damping", Role::Damping),
        ("family", Role::Family),
        ("description", Role::Description),
        ("case", Role::Case),
        ("W_D", Role::DissipatedEnergy),
        ("W_s", Role::StoredEnergy),
        ("D", Role::LossRatio),
    ];

    /// The word in dataset.toml.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|w| w.1 == self).map_or("", |w| w.0)
    }

    /// Measured at a place in the model (`at` is required).
    pub fn has_place(self) -> bool {
        matches!(self, Self::Displacement | Self::Velocity | Self::Acceleration | Self::Force)
    }

    /// Holds text, not numbers.
    pub fn is_text(self) -> bool {
        matches!(self, Self::Family | Self::Description | Self::Case)
    }

    /// Dimensions its unit may have: along a translation, about a rotation.
    pub fn dimensions(self) -> &'static [Dimension] {
        match self {
            Self::Time => &[Dimension::TIME],
            Self::Displacement => &[Dimension::LENGTH, Dimension::ANGLE],
            Self::Velocity => &[Dimension::VELOCITY, Dimension::ANGULAR_VELOCITY],
            Self::Acceleration => &[Dimension::ACCELERATION, Dimension::ANGULAR_ACCELERATION],
            Self::Force | Self::Excitation => &[Dimension::FORCE, Dimension::MOMENT],
            Self::Frequency => &[Dimension::FREQUENCY],
            Self::Phase => &[Dimension::ANGLE],
            Self::DissipatedEnergy | Self::StoredEnergy => &[Dimension::ENERGY],
            Self::Coherence | Self::Mode | Self::Damping | Self::LossRatio => &[Dimension::DIMENSIONLESS],
            // Settled by the test (the quantity of an FRF), or text.
            Self::Real | Self::Imag | Self::Amplitude | Self::Family | Self::Description | Self::Case => &[],
        }
    }
}

/// A declared standard deviation of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sigma {
    /// SI.
    Absolute(f64),
    /// Fraction: of the channel's rms about its mean (histories), of |H| at each line (FRF), of the value (tables).
    Relative(f64),
}

/// A channel as declared.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelSpec {
    pub role: Role,
    /// `name.axis`; checked for its form only, the model checks the place.
    pub at: Option<String>,
    pub column: String,
    pub unit: Unit,
    pub sigma: Option<Sigma>,
    /// Column that holds the standard deviation of each row, in the channel's unit (tables).
    pub sigma_column: Option<String>,
    /// Averages behind a coherence.
    pub averages: Option<u32>,
    /// Drives the test (transient).
    pub input: bool,
    /// What is done to it before it is used.
    pub reading: Reading,
    /// Line in dataset.toml.
    pub line: usize,
}

impl ChannelSpec {
    /// `force at c1.x`, for messages.
    pub fn label(&self) -> String {
        match &self.at {
            Some(at) => format!("{} at {at}", self.role.word()),
            None => self.role.word().to_string(),
        }
    }
}

/// Reads the channels of a test; `roles` are those its kind knows, `response` the dimensions of real, imag and amplitude.
pub(super) fn channels(test: &TableView<'_>, roles: &[Role], response: &[Dimension]) -> Result<Vec<ChannelSpec>, TomlError> {
    let list = test.require("channels", "[{ role = \"time\", column = \"t\", unit = \"s\" }, ...]")?;
    let (mut seen, mut all) = (Vec::new(), Vec::new());
    for value in list.list()? {
        let table = value.table()?;
        let spec = channel(&table, roles, response)?;
        unique(&mut seen, "channel", &spec.label(), &value)?;
        all.push(spec);
    }
    Ok(all)
}

fn channel(table: &TableView<'_>, roles: &[Role], response: &[Dimension]) -> Result<ChannelSpec, TomlError> {
    let words: Vec<(&str, Role)> = Role::WORDS.into_iter().filter(|w| roles.contains(&w.1)).collect();
    let role =
        table.require("role", &format!("one of {}", words.iter().map(|w| w.0).collect::<Vec<_>>().join(", ")))?.word("role", &words)?;
    let mut keys = vec!["role", "column", "unit"];
    if role.has_place() {
        keys.extend(["at", "input"]);
    }
    if role == Role::Coherence {
        keys.push("averages");
    } else if !role.is_text() && role != Role::Time {
        keys.extend(["sigma", "sigma_column"]);
    }
    keys.extend(reading::keys(role));
    whose(table, role)?;
    table.only(&keys)?;
    let at = if role.has_place() { Some(place(&table.require("at", "a place such as \"c1.x\"")?)?) } else { None };
    let dimensions = if matches!(role, Role::Real | Role::Imag | Role::Amplitude) { response } else { role.dimensions() };
    let dimensions = along_axis(dimensions, at.as_deref());
    let clock = role == Role::Time && table.has("rate");
    if let (true, Some(v)) = (clock, table.get("column").or(table.get("unit"))) {
        return Err(v.refuse("a channel of time that is given by its rate has no column", "rate, or column and unit"));
    }
    if role == Role::Time && !clock {
        table.require("column", "the name of a column, or in place of column and unit `rate = \"100 Hz\"`")?;
    }
    let unit = if clock { Unit::si(Dimension::TIME) } else { unit(table, role, &dimensions)? };
    let sigma = table.optional("sigma", |v| sigma(&v, &unit))?;
    let sigma_column = table.optional("sigma_column", |v| v.string())?.map(str::to_string);
    if let (Some(_), Some(v)) = (&sigma, table.get("sigma_column")) {
        return Err(v.refuse("sigma and sigma_column both stand there", "one of them"));
    }
    let averages = match role {
        Role::Coherence => Some(table.require("averages", "the number of averages, such as 20")?.integer(1, 1_000_000_000)? as u32),
        _ => None,
    };
    let reading = reading::read(table, &unit)?;
    Ok(ChannelSpec {
        role,
        at,
        reading,
        column: if clock { String::new() } else { table.string("column")?.to_string() },
        unit,
        sigma,
        sigma_column,
        averages,
        input: table.optional("input", |v| v.bool())?.unwrap_or(false),
        line: table.line(),
    })
}

/// Says of a key that a channel of another role takes where it belongs.
fn whose(table: &TableView<'_>, role: Role) -> Result<(), TomlError> {
    let places = [
        (["from", "to"].as_slice(), "on the channel of role time: the window holds for all channels"),
        (&["rate"], "on the channel of role time"),
        (&["offset", "centre"], "on a displacement, velocity, acceleration or force"),
        (&["scale"], "on a displacement, velocity, acceleration or force, or on real, imag or amplitude"),
    ];
    for (keys, where_to) in places {
        for key in keys.iter().filter(|k| !reading::keys(role).contains(*k)) {
            if let Some(v) = table.get(key) {
                return Err(v.refuse(format!("`{key}` on a channel of role {}", role.word()), where_to));
            }
        }
    }
    Ok(())
}

fn unit(table: &TableView<'_>, role: Role, dimensions: &[Dimension]) -> Result<Unit, TomlError> {
    let bare = dimensions.is_empty() || dimensions.iter().any(|d| d.is_dimensionless());
    if bare && !table.has("unit") {
        return Ok(Unit::si(Dimension::DIMENSIONLESS));
    }
    let examples = dimensions.first().map_or(String::new(), |d| d.examples());
    let accepted = format!("the unit of the {} ({examples})", role.word());
    let value = table.require("unit", &accepted)?;
    if value.is_blank() {
        return Err(value.refuse(format!("the unit of the {} is missing", role.word()), accepted));
    }
    let text = value.string()?;
    let mut first = None;
    for d in dimensions {
        match units::parse_unit(text, *d) {
            Ok(unit) => return Ok(unit),
            Err(e) => first = first.or(Some(e)),
        }
    }
    Err(match first {
        Some(e) => value.error(super::toml_strict::TomlProblem::Quantity(e)),
        None => value.refuse(format!("a {} has no unit", role.word()), "no key `unit`"),
    })
}

/// A standard deviation: a quantity, or a percentage.
pub(super) fn sigma(value: &ValueView<'_>, unit: &Unit) -> Result<Sigma, TomlError> {
    let percent = value.is_string() && value.string()?.trim_end().ends_with('%');
    if percent && !unit.dimension.is_dimensionless() {
        return value.deviation(unit, 1.0).map(Sigma::Relative);
    }
    value.deviation(unit, 1.0).map(Sigma::Absolute)
}

/// A place `name.axis`: a name of letters, digits, `_` and `-`, a point, an axis of letters and digits.
pub(super) fn place(value: &ValueView<'_>) -> Result<String, TomlError> {
    let text = value.string()?;
    let fine = text.rsplit_once('.').is_some_and(|(name, axis)| {
        let name_fine = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
        let axis_fine = axis.starts_with(|c: char| c.is_alphabetic()) && axis.chars().all(|c| c.is_alphanumeric() || c == '_');
        name_fine && axis_fine
    });
    if fine {
        Ok(text.to_string())
    } else {
        Err(value.refuse(format!("`{text}` is not a place"), "name.axis, such as \"c1.x\" or \"GF3.psi\""))
    }
}

/// Keeps, of the translational and rotational dimension, those the axis allows: x, y, z are translations, the usual angle names rotations.
pub(super) fn along_axis(dimensions: &[Dimension], at: Option<&str>) -> Vec<Dimension> {
    let [translation, rotation] = dimensions else { return dimensions.to_vec() };
    match at.and_then(|a| a.rsplit_once('.')).map(|(_, axis)| axis) {
        Some("x" | "y" | "z" | "ux" | "uy" | "uz") => vec![*translation],
        Some("psi" | "phi" | "theta" | "gamma" | "rx" | "ry" | "rz") => vec![*rotation],
        _ => vec![*translation, *rotation],
    }
}
