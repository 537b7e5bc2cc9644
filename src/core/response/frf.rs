//! A frequency response function.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;

use crate::data::{Frf, FrfQuantity};
use crate::engine::EngineError;
use crate::engine::blocktri::Sweep;
use crate::engine::frf::{Receptance, receptance};
use crate::engine::harmonic::{self, Standing};
use crate::model::{Bound, ChannelPiece, Model};

use super::site::{Seat, seat};
use super::variation::Variation;
use super::{Amplitude, Block, BlockKind, Computed, Plan, ResponseError, Work};

/// Resolutions of the harmonic balance under a declared excitation, [`Plan::refined`] looks which is enough: most of what lies between two levels
/// is a factor of four to ten in time. The balance holds to a part in 1e9, far below what a level leaves out.
const LEVELS: [harmonic::Settings; 3] = [
    harmonic::Settings { harmonics: 3, samples: 64, tolerance: 1e-9 },
    harmonic::Settings { harmonics: 7, samples: 128, tolerance: 1e-9 },
    harmonic::Settings { harmonics: 15, samples: 256, tolerance: 1e-9 },
];

/// An FRF made ready. Compared in the measured quantity.
#[derive(Clone, Debug)]
pub struct FrfPlan {
    omega: Vec<f64>,
    input: usize,
    output: usize,
    quantity: FrfQuantity,
    /// Peak of the exciting force [N], of the line where it is largest; none is small signal.
    excitation: Option<f64>,
    /// The part of that which each line had; empty where all had as much.
    parts: Vec<f64>,
    /// Resolution under it, of [`LEVELS`].
    level: usize,
    /// Where a system stands beside which others are computed, for a look.
    standing: Option<Arc<Standing>>,
}

impl FrfPlan {
    /// First and last line [Hz].
    pub(super) fn band(&self) -> (f64, f64) {
        let ends = self.omega.iter().fold((f64::INFINITY, 0.0f64), |(low, high), w| (low.min(*w), high.max(*w)));
        (ends.0 / std::f64::consts::TAU, ends.1 / std::f64::consts::TAU)
    }

    pub(super) fn new(frf: &Frf, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let dof = |at: &str| match seat(model, at)? {
            Seat::Dof(d) => Ok(d),
            Seat::Place(_) => Err(ResponseError::invalid(&frf.test, format!("`{at}` is a connector"), "a body and axis, such as `m1.x`")),
        };
        let (input, output) = (dof(&frf.excite)?, dof(&frf.respond)?);
        let omega: Vec<f64> = frf.frequency.iter().map(|f| TAU * f).collect();
        let start = plan.measured.len();
        let block = Block {
            label: format!("{} {}/{}", frf.quantity.word(), frf.respond, frf.excite),
            role: "response".into(),
            unit: frf.unit.dimension.si_unit(),
            stated: frf.unit.clone(),
            amplitude_unit: None,
            kind: BlockKind::Frf,
            range: start..start + 2 * omega.len(),
            abscissa: frf.frequency.clone(),
            x: vec![],
            v: vec![],
        };
        // Back from receptance to the quantity in SI.
        let quantity = frf.quantity;
        let measured = frf.receptance.iter().zip(&omega).flat_map(|(h, w)| {
            let h = h * quantity.from_receptance(*w);
            [h.re, h.im]
        });
        let sigma = frf.receptance_sigma.iter().zip(&omega).flat_map(|(s, w)| {
            let s = s * quantity.from_receptance(*w).norm();
            [s, s]
        });
        plan.add_block(block, measured.collect(), sigma.collect());
        plan.notes.extend(frf.notes.iter().map(|n| format!("{}: {}", n.about, n.text)));
        let (excitation, parts) = (frf.excitation, frf.parts.clone());
        Ok(FrfPlan { omega, input, output, quantity, excitation, parts, level: 0, standing: None })
    }

