//! Frequency response functions, with the noise of each line.

mod histories;

use super::channel::{ChannelSpec, Role, Sigma, along_axis, channels, place, sigma};
use super::dataset::{Source, columns, no_channel, only};
use super::readers::{Column, Columns};
use super::record::{content, to_si};
use super::toml_strict::TableView;
use super::{DataError, Note};
use crate::units::{Dimension, Unit};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// Noise below this part of the rms of |H| is floored: a coherence of 1 is rounded, and simulated data have none.
const NOISE_FLOOR: f64 = 1e-6;

/// What the response is: acceleration, velocity or displacement per force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrfQuantity {
    Accelerance,
    Mobility,
    Receptance,
}

impl FrfQuantity {
    pub const WORDS: [(&'static str, FrfQuantity); 3] =
        [("accelerance", FrfQuantity::Accelerance), ("mobility", FrfQuantity::Mobility), ("receptance", FrfQuantity::Receptance)];

    /// The word of dataset.toml.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, q)| *q == self).map_or("", |(w, _)| w)
    }

    /// Power of i omega that takes a receptance to it.
    pub fn derivatives(self) -> i32 {
        match self {
            Self::Receptance => 0,
            Self::Mobility => 1,
            Self::Accelerance => 2,
        }
    }

    /// (i omega)^n: times a receptance, gives this quantity.
    pub fn from_receptance(self, omega: f64) -> Complex64 {
        Complex64::new(0.0, omega).powi(self.derivatives())
    }
}

/// A measured FRF, convention e^{+i omega t}, H = response / force. SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Frf {
    pub test: String,
    pub file: PathBuf,
    /// `name.axis` of the force.
    pub excite: String,
    /// `name.axis` of the response.
    pub respond: String,
    /// What was measured.
    pub quantity: FrfQuantity,
    /// Unit of the file, for printing.
    pub unit: Unit,
    /// Peak amplitude of the exciting force (N) or moment (N m), of the line where it is largest; none is small signal.
    pub excitation: Option<f64>,
    /// The part of that which each line was excited with; empty where all had as much.
    pub parts: Vec<f64>,
    /// Hz, ascending.
    pub frequency: Vec<f64>,
    /// The measured quantity.
    pub measured: Vec<Complex64>,
    /// Standard deviation of the real part, and of the imaginary part, of `measured` (each; the complex deviation is sqrt 2 of it).
    pub sigma: Vec<f64>,
    /// The receptance: measured / (i omega)^n.
    pub receptance: Vec<Complex64>,
    /// Standard deviation of the real part, and of the imaginary part, of `receptance`.
    pub receptance_sigma: Vec<f64>,
    pub coherence: Option<Vec<f64>>,
    pub notes: Vec<Note>,
}

impl Frf {
    /// An FRF that is already in memory, in SI: `measured` with the standard deviation of each line's real part, and of its imaginary part.
    pub fn new(
        test: &str,
        excite: &str,
        respond: &str,
        quantity: FrfQuantity,
        frequency: Vec<f64>,
        measured: Vec<Complex64>,
        sigma: Vec<f64>,
    ) -> Frf {
        let along = |role: Role, at: &str| along_axis(role.dimensions(), Some(at))[0];
        let per_time = Dimension::TIME.power(quantity.derivatives() as i8);
        let unit = Unit::si(along(Role::Displacement, respond).over(per_time).over(along(Role::Force, excite)));
        let excited = Excited { excite: excite.into(), respond: respond.into(), quantity, excitation: None, mass: None };
        excited.frf(test, PathBuf::new(), unit, frequency, measured, sigma, None, vec![])
    }
}

const ROLES: [Role; 7] = [Role::Frequency, Role::Real, Role::Imag, Role::Amplitude, Role::Phase, Role::Coherence, Role::Excitation];

