//! What an effect says of itself: name, claim, equation, parameters, ports, source. One list of these drives the parser, the help,
//! the tables, the search for candidates and the tests that hold for all.

use crate::units::Dimension;

/// The five roles an effect can play in a system (design.md section 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A general force between the two ends of a connector, in parallel with the others there.
    Force,
    /// An opening in series with everything that acts at its place.
    Series,
    /// A parameter of another effect as a function of a test condition.
    Coefficient,
    /// Acts on a measuring channel, not on the structure.
    Channel,
    /// Where the parts lie in the reference position.
    Geometry,
}

impl Role {
    /// The role in one lower-case word.
    pub fn word(self) -> &'static str {
        match self {
            Role::Force => "force",
            Role::Series => "series",
            Role::Coefficient => "coefficient",
            Role::Channel => "channel",
            Role::Geometry => "geometry",
        }
    }
}

/// The admissible sign of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Never negative.
    NonNegative,
    /// Greater than zero: zero has no meaning.
    Positive,
    /// Either sign.
    Any,
}

impl Sign {
    /// The sign as it is printed: `>= 0`, `> 0`, `any`.
    pub fn word(self) -> &'static str {
        match self {
            Sign::NonNegative => ">= 0",
            Sign::Positive => "> 0",
            Sign::Any => "any",
        }
    }

    /// The lower bound it implies.
    pub const fn lowest(self) -> f64 {
        match self {
            Sign::Any => f64::NEG_INFINITY,
            _ => 0.0,
        }
    }
}

/// What a parameter is to its effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The effect is proportional to it (or, for a series effect, absent at its null value).
    Strength,
    /// Without meaning when the strength is at its null value; searched over a grid.
    Shape,
    /// Declared, never fitted unless the user says so.
    Setting,
}

/// Dimension of a parameter in terms of the place it acts at: general force F, relative displacement X, time T. At a
/// translational axis F is N and X is m; at a rotational axis F is N m and X is rad.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dim {
    /// `F^f X^x T^t`.
    Place {
        /// Exponent of the general force.
        f: i8,
        /// Exponent of the relative displacement.
        x: i8,
        /// Exponent of time.
        t: i8,
    },
    /// A pure number.
    One,
    /// The unit of the channel it acts on.
    Channel,
    /// The unit of the channel it acts on, per second.
    ChannelPerTime,
    /// The dimension a study declares, whatever the place.
    Declared(Dimension),
    /// One over the unit of the condition it refers to.
    PerCondition,
}

const fn fxt(f: i8, x: i8, t: i8) -> Dim {
    Dim::Place { f, x, t }
}

impl Dim {
    /// General force.
    pub const F: Dim = fxt(1, 0, 0);
    /// Relative displacement.
    pub const X: Dim = fxt(0, 1, 0);
    /// Time.
    pub const T: Dim = fxt(0, 0, 1);
    /// Frequency.
    pub const PER_T: Dim = fxt(0, 0, -1);
    /// Velocity.
    pub const X_PER_T: Dim = fxt(0, 1, -1);
    /// Stiffness.
    pub const F_PER_X: Dim = fxt(1, -1, 0);
    /// Quadratic stiffness.
    pub const F_PER_X2: Dim = fxt(1, -2, 0);
    /// Cubic stiffness.
    pub const F_PER_X3: Dim = fxt(1, -3, 0);
    /// Compliance.
    pub const X_PER_F: Dim = fxt(-1, 1, 0);
    /// Viscous damping.
    pub const FT_PER_X: Dim = fxt(1, -1, 1);
    /// Quadratic damping.
    pub const FT2_PER_X2: Dim = fxt(1, -2, 2);
    /// Mass or moment of inertia.
    pub const FT2_PER_X: Dim = fxt(1, -1, 2);
    /// Time per displacement.
    pub const T_PER_X: Dim = fxt(0, -1, 1);

    /// The unit an engineer reads it in, with its value in SI: N, mm, s at a translational place, N m, rad, s at a rotational one.
    pub fn practical(self, rotational: bool) -> (String, f64) {
        match self {
            Dim::Place { f, x, t } if !rotational && (f, x, t) != (1, -1, 2) && x != 0 => {
                // `m` stands for the displacement alone in the SI text of a translational place.
                (self.si(false).replace('m', "mm"), 1e-3f64.powi(i32::from(x)))
            }
            _ => (self.si(rotational), 1.0),
        }
    }

