//! A table of natural frequencies and damping ratios, compared by their logarithms.
//!
//! Where the rows state families, the first mode of a family in the table is the first of that family in the model, and so on; else the
//! numbers of the rows count the modes of the model. Rigid-body modes are never in a table, and overdamped
//! ones, which do not swing, only where the model swings less often than the table has rows.

use std::collections::BTreeMap;

use num_complex::Complex64;

use crate::data::modal_fit::mac;
use crate::data::{ModalTable, ModeRow};
use crate::engine::EngineError;
use crate::engine::modal::{Mode, Modes, Range, Shares, shares};
use crate::model::{Bound, FreeParam, Model, System};

use super::family::Family;
use super::{Block, BlockKind, Computed, Plan, ResponseError, TableForm, Work};

/// A modal table made ready.
#[derive(Clone, Debug)]
pub struct ModalPlan {
    rows: ModalRows,
    against: Option<Against>,
}

/// Another table, against whose frequencies those of a table are compared as shifts.
#[derive(Clone, Debug)]
struct Against {
    id: String,
    conditions: BTreeMap<String, f64>,
    rows: ModalRows,
    /// For every row of the table, the row of the other with its mode and the logarithm of the frequency measured there.
    same: Vec<Option<(usize, f64)>>,
}

/// The modes of a model against a table.
#[derive(Clone, Debug)]
pub struct TableModes {
    /// Modes of the model that are held against the table, ascending.
    pub found: Vec<Mode>,
    /// What each of them is.
    pub families: Vec<Family>,
    /// Which of them each row of the table is, in the order of the test's values.
    pub rows: Vec<usize>,
    /// Where the energy of each of `found` is.
    pub shares: Vec<Shares>,
}

/// The rows of a table.
#[derive(Clone, Debug)]
struct ModalRows(Vec<Row>);

