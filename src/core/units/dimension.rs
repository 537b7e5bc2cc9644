//! Physical dimension: seven SI exponents, and the plane angle carried along so that rad/s is not taken for Hz.

use std::fmt;

/// Exponents of the seven SI base quantities, and of the plane angle.
///
/// The angle is dimensionless in SI: rad = 1 in every value. Its exponent is kept only to catch confusions that a factor of 2 pi or
/// 180/pi would otherwise hide: see [`Dimension::accepts`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Dimension {
    pub length: i8,
    pub mass: i8,
    pub time: i8,
    pub current: i8,
    pub temperature: i8,
    pub amount: i8,
    pub luminosity: i8,
    /// Exponent of the plane angle (rad); not one of the seven.
    pub angle: i8,
}

impl Dimension {
    pub const DIMENSIONLESS: Self = Self::mechanical(0, 0, 0, 0);
    pub const LENGTH: Self = Self::mechanical(1, 0, 0, 0);
    pub const ANGLE: Self = Self::mechanical(0, 0, 0, 1);
    pub const MASS: Self = Self::mechanical(0, 1, 0, 0);
    pub const INERTIA: Self = Self::mechanical(2, 1, 0, 0);
    pub const TIME: Self = Self::mechanical(0, 0, 1, 0);
    pub const FREQUENCY: Self = Self::mechanical(0, 0, -1, 0);
    pub const VELOCITY: Self = Self::mechanical(1, 0, -1, 0);
    pub const ANGULAR_VELOCITY: Self = Self::mechanical(0, 0, -1, 1);
    pub const ACCELERATION: Self = Self::mechanical(1, 0, -2, 0);
    pub const ANGULAR_ACCELERATION: Self = Self::mechanical(0, 0, -2, 1);
    pub const FORCE: Self = Self::mechanical(1, 1, -2, 0);
    pub const MOMENT: Self = Self::mechanical(2, 1, -2, 0);
    pub const ENERGY: Self = Self::mechanical(2, 1, -2, 0);
    pub const POWER: Self = Self::mechanical(2, 1, -3, 0);
    pub const PRESSURE: Self = Self::mechanical(-1, 1, -2, 0);
    pub const STIFFNESS: Self = Self::FORCE.over(Self::LENGTH);
    pub const ROTATIONAL_STIFFNESS: Self = Self::MOMENT.over(Self::ANGLE);
    pub const DAMPING: Self = Self::FORCE.over(Self::VELOCITY);
    pub const ROTATIONAL_DAMPING: Self = Self::MOMENT.over(Self::ANGULAR_VELOCITY);
    pub const RECEPTANCE: Self = Self::LENGTH.over(Self::FORCE);
    pub const MOBILITY: Self = Self::VELOCITY.over(Self::FORCE);
    pub const ACCELERANCE: Self = Self::ACCELERATION.over(Self::FORCE);
    pub const TEMPERATURE: Self = Self { temperature: 1, ..Self::DIMENSIONLESS };

    /// A dimension of mechanics: exponents of length, mass, time and plane angle.
    pub const fn mechanical(length: i8, mass: i8, time: i8, angle: i8) -> Self {
        Self { length, mass, time, current: 0, temperature: 0, amount: 0, luminosity: 0, angle }
    }

    /// The dimension of a product (exponents saturate at +-127).
    pub const fn times(self, other: Self) -> Self {
        self.combined(other, 1)
    }

    /// The dimension of a quotient (exponents saturate at +-127).
    pub const fn over(self, other: Self) -> Self {
        self.combined(other, -1)
    }

    /// The dimension of the n-th power (exponents saturate at +-127).
    pub const fn power(self, n: i8) -> Self {
        Self::DIMENSIONLESS.combined(self, n)
    }

    const fn combined(self, other: Self, n: i8) -> Self {
        Self {
            length: self.length.saturating_add(other.length.saturating_mul(n)),
            mass: self.mass.saturating_add(other.mass.saturating_mul(n)),
            time: self.time.saturating_add(other.time.saturating_mul(n)),
            current: self.current.saturating_add(other.current.saturating_mul(n)),
            temperature: self.temperature.saturating_add(other.temperature.saturating_mul(n)),
            amount: self.amount.saturating_add(other.amount.saturating_mul(n)),
            luminosity: self.luminosity.saturating_add(other.luminosity.saturating_mul(n)),
            angle: self.angle.saturating_add(other.angle.saturating_mul(n)),
        }
    }