    /// The same at other frequencies or under another excitation.
    pub(super) fn varied(&self, by: &Variation) -> Self {
        let omega = self.omega.iter().map(|w| w * by.frequency).collect();
        let standing = self.standing.clone().filter(|_| by.condition.is_none());
        FrfPlan { omega, excitation: by.excitation.or(self.excitation), standing, ..self.clone() }
    }

    /// The same at these of its lines.
    pub(super) fn of_lines(&self, lines: &[usize]) -> Self {
        let parts = lines.iter().filter_map(|k| self.parts.get(*k).copied()).collect();
        FrfPlan { omega: lines.iter().map(|k| self.omega[*k]).collect(), parts, ..self.clone() }
    }

    /// Number of lines.
    pub(super) fn lines(&self) -> usize {
        self.omega.len()
    }

    /// Whether every line takes more than its share of one sweep: a balance, or a system about a point.
    pub(super) fn dear(&self) -> bool {
        self.excitation.is_some() || self.standing.is_some()
    }

    /// The force of every line where the largest is this.
    fn forces(&self, largest: f64) -> Vec<f64> {
        (0..self.omega.len()).map(|k| largest * self.parts.get(k).copied().unwrap_or(1.0)).collect()
    }

    /// Peak of the exciting force.
    pub(super) fn excitation(&self) -> Option<f64> {
        self.excitation
    }

    /// The same test in the next finer resolution; none where it has no excitation or is as fine as it gets.
    pub(super) fn finer(&self) -> Option<Self> {
        (self.excitation.is_some() && self.level + 1 < LEVELS.len()).then(|| FrfPlan { level: self.level + 1, ..self.clone() })
    }

    /// The same about where this system stands under its loads; `None` where that saves nothing.
    pub(super) fn expanded(&self, model: &Model, bound: &Bound) -> Option<Self> {
        let small = self.excitation.is_none();
        let standing = small.then(|| Standing::of(model, bound).ok()).flatten()??;
        Some(FrfPlan { standing: Some(Arc::new(standing)), ..self.clone() })
    }

    /// The same in the next coarser one.
    pub(super) fn coarser(&self) -> Option<Self> {
        (self.excitation.is_some() && self.level > 0).then(|| FrfPlan { level: self.level - 1, ..self.clone() })
    }

    pub(super) fn periods(&self) -> (f64, f64) {
        let positive = self.omega.iter().filter(|w| **w > 0.0);
        let (lo, hi) = positive.fold((f64::INFINITY, 0.0f64), |(lo, hi), w| (lo.min(*w), hi.max(*w)));
        (TAU / hi, TAU / lo)
    }

    /// Amplitudes at every place over the lines of a test with a declared excitation.
    pub(super) fn amplitudes(&self, model: &Model, bound: &Bound) -> Result<Option<Vec<Amplitude>>, EngineError> {
        let Some(force) = self.excitation else { return Ok(None) };
        let dofs: Vec<usize> = (0..model.dofs.len()).collect();
        let forces = self.forces(force);
        let r = harmonic::under_forces(model, bound, &self.omega, self.input, &forces, &dofs, false, LEVELS[self.level])?;
        let mut widest = vec![Amplitude::default(); model.places.len()];
        for (line, (w, force)) in self.omega.iter().zip(forces).enumerate() {
            let motion = |dof: Option<usize>| dof.map_or(Complex64::ZERO, |d| r.h[line * dofs.len() + d] * force);
            for (a, place) in widest.iter_mut().zip(&model.places) {
                let x = (motion(place.to) - motion(place.from)).norm();
                *a = a.or(Amplitude { x, travel: (-x, x), v: w * x, f: force });
            }
        }
        Ok(Some(widest))
    }