    /// SI unit as it is printed for a translational or a rotational place, e.g. `N/m`, `N m/rad`, `N s/m`.
    pub fn si(self, rotational: bool) -> String {
        let (f, x, t) = match self {
            Dim::One => return "-".into(),
            Dim::Channel => return "unit of the channel".into(),
            Dim::ChannelPerTime => return "unit of the channel/s".into(),
            Dim::Declared(dimension) => return dimension.si_unit(),
            Dim::PerCondition => return "1/unit of the condition".into(),
            Dim::Place { f, x, t } => (f, x, t),
        };
        if (f, x, t) == (1, -1, 2) {
            return if rotational { "kg m2".into() } else { "kg".into() };
        }
        let (force, length) = if rotational { ("N m", "rad") } else { ("N", "m") };
        let power = |symbol: &str, n: i8| if n == 1 { symbol.to_string() } else { format!("{symbol}{n}") };
        let parts = [(force, f), (length, x), ("s", t)];
        let over: Vec<_> = parts.iter().filter(|p| p.1 > 0).map(|p| power(p.0, p.1)).collect();
        let under: Vec<_> = parts.iter().filter(|p| p.1 < 0).map(|p| power(p.0, -p.1)).collect();
        let top = if over.is_empty() { "1".to_string() } else { over.join(" ") };
        if under.is_empty() { top } else { format!("{top}/{}", under.join("/")) }
    }
}

