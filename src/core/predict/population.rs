//! A population of assemblies whose parts deviate within their tolerances: distributions of W_D, W_s, stiffness and natural frequencies, yields,
//! contributions, synthesis.
//!
//! Deviations move the contact area ([`AreaLaw`]) and by eq. 6 the interference; the calibrated model over the area is a surrogate (`population::surrogate`) whose largest
//! error on exact runs is stated. What the fit does not know of the parameters, and the model's own error, move all assemblies together: they widen the
//! intervals of yield and quantiles, not the spread of the parts.

mod kept;
mod surrogate;

use nalgebra::DMatrix;
use statrs::distribution::Normal;

use crate::data::{Conditions, Control};
use crate::study::{Banded, Parts, Predicted, ToleranceSpec, ToleranceTable};
use crate::tolerance::contribution::contributions;
use crate::tolerance::{AreaLaw, Constant, Contribution, Pair, PartTolerance, Shape, ToleranceError, deviation};

use super::cases::conditions;
use super::{Calibrated, PredictError};

pub use kept::{Kept, Priced, Width};
pub use surrogate::Fit;

use surrogate::{LOST, MODES, STORED, Surrogate, Values, exact};

/// How much is computed.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Assemblies drawn per case.
    pub draws: usize,
    /// Exact runs the surrogate is held against.
    pub exact: usize,
    /// Seed.
    pub seed: u64,
}

/// A quantity of a case over its assemblies.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Case.
    pub case: String,
    /// Quantity.
    pub quantity: Banded,
    /// Mean over the assemblies, at the fitted parameters [SI].
    pub mean: f64,
    /// Standard deviation over the assemblies.
    pub std: f64,
    /// Standard deviation of the mean that parameters and model error leave; none where a parameter that matters is open.
    pub std_model: Option<f64>,
    /// 95 % of the assemblies, parameters and model error included.
    pub interval: (f64, f64),
    /// Part of the assemblies within the band; none without a band.
    pub reached: Option<f64>,
    /// Its 95 % interval: parameters, model error and the number of draws.
    pub reached_interval: Option<(f64, f64)>,
    /// Least and greatest value with all deviations within their tolerances.
    pub worst: (f64, f64),
    /// The model at the mean conditions of the row.
    pub at_mean: f64,
    /// The table's value.
    pub printed: Option<f64>,
}

/// What a tolerance contributes to the variance of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// Name of the tolerance; `rest` for what moves the area and stands in no column.
    pub tolerance: String,
    /// Quantity.
    pub quantity: Banded,
    /// Its indices.
    pub contribution: Contribution,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct Population {
    /// Every quantity of every case.
    pub distributions: Vec<Distribution>,
    /// Case the contributions are of.
    pub share_case: String,
    /// Contributions.
    pub shares: Vec<Share>,
    /// Widths that keep the yield, where asked for.
    pub kept: Option<Kept>,
    /// How the surrogate was made and how far it is off.
    pub fit: Fit,
    /// The constant of eq. 6 [m3], where the interference follows from the area.
    pub constant: Option<f64>,
    /// What to know of the numbers.
    pub notes: Vec<String>,
}

/// How ln of the area sets the conditions.
struct Driver<'a> {
    columns: [&'a str; 2],
    /// Condition, and the constant it is over the area, or none where it is the area.
    sets: Vec<(String, Option<f64>)>,
}

impl Driver<'_> {
    fn at(&self, base: &Conditions, log: f64) -> Conditions {
        let mut all = base.clone();
        for (name, constant) in &self.sets {
            if let Some(c) = all.get_mut(name) {
                c.value = constant.map_or(log.exp(), |k| k / log.exp());
            }
        }
        all
    }
}

