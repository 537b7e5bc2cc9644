//! Where the model fails: statistics of the whitened residuals with their thresholds and power.

use std::f64::consts::TAU;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::model::System;
use crate::response::{BlockKind, Plan};

use super::results::Finding;

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

/// Findings of one test, given its computed values: statistics beyond so many standard deviations.
pub fn findings(plan: &Plan, computed: &[f64], threshold: f64) -> Vec<Finding> {
    let mut list = Vec::new();
    let Ok(normal) = Normal::new(0.0, 1.0) else { return list };
    let mut add = |claim: String, statistic: f64, signal: f64| {
        let power = if signal.is_finite() { 1.0 - normal.cdf(threshold - 0.1 * signal.abs()) } else { 0.0 };
        if statistic.abs() > threshold {
            list.push(Finding { test: plan.id.clone(), claim, number: statistic, threshold, power });
        }
    };
    for block in &plan.blocks {
        let range = block.range.clone();
        let (m, c, s) = (&plan.measured[range.clone()], &computed[range.clone()], &plan.sigma[range]);
        let n = m.len() as f64;
        let w: Vec<f64> = m.iter().zip(c).zip(s).map(|((m, c), s)| (m - c) / s).collect();
        let chi2: f64 = w.iter().map(|w| w * w).sum();
        let level: f64 = m.iter().zip(s).map(|(m, s)| (m / s).powi(2)).sum::<f64>().sqrt();
        // Wilson and Hilferty: the cube root of chi2/n is nearly normal.
        let overall = ((chi2 / n).cbrt() - (1.0 - 2.0 / (9.0 * n))) / (2.0 / (9.0 * n)).sqrt();
        add(format!("{}: the residual is {:.2} times the noise", block.label, (chi2 / n).sqrt()), overall, level * level / n.sqrt());
        match block.kind {
            BlockKind::Loop => {
                let project = |weight: &dyn Fn(usize) -> f64, values: &dyn Fn(usize) -> f64| {
                    let (mut top, mut bottom) = (0.0, 0.0);
                    for k in 0..m.len() {
                        top += weight(k) * values(k);
                        bottom += (weight(k) * s[k]).powi(2);
                    }
                    if bottom > 0.0 { top / bottom.sqrt() } else { 0.0 }
                };
                let residual = |k: usize| m[k] - c[k];
                let measured = |k: usize| m[k];
                let one = |_: usize| 1.0;
                let words = |z: f64, more: &str, less: &str| format!("{}: {}", block.label, if z > 0.0 { more } else { less });
                let z = project(&one, &residual);
                add(words(z, "the measured mean lies higher", "the measured mean lies lower"), z, project(&one, &measured));
                if !block.v.is_empty() && block.v.len() == m.len() {
                    let v = |k: usize| block.v[k];
                    let z = project(&v, &residual);
                    add(
                        words(z, "the measured loop dissipates more than the model", "the measured loop dissipates less than the model"),
                        z,
                        project(&v, &measured),
                    );
                    let x = |k: usize| block.x[k];
                    let z = project(&x, &residual);
                    add(words(z, "the measured loop is stiffer", "the measured loop is softer"), z, project(&x, &measured));
                    // After a reversal: the first tenth of a half cycle, force against the new direction of travel.
                    let late = |k: usize| {
                        let ahead = block.v[(k + m.len() / 20) % m.len()];
                        if block.v[k] * ahead < 0.0 { block.v[k].signum() } else { 0.0 }
                    };
                    let z = project(&late, &residual);
                    add(
                        words(z, "excess force just before the reversals: a jump there", "force missing just before the reversals"),
                        z,
                        project(&late, &measured),
                    );
                }
                for h in [2usize, 3] {
                    let amplitude: f64 = [0.0, 0.25]
                        .iter()
                        .map(|shift| {
                            let wave = |k: usize| (TAU * (h as f64 * k as f64 / n + shift)).cos();
                            project(&wave, &residual).powi(2)
                        })
                        .sum();
                    let claim = if h == 2 {
                        "the residual has a second harmonic: an asymmetric law"
                    } else {
                        "the residual has a third harmonic: a symmetric nonlinearity"
                    };
                    // chi2 with two degrees of freedom as a normal deviate of equal tail probability.
                    let z = normal.inverse_cdf((1.0 - (-0.5 * amplitude).exp()).clamp(1e-300, 1.0 - 1e-16));
                    add(format!("{}: {claim}", block.label), z, level / n.sqrt());
                }
            }
            BlockKind::Frf => {
                // Where along frequency the residual sits.
                let lines = m.len() / 2;
                let band = lines.div_ceil(12).max(1);
                let worst = (0..lines)
                    .step_by(band)
                    .map(|k| {
                        let part = &w[2 * k..(2 * (k + band)).min(2 * lines)];
                        (part.iter().map(|w| w * w).sum::<f64>() / part.len() as f64, k, part.len() as f64)
                    })
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((mean, k, count)) = worst {
                    let z = (mean - 1.0) / (2.0 / count).sqrt();
                    let to = block.abscissa[(k + band - 1).min(lines - 1)];
                    add(
                        format!("{}: the misfit is largest between {:.4} and {to:.4} Hz", block.label, block.abscissa[k]),
                        z,
                        level / count.sqrt(),
                    );
                }
            }
            BlockKind::Record | BlockKind::Table => {}
        }
    }
    list
}
