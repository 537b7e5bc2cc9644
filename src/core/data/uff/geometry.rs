//! Sets 15 and 2411 (nodes), 82 (trace lines), 2412 (elements).

use super::numbers;
use super::text::{Fault, Fields, Lines};

/// A node, coordinates in the unit of length of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    pub number: i64,
    pub definition_system: i64,
    pub displacement_system: i64,
    pub colour: i64,
    pub position: [f64; 3],
}

/// Columns of set 15: 4I10, 1P3E13.5 in one line.
pub(super) const SINGLE: &[&[usize]] = &[&[10, 10, 10, 10, 13, 13, 13]];
/// Columns of set 2411: 4I10, then 1P3D25.16 in the next line.
pub(super) const DOUBLE: &[&[usize]] = &[&[25, 25, 25], &[10, 10, 10, 10]];

pub(super) fn nodes(body: &[u8], patterns: &[&[usize]]) -> Result<Vec<Node>, Fault> {
    let values = numbers::all(body, patterns, usize::MAX)?;
    if !values.len().is_multiple_of(7) {
        return Err(Fault::new(
            body.len(),
            format!("{} numbers, where each node has 7", values.len()),
            "four whole numbers and three coordinates a node",
        ));
    }
    values
        .chunks_exact(7)
        .map(node)
        .collect::<Option<_>>()
        .ok_or_else(|| Fault::new(0, "a node number that is no whole number", "whole numbers"))
}

fn node(v: &[f64]) -> Option<Node> {
    let whole = |x: f64| (x.fract() == 0.0 && x.abs() < 1e15).then_some(x as i64);
    let position = [v[4], v[5], v[6]];
    let finite = position.iter().all(|x| x.is_finite());
    finite.then_some(())?;
    Some(Node { number: whole(v[0])?, definition_system: whole(v[1])?, displacement_system: whole(v[2])?, colour: whole(v[3])?, position })
}

/// A trace line.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceLine {
    pub number: i64,
    pub colour: i64,
    pub name: String,
    /// Nodes the header declares.
    pub declared: i64,
    /// As stored: node numbers, 0 lifts the pen; some programs fill the last line with zeros.
    pub nodes: Vec<i64>,
}

pub(super) fn trace(body: &[u8]) -> Result<TraceLine, Fault> {
    let mut lines = Lines::new(body);
    let line = lines.need("its first line")?;
    let f = Fields::new(&line, &[10, 10, 10]);
    let (number, declared, colour) = (f.integer(0, "the trace number")?, f.integer(1, "the number of nodes")?, f.integer(2, "the colour")?);
    let name = lines.need("its name")?.text.trim().to_string();
    let at = lines.at;
    let nodes = integers(lines.rest(), at, 10)?;
    if (nodes.len() as i64) < declared {
        return Err(Fault::new(at, format!("{declared} nodes are declared, {} stand there", nodes.len()), "as many nodes as declared"));
    }
    Ok(TraceLine { number, colour, name, declared, nodes })
}

/// Whole numbers in words, or in columns where these touch.
fn integers(bytes: &[u8], at: usize, width: usize) -> Result<Vec<i64>, Fault> {
    let mut lines = Lines::new(bytes);
    let mut all = Vec::new();
    while let Some(line) = lines.next() {
        let words = line.text.split_whitespace().map(|w| w.parse::<i64>().ok()).collect::<Option<Vec<i64>>>();
        let columns = || {
            let widths = vec![width; line.text.trim_end().len().div_ceil(width)];
            let f = Fields::new(&line, &widths);
            (0..widths.len()).map(|i| f.integer(i, "a number")).collect::<Result<Vec<i64>, Fault>>()
        };
        // A word longer than its column is two numbers that touch.
        let touching = line.text.split_whitespace().any(|w| w.len() > width);
        let found = match words.filter(|_| !touching) {
            Some(words) => words,
            None => columns().map_err(|f| Fault { offset: at + f.offset, ..f })?,
        };
        all.extend(found);
    }
    Ok(all)
}

/// An element of set 2412.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    pub number: i64,
    /// Finite-element descriptor: 11 rod, 21 beam, 41 triangle, 44 quadrilateral, 111 tetrahedron, ...
    pub descriptor: i64,
    pub physical_table: i64,
    pub material_table: i64,
    pub colour: i64,
    pub nodes: Vec<i64>,
    /// Orientation node and end cross-sections (rods and beams).
    pub beam: Option<[i64; 3]>,
}

/// Rods and beams have a line of their own between the first and the nodes.
const BEAMS: [i64; 5] = [11, 21, 22, 23, 24];

pub(super) fn elements(body: &[u8]) -> Result<Vec<Element>, Fault> {
    let mut lines = Lines::new(body);
    let mut all = Vec::new();
    while let Some(line) = lines.next() {
        if line.text.trim().is_empty() {
            continue;
        }
        let f = Fields::new(&line, &[10; 6]);
        let whole = |i: usize, what: &str| f.integer(i, what);
        let count = whole(5, "the number of nodes")?;
        if !(1..=1000).contains(&count) {
            return Err(Fault::new(line.offset, format!("an element with {count} nodes"), "1 to 1000 nodes"));
        }
        let descriptor = whole(1, "the element descriptor")?;
        let beam = if BEAMS.contains(&descriptor) {
            let line = lines.need("the orientation of a beam")?;
            let f = Fields::new(&line, &[10; 3]);
            Some([f.integer(0, "the orientation node")?, f.integer(1, "an end section")?, f.integer(2, "an end section")?])
        } else {
            None
        };
        let mut nodes = Vec::new();
        while nodes.len() < count as usize {
            let at = lines.at;
            let line = lines.need("the nodes of an element")?;
            let found = integers(line.text.as_bytes(), at, 10)?;
            if found.is_empty() || nodes.len() + found.len() > count as usize {
                return Err(Fault::new(
                    at,
                    format!("an element of {count} nodes, and {} numbers", nodes.len() + found.len()),
                    "as many nodes as declared",
                ));
            }
            nodes.extend(found);
        }
        all.push(Element {
            number: whole(0, "the element number")?,
            descriptor,
            physical_table: whole(2, "the physical table")?,
            material_table: whole(3, "the material table")?,
            colour: whole(4, "the colour")?,
            nodes,
            beam,
        });
    }
    Ok(all)
}
