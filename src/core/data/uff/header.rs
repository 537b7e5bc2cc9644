//! Sets 151 (header) and 164 (units).

use super::text::{Fault, Fields, Lines};

/// Set 151: where the file comes from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FileHeader {
    pub model: String,
    pub description: String,
    pub database_program: String,
    pub created: String,
    pub saved: String,
    pub program: String,
    pub written: String,
}

pub(super) fn file_header(body: &[u8]) -> Result<FileHeader, Fault> {
    let mut lines = Lines::new(body);
    // Programs leave the last lines out; what is missing is empty.
    let mut text = || lines.next().map_or(String::new(), |l| l.text.trim().to_string());
    Ok(FileHeader {
        model: text(),
        description: text(),
        database_program: text(),
        created: text(),
        saved: text(),
        program: text(),
        written: text(),
    })
}

/// Set 164: the units of the file. SI value = value in the file / factor.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitSystem {
    /// 1 SI, 2 foot pound-force, 3 metre kilogram-force, 4 foot poundal, 5 mm mN, 6 cm cN, 7 inch pound-force, 8 mm kgf, 9 user, 10 mm N.
    pub code: i64,
    pub description: String,
    /// 1 absolute, 2 relative; 0 where it is left out.
    pub temperature_mode: i64,
    pub length: f64,
    pub force: f64,
    pub temperature: f64,
    pub temperature_offset: f64,
}

/// Code, description and temperature mode of a line whose columns are shifted, the description glued to the code: `5mm (milli-newton)`.
/// The description begins with a letter, so that no digit is taken from it.
fn glued(line: &str) -> Option<(i64, String, i64)> {
    let line = line.trim();
    let (code, rest) = line.split_at(line.find(|c: char| !c.is_ascii_digit())?);
    let rest = rest.trim_start();
    if !rest.starts_with(char::is_alphabetic) {
        return None;
    }
    let mode = rest.rsplit_once(char::is_whitespace).and_then(|(text, mode)| Some((text.trim(), mode.parse().ok()?)));
    let (description, mode) = mode.unwrap_or((rest, 0));
    Some((code.parse().ok()?, description.to_string(), mode))
}

pub(super) fn units(body: &[u8]) -> Result<UnitSystem, Fault> {
    let mut lines = Lines::new(body);
    let line = lines.need("its code")?;
    let f = Fields::new(&line, &[10, 20, 10]);
    let in_columns = f.integer(0, "the code of the units").and_then(|c| Ok((c, f.text(1), f.integer(2, "the temperature mode")?)));
    let (code, description, temperature_mode) = in_columns.or_else(|e| glued(&line.text).ok_or(e))?;
    let line = lines.need("its factors")?;
    let f = Fields::new(&line, &[25, 25, 25]);
    let factors = [f.real(0, "the factor of length")?, f.real(1, "the factor of force")?, f.real(2, "the factor of temperature")?];
    if factors[..2].iter().any(|v| v.is_nan() || *v <= 0.0) {
        return Err(Fault::new(
            line.offset,
            "a unit factor that is not above 0",
            "factors above 0: values of the file divided by them are SI",
        ));
    }
    // The offset stands in a line of its own, and some programs leave it out.
    let temperature_offset = match lines.next() {
        Some(line) => Fields::new(&line, &[25]).real(0, "the offset of temperature")?,
        None => 0.0,
    };
    let [length, force, temperature] = factors;
    Ok(UnitSystem { code, description, temperature_mode, length, force, temperature, temperature_offset })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_glued_to_its_description_is_read() {
        let body = |first: &str| {
            format!("{first}\n  1.00000000000000000D+03  1.00000000000000000D+03  1.00000000000000000D+00\n  2.73150000000000000D+02\n")
        };
        let read = |first: &str| units(body(first).as_bytes()).map(|u| (u.code, u.description, u.temperature_mode));
        let expected = (5, "mm (milli-newton)".to_string(), 2);
        assert_eq!(read("         5mm (milli-newton)           2").unwrap(), expected);
        assert_eq!(read("        5mm (milli-newton)           2").unwrap(), expected);
        assert_eq!(read("5mm (milli-newton) 2").unwrap(), expected);
        assert_eq!(read("         9USER_DEFINED").unwrap(), (9, "USER_DEFINED".into(), 0));
        assert!(read("code 5").is_err());
    }
}