pub(super) fn read(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<Frf, DataError> {
    only(
        table,
        &["file", "excite", "respond", "quantity", "excitation", "response_amplitude", "noise", "channels", "estimate", "load_cell_mass"],
    )?;
    let excite = place(&table.require("excite", "the place of the force, such as \"m1.x\"")?)?;
    let respond = place(&table.require("respond", "the place of the response, such as \"m8.x\"")?)?;
    let quantity = table.require("quantity", "\"accelerance\", \"mobility\" or \"receptance\"")?.word("quantity", &FrfQuantity::WORDS)?;
    let forces = along_axis(&[Dimension::FORCE, Dimension::MOMENT], Some(&excite));
    let excitation = table.optional("excitation", |v| {
        let q = v.quantity_of(&forces)?;
        if q.value > 0.0 {
            Ok(q.value)
        } else {
            Err(v.refuse(format!("an excitation of {q}"), "a peak force above 0, or no key for small signal"))
        }
    })?;
    let mass = table.optional("load_cell_mass", |v| v.quantity(Dimension::MASS))?.map(|q| q.value);
    if let (Some(_), Some(v)) = (mass, table.get("load_cell_mass"))
        && excite != respond
    {
        let accepted = "excite and respond at one place; elsewhere the mass is an effect of the model, added_mass";
        return Err(v.refuse("the mass of a load cell can be taken off a driving-point FRF only", accepted).into());
    }
    let excited = Excited { excite: excite.clone(), respond: respond.clone(), quantity, excitation, mass };
    if table.has("estimate") {
        if let Some(v) = table.get("response_amplitude") {
            return Err(v
                .refuse("a response that is estimated from histories was held at no amplitude", "excitation, or nothing for small signal")
                .into());
        }
        return histories::read(table, id, source, excited);
    }
    let noise = table.optional("noise", |v| sigma(&v, &Unit::si(Dimension::DIMENSIONLESS)))?.map(|s| match s {
        Sigma::Absolute(f) | Sigma::Relative(f) => f,
    });
    let per_time = Dimension::TIME.power(quantity.derivatives() as i8);
    let responses = along_axis(&[Dimension::LENGTH, Dimension::ANGLE], Some(&respond));
    let dimensions: Vec<Dimension> = forces.iter().flat_map(|f| responses.iter().map(move |r| r.over(per_time).over(*f))).collect();
    let specs = channels(table, &ROLES, &dimensions)?;
    // Of the quantity that answers, along the axis of its place.
    let held = table.optional("response_amplitude", |v| {
        let of: Vec<Dimension> = responses.iter().map(|r| r.over(per_time)).collect();
        let q = v.quantity_of(&of)?;
        if q.value > 0.0 {
            Ok(q.value)
        } else {
            Err(v.refuse(format!("a response of {q}"), "a peak response above 0, at which every line was held"))
        }
    })?;
    let forces = specs.iter().any(|s| s.role == Role::Excitation);
    if usize::from(excitation.is_some()) + usize::from(held.is_some()) + usize::from(forces) > 1 {
        let accepted = "one of them: excitation for one force at all lines, response_amplitude for one response at all lines, a channel of role excitation \
                        for the peak force of each";
        return Err(table.refuse("what the lines were excited with is said twice", accepted).into());
    }
    let has = |role: Role| specs.iter().any(|s| s.role == role);
    if !has(Role::Frequency) {
        return Err(no_channel(table, "role = \"frequency\"").into());
    }
    let cartesian = has(Role::Real) && has(Role::Imag);
    let polar = has(Role::Amplitude) && has(Role::Phase);
    if cartesian == polar {
        let what = "role = \"real\" and one with role = \"imag\" (or amplitude and phase instead)";
        return Err(no_channel(table, what).into());
    }
    let file = source.file(table, id)?;
    let mut rows = columns(table, id, &file, &specs)?;
    if let Some(found) = rows.quantity.filter(|q| *q != quantity)
        && let Some(spec) = specs.iter().find(|s| matches!(s.role, Role::Real | Role::Amplitude))
    {
        let message = format!("the file says {}, and {} is declared", found.word(), quantity.word());
        let accepted = format!("quantity = \"{}\", or header_units = \"ignore\" where the file is wrong", found.word());
        return Err(content(&file, None, id, spec, &message, &accepted));
    }
    let mut values = Vec::with_capacity(specs.len());
    for (column, spec) in std::mem::take(&mut rows.columns).into_iter().zip(&specs) {
        let Column::Numbers(mut column) = column else { continue };
        to_si(&file, &rows, id, spec, &mut column)?;
        values.push(column);
    }
    let mut notes: Vec<Note> = specs.iter().filter_map(|s| s.reading.note(&s.label(), &s.unit)).collect();
    // Analysers write their lines from 0 Hz on, where neither mobility nor accelerance says anything of the receptance.
    let at = specs.iter().position(|s| s.role == Role::Frequency).unwrap_or(0);
    let from_zero = values.get(at).is_some_and(|f| f.first() == Some(&0.0)) && quantity != FrfQuantity::Receptance;
    if from_zero {
        values.iter_mut().for_each(|v| {
            v.remove(0);
        });
        rows.skip_first();
        notes.push(Note::new("frequency", "the line at 0 Hz has no receptance and is left out"));
    }
    let column = |role: Role| specs.iter().zip(&values).find(|(s, _)| s.role == role);
    let lines = Lines { file: &file, rows: &rows, id };
    let Some((spec, frequency)) = column(Role::Frequency) else { return Err(no_channel(table, "role = \"frequency\"").into()) };
    lines.frequencies(spec, frequency, quantity)?;
    let (first, second) = if cartesian { (Role::Real, Role::Imag) } else { (Role::Amplitude, Role::Phase) };
    let (Some((first_spec, first)), Some((second_spec, second))) = (column(first), column(second)) else {
        return Err(no_channel(table, "role = \"real\" and one with role = \"imag\"").into());
    };
    let pair = first.iter().zip(second);
    let measured: Vec<Complex64> =
        pair.map(|(a, b)| if cartesian { Complex64::new(*a, *b) } else { Complex64::from_polar(*a, *b) }).collect();
    let coherence = column(Role::Coherence);
    if let Some((spec, values)) = coherence {
        lines.coherence(spec, values)?;
    }
    let declared = declared(&measured, first_spec, second_spec, cartesian).or_else(|| noise.map(|f| relative(&measured, f)));
    let mut sigma = match (declared, coherence) {
        (Some(sigma), _) => sigma,
        (None, Some((spec, values))) => from_coherence(&measured, values, spec.averages.unwrap_or(1)),
        (None, None) => {
            notes.push(Note::new(
                "noise",
                "neither coherence nor sigma is given; noise is estimated from the scatter between neighbouring lines",
            ));
            from_scatter(frequency, &measured).ok_or_else(|| {
                content(
                    &file,
                    None,
                    id,
                    first_spec,
                    "too few lines to estimate the noise from",
                    "a coherence channel, sigma on real and imag, or noise = \"1 %\"",
                )
            })?
        }
    };
    floor(&measured, &mut sigma, &mut notes);
    let (unit, frequency) = (first_spec.unit.clone(), frequency.clone());
    let coherence = coherence.map(|(_, v)| v.clone());
    let read = excited.frf(id, file.clone(), unit, frequency, measured, sigma, coherence, notes);
    let by_line: Vec<f64> = match (column(Role::Excitation), held) {
        (Some((spec, forces)), _) => {
            if let Some(i) = forces.iter().position(|f| *f <= 0.0) {
                let message = format!("an excitation of {}", spec.unit.print(forces[i]));
                return Err(lines.fail(i, spec, &message, "the peak force of every line, above 0"));
            }
            forces.clone()
        }
        // The force that made the response what it was held at.
        (None, Some(response)) => read.measured.iter().map(|h| response / h.norm()).collect(),
        (None, None) => return Ok(read),
    };
    if let Some(i) = by_line.iter().position(|f| !f.is_finite()) {
        let message = "no response at all, which no force holds at an amplitude";
        return Err(lines.fail(i, first_spec, message, "a response above 0 at every line"));
    }
    let largest = by_line.iter().fold(0.0f64, |m, f| m.max(*f));
    Ok(Frf { excitation: Some(largest), parts: by_line.iter().map(|f| f / largest).collect(), ..read })
}

/// Where and how a structure is excited.
struct Excited {
    excite: String,
    respond: String,
    quantity: FrfQuantity,
    excitation: Option<f64>,
    /// Mass between the force gauge and the structure, kg.
    mass: Option<f64>,
}

impl Excited {
    #[allow(clippy::too_many_arguments)]
    fn frf(
        self,
        id: &str,
        file: PathBuf,
        unit: Unit,
        frequency: Vec<f64>,
        mut measured: Vec<Complex64>,
        mut sigma: Vec<f64>,
        coherence: Option<Vec<f64>>,
        mut notes: Vec<Note>,
    ) -> Frf {
        let factor = |f: &f64| self.quantity.from_receptance(TAU * f);
        if let Some(mass) = self.mass {
            // H = H_m / (1 - m A), A the measured accelerance; dH / dH_m = (H / H_m)^2.
            let accelerance: Vec<Complex64> =
                frequency.iter().zip(&measured).map(|(f, h)| h / factor(f) * FrfQuantity::Accelerance.from_receptance(TAU * f)).collect();
            let without = super::frf_estimate::without_driven_mass(&measured, &accelerance, mass);
            sigma.iter_mut().zip(measured.iter().zip(&without)).for_each(|(s, (a, b))| *s *= (b / a).norm_sqr());
            measured = without;
            notes.push(Note::new("load cell", format!("a mass of {mass} kg between force gauge and structure is taken off")));
        }
        Frf {
            test: id.to_string(),
            file,
            unit,
            receptance: frequency.iter().zip(&measured).map(|(f, h)| h / factor(f)).collect(),
            receptance_sigma: frequency.iter().zip(&sigma).map(|(f, s)| s / factor(f).norm()).collect(),
            excite: self.excite,
            respond: self.respond,
            quantity: self.quantity,
            excitation: self.excitation,
            parts: vec![],
            frequency,
            measured,
            sigma,
            coherence,
            notes,
        }
    }
}

struct Lines<'a> {
    file: &'a Path,
    rows: &'a Columns,
    id: &'a str,
}