    /// The receptance of the place of the response under a force there, for an accelerometer that weighs something: in small motion, whatever excites the
    /// structure. Its derivatives have a part where the mass is not null.
    fn loaded(
        &self,
        model: &Model,
        bound: &Bound,
        pieces: &[&ChannelPiece],
        sensitivities: bool,
    ) -> Result<Option<Receptance>, EngineError> {
        let mut on = pieces.iter().filter(|p| p.law.reads() == Some("response")).peekable();
        if on.peek().is_none() {
            return Ok(None);
        }
        let weighs = on.any(|p| p.p[0] != 0.0);
        match receptance(model, bound, &self.omega, &[self.output], &[self.output], sensitivities && weighs) {
            // A structure without small motion shows nothing of a candidate.
            Err(_) if !weighs => Ok(None),
            found => found.map(Some),
        }
    }

    pub(super) fn evaluate(&self, model: &Model, bound: &Bound, plan: &Plan, sensitivities: bool) -> Result<Computed, EngineError> {
        let pieces: Vec<_> = bound.channels.iter().filter(|c| ["force", "response"].iter().any(|r| c.site.covers(&plan.id, r))).collect();
        let outputs = if pieces.is_empty() { vec![self.output] } else { vec![self.output, self.input] };
        let r = match self.excitation {
            Some(force) => {
                let forces = self.forces(force);
                harmonic::under_forces(model, bound, &self.omega, self.input, &forces, &outputs, sensitivities, LEVELS[self.level])?
            }
            None => match &self.standing {
                Some(standing) => {
                    let sweep = Sweep { omega: &self.omega, inputs: &[self.input], outputs: &outputs, sensitivities };
                    standing.receptance(model, bound, &sweep)?
                }
                None => receptance(model, bound, &self.omega, &[self.input], &outputs, sensitivities)?,
            },
        };
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let loaded = self.loaded(model, bound, &pieces, sensitivities)?;
        let mut out =
            Computed { values: Vec::with_capacity(2 * self.omega.len()), slopes: Vec::with_capacity(2 * self.omega.len() * n_free) };
        let mut dh = vec![Complex64::ZERO; n_free];
        for (line, w) in self.omega.iter().enumerate() {
            let to_quantity = self.quantity.from_receptance(*w);
            let at = line * outputs.len();
            let mut h = r.h[at];
            dh.copy_from_slice(&r.dh[at * n_free..(at + 1) * n_free]);
            for piece in &pieces {
                // The accelerance of the driven place, for what moves with the load cell, or of that of the response.
                let (own, dr, dfrom) = match (piece.law.reads() == Some("response"), &loaded) {
                    (true, None) => continue,
                    (true, Some(l)) => (l.h[line], &l.dh, line * n_free),
                    (false, _) => (r.h[at + 1], &r.dh, (at + 1) * n_free),
                };
                let drive = -own * w * w;
                let mut dp = vec![Complex64::ZERO; piece.p.len()];
                let (factor, ddrive) = piece.law.factor(*w, drive, &piece.p, &mut dp);
                // A factor on the response multiplies H, one on the force divides it.
                let (g, sign) = if piece.site.role == "force" { (factor.inv(), -1.0) } else { (factor, 1.0) };
                for (k, d) in dh.iter_mut().enumerate() {
                    let df = -ddrive * dr.get(dfrom + k).copied().unwrap_or_default() * w * w;
                    *d = *d * g + h * g * (df / factor) * sign;
                }
                for (d, chain) in dp.iter().zip(&piece.chains) {
                    for (k, slope) in chain.iter().filter(|_| n_free > 0) {
                        dh[*k] += h * g * (d / factor) * sign * *slope;
                    }
                }
                h *= g;
            }
            let y = h * to_quantity;
            out.values.extend([y.re, y.im]);
            out.slopes.extend(dh.iter().map(|d| (d * to_quantity).re));
            out.slopes.extend(dh.iter().map(|d| (d * to_quantity).im));
        }
        Ok(out)
    }
}

impl Plan {
    /// What an FRF was measured as; none of other tests.
    pub fn frf_quantity(&self) -> Option<FrfQuantity> {
        if let Work::Frf(f) = &self.work { Some(f.quantity) } else { None }
    }
}
