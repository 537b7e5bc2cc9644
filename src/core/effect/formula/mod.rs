//! A force law given in the study file, without compiling.
//!
//! ```toml
//! [[effect]]
//! effect = "formula"
//! at = "c1.x"
//! expression = "k*x + f*z"
//! states = { z = "(v - abs(v)*z)/d" }
//! k = { start = "20 N/mm", min = "0 N/mm", max = "100 N/mm" }
//! f = { start = "5 N", min = "0 N", max = "50 N" }
//! d = { start = "0.1 mm", min = "0.01 mm", max = "1 mm" }
//! ```
//!
//! `x`, `v`, `a` are relative displacement, velocity, acceleration; every other name is a parameter or a state. A state's text is its rate;
//! it starts at 0 and is integrated by the second-order backward formula within the step. Tangents and sensitivities come from evaluating
//! the same program over dual numbers.

use std::sync::{Mutex, PoisonError};

use nalgebra::{Matrix4, Vector4};
use num_complex::{Complex, Complex64};
use num_dual::{DualSVec, DualSVec64};

use super::dispatch::{self, ForceLaw, Tangent, Update};
use super::info::{Dim, Info, Kind, Param, Ports, Role, Sign};
use super::num::bdf2;
use super::{Effect, EffectError, Inputs, Num};
use crate::units::Dimension;

mod dimension;
mod error;
mod examine;
mod parse;
mod program;
#[cfg(test)]
mod tests;

pub use error::FormulaError;
pub use examine::Motion;

use dimension::{Quantity, infer};
use program::{FUNCTIONS, Program};

/// What the library says of formulas in general.
pub static FORMULA: Info = Info {
    name: "formula",
    role: Role::Force,
    claim: "a force law written in the study file: expression = \"k*x + c*v*abs(x)\", with its parameters and states beside it",
    equation: "F = expression(x, v, a, states; parameters),  d(state)/dt = its own expression",
    params: &[],
    states: 0,
    ports: Ports { x: true, v: true, a: true, dx: false },
    family: "formula",
    source: "the study; + - * / ^, sin cos tan exp log sqrt abs sign min max tanh asinh pow, pi; -x^2 = -(x^2), 2^3^2 = 2^9",
    range: "up to 7 parameters and 4 states; refused when it has no value at the tested motion or gives energy back over closed cycles",
};

/// Parameters at most: as many as a stiffness has derivatives for.
pub const PARAMETERS: usize = 7;
/// States at most.
pub const STATES: usize = 4;
/// x, v, a, states, parameters.
const VARIABLES: usize = 3 + STATES + PARAMETERS;
/// The motion.
const MOTION: [&str; 3] = ["x", "v", "a"];

/// A formula as it is declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// The force.
    pub expression: String,
    /// Name and rate of each state.
    pub states: Vec<(String, String)>,
    /// Name and dimension of each parameter.
    pub parameters: Vec<(String, Dimension)>,
    /// Whether it may give energy back.
    pub active: bool,
    /// Whether it acts about a rotation.
    pub rotational: bool,
}

/// Which text of a definition an error is about.
#[derive(Clone, Debug, PartialEq)]
pub enum Part {
    /// The expression.
    Expression,
    /// The rate of this state.
    State(String),
    /// The declaration of this parameter.
    Parameter(String),
}

/// A formula made ready.
pub struct Formula {
    /// As declared.
    pub definition: Definition,
    info: &'static Info,
    force: Program,
    rates: Vec<Program>,
    n_params: usize,
}

/// The law of a definition. Each one is made once and kept for the life of the program, as the laws of the library are: loading the same
/// study again finds it.
pub fn compile(definition: &Definition) -> Result<&'static Effect, (Part, FormulaError)> {
    static KNOWN: Mutex<Vec<(Definition, &'static Effect)>> = Mutex::new(Vec::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, effect)) = known.iter().find(|k| k.0 == *definition) {
        return Ok(effect);
    }
    let formula: &'static Formula = Box::leak(Box::new(Formula::new(definition)?));
    let effect: &'static Effect = Box::leak(Box::new(Effect::Force(formula)));
    known.push((definition.clone(), effect));
    Ok(effect)
}

