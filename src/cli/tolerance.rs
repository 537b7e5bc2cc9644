//! `misfit tolerance`: tolerances of parts to distributions of energies and stiffness, their contributions, and the loosest that keep a yield.

use std::time::Instant;

use schemars::JsonSchema;
use serde::Serialize;

use crate::diagnose;
use crate::diagnose::results::SplitName;
use crate::predict::population::{self, Asked, Population};
use crate::predict::{self, Calibrated};
use crate::study::{Banded, Study, ToleranceSpec};
use crate::units::Unit;

use super::session::{Common, Session};
use super::table::{percent, significant, table};
use super::{Outcome, fit};
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Assemblies drawn per case
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(100..=20_000_000))]
    draws: u32,
    /// Exact runs of the model that its surrogate is held against
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    exact: u32,
}

/// Result of `tolerance`.
#[derive(Serialize, JsonSchema)]
pub(super) struct Printed {
    /// Name of the study.
    study: String,
    /// Every quantity of every case.
    cases: Vec<CaseResult>,
    /// Contributions to the variance, of one case.
    contributions: Vec<ContributionResult>,
    /// The loosest tolerances; none where the study does not ask for them.
    synthesis: Option<SynthesisResult>,
    /// The surrogate of the model.
    surrogate: SurrogateResult,
    /// Assemblies drawn per case.
    draws: usize,
    /// The constant i A of eq. 6 [m3], where the interference follows from the area.
    constant: Option<f64>,
    /// What to know of the numbers.
    notes: Vec<String>,
    /// Wall time of everything after the fit [s].
    assemblies_s: f64,
}

/// A quantity of a case over its assemblies.
#[derive(Serialize, JsonSchema)]
pub(super) struct CaseResult {
    /// Case.
    case: String,
    /// W_D, W_s, stiffness, natural_frequency.
    quantity: &'static str,
    /// Mode of a natural frequency, from 1.
    mode: Option<u32>,
    /// SI unit.
    unit: String,
    /// Mean over the assemblies.
    mean: f64,
    /// Standard deviation over the assemblies.
    std: f64,
    /// Part of the assemblies within the band; none without a band.
    #[serde(rename = "yield")]
    reached: Option<f64>,
    /// Its 95 % interval: parameters, model error, number of draws.
    yield_interval: Option<(f64, f64)>,
    /// Standard deviation of the mean by parameters and model error.
    std_model: Option<f64>,
    /// 95 % of the assemblies, parameters and model error included.
    interval: (f64, f64),
    /// Least and greatest value with all deviations within their tolerances.
    worst_case: (f64, f64),
    /// The model at the mean conditions of the row.
    at_mean: f64,
    /// The table's value.
    reference: Option<f64>,
    /// Whether the table's value lies in the interval.
    inside: Option<bool>,
}

/// What a tolerance contributes.
#[derive(Serialize, JsonSchema)]
pub(super) struct ContributionResult {
    /// Name of the tolerance; `rest` for what moves the area and stands in no column.
    tolerance: String,
    /// Quantity.
    quantity: &'static str,
    /// Mode of a natural frequency, from 1.
    mode: Option<u32>,
    /// First-order Sobol index.
    first: f64,
    /// Total Sobol index.
    total: f64,
    /// 95 % interval of the first-order index.
    first_interval: (f64, f64),
    /// 95 % interval of the total index.
    total_interval: (f64, f64),
    /// Case it is of.
    case: String,
}

