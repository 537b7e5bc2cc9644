//! What frequency responses say of each other and of themselves: sign and quantity of a driving point, reciprocity.
//!
//! The power that a force gives to a structure is half of its square times the real part of the mobility there, so that Re(i w H) >= 0 at
//! every driving point, H the receptance under e^{+i w t}: the phase of a receptance lies in the lower half plane, that of a mobility in the
//! right one, that of an accelerance in the upper one. A response that keeps to another of the four half planes is turned, or another of the
//! three quantities. A linear structure answers at b to a force at a as it answers at a to a force at b.

use super::{Conditions, Content, DataError, Frf, FrfQuantity, Record, Test};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// A frequency response that cannot be what it is said to be, or does not go with another.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfDoubt {
    /// Test.
    pub test: String,
    /// File that it was read from.
    pub file: PathBuf,
    /// What is wrong, with its numbers.
    pub claim: String,
    /// What would be accepted.
    pub accepted: String,
    /// Share of the squares of the power that is given back, or deviation of the two over their size.
    pub number: f64,
    /// What it may be.
    pub threshold: f64,
    /// No fit can make sense of it.
    pub refused: bool,
}

impl FrfDoubt {
    /// The error that a doubt which is refused ends a fit with, and that `check` tells.
    pub fn error(&self) -> DataError {
        let (message, accepted) = (self.claim.clone(), self.accepted.clone());
        Content { file: self.file.clone(), row: None, test: self.test.clone(), channel: None, message, accepted }.into()
    }
}

/// Lines whose power lies this many standard deviations from zero are counted.
const BEYOND: f64 = 3.0;
/// Share of the squares of the power that may be given back before the sign is taken to be turned.
const TURNED: f64 = 0.5;
/// The same before it is told: a delay between the sensors turns the phase of the upper lines.
const ODD: f64 = 0.1;
/// The same that a response may have in the half plane of another quantity to be taken for that: a resonance leads the phase through the whole of its half
/// plane, and through half of each of the two beside it.
const KEPT: f64 = 0.02;
/// Part of |H| (root mean square over the lines) that gives power back, below which nothing is refused: the sine of six degrees, which a delay between two
/// sensors makes along a line of stiffness or mass.
const LEAD: f64 = 0.1;
/// Deviation of two reciprocal FRFs over their size that is told, where it is beyond their noise.
const UNEQUAL: f64 = 0.1;
/// Lines two FRFs must have in common to be compared.
const COMMON: usize = 8;