impl Formula {
    fn new(definition: &Definition) -> Result<Formula, (Part, FormulaError)> {
        let Definition { expression, states, parameters, .. } = definition;
        let plain = |part: Part, text: &str, message: String, accepted: &str| {
            (part, FormulaError::Syntax { text: text.into(), position: 1, message, accepted: accepted.into() })
        };
        let states_of = |name: &String| Part::State(name.clone());
        let mut names: Vec<&str> = MOTION.to_vec();
        for (name, part) in
            states.iter().map(|s| (&s.0, states_of(&s.0))).chain(parameters.iter().map(|p| (&p.0, Part::Parameter(p.0.clone()))))
        {
            let word = name.chars().all(|c| c.is_alphanumeric() || c == '_') && name.chars().next().is_some_and(|c| !c.is_ascii_digit());
            if !word {
                return Err(plain(
                    part,
                    name,
                    format!("`{name}` is no name a formula can use"),
                    "letters, digits and _, not a digit first",
                ));
            }
            if name == "pi" || names.contains(&name.as_str()) || FUNCTIONS.iter().any(|f| f.0 == name) {
                return Err(plain(part, name, format!("`{name}` has a meaning already"), "another name"));
            }
            names.push(name);
        }
        if states.len() > STATES || parameters.len() > PARAMETERS {
            let message = format!("{} states and {} parameters", states.len(), parameters.len());
            return Err(plain(Part::Expression, expression, message, &format!("at most {STATES} states and {PARAMETERS} parameters")));
        }
        let force = parse::parse(expression, &names).map_err(|e| (Part::Expression, e))?;
        let rates = states
            .iter()
            .map(|(name, text)| parse::parse(text, &names).map_err(|e| (states_of(name), e)))
            .collect::<Result<Vec<_>, _>>()?;
        let reads = |v: usize| force.reads(v) || rates.iter().any(|r| r.reads(v));
        if let Some(unused) = (3..names.len()).find(|v| !reads(*v)) {
            let name = names[unused].to_string();
            let part = if unused < 3 + states.len() { Part::State(name.clone()) } else { Part::Parameter(name.clone()) };
            return Err(plain(part, expression, format!("`{name}` is declared and not used"), "a formula that uses it, or no such key"));
        }
        let ports = Ports { x: reads(0), v: reads(1), a: reads(2), dx: false };
        let mut formula = Formula { definition: definition.clone(), info: &FORMULA, force, rates, n_params: parameters.len() };
        formula.check_dimensions()?;
        let leak = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
        let param = |(name, dimension): &(String, Dimension)| Param {
            name: leak(name.clone()),
            dim: Dim::Declared(*dimension),
            kind: Kind::Strength,
            ..Param::strength("", Dim::One, Sign::Any, "declared in the study")
        };
        let equation = std::iter::once(format!("F = {expression}")).chain(states.iter().map(|(name, rate)| format!("d{name}/dt = {rate}")));
        formula.info = Box::leak(Box::new(Info {
            equation: leak(equation.collect::<Vec<_>>().join(",  ")),
            params: Box::leak(parameters.iter().map(param).collect()),
            states: 2 * states.len(),
            ports,
            ..FORMULA
        }));
        Ok(formula)
    }

    /// Dimensions of both sides; those of the states follow from their rates.
    fn check_dimensions(&self) -> Result<(), (Part, FormulaError)> {
        let Definition { expression, states, parameters, rotational, .. } = &self.definition;
        let (force, length) = if *rotational { (Dimension::MOMENT, Dimension::ANGLE) } else { (Dimension::FORCE, Dimension::LENGTH) };
        let motion = [length, length.over(Dimension::TIME), length.over(Dimension::TIME.power(2))].map(Quantity::of);
        let mut variables: Vec<Quantity> = motion.to_vec();
        variables.extend(states.iter().map(|_| Quantity::UNKNOWN));
        variables.extend(parameters.iter().map(|p| Quantity::of(p.1)));
        for round in 0..=states.len() {
            for (k, (name, text)) in states.iter().enumerate() {
                let rate = infer(text, &self.rates[k], &variables).map_err(|e| (Part::State(name.clone()), e))?;
                let whole = Quantity { dimension: rate.dimension.times(Dimension::TIME), loose: rate.loose };
                let state = variables[3 + k];
                if round == states.len() && !state.loose && !whole.loose && state.dimension != whole.dimension {
                    let message = format!("the rate of a {} is a {}", state.dimension.name(), rate.dimension.name());
                    let (text, accepted) = (text.clone(), format!("a {}", state.dimension.over(Dimension::TIME).name()));
                    return Err((Part::State(name.clone()), FormulaError::Syntax { text, position: 1, message, accepted }));
                }
                if state.loose {
                    variables[3 + k] = whole;
                }
            }
        }
        let result = infer(expression, &self.force, &variables).map_err(|e| (Part::Expression, e))?;
        if !result.loose && result.dimension != Quantity::of(force).dimension {
            let message = format!("the result is a {}", result.dimension.name());
            let accepted = format!("a {} ({})", force.name(), force.examples());
            return Err((Part::Expression, FormulaError::Syntax { text: expression.clone(), position: 1, message, accepted }));
        }
        Ok(())
    }

