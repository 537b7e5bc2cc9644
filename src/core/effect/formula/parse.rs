//! From the text of a formula to its program: a precedence parser that knows where it stands.
//!
//! ```text
//! sum     = product { (+|-) product }
//! product = sign { (*|/) sign }
//! sign    = (+|-) sign | power
//! power   = value [ ^ sign ]            so that -x^2 = -(x^2), 2^3^2 = 2^9, 2^-1 = 0.5
//! value   = number | name | function ( sum {, sum} ) | ( sum )
//! ```

use super::FormulaError;
use super::program::{DEPTH, FUNCTIONS, Function, Op, Program, Step};

/// Characters of a formula at most.
const LONGEST: usize = 2000;
/// Brackets within brackets at most.
const BRACKETS: usize = 60;

/// Parses `text`; `names[k]` is variable `k`.
pub(super) fn parse(text: &str, names: &[&str]) -> Result<Program, FormulaError> {
    let mut parser = Parser { text, rest: text.chars().collect(), at: 0, names, program: Program::default(), waiting: 0, nested: 0 };
    if parser.rest.len() > LONGEST {
        return Err(parser.error(LONGEST, "a formula that is too long", format!("at most {LONGEST} characters")));
    }
    parser.sum()?;
    match parser.peek() {
        None => Ok(parser.program),
        Some(')') => Err(parser.error(parser.at, "a closing bracket without an opening one", "as many ( as )")),
        Some(c) => Err(parser.error(parser.at, format!("`{c}` where an operator is expected"), "one of + - * / ^")),
    }
}

struct Parser<'a> {
    text: &'a str,
    rest: Vec<char>,
    /// Index of the next character.
    at: usize,
    names: &'a [&'a str],
    program: Program,
    /// Numbers on the stack.
    waiting: usize,
    nested: usize,
}