impl Lines<'_> {
    fn fail(&self, i: usize, spec: &ChannelSpec, message: &str, accepted: &str) -> DataError {
        content(self.file, Some(self.rows.place(i)), self.id, spec, message, accepted)
    }

    fn frequencies(&self, spec: &ChannelSpec, frequency: &[f64], quantity: FrfQuantity) -> Result<(), DataError> {
        let lowest_allowed = |f: f64| if quantity == FrfQuantity::Receptance { f >= 0.0 } else { f > 0.0 };
        if let Some(i) = frequency.iter().position(|f| !lowest_allowed(*f)) {
            let message = format!("a frequency of {} has no receptance", spec.unit.print(frequency[i]));
            return Err(self.fail(i, spec, &message, "frequencies above 0 Hz (0 Hz for a receptance)"));
        }
        if let Some(i) = frequency.windows(2).position(|w| w[1] <= w[0]) {
            let what = if frequency[i + 1] == frequency[i] { "is repeated" } else { "goes back" };
            let message = format!("the frequency {what}: {} after {}", spec.unit.print(frequency[i + 1]), spec.unit.print(frequency[i]));
            return Err(self.fail(i + 1, spec, &message, "frequencies that ascend from row to row"));
        }
        Ok(())
    }

    fn coherence(&self, spec: &ChannelSpec, values: &[f64]) -> Result<(), DataError> {
        match values.iter().position(|g| !(*g > 0.0 && *g <= 1.0)) {
            None => Ok(()),
            Some(i) => Err(self.fail(i, spec, &format!("a coherence of {}", values[i]), "a coherence above 0 and at most 1")),
        }
    }
}

