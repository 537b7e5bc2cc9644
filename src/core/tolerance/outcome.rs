//! What the tolerance cases come to: the constant of eq. 6, the energies by every rung of the model, the search for a law of its strengths, the surface,
//! and what they say in words.

use super::{Cases, Constant, LawOutcome, Prediction, Quantity, Surface, energies};

/// Something the cases say of each other or of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// In words.
    pub claim: String,
    /// The number it rests on.
    pub number: f64,
    /// The value beyond which it is claimed.
    pub threshold: f64,
}

/// The cases of one cycle by one model.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Id of the test that holds the cases.
    pub test: String,
    /// Limits and frequency, in words.
    pub words: String,
    /// Case by case: W_D, W_s where the table has it, ratio of W_D to the reference case.
    pub predictions: Vec<Prediction>,
}

/// The relative error of the model's energies in tests that are like the cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelError {
    /// Root mean square of (W_D computed - W_D measured) / W_s measured.
    pub loss_ratio: f64,
    /// Root mean square of W_s computed / W_s measured - 1.
    pub stored: f64,
    /// Tests that it comes from.
    pub tests: usize,
}

/// One model of the way: as it stands, with what the ladder added, or what was calibrated by hand.
#[derive(Clone, Debug)]
pub struct Rung {
    /// In words.
    pub title: String,
    /// Effects that the rung before did not have, as `effect at place`.
    pub added: Vec<String>,
    /// Its energies.
    pub cycles: Vec<Cycle>,
    /// Error of its energies in the tests; none where no test is a loop at the place that is driven.
    pub model_error: Option<ModelError>,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The cases of the first cycle, with units.
    pub cases: Cases,
    /// Index of the case that ratios refer to.
    pub reference: usize,
    /// The constant `i A`, with the moment of area of the leaf that eq. 6 needs for it [m4] and the thickness of such a leaf [m].
    pub constant: Option<(Constant, (f64, f64))>,
    /// Every rung, the last one is the answer.
    pub rungs: Vec<Rung>,
    /// Laws of the strengths in the quantities of the table.
    pub laws: Option<LawOutcome>,
    /// The surface.
    pub surface: Option<Surface>,
    /// Findings; the first says what can be predicted and what cannot.
    pub findings: Vec<Finding>,
}

/// What the constant of eq. 6 says.
pub fn of_constant(constant: &Constant, leaf: (f64, f64), thickness: f64) -> Vec<Finding> {
    let (mut list, mm3) = (Vec::new(), 1e9);
    if !constant.holds() {
        let needs = |a: &(String, f64, f64)| match a.1 <= a.2 {
            true => format!("that of {} lies in {:.3} to {:.3} mm3", a.0, a.1 * mm3, a.2 * mm3),
            false => format!("that of {} would have to lie above {:.3} and below {:.3} mm3", a.0, a.1 * mm3, a.2 * mm3),
        };
        let each: Vec<String> = constant.allowed.iter().map(needs).collect();
        let claim = format!("interference times contact area is not one constant within the rounding of the table: {}", each.join(", "));
        list.push(Finding { claim, number: constant.allowed_by_all.0 / constant.allowed_by_all.1, threshold: 1.0 });
    }
    if leaf.1 > THICK * thickness {
        let claim = format!(
            "the constant {:.3} mm3 means a leaf of {:.1} mm4, {:.1} mm thick at the declared width, in a housing of {:.1} mm",
            constant.value * mm3,
            leaf.0 * 1e12,
            leaf.1 * 1e3,
            thickness * 1e3
        );
        list.push(Finding { claim, number: leaf.1 / thickness, threshold: THICK });
    }
    list
}

/// Part of the housing's thickness beyond which a leaf is no leaf.
const THICK: f64 = 0.25;
/// Conditions of two cases that differ by at most this part of their spread are nearly equal.
const NEARLY: f64 = 0.15;
/// Energies at nearly equal conditions that differ by more than this part say that the condition is not all.
const UNLIKE: f64 = 0.05;

/// Of the pairs of cases at nearly equal `condition` (a value a case) the one whose energies differ most.
pub fn unlike(cases: &Cases, condition: &str, values: &[f64]) -> Option<Finding> {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let mut worst: Option<(usize, usize, f64)> = None;
    for a in 0..values.len() {
        for b in a + 1..values.len() {
            let ratio = energies::span(&[cases.cases[a].energy, cases.cases[b].energy]);
            let near = (values[a] - values[b]).abs() <= NEARLY * (high - low);
            if near && ratio > UNLIKE && worst.is_none_or(|w| ratio > w.2) {
                worst = Some((a, b, ratio));
            }
        }
    }
    let (a, b, ratio) = worst?;
    let (a, b) = (&cases.cases[a].name, &cases.cases[b].name);
    let claim = format!(
        "cases {a} and {b} have nearly equal {condition} and energies that differ by {:.0} %: {condition} is not all",
        100.0 * ratio
    );
    Some(Finding { claim, number: ratio, threshold: UNLIKE })
}

/// What the rungs say: error of the ratios and of W_D before and after, and how many values of the table lie in the intervals.
pub fn of_rungs(rungs: &[Rung]) -> Option<Finding> {
    let last = rungs.last()?;
    let error = |r: &Rung, quantity| r.cycles.first().and_then(|c| energies::rms(&c.predictions, quantity));
    let (after, absolute) = (error(last, Quantity::Ratio)?, error(last, Quantity::Dissipated)?);
    let all: Vec<bool> = last.cycles.iter().flat_map(|c| c.predictions.iter().filter_map(Prediction::holds)).collect();
    let inside = all.iter().filter(|h| **h).count();
    let before = rungs.first().filter(|_| rungs.len() > 1).and_then(|r| error(r, Quantity::Ratio));
    let added = if last.added.is_empty() { "the answer".to_string() } else { last.added.join(" and ") };
    let fell = before.map_or(String::new(), |b| format!(" instead of {:.1} % before {added} was added", 100.0 * b));
    let claim = format!(
        "nothing is fitted to the energies of the cases: their ratios are predicted {:.1} % off (root mean square){fell}, W_D itself {:.1} % off; \
         {inside} of {} values lie in their 95 % intervals",
        100.0 * after,
        100.0 * absolute,
        all.len()
    );
    Some(Finding { claim, number: after, threshold: before.unwrap_or(f64::INFINITY) })
}

/// That so many rungs on the way to the answer are not shown, since the time was over.
pub fn untold(rungs: usize) -> Finding {
    Finding {
        claim: format!(
            "the time was over: of {rungs} rung{} on the way to the answer the cases were not computed",
            if rungs == 1 { "" } else { "s" }
        ),
        number: rungs as f64,
        threshold: 0.0,
    }
}

/// That the model has a law over a condition which no two tests differ in: nothing tells its exponent, and the cases rest on it.
pub fn varies(conditions: &[String], unvaried: &[String]) -> Vec<Finding> {
    let of = |name: &String| Finding {
        claim: format!("the model has a law over {name}, and no two tests differ in {name}: nothing measured tells its coefficient"),
        number: 0.0,
        threshold: 1.0,
    };
    conditions.iter().filter(|c| unvaried.contains(c)).map(of).collect()
}