impl Parser<'_> {
    fn error(&self, at: usize, message: impl Into<String>, accepted: impl Into<String>) -> FormulaError {
        FormulaError::Syntax { text: self.text.into(), position: at + 1, message: message.into(), accepted: accepted.into() }
    }

    /// The next character that is no space.
    fn peek(&mut self) -> Option<char> {
        while self.rest.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.rest.get(self.at).copied()
    }

    fn push(&mut self, op: Op, at: usize) -> Result<(), FormulaError> {
        self.waiting = self.waiting + 1 - op.takes();
        if self.waiting > DEPTH {
            return Err(self.error(at, "a formula that is nested too deeply", "fewer brackets, or a part of it as a state"));
        }
        self.program.steps.push(Step { op, position: at + 1 });
        Ok(())
    }

    fn sum(&mut self) -> Result<(), FormulaError> {
        self.nested += 1;
        if self.nested > BRACKETS {
            return Err(self.error(self.at, "too many brackets within brackets", format!("at most {BRACKETS}")));
        }
        self.product()?;
        while let Some(c @ ('+' | '-')) = self.peek() {
            let at = self.at;
            self.at += 1;
            self.product()?;
            self.push(if c == '+' { Op::Add } else { Op::Sub }, at)?;
        }
        self.nested -= 1;
        Ok(())
    }

    fn product(&mut self) -> Result<(), FormulaError> {
        self.sign()?;
        while let Some(c @ ('*' | '/')) = self.peek() {
            let at = self.at;
            self.at += 1;
            if c == '*' && self.rest.get(self.at) == Some(&'*') {
                return Err(self.error(at, "`**`", "a power as x^2"));
            }
            self.sign()?;
            self.push(if c == '*' { Op::Mul } else { Op::Div }, at)?;
        }
        Ok(())
    }

    fn sign(&mut self) -> Result<(), FormulaError> {
        let mut minus = Vec::new();
        while let Some(c @ ('+' | '-')) = self.peek() {
            if c == '-' {
                minus.push(self.at);
            }
            self.at += 1;
        }
        self.power()?;
        minus.into_iter().rev().try_for_each(|at| self.push(Op::Neg, at))
    }

    fn power(&mut self) -> Result<(), FormulaError> {
        self.value()?;
        if self.peek() != Some('^') {
            return Ok(());
        }
        let at = self.at;
        self.at += 1;
        let from = self.program.steps.len();
        self.nested += 1;
        if self.nested > BRACKETS {
            return Err(self.error(at, "too many powers of powers", format!("at most {BRACKETS}")));
        }
        self.sign()?;
        self.nested -= 1;
        // A whole number that stands there keeps the sign of a negative base and the slope at 0.
        let exponent = match self.program.steps[from..] {
            [Step { op: Op::Number(n), .. }] => Some(n),
            [Step { op: Op::Number(n), .. }, Step { op: Op::Neg, .. }] => Some(-n),
            _ => None,
        };
        match exponent.filter(|n| n.fract() == 0.0 && n.abs() <= 64.0) {
            Some(n) => {
                self.program.steps.truncate(from);
                self.waiting -= 1;
                self.push(Op::Whole(n as i32), at)
            }
            None => self.push(Op::Call(Function::Pow), at),
        }
    }

    fn value(&mut self) -> Result<(), FormulaError> {
        let Some(c) = self.peek() else {
            return Err(self.error(self.at, "the formula ends where a value is expected", "a number, a name, or a bracket"));
        };
        let at = self.at;
        if c == '(' {
            self.at += 1;
            self.sum()?;
            return self.close(at);
        }
        if c.is_ascii_digit() || c == '.' {
            return self.number();
        }
        if c.is_alphabetic() || c == '_' {
            return self.name();
        }
        Err(self.error(at, format!("`{c}` where a value is expected"), "a number, a name, or a bracket"))
    }

    fn close(&mut self, opened: usize) -> Result<(), FormulaError> {
        match self.peek() {
            Some(')') => {
                self.at += 1;
                Ok(())
            }
            Some(c) => Err(self.error(self.at, format!("`{c}` where `)` is expected"), "an operator or a closing bracket")),
            None => Err(self.error(opened, "a bracket that is not closed", "as many ) as (")),
        }
    }

    fn number(&mut self) -> Result<(), FormulaError> {
        let from = self.at;
        let digits = |p: &mut Self| {
            while p.rest.get(p.at).is_some_and(char::is_ascii_digit) {
                p.at += 1;
            }
        };
        digits(self);
        if self.rest.get(self.at) == Some(&'.') {
            self.at += 1;
            digits(self);
        }
        if matches!(self.rest.get(self.at), Some('e' | 'E')) {
            // An exponent only where digits follow.
            let signed = usize::from(matches!(self.rest.get(self.at + 1), Some('+' | '-')));
            if self.rest.get(self.at + 1 + signed).is_some_and(char::is_ascii_digit) {
                self.at += 1 + signed;
                digits(self);
            }
        }
        let text: String = self.rest[from..self.at].iter().collect();
        if self.rest.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_' || *c == '.') {
            return Err(self.error(self.at, format!("`{}` right after the number {text}", self.rest[self.at]), "an operator, such as 2*x"));
        }
        match text.parse::<f64>() {
            Ok(n) if n.is_finite() => self.push(Op::Number(n), from),
            _ => Err(self.error(from, format!("`{text}` is no number"), "a number such as 1e-3")),
        }
    }

    fn name(&mut self) -> Result<(), FormulaError> {
        let from = self.at;
        while self.rest.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_') {
            self.at += 1;
        }
        let name: String = self.rest[from..self.at].iter().collect();
        if self.peek() == Some('(') {
            let Some((_, function, arguments)) = FUNCTIONS.iter().find(|f| f.0 == name) else {
                let nearest = nearest(&name, FUNCTIONS.iter().map(|f| f.0));
                let all = FUNCTIONS.iter().map(|f| f.0).collect::<Vec<_>>().join(", ");
                return Err(self.error(from, format!("there is no function `{name}`{nearest}"), format!("one of {all}")));
            };
            let opened = self.at;
            self.at += 1;
            for k in 0..*arguments {
                if k > 0 {
                    match self.peek() {
                        Some(',') => self.at += 1,
                        _ => return Err(self.error(self.at, format!("`{name}` takes {arguments} values"), format!("{name}(a, b)"))),
                    }
                }
                self.sum()?;
            }
            if self.peek() == Some(',') {
                return Err(self.error(
                    self.at,
                    format!("`{name}` takes {arguments} value{}", if *arguments > 1 { "s" } else { "" }),
                    "no more",
                ));
            }
            self.close(opened)?;
            return self.push(Op::Call(*function), from);
        }
        if name == "pi" {
            return self.push(Op::Number(std::f64::consts::PI), from);
        }
        if let Some(v) = self.names.iter().position(|n| *n == name) {
            return self.push(Op::Variable(v), from);
        }
        if FUNCTIONS.iter().any(|f| f.0 == name) {
            return Err(self.error(from, format!("the function `{name}` without its value"), format!("{name}(...)")));
        }
        let nearest = nearest(&name, self.names.iter().copied());
        let all = self.names.join(", ");
        Err(self.error(
            from,
            format!("`{name}` is not known{nearest}"),
            format!("one of {all}, pi, or a parameter declared beside the formula"),
        ))
    }
}

fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let scored = known.map(|k| (strsim::jaro_winkler(k, name), k)).filter(|(score, _)| *score > 0.75);
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(String::new(), |(_, k)| format!("; the nearest is `{k}`"))
}