/// sigma of each part where real and imag (or amplitude and phase) declare theirs. Two different ones are pooled: the residual is whitened by one.
fn declared(h: &[Complex64], first: &ChannelSpec, second: &ChannelSpec, cartesian: bool) -> Option<Vec<f64>> {
    let one = |s: Option<Sigma>, h: &Complex64, is_phase: bool| match s? {
        Sigma::Absolute(s) if is_phase => Some(s * h.norm()),
        Sigma::Absolute(s) => Some(s),
        Sigma::Relative(f) => Some(f * h.norm()),
    };
    h.iter()
        .map(|h| match (one(first.sigma, h, false), one(second.sigma, h, !cartesian)) {
            (Some(a), Some(b)) => Some((0.5 * (a * a + b * b)).sqrt()),
            (a, b) => a.or(b),
        })
        .collect()
}

fn relative(h: &[Complex64], fraction: f64) -> Vec<f64> {
    h.iter().map(|h| fraction * h.norm()).collect()
}

/// sigma = |H| sqrt((1 - g2) / (2 n g2)): standard deviation of the magnitude, and of the phase times the magnitude, so of the real and of the
/// imaginary part each (Bendat and Piersol, Random Data, 4th ed., eq. 9.90), for n averages and the coherence g2.
fn from_coherence(h: &[Complex64], coherence: &[f64], averages: u32) -> Vec<f64> {
    let deviation = |(h, g): (&Complex64, &f64)| h.norm() * ((1.0 - g) / (2.0 * f64::from(averages) * g)).sqrt();
    h.iter().zip(coherence).map(deviation).collect()
}

