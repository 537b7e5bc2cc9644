//! Tables of energies and of modes, inline in dataset.toml, each value with its standard deviation.

use std::fmt::Write;

use crate::data::{BackboneTable, Control, EnergyTable, ModalTable, ModeRow, StoredEnergy};
use crate::model::Axis;
use crate::response::Plan;

use super::noise::Noise;
use super::quoted;

type Values<'a> = std::iter::Copied<std::slice::Iter<'a, f64>>;

/// Computed values of the block of this role.
fn block<'a>(plan: &Plan, role: &str, computed: &'a [f64]) -> Values<'a> {
    plan.blocks.iter().find(|b| b.role == role).and_then(|b| computed.get(b.range.clone())).unwrap_or(&[]).iter().copied()
}

/// `name = "value unit", sigma_name = "..."`. The noise acts on the logarithm, as tables are compared, so that no value turns negative.
fn entry(cells: &mut Vec<String>, name: &str, value: f64, unit: &str, noise: &mut Noise) {
    let measured = value * (noise.fraction() * noise.normal()).exp();
    let sigma = noise.fraction() * measured.abs();
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    cells.push(format!("{name} = \"{measured:.16e}{unit}\""));
    if sigma > 0.0 {
        cells.push(format!("sigma_{name} = \"{sigma:e}{unit}\""));
    }
}

/// Natural frequencies and damping ratios of the rows that the plan pairs with modes, in its order; a row of another family has none.
pub(super) fn modal(toml: &mut String, table: &ModalTable, plan: &Plan, computed: &[f64], noise: &mut Noise) {
    let (mut frequencies, mut dampings) = (block(plan, "natural_frequency", computed), block(plan, "modal_damping", computed));
    let paired = plan.blocks.iter().find(|b| b.role == "natural_frequency").map_or(&[][..], |b| &b.abscissa);
    let mut rows: Vec<&ModeRow> = table.rows.iter().filter(|r| paired.contains(&f64::from(r.mode))).collect();
    if rows.iter().any(|r| r.family.is_some()) {
        rows.sort_by_key(|r| r.mode);
    }
    toml.push_str("rows = [\n");
    for row in rows {
        let mut cells = vec![format!("mode = {}", row.mode)];
        if let Some(f) = frequencies.next() {
            entry(&mut cells, "frequency", f, "Hz", noise);
        }
        if let Some(d) = row.damping.as_ref().and_then(|_| dampings.next()) {
            entry(&mut cells, "damping", d, "", noise);
        }
        for (key, text) in [("family", &row.family), ("description", &row.description)] {
            cells.extend(text.as_ref().map(|t| format!("{key} = {}", quoted(t))));
        }
        let _ = writeln!(toml, "  {{ {} }},", cells.join(", "));
    }
    toml.push_str("]\n");
}

/// Frequencies and damping ratios over the amplitudes of the rows, which are written as the rig sets them: without noise.
pub(super) fn backbone(toml: &mut String, table: &BackboneTable, plan: &Plan, computed: &[f64], noise: &mut Noise) {
    let _ = writeln!(toml, "at = \"{}\"", table.at);
    if let Some(mode) = table.mode {
        let _ = writeln!(toml, "mode = {mode}");
    }
    let (mut frequencies, mut dampings) = (block(plan, "backbone_frequency", computed), block(plan, "backbone_damping", computed));
    toml.push_str("rows = [\n");
    for row in &table.rows {
        let mut cells = vec![format!("amplitude = \"{}\"", row.unit.print(row.amplitude))];
        if let Some(f) = row.frequency.as_ref().and_then(|_| frequencies.next()) {
            entry(&mut cells, "frequency", f, "Hz", noise);
        }
        if let Some(d) = row.damping.as_ref().and_then(|_| dampings.next()) {
            entry(&mut cells, "damping", d, "", noise);
        }
        let _ = writeln!(toml, "  {{ {} }},", cells.join(", "));
    }
    toml.push_str("]\n");
}

/// Energies per cycle.
pub(super) fn energy(toml: &mut String, table: &EnergyTable, plan: &Plan, computed: &[f64], noise: &mut Noise) {
    let force = table.control == Control::Force;
    let _ = writeln!(toml, "at = \"{}\"\ncontrol = \"{}\"", table.at, table.control.role().word());
    if let Some((low, high)) = table.limits {
        let rotational = table.at.rsplit_once('.').and_then(|(_, a)| Axis::parse(a).ok()).is_some_and(|a| a.rotational());
        let (name, unit) = match (force, rotational) {
            (true, false) => ("force", "N"),
            (true, true) => ("force", "N m"),
            (false, false) => ("displacement", "m"),
            (false, true) => ("displacement", "rad"),
        };
        let _ = writeln!(toml, "{name}_min = \"{low:e} {unit}\"\n{name}_max = \"{high:e} {unit}\"");
    }
    if let Some(reading) = table.stored {
        let _ = writeln!(toml, "W_s_reading = \"{}\"", if reading == StoredEnergy::Slope { "slope" } else { "product" });
    }
    let (mut dissipated, mut stored) = (block(plan, "dissipated", computed), block(plan, "stored", computed));
    toml.push_str("rows = [\n");
    for row in &table.rows {
        let mut cells = Vec::new();
        if let Some(case) = &row.case {
            cells.push(format!("case = {}", quoted(case)));
        }
        if let Some(f) = row.frequency {
            cells.push(format!("frequency = \"{f:e} Hz\""));
        }
        let wanted = [("W_D", row.dissipated.is_some(), &mut dissipated), ("W_s", row.stored.is_some(), &mut stored)];
        for (name, there, values) in wanted {
            if let Some(value) = there.then(|| values.next()).flatten() {
                entry(&mut cells, name, value, "J", noise);
            }
        }
        let _ = writeln!(toml, "  {{ {} }},", cells.join(", "));
    }
    toml.push_str("]\n");
}