fn driver<'a>(spec: &'a ToleranceSpec, table: &ToleranceTable, parts: &'a Parts) -> Result<Driver<'a>, PredictError> {
    let Some(assembly) = &parts.assembly else {
        let only = spec.conditions.iter().find(|c| c.of.len() == 2);
        let c = only.ok_or_else(|| asked("parts", "no condition of the cases has a least and a greatest value", "one such condition"))?;
        return Ok(Driver { columns: [&c.of[0], &c.of[1]], sets: vec![(c.name.clone(), None)] });
    };
    let [low, high] = &assembly.area;
    let mut sets: Vec<(String, Option<f64>)> =
        spec.conditions.iter().filter(|c| c.of.contains(low) || c.of.contains(high)).map(|c| (c.name.clone(), None)).collect();
    if let Some(name) = &assembly.interference {
        let of = spec.conditions.iter().find(|c| c.name == *name).map_or(&[][..], |c| c.of.as_slice());
        let constant = match (assembly.constant, of) {
            (Some(k), _) => k,
            // Eq. 6: the least interference stands at the greatest area.
            (None, [least, greatest]) => {
                let pair = |i: &String, a: &String| Pair { interference: i.clone(), area: a.clone(), resolution: (0.0, 0.0) };
                Constant::of(&table.cases, &[pair(least, high), pair(greatest, low)])?.value
            }
            _ => {
                return Err(asked(
                    "assembly",
                    "the cases state no two interferences to take the constant i A from",
                    "constant = \"2.8 mm3\"",
                ));
            }
        };
        sets.push((name.clone(), Some(constant)));
    }
    if sets.is_empty() {
        return Err(asked(
            "assembly",
            "no condition of the cases depends on the area",
            "a condition over the columns of the area, or interference",
        ));
    }
    Ok(Driver { columns: [low, high], sets })
}

fn asked(key: &str, message: &str, accepted: &str) -> PredictError {
    ToleranceError::Asked { key: key.into(), message: message.into(), accepted: accepted.into() }.into()
}

/// What every part of the computation needs.
struct Whole<'a> {
    spec: &'a ToleranceSpec,
    table: &'a ToleranceTable,
    parts: &'a Parts,
    /// The parts, and the rest behind them.
    all: Vec<PartTolerance>,
    /// Cholesky factor of their correlations.
    factor: DMatrix<f64>,
    /// Factor from the model's W_D to that of each case, scale included.
    lost: Vec<f64>,
    /// Range of force or displacement of the cycle, and what is controlled.
    range: (f64, Control),
    /// Surrogates, and which one a case has.
    surrogates: Vec<Surrogate>,
    of: Vec<usize>,
    /// Law of the area through each case's row, and its widths.
    laws: Vec<(AreaLaw, Vec<f64>)>,
}

impl Whole<'_> {
    fn quantities(&self) -> Vec<Banded> {
        let mut all = vec![Banded::Dissipated];
        if self.table.stored.is_some() || self.parts.bands.iter().any(|b| matches!(b.quantity, Banded::Stored | Banded::Stiffness)) {
            all.extend([Banded::Stored, Banded::Stiffness]);
        }
        all.extend(self.parts.modes.iter().map(|m| Banded::Frequency(*m)));
        all
    }

    /// The value of the surrogate that a quantity follows from.
    fn which(&self, quantity: Banded) -> usize {
        match quantity {
            Banded::Dissipated => LOST,
            Banded::Stored | Banded::Stiffness => STORED,
            Banded::Frequency(mode) => MODES + self.parts.modes.iter().position(|m| *m == mode).unwrap_or(0),
        }
    }

    /// A quantity by the surrogate's values.
    fn value(&self, case: usize, quantity: Banded, v: &dyn Values, x: f64) -> f64 {
        let value = v.at(self.which(quantity), x);
        match quantity {
            Banded::Dissipated => self.lost[case] * value,
            Banded::Stored => self.spec.scale * value,
            Banded::Stiffness => match self.range.1 {
                Control::Force => self.range.0.powi(2) / (2.0 * value),
                Control::Displacement => 2.0 * value / self.range.0.powi(2),
            },
            Banded::Frequency(_) => value,
        }
    }

    fn at(&self, case: usize, quantity: Banded, x: f64) -> f64 {
        self.value(case, quantity, &self.surrogates[self.of[case]], x)
    }

    /// Limits of a quantity; infinite where there is no band.
    fn band(&self, quantity: Banded) -> Option<(f64, f64)> {
        let mut bands = self.parts.bands.iter().filter(|b| b.quantity == quantity).map(|b| b.limits);
        let first = bands.next()?;
        Some(bands.fold(first, |a, b| (a.0.max(b.0), a.1.min(b.1))))
    }

    /// ln of the area of every draw.
    fn logs(&self, law: &AreaLaw, widths: &[f64], draws: &[f64]) -> Vec<f64> {
        draws.chunks_exact(self.all.len()).map(|s| law.log_area(widths, s)).collect()
    }
}

