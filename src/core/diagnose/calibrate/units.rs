//! Frequency responses that are the model's but for a factor between units, or for a derivative: an accelerance in mm/s2/N that is said to be in m/s2/N, a
//! mobility that is said to be a receptance. The model says so alone: of a driving point the data tell their quantity by the phase (`data::frf_signs`).

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::data::{FrfQuantity, TestKind};
use crate::model::System;
use crate::parallel;
use crate::response::{BlockKind, Plan};

use super::case::Case;
use super::fit::digits;
use crate::diagnose::settings::Telling;

/// Factors between units that are taken for one another, each with what it stands between.
const FACTORS: [(f64, &str); 8] = [
    (1e3, "a prefix: mm for m, or kN for N"),
    (1e6, "a prefix twice, or micrometres for m"),
    (9.80665, "g for m/s2, or kgf for N"),
    (9806.65, "g for mm/s2"),
    (25.4, "inches for mm"),
    (39.370_078_74, "inches for m"),
    (4.448_221_615, "lbf for N"),
    (TAU, "Hz for rad/s"),
];

/// What a measured FRF is of the computed one: a factor times a power of `i w`.
#[derive(Debug, Clone, PartialEq)]
struct Ratio {
    /// Logarithm of the factor.
    log: f64,
    /// Power of `i w`.
    power: i32,
    /// Median deviation of the logarithms of the lines from it.
    scatter: f64,
    /// Mean cosine of the phase between the lines and the computed ones, times `(i w)^power`.
    phase: f64,
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The factor and the power that leave the least scatter over lines of `(frequency [rad/s], measured, computed)`; none of fewer than eight.
fn ratio(lines: &[(f64, Complex64, Complex64)], shaped: f64) -> Option<Ratio> {
    let of = |(w, m, h): &(f64, Complex64, Complex64)| {
        let y = (m / h).norm().ln();
        (*w > 0.0 && y.is_finite()).then(|| (w.ln(), y, (m / h).arg(), (h * w * w).norm().ln()))
    };
    let seen: Vec<(f64, f64, f64, f64)> = lines.iter().filter_map(of).collect();
    let (low, high) = seen.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s.3), h.max(s.3)));
    if seen.len() < 8 || high - low < shaped {
        return None;
    }
    let with = |power: i32| {
        let left: Vec<f64> = seen.iter().map(|(w, y, ..)| y - f64::from(power) * w).collect();
        let log = median(left.clone());
        let scatter = median(left.iter().map(|l| (l - log).abs()).collect());
        let turn = f64::from(power) * std::f64::consts::FRAC_PI_2;
        let phase = seen.iter().map(|s| (s.2 - turn).cos()).sum::<f64>() / seen.len() as f64;
        Ratio { log, power, scatter, phase }
    };
    [0, 1, -1, 2, -2].map(with).into_iter().min_by(|a, b| a.scatter.total_cmp(&b.scatter))
}

/// What a ratio says of the units or the quantity, where it says anything.
fn told(r: &Ratio, quantity: FrfQuantity, s: &Telling) -> Option<String> {
    if r.scatter > s.same_factor || r.phase.abs() < s.same_phase {
        return None;
    }
    let near = (s.same_unit * r.log.abs()).max(r.scatter).max(s.same_unit);
    let unit =
        FACTORS.iter().map(|(f, what)| ((r.log.abs() - f.ln()).abs(), what)).filter(|u| u.0 <= near).min_by(|a, b| a.0.total_cmp(&b.0));
    let other = FrfQuantity::WORDS.iter().find(|(_, q)| r.power != 0 && q.derivatives() == quantity.derivatives() + r.power);
    let turned = if r.phase < 0.0 { ", with its sign turned" } else { "" };
    let factor = || digits(r.log.exp(), 3);
    match (other, unit) {
        // A derivative that leaves no factor of its own, or one of a unit as well.
        (Some((word, _)), unit) if r.log.abs() <= near || unit.is_some() => {
            let also = unit.map_or(String::new(), |u| format!(", {} times what it would be ({}?)", factor(), u.1));
            Some(format!("over the whole band it is the {word} of the model{also}{turned}, and is declared as {}", quantity.word()))
        }
        (None, Some((_, what))) if r.power == 0 => {
            Some(format!("over the whole band it is {} times what the model computes{turned}: {what}?", factor()))
        }
        _ => None,
    }
}

/// The FRFs that a system computes but for a factor between units or a derivative, `test: what`.
pub fn odd_units(case: &Case, system: &System) -> Vec<String> {
    let s = &case.search.settings.telling;
    let of = |plan: &Plan| -> Option<String> {
        let block = plan.blocks.iter().find(|b| b.kind == BlockKind::Frf)?;
        let quantity = plan.frf_quantity()?;
        let computed = plan.evaluate(system, &[], false).ok()?.values;
        let pair = |v: &[f64]| Complex64::new(v[0], v[1]);
        let values = plan.measured[block.range.clone()].chunks_exact(2).zip(computed[block.range.clone()].chunks_exact(2));
        // The shape is that of the accelerance, whatever was measured.
        let to_receptance = |w: f64, h: Complex64| h / quantity.from_receptance(w);
        let lines: Vec<_> = block
            .abscissa
            .iter()
            .zip(values)
            .map(|(f, (m, h))| (TAU * f, to_receptance(TAU * f, pair(m)), to_receptance(TAU * f, pair(h))))
            .collect();
        Some(format!("{}: {}", plan.id, told(&ratio(&lines, s.shaped)?, quantity, s)?))
    };
    let frfs: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).filter(|p| p.kind == TestKind::Frf).collect();
    parallel::map(&frfs, |p| of(p)).into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(factor: impl Fn(f64) -> Complex64, off: f64) -> Vec<(f64, Complex64, Complex64)> {
        let h = |w: f64, k: f64| Complex64::new(k - w * w, 0.04 * k.sqrt() * w).inv();
        (1..200).map(|n| 2.0 * f64::from(n)).map(|w| (w, h(w, 1e4 * off) * factor(w), h(w, 1e4))).collect()
    }

    #[test]
    fn a_prefix_and_a_derivative_are_told_and_a_model_that_is_off_is_not() {
        let s = Telling::default();
        let say = |lines: &[_]| ratio(lines, s.shaped).and_then(|r| told(&r, FrfQuantity::Mobility, &s));
        let plain = |f: f64| move |_: f64| Complex64::from(f);
        assert!(say(&lines(plain(1e3), 1.0)).unwrap().contains("1000 times"));
        // The model at its start is off by a fifth in its mass.
        assert!(say(&lines(plain(1.2e3), 1.0)).unwrap().contains("mm for m"));
        assert_eq!(say(&lines(plain(8.0), 1.0)), None);
        // And by a tenth in stiffness.
        assert!(say(&lines(plain(1e-3), 1.1)).unwrap().contains("mm for m"), "{:?}", ratio(&lines(plain(1e-3), 1.1), 2.0));
        assert!(say(&lines(plain(-9.80665), 1.0)).unwrap().contains("sign turned: g for m/s2"));
        assert!(
            say(&lines(|w| Complex64::new(0.0, w), 1.0)).unwrap().contains("is the accelerance of the model, and is declared as mobility")
        );
        assert!(
            say(&lines(|w| Complex64::new(0.0, 1e3 * w).inv(), 1.0)).unwrap().contains("is the receptance of the model, 0.00100 times")
        );
        for (factor, off) in [(1.0, 1.0), (2.0, 1.0), (1.0, 3.0), (1.0, 0.3)] {
            assert_eq!(say(&lines(plain(factor), off)), None, "{factor} {off}");
        }
    }
}