/// Noise from neighbouring lines: the fourth divided difference over five lines is blind to any cubic, so that what is left is noise (and,
/// where a resonance is narrower than a few lines, its curvature: the estimate is then too large). Normalised to unit noise gain; the local
/// level is the median over 21 differences (of |d|^2, exponential with mean 2 sigma^2). None below 7 lines.
fn from_scatter(frequency: &[f64], h: &[Complex64]) -> Option<Vec<f64>> {
    let n = frequency.len();
    if n < 7 {
        return None;
    }
    let differences: Vec<f64> = (0..n - 4)
        .map(|i| {
            let f = &frequency[i..i + 5];
            let scale = (f[4] - f[0]) / 4.0;
            let weight = |j: usize| (0..5).filter(|k| *k != j).map(|k| scale / (f[j] - f[k])).product::<f64>();
            let weights: [f64; 5] = std::array::from_fn(weight);
            let gain: f64 = weights.iter().map(|w| w * w).sum();
            weights.iter().zip(&h[i..]).map(|(w, h)| h * *w).sum::<Complex64>().norm_sqr() / gain
        })
        .collect();
    let level = |i: usize| {
        let centre = i.saturating_sub(2).min(differences.len() - 1);
        let (from, to) = (centre.saturating_sub(10), (centre + 11).min(differences.len()));
        let mut window = differences[from..to].to_vec();
        window.sort_by(f64::total_cmp);
        (window[window.len() / 2] / (2.0 * std::f64::consts::LN_2)).sqrt()
    };
    Some((0..n).map(level).collect())
}

/// Raises sigma to a part of the rms of |H| where it is below.
fn floor(h: &[Complex64], sigma: &mut [f64], notes: &mut Vec<Note>) {
    let rms = (h.iter().map(|h| h.norm_sqr()).sum::<f64>() / h.len().max(1) as f64).sqrt();
    let lowest = (NOISE_FLOOR * rms).max(f64::MIN_POSITIVE);
    let below = sigma.iter().filter(|s| **s < lowest).count();
    sigma.iter_mut().for_each(|s| *s = s.max(lowest));
    if below > 0 {
        notes.push(Note::new("noise", format!("sigma is floored at {NOISE_FLOOR:.0e} of the rms of |H| on {below} of {} lines", h.len())));
    }
}

#[cfg(test)]
mod tests;
