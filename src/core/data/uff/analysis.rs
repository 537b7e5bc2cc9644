//! Set 2414: analysis data at nodes or on elements.

use super::nodal::{form, id_lines, integers, table};
use super::text::{Fault, Fields, Lines};
use num_complex::Complex64;

/// Analysis data, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    pub label: i64,
    pub name: String,
    /// 1 at nodes, 2 on elements, 3 at nodes on elements, 5 at points.
    pub location: i64,
    pub id: [String; 5],
    /// Model type, analysis type, characteristic, result type, data type, values a component.
    pub kind: [i64; 6],
    /// Design set, iteration, solution set, boundary condition, load set, mode, time step, frequency number.
    pub integers: Vec<i64>,
    /// Time, frequency, eigenvalue, modal mass, viscous and structural damping; eigenvalue, modal a, modal b (re, im each).
    pub reals: Vec<f64>,
    pub values: AnalysisValues,
}

/// The values of a set 2414.
#[derive(Debug, Clone, PartialEq)]
pub enum AnalysisValues {
    /// Node or element numbers, and the values of each.
    At(Vec<i64>, Vec<Vec<Complex64>>),
    /// A location this reader does not decode.
    NotRead,
}

pub(super) fn read(body: &[u8]) -> Result<Analysis, Fault> {
    let mut lines = Lines::new(body);
    let label = Fields::new(&lines.need("its label")?, &[10]).integer(0, "the label")?;
    let name = lines.need("its name")?.text.trim().to_string();
    let location = Fields::new(&lines.need("its location")?, &[10]).integer(0, "the location")?;
    let id = id_lines(&mut lines)?;
    let line = lines.need("its kind")?;
    let found = integers(&line, 6, "a field of the kind of data")?;
    let mut kind = [0; 6];
    kind.copy_from_slice(&found);
    let (complex, per) = form(&line, kind[4], kind[5])?;
    let mut ints = integers(&lines.need("its whole numbers")?, 8, "a whole number of the analysis")?;
    ints.extend(integers(&lines.need("its whole numbers")?, 8, "a whole number of the analysis")?);
    let mut reals = Vec::new();
    for _ in 0..2 {
        let line = lines.need("its real numbers")?;
        let f = Fields::new(&line, &[13; 6]);
        for i in 0..6 {
            reals.push(f.real(i, "a number of the analysis")?);
        }
    }
    let at = lines.at;
    let numbers = per * if complex { 2 } else { 1 };
    let values = match location {
        1 => {
            let (nodes, values) = table(lines.rest(), at, 1 + numbers, 1, complex)?;
            AnalysisValues::At(nodes, values)
        }
        2 => {
            let (elements, values) = table(lines.rest(), at, 2 + numbers, 2, complex)?;
            AnalysisValues::At(elements, values)
        }
        _ => AnalysisValues::NotRead,
    };
    Ok(Analysis { label, name, location, id, kind, integers: ints, reals, values })
}