    /// Whether a bare number may stand for it (no unit needed).
    pub fn is_dimensionless(self) -> bool {
        self == Self::DIMENSIONLESS
    }

    /// Whether a value of dimension `found` may stand where `self` is expected.
    ///
    /// The seven exponents must agree. The angle must agree too, except that rad may be left out where a mass stands in the unit
    /// (N m for N m/rad): there no other reading is in use. Hz for rad/s, rad/s for Hz and a bare number for an angle are refused.
    pub fn accepts(self, found: Self) -> bool {
        let seven = Self { angle: 0, ..self } == Self { angle: 0, ..found };
        seven && (found.angle == self.angle || (found.angle == 0 && self.mass != 0))
    }

    /// Units that would be accepted for it, for error messages: the usual ones by name, or the SI unit.
    pub fn examples(self) -> String {
        let known = KNOWN.iter().find(|k| k.0 == self).map(|k| k.2.to_string());
        known.unwrap_or_else(|| format!("{self}"))
    }

    /// The usual name, e.g. `stiffness`, or the SI unit where it has none.
    pub fn name(self) -> String {
        KNOWN.iter().find(|k| k.0 == self).map_or_else(|| format!("{self}"), |k| k.1.to_string())
    }

    /// The coherent SI unit, e.g. `N/m`.
    pub fn si_unit(self) -> String {
        format!("{self}")
    }
}

/// Dimension, name, units accepted (the first is the SI unit).
const KNOWN: &[(Dimension, &str, &str)] = &[
    (Dimension::DIMENSIONLESS, "dimensionless number", "1, %, -"),
    (Dimension::LENGTH, "length", "m, mm, um, in, ft"),
    (Dimension::ANGLE, "angle", "rad, mrad, deg"),
    (Dimension::MASS, "mass", "kg, g, t, lb"),
    (Dimension::INERTIA, "moment of inertia", "kg m2, kg mm2, g mm2"),
    (Dimension::TIME, "time", "s, ms, us, min, h"),
    (Dimension::FREQUENCY, "frequency", "Hz, kHz, 1/s, rpm"),
    (Dimension::VELOCITY, "velocity", "m/s, mm/s, in/s"),
    (Dimension::ANGULAR_VELOCITY, "angular velocity", "rad/s, deg/s, rpm"),
    (Dimension::ACCELERATION, "acceleration", "m/s2, mm/s2, g"),
    (Dimension::ANGULAR_ACCELERATION, "angular acceleration", "rad/s2, deg/s2"),
    (Dimension::FORCE, "force", "N, kN, mN, lbf, kip"),
    (Dimension::MOMENT, "moment or energy", "N m, N mm, J, mJ, lbf in"),
    (Dimension::POWER, "power", "W, mW, kW"),
    (Dimension::PRESSURE, "pressure", "Pa, MPa, GPa, N/mm2, psi"),
    (Dimension::STIFFNESS, "stiffness", "N/m, N/mm, kN/mm, lbf/in"),
    (Dimension::ROTATIONAL_STIFFNESS, "rotational stiffness", "N m/rad, N mm/rad, N mm/deg"),
    (Dimension::DAMPING, "viscous damping", "N s/m, N s/mm, lbf s/in"),
    (Dimension::ROTATIONAL_DAMPING, "rotational damping", "N m s/rad, N mm s/rad, N mm s/deg"),
    (Dimension::RECEPTANCE, "receptance", "m/N, mm/N, um/N"),
    (Dimension::MOBILITY, "mobility", "m/s/N, mm/s/N"),
    (Dimension::ACCELERANCE, "accelerance", "m/s2/N, g/N"),
    (Dimension::TEMPERATURE, "temperature", "K, degC"),
];

impl fmt::Display for Dimension {
    /// The coherent SI unit: the usual symbol where there is one, else base units.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((_, _, units)) = KNOWN.iter().find(|k| k.0 == *self) {
            return f.write_str(units.split(',').next().unwrap_or("1"));
        }
        let base = [
            ("kg", self.mass),
            ("m", self.length),
            ("s", self.time),
            ("A", self.current),
            ("K", self.temperature),
            ("mol", self.amount),
            ("cd", self.luminosity),
            ("rad", self.angle),
        ];
        let mut first = true;
        for (symbol, exponent) in base.into_iter().filter(|b| b.1 != 0) {
            if !first {
                f.write_str(" ")?;
            }
            first = false;
            f.write_str(symbol)?;
            if exponent != 1 {
                write!(f, "^{exponent}")?;
            }
        }
        if first { f.write_str("1") } else { Ok(()) }
    }
}
