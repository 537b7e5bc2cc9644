//! Functions of a universal file as columns.
//!
//! A column is named by its function and its part: `12:-Z/7:+Z real`, `#5 imag`. The function is a set by its number in the file (`#5`), or response
//! and reference degree of freedom (`12:-Z/7:+Z`, or the response alone). The parts are `time`, `frequency` or `abscissa`; `value` of a real function
//! (the part where none is named); `real`, `imag`, `amplitude`, `phase` of a complex one; `coherence`, the coherence of the same degrees of freedom.
//! Without a function of its own a part is one of the test's `record`, or of the only function of the file that has it.

use super::{Column, Columns, DataError, Wanted};
use crate::data::error::FileError;
use crate::data::uff::{AxisUnit, Function, FunctionHeader, SetContent, UffFile, Values, describe, function_kind};
use std::collections::BTreeMap;
use std::path::Path;

const PARTS: [&str; 9] = ["time", "frequency", "abscissa", "value", "real", "imag", "amplitude", "phase", "coherence"];

struct Reader<'a> {
    file: &'a UffFile,
    headers: Vec<(usize, FunctionHeader)>,
    read: BTreeMap<usize, Function>,
}

pub(super) fn read(path: &Path, bytes: Vec<u8>, wanted: &[Wanted], record: Option<&str>) -> Result<Columns, DataError> {
    let file = UffFile::from_bytes(path, bytes)?;
    let headers = file.functions().into_iter().map(|i| Ok((i, file.function_header(i)?))).collect::<Result<Vec<_>, DataError>>()?;
    let mut reader = Reader { file: &file, headers, read: BTreeMap::new() };
    let named: Vec<(Option<&str>, &str)> = wanted.iter().map(|w| split(&w.name, record)).collect();
    let mut picked = Vec::with_capacity(named.len());
    // An abscissa without a function of its own belongs to the first function that is named.
    let first = named.iter().find(|(_, part)| !is_abscissa(part)).copied();
    for (selector, part) in &named {
        let (selector, kind) = match (selector, first) {
            (None, Some((of, kind))) if is_abscissa(part) => (of, kind),
            _ => (*selector, *part),
        };
        picked.push(reader.pick(selector, kind)?);
    }
    for i in &picked {
        reader.load(*i)?;
    }
    reader.columns(&named, &picked, wanted)
}

fn is_abscissa(part: &str) -> bool {
    matches!(part, "time" | "frequency" | "abscissa")
}

fn split<'a>(name: &'a str, record: Option<&'a str>) -> (Option<&'a str>, &'a str) {
    let name = name.trim();
    if PARTS.contains(&name) {
        return (record, name);
    }
    match name.rsplit_once(' ') {
        Some((function, part)) if PARTS.contains(&part) => (Some(function.trim()), part),
        _ => (Some(name), "value"),
    }
}

