//! Universal files: functions as FRFs and histories; geometry, shapes and units named.

use super::{At, FoundColumn, FoundFrf, FoundItem, FoundModes, history};
use crate::data::uff::{Dof, Function, SetContent, UffFile, Values, describe, function_kind};
use crate::data::{DataError, Role};
use std::collections::{BTreeMap, BTreeSet};

fn place(dof: &Dof) -> Option<At> {
    let axis = match dof.direction.abs() {
        1 => "x",
        2 => "y",
        3 => "z",
        4 => "theta",
        5 => "phi",
        6 => "psi",
        _ => return None,
    };
    Some((dof.node, axis, dof.direction < 0))
}

/// Histories over one abscissa make one test.
struct Group {
    abscissa: Vec<f64>,
    unit: Option<String>,
    columns: Vec<FoundColumn>,
}

pub(super) fn items(file: &UffFile) -> Result<Vec<FoundItem>, DataError> {
    let mut items = Vec::new();
    let mut groups: Vec<Group> = Vec::new();
    let (mut modes, mut nodes) = (Vec::new(), BTreeSet::new());
    let mut others: BTreeMap<String, usize> = BTreeMap::new();
    let coherences: Vec<String> = file
        .functions()
        .into_iter()
        .filter_map(|i| file.function_header(i).ok())
        .filter(|h| matches!(h.function_type, 6 | 26))
        .map(|h| h.label())
        .collect();
    for i in 0..file.sets.len() {
        let mut count = |what: String| *others.entry(what).or_insert(0) += 1;
        match file.read(i)? {
            SetContent::Function(f) => {
                let system = file.unit_system(i)?;
                let (x, y, quantity) = describe(&f.header, system.as_ref());
                let unit = |u: &crate::data::uff::AxisUnit| u.unit.as_ref().map(|u| u.symbol.clone()).filter(|s| !s.is_empty());
                let mut findings: Vec<String> = f.findings.iter().chain(&y.finding).chain(&x.finding).map(|n| n.text.clone()).collect();
                match (&f.values, f.header.function_type) {
                    (Values::Complex(_), 4) => {
                        let (respond, excite) = (place(&f.header.response), place(&f.header.reference));
                        if f.header.reference.node == 0 && f.header.reference.direction == 0 {
                            findings.push("no reference degree of freedom: excite has to be declared".into());
                        }
                        let against = [respond, excite].iter().flatten().filter(|p| p.2).count();
                        if against == 1 {
                            findings.push("measured against the axis: its sign is the opposite of the axis named here".into());
                        }
                        items.push(FoundItem::Frf(frf(&f, i, respond, excite, quantity, unit(&x), unit(&y), &coherences, findings)));
                    }
                    (Values::Real(values), 0 | 1) if matches!(f.header.abscissa.data_type, 17 | 0 | 1) => {
                        let role = match f.header.ordinate.data_type {
                            8 => Some(Role::Displacement),
                            11 => Some(Role::Velocity),
                            12 => Some(Role::Acceleration),
                            9 | 13 => Some(Role::Force),
                            _ => super::guess_role(&f.header.ordinate.label, unit(&y).as_deref()),
                        };
                        let at = place(&f.header.response).filter(|p| p.0 > 0);
                        let (column, given) = (format!("#{}", i + 1), unit(&y));
                        let column = FoundColumn { column, role, unit: given, values: values.clone(), guessed: false, at, clock: None };
                        match groups.iter_mut().find(|g| g.abscissa == f.abscissa) {
                            Some(g) => g.columns.push(column),
                            None => groups.push(Group { abscissa: f.abscissa.clone(), unit: unit(&x), columns: vec![column] }),
                        }
                        if !findings.is_empty() {
                            items.push(FoundItem::Other(format!("set {}: {}", i + 1, findings.join("; "))));
                        }
                    }
                    _ => count(function_kind(f.header.function_type).to_string()),
                }
            }
            SetContent::Header(h) => items.push(FoundItem::Other(format!("written by {}", [h.program, h.written].join(" ").trim()))),
            SetContent::Units(u) => {
                items.push(FoundItem::Other(format!(
                    "units of set 164: code {} {}, length factor {}, force factor {}",
                    u.code, u.description, u.length, u.force
                )));
            }
            SetContent::Nodes(n) => items.push(FoundItem::Other(format!("{} nodes", n.len()))),
            SetContent::Elements(e) => items.push(FoundItem::Other(format!("{} elements", e.len()))),
            SetContent::Trace(t) => count(format!("trace line ({})", t.name)),
            SetContent::NodalData(d) => match d.mode() {
                // A mode at rest is a rigid body's, and no value of a table.
                Some((f, z)) => {
                    items.push(FoundItem::Other(format!("mode shape at {f:.3} Hz, damping {:.3} %, {} nodes", 100.0 * z, d.nodes.len())));
                    if f > 0.0 && f.is_finite() {
                        modes.push((f, Some(z).filter(|z| *z > 0.0 && *z < 1.0)));
                        nodes.extend(d.nodes.iter().copied());
                    }
                }
                None => count("data at nodes".into()),
            },
            SetContent::Analysis(_) => count("analysis data".into()),
            SetContent::Other => count(format!("set {}, not read", file.sets[i].number)),
        }
    }
    for g in groups {
        let time = Some(Role::Time);
        let mut columns = vec![FoundColumn {
            column: "time".into(),
            role: time,
            unit: g.unit,
            values: g.abscissa,
            guessed: false,
            at: None,
            clock: None,
        }];
        columns.extend(g.columns);
        items.push(FoundItem::History(Box::new(history::found(columns, &history::Corrected::default()))));
    }
    if !modes.is_empty() {
        modes.sort_by(|a, b| a.0.total_cmp(&b.0));
        items.push(FoundItem::Modes(FoundModes { modes, nodes: nodes.into_iter().collect() }));
    }
    items.extend(others.into_iter().map(|(what, n)| FoundItem::Other(if n > 1 { format!("{n} x {what}") } else { what })));
    Ok(items)
}

#[allow(clippy::too_many_arguments)]
fn frf(
    f: &Function,
    i: usize,
    respond: Option<At>,
    excite: Option<At>,
    quantity: Option<crate::data::FrfQuantity>,
    x: Option<String>,
    y: Option<String>,
    coherences: &[String],
    findings: Vec<String>,
) -> FoundFrf {
    let mut columns = vec![
        (Role::Frequency, "frequency".to_string(), x),
        (Role::Real, "real".to_string(), y.clone()),
        (Role::Imag, "imag".to_string(), y),
    ];
    if coherences.iter().filter(|c| **c == f.header.label()).count() == 1 {
        columns.push((Role::Coherence, "coherence".to_string(), None));
    }
    let band = f.abscissa.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let magnitude = match &f.values {
        Values::Complex(h) => f.abscissa.iter().zip(h).map(|(x, h)| (*x, h.norm())).collect(),
        Values::Real(_) => vec![],
    };
    let record = Some(format!("#{}", i + 1));
    FoundFrf { record, respond, excite, quantity, columns, lines: f.abscissa.len(), band, magnitude, averages: None, findings }
}
