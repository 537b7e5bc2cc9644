//! Set 55: data at nodes (mode shapes, responses).

use super::numbers;
use super::text::{Fault, Fields, Line, Lines};
use num_complex::Complex64;

/// Data at nodes, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalData {
    pub id: [String; 5],
    pub model_type: i64,
    /// 2 normal mode, 3 complex mode (displacement), 5 frequency response, 7 complex mode (velocity), ...
    pub analysis_type: i64,
    pub characteristic: i64,
    /// 8 displacement, 11 velocity, 12 acceleration, ...
    pub data_type: i64,
    pub complex: bool,
    /// Values at a node.
    pub per_node: usize,
    /// Load case, mode number, ...
    pub integers: Vec<i64>,
    /// Normal mode: frequency (Hz), modal mass, viscous and structural damping ratio. Complex mode: eigenvalue, modal a, modal b (re, im each).
    pub reals: Vec<f64>,
    pub nodes: Vec<i64>,
    /// Nodes x `per_node`; imaginary parts 0 where the data are real.
    pub values: Vec<Vec<Complex64>>,
}

impl NodalData {
    /// Frequency (Hz) and damping ratio of a mode, where the set is one: of a normal mode as stored, of a complex one from its eigenvalue.
    pub fn mode(&self) -> Option<(f64, f64)> {
        match (self.analysis_type, self.reals.as_slice()) {
            (2, [f, _, viscous, structural, ..]) => Some((*f, if *viscous != 0.0 { *viscous } else { 0.5 * structural })),
            (2, [f, ..]) => Some((*f, 0.0)),
            (3 | 7, [re, im, ..]) => {
                let w = re.hypot(*im);
                (w > 0.0).then(|| (w / std::f64::consts::TAU, -re / w))
            }
            _ => None,
        }
    }
}

pub(super) fn id_lines(lines: &mut Lines<'_>) -> Result<[String; 5], Fault> {
    let mut id: [String; 5] = Default::default();
    for text in &mut id {
        *text = lines.need("its five lines of text")?.text.trim().to_string();
    }
    Ok(id)
}

pub(super) fn integers(line: &Line<'_>, n: usize, what: &str) -> Result<Vec<i64>, Fault> {
    let f = Fields::new(line, &vec![10; n]);
    (0..n).map(|i| f.integer(i, what)).collect()
}

pub(super) fn read(body: &[u8]) -> Result<NodalData, Fault> {
    let mut lines = Lines::new(body);
    let id = id_lines(&mut lines)?;
    let line = lines.need("its kind")?;
    let kind = integers(&line, 6, "a field of the kind of data")?;
    let (complex, per_node) = form(&line, kind[4], kind[5])?;
    let line = lines.need("its whole numbers")?;
    let counts = integers(&line, 2, "a count")?;
    let (n_int, n_real) = match counts[..] {
        [a, b] if (0..=100).contains(&a) && (0..=100).contains(&b) => (a as usize, b as usize),
        _ => return Err(Fault::new(line.offset, "counts of numbers that cannot be", "counts from 0 to 100")),
    };
    let mut ints = integers(&line, (2 + n_int).min(8), "a whole number of the analysis")?.split_off(2);
    while ints.len() < n_int {
        let line = lines.need("its whole numbers")?;
        let more = integers(&line, (n_int - ints.len()).min(8), "a whole number of the analysis")?;
        ints.extend(more);
    }
    let mut reals = Vec::new();
    while reals.len() < n_real {
        let line = lines.need("its real numbers")?;
        let n = (n_real - reals.len()).min(6);
        let f = Fields::new(&line, &vec![13; n]);
        for i in 0..n {
            reals.push(f.real(i, "a number of the analysis")?);
        }
    }
    let at = lines.at;
    let stride = 1 + per_node * if complex { 2 } else { 1 };
    let (nodes, values) = table(lines.rest(), at, stride, 1, complex)?;
    Ok(NodalData {
        id,
        model_type: kind[0],
        analysis_type: kind[1],
        characteristic: kind[2],
        data_type: kind[3],
        complex,
        per_node,
        integers: ints,
        reals,
        nodes,
        values,
    })
}

/// Whether the data are complex (type 5, 6) or real (2, 4), and how many there are a node.
pub(super) fn form(line: &Line<'_>, data_type: i64, per_node: i64) -> Result<(bool, usize), Fault> {
    let complex = match data_type {
        2 | 4 => false,
        5 | 6 => true,
        other => return Err(Fault::new(line.offset, format!("data type {other}"), super::function::TYPES)),
    };
    match usize::try_from(per_node) {
        Ok(n) if (1..=1000).contains(&n) => Ok((complex, n)),
        _ => Err(Fault::new(line.offset, format!("{per_node} values a node"), "1 to 1000 values a node")),
    }
}

type Table = (Vec<i64>, Vec<Vec<Complex64>>);

/// Records of `stride` numbers: a number of node or element, `skip - 1` more whole numbers, then the values.
pub(super) fn table(bytes: &[u8], at: usize, stride: usize, skip: usize, complex: bool) -> Result<Table, Fault> {
    let in_set = |f: Fault| Fault { offset: at + f.offset, ..f };
    let numbers = numbers::all(bytes, &[&[13], &[10], &[20]], usize::MAX).map_err(in_set)?;
    if !numbers.len().is_multiple_of(stride) {
        let message = format!("{} numbers, where each node has {stride}", numbers.len());
        return Err(Fault::new(at, message, "a node number and its values for every node"));
    }
    let (mut nodes, mut values) = (Vec::new(), Vec::new());
    for record in numbers.chunks_exact(stride) {
        if record[0].fract() != 0.0 || record[0].abs() > 1e15 || record.iter().any(|v| !v.is_finite()) {
            let message = format!("`{}` where a node number is expected, or a value that is not finite", record[0]);
            return Err(Fault::new(at, message, "a node number and its values for every node"));
        }
        nodes.push(record[0] as i64);
        let v = &record[skip..];
        values.push(if complex {
            v.chunks_exact(2).map(|p| Complex64::new(p[0], p[1])).collect()
        } else {
            v.iter().map(|x| Complex64::from(*x)).collect()
        });
    }
    Ok((nodes, values))
}
