//! A test that was not measured: an existing one with another drive.

use crate::units::Unit;

use super::{Block, BlockKind, Plan, Work};

/// What is changed of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Factor on the frequency of a cycle, or on all lines of an FRF.
    pub frequency: f64,
    /// Factor on the half range of the drive of a cycle.
    pub amplitude: f64,
    /// Shift of the mean of the drive of a cycle, in parts of its new half range.
    pub mean: f64,
    /// Peak of the exciting force of an FRF [N or N m]; none leaves it as it is.
    pub excitation: Option<f64>,
    /// Another value [SI] of one of the test's conditions, by its place in the order of their names.
    pub condition: Option<(usize, f64)>,
}

impl Default for Variation {
    fn default() -> Self {
        Variation { frequency: 1.0, amplitude: 1.0, mean: 0.0, excitation: None, condition: None }
    }
}

/// The drive of a cycle test.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleDrive {
    /// Frequency [Hz].
    pub frequency: f64,
    /// Half range [SI].
    pub amplitude: f64,
    /// Mean [SI].
    pub mean: f64,
    /// Unit it was recorded in.
    pub unit: Unit,
}

/// Lines of a varied FRF at most.
const VARIED: usize = 80;

impl Plan {
    /// The beginning of a record: its first `1.5 2^doublings` cycles; `None` of another kind of test, and where that is all of it.
    pub fn opening(&self, doublings: u32) -> Option<Plan> {
        let Work::Transient(record) = &self.work else { return None };
        let n = record.opening(self, doublings)?;
        let work = Work::Transient(record.begun(n));
        let mut plan = Plan { measured: vec![], sigma: vec![], blocks: vec![], scatter: vec![], covariance: None, work, ..self.clone() };
        for block in &self.blocks {
            let of = |values: &[f64]| values.iter().take(n).copied().collect::<Vec<f64>>();
            let (measured, sigma) = (of(&self.measured[block.range.clone()]), of(&self.sigma[block.range.clone()]));
            let range = plan.len()..plan.len() + n;
            let block = Block { range, abscissa: of(&block.abscissa), x: of(&block.x), v: of(&block.v), ..block.clone() };
            plan.add_block(block, measured, sigma);
        }
        Some(plan)
    }

    /// The same test with its drive or a condition changed; `None` for tests that are neither cycles nor FRFs nor modal tables, of which the last have
    /// conditions alone. What was measured loses its meaning, and with it what instruments add to the covariance; sigma grows with the range of a drive
    /// and shrinks with none.
    pub fn varied(&self, by: &Variation) -> Option<Plan> {
        let mut plan = Plan { scatter: vec![], covariance: None, ..self.clone() };
        if let Some((at, level)) = by.condition {
            *plan.conditions.values_mut().nth(at)? = level;
        }
        match &self.work {
            Work::Cycle(cycle) => {
                plan.work = Work::Cycle(cycle.varied(by));
                plan.sigma.iter_mut().for_each(|s| *s *= by.amplitude.max(1.0));
            }
            Work::Frf(frf) => {
                let lines = frf.lines();
                let kept: Vec<(usize, f64)> = (0..lines).step_by(lines.div_ceil(VARIED).max(1)).map(|k| (k, 1.0)).collect();
                plan = plan.of_lines(&kept);
                plan.work = Work::Frf(frf.of_lines(&kept.iter().map(|k| k.0).collect::<Vec<_>>()).varied(by));
                plan.blocks.iter_mut().flat_map(|b| &mut b.abscissa).for_each(|f| *f *= by.frequency);
            }
            Work::Modal(_) if by.condition.is_some() => {}
            _ => return None,
        }
        Some(plan)
    }

    /// The plan as if `computed` with noise of `deviates` times sigma had been measured, on instruments of the given tolerance.
    pub fn measuring(mut self, computed: &[f64], deviates: impl Iterator<Item = f64>) -> Plan {
        self.measured = computed.iter().zip(&self.sigma).zip(deviates).map(|((c, s), z)| c + s * z).collect();
        self.with_instruments(computed)
    }

    /// Noise of an FRF at another place of its band in proportion to the response there, as it is where it was measured.
    pub fn with_noise_of(&mut self, from: &Plan, computed: &[f64]) {
        if self.blocks.first().is_none_or(|b| b.kind != BlockKind::Frf) {
            return;
        }
        let size = |h: &[f64]| h.chunks(2).map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt()).collect::<Vec<f64>>();
        let mut relative: Vec<f64> = size(&from.measured).iter().zip(from.sigma.chunks(2)).map(|(h, s)| s[0] / h).collect();
        relative.sort_by(f64::total_cmp);
        let Some(part) = relative.get(relative.len() / 2).copied().filter(|p| p.is_finite() && *p > 0.0) else { return };
        self.sigma = size(computed).into_iter().flat_map(|h| [part * h; 2]).collect();
    }

    /// Frequency, half range and mean of the drive of a cycle test.
    pub fn cycle_drive(&self) -> Option<CycleDrive> {
        match &self.work {
            Work::Cycle(cycle) => Some(cycle.drive()),
            _ => None,
        }
    }

    /// Peak of the exciting force of an FRF that declares one [N or N m].
    pub fn excitation(&self) -> Option<f64> {
        match &self.work {
            Work::Frf(frf) => frf.excitation(),
            _ => None,
        }
    }
}
