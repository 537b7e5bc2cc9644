//! Everything at once: the constant of eq. 6, the energies under the laws, the search, the surface, and what they say in words.

use super::energies::span;
use super::{Cases, Constant, Energies, Found, Housing, Pair, Predicted, Surface, ToleranceError, Verdict, search};

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

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The cases.
    pub cases: &'a Cases,
    /// Index of the case that ratios refer to.
    pub reference: usize,
    /// Interferences with their areas.
    pub pairs: &'a [Pair],
    /// Leaf and housing.
    pub housing: &'a Housing,
    /// Quantities of the laws.
    pub quantities: &'a [String],
    /// Terms of a law at most.
    pub terms: usize,
    /// Permutations.
    pub permutations: usize,
    /// Tolerances of the surface.
    pub surface: &'a [String; 2],
    /// Seed of the permutations.
    pub seed: u64,
    /// Energies of the model, case by case.
    pub predicted: &'a [Predicted],
    /// dF dx of the model's cycle [J], the rectangle that encloses any loop between its limits.
    pub enclosing: f64,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The constant `i A`.
    pub constant: Constant,
    /// Moment of area of the leaf that eq. 6 needs for it [m4], and the thickness of such a leaf [m].
    pub leaf: (f64, f64),
    /// Energies under the laws.
    pub energies: Energies,
    /// Searches with one term at most, two, ...
    pub searches: Vec<Found>,
    /// The surface, with the law of the last search.
    pub surface: Surface,
    /// Findings.
    pub findings: Vec<Finding>,
}

/// Points of the surface from one case to the next.
const FINER: usize = 8;
/// Interferences that differ by at most this many printed digits are nearly equal.
const NEARLY: f64 = 2.5;
/// Energies at nearly equal interferences that differ by more than this part say that the interference is not all.
const UNLIKE: f64 = 0.25;

/// Answers a question; `deviation` as for [`Energies::of`].
pub fn answer(ask: &Question, deviation: impl Fn(f64, &[f64]) -> Option<f64>) -> Result<Outcome, ToleranceError> {
    let constant = Constant::of(ask.cases, ask.pairs)?;
    let inertia = ask.housing.moment_of_area(constant.value);
    let leaf = (inertia, ask.housing.leaf_thickness(inertia));
    let energies = Energies::of(ask.cases, ask.reference, ask.predicted, deviation)?;
    let mut searches = Vec::new();
    let mut last = None;
    for terms in 1..=ask.terms.max(1) {
        let (laws, found) = search::search(ask.cases, ask.quantities, terms, ask.permutations, ask.seed)?;
        last = Some((laws, found.law.clone()));
        searches.push(found);
    }
    let (laws, law) = last.ok_or(ToleranceError::TooFew { what: "a law".into(), found: 0, needed: 1 })?;
    let scaled: Vec<f64> = energies.cases.iter().map(|c| c.scaled).collect();
    let axes = [ask.surface[0].as_str(), ask.surface[1].as_str()];
    let surface = Surface::of(ask.cases, axes, ask.quantities, &scaled, &laws, &law, FINER)?;
    let findings = findings(ask, &constant, leaf, &energies, &searches);
    Ok(Outcome { constant, leaf, energies, searches, surface, findings })
}

fn findings(ask: &Question, constant: &Constant, leaf: (f64, f64), energies: &Energies, searches: &[Found]) -> Vec<Finding> {
    let mut list = Vec::new();
    let mut add = |claim: String, number: f64, threshold: f64| list.push(Finding { claim, number, threshold });
    let mm3 = 1e9;
    if !constant.holds() {
        let needs = |a: &(String, f64, f64)| match a.1 <= a.2 {
            true => format!("that of {} lies in {:.3} to {:.3} mm3", a.0, a.1 * mm3, a.2 * mm3),
            false => format!("that of {} would have to lie above {:.3} and below {:.3} mm3", a.0, a.1 * mm3, a.2 * mm3),
        };
        let each: Vec<String> = constant.allowed.iter().map(needs).collect();
        let claim = format!("interference times contact area is not one constant within the rounding of the table: {}", each.join(", "));
        add(claim, constant.allowed_by_all.0 / constant.allowed_by_all.1, 1.0);
    }
    let claim = format!(
        "the constant {:.3} mm3 means a leaf of {:.1} mm4, {:.1} mm thick at the declared width, in a housing of {:.1} mm",
        constant.value * mm3,
        leaf.0 * 1e12,
        leaf.1 * 1e3,
        ask.housing.thickness * 1e3
    );
    if leaf.1 > 0.25 * ask.housing.thickness {
        add(claim, leaf.1 / ask.housing.thickness, 0.25);
    }
    let largest = energies.cases.iter().fold((0.0, ""), |m, c| if c.energy > m.0 { (c.energy, c.case.as_str()) } else { m });
    if largest.0 > ask.enclosing {
        let claim = format!(
            "case {} dissipates {:.1} mJ, more than dF dx = {:.1} mJ, which encloses any loop between the declared limits: the energies are of \
             another test, and only their ratios can be compared",
            largest.1,
            largest.0 * 1e3,
            ask.enclosing * 1e3
        );
        add(claim, largest.0 / ask.enclosing, 1.0);
    }
    let (middle, ends) = energies.span;
    if ends < energies.printed_span {
        let claim = format!(
            "the laws in the interference span {:.1} % over the cases ({:.1} % with the ends of the interferences), the energies {:.0} %",
            100.0 * middle,
            100.0 * ends,
            100.0 * energies.printed_span
        );
        add(claim, energies.printed_span / ends, 1.0);
    }
    if let Some((a, b, ratio)) = unlike(ask) {
        let claim = format!(
            "cases {a} and {b} have nearly equal interferences and energies that differ by {:.0} %: the interference is not all",
            100.0 * ratio
        );
        add(claim, ratio, UNLIKE);
    }
    for found in searches {
        let said = match found.verdict {
            Verdict::CannotTell => format!("{} numbers cannot tell a law", found.errors.len()),
            Verdict::SomeLaw => "the energies depend on these quantities, but the folds do not agree on the law".into(),
            Verdict::Law => format!("every fold takes {}", found.words),
        };
        let terms = if found.terms == 1 { "1 term".to_string() } else { format!("1 to {} terms", found.terms) };
        let claim = format!(
            "laws of {terms} ({} searched in every fold): left out {:.1} % off, {:.1} % without a law; {:.1} % of permuted tables do as well: {said}",
            found.laws,
            100.0 * found.relative,
            100.0 * found.no_law,
            100.0 * found.p_value
        );
        add(claim, found.p_value, super::search::LEVEL);
    }
    list
}

/// Of the pairs of cases with nearly equal interferences the one whose energies differ most.
fn unlike(ask: &Question) -> Option<(String, String, f64)> {
    let (cases, mut worst) = (&ask.cases.cases, None::<(String, String, f64)>);
    for (k, a) in cases.iter().enumerate() {
        for b in &cases[k + 1..] {
            let near = ask.pairs.iter().all(|p| {
                let of = |c: &super::Case| c.values.get(&p.interference).copied().unwrap_or(f64::NAN);
                (of(a) - of(b)).abs() <= NEARLY * p.resolution.0
            });
            let ratio = span(&[a.energy, b.energy]);
            if near && ratio > UNLIKE && worst.as_ref().is_none_or(|w| ratio > w.2) {
                worst = Some((a.name.clone(), b.name.clone(), ratio));
            }
        }
    }
    worst
}