/// The population of `table`: `factors` turn the model's W_D of a case into that of the law found for its strengths, 1 where there is none.
pub fn population(
    spec: &ToleranceSpec,
    table: &ToleranceTable,
    parts: &Parts,
    model: &Calibrated,
    factors: &[f64],
    how: Asked,
) -> Result<Population, PredictError> {
    let Predicted::Cycle { limits, frequency, control, .. } = &table.cycle.quantity else {
        return Err(asked("cycle", "the cases have no cycle", "[tolerance.cycle]"));
    };
    let cases = &table.cases.cases;
    let driver = driver(spec, table, parts)?;
    let value = |k: usize, name: &str| cases[k].values.get(name).copied().unwrap_or(f64::NAN);
    let ends: Vec<_> = (0..cases.len())
        .map(|k| {
            let widths: Vec<f64> = parts.parts.iter().map(|p| value(k, &p.name)).collect();
            (widths, value(k, driver.columns[0]), value(k, driver.columns[1]))
        })
        .collect();
    if let Some(k) = ends.iter().position(|e| e.1 >= e.2) {
        let message = format!("{} is not below {}", driver.columns[0], driver.columns[1]);
        let accepted = "the least value first".to_string();
        return Err(PredictError::Case { case: cases[k].name.clone(), message, accepted, place: cases[k].place.clone() });
    }
    let law = AreaLaw::fit(&ends);
    let rest = PartTolerance { name: "rest".into(), shape: Shape::Normal, cp: 1.0, cpk: 1.0, side: 1.0, cost: None, range: (0.0, 0.0) };
    let all: Vec<PartTolerance> = parts.parts.iter().cloned().chain([rest]).collect();
    let factor = deviation::correlated(all.len(), &parts.correlations)?;
    let draws = deviation::draws(&all, &factor, how.draws, how.seed);
    let mut whole = Whole {
        spec,
        table,
        parts,
        all,
        factor,
        lost: factors.iter().map(|f| f * spec.scale).collect(),
        range: (limits.1 - limits.0, *control),
        surrogates: vec![],
        of: vec![],
        laws: ends.iter().map(|e| (law.through(e), e.0.clone())).collect(),
    };
    let logs: Vec<Vec<f64>> = whole.laws.iter().map(|(l, w)| whole.logs(l, w, &draws)).collect();
    let mut domain = bounds(logs.iter().flatten().copied());
    for (l, w) in &whole.laws {
        let (low, high) = l.ends(w);
        domain = (domain.0.min(low), domain.1.max(high));
    }
    if let Some(widest) = kept::widest(&whole) {
        let (low, high) = bounds(whole.logs(&widest.0, &widest.1, &draws).into_iter());
        domain = (domain.0.min(low), domain.1.max(high));
    }
    // Cases that differ in conditions beside the area have surrogates of their own.
    let free_of = |k: usize| {
        let mut c = conditions(spec, table, k, *frequency);
        c.retain(|name, _| !driver.sets.iter().any(|s| s.0 == *name));
        c.iter().map(|(n, c)| (n.clone(), c.value)).collect::<Vec<_>>()
    };
    let mut groups: Vec<(usize, Vec<(String, f64)>)> = Vec::new();
    for k in 0..cases.len() {
        let own = free_of(k);
        let known = groups.iter().position(|g| g.1 == own);
        whole.of.push(known.unwrap_or(groups.len()));
        if known.is_none() {
            groups.push((k, own));
        }
    }
    let error = super::model_error(spec, model)?;
    let mut fit = Fit::default();
    for (g, (k, _)) in groups.iter().enumerate() {
        let base = conditions(spec, table, *k, *frequency);
        let at = |x: f64| driver.at(&base, x);
        let own: Vec<f64> = (0..cases.len()).filter(|k| whole.of[*k] == g).flat_map(|k| logs[k].iter().copied()).collect();
        let made = Surrogate::new(table, &parts.modes, model, error, domain, &at, &own, how)?;
        fit = fit.worse(made.1);
        whole.surrogates.push(made.0);
    }
    unreachable(&whole, domain)?;
    let rows: Vec<_> = (0..cases.len()).map(|k| (cases[k].name.clone(), conditions(spec, table, k, *frequency))).collect();
    let at_mean = exact(table, &parts.modes, model.system, &[], rows)?;
    let of_case = |k: usize| -> Vec<Distribution> {
        let mean = surrogate::Constant(at_mean[k].iter().map(|f| f.value).collect());
        whole.quantities().into_iter().map(|q| distribution(&whole, k, q, &logs[k], &mean, how)).collect()
    };
    let distributions = crate::parallel::over(cases.len(), of_case).concat();
    let share_case = match &parts.synthesis {
        Some(s) => crate::tolerance::energies::find(&table.cases, &s.case)?,
        // Where tolerances matter most.
        None => {
            let sum = |k: &usize| ends[*k].0.iter().sum::<f64>();
            (0..cases.len()).max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap_or(0)
        }
    };
    let shares = whole.quantities().into_iter().flat_map(|q| shares(&whole, share_case, q, how.seed)).collect();
    let kept = parts.synthesis.as_ref().map(|s| kept::kept(&whole, share_case, s, &draws, how));
    let constant = driver.sets.iter().find_map(|s| s.1);
    let mut notes = notes(&whole, &law, &driver, &fit);
    notes.extend(off_the_law(&whole, &driver, *frequency));
    Ok(Population { distributions, share_case: cases[share_case].name.clone(), shares, kept, fit, constant, notes })
}

fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
}

fn notes(whole: &Whole, law: &AreaLaw, driver: &Driver, fit: &Fit) -> Vec<String> {
    let mut notes = vec![format!(
        "ln {} and ln {} of the cases are linear in the tolerances to {:.3}; every case is taken through its own row",
        driver.columns[0], driver.columns[1], law.off
    )];
    let name = |k: &usize| whole.all[*k].name.as_str();
    for group in law.together.iter().filter(|g| g.len() > 1) {
        let names: Vec<&str> = group.iter().map(name).collect();
        notes.push(format!("the cases do not tell {} apart: they move the area by the same part per width", names.join(", ")));
    }
    if !whole.parts.correlations.is_empty() {
        notes.push("contributions are those of independent deviations; the distributions are correlated".into());
    }
    if !whole.parts.modes.is_empty() {
        notes.push("the model's own error of a natural frequency is not known from loops and is no part of its intervals".into());
    }
    if fit.open {
        notes.push("a parameter that matters is not identified: what the fit leaves open of it is no part of the intervals".into());
    }
    notes
}

/// How far the mean conditions of the rows, at which the table's energies stand, lie from eq. 6.
fn off_the_law(whole: &Whole, driver: &Driver, frequency: f64) -> Option<String> {
    let (name, constant) = driver.sets.iter().find_map(|s| Some((&s.0, s.1?)))?;
    let cases = &whole.table.cases.cases;
    let product = |k: usize| -> Option<(usize, f64)> {
        let area = driver.columns.iter().filter_map(|c| cases[k].values.get(*c)).sum::<f64>() / 2.0;
        Some((k, conditions(whole.spec, whole.table, k, frequency).get(name)?.value * area / constant))
    };
    let (k, worst) = (0..cases.len()).filter_map(product).max_by(|a, b| a.1.ln().abs().total_cmp(&b.1.ln().abs()))?;
    (worst.ln().abs() > 0.1).then(|| {
        format!(
            "the means of {name} and area of a row are no state of one assembly: in case {} their product is {worst:.1} times the constant of eq. 6; `at mean` and the \
             table stand there, the distributions on eq. 6",
            cases[k].name
        )
    })
}

/// A band that no state of any assembly keeps.
fn unreachable(whole: &Whole, domain: (f64, f64)) -> Result<(), PredictError> {
    const STEPS: usize = 400;
    for band in &whole.parts.bands {
        let at = |k: usize| domain.0 + (domain.1 - domain.0) * k as f64 / STEPS as f64;
        let values = (0..whole.of.len()).flat_map(|c| (0..=STEPS).map(move |k| whole.at(c, band.quantity, at(k))));
        let (low, high) = bounds(values);
        if high < band.limits.0 || low > band.limits.1 {
            let print = |v: f64| band.unit.print(significant(v / band.unit.factor) * band.unit.factor);
            let message = format!(
                "nothing meets the band of {}: whatever the deviations, the model gives {} to {}",
                band.quantity.name(),
                print(low),
                print(high)
            );
            let accepted = format!("a band that reaches into {} to {}", print(low), print(high));
            return Err(ToleranceError::Asked { key: format!("bands (line {})", band.line), message, accepted }.into());
        }
    }
    Ok(())
}

/// Rounded to four digits.
fn significant(v: f64) -> f64 {
    let digits = 10f64.powi(3 - v.abs().max(1e-300).log10().floor() as i32);
    (v * digits).round() / digits
}

/// Points of a case's distribution that parameters are carried through.
const QUANTILES: usize = 800;
/// Draws of parameters and model error.
const REPLICATES: usize = 200;

