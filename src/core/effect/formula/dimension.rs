//! Dimensions of a formula: a length where a force belongs is an error.
//!
//! A bare number is taken in SI and fits any dimension, so that `tanh(v/0.001)` passes; angles are not told from pure numbers.

use super::FormulaError;
use super::program::{Function, Op, Program};
use crate::units::Dimension;

/// Dimension of a part of a formula; `loose` where a bare number, or a state not yet known, may have carried another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quantity {
    pub dimension: Dimension,
    pub loose: bool,
}

impl Quantity {
    pub fn of(dimension: Dimension) -> Self {
        Quantity { dimension: Dimension { angle: 0, ..dimension }, loose: false }
    }
    pub const UNKNOWN: Self = Quantity { dimension: Dimension::DIMENSIONLESS, loose: true };

    /// What both sides of a sum have; `None` where they cannot be summed.
    fn common(self, other: Self) -> Option<Self> {
        match (self.loose, other.loose) {
            (_, true) => Some(self),
            (true, false) => Some(other),
            _ => (self.dimension == other.dimension).then_some(self),
        }
    }
}

/// The dimension of the result; `variables` in the order of the program's.
pub(super) fn infer(text: &str, program: &Program, variables: &[Quantity]) -> Result<Quantity, FormulaError> {
    let mut stack: Vec<Quantity> = Vec::new();
    for step in &program.steps {
        let b = if step.op.takes() == 2 { stack.pop() } else { None };
        let a = if step.op.takes() > 0 { stack.pop() } else { None };
        let (a, b) = (a.unwrap_or(Quantity::UNKNOWN), b.unwrap_or(Quantity::UNKNOWN));
        let refuse = |message: String, accepted: &str| FormulaError::Syntax {
            text: text.into(),
            position: step.position,
            message,
            accepted: accepted.into(),
        };
        let both = |word: &str| {
            a.common(b).ok_or_else(|| {
                let message = format!("{word} of a {} and a {}", a.dimension.name(), b.dimension.name());
                refuse(message, "quantities of one dimension")
            })
        };
        let pure = |q: Quantity, word: &str| match q.loose || q.dimension.is_dimensionless() {
            true => Ok(Quantity { dimension: Dimension::DIMENSIONLESS, loose: q.loose }),
            false => {
                let message = format!("{word} of a {}", q.dimension.name());
                Err(refuse(message, "a pure number: divide by a parameter of the same dimension"))
            }
        };
        stack.push(match step.op {
            Op::Number(_) => Quantity::UNKNOWN,
            Op::Variable(v) => variables[v],
            Op::Neg => a,
            Op::Add => both("the sum")?,
            Op::Sub => both("the difference")?,
            Op::Mul => Quantity { dimension: a.dimension.times(b.dimension), loose: a.loose || b.loose },
            Op::Div => Quantity { dimension: a.dimension.over(b.dimension), loose: a.loose || b.loose },
            Op::Whole(n) => Quantity { dimension: a.dimension.power(n as i8), loose: a.loose },
            Op::Call(f) => match f {
                Function::Abs => a,
                Function::Min | Function::Max => both(if f == Function::Min { "the smaller" } else { "the larger" })?,
                Function::Sign => Quantity::of(Dimension::DIMENSIONLESS),
                Function::Sqrt => root(a),
                Function::Pow => {
                    pure(b, "a power with the exponent")?;
                    if a.dimension.is_dimensionless() { a } else { Quantity::UNKNOWN }
                }
                Function::Sin => pure(a, "the sine")?,
                Function::Cos => pure(a, "the cosine")?,
                Function::Tan => pure(a, "the tangent")?,
                Function::Exp => pure(a, "the exponential")?,
                Function::Log => pure(a, "the logarithm")?,
                Function::Tanh => pure(a, "the hyperbolic tangent")?,
                Function::Asinh => pure(a, "the inverse hyperbolic sine")?,
            },
        });
    }
    Ok(stack.pop().unwrap_or(Quantity::UNKNOWN))
}

fn root(q: Quantity) -> Quantity {
    let d = q.dimension;
    let odd = [d.length, d.mass, d.time, d.current, d.temperature, d.amount, d.luminosity].iter().any(|e| e % 2 != 0);
    let half = Dimension {
        length: d.length / 2,
        mass: d.mass / 2,
        time: d.time / 2,
        current: d.current / 2,
        temperature: d.temperature / 2,
        amount: d.amount / 2,
        luminosity: d.luminosity / 2,
        angle: 0,
    };
    // Half powers cannot be told here.
    if odd { Quantity::UNKNOWN } else { Quantity { dimension: half, loose: q.loose } }
}
