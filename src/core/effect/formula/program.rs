//! A formula made ready: steps in postfix order, evaluated over any number type.

use super::super::Num;
use super::super::num::{magnitude, positive, power, saturating_tanh, sign};

/// Functions a formula may call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Sin,
    Cos,
    Tan,
    Exp,
    Log,
    Sqrt,
    Abs,
    Sign,
    Tanh,
    Asinh,
    Min,
    Max,
    Pow,
}

/// Names and arguments.
pub(super) const FUNCTIONS: [(&str, Function, usize); 13] = [
    ("sin", Function::Sin, 1),
    ("cos", Function::Cos, 1),
    ("tan", Function::Tan, 1),
    ("exp", Function::Exp, 1),
    ("log", Function::Log, 1),
    ("sqrt", Function::Sqrt, 1),
    ("abs", Function::Abs, 1),
    ("sign", Function::Sign, 1),
    ("tanh", Function::Tanh, 1),
    ("asinh", Function::Asinh, 1),
    ("min", Function::Min, 2),
    ("max", Function::Max, 2),
    ("pow", Function::Pow, 2),
];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Op {
    Number(f64),
    Variable(usize),
    Neg,
    Add,
    Sub,
    Mul,
    Div,
    /// To a whole power that stands in the formula.
    Whole(i32),
    Call(Function),
}

/// One step and where it stands in the text, counted in characters from 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    pub op: Op,
    pub position: usize,
}

/// Numbers that wait at the same time, at most.
pub(super) const DEPTH: usize = 16;

/// A formula made ready.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Program {
    pub steps: Vec<Step>,
}

impl Op {
    /// Numbers it takes from the stack.
    pub fn takes(self) -> usize {
        match self {
            Op::Number(_) | Op::Variable(_) => 0,
            Op::Neg | Op::Whole(_) => 1,
            Op::Add | Op::Sub | Op::Mul | Op::Div => 2,
            Op::Call(f) => FUNCTIONS.iter().find(|g| g.1 == f).map_or(1, |g| g.2),
        }
    }
}

fn apply<T: Num>(op: Op, a: T, b: T) -> T {
    match op {
        Op::Number(n) => T::from(n),
        Op::Variable(_) => a,
        Op::Neg => -a,
        Op::Add => a + b,
        Op::Sub => a - b,
        Op::Mul => a * b,
        Op::Div => a / b,
        Op::Whole(n) => whole(a, n),
        Op::Call(f) => match f {
            Function::Sin => a.sin(),
            Function::Cos => a.cos(),
            Function::Tan => a.tan(),
            Function::Exp => a.exp(),
            Function::Log => a.ln(),
            // The slope of the root at 0 is infinite; as for `pow`, none is taken there.
            Function::Sqrt => {
                if a.re() == 0.0 {
                    T::from(0.0)
                } else {
                    a.sqrt()
                }
            }
            Function::Abs => magnitude(a),
            Function::Sign => T::from(sign(a)),
            Function::Tanh => saturating_tanh(a),
            Function::Asinh => a.asinh(),
            // Where both are equal the mean of both, so that the slope is that of neither side alone.
            Function::Min => a - (positive(a - b) + positive_or_half(a, b)),
            Function::Max => b + (positive(a - b) + positive_or_half(a, b)),
            Function::Pow => general(a, b),
        },
    }
}

/// Half of the difference where both are equal: 0 in value, with the slope of the mean.
fn positive_or_half<T: Num>(a: T, b: T) -> T {
    if a.re() == b.re() { (a - b) * 0.5 } else { T::from(0.0) }
}

fn whole<T: Num>(base: T, n: i32) -> T {
    match n {
        0 => T::from(1.0),
        n if n < 0 => whole(base, n.saturating_neg()).recip(),
        n if n % 2 == 0 => whole(base * base, n / 2),
        1 => base,
        n => base * whole(base * base, n / 2),
    }
}

/// `base^n`: of a negative base for whole n only.
fn general<T: Num>(base: T, n: T) -> T {
    if base.re() > 0.0 {
        return power(base, n);
    }
    let exponent = n.re();
    if base.re() == 0.0 {
        return if exponent >= 0.0 { power(base, n) } else { T::from(f64::INFINITY) };
    }
    if exponent.fract() == 0.0 && exponent.abs() < 1e9 { whole(base, exponent as i32) } else { T::from(f64::NAN) }
}

impl Program {
    /// The value with these variables.
    pub fn evaluate<T: Num>(&self, variables: &[T]) -> T {
        self.run(variables, |_, _| {})
    }

    /// As [`Program::evaluate`]; `each` sees every step with its result and its arguments.
    fn run<T: Num>(&self, variables: &[T], mut each: impl FnMut(&Step, [T; 3])) -> T {
        let mut stack = [T::from(0.0); DEPTH + 1];
        let mut top = 0;
        for step in &self.steps {
            top -= step.op.takes();
            let (a, b) = match step.op {
                Op::Variable(v) => (variables[v], stack[top]),
                _ => (stack[top], stack[top + 1]),
            };
            stack[top] = apply(step.op, a, b);
            each(step, [stack[top], a, b]);
            top += 1;
        }
        stack[0]
    }

    /// The first step whose result is not finite, its position and what is wrong with it.
    pub fn fault(&self, variables: &[f64]) -> Option<(usize, String)> {
        let mut found = None;
        self.run(variables, |step, [result, a, b]: [f64; 3]| {
            if result.is_finite() || found.is_some() {
                return;
            }
            let what = match step.op {
                Op::Div if b == 0.0 => "a division by zero".to_string(),
                Op::Whole(_) if a == 0.0 => "a division by zero: a negative power of 0".to_string(),
                Op::Call(Function::Pow) if a == 0.0 => format!("a division by zero: 0 to the power {b}"),
                Op::Call(Function::Pow) if a < 0.0 => format!("the power {b} of {a}, which is no real number"),
                Op::Call(Function::Log) => format!("the logarithm of {a}"),
                Op::Call(Function::Sqrt) => format!("the square root of {a}"),
                Op::Variable(_) => format!("a variable that is {a}"),
                _ => format!("a result of {result}"),
            };
            found = Some((step.position, what));
        });
        found
    }

    /// Position of a `sign` of exactly 0: where the force jumps.
    pub fn jump(&self, variables: &[f64]) -> Option<usize> {
        let mut found = None;
        self.run(variables, |step, [_, a, _]: [f64; 3]| {
            if step.op == Op::Call(Function::Sign) && a == 0.0 && found.is_none() {
                found = Some(step.position);
            }
        });
        found
    }

    /// Whether it reads a variable.
    pub fn reads(&self, variable: usize) -> bool {
        self.steps.iter().any(|s| s.op == Op::Variable(variable))
    }
}