    fn n_states(&self) -> usize {
        self.rates.len()
    }

    /// `x, v, a`, the states, the parameters.
    fn variables<T: Num>(&self, motion: [T; 3], p: &[T]) -> [T; VARIABLES] {
        let mut all = [T::from(0.0); VARIABLES];
        all[..3].copy_from_slice(&motion);
        all[3 + self.n_states()..][..self.n_params].copy_from_slice(&p[..self.n_params]);
        all
    }

    /// Rates of the states and, with `jacobian`, their derivatives with respect to the states.
    fn rates(&self, variables: &[f64; VARIABLES], jacobian: Option<&mut Matrix4<f64>>) -> Vector4<f64> {
        let n = self.n_states();
        let mut rates = Vector4::zeros();
        let Some(jacobian) = jacobian else {
            (0..n).for_each(|k| rates[k] = self.rates[k].evaluate(variables));
            return rates;
        };
        let mut dual = variables.map(DualSVec64::<STATES>::from_re);
        (0..n).for_each(|k| dual[3 + k] = dual[3 + k].derivative(k));
        for k in 0..n {
            let rate = self.rates[k].evaluate(&dual);
            rates[k] = rate.re;
            (0..n).for_each(|j| jacobian[(k, j)] = rate.eps.0.as_ref().map_or(0.0, |m| m[j]));
        }
        rates
    }

    /// States at the end of the step, written into `all`: `bdf2(z) = rate(z)` by Newton's method, then one more Newton step in the number
    /// type with the real Jacobian, which carries the exact derivatives. States that cannot be found are no numbers.
    fn advance_states<T: Num>(&self, all: &mut [T; VARIABLES], dt: f64, s: &mut [T]) {
        let n = self.n_states();
        let mut real = all.map(|v| v.re());
        let old: [(f64, f64); STATES] = std::array::from_fn(|k| if k < n { (s[2 * k].re(), s[2 * k + 1].re()) } else { (0.0, 0.0) });
        let mut z = Vector4::from_fn(|k, _| old[k].0);
        let gap = |z: &Vector4<f64>, rates: Vector4<f64>| {
            Vector4::from_fn(|k, _| if k < n { bdf2(z[k], old[k].0, old[k].1, dt) - rates[k] } else { 0.0 })
        };
        let mut inverse = None;
        let mut settled = false;
        for _ in 0..50 {
            (0..n).for_each(|k| real[3 + k] = z[k]);
            let mut slopes = Matrix4::zeros();
            let residual = gap(&z, self.rates(&real, Some(&mut slopes)));
            let jacobian = Matrix4::from_fn(|i, j| f64::from(i == j) * if i < n { 1.5 / dt } else { 1.0 } - slopes[(i, j)]);
            inverse = jacobian.try_inverse();
            if settled || inverse.is_none() || !residual.norm().is_finite() {
                break;
            }
            let step = inverse.map_or(Vector4::zeros(), |m: Matrix4<f64>| m * residual);
            // Rates with kinks can send the full step back and forth: less of it, while the residual does not fall.
            let mut part = 1.0;
            for _ in 0..12 {
                let next = z - step * part;
                (0..n).for_each(|k| real[3 + k] = next[k]);
                if gap(&next, self.rates(&real, None)).norm() < residual.norm() || residual.norm() == 0.0 {
                    break;
                }
                part *= 0.5;
            }
            z -= step * part;
            settled = (0..n).all(|k| (step[k] * part).abs() <= 1e-14 * (z[k].abs() + old[k].0.abs()));
        }
        (0..n).for_each(|k| all[3 + k] = T::from(z[k]));
        let residual: [T; STATES] = std::array::from_fn(|k| {
            if k < n { bdf2(all[3 + k], s[2 * k], s[2 * k + 1], dt) - self.rates[k].evaluate(all) } else { T::from(0.0) }
        });
        for k in 0..n {
            let correction = inverse.map_or(T::from(f64::NAN), |m| (0..n).fold(T::from(0.0), |sum, j| sum + residual[j] * m[(k, j)]));
            all[3 + k] -= correction;
            s[2 * k + 1] = s[2 * k];
            s[2 * k] = all[3 + k];
        }
    }

