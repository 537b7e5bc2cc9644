//! Sets 58 and 58b: functions at nodal degrees of freedom.

use num_complex::Complex64;

use super::binary::{self, Binary};
use super::numbers;
use super::text::{Fault, Fields, Lines};
use crate::data::Note;

pub(super) const TYPES: &str = "2 (real, single), 4 (real, double), 5 (complex, single) or 6 (complex, double)";

/// A degree of freedom: node and direction.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dof {
    pub entity: String,
    pub node: i64,
    /// 0 scalar; 1, 2, 3 translation along x, y, z; 4, 5, 6 rotation about them; negative against them.
    pub direction: i64,
}

impl Dof {
    /// `5:+Z`, `5:-RX`, `5:S` for a scalar.
    pub fn label(&self) -> String {
        let sign = if self.direction < 0 { '-' } else { '+' };
        let axis = match self.direction.abs() {
            1 => "X",
            2 => "Y",
            3 => "Z",
            4 => "RX",
            5 => "RY",
            6 => "RZ",
            _ => return format!("{}:S", self.node),
        };
        format!("{}:{sign}{axis}", self.node)
    }
}

/// What an axis carries.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// Specific data type: 8 displacement, 11 velocity, 12 acceleration, 13 excitation force, 17 time, 18 frequency, ...
    pub data_type: i64,
    /// Exponents of length, force and temperature in its unit.
    pub exponents: [i64; 3],
    pub label: String,
    pub unit: String,
}

/// The text of a function.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FunctionHeader {
    pub id: [String; 5],
    /// 1 time response, 2 auto spectrum, 3 cross spectrum, 4 frequency response function, 6 coherence, 9 power spectral density, ...
    pub function_type: i64,
    pub function_number: i64,
    pub version: i64,
    pub load_case: i64,
    pub response: Dof,
    pub reference: Dof,
    /// 2 real single, 4 real double, 5 complex single, 6 complex double.
    pub ordinate_type: i64,
    /// Points the header declares.
    pub points: usize,
    pub even: bool,
    /// First abscissa and step (even).
    pub abscissa_first: f64,
    pub abscissa_step: f64,
    pub z_value: f64,
    pub abscissa: Axis,
    pub ordinate: Axis,
    pub denominator: Axis,
    pub z: Axis,
}

impl FunctionHeader {
    pub fn complex(&self) -> bool {
        matches!(self.ordinate_type, 5 | 6)
    }

    /// `5:+Z/1:+Z`, or the response alone where there is no reference.
    pub fn label(&self) -> String {
        let none = self.reference.node == 0 && self.reference.direction == 0;
        if none { self.response.label() } else { format!("{}/{}", self.response.label(), self.reference.label()) }
    }
}

/// The word for a function type.
pub fn function_kind(function_type: i64) -> &'static str {
    const KINDS: [&str; 28] = [
        "general function",
        "time response",
        "auto spectrum",
        "cross spectrum",
        "frequency response function",
        "transmissibility",
        "coherence",
        "auto correlation",
        "cross correlation",
        "power spectral density",
        "energy spectral density",
        "probability density",
        "spectrum",
        "cumulative frequency distribution",
        "peaks and valleys",
        "stress cycles",
        "strain cycles",
        "orbit",
        "mode indicator function",
        "force pattern",
        "partial power",
        "partial coherence",
        "eigenvalue",
        "eigenvector",
        "shock response spectrum",
        "finite impulse response filter",
        "multiple coherence",
        "order function",
    ];
    usize::try_from(function_type).ok().and_then(|k| KINDS.get(k)).copied().unwrap_or("function of unknown type")
}

/// Ordinate values as stored.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    Real(Vec<f64>),
    Complex(Vec<Complex64>),
}

impl Values {
    pub fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Complex(v) => v.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A function, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    pub header: FunctionHeader,
    pub abscissa: Vec<f64>,
    pub values: Values,
    /// What does not agree in it.
    pub findings: Vec<Note>,
}

