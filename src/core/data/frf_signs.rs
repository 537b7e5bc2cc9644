//! What frequency responses say of each other and of themselves: the sign of a driving point, reciprocity.
//!
//! A structure that gives no energy back has Im H <= 0 at a driving point, H the receptance under e^{+i w t}: its force does work on it in
//! every cycle. Where most of Im H lies above zero, the sign of the force or of the response is turned, or the phase has the other
//! convention. A linear structure answers at b to a force at a as it answers at a to a force at b.

use super::{Conditions, Frf, Record, Test};
use num_complex::Complex64;

/// A frequency response that cannot be what it is said to be, or does not go with another.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfDoubt {
    /// Test.
    pub test: String,
    /// What is wrong, with its numbers.
    pub claim: String,
    /// What would be accepted.
    pub accepted: String,
    /// Share of the squares of Im H above zero, or deviation of the two over their size.
    pub number: f64,
    /// What it may be.
    pub threshold: f64,
    /// No fit can make sense of it.
    pub refused: bool,
}

/// Lines with Im H above zero by this many standard deviations are counted.
const BEYOND: f64 = 3.0;
/// Share of the sum of Im H squared that may lie above zero before the sign is taken to be turned.
const TURNED: f64 = 0.5;
/// The same before it is told: a delay between the sensors turns the phase of the upper lines.
const ODD: f64 = 0.1;
/// Deviation of two reciprocal FRFs over their size that is told, where it is beyond their noise.
const UNEQUAL: f64 = 0.1;
/// Lines two FRFs must have in common to be compared.
const COMMON: usize = 8;

/// Every doubt about the frequency responses of a dataset.
pub fn frf_doubts(tests: &[Test]) -> Vec<FrfDoubt> {
    let frfs: Vec<(&Test, &Frf)> =
        tests.iter().filter_map(|t| if let Record::Frf(f) = &t.record { Some((t, f.as_ref())) } else { None }).collect();
    let mut doubts: Vec<FrfDoubt> = frfs.iter().filter_map(|(_, f)| driving_point(f)).collect();
    for (k, (a, f)) in frfs.iter().enumerate() {
        for (b, g) in frfs.iter().skip(k + 1) {
            if f.excite == g.respond && f.respond == g.excite && f.excite != f.respond && same(&a.conditions, &b.conditions) {
                doubts.extend(reciprocity(f, g));
            }
        }
    }
    doubts
}

fn same(a: &Conditions, b: &Conditions) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|((x, p), (y, q))| x == y && p.value == q.value)
}

fn driving_point(f: &Frf) -> Option<FrfDoubt> {
    if f.excite != f.respond {
        return None;
    }
    let squares = |above: bool| {
        let lines = f.receptance.iter().zip(&f.receptance_sigma).filter(|(h, s)| h.im.abs() > BEYOND * **s && (h.im > 0.0) == above);
        lines.fold((0.0, 0), |(sum, n), (h, _)| (sum + h.im * h.im, n + 1))
    };
    let ((above, n), (below, rest)) = (squares(true), squares(false));
    let share = above / (above + below);
    // No line at all has a share that is no number, and few lines are no doubt.
    if n < COMMON || share <= ODD {
        return None;
    }
    let refused = share > TURNED;
    let claim = format!(
        "the imaginary part of the driving-point receptance lies above zero on {n} of {} lines beyond the noise, {:.0} % of its square sum: \
         a structure that takes energy from its force has none there{}",
        n + rest,
        100.0 * share,
        if refused { "; the sign of the force or of the response is turned, or the phase is that of e^{-i w t}" } else { "" }
    );
    let accepted = "force and response positive along the same direction, phase between -180 and 0 degrees (e^{+i w t})".into();
    Some(FrfDoubt { test: f.test.clone(), claim, accepted, number: share, threshold: TURNED, refused })
}

