//! Where the model fails: statistics of the whitened residuals with their thresholds and power.

use std::f64::consts::TAU;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::model::System;
use crate::response::{Block, BlockKind, Plan};

use crate::diagnose::results::Finding;
use crate::diagnose::settings::Telling;

/// A cycle test that has not settled, with more than `most` sigma of its transient left: what its kept cycles say, and what the model says of the cycles discarded.
pub fn unsettled(plan: &Plan, system: &System, most: f64) -> Vec<Finding> {
    let measured = plan.unsettled.iter().map(|u| Finding {
        test: plan.id.clone(),
        claim: format!("{}: {}", u.channel, u.claim),
        number: u.t,
        threshold: u.threshold,
        power: 1.0,
    });
    // A model that cannot be marched from rest has other troubles, which the fit has told.
    let computed = plan.transient(system, most).ok().flatten().filter(|t| t.left > most).map(|t| {
        let enough = t.needed.map_or("more than twice as many are needed".into(), |n| format!("{n} would do"));
        Finding {
            test: plan.id.clone(),
            claim: format!(
                "not settled: by the model, {:.2} sigma of its transient are left in the kept cycles after {} discarded; {enough}",
                t.left, t.discarded
            ),
            number: t.left,
            threshold: most,
            power: 1.0,
        }
    });
    measured.chain(computed).collect()
}

/// Findings of one test, given its computed values: statistics beyond [`Telling::finding`] standard deviations.
pub fn findings(plan: &Plan, computed: &[f64], told: &Telling) -> Vec<Finding> {
    let (normal, threshold) = (Normal::standard(), told.finding);
    let seen = plan.blocks.iter().flat_map(|block| {
        let residual = Residual::of(plan, block, computed);
        let of_kind = match block.kind {
            BlockKind::Loop => residual.of_loop(&normal),
            BlockKind::Frf => residual.of_lines(told.bands).into_iter().collect(),
            BlockKind::Record | BlockKind::Table => vec![],
        };
        std::iter::once(residual.overall()).chain(of_kind)
    });
    let found = seen.filter(|s| s.statistic.abs() > threshold).map(|s| {
        let power = if s.signal.is_finite() { 1.0 - normal.cdf(threshold - told.finding_power * s.signal.abs()) } else { 0.0 };
        Finding { test: plan.id.clone(), claim: s.claim, number: s.statistic, threshold, power }
    });
    found.collect()
}

/// The normal deviate that is exceeded as rarely as a chi-square of two degrees of freedom is `square`: `Q(z) = exp(-square / 2)`. Where that is no
/// number any more, by Mills' ratio: `z^2 + ln(2 pi z^2) = square`.
fn as_rare_as(square: f64, normal: &Normal) -> f64 {
    let rare = (-0.5 * square).exp();
    if rare > 1e-280 { -normal.inverse_cdf(rare.min(1.0 - 1e-16)) } else { (square - (TAU * square).ln()).sqrt() }
}

/// A statistic of a residual that is a standard normal deviate where the model is right.
struct Statistic {
    claim: String,
    statistic: f64,
    /// The same of the measured signal itself.
    signal: f64,
}

/// Measured less computed in one channel of a test.
struct Residual<'a> {
    block: &'a Block,
    measured: &'a [f64],
    computed: &'a [f64],
    sigma: &'a [f64],
}

impl<'a> Residual<'a> {
    fn of(plan: &'a Plan, block: &'a Block, computed: &'a [f64]) -> Self {
        let range = || block.range.clone();
        Residual { block, measured: &plan.measured[range()], computed: &computed[range()], sigma: &plan.sigma[range()] }
    }

    /// In units of the noise.
    fn whitened(&self) -> impl Iterator<Item = f64> {
        self.measured.iter().zip(self.computed).zip(self.sigma).map(|((m, c), s)| (m - c) / s)
    }

    /// Measured signal over noise.
    fn level(&self) -> f64 {
        self.measured.iter().zip(self.sigma).map(|(m, s)| (m / s).powi(2)).sum::<f64>().sqrt()
    }

    fn statistic(&self, words: &str, statistic: f64, signal: f64) -> Statistic {
        Statistic { claim: format!("{}: {words}", self.block.label), statistic, signal }
    }