/// The loosest tolerances that keep a yield.
#[derive(Serialize, JsonSchema)]
pub(super) struct SynthesisResult {
    /// Whether there are such tolerances.
    feasible: bool,
    /// What stands in the way, where there are none.
    in_the_way: Option<String>,
    /// Case it began with.
    case: String,
    /// Yield asked for.
    asked: f64,
    /// Yield over all bands on draws of their own.
    #[serde(rename = "yield")]
    reached: f64,
    /// Its 95 % interval by the number of draws.
    yield_interval: (f64, f64),
    /// Yield of the case as it stands.
    yield_before: f64,
    /// Cost, sum of c / width, after.
    cost: f64,
    /// Cost of the case as it stands.
    cost_before: f64,
    /// Conic programmes solved.
    programmes: usize,
    /// Widths.
    tolerances: Vec<WidthResult>,
    /// What other yields cost, rising, as far as they are within reach; from at most 20,000 draws.
    curve: Vec<PricedResult>,
}

/// The cost of the loosest tolerances that keep a yield.
#[derive(Serialize, JsonSchema)]
pub(super) struct PricedResult {
    /// Yield asked for.
    asked: f64,
    /// Yield on draws of their own.
    #[serde(rename = "yield")]
    reached: f64,
    /// Cost, sum of c / width.
    cost: f64,
}

/// A chosen width.
#[derive(Serialize, JsonSchema)]
pub(super) struct WidthResult {
    /// Name.
    tolerance: String,
    /// Unit of the widths.
    unit: &'static str,
    /// Width.
    width: f64,
    /// Width of the case.
    before: f64,
    /// Its cost.
    cost: f64,
}

/// How far the surrogate is off.
#[derive(Serialize, JsonSchema)]
pub(super) struct SurrogateResult {
    /// Points at which the model was computed.
    nodes: usize,
    /// Exact runs it was held against.
    exact: usize,
    /// Largest relative error of W_D there.
    error: f64,
    /// Largest relative error of W_s there.
    error_stored: f64,
    /// Largest relative error of a natural frequency there; 0 where none is asked for.
    error_frequency: f64,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let asked = session.study()?;
    let data = session.common.data.as_deref();
    // The answer of the way is what the tolerances act on; they stand in the study that was asked for.
    let last = asked.rungs.last().map(|path| Study::load(path, data)).transpose()?;
    let study = last.as_ref().unwrap_or(&asked);
    let stated = |s: &Study| s.tolerance.clone().filter(|t| t.parts.is_some());
    let Some(spec) = stated(&asked).or_else(|| stated(study)) else {
        return Err(Failure::new(
            "study",
            asked.file.display().to_string(),
            "the study states no tolerances of parts",
            "[tolerance] with [[tolerance.parts]]: name = a column of the cases, distribution = \"normal\", ...",
        ));
    };
    let case = predict::case(study, last.is_some(), session.common.seed)?;
    session.progress.say("fit");
    let (_, fitted, result) = diagnose::fit(&case, &SplitName::ALL, &session.monitor())?;
    let spread = fitted.uncertainty()?;
    let model = Calibrated::of(study, &fitted, &spread.covariance);
    // The law of the strengths stands in the study of the answer.
    let own = study.tolerance.as_ref().filter(|t| !t.libraries.is_empty()).unwrap_or(&spec);
    session.progress.say("law of the strengths");
    let factors = predict::factors(own, spec.scale, &model, session.common.seed)?;
    session.progress.say("assemblies");
    let how = Asked { draws: args.draws as usize, exact: args.exact as usize, seed: session.common.seed };
    let (Some(parts), Some(cases)) = (&spec.parts, spec.tables.first()) else {
        return Err(Failure::new("study", "tolerance", "no table of cases", "test = \"...\""));
    };
    let begun = Instant::now();
    let found = population::population(&spec, cases, parts, &model, &factors, how)?;
    let assemblies_s = begun.elapsed().as_secs_f64();
    session.progress.end();
    let folder = session.folder(&asked, "tolerance")?;
    folder.study(study, &fitted.system)?;
    let page = crate::report::population(&asked.title, &first(&found), &found, &parts.bands, &|q| shown(&spec, q));
    folder.write(super::report::FILE, page.as_bytes())?;
    let value = fit::json(&printed(&asked.title, &spec, &found, how, assemblies_s), &folder)?;
    folder.result(&value)?;
    let text = format!("{}\n\n{}Run: {}\n", asked.title, told(&spec, &found, how), folder.path.display());
    Ok(Outcome { json: value, text, code: fit::code(&result.termination) })
}

