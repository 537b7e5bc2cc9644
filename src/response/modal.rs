//! A table of natural frequencies and damping ratios, compared by their logarithms.
//!
//! Where the rows state families, the first mode of a family in the table is the first of that family in the model, and so on; else the
//! numbers of the rows count the modes of the model. Rigid-body modes are never in a table.

use crate::data::{ModalTable, ModeRow};
use crate::engine::EngineError;
use crate::engine::modal::{Mode, Range, modes};
use crate::model::{Bound, Model};

use super::family::Family;
use super::{Block, BlockKind, Computed, Plan, ResponseError, TableForm};

/// A modal table made ready.
#[derive(Clone, Debug)]
pub struct ModalPlan {
    rows: Vec<Row>,
}

/// The modes of a model against a table.
#[derive(Clone, Debug)]
pub struct TableModes {
    /// Modes of the model, ascending; no rigid-body modes.
    pub found: Vec<Mode>,
    /// What each of them is.
    pub families: Vec<Family>,
    /// Which of them each row of the table is, in the order of the test's values.
    pub rows: Vec<usize>,
}

/// The mode of a row by its order from the lowest, in its family where it states one.
#[derive(Clone, Copy, Debug)]
struct Row {
    family: Option<Family>,
    order: usize,
    damping: bool,
    /// As measured [Hz].
    frequency: f64,
}

/// Assumed relative deviation of a frequency and of a damping ratio that state none.
const UNSTATED: [f64; 2] = [0.005, 0.05];

impl ModalPlan {
    pub(super) fn new(table: &ModalTable, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        let mut rows: Vec<Row> = Vec::new();
        let mut table = table.clone();
        if table.rows.iter().any(|r| r.family.is_some()) {
            let known = |r: &ModeRow| r.family.as_deref().and_then(Family::parse);
            for row in table.rows.iter().filter(|r| known(r).is_none()) {
                let family = row.family.as_ref().map_or("no family".into(), |f| format!("the family `{f}`"));
                plan.notes.push(format!("mode {} has {family}, with which no mode is paired: it is not compared", row.mode));
            }
            if table.rows.iter().all(|r| known(r).is_none()) {
                let accepted = "families xy bending, torsion or yz bending; none at all to pair by number";
                return Err(ResponseError::invalid(&id, "modes cannot be paired: the table names no family of the model's", accepted));
            }
            table.rows.retain(|r| known(r).is_some());
            table.rows.sort_by_key(|r| r.mode);
        }
        let (mut values, mut sigmas, mut numbers) = ([vec![], vec![]], [vec![], vec![]], [vec![], vec![]]);
        for row in &table.rows {
            let number = row.mode as usize;
            if number == 0 {
                return Err(ResponseError::invalid(&id, format!("{}: mode 0", row.place), "modes counted from 1"));
            }
            let family = row.family.as_deref().and_then(Family::parse);
            let order = family.map_or(number - 1, |_| rows.iter().filter(|r| r.family == family).count());
            rows.push(Row { family, order, damping: row.damping.is_some(), frequency: row.frequency.value });
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

    pub(super) fn periods(&self) -> (f64, f64) {
        let periods = self.rows.iter().map(|r| r.frequency.recip());
        periods.fold((f64::INFINITY, 0.0), |(lo, hi), t| (lo.min(t), hi.max(t)))
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
        let (found, pairs) = self.pair(model, bound, plan, sensitivities)?;
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let mut out = Computed::default();
        for &mode in &pairs {
            let m = &found[mode];
            let f = m.frequency_hz;
            out.values.push(if plain { f } else { f.ln() });
            out.slopes.extend((0..n_free).map(|k| if plain { m.frequency_slope(k) } else { m.frequency_slope(k) / f }));
        }
        for (&mode, _) in pairs.iter().zip(&self.rows).filter(|(_, r)| r.damping) {
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

    /// The modes of the model beside the rows of the table.
    pub(super) fn modes(&self, model: &Model, bound: &Bound, plan: &Plan) -> Result<TableModes, ResponseError> {
        let (found, rows) = self.pair(model, bound, plan, false)?;
        let families = found.iter().map(|m| Family::of(model, &m.shape)).collect();
        Ok(TableModes { found, families, rows })
    }

    /// The modes of the model, and which of them each row is.
    fn pair(&self, model: &Model, bound: &Bound, plan: &Plan, sensitivities: bool) -> Result<(Vec<Mode>, Vec<usize>), ResponseError> {
        let named = |source: EngineError| ResponseError::Engine { test: plan.id.clone(), source };
        let mut count = self.rows.iter().map(|r| r.order + 1).max().unwrap_or(0).max(self.rows.len());
        loop {
            let mut found = modes(model, bound, Range::Lowest(count), sensitivities).map_err(named)?;
            let all = found.len() < count || count >= model.dofs.len();
            found.retain(|m| m.frequency_hz > 0.0);
            let families: Vec<Family> = found.iter().map(|m| Family::of(model, &m.shape)).collect();
            let of = |row: &Row| (0..found.len()).filter(|k| row.family.is_none_or(|f| families[*k] == f)).nth(row.order);
            let pairs: Vec<Option<usize>> = self.rows.iter().map(of).collect();
            if let Some(pairs) = pairs.iter().copied().collect::<Option<Vec<usize>>>() {
                return Ok((found, pairs));
            }
            if all {
                let row = self.rows.iter().zip(&pairs).find(|(_, p)| p.is_none()).map_or(&self.rows[0], |(r, _)| r);
                let kind = row.family.map_or("flexible", Family::word);
                let there = families.iter().filter(|f| row.family.is_none_or(|r| r == **f)).count();
                let message = format!("modes cannot be paired: the model has {there} {kind} modes");
                return Err(ResponseError::invalid(&plan.id, message, format!("at least {}", row.order + 1)));
            }
            count = (2 * count).min(model.dofs.len());
        }
    }
}

/// Damping ratio below which none is told from none.
const LEAST: f64 = 1e-9;