/// Every doubt about the frequency responses of a dataset.
pub fn frf_doubts<'a>(tests: impl IntoIterator<Item = &'a Test>) -> Vec<FrfDoubt> {
    let frfs: Vec<(&Test, &Frf)> =
        tests.into_iter().filter_map(|t| if let Record::Frf(f) = &t.record { Some((t, f.as_ref())) } else { None }).collect();
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

/// What the lines of a driving point give back where their phase is turned by a factor of size 1.
struct GivenBack {
    /// Lines that give power back...
    lines: usize,
    /// ...of those whose power is beyond the noise.
    seen: usize,
    /// Share of the squares of the power.
    share: f64,
    /// Root mean square of what is given back over that of |H|.
    size: f64,
}

impl GivenBack {
    fn of(f: &Frf, turn: Complex64) -> GivenBack {
        let (mut back, mut taken, mut all) = ((0.0, 0), (0.0, 0), 0.0);
        for ((h, s), w) in f.receptance.iter().zip(&f.receptance_sigma).zip(f.frequency.iter().map(|f| TAU * f)) {
            let (y, s) = (h * Complex64::new(0.0, w) * turn, s * w);
            all += y.norm_sqr();
            if y.re.abs() > BEYOND * s {
                let (sum, n) = if y.re < 0.0 { &mut back } else { &mut taken };
                *sum += y.re * y.re;
                *n += 1;
            }
        }
        // Where no line is beyond the noise, the share is no number, which is beyond no threshold.
        GivenBack { lines: back.1, seen: back.1 + taken.1, share: back.0 / (back.0 + taken.0), size: (back.0 / all).sqrt() }
    }
}

/// What a response is whose phase keeps to the half plane that is turned by so many right angles from that of its quantity.
fn meaning(declared: FrfQuantity, right_angles: i32) -> String {
    let shifted = |by: i32| FrfQuantity::WORDS.iter().find(|(_, q)| q.derivatives() == declared.derivatives() + by).map(|w| w.0);
    if right_angles.rem_euclid(4) == 2 {
        let other = shifted(2).or(shifted(-2)).map_or(String::new(), |q| format!(", or it is the {q}"));
        return format!("; the sign of the force or of the response is turned, or the phase is that of e^{{-i w t}}{other}");
    }
    // A derivative turns by a right angle ahead; one less and the sign turned do too.
    let plain = shifted(right_angles).map(|q| format!("the {q}"));
    let turned = shifted(-right_angles).map(|q| format!("the {q} with its sign turned"));
    let either: Vec<String> = plain.into_iter().chain(turned).collect();
    format!("; its phase is that of {}", either.join(", or of "))
}

fn driving_point(f: &Frf) -> Option<FrfDoubt> {
    if f.excite != f.respond {
        return None;
    }
    // A measured quantity that is n derivatives more than declared is ahead by n right angles: turned back, it takes power.
    let turned_back = |n: i32| GivenBack::of(f, Complex64::I.powi(-n));
    let declared = turned_back(0);
    if declared.lines < COMMON || declared.share.is_nan() || declared.share <= ODD {
        return None;
    }
    let others = [2, 1, -1].map(|n| (n, turned_back(n).share)).into_iter().filter(|o| o.1 <= KEPT);
    let kept = others.min_by(|a, b| a.1.total_cmp(&b.1)).map(|o| o.0);
    let means = kept.or((declared.share > TURNED).then_some(2));
    let refused = declared.size > LEAD && means.is_some();
    let claim = format!(
        "the {} of a driving point gives power back to its force (the imaginary part of its receptance lies above zero) on {} of {} lines \
         beyond the noise, {:.0} % of its square sum: a structure that takes energy from its force does so nowhere{}",
        f.quantity.word(),
        declared.lines,
        declared.seen,
        100.0 * declared.share,
        means.filter(|_| refused).map_or(String::new(), |n| meaning(f.quantity, n))
    );
    let accepted = "force and response positive along the same direction, and the phase (e^{+i w t}) of a receptance between -180 and 0 degrees, of a \
                    mobility between -90 and 90, of an accelerance between 0 and 180"
        .into();
    let (test, file) = (f.test.clone(), f.file.clone());
    Some(FrfDoubt { test, file, claim, accepted, number: declared.share, threshold: if refused { ODD } else { TURNED }, refused })
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
    let (test, file) = (f.test.clone(), f.file.clone());
    Some(FrfDoubt { test, file, claim, accepted, number: equal, threshold: UNEQUAL, refused: false })
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
            parts: vec![],
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

    /// The accelerance, the mobility and the receptance of one place, each declared as each: the phase says which is wrong.
    #[test]
    fn a_driving_point_says_which_of_the_three_it_is() {
        for (declared, measured) in FrfQuantity::WORDS.iter().flat_map(|d| FrfQuantity::WORDS.map(|m| (d.1, m.1))) {
            let mut one = test("a", "m.x", "m.x", 1.0);
            let Record::Frf(f) = &mut one.record else { unreachable!() };
            f.quantity = declared;
            for ((h, s), f) in f.receptance.iter_mut().zip(&mut f.receptance_sigma).zip(&f.frequency) {
                let taken_for = measured.from_receptance(TAU * f) / declared.from_receptance(TAU * f);
                *h *= taken_for;
                *s = 1e-3 * h.norm();
            }
            let found = frf_doubts(&[one]);
            if declared == measured {
                assert!(found.is_empty(), "{found:?}");
                continue;
            }
            assert!(found.len() == 1 && found[0].refused, "{declared:?} for {measured:?}: {found:?}");
            assert!(found[0].claim.contains(&format!("the {}", measured.word())), "{declared:?} for {measured:?}: {found:?}");
        }
    }

    /// Along a line of stiffness, a force that is read late by a few degrees gives power back, and nothing is turned.
    #[test]
    fn a_late_sensor_is_told_and_refuses_nothing() {
        let mut one = test("a", "m.x", "m.x", 1.0);
        let Record::Frf(f) = &mut one.record else { unreachable!() };
        f.receptance = f.frequency.iter().map(|f| Complex64::from_polar(1e-3, 1e-3 * f)).collect();
        let found = frf_doubts(&[one]);
        assert!(found.len() == 1 && !found[0].refused, "{found:?}");
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
