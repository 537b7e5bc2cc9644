//! A table of natural frequencies and damping ratios, compared by their logarithms.

use crate::data::ModalTable;
use crate::engine::EngineError;
use crate::engine::modal::{Range, modes};
use crate::model::{Bound, Model};

use super::{Block, BlockKind, Computed, Plan, ResponseError, TableForm};

/// A modal table made ready: the mode of each row by its order from the lowest, and whether its damping is compared.
#[derive(Clone, Debug)]
pub struct ModalPlan {
    rows: Vec<(usize, bool)>,
}

/// Assumed relative deviation of a frequency and of a damping ratio that state none.
const UNSTATED: [f64; 2] = [0.005, 0.05];

impl ModalPlan {
    pub(super) fn new(table: &ModalTable, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        let mut rows = Vec::new();
        let (mut values, mut sigmas, mut numbers) = ([vec![], vec![]], [vec![], vec![]], [vec![], vec![]]);
        for row in &table.rows {
            let number = row.mode as usize;
            if number == 0 {
                return Err(ResponseError::invalid(&id, format!("{}: mode 0", row.place), "modes counted from 1"));
            }
            rows.push((number - 1, row.damping.is_some()));
            for (k, value) in [Some(&row.frequency), row.damping.as_ref()].into_iter().enumerate() {
                let Some(v) = value else { continue };
                if v.value <= 0.0 {
                    return Err(ResponseError::invalid(&id, format!("{}: {}", row.place, v.value), "frequency and damping above zero"));
                }
                values[k].push(v.value.ln());
                sigmas[k].push(v.sigma.map_or(UNSTATED[k], |s| s / v.value).max(v.rounding / v.value));
                numbers[k].push(f64::from(row.mode));
            }
        }
        if table.rows.iter().any(|r| r.frequency.sigma.is_none()) {
            plan.notes.push("no sigma is stated: 0.5 % of a frequency and 5 % of a damping ratio are assumed".into());
        }
        for (k, (name, unit)) in [("natural frequency", "Hz"), ("modal damping", "-")].into_iter().enumerate() {
            if values[k].is_empty() {
                continue;
            }
            let start = plan.measured.len();
            let block = Block {
                label: name.into(),
                role: name.replace(' ', "_"),
                unit: unit.into(),
                kind: BlockKind::Table,
                range: start..start + values[k].len(),
                abscissa: std::mem::take(&mut numbers[k]),
                x: vec![],
                v: vec![],
            };
            plan.add_block(block, std::mem::take(&mut values[k]), std::mem::take(&mut sigmas[k]));
        }
        Ok(ModalPlan { rows })
    }

    pub(super) fn evaluate(
        &self,
        model: &Model,
        bound: &Bound,
        plan: &Plan,
        sensitivities: bool,
        form: TableForm,
    ) -> Result<Computed, ResponseError> {
        let plain = form == TableForm::Plain;
        let count = self.rows.iter().map(|r| r.0 + 1).max().unwrap_or(0);
        let named = |source: EngineError| ResponseError::Engine { test: plan.id.clone(), source };
        let found = modes(model, bound, Range::Lowest(count), sensitivities).map_err(named)?;
        if found.len() < count {
            return Err(ResponseError::invalid(&plan.id, format!("the model has {} modes", found.len()), format!("at least {count}")));
        }
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let mut out = Computed::default();
        for &(mode, _) in &self.rows {
            let m = &found[mode];
            let f = m.frequency_hz;
            out.values.push(if plain { f } else { f.ln() });
            out.slopes.extend((0..n_free).map(|k| if plain { m.frequency_slope(k) } else { m.frequency_slope(k) / f }));
        }
        for &(mode, _) in self.rows.iter().filter(|r| r.1) {
            let m = &found[mode];
            if plain {
                out.values.push(m.damping);
                out.slopes.extend((0..n_free).map(|k| m.damping_slope(k)));
                continue;
            }
            // A mode without damping counts as immeasurably lightly damped.
            let damping = m.damping.max(LEAST);
            out.values.push(damping.ln());
            out.slopes.extend((0..n_free).map(|k| if m.damping > LEAST { m.damping_slope(k) / damping } else { 0.0 }));
        }
        Ok(out)
    }
}

/// Damping ratio below which none is told from none.
const LEAST: f64 = 1e-9;
