//! Unit expressions: `N s/mm`, `m/s2/N`, `N·mm/°`, `kg/(m s)`.

use super::{Dimension, UnitError, table};

/// The value of a unit expression: SI = number * mantissa * 10^exponent (+ offset).
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor {
    pub mantissa: f64,
    pub exponent: i32,
    pub offset: f64,
    pub dimension: Dimension,
}

const ONE: Factor = Factor { mantissa: 1.0, exponent: 0, offset: 0.0, dimension: Dimension::DIMENSIONLESS };
const MAX_DEPTH: usize = 8;
const MAX_POWER: i32 = 9;

/// Evaluates `text`; `second` takes the second reading of the symbols that have two.
pub(super) fn evaluate(text: &str, second: bool) -> Result<Factor, UnitError> {
    let mut parser = Parser { text, rest: text, second };
    let factor = parser.product(0)?;
    if !parser.rest.is_empty() {
        return Err(parser.syntax("a closing bracket without an opening one"));
    }
    // Exponents saturate rather than wrap: one that has reached the end of its range is not a unit any more.
    let d = factor.dimension;
    let all = [d.length, d.mass, d.time, d.current, d.temperature, d.amount, d.luminosity, d.angle];
    if all.iter().any(|e| e.unsigned_abs() > 30) || factor.exponent.abs() > 90 || !factor.mantissa.is_normal() {
        return Err(parser.syntax("powers too high for a unit"));
    }
    Ok(factor)
}

struct Parser<'a> {
    text: &'a str,
    rest: &'a str,
    second: bool,
}

impl<'a> Parser<'a> {
    fn syntax(&self, what: &str) -> UnitError {
        UnitError::Syntax { text: self.text.to_string(), what: what.to_string(), expected: None }
    }

    fn skip_space(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, token: &str) -> bool {
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn product(&mut self, depth: usize) -> Result<Factor, UnitError> {
        if depth > MAX_DEPTH {
            return Err(self.syntax("too many brackets"));
        }
        let mut value = ONE;
        let mut divided = false;
        self.skip_space();
        // `1/mm` may lose its 1 to the number before it, so that the expression begins with the stroke.
        let mut dividing = self.take("/");
        loop {
            self.skip_space();
            let (factor, power) = self.factor(depth)?;
            value = multiply(value, factor, if dividing { -power } else { power });
            divided |= dividing;
            self.skip_space();
            if self.rest.is_empty() || self.rest.starts_with(')') {
                return Ok(value);
            }
            dividing = self.take("/");
            if !dividing {
                if divided {
                    return Err(
                        self.syntax("a product after `/` is ambiguous; put brackets, as in N/(m s), or the product first, as in N s/m")
                    );
                }
                let _ = self.take("**") || self.take("*") || self.take("·") || self.take("⋅") || self.take("×");
            }
        }
    }

    fn factor(&mut self, depth: usize) -> Result<(Factor, i32), UnitError> {
        if self.take("(") {
            let inner = self.product(depth + 1)?;
            if !self.take(")") {
                return Err(self.syntax("a bracket is not closed"));
            }
            return Ok((inner, self.power()?));
        }
        let name = self.symbol();
        if name.is_empty() {
            let what = match self.rest.chars().next() {
                Some(c) => format!("`{c}` is not part of a unit"),
                None => "the unit is not complete".to_string(),
            };
            return Err(self.syntax(&what));
        }
        if name == "-" && self.text.trim() != "-" {
            return Err(self.syntax("a sign is no part of a unit; `scale = -1` turns a channel"));
        }
        let found = table::look_up(name, self.second).ok_or_else(|| UnitError::UnknownUnit {
            text: self.text.to_string(),
            symbol: name.to_string(),
            nearest: table::nearest(name),
            expected: None,
        })?;
        let power = self.power()?;
        Ok((Factor { mantissa: found.mantissa, exponent: found.exponent, offset: found.offset, dimension: found.dimension }, power))
    }

    /// The next symbol: letters (with ° before them), or one of %, -, 1.
    fn symbol(&mut self) -> &'a str {
        let mut end = 0;
        for (at, c) in self.rest.char_indices() {
            let letter = c.is_alphabetic() && !superscript(c) || (c == '°' && at == 0);
            if !letter {
                break;
            }
            end = at + c.len_utf8();
        }
        if end == 0
            && let Some(c) = self.rest.chars().next()
            && matches!(c, '%' | '-' | '1')
        {
            end = 1;
        }
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        name
    }

    /// An integer power: `2`, `-1`, `^2`, `^-1`, `**2`, `²`, `⁻¹`; 1 where none stands.
    fn power(&mut self) -> Result<i32, UnitError> {
        let explicit = self.take("^") || (self.rest.starts_with("**") && self.take("**"));
        let mut digits = String::new();
        let mut used = 0;
        for (at, c) in self.rest.char_indices() {
            let plain = superscript_value(c).unwrap_or(c);
            if plain.is_ascii_digit() || (digits.is_empty() && matches!(plain, '-' | '+') && (explicit || self.sign_before_digit(at))) {
                digits.push(plain);
                used = at + c.len_utf8();
            } else {
                break;
            }
        }
        if digits.is_empty() && !explicit {
            return Ok(1);
        }
        self.rest = self.rest.get(used..).unwrap_or("");
        match digits.parse::<i32>() {
            Ok(power) if power != 0 && power.abs() <= MAX_POWER => Ok(power),
            _ => Err(self.syntax(&format!("a power must be a whole number from -{MAX_POWER} to {MAX_POWER} and not 0"))),
        }
    }

    fn sign_before_digit(&self, at: usize) -> bool {
        let mut chars = self.rest.get(at..).unwrap_or("").chars();
        chars.next();
        chars.next().map(|c| superscript_value(c).unwrap_or(c)).is_some_and(|c| c.is_ascii_digit())
    }
}

fn multiply(a: Factor, b: Factor, power: i32) -> Factor {
    Factor {
        mantissa: a.mantissa * b.mantissa.powi(power),
        exponent: a.exponent.saturating_add(b.exponent.saturating_mul(power)),
        // Degrees Celsius keep their zero only when they stand alone.
        offset: if power == 1 && a.dimension.is_dimensionless() && a.mantissa == 1.0 && a.exponent == 0 { b.offset } else { 0.0 },
        dimension: a.dimension.times(b.dimension.power(power as i8)),
    }
}

fn superscript(c: char) -> bool {
    superscript_value(c).is_some()
}

fn superscript_value(c: char) -> Option<char> {
    Some(match c {
        '⁰' => '0',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴' => '4',
        '⁵' => '5',
        '⁶' => '6',
        '⁷' => '7',
        '⁸' => '8',
        '⁹' => '9',
        '⁻' => '-',
        '⁺' => '+',
        _ => return None,
    })
}
