//! Universal files (SDRC / UFF): sets 58 and 58b (functions), 55 and 2414 (data at nodes), 15 and 2411 (nodes), 82 (trace lines), 2412
//! (elements), 151 (header), 164 (units). Source of the formats: SDRL, University of Cincinnati, "Universal file formats for modal analysis
//! testing"; SDRC I-DEAS Test, universal dataset descriptions.
//!
//! [`UffFile::open`] finds the sets without decoding them; [`UffFile::read`] decodes one. Where real files are odd they are read (D exponents,
//! bytes that are not ASCII, CRLF, upper-case 58B, missing trailing fields); where they contradict themselves there is an error or a finding.

mod analysis;
mod binary;
mod function;
mod geometry;
mod header;
mod nodal;
mod numbers;
mod scan;
mod text;
mod units;

pub use analysis::{Analysis, AnalysisValues};
pub use function::{Axis, Dof, Function, FunctionHeader, Values, function_kind};
pub use geometry::{Element, Node, TraceLine};
pub use header::{FileHeader, UnitSystem};
pub use nodal::NodalData;
pub use numbers::number;
pub use scan::{Set, UffFile};
pub use text::decode;
pub use units::{AxisUnit, describe};

/// One decoded set.
#[derive(Debug, Clone, PartialEq)]
pub enum SetContent {
    /// Set 151.
    Header(FileHeader),
    /// Set 164.
    Units(UnitSystem),
    /// Set 15 or 2411.
    Nodes(Vec<Node>),
    /// Set 82.
    Trace(TraceLine),
    /// Set 2412.
    Elements(Vec<Element>),
    /// Set 55.
    NodalData(Box<NodalData>),
    /// Set 2414.
    Analysis(Box<Analysis>),
    /// Set 58 or 58b.
    Function(Box<Function>),
    /// A set this reader does not decode.
    Other,
}

impl UffFile {
    /// Decodes the set of index `i` (from 0); [`SetContent::Other`] where its number is not one of those above.
    pub fn read(&self, i: usize) -> Result<SetContent, super::DataError> {
        let Some(set) = self.sets.get(i) else {
            return Err(self.error(0, None, &format!("the file has {} sets, no set {}", self.sets.len(), i + 1), "a set of the file"));
        };
        let body = self.body(set);
        let fail = |at: text::Fault| self.error(set.body.start + at.offset, Some(set), &at.message, at.accepted);
        match set.number {
            151 => header::file_header(body).map(SetContent::Header),
            164 => header::units(body).map(SetContent::Units),
            15 => geometry::nodes(body, geometry::SINGLE).map(SetContent::Nodes),
            2411 => geometry::nodes(body, geometry::DOUBLE).map(SetContent::Nodes),
            82 => geometry::trace(body).map(SetContent::Trace),
            2412 => geometry::elements(body).map(SetContent::Elements),
            55 => nodal::read(body).map(|d| SetContent::NodalData(Box::new(d))),
            2414 => analysis::read(body).map(|d| SetContent::Analysis(Box::new(d))),
            58 => function::read(body, set.binary.as_ref()).map(|d| SetContent::Function(Box::new(d))),
            _ => Ok(SetContent::Other),
        }
        .map_err(fail)
    }

    /// The header of a function, without its data.
    pub fn function_header(&self, i: usize) -> Result<FunctionHeader, super::DataError> {
        let Some(set) = self.sets.get(i).filter(|s| s.number == 58) else {
            return Err(self.error(0, None, &format!("set {} is no function", i + 1), "a set 58"));
        };
        let fail = |at: text::Fault| self.error(set.body.start + at.offset, Some(set), &at.message, at.accepted);
        function::header(self.body(set)).map(|h| h.0).map_err(fail)
    }

    /// Indices of the functions among the sets.
    pub fn functions(&self) -> Vec<usize> {
        (0..self.sets.len()).filter(|i| self.sets[*i].number == 58).collect()
    }

    /// The unit system in force for set `i`: the last set 164 before it.
    pub fn unit_system(&self, i: usize) -> Result<Option<UnitSystem>, super::DataError> {
        let Some(j) = (0..i.min(self.sets.len())).rev().find(|j| self.sets[*j].number == 164) else { return Ok(None) };
        match self.read(j)? {
            SetContent::Units(u) => Ok(Some(u)),
            _ => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests;