/// SI unit of a quantity.
fn unit(spec: &ToleranceSpec, quantity: Banded) -> String {
    match quantity {
        Banded::Stiffness => {
            let rotational = spec.tables.first().is_some_and(|t| match &t.cycle.quantity {
                crate::study::Predicted::Cycle { at, .. } => ["theta", "phi", "psi"].iter().any(|a| at.ends_with(a)),
                _ => false,
            });
            if rotational { "N m/rad".into() } else { "N/m".into() }
        }
        Banded::Frequency(_) => "Hz".into(),
        Banded::Dissipated | Banded::Stored => "J".into(),
    }
}

fn printed(title: &str, spec: &ToleranceSpec, found: &Population, how: Asked, assemblies_s: f64) -> Printed {
    let case = |d: &population::Distribution| CaseResult {
        case: d.case.clone(),
        quantity: d.quantity.word(),
        mode: d.quantity.mode(),
        unit: unit(spec, d.quantity),
        mean: d.mean,
        std: d.std,
        reached: d.reached,
        yield_interval: d.reached_interval,
        std_model: d.std_model,
        interval: d.interval,
        worst_case: d.worst,
        at_mean: d.at_mean,
        reference: d.printed,
        inside: d.printed.map(|p| (d.interval.0..=d.interval.1).contains(&p)),
    };
    let share = |s: &population::Share| {
        let c = s.contribution;
        ContributionResult {
            tolerance: s.tolerance.clone(),
            quantity: s.quantity.word(),
            mode: s.quantity.mode(),
            first: c.first,
            total: c.total,
            first_interval: (c.first - c.first_error, c.first + c.first_error),
            total_interval: (c.total - c.total_error, c.total + c.total_error),
            case: found.share_case.clone(),
        }
    };
    let synthesis = found.kept.as_ref().map(|k| SynthesisResult {
        feasible: k.in_the_way.is_none(),
        in_the_way: k.in_the_way.clone(),
        case: k.case.clone(),
        asked: k.asked,
        reached: k.reached.0,
        yield_interval: k.reached.1,
        yield_before: k.before,
        cost: k.cost.1,
        cost_before: k.cost.0,
        programmes: k.programmes,
        tolerances: k
            .widths
            .iter()
            .map(|w| WidthResult { tolerance: w.name.clone(), unit: "m", width: w.width, before: w.before, cost: w.cost })
            .collect(),
        curve: k.curve.iter().map(|p| PricedResult { asked: p.asked, reached: p.reached, cost: p.cost }).collect(),
    });
    Printed {
        study: title.into(),
        cases: found.distributions.iter().map(case).collect(),
        contributions: found.shares.iter().map(share).collect(),
        synthesis,
        surrogate: SurrogateResult {
            nodes: found.fit.nodes,
            exact: found.fit.exact,
            error: found.fit.lost,
            error_stored: found.fit.stored,
            error_frequency: found.fit.frequency,
        },
        draws: how.draws,
        constant: found.constant,
        notes: found.notes.clone(),
        assemblies_s,
    }
}

/// Unit a quantity is printed in: that of its band, or of the table.
fn shown(spec: &ToleranceSpec, quantity: Banded) -> (String, f64) {
    let of = |u: &Unit| (u.symbol.clone(), u.factor);
    let band = spec.parts.iter().flat_map(|p| &p.bands).find(|b| b.quantity == quantity);
    match (band, quantity) {
        (Some(b), _) => of(&b.unit),
        (None, Banded::Stiffness | Banded::Frequency(_)) => (unit(spec, quantity), 1.0),
        (None, _) => of(&spec.tables[0].cases.energy_unit),
    }
}