    /// Size of the residual. Wilson and Hilferty: the cube root of chi2/n is nearly normal.
    fn overall(&self) -> Statistic {
        let (n, level) = (self.measured.len() as f64, self.level());
        let chi2: f64 = self.whitened().map(|w| w * w).sum();
        let z = ((chi2 / n).cbrt() - (1.0 - 2.0 / (9.0 * n))) / (2.0 / (9.0 * n)).sqrt();
        self.statistic(&format!("the residual is {:.2} times the noise", (chi2 / n).sqrt()), z, level * level / n.sqrt())
    }

    /// Part of values along a weight over what noise has there.
    fn along(&self, weight: impl Fn(usize) -> f64, values: impl Fn(usize) -> f64) -> f64 {
        let all = 0..self.measured.len();
        let (top, bottom) =
            all.map(|k| (weight(k) * values(k), (weight(k) * self.sigma[k]).powi(2))).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        if bottom > 0.0 { top / bottom.sqrt() } else { 0.0 }
    }

    /// The residual along a weight, told by its sign.
    fn told(&self, weight: impl Fn(usize) -> f64, more: &str, less: &str) -> Statistic {
        let z = self.along(&weight, |k| self.measured[k] - self.computed[k]);
        self.statistic(if z > 0.0 { more } else { less }, z, self.along(&weight, |k| self.measured[k]))
    }

    /// Mean, loss, stiffness, jumps and harmonics of a loop.
    fn of_loop(&self, normal: &Normal) -> Vec<Statistic> {
        let (n, block) = (self.measured.len(), self.block);
        let mut all = vec![self.told(|_| 1.0, "the measured mean lies higher", "the measured mean lies lower")];
        if !block.v.is_empty() && block.v.len() == n {
            let loss = ("the measured loop dissipates more than the model", "the measured loop dissipates less than the model");
            all.push(self.told(|k| block.v[k], loss.0, loss.1));
            all.push(self.told(|k| block.x[k], "the measured loop is stiffer", "the measured loop is softer"));
            // After a reversal: the first tenth of a half cycle, force against the new direction of travel.
            let late = |k: usize| {
                let ahead = block.v[(k + n / 20) % n];
                if block.v[k] * ahead < 0.0 { block.v[k].signum() } else { 0.0 }
            };
            all.push(self.told(late, "excess force just before the reversals: a jump there", "force missing just before the reversals"));
        }
        let harmonics = [
            (2.0, "the residual has a second harmonic: an asymmetric law"),
            (3.0, "the residual has a third harmonic: a symmetric nonlinearity"),
        ];
        all.extend(harmonics.map(|(h, words)| {
            let wave = |shift: f64| move |k: usize| (TAU * (h * k as f64 / n as f64 + shift)).cos();
            let part = |shift: f64| self.along(wave(shift), |k| self.measured[k] - self.computed[k]).powi(2);
            self.statistic(words, as_rare_as(part(0.0) + part(0.25), normal), self.level() / (n as f64).sqrt())
        }));
        all
    }

    /// Where along frequency the residual of an FRF sits.
    fn of_lines(&self, bands: usize) -> Option<Statistic> {
        let w: Vec<f64> = self.whitened().collect();
        let lines = w.len() / 2;
        let band = lines.div_ceil(bands).max(1);
        let of = |k: usize| {
            let part = &w[2 * k..(2 * (k + band)).min(2 * lines)];
            (part.iter().map(|w| w * w).sum::<f64>() / part.len() as f64, k, part.len() as f64)
        };
        let (mean, k, count) = (0..lines).step_by(band).map(of).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (from, to) = (self.block.abscissa[k], self.block.abscissa[(k + band - 1).min(lines - 1)]);
        let words = format!("the misfit is largest between {from:.4} and {to:.4} Hz");
        Some(self.statistic(&words, (mean - 1.0) / (2.0 / count).sqrt(), self.level() / count.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_harmonic_is_told_by_its_size_however_large() {
        let normal = Normal::standard();
        // Q(1.96) = 0.025.
        assert!((as_rare_as(-2.0 * 0.025f64.ln(), &normal) - 1.959964).abs() < 1e-5);
        let (near, far) = (as_rare_as(1289.0, &normal), as_rare_as(1290.0, &normal));
        assert!(near < far && far - near < 0.03, "{near} {far}");
        assert!((as_rare_as(1e6, &normal) - 1e3).abs() < 0.01);
        assert!(as_rare_as(0.0, &normal).is_finite());
    }
}