    /// Derivatives at rest with respect to x, v, a and the states: of the force, then of the rates.
    fn linearised(&self, p: &[DualSVec64<8>]) -> [[DualSVec64<8>; 3 + STATES]; 1 + STATES] {
        type Nested = DualSVec<DualSVec64<8>, 8>;
        let zero = DualSVec64::<8>::from_re(0.0);
        let mut all = self.variables([zero; 3], p).map(Nested::from_re);
        for (k, v) in all.iter_mut().enumerate().take(3 + self.n_states()) {
            *v = v.derivative(k);
        }
        let row = |program: &Program| {
            let value = program.evaluate(&all);
            std::array::from_fn(|k| value.eps.0.as_ref().map_or(zero, |m| m[k]))
        };
        let mut rows = [[zero; 3 + STATES]; 1 + STATES];
        rows[0] = row(&self.force);
        self.rates.iter().enumerate().for_each(|(k, rate)| rows[1 + k] = row(rate));
        rows
    }

    /// `Z(s) = F_x + s F_v + s^2 F_a + F_z (s I - G_z)^-1 (G_x + s G_v + s^2 G_a)` at rest.
    fn dynamic_stiffness(&self, s: Complex<DualSVec64<8>>, p: &[DualSVec64<8>]) -> Result<Complex<DualSVec64<8>>, &'static str> {
        type D = DualSVec64<8>;
        let real = self.variables([0.0; 3], &p.iter().map(|p| p.re).collect::<Vec<_>>());
        if self.force.jump(&real).or(self.rates.iter().find_map(|r| r.jump(&real))).is_some() {
            return Err("tanh(v/v0) in place of sign(v), or a declared excitation amplitude of the FRF");
        }
        if (0..self.n_states()).any(|k| self.rates[k].evaluate(&real) != 0.0) {
            return Err("states that rest at 0 without motion, or a declared excitation amplitude of the FRF");
        }
        let rows = self.linearised(p);
        let n = self.n_states();
        let complex = |d: D| Complex::new(d, D::from_re(0.0));
        let drive = |row: &[D; 3 + STATES]| complex(row[0]) + s * row[1] + s * s * row[2];
        // Gauss with pivots over the states; the last column is the right-hand side.
        let mut m = [[complex(D::from_re(0.0)); STATES + 1]; STATES];
        for i in 0..n {
            for j in 0..n {
                m[i][j] = complex(-rows[1 + i][3 + j]);
            }
            m[i][i] += s;
            m[i][STATES] = drive(&rows[1 + i]);
        }
        let size = |z: &Complex<D>| z.re.re.hypot(z.im.re);
        for c in 0..n {
            let pivot = (c..n).max_by(|a, b| size(&m[*a][c]).total_cmp(&size(&m[*b][c]))).unwrap_or(c);
            m.swap(c, pivot);
            if size(&m[c][c]) == 0.0 {
                return Err("states that decay, or another frequency");
            }
            for r in (0..n).filter(|r| *r != c).collect::<Vec<_>>() {
                let factor = m[r][c] / m[c][c];
                let pivot_row = m[c];
                m[r].iter_mut().zip(pivot_row).for_each(|(x, y)| *x -= y * factor);
            }
        }
        Ok((0..n).fold(drive(&rows[0]), |sum, k| sum + m[k][STATES] / m[k][k] * rows[0][3 + k]))
    }
}

impl Update for Formula {
    fn ports(&self) -> Ports {
        self.info.ports
    }

    fn advance<T: Num>(&self, u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        let mut all = self.variables([u.x, u.v, u.a], p);
        if self.n_states() > 0 {
            self.advance_states(&mut all, dt, s);
        }
        self.force.evaluate(&all)
    }
}

impl ForceLaw for Formula {
    fn info(&self) -> &'static Info {
        self.info
    }
    fn linear(&self) -> bool {
        false
    }
    fn superposes(&self) -> bool {
        false
    }
    fn looks_back(&self) -> usize {
        self.n_states()
    }
    fn formula(&self) -> Option<&Formula> {
        Some(self)
    }
    fn value(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64]) -> f64 {
        self.advance(u, dt, s, p)
    }
    fn tangent(&self, u: &Inputs<f64>, dt: f64, s: &mut [f64], p: &[f64], wanted: dispatch::Wanted, out: &mut Tangent) {
        dispatch::tangent(self, u, dt, s, p, wanted, out);
    }
    fn stiffness(&self, s: Complex64, p: &[f64]) -> Result<Complex64, EffectError> {
        self.stiffness_tangent(s, p, &mut vec![Complex64::ZERO; p.len()]).map(|z| z.0)
    }
    fn stiffness_tangent(&self, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> Result<(Complex64, Complex64), EffectError> {
        dispatch::stiffness_tangent(self.info.name, s, p, dp, |s, p| self.dynamic_stiffness(s, p))
    }
}