/// Role of the block of natural frequencies.
const FREQUENCY: &str = "natural_frequency";

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
        plan.notes.append(&mut table.notes);
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
        Ok(ModalPlan { rows: ModalRows(rows), against: None })
    }

    /// The same table with its frequencies compared as shifts against `other`, of the modes that `wanted` takes and that both tables have: what is computed is
    /// multiplied by measured / computed frequency of the other test, so that an error that both have in common falls out.
    pub(super) fn against(&self, own: &Plan, other: &ModalPlan, plan: &Plan, wanted: impl Fn(f64) -> bool) -> ModalPlan {
        let frequencies = |p: &Plan| p.blocks.iter().find(|b| b.role == FREQUENCY).cloned();
        let (Some(here), Some(there)) = (frequencies(own), frequencies(plan)) else { return self.clone() };
        let row = |mode: &f64| {
            let k = there.abscissa.iter().position(|m| m == mode).filter(|_| wanted(*mode))?;
            Some((k, plan.measured[there.range.start + k]))
        };
        let same = here.abscissa.iter().map(row).collect();
        let against = Against { id: plan.id.clone(), conditions: plan.conditions.clone(), rows: other.rows.clone(), same };
        ModalPlan { rows: self.rows.clone(), against: Some(against) }
    }

    /// Rows that are compared as shifts.
    pub(super) fn shifted(&self) -> Vec<usize> {
        self.against.iter().flat_map(|a| a.same.iter().enumerate().filter(|s| s.1.is_some()).map(|s| s.0)).collect()
    }

    pub(super) fn periods(&self) -> (f64, f64) {
        let periods = self.rows.0.iter().map(|r| r.frequency.recip());
        periods.fold((f64::INFINITY, 0.0), |(lo, hi), t| (lo.min(t), hi.max(t)))
    }

    pub(super) fn evaluate(
        &self,
        system: &System,
        free: &[FreeParam],
        plan: &Plan,
        sensitivities: bool,
        form: TableForm,
    ) -> Result<Computed, ResponseError> {
        let plain = form == TableForm::Plain;
        let bound = plan.bind(system, free)?;
        let (found, mut pairs) = self.rows.pair(&system.model, &bound, &plan.id, sensitivities)?;
        let reference = self.against.as_ref().map(|a| a.modes(system, free, sensitivities)).transpose()?;
        if let (Some(against), Some(reference)) = (&self.against, &reference) {
            against.follow(&system.model, reference, &found, &mut pairs);
        }
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let mut out = Computed::default();
        for &mode in &pairs {
            let m = &found[mode];
            let f = m.frequency_hz;
            out.values.push(if plain { f } else { f.ln() });
            out.slopes.extend((0..n_free).map(|k| if plain { m.frequency_slope(k) } else { m.frequency_slope(k) / f }));
        }
        if let (Some(against), Some(reference)) = (&self.against, &reference) {
            against.take_out(reference, n_free, plain, &mut out);
        }
        for (&mode, _) in pairs.iter().zip(&self.rows.0).filter(|(_, r)| r.damping) {
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
    pub(super) fn modes(&self, system: &System, plan: &Plan) -> Result<TableModes, ResponseError> {
        let bound = plan.bind(system, &[])?;
        let (found, mut rows) = self.rows.pair(&system.model, &bound, &plan.id, false)?;
        if let Some(against) = &self.against {
            against.follow(&system.model, &against.modes(system, &[], false)?, &found, &mut rows);
        }
        let families = found.iter().map(|m| Family::of(&system.model, &m.shape)).collect();
        let shares = shares(&system.model, &bound, &found).map_err(|source| ResponseError::Engine { test: plan.id.clone(), source })?;
        Ok(TableModes { found, families, rows, shares })
    }
}

impl Plan {
    /// A modal table whose frequencies are compared as shifts against those of another one, of the modes that `wanted` takes and both have, with the relative
    /// deviation `sigma`: what is computed is multiplied by measured / computed of the other test. Other tests as they are.
    pub fn shifted_against(mut self, other: &Plan, sigma: f64, wanted: impl Fn(f64) -> bool) -> Plan {
        let (Work::Modal(own), Work::Modal(there)) = (&self.work, &other.work) else { return self };
        let shifted = own.against(&self, there, other, wanted);
        let rows = shifted.shifted();
        self.work = Work::Modal(shifted);
        let Some(block) = self.blocks.iter().find(|b| b.role == FREQUENCY) else { return self };
        let modes: Vec<String> = rows.iter().map(|k| block.abscissa[*k].to_string()).collect();
        rows.iter().for_each(|k| self.sigma[block.range.start + k] = sigma);
        self.notes.push(format!(
            "the frequencies of modes {} are compared as shifts against `{}`, to {:.3} %: computed, times measured over computed there",
            modes.join(", "),
            other.id,
            100.0 * sigma
        ));
        self
    }
}

/// Modes of a model, and which of them each row of a table is.
type Paired = (Vec<Mode>, Vec<usize>);

impl Against {
    /// The modes of the model in the other test.
    fn modes(&self, system: &System, free: &[FreeParam], sensitivities: bool) -> Result<Paired, ResponseError> {
        let bound = Bound::new(system, free, &self.id, &self.conditions)?;
        self.rows.pair(&system.model, &bound, &self.id, sensitivities)
    }

    /// A mode that shifts stays the mode it was: the one whose shape is most like that of the other test (MAC, weighted by the square roots of the masses),
    /// where one is more like it than not and no other row has it.
    fn follow(&self, model: &Model, (modes, rows): &Paired, found: &[Mode], pairs: &mut [usize]) {
        let weighted = |m: &Mode| m.shape.iter().zip(&model.dofs).map(|(x, d)| x * d.mass.max(0.0).sqrt()).collect::<Vec<Complex64>>();
        let shapes: Vec<Vec<Complex64>> = found.iter().map(weighted).collect();
        let mut best: Vec<(usize, usize, f64)> = Vec::new();
        for (i, (k, _)) in self.same.iter().enumerate().filter_map(|(i, s)| Some((i, (*s)?))) {
            let there = weighted(&modes[rows[k]]);
            best.extend(shapes.iter().enumerate().map(|(m, shape)| (i, m, mac(&there, shape))).filter(|b| b.2 > ALIKE));
        }
        for (i, m, _) in best {
            if pairs.iter().enumerate().all(|(j, p)| j == i || *p != m || self.same[j].is_some()) {
                pairs[i] = m;
            }
        }
    }

    /// Multiplies frequencies (adds to their logarithms) what the other test was measured at over what is computed of it.
    fn take_out(&self, (modes, rows): &Paired, n_free: usize, plain: bool, out: &mut Computed) {
        for (i, (k, measured)) in self.same.iter().enumerate().filter_map(|(i, s)| Some((i, (*s)?))) {
            let mode = &modes[rows[k]];
            let f = mode.frequency_hz;
            let factor = if plain { (measured - f.ln()).exp() } else { 1.0 };
            let before = out.values[i];
            out.values[i] = if plain { before * factor } else { before + measured - f.ln() };
            for (p, slope) in out.slopes[i * n_free..(i + 1) * n_free].iter_mut().enumerate() {
                let common = mode.frequency_slope(p) / f;
                *slope = factor * (*slope - common * if plain { before } else { 1.0 });
            }
        }
    }
}

/// MAC beyond which two shapes are the same mode: no other of an orthogonal set can have as much of it.
const ALIKE: f64 = 0.5;

impl ModalRows {
    /// Which of these modes each row is; else the first row that is none, and how many modes there are of its family.
    fn among(&self, model: &Model, found: &[Mode]) -> Result<Vec<usize>, (Row, usize)> {
        let families: Vec<Family> = found.iter().map(|m| Family::of(model, &m.shape)).collect();
        let alike = |row: &Row| (0..found.len()).filter(|k| row.family.is_none_or(|f| families[*k] == f)).collect::<Vec<_>>();
        self.0.iter().map(|row| alike(row).get(row.order).copied().ok_or_else(|| (*row, alike(row).len()))).collect()
    }

    /// The modes of the model, and which of them each row is.
    fn pair(&self, model: &Model, bound: &Bound, id: &str, sensitivities: bool) -> Result<Paired, ResponseError> {
        let named = |source: EngineError| ResponseError::Engine { test: id.into(), source };
        let mut count = self.0.iter().map(|r| r.order + 1).max().unwrap_or(0).max(self.0.len());
        // Overdamped ones for which others were asked for.
        let mut replaced = 0;
        let mut modes = Modes::new(model, bound, Range::Lowest(count), sensitivities).map_err(named)?;
        loop {
            let mut found = modes.lowest(count).map_err(named)?;
            let creeping = found.iter().filter(|m| m.creeps()).count();
            let swinging: Vec<Mode> = found.iter().filter(|m| m.oscillates()).cloned().collect();
            if let Ok(pairs) = self.among(model, &swinging) {
                return Ok((swinging, pairs));
            }
            if count >= model.dofs.len() || (found.len() < count && creeping == 0) {
                // A model that does not swing as often as the table has rows, as at a start with dampers far too large, is paired by all its poles.
                found.retain(|m| m.frequency_hz > 0.0);
                return match self.among(model, &found) {
                    Ok(pairs) => Ok((found, pairs)),
                    Err((row, there)) => {
                        let kind = row.family.map_or("flexible", Family::word);
                        let message = format!("modes cannot be paired: the model has {there} {kind} modes");
                        Err(ResponseError::invalid(id, message, format!("at least {}", row.order + 1)))
                    }
                };
            }
            // Only as many more as are needed: beyond them lie modes that no test shows.
            count = (if creeping > replaced { count + creeping - replaced } else { 2 * count }).min(model.dofs.len());
            replaced = replaced.max(creeping);
        }
    }
}

/// Damping ratio below which none is told from none.
const LEAST: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Body;

    #[test]
    fn an_overdamped_pole_is_no_mode_of_a_table() {
        // Two masses of 1 kg on springs of 1 kN/m; the second drags through 10 kN s/m and stands still beside the first, which swings on both springs.
        let body = |name: &str, free: bool| Body {
            name: name.into(),
            mass: f64::from(u8::from(free)),
            inertia: 0.0,
            free: if free { vec![crate::model::Axis::X] } else { vec![] },
        };
        let bodies = vec![body("ground", false), body("m1", true), body("m2", true)];
        let joints = [("c1", "ground", "m1"), ("c2", "m1", "m2"), ("drag", "ground", "m2")];
        let system = System::new(Model::joined(bodies, &joints).unwrap())
            .and("linear_stiffness", "c1-2.x", &[("k", 1e3)])
            .and_then(|s| s.and("viscous", "drag.x", &[("c", 1e4)]))
            .unwrap();
        let bound = Bound::new(&system, &[], "t", &BTreeMap::new()).unwrap();
        let first = ModalRows(vec![Row { family: None, order: 0, damping: false, frequency: 7.0 }]);
        let (found, rows) = first.pair(&system.model, &bound, "t", false).unwrap();
        let want = 2e3f64.sqrt() / std::f64::consts::TAU;
        assert!((found[rows[0]].frequency_hz / want - 1.0).abs() < 1e-3, "{:?}", found[rows[0]]);
        // The model has one such mode. A table of two is held against all its poles, so that a fit from such a start may go on; one of three is not to be met.
        let row = |order: usize| ModalRows(vec![Row { family: None, order, damping: false, frequency: 7.0 }]);
        assert_eq!(row(1).pair(&system.model, &bound, "t", false).unwrap().0.len(), 2);
        assert!(row(2).pair(&system.model, &bound, "t", false).unwrap_err().to_string().contains("2 flexible"));
    }
}