impl Reader<'_> {
    fn fail(&self, message: String, accepted: &str) -> DataError {
        FileError { file: self.file.path.clone(), place: String::new(), message, accepted: accepted.to_string() }.into()
    }

    fn list(&self, of: impl Iterator<Item = usize>) -> String {
        let all: Vec<String> = of
            .filter_map(|i| self.headers.iter().find(|h| h.0 == i))
            .map(|(i, h)| format!("#{} {} ({})", i + 1, h.label(), function_kind(h.function_type)))
            .collect();
        let more = if all.len() > 12 { format!(" and {} more", all.len() - 12) } else { String::new() };
        all.iter().take(12).cloned().collect::<Vec<_>>().join(", ") + &more
    }

    /// The set a selector means, for a part.
    fn pick(&self, selector: Option<&str>, part: &str) -> Result<usize, DataError> {
        let fits = |h: &FunctionHeader| match part {
            "coherence" => matches!(h.function_type, 6 | 26),
            "real" | "imag" | "amplitude" | "phase" | "frequency" => h.complex(),
            "value" | "time" => !h.complex() && !matches!(h.function_type, 6 | 26),
            _ => true,
        };
        let any = || self.list(self.headers.iter().map(|h| h.0));
        if let Some(number) = selector.and_then(|s| s.strip_prefix('#')) {
            let found =
                number.trim().parse::<usize>().ok().and_then(|n| n.checked_sub(1)).and_then(|n| self.headers.iter().find(|h| h.0 == n));
            let Some((i, h)) = found else {
                return Err(self.fail(format!("`#{number}` is no function of the file"), &format!("one of {}", any())));
            };
            if part == "coherence" && !fits(h) {
                return self.pick(Some(&h.label()), part);
            }
            return if fits(h) {
                Ok(*i)
            } else {
                Err(self.fail(
                    format!("set {number} is a {}, which has no part `{part}`", function_kind(h.function_type)),
                    &format!("one of {}", any()),
                ))
            };
        }
        let same =
            |h: &FunctionHeader| selector.is_none_or(|s| h.label().eq_ignore_ascii_case(s) || h.response.label().eq_ignore_ascii_case(s));
        let all: Vec<&(usize, FunctionHeader)> = self.headers.iter().filter(|(_, h)| fits(h) && same(h)).collect();
        // Beside spectra of the same place an FRF is what a part of a complex function means.
        let frfs: Vec<&(usize, FunctionHeader)> = all.iter().copied().filter(|(_, h)| h.function_type == 4).collect();
        let found = if frfs.is_empty() { all } else { frfs };
        match found.as_slice() {
            [one] => Ok(one.0),
            [] => {
                let what = selector.map_or(String::new(), |s| format!(" `{s}`"));
                Err(self.fail(format!("no function{what} with a part `{part}`"), &format!("one of {}", any())))
            }
            several => {
                let what = selector.map_or("the file".to_string(), |s| format!("`{s}`"));
                let message = format!("{what} has {} functions with a part `{part}`", several.len());
                Err(self.fail(
                    message,
                    &format!("record = \"#...\" or the degrees of freedom of one of {}", self.list(several.iter().map(|h| h.0))),
                ))
            }
        }
    }

    fn load(&mut self, i: usize) -> Result<(), DataError> {
        if self.read.contains_key(&i) {
            return Ok(());
        }
        if let SetContent::Function(f) = self.file.read(i)? {
            if let Some(note) = f.findings.iter().find(|n| n.about == "points" || n.about == "abscissa") {
                return Err(self.fail(format!("set {}: {}", i + 1, note.text), "a whole set; export the file again"));
            }
            self.read.insert(i, *f);
        }
        Ok(())
    }

    fn columns(&self, named: &[(Option<&str>, &str)], picked: &[usize], wanted: &[Wanted]) -> Result<Columns, DataError> {
        let mut columns = Columns::new(Vec::new(), "point", 1);
        let mut base: Option<(&Function, usize)> = None;
        for ((_, part), i) in named.iter().zip(picked) {
            let Some(f) = self.read.get(i) else { return Err(self.fail(format!("set {} is no function", i + 1), "a set 58")) };
            let (base_f, base_i) = *base.get_or_insert((f, *i));
            if base_f.abscissa != f.abscissa {
                let message = format!(
                    "sets {} and {} stand over different abscissae ({} and {} points)",
                    base_i + 1,
                    i + 1,
                    base_f.abscissa.len(),
                    f.abscissa.len()
                );
                return Err(self.fail(message, "channels of one test over the same abscissa"));
            }
            let system = self.file.unit_system(*i)?;
            let (x, y, quantity) = describe(&f.header, system.as_ref());
            let symbol = |u: &AxisUnit| u.unit.as_ref().map(|u| u.symbol.clone()).filter(|s| !s.is_empty());
            let complex = |part: fn(&num_complex::Complex64) -> f64| match &f.values {
                Values::Complex(v) => v.iter().map(part).collect(),
                Values::Real(v) => v.clone(),
            };
            let (values, unit) = match *part {
                p if is_abscissa(p) => (f.abscissa.clone(), symbol(&x)),
                "imag" => (complex(|h| h.im), symbol(&y)),
                "amplitude" => (complex(|h| h.norm()), symbol(&y)),
                "phase" => (complex(|h| h.arg()), Some("rad".to_string())),
                _ => (complex(|h| h.re), symbol(&y)),
            };
            if matches!(*part, "real" | "imag" | "amplitude") {
                columns.quantity = columns.quantity.or(quantity);
            }
            columns.columns.push(Column::Numbers(values));
            columns.units.push(unit);
        }
        if columns.is_empty() {
            return Err(DataError::NoRows { file: self.file.path.clone() });
        }
        super::finite(&self.file.path, &columns, wanted)?;
        Ok(columns)
    }
}