/// The answer in a sentence.
fn first(found: &Population) -> String {
    match &found.kept {
        Some(k) if k.in_the_way.is_none() => format!(
            "Tolerances for a yield of {:.2} % exist: {:.2} % keep the bands, at {} of the cost of case {}.",
            100.0 * k.asked,
            100.0 * k.reached.0,
            percent(k.cost.1 / k.cost.0),
            k.case
        ),
        Some(k) => format!(
            "No tolerances within their ranges give a yield of {:.2} %: {}.",
            100.0 * k.asked,
            k.in_the_way.as_deref().unwrap_or("-")
        ),
        None => match found.distributions.iter().filter_map(|d| Some((d, d.reached?))).min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((d, r)) => format!("The least yield is {:.2} %: {} of case {}.", 100.0 * r, d.quantity.name(), d.case),
            None => "No band is stated; these are the distributions.".into(),
        },
    }
}

fn told(spec: &ToleranceSpec, found: &Population, how: Asked) -> String {
    let mut text = format!("{}\n\n", first(found));
    let row = |d: &population::Distribution| {
        let (symbol, factor) = shown(spec, d.quantity);
        let v = |v: f64| significant(v / factor, 4);
        vec![
            d.case.clone(),
            d.quantity.name(),
            v(d.mean),
            significant(d.std / factor, 3),
            d.std_model.map_or("-".into(), |s| significant(s / factor, 2)),
            format!("{} to {}", v(d.interval.0), v(d.interval.1)),
            d.reached.map_or("-".into(), |r| format!("{:.2} %", 100.0 * r)),
            d.reached_interval.map_or("-".into(), |i| format!("{:.2} to {:.2} %", 100.0 * i.0, 100.0 * i.1)),
            format!("{} to {}", v(d.worst.0), v(d.worst.1)),
            v(d.at_mean),
            d.printed.map_or("-".into(), v),
            symbol,
        ]
    };
    let rows: Vec<Vec<String>> = found.distributions.iter().map(row).collect();
    let header = ["case", "quantity", "mean", "std", "of model", "95 %", "yield", "95 % of it", "worst case", "at mean", "table", "unit"];
    text += &table(&header, &rows);
    text += &format!("\nContributions to the variance in case {}\n\n", found.share_case);
    let row = |s: &population::Share| {
        let c = s.contribution;
        let with = |v: f64, e: f64| format!("{:.1} +- {:.1} %", 100.0 * v, 100.0 * e);
        vec![s.tolerance.clone(), s.quantity.name(), with(c.first, c.first_error), with(c.total, c.total_error)]
    };
    text += &table(&["tolerance", "quantity", "alone", "with all it acts with"], &found.shares.iter().map(row).collect::<Vec<_>>());
    if let Some(k) = &found.kept {
        let row = |w: &population::Width| {
            vec![w.name.clone(), significant(1e3 * w.before, 4), significant(1e3 * w.width, 4), "mm".into(), significant(w.cost, 3)]
        };
        text += &format!("\nTolerances, from case {}\n\n", k.case);
        text += &table(&["tolerance", "before", "after", "unit", "cost"], &k.widths.iter().map(row).collect::<Vec<_>>());
        text += &format!(
            "Yield {:.3} % ({:.3} to {:.3} % by the number of draws), {:.3} % before; {} conic programmes.\n",
            100.0 * k.reached.0,
            100.0 * k.reached.1.0,
            100.0 * k.reached.1.1,
            100.0 * k.before,
            k.programmes
        );
    }
    text += &format!(
        "\n{} assemblies a case through a surrogate of {} runs; on {} exact runs it is off by {} of W_D at most.\n",
        how.draws,
        found.fit.nodes,
        found.fit.exact,
        percent(found.fit.lost)
    );
    for note in &found.notes {
        text += &format!("Note: {note}.\n");
    }
    text
}