fn distribution(whole: &Whole, case: usize, quantity: Banded, logs: &[f64], at_mean: &surrogate::Constant, how: Asked) -> Distribution {
    let n = logs.len() as f64;
    let surrogate = &whole.surrogates[whole.of[case]];
    let values: Vec<f64> = logs.iter().map(|x| whole.at(case, quantity, *x)).collect();
    let mean = values.iter().sum::<f64>() / n;
    let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
    let band = whole.band(quantity);
    let within = |v: &f64, b: (f64, f64)| (b.0..=b.1).contains(v);
    let reached = band.map(|b| values.iter().filter(|v| within(v, b)).count() as f64 / n);
    let mut sorted = logs.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let points = QUANTILES.min(sorted.len());
    let at: Vec<f64> = (0..points).map(|k| sorted[((k as f64 + 0.5) / points as f64 * n) as usize]).collect();
    // The base seed is the same for every case: parameters are common to all assemblies.
    let (mut means, mut yields, mut pool) = (vec![], vec![], vec![]);
    for replicate in surrogate.replicates(REPLICATES, how.seed) {
        let own: Vec<f64> = at.iter().map(|x| whole.value(case, quantity, &replicate, *x)).collect();
        means.push(own.iter().sum::<f64>() / points as f64);
        if let Some(b) = band {
            yields.push(own.iter().filter(|v| within(v, b)).count() as f64 / points as f64);
        }
        pool.extend(own);
    }
    let centre = means.iter().sum::<f64>() / means.len() as f64;
    let std_model = (means.iter().map(|m| (m - centre).powi(2)).sum::<f64>() / (means.len() - 1) as f64).sqrt();
    let quantile = |all: &mut Vec<f64>, p: f64| {
        all.sort_unstable_by(f64::total_cmp);
        all[((p * all.len() as f64) as usize).min(all.len() - 1)]
    };
    let interval = (quantile(&mut pool, 0.025), quantile(&mut pool, 0.975));
    let reached_interval = reached.map(|r| {
        // Yields of the replicates are counted on fewer points; what they are off by from each other is what counts.
        let own = band.map_or(r, |b| at.iter().filter(|x| within(&whole.at(case, quantity, **x), b)).count() as f64 / points as f64);
        let (low, high) = (quantile(&mut yields, 0.025) - own, quantile(&mut yields, 0.975) - own);
        let sampling = wilson(r, logs.len());
        ((sampling.0 + low.min(0.0)).max(0.0), (sampling.1 + high.max(0.0)).min(1.0))
    });
    let (law, widths) = &whole.laws[case];
    let (low, high) = law.ends(widths);
    let worst = bounds((0..=200).map(|k| whole.at(case, quantity, low + (high - low) * f64::from(k) / 200.0)));
    let row = &whole.table.cases.cases[case];
    Distribution {
        case: row.name.clone(),
        quantity,
        mean,
        std,
        std_model: (!surrogate.open).then_some(std_model),
        interval,
        reached,
        reached_interval,
        worst,
        at_mean: whole.value(case, quantity, at_mean, 0.0),
        printed: match quantity {
            Banded::Dissipated => Some(row.energy),
            Banded::Stored => row.stored,
            Banded::Stiffness | Banded::Frequency(_) => None,
        },
    }
}

/// 95 % interval of a proportion (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209).
pub fn wilson(p: f64, n: usize) -> (f64, f64) {
    const Z: f64 = 1.959_964;
    let n = n as f64;
    let (centre, scale) = (p + Z * Z / (2.0 * n), 1.0 + Z * Z / n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    (((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0))
}

/// Points of each of the twelve shifts.
const POINTS: usize = 2048;

fn shares(whole: &Whole, case: usize, quantity: Banded, seed: u64) -> Vec<Share> {
    let (law, widths) = &whole.laws[case];
    let normal = Normal::standard();
    let f = |u: &[f64]| {
        let s: Vec<f64> = whole.all.iter().zip(u).map(|(p, u)| p.unit(*u, &normal)).collect();
        whole.at(case, quantity, law.log_area(widths, &s))
    };
    let found = contributions(whole.all.len(), POINTS, seed, &f);
    let named = whole.all.iter().zip(found).filter(|(p, c)| p.name != "rest" || c.total > 0.0);
    named.map(|(p, contribution)| Share { tolerance: p.name.clone(), quantity, contribution }).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn wilson_has_the_printed_values() {
        // 18 of 20 (Newcombe, Stat. Med. 17 (1998) 857 gives such tables): 0.6990 to 0.9721.
        let (low, high) = super::wilson(0.9, 20);
        assert!((low - 0.6990).abs() < 1e-4 && (high - 0.9721).abs() < 1e-4, "{low} {high}");
        let (low, high) = super::wilson(1.0, 1000);
        assert!(low > 0.995 && high == 1.0);
    }
}