fn reciprocity(f: &Frf, g: &Frf) -> Option<FrfDoubt> {
    let (mut pairs, mut k): (Vec<(Complex64, Complex64, f64)>, usize) = (vec![], 0);
    for (i, w) in f.frequency.iter().enumerate() {
        while g.frequency.get(k).is_some_and(|v| *v < w * (1.0 - 1e-9)) {
            k += 1;
        }
        if g.frequency.get(k).is_some_and(|v| (v - w).abs() <= 1e-9 * w) {
            let noise = f.receptance_sigma[i].powi(2) + g.receptance_sigma[k].powi(2);
            pairs.push((f.receptance[i], g.receptance[k], 2.0 * noise));
        }
    }
    if pairs.len() < COMMON {
        return None;
    }
    let size: f64 = pairs.iter().map(|(a, b, _)| 0.5 * (a.norm_sqr() + b.norm_sqr())).sum();
    let noise: f64 = pairs.iter().map(|p| p.2).sum();
    let apart = |sign: f64| (pairs.iter().map(|(a, b, _)| (a - b * sign).norm_sqr()).sum::<f64>() / size).sqrt();
    let (equal, turned) = (apart(1.0), apart(-1.0));
    if equal.is_nan() || equal <= UNEQUAL.max(BEYOND * (noise / size).sqrt()) {
        return None;
    }
    let (claim, accepted) = if turned < 0.5 * equal {
        let claim = format!(
            "it is the negative of its reciprocal `{}` within {:.0} %: the sign of one of the two is turned",
            g.test,
            100.0 * turned
        );
        (claim, "one sign convention for both".to_string())
    } else {
        let scale = (pairs.iter().map(|p| p.0.norm_sqr()).sum::<f64>() / pairs.iter().map(|p| p.1.norm_sqr()).sum::<f64>()).sqrt();
        let claim = format!(
            "it differs from its reciprocal `{}` by {:.0} %; its size is {scale:.3} times that of the other",
            g.test,
            100.0 * equal
        );
        (claim, "the units of both, places that were not mistaken, or a structure that is not linear at this excitation".to_string())
    };
    Some(FrfDoubt { test: f.test.clone(), claim, accepted, number: equal, threshold: UNEQUAL, refused: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::FrfQuantity;
    use crate::units::{Dimension, Unit};

    fn test(id: &str, excite: &str, respond: &str, sign: f64) -> Test {
        let frequency: Vec<f64> = (1..60).map(f64::from).collect();
        let h = |f: &f64| sign / Complex64::new(900.0 - f * f, 3.0 * f);
        let receptance: Vec<Complex64> = frequency.iter().map(h).collect();
        let sigma = vec![1e-6; frequency.len()];
        let frf = Frf {
            test: id.into(),
            file: "a.csv".into(),
            excite: excite.into(),
            respond: respond.into(),
            quantity: FrfQuantity::Receptance,
            unit: Unit::si(Dimension::DIMENSIONLESS),
            excitation: None,
            measured: receptance.clone(),
            sigma: sigma.clone(),
            receptance,
            receptance_sigma: sigma,
            coherence: None,
            notes: vec![],
            frequency,
        };
        Test {
            id: id.into(),
            description: None,
            conditions: Conditions::new(),
            supports: None,
            record: Record::Frf(Box::new(frf)),
            line: 1,
        }
    }

    #[test]
    fn a_driving_point_gives_no_energy_back() {
        assert!(frf_doubts(&[test("a", "m.x", "m.x", 1.0), test("b", "m.x", "n.x", -1.0)]).is_empty());
        let found = frf_doubts(&[test("a", "m.x", "m.x", -1.0)]);
        assert!(found.len() == 1 && found[0].refused && found[0].claim.contains("59 of 59 lines"), "{found:?}");
    }

    #[test]
    fn reciprocal_responses_are_equal() {
        assert!(frf_doubts(&[test("a", "m.x", "n.x", 1.0), test("b", "n.x", "m.x", 1.0)]).is_empty());
        let found = frf_doubts(&[test("a", "m.x", "n.x", 1.0), test("b", "n.x", "m.x", -1.0)]);
        assert!(found[0].claim.contains("negative of its reciprocal `b`") && !found[0].refused, "{found:?}");
        let found = frf_doubts(&[test("a", "m.x", "n.x", 1.0), test("b", "n.x", "m.x", 1000.0)]);
        assert!(found[0].claim.contains("0.001 times"), "{found:?}");
    }
}