/// How the search chooses values for a shape parameter, in terms of what the data show at the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grid {
    /// Not searched: the default stands.
    None,
    /// Multiples of the displacement amplitude at the place.
    OfX(&'static [f64]),
    /// Along the travel of the place in all tests: this part of half of it from its middle. A spring under a load that stays changes its stiffness where the
    /// tests move it, not about where it is at rest.
    Along(&'static [f64]),
    /// Multiples of the displacement amplitude at the place where some test is of small signal, which sees an elastic limit, and is
    /// then fitted; else 0.
    Elastic(&'static [f64]),
    /// Multiples of the velocity amplitude at the place.
    OfV(&'static [f64]),
    /// Multiples of one over the velocity amplitude at the place.
    PerV(&'static [f64]),
    /// Multiples of the smallest velocity amplitude that a test has at the place.
    OfLeastV(&'static [f64]),
    /// Multiples of the general-force amplitude at the place: how sharp a corner is. Fitted once all else is: the sharper it is, the less
    /// the slope at one place says of the next.
    Sharpness(&'static [f64]),
    /// Logarithmically spaced over the periods of the tests, this many points.
    Time(usize),
    /// Multiples of the lowest frequency of the tests, one over the longest period [Hz].
    OfLowest(&'static [f64]),
    /// Multiples of the highest frequency of the tests, one over the shortest period [Hz].
    OfHighest(&'static [f64]),
    /// Multiples of the middle of the frequencies of the tests, on a logarithmic scale [Hz]; 0 where they show none. A setting
    /// that is then fitted where that is worth a parameter, if it is not below 0.
    OfMiddle(&'static [f64]),
    /// A frequency [Hz]: the first value, whatever the tests show; where they span more than three decades also those at these fractions of
    /// the way from their lowest to their highest frequency on a logarithmic scale, which part slow tests from fast ones.
    Between(f64, &'static [f64]),
    /// Fractions of the way from the lowest to the highest frequency of the tests on a logarithmic scale [Hz].
    Across(&'static [f64]),
    /// These values, whatever the tests show.
    Values(&'static [f64]),
    /// These values, whatever the tests show, from which a setting is then fitted.
    Starts(&'static [f64]),
}

/// What the tests show at a place, from which the search takes its values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scales {
    /// Displacement amplitude.
    pub x: f64,
    /// Least and largest displacement, that at rest included: every test begins there.
    pub travel: (f64, f64),
    /// Velocity amplitude.
    pub v: f64,
    /// Smallest velocity amplitude that a test has.
    pub least_v: f64,
    /// General-force amplitude.
    pub f: f64,
    /// Shortest and longest period [s].
    pub periods: (f64, f64),
    /// Whether some test is of small signal: modal, or an FRF without a declared amplitude.
    pub small: bool,
}

impl Scales {
    /// What no test shows.
    pub const NONE: Scales =
        Scales { x: 0.0, travel: (0.0, 0.0), v: 0.0, least_v: f64::INFINITY, f: 0.0, periods: (f64::INFINITY, 0.0), small: false };

    /// What both show.
    pub fn with(self, other: Scales) -> Scales {
        Scales {
            x: self.x.max(other.x),
            travel: (self.travel.0.min(other.travel.0), self.travel.1.max(other.travel.1)),
            v: self.v.max(other.v),
            least_v: self.least_v.min(other.least_v),
            f: self.f.max(other.f),
            periods: (self.periods.0.min(other.periods.0), self.periods.1.max(other.periods.1)),
            small: self.small || other.small,
        }
    }

    /// Largest distance from x = 0.
    pub fn most(&self) -> f64 {
        self.travel.1.max(-self.travel.0)
    }

    /// The same as a law of this `side` sees it: mirrored for -1, and where it faces both sides as far on either.
    pub fn from_side(self, side: f64) -> Scales {
        let travel = match side {
            s if s > 0.0 => self.travel,
            s if s < 0.0 => (-self.travel.1, -self.travel.0),
            _ => (-self.most(), self.most()),
        };
        Scales { travel, ..self }
    }
}

/// Part of where a sharpness begins below which it is not fitted: a corner sharper than the data can show has no end of its own to go to.
const SHARPEST: f64 = 0.01;

impl Grid {
    /// Whether `value` of this grid is kept until all else is fitted, and is fitted then: a frequency below 0 is none.
    pub fn fitted_last(self, value: f64) -> bool {
        matches!(self, Grid::Sharpness(_)) || matches!(self, Grid::OfMiddle(_)) && value >= 0.0
    }

    /// The least value that one begun at `start` is fitted to.
    pub fn least(self, start: f64) -> f64 {
        match self {
            Grid::Sharpness(_) => SHARPEST * start,
            Grid::OfMiddle(_) => 0.0,
            _ => f64::NEG_INFINITY,
        }
    }

    /// The values to try; empty where the tests do not show the scale they are multiples of.
    pub fn values(self, scales: &Scales) -> Vec<f64> {
        let times = |factors: &[f64], size: f64| {
            if size > 0.0 && size.is_finite() { factors.iter().map(|f| f * size).collect() } else { vec![] }
        };
        match self {
            Grid::None => vec![],
            Grid::OfX(f) => times(f, scales.x),
            Grid::Along(f) => {
                let (low, high) = scales.travel;
                times(f, 0.5 * (high - low)).iter().map(|x| 0.5 * (low + high) + x).collect()
            }
            Grid::Elastic(f) if scales.small => times(f, scales.x),
            Grid::Elastic(_) => vec![0.0],
            Grid::OfV(f) => times(f, scales.v),
            Grid::PerV(f) => times(f, scales.v.recip()),
            Grid::OfLeastV(f) => times(f, scales.least_v),
            Grid::Sharpness(f) => times(f, scales.f),
            Grid::OfLowest(f) => times(f, scales.periods.1.recip()),
            Grid::OfHighest(f) => times(f, scales.periods.0.recip()),
            Grid::OfMiddle(f) => {
                let middle = times(f, (scales.periods.0 * scales.periods.1).sqrt().recip());
                if middle.is_empty() { vec![0.0] } else { middle }
            }
            Grid::Between(always, fractions) => {
                let (low, high) = (scales.periods.1.recip(), scales.periods.0.recip());
                let wide = low > 0.0 && high.is_finite() && high > 1e3 * low;
                let between = fractions.iter().filter(|_| wide).map(|f| low * (high / low).powf(*f));
                std::iter::once(always).chain(between).collect()
            }
            Grid::Across(fractions) => {
                let (low, high) = (scales.periods.1.recip(), scales.periods.0.recip());
                if !(low > 0.0 && high.is_finite()) {
                    return vec![];
                }
                fractions.iter().map(|f| low * (high / low).powf(*f)).collect()
            }
            Grid::Values(v) | Grid::Starts(v) => v.to_vec(),
            Grid::Time(n) => {
                let (lo, hi) = (scales.periods.0 / std::f64::consts::TAU, scales.periods.1 / std::f64::consts::TAU);
                if !(lo > 0.0 && hi.is_finite()) {
                    return vec![];
                }
                (0..n).map(|k| lo * (hi / lo).powf(k as f64 / (n - 1).max(1) as f64)).collect()
            }
        }
    }
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Param {
    /// Key in the study file.
    pub name: &'static str,
    /// Dimension, from which the accepted units follow.
    pub dim: Dim,
    /// Admissible sign, which bounds every fit.
    pub sign: Sign,
    /// Strength, shape or setting.
    pub kind: Kind,
    /// Null value of a strength; default of a setting.
    pub default: f64,
    /// Smallest value that means something [SI].
    pub min: f64,
    /// Largest value that means something [SI].
    pub max: f64,
    /// Values the search tries for a shape.
    pub grid: Grid,
    /// One line of documentation.
    pub doc: &'static str,
}

impl Param {
    /// A strength: null value 0, fitted.
    pub const fn strength(name: &'static str, dim: Dim, sign: Sign, doc: &'static str) -> Param {
        Param { name, dim, sign, kind: Kind::Strength, default: 0.0, min: sign.lowest(), max: f64::INFINITY, grid: Grid::None, doc }
    }
    /// A shape: positive, searched over a grid, then fitted.
    pub const fn shape(name: &'static str, dim: Dim, grid: Grid, doc: &'static str) -> Param {
        Param { name, dim, sign: Sign::Positive, kind: Kind::Shape, default: 0.0, min: 0.0, max: f64::INFINITY, grid, doc }
    }
    /// A setting: fixed at its default unless the study says otherwise.
    pub const fn setting(name: &'static str, dim: Dim, sign: Sign, default: f64, doc: &'static str) -> Param {
        Param { name, dim, sign, kind: Kind::Setting, default, min: sign.lowest(), max: f64::INFINITY, grid: Grid::None, doc }
    }
    /// The same of either sign.
    pub const fn signed(mut self) -> Param {
        (self.sign, self.min) = (Sign::Any, f64::NEG_INFINITY);
        self
    }
    /// The same within narrower bounds [SI].
    pub const fn within(mut self, min: f64, max: f64) -> Param {
        (self.min, self.max) = (min, max);
        self
    }
    /// The same setting, for which the search tries these values.
    pub const fn tried(mut self, grid: Grid) -> Param {
        self.grid = grid;
        self
    }
    /// Bounds as they are printed: `>= 0`, `any`, `0.05 to 0.95`.
    pub fn bounds(&self) -> String {
        match (self.min == self.sign.lowest(), self.max == f64::INFINITY) {
            (true, true) => self.sign.word().into(),
            (true, false) if self.min == 0.0 => format!("{} to {}", if self.sign == Sign::Positive { "> 0" } else { "0" }, self.max),
            (true, false) => format!("<= {}", self.max),
            (false, true) => format!(">= {}", self.min),
            (false, false) => format!("{} to {}", self.min, self.max),
        }
    }
}

/// Inputs a law reads, so that only these are differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ports {
    /// Relative displacement.
    pub x: bool,
    /// Relative velocity.
    pub v: bool,
    /// Relative acceleration.
    pub a: bool,
    /// Increment of the relative displacement over the step.
    pub dx: bool,
}

impl Ports {
    /// Number of inputs read.
    pub const fn count(self) -> usize {
        self.x as usize + self.v as usize + self.a as usize + self.dx as usize
    }
    /// Reads the displacement only.
    pub const X: Ports = Ports { x: true, v: false, a: false, dx: false };
    /// Reads the velocity only.
    pub const V: Ports = Ports { x: false, v: true, a: false, dx: false };
    /// Reads the acceleration only.
    pub const A: Ports = Ports { x: false, v: false, a: true, dx: false };
    /// Reads velocity and acceleration.
    pub const VA: Ports = Ports { x: false, v: true, a: true, dx: false };
    /// Reads the displacement increment only.
    pub const DX: Ports = Ports { x: false, v: false, a: false, dx: true };
    /// Reads displacement and displacement increment.
    pub const XDX: Ports = Ports { x: true, v: false, a: false, dx: true };
    /// Reads displacement and velocity.
    pub const XV: Ports = Ports { x: true, v: true, a: false, dx: false };
    /// Reads displacement, velocity and displacement increment.
    pub const XVDX: Ports = Ports { x: true, v: true, a: false, dx: true };
    /// Reads velocity and displacement increment.
    pub const VDX: Ports = Ports { x: false, v: true, a: false, dx: true };
    /// Reads no motion (series, coefficient and channel effects).
    pub const NONE: Ports = Ports { x: false, v: false, a: false, dx: false };
}

/// Everything an effect says of itself.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name in study files and results (contract.md lists them).
    pub name: &'static str,
    /// Role in the system.
    pub role: Role,
    /// One-line claim: what an engineer would see if it were there.
    pub claim: &'static str,
    /// The law, F the force on `to` that holds it there, x = q_to - q_from.
    pub equation: &'static str,
    /// Parameters, the strength first.
    pub params: &'static [Param],
    /// Number of internal states.
    pub states: usize,
    /// Inputs read.
    pub ports: Ports,
    /// The family it belongs to (elastic, viscous, friction, ...), for tables and ties.
    pub family: &'static str,
    /// Where the law comes from.
    pub source: &'static str,
    /// Range of validity and what to watch for.
    pub range: &'static str,
}

impl Info {
    /// A force law of a program's own, without states: its name in study files, its equation, its parameters (the strength first), the inputs it reads.
    /// What is told of it besides can be set as in `Info { states: 1, claim: "...", ..Info::force(...) }`.
    pub const fn force(name: &'static str, equation: &'static str, params: &'static [Param], ports: Ports) -> Info {
        Info { name, role: Role::Force, claim: "", equation, params, states: 0, ports, family: "own", source: "", range: "" }
    }

    /// Index of the parameter of this name.
    pub fn param(&self, name: &str) -> Option<usize> {
        self.params.iter().position(|p| p.name == name)
    }
}