/// Reads the eleven lines of text; gives where the data begin.
pub(super) fn header(body: &[u8]) -> Result<(FunctionHeader, usize), Fault> {
    let mut lines = Lines::new(body);
    let mut id: [String; 5] = Default::default();
    for text in &mut id {
        *text = lines.need("its five lines of text")?.text.trim().to_string();
    }
    let line = lines.need("its degrees of freedom")?;
    let dof = Fields::new(&line, &[5, 10, 5, 10, 11, 10, 4, 11, 10, 4]);
    let at = |from: usize, what: &str| {
        let (node, direction) = (format!("the {what} node"), format!("the {what} direction"));
        Ok(Dof { entity: dof.text(from), node: dof.integer(from + 1, &node)?, direction: dof.integer(from + 2, &direction)? })
    };
    let (response, reference) = (at(4, "response")?, at(7, "reference")?);
    let (function_type, function_number) = (dof.integer(0, "the function type")?, dof.integer(1, "the function number")?);
    let (version, load_case) = (dof.integer(2, "the version")?, dof.integer(3, "the load case")?);
    let line = lines.need("the form of its data")?;
    let form = Fields::new(&line, &[10, 10, 10, 13, 13, 13]);
    let ordinate_type = form.integer(0, "the ordinate data type")?;
    if !matches!(ordinate_type, 2 | 4 | 5 | 6) {
        return Err(Fault::new(line.offset, format!("ordinate data type {ordinate_type}"), TYPES));
    }
    let points = usize::try_from(form.integer(1, "the number of points")?)
        .map_err(|_| Fault::new(line.offset, "a negative number of points", "a number of points above 0"))?;
    let spacing = form.integer(2, "the abscissa spacing")?;
    if !matches!(spacing, 0 | 1) {
        return Err(Fault::new(line.offset, format!("an abscissa spacing of {spacing}"), "0 (uneven) or 1 (even)"));
    }
    let (abscissa_first, abscissa_step) = (form.real(3, "the first abscissa")?, form.real(4, "the abscissa step")?);
    let z_value = form.real(5, "the z value")?;
    let mut axis = |what: &str| {
        let line = lines.need(what)?;
        let f = Fields::new(&line, &[10, 5, 5, 5, 21, 21]);
        let data_type = f.integer(0, "the specific data type")?;
        let exponents =
            [f.integer(1, "the length exponent")?, f.integer(2, "the force exponent")?, f.integer(3, "the temperature exponent")?];
        let none = |t: String| if t.eq_ignore_ascii_case("none") { String::new() } else { t };
        Ok(Axis { data_type, exponents, label: none(f.text(4)), unit: none(f.text(5)) })
    };
    let abscissa = axis("its abscissa")?;
    let ordinate = axis("its ordinate")?;
    let denominator = axis("the denominator of its ordinate")?;
    let z = axis("its z axis")?;
    let header = FunctionHeader {
        id,
        function_type,
        function_number,
        version,
        load_case,
        response,
        reference,
        ordinate_type,
        points,
        even: spacing == 1,
        abscissa_first,
        abscissa_step,
        z_value,
        abscissa,
        ordinate,
        denominator,
        z,
    };
    Ok((header, lines.at))
}

/// Decodes a function.
pub(super) fn read(body: &[u8], binary: Option<&Binary>) -> Result<Function, Fault> {
    let (header, start) = header(body)?;
    let double = matches!(header.ordinate_type, 4 | 6);
    let per_point = usize::from(!header.even) + if header.complex() { 2 } else { 1 };
    let mut findings = Vec::new();
    let numbers = match binary {
        Some(b) => {
            if let Some(lie) = b.lie {
                let text = format!(
                    "the header names {lie} bytes of data, {} stand there, as its {} points need",
                    body.len() - b.data,
                    header.points
                );
                findings.push(Note::new("bytes", text));
            }
            binary::numbers(body, b, double)
        }
        None => text(&body[start.min(body.len())..], start, &header, double, per_point)?,
    };
    let points = numbers.len() / per_point;
    if points != header.points || !numbers.len().is_multiple_of(per_point) {
        findings.push(Note::new(
            "points",
            format!("{} points are declared, {} numbers of {per_point} a point stand there", header.points, numbers.len()),
        ));
    }
    let bad = numbers.iter().filter(|v| !v.is_finite()).count();
    if bad > 0 {
        let first = numbers.iter().position(|v| !v.is_finite()).unwrap_or(0) / per_point + 1;
        findings.push(Note::new("values", format!("{bad} values are no finite numbers, the first at point {first}")));
    }
    if header.even && header.points > 1 && header.abscissa_step == 0.0 {
        findings.push(Note::new("abscissa", "the abscissa is even with a step of 0"));
    }
    Ok(split(header, numbers, per_point, findings))
}

fn text(data: &[u8], start: usize, header: &FunctionHeader, double: bool, per_point: usize) -> Result<Vec<f64>, Fault> {
    let patterns: &[&[usize]] = match (double, header.even, header.complex()) {
        (false, ..) => &[&[13], &[20]],
        (true, true, _) => &[&[20], &[13]],
        (true, false, false) => &[&[13, 20], &[20]],
        (true, false, true) => &[&[13, 20, 20], &[20]],
    };
    // One more than declared, so that too many are seen.
    let limit = header.points.saturating_mul(per_point).saturating_add(per_point);
    numbers::all(data, patterns, limit).map_err(|f| Fault { offset: start + f.offset, ..f })
}

fn split(header: FunctionHeader, numbers: Vec<f64>, per_point: usize, findings: Vec<Note>) -> Function {
    let points = numbers.len() / per_point;
    let even = |i: usize| header.abscissa_first + i as f64 * header.abscissa_step;
    let abscissa: Vec<f64> =
        if header.even { (0..points).map(even).collect() } else { numbers.chunks_exact(per_point).map(|p| p[0]).collect() };
    let values = match (header.complex(), header.even) {
        (false, true) => Values::Real(numbers),
        (false, false) => Values::Real(numbers.chunks_exact(2).map(|p| p[1]).collect()),
        (true, true) => Values::Complex(numbers.as_chunks::<2>().0.iter().map(|p| Complex64::new(p[0], p[1])).collect()),
        (true, false) => Values::Complex(numbers.as_chunks::<3>().0.iter().map(|p| Complex64::new(p[1], p[2])).collect()),
    };
    Function { header, abscissa, values, findings }
}
